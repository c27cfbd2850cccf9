// Virtual point lights at the hits of light paths: makes `vpls`, and counts the rays in `rays_vpl`. The paths' first
// rays are one batch, and each bounce makes of a batch's hits the next.
#include "modules.h"
#include "rays.h"
#include "resource_chain.h"
#include "vpl_reference.h"
#include "vpl_trace.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>

typedef struct vpl_trace {
    gpu_pipeline emit, bounce;
} vpl_trace;

typedef struct vpl_pass {
    gpu_pipeline pipeline;
    uint32_t rays;
    uint32_t push[4];
} vpl_pass;

// What is handed on from bounce to bounce.
typedef struct vpl_chains {
    uint32_t rays; // of a batch: a path each, and one for the slots that no path fills
    resource_chain counter, flux, vpls;
} vpl_chains;

typedef struct batch_name {
    char text[32];
} batch_name;

static batch_name batch_of(uint32_t bounce)
{
    batch_name name;
    snprintf(name.text, sizeof name.text, "vpl_trace/%u", bounce + 1);
    return name;
}

static void execute(const frame_graph_context *context, void *user)
{
    const vpl_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, pass->push, sizeof pass->push);
    gpu_dispatch(context->commands, div_up_u32(pass->rays, 64), 1, 1);
}

static frame_graph_pass *pass_add(renderer *r, const char *name, vpl_pass args)
{
    const frame_graph_pass_desc desc = {
        .name = name, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = &args, .user_size = sizeof args};
    return frame_graph_pass_add(r->graph, &desc);
}

static void emit_declare(renderer *r, const vpl_trace *state, vpl_chains *chains)
{
    const uint32_t paths = max_u32(1, renderer_vpl_slots(r) / r->settings.bounces);
    frame_graph_pass *pass =
        pass_add(r, "vpl_trace/emit", (vpl_pass){state->emit, chains->rays, {paths, chains->rays}});
    resource_chain_next(&chains->counter, pass);
    rays_create(r, pass, batch_of(0).text, chains->rays);
    resource_chain_next(&chains->flux, pass);
}

static void bounce_declare(renderer *r, const vpl_trace *state, vpl_chains *chains, uint32_t bounce, bool last)
{
    char name[48], hits[48];
    snprintf(name, sizeof name, "%s/bounce", batch_of(bounce).text);
    snprintf(hits, sizeof hits, "%s_hits", batch_of(bounce).text);
    const vpl_pass args = {state->bounce, chains->rays, {renderer_vpl_slots(r), r->settings.bounces, bounce, last}};
    frame_graph_pass *pass = pass_add(r, name, args);
    resource_chain_next(&chains->counter, pass);
    rays_modify(r, pass, batch_of(bounce).text, batch_of(bounce + 1).text);
    resource_chain_next(&chains->flux, pass);
    resource_chain_next(&chains->vpls, pass);
    frame_graph_read(pass, hits, ACCESS_STORAGE_READ);
}

vpl_change vpl_trace_change(const renderer *r)
{
    (void)r;
    return VPLS_ALL;
}

static void vpl_trace_setup(renderer *r, void *state)
{
    if (!renderer_has_vpls(r) || vpl_reference_has_vpls(r))
        return;
    const uint32_t slots = renderer_vpl_slots(r), bounces = min_u32(r->settings.bounces, slots);
    const uint32_t rays = div_up_u32(slots, r->settings.bounces);
    vpl_chains chains = {
        .rays = rays,
        .counter = resource_chain_counter(r->graph, "vpl_trace/clear", "rays_vpl", 1 + bounces),
        .flux = {"vpl_flux", frame_graph_buffer_of(rays * 3ull * sizeof(float)), 1 + bounces, 0},
        .vpls = {"vpls", frame_graph_buffer_of((uint64_t)slots * sizeof(vpl)), bounces, 0},
    };
    emit_declare(r, state, &chains);
    for (uint32_t bounce = 0; bounce < bounces; bounce++) {
        rays_trace(r, batch_of(bounce).text, RAYS_NEAREST, rays);
        bounce_declare(r, state, &chains, bounce, bounce + 1 == bounces);
    }
}

static void vpl_trace_fini(renderer *r, void *state)
{
    gpu_pipeline_destroy(r->gpu, ((vpl_trace *)state)->emit);
    gpu_pipeline_destroy(r->gpu, ((vpl_trace *)state)->bounce);
}

bool vpl_trace_init(renderer *r)
{
    vpl_trace *state = renderer_pass_add(r, "vpl_trace", sizeof(vpl_trace), vpl_trace_setup, vpl_trace_fini);
    state->emit =
        gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = &shader_vpl_trace_emit_comp});
    state->bounce =
        gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = &shader_vpl_trace_bounce_comp});
    return state->emit.id && state->bounce.id;
}
