// The frame graph on a device: what comes out of passes that alias, read history, run on the host and draw.
#include "engine/frame_graph.h"
#include "test.h"
#include "test_shaders_shaders.h"

enum { COUNT = 4096, WIDTH = 32, HEIGHT = 16 };

static gpu *device;
static gpu_pipeline fill_pipeline, step_pipeline, copy_pipeline, texel_fill_pipeline, texel_step_pipeline,
    texel_count_pipeline, arguments_pipeline;

static void pipelines_create(void)
{
    const struct {
        gpu_pipeline *pipeline;
        const gpu_shader *shader;
    } list[] = {
        {&fill_pipeline, &shader_frame_graph_fill_comp},
        {&step_pipeline, &shader_frame_graph_step_comp},
        {&copy_pipeline, &shader_frame_graph_copy_comp},
        {&texel_fill_pipeline, &shader_frame_graph_texel_fill_comp},
        {&texel_step_pipeline, &shader_frame_graph_texel_step_comp},
        {&texel_count_pipeline, &shader_frame_graph_texel_count_comp},
        {&arguments_pipeline, &shader_frame_graph_arguments_comp},
    };
    for (size_t i = 0; i < countof(list); i++) {
        *list[i].pipeline = gpu_compute_pipeline_create(device, &(gpu_compute_pipeline_desc){.shader = list[i].shader});
    }
}

static void pipelines_destroy(void)
{
    const gpu_pipeline list[] = {fill_pipeline,       step_pipeline,        copy_pipeline,     texel_fill_pipeline,
                                 texel_step_pipeline, texel_count_pipeline, arguments_pipeline};
    for (size_t i = 0; i < countof(list); i++) {
        gpu_pipeline_destroy(device, list[i]);
    }
}

// ---- Passes

typedef struct dispatch {
    gpu_pipeline pipeline;
    uint32_t x, y;
    uint32_t push;
    bool pushes;
} dispatch;

static void dispatch_execute(const frame_graph_context *context, void *user)
{
    const dispatch *const work = user;
    frame_graph_bind(context, work->pipeline);
    if (work->pushes) {
        gpu_push(context->commands, &work->push, sizeof(work->push));
    }
    gpu_dispatch(context->commands, work->x, work->y, 1);
}

static void nothing_execute(const frame_graph_context *context, void *user)
{
    (void)context, (void)user;
}

static frame_graph_pass *pass_add(frame_graph *graph, const char *name, dispatch work)
{
    const frame_graph_pass_desc desc = {.name = name,
                                        .kind = FRAME_GRAPH_COMPUTE,
                                        .execute = dispatch_execute,
                                        .user = &work,
                                        .user_size = sizeof(work)};
    return frame_graph_pass_add(graph, &desc);
}

static void fill_add(frame_graph *graph, const char *name, uint32_t seed)
{
    const frame_graph_resource_desc desc = frame_graph_buffer_of(COUNT * sizeof(uint32_t));
    frame_graph_pass *const pass = pass_add(
        graph, name, (dispatch){.pipeline = fill_pipeline, .x = COUNT / 64, .y = 1, .push = seed, .pushes = true});
    frame_graph_create_resource(pass, name, &desc, ACCESS_STORAGE_WRITE);
}

static void step_add(frame_graph *graph, const char *from, const char *to)
{
    const frame_graph_resource_desc desc = frame_graph_buffer_of(COUNT * sizeof(uint32_t));
    frame_graph_pass *const pass = pass_add(graph, to, (dispatch){.pipeline = step_pipeline, .x = COUNT / 64, .y = 1});
    frame_graph_read(pass, from, ACCESS_STORAGE_READ);
    frame_graph_create_resource(pass, to, &desc, ACCESS_STORAGE_WRITE);
}

static const char *const LINKS[] = {"a", "b", "c", "d", "e", "f", "g", "h"};

// A fill and seven steps, registered from the last to the first.
static void chain_add(frame_graph *graph, uint32_t seed)
{
    for (size_t i = countof(LINKS) - 1; i > 0; i--) {
        step_add(graph, LINKS[i - 1], LINKS[i]);
    }
    fill_add(graph, LINKS[0], seed);
    frame_graph_export(graph, LINKS[countof(LINKS) - 1], ACCESS_TRANSFER_READ);
}

static void fill_expected(uint32_t *numbers, uint32_t seed)
{
    for (uint32_t i = 0; i < COUNT; i++) {
        numbers[i] = i * 2654435761u + seed;
    }
}

