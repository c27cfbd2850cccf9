// Animations of a scene, evaluated: channels at a time, clips on the clock, poses, joint matrices. Pure: no GPU and no
// history, so the same time gives the same pose, whatever came before. animation_system.h plays them in a renderer.
#pragma once

#include "scene.h"

// Index of the first animation named `name`, or SCENE_NONE.
uint32_t animation_find(const scene_data *scene, const char *name);

// What a channel changes its target to at `time` (seconds): channel->width numbers. Before the first key and after the
// last it stays what it is there. Rotations are unit quaternions. glTF 2.0, appendix C.
void animation_channel_value(const scene_channel *channel, double time, float *value);

// An animation that plays.
typedef struct animation_clip {
    uint32_t animation; // index into scene_data.animations
    double start; // seconds, by renderer.time; before it the clip changes nothing
    float speed; // 1: as it was made; below 0: from its end to its beginning
    bool loop; // false: it stays at its end
    int32_t layer; // of what several clips change, the highest has its way
} animation_clip;

// Where the clip stands at `time`, in seconds of its animation: 0 to duration. False: it has not begun.
bool animation_clip_time(const animation_clip *clip, double duration, double time, double *at);

typedef struct animation_transform {
    float translation[3], rotation[4], scale[3];
} animation_transform;

// All that animations can change, and which of it is changed. Zero-initialise, then animation_pose_init.
typedef struct animation_pose {
    const scene_data *scene;
    animation_transform *nodes; // [node_count]; those that have a matrix stay as they are
    float **weights; // [deformation_count][target_count]
    scene_light *lights; // [light_count]; `color` is that at rest, it follows from hue and intensity
    float (*base_colors)[4]; // [material_count]
    scene_emission *emissions; // [material_count]
    bool *nodes_set, *deformations_set, *lights_set, *materials_set; // parts of `set`
    bool *set; // [set_count]: changed by a clip
    uint32_t set_count;
    arena arena;
} animation_pose;

// At rest. Keeps a reference to the scene.
void animation_pose_init(animation_pose *pose, const scene_data *scene);
void animation_pose_fini(animation_pose *pose);
void animation_pose_rest(animation_pose *pose); // as it was after init
// Puts what the animation changes to where it is at `time`, over what was applied before.
void animation_pose_apply(animation_pose *pose, const scene_animation *animation, double time);

// What a pose means: column-major matrices, from the node to its parent and to the world.
void animation_pose_matrix(const animation_pose *pose, uint32_t node, float matrix[16]);
void animation_pose_worlds(const animation_pose *pose, float (*worlds)[16]); // [node_count]
// Values out of their range (splines overshoot) are cut.
scene_light animation_pose_light(const animation_pose *pose, uint32_t light);
void animation_pose_material(const animation_pose *pose, uint32_t index, material *changed); // changes its colours

// matrices[joint_count]: world(joint) * inverse_bind, which take vertices at rest to the world. `worlds`: by node.
void animation_joint_matrices(const scene_skin *skin, const float (*worlds)[16], float (*matrices)[16]);
