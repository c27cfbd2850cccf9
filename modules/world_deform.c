// The deformations of a frame as the CPU sees them: joint matrices and weights from the entities, whether any changed,
// and a box around what they make of the vertices.
#include "world.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CGLM_FORCE_DEPTH_ZERO_TO_ONE
#include <cglm/cglm.h>

typedef float joint_rows[3][4];

// Of one deformation. Without a skin there is one joint, which moves nothing.
struct deformation_state {
    uint32_t joint_count;
    joint_rows *joints; // [joint_count]
    float *weights; // [target_count]
    box *rest; // [joint_count]: around the vertices that the joint moves, mesh space at rest; empty: none
    box *offsets; // [joint_count][target_count]: around what a target of weight 1 adds to them
    float rest_area; // surface of the box around all vertices at rest
};
typedef struct deformation_state deformation_state;

static const box box_empty = {{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};

static bool box_is_empty(const box *b)
{
    return b->min[0] > b->max[0];
}

static void box_add(box *b, const float low[3], const float high[3])
{
    for (int k = 0; k < 3; k++) {
        b->min[k] = fminf(b->min[k], low[k]);
        b->max[k] = fmaxf(b->max[k], high[k]);
    }
}

// Half of its surface.
static float box_area(const box *b)
{
    float e[3];
    glm_vec3_sub((float *)b->max, (float *)b->min, e);
    return e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
}

// Adds `weight` times an interval along each axis.
static void box_grow(box *b, const box *by, float weight)
{
    for (int k = 0; k < 3; k++) {
        b->min[k] += fminf(weight * by->min[k], weight * by->max[k]);
        b->max[k] += fmaxf(weight * by->min[k], weight * by->max[k]);
    }
}

// Adds the box around `from` once transformed (Arvo 1990, "Transforming Axis-Aligned Bounding Boxes").
static void box_add_transformed(box *b, const box *from, const joint_rows rows)
{
    float low[3], high[3];
    for (int row = 0; row < 3; row++) {
        low[row] = high[row] = rows[row][3];
        for (int k = 0; k < 3; k++) {
            const float x = rows[row][k] * from->min[k], y = rows[row][k] * from->max[k];
            low[row] += fminf(x, y);
            high[row] += fmaxf(x, y);
        }
    }
    box_add(b, low, high);
}

// Makes room for the rounding of what the GPU computes.
static void box_pad(box *b)
{
    const float MARGIN = 1e-5f;
    float reach = 0;
    for (int k = 0; k < 3; k++)
        reach = fmaxf(reach, fmaxf(fabsf(b->min[k]), fabsf(b->max[k])));
    for (int k = 0; k < 3; k++) {
        b->min[k] -= MARGIN * reach;
        b->max[k] += MARGIN * reach;
    }
}

// ---- Joints and weights

// Both write what differs and say whether anything did. A joint whose entity is gone stays where it was.
static bool joints_follow(const renderer *r, const scene_skin *skin, joint_rows *joints)
{
    const world_gpu *w = r->gpu_world;
    bool changed = false;
    for (uint32_t i = 0; i < skin->joint_count; i++) {
        const transform_component *transform = ecs_get(r->world, w->node_entities[skin->joints[i]], w->transform);
        if (!transform)
            continue;
        float product[16];
        joint_rows rows;
        world_matrix_multiply(transform->world, skin->inverse_bind[i], product);
        for (int row = 0; row < 3; row++)
            for (int k = 0; k < 4; k++)
                rows[row][k] = product[4 * k + row];
        changed |= memcmp(joints[i], rows, sizeof rows) != 0;
        memcpy(joints[i], rows, sizeof rows);
    }
    return changed;
}

static bool weights_follow(const renderer *r, const scene_deformation *d, float *weights)
{
    const world_gpu *w = r->gpu_world;
    const weights_component *now = ecs_get(r->world, w->node_entities[d->node], w->weights);
    if (!now || d->target_count == 0)
        return false;
    assert(now->count == d->target_count);
    const bool changed = memcmp(weights, now->weights, d->target_count * sizeof *weights) != 0;
    memcpy(weights, now->weights, d->target_count * sizeof *weights);
    return changed;
}

static float determinant(const joint_rows rows)
{
    float cross[3];
    glm_vec3_cross((float *)rows[0], (float *)rows[1], cross);
    return glm_vec3_dot(cross, (float *)rows[2]);
}

// ---- Where the vertices are

// A skinned vertex is a mean of where its joints alone would put it, so it is within the boxes of theirs.
static box deformed_box(const scene_deformation *d, const deformation_state *state)
{
    box all = box_empty;
    for (uint32_t i = 0; i < state->joint_count; i++) {
        box moved = state->rest[i];
        if (box_is_empty(&moved))
            continue;
        for (uint32_t t = 0; t < d->target_count; t++)
            box_grow(&moved, &state->offsets[i * d->target_count + t], state->weights[t]);
        box_add_transformed(&all, &moved, state->joints[i]);
    }
    if (!box_is_empty(&all))
        box_pad(&all);
    return all;
}

// Of a level of a subdivided mesh: by the stencil, over the cage.
static void level_position(const renderer *r, const scene_deformation *d, uint32_t own, float position[3])
{
    const scene_subdivision *s = d->subdivision;
    const uint32_t stencil = s->levels[d->level - 1].vertices[own].stencil;
    memset(position, 0, 3 * sizeof *position);
    for (uint32_t i = s->stencils.offsets[stencil]; i < s->stencils.offsets[stencil + 1]; i++) {
        const subdivision_entry *entry = &s->stencils.entries[i];
        float p[3];
        world_deformed_position(r, d->cage, s->first_vertex + entry->vertex, p);
        glm_vec3_muladds(p, entry->position, position);
    }
}

void world_deformed_position(const renderer *r, uint32_t deformation, uint32_t vertex, float position[3])
{
    const scene_data *s = r->scene;
    const scene_deformation *d = &s->deformations[deformation];
    const world_deformation *now = &r->gpu_world->deformations[deformation];
    const uint32_t own = vertex - d->first_vertex;
    if (d->subdivision) {
        level_position(r, d, own, position);
        return;
    }
    float p[3];
    memcpy(p, s->positions[vertex], sizeof p);
    for (uint32_t t = 0; t < d->target_count; t++)
        glm_vec3_muladds((float *)d->morphs[t * d->vertex_count + own].position, now->weights[t], p);
    memcpy(position, p, sizeof p);
    if (d->skin == SCENE_NONE)
        return;
    const scene_influences *by = &d->influences[own];
    memset(position, 0, sizeof p);
    for (int i = 0; i < SCENE_INFLUENCES && by->weights[i] > 0; i++)
        for (int row = 0; row < 3; row++) {
            const float *m = now->joints[by->joints[i]][row];
            position[row] += by->weights[i] * (m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3]);
        }
}

