// Building the hierarchy again: what an incremental build leaves is what a full one does, bit for bit.
//
//     device_lgh_build                 the tests, with a few hundred changes
//     device_lgh_build changes N       the first of them with N changes
//     device_lgh_build hash N          the hash of what is left after N changes
//     device_lgh_build bench N         milliseconds of a full build over N VPL slots of the atrium, of one with 1 % of
//     the
//                                      VPLs changed, and of none
#include "test.h"

#include "modules/lgh_build.h"
#include "modules/renderer.h"

#include <inttypes.h>

#define SCENES BUILD_DIR "/scenes/"

static gpu *device;

// ---- VPLs of our own in the place of traced ones

typedef struct given {
    gpu_buffer vpls, changed;
    vpl *data;
    uint32_t *bits; // of the slots that changed
    uint32_t slots, random;
} given;

static vpl_change given_change; // what the next frame is told

static vpl_change change_of(const renderer *r)
{
    (void)r;
    return given_change;
}

static void given_setup(renderer *r, void *state)
{
    given *g = state;
    frame_graph_import_buffer(r->graph, "vpls", g->vpls, ACCESS_TRANSFER_WRITE, ACCESS_NONE);
    frame_graph_import_buffer(r->graph, "vpl_changed", g->changed, ACCESS_TRANSFER_WRITE, ACCESS_NONE);
}

static void given_fini(renderer *r, void *state)
{
    given *g = state;
    gpu_buffer_destroy(r->gpu, g->vpls);
    gpu_buffer_destroy(r->gpu, g->changed);
    free(g->data);
    free(g->bits);
}

static given *given_create(renderer *r)
{
    given *g = renderer_pass_add(r, "given_vpls", sizeof *g, given_setup, given_fini);
    g->slots = r->settings.vpls;
    g->data = memory_alloc(g->slots * sizeof *g->data);
    g->bits = memory_alloc(div_up_u32(g->slots, 32) * 4);
    g->random = 1;
    const VkBufferUsageFlags usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    g->vpls = gpu_buffer_create(r->gpu, &(gpu_buffer_desc){.size = g->slots * sizeof *g->data, .usage = usage});
    g->changed = gpu_buffer_create(r->gpu, &(gpu_buffer_desc){.size = div_up_u32(g->slots, 32) * 4, .usage = usage});
    ecs_remove(r->world, renderer_pass_find(r, "vpl_trace"), r->pass);
    lgh_build_follow(r, change_of);
    return g;
}

static uint32_t random_below(given *g, uint32_t n)
{
    g->random = g->random * 747796405u + 2891336453u;
    const uint32_t word = ((g->random >> ((g->random >> 28) + 4)) ^ g->random) * 277803737u;
    return (uint32_t)((uint64_t)((word >> 22) ^ word) * n >> 32);
}

static float random_float(given *g, float low, float high)
{
    return low + (high - low) * (float)random_below(g, 1 << 24) / (float)(1 << 24);
}

// Somewhere on the faces of a box of half-size `reach`, of any colour.
static vpl random_vpl(given *g, float reach)
{
    vpl light = {.color = {random_float(g, 0, 1), random_float(g, 0, 1), random_float(g, 0.01f, 1)}};
    const uint32_t axis = random_below(g, 3), side = random_below(g, 2);
    for (uint32_t k = 0; k < 3; k++)
        light.position[k] = k == axis ? (side ? reach : -reach) : random_float(g, -reach, reach);
    light.normal[axis] = side ? -1 : 1;
    light.intensity = 0.2126f * light.color[0] + 0.7152f * light.color[1] + 0.0722f * light.color[2];
    return light;
}

static void slot_change(given *g, uint32_t slot, vpl light)
{
    g->data[slot] = light;
    g->bits[slot / 32] |= 1u << slot % 32;
}

static void slots_upload(given *g)
{
    CHECK(gpu_buffer_write(device, g->vpls, 0, g->data, g->slots * sizeof *g->data));
    CHECK(gpu_buffer_write(device, g->changed, 0, g->bits, div_up_u32(g->slots, 32) * 4));
    memset(g->bits, 0, div_up_u32(g->slots, 32) * 4);
}