static void step_expected(uint32_t *numbers)
{
    const uint32_t first = numbers[0];
    for (uint32_t i = 0; i < COUNT; i++) {
        numbers[i] = numbers[i] * 1664525u + (i + 1 < COUNT ? numbers[i + 1] : first);
    }
}

static void chain_expected(uint32_t *numbers, uint32_t seed)
{
    fill_expected(numbers, seed);
    for (size_t i = 1; i < countof(LINKS); i++) {
        step_expected(numbers);
    }
}

static void export_read(frame_graph *graph, const char *name, uint32_t *numbers)
{
    memset(numbers, 0xcc, COUNT * sizeof(*numbers));
    CHECK(gpu_buffer_read(device, frame_graph_find_buffer(graph, name), 0, numbers, COUNT * sizeof(*numbers)));
}

// ---- Tests

TEST(chain_through_aliased_buffers_gives_the_right_bytes)
{
    frame_graph *const graph = frame_graph_create(device);
    frame_graph_begin(graph);
    CHECK(frame_graph_dump_text(graph) == NULL);
    chain_add(graph, 17);
    CHECK(frame_graph_execute(graph));
    static uint32_t actual[COUNT], expected[COUNT];
    export_read(graph, "h", actual);
    chain_expected(expected, 17);
    CHECK(memcmp(actual, expected, sizeof(actual)) == 0);
    CHECK(frame_graph_find_buffer(graph, "g").id == 0); // exports only
    char *const text = frame_graph_dump_text(graph);
    CHECK(strstr(text, "slot 1") && !strstr(text, "slot 2"));
    free(text);
    char *const dot = frame_graph_dump_dot(graph);
    CHECK(strncmp(dot, "digraph", 7) == 0);
    free(dot);
    frame_graph_destroy(graph);
}

