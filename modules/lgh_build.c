// Builds the lighting grid hierarchy over `vpls` every frame (Lin and Yuksel 2019, section 3.1; shaders/lgh.glsl.h has
// the data structure): makes `lgh_header`, `lgh_lights`, `lgh_sums` and, for the `vpl` end points, `lgh_samples`.
// Nothing is read back: the number of levels is chosen on the GPU, and whatever depends on it is dispatched indirectly.
#include "lgh_build.h"
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>

enum { SORT_BLOCK = 2048, BOUNDS_STRETCH = 4096 }; // as in the shaders

typedef enum lgh_pipeline {
    BOUNDS,
    GRID,
    KEYS,
    SORT_COUNT,
    SCAN,
    SORT_SCATTER,
    MARK,
    LEVELS,
    RANKS_SUM,
    RANKS,
    VERTICES,
    CELLS_CLEAR,
    CELLS_MARK,
    CELLS,
    FIRST_ORDERED,
    RESTRICT,
    GATHER,
    SAMPLES_FIRST,
    SAMPLES,
    LIGHTS,
    SCATTER, // last: needs float atomics
    PIPELINE_COUNT
} lgh_pipeline;

typedef struct lgh_build {
    gpu_pipeline pipelines[PIPELINE_COUNT];
    // Of the current frame:
    uint32_t slots;
    uint32_t exponent; // finest candidate
    uint32_t capacity; // grid lights
    uint32_t interleave, levels;
    float alpha;
    uint32_t key; // of this frame's random numbers
    uint32_t demo; // the emission model `demo` weighs all lights alike
} lgh_build;

typedef struct lgh_step { // user of the passes that build one level
    lgh_build *build;
    uint32_t step; // t: builds S_(t+1)
} lgh_step;

static void dispatch(const frame_graph_context *context, gpu_pipeline pipeline, const void *push, uint32_t size,
                     uint32_t groups)
{
    frame_graph_bind(context, pipeline);
    if (size > 0)
        gpu_push(context->commands, push, size);
    gpu_dispatch(context->commands, groups, 1, 1);
    gpu_memory_barrier(context->commands);
}

static void execute_bounds(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    const uint32_t push[] = {b->slots, div_up_u32(b->slots, BOUNDS_STRETCH)};
    dispatch(context, b->pipelines[BOUNDS], push, sizeof push, push[1]);
    dispatch(context, b->pipelines[GRID], push, sizeof push, 1);
}

static void execute_keys(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    const uint32_t push[] = {b->slots, b->exponent, 0};
    dispatch(context, b->pipelines[KEYS], push, sizeof push, div_up_u32(b->slots, 64));
}

static void execute_sort(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    const uint32_t passes = div_up_u32(3 * b->exponent + 1, 4), blocks = div_up_u32(b->slots, SORT_BLOCK);
    uint32_t in_swap = passes & 1; // so that the last pass ends in `lgh_keys`
    const uint32_t keys[] = {b->slots, b->exponent, in_swap};
    dispatch(context, b->pipelines[KEYS], keys, sizeof keys, div_up_u32(b->slots, 64));
    for (uint32_t i = 0; i < passes; i++, in_swap ^= 1) {
        const uint32_t push[] = {b->slots, 4 * i, in_swap, blocks}, table_size = 16 * blocks;
        dispatch(context, b->pipelines[SORT_COUNT], push, sizeof push, blocks);
        dispatch(context, b->pipelines[SCAN], &table_size, sizeof table_size, 1);
        dispatch(context, b->pipelines[SORT_SCATTER], push, sizeof push, blocks);
    }
}

static void execute_levels(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    const gpu_buffer masks = frame_graph_buffer(context, "lgh_masks"),
                     counts = frame_graph_buffer(context, "lgh_counts");
    gpu_buffer_fill(context->commands, masks, 0, lgh_mask_words(b->exponent) * 4ull, 0);
    gpu_buffer_fill(context->commands, counts, 0, LGH_EXPONENTS * 4, 0);
    gpu_memory_barrier(context->commands);
    const uint32_t mark[] = {b->slots, b->exponent};
    dispatch(context, b->pipelines[MARK], mark, sizeof mark, div_up_u32(b->slots, 64));
    const struct {
        uint32_t exponent, levels, capacity, interleave;
        float alpha;
    } levels = {b->exponent, b->levels, b->capacity, b->interleave, b->alpha};
    dispatch(context, b->pipelines[LEVELS], &levels, sizeof levels, 1);
}

