// A human figure, 1.75 m tall: a closed control cage of quads, its skeleton, and poses of it by inverse kinematics.
//
// It stands on y = 0, faces +Z and has its left at +X. At rest its arms hang at 45 degrees.
#pragma once

#include "tools/make_scenes_gltf.h"

typedef enum figure_side { FIGURE_LEFT, FIGURE_RIGHT, FIGURE_SIDES } figure_side;

typedef enum figure_joint {
    JOINT_HIPS,
    JOINT_SPINE,
    JOINT_CHEST,
    JOINT_NECK,
    JOINT_HEAD,
    JOINT_SKIRT, // of the hips; moves nothing of a figure in trousers
    // Of either side: + FIGURE_LEFT or FIGURE_RIGHT.
    JOINT_CLAVICLE,
    JOINT_SHOULDER = JOINT_CLAVICLE + FIGURE_SIDES,
    JOINT_ELBOW = JOINT_SHOULDER + FIGURE_SIDES,
    JOINT_WRIST = JOINT_ELBOW + FIGURE_SIDES,
    JOINT_HIP = JOINT_WRIST + FIGURE_SIDES,
    JOINT_KNEE = JOINT_HIP + FIGURE_SIDES,
    JOINT_ANKLE = JOINT_KNEE + FIGURE_SIDES,
    JOINT_TOES = JOINT_ANKLE + FIGURE_SIDES, // the ball of the foot
    JOINT_COUNT = JOINT_TOES + FIGURE_SIDES
} figure_joint;

// Parts of the texture that a figure wears: a grid of 4 x 2 cells in this order. Each shows its part as seen from in
// front, at rest; figure_cell gives the metres that it covers.
typedef enum figure_region {
    REGION_SKIN,
    REGION_FACE,
    REGION_HAIR,
    REGION_SHIRT,
    REGION_LOWER, // trousers or skirt
    REGION_SHOES,
    REGION_COUNT
} figure_region;
typedef struct figure_rectangle {
    float left, right, bottom, top; // metres
} figure_rectangle;
figure_rectangle figure_cell(figure_region region);

// All share one skeleton.
typedef struct figure_build {
    float shoulders, waist, hips, limbs; // widths of trunk and limbs times these
    float bust; // metres
    bool skirt, bun;
    bool short_sleeves;
} figure_build;

// The cage as a skinned geometry; two triangles in a row are a quad.
gltf_geometry figure_geometry_add(gltf_file *file, const figure_build *build);

// ---- Skeleton

const char *figure_joint_name(figure_joint joint);
figure_joint figure_parent(figure_joint joint); // of JOINT_HIPS: itself
vec3 figure_rest_position(figure_joint joint); // in the figure's space; no joint is turned at rest
gltf_skin figure_skin_add(gltf_file *file, const char *name, const gltf_node joints[JOINT_COUNT]);

// ---- Rotations

quat quat_axis(vec3 axis, float radians); // `axis` is unit
quat quat_multiply(quat a, quat b); // b first
quat quat_conjugate(quat q);
vec3 quat_rotate(quat q, vec3 v);

// ---- Poses

typedef struct figure_pose { // in the figure's space
    vec3 positions[JOINT_COUNT];
    quat rotations[JOINT_COUNT];
} figure_pose;

typedef struct figure_foot {
    vec3 ball; // on the ground, under the joint of the toes
    float yaw, pitch; // radians; the pitch lifts the heel off the ball, on which the toes stay flat
} figure_foot;

typedef struct figure_stance {
    vec3 hips; // offset of the hips' joint from its height at rest over the origin
    quat hips_rotation;
    quat spine, chest, neck, head; // local
    figure_foot feet[FIGURE_SIDES];
} figure_stance;

// The joints' nodes in a pose, under `root`, whose space is the figure's.
void figure_skeleton_add(gltf_file *file, gltf_node root, const figure_pose *pose, gltf_node joints[JOINT_COUNT]);
// Hips, spine, head and legs; the arms hang as they do at rest. A foot out of reach floats on the leg's straight line.
figure_pose figure_stand(const figure_stance *stance);
// Bends an arm so that its wrist is at `wrist`, or as near as it gets, the elbow towards the direction `elbow`. Raises
// the collar bone with the arm.
void figure_reach(figure_pose *pose, figure_side side, vec3 wrist, vec3 elbow);
// A place given in the chest's frame, as metres from its joint.
vec3 figure_chest_place(const figure_pose *pose, vec3 offset);
// Relative to the parent joint, as nodes have it.
quat figure_local_rotation(const figure_pose *pose, figure_joint joint);
