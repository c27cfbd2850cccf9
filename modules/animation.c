// Evaluation of animations: see animation.h.
#include "animation.h"

#include <math.h>
#include <string.h>

uint32_t animation_find(const scene_data *scene, const char *name)
{
    for (uint32_t i = 0; i < scene->animation_count; i++) {
        if (strcmp(scene->animations[i].name, name) == 0) {
            return i;
        }
    }
    return SCENE_NONE;
}

// ---- Channels

// The last key at or before `time`, which is within the keys.
static uint32_t key_find(const scene_channel *channel, double time)
{
    uint32_t low = 0, high = channel->key_count - 1;
    while (low < high) {
        const uint32_t middle = high - (high - low) / 2;
        if ((double)channel->times[middle] <= time) {
            low = middle;
        } else {
            high = middle - 1;
        }
    }
    return low;
}

static const float *key_value(const scene_channel *channel, uint32_t key)
{
    const size_t width = channel->width;
    return channel->interpolation == SCENE_CUBIC ? channel->values + (3 * (size_t)key + 1) * width
                                                 : channel->values + key * width;
}

static void quaternion_normalize(float q[4])
{
    double square = 0;
    for (int i = 0; i < 4; i++) {
        square += (double)q[i] * (double)q[i];
    }
    const double length = sqrt(square);
    for (int i = 0; i < 4; i++) {
        q[i] = length > 1e-20 ? (float)((double)q[i] / length) : i == 3 ? 1.0f : 0.0f;
    }
}

// Along the shorter arc, `a` and `b` unit, t in [0,1].
static void slerp(const float a[4], const float b[4], double t, float out[4])
{
    double cosine = 0;
    for (int i = 0; i < 4; i++) {
        cosine += (double)a[i] * (double)b[i];
    }
    const double sign = cosine < 0 ? -1 : 1, angle = acos(fmin(fabs(cosine), 1)), sine = sin(angle);
    // Where sin(angle) vanishes a straight line is as good: it is off by less than angle^3.
    const double from = sine > 1e-4 ? sin((1 - t) * angle) / sine : 1 - t;
    const double to = sign * (sine > 1e-4 ? sin(t * angle) / sine : t);
    for (int i = 0; i < 4; i++) {
        out[i] = (float)(from * (double)a[i] + to * (double)b[i]);
    }
}

// Tangents are per second.
static void spline(const scene_channel *channel, uint32_t key, double t, double seconds, float *value)
{
    const size_t width = channel->width;
    const float *const from = key_value(channel, key), *const to = key_value(channel, key + 1);
    const float *const tangent_out = from + width, *const tangent_in = to - width;
    const double t2 = t * t, t3 = t2 * t;
    for (size_t i = 0; i < width; i++) {
        value[i] =
            (float)((2 * t3 - 3 * t2 + 1) * (double)from[i] + seconds * (t3 - 2 * t2 + t) * (double)tangent_out[i] +
                    (3 * t2 - 2 * t3) * (double)to[i] + seconds * (t3 - t2) * (double)tangent_in[i]);
    }
}

static void line(const scene_channel *channel, uint32_t key, double t, float *value)
{
    const float *const from = key_value(channel, key), *const to = key_value(channel, key + 1);
    if (channel->target == SCENE_ROTATION) {
        slerp(from, to, t, value);
        return;
    }
    for (uint32_t i = 0; i < channel->width; i++) {
        value[i] = (float)((1 - t) * (double)from[i] + t * (double)to[i]);
    }
}

void animation_channel_value(const scene_channel *channel, double time, float *value)
{
    const uint32_t last = channel->key_count - 1, key = key_find(channel, time);
    const double seconds = key < last ? (double)channel->times[key + 1] - (double)channel->times[key] : 0;
    const double t = seconds > 0 ? (time - (double)channel->times[key]) / seconds : 0;
    const bool between = key < last && t > 0; // else before the first key, at one or after the last
    if (!between || channel->interpolation == SCENE_STEP) {
        memcpy(value, key_value(channel, key), channel->width * sizeof(float));
    } else if (channel->interpolation == SCENE_CUBIC) {
        spline(channel, key, t, seconds, value);
    } else {
        line(channel, key, t, value);
    }
    if (channel->target == SCENE_ROTATION) {
        quaternion_normalize(value);
    }
}