static void execute_indirect(const frame_graph_context *context, gpu_pipeline pipeline, const uint32_t *push,
                             uint32_t size, size_t offset)
{
    frame_graph_bind(context, pipeline);
    if (size > 0)
        gpu_push(context->commands, push, size);
    gpu_dispatch_indirect(context->commands, frame_graph_buffer(context, "lgh_header"), offset);
}

// Ranks of the vertex masks (`cells` 0) or of the cell masks (1).
static void rank_bits(const frame_graph_context *context, const lgh_build *b, uint32_t cells, uint32_t most_words)
{
    const uint32_t groups = div_up_u32(most_words, LGH_SCAN_WORDS);
    const size_t scan = offsetof(lgh_header, scan_dispatch) + cells * sizeof(lgh_dispatch);
    execute_indirect(context, b->pipelines[RANKS_SUM], &cells, sizeof cells, scan);
    gpu_memory_barrier(context->commands);
    // Past the groups that were summed the numbers mean nothing, and are not used.
    dispatch(context, b->pipelines[SCAN], &groups, sizeof groups, 1);
    execute_indirect(context, b->pipelines[RANKS], &cells, sizeof cells, scan);
    gpu_memory_barrier(context->commands);
}

static void execute_compact(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    rank_bits(context, b, 0, lgh_mask_words(b->exponent));
    execute_indirect(context, b->pipelines[VERTICES], NULL, 0, offsetof(lgh_header, word_dispatch[0]));
}

static void execute_cells(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    execute_indirect(context, b->pipelines[CELLS_CLEAR], NULL, 0, offsetof(lgh_header, word_dispatch[1]));
    gpu_memory_barrier(context->commands);
    dispatch(context, b->pipelines[CELLS_MARK], &b->exponent, 4, div_up_u32(b->slots, 64));
    rank_bits(context, b, 1, lgh_cell_words(b->exponent));
    dispatch(context, b->pipelines[CELLS], &b->exponent, 4, div_up_u32(b->slots, 64));
}

static void execute_first_ordered(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    execute_indirect(context, b->pipelines[FIRST_ORDERED], &b->demo, 4, offsetof(lgh_header, first_dispatch));
}

// The name that the sums carry after step t.
static const char *sums_name(const lgh_build *b, uint32_t step)
{
    static const char *const names[] = {"lgh_sums_1", "lgh_sums_2", "lgh_sums_3", "lgh_sums_4", "lgh_sums_5",
                                        "lgh_sums_6", "lgh_sums_7", "lgh_sums_8", "lgh_sums_9"};
    return step >= b->exponent ? "lgh_sums" : names[step];
}

static const char *samples_name(const lgh_build *b, uint32_t step)
{
    static const char *const names[] = {"lgh_samples_1", "lgh_samples_2", "lgh_samples_3",
                                        "lgh_samples_4", "lgh_samples_5", "lgh_samples_6",
                                        "lgh_samples_7", "lgh_samples_8", "lgh_samples_9"};
    return step >= b->exponent ? "lgh_samples" : names[step];
}

static void execute_scatter(const frame_graph_context *context, void *user)
{
    const lgh_step *s = user;
    const lgh_build *b = s->build;
    if (s->step == 0) {
        const gpu_buffer sums = frame_graph_buffer(context, sums_name(b, 0));
        gpu_buffer_fill(context->commands, sums, 0, b->capacity * (VkDeviceSize)sizeof(lgh_sums), 0);
        gpu_memory_barrier(context->commands);
    }
    const uint32_t push[] = {b->slots, b->demo, s->step};
    dispatch(context, b->pipelines[SCATTER], push, sizeof push, div_up_u32(b->slots, 64));
}

static void execute_restrict(const frame_graph_context *context, void *user)
{
    const lgh_step *s = user;
    execute_indirect(context, s->build->pipelines[RESTRICT], &s->step, 4,
                     offsetof(lgh_header, restrict_dispatch) + s->step * sizeof(lgh_dispatch));
}

static void execute_gather(const frame_graph_context *context, void *user)
{
    const lgh_step *s = user;
    execute_indirect(context, s->build->pipelines[GATHER], &s->step, 4,
                     offsetof(lgh_header, gather_dispatch) + s->step * sizeof(lgh_dispatch));
}

