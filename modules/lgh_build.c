// Builds the lighting grid hierarchy over `vpls` (Lin and Yuksel 2019, section 3.1; shaders/lgh.glsl.h has the data
// structure): makes `lgh_header`, `lgh_lights`, `lgh_sums` and, for the `vpl` end points, `lgh_samples`.
//
// Nothing is read back: the grid and the number of levels are chosen on the GPU, and whatever depends on them is
// dispatched indirectly. A frame first builds on last frame's grid and levels ("bounds" to "levels"); where these do
// not fit, or there is no last frame, "choose" starts anew, and else costs next to nothing.
//
// Incremental (settings.incremental, modules/vpl_trace.h): when no VPL changed, nothing is declared; when some did,
// they alone are sorted and merged into last frame's list, and only the vertices around their cells, of before and
// after, are summed up again. The result has the bits of a full build. This is what the paper names as future work.
#include "lgh_build.h"
#include "lgh_buffers.h"
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

#include <float.h>
#include <stdio.h>
#include <string.h>

enum { SORT_BLOCK = 2048, MERGE_RUN = 32 }; // as in the shaders

typedef enum lgh_pipeline {
    BOUNDS,
    BOUNDS_CHANGED,
    GRID,
    KEYS,
    KEYS_CHANGED,
    SORT_COUNT,
    SCAN_LIST,
    SORT_SCATTER,
    MERGE_COUNT,
    MERGE,
    CLEAR,
    CLEAR_DIRTY,
    MARK,
    LEVELS,
    RANKS_SUM,
    SCAN,
    RANKS,
    VERTICES,
    CELLS_CLEAR,
    CELLS_MARK,
    CELLS,
    MOVE,
    MOVE_SAMPLES,
    DIRTY,
    FIRST_ORDERED,
    FIRST_ORDERED_DIRTY,
    RESTRICT,
    RESTRICT_DIRTY,
    GATHER,
    SAMPLES_FIRST,
    SAMPLES_FIRST_DIRTY,
    SAMPLES,
    SAMPLES_DIRTY,
    LIGHTS,
    SCATTER, // last: needs float atomics
    PIPELINE_COUNT
} lgh_pipeline;

// What the hierarchy depends on besides the VPLs.
typedef struct lgh_signature {
    // What decides the grid and the levels, and hence what they may be kept for:
    uint32_t slots;
    uint32_t exponent; // finest candidate
    uint32_t levels, grid;
    // and the rest:
    uint32_t capacity; // grid lights
    uint32_t interleave;
    uint32_t build, s1;
    uint32_t demo; // the emission model `demo` weighs all lights alike
    uint32_t key; // of the random numbers; not the frame's, as still VPLs must have still samples
    uint32_t sorted; // VPLs, into cells
    uint32_t samples; // they are made
    float alpha;
} lgh_signature;

