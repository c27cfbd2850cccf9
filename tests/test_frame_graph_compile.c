// The frame graph's plan: order, culling, lifetimes, slots, barriers and the sentence of every error. Needs no GPU.
#include "engine/frame_graph_compile.h"
#include "test.h"

static arena memory;
static char error[512];

// ---- Declarations, short

#define COMPUTE_STAGE VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT
#define FRAGMENT_STAGE VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT
#define TRANSFER_STAGE VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT
#define HOST_STAGE VK_PIPELINE_STAGE_2_HOST_BIT
#define COLOR_STAGE VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT

static const frame_graph_resource_desc IMAGE = {
    .kind = FRAME_GRAPH_IMAGE, .format = VK_FORMAT_R16G16B16A16_SFLOAT, .width = 64, .height = 32};
static const frame_graph_resource_desc DEPTH = {
    .kind = FRAME_GRAPH_IMAGE, .format = VK_FORMAT_D32_SFLOAT, .width = 64, .height = 32};
static const frame_graph_resource_desc BUFFER = {.kind = FRAME_GRAPH_BUFFER, .size = 4096};
static const frame_graph_resource_desc HOST_BUFFER = {.kind = FRAME_GRAPH_BUFFER, .size = 4096, .host = true};
static const frame_graph_resource_desc STRUCTURE = {.kind = FRAME_GRAPH_ACCELERATION};

static frame_graph_use create(const char *makes, frame_graph_resource_desc desc, frame_graph_access access)
{
    return (frame_graph_use){.kind = FRAME_GRAPH_USE_CREATE, .access = access, .makes = makes, .desc = desc};
}

static frame_graph_use create_cleared(const char *makes, frame_graph_resource_desc desc, frame_graph_access access)
{
    frame_graph_use use = create(makes, desc, access);
    use.clear = true;
    return use;
}

static frame_graph_use reads(const char *name, frame_graph_access access)
{
    return (frame_graph_use){.kind = FRAME_GRAPH_USE_READ, .access = access, .name = name};
}

static frame_graph_use modify(const char *name, const char *makes, frame_graph_access access)
{
    return (frame_graph_use){.kind = FRAME_GRAPH_USE_MODIFY, .access = access, .name = name, .makes = makes};
}

static frame_graph_use previous(const char *name, frame_graph_access access)
{
    return (frame_graph_use){.kind = FRAME_GRAPH_USE_PREVIOUS, .access = access, .name = name};
}

static frame_graph_pass_decl pass_of(const char *name, frame_graph_pass_kind kind, bool keep,
                                     const frame_graph_use *uses, uint32_t use_count)
{
    frame_graph_use *const copy = arena_alloc(&memory, (use_count + 1) * sizeof(*copy));
    memcpy(copy, uses, use_count * sizeof(*copy));
    return (frame_graph_pass_decl){.name = name, .kind = kind, .keep = keep, .uses = copy, .use_count = use_count};
}

#define USES(...) (const frame_graph_use[]){__VA_ARGS__}, countof(((const frame_graph_use[]){__VA_ARGS__}))
#define COMPUTE(name, ...) pass_of(name, FRAME_GRAPH_COMPUTE, false, USES(__VA_ARGS__))
#define GRAPHICS(name, ...) pass_of(name, FRAME_GRAPH_GRAPHICS, false, USES(__VA_ARGS__))
#define TRANSFER(name, ...) pass_of(name, FRAME_GRAPH_TRANSFER, false, USES(__VA_ARGS__))
#define HOST(name, ...) pass_of(name, FRAME_GRAPH_HOST, false, USES(__VA_ARGS__))
#define KEPT(name, ...) pass_of(name, FRAME_GRAPH_COMPUTE, true, USES(__VA_ARGS__))

#define PASSES(...)                                                                                                    \
    .passes = (const frame_graph_pass_decl[]){__VA_ARGS__},                                                            \
    .pass_count = countof(((const frame_graph_pass_decl[]){__VA_ARGS__}))
#define IMPORTS(...)                                                                                                   \
    .imports = (const frame_graph_import_decl[]){__VA_ARGS__},                                                         \
    .import_count = countof(((const frame_graph_import_decl[]){__VA_ARGS__}))
#define EXPORTS(...)                                                                                                   \
    .exports = (const frame_graph_export_decl[]){__VA_ARGS__},                                                         \
    .export_count = countof(((const frame_graph_export_decl[]){__VA_ARGS__}))
#define INPUT(...) (&(frame_graph_input){.measure = measure, __VA_ARGS__})

// Depth images live in memory of type 1, half floats in either, all else in memory of type 0.
static VkMemoryRequirements measure(const frame_graph_resource_desc *desc, VkFlags usage, void *user)
{
    (void)usage, (void)user;
    const bool depth = desc->format == VK_FORMAT_D32_SFLOAT, half = desc->format == VK_FORMAT_R16_SFLOAT;
    return (VkMemoryRequirements){
        .size = desc->kind == FRAME_GRAPH_IMAGE ? desc->width * desc->height * 8 : desc->size,
        .alignment = 256,
        .memoryTypeBits = depth  ? 2
                          : half ? 3
                                 : 1,
    };
}

// ---- The plan, read back

static const frame_graph_plan *compile(const frame_graph_input *input)
{
    const frame_graph_plan *const plan = frame_graph_plan_compile(input, &memory, error);
    if (!plan) {
        printf("the plan does not compile: %s\n", error);
        exit(EXIT_FAILURE);
    }
    return plan;
}

static const char *order_text(const frame_graph_plan *plan, const frame_graph_input *input)
{
    const char *text = "";
    for (uint32_t i = 0; i < plan->order_count; i++) {
        text = arena_printf(&memory, "%s%s%s", text, i ? " " : "", input->passes[plan->order[i].pass].name);
    }
    return text;
}

static const frame_graph_plan_pass *planned(const frame_graph_plan *plan, const frame_graph_input *input,
                                            const char *pass)
{
    for (uint32_t i = 0; i < plan->order_count; i++) {
        if (strcmp(input->passes[plan->order[i].pass].name, pass) == 0) {
            return &plan->order[i];
        }
    }
    printf("no pass %s in the plan\n", pass);
    exit(EXIT_FAILURE);
}

static const frame_graph_plan_resource *resource(const frame_graph_plan *plan, const frame_graph_input *input,
                                                 const char *name)
{
    const uint32_t index = frame_graph_plan_find(plan, input, name);
    if (index == FRAME_GRAPH_NONE) {
        printf("no resource %s in the plan\n", name);
        exit(EXIT_FAILURE);
    }
    return &plan->resources[index];
}

static const frame_graph_barrier *barrier_among(const frame_graph_barrier *barriers, uint32_t count, uint32_t resource,
                                                bool previous)
{
    for (uint32_t b = 0; b < count; b++) {
        if (barriers[b].resource == resource && barriers[b].previous == previous) {
            return &barriers[b];
        }
    }
    return NULL;
}

// The barrier on `name` before `pass`; all zero when there is none.
static frame_graph_barrier barrier_of(const frame_graph_plan *plan, const frame_graph_input *input, const char *pass,
                                      const char *name)
{
    const frame_graph_plan_pass *const p = planned(plan, input, pass);
    const frame_graph_barrier *const barrier =
        barrier_among(p->barriers, p->barrier_count, frame_graph_plan_find(plan, input, name), false);
    return barrier ? *barrier : (frame_graph_barrier){0};
}

static frame_graph_barrier previous_barrier_of(const frame_graph_plan *plan, const frame_graph_input *input,
                                               const char *pass, const char *name)
{
    const frame_graph_plan_pass *const p = planned(plan, input, pass);
    const frame_graph_barrier *const barrier =
        barrier_among(p->barriers, p->barrier_count, frame_graph_plan_find(plan, input, name), true);
    return barrier ? *barrier : (frame_graph_barrier){0};
}

static frame_graph_barrier final_barrier_of(const frame_graph_plan *plan, const frame_graph_input *input,
                                            const char *name)
{
    const frame_graph_barrier *const barrier =
        barrier_among(plan->final_barriers, plan->final_barrier_count, frame_graph_plan_find(plan, input, name), false);
    return barrier ? *barrier : (frame_graph_barrier){0};
}

static bool is_none(frame_graph_barrier barrier)
{
    return barrier.destination_stages == 0;
}

static bool share_slot(const frame_graph_plan *plan, const frame_graph_input *input, const char *a, const char *b)
{
    const uint32_t slot = resource(plan, input, a)->slot;
    return slot != FRAME_GRAPH_NONE && slot == resource(plan, input, b)->slot;
}

// Compiles what must not compile; the message must have all of the words, which are separated by '&'.
static void check_error(const frame_graph_input *input, const char *words)
{
    strcpy(error, "stale");
    if (frame_graph_plan_compile(input, &memory, error)) {
        printf("compiles, but should name %s\n", words);
        test_failures++;
        return;
    }
    char *const copy = arena_strdup(&memory, words);
    for (char *word = strtok(copy, "&"); word; word = strtok(NULL, "&")) {
        if (!strstr(error, word)) {
            printf("\"%s\" lacks %s\n", error, word);
            test_failures++;
        }
    }
    CHECK(error[0] && error[strlen(error) - 1] == '.');
}

// ---- Order

