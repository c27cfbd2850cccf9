// The figure's skeleton and its poses; see make_scenes_figure.h.
#include "tools/make_scenes_figure.h"

#include <math.h>

// ---- Rotations

quat quat_axis(vec3 axis, float radians)
{
    const float s = sinf(radians / 2);
    return (quat){axis.x * s, axis.y * s, axis.z * s, cosf(radians / 2)};
}

quat quat_multiply(quat a, quat b)
{
    return (quat){
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
    };
}

quat quat_conjugate(quat q)
{
    return (quat){-q.x, -q.y, -q.z, q.w};
}

vec3 quat_rotate(quat q, vec3 v)
{
    const vec3 axis = {q.x, q.y, q.z};
    const vec3 t = vec3_scale(vec3_cross(axis, v), 2);
    return vec3_add(v, vec3_add(vec3_scale(t, q.w), vec3_cross(axis, t)));
}

static quat quat_unit(quat q)
{
    const float length = sqrtf(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
    return (quat){q.x / length, q.y / length, q.z / length, q.w / length};
}

// The shortest turn from one unit vector to another that is not its opposite.
static quat quat_between(vec3 from, vec3 to)
{
    const vec3 axis = vec3_cross(from, to);
    return quat_unit((quat){axis.x, axis.y, axis.z, 1 + vec3_dot(from, to)});
}

// ---- Skeleton

static float mirrored(figure_side side)
{
    return side == FIGURE_LEFT ? 1 : -1;
}

static const struct {
    const char *name;
    figure_joint parent;
    vec3 position; // sides: of the left
} skeleton[JOINT_COUNT] = {
    [JOINT_HIPS] = {"hips", JOINT_HIPS, {0, 0.95f, 0}},
    [JOINT_SPINE] = {"spine", JOINT_HIPS, {0, 1.07f, -0.01f}},
    [JOINT_CHEST] = {"chest", JOINT_SPINE, {0, 1.22f, -0.015f}},
    [JOINT_NECK] = {"neck", JOINT_CHEST, {0, 1.465f, -0.02f}},
    [JOINT_HEAD] = {"head", JOINT_NECK, {0, 1.55f, -0.005f}},
    [JOINT_SKIRT] = {"skirt", JOINT_HIPS, {0, 0.97f, 0}},
    [JOINT_CLAVICLE + FIGURE_LEFT] = {"left collar bone", JOINT_CHEST, {0.03f, 1.42f, -0.01f}},
    [JOINT_CLAVICLE + FIGURE_RIGHT] = {"right collar bone", JOINT_CHEST, {-0.03f, 1.42f, -0.01f}},
    [JOINT_SHOULDER + FIGURE_LEFT] = {"left shoulder", JOINT_CLAVICLE + FIGURE_LEFT, {0.165f, 1.405f, -0.015f}},
    [JOINT_SHOULDER + FIGURE_RIGHT] = {"right shoulder", JOINT_CLAVICLE + FIGURE_RIGHT, {-0.165f, 1.405f, -0.015f}},
    [JOINT_ELBOW + FIGURE_LEFT] = {"left elbow", JOINT_SHOULDER + FIGURE_LEFT, {0.363f, 1.207f, -0.022f}},
    [JOINT_ELBOW + FIGURE_RIGHT] = {"right elbow", JOINT_SHOULDER + FIGURE_RIGHT, {-0.363f, 1.207f, -0.022f}},
    [JOINT_WRIST + FIGURE_LEFT] = {"left wrist", JOINT_ELBOW + FIGURE_LEFT, {0.54f, 1.03f, -0.006f}},
    [JOINT_WRIST + FIGURE_RIGHT] = {"right wrist", JOINT_ELBOW + FIGURE_RIGHT, {-0.54f, 1.03f, -0.006f}},
    [JOINT_HIP + FIGURE_LEFT] = {"left hip", JOINT_HIPS, {0.09f, 0.91f, 0}},
    [JOINT_HIP + FIGURE_RIGHT] = {"right hip", JOINT_HIPS, {-0.09f, 0.91f, 0}},
    [JOINT_KNEE + FIGURE_LEFT] = {"left knee", JOINT_HIP + FIGURE_LEFT, {0.098f, 0.5f, 0.006f}},
    [JOINT_KNEE + FIGURE_RIGHT] = {"right knee", JOINT_HIP + FIGURE_RIGHT, {-0.098f, 0.5f, 0.006f}},
    [JOINT_ANKLE + FIGURE_LEFT] = {"left ankle", JOINT_KNEE + FIGURE_LEFT, {0.1f, 0.085f, -0.012f}},
    [JOINT_ANKLE + FIGURE_RIGHT] = {"right ankle", JOINT_KNEE + FIGURE_RIGHT, {-0.1f, 0.085f, -0.012f}},
    [JOINT_TOES + FIGURE_LEFT] = {"left toes", JOINT_ANKLE + FIGURE_LEFT, {0.106f, 0.02f, 0.115f}},
    [JOINT_TOES + FIGURE_RIGHT] = {"right toes", JOINT_ANKLE + FIGURE_RIGHT, {-0.106f, 0.02f, 0.115f}},
};

const char *figure_joint_name(figure_joint joint)
{
    return skeleton[joint].name;
}

figure_joint figure_parent(figure_joint joint)
{
    return skeleton[joint].parent;
}

vec3 figure_rest_position(figure_joint joint)
{
    return skeleton[joint].position;
}

static vec3 rest_bone(figure_joint from, figure_joint to)
{
    return vec3_sub(skeleton[to].position, skeleton[from].position);
}

static float length_of(vec3 v)
{
    return sqrtf(vec3_dot(v, v));
}

// ---- Poses

// Hangs a joint on its parent, turned by `rotation` against it.
static void joint_place(figure_pose *pose, figure_joint joint, quat rotation)
{
    const figure_joint parent = figure_parent(joint);
    const vec3 bone = quat_rotate(pose->rotations[parent], rest_bone(parent, joint));
    pose->positions[joint] = vec3_add(pose->positions[parent], bone);
    pose->rotations[joint] = quat_unit(quat_multiply(pose->rotations[parent], rotation));
}

quat figure_local_rotation(const figure_pose *pose, figure_joint joint)
{
    if (joint == JOINT_HIPS)
        return pose->rotations[joint];
    return quat_unit(quat_multiply(quat_conjugate(pose->rotations[figure_parent(joint)]), pose->rotations[joint]));
}

// The middle joint of a limb of two bones, of lengths `upper` and `lower`, from `root` to `*end`, which is brought
// within reach. It bends towards the direction `pole`.
static vec3 middle_joint(vec3 root, vec3 *end, float upper, float lower, vec3 pole)
{
    const vec3 straight = vec3_sub(*end, root), along = vec3_normalize(straight);
    // A limb that is not quite straight keeps its plane of bending.
    const float reach = fminf(length_of(straight), 0.999f * (upper + lower));
    *end = vec3_add(root, vec3_scale(along, reach));
    const float foot = (reach * reach + upper * upper - lower * lower) / (2 * reach);
    const float height = sqrtf(fmaxf(upper * upper - foot * foot, 0));
    const vec3 aside = vec3_normalize(vec3_sub(pole, vec3_scale(along, vec3_dot(pole, along))));
    return vec3_add(root, vec3_add(vec3_scale(along, foot), vec3_scale(aside, height)));
}

// The rotation that brings a bone from its direction at rest to `bone`, and its hinge from +X as near as can be to
// `hinge`.
static quat hinged(vec3 rest, vec3 bone, vec3 hinge)
{
    const quat swing = quat_between(vec3_normalize(rest), vec3_normalize(bone));
    const vec3 axis = vec3_normalize(bone), swung = quat_rotate(swing, (vec3){1, 0, 0});
    const vec3 from = vec3_normalize(vec3_sub(swung, vec3_scale(axis, vec3_dot(swung, axis))));
    const vec3 to = vec3_normalize(vec3_sub(hinge, vec3_scale(axis, vec3_dot(hinge, axis))));
    return quat_multiply(quat_between(from, to), swing);
}

static void leg_place(figure_pose *pose, figure_side side, const figure_foot *foot)
{
    const figure_joint hip = JOINT_HIP + side, knee = JOINT_KNEE + side, ankle = JOINT_ANKLE + side,
                       toes = JOINT_TOES + side;
    const vec3 up = {0, 1, 0}, right = {1, 0, 0};
    const quat turn = quat_axis(up, foot->yaw), heel = quat_multiply(turn, quat_axis(right, foot->pitch));
    const vec3 ball = vec3_add(foot->ball, (vec3){0, figure_rest_position(toes).y, 0});
    vec3 end = vec3_add(ball, quat_rotate(heel, rest_bone(toes, ankle)));

    joint_place(pose, hip, (quat){0, 0, 0, 1});
    // Knees point where foot and pelvis do.
    const vec3 forward = {0, 0, 1};
    const vec3 pole = vec3_add(quat_rotate(turn, forward), quat_rotate(pose->rotations[JOINT_HIPS], forward));
    const vec3 root = pose->positions[hip];
    const vec3 thigh = rest_bone(hip, knee), shin = rest_bone(knee, ankle);
    const vec3 bent = middle_joint(root, &end, length_of(thigh), length_of(shin), pole);
    const vec3 hinge = vec3_cross(pole, vec3_sub(end, root));

    pose->rotations[hip] = hinged(thigh, vec3_sub(bent, root), hinge);
    pose->positions[knee] = bent;
    pose->rotations[knee] = hinged(shin, vec3_sub(end, bent), hinge);
    pose->positions[ankle] = end;
    pose->rotations[ankle] = heel;
    joint_place(pose, toes, quat_axis(right, -foot->pitch));
}

figure_pose figure_stand(const figure_stance *stance)
{
    const quat none = {0, 0, 0, 1};
    figure_pose pose;
    pose.positions[JOINT_HIPS] = vec3_add(figure_rest_position(JOINT_HIPS), stance->hips);
    pose.rotations[JOINT_HIPS] = stance->hips_rotation;
    joint_place(&pose, JOINT_SPINE, stance->spine);
    joint_place(&pose, JOINT_CHEST, stance->chest);
    joint_place(&pose, JOINT_NECK, stance->neck);
    joint_place(&pose, JOINT_HEAD, stance->head);
    joint_place(&pose, JOINT_SKIRT, none);
    for (figure_side side = 0; side < FIGURE_SIDES; side++) {
        joint_place(&pose, JOINT_CLAVICLE + side, none);
        joint_place(&pose, JOINT_SHOULDER + side, none);
        joint_place(&pose, JOINT_ELBOW + side, none);
        joint_place(&pose, JOINT_WRIST + side, none);
        leg_place(&pose, side, &stance->feet[side]);
    }
    return pose;
}

vec3 figure_chest_place(const figure_pose *pose, vec3 offset)
{
    return vec3_add(pose->positions[JOINT_CHEST], quat_rotate(pose->rotations[JOINT_CHEST], offset));
}

// A limb of that length follows exactly up to nine tenths of it, then less and less: its joint would jerk otherwise as
// it straightens.
static float eased_reach(float distance, float length)
{
    const float easy = 0.9f * length, rest = length - easy;
    return distance < easy ? distance : easy + rest * (1 - expf(-(distance - easy) / rest));
}

void figure_reach(figure_pose *pose, figure_side side, vec3 wrist, vec3 elbow_towards)
{
    const figure_joint clavicle = JOINT_CLAVICLE + side, shoulder = JOINT_SHOULDER + side, elbow = JOINT_ELBOW + side;
    // The collar bone takes a third of what the arm is raised over 20 degrees below the horizontal.
    const quat chest = pose->rotations[JOINT_CHEST];
    const vec3 arm = quat_rotate(quat_conjugate(chest), vec3_sub(wrist, pose->positions[shoulder]));
    const float raised = asinf(fminf(fmaxf(arm.y / length_of(arm), -1), 1)) + 0.35f;
    const float lift = raised > 0 ? 0.33f * raised * raised / (raised + 0.3f) : 0;
    joint_place(pose, clavicle, quat_axis((vec3){0, 0, 1}, mirrored(side) * lift));
    joint_place(pose, shoulder, (quat){0, 0, 0, 1});

    // Both bones turn the shortest way from where they hang at rest: an arm has no twist to wring its sleeve.
    const vec3 upper = rest_bone(shoulder, elbow), lower = rest_bone(elbow, JOINT_WRIST + side);
    const vec3 root = pose->positions[shoulder], straight_to = vec3_sub(wrist, root);
    const float reach = eased_reach(length_of(straight_to), length_of(upper) + length_of(lower));
    vec3 end = vec3_add(root, vec3_scale(vec3_normalize(straight_to), reach));
    const vec3 bent = middle_joint(root, &end, length_of(upper), length_of(lower), elbow_towards);
    const quat at_rest = pose->rotations[clavicle];
    const vec3 hanging = vec3_normalize(quat_rotate(at_rest, upper));
    pose->rotations[shoulder] =
        quat_unit(quat_multiply(quat_between(hanging, vec3_normalize(vec3_sub(bent, root))), at_rest));
    pose->positions[elbow] = bent;
    const vec3 straight = vec3_normalize(quat_rotate(pose->rotations[shoulder], lower));
    pose->rotations[elbow] = quat_unit(
        quat_multiply(quat_between(straight, vec3_normalize(vec3_sub(end, bent))), pose->rotations[shoulder]));
    joint_place(pose, JOINT_WRIST + side, (quat){0, 0, 0, 1});
}
