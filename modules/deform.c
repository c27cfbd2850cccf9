// The pass that deforms vertices: see deform.h.
#include "deform.h"
#include "modules.h"
#include "subdivide.h"
#include "world.h"

#include "lanternfield_renderer_shaders.h"

#include <stdlib.h>
#include <string.h>

_Static_assert(sizeof(scene_influences) == sizeof(deform_influences) && SCENE_INFLUENCES == DEFORM_INFLUENCES,
               "uploaded as they are");
_Static_assert(sizeof(scene_morph) == sizeof(deform_offset), "uploaded as they are");

typedef struct deform_place { // where a deformation's items begin in the buffers
    uint32_t influences, offsets, joints, targets;
} deform_place;

typedef struct deform_state {
    gpu_pipeline pipeline;
    gpu_buffer rest, influences, offsets;
    gpu_buffer joints, targets; // host, written in the frames in which they change
    deform_place *places; // [deformation_count]
    uint32_t *versions; // [deformation_count]: of what the GPU's vertices are
    gpu_pipeline level_pipeline;
    subdivide_stencils *stencils; // [subdivision_count]: of those that deform
} deform_state;

typedef struct deform_pass {
    const renderer *r;
    deform_state *state;
} deform_pass;

static deform_state *state_of(const renderer *r)
{
    return ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "deform"), r->pass))->state;
}

gpu_buffer deform_rest(const renderer *r)
{
    return state_of(r)->rest;
}

void deform_read(frame_graph_pass *pass)
{
    static const char *const names[] = {"positions|-", "attributes|-", "previous_positions|-"};
    for (size_t i = 0; i < countof(names); i++)
        frame_graph_read(pass, names[i], ACCESS_STORAGE_READ);
}

// ---- The pass

// Writes the deformation's joints, and those of its targets that add anything; returns how many these are.
static uint32_t pose_write(const renderer *r, const deform_state *state, uint32_t index)
{
    const scene_deformation *d = &r->scene->deformations[index];
    const world_deformation *now = &r->gpu_world->deformations[index];
    const deform_place *at = &state->places[index];
    deform_target *targets = (deform_target *)gpu_buffer_map(r->gpu, state->targets) + at->targets;
    if (d->skin != SCENE_NONE)
        memcpy((deform_joint *)gpu_buffer_map(r->gpu, state->joints) + at->joints, now->joints,
               r->scene->skins[d->skin].joint_count * sizeof(deform_joint));
    uint32_t count = 0;
    for (uint32_t t = 0; t < d->target_count; t++)
        if (now->weights[t] != 0)
            targets[count++] = (deform_target){at->offsets + t * d->vertex_count, now->weights[t]};
    return count;
}

// Of levels those that are drawn: coarser and finer ones are behind until they are.
static bool is_stale(const renderer *r, const deform_state *state, uint32_t index)
{
    const world_deformation *now = &r->gpu_world->deformations[index];
    return state->versions[index] != now->version && (!r->scene->deformations[index].subdivision || now->drawn);
}

static void levels_execute(const deform_pass *pass, gpu_commands *commands)
{
    const renderer *r = pass->r;
    const world_gpu *w = r->gpu_world;
    deform_state *state = pass->state;
    for (uint32_t i = 0; i < r->scene->deformation_count; i++) {
        const scene_deformation *d = &r->scene->deformations[i];
        const world_deformation *now = &w->deformations[i];
        if (!d->subdivision || !is_stale(r, state, i))
            continue;
        const subdivide_target target = {
            .positions = w->positions,
            .attributes = w->attributes,
            .previous_positions = w->previous_positions,
            .first_kept = now->first_kept,
            .is_new = state->versions[i] + 1 != now->version,
        };
        subdivide_record(commands, state->level_pipeline, &state->stencils[d->subdivision - r->scene->subdivisions],
                         d->subdivision, d->level, &target);
        state->versions[i] = now->version;
    }
}