TEST(chain_through_aliased_images_gives_the_right_texels)
{
    frame_graph *const graph = frame_graph_create(device);
    const frame_graph_resource_desc desc = frame_graph_image_of(VK_FORMAT_R32_UINT, WIDTH, HEIGHT);
    frame_graph_begin(graph);
    frame_graph_pass *const fill = pass_add(
        graph, "fill",
        (dispatch){.pipeline = texel_fill_pipeline, .x = WIDTH / 8, .y = HEIGHT / 8, .push = 5, .pushes = true});
    frame_graph_create_resource(fill, LINKS[0], &desc, ACCESS_STORAGE_WRITE);
    for (size_t i = 1; i < countof(LINKS); i++) {
        frame_graph_pass *const step =
            pass_add(graph, LINKS[i], (dispatch){.pipeline = texel_step_pipeline, .x = WIDTH / 8, .y = HEIGHT / 8});
        frame_graph_read(step, LINKS[i - 1], ACCESS_SAMPLED);
        frame_graph_create_resource(step, LINKS[i], &desc, ACCESS_STORAGE_WRITE);
    }
    frame_graph_export(graph, "h", ACCESS_TRANSFER_READ);
    CHECK(frame_graph_execute(graph));

    uint32_t texels[HEIGHT][WIDTH];
    CHECK(gpu_image_read(device, frame_graph_find_image(graph, "h"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels,
                         sizeof(texels)));
    bool equal = true;
    for (uint32_t y = 0; y < HEIGHT; y++) {
        uint32_t row[WIDTH];
        for (uint32_t x = 0; x < WIDTH; x++) {
            row[x] = x * 7 + y * 1000 + 5;
        }
        for (size_t i = 1; i < countof(LINKS); i++) {
            const uint32_t first = row[0];
            for (uint32_t x = 0; x < WIDTH; x++) {
                row[x] = row[x] * 3 + (x + 1 < WIDTH ? row[x + 1] : first);
            }
        }
        equal = equal && memcmp(row, texels[y], sizeof(row)) == 0;
    }
    CHECK(equal);
    frame_graph_destroy(graph);
}

typedef struct counter {
    bool valid; // what the pass was told last
} counter;

static void count_execute(const frame_graph_context *context, void *user)
{
    counter *const state = user;
    state->valid = frame_graph_history_valid(context, "counts");
    const uint32_t valid = state->valid;
    frame_graph_bind(context, texel_count_pipeline);
    gpu_push(context->commands, &valid, sizeof(valid));
    gpu_dispatch(context->commands, WIDTH / 8, HEIGHT / 8, 1);
}

static void count_add(frame_graph *graph, counter *state, uint32_t width)
{
    const frame_graph_resource_desc desc = frame_graph_image_of(VK_FORMAT_R32_UINT, width, HEIGHT);
    const frame_graph_pass_desc pass_desc = {
        .name = "count", .kind = FRAME_GRAPH_COMPUTE, .keep = true, .execute = count_execute, .user = state};
    frame_graph_pass *const pass = frame_graph_pass_add(graph, &pass_desc);
    frame_graph_read_previous(pass, "counts", ACCESS_SAMPLED);
    frame_graph_create_resource(pass, "counts", &desc, ACCESS_STORAGE_WRITE);
}

// The count in the first texel after one more frame.
static uint32_t count_frame(frame_graph *graph, counter *state, uint32_t width)
{
    frame_graph_begin(graph);
    count_add(graph, state, width);
    frame_graph_export(graph, "counts", ACCESS_TRANSFER_READ);
    CHECK(frame_graph_execute(graph));
    static uint32_t texels[HEIGHT * WIDTH];
    CHECK(gpu_image_read(device, frame_graph_find_image(graph, "counts"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels,
                         width * HEIGHT * sizeof(texels[0])));
    return texels[0];
}

TEST(history_is_invalid_on_the_first_frame_and_after_a_resize)
{
    frame_graph *const graph = frame_graph_create(device);
    counter state;
    CHECK(count_frame(graph, &state, WIDTH) == 1 && !state.valid);
    CHECK(count_frame(graph, &state, WIDTH) == 2 && state.valid);
    CHECK(count_frame(graph, &state, WIDTH) == 3 && state.valid);
    CHECK(count_frame(graph, &state, WIDTH / 2) == 1 && !state.valid);
    CHECK(count_frame(graph, &state, WIDTH / 2) == 2 && state.valid);
    frame_graph_destroy(graph);
}

TEST(history_outlives_what_is_exported)
{
    frame_graph *const graph = frame_graph_create(device);
    counter state;
    frame_graph_begin(graph);
    count_add(graph, &state, WIDTH);
    CHECK(frame_graph_execute(graph));
    CHECK(count_frame(graph, &state, WIDTH) == 2 && state.valid);
    frame_graph_destroy(graph);
}

TEST(history_is_invalid_after_a_cut_and_after_a_frame_without_it)
{
    frame_graph *const graph = frame_graph_create(device);
    counter state;
    count_frame(graph, &state, WIDTH);
    CHECK(count_frame(graph, &state, WIDTH) == 2);
    frame_graph_history_drop(graph);
    CHECK(count_frame(graph, &state, WIDTH) == 1 && !state.valid);
    CHECK(count_frame(graph, &state, WIDTH) == 2 && state.valid);
    frame_graph_begin(graph);
    CHECK(frame_graph_execute(graph));
    CHECK(count_frame(graph, &state, WIDTH) == 1 && !state.valid);
    frame_graph_destroy(graph);
}

TEST(declaration_error_is_reported_and_keeps_the_history)
{
    frame_graph *const graph = frame_graph_create(device);
    counter state;
    CHECK(count_frame(graph, &state, WIDTH) == 1);
    const VkDeviceSize used = gpu_memory_used(device);
    frame_graph_begin(graph);
    count_add(graph, &state, WIDTH);
    step_add(graph, "nothing", "something");
    CHECK(!frame_graph_execute(graph));
    CHECK(frame_graph_dump_text(graph) == NULL);
    CHECK(frame_graph_find_image(graph, "counts").id == 0);
    CHECK(gpu_memory_used(device) == used);
    CHECK(count_frame(graph, &state, WIDTH) == 2 && state.valid);
    frame_graph_destroy(graph);
}

static void host_step_execute(const frame_graph_context *context, void *user)
{
    (void)user;
    CHECK(context->commands == NULL);
    const uint32_t *const from = gpu_buffer_map(context->gpu, frame_graph_buffer(context, "from_device"));
    uint32_t *const to = gpu_buffer_map(context->gpu, frame_graph_buffer(context, "from_host"));
    memcpy(to, from, COUNT * sizeof(*to));
    step_expected(to);
}

TEST(host_pass_sees_what_the_device_made_and_the_device_what_it_made)
{
    frame_graph *const graph = frame_graph_create(device);
    frame_graph_resource_desc shared = frame_graph_buffer_of(COUNT * sizeof(uint32_t));
    shared.host = true;
    static uint32_t actual[COUNT], expected[COUNT];
    for (uint32_t frame = 0; frame < 3; frame++) {
        frame_graph_begin(graph);
        fill_add(graph, "filled", frame);
        frame_graph_pass *const before =
            pass_add(graph, "before", (dispatch){.pipeline = step_pipeline, .x = COUNT / 64, .y = 1});
        frame_graph_read(before, "filled", ACCESS_STORAGE_READ);
        frame_graph_create_resource(before, "from_device", &shared, ACCESS_STORAGE_WRITE);
        const frame_graph_pass_desc desc = {.name = "host", .kind = FRAME_GRAPH_HOST, .execute = host_step_execute};
        frame_graph_pass *const host = frame_graph_pass_add(graph, &desc);
        frame_graph_read(host, "from_device", ACCESS_HOST_READ);
        frame_graph_create_resource(host, "from_host", &shared, ACCESS_HOST_WRITE);
        step_add(graph, "from_host", "done");
        frame_graph_export(graph, "done", ACCESS_TRANSFER_READ);
        CHECK(frame_graph_execute(graph));
        export_read(graph, "done", actual);
        fill_expected(expected, frame);
        for (uint32_t i = 0; i < 3; i++) {
            step_expected(expected);
        }
        CHECK(memcmp(actual, expected, sizeof(actual)) == 0);
    }
    frame_graph_destroy(graph);
}

TEST(warm_frame_allocates_nothing)
{
    frame_graph *const graph = frame_graph_create(device);
    counter state;
    VkDeviceSize warm = 0;
    const VkDeviceSize start = gpu_memory_used(device);
    for (uint32_t frame = 0; frame < 5; frame++) {
        frame_graph_begin(graph);
        chain_add(graph, frame);
        count_add(graph, &state, WIDTH);
        CHECK(frame_graph_execute(graph));
        warm = frame ? warm : gpu_memory_used(device);
        CHECK(gpu_memory_used(device) == warm);
    }
    // Two slots, not eight buffers, and what is no longer used goes.
    CHECK(warm - start < 4 * COUNT * sizeof(uint32_t));
    for (uint32_t frame = 0; frame < 2; frame++) {
        frame_graph_begin(graph);
        CHECK(frame_graph_execute(graph));
    }
    CHECK(gpu_memory_used(device) == start);
    frame_graph_destroy(graph);
}

TEST(two_runs_give_the_same_bytes)
{
    static uint32_t first[COUNT], second[COUNT];
    for (uint32_t run = 0; run < 2; run++) {
        frame_graph *const graph = frame_graph_create(device);
        for (uint32_t frame = 0; frame < 3; frame++) {
            frame_graph_begin(graph);
            chain_add(graph, frame);
            CHECK(frame_graph_execute(graph));
        }
        export_read(graph, "h", run ? second : first);
        frame_graph_destroy(graph);
    }
    CHECK(memcmp(first, second, sizeof(first)) == 0);
}

static void optional_execute(const frame_graph_context *context, void *user)
{
    CHECK(frame_graph_present(context, "in") && !frame_graph_present(context, "mask"));
    CHECK(frame_graph_present(context, "out") && frame_graph_buffer(context, "mask").id == 0);
    CHECK(frame_graph_buffer(context, "other|in").id == frame_graph_buffer(context, "in").id);
    dispatch_execute(context, user);
}

TEST(absent_optional_use_keeps_its_binding)
{
    // The shader reads binding 0 and writes binding 2.
    frame_graph *const graph = frame_graph_create(device);
    const frame_graph_resource_desc buffer = frame_graph_buffer_of(COUNT * sizeof(uint32_t));
    frame_graph_begin(graph);
    fill_add(graph, "in", 3);
    dispatch work = {.pipeline = copy_pipeline, .x = COUNT / 64, .y = 1};
    const frame_graph_pass_desc desc = {
        .name = "pass", .kind = FRAME_GRAPH_COMPUTE, .execute = optional_execute, .user = &work};
    frame_graph_pass *const pass = frame_graph_pass_add(graph, &desc);
    frame_graph_read(pass, "other|in", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "mask|-", ACCESS_STORAGE_READ);
    frame_graph_create_resource(pass, "out", &buffer, ACCESS_STORAGE_WRITE);
    frame_graph_export(graph, "out", ACCESS_TRANSFER_READ);
    CHECK(frame_graph_execute(graph));
    static uint32_t actual[COUNT], expected[COUNT];
    export_read(graph, "out", actual);
    fill_expected(expected, 3);
    CHECK(memcmp(actual, expected, sizeof(actual)) == 0);
    frame_graph_destroy(graph);
}

static void indirect_execute(const frame_graph_context *context, void *user)
{
    const uint32_t *const seed = user;
    frame_graph_bind(context, fill_pipeline);
    gpu_push(context->commands, seed, sizeof(*seed));
    gpu_dispatch_indirect(context->commands, frame_graph_buffer(context, "arguments"), 0);
}

static void zero_execute(const frame_graph_context *context, void *user)
{
    (void)user;
    gpu_buffer_fill(context->commands, frame_graph_buffer(context, "zeros"), 0, COUNT * sizeof(uint32_t), 0);
}

TEST(modified_import_keeps_what_indirect_dispatch_left_of_it)
{
    // The import is zeroed by a transfer; then as many groups as the device says fill its beginning.
    frame_graph *const graph = frame_graph_create(device);
    const gpu_buffer_desc import_desc = {
        .name = "numbers", .size = COUNT * sizeof(uint32_t), .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT};
    const gpu_buffer import = gpu_buffer_create(device, &import_desc);
    const uint32_t seed = 9, groups = 2;

    frame_graph_begin(graph);
    frame_graph_import_buffer(graph, "numbers", import, ACCESS_NONE, ACCESS_TRANSFER_READ);
    const frame_graph_pass_desc fill_desc = {.name = "fill",
                                             .kind = FRAME_GRAPH_COMPUTE,
                                             .execute = indirect_execute,
                                             .user = (void *)&seed,
                                             .user_size = sizeof(seed)};
    frame_graph_pass *const fill = frame_graph_pass_add(graph, &fill_desc);
    frame_graph_modify(fill, "zeros", "filled", ACCESS_STORAGE_WRITE);
    frame_graph_read(fill, "arguments", ACCESS_INDIRECT);
    frame_graph_pass *const arguments = pass_add(
        graph, "arguments", (dispatch){.pipeline = arguments_pipeline, .x = 1, .y = 1, .push = groups, .pushes = true});
    const frame_graph_resource_desc arguments_desc = frame_graph_buffer_of(3 * sizeof(uint32_t));
    frame_graph_create_resource(arguments, "arguments", &arguments_desc, ACCESS_STORAGE_WRITE);
    const frame_graph_pass_desc zero_desc = {.name = "zero", .kind = FRAME_GRAPH_TRANSFER, .execute = zero_execute};
    frame_graph_modify(frame_graph_pass_add(graph, &zero_desc), "numbers", "zeros", ACCESS_TRANSFER_WRITE);
    CHECK(frame_graph_execute(graph));

    static uint32_t actual[COUNT], expected[COUNT];
    CHECK(gpu_buffer_read(device, import, 0, actual, sizeof(actual)));
    fill_expected(expected, seed);
    memset(expected + groups * 64, 0, (COUNT - groups * 64) * sizeof(expected[0]));
    CHECK(memcmp(actual, expected, sizeof(actual)) == 0);
    frame_graph_destroy(graph);
    gpu_buffer_destroy(device, import);
}

static void size_execute(const frame_graph_context *context, void *user)
{
    uint32_t *const size = user;
    size[0] = context->width;
    size[1] = context->height;
}

TEST(graphics_pass_clears_keeps_and_tests_its_attachments)
{
    frame_graph *const graph = frame_graph_create(device);
    const frame_graph_resource_desc color = frame_graph_image_of(VK_FORMAT_R32_UINT, WIDTH, HEIGHT);
    const frame_graph_resource_desc depth = frame_graph_image_of(VK_FORMAT_D32_SFLOAT, WIDTH, HEIGHT);
    uint32_t size[2] = {0};
    frame_graph_begin(graph);
    const frame_graph_pass_desc draw_desc = {
        .name = "draw", .kind = FRAME_GRAPH_GRAPHICS, .execute = size_execute, .user = size};
    frame_graph_pass *const draw = frame_graph_pass_add(graph, &draw_desc);
    frame_graph_create_cleared(draw, "color", &color, ACCESS_COLOR_ATTACHMENT,
                               (VkClearValue){.color.uint32 = {41, 0, 0, 0}});
    frame_graph_create_cleared(draw, "depth", &depth, ACCESS_DEPTH_ATTACHMENT,
                               (VkClearValue){.depthStencil.depth = 0.25f});
    const frame_graph_pass_desc over_desc = {.name = "over", .kind = FRAME_GRAPH_GRAPHICS, .execute = nothing_execute};
    frame_graph_pass *const over = frame_graph_pass_add(graph, &over_desc);
    frame_graph_modify(over, "color", "overlaid", ACCESS_COLOR_ATTACHMENT);
    frame_graph_read(over, "depth", ACCESS_DEPTH_TEST_SAMPLED);
    frame_graph_pass *const step =
        pass_add(graph, "step", (dispatch){.pipeline = texel_step_pipeline, .x = WIDTH / 8, .y = HEIGHT / 8});
    frame_graph_read(step, "overlaid", ACCESS_SAMPLED);
    frame_graph_create_resource(step, "stepped", &color, ACCESS_STORAGE_WRITE);
    frame_graph_export(graph, "stepped", ACCESS_TRANSFER_READ);
    frame_graph_export(graph, "depth", ACCESS_TRANSFER_READ);
    CHECK(frame_graph_execute(graph));
    CHECK(size[0] == WIDTH && size[1] == HEIGHT);

    static uint32_t texels[WIDTH * HEIGHT];
    static float depths[WIDTH * HEIGHT];
    CHECK(gpu_image_read(device, frame_graph_find_image(graph, "stepped"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels,
                         sizeof(texels)));
    CHECK(gpu_image_read(device, frame_graph_find_image(graph, "depth"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, depths,
                         sizeof(depths)));
    CHECK(texels[0] == 41 * 4 && texels[WIDTH * HEIGHT - 1] == 41 * 4);
    CHECK(depths[0] == 0.25f && depths[WIDTH * HEIGHT - 1] == 0.25f);
    frame_graph_destroy(graph);
}

TEST(timings_come_in_order_of_execution)
{
    frame_graph *const graph = frame_graph_create(device);
    frame_graph_begin(graph);
    chain_add(graph, 1);
    CHECK(frame_graph_execute(graph));
    uint32_t count;
    const frame_graph_timing *const timings = frame_graph_timings(graph, &count);
    CHECK(count == countof(LINKS));
    for (uint32_t i = 0; i < count; i++) {
        CHECK_STRING(timings[i].name, LINKS[i]);
        CHECK(timings[i].milliseconds >= 0 && timings[i].milliseconds < 60e3);
    }
    frame_graph_destroy(graph);
}

TEST(culling_can_be_turned_off)
{
    frame_graph *const graph = frame_graph_create(device);
    uint32_t count;
    for (uint32_t enabled = 0; enabled < 2; enabled++) {
        frame_graph_cull_set(graph, enabled);
        frame_graph_begin(graph);
        fill_add(graph, "unread", 0);
        CHECK(frame_graph_execute(graph));
        frame_graph_timings(graph, &count);
        CHECK(count == 1 - enabled);
    }
    frame_graph_destroy(graph);
}

TEST(validation_layer_has_nothing_to_say)
{
    CHECK(gpu_validation_messages(device) == 0);
}

int main(void)
{
    device = gpu_create(&(gpu_desc){.validation = true});
    if (!device) {
        printf("skipped: no usable Vulkan device with a validation layer\n");
        return 77;
    }
    pipelines_create();
    RUN(chain_through_aliased_buffers_gives_the_right_bytes);
    RUN(chain_through_aliased_images_gives_the_right_texels);
    RUN(history_is_invalid_on_the_first_frame_and_after_a_resize);
    RUN(history_outlives_what_is_exported);
    RUN(history_is_invalid_after_a_cut_and_after_a_frame_without_it);
    RUN(declaration_error_is_reported_and_keeps_the_history);
    RUN(host_pass_sees_what_the_device_made_and_the_device_what_it_made);
    RUN(warm_frame_allocates_nothing);
    RUN(two_runs_give_the_same_bytes);
    RUN(absent_optional_use_keeps_its_binding);
    RUN(modified_import_keeps_what_indirect_dispatch_left_of_it);
    RUN(graphics_pass_clears_keeps_and_tests_its_attachments);
    RUN(timings_come_in_order_of_execution);
    RUN(culling_can_be_turned_off);
    RUN(validation_layer_has_nothing_to_say);
    pipelines_destroy();
    gpu_destroy(device);
    return test_end();
}