// ---- Clips

bool animation_clip_time(const animation_clip *clip, double duration, double time, double *at)
{
    const double elapsed = (time - clip->start) * fabs((double)clip->speed);
    if (!(time >= clip->start)) {
        return false;
    }
    const double played = !(duration > 0) ? 0 : clip->loop ? fmod(elapsed, duration) : fmin(elapsed, duration);
    *at = clip->speed < 0 ? duration - played : played;
    return true;
}

// ---- Poses

void animation_pose_init(animation_pose *pose, const scene_data *scene)
{
    arena *const memory = &pose->arena;
    const uint32_t materials = scene->material_count;
    pose->scene = scene;
    pose->nodes = arena_alloc(memory, scene->node_count * sizeof(*pose->nodes));
    pose->weights = arena_alloc(memory, scene->deformation_count * sizeof(*pose->weights));
    for (uint32_t i = 0; i < scene->deformation_count; i++) {
        pose->weights[i] = arena_alloc(memory, scene->deformations[i].target_count * sizeof(float));
    }
    pose->lights = arena_alloc(memory, scene->light_count * sizeof(*pose->lights));
    pose->base_colors = arena_alloc(memory, materials * sizeof(*pose->base_colors));
    pose->emissions = arena_alloc(memory, materials * sizeof(*pose->emissions));
    pose->set_count = scene->node_count + scene->deformation_count + scene->light_count + materials;
    pose->set = arena_alloc(memory, pose->set_count * sizeof(bool));
    pose->nodes_set = pose->set;
    pose->deformations_set = pose->nodes_set + scene->node_count;
    pose->lights_set = pose->deformations_set + scene->deformation_count;
    pose->materials_set = pose->lights_set + scene->light_count;
    animation_pose_rest(pose);
}

void animation_pose_fini(animation_pose *pose)
{
    arena_fini(&pose->arena);
}

static void emission_rest(const scene_data *scene, uint32_t index, scene_emission *out)
{
    if (scene->emissions) {
        *out = scene->emissions[index];
        return;
    }
    memcpy(out->factor, scene->materials[index].emissive, sizeof(out->factor));
    out->strength = 1;
}

void animation_pose_rest(animation_pose *pose)
{
    const scene_data *const scene = pose->scene;
    for (uint32_t i = 0; i < scene->node_count; i++) {
        const scene_node *const node = &scene->nodes[i];
        animation_transform *const to = &pose->nodes[i];
        memcpy(to->translation, node->translation, sizeof(to->translation));
        memcpy(to->rotation, node->rotation, sizeof(to->rotation));
        memcpy(to->scale, node->scale, sizeof(to->scale));
    }
    for (uint32_t i = 0; i < scene->deformation_count; i++) {
        for (uint32_t k = 0; k < scene->deformations[i].target_count; k++) {
            pose->weights[i][k] = scene->deformations[i].weights[k];
        }
    }
    for (uint32_t i = 0; i < scene->light_count; i++) {
        pose->lights[i] = scene->lights[i];
    }
    for (uint32_t i = 0; i < scene->material_count; i++) {
        memcpy(pose->base_colors[i], scene->materials[i].base_color, sizeof(pose->base_colors[i]));
        emission_rest(scene, i, &pose->emissions[i]);
    }
    memset(pose->set, 0, pose->set_count * sizeof(bool));
}