static void deform_execute(const frame_graph_context *context, void *user)
{
    const deform_pass *pass = user;
    deform_state *state = pass->state;
    const renderer *r = pass->r;
    frame_graph_bind(context, state->pipeline);
    for (uint32_t i = 0; i < r->scene->deformation_count; i++) {
        const scene_deformation *d = &r->scene->deformations[i];
        const world_deformation *now = &r->gpu_world->deformations[i];
        if (d->subdivision || !is_stale(r, state, i))
            continue;
        const deform_range range = {
            .vertex_count = d->vertex_count,
            .first_vertex = d->first_vertex,
            .first_kept = now->first_kept,
            .first_influence = state->places[i].influences,
            .first_joint = state->places[i].joints,
            .is_skinned = d->skin != SCENE_NONE,
            .first_target = state->places[i].targets,
            .target_count = pose_write(r, state, i),
        };
        gpu_push(context->commands, &range, sizeof range);
        gpu_dispatch(context->commands, div_up_u32(d->vertex_count, 64), 1, 1);
        state->versions[i] = now->version;
    }
    if (state->level_pipeline.id) {
        gpu_memory_barrier(context->commands);
        levels_execute(pass, context->commands);
    }
}

static void deform_setup(renderer *r, void *user)
{
    deform_state *state = user;
    bool changed = false;
    for (uint32_t i = 0; i < r->scene->deformation_count; i++)
        changed |= is_stale(r, state, i);
    if (!changed)
        return;
    const world_gpu *w = r->gpu_world;
    const deform_pass args = {r, state};
    const frame_graph_pass_desc desc = {
        .name = "deform",
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = deform_execute,
        .user = (void *)&args,
        .user_size = sizeof args,
    };
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &desc);
    const struct {
        const char *before, *after;
        gpu_buffer buffer;
    } written[] = {
        {"positions_kept", "positions", w->positions},
        {"attributes_kept", "attributes", w->attributes},
        {"previous_positions_kept", "previous_positions", w->previous_positions},
    };
    for (size_t i = 0; i < countof(written); i++) {
        frame_graph_import_buffer(r->graph, written[i].before, written[i].buffer, ACCESS_STORAGE_READ, ACCESS_NONE);
        frame_graph_modify(pass, written[i].before, written[i].after, ACCESS_STORAGE_READ_WRITE);
    }
    const struct {
        const char *name;
        gpu_buffer buffer;
    } read[] = {
        {"deform_rest", state->rest},     {"deform_influences", state->influences}, {"deform_offsets", state->offsets},
        {"deform_joints", state->joints}, {"deform_targets", state->targets},
    };
    for (size_t i = 0; i < countof(read); i++) {
        frame_graph_import_buffer(r->graph, read[i].name, read[i].buffer, ACCESS_HOST_WRITE, ACCESS_NONE);
        frame_graph_read(pass, read[i].name, ACCESS_STORAGE_READ);
    }
}

// ---- Life

// Fills `places` in, and `end` with how many of each there are.
static void places_make(const scene_data *s, deform_place *places, deform_place *end)
{
    *end = (deform_place){0};
    for (uint32_t i = 0; i < s->deformation_count; i++) {
        const scene_deformation *d = &s->deformations[i];
        places[i] = *end;
        if (d->subdivision)
            continue;
        end->influences += d->skin == SCENE_NONE ? 0 : d->vertex_count;
        end->offsets += d->target_count * d->vertex_count;
        end->joints += d->skin == SCENE_NONE ? 0 : s->skins[d->skin].joint_count;
        end->targets += d->target_count;
    }
}

static deform_vertex vertex_at_rest(const scene_data *s, uint32_t vertex)
{
    const vertex_attributes *a = &s->attributes[vertex];
    deform_vertex rest;
    memcpy(rest.position, s->positions[vertex], sizeof rest.position);
    memcpy(rest.normal, a->normal, sizeof rest.normal);
    memcpy(rest.tangent, a->tangent, sizeof rest.tangent);
    return rest;
}

// An item of `size` bytes each, from the memory that `fill` writes.
static bool buffer_make(renderer *r, gpu_buffer *buffer, const char *name, uint64_t count, size_t size, bool host,
                        const void *data)
{
    if (count * size > gpu_storage_buffer_max(r->gpu)) {
        log_error("%s: %s of the deforming meshes take %llu bytes; the device binds at most %llu", r->scene->path, name,
                  (unsigned long long)(count * size), (unsigned long long)gpu_storage_buffer_max(r->gpu));
        return false;
    }
    const gpu_buffer_desc desc = {
        .name = name,
        .size = count * size,
        .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                 VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR,
        .host = host,
        .data = count > 0 ? data : NULL,
    };
    *buffer = gpu_buffer_create(r->gpu, &desc);
    return buffer->id != 0;
}

