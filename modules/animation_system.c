// The system that plays animations: see animation_system.h.
#include "animation_system.h"
#include "modules.h"
#include "world.h"

#include <stdlib.h>
#include <string.h>

typedef struct playing {
    animation_clip clip;
    entity entity;
} playing;

struct animation_state {
    animation_pose pose;
    bool *last_set; // as pose.set, of the last update
    bool driving; // some of it
    playing *playing; // of this update
    size_t playing_capacity;
    component_type clip; // "animation"
};
typedef struct animation_state animation_state;

entity animation_play(renderer *r, const animation_clip *clip)
{
    assert(clip->animation < r->scene->animation_count);
    const entity e = ecs_entity_create(r->world);
    *(animation_clip *)ecs_add(r->world, e, r->animation->clip) = *clip;
    return e;
}

void animation_stop(renderer *r, entity playing)
{
    ecs_entity_destroy(r->world, playing);
}

// ---- What plays

static int playing_compare(const void *left, const void *right)
{
    const playing *a = left, *b = right;
    if (a->clip.layer != b->clip.layer)
        return a->clip.layer < b->clip.layer ? -1 : 1;
    if (a->clip.start != b->clip.start)
        return a->clip.start < b->clip.start ? -1 : 1;
    if (a->clip.animation != b->clip.animation)
        return a->clip.animation < b->clip.animation ? -1 : 1;
    return (a->entity.id > b->entity.id) - (a->entity.id < b->entity.id);
}

static uint32_t playing_list(renderer *r, animation_state *state)
{
    memory_reserve((void **)&state->playing, &state->playing_capacity, ecs_count(r->world, state->clip),
                   sizeof *state->playing);
    uint32_t count = 0;
    for (ecs_iterator it = ecs_iterate(r->world, state->clip); ecs_next(&it);)
        state->playing[count++] = (playing){*(animation_clip *)it.component, it.entity};
    if (count > 0)
        qsort(state->playing, count, sizeof *state->playing, playing_compare);
    return count;
}

// ---- From the pose to the components. What was set in the last update and is not in this one is at rest in the pose.

static bool is_due(const animation_state *state, const bool *set)
{
    return *set || state->last_set[set - state->pose.set];
}

static void nodes_write(renderer *r, const animation_state *state)
{
    const world_gpu *w = r->gpu_world;
    for (uint32_t i = 0; i < r->scene->node_count; i++) {
        node_component *node =
            is_due(state, &state->pose.nodes_set[i]) ? ecs_get(r->world, w->node_entities[i], w->node) : NULL;
        if (node)
            animation_pose_matrix(&state->pose, i, node->matrix);
    }
}

static void weights_write(renderer *r, const animation_state *state)
{
    const world_gpu *w = r->gpu_world;
    for (uint32_t i = 0; i < r->scene->deformation_count; i++) {
        const scene_deformation *deformation = &r->scene->deformations[i];
        weights_component *weights = is_due(state, &state->pose.deformations_set[i])
                                         ? ecs_get(r->world, w->node_entities[deformation->node], w->weights)
                                         : NULL;
        if (weights)
            memcpy(weights->weights, state->pose.weights[i], weights->count * sizeof(float));
    }
}

// A light of the scene may shine at several nodes.
static void lights_write(renderer *r, const animation_state *state)
{
    const world_gpu *w = r->gpu_world;
    for (uint32_t i = 0; i < r->scene->node_count; i++) {
        const uint32_t index = r->scene->nodes[i].light;
        light_component *light = index != SCENE_NONE && is_due(state, &state->pose.lights_set[index])
                                     ? ecs_get(r->world, w->node_entities[i], w->light)
                                     : NULL;
        if (!light)
            continue;
        const scene_light from =
            state->pose.lights_set[index] ? animation_pose_light(&state->pose, index) : r->scene->lights[index];
        memcpy(light->color, from.color, sizeof light->color);
        light->inner_cone = from.inner_cone;
        light->outer_cone = from.outer_cone;
    }
}

static void materials_write(renderer *r, const animation_state *state)
{
    for (uint32_t i = 0; i < r->scene->material_count; i++) {
        if (!is_due(state, &state->pose.materials_set[i]))
            continue;
        material changed = r->scene->materials[i];
        if (state->pose.materials_set[i])
            animation_pose_material(&state->pose, i, &changed);
        world_material_set(r, i, changed.base_color, changed.emissive);
    }
}

void animation_update(renderer *r)
{
    animation_state *state = r->animation;
    const uint32_t count = playing_list(r, state);
    if (count == 0 && !state->driving)
        return;
    memcpy(state->last_set, state->pose.set, state->pose.set_count * sizeof(bool));
    animation_pose_rest(&state->pose);
    for (uint32_t i = 0; i < count; i++) {
        const animation_clip *clip = &state->playing[i].clip;
        const scene_animation *animation = &r->scene->animations[clip->animation];
        double at;
        if (animation_clip_time(clip, (double)animation->duration, r->time, &at))
            animation_pose_apply(&state->pose, animation, at);
    }
    state->driving = count > 0;
    nodes_write(r, state);
    weights_write(r, state);
    lights_write(r, state);
    materials_write(r, state);
}

// ---- Life

static void animation_run(ecs_world *world, void *user)
{
    (void)world;
    animation_update(user);
}

// Its state is no pass's, as it has none: an entity more would change the ids of those that come later, and with them
// the light paths of suns.
bool animation_init(renderer *r)
{
    animation_state *state = r->animation = memory_alloc(sizeof *state);
    animation_pose_init(&state->pose, r->scene);
    state->last_set = memory_alloc(max_u32(state->pose.set_count, 1) * sizeof(bool));
    state->clip =
        ecs_component_register(r->world, &(component_desc){.name = "animation", .size = sizeof(animation_clip)});
    const ecs_system_desc run = {.name = "animation", .phase = ECS_PHASE_INPUT, .run = animation_run, .user = r};
    ecs_system_register(r->world, &run);
    return true;
}

void animation_fini(renderer *r)
{
    if (!r->animation)
        return;
    animation_pose_fini(&r->animation->pose);
    free(r->animation->last_set);
    free(r->animation->playing);
    free(r->animation);
}