TEST(order_follows_data_and_not_registration)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("c", reads("b", ACCESS_STORAGE_READ), create("c", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("b", reads("a", ACCESS_STORAGE_READ), create("b", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("a", create("a", BUFFER, ACCESS_STORAGE_WRITE))),
              EXPORTS({"c", ACCESS_NONE}));
    CHECK_STRING(order_text(compile(input), input), "a b c");
}

TEST(reader_runs_before_the_modifier_of_what_it_reads)
{
    // By name alone, the modifier would come first.
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("a_modifier", modify("x", "y", ACCESS_STORAGE_READ_WRITE)),
                     COMPUTE("reader", reads("x", ACCESS_STORAGE_READ), create("z", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("maker", create("x", BUFFER, ACCESS_STORAGE_WRITE))),
              EXPORTS({"y", ACCESS_NONE}, {"z", ACCESS_NONE}));
    CHECK_STRING(order_text(compile(input), input), "maker reader a_modifier");
}

TEST(a_pass_runs_right_before_what_needs_it)
{
    // "blur" needs the long chain and the lone "noise"; noise is made last, so that it lives briefly.
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("a_noise", create("noise", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("b", create("b", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("c", reads("b", ACCESS_STORAGE_READ), create("c", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("d_blur", reads("noise", ACCESS_STORAGE_READ), reads("c", ACCESS_STORAGE_READ),
                             create("d", BUFFER, ACCESS_STORAGE_WRITE))),
              EXPORTS({"d", ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    CHECK_STRING(order_text(plan, input), "b c a_noise d_blur");
    CHECK(resource(plan, input, "noise")->first == 2 && resource(plan, input, "noise")->last == 3);
}

// A graph with all that the plan must decide: modifications, history, imports, exports, aliasing, attachments.
enum { VARIED_PASSES = 7, VARIED_IMPORTS = 2 };
static void varied_passes(frame_graph_pass_decl passes[VARIED_PASSES])
{
    const frame_graph_pass_decl list[VARIED_PASSES] = {
        GRAPHICS("gbuffer", create_cleared("albedo", IMAGE, ACCESS_COLOR_ATTACHMENT),
                 create_cleared("depth", DEPTH, ACCESS_DEPTH_ATTACHMENT), reads("instances", ACCESS_STORAGE_READ)),
        COMPUTE("cluster", create("clusters", BUFFER, ACCESS_STORAGE_WRITE)),
        COMPUTE("light", reads("albedo", ACCESS_SAMPLED), reads("clusters", ACCESS_STORAGE_READ),
                create("radiance", IMAGE, ACCESS_STORAGE_WRITE)),
        COMPUTE("fog", reads("depth", ACCESS_SAMPLED), modify("radiance", "fogged", ACCESS_STORAGE_READ_WRITE)),
        COMPUTE("taa", reads("fogged", ACCESS_SAMPLED), previous("resolved", ACCESS_SAMPLED),
                create("resolved", IMAGE, ACCESS_STORAGE_WRITE)),
        COMPUTE("tonemap", reads("resolved", ACCESS_SAMPLED), create("display", IMAGE, ACCESS_STORAGE_WRITE)),
        TRANSFER("present", reads("display", ACCESS_TRANSFER_READ), modify("screen", "shown", ACCESS_TRANSFER_WRITE)),
    };
    memcpy(passes, list, sizeof(list));
}
static const frame_graph_import_decl VARIED_IMPORT_LIST[VARIED_IMPORTS] = {
    {"instances", {.kind = FRAME_GRAPH_BUFFER, .size = 64}, ACCESS_HOST_WRITE, ACCESS_NONE},
    {"screen",
     {.kind = FRAME_GRAPH_IMAGE, .format = VK_FORMAT_B8G8R8A8_UNORM, .width = 64, .height = 32},
     ACCESS_NONE,
     ACCESS_TRANSFER_READ},
};

TEST(plan_is_the_same_under_any_order_of_registration)
{
    frame_graph_pass_decl passes[VARIED_PASSES];
    varied_passes(passes);
    frame_graph_import_decl imports[VARIED_IMPORTS];
    memcpy(imports, VARIED_IMPORT_LIST, sizeof(imports));
    const char *expected = NULL;
    uint32_t random = 1;
    for (int round = 0; round < 200; round++) {
        const frame_graph_input *const input =
            INPUT(.passes = passes, .pass_count = VARIED_PASSES, .imports = imports, .import_count = VARIED_IMPORTS,
                  EXPORTS({"display", ACCESS_TRANSFER_READ}));
        const char *const text = frame_graph_plan_text(compile(input), input, &memory);
        expected = expected ? expected : text;
        CHECK_STRING(text, expected);
        for (uint32_t i = VARIED_PASSES - 1; i > 0; i--) {
            random = random * 1664525 + 1013904223;
            const uint32_t j = (random >> 16) % (i + 1);
            const frame_graph_pass_decl swapped = passes[i];
            passes[i] = passes[j];
            passes[j] = swapped;
        }
        const frame_graph_import_decl first = imports[0];
        imports[0] = imports[1];
        imports[1] = first;
    }
}

TEST(passes_of_one_name_are_told_apart_by_what_they_declare)
{
    const frame_graph_pass_decl one = KEPT("step", create("x", BUFFER, ACCESS_STORAGE_WRITE));
    const frame_graph_pass_decl two = KEPT("step", create("y", BUFFER, ACCESS_STORAGE_WRITE));
    const frame_graph_input *const a = INPUT(PASSES(one, two)), *const b = INPUT(PASSES(two, one));
    CHECK_STRING(frame_graph_plan_text(compile(a), a, &memory), frame_graph_plan_text(compile(b), b, &memory));
}

TEST(plan_is_the_same_with_culling_off_when_nothing_is_culled)
{
    frame_graph_pass_decl passes[VARIED_PASSES];
    varied_passes(passes);
    frame_graph_input input = {
        .measure = measure,
        .passes = passes,
        .pass_count = VARIED_PASSES,
        .imports = VARIED_IMPORT_LIST,
        .import_count = VARIED_IMPORTS,
    };
    const frame_graph_plan *const culled = compile(&input);
    CHECK(culled->culled_count == 0);
    const char *const text = frame_graph_plan_text(culled, &input, &memory);
    input.keep_all = true;
    CHECK_STRING(frame_graph_plan_text(compile(&input), &input, &memory), text);
}

TEST(errors_are_found_in_passes_that_would_be_culled)
{
    const frame_graph_input input = {.measure = measure, PASSES(COMPUTE("unneeded", reads("nothing", ACCESS_SAMPLED)))};
    frame_graph_input keeping = input;
    keeping.keep_all = true;
    check_error(&input, "\"unneeded\"&\"nothing\"");
    check_error(&keeping, "\"unneeded\"&\"nothing\"");
}

// ---- Culling

TEST(pass_nobody_reads_is_culled_and_says_so)
{
    const frame_graph_input *const input = INPUT(PASSES(COMPUTE("needed", create("a", BUFFER, ACCESS_STORAGE_WRITE)),
                                                        COMPUTE("idle", create("b", BUFFER, ACCESS_STORAGE_WRITE))),
                                                 EXPORTS({"a", ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    CHECK_STRING(order_text(plan, input), "needed");
    CHECK(plan->culled_count == 1 && plan->culled[0].pass == 1);
    CHECK_STRING(plan->culled[0].why, "Pass \"idle\" is culled: nobody reads \"b\".");
    CHECK(frame_graph_plan_find(plan, input, "b") == FRAME_GRAPH_NONE);
}

TEST(one_switch_turns_culling_off)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("idle", create("b", BUFFER, ACCESS_STORAGE_WRITE))), .keep_all = true);
    const frame_graph_plan *const plan = compile(input);
    CHECK_STRING(order_text(plan, input), "idle");
    CHECK(plan->culled_count == 0);
}

TEST(pass_marked_keep_is_kept_with_all_that_it_needs)
{
    const frame_graph_input *const input =
        INPUT(PASSES(KEPT("print", reads("counts", ACCESS_STORAGE_READ)),
                     COMPUTE("count", create("counts", BUFFER, ACCESS_STORAGE_WRITE))));
    CHECK_STRING(order_text(compile(input), input), "count print");
}

TEST(chain_that_nobody_reads_is_culled_as_a_whole)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("a", create("a", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("b", reads("a", ACCESS_STORAGE_READ), create("b", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("c", reads("b", ACCESS_STORAGE_READ))));
    const frame_graph_plan *const plan = compile(input);
    CHECK(plan->order_count == 0 && plan->culled_count == 3);
    CHECK_STRING(plan->culled[0].why, "Pass \"a\" is culled: \"a\" is used only by passes that are culled (\"b\").");
    CHECK_STRING(plan->culled[2].why, "Pass \"c\" is culled: it makes nothing and is not marked to be kept.");
    CHECK(plan->resource_count == 0 && plan->slot_count == 0);
}

TEST(modifier_that_nobody_reads_is_culled_and_the_maker_stays)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("maker", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("modifier", modify("x", "y", ACCESS_STORAGE_READ_WRITE)),
                     KEPT("reader", reads("x", ACCESS_STORAGE_READ))));
    CHECK_STRING(order_text(compile(input), input), "maker reader");
}

TEST(modifier_of_an_import_is_never_culled)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("update", modify("state", "updated", ACCESS_STORAGE_READ_WRITE))),
              IMPORTS({"state", BUFFER, ACCESS_STORAGE_READ_WRITE, ACCESS_NONE}));
    CHECK_STRING(order_text(compile(input), input), "update");
}

TEST(acceleration_structure_that_nobody_traces_is_not_built)
{
    const frame_graph_input *const input = INPUT(PASSES(COMPUTE("build", modify("tlas", "scene", ACCESS_BUILD_WRITE))),
                                                 IMPORTS({"tlas", STRUCTURE, ACCESS_NONE, ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    CHECK(plan->order_count == 0 && plan->culled_count == 1);
    CHECK_STRING(plan->culled[0].why, "Pass \"build\" is culled: nobody reads \"scene\".");
}

TEST(history_alone_keeps_no_pass_alive)
{
    // The pass reads only what it made itself.
    const frame_graph_input *const input = INPUT(
        PASSES(COMPUTE("taa", previous("resolved", ACCESS_SAMPLED), create("resolved", IMAGE, ACCESS_STORAGE_WRITE))));
    CHECK(compile(input)->culled_count == 1);
}

TEST(history_keeps_its_last_maker_alive)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("accumulate", modify("raw", "history", ACCESS_STORAGE_READ_WRITE)),
                     COMPUTE("trace", create("raw", IMAGE, ACCESS_STORAGE_WRITE)),
                     KEPT("use", previous("history", ACCESS_SAMPLED))));
    const frame_graph_plan *const plan = compile(input);
    CHECK(plan->order_count == 3);
    CHECK(resource(plan, input, "history")->history);
    CHECK_STRING(resource(plan, input, "history")->name, "raw");
}

// ---- Names

TEST(first_alternative_with_a_maker_is_meant)
{
    const frame_graph_input *const input = INPUT(
        PASSES(COMPUTE("raw", create("raw", BUFFER, ACCESS_STORAGE_WRITE)),
               COMPUTE("filter", reads("raw", ACCESS_STORAGE_READ), create("filtered", BUFFER, ACCESS_STORAGE_WRITE)),
               KEPT("show", reads("upscaled|filtered|raw", ACCESS_STORAGE_READ))));
    const frame_graph_plan *const plan = compile(input);
    CHECK(planned(plan, input, "show")->uses[0].resource == frame_graph_plan_find(plan, input, "filtered"));
    CHECK(frame_graph_plan_find(plan, input, "upscaled|raw") == frame_graph_plan_find(plan, input, "raw"));
}

TEST(optional_use_without_a_maker_is_absent)
{
    const frame_graph_input *const input =
        INPUT(PASSES(KEPT("show", reads("shadow|-", ACCESS_SAMPLED), previous("old|-", ACCESS_SAMPLED),
                          create("x", BUFFER, ACCESS_STORAGE_WRITE))),
              EXPORTS({"debug|-", ACCESS_SAMPLED}));
    const frame_graph_plan *const plan = compile(input);
    const frame_graph_plan_use *const uses = planned(plan, input, "show")->uses;
    CHECK(uses[0].resource == FRAME_GRAPH_NONE && uses[1].resource == FRAME_GRAPH_NONE);
    CHECK(uses[2].resource == 0 && plan->resource_count == 1);
}

TEST(optional_modification_of_nothing_makes_nothing)
{
    const frame_graph_pass_decl dim = COMPUTE("dim", modify("fog|-", "dimmed", ACCESS_STORAGE_READ_WRITE));
    const frame_graph_pass_decl tint = COMPUTE("tint", modify("dimmed|-", "tinted", ACCESS_STORAGE_READ_WRITE));
    const frame_graph_pass_decl show = KEPT("show", reads("tinted|sky", ACCESS_STORAGE_READ));
    const frame_graph_pass_decl sky = COMPUTE("sky", create("sky", BUFFER, ACCESS_STORAGE_WRITE));
    const frame_graph_pass_decl fog = COMPUTE("fog", create("fog", BUFFER, ACCESS_STORAGE_WRITE));
    const frame_graph_input *const without = INPUT(PASSES(tint, dim, show, sky));
    CHECK_STRING(order_text(compile(without), without), "sky show");
    const frame_graph_input *const with = INPUT(PASSES(tint, dim, show, sky, fog));
    CHECK_STRING(order_text(compile(with), with), "fog dim tint show");
}

TEST(a_list_names_itself_and_each_of_its_alternatives)
{
    CHECK(frame_graph_names("filtered|raw", "raw") && frame_graph_names("filtered|raw", "filtered"));
    CHECK(frame_graph_names("filtered|raw", "filtered|raw"));
    CHECK(!frame_graph_names("filtered|raw", "filter") && !frame_graph_names("raw", "raw2"));
}

TEST(find_knows_every_version_of_a_resource)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("b", modify("x", "y", ACCESS_STORAGE_READ_WRITE))),
              IMPORTS({"in", BUFFER, ACCESS_UNIFORM, ACCESS_NONE}), EXPORTS({"y", ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    CHECK(frame_graph_plan_find(plan, input, "x") == frame_graph_plan_find(plan, input, "y"));
    CHECK(resource(plan, input, "in")->import == 0);
    CHECK(resource(plan, input, "in")->first == FRAME_GRAPH_NONE);
    CHECK(frame_graph_plan_find(plan, input, "z") == FRAME_GRAPH_NONE);
}

// ---- Barriers

TEST(read_waits_for_the_write)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("write", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                     pass_of("read", FRAME_GRAPH_TRANSFER, true, USES(reads("x", ACCESS_TRANSFER_READ)))));
    const frame_graph_barrier barrier = barrier_of(compile(input), input, "read", "x");
    CHECK(barrier.source_stages == COMPUTE_STAGE && barrier.source_mask == VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT);
    CHECK(barrier.destination_stages == TRANSFER_STAGE && barrier.destination_mask == VK_ACCESS_2_TRANSFER_READ_BIT);
}

TEST(write_after_two_reads_waits_for_both)
{
    const frame_graph_input *const input = INPUT(
        PASSES(COMPUTE("maker", create("x", IMAGE, ACCESS_STORAGE_WRITE)), KEPT("reader", reads("x", ACCESS_SAMPLED)),
               GRAPHICS("painter", reads("x", ACCESS_SAMPLED), create("target", IMAGE, ACCESS_COLOR_ATTACHMENT)),
               TRANSFER("modifier", modify("x", "y", ACCESS_TRANSFER_WRITE))),
        EXPORTS({"target", ACCESS_NONE}, {"y", ACCESS_NONE}));
    const frame_graph_barrier barrier = barrier_of(compile(input), input, "modifier", "x");
    CHECK(barrier.source_stages & COMPUTE_STAGE && barrier.source_stages & FRAGMENT_STAGE);
    // The readers waited for the write themselves: what is left is to wait for them to finish.
    CHECK(barrier.source_mask == 0);
    CHECK(barrier.destination_stages == TRANSFER_STAGE && barrier.destination_mask == VK_ACCESS_2_TRANSFER_WRITE_BIT);
    CHECK(barrier.old_layout == VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
}

TEST(write_after_a_read_that_waited_orders_execution_only)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("maker", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                     pass_of("reader", FRAME_GRAPH_TRANSFER, true, USES(reads("x", ACCESS_TRANSFER_READ))),
                     COMPUTE("modifier", modify("x", "y", ACCESS_STORAGE_WRITE))),
              EXPORTS({"y", ACCESS_NONE}));
    const frame_graph_barrier barrier = barrier_of(compile(input), input, "modifier", "x");
    CHECK(barrier.source_stages == TRANSFER_STAGE && barrier.source_mask == 0);
    CHECK(barrier.destination_stages == COMPUTE_STAGE);
}

TEST(write_after_write_waits_and_makes_available)
{
    const frame_graph_input *const input = INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                                                        COMPUTE("b", modify("x", "y", ACCESS_STORAGE_WRITE))),
                                                 EXPORTS({"y", ACCESS_NONE}));
    const frame_graph_barrier barrier = barrier_of(compile(input), input, "b", "x");
    CHECK(barrier.source_stages == COMPUTE_STAGE && barrier.source_mask == VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT);
    CHECK(barrier.destination_stages == COMPUTE_STAGE);
}