static void execute_samples_first(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    execute_indirect(context, b->pipelines[SAMPLES_FIRST], &b->key, 4, offsetof(lgh_header, first_dispatch));
}

static void execute_samples(const frame_graph_context *context, void *user)
{
    const lgh_step *s = user;
    const uint32_t push[] = {s->step, s->build->key};
    execute_indirect(context, s->build->pipelines[SAMPLES], push, sizeof push,
                     offsetof(lgh_header, restrict_dispatch) + s->step * sizeof(lgh_dispatch));
}

static void execute_lights(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    execute_indirect(context, b->pipelines[LIGHTS], NULL, 0, offsetof(lgh_header, light_dispatch));
}

// ---- Declarations

static frame_graph_pass *add_pass(renderer *r, const char *name, void (*execute)(const frame_graph_context *, void *),
                                  void *user)
{
    return frame_graph_pass_add(
        r->graph,
        &(frame_graph_pass_desc){.name = name, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = user});
}

static void create_buffer(frame_graph_pass *p, const char *name, uint64_t size)
{
    const frame_graph_resource_desc desc = frame_graph_buffer_of(size);
    frame_graph_create_resource(p, name, &desc, ACCESS_STORAGE_READ_WRITE);
}

static void declare_bounds(renderer *r, lgh_build *b)
{
    frame_graph_pass *p = add_pass(r, "lgh_build/bounds", execute_bounds, b);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    create_buffer(p, "lgh_partials", div_up_u32(b->slots, BOUNDS_STRETCH) * 28ull);
    create_buffer(p, "lgh_bounds", sizeof(lgh_header));
}

static void declare_sort(renderer *r, lgh_build *b, bool sorted)
{
    frame_graph_pass *p =
        add_pass(r, sorted ? "lgh_build/sort" : "lgh_build/keys", sorted ? execute_sort : execute_keys, b);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_bounds", ACCESS_STORAGE_READ);
    create_buffer(p, "lgh_keys", b->slots * 4ull);
    create_buffer(p, "lgh_sort_table", 64ull * div_up_u32(b->slots, SORT_BLOCK));
    create_buffer(p, "lgh_order", b->slots * 4ull);
    create_buffer(p, "lgh_keys_swap", sorted ? b->slots * 4ull : 16);
    create_buffer(p, "lgh_order_swap", sorted ? b->slots * 4ull : 16);
}

static void declare_levels(renderer *r, lgh_build *b)
{
    frame_graph_pass *p = add_pass(r, "lgh_build/levels", execute_levels, b);
    frame_graph_read(p, "lgh_keys", ACCESS_STORAGE_READ);
    create_buffer(p, "lgh_masks", lgh_mask_words(b->exponent) * 4ull);
    create_buffer(p, "lgh_counts", LGH_EXPONENTS * 4);
    frame_graph_modify(p, "lgh_bounds", "lgh_header", ACCESS_STORAGE_READ_WRITE);
}

// Masks, header, ranks and group sums are the bindings 0..3 both here and for the cells, as the ranks' shaders want.
static void declare_compact(renderer *r, lgh_build *b)
{
    const uint32_t words = lgh_mask_words(b->exponent);
    frame_graph_pass *p = add_pass(r, "lgh_build/compact", execute_compact, b);
    frame_graph_read(p, "lgh_masks", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    create_buffer(p, "lgh_ranks", words * 4ull);
    create_buffer(p, "lgh_rank_groups", div_up_u32(words, LGH_SCAN_WORDS) * 4ull);
    create_buffer(p, "lgh_vertices", b->capacity * 4ull);
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
}

static void declare_cells(renderer *r, lgh_build *b)
{
    const uint32_t words = lgh_cell_words(b->exponent);
    frame_graph_pass *p = add_pass(r, "lgh_build/cells", execute_cells, b);
    create_buffer(p, "lgh_cell_masks", words * 4ull);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    create_buffer(p, "lgh_cell_ranks", words * 4ull);
    create_buffer(p, "lgh_cell_groups", div_up_u32(words, LGH_SCAN_WORDS) * 4ull);
    frame_graph_read(p, "lgh_keys", ACCESS_STORAGE_READ);
    create_buffer(p, "lgh_cell_starts", (b->slots + 1) * 4ull);
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
}

// What walks the sorted VPLs around each vertex of S1, and makes `name`.
static void declare_first(renderer *r, lgh_build *b, const char *pass,
                          void (*execute)(const frame_graph_context *, void *), const char *name, uint64_t size)
{
    static const char *const inputs[] = {"vpls",           "lgh_header",     "lgh_vertices",   "lgh_order",
                                         "lgh_cell_masks", "lgh_cell_ranks", "lgh_cell_starts"};
    frame_graph_pass *p = add_pass(r, pass, execute, b);
    for (size_t i = 0; i < countof(inputs); i++)
        frame_graph_read(p, inputs[i], ACCESS_STORAGE_READ);
    create_buffer(p, name, size);
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
}

static frame_graph_pass *add_step(renderer *r, lgh_build *b, const char *prefix, uint32_t step,
                                  void (*execute)(const frame_graph_context *, void *))
{
    char name[32];
    snprintf(name, sizeof name, "lgh_build/%s%u", prefix, step + 1);
    lgh_step user = {b, step};
    return frame_graph_pass_add(
        r->graph,
        &(frame_graph_pass_desc){
            .name = name, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = &user, .user_size = sizeof user});
}

static void declare_scatter(renderer *r, lgh_build *b, uint32_t step)
{
    frame_graph_pass *p = add_step(r, b, "s", step, execute_scatter);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_masks", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_ranks", ACCESS_STORAGE_READ);
    if (step == 0)
        create_buffer(p, sums_name(b, 0), b->capacity * (uint64_t)sizeof(lgh_sums));
    else
        frame_graph_modify(p, sums_name(b, step - 1), sums_name(b, step), ACCESS_STORAGE_READ_WRITE);
}

