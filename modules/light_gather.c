// Gather lighting: adds up the lighting grid hierarchy's lights pixel by pixel, from lists of those that reach each
// cell. Makes what light_volume.c makes, `indirect` (tiled when interleaved), `reservoirs` in their unlocked form and,
// when asked, `lights_per_pixel`, without overdraw, locks and races.
#include "lgh_build.h"
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

#include <math.h>

// As in light_gather.glsl.h.
enum { CELLS = 1 << 16, TABLE = 2 * CELLS, ROW = 1024, SAMPLES_MAX = 8, EMISSIONS = EMISSION_AB + 1 };
enum { ENTRIES = 1 << 22 };
enum { GATHER_PIXELS = 2 }; // PIXELS of light_gather.comp.glsl: of a lane

typedef struct gather_counts {
    lgh_dispatch cell_dispatch;
    uint32_t cells, entries;
} gather_counts;

typedef struct light_gather {
    gpu_pipeline mark, plan, lists[2];
    // Made when first used.
    gpu_pipeline pack[EMISSIONS][2]; // [emission][VPLs]
    // [emission][blend][uniform][count][VPLs][lights][samples]
    gpu_pipeline gather[EMISSIONS][2][2][2][2][2][SAMPLES_MAX + 1];
} light_gather;

typedef struct gather_push { // push_block in light_gather.glsl.h
    uint32_t interleave, start_level, coarser, entry_capacity, grid_capacity, slot_count, late_s1;
    float alpha, singularity;
} gather_push;

typedef struct gather_pass {
    gpu_pipeline pipeline, next; // `next` packs the VPLs, or plans the lists; {0}: nothing
    uint32_t width, height;
    gather_push push;
} gather_pass;

// The list cells' edge is the smallest power of two of cells that is at least a light's reach, 2 r. Smaller cells have
// shorter lists, but there are more of them, and blocks of pixels that lie in several.
static uint32_t coarser_of(float alpha)
{
    return (uint32_t)fmaxf(1, ceilf(log2f(2 * alpha)));
}

// Lowers what fits for tests of what happens then.
static uint32_t entry_capacity(const renderer *r)
{
    return r->gather_entries ? r->gather_entries : ENTRIES;
}

static gpu_pipeline pipeline_of(renderer *r, gpu_pipeline *pipeline, const gpu_shader *shader,
                                const uint32_t *constants, uint32_t count)
{
    if (!pipeline->id)
        *pipeline = gpu_compute_pipeline_create(
            r->gpu, &(gpu_compute_pipeline_desc){.shader = shader, .constants = constants, .constant_count = count});
    return *pipeline;
}

static gpu_pipeline pack_pipeline(renderer *r, light_gather *state, bool vpls)
{
    const uint32_t constants[] = {r->settings.emission, vpls};
    return pipeline_of(r, &state->pack[r->settings.emission][vpls], &shader_light_gather_pack_comp, constants,
                       countof(constants));
}

static gpu_pipeline gather_pipeline(renderer *r, light_gather *state, uint32_t samples)
{
    const uint32_t emission = r->settings.emission, uniform = r->settings.sampling == SAMPLING_UNIFORM,
                   vpls = r->settings.start_level == 0, blend = r->settings.blend, lights = renderer_light_slots(r) > 0;
    const uint32_t constants[] = {emission, uniform, r->count_lights, samples, vpls, blend == BLEND_PAPER, lights};
    return pipeline_of(r, &state->gather[emission][blend][uniform][r->count_lights][vpls][lights][samples],
                       &shader_light_gather_comp, constants, countof(constants));
}

static void bind(const frame_graph_context *context, gpu_pipeline pipeline, const gather_push *push)
{
    frame_graph_bind(context, pipeline);
    gpu_push(context->commands, push, sizeof *push);
}

static void execute_pack(const frame_graph_context *context, void *user)
{
    const gather_pass *pass = user;
    bind(context, pass->pipeline, &pass->push);
    gpu_dispatch_indirect(context->commands, frame_graph_buffer(context, "lgh_header"),
                          offsetof(lgh_header, light_dispatch));
    if (!pass->next.id)
        return;
    bind(context, pass->next, &pass->push);
    gpu_dispatch(context->commands, div_up_u32(pass->push.slot_count, 256), 1, 1);
}