TEST(read_after_read_in_the_same_stage_and_layout_needs_no_barrier)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("maker", create("x", IMAGE, ACCESS_STORAGE_WRITE)),
                     KEPT("one", reads("x", ACCESS_SAMPLED)), KEPT("two", reads("x", ACCESS_SAMPLED))));
    const frame_graph_plan *const plan = compile(input);
    CHECK(!is_none(barrier_of(plan, input, "one", "x")));
    CHECK(is_none(barrier_of(plan, input, "two", "x")));
}

TEST(each_stage_that_reads_waits_for_the_write_once)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("maker", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                     KEPT("one", reads("x", ACCESS_STORAGE_READ)), KEPT("three", reads("x", ACCESS_STORAGE_READ)),
                     pass_of("two", FRAME_GRAPH_TRANSFER, true, USES(reads("x", ACCESS_TRANSFER_READ)))));
    const frame_graph_plan *const plan = compile(input);
    CHECK_STRING(order_text(plan, input), "maker one three two");
    CHECK(barrier_of(plan, input, "one", "x").destination_stages == COMPUTE_STAGE);
    CHECK(is_none(barrier_of(plan, input, "three", "x")));
    const frame_graph_barrier second = barrier_of(plan, input, "two", "x");
    CHECK(second.source_stages == COMPUTE_STAGE && second.source_mask == VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT);
    CHECK(second.destination_stages == TRANSFER_STAGE);
}

TEST(what_one_stage_sees_is_not_taken_for_seen_by_another)
{
    // Compute has seen uniform reads, vertex and fragment shaders have seen storage reads; compute has not seen those.
    const frame_graph_input *const input = INPUT(
        PASSES(COMPUTE("maker", create("x", BUFFER, ACCESS_STORAGE_WRITE)), KEPT("one", reads("x", ACCESS_UNIFORM)),
               pass_of("three", FRAME_GRAPH_GRAPHICS, true,
                       USES(reads("x", ACCESS_STORAGE_READ), create("t", IMAGE, ACCESS_COLOR_ATTACHMENT))),
               KEPT("two", reads("x", ACCESS_STORAGE_READ))));
    const frame_graph_plan *const plan = compile(input);
    CHECK_STRING(order_text(plan, input), "maker one three two");
    CHECK(barrier_of(plan, input, "two", "x").destination_mask == VK_ACCESS_2_SHADER_STORAGE_READ_BIT);
}