// ---- A renderer

static const char *const outputs[] = {"lgh_header", "lgh_lights",     "lgh_sums",       "lgh_samples",
                                      "lgh_masks",  "lgh_ranks",      "lgh_vertices",   "lgh_keys",
                                      "lgh_order",  "lgh_cell_masks", "lgh_cell_ranks", "lgh_cell_starts"};

typedef struct fixture {
    scene_data *scene;
    renderer *r;
    given *vpls;
} fixture;

static render_settings settings_of(uint32_t vpls)
{
    render_settings s = render_settings_default();
    s.width = s.height = 16;
    s.vpls = vpls;
    s.filter = s.taa = false;
    return s;
}

static fixture fixture_create(const char *path, const render_settings *settings)
{
    fixture f = {.scene = scene_load(path)};
    if (f.scene)
        f.r = renderer_create(device, f.scene, settings);
    if (!f.r) {
        printf("cannot set up %s\n", path);
        exit(EXIT_FAILURE);
    }
    memcpy(f.r->exports, outputs, sizeof outputs);
    f.r->export_count = countof(outputs);
    return f;
}

static void fixture_destroy(fixture *f)
{
    renderer_destroy(f->r);
    scene_destroy(f->scene);
}

static void render(fixture *f, vpl_change change)
{
    given_change = change;
    CHECK(renderer_frame(f->r));
}

// Every output, cut to what the header says is in use.
typedef struct hierarchy {
    void *bytes[countof(outputs)];
    size_t sizes[countof(outputs)];
} hierarchy;

// Words of a mask that are zero have no rank.
static void ranks_clear(uint32_t *ranks, const uint32_t *mask, uint32_t words)
{
    for (uint32_t i = 0; i < words; i++)
        if (mask[i] == 0)
            ranks[i] = 0;
}

static uint32_t cell_count(const lgh_header *header, const uint32_t *cell_masks, uint32_t words)
{
    uint32_t count = 0;
    for (uint32_t i = 0; header->level_count > 0 && i < words; i++)
        count += (uint32_t)__builtin_popcount(cell_masks[i]);
    return count;
}

static hierarchy hierarchy_read(renderer *r)
{
    hierarchy h;
    for (size_t i = 0; i < countof(outputs); i++) {
        const gpu_buffer buffer = frame_graph_find_buffer(r->graph, outputs[i]);
        h.sizes[i] = gpu_buffer_size(r->gpu, buffer);
        h.bytes[i] = memory_alloc(h.sizes[i]);
        CHECK(gpu_buffer_read(r->gpu, buffer, 0, h.bytes[i], h.sizes[i]));
    }
    const lgh_header *header = h.bytes[0];
    const uint32_t words = header->level_count ? lgh_cell_words(header->level_count - 1) : 0;
    const size_t sizes[] = {
        sizeof *header,
        header->light_count * sizeof(grid_light),
        header->light_count * sizeof(lgh_sums),
        header->light_count * 16ull,
        header->word_count * 4ull,
        header->word_count * 4ull,
        header->light_count * 4ull,
        header->vpl_count * 4ull,
        header->vpl_count * 4ull,
        words * 4ull,
        words * 4ull,
        (cell_count(header, h.bytes[9], words) + 1) * 4ull,
    };
    _Static_assert(countof(sizes) == countof(outputs), "one each");
    ranks_clear(h.bytes[5], h.bytes[4], header->word_count);
    ranks_clear(h.bytes[10], h.bytes[9], words);
    for (size_t i = 0; i < countof(sizes); i++) {
        CHECK(sizes[i] <= h.sizes[i]);
        h.sizes[i] = sizes[i];
    }
    return h;
}

static void hierarchy_free(hierarchy *h)
{
    for (size_t i = 0; i < countof(outputs); i++)
        free(h->bytes[i]);
}