typedef struct lgh_build {
    gpu_pipeline pipelines[PIPELINE_COUNT];
    lgh_buffers buffers;
    lgh_signature built; // what the last frame built...
    uint32_t built_frame; // ... and which it was
    bool is_built;
    vpl_change (*change)(const renderer *r);
    const frame_constants *scene; // its bounds
    // Of the current frame:
    lgh_signature now;
    uint32_t frame;
    bool history; // grid and levels of last frame may be kept
    bool changed; // incremental
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

static void indirect(const frame_graph_context *context, gpu_pipeline pipeline, const void *push, uint32_t size,
                     gpu_buffer arguments, size_t offset)
{
    frame_graph_bind(context, pipeline);
    if (size > 0)
        gpu_push(context->commands, push, size);
    gpu_dispatch_indirect(context->commands, arguments, offset);
    gpu_memory_barrier(context->commands);
}

static gpu_buffer held(const lgh_build *b, lgh_item item)
{
    return b->buffers.held[item][0];
}

// By one of lgh_state's dispatches.
#define STATE_DISPATCH(member) offsetof(lgh_state, member)

static void by_state(const frame_graph_context *context, const lgh_build *b, lgh_pipeline pipeline, const void *push,
                     uint32_t size, size_t offset)
{
    indirect(context, b->pipelines[pipeline], push, size, held(b, LGH_STATE), offset);
}

static void by_header(const frame_graph_context *context, const lgh_build *b, lgh_pipeline pipeline, const void *push,
                      uint32_t size, size_t offset)
{
    indirect(context, b->pipelines[pipeline], push, size, held(b, LGH_HEADER), offset);
}

// ---- Grid, sorted list of VPLs, number of levels. Stage 0 is on last frame's grid and levels; stage 1 starts anew.

static uint32_t stretches_of(const lgh_build *b)
{
    return div_up_u32(b->now.slots, LGH_STRETCH);
}

typedef struct grid_push {
    uint32_t partial_count, exponent, stage, history, changed, kept, snapped;
    float scene_low[3], scene_high[3];
} grid_push;

static grid_push grid_push_of(const lgh_build *b, uint32_t stage)
{
    grid_push push = {
        .partial_count = stretches_of(b),
        .exponent = b->now.exponent,
        .stage = stage,
        .history = b->history,
        .changed = b->changed,
        .kept = b->now.grid != GRID_BOUNDS,
        .snapped = b->now.grid == GRID_WORLD,
        .scene_low = {FLT_MAX, FLT_MAX, FLT_MAX},
        .scene_high = {-FLT_MAX, -FLT_MAX, -FLT_MAX},
    };
    if (b->now.grid == GRID_SCENE) {
        memcpy(push.scene_low, b->scene->scene_min, sizeof push.scene_low);
        memcpy(push.scene_high, b->scene->scene_max, sizeof push.scene_high);
    }
    return push;
}

static void execute_bounds(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    const grid_push grid = grid_push_of(b, 0);
    dispatch(context, b->pipelines[b->changed ? BOUNDS_CHANGED : BOUNDS], &b->now.slots, 4, stretches_of(b));
    dispatch(context, b->pipelines[GRID], &grid, sizeof grid, 1);
}

// Keys of S1's cells, sorted.
static void sort_list(const frame_graph_context *context, const lgh_build *b, lgh_pipeline keys, uint32_t stage)
{
    const uint32_t push[] = {b->now.slots, UINT32_MAX, b->now.sorted};
    by_state(context, b, keys, push, sizeof push, STATE_DISPATCH(stretches[stage]));
    for (uint32_t follow = LGH_SORT_PASSES; b->now.sorted && follow-- > 0;) {
        const uint32_t scan[] = {0, follow};
        const size_t blocks = STATE_DISPATCH(sort) + follow * sizeof(lgh_dispatch);
        by_state(context, b, SORT_COUNT, &follow, 4, blocks);
        by_state(context, b, SCAN_LIST, scan, sizeof scan, blocks);
        by_state(context, b, SORT_SCATTER, &follow, 4, blocks);
    }
}

// Of a mask of so many words.
static void mask_clear(const frame_graph_context *context, lgh_build *b, lgh_pipeline clear, lgh_item mask,
                       uint32_t words)
{
    const uint32_t push[] = {words, lgh_buffers_fresh(&b->buffers, mask)};
    dispatch(context, b->pipelines[clear], push, sizeof push, div_up_u32(words, LGH_CLEAR_WORDS));
}

static void execute_sort(const frame_graph_context *context, void *user)
{
    lgh_build *b = user;
    gpu_memory_barrier(context->commands);
    if (b->changed)
        mask_clear(context, b, CLEAR_DIRTY, LGH_DIRTY_CELLS, lgh_cells_before(b->now.exponent + 1));
    sort_list(context, b, b->changed ? KEYS_CHANGED : KEYS, 0);
}

static void execute_merge(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    const uint32_t scan[] = {1, 0};
    gpu_memory_barrier(context->commands);
    by_state(context, b, MERGE_COUNT, NULL, 0, STATE_DISPATCH(runs));
    by_state(context, b, SCAN_LIST, scan, sizeof scan, STATE_DISPATCH(runs));
    by_state(context, b, MERGE, NULL, 0, STATE_DISPATCH(runs));
}

static void count_levels(const frame_graph_context *context, const lgh_build *b, uint32_t stage)
{
    const uint32_t mark[] = {b->now.exponent, stage};
    const struct {
        uint32_t stage, partial_count, exponent, levels, capacity, interleave, sorted;
        float alpha;
    } levels = {stage,           stretches_of(b),   b->now.exponent, b->now.levels,
                b->now.capacity, b->now.interleave, b->now.sorted,   b->now.alpha};
    if (stage == 1) {
        const uint32_t keys[] = {b->now.slots, b->now.exponent, 0};
        by_state(context, b, KEYS, keys, sizeof keys, STATE_DISPATCH(stretches[1]));
    }
    by_state(context, b, MARK, mark, sizeof mark, STATE_DISPATCH(vpls[stage]));
    by_state(context, b, LEVELS, &levels, sizeof levels, STATE_DISPATCH(once[stage]));
}

static void execute_levels(const frame_graph_context *context, void *user)
{
    lgh_build *b = user;
    gpu_memory_barrier(context->commands);
    mask_clear(context, b, CLEAR, LGH_MASKS, lgh_mask_words(b->now.exponent));
    count_levels(context, b, 0);
}

static void execute_choose(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    const grid_push grid = grid_push_of(b, 1);
    const uint32_t clear[] = {lgh_mask_words(b->now.exponent), 0};
    gpu_memory_barrier(context->commands);
    by_state(context, b, BOUNDS, &b->now.slots, 4, STATE_DISPATCH(stretches[1]));
    by_state(context, b, GRID, &grid, sizeof grid, STATE_DISPATCH(once[1]));
    by_state(context, b, CLEAR, clear, sizeof clear, STATE_DISPATCH(words));
    count_levels(context, b, 1);
    sort_list(context, b, KEYS, 1);
}

// ---- Vertices and cells

// Ranks of the vertex masks (`cells` 0), and the vertices, or of the cell masks (1).
static void rank_bits(const frame_graph_context *context, const lgh_build *b, uint32_t cells, uint32_t most_words)
{
    const uint32_t groups = div_up_u32(most_words, LGH_SCAN_WORDS);
    const size_t scan = offsetof(lgh_header, scan_dispatch) + cells * sizeof(lgh_dispatch);
    by_header(context, b, RANKS_SUM, &cells, sizeof cells, scan);
    // Past the groups that were summed the numbers mean nothing, and are not used.
    dispatch(context, b->pipelines[SCAN], &groups, sizeof groups, 1);
    by_header(context, b, cells ? RANKS : VERTICES, &cells, sizeof cells, scan);
}

static void execute_compact(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    rank_bits(context, b, 0, lgh_mask_words(b->now.exponent));
}

static void execute_cells(const frame_graph_context *context, void *user)
{
    lgh_build *b = user;
    mask_clear(context, b, CELLS_CLEAR, LGH_CELL_MASKS, lgh_cell_words(b->now.exponent));
    by_state(context, b, CELLS_MARK, NULL, 0, STATE_DISPATCH(list));
    rank_bits(context, b, 1, lgh_cell_words(b->now.exponent));
    by_state(context, b, CELLS, NULL, 0, STATE_DISPATCH(list));
}

// ---- Sums, samples, lights

static void execute_move(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    by_header(context, b, b->now.samples ? MOVE_SAMPLES : MOVE, NULL, 0, offsetof(lgh_header, light_dispatch));
    dispatch(context, b->pipelines[DIRTY], NULL, 0, 1);
}

// All vertices of the level that step t builds, or the dirty ones.
static void by_vertices(const frame_graph_context *context, const lgh_build *b, lgh_pipeline all, lgh_pipeline dirty,
                        uint32_t step, const void *push, uint32_t size)
{
    const size_t first = offsetof(lgh_header, first_dispatch),
                 coarse = offsetof(lgh_header, restrict_dispatch) + step * sizeof(lgh_dispatch);
    if (b->changed)
        by_state(context, b, dirty, push, size, STATE_DISPATCH(dirty_dispatch) + step * sizeof(lgh_dispatch));
    else
        by_header(context, b, all, push, size, step == 0 ? first : coarse);
}

static void execute_first_ordered(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    by_vertices(context, b, FIRST_ORDERED, FIRST_ORDERED_DIRTY, 0, &b->now.demo, 4);
}

// The name that the sums carry after step t.
static const char *sums_name(const lgh_build *b, uint32_t step)
{
    static const char *const names[] = {"lgh_sums_1", "lgh_sums_2", "lgh_sums_3", "lgh_sums_4",
                                        "lgh_sums_5", "lgh_sums_6", "lgh_sums_7", "lgh_sums_8"};
    return step >= b->now.exponent ? "lgh_sums" : names[step];
}

static const char *samples_name(const lgh_build *b, uint32_t step)
{
    static const char *const names[] = {"lgh_samples_1", "lgh_samples_2", "lgh_samples_3", "lgh_samples_4",
                                        "lgh_samples_5", "lgh_samples_6", "lgh_samples_7", "lgh_samples_8"};
    return step >= b->now.exponent ? "lgh_samples" : names[step];
}

static void execute_scatter(const frame_graph_context *context, void *user)
{
    const lgh_step *s = user;
    const lgh_build *b = s->build;
    if (s->step == 0) {
        const gpu_buffer sums = frame_graph_buffer(context, sums_name(b, 0));
        gpu_buffer_fill(context->commands, sums, 0, b->now.capacity * (VkDeviceSize)sizeof(lgh_sums), 0);
        gpu_memory_barrier(context->commands);
    }
    const uint32_t push[] = {b->now.slots, b->now.demo, s->step};
    dispatch(context, b->pipelines[SCATTER], push, sizeof push, div_up_u32(b->now.slots, 64));
}

static void execute_restrict(const frame_graph_context *context, void *user)
{
    const lgh_step *s = user;
    by_vertices(context, s->build, RESTRICT, RESTRICT_DIRTY, s->step, &s->step, 4);
}

static void execute_gather(const frame_graph_context *context, void *user)
{
    const lgh_step *s = user;
    by_header(context, s->build, GATHER, &s->step, 4,
              offsetof(lgh_header, gather_dispatch) + s->step * sizeof(lgh_dispatch));
}

static void execute_samples_first(const frame_graph_context *context, void *user)
{
    const lgh_build *b = user;
    by_vertices(context, b, SAMPLES_FIRST, SAMPLES_FIRST_DIRTY, 0, &b->now.key, 4);
}

static void execute_samples(const frame_graph_context *context, void *user)
{
    const lgh_step *s = user;
    const uint32_t push[] = {s->step, s->build->now.key};
    by_vertices(context, s->build, SAMPLES, SAMPLES_DIRTY, s->step, push, sizeof push);
}

// The last pass: what it leaves is there for the next frame.
static void execute_lights(const frame_graph_context *context, void *user)
{
    lgh_build *b = user;
    by_header(context, b, LIGHTS, NULL, 0, offsetof(lgh_header, light_dispatch));
    b->built = b->now;
    b->built_frame = b->frame;
    b->is_built = true;
}

// ---- Declarations

static frame_graph_pass *add_pass(renderer *r, const char *name, void (*execute)(const frame_graph_context *, void *),
                                  void *user)
{
    return frame_graph_pass_add(
        r->graph,
        &(frame_graph_pass_desc){.name = name, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = user});
}

static void write(renderer *r, lgh_build *b, frame_graph_pass *p, lgh_item item)
{
    lgh_buffers_write(r, &b->buffers, p, item, false);
}

static void write_last(renderer *r, lgh_build *b, frame_graph_pass *p, lgh_item item)
{
    lgh_buffers_write(r, &b->buffers, p, item, true);
}

static void read(const lgh_build *b, frame_graph_pass *p, lgh_item item)
{
    lgh_buffers_read(&b->buffers, p, item, ACCESS_STORAGE_READ);
}

static void read_old(renderer *r, lgh_build *b, frame_graph_pass *p, lgh_item item)
{
    lgh_buffers_read_old(r, &b->buffers, p, item);
}

static void read_changed(const lgh_build *b, frame_graph_pass *p)
{
    if (b->changed)
        frame_graph_read(p, "vpl_changed", ACCESS_STORAGE_READ);
    else
        read(b, p, LGH_CHANGED);
}

// The passes that make the sorted list have one numbering of bindings:
//   0 vpls  1 partials  2 slot_cells  3 table  4 header  5 state  6 changed
//   7 keys  8 order  9 keys_swap  10 order_swap  11 dirty_cells  12 dirty_cells_filled  13 masks  14 masks_filled

static void declare_bounds(renderer *r, lgh_build *b)
{
    frame_graph_pass *p = add_pass(r, "lgh_build/bounds", execute_bounds, b);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    write(r, b, p, LGH_PARTIALS);
    write(r, b, p, LGH_SLOT_CELLS);
    write(r, b, p, LGH_TABLE);
    write(r, b, p, LGH_HEADER);
    write(r, b, p, LGH_STATE);
    if (b->changed)
        frame_graph_read(p, "vpl_changed", ACCESS_STORAGE_READ);
    else
        write(r, b, p, LGH_CHANGED);
}

static void declare_sort(renderer *r, lgh_build *b)
{
    frame_graph_pass *p = add_pass(r, b->now.sorted ? "lgh_build/sort" : "lgh_build/keys", execute_sort, b);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    read(b, p, LGH_PARTIALS);
    write(r, b, p, LGH_SLOT_CELLS);
    write(r, b, p, LGH_TABLE);
    read(b, p, LGH_HEADER);
    read(b, p, LGH_STATE);
    read_changed(b, p);
    write(r, b, p, b->changed ? LGH_NEW_KEYS : LGH_KEYS);
    write(r, b, p, b->changed ? LGH_NEW_ORDER : LGH_ORDER);
    write(r, b, p, LGH_KEYS_SWAP);
    write(r, b, p, LGH_ORDER_SWAP);
    write(r, b, p, LGH_DIRTY_CELLS);
    write(r, b, p, LGH_DIRTY_CELLS_FILLED);
}

static void declare_merge(renderer *r, lgh_build *b)
{
    frame_graph_pass *p = add_pass(r, "lgh_build/merge_list", execute_merge, b);
    frame_graph_read(p, "vpl_changed", ACCESS_STORAGE_READ);
    read_old(r, b, p, LGH_KEYS);
    read_old(r, b, p, LGH_ORDER);
    write(r, b, p, LGH_TABLE);
    read(b, p, LGH_NEW_KEYS);
    read(b, p, LGH_STATE);
    read(b, p, LGH_NEW_ORDER);
    write(r, b, p, LGH_KEYS);
    write(r, b, p, LGH_ORDER);
}

// On last frame's grid and levels (`execute_levels`), or anew.
static void declare_levels(renderer *r, lgh_build *b, const char *name,
                           void (*execute)(const frame_graph_context *, void *), bool last)
{
    frame_graph_pass *p = add_pass(r, name, execute, b);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    write(r, b, p, LGH_PARTIALS);
    write(r, b, p, LGH_SLOT_CELLS);
    write(r, b, p, LGH_TABLE);
    lgh_buffers_write(r, &b->buffers, p, LGH_HEADER, last);
    write(r, b, p, LGH_STATE);
    read_changed(b, p);
    lgh_buffers_write(r, &b->buffers, p, LGH_KEYS, last);
    lgh_buffers_write(r, &b->buffers, p, LGH_ORDER, last);
    write(r, b, p, LGH_KEYS_SWAP);
    write(r, b, p, LGH_ORDER_SWAP);
    read(b, p, LGH_DIRTY_CELLS);
    read(b, p, LGH_DIRTY_CELLS_FILLED);
    lgh_buffers_write(r, &b->buffers, p, LGH_MASKS, last);
    lgh_buffers_write(r, &b->buffers, p, LGH_MASKS_FILLED, last);
}

// Masks, header, ranks, group sums and the masks' filled words are the bindings 0..3 and 5 both here and for the cells,
// as the ranks' shaders want.
static void declare_compact(renderer *r, lgh_build *b)
{
    frame_graph_pass *p = add_pass(r, "lgh_build/compact", execute_compact, b);
    read(b, p, LGH_MASKS);
    read(b, p, LGH_HEADER);
    write_last(r, b, p, LGH_RANKS);
    write(r, b, p, LGH_RANK_GROUPS);
    write_last(r, b, p, LGH_VERTICES);
    read(b, p, LGH_MASKS_FILLED);
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
}

static void declare_cells(renderer *r, lgh_build *b)
{
    frame_graph_pass *p = add_pass(r, "lgh_build/cells", execute_cells, b);
    write_last(r, b, p, LGH_CELL_MASKS);
    read(b, p, LGH_HEADER);
    write_last(r, b, p, LGH_CELL_RANKS);
    write(r, b, p, LGH_CELL_GROUPS);
    read(b, p, LGH_KEYS);
    write_last(r, b, p, LGH_CELL_MASKS_FILLED);
    write_last(r, b, p, LGH_CELL_STARTS);
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
    lgh_buffers_read(&b->buffers, p, LGH_STATE, ACCESS_INDIRECT);
}

static void declare_move(renderer *r, lgh_build *b)
{
    frame_graph_pass *p = add_pass(r, "lgh_build/move", execute_move, b);
    read(b, p, LGH_HEADER);
    write(r, b, p, LGH_STATE);
    read(b, p, LGH_VERTICES);
    read(b, p, LGH_MASKS);
    read(b, p, LGH_RANKS);
    read(b, p, LGH_DIRTY_CELLS);
    read_old(r, b, p, LGH_VERTICES);
    read_old(r, b, p, LGH_MASKS);
    read_old(r, b, p, LGH_RANKS);
    read_old(r, b, p, LGH_SUMS);
    lgh_buffers_make(r, &b->buffers, p, LGH_SUMS, "lgh_sums_moved");
    write(r, b, p, LGH_DIRTY_PLACES);
    read_old(r, b, p, LGH_SAMPLES);
    lgh_buffers_make(r, &b->buffers, p, LGH_SAMPLES, b->now.samples ? "lgh_samples_moved" : "lgh_samples");
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
}

// State and list of the dirty vertices.
static void read_dirty(renderer *r, lgh_build *b, frame_graph_pass *p)
{
    read(b, p, LGH_STATE);
    if (b->buffers.versions[LGH_DIRTY_PLACES] == 0)
        write(r, b, p, LGH_DIRTY_PLACES);
    else
        read(b, p, LGH_DIRTY_PLACES);
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
    lgh_buffers_read(&b->buffers, p, LGH_STATE, ACCESS_INDIRECT);
}

// What walks the sorted VPLs around each vertex of S1, and makes `name` of the item.
static void declare_first(renderer *r, lgh_build *b, const char *pass,
                          void (*execute)(const frame_graph_context *, void *), lgh_item item, const char *moved,
                          const char *name)
{
    static const lgh_item inputs[] = {LGH_HEADER,     LGH_VERTICES,   LGH_ORDER,
                                      LGH_CELL_MASKS, LGH_CELL_RANKS, LGH_CELL_STARTS};
    frame_graph_pass *p = add_pass(r, pass, execute, b);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    for (size_t i = 0; i < countof(inputs); i++)
        read(b, p, inputs[i]);
    read_dirty(r, b, p);
    if (item == LGH_SAMPLES)
        frame_graph_read(p, "lgh_sums", ACCESS_STORAGE_READ);
    if (b->changed)
        frame_graph_modify(p, moved, name, ACCESS_STORAGE_READ_WRITE);
    else
        lgh_buffers_make(r, &b->buffers, p, item, name);
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
    read(b, p, LGH_HEADER);
    read(b, p, LGH_MASKS);
    read(b, p, LGH_RANKS);
    if (step == 0)
        lgh_buffers_make(r, &b->buffers, p, LGH_SUMS, sums_name(b, 0));
    else
        frame_graph_modify(p, sums_name(b, step - 1), sums_name(b, step), ACCESS_STORAGE_READ_WRITE);
}

// What builds a coarse level from the finer ones reads.
static void read_finer(renderer *r, lgh_build *b, frame_graph_pass *p)
{
    read(b, p, LGH_HEADER);
    read(b, p, LGH_VERTICES);
    read(b, p, LGH_MASKS);
    read(b, p, LGH_RANKS);
    read_dirty(r, b, p);
}

static void declare_coarse(renderer *r, lgh_build *b, uint32_t step)
{
    frame_graph_pass *p =
        add_step(r, b, "s", step, b->now.build == LGH_BUILD_GATHER ? execute_gather : execute_restrict);
    read_finer(r, b, p);
    frame_graph_modify(p, sums_name(b, step - 1), sums_name(b, step), ACCESS_STORAGE_READ_WRITE);
}

// The VPLs at which shadow rays may end.
static void declare_samples(renderer *r, lgh_build *b)
{
    declare_first(r, b, "lgh_build/samples1", execute_samples_first, LGH_SAMPLES, "lgh_samples_moved",
                  samples_name(b, 0));
    for (uint32_t step = 1; step <= b->now.exponent; step++) {
        frame_graph_pass *p = add_step(r, b, "samples", step, execute_samples);
        read_finer(r, b, p);
        frame_graph_read(p, "lgh_sums", ACCESS_STORAGE_READ);
        frame_graph_modify(p, samples_name(b, step - 1), samples_name(b, step), ACCESS_STORAGE_READ_WRITE);
    }
}

static void declare_sums(renderer *r, lgh_build *b)
{
    if (b->now.s1 == LGH_S1_ORDERED)
        declare_first(r, b, "lgh_build/s1", execute_first_ordered, LGH_SUMS, "lgh_sums_moved", sums_name(b, 0));
    else
        declare_scatter(r, b, 0);
    for (uint32_t step = 1; step <= b->now.exponent; step++)
        if (b->now.build == LGH_BUILD_SCATTER)
            declare_scatter(r, b, step);
        else
            declare_coarse(r, b, step);
}

static void declare_lights(renderer *r, lgh_build *b)
{
    frame_graph_pass *p = add_pass(r, "lgh_build/merge", execute_lights, b);
    read(b, p, LGH_HEADER);
    read(b, p, LGH_VERTICES);
    frame_graph_read(p, "lgh_sums", ACCESS_STORAGE_READ);
    write_last(r, b, p, LGH_LIGHTS);
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
}

static void declare_all(renderer *r, lgh_build *b)
{
    declare_bounds(r, b);
    declare_sort(r, b);
    if (b->changed)
        declare_merge(r, b);
    declare_levels(r, b, "lgh_build/levels", execute_levels, false);
    declare_levels(r, b, "lgh_build/choose", execute_choose, true);
    declare_compact(r, b);
    if (b->now.sorted)
        declare_cells(r, b);
    if (b->changed)
        declare_move(r, b);
    declare_sums(r, b);
    if (b->now.samples)
        declare_samples(r, b);
    declare_lights(r, b);
}

// ---- The frame

static uint32_t log2_floor(uint32_t x)
{
    return 31u - (uint32_t)__builtin_clz(max_u32(x, 1));
}

// Finest candidate. In a room the lights' surfaces fill several times cells^2 vertices, so sqrt(N) / 4 cells would do;
// halls, lines and spot-lit patches stay below N / 2 on finer grids. A grid too fine for any of them costs memory, and
// time in the frames that choose anew.
static uint32_t exponent_of(const renderer *r)
{
    const render_settings *s = &r->settings;
    const uint32_t exponent = s->levels > 0 ? max_u32(s->levels - 1, 1) : log2_floor(renderer_slots(r)) / 2 + 2;
    return min_u32(exponent, LGH_EXPONENTS - 1);
}

static lgh_signature signature_of(const renderer *r)
{
    const render_settings *s = &r->settings;
    const uint32_t s1 = s->build == LGH_BUILD_SCATTER ? LGH_S1_ATOMIC : s->s1;
    const bool by_cell = s->end_point == END_POINT_VPL || (s->start_level == 0 && s->lighting == LIGHTING_GATHER);
    return (lgh_signature){
        .slots = renderer_slots(r),
        .exponent = exponent_of(r),
        .levels = s->levels,
        .grid = s->grid,
        .capacity = lgh_capacity(r),
        .interleave = s->interleave,
        .build = s->build,
        .s1 = s1,
        .demo = s->emission == EMISSION_DEMO,
        .key = s->seed * 0x9e3779b9u,
        .sorted = s1 == LGH_S1_ORDERED || by_cell, // some look VPLs up by their cell
        .samples = s->end_point == END_POINT_VPL && renderer_has_shadows(r),
        .alpha = s->alpha,
    };
}

static bool same_grid(const lgh_signature *a, const lgh_signature *b)
{
    return a->slots == b->slots && a->exponent == b->exponent && a->levels == b->levels && a->grid == b->grid;
}

static void sizes_fill(lgh_build *b)
{
    const lgh_signature *now = &b->now;
    const uint64_t slots = now->slots, mask_words = lgh_mask_words(now->exponent),
                   cell_words = lgh_cell_words(now->exponent), dirty_words = lgh_cells_before(now->exponent + 1),
                   lights = now->capacity;
    const uint64_t digits = (uint64_t)div_up_u32(now->slots, SORT_BLOCK) << LGH_SORT_BITS, runs = slots / MERGE_RUN + 1;
    const uint64_t none = 16; // of what shaders declare and do not touch
    const uint64_t sizes[LGH_ITEM_COUNT] = {
        [LGH_KEYS] = 4 * slots,
        [LGH_ORDER] = 4 * slots,
        [LGH_MASKS] = 4 * mask_words,
        [LGH_MASKS_FILLED] = mask_words / 8 + 16,
        [LGH_RANKS] = 4 * mask_words,
        [LGH_VERTICES] = 4 * lights,
        [LGH_SUMS] = sizeof(lgh_sums) * lights,
        [LGH_SAMPLES] = now->samples ? 16 * lights : none,
        [LGH_HEADER] = sizeof(lgh_header),
        [LGH_STATE] = sizeof(lgh_state),
        [LGH_SLOT_CELLS] = 4 * slots,
        [LGH_CELL_MASKS] = 4 * cell_words,
        [LGH_CELL_MASKS_FILLED] = cell_words / 8 + 16,
        [LGH_CELL_RANKS] = 4 * cell_words,
        [LGH_CELL_STARTS] = 4 * (slots + 1),
        [LGH_LIGHTS] = sizeof(grid_light) * lights,
        [LGH_PARTIALS] = sizeof(lgh_partial) * stretches_of(b),
        [LGH_TABLE] = 4 * (digits > runs ? digits : runs),
        [LGH_KEYS_SWAP] = b->now.sorted ? 4 * slots : none,
        [LGH_ORDER_SWAP] = b->now.sorted ? 4 * slots : none,
        [LGH_NEW_KEYS] = 4 * slots,
        [LGH_NEW_ORDER] = 4 * slots,
        [LGH_CHANGED] = none,
        [LGH_DIRTY_CELLS] = b->buffers.hold ? 4 * dirty_words : none,
        [LGH_DIRTY_CELLS_FILLED] = b->buffers.hold ? dirty_words / 8 + 16 : none,
        [LGH_DIRTY_PLACES] = b->changed ? 4 * lights : none,
        [LGH_RANK_GROUPS] = 4 * (mask_words / LGH_SCAN_WORDS + 1),
        [LGH_CELL_GROUPS] = 4 * (cell_words / LGH_SCAN_WORDS + 1),
    };
    memcpy(b->buffers.sizes, sizes, sizeof sizes);
}

// What of last frame's can be used, for settings and `change` as they are.
static vpl_change frame_begin(renderer *r, lgh_build *b, vpl_change change)
{
    b->frame = r->frame;
    b->now = signature_of(r);
    b->changed = false;
    b->buffers.hold = r->settings.incremental;
    sizes_fill(b);
    const bool same = lgh_buffers_begin(r, &b->buffers), follows = b->is_built && r->frame == b->built_frame + 1;
    b->history = follows && same_grid(&b->now, &b->built);
    if (!same || !follows || !r->settings.incremental || memcmp(&b->now, &b->built, sizeof b->now) != 0)
        return VPLS_ALL;
    // The paper's ways of building have no order that could be kept, and bounds cannot be known from changes alone.
    const bool by_cells = b->now.s1 == LGH_S1_ORDERED && b->now.build == LGH_BUILD_RESTRICT;
    return change == VPLS_SOME && (!by_cells || b->now.grid == GRID_BOUNDS) ? VPLS_ALL : change;
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
    switch (frame_begin(r, b, b->change(r))) {
    case VPLS_NONE:
        lgh_buffers_import(r, &b->buffers);
        b->built_frame = r->frame;
        return;
    case VPLS_SOME:
        b->changed = lgh_buffers_flip(r, &b->buffers);
        sizes_fill(b);
        break;
    case VPLS_ALL:
        break;
    }
    if (!r->failed)
        declare_all(r, b);
}

void lgh_build_follow(renderer *r, vpl_change (*change)(const renderer *r))
{
    const entity pass = renderer_pass_find(r, "lgh_build");
    ((lgh_build *)((render_pass *)ecs_get(r->world, pass, r->pass))->state)->change = change;
}

uint32_t lgh_mask_words(uint32_t exponent)
{
    uint32_t words = 0;
    for (uint32_t c = 0; c <= exponent; c++) {
        const uint32_t blocks = ((2u << c) >> 3) + 1;
        words += 16 * blocks * blocks * blocks;
    }
    return words;
}

uint32_t lgh_cell_words(uint32_t exponent)
{
    return div_up_u32(8u << 3 * exponent, 32);
}

uint32_t lgh_cells_before(uint32_t exponent)
{
    uint32_t words = 0;
    for (uint32_t c = 0; c < exponent; c++)
        words += lgh_cell_words(c);
    return words;
}

uint32_t lgh_capacity(const renderer *r)
{
    const uint32_t slots = renderer_slots(r), levels = r->settings.levels;
    const uint32_t largest = (128u << 20) / sizeof(grid_light); // one binding's range
    const uint64_t asked = levels > 0 ? 8ull * slots * levels : slots;
    return (uint32_t)(asked < 4096 ? 4096 : asked > largest ? largest : asked);
}

static void lgh_build_fini(renderer *r, void *state)
{
    lgh_build *b = state;
    for (uint32_t i = 0; i < PIPELINE_COUNT; i++)
        gpu_pipeline_destroy(r->gpu, b->pipelines[i]);
    lgh_buffers_fini(r, &b->buffers);
}

bool lgh_build_init(renderer *r)
{
    static const struct {
        const gpu_shader *shader;
        uint32_t variant; // specialization constant 0
    } desc[PIPELINE_COUNT] = {
        [BOUNDS] = {&shader_lgh_build_bounds_comp, 0},
        [BOUNDS_CHANGED] = {&shader_lgh_build_bounds_comp, 1},
        [GRID] = {&shader_lgh_build_grid_comp, 0},
        [KEYS] = {&shader_lgh_build_keys_comp, 0},
        [KEYS_CHANGED] = {&shader_lgh_build_keys_comp, 1},
        [SORT_COUNT] = {&shader_lgh_build_sort_count_comp, 0},
        [SCAN_LIST] = {&shader_lgh_build_scan_list_comp, 0},
        [SORT_SCATTER] = {&shader_lgh_build_sort_scatter_comp, 0},
        [MERGE_COUNT] = {&shader_lgh_build_merge_count_comp, 0},
        [MERGE] = {&shader_lgh_build_merge_comp, 0},
        [CLEAR] = {&shader_lgh_build_clear_comp, 0},
        [CLEAR_DIRTY] = {&shader_lgh_build_clear_dirty_comp, 0},
        [MARK] = {&shader_lgh_build_mark_comp, 0},
        [LEVELS] = {&shader_lgh_build_levels_comp, 0},
        [RANKS_SUM] = {&shader_lgh_build_ranks_sum_comp, 0},
        [SCAN] = {&shader_lgh_build_scan_comp, 0},
        [RANKS] = {&shader_lgh_build_ranks_comp, 0},
        [VERTICES] = {&shader_lgh_build_vertices_comp, 0},
        [CELLS_CLEAR] = {&shader_lgh_build_cells_clear_comp, 0},
        [CELLS_MARK] = {&shader_lgh_build_cells_mark_comp, 0},
        [CELLS] = {&shader_lgh_build_cells_comp, 0},
        [MOVE] = {&shader_lgh_build_move_comp, 0},
        [MOVE_SAMPLES] = {&shader_lgh_build_move_comp, 1},
        [DIRTY] = {&shader_lgh_build_dirty_comp, 0},
        [FIRST_ORDERED] = {&shader_lgh_build_first_ordered_comp, 0},
        [FIRST_ORDERED_DIRTY] = {&shader_lgh_build_first_ordered_comp, 1},
        [RESTRICT] = {&shader_lgh_build_restrict_comp, 0},
        [RESTRICT_DIRTY] = {&shader_lgh_build_restrict_comp, 1},
        [GATHER] = {&shader_lgh_build_gather_comp, 0},
        [SAMPLES_FIRST] = {&shader_lgh_build_samples_first_comp, 0},
        [SAMPLES_FIRST_DIRTY] = {&shader_lgh_build_samples_first_comp, 1},
        [SAMPLES] = {&shader_lgh_build_samples_comp, 0},
        [SAMPLES_DIRTY] = {&shader_lgh_build_samples_comp, 1},
        [LIGHTS] = {&shader_lgh_build_lights_comp, 0},
        [SCATTER] = {&shader_lgh_build_scatter_comp, 0},
    };
    lgh_build *b = renderer_pass_add(r, "lgh_build", sizeof *b, lgh_build_setup, lgh_build_fini);
    b->change = vpl_trace_change;
    b->scene = &r->constants;
    for (uint32_t i = 0; i < PIPELINE_COUNT; i++) {
        if (i == SCATTER && !gpu_has_float_atomics(r->gpu))
            continue;
        const gpu_compute_pipeline_desc pipeline = {
            .shader = desc[i].shader, .constants = &desc[i].variant, .constant_count = 1};
        b->pipelines[i] = gpu_compute_pipeline_create(r->gpu, &pipeline);
        if (!b->pipelines[i].id)
            return false;
    }
    return true;
}
