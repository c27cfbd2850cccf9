// References made of the VPLs that the lighting grid hierarchy approximates: every one at every pixel, with a shadow
// ray. `vpl` sums a slice of them a frame until all are summed; `ir` (instant radiosity, Keller 1997) takes few, all of
// them in every frame. Without shadow rays (--only indirect-unshadowed, --shadow-samples 0) both sum them as they are.
//
// Progress counts slots, empty ones included, since only these are known before light is traced. A slice ends where a
// path ends, and paths are a Sobol sequence, so those so far are a smaller set of VPLs of their own: the unfinished
// picture is their sum times slots / slots so far. Each frame of `vpl` also adds its direct light to a mean.
#include "vpl_reference.h"
#include "modules.h"
#include "progressive.h"
#include "rays.h"
#include "resource_chain.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>

enum {
    FRAMES = 64, // of `vpl` at least where there are paths enough, so that direct light gets its samples
    UNSHADOWED_PAIRS = 1 << 25, // of pixel and slot in a frame without rays, about: fractions of a second
    BATCHES_MAX = 150, // in a frame: minutes of tracing, and about as many passes as there are timestamps
    GROUP = 128, // pixels of a workgroup: 64 would make more workgroups of RAYS_BATCH pixels than there may be
    LAYERS = 16, // of an invocation that makes rays: few enough to fill a GPU, many to read the G-buffer seldom
    NAME_SIZE = 40,
};

typedef struct vpl_reference {
    gpu_pipeline direct, rays, sum, sum_unshadowed;
    gpu_buffer vpls; // of `vpl`: traced in its first frame, read in the others
    bool kept; // `vpls` holds them
} vpl_reference;

// What a frame sums.
typedef struct slice {
    uint32_t first, count; // slots; where there is no VPL, frames of direct light
    uint32_t batch, batches; // slots in a batch (of rays, or the only one without rays), and how many of them
    uint32_t frames; // of direct light, this one included
} slice;

static uint32_t pixels_of(const renderer *r)
{
    return r->settings.width * r->settings.height;
}

static bool is_shadowed(const renderer *r)
{
    return r->settings.shadow_samples > 0 && r->settings.only != ONLY_INDIRECT_UNSHADOWED;
}

static bool is_instant(const renderer *r)
{
    return r->settings.method == METHOD_IR;
}

// ---- Slices

// Slots of the paths that are traced (a rest of less than a path stays empty), or frames.
static uint32_t total_of(const renderer *r)
{
    const uint32_t slots = renderer_vpl_slots(r), bounces = r->settings.bounces;
    if (!renderer_has_vpls(r))
        return is_instant(r) ? 1 : FRAMES;
    return slots < bounces ? slots : slots - slots % bounces;
}

// Whole paths, at least one, and as many as fit into a batch if possible.
static uint32_t slice_size(const renderer *r, uint32_t total)
{
    if (!renderer_has_vpls(r))
        return 1;
    if (is_instant(r))
        return total;
    const uint32_t bounces = r->settings.bounces;
    const uint32_t fit = is_shadowed(r) ? rays_layers(r, total) : UNSHADOWED_PAIRS / pixels_of(r);
    return bounces * max_u32(1, min_u32(fit / bounces, total / bounces / FRAMES));
}

static slice slice_of(const renderer *r, uint32_t total, uint32_t done)
{
    const uint32_t size = slice_size(r, total);
    slice s = {.first = min_u32(done, total)};
    s.count = min_u32(size, total - s.first);
    s.batch = is_shadowed(r) ? rays_layers(r, size) : size;
    s.batches = renderer_has_vpls(r) ? div_up_u32(s.count, s.batch) : 0;
    s.frames = div_up_u32(s.first + s.count, size);
    return s;
}

// ---- VPLs

bool vpl_reference_has_vpls(renderer *r)
{
    const vpl_reference *state =
        ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "vpl_reference"), r->pass))->state;
    return r->settings.method == METHOD_VPL && state->kept && !progressive_is_fresh(r);
}

static void keep_execute(const frame_graph_context *context, void *user)
{
    vpl_reference *state = user;
    gpu_buffer_copy(context->commands, frame_graph_buffer(context, "vpls"), state->vpls,
                    gpu_buffer_size(context->gpu, state->vpls));
    state->kept = true;
}