static void check_same(const hierarchy *a, const hierarchy *b)
{
    for (size_t i = 0; i < countof(outputs); i++) {
        const bool same = a->sizes[i] == b->sizes[i] && memcmp(a->bytes[i], b->bytes[i], a->sizes[i]) == 0;
        if (!same)
            printf("  %s differs\n", outputs[i]);
        CHECK(same);
    }
}

// The frame just rendered against a full build over the same VPLs.
static void check_against_full(fixture *f)
{
    hierarchy incremental = hierarchy_read(f->r);
    render(f, VPLS_ALL);
    hierarchy full = hierarchy_read(f->r);
    check_same(&incremental, &full);
    hierarchy_free(&incremental);
    hierarchy_free(&full);
}

static fixture given_fixture(uint32_t slots)
{
    const render_settings s = settings_of(slots);
    fixture f = fixture_create(SCENES "cornell.glb", &s);
    f.vpls = given_create(f.r);
    for (uint32_t i = 0; i < slots; i++)
        if (i % 3 != 0) // some are empty
            slot_change(f.vpls, i, random_vpl(f.vpls, 1));
    slots_upload(f.vpls);
    render(&f, VPLS_ALL);
    return f;
}

// One VPL in a hundred moves, appears, disappears, or changes its colour alone.
static void change_some(given *g)
{
    for (uint32_t i = 0; i < div_up_u32(g->slots, 100); i++) {
        const uint32_t slot = random_below(g, g->slots);
        vpl light = g->data[slot];
        if (i % 4 == 0)
            light.intensity = 0;
        else if (i % 4 == 1 && light.intensity > 0)
            light.color[1] *= 0.5f;
        else
            light = random_vpl(g, 1);
        slot_change(g, slot, light);
    }
    slots_upload(g);
}

static void check_changes(uint32_t slots, uint32_t changes)
{
    fixture f = given_fixture(slots);
    for (uint32_t i = 1; i <= changes; i++) {
        change_some(f.vpls);
        render(&f, VPLS_SOME);
        if (i % 50 == 0)
            check_against_full(&f);
    }
    check_against_full(&f);
    fixture_destroy(&f);
}

TEST(changes_leave_what_a_full_build_would)
{
    check_changes(5000, 100);
}

static const lgh_header *header_of(const hierarchy *h)
{
    return h->bytes[0];
}

// Light that leaves the grid, then most of it gone, then all, then all back.
TEST(a_new_grid_and_new_levels_are_built_fully)
{
    fixture f = given_fixture(5000);
    given *g = f.vpls;
    hierarchy before = hierarchy_read(f.r);
    slot_change(g, 7, random_vpl(g, 5));
    slots_upload(g);
    render(&f, VPLS_SOME);
    hierarchy wider = hierarchy_read(f.r);
    CHECK(header_of(&wider)->top_size > header_of(&before)->top_size);
    check_against_full(&f);
    for (uint32_t i = 0; i < 4900; i++)
        slot_change(g, i, (vpl){0});
    slots_upload(g);
    render(&f, VPLS_SOME);
    hierarchy fewer = hierarchy_read(f.r);
    CHECK(header_of(&fewer)->level_count < header_of(&wider)->level_count);
    check_against_full(&f);
    for (uint32_t i = 4900; i < 5000; i++)
        slot_change(g, i, (vpl){0});
    slots_upload(g);
    render(&f, VPLS_SOME);
    hierarchy none = hierarchy_read(f.r);
    CHECK(header_of(&none)->level_count == 0 && header_of(&none)->light_count == 0);
    for (uint32_t i = 0; i < 5000; i++)
        slot_change(g, i, random_vpl(g, 1));
    slots_upload(g);
    render(&f, VPLS_SOME);
    check_against_full(&f);
    change_some(g);
    render(&f, VPLS_SOME);
    check_against_full(&f);
    hierarchy_free(&before);
    hierarchy_free(&wider);
    hierarchy_free(&fewer);
    hierarchy_free(&none);
    fixture_destroy(&f);
}

