// Spatiotemporal variance-guided filter (Schied et al. 2017) for pairs of an unshadowed and a shadowed estimate, U and
// S: accumulation over time by reprojection, then six or seven a-trous iterations. U and S are filtered with identical
// weights, so that S / U stays in [0,1].
#include "direct_light.h"
#include "filters.h"
#include "modules.h"
#include "shadow_again.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>

enum { STEP_MAX = 16, DESCENDING = 5 }; // pixels; iterations from STEP_MAX down to 1

// How far U may differ, relatively and noise aside, between pixels that are averaged: by half, so that a bright spot
// next by does not decide a dim pixel's ratio; little where the filtered U is what one sees.
static const float RATIO_ONLY_TOLERANCE = 0.5f, SHOWN_TOLERANCE = 0.05f;

// A new frame's least share of the history, which is then worth 2 / share - 1 frames. Measured on the Cornell box with
// one sample: the settled deviation over time is 0.0097, 0.0069 and 0.0056 with 1/8, 1/16 and 1/32, the error 0.042,
// 0.041 and 0.041, while what `agreement` cannot tell from noise takes 22, 46 and 94 frames to fade.
enum { SHARES = 16 };

typedef struct svgf_dispatch {
    gpu_pipeline pipeline;
    uint32_t width, height;
    char history[32]; // temporal: what the last frame must have left
    uint32_t light_shown; // temporal, variance: the pair's U is seen, not only its ratio
    uint32_t still_frames; // temporal
    bool has_limit; // temporal
    uint32_t interleave; // a-trous
    struct {
        int32_t step;
        float light_tolerance;
        uint32_t any_value;
    } atrous;
} svgf_dispatch;

static void image_dispatch(const frame_graph_context *context, const svgf_dispatch *d)
{
    gpu_dispatch(context->commands, div_up_u32(d->width, PIXEL_GROUP_WIDTH), d->height, 1);
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
    // While nothing changes, all frames count alike; those before are let fade first.
    const uint32_t shares = max_u32(SHARES, d->still_frames + 1), frames = max_u32(2 * SHARES - 1, shares);
    const struct {
        uint32_t history_valid, light_shown, has_limit;
        float frames_max, share_min;
    } push = {
        .history_valid = reprojection_is_valid(context) && frame_graph_history_valid(context, d->history),
        .light_shown = d->light_shown,
        .has_limit = d->has_limit,
        .frames_max = (float)frames,
        .share_min = 1.0f / (float)shares,
    };
    frame_graph_bind(context, d->pipeline);
    gpu_push(context->commands, &push, sizeof push);
    image_dispatch(context, d);
}