// What builds a coarse level from the finer ones reads.
static void read_finer(frame_graph_pass *p)
{
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_vertices", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_masks", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_ranks", ACCESS_STORAGE_READ);
}

static void declare_coarse(renderer *r, lgh_build *b, uint32_t step, lgh_build_method method)
{
    frame_graph_pass *p = add_step(r, b, "s", step, method == LGH_BUILD_GATHER ? execute_gather : execute_restrict);
    read_finer(p);
    frame_graph_modify(p, sums_name(b, step - 1), sums_name(b, step), ACCESS_STORAGE_READ_WRITE);
}

// The VPLs at which shadow rays may end; culled by the graph unless something reads them.
static void declare_samples(renderer *r, lgh_build *b)
{
    declare_first(r, b, "lgh_build/samples1", execute_samples_first, samples_name(b, 0), b->capacity * 16ull);
    for (uint32_t step = 1; step <= b->exponent; step++) {
        frame_graph_pass *p = add_step(r, b, "samples", step, execute_samples);
        read_finer(p);
        frame_graph_read(p, "lgh_sums", ACCESS_STORAGE_READ);
        frame_graph_modify(p, samples_name(b, step - 1), samples_name(b, step), ACCESS_STORAGE_READ_WRITE);
    }
}

static void declare_lights(renderer *r, lgh_build *b)
{
    frame_graph_pass *p = add_pass(r, "lgh_build/merge", execute_lights, b);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_vertices", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_sums", ACCESS_STORAGE_READ);
    create_buffer(p, "lgh_lights", b->capacity * (uint64_t)sizeof(grid_light));
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
}

static uint32_t log2_floor(uint32_t x)
{
    return 31u - (uint32_t)__builtin_clz(max_u32(x, 1));
}

static void follow_settings(lgh_build *b, const render_settings *s, uint32_t key)
{
    b->slots = s->vpls;
    // In a room the lights' surfaces fill several times cells^2 vertices, so sqrt(N) / 4 cells would do; halls, lines
    // and spot-lit patches stay below N / 2 on finer grids. A grid too fine for any of them only costs its masks.
    b->exponent = min_u32(log2_floor(s->vpls) / 2 + 2, LGH_EXPONENTS - 1);
    if (s->levels > 0)
        b->exponent = min_u32(max_u32(s->levels - 1, 1), LGH_EXPONENTS - 1);
    b->capacity = lgh_capacity(s);
    b->levels = s->levels;
    b->interleave = s->interleave;
    b->alpha = s->alpha;
    b->key = key;
    b->demo = s->emission == EMISSION_DEMO;
}

