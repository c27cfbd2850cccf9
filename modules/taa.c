// The shadow ratio S / U of each pair, steadied over time where settings.taa asks for it. Only the ratio: the
// unshadowed light has no noise to remove, and blending it would make it lag.
#include "direct_light.h"
#include "filters.h"
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>

typedef struct taa_dispatch {
    gpu_pipeline pipeline;
    uint32_t width, height;
    char ratio[64]; // the image made
} taa_dispatch;

static void blend_execute(const frame_graph_context *context, void *user)
{
    const taa_dispatch *d = user;
    const uint32_t valid = frame_graph_history_valid(context, "depth") && frame_graph_history_valid(context, d->ratio);
    frame_graph_bind(context, d->pipeline);
    gpu_push(context->commands, &valid, sizeof valid);
    gpu_dispatch(context->commands, div_up_u32(d->width, 8), div_up_u32(d->height, 8), 1);
}

static void plain_execute(const frame_graph_context *context, void *user)
{
    const taa_dispatch *d = user;
    frame_graph_bind(context, d->pipeline);
    gpu_dispatch(context->commands, div_up_u32(d->width, 8), div_up_u32(d->height, 8), 1);
}

static void surfaces_read(frame_graph_pass *pass)
{
    frame_graph_read(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    frame_graph_read(pass, "motion", ACCESS_SAMPLED);
    frame_graph_read_previous(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read_previous(pass, "normals", ACCESS_SAMPLED);
}

void taa_declare(const taa *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair, bool history)
{
    taa_dispatch dispatch = {history ? state->blend : state->plain, width, height, ""};
    char name[64], unshadowed[64], shadowed[64];
    snprintf(dispatch.ratio, sizeof dispatch.ratio, "%s_ratio", pair);
    snprintf(name, sizeof name, "taa/%s", pair);
    snprintf(unshadowed, sizeof unshadowed, "%s_u_filtered|%s_u", pair, pair);
    snprintf(shadowed, sizeof shadowed, "%s_s_filtered|%s_s", pair, pair);
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = history ? blend_execute : plain_execute,
        .user = &dispatch,
        .user_size = sizeof dispatch,
    };
    frame_graph_pass *pass = frame_graph_pass_add(graph, &desc);
    if (history)
        surfaces_read(pass);
    frame_graph_read(pass, unshadowed, ACCESS_STORAGE_READ);
    frame_graph_read(pass, shadowed, ACCESS_STORAGE_READ);
    if (history)
        frame_graph_read_previous(pass, dispatch.ratio, ACCESS_STORAGE_READ);
    const frame_graph_resource_desc image = frame_graph_image_of(VK_FORMAT_R16G16B16A16_SFLOAT, width, height);
    frame_graph_create_resource(pass, dispatch.ratio, &image, ACCESS_STORAGE_WRITE);
}

bool taa_create(gpu *gpu, taa *state)
{
    state->blend = gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = &shader_taa_comp});
    state->plain = gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = &shader_taa_plain_comp});
    return state->blend.id && state->plain.id;
}

void taa_fini(gpu *gpu, taa *state)
{
    gpu_pipeline_destroy(gpu, state->blend);
    gpu_pipeline_destroy(gpu, state->plain);
}

// ---- The module

static void taa_setup(renderer *r, void *state)
{
    const render_settings *s = &r->settings;
    if (renderer_has_shadows(r))
        taa_declare(state, r->graph, s->width, s->height, "shadow", s->taa);
    if (direct_light_is_sampled(r))
        taa_declare(state, r->graph, s->width, s->height, "direct", s->taa);
}

static void taa_release(renderer *r, void *state)
{
    taa_fini(r->gpu, state);
}

bool taa_init(renderer *r)
{
    taa *state = renderer_pass_add(r, "taa", sizeof(taa), taa_setup, taa_release);
    return taa_create(r->gpu, state);
}