static bool has_pass(const renderer *r, const char *prefix)
{
    uint32_t count;
    const frame_graph_timing *timings = frame_graph_timings(r->graph, &count);
    for (uint32_t i = 0; i < count; i++)
        if (strncmp(timings[i].name, prefix, strlen(prefix)) == 0)
            return true;
    return false;
}

TEST(without_a_change_nothing_is_built)
{
    fixture f = given_fixture(3000);
    hierarchy before = hierarchy_read(f.r);
    CHECK(has_pass(f.r, "lgh_build"));
    render(&f, VPLS_NONE);
    CHECK(!has_pass(f.r, "lgh_build"));
    hierarchy after = hierarchy_read(f.r);
    check_same(&before, &after);
    change_some(f.vpls);
    render(&f, VPLS_SOME); // goes on from what is held
    check_against_full(&f);
    hierarchy_free(&before);
    hierarchy_free(&after);
    fixture_destroy(&f);
}

TEST(other_settings_build_anew)
{
    fixture f = given_fixture(3000);
    f.r->settings.alpha = 2;
    render(&f, VPLS_NONE);
    CHECK(has_pass(f.r, "lgh_build"));
    hierarchy h = hierarchy_read(f.r);
    CHECK(header_of(&h)->levels[0].radius == 2 * header_of(&h)->top_size);
    hierarchy_free(&h);
    f.r->settings.incremental = false;
    render(&f, VPLS_NONE);
    CHECK(has_pass(f.r, "lgh_build"));
    f.r->settings.incremental = true;
    render(&f, VPLS_NONE);
    CHECK(has_pass(f.r, "lgh_build"));
    check_against_full(&f);
    fixture_destroy(&f);
}

// A grid stays where it is while a light moves a little; one around the lights' bounds does not.
TEST(a_small_motion_leaves_the_grid_where_it_is)
{
    for (uint32_t grid = GRID_SCENE; grid <= GRID_BOUNDS; grid++) {
        fixture f = given_fixture(3000);
        f.r->settings.grid = grid;
        render(&f, VPLS_ALL);
        hierarchy before = hierarchy_read(f.r);
        for (uint32_t i = 0; i < 3000; i++) {
            vpl light = f.vpls->data[i];
            light.position[0] += 0.001f;
            slot_change(f.vpls, i, light);
        }
        slots_upload(f.vpls);
        render(&f, VPLS_ALL);
        hierarchy after = hierarchy_read(f.r);
        const lgh_header *a = header_of(&before), *b = header_of(&after);
        const bool same = a->origin[0] == b->origin[0] && a->top_size == b->top_size;
        CHECK(same == (grid != GRID_BOUNDS));
        CHECK(a->level_count == b->level_count);
        hierarchy_free(&before);
        hierarchy_free(&after);
        fixture_destroy(&f);
    }
}

TEST(the_world_grid_is_a_power_of_two_at_a_multiple_of_itself)
{
    fixture f = given_fixture(3000);
    f.r->settings.grid = GRID_WORLD;
    render(&f, VPLS_ALL);
    hierarchy h = hierarchy_read(f.r);
    const lgh_header *header = header_of(&h);
    int exponent;
    CHECK(frexpf(header->top_size, &exponent) == 0.5f);
    CHECK(header->top_size >= 2 && header->top_size <= 4); // the lights' box is 2 wide, and padded
    for (uint32_t k = 0; k < 3; k++)
        CHECK(fmodf(header->origin[k], header->top_size) == 0 && header->origin[k] <= -1 &&
              header->origin[k] + 2 * header->top_size >= 1);
    hierarchy_free(&h);
    fixture_destroy(&f);
}

TEST(ten_builds_give_the_same_bytes)
{
    fixture f = given_fixture(20000);
    hierarchy first = hierarchy_read(f.r);
    for (int i = 0; i < 10; i++) {
        f.r->frame = i % 2 ? 0 : f.r->frame; // with last frame's grid, and without
        render(&f, VPLS_ALL);
        hierarchy again = hierarchy_read(f.r);
        check_same(&first, &again);
        hierarchy_free(&again);
    }
    hierarchy_free(&first);
    fixture_destroy(&f);
}

