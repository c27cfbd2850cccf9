// Spatiotemporal variance-guided filter (Schied et al. 2017) for pairs of an unshadowed and a shadowed estimate, U and
// S: accumulation over time by reprojection, then five a-trous iterations. U and S are filtered with identical weights,
// so that S / U stays in [0,1].
#include "direct_light.h"
#include "filters.h"
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>

enum { ITERATIONS = 5 };

// How far U may differ, relatively and noise aside, between pixels that are averaged: by half, so that a bright spot
// next by does not decide a dim pixel's ratio; little where the filtered U is what one sees.
static const float RATIO_ONLY_TOLERANCE = 0.5f, SHOWN_TOLERANCE = 0.05f;

typedef struct svgf_dispatch {
    gpu_pipeline pipeline;
    uint32_t width, height;
    char history[32]; // temporal: what the last frame must have left
    uint32_t light_shown; // temporal: the pair's U is seen, not only its ratio
    uint32_t interleave; // a-trous
    struct {
        int32_t step;
        float light_tolerance;
        uint32_t any_value;
    } atrous;
} svgf_dispatch;

static void image_dispatch(const frame_graph_context *context, const svgf_dispatch *d)
{
    gpu_dispatch(context->commands, div_up_u32(d->width, 8), div_up_u32(d->height, 8), 1);
}

static void plain_execute(const frame_graph_context *context, void *user)
{
    const svgf_dispatch *d = user;
    frame_graph_bind(context, d->pipeline);
    image_dispatch(context, d);
}

static void temporal_execute(const frame_graph_context *context, void *user)
{
    const svgf_dispatch *d = user;
    const struct {
        uint32_t history_valid, light_shown;
    } push = {
        .history_valid = frame_graph_history_valid(context, "depth") && frame_graph_history_valid(context, d->history),
        .light_shown = d->light_shown,
    };
    frame_graph_bind(context, d->pipeline);
    gpu_push(context->commands, &push, sizeof push);
    image_dispatch(context, d);
}

static void atrous_execute(const frame_graph_context *context, void *user)
{
    const svgf_dispatch *d = user;
    frame_graph_bind(context, d->pipeline);
    gpu_push(context->commands, &d->atrous, sizeof d->atrous);
    image_dispatch(context, d);
}

static frame_graph_pass *svgf_pass_add(frame_graph *graph, const char *name, svgf_dispatch *dispatch,
                                       void (*execute)(const frame_graph_context *, void *))
{
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = execute,
        .user = dispatch,
        .user_size = sizeof *dispatch,
    };
    return frame_graph_pass_add(graph, &desc);
}

// "shadow" and "_u_filtered" make "shadow_u_filtered".
typedef struct pair_name {
    char text[64];
} pair_name;

static pair_name named(const char *pair, const char *suffix)
{
    pair_name name;
    snprintf(name.text, sizeof name.text, "%s%s", pair, suffix);
    return name;
}

static void image_create(frame_graph_pass *pass, const char *pair, const char *suffix, const svgf_dispatch *d)
{
    const frame_graph_resource_desc image = frame_graph_image_of(VK_FORMAT_R32G32B32A32_SFLOAT, d->width, d->height);
    frame_graph_create_resource(pass, named(pair, suffix).text, &image, ACCESS_STORAGE_WRITE);
}