TEST(change_of_layout_between_two_reads_waits_for_the_first_read)
{
    const frame_graph_input *const input = INPUT(
        PASSES(COMPUTE("maker", create("x", IMAGE, ACCESS_STORAGE_WRITE)), KEPT("one", reads("x", ACCESS_SAMPLED)),
               pass_of("two", FRAME_GRAPH_TRANSFER, true, USES(reads("x", ACCESS_TRANSFER_READ)))));
    const frame_graph_barrier barrier = barrier_of(compile(input), input, "two", "x");
    CHECK(barrier.source_stages == COMPUTE_STAGE && barrier.source_mask == 0);
    CHECK(barrier.old_layout == VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
    CHECK(barrier.new_layout == VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
}

TEST(read_after_a_change_of_layout_waits_for_the_change)
{
    // The change happens before the sampling in fragments; the compute read in the same layout chains to it.
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("maker", create("x", IMAGE, ACCESS_STORAGE_WRITE)),
                     pass_of("one", FRAME_GRAPH_GRAPHICS, true,
                             USES(reads("x", ACCESS_SAMPLED), create("t", IMAGE, ACCESS_COLOR_ATTACHMENT))),
                     KEPT("two", reads("x", ACCESS_SAMPLED))));
    const frame_graph_barrier barrier = barrier_of(compile(input), input, "two", "x");
    CHECK(barrier.source_stages & FRAGMENT_STAGE && barrier.source_mask == 0);
    CHECK(barrier.destination_stages == COMPUTE_STAGE);
    CHECK(barrier.old_layout == barrier.new_layout);
}

TEST(transient_image_starts_from_undefined_and_waits_for_nothing)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("a", create("x", IMAGE, ACCESS_STORAGE_WRITE))), .keep_all = true);
    const frame_graph_barrier barrier = barrier_of(compile(input), input, "a", "x");
    CHECK(barrier.source_stages == 0 && barrier.source_mask == 0);
    CHECK(barrier.old_layout == VK_IMAGE_LAYOUT_UNDEFINED && barrier.new_layout == VK_IMAGE_LAYOUT_GENERAL);
}

TEST(first_write_of_a_buffer_needs_no_barrier)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE))), .keep_all = true);
    CHECK(planned(compile(input), input, "a")->barrier_count == 0);
}

TEST(two_uses_of_one_buffer_in_a_pass_make_one_barrier)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("count", create("args", BUFFER, ACCESS_STORAGE_WRITE)),
                     KEPT("dispatch", reads("args", ACCESS_INDIRECT), reads("args", ACCESS_STORAGE_READ))));
    const frame_graph_plan *const plan = compile(input);
    CHECK(planned(plan, input, "dispatch")->barrier_count == 1);
    const frame_graph_barrier barrier = barrier_of(plan, input, "dispatch", "args");
    CHECK(barrier.destination_stages == (VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT | COMPUTE_STAGE));
    CHECK(barrier.destination_mask == (VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_READ_BIT));
}

TEST(pass_may_use_what_it_makes)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("sort", create("keys", BUFFER, ACCESS_TRANSFER_WRITE), reads("keys", ACCESS_INDIRECT),
                             modify("keys", "sorted", ACCESS_STORAGE_READ_WRITE)),
                     KEPT("use", reads("sorted", ACCESS_STORAGE_READ))));
    const frame_graph_plan *const plan = compile(input);
    CHECK_STRING(order_text(plan, input), "sort use");
    const frame_graph_barrier barrier = barrier_of(plan, input, "use", "sorted");
    CHECK((barrier.source_stages & (TRANSFER_STAGE | COMPUTE_STAGE)) == (TRANSFER_STAGE | COMPUTE_STAGE));
    CHECK(barrier.source_mask == (VK_ACCESS_2_TRANSFER_WRITE_BIT | VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT));
}

TEST(depth_that_is_only_tested_stays_readable)
{
    const frame_graph_input *const input = INPUT(
        PASSES(GRAPHICS("depth", create_cleared("depth", DEPTH, ACCESS_DEPTH_ATTACHMENT)),
               pass_of("particles", FRAME_GRAPH_GRAPHICS, true,
                       USES(reads("depth", ACCESS_DEPTH_TEST_SAMPLED), create("c", IMAGE, ACCESS_COLOR_ATTACHMENT)))));
    const frame_graph_plan *const plan = compile(input);
    const frame_graph_barrier barrier = barrier_of(plan, input, "particles", "depth");
    CHECK(barrier.new_layout == VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL);
    CHECK(barrier.destination_stages & FRAGMENT_STAGE);
    CHECK(barrier.destination_stages & VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT);
    // Storing would be a write.
    CHECK(planned(plan, input, "particles")->uses[0].store == VK_ATTACHMENT_STORE_OP_NONE);
    CHECK(planned(plan, input, "particles")->uses[0].load == VK_ATTACHMENT_LOAD_OP_LOAD);
}