// Keeps the VPLs that this frame traces. False when there is no memory (logged).
static bool vpls_keep(renderer *r, vpl_reference *state)
{
    gpu_buffer_destroy(r->gpu, state->vpls);
    state->kept = false;
    const gpu_buffer_desc desc = {.name = "kept VPLs",
                                  .size = (uint64_t)renderer_vpl_slots(r) * sizeof(vpl),
                                  .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT};
    state->vpls = gpu_buffer_create(r->gpu, &desc);
    if (!state->vpls.id)
        return false;
    frame_graph_import_buffer(r->graph, "vpls_to_keep", state->vpls, ACCESS_NONE, ACCESS_NONE);
    const frame_graph_pass_desc pass = {
        .name = "vpl_reference/keep", .kind = FRAME_GRAPH_TRANSFER, .execute = keep_execute, .user = state};
    frame_graph_pass *p = frame_graph_pass_add(r->graph, &pass);
    frame_graph_read(p, "vpls", ACCESS_TRANSFER_READ);
    frame_graph_modify(p, "vpls_to_keep", "vpls_kept", ACCESS_TRANSFER_WRITE);
    return true;
}

// ---- Passes. Each modifies the sums, so that they run one after the other and batches take turns in the same memory.

typedef struct dispatch {
    gpu_pipeline pipeline;
    uint32_t x, y; // workgroups
    struct {
        uint32_t first, count; // slots
        float singularity;
    } push;
    uint32_t push_size;
} dispatch;

static void dispatch_execute(const frame_graph_context *context, void *user)
{
    const dispatch *d = user;
    frame_graph_bind(context, d->pipeline);
    if (d->push_size > 0)
        gpu_push(context->commands, &d->push, d->push_size);
    gpu_dispatch(context->commands, d->x, d->y, 1);
}

static frame_graph_pass *pass_add(renderer *r, const char *name, const dispatch *d)
{
    const frame_graph_pass_desc desc = {.name = name,
                                        .kind = FRAME_GRAPH_COMPUTE,
                                        .execute = dispatch_execute,
                                        .user = (void *)d,
                                        .user_size = sizeof *d};
    return frame_graph_pass_add(r->graph, &desc);
}

static dispatch dispatch_of(const renderer *r, gpu_pipeline pipeline, uint32_t first, uint32_t count)
{
    return (dispatch){.pipeline = pipeline,
                      .x = div_up_u32(pixels_of(r), GROUP),
                      .y = 1,
                      .push = {first, count, renderer_singularity(r)},
                      .push_size = count > 0 ? sizeof(((dispatch *)0)->push) : 0};
}

