// Ray-query shadows of the reservoirs' samples: makes the pair `shadow_u`, `shadow_s`, and counts the rays in
// `rays_shadow`.
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

enum { EXACT = 1, UNIFORM = 2, JITTER = 4, VPL = 8, VARIANTS = 16 }; // bits of a pipeline's index

typedef struct shadow {
    gpu_pipeline pipelines[VARIANTS]; // made when first used
} shadow;

typedef struct shadow_pass {
    gpu_pipeline pipeline;
    uint32_t width, height;
    struct {
        uint32_t interleave, emission, start_level, samples;
        float singularity;
    } push;
} shadow_pass;

static gpu_pipeline pipeline_of(renderer *r, shadow *state, uint32_t variant)
{
    gpu_pipeline *pipeline = &state->pipelines[variant];
    const uint32_t constants[] = {(variant & EXACT) != 0, (variant & UNIFORM) != 0, (variant & JITTER) != 0};
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
    gpu_buffer_fill(context->commands, frame_graph_buffer(context, "rays_shadow"), 0, 16, 0);
    gpu_memory_barrier(context->commands);
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->push, sizeof pass->push);
    gpu_dispatch(context->commands, div_up_u32(pass->width, 8), div_up_u32(pass->height, 8), 1);
}

static void declare_bindings(renderer *r, frame_graph_pass *p)
{
    const render_settings *s = &r->settings;
    const frame_graph_resource_desc rays = {.kind = FRAME_GRAPH_BUFFER, .size = 16, .host = true};
    const frame_graph_resource_desc light = frame_graph_image_of(VK_FORMAT_R32G32B32A32_SFLOAT, s->width, s->height);
    frame_graph_read(p, "tlas", ACCESS_TRACE);
    frame_graph_create_resource(p, "rays_shadow", &rays, ACCESS_STORAGE_READ_WRITE);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_lights", ACCESS_STORAGE_READ);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(p, "depth", ACCESS_SAMPLED);
    frame_graph_read(p, "normals", ACCESS_SAMPLED);
    frame_graph_read(p, "indirect", ACCESS_SAMPLED);
    frame_graph_read(p, "reservoirs", ACCESS_STORAGE_READ);
    frame_graph_create_resource(p, "shadow_u", &light, ACCESS_STORAGE_WRITE);
    frame_graph_create_resource(p, "shadow_s", &light, ACCESS_STORAGE_WRITE);
    if (s->end_point == END_POINT_VPL)
        frame_graph_read(p, "lgh_samples", ACCESS_STORAGE_READ);
}

static void shadow_setup(renderer *r, void *state)
{
    if (!renderer_has_shadows(r))
        return;
    const render_settings *s = &r->settings;
    const uint32_t variant =
        (s->reservoirs == RESERVOIRS_EXACT ? EXACT : 0) | (s->sampling == SAMPLING_UNIFORM ? UNIFORM : 0) |
        (s->end_point == END_POINT_JITTER ? JITTER : 0) | (s->end_point == END_POINT_VPL ? VPL : 0);
    shadow_pass pass = {
        .pipeline = pipeline_of(r, state, variant),
        .width = s->width,
        .height = s->height,
        .push = {s->interleave, s->emission, s->start_level, s->shadow_samples, renderer_singularity(r)},
    };
    const frame_graph_pass_desc desc = {
        .name = "shadow", .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = &pass, .user_size = sizeof pass};
    declare_bindings(r, frame_graph_pass_add(r->graph, &desc));
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
