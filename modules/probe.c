// The passes of the probe pixels: see probe.h.
#include "probe.h"
#include "automatic_system.h"
#include "modules.h"
#include "rays.h"

#include "lanternfield_renderer_shaders.h"

enum {
    VPL_SUMS = 3 << 19, // pairs of probe and VPL slot in a frame, about: 1.6 million
    PROBES_MIN = 8,
    PROBES_MAX = 64,
    ERROR_FACTOR = 4, // of these where an error is asked for and not a time: fewer frames settle it
};

typedef struct probe_state {
    gpu_pipeline rays, sum;
    uint32_t next; // in the sequence of pixels
    uint32_t count; // of the last frame
} probe_state;

typedef struct probe_dispatch {
    gpu_pipeline pipeline;
    uint32_t groups;
    union {
        struct {
            uint32_t slots, second_half, lights, first;
            float singularity;
        } rays;
        uint32_t count;
    } push;
    uint32_t push_size;
} probe_dispatch;

static probe_state *state_of(const renderer *r)
{
    return ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "probe"), r->pass))->state;
}

uint32_t probe_count(const renderer *r)
{
    const uint32_t fit = VPL_SUMS / max_u32(1, renderer_slots(r));
    return max_u32(PROBES_MIN, min_u32(PROBES_MAX, fit)) * (r->settings.target_error > 0 ? ERROR_FACTOR : 1);
}

static void execute(const frame_graph_context *context, void *user)
{
    const probe_dispatch *d = user;
    frame_graph_bind(context, d->pipeline);
    gpu_push(context->commands, &d->push, d->push_size);
    gpu_dispatch(context->commands, d->groups, 1, 1);
}

static frame_graph_pass *pass_add(renderer *r, const char *name, probe_dispatch d)
{
    const frame_graph_pass_desc desc = {
        .name = name, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = &d, .user_size = sizeof d};
    return frame_graph_pass_add(r->graph, &desc);
}

static void rays_declare(renderer *r, const probe_state *state, uint32_t count)
{
    const uint32_t slots = renderer_vpl_slots(r), bounces = r->settings.bounces;
    const probe_dispatch d = {
        .pipeline = state->rays,
        .groups = count,
        .push.rays = {renderer_slots(r), slots / bounces / 2 * bounces, slots, state->next, renderer_singularity(r)},
        .push_size = sizeof d.push.rays,
    };
    const frame_graph_resource_desc probes = {.kind = FRAME_GRAPH_BUFFER, .size = count * sizeof(probe), .host = true};
    const frame_graph_resource_desc estimates = frame_graph_buffer_of(count * PROBE_RAYS * 3ull * sizeof(float));
    frame_graph_pass *pass = pass_add(r, "probe/rays", d);
    frame_graph_read(pass, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    frame_graph_create_resource(pass, "probes_unseen", &probes, ACCESS_STORAGE_WRITE);
    rays_create(r, pass, "probe", count * PROBE_RAYS);
    frame_graph_create_resource(pass, "probe_estimates", &estimates, ACCESS_STORAGE_WRITE);
}

// What is shown is read as the composite reads it (composite.c).
static void sum_declare(renderer *r, const probe_state *state, uint32_t count)
{
    const probe_dispatch d = {
        .pipeline = state->sum,
        .groups = div_up_u32(count, 64),
        .push.count = count,
        .push_size = sizeof d.push.count,
    };
    frame_graph_pass *pass = pass_add(r, "probe/sum", d);
    frame_graph_read(pass, "probe_estimates", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "probe_visible", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "albedo", ACCESS_SAMPLED);
    const bool steadied = r->settings.taa && r->settings.taa_target == TAA_LIGHT;
    frame_graph_read(pass, steadied ? "shadow_steadied" : "indirect_gathered|indirect|black", ACCESS_SAMPLED);
    frame_graph_read(pass, steadied ? "white" : "shadow_ratio|shadow_ratio_now|white", ACCESS_SAMPLED);
    frame_graph_modify(pass, "probes_unseen", "probes", ACCESS_STORAGE_READ_WRITE);
    frame_graph_export(r->graph, "probes", ACCESS_HOST_READ);
}

static void probe_setup(renderer *r, void *user)
{
    probe_state *state = user;
    state->count = 0;
    if ((!r->probes && !automatic_get(r)) || !renderer_has_shadows(r))
        return;
    const uint32_t count = state->count = probe_count(r);
    rays_declare(r, state, count);
    rays_trace(r, "probe", RAYS_VISIBLE, count * PROBE_RAYS);
    sum_declare(r, state, count);
    state->next += count;
}

// ---- Results

const probe *probe_results(renderer *r, uint32_t *count)
{
    *count = state_of(r)->count;
    return *count > 0 ? gpu_buffer_map(r->gpu, frame_graph_find_buffer(r->graph, "probes")) : NULL;
}

static double dot_of(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Of the variance of the sum over all VPLs, which is the squared difference between the halves' sums if they are
// independent. The picture errs from that sum by smoothing some of its noise away, so the two do not simply add up, and
// halves of a low-discrepancy sequence differ more than what is left in the whole. With 0.25 the estimate was 0.87 to
// 1.16 of the error against path tracing (cornell) or other VPLs (atrium) for 4,000 to 300,000 VPLs and alpha 1 to 4;
// with 1 it was up to 1.4.
static const double vpl_noise_left = 0.25;

static automatic_probes sums_of(const probe *p)
{
    double hierarchy[3], unshadowed[3], light[2][3], difference[2][3], error[2][3];
    for (int c = 0; c < 3; c++) {
        unshadowed[c] = (double)p->unshadowed[c];
        hierarchy[c] = (double)p->shown_unshadowed[c] - unshadowed[c];
        for (int i = 0; i < 2; i++) {
            const double first = (double)p->shadowed[i][0][c], second = (double)p->shadowed[i][1][c];
            light[i][c] = first + second;
            difference[i][c] = first - second;
            error[i][c] = (double)p->shown[c] - light[i][c];
        }
    }
    automatic_probes sums = {
        .count = 1,
        .hierarchy = dot_of(hierarchy, hierarchy),
        .unshadowed = dot_of(unshadowed, unshadowed),
        .shadows = dot_of(error[0], error[1]),
        .vpls = vpl_noise_left * dot_of(difference[0], difference[1]),
        .light = dot_of(light[0], light[1]),
    };
    const double total = sums.shadows + sums.vpls;
    sums.error_error = total * total;
    sums.error_light = total * sums.light;
    sums.light_light = sums.light * sums.light;
    return sums;
}

automatic_probes probe_sums(const probe *probes, uint32_t count)
{
    automatic_probes sums = {0};
    for (uint32_t i = 0; i < count; i++) {
        const automatic_probes one = sums_of(&probes[i]);
        automatic_probes_add(&sums, &one);
    }
    return sums;
}

// ---- The module

static void probe_fini(renderer *r, void *user)
{
    const probe_state *state = user;
    gpu_pipeline_destroy(r->gpu, state->rays);
    gpu_pipeline_destroy(r->gpu, state->sum);
}

bool probe_init(renderer *r)
{
    probe_state *state = renderer_pass_add(r, "probe", sizeof(probe_state), probe_setup, probe_fini);
    state->rays = gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = &shader_probe_rays_comp});
    state->sum = gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = &shader_probe_sum_comp});
    return state->rays.id && state->sum.id;
}