TEST(acceleration_structure_is_built_before_it_is_traced)
{
    const frame_graph_input *const input = INPUT(
        PASSES(COMPUTE("instances", create("instances", BUFFER, ACCESS_STORAGE_WRITE)),
               COMPUTE("tlas", reads("instances", ACCESS_BUILD_INPUT), modify("tlas", "scene", ACCESS_BUILD_WRITE)),
               KEPT("trace", reads("scene", ACCESS_TRACE))),
        IMPORTS({"tlas", STRUCTURE, ACCESS_NONE, ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    CHECK_STRING(order_text(plan, input), "instances tlas trace");
    const frame_graph_barrier barrier = barrier_of(plan, input, "trace", "scene");
    CHECK(barrier.source_stages == VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR);
    CHECK(barrier.source_mask == VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR);
    CHECK(barrier.destination_mask == VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR);
    CHECK(barrier_of(plan, input, "tlas", "instances").destination_stages ==
          VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR);
}

TEST(ray_tracing_pass_waits_and_is_waited_for_in_its_own_stage)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("make", create("rays", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("build", modify("tlas", "scene", ACCESS_BUILD_WRITE)),
                     pass_of("trace", FRAME_GRAPH_RAY_TRACING, false,
                             USES(reads("scene", ACCESS_TRACE), reads("rays", ACCESS_STORAGE_READ),
                                  create("hits", BUFFER, ACCESS_STORAGE_WRITE))),
                     KEPT("use", reads("hits", ACCESS_STORAGE_READ))),
              IMPORTS({"tlas", STRUCTURE, ACCESS_NONE, ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    const VkPipelineStageFlags2 stage = VK_PIPELINE_STAGE_2_RAY_TRACING_SHADER_BIT_KHR;
    CHECK(barrier_of(plan, input, "trace", "rays").source_stages == COMPUTE_STAGE);
    CHECK(barrier_of(plan, input, "trace", "rays").destination_stages == stage);
    CHECK(barrier_of(plan, input, "trace", "scene").destination_stages == stage);
    CHECK(barrier_of(plan, input, "use", "hits").source_stages == stage);
    CHECK(barrier_of(plan, input, "use", "hits").source_mask == VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT);
}

TEST(host_pass_waits_for_the_device_and_the_device_for_it)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("a", create("counts", HOST_BUFFER, ACCESS_STORAGE_WRITE)),
                     HOST("b", reads("counts", ACCESS_HOST_READ), create("sums", HOST_BUFFER, ACCESS_HOST_WRITE)),
                     KEPT("c", reads("sums", ACCESS_UNIFORM))));
    const frame_graph_plan *const plan = compile(input);
    CHECK_STRING(order_text(plan, input), "a b c");
    const frame_graph_barrier in = barrier_of(plan, input, "b", "counts"), out = barrier_of(plan, input, "c", "sums");
    CHECK(in.destination_stages == HOST_STAGE && in.destination_mask == VK_ACCESS_2_HOST_READ_BIT);
    CHECK(out.source_stages == HOST_STAGE && out.source_mask == VK_ACCESS_2_HOST_WRITE_BIT);
}

// ---- Imports and exports

TEST(imports_return_to_their_after_state)
{
    const frame_graph_input *const input = INPUT(
        PASSES(COMPUTE("paint", modify("screen", "painted", ACCESS_STORAGE_WRITE)),
               KEPT("look", reads("texture", ACCESS_SAMPLED))),
        IMPORTS({"screen", IMAGE, ACCESS_TRANSFER_READ, ACCESS_TRANSFER_READ},
                {"texture", IMAGE, ACCESS_SAMPLED, ACCESS_SAMPLED},
                {"unused", IMAGE, ACCESS_SAMPLED, ACCESS_TRANSFER_READ}, {"left", IMAGE, ACCESS_SAMPLED, ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    const frame_graph_barrier before = barrier_of(plan, input, "paint", "screen");
    CHECK(before.old_layout == VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL && before.source_stages == TRANSFER_STAGE);
    const frame_graph_barrier after = final_barrier_of(plan, input, "screen");
    CHECK(after.old_layout == VK_IMAGE_LAYOUT_GENERAL && after.new_layout == VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
    CHECK(after.source_stages == COMPUTE_STAGE && after.destination_stages == TRANSFER_STAGE);
    CHECK(resource(plan, input, "screen")->final.layout == VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL);
    // Those that are in their `after` state already, or that state none, are left alone; unused ones are moved too.
    CHECK(is_none(final_barrier_of(plan, input, "texture")) && is_none(final_barrier_of(plan, input, "left")));
    CHECK(final_barrier_of(plan, input, "unused").old_layout == VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
    CHECK(resource(plan, input, "screen")->slot == FRAME_GRAPH_NONE);
}

TEST(import_waits_for_what_was_written_before_the_frame)
{
    const frame_graph_input *const input =
        INPUT(PASSES(KEPT("a", reads("x", ACCESS_UNIFORM))), IMPORTS({"x", BUFFER, ACCESS_HOST_WRITE, ACCESS_NONE}));
    const frame_graph_barrier barrier = barrier_of(compile(input), input, "a", "x");
    CHECK(barrier.source_stages == HOST_STAGE && barrier.source_mask == VK_ACCESS_2_HOST_WRITE_BIT);
}

TEST(import_without_contents_starts_from_undefined_and_is_not_loaded)
{
    const frame_graph_input *const input =
        INPUT(PASSES(GRAPHICS("draw", modify("screen", "drawn", ACCESS_COLOR_ATTACHMENT)),
                     GRAPHICS("overlay", modify("drawn", "done", ACCESS_COLOR_ATTACHMENT))),
              IMPORTS({"screen", IMAGE, ACCESS_NONE, ACCESS_TRANSFER_READ}));
    const frame_graph_plan *const plan = compile(input);
    CHECK(barrier_of(plan, input, "draw", "screen").old_layout == VK_IMAGE_LAYOUT_UNDEFINED);
    CHECK(planned(plan, input, "draw")->uses[0].load == VK_ATTACHMENT_LOAD_OP_DONT_CARE);
    CHECK(planned(plan, input, "overlay")->uses[0].load == VK_ATTACHMENT_LOAD_OP_LOAD);
    CHECK(planned(plan, input, "overlay")->uses[0].store == VK_ATTACHMENT_STORE_OP_STORE);
}

TEST(exports_move_to_their_after_state_and_get_its_usage)
{
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("a", create("x", IMAGE, ACCESS_STORAGE_WRITE))), EXPORTS({"x", ACCESS_TRANSFER_READ}));
    const frame_graph_plan *const plan = compile(input);
    const frame_graph_barrier barrier = final_barrier_of(plan, input, "x");
    CHECK(barrier.new_layout == VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL && barrier.source_stages == COMPUTE_STAGE);
    CHECK(resource(plan, input, "x")->exported);
    CHECK(resource(plan, input, "x")->usage & VK_IMAGE_USAGE_TRANSFER_SRC_BIT);
}

// Five passes in a row, each reading what the one before it made: two resources are alive at a time.
static void chain_passes(frame_graph_pass_decl passes[5])
{
    const char *const names[] = {"a", "b", "c", "d", "e"};
    for (uint32_t i = 0; i < 5; i++) {
        passes[i] =
            i ? COMPUTE(names[i], reads(names[i - 1], ACCESS_SAMPLED), create(names[i], IMAGE, ACCESS_STORAGE_WRITE))
              : COMPUTE(names[i], create(names[i], IMAGE, ACCESS_STORAGE_WRITE));
    }
}

TEST(exports_are_kept_out_of_aliasing_from_their_last_use_on)
{
    frame_graph_pass_decl passes[5];
    chain_passes(passes);
    const frame_graph_input *const input =
        INPUT(.passes = passes, .pass_count = 5, EXPORTS({"a", ACCESS_NONE}, {"e", ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    for (uint32_t i = 1; i < 5; i++) {
        CHECK(!share_slot(plan, input, "a", passes[i].name));
    }
    CHECK(resource(plan, input, "a")->last == 4);
}

// ---- Slots

TEST(resources_whose_lifetimes_do_not_meet_share_a_slot)
{
    frame_graph_pass_decl passes[5];
    chain_passes(passes);
    const frame_graph_input *const input = INPUT(.passes = passes, .pass_count = 5, EXPORTS({"e", ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    CHECK(plan->slot_count == 2);
    CHECK(share_slot(plan, input, "a", "c") && share_slot(plan, input, "b", "d") && !share_slot(plan, input, "a", "b"));
    CHECK(resource(plan, input, "b")->first == 1 && resource(plan, input, "b")->last == 2);
}

TEST(reuse_of_a_slot_waits_for_its_previous_user_and_starts_from_undefined)
{
    frame_graph_pass_decl passes[5];
    chain_passes(passes);
    passes[1] = GRAPHICS("b", reads("a", ACCESS_SAMPLED), create("b", IMAGE, ACCESS_COLOR_ATTACHMENT));
    const frame_graph_input *const input = INPUT(.passes = passes, .pass_count = 5, EXPORTS({"e", ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    CHECK(share_slot(plan, input, "a", "c"));
    const frame_graph_barrier barrier = barrier_of(plan, input, "c", "c");
    CHECK(barrier.source_stages & FRAGMENT_STAGE); // that sampled "a"
    CHECK(barrier.old_layout == VK_IMAGE_LAYOUT_UNDEFINED && barrier.new_layout == VK_IMAGE_LAYOUT_GENERAL);
}

TEST(reuse_of_a_buffer_slot_waits_for_its_last_reader)
{
    const frame_graph_input *const input = INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                                                        TRANSFER("b", reads("x", ACCESS_TRANSFER_READ)),
                                                        COMPUTE("c", create("y", BUFFER, ACCESS_STORAGE_WRITE))),
                                                 .keep_all = true);
    const frame_graph_plan *const plan = compile(input);
    CHECK(share_slot(plan, input, "x", "y"));
    CHECK(barrier_of(plan, input, "c", "y").source_stages & TRANSFER_STAGE);
}

TEST(reuse_of_a_buffer_slot_waits_for_writes_that_nobody_read)
{
    const frame_graph_input *const input = INPUT(PASSES(TRANSFER("a", create("x", BUFFER, ACCESS_TRANSFER_WRITE)),
                                                        COMPUTE("b", create("y", BUFFER, ACCESS_STORAGE_WRITE))),
                                                 .keep_all = true);
    const frame_graph_plan *const plan = compile(input);
    CHECK(share_slot(plan, input, "x", "y"));
    const frame_graph_barrier barrier = barrier_of(plan, input, "b", "y");
    CHECK(barrier.source_stages == TRANSFER_STAGE && barrier.source_mask == VK_ACCESS_2_TRANSFER_WRITE_BIT);
}

TEST(reuse_of_a_buffer_slot_covers_the_clearing_of_counters)
{
    // The counting pass fills its counters itself before its shader adds to them.
    const frame_graph_input *const input =
        INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                     COMPUTE("count", create("counters", BUFFER, ACCESS_STORAGE_READ_WRITE))),
              .keep_all = true);
    const frame_graph_plan *const plan = compile(input);
    CHECK(share_slot(plan, input, "x", "counters"));
    const frame_graph_barrier barrier = barrier_of(plan, input, "count", "counters");
    CHECK(barrier.destination_stages == (COMPUTE_STAGE | TRANSFER_STAGE));
    CHECK(barrier.destination_mask & VK_ACCESS_2_TRANSFER_WRITE_BIT);
}

TEST(slot_takes_the_largest_needs_of_its_users)
{
    frame_graph_resource_desc large = BUFFER;
    large.size = 1 << 20;
    const frame_graph_input *const input = INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                                                        COMPUTE("b", create("y", large, ACCESS_STORAGE_WRITE)),
                                                        COMPUTE("c", create("z", BUFFER, ACCESS_STORAGE_WRITE))),
                                                 .keep_all = true);
    const frame_graph_plan *const plan = compile(input);
    CHECK(plan->slot_count == 1 && plan->slots[0].requirements.size == 1 << 20);
}

TEST(buffers_and_images_never_share_a_slot)
{
    const frame_graph_input *const input = INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                                                        COMPUTE("b", create("y", IMAGE, ACCESS_STORAGE_WRITE))),
                                                 .keep_all = true);
    const frame_graph_plan *const plan = compile(input);
    CHECK(plan->slot_count == 2 && !share_slot(plan, input, "x", "y"));
    CHECK(plan->slots[resource(plan, input, "y")->slot].kind == FRAME_GRAPH_IMAGE);
}

TEST(host_buffers_share_slots_with_host_buffers_only)
{
    const frame_graph_input *const input = INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                                                        COMPUTE("b", create("y", HOST_BUFFER, ACCESS_STORAGE_WRITE)),
                                                        COMPUTE("c", create("z", HOST_BUFFER, ACCESS_STORAGE_WRITE))),
                                                 .keep_all = true);
    const frame_graph_plan *const plan = compile(input);
    CHECK(!share_slot(plan, input, "x", "y") && share_slot(plan, input, "y", "z"));
    CHECK(plan->slots[resource(plan, input, "y")->slot].host && !plan->slots[resource(plan, input, "x")->slot].host);
}

TEST(resources_without_a_common_memory_type_never_share_a_slot)
{
    const frame_graph_input *const input = INPUT(PASSES(GRAPHICS("a", create("x", DEPTH, ACCESS_DEPTH_ATTACHMENT)),
                                                        GRAPHICS("b", create("y", IMAGE, ACCESS_COLOR_ATTACHMENT)),
                                                        GRAPHICS("c", create("z", DEPTH, ACCESS_DEPTH_ATTACHMENT))),
                                                 .keep_all = true);
    const frame_graph_plan *const plan = compile(input);
    CHECK(!share_slot(plan, input, "x", "y") && share_slot(plan, input, "x", "z"));
}

TEST(slot_keeps_only_the_memory_types_that_all_its_users_have)
{
    frame_graph_resource_desc either = IMAGE;
    either.format = VK_FORMAT_R16_SFLOAT;
    const frame_graph_input *const input = INPUT(PASSES(GRAPHICS("a", create("x", either, ACCESS_COLOR_ATTACHMENT)),
                                                        GRAPHICS("b", create("y", DEPTH, ACCESS_DEPTH_ATTACHMENT)),
                                                        GRAPHICS("c", create("z", IMAGE, ACCESS_COLOR_ATTACHMENT))),
                                                 .keep_all = true);
    const frame_graph_plan *const plan = compile(input);
    CHECK(share_slot(plan, input, "x", "y") && !share_slot(plan, input, "y", "z"));
    CHECK(plan->slots[resource(plan, input, "y")->slot].requirements.memoryTypeBits == 2);
}

TEST(smallest_slot_that_need_not_grow_is_taken)
{
    const frame_graph_resource_desc sizes[] = {{.size = 100}, {.size = 10000}, {.size = 1000}, {.size = 900}};
    const frame_graph_input *const input = INPUT(PASSES(COMPUTE("a", create("small", sizes[0], ACCESS_STORAGE_WRITE),
                                                                create("large", sizes[1], ACCESS_STORAGE_WRITE),
                                                                create("middle", sizes[2], ACCESS_STORAGE_WRITE)),
                                                        COMPUTE("b", create("next", sizes[3], ACCESS_STORAGE_WRITE))),
                                                 .keep_all = true);
    const frame_graph_plan *const plan = compile(input);
    CHECK(plan->slot_count == 3 && share_slot(plan, input, "next", "middle"));
}

TEST(usage_flags_are_gathered_over_all_versions)
{
    const frame_graph_input *const input =
        INPUT(PASSES(GRAPHICS("a", create("x", IMAGE, ACCESS_COLOR_ATTACHMENT)),
                     COMPUTE("b", modify("x", "y", ACCESS_STORAGE_READ_WRITE)), KEPT("c", reads("y", ACCESS_SAMPLED)),
                     COMPUTE("culled", reads("y", ACCESS_TRANSFER_READ))));
    CHECK(resource(compile(input), input, "x")->usage ==
          (VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | VK_IMAGE_USAGE_STORAGE_BIT | VK_IMAGE_USAGE_SAMPLED_BIT));
}

// ---- Load and store operations

TEST(load_and_store_operations_follow_from_edges)
{
    const frame_graph_input *const input =
        INPUT(PASSES(GRAPHICS("a", create_cleared("color", IMAGE, ACCESS_COLOR_ATTACHMENT),
                              create("normal", IMAGE, ACCESS_COLOR_ATTACHMENT),
                              create_cleared("depth", DEPTH, ACCESS_DEPTH_ATTACHMENT)),
                     GRAPHICS("b", modify("color", "lit", ACCESS_COLOR_ATTACHMENT)),
                     COMPUTE("culled", reads("normal", ACCESS_SAMPLED))),
              EXPORTS({"lit", ACCESS_NONE}));
    const frame_graph_plan *const plan = compile(input);
    const frame_graph_plan_use *const a = planned(plan, input, "a")->uses, *const b = planned(plan, input, "b")->uses;
    CHECK(a[0].load == VK_ATTACHMENT_LOAD_OP_CLEAR && a[0].store == VK_ATTACHMENT_STORE_OP_STORE);
    CHECK(a[1].load == VK_ATTACHMENT_LOAD_OP_DONT_CARE && a[1].store == VK_ATTACHMENT_STORE_OP_DONT_CARE);
    CHECK(a[2].load == VK_ATTACHMENT_LOAD_OP_CLEAR && a[2].store == VK_ATTACHMENT_STORE_OP_DONT_CARE);
    CHECK(b[0].load == VK_ATTACHMENT_LOAD_OP_LOAD && b[0].store == VK_ATTACHMENT_STORE_OP_STORE);
}

TEST(attachment_that_next_frame_reads_is_stored)
{
    const frame_graph_input *const input =
        INPUT(PASSES(pass_of("a", FRAME_GRAPH_GRAPHICS, true,
                             USES(previous("x", ACCESS_SAMPLED), create("x", IMAGE, ACCESS_COLOR_ATTACHMENT)))));
    CHECK(planned(compile(input), input, "a")->uses[1].store == VK_ATTACHMENT_STORE_OP_STORE);
}

// ---- History

TEST(history_is_outside_the_slots)
{
    frame_graph_pass_decl passes[5];
    chain_passes(passes);
    passes[4] = KEPT("e", reads("d", ACCESS_SAMPLED), previous("b", ACCESS_SAMPLED));
    const frame_graph_input *const input = INPUT(.passes = passes, .pass_count = 5);
    const frame_graph_plan *const plan = compile(input);
    CHECK(resource(plan, input, "b")->history && resource(plan, input, "b")->slot == FRAME_GRAPH_NONE);
    CHECK(!resource(plan, input, "a")->history);
    CHECK(share_slot(plan, input, "a", "c"));
}

TEST(history_that_only_a_culled_pass_reads_is_none)
{
    const frame_graph_input *const input =
        INPUT(PASSES(KEPT("a", create("x", IMAGE, ACCESS_STORAGE_WRITE)), COMPUTE("b", previous("x", ACCESS_SAMPLED))));
    const frame_graph_plan *const plan = compile(input);
    CHECK(!resource(plan, input, "x")->history && resource(plan, input, "x")->slot == 0);
}

TEST(last_frames_object_has_barriers_of_its_own)
{
    const frame_graph_input *const input =
        INPUT(PASSES(KEPT("taa", previous("x", ACCESS_SAMPLED), create("x", IMAGE, ACCESS_STORAGE_WRITE)),
                     pass_of("show", FRAME_GRAPH_TRANSFER, true, USES(reads("x", ACCESS_TRANSFER_READ))),
                     KEPT("zoom", previous("x", ACCESS_SAMPLED), reads("x", ACCESS_STORAGE_READ))));
    const frame_graph_plan *const plan = compile(input);
    CHECK_STRING(order_text(plan, input), "taa show zoom");
    const frame_graph_plan_use *const uses = planned(plan, input, "taa")->uses;
    CHECK(uses[0].previous && !uses[1].previous && uses[0].resource == uses[1].resource);
    // The first read starts from what a frame leaves behind; the second read of the same stage needs nothing more.
    const frame_graph_barrier first = previous_barrier_of(plan, input, "taa", "x");
    CHECK(first.old_layout == VK_IMAGE_LAYOUT_GENERAL && first.new_layout == VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL);
    CHECK(first.source_stages == COMPUTE_STAGE);
    CHECK(resource(plan, input, "x")->final.layout == VK_IMAGE_LAYOUT_GENERAL);
    CHECK(is_none(previous_barrier_of(plan, input, "zoom", "x")));
    // This frame's object starts from nothing.
    CHECK(barrier_of(plan, input, "taa", "x").old_layout == VK_IMAGE_LAYOUT_UNDEFINED);
}

TEST(last_frames_buffer_waits_even_without_a_layout)
{
    const frame_graph_input *const input =
        INPUT(PASSES(KEPT("a", previous("x", ACCESS_STORAGE_READ), create("x", BUFFER, ACCESS_STORAGE_WRITE))));
    const frame_graph_barrier barrier = previous_barrier_of(compile(input), input, "a", "x");
    CHECK(barrier.source_stages == COMPUTE_STAGE && barrier.source_mask == VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT);
    CHECK(barrier.old_layout == VK_IMAGE_LAYOUT_UNDEFINED && barrier.new_layout == VK_IMAGE_LAYOUT_UNDEFINED);
}

// ---- Errors

TEST(compile_error_leaves_no_half_built_state)
{
    frame_graph_pass_decl passes[VARIED_PASSES + 1];
    varied_passes(passes);
    frame_graph_input input = {
        .measure = measure,
        .passes = passes,
        .pass_count = VARIED_PASSES,
        .imports = VARIED_IMPORT_LIST,
        .import_count = VARIED_IMPORTS,
    };
    const frame_graph_plan *const plan = compile(&input);
    const char *const text = frame_graph_plan_text(plan, &input, &memory);
    passes[VARIED_PASSES] = COMPUTE("broken", modify("nothing", "something", ACCESS_STORAGE_WRITE));
    input.pass_count = VARIED_PASSES + 1;
    check_error(&input, "\"broken\"");
    // The earlier plan still reads the same, and the next one comes out the same.
    input.pass_count = VARIED_PASSES;
    CHECK_STRING(frame_graph_plan_text(plan, &input, &memory), text);
    CHECK_STRING(frame_graph_plan_text(compile(&input), &input, &memory), text);
    CHECK_STRING(error, "");
}

TEST(two_makers_of_one_name_are_an_error)
{
    check_error(INPUT(PASSES(COMPUTE("b", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                             COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)))),
                "\"x\" has two makers: pass \"a\" and pass \"b\"");
    check_error(INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE))),
                      IMPORTS({"x", BUFFER, ACCESS_NONE, ACCESS_NONE})),
                "\"x\"&pass \"a\"&an import");
}

