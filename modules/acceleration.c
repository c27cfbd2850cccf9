// The top-level acceleration structure over the instances, rebuilt in every frame that traces it.
#include "modules.h"
#include "world.h"

typedef struct acceleration_state {
    gpu_acceleration tlas;
    uint32_t max_instances; // of `tlas`
} acceleration_state;

typedef struct acceleration_build_args {
    const renderer *r;
    gpu_acceleration tlas;
} acceleration_build_args;

static void acceleration_build(const frame_graph_context *context, void *user)
{
    const acceleration_build_args *args = user;
    const world_gpu *w = args->r->gpu_world;
    gpu_tlas_build(context->commands, args->tlas, w->tlas_instances, w->instance_count);
}

static void acceleration_setup(renderer *r, void *user)
{
    acceleration_state *state = user;
    const uint32_t wanted = max_u32(r->gpu_world->instance_max, 1);
    if (state->max_instances < wanted) {
        gpu_acceleration_destroy(r->gpu, state->tlas);
        state->tlas = gpu_tlas_create(r->gpu, wanted);
        state->max_instances = state->tlas.id ? wanted : 0;
    }
    if (!state->tlas.id) {
        r->failed = true;
        return;
    }
    frame_graph_import_acceleration(r->graph, "tlas_storage", state->tlas, ACCESS_NONE, ACCESS_NONE);
    acceleration_build_args args = {r, state->tlas};
    const frame_graph_pass_desc desc = {
        .name = "acceleration",
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = acceleration_build,
        .user = &args,
        .user_size = sizeof args,
    };
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &desc);
    frame_graph_modify(pass, "tlas_storage", "tlas", ACCESS_BUILD_WRITE);
}

static void acceleration_fini(renderer *r, void *user)
{
    acceleration_state *state = user;
    gpu_acceleration_destroy(r->gpu, state->tlas);
}

bool acceleration_init(renderer *r)
{
    renderer_pass_add(r, "acceleration", sizeof(acceleration_state), acceleration_setup, acceleration_fini);
    return true;
}