static bool buffers_make(renderer *r, deform_state *state, const deform_place *end)
{
    const scene_data *s = r->scene;
    const uint32_t vertices = r->gpu_world->kept_vertices;
    deform_vertex *rest = memory_alloc(max_u32(vertices, 1) * sizeof *rest);
    scene_influences *influences = memory_alloc(max_u32(end->influences, 1) * sizeof *influences);
    scene_morph *offsets = memory_alloc(max_u32(end->offsets, 1) * sizeof *offsets);
    for (uint32_t i = 0, kept = 0; i < s->deformation_count; i++) {
        const scene_deformation *d = &s->deformations[i];
        const deform_place *at = &state->places[i];
        for (uint32_t v = 0; v < d->vertex_count; v++)
            rest[kept++] = vertex_at_rest(s, d->first_vertex + v);
        if (d->influences)
            memcpy(influences + at->influences, d->influences, d->vertex_count * sizeof *influences);
        if (d->target_count > 0)
            memcpy(offsets + at->offsets, d->morphs, (size_t)d->target_count * d->vertex_count * sizeof *offsets);
    }
    const bool made =
        buffer_make(r, &state->rest, "vertices at rest", vertices, sizeof *rest, false, rest) &&
        buffer_make(r, &state->influences, "joint weights", end->influences, sizeof *influences, false, influences) &&
        buffer_make(r, &state->offsets, "morph targets", end->offsets, sizeof *offsets, false, offsets) &&
        buffer_make(r, &state->joints, "joints", end->joints, sizeof(deform_joint), true, NULL) &&
        buffer_make(r, &state->targets, "morph weights", end->targets, sizeof(deform_target), true, NULL);
    free(rest);
    free(influences);
    free(offsets);
    return made;
}

static void deform_fini(renderer *r, void *user)
{
    deform_state *state = user;
    gpu_pipeline_destroy(r->gpu, state->pipeline);
    const gpu_buffer buffers[] = {state->rest, state->influences, state->offsets, state->joints, state->targets};
    for (size_t i = 0; i < countof(buffers); i++)
        gpu_buffer_destroy(r->gpu, buffers[i]);
    gpu_pipeline_destroy(r->gpu, state->level_pipeline);
    for (uint32_t i = 0; state->stencils && i < r->scene->subdivision_count; i++)
        subdivide_stencils_destroy(r->gpu, &state->stencils[i]);
    free(state->stencils);
    free(state->places);
    free(state->versions);
}

// The stencils of every level that deforms.
static bool levels_make(renderer *r, deform_state *state)
{
    const scene_data *s = r->scene;
    bool made = true;
    state->stencils = memory_alloc(max_u32(s->subdivision_count, 1) * sizeof *state->stencils);
    for (uint32_t i = 0; i < s->subdivision_count && made; i++)
        if (r->gpu_world->mesh_deformations[s->subdivisions[i].mesh] != SCENE_NONE) {
            const gpu_compute_pipeline_desc desc = {.shader = &shader_subdivide_comp};
            if (!state->level_pipeline.id)
                state->level_pipeline = gpu_compute_pipeline_create(r->gpu, &desc);
            made =
                state->level_pipeline.id && subdivide_stencils_create(r->gpu, &s->subdivisions[i], &state->stencils[i]);
        }
    return made;
}

bool deform_init(renderer *r)
{
    const uint32_t count = r->scene->deformation_count;
    if (count == 0) // takes no entity: light paths are keyed by those of their lights
        return true;
    deform_state *state = renderer_pass_add(r, "deform", sizeof(deform_state), deform_setup, deform_fini);
    state->places = memory_alloc(count * sizeof *state->places);
    state->versions = memory_alloc(count * sizeof *state->versions);
    deform_place end;
    places_make(r->scene, state->places, &end);
    state->pipeline = gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = &shader_deform_comp});
    return state->pipeline.id && buffers_make(r, state, &end) && levels_make(r, state);
}