// Where the channel's value goes, and the mark that says that it was changed.
static float *channel_place(animation_pose *pose, const scene_channel *channel, bool **set)
{
    const uint32_t i = channel->index;
    *set = channel->target < SCENE_WEIGHTS             ? &pose->nodes_set[i]
           : channel->target <= SCENE_LIGHT_OUTER_CONE ? &pose->lights_set[i]
                                                       : &pose->materials_set[i];
    switch (channel->target) {
    case SCENE_TRANSLATION:
        return pose->nodes[i].translation;
    case SCENE_ROTATION:
        return pose->nodes[i].rotation;
    case SCENE_SCALE:
        return pose->nodes[i].scale;
    case SCENE_WEIGHTS: {
        const uint32_t deformation = pose->scene->meshes[pose->scene->nodes[i].mesh].deformation;
        *set = &pose->deformations_set[deformation];
        return pose->weights[deformation];
    }
    case SCENE_LIGHT_COLOR:
        return pose->lights[i].hue;
    case SCENE_LIGHT_INTENSITY:
        return &pose->lights[i].intensity;
    case SCENE_LIGHT_INNER_CONE:
        return &pose->lights[i].inner_cone;
    case SCENE_LIGHT_OUTER_CONE:
        return &pose->lights[i].outer_cone;
    case SCENE_BASE_COLOR:
        return pose->base_colors[i];
    case SCENE_EMISSIVE_FACTOR:
        return pose->emissions[i].factor;
    case SCENE_EMISSIVE_STRENGTH:
        return &pose->emissions[i].strength;
    }
    assert(false);
    return NULL;
}

void animation_pose_apply(animation_pose *pose, const scene_animation *animation, double time)
{
    for (uint32_t i = 0; i < animation->channel_count; i++) {
        bool *set;
        float *const value = channel_place(pose, &animation->channels[i], &set);
        animation_channel_value(&animation->channels[i], time, value);
        *set = true;
    }
}

// ---- What a pose means

void animation_pose_matrix(const animation_pose *pose, uint32_t index, float matrix[16])
{
    const scene_node *const node = &pose->scene->nodes[index];
    const animation_transform *const from = &pose->nodes[index];
    if (node->has_trs) {
        scene_matrix_compose(from->translation, from->rotation, from->scale, matrix);
    } else {
        memcpy(matrix, node->matrix, sizeof(node->matrix));
    }
}

void animation_pose_worlds(const animation_pose *pose, float (*worlds)[16])
{
    for (uint32_t i = 0; i < pose->scene->node_count; i++) { // parents come first
        const uint32_t parent = pose->scene->nodes[i].parent;
        float local[16];
        animation_pose_matrix(pose, i, local);
        if (parent == SCENE_NONE) {
            memcpy(worlds[i], local, sizeof(local));
        } else {
            scene_matrix_multiply(worlds[parent], local, worlds[i]);
        }
    }
}

// Light that no picture overflows with, as the loader has it.
static float light_cut(float value)
{
    return fminf(fmaxf(value, 0), 1e30f);
}

scene_light animation_pose_light(const animation_pose *pose, uint32_t index)
{
    scene_light light = pose->lights[index];
    for (int k = 0; k < 3; k++) {
        light.color[k] = light_cut(light_cut(light.hue[k]) * light_cut(light.intensity));
    }
    light.outer_cone = fminf(fmaxf(light.outer_cone, 0), (float)M_PI_2);
    light.inner_cone = fminf(fmaxf(light.inner_cone, 0), light.outer_cone);
    return light;
}

void animation_pose_material(const animation_pose *pose, uint32_t index, material *changed)
{
    const scene_emission *const emission = &pose->emissions[index];
    for (int k = 0; k < 4; k++) {
        changed->base_color[k] = fminf(fmaxf(pose->base_colors[index][k], 0), 1);
    }
    for (int k = 0; k < 3; k++) {
        changed->emissive[k] = light_cut(light_cut(emission->factor[k]) * light_cut(emission->strength));
    }
}

void animation_joint_matrices(const scene_skin *skin, const float (*worlds)[16], float (*matrices)[16])
{
    for (uint32_t i = 0; i < skin->joint_count; i++) {
        scene_matrix_multiply(worlds[skin->joints[i]], skin->inverse_bind[i], matrices[i]);
    }
}
