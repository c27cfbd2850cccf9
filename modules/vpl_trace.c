// Virtual point lights by ray query: makes `vpls`, and counts the rays in `rays_vpl`.
#include "modules.h"
#include "vpl_reference.h"

#include "lanternfield_renderer_shaders.h"

typedef struct vpl_trace {
    gpu_pipeline pipeline;
    struct {
        uint32_t path_count, slot_count, bounces;
    } push;
} vpl_trace;

static void vpl_trace_execute(const frame_graph_context *context, void *user)
{
    const vpl_trace *pass = user;
    gpu_buffer_fill(context->commands, frame_graph_buffer(context, "rays_vpl"), 0, 16, 0);
    gpu_memory_barrier(context->commands);
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->push, sizeof pass->push);
    gpu_dispatch(context->commands, div_up_u32(div_up_u32(pass->push.slot_count, pass->push.bounces), 64), 1, 1);
}

static void vpl_trace_setup(renderer *r, void *state)
{
    if (!renderer_has_vpls(r) || vpl_reference_has_vpls(r))
        return;
    vpl_trace *pass = state;
    const render_settings *s = &r->settings;
    const uint32_t slots = renderer_vpl_slots(r);
    pass->push.path_count = max_u32(1, slots / s->bounces);
    pass->push.slot_count = slots;
    pass->push.bounces = s->bounces;
    frame_graph_pass *p = frame_graph_pass_add(
        r->graph, &(frame_graph_pass_desc){
                      .name = "vpl_trace", .kind = FRAME_GRAPH_COMPUTE, .execute = vpl_trace_execute, .user = pass});
    frame_graph_read(p, "tlas", ACCESS_TRACE);
    const frame_graph_resource_desc vpls = frame_graph_buffer_of((uint64_t)slots * sizeof(vpl));
    frame_graph_create_resource(p, "vpls", &vpls, ACCESS_STORAGE_WRITE);
    const frame_graph_resource_desc rays = {.kind = FRAME_GRAPH_BUFFER, .size = 16, .host = true};
    frame_graph_create_resource(p, "rays_vpl", &rays, ACCESS_STORAGE_READ_WRITE);
}

static void vpl_trace_fini(renderer *r, void *state)
{
    gpu_pipeline_destroy(r->gpu, ((vpl_trace *)state)->pipeline);
}

bool vpl_trace_init(renderer *r)
{
    vpl_trace *state = renderer_pass_add(r, "vpl_trace", sizeof(vpl_trace), vpl_trace_setup, vpl_trace_fini);
    state->pipeline =
        gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = &shader_vpl_trace_comp});
    return state->pipeline.id != 0;
}