static void execute_mark(const frame_graph_context *context, void *user)
{
    const gather_pass *pass = user;
    gpu_buffer_fill(context->commands, frame_graph_buffer(context, "gather_table"), 0, TABLE * 8, 0);
    gpu_buffer_fill(context->commands, frame_graph_buffer(context, "gather_noted"), 0, sizeof(gather_counts), 0);
    gpu_memory_barrier(context->commands);
    bind(context, pass->pipeline, &pass->push);
    gpu_dispatch(context->commands, div_up_u32(pass->width, 8), div_up_u32(pass->height, 8), 1);
    gpu_memory_barrier(context->commands);
    bind(context, pass->next, &pass->push);
    gpu_dispatch(context->commands, 1, 1, 1);
}

static void execute_lists(const frame_graph_context *context, void *user)
{
    const gather_pass *pass = user;
    bind(context, pass->pipeline, &pass->push);
    gpu_dispatch_indirect(context->commands, frame_graph_buffer(context, "gather_counts"),
                          offsetof(gather_counts, cell_dispatch));
}

static void execute_gather(const frame_graph_context *context, void *user)
{
    const gather_pass *pass = user;
    const uint32_t n = pass->push.interleave;
    bind(context, pass->pipeline, &pass->push);
    gpu_dispatch(context->commands, div_up_u32(div_up_u32(pass->width, n), 8),
                 div_up_u32(div_up_u32(pass->height, n), 8 * GATHER_PIXELS), n * n);
}

// ---- Declarations

static frame_graph_pass *add_pass(renderer *r, const char *name, void (*execute)(const frame_graph_context *, void *),
                                  gather_pass *pass)
{
    return frame_graph_pass_add(
        r->graph,
        &(frame_graph_pass_desc){
            .name = name, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = pass, .user_size = sizeof *pass});
}

static void create_buffer(frame_graph_pass *p, const char *name, uint64_t size, frame_graph_access access)
{
    const frame_graph_resource_desc desc = frame_graph_buffer_of(size);
    frame_graph_create_resource(p, name, &desc, access);
}

static void declare_pack(renderer *r, light_gather *state, gather_pass pass)
{
    const bool vpls = pass.push.start_level == 0;
    pass.pipeline = pack_pipeline(r, state, false);
    if (vpls)
        pass.next = pack_pipeline(r, state, true);
    const uint32_t lights = pass.push.grid_capacity + (vpls ? pass.push.slot_count : 0);
    const frame_graph_resource_desc image =
        frame_graph_image_of(VK_FORMAT_R32G32B32A32_UINT, 3 * ROW, div_up_u32(lights, ROW));
    frame_graph_pass *p = add_pass(r, "light_gather/pack", execute_pack, &pass);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_lights", ACCESS_STORAGE_READ);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_order", ACCESS_STORAGE_READ);
    frame_graph_create_resource(p, "gather_lights", &image, ACCESS_STORAGE_WRITE);
    frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
}

static void declare_mark(renderer *r, const light_gather *state, gather_pass pass)
{
    pass.pipeline = state->mark;
    pass.next = state->plan;
    frame_graph_pass *p = add_pass(r, "light_gather/mark", execute_mark, &pass);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, "depth", ACCESS_SAMPLED);
    create_buffer(p, "gather_table", TABLE * 8, ACCESS_STORAGE_READ_WRITE);
    create_buffer(p, "gather_noted", sizeof(gather_counts), ACCESS_STORAGE_READ_WRITE);
    create_buffer(p, "gather_cells", CELLS * 4, ACCESS_STORAGE_WRITE);
}