TEST(two_modifiers_of_one_version_are_an_error)
{
    check_error(INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                             COMPUTE("b", modify("x", "y", ACCESS_STORAGE_WRITE)),
                             COMPUTE("c", modify("x", "z", ACCESS_STORAGE_WRITE)))),
                "\"x\" has two modifiers: pass \"b\" and pass \"c\"");
}

TEST(cycle_is_an_error_that_names_its_passes)
{
    check_error(INPUT(PASSES(COMPUTE("a", reads("z", ACCESS_STORAGE_READ), create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                             COMPUTE("b", reads("x", ACCESS_STORAGE_READ), create("y", BUFFER, ACCESS_STORAGE_WRITE)),
                             COMPUTE("c", reads("y", ACCESS_STORAGE_READ), create("z", BUFFER, ACCESS_STORAGE_WRITE)),
                             COMPUTE("innocent", reads("z", ACCESS_STORAGE_READ)))),
                "pass \"a\" needs \"z\" of pass \"c\"&pass \"b\" needs \"x\" of pass \"a\"&pass \"c\" needs \"y\"");
    CHECK(!strstr(error, "innocent"));
}

TEST(reading_both_before_and_after_a_modification_is_a_cycle)
{
    check_error(INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                             COMPUTE("b", modify("x", "y", ACCESS_STORAGE_READ_WRITE)),
                             COMPUTE("c", reads("x", ACCESS_STORAGE_READ), reads("y", ACCESS_STORAGE_READ)))),
                "pass \"b\" modifies \"x\" after it is read by pass \"c\"&pass \"c\" needs \"y\" of pass \"b\"");
}