static void variance_execute(const frame_graph_context *context, void *user)
{
    const svgf_dispatch *d = user;
    frame_graph_bind(context, d->pipeline);
    gpu_push(context->commands, &d->light_shown, sizeof d->light_shown);
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

static void image_create(frame_graph_pass *pass, const char *pair, const char *suffix, VkFormat format,
                         const svgf_dispatch *d)
{
    const frame_graph_resource_desc image = frame_graph_image_of(format, d->width, d->height);
    frame_graph_create_resource(pass, named(pair, suffix).text, &image, ACCESS_STORAGE_WRITE);
}

void reprojection_declare(frame_graph_pass *pass)
{
    static const char *const now[] = {"depth", "normals", "motion", "albedo"};
    static const char *const before[] = {"depth", "normals", "albedo"};
    for (size_t i = 0; i < countof(now); i++)
        frame_graph_read(pass, now[i], ACCESS_SAMPLED);
    for (size_t i = 0; i < countof(before); i++)
        frame_graph_read_previous(pass, before[i], ACCESS_SAMPLED);
}

bool reprojection_is_valid(const frame_graph_context *context)
{
    return frame_graph_history_valid(context, "depth");
}

void svgf_declare_geometry(const svgf *state, frame_graph *graph, uint32_t width, uint32_t height)
{
    svgf_dispatch dispatch = {.pipeline = state->geometry, .width = width, .height = height};
    frame_graph_pass *pass = svgf_pass_add(graph, "svgf/geometry", &dispatch, plain_execute);
    frame_graph_read(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    image_create(pass, "filter_geometry", "", VK_FORMAT_R32G32B32A32_SFLOAT, &dispatch);
}

static const char *const accumulated[] = {"_u_accumulated", "_s_accumulated", "_moments"};

static void temporal_declare(const svgf *state, frame_graph *graph, svgf_dispatch dispatch, const char *pair,
                             const char *limit)
{
    dispatch.pipeline = state->temporal;
    dispatch.has_limit = limit != NULL;
    snprintf(dispatch.history, sizeof dispatch.history, "%s_moments", pair);
    frame_graph_pass *pass = svgf_pass_add(graph, named("svgf/temporal_", pair).text, &dispatch, temporal_execute);
    reprojection_declare(pass);
    frame_graph_read(pass, "filter_geometry", ACCESS_STORAGE_READ);
    frame_graph_read(pass, named(pair, "_u").text, ACCESS_STORAGE_READ);
    frame_graph_read(pass, named(pair, "_s").text, ACCESS_STORAGE_READ);
    for (size_t i = 0; i < countof(accumulated); i++)
        frame_graph_read_previous(pass, named(pair, accumulated[i]).text, ACCESS_STORAGE_READ);
    frame_graph_read_previous(pass, named(pair, "_means").text, ACCESS_STORAGE_READ);
    for (size_t i = 0; i < countof(accumulated); i++)
        image_create(pass, pair, accumulated[i], VK_FORMAT_R32G32B32A32_SFLOAT, &dispatch);
    image_create(pass, pair, "_pair", VK_FORMAT_R32G32B32A32_UINT, &dispatch);
    frame_graph_read(pass, limit ? limit : "depth", ACCESS_SAMPLED); // without one something else stands in, unread
}

// In place of temporal_declare: leaves the history as it is.
static void hold_declare(const svgf *state, frame_graph *graph, svgf_dispatch dispatch, const char *pair)
{
    dispatch.pipeline = state->hold;
    frame_graph_pass *pass = svgf_pass_add(graph, named("svgf/hold_", pair).text, &dispatch, plain_execute);
    for (size_t i = 0; i < countof(accumulated); i++)
        frame_graph_read_previous(pass, named(pair, accumulated[i]).text, ACCESS_STORAGE_READ);
    for (size_t i = 0; i < countof(accumulated); i++)
        image_create(pass, pair, accumulated[i], VK_FORMAT_R32G32B32A32_SFLOAT, &dispatch);
    image_create(pass, pair, "_pair", VK_FORMAT_R32G32B32A32_UINT, &dispatch);
    // Unread: kept for the frame in which something changes.
    static const char *const kept[] = {"depth", "normals", "albedo"};
    for (size_t i = 0; i < countof(kept); i++)
        frame_graph_read_previous(pass, kept[i], ACCESS_SAMPLED);
    frame_graph_read_previous(pass, named(pair, "_means").text, ACCESS_STORAGE_READ);
}

static void variance_declare(const svgf *state, frame_graph *graph, svgf_dispatch dispatch, const char *pair)
{
    dispatch.pipeline = state->variance;
    frame_graph_pass *pass = svgf_pass_add(graph, named("svgf/variance_", pair).text, &dispatch, variance_execute);
    frame_graph_read(pass, "filter_geometry", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    frame_graph_read(pass, named(pair, "_moments").text, ACCESS_STORAGE_READ);
    frame_graph_read(pass, named(pair, "_pair").text, ACCESS_STORAGE_READ);
    image_create(pass, pair, "_pair0", VK_FORMAT_R32G32B32A32_UINT, &dispatch);
    image_create(pass, pair, "_means", VK_FORMAT_R32G32_SFLOAT, &dispatch);
}

// Iterations before the descending ones: the steps below the interleaving's n, and step 1 in any case, so that no
// single sample is spread over a lattice.
static int fine_iterations(const svgf_dispatch *d)
{
    int fine = 1;
    while (1u << fine < d->interleave)
        fine++;
    return fine;
}

// After the fine steps the coarsest, then down to 1: each step fills the gaps that the one before left. Ascending, the
// last steps' lattices stay, which are seen as a crosshatch with the 3x3 kernel.
static int32_t step_of(const svgf_dispatch *d, int iteration)
{
    const int fine = fine_iterations(d);
    return iteration < fine ? 1 << iteration : STEP_MAX >> (iteration - fine);
}

// `suffix` completes the pass's name. What it makes is left to the caller.
static frame_graph_pass *atrous_declare(frame_graph *graph, svgf_dispatch dispatch, const char *pair, int iteration,
                                        const char *suffix)
{
    char name[64], from[64];
    snprintf(name, sizeof name, "svgf/atrous_%s_%d%s", pair, iteration, suffix);
    snprintf(from, sizeof from, "%s_pair%d", pair, iteration);
    dispatch.atrous.step = step_of(&dispatch, iteration);
    // The tiles of interleaving sample different lights, which neither is noise nor may be seen: the kernels of the
    // steps below n, unstopped by values, cancel all that repeats every n pixels.
    dispatch.atrous.any_value = 1u << iteration < dispatch.interleave;
    frame_graph_pass *pass = svgf_pass_add(graph, name, &dispatch, atrous_execute);
    frame_graph_read(pass, "filter_geometry", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    frame_graph_read(pass, from, ACCESS_STORAGE_READ);
    return pass;
}

// The last iteration has two forms, for the ratio and for the pair; the graph culls the one that nobody reads.
static void iterations_declare(const svgf *state, frame_graph *graph, svgf_dispatch dispatch, const char *pair)
{
    dispatch.pipeline = state->atrous;
    const int last_iteration = fine_iterations(&dispatch) + DESCENDING - 1;
    for (int i = 0; i < last_iteration; i++) {
        char to[16];
        snprintf(to, sizeof to, "_pair%d", i + 1);
        image_create(atrous_declare(graph, dispatch, pair, i, ""), pair, to, VK_FORMAT_R32G32B32A32_UINT, &dispatch);
    }
    dispatch.pipeline = state->atrous_ratio;
    frame_graph_pass *ratio = atrous_declare(graph, dispatch, pair, last_iteration, "");
    image_create(ratio, pair, "_ratio_now", VK_FORMAT_R16G16B16A16_SFLOAT, &dispatch);
    dispatch.pipeline = state->atrous_last;
    frame_graph_pass *last = atrous_declare(graph, dispatch, pair, last_iteration, "_pair");
    image_create(last, pair, "_u_filtered", VK_FORMAT_R32G32B32A32_SFLOAT, &dispatch);
    image_create(last, pair, "_s_filtered", VK_FORMAT_R32G32B32A32_SFLOAT, &dispatch);
}

void svgf_declare(const svgf *state, frame_graph *graph, uint32_t width, uint32_t height, const char *pair,
                  const svgf_desc *desc)
{
    const svgf_dispatch dispatch = {
        .width = width,
        .height = height,
        .light_shown = desc->light_shown,
        .still_frames = desc->still_frames,
        .interleave = max_u32(desc->interleave, 1),
        .atrous.light_tolerance = desc->light_shown ? SHOWN_TOLERANCE : RATIO_ONLY_TOLERANCE,
    };
    if (desc->hold)
        hold_declare(state, graph, dispatch, pair);
    else
        temporal_declare(state, graph, dispatch, pair, desc->limit);
    variance_declare(state, graph, dispatch, pair);
    iterations_declare(state, graph, dispatch, pair);
}

static gpu_pipeline pipeline_of(gpu *gpu, const gpu_shader *shader)
{
    return gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = shader});
}

bool svgf_create(gpu *gpu, svgf *state)
{
    *state = (svgf){
        .geometry = pipeline_of(gpu, &shader_svgf_geometry_comp),
        .temporal = pipeline_of(gpu, &shader_svgf_temporal_comp),
        .hold = pipeline_of(gpu, &shader_svgf_hold_comp),
        .variance = pipeline_of(gpu, &shader_svgf_variance_comp),
        .atrous = pipeline_of(gpu, &shader_svgf_atrous_comp),
        .atrous_ratio = pipeline_of(gpu, &shader_svgf_atrous_ratio_comp),
        .atrous_last = pipeline_of(gpu, &shader_svgf_atrous_last_comp),
    };
    return state->geometry.id && state->temporal.id && state->hold.id && state->variance.id && state->atrous.id &&
           state->atrous_ratio.id && state->atrous_last.id;
}

void svgf_fini(gpu *gpu, svgf *state)
{
    gpu_pipeline_destroy(gpu, state->geometry);
    gpu_pipeline_destroy(gpu, state->temporal);
    gpu_pipeline_destroy(gpu, state->hold);
    gpu_pipeline_destroy(gpu, state->variance);
    gpu_pipeline_destroy(gpu, state->atrous);
    gpu_pipeline_destroy(gpu, state->atrous_ratio);
    gpu_pipeline_destroy(gpu, state->atrous_last);
}

// ---- The module

static void svgf_setup(renderer *r, void *state)
{
    const render_settings *s = &r->settings;
    svgf_declare_geometry(state, r->graph, s->width, s->height);
    if (!s->filter)
        return;
    svgf_desc desc = {.still_frames = r->still_frames, .hold = renderer_is_settled(r)};
    if (direct_light_is_sampled(r)) {
        desc.light_shown = !direct_light_is_analytic(r);
        svgf_declare(state, r->graph, s->width, s->height, "direct", &desc);
    }
    desc.light_shown = false;
    desc.interleave = s->interleave;
    desc.limit = shadow_again_limit(r);
    if (renderer_has_shadows(r))
        svgf_declare(state, r->graph, s->width, s->height, "shadow", &desc);
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
