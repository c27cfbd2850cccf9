// A pass for tests that traces a list of rays in two batches, "near" for hits and "seen" for visibility.
#pragma once

#include "modules/rays.h"
#include "modules/world.h"
#include "test.h"

#include "test_shaders_shaders.h"

typedef struct ray {
    float origin[3], reach, direction[3], unused;
} ray;

typedef struct answers {
    ray_hit *hits; // per ray
    uint32_t *visible;
} answers;

typedef struct batch_pass {
    gpu_pipeline pipeline;
    gpu_buffer list;
    uint32_t count;
} batch_pass;

static void batch_execute(const frame_graph_context *context, void *user)
{
    const batch_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->count, sizeof pass->count);
    gpu_dispatch(context->commands, div_up_u32(pass->count, 64), 1, 1);
}

static void batch_make(renderer *r, batch_pass *state, const char *batch, rays_kind kind)
{
    frame_graph_pass *pass = frame_graph_pass_add(
        r->graph,
        &(frame_graph_pass_desc){.name = batch, .kind = FRAME_GRAPH_COMPUTE, .execute = batch_execute, .user = state});
    frame_graph_read(pass, "list", ACCESS_STORAGE_READ);
    rays_create(r, pass, batch, state->count);
    rays_trace(r, batch, kind, state->count);
}

static void batch_setup(renderer *r, void *user)
{
    batch_pass *state = user;
    frame_graph_import_buffer(r->graph, "list", state->list, ACCESS_HOST_WRITE, ACCESS_NONE);
    batch_make(r, state, "near", RAYS_NEAREST);
    batch_make(r, state, "seen", RAYS_VISIBLE);
}

static void batch_fini(renderer *r, void *user)
{
    batch_pass *state = user;
    gpu_pipeline_destroy(r->gpu, state->pipeline);
    gpu_buffer_destroy(r->gpu, state->list);
}

// Adds the pass to a renderer in which nobody else traces.
static inline void batch_add(renderer *r)
{
    batch_pass *state = renderer_pass_add(r, "test_batch", sizeof(batch_pass), batch_setup, batch_fini);
    state->pipeline =
        gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = &shader_rays_copy_comp});
    CHECK(state->pipeline.id != 0);
    r->exports[r->export_count++] = "near_hits";
    r->exports[r->export_count++] = "seen_visible";
}

static inline void export_read(renderer *r, const char *name, void *data, size_t size)
{
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, name);
    CHECK(buffer.id && (size == 0 || gpu_buffer_read(r->gpu, buffer, 0, data, size)));
}

// Renders a frame that traces the rays.
static inline answers trace(renderer *r, uint32_t tracer, const ray *rays, uint32_t count)
{
    batch_pass *state = ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "test_batch"), r->pass))->state;
    const gpu_buffer_desc desc = {.name = "list",
                                  .size = count * sizeof *rays,
                                  .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                                  .host = true,
                                  .data = rays};
    gpu_buffer_destroy(r->gpu, state->list);
    state->list = gpu_buffer_create(r->gpu, &desc);
    state->count = count;
    r->settings.rays = tracer;
    CHECK(state->list.id && renderer_frame(r));
    CHECK(rays_tracer(r) == tracer && rays_are_host(r) == (tracer == RAYS_EMBREE));
    const answers a = {memory_alloc(max_u32(count, 1) * sizeof *a.hits),
                       memory_alloc(max_u32(count, 1) * sizeof *a.visible)};
    export_read(r, "near_hits", a.hits, count * sizeof *a.hits);
    export_read(r, "seen_visible", a.visible, count * sizeof *a.visible);
    return a;
}

static inline void answers_free(answers *a)
{
    free(a->hits);
    free(a->visible);
}

static inline bool pass_ran(const renderer *r, const char *name)
{
    uint32_t count;
    const frame_graph_timing *timings = frame_graph_timings(r->graph, &count);
    for (uint32_t i = 0; i < count; i++)
        if (strcmp(timings[i].name, name) == 0)
            return true;
    return false;
}
