// Shadows of the reservoirs' samples: makes the pair `shadow_u`, `shadow_s`, and counts the rays in `rays_shadow`.
#include "light_rays.h"
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

enum { EXACT = 1, UNIFORM = 2, JITTER = 4, VPL = 8, PAPER_BLEND = 16, VARIANTS = 32 }; // bits of a pipeline's index

typedef struct shadow {
    gpu_pipeline pipelines[VARIANTS]; // made when first used
} shadow;

typedef struct shadow_pass {
    gpu_pipeline pipeline;
    uint32_t width, height;
    struct {
        uint32_t interleave, emission, start_level, samples;
        uint32_t first, layers;
        float singularity;
    } push;
} shadow_pass;

static gpu_pipeline pipeline_of(renderer *r, shadow *state, uint32_t variant)
{
    gpu_pipeline *pipeline = &state->pipelines[variant];
    const uint32_t constants[] = {(variant & EXACT) != 0, (variant & UNIFORM) != 0, (variant & JITTER) != 0,
                                  (variant & PAPER_BLEND) != 0};
    const gpu_compute_pipeline_desc desc = {
        .shader = variant & VPL ? &shader_shadow_vpl_comp : &shader_shadow_comp,
        .constants = constants,
        .constant_count = countof(constants),
    };
    if (!pipeline->id)
        *pipeline = gpu_compute_pipeline_create(r->gpu, &desc);
    return *pipeline;
}

static void execute(const frame_graph_context *context, void *user)
{
    const shadow_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->push, sizeof pass->push);
    gpu_dispatch(context->commands, div_up_u32(pass->width, 8), div_up_u32(pass->height, 8), 1);
}

// The pass that makes the rays of the current batch.
static void declare_rays(renderer *r, shadow_pass args, const light_rays *rays, resource_chain *counter,
                         resource_chain *unshadowed)
{
    args.push.first = rays->first;
    args.push.layers = rays->count;
    const frame_graph_pass_desc desc = {
        .name = rays->pass, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = &args, .user_size = sizeof args};
    frame_graph_pass *p = frame_graph_pass_add(r->graph, &desc);
    resource_chain_next(counter, p);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_lights", ACCESS_STORAGE_READ);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(p, "depth", ACCESS_SAMPLED);
    frame_graph_read(p, "normals", ACCESS_SAMPLED);
    frame_graph_read(p, "indirect", ACCESS_SAMPLED);
    frame_graph_read(p, "reservoirs", ACCESS_STORAGE_READ);
    light_rays_make(r, rays, p);
    resource_chain_next(unshadowed, p);
    if (r->settings.end_point == END_POINT_VPL)
        frame_graph_read(p, "lgh_samples", ACCESS_STORAGE_READ);
}

static void shadow_setup(renderer *r, void *state)
{
    if (!renderer_has_shadows(r))
        return;
    const render_settings *s = &r->settings;
    const uint32_t variant = (s->lighting == LIGHTING_VOLUMES && s->reservoirs == RESERVOIRS_EXACT ? EXACT : 0) |
                             (s->sampling == SAMPLING_UNIFORM ? UNIFORM : 0) |
                             (s->end_point == END_POINT_JITTER ? JITTER : 0) |
                             (s->end_point == END_POINT_VPL ? VPL : 0) | (s->blend == BLEND_PAPER ? PAPER_BLEND : 0);
    const shadow_pass pass = {
        .pipeline = pipeline_of(r, state, variant),
        .width = s->width,
        .height = s->height,
        .push = {s->interleave, s->emission, s->start_level, s->shadow_samples, 0, 0, renderer_singularity(r)},
    };
    light_rays rays = light_rays_begin(r, "shadow", "shadow_s", s->shadow_samples);
    resource_chain counter = resource_chain_counter(r->graph, "shadow/clear", "rays_shadow", rays.batches);
    resource_chain unshadowed = {.name = "shadow_u", .desc = rays.sum.desc, .length = rays.batches};
    do
        declare_rays(r, pass, &rays, &counter, &unshadowed);
    while (light_rays_trace(r, &rays));
}

static void shadow_fini(renderer *r, void *state)
{
    for (uint32_t i = 0; i < VARIANTS; i++)
        gpu_pipeline_destroy(r->gpu, ((shadow *)state)->pipelines[i]);
}

bool shadow_init(renderer *r)
{
    return renderer_pass_add(r, "shadow", sizeof(shadow), shadow_setup, shadow_fini) != NULL;
}