// Of every output (FNV-1a).
static uint64_t hash_of(const hierarchy *h)
{
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < countof(outputs); i++)
        for (size_t k = 0; k < h->sizes[i]; k++)
            hash = (hash ^ ((const uint8_t *)h->bytes[i])[k]) * 0x100000001b3u;
    return hash;
}

static void print_hash(uint32_t changes)
{
    fixture f = given_fixture(5000);
    for (uint32_t i = 0; i < changes; i++) {
        change_some(f.vpls);
        render(&f, VPLS_SOME);
    }
    hierarchy h = hierarchy_read(f.r);
    printf("%016" PRIx64 "\n", hash_of(&h));
    hierarchy_free(&h);
    fixture_destroy(&f);
}

static const char *program;

static void hash_with_threads(int threads, char line[64])
{
    char command[512];
    snprintf(command, sizeof command, "LP_NUM_THREADS=%d '%s' hash 3", threads, program);
    FILE *pipe = popen(command, "r");
    CHECK(pipe && fgets(line, 64, pipe) && strlen(line) == 17);
    CHECK(pipe && pclose(pipe) == 0);
}

// The environment variable is lavapipe's; on other devices this is two runs.
TEST(one_thread_and_two_give_the_same_bytes)
{
    char one[64] = "", two[64] = "";
    hash_with_threads(1, one);
    hash_with_threads(2, two);
    CHECK(strcmp(one, two) == 0);
}

TEST(the_validation_layer_has_nothing_to_say)
{
    CHECK(gpu_validation_messages(device) == 0);
}

// ---- Benchmark

enum { BENCH_PASSES = 64 };

typedef struct bench_times { // of one round
    char names[BENCH_PASSES][40];
    double milliseconds[BENCH_PASSES];
    int count;
    double sum;
} bench_times;

static bench_times times_read(const renderer *r)
{
    uint32_t count;
    const frame_graph_timing *timings = frame_graph_timings(r->graph, &count);
    bench_times times = {0};
    for (uint32_t i = 0; i < count; i++) {
        if (strncmp(timings[i].name, "lgh_build/", 10) != 0)
            continue;
        snprintf(times.names[times.count], sizeof times.names[0], "%s", timings[i].name + 10);
        times.milliseconds[times.count++] = timings[i].milliseconds;
        times.sum += timings[i].milliseconds;
    }
    return times;
}

static void times_print(const bench_times *times, const char *name, double full)
{
    printf("  %-22s %8.2f ms, %.3f of a full build:", name, times->sum, times->sum / full);
    for (int i = 0; i < times->count; i++)
        if (times->milliseconds[i] > 0.02 * times->sum)
            printf(" %s %.2f", times->names[i], times->milliseconds[i]);
    printf("\n");
}

static int compare_times(const void *a, const void *b)
{
    const double x = ((const bench_times *)a)->sum, y = ((const bench_times *)b)->sum;
    return (x > y) - (x < y);
}

static int compare_doubles(const void *a, const void *b)
{
    return (*(const double *)a > *(const double *)b) - (*(const double *)a < *(const double *)b);
}

// One VPL in a hundred sends out another light from another place nearby: any of them, or those nearest to one of them.
static void bench_change(given *g, const frame_constants *scene, const uint32_t *occupied, uint32_t count,
                         bool together)
{
    const float *centre = g->data[occupied[random_below(g, count)]].position;
    float limit = INFINITY;
    if (together) {
        double *distances = memory_alloc(count * sizeof *distances);
        for (uint32_t i = 0; i < count; i++)
            for (int k = 0; k < 3; k++)
                distances[i] += pow(g->data[occupied[i]].position[k] - centre[k], 2);
        qsort(distances, count, sizeof *distances, compare_doubles);
        limit = (float)distances[count / 100];
        free(distances);
    }
    const float origin[3] = {centre[0], centre[1], centre[2]};
    for (uint32_t i = 0; i < count; i++) {
        vpl light = g->data[occupied[i]];
        float square = 0;
        for (int k = 0; k < 3; k++)
            square += (light.position[k] - origin[k]) * (light.position[k] - origin[k]);
        if (together ? square >= limit : random_below(g, 100) != 0)
            continue;
        float *x = &light.position[i % 3];
        *x = fminf(fmaxf(*x + random_float(g, -0.02f, 0.02f), scene->scene_min[i % 3]), scene->scene_max[i % 3]);
        light.color[0] *= random_float(g, 0.5f, 1);
        slot_change(g, occupied[i], light);
    }
    slots_upload(g);
}