TEST(modification_of_its_own_outcome_is_an_error)
{
    check_error(INPUT(PASSES(COMPUTE("a", modify("x", "x", ACCESS_STORAGE_READ_WRITE)))), "\"x\"&\"a\"");
}

TEST(read_of_nothing_is_an_error)
{
    check_error(INPUT(PASSES(COMPUTE("a", reads("x|y", ACCESS_SAMPLED)))), "Pass \"a\" reads \"x|y\"&nothing");
    check_error(INPUT(PASSES(COMPUTE("a", modify("x", "y", ACCESS_STORAGE_WRITE)))), "Pass \"a\" modifies \"x\"");
    check_error(INPUT(PASSES(COMPUTE("a", previous("x", ACCESS_SAMPLED)))), "Pass \"a\" reads last frame's \"x\"");
    check_error(INPUT(EXPORTS({"x", ACCESS_NONE})), "\"x\" is exported&nothing");
}

TEST(history_of_a_version_that_is_later_modified_is_an_error)
{
    check_error(INPUT(PASSES(COMPUTE("a", create("x", IMAGE, ACCESS_STORAGE_WRITE), previous("x", ACCESS_SAMPLED)),
                             COMPUTE("b", modify("x", "y", ACCESS_STORAGE_READ_WRITE)))),
                "Pass \"a\"&\"x\"&pass \"b\" modifies");
}

TEST(history_of_an_import_is_an_error)
{
    check_error(
        INPUT(PASSES(COMPUTE("a", previous("x", ACCESS_SAMPLED))), IMPORTS({"x", IMAGE, ACCESS_SAMPLED, ACCESS_NONE})),
        "\"a\"&\"x\"&imports");
}

TEST(desc_of_size_zero_is_an_error)
{
    check_error(INPUT(PASSES(COMPUTE(
                    "a", create("x", (frame_graph_resource_desc){.kind = FRAME_GRAPH_BUFFER}, ACCESS_STORAGE_WRITE)))),
                "\"a\"&\"x\"&zero");
    check_error(
        INPUT(PASSES(COMPUTE("a", create("x",
                                         (frame_graph_resource_desc){
                                             .kind = FRAME_GRAPH_IMAGE, .format = VK_FORMAT_R8_UNORM, .width = 3},
                                         ACCESS_STORAGE_WRITE)))),
        "\"a\"&\"x\"&3x0");
    check_error(INPUT(PASSES(COMPUTE(
                    "a", create("x", (frame_graph_resource_desc){.kind = FRAME_GRAPH_IMAGE, .width = 3, .height = 3},
                                ACCESS_STORAGE_WRITE)))),
                "\"a\"&\"x\"&format");
}

TEST(creating_an_acceleration_structure_is_an_error)
{
    check_error(INPUT(PASSES(COMPUTE("a", create("x", STRUCTURE, ACCESS_BUILD_WRITE)))), "\"a\"&\"x\"&imported");
}

TEST(access_must_match_the_use)
{
    check_error(INPUT(PASSES(COMPUTE("a", create("x", IMAGE, ACCESS_SAMPLED)))), "\"a\" creates \"x\"&\"sampled\"");
    check_error(INPUT(PASSES(COMPUTE("a", create("x", IMAGE, ACCESS_STORAGE_WRITE)),
                             COMPUTE("b", reads("x", ACCESS_STORAGE_WRITE)))),
                "\"b\" reads \"x\"&\"storage write\"&writes");
    check_error(INPUT(PASSES(COMPUTE("a", reads("x", ACCESS_NONE)))), "\"a\" reads \"x\"&\"none\"");
}

TEST(access_must_fit_the_kind_of_the_resource)
{
    check_error(INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                             COMPUTE("b", reads("x", ACCESS_SAMPLED)))),
                "\"b\" reads \"x\"&\"sampled\"&buffer");
    check_error(INPUT(IMPORTS({"x", BUFFER, ACCESS_SAMPLED, ACCESS_NONE})), "\"x\"&\"sampled\"&buffer");
    check_error(INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE))), EXPORTS({"x", ACCESS_SAMPLED})),
                "\"x\"&\"sampled\"&buffer");
}