static void primitive_boxes_write(const renderer *r, const scene_mesh *mesh, const box *b)
{
    for (uint32_t i = 0; i < mesh->primitive_count; i++)
        r->gpu_world->primitive_boxes[mesh->first_primitive + i] = *b;
}

// What follows from joints and weights.
static void pose_follow(const renderer *r, const scene_deformation *d, const deformation_state *state,
                        world_deformation *now)
{
    // A tree over the triangles at rest is kept while the box around everything is at most this much larger or smaller
    // than at rest, but for the joints' own scale. Measured with Embree, 200,000 rays: up to 1.5 (Cesium Man, Fox) they
    // take 0 to 13 % longer than with a tree made anew, from 2 to 9 (twisted and scattered grids) 19 to 36 %; fitting
    // takes a fifth to a ninth of the time of making.
    const float STRETCH = 2;
    now->box = deformed_box(d, state);
    uint32_t mirrored = 0;
    float scale = 0;
    for (uint32_t i = 0; i < state->joint_count; i++) {
        const float volume = determinant(state->joints[i]);
        mirrored += volume < 0;
        scale += cbrtf(volume * volume) / (float)state->joint_count;
    }
    const float area = box_area(&now->box), rest = scale * state->rest_area;
    now->scale = sqrtf(scale);
    now->mirrored = mirrored > state->joint_count / 2;
    now->stretched = !(area <= STRETCH * rest && area * STRETCH >= rest);
    primitive_boxes_write(r, &r->scene->meshes[d->mesh], &now->box);
}

// The limit surface lies within the cage's hull, so what is known of the cage holds for its levels.
static void level_follow(const renderer *r, const scene_deformation *d, world_deformation *now)
{
    const uint32_t first_kept = now->first_kept;
    *now = r->gpu_world->deformations[d->cage];
    now->first_kept = first_kept;
    primitive_boxes_write(r, &r->scene->meshes[d->mesh], &now->box);
}

void world_deform_update(renderer *r)
{
    world_gpu *w = r->gpu_world;
    const scene_data *s = r->scene;
    for (uint32_t i = 0; i < s->deformation_count; i++) {
        const scene_deformation *d = &s->deformations[i];
        deformation_state *state = &w->deformation_states[i];
        world_deformation *now = &w->deformations[i];
        if (d->subdivision) {
            level_follow(r, d, now);
            continue;
        }
        now->previous_box = now->box;
        now->changed = d->skin != SCENE_NONE && joints_follow(r, &s->skins[d->skin], state->joints);
        now->changed |= weights_follow(r, d, state->weights);
        if (!now->changed)
            continue;
        pose_follow(r, d, state, now);
        now->version++;
        now->changed = r->frame > 0; // before that there was nothing else
    }
}