void svgf_declare_geometry(const svgf *state, frame_graph *graph, uint32_t width, uint32_t height)
{
    svgf_dispatch dispatch = {.pipeline = state->geometry, .width = width, .height = height};
    frame_graph_pass *pass = svgf_pass_add(graph, "svgf/geometry", &dispatch, plain_execute);
    frame_graph_read(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    image_create(pass, "filter_geometry", "", &dispatch);
}

static void temporal_declare(const svgf *state, frame_graph *graph, svgf_dispatch dispatch, const char *pair)
{
    static const char *const accumulated[] = {"_u_accumulated", "_s_accumulated", "_moments"};
    dispatch.pipeline = state->temporal;
    snprintf(dispatch.history, sizeof dispatch.history, "%s_moments", pair);
    frame_graph_pass *pass = svgf_pass_add(graph, named("svgf/temporal_", pair).text, &dispatch, temporal_execute);
    frame_graph_read(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    frame_graph_read(pass, "motion", ACCESS_SAMPLED);
    frame_graph_read_previous(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read_previous(pass, "normals", ACCESS_SAMPLED);
    frame_graph_read(pass, named(pair, "_u").text, ACCESS_STORAGE_READ);
    frame_graph_read(pass, named(pair, "_s").text, ACCESS_STORAGE_READ);
    for (size_t i = 0; i < countof(accumulated); i++)
        frame_graph_read_previous(pass, named(pair, accumulated[i]).text, ACCESS_STORAGE_READ);
    for (size_t i = 0; i < countof(accumulated); i++)
        image_create(pass, pair, accumulated[i], &dispatch);
    frame_graph_read(pass, "filter_geometry", ACCESS_STORAGE_READ);
}

static void variance_declare(const svgf *state, frame_graph *graph, svgf_dispatch dispatch, const char *pair)
{
    dispatch.pipeline = state->variance;
    frame_graph_pass *pass = svgf_pass_add(graph, named("svgf/variance_", pair).text, &dispatch, plain_execute);
    frame_graph_read(pass, "filter_geometry", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    frame_graph_read(pass, named(pair, "_u_accumulated").text, ACCESS_STORAGE_READ);
    frame_graph_read(pass, named(pair, "_s_accumulated").text, ACCESS_STORAGE_READ);
    frame_graph_read(pass, named(pair, "_moments").text, ACCESS_STORAGE_READ);
    image_create(pass, pair, "_u_filter0", &dispatch);
    image_create(pass, pair, "_s_filter0", &dispatch);
}

static void atrous_declare(const svgf *state, frame_graph *graph, svgf_dispatch dispatch, const char *pair,
                           int iteration)
{
    // By iteration; what one writes the next one reads.
    static const char *const u[ITERATIONS + 1] = {"_u_filter0", "_u_filter1", "_u_filter2",
                                                  "_u_filter3", "_u_filter4", "_u_filtered"};
    static const char *const s[ITERATIONS + 1] = {"_s_filter0", "_s_filter1", "_s_filter2",
                                                  "_s_filter3", "_s_filter4", "_s_filtered"};
    char name[64];
    snprintf(name, sizeof name, "svgf/atrous_%s_%d", pair, iteration);
    dispatch.pipeline = state->atrous;
    dispatch.atrous.step = 1 << iteration;
    // The tiles of interleaving sample different lights, which neither is noise nor may be seen: the kernels of the
    // steps below n, unstopped by values, cancel all that repeats every n pixels.
    dispatch.atrous.any_value = 1u << iteration < dispatch.interleave;
    frame_graph_pass *pass = svgf_pass_add(graph, name, &dispatch, atrous_execute);
    frame_graph_read(pass, "filter_geometry", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    frame_graph_read(pass, named(pair, u[iteration]).text, ACCESS_STORAGE_READ);
    frame_graph_read(pass, named(pair, s[iteration]).text, ACCESS_STORAGE_READ);
    image_create(pass, pair, u[iteration + 1], &dispatch);
    image_create(pass, pair, s[iteration + 1], &dispatch);
}

void svgf_declare(const svgf *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair,
                  uint32_t interleave, bool light_shown)
{
    const svgf_dispatch dispatch = {
        .width = width,
        .height = height,
        .light_shown = light_shown,
        .interleave = interleave,
        .atrous.light_tolerance = light_shown ? SHOWN_TOLERANCE : RATIO_ONLY_TOLERANCE,
    };
    temporal_declare(state, graph, dispatch, pair);
    variance_declare(state, graph, dispatch, pair);
    for (int i = 0; i < ITERATIONS; i++)
        atrous_declare(state, graph, dispatch, pair, i);
}

bool svgf_create(gpu *gpu, svgf *state)
{
    state->geometry =
        gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = &shader_svgf_geometry_comp});
    state->temporal =
        gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = &shader_svgf_temporal_comp});
    state->variance =
        gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = &shader_svgf_variance_comp});
    state->atrous = gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = &shader_svgf_atrous_comp});
    return state->geometry.id && state->temporal.id && state->variance.id && state->atrous.id;
}

void svgf_fini(gpu *gpu, svgf *state)
{
    gpu_pipeline_destroy(gpu, state->geometry);
    gpu_pipeline_destroy(gpu, state->temporal);
    gpu_pipeline_destroy(gpu, state->variance);
    gpu_pipeline_destroy(gpu, state->atrous);
}

// ---- The module

static void svgf_setup(renderer *r, void *state)
{
    const render_settings *s = &r->settings;
    svgf_declare_geometry(state, r->graph, s->width, s->height);
    if (!s->filter)
        return;
    if (renderer_has_shadows(r))
        svgf_declare(state, r->graph, s->width, s->height, "shadow", s->interleave, false);
    if (direct_light_is_sampled(r))
        svgf_declare(state, r->graph, s->width, s->height, "direct", 1, !direct_light_is_analytic(r));
}

static void svgf_release(renderer *r, void *state)
{
    svgf_fini(r->gpu, state);
}

bool svgf_init(renderer *r)
{
    svgf *state = renderer_pass_add(r, "svgf", sizeof(svgf), svgf_setup, svgf_release);
    return svgf_create(r->gpu, state);
}
