// The shadow ratio S / U of each pair, and where settings.taa asks for it the same steadied over time. Only the ratio:
// the unshadowed light has no noise to remove, and blending it makes it lag, which settings.taa_target can show.
#include "direct_light.h"
#include "filters.h"
#include "modules.h"
#include "shadow_again.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>

typedef struct taa_dispatch {
    gpu_pipeline pipeline;
    uint32_t width, height;
    char made[64]; // blend: the image
    bool has_limit, hold;
} taa_dispatch;

static void blend_execute(const frame_graph_context *context, void *user)
{
    const taa_dispatch *d = user;
    const uint32_t push[] = {
        reprojection_is_valid(context) && frame_graph_history_valid(context, d->made),
        d->has_limit,
        d->hold,
    };
    frame_graph_bind(context, d->pipeline);
    gpu_push(context->commands, push, sizeof push);
    gpu_dispatch(context->commands, div_up_u32(d->width, PIXEL_GROUP_WIDTH), d->height, 1);
}

static void plain_execute(const frame_graph_context *context, void *user)
{
    const taa_dispatch *d = user;
    frame_graph_bind(context, d->pipeline);
    gpu_dispatch(context->commands, div_up_u32(d->width, PIXEL_GROUP_WIDTH), d->height, 1);
}

static frame_graph_pass *taa_pass_add(frame_graph *graph, const char *name, const taa_dispatch *dispatch,
                                      void (*execute)(const frame_graph_context *, void *))
{
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = execute,
        .user = (void *)dispatch, // copied
        .user_size = sizeof *dispatch,
    };
    return frame_graph_pass_add(graph, &desc);
}

static void image_create(frame_graph_pass *pass, const char *name, VkFormat format, uint32_t width, uint32_t height)
{
    const frame_graph_resource_desc image = frame_graph_image_of(format, width, height);
    frame_graph_create_resource(pass, name, &image, ACCESS_STORAGE_WRITE);
}

void taa_declare_ratio(const taa *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair)
{
    const taa_dispatch dispatch = {.pipeline = state->plain, .width = width, .height = height};
    char name[64], unshadowed[64], shadowed[64], ratio[64];
    snprintf(name, sizeof name, "taa/ratio_%s", pair);
    snprintf(unshadowed, sizeof unshadowed, "%s_u", pair);
    snprintf(shadowed, sizeof shadowed, "%s_s", pair);
    snprintf(ratio, sizeof ratio, "%s_ratio_now", pair);
    frame_graph_pass *pass = taa_pass_add(graph, name, &dispatch, plain_execute);
    frame_graph_read(pass, unshadowed, ACCESS_STORAGE_READ);
    frame_graph_read(pass, shadowed, ACCESS_STORAGE_READ);
    image_create(pass, ratio, VK_FORMAT_R16G16B16A16_SFLOAT, width, height);
}

void taa_declare(const taa *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair,
                 const taa_desc *desc)
{
    taa_dispatch dispatch = {
        .pipeline = desc->light ? state->light : state->blend,
        .width = width,
        .height = height,
        .has_limit = desc->limit != NULL,
        .hold = desc->hold,
    };
    char name[64], ratio_now[64];
    snprintf(dispatch.made, sizeof dispatch.made, desc->light ? "%s_steadied" : "%s_ratio", pair);
    snprintf(name, sizeof name, "taa/%s", pair);
    snprintf(ratio_now, sizeof ratio_now, "%s_ratio_now", pair);
    frame_graph_pass *pass = taa_pass_add(graph, name, &dispatch, blend_execute);
    reprojection_declare(pass);
    frame_graph_read(pass, ratio_now, ACCESS_STORAGE_READ);
    frame_graph_read_previous(pass, dispatch.made, ACCESS_STORAGE_READ);
    image_create(pass, dispatch.made, desc->light ? VK_FORMAT_R32G32B32A32_SFLOAT : VK_FORMAT_R16G16B16A16_SFLOAT,
                 width, height);
    frame_graph_read(pass, desc->limit ? desc->limit : "depth", ACCESS_SAMPLED); // else unread
    if (desc->light)
        frame_graph_read(pass, desc->light, ACCESS_SAMPLED);
}

bool taa_create(gpu *gpu, taa *state)
{
    state->blend = gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = &shader_taa_comp});
    state->light = gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = &shader_taa_light_comp});
    state->plain = gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = &shader_taa_plain_comp});
    return state->blend.id && state->light.id && state->plain.id;
}

void taa_fini(gpu *gpu, taa *state)
{
    gpu_pipeline_destroy(gpu, state->blend);
    gpu_pipeline_destroy(gpu, state->light);
    gpu_pipeline_destroy(gpu, state->plain);
}

// ---- The module

static void pair_setup(renderer *r, const taa *state, const char *pair, const taa_desc *desc)
{
    const render_settings *s = &r->settings;
    if (!s->filter)
        taa_declare_ratio(state, r->graph, s->width, s->height, pair);
    if (s->taa)
        taa_declare(state, r->graph, s->width, s->height, pair, desc);
}

static void taa_setup(renderer *r, void *state)
{
    taa_desc desc = {.hold = renderer_is_settled(r)};
    if (direct_light_is_sampled(r))
        pair_setup(r, state, "direct", &desc);
    desc.limit = shadow_again_limit(r);
    if (r->settings.taa_target == TAA_LIGHT)
        desc.light = "indirect_gathered|indirect";
    if (renderer_has_shadows(r))
        pair_setup(r, state, "shadow", &desc);
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