static void declare_lists(renderer *r, const light_gather *state, gather_pass pass)
{
    const bool vpls = pass.push.start_level == 0;
    pass.pipeline = state->lists[vpls];
    frame_graph_pass *p = add_pass(r, "light_gather/lists", execute_lists, &pass);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_modify(p, "gather_noted", "gather_counts", ACCESS_STORAGE_READ_WRITE);
    frame_graph_read(p, "gather_cells", ACCESS_STORAGE_READ);
    create_buffer(p, "gather_ranges", CELLS * 8ull * pass.push.interleave * pass.push.interleave,
                  ACCESS_STORAGE_READ_WRITE);
    create_buffer(p, "gather_entries", 4ull * pass.push.entry_capacity, ACCESS_STORAGE_WRITE);
    frame_graph_read(p, "lgh_masks", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_ranks", ACCESS_STORAGE_READ);
    frame_graph_read(p, "gather_lights", ACCESS_STORAGE_READ);
    static const char *const of_vpls[] = {"lgh_cell_masks", "lgh_cell_ranks", "lgh_cell_starts", "lgh_order"};
    for (size_t i = 0; vpls && i < countof(of_vpls); i++)
        frame_graph_read(p, of_vpls[i], ACCESS_STORAGE_READ);
    frame_graph_read(p, "gather_counts", ACCESS_INDIRECT);
}

static void declare_gather(renderer *r, light_gather *state, gather_pass pass)
{
    const uint32_t n = pass.push.interleave, width = n * div_up_u32(pass.width, n),
                   height = n * div_up_u32(pass.height, n);
    const uint32_t samples = renderer_has_shadows(r) ? r->settings.shadow_samples : 0;
    pass.pipeline = gather_pipeline(r, state, samples);
    frame_graph_pass *p = add_pass(r, "light_gather/gather", execute_gather, &pass);
    static const char *const inputs[] = {"lgh_header",    "gather_counts",  "gather_table",
                                         "gather_ranges", "gather_entries", "gather_lights"};
    for (size_t i = 0; i < countof(inputs); i++)
        frame_graph_read(p, inputs[i], ACCESS_STORAGE_READ);
    frame_graph_read(p, "depth", ACCESS_SAMPLED);
    frame_graph_read(p, "normals", ACCESS_SAMPLED);
    const frame_graph_resource_desc light = frame_graph_image_of(VK_FORMAT_R32G32B32A32_SFLOAT, width, height);
    frame_graph_create_resource(p, "indirect", &light, ACCESS_STORAGE_WRITE);
    const uint64_t pixels = (uint64_t)pass.width * pass.height;
    create_buffer(p, "reservoirs", samples > 0 ? pixels * (samples + 1) * 4 : 16, ACCESS_STORAGE_WRITE);
    const frame_graph_resource_desc number =
        frame_graph_image_of(VK_FORMAT_R32_SFLOAT, r->count_lights ? width : 1, r->count_lights ? height : 1);
    frame_graph_create_resource(p, r->count_lights ? "lights_per_pixel" : "gather_no_count", &number,
                                ACCESS_STORAGE_WRITE);
}

static void light_gather_setup(renderer *r, void *state)
{
    const render_settings *s = &r->settings;
    if (!renderer_has_indirect(r) || s->lighting != LIGHTING_GATHER)
        return;
    const gather_pass pass = {
        .width = s->width,
        .height = s->height,
        .push = {s->interleave, s->start_level, coarser_of(s->alpha), entry_capacity(r), lgh_capacity(r),
                 renderer_slots(r), !s->sample_s1, s->alpha, renderer_singularity(r)},
    };
    declare_pack(r, state, pass);
    declare_mark(r, state, pass);
    declare_lists(r, state, pass);
    declare_gather(r, state, pass);
}

static void light_gather_fini(renderer *r, void *state)
{
    light_gather *g = state;
    gpu_pipeline_destroy(r->gpu, g->mark);
    gpu_pipeline_destroy(r->gpu, g->plan);
    for (size_t i = 0; i < countof(g->lists); i++)
        gpu_pipeline_destroy(r->gpu, g->lists[i]);
    gpu_pipeline *const packs = g->pack[0], *const gathers = g->gather[0][0][0][0][0][0];
    for (size_t i = 0; i < sizeof g->pack / sizeof *packs; i++)
        gpu_pipeline_destroy(r->gpu, packs[i]);
    for (size_t i = 0; i < sizeof g->gather / sizeof *gathers; i++)
        gpu_pipeline_destroy(r->gpu, gathers[i]);
}

bool light_gather_init(renderer *r)
{
    light_gather *g = renderer_pass_add(r, "light_gather", sizeof *g, light_gather_setup, light_gather_fini);
    return pipeline_of(r, &g->mark, &shader_light_gather_mark_comp, NULL, 0).id &&
           pipeline_of(r, &g->plan, &shader_light_gather_plan_comp, NULL, 0).id &&
           pipeline_of(r, &g->lists[false], &shader_light_gather_lists_comp, NULL, 0).id &&
           pipeline_of(r, &g->lists[true], &shader_light_gather_lists_s0_comp, NULL, 0).id;
}