static void lgh_build_setup(renderer *r, void *state)
{
    if (!renderer_has_indirect(r))
        return;
    lgh_build *b = state;
    const render_settings *s = &r->settings;
    if (!b->pipelines[SCATTER].id && (s->s1 == LGH_S1_ATOMIC || s->build == LGH_BUILD_SCATTER)) {
        log_error("%s has no float atomics on buffers, which --s1 atomic and --build scatter need", gpu_name(r->gpu));
        r->failed = true;
        return;
    }
    follow_settings(b, s, s->seed * 0x9e3779b9u + r->frame);
    const bool ordered = s->s1 == LGH_S1_ORDERED && s->build != LGH_BUILD_SCATTER;
    const bool sorted = ordered || s->end_point == END_POINT_VPL ||
                        (s->start_level == 0 && s->lighting == LIGHTING_GATHER); // which looks VPLs up by cell
    declare_bounds(r, b);
    declare_sort(r, b, sorted);
    declare_levels(r, b);
    declare_compact(r, b);
    if (sorted) {
        declare_cells(r, b);
        declare_samples(r, b);
    }
    if (ordered)
        declare_first(r, b, "lgh_build/s1", execute_first_ordered, sums_name(b, 0),
                      b->capacity * (uint64_t)sizeof(lgh_sums));
    else
        declare_scatter(r, b, 0);
    for (uint32_t step = 1; step <= b->exponent; step++)
        if (s->build == LGH_BUILD_SCATTER)
            declare_scatter(r, b, step);
        else
            declare_coarse(r, b, step, s->build);
    declare_lights(r, b);
}

uint32_t lgh_mask_words(uint32_t exponent)
{
    uint32_t words = 0;
    for (uint32_t c = 0; c <= exponent; c++) {
        const uint32_t blocks = ((1u << c) >> 3) + 1;
        words += 16 * blocks * blocks * blocks;
    }
    return words;
}

uint32_t lgh_cell_words(uint32_t exponent)
{
    return div_up_u32(1u << 3 * exponent, 32);
}

uint32_t lgh_capacity(const render_settings *s)
{
    const uint32_t largest = (128u << 20) / sizeof(grid_light); // one binding's range
    const uint64_t asked = s->levels > 0 ? 8ull * s->vpls * s->levels : s->vpls;
    return (uint32_t)(asked < 4096 ? 4096 : asked > largest ? largest : asked);
}

static void lgh_build_fini(renderer *r, void *state)
{
    const lgh_build *b = state;
    for (uint32_t i = 0; i < PIPELINE_COUNT; i++)
        gpu_pipeline_destroy(r->gpu, b->pipelines[i]);
}

bool lgh_build_init(renderer *r)
{
    static const gpu_shader *const shaders[PIPELINE_COUNT] = {
        [BOUNDS] = &shader_lgh_build_bounds_comp,
        [GRID] = &shader_lgh_build_grid_comp,
        [KEYS] = &shader_lgh_build_keys_comp,
        [SORT_COUNT] = &shader_lgh_build_sort_count_comp,
        [SCAN] = &shader_lgh_build_scan_comp,
        [SORT_SCATTER] = &shader_lgh_build_sort_scatter_comp,
        [MARK] = &shader_lgh_build_mark_comp,
        [LEVELS] = &shader_lgh_build_levels_comp,
        [RANKS_SUM] = &shader_lgh_build_ranks_sum_comp,
        [RANKS] = &shader_lgh_build_ranks_comp,
        [VERTICES] = &shader_lgh_build_vertices_comp,
        [CELLS_CLEAR] = &shader_lgh_build_cells_clear_comp,
        [CELLS_MARK] = &shader_lgh_build_cells_mark_comp,
        [CELLS] = &shader_lgh_build_cells_comp,
        [FIRST_ORDERED] = &shader_lgh_build_first_ordered_comp,
        [RESTRICT] = &shader_lgh_build_restrict_comp,
        [GATHER] = &shader_lgh_build_gather_comp,
        [SAMPLES_FIRST] = &shader_lgh_build_samples_first_comp,
        [SAMPLES] = &shader_lgh_build_samples_comp,
        [LIGHTS] = &shader_lgh_build_lights_comp,
        [SCATTER] = &shader_lgh_build_scatter_comp,
    };
    lgh_build *b = renderer_pass_add(r, "lgh_build", sizeof *b, lgh_build_setup, lgh_build_fini);
    for (uint32_t i = 0; i < PIPELINE_COUNT; i++) {
        if (i == SCATTER && !gpu_has_float_atomics(r->gpu))
            continue;
        b->pipelines[i] = gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = shaders[i]});
        if (!b->pipelines[i].id)
            return false;
    }
    return true;
}