static void bench(uint32_t slots)
{
    enum { KINDS = 4, ROUNDS = 25 };
    const int rounds = slots > 200000 ? 9 : ROUNDS;
    static const char *const names[KINDS] = {"full", "1 % anywhere", "1 % in one place", "none"};
    const render_settings s = settings_of(slots);
    fixture f = fixture_create(SCENES "atrium.glb", &s);
    f.r->exports[0] = "vpls";
    f.r->export_count = 1;
    CHECK(renderer_frame(f.r));
    vpl *traced = memory_alloc(slots * sizeof *traced);
    CHECK(gpu_buffer_read(device, frame_graph_find_buffer(f.r->graph, "vpls"), 0, traced, slots * sizeof *traced));
    f.r->export_count = 0;
    given *g = given_create(f.r);
    uint32_t *occupied = memory_alloc(slots * 4ull), count = 0;
    for (uint32_t i = 0; i < slots; i++) {
        g->data[i] = traced[i];
        if (traced[i].intensity > 0)
            occupied[count++] = i;
    }
    slots_upload(g);
    static bench_times times[KINDS][ROUNDS];
    for (int round = -1; round < rounds; round++) // the first warms up
        for (int kind = 0; kind < KINDS; kind++) {
            if (kind == 1 || kind == 2)
                bench_change(g, &f.r->constants, occupied, count, kind == 2);
            render(&f, kind == 0 ? VPLS_ALL : kind == 3 ? VPLS_NONE : VPLS_SOME);
            if (round >= 0)
                times[kind][round] = times_read(f.r);
        }
    printf("  %u slots, %u VPLs\n", slots, count);
    for (int kind = 0; kind < KINDS; kind++) {
        qsort(times[kind], (size_t)rounds, sizeof times[kind][0], compare_times);
        times_print(&times[kind][rounds / 2], names[kind], times[0][rounds / 2].sum); // the median
    }
    free(traced);
    free(occupied);
    fixture_destroy(&f);
}

int main(int argc, char **argv)
{
    program = argv[0];
    const char *mode = argc == 3 ? argv[1] : "";
    const uint32_t number = argc == 3 ? (uint32_t)strtoul(argv[2], NULL, 10) : 0;
    device = gpu_create(&(gpu_desc){.validation = strcmp(mode, "bench") != 0});
    if (!device) {
        printf("skipped: no usable device\n");
        return 77;
    }
    if (strcmp(mode, "bench") == 0) {
        bench(number);
    } else if (strcmp(mode, "changes") == 0) {
        check_changes(5000, number);
    } else if (strcmp(mode, "hash") == 0) {
        print_hash(number);
        gpu_destroy(device);
        return 0;
    } else {
        RUN(changes_leave_what_a_full_build_would);
        RUN(a_new_grid_and_new_levels_are_built_fully);
        RUN(without_a_change_nothing_is_built);
        RUN(other_settings_build_anew);
        RUN(a_small_motion_leaves_the_grid_where_it_is);
        RUN(the_world_grid_is_a_power_of_two_at_a_multiple_of_itself);
        RUN(ten_builds_give_the_same_bytes);
        RUN(one_thread_and_two_give_the_same_bytes);
        RUN(the_validation_layer_has_nothing_to_say);
    }
    gpu_destroy(device);
    return test_end();
}