static void slot_inputs_declare(frame_graph_pass *pass)
{
    frame_graph_read(pass, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
}

// The sums after `step` of a frame's `1 + batches` modifications.
static const char *sums_name(char name[NAME_SIZE], const slice *s, uint32_t step)
{
    snprintf(name, NAME_SIZE, "sums_%u", step);
    return step == 0 ? "sums_before" : step == 1 + s->batches ? "sums" : name;
}

static void sums_modify(frame_graph_pass *pass, const slice *s, uint32_t step)
{
    char from[NAME_SIZE], to[NAME_SIZE];
    frame_graph_modify(pass, sums_name(from, s, step), sums_name(to, s, step + 1), ACCESS_STORAGE_READ_WRITE);
}

static void direct_declare(renderer *r, const vpl_reference *state, const slice *s)
{
    const dispatch d = dispatch_of(r, state->direct, 0, 0);
    frame_graph_pass *pass = pass_add(r, "vpl_reference/direct", &d);
    frame_graph_read(pass, "direct|black", ACCESS_SAMPLED);
    frame_graph_read(pass, "direct_s|black", ACCESS_SAMPLED);
    sums_modify(pass, s, 0);
}

static void unshadowed_declare(renderer *r, const vpl_reference *state, const slice *s)
{
    const dispatch d = dispatch_of(r, state->sum_unshadowed, s->first, s->count);
    frame_graph_pass *pass = pass_add(r, "vpl_reference/sum", &d);
    slot_inputs_declare(pass);
    sums_modify(pass, s, 1);
}

// A name that belongs to a batch.
static const char *batch_name(char name[NAME_SIZE], uint32_t index, const char *suffix)
{
    snprintf(name, NAME_SIZE, "vpl_reference/%u%s", index, suffix);
    return name;
}

// Makes a batch of rays, and counts them.
static void rays_declare(renderer *r, const vpl_reference *state, resource_chain *counter, uint32_t index, dispatch d)
{
    char name[NAME_SIZE];
    d.pipeline = state->rays;
    d.y = div_up_u32(d.push.count, LAYERS);
    frame_graph_pass *pass = pass_add(r, batch_name(name, index, "/rays"), &d);
    slot_inputs_declare(pass);
    rays_create(r, pass, batch_name(name, index, ""), d.push.count * pixels_of(r));
    resource_chain_next(counter, pass);
}

static void batch_declare(renderer *r, const vpl_reference *state, const slice *s, resource_chain *counter,
                          uint32_t index)
{
    char name[NAME_SIZE];
    const uint32_t first = s->first + index * s->batch;
    const dispatch d = dispatch_of(r, state->sum, first, min_u32(s->batch, s->first + s->count - first));
    rays_declare(r, state, counter, index, d);
    rays_trace(r, batch_name(name, index, ""), RAYS_VISIBLE, d.push.count * pixels_of(r));
    frame_graph_pass *pass = pass_add(r, batch_name(name, index, "/sum"), &d);
    slot_inputs_declare(pass);
    sums_modify(pass, s, 1 + index);
    frame_graph_read(pass, batch_name(name, index, "_origins"), ACCESS_STORAGE_READ);
    frame_graph_read(pass, batch_name(name, index, "_visible"), ACCESS_STORAGE_READ);
}

// ---- The method

static bool size_is_possible(const renderer *r)
{
    const render_settings *s = &r->settings;
    const char *method = is_instant(r) ? "ir" : "vpl";
    if ((uint64_t)s->width * s->height > RAYS_BATCH) {
        log_error("--size %ux%u: expected at most %u pixels for --method %s", s->width, s->height, RAYS_BATCH, method);
        return false;
    }
    const uint32_t size = slice_size(r, total_of(r)), most = BATCHES_MAX * rays_layers(r, UINT32_MAX);
    if (is_instant(r) && is_shadowed(r) && renderer_has_vpls(r) && size > most) {
        log_error("--ir-vpls %u: expected at most %u at %ux%u, as all are traced in one frame; --method vpl takes many",
                  s->ir_vpls, most, s->width, s->height);
        return false;
    }
    return true;
}

static void slice_declare(renderer *r, vpl_reference *state, const slice *s)
{
    direct_declare(r, state, s);
    if (s->batches == 0)
        return;
    if (!is_shadowed(r)) {
        unshadowed_declare(r, state, s);
        return;
    }
    resource_chain counter = resource_chain_counter(r->graph, "vpl_reference/clear", "rays_shadow", s->batches);
    for (uint32_t i = 0; i < s->batches; i++)
        batch_declare(r, state, s, &counter, i);
}

static void vpl_reference_setup(renderer *r, void *user)
{
    vpl_reference *state = user;
    if (r->settings.method != METHOD_VPL && state->vpls.id) {
        gpu_buffer_destroy(r->gpu, state->vpls);
        state->vpls = (gpu_buffer){0};
        state->kept = false;
    }
    if (r->settings.method != METHOD_VPL && !is_instant(r))
        return;
    if (!size_is_possible(r)) {
        r->failed = true;
        return;
    }
    const bool has_vpls = vpl_reference_has_vpls(r);
    const uint32_t total = total_of(r);
    const slice s = slice_of(r, total, (uint32_t)progressive_begin(r, total));
    if (has_vpls)
        frame_graph_import_buffer(r->graph, "vpls", state->vpls, ACCESS_TRANSFER_WRITE, ACCESS_NONE);
    else if (!is_instant(r) && renderer_has_vpls(r) && !vpls_keep(r, state))
        r->failed = true;
    if (r->failed)
        return;
    if (s.count > 0)
        slice_declare(r, state, &s);
    const float factors[2] = {(float)total / (float)(s.first + s.count), 1 / (float)s.frames};
    progressive_end(r, s.count, factors, false);
}

static void vpl_reference_fini(renderer *r, void *user)
{
    const vpl_reference *state = user;
    gpu_pipeline_destroy(r->gpu, state->direct);
    gpu_pipeline_destroy(r->gpu, state->rays);
    gpu_pipeline_destroy(r->gpu, state->sum);
    gpu_pipeline_destroy(r->gpu, state->sum_unshadowed);
    gpu_buffer_destroy(r->gpu, state->vpls);
}

static gpu_pipeline pipeline_of(gpu *gpu, const gpu_shader *shader)
{
    return gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = shader});
}

bool vpl_reference_init(renderer *r)
{
    vpl_reference *state =
        renderer_pass_add(r, "vpl_reference", sizeof(vpl_reference), vpl_reference_setup, vpl_reference_fini);
    state->direct = pipeline_of(r->gpu, &shader_vpl_reference_direct_comp);
    state->rays = pipeline_of(r->gpu, &shader_vpl_reference_rays_comp);
    state->sum = pipeline_of(r->gpu, &shader_vpl_reference_sum_comp);
    state->sum_unshadowed = pipeline_of(r->gpu, &shader_vpl_reference_sum_unshadowed_comp);
    return state->direct.id && state->rays.id && state->sum.id && state->sum_unshadowed.id;
}
