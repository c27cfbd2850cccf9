// The acceleration structures that rays are traced through: bottom levels of deforming meshes follow their vertices,
// and the top level follows the instances, in the frames in which these change and rays are traced. "tlas" stands for
// the top level and all below it.
#include "deform.h"
#include "modules.h"
#include "world.h"

#include <stdlib.h>

typedef struct acceleration_state {
    gpu_acceleration tlas;
    uint32_t max_instances; // of `tlas`
    bool follows; // it was built over the instances as they are
    uint32_t *versions; // per deformation: of the vertices that its bottom level was built over
    bool *at_rest; // per deformation: its bottom level has the tree that the triangles have at rest
} acceleration_state;

typedef struct acceleration_args {
    const renderer *r;
    acceleration_state *state;
} acceleration_args;

// ---- Bottom levels

// The tree depends on the pose alone, not on those before it: what is rendered from a pose on is the same however it
// was come by. Poses near the one at rest keep the tree that was built then, others get one of their own.
static bool tree_is_of_rest(const world_deformation *now)
{
    return !now->stretched;
}

static gpu_triangles *triangles_alloc(const renderer *r)
{
    uint32_t most = 1;
    for (uint32_t i = 0; i < r->scene->deformation_count; i++)
        most = max_u32(most, r->scene->meshes[r->scene->deformations[i].mesh].primitive_count);
    return memory_alloc(most * sizeof(gpu_triangles));
}

static bool bottom_is_stale(const renderer *r, const acceleration_state *state, uint32_t deformation)
{
    const world_deformation *now = &r->gpu_world->deformations[deformation];
    return now->drawn && state->versions[deformation] != now->version &&
           r->gpu_world->blas[r->scene->deformations[deformation].mesh].id;
}

// Builds over the vertices at rest what has lost the tree that it had there and shall have it again.
static void trees_restore(const renderer *r, acceleration_state *state, gpu_commands *commands,
                          gpu_triangles *triangles)
{
    bool built = false;
    for (uint32_t i = 0; i < r->scene->deformation_count; i++) {
        const scene_deformation *d = &r->scene->deformations[i];
        const world_deformation *now = &r->gpu_world->deformations[i];
        if (!bottom_is_stale(r, state, i) || state->at_rest[i] || !tree_is_of_rest(now))
            continue;
        const uint32_t stride = sizeof(deform_vertex);
        const VkDeviceAddress first = gpu_buffer_address(r->gpu, deform_rest(r)) + (uint64_t)now->first_kept * stride;
        world_mesh_triangles(r, d->mesh, first - (uint64_t)d->first_vertex * stride, stride, triangles);
        gpu_blas_build(commands, r->gpu_world->blas[d->mesh], triangles, r->scene->meshes[d->mesh].primitive_count,
                       false);
        state->at_rest[i] = built = true;
    }
    if (built)
        gpu_build_barrier(commands);
}

static void bottoms_build(const frame_graph_context *context, void *user)
{
    const acceleration_args *args = user;
    const renderer *r = args->r;
    const world_gpu *w = r->gpu_world;
    acceleration_state *state = args->state;
    const VkDeviceAddress positions = gpu_buffer_address(r->gpu, w->positions);
    gpu_triangles *triangles = triangles_alloc(r);
    trees_restore(r, state, context->commands, triangles);
    for (uint32_t i = 0; i < r->scene->deformation_count; i++) {
        const uint32_t mesh = r->scene->deformations[i].mesh;
        if (!bottom_is_stale(r, state, i))
            continue;
        world_mesh_triangles(r, mesh, positions, sizeof *r->scene->positions, triangles);
        state->at_rest[i] = tree_is_of_rest(&w->deformations[i]);
        gpu_blas_build(context->commands, w->blas[mesh], triangles, r->scene->meshes[mesh].primitive_count,
                       state->at_rest[i]);
        state->versions[i] = w->deformations[i].version;
    }
    free(triangles);
}

// ---- The top level

static void top_build(const frame_graph_context *context, void *user)
{
    const acceleration_args *args = user;
    const world_gpu *w = args->r->gpu_world;
    gpu_tlas_build(context->commands, args->state->tlas, w->tlas_instances, w->instance_count);
    args->state->follows = true;
}

// Has room for all instances. False: no memory.
static bool top_reserve(renderer *r, acceleration_state *state)
{
    const uint32_t wanted = max_u32(r->gpu_world->instance_max, 1);
    if (state->max_instances >= wanted)
        return true;
    gpu_acceleration_destroy(r->gpu, state->tlas);
    state->tlas = gpu_tlas_create(r->gpu, wanted);
    state->max_instances = state->tlas.id ? wanted : 0;
    state->follows = false;
    return state->tlas.id;
}

// ---- Passes

static frame_graph_pass *pass_add(renderer *r, acceleration_state *state, const char *name,
                                  void (*execute)(const frame_graph_context *context, void *user))
{
    const acceleration_args args = {r, state};
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = execute,
        .user = (void *)&args,
        .user_size = sizeof args,
    };
    return frame_graph_pass_add(r->graph, &desc);
}

static void acceleration_setup(renderer *r, void *user)
{
    acceleration_state *state = user;
    if (!top_reserve(r, state)) {
        r->failed = true;
        return;
    }
    bool stale = false;
    for (uint32_t i = 0; i < r->scene->deformation_count; i++)
        stale |= bottom_is_stale(r, state, i);
    state->follows &= !r->gpu_world->changes.instances;
    const bool build = stale || !state->follows;
    frame_graph_import_acceleration(r->graph, build ? "tlas_kept" : "tlas", state->tlas, ACCESS_BUILD_WRITE,
                                    ACCESS_NONE);
    if (stale) {
        frame_graph_pass *pass = pass_add(r, state, "acceleration/update", bottoms_build);
        frame_graph_read(pass, "positions|-", ACCESS_BUILD_INPUT);
        frame_graph_modify(pass, "tlas_kept", "tlas_bottoms", ACCESS_BUILD_WRITE);
    }
    if (build)
        frame_graph_modify(pass_add(r, state, "acceleration", top_build), stale ? "tlas_bottoms" : "tlas_kept", "tlas",
                           ACCESS_BUILD_WRITE);
}

static void acceleration_fini(renderer *r, void *user)
{
    acceleration_state *state = user;
    gpu_acceleration_destroy(r->gpu, state->tlas);
    free(state->versions);
    free(state->at_rest);
}

bool acceleration_init(renderer *r)
{
    acceleration_state *state =
        renderer_pass_add(r, "acceleration", sizeof(acceleration_state), acceleration_setup, acceleration_fini);
    const uint32_t count = max_u32(r->scene->deformation_count, 1);
    state->versions = memory_alloc(count * sizeof *state->versions);
    state->at_rest = memory_alloc(count * sizeof *state->at_rest);
    for (uint32_t i = 0; i < count; i++)
        state->at_rest[i] = true;
    return true;
}