void world_deform_mark(renderer *r)
{
    world_gpu *w = r->gpu_world;
    for (uint32_t i = 0; i < r->scene->deformation_count; i++)
        w->deformations[i].drawn = false;
    for (uint32_t i = 0; i < w->instance_count; i++) {
        const uint32_t index = w->mesh_deformations[w->order[i].mesh];
        if (index != SCENE_NONE)
            w->deformations[index].drawn = true;
    }
}

const world_deformation *world_deformation_of(const renderer *r, uint32_t mesh)
{
    const uint32_t index = r->gpu_world->mesh_deformations[mesh];
    return index == SCENE_NONE ? NULL : &r->gpu_world->deformations[index];
}

// ---- Life

// Adds a vertex to what the joint moves.
static void joint_add(const scene_data *s, const scene_deformation *d, deformation_state *state, uint32_t joint,
                      uint32_t vertex)
{
    const float *p = s->positions[d->first_vertex + vertex];
    box_add(&state->rest[joint], p, p);
    for (uint32_t t = 0; t < d->target_count; t++) {
        const float *offset = d->morphs[t * d->vertex_count + vertex].position;
        box_add(&state->offsets[joint * d->target_count + t], offset, offset);
    }
}

static void boxes_init(const scene_data *s, const scene_deformation *d, deformation_state *state)
{
    for (uint32_t i = 0; i < state->joint_count; i++)
        state->rest[i] = box_empty;
    for (uint32_t i = 0; i < state->joint_count * d->target_count; i++)
        state->offsets[i] = box_empty;
    box all = box_empty;
    for (uint32_t v = 0; v < d->vertex_count; v++) {
        box_add(&all, s->positions[d->first_vertex + v], s->positions[d->first_vertex + v]);
        if (d->skin == SCENE_NONE)
            joint_add(s, d, state, 0, v);
        for (int i = 0; d->skin != SCENE_NONE && i < SCENE_INFLUENCES && d->influences[v].weights[i] > 0; i++)
            joint_add(s, d, state, d->influences[v].joints[i], v);
    }
    state->rest_area = box_is_empty(&all) ? 0 : box_area(&all);
}

static void deformation_init(const renderer *r, const scene_deformation *d, deformation_state *state,
                             world_deformation *now)
{
    const scene_data *s = r->scene;
    const uint32_t joints = d->skin == SCENE_NONE ? 1 : s->skins[d->skin].joint_count;
    state->joint_count = joints;
    state->joints = memory_alloc(joints * sizeof *state->joints);
    state->weights = memory_alloc(max_u32(d->target_count, 1) * sizeof *state->weights);
    state->rest = memory_alloc(joints * sizeof *state->rest);
    state->offsets = memory_alloc(max_u32(joints * d->target_count, 1) * sizeof *state->offsets);
    for (uint32_t i = 0; i < joints; i++)
        for (int k = 0; k < 3; k++)
            state->joints[i][k][k] = 1;
    boxes_init(s, d, state);
    now->joints = (const joint_rows *)state->joints;
    now->weights = state->weights;
    pose_follow(r, d, state, now); // at rest
}

bool world_deform_init(renderer *r)
{
    world_gpu *w = r->gpu_world;
    const scene_data *s = r->scene;
    w->mesh_deformations = memory_alloc(max_u32(s->mesh_count, 1) * sizeof *w->mesh_deformations);
    memset(w->mesh_deformations, 0xff, s->mesh_count * sizeof *w->mesh_deformations);
    w->deformations = memory_alloc(max_u32(s->deformation_count, 1) * sizeof *w->deformations);
    w->deformation_states = memory_alloc(max_u32(s->deformation_count, 1) * sizeof *w->deformation_states);
    uint32_t kept = 0;
    for (uint32_t i = 0; i < s->deformation_count; i++) {
        const scene_deformation *d = &s->deformations[i];
        w->mesh_deformations[d->mesh] = i;
        w->deformations[i].first_kept = kept;
        kept += d->vertex_count;
        if (d->subdivision)
            level_follow(r, d, &w->deformations[i]);
        else
            deformation_init(r, d, &w->deformation_states[i], &w->deformations[i]);
    }
    w->kept_vertices = kept;
    const gpu_buffer_desc desc = {
        .name = "previous positions",
        .size = kept * 3ull * sizeof(float),
        .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
    };
    w->previous_positions = gpu_buffer_create(r->gpu, &desc);
    if (w->previous_positions.id)
        gpu_scene_bind_buffer(r->gpu, SCENE_PREVIOUS_POSITIONS, w->previous_positions);
    return w->previous_positions.id != 0;
}

void world_deform_fini(renderer *r)
{
    world_gpu *w = r->gpu_world;
    for (uint32_t i = 0; w->deformation_states && i < r->scene->deformation_count; i++) {
        const deformation_state *state = &w->deformation_states[i];
        free(state->joints);
        free(state->weights);
        free(state->rest);
        free(state->offsets);
    }
    free(w->deformation_states);
    free(w->deformations);
    free(w->mesh_deformations);
    gpu_buffer_destroy(r->gpu, w->previous_positions);
}
