// The tracing passes of ray batches: see rays.h.
#include "rays.h"
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>

typedef struct rays_state {
    gpu_pipeline pipelines[2]; // by rays_kind
} rays_state;

typedef struct rays_pass {
    gpu_pipeline pipeline;
    uint32_t count;
} rays_pass;

enum { NAME_SIZE = 64 };

static void name_print(char name[NAME_SIZE], const char *batch, const char *suffix)
{
    const int length = snprintf(name, NAME_SIZE, "%s%s", batch, suffix);
    assert(length < NAME_SIZE);
    (void)length;
}

bool rays_are_host(const renderer *r)
{
    (void)r;
    return false;
}

uint32_t rays_layers(const renderer *r, uint32_t wanted)
{
    const uint64_t pixels = (uint64_t)r->settings.width * r->settings.height;
    const uint64_t fit = RAYS_BATCH / pixels;
    return fit < 1 ? 1 : fit < wanted ? (uint32_t)fit : wanted;
}

static frame_graph_resource_desc batch_buffer(const renderer *r, uint32_t count, uint64_t item_size)
{
    frame_graph_resource_desc desc = frame_graph_buffer_of(count * item_size);
    desc.host = rays_are_host(r);
    return desc;
}

void rays_create(renderer *r, frame_graph_pass *pass, const char *batch, uint32_t count)
{
    static const char *const suffixes[] = {"_origins", "_directions"};
    const frame_graph_resource_desc desc = batch_buffer(r, count, 4 * sizeof(float));
    for (size_t i = 0; i < countof(suffixes); i++) {
        char name[NAME_SIZE];
        name_print(name, batch, suffixes[i]);
        frame_graph_create_resource(pass, name, &desc, ACCESS_STORAGE_WRITE);
    }
}

void rays_modify(renderer *r, frame_graph_pass *pass, const char *from, const char *to)
{
    (void)r;
    static const char *const suffixes[] = {"_origins", "_directions"};
    for (size_t i = 0; i < countof(suffixes); i++) {
        char from_name[NAME_SIZE], to_name[NAME_SIZE];
        name_print(from_name, from, suffixes[i]);
        name_print(to_name, to, suffixes[i]);
        frame_graph_modify(pass, from_name, to_name, ACCESS_STORAGE_READ_WRITE);
    }
}

static void query_execute(const frame_graph_context *context, void *user)
{
    const rays_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->count, sizeof pass->count);
    gpu_dispatch(context->commands, div_up_u32(pass->count, 128), 1, 1); // 64 would be one group too many for RAYS_BATCH
}

void rays_trace(renderer *r, const char *batch, rays_kind kind, uint32_t count)
{
    const rays_state *state = ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "rays"), r->pass))->state;
    char name[NAME_SIZE];
    name_print(name, batch, "/trace");
    const rays_pass args = {state->pipelines[kind], count};
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &(frame_graph_pass_desc){
                                                                .name = name,
                                                                .kind = FRAME_GRAPH_COMPUTE,
                                                                .execute = query_execute,
                                                                .user = (void *)&args,
                                                                .user_size = sizeof args,
                                                            });
    frame_graph_read(pass, "tlas", ACCESS_TRACE);
    name_print(name, batch, "_origins");
    frame_graph_read(pass, name, ACCESS_STORAGE_READ);
    name_print(name, batch, "_directions");
    frame_graph_read(pass, name, ACCESS_STORAGE_READ);
    const frame_graph_resource_desc desc =
        batch_buffer(r, count, kind == RAYS_NEAREST ? sizeof(ray_hit) : sizeof(uint32_t));
    name_print(name, batch, kind == RAYS_NEAREST ? "_hits" : "_visible");
    frame_graph_create_resource(pass, name, &desc, ACCESS_STORAGE_WRITE);
}

static void rays_setup(renderer *r, void *state)
{
    (void)r, (void)state; // only other modules add passes
}

static void rays_fini(renderer *r, void *state)
{
    for (uint32_t kind = 0; kind < 2; kind++)
        gpu_pipeline_destroy(r->gpu, ((rays_state *)state)->pipelines[kind]);
}

bool rays_init(renderer *r)
{
    rays_state *state = renderer_pass_add(r, "rays", sizeof(rays_state), rays_setup, rays_fini);
    const gpu_shader *const shaders[] = {
        [RAYS_VISIBLE] = &shader_rays_visible_comp,
        [RAYS_NEAREST] = &shader_rays_nearest_comp,
    };
    for (uint32_t kind = 0; kind < 2; kind++)
        state->pipelines[kind] =
            gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = shaders[kind]});
    return state->pipelines[0].id && state->pipelines[1].id;
}
