// A pass for tests: the sum over every VPL at every pixel in one shader, as the image "brute_force" (light, nits):
// shader_brute_force_comp without shadows, shader_brute_force_shadowed_comp with a ray query to each.
#pragma once

#include "modules/renderer.h"

typedef struct brute_force {
    gpu_pipeline pipeline;
    uint32_t width, height;
    struct {
        uint32_t slot_count;
        float singularity;
    } push;
} brute_force;

static void brute_force_execute(const frame_graph_context *context, void *user)
{
    const brute_force *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->push, sizeof pass->push);
    gpu_dispatch(context->commands, div_up_u32(pass->width, 8), div_up_u32(pass->height, 8), 1);
}

static void brute_force_setup(renderer *r, void *state)
{
    brute_force *pass = state;
    pass->width = r->settings.width;
    pass->height = r->settings.height;
    pass->push.slot_count = renderer_slots(r);
    pass->push.singularity = renderer_singularity(r);
    const frame_graph_pass_desc desc = {
        .name = "brute_force", .kind = FRAME_GRAPH_COMPUTE, .execute = brute_force_execute, .user = pass};
    const frame_graph_resource_desc image =
        frame_graph_image_of(VK_FORMAT_R32G32B32A32_SFLOAT, pass->width, pass->height);
    frame_graph_pass *p = frame_graph_pass_add(r->graph, &desc);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(p, "depth", ACCESS_SAMPLED);
    frame_graph_read(p, "normals", ACCESS_SAMPLED);
    frame_graph_create_resource(p, "brute_force", &image, ACCESS_STORAGE_WRITE);
    frame_graph_read(p, "tlas", ACCESS_TRACE);
}

static void brute_force_fini(renderer *r, void *state)
{
    gpu_pipeline_destroy(r->gpu, ((brute_force *)state)->pipeline);
}

static inline void brute_force_add(renderer *r, const gpu_shader *shader)
{
    brute_force *pass = renderer_pass_add(r, "brute_force", sizeof *pass, brute_force_setup, brute_force_fini);
    pass->pipeline = gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = shader});
}