TEST(access_must_fit_the_kind_of_the_pass)
{
    check_error(INPUT(PASSES(TRANSFER("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)))),
                "\"a\"&\"x\"&\"storage write\"&transfer pass");
    check_error(INPUT(PASSES(COMPUTE("a", create("x", IMAGE, ACCESS_COLOR_ATTACHMENT)))), "\"a\"&\"x\"&compute pass");
    check_error(INPUT(PASSES(COMPUTE("a", create("x", HOST_BUFFER, ACCESS_HOST_WRITE)))), "\"a\"&\"x\"&compute pass");
}

TEST(host_pass_on_device_memory_is_an_error)
{
    check_error(INPUT(PASSES(HOST("a", create("x", BUFFER, ACCESS_HOST_WRITE)))), "\"a\"&\"x\"&host-visible");
}

TEST(two_layouts_of_one_image_in_one_pass_are_an_error)
{
    check_error(INPUT(PASSES(COMPUTE("a", create("x", IMAGE, ACCESS_STORAGE_WRITE)),
                             COMPUTE("b", reads("x", ACCESS_SAMPLED), reads("x", ACCESS_STORAGE_READ)))),
                "\"b\"&\"x\"&\"sampled\"&\"storage read\"");
    // This frame's and last frame's image are two images.
    compile(INPUT(PASSES(KEPT("a", create("x", IMAGE, ACCESS_STORAGE_WRITE), previous("x", ACCESS_SAMPLED)))));
}

TEST(attachments_of_different_sizes_are_an_error)
{
    frame_graph_resource_desc half = IMAGE;
    half.width /= 2;
    check_error(INPUT(PASSES(GRAPHICS("a", create("x", IMAGE, ACCESS_COLOR_ATTACHMENT),
                                      create("y", half, ACCESS_COLOR_ATTACHMENT)))),
                "\"a\"&\"x\" is 64x32&\"y\" is 32x32");
}

TEST(graphics_pass_without_attachments_is_an_error)
{
    check_error(INPUT(PASSES(GRAPHICS("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)))), "\"a\"&attachment");
}

TEST(two_depth_attachments_are_an_error)
{
    check_error(INPUT(PASSES(GRAPHICS("a", create("x", DEPTH, ACCESS_DEPTH_ATTACHMENT),
                                      create("y", DEPTH, ACCESS_DEPTH_ATTACHMENT)))),
                "\"a\"&2 depth");
}

TEST(last_frames_image_as_attachment_is_an_error)
{
    check_error(
        INPUT(PASSES(GRAPHICS("a", create("x", DEPTH, ACCESS_DEPTH_ATTACHMENT)),
                     GRAPHICS("b", previous("x", ACCESS_DEPTH_TEST), create("y", IMAGE, ACCESS_COLOR_ATTACHMENT)))),
        "\"b\"&\"x\"&attachment");
}

TEST(clearing_what_is_no_attachment_is_an_error)
{
    check_error(INPUT(PASSES(COMPUTE("a", create_cleared("x", IMAGE, ACCESS_STORAGE_WRITE)))), "\"a\"&\"x\"&clears");
}

TEST(malformed_names_are_errors)
{
    check_error(INPUT(PASSES(COMPUTE("a", reads("x||y", ACCESS_SAMPLED)))), "\"a\"&\"x||y\"");
    check_error(INPUT(PASSES(COMPUTE("a", reads("-", ACCESS_SAMPLED)))), "\"a\"&\"-\"");
    check_error(INPUT(PASSES(COMPUTE("a", reads("-|x", ACCESS_SAMPLED)))), "\"a\"&\"-|x\"");
    check_error(INPUT(PASSES(COMPUTE("a", reads(NULL, ACCESS_SAMPLED)))), "\"a\"&\"\"");
    check_error(INPUT(PASSES(COMPUTE("a", create("x|y", BUFFER, ACCESS_STORAGE_WRITE)))), "\"a\"&\"x|y\"");
    check_error(INPUT(IMPORTS({"x|y", BUFFER, ACCESS_NONE, ACCESS_NONE})), "\"x|y\"");
    check_error(INPUT(EXPORTS({"", ACCESS_NONE})), "export&\"\"");
}

TEST(reading_an_import_without_contents_is_an_error)
{
    check_error(
        INPUT(PASSES(COMPUTE("a", reads("x", ACCESS_UNIFORM))), IMPORTS({"x", BUFFER, ACCESS_NONE, ACCESS_NONE})),
        "\"a\"&\"x\"&undefined");
}

TEST(export_of_a_version_that_is_later_modified_is_an_error)
{
    check_error(INPUT(PASSES(COMPUTE("a", create("x", BUFFER, ACCESS_STORAGE_WRITE)),
                             COMPUTE("b", modify("x", "y", ACCESS_STORAGE_READ_WRITE))),
                      EXPORTS({"x", ACCESS_NONE})),
                "\"x\" is exported&pass \"b\" modifies");
}

TEST(two_after_states_of_one_resource_are_an_error)
{
    check_error(INPUT(PASSES(COMPUTE("a", create("x", IMAGE, ACCESS_STORAGE_WRITE))),
                      EXPORTS({"x", ACCESS_SAMPLED}, {"y|x", ACCESS_TRANSFER_READ})),
                "\"x\"&\"sampled\"&\"transfer read\"");
    compile(INPUT(PASSES(COMPUTE("a", create("x", IMAGE, ACCESS_STORAGE_WRITE))),
                  EXPORTS({"x", ACCESS_SAMPLED}, {"x", ACCESS_SAMPLED}, {"x", ACCESS_NONE})));
}

TEST(long_names_are_cut_off_in_messages)
{
    char name[600];
    memset(name, 'n', sizeof(name) - 1);
    name[sizeof(name) - 1] = 0;
    CHECK(!frame_graph_plan_compile(INPUT(PASSES(COMPUTE("a", reads(name, ACCESS_SAMPLED)))), &memory, error));
    CHECK(strlen(error) == sizeof(error) - 1);
}

// ---- Text

TEST(text_and_dot_show_passes_resources_and_reasons)
{
    frame_graph_pass_decl passes[VARIED_PASSES + 1];
    varied_passes(passes);
    passes[VARIED_PASSES] = COMPUTE("idle", create("unread", BUFFER, ACCESS_STORAGE_WRITE));
    const frame_graph_input *const input = INPUT(.passes = passes, .pass_count = VARIED_PASSES + 1,
                                                 .imports = VARIED_IMPORT_LIST, .import_count = VARIED_IMPORTS);
    const frame_graph_plan *const plan = compile(input);
    const char *const text = frame_graph_plan_text(plan, input, &memory);
    CHECK(strstr(text, "gbuffer (graphics)") && strstr(text, "nobody reads \"unread\""));
    CHECK(strstr(text, "modifies \"radiance\" into \"fogged\" as storage read and write"));
    CHECK(strstr(text, "undefined -> color attachment") &&
          strstr(text, "\"resolved\": image 64x32, format 97, history"));
    CHECK(!strstr(text, "unknown"));
    const char *const dot = frame_graph_plan_dot(plan, input, &memory);
    CHECK(strncmp(dot, "digraph", 7) == 0 && strstr(dot, "-> \"fogged\"") && strstr(dot, "last frame"));
}

TEST(empty_graph_compiles_to_an_empty_plan)
{
    const frame_graph_plan *const plan = compile(INPUT(.keep_all = true));
    CHECK(plan->order_count == 0 && plan->resource_count == 0 && plan->final_barrier_count == 0);
}

TEST(every_access_is_described)
{
    for (uint32_t access = 0; access < ACCESS_COUNT; access++) {
        const frame_graph_access_info *const info = frame_graph_access_describe(access);
        CHECK(info->name && *info->name);
        CHECK(access == ACCESS_NONE || info->shader || info->stages);
        CHECK(access == ACCESS_NONE || (info->mask && info->resource_kinds && info->pass_kinds));
        const bool image = info->resource_kinds & 1u << FRAME_GRAPH_IMAGE;
        CHECK(image == (info->image_usage != 0) && image == (info->layout != VK_IMAGE_LAYOUT_UNDEFINED));
    }
}

int main(void)
{
    RUN(order_follows_data_and_not_registration);
    RUN(reader_runs_before_the_modifier_of_what_it_reads);
    RUN(a_pass_runs_right_before_what_needs_it);
    RUN(plan_is_the_same_under_any_order_of_registration);
    RUN(passes_of_one_name_are_told_apart_by_what_they_declare);
    RUN(plan_is_the_same_with_culling_off_when_nothing_is_culled);
    RUN(errors_are_found_in_passes_that_would_be_culled);
    RUN(pass_nobody_reads_is_culled_and_says_so);
    RUN(one_switch_turns_culling_off);
    RUN(pass_marked_keep_is_kept_with_all_that_it_needs);
    RUN(chain_that_nobody_reads_is_culled_as_a_whole);
    RUN(modifier_that_nobody_reads_is_culled_and_the_maker_stays);
    RUN(modifier_of_an_import_is_never_culled);
    RUN(acceleration_structure_that_nobody_traces_is_not_built);
    RUN(history_alone_keeps_no_pass_alive);
    RUN(history_keeps_its_last_maker_alive);
    RUN(first_alternative_with_a_maker_is_meant);
    RUN(optional_use_without_a_maker_is_absent);
    RUN(optional_modification_of_nothing_makes_nothing);
    RUN(a_list_names_itself_and_each_of_its_alternatives);
    RUN(find_knows_every_version_of_a_resource);
    RUN(read_waits_for_the_write);
    RUN(write_after_two_reads_waits_for_both);
    RUN(write_after_a_read_that_waited_orders_execution_only);
    RUN(write_after_write_waits_and_makes_available);
    RUN(read_after_read_in_the_same_stage_and_layout_needs_no_barrier);
    RUN(each_stage_that_reads_waits_for_the_write_once);
    RUN(what_one_stage_sees_is_not_taken_for_seen_by_another);
    RUN(change_of_layout_between_two_reads_waits_for_the_first_read);
    RUN(read_after_a_change_of_layout_waits_for_the_change);
    RUN(transient_image_starts_from_undefined_and_waits_for_nothing);
    RUN(first_write_of_a_buffer_needs_no_barrier);
    RUN(two_uses_of_one_buffer_in_a_pass_make_one_barrier);
    RUN(pass_may_use_what_it_makes);
    RUN(depth_that_is_only_tested_stays_readable);
    RUN(acceleration_structure_is_built_before_it_is_traced);
    RUN(ray_tracing_pass_waits_and_is_waited_for_in_its_own_stage);
    RUN(host_pass_waits_for_the_device_and_the_device_for_it);
    RUN(imports_return_to_their_after_state);
    RUN(import_waits_for_what_was_written_before_the_frame);
    RUN(import_without_contents_starts_from_undefined_and_is_not_loaded);
    RUN(exports_move_to_their_after_state_and_get_its_usage);
    RUN(exports_are_kept_out_of_aliasing_from_their_last_use_on);
    RUN(resources_whose_lifetimes_do_not_meet_share_a_slot);
    RUN(reuse_of_a_slot_waits_for_its_previous_user_and_starts_from_undefined);
    RUN(reuse_of_a_buffer_slot_waits_for_its_last_reader);
    RUN(reuse_of_a_buffer_slot_waits_for_writes_that_nobody_read);
    RUN(reuse_of_a_buffer_slot_covers_the_clearing_of_counters);
    RUN(slot_takes_the_largest_needs_of_its_users);
    RUN(buffers_and_images_never_share_a_slot);
    RUN(host_buffers_share_slots_with_host_buffers_only);
    RUN(resources_without_a_common_memory_type_never_share_a_slot);
    RUN(slot_keeps_only_the_memory_types_that_all_its_users_have);
    RUN(smallest_slot_that_need_not_grow_is_taken);
    RUN(usage_flags_are_gathered_over_all_versions);
    RUN(load_and_store_operations_follow_from_edges);
    RUN(attachment_that_next_frame_reads_is_stored);
    RUN(history_is_outside_the_slots);
    RUN(history_that_only_a_culled_pass_reads_is_none);
    RUN(last_frames_object_has_barriers_of_its_own);
    RUN(last_frames_buffer_waits_even_without_a_layout);
    RUN(compile_error_leaves_no_half_built_state);
    RUN(two_makers_of_one_name_are_an_error);
    RUN(two_modifiers_of_one_version_are_an_error);
    RUN(cycle_is_an_error_that_names_its_passes);
    RUN(reading_both_before_and_after_a_modification_is_a_cycle);
    RUN(modification_of_its_own_outcome_is_an_error);
    RUN(read_of_nothing_is_an_error);
    RUN(history_of_a_version_that_is_later_modified_is_an_error);
    RUN(history_of_an_import_is_an_error);
    RUN(desc_of_size_zero_is_an_error);
    RUN(creating_an_acceleration_structure_is_an_error);
    RUN(access_must_match_the_use);
    RUN(access_must_fit_the_kind_of_the_resource);
    RUN(access_must_fit_the_kind_of_the_pass);
    RUN(host_pass_on_device_memory_is_an_error);
    RUN(two_layouts_of_one_image_in_one_pass_are_an_error);
    RUN(attachments_of_different_sizes_are_an_error);
    RUN(graphics_pass_without_attachments_is_an_error);
    RUN(two_depth_attachments_are_an_error);
    RUN(last_frames_image_as_attachment_is_an_error);
    RUN(clearing_what_is_no_attachment_is_an_error);
    RUN(malformed_names_are_errors);
    RUN(reading_an_import_without_contents_is_an_error);
    RUN(export_of_a_version_that_is_later_modified_is_an_error);
    RUN(two_after_states_of_one_resource_are_an_error);
    RUN(long_names_are_cut_off_in_messages);
    RUN(text_and_dot_show_passes_resources_and_reasons);
    RUN(empty_graph_compiles_to_an_empty_plan);
    RUN(every_access_is_described);
    arena_fini(&memory);
    return test_end();
}
