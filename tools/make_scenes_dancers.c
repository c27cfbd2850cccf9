// The atrium's court at a feast: four couples dance and play ball for ten seconds that repeat, while the sun goes from
// three hours before noon to three after.
//
// Motion is written as functions of time, periodic in the dance's length: a path for each dancer, feet that step along
// it in time with the beat and stand still in between, and sums of sinusoids for trunk and arms. Inverse kinematics
// makes poses of them, sampled at KEYS_PER_SECOND.
#include "tools/make_scenes_atrium.h"
#include "tools/make_scenes_figure.h"
#include "tools/make_scenes_texture.h"

#include <math.h>

static const float pi = 3.14159265358979f;
enum { LENGTH = 10, KEYS_PER_SECOND = 12, KEYS = LENGTH * KEYS_PER_SECOND + 1, KEYS_PER_BEAT = 5 };
static const float dance_length = LENGTH, key_length = 1.0f / KEYS_PER_SECOND; // seconds
static const float beat = (float)KEYS_PER_BEAT / KEYS_PER_SECOND; // either foot steps every second beat
enum { COUPLES = 4, DANCERS = 2 * COUPLES };

static float smooth(float low, float high, float x)
{
    const float t = fminf(fmaxf((x - low) / (high - low), 0), 1);
    return t * t * (3 - 2 * t);
}

static vec3 mix3(vec3 a, vec3 b, float t)
{
    return vec3_add(vec3_scale(a, 1 - t), vec3_scale(b, t));
}

// `count` swings in the dance's length.
static float wave(float t, float count, float phase)
{
    return sinf(2 * pi * count * t / dance_length + phase);
}

// ---- Who dances what, and where

typedef enum dance { DANCE_HAND_IN_HAND, DANCE_AROUND, DANCE_BALL } dance;

static const struct couple {
    dance dance;
    float x, z; // metres in the court
    float turns; // around each other in the dance's length; counter-clockwise from above where positive
    float angle; // at the start
    float distance; // of each from the middle
} couples[COUPLES] = {
    {DANCE_HAND_IN_HAND, -2.7f, -1.1f, 2, 0.4f, 0.41f},
    {DANCE_HAND_IN_HAND, 2.3f, -1.9f, -2, 1.9f, 0.41f},
    {DANCE_AROUND, -0.2f, -2.6f, 1, 2.7f, 0.75f},
    {DANCE_BALL, 1.1f, 0.9f, 0, 1.25f, 1.3f},
};

typedef enum costume { COSTUME_WAISTCOAT, COSTUME_BRACES, COSTUME_RED_SKIRT, COSTUME_BLUE_SKIRT, COSTUMES } costume;

// Couple i is dancers 2 i and 2 i + 1.
static const struct dancer {
    const char *name;
    costume costume;
    float size; // of 1.75 m
    float phase; // radians, of all that sways
} dancers[DANCERS] = {
    {"Anton", COSTUME_WAISTCOAT, 1.03f, 0},
    {"Berta", COSTUME_RED_SKIRT, 0.96f, 2},
    {"Carlo", COSTUME_BRACES, 1, 1},
    {"Dora", COSTUME_BLUE_SKIRT, 0.95f, 3.5f},
    {"Elise", COSTUME_RED_SKIRT, 0.94f, 4.4f},
    {"Frida", COSTUME_BLUE_SKIRT, 0.98f, 0.7f},
    {"Gustav", COSTUME_WAISTCOAT, 0.99f, 2.6f},
    {"Hanno", COSTUME_BRACES, 1.04f, 5.1f},
};

static float partner_sign(uint32_t dancer)
{
    return dancer % 2 ? -1 : 1;
}

typedef struct place {
    vec3 position; // on the floor
    float yaw; // unbounded, so that it runs on over full turns
} place;

static vec3 couple_middle(const struct couple *couple, float t)
{
    return (vec3){couple->x + 0.2f * wave(t, 1, couple->angle), 0, couple->z + 0.1f * wave(t, 2, couple->angle)};
}

// Dancers face each other across the middle.
static place path_at(uint32_t dancer, float t)
{
    const struct couple *couple = &couples[dancer / 2];
    const float sign = partner_sign(dancer), phase = dancers[dancer].phase;
    const float angle = couple->angle + 2 * pi * couple->turns * t / dance_length + (sign > 0 ? 0 : pi);
    const vec3 outward = {sinf(angle), 0, cosf(angle)}, aside = {cosf(angle), 0, -sinf(angle)};
    place place = {couple_middle(couple, t), angle + pi};
    switch (couple->dance) {
    case DANCE_HAND_IN_HAND:
        place.position = vec3_add(place.position, vec3_scale(outward, couple->distance + 0.03f * wave(t, 5, 0)));
        break;
    case DANCE_AROUND:
        place.position = vec3_add(place.position, vec3_scale(outward, couple->distance + 0.06f * wave(t, 4, 0)));
        place.yaw += 0.5f * wave(t, 2, phase);
        break;
    case DANCE_BALL:
        place.position = vec3_add(place.position, vec3_scale(outward, couple->distance));
        place.position = vec3_add(place.position, vec3_scale(aside, 0.25f * wave(t, 2, phase)));
        break;
    }
    return place;
}

// ---- Feet

// A foot lifts a key after its beat and stands again three keys later, where its dancer will be when next it bears the
// weight. Being on keys, neither is rounded by the interpolation between them.
static const float lift_off = 1.0f / KEYS_PER_SECOND, flight = 3.0f / KEYS_PER_SECOND;

static figure_foot footprint(uint32_t dancer, figure_side side, float t)
{
    const place place = path_at(dancer, t);
    const float outward = side == FIGURE_LEFT ? 1 : -1;
    return (figure_foot){
        .ball = vec3_add(place.position, vec3_yaw((vec3){0.1f * outward, 0, 0.115f}, place.yaw)),
        .yaw = place.yaw + 0.14f * outward,
    };
}

// Partners begin with opposite feet.
static figure_foot foot_at(uint32_t dancer, figure_side side, float t)
{
    const float start = ((int)side + (int)dancer) % 2 ? beat : 0, cycle = 2 * beat;
    const float step = floorf((t - start) / cycle), into = t - start - step * cycle;
    const float bears = start + step * cycle + lift_off + flight + (cycle - flight) / 2;
    const figure_foot from = footprint(dancer, side, bears - cycle), to = footprint(dancer, side, bears);
    const float u = fminf(fmaxf((into - lift_off) / flight, 0), 1), eased = u * u * u * (u * (6 * u - 15) + 10);
    const float rise = sinf(pi * u), near = into > 0.75f * cycle ? into - cycle : into;
    figure_foot foot = {
        .ball = mix3(from.ball, to.ball, eased),
        .yaw = from.yaw + eased * (to.yaw - from.yaw),
        .pitch = 0.4f * smooth(-0.16f, lift_off, near) * (1 - smooth(lift_off, lift_off + 0.8f * flight, near)),
    };
    foot.ball.y = 0.07f * rise * rise;
    return foot;
}

// ---- Trunk

static quat turned(float yaw, float pitch, float roll)
{
    const quat about_y = quat_axis((vec3){0, 1, 0}, yaw), about_x = quat_axis((vec3){1, 0, 0}, pitch);
    return quat_multiply(quat_multiply(about_y, about_x), quat_axis((vec3){0, 0, 1}, roll));
}

// In the dancer's own space, which is the court's divided by its size.
static figure_pose stand_at(uint32_t dancer, float t)
{
    const struct couple *couple = &couples[dancer / 2];
    const float phase = dancers[dancer].phase, to_own = 1 / dancers[dancer].size;
    const place place = path_at(dancer, t);
    // Weight goes from foot to foot: the hips move over the one that stands, and drop on the other's side.
    const float weight = sinf(pi * t / beat) * partner_sign(dancer), bounce = cosf(2 * pi * t / beat);
    const vec3 sway = vec3_yaw((vec3){-0.035f * weight, 0, 0}, place.yaw);
    const float lean = couple->dance == DANCE_HAND_IN_HAND ? -0.07f : 0.02f;
    const float twist = 0.1f * weight + 0.08f * wave(t, 2, phase);

    figure_stance stance = {
        .hips = vec3_scale(vec3_add(place.position, sway), to_own),
        .hips_rotation = turned(place.yaw + twist, 0.03f, -0.05f * weight),
        .spine = turned(-0.6f * twist, lean + 0.03f * wave(t, 4, phase), 0.05f * weight + 0.04f * wave(t, 2, phase)),
        .chest = turned(-1.1f * twist, 0.02f * bounce, 0.04f * weight + 0.05f * wave(t, 4, phase)),
        .neck = turned(0.1f * wave(t, 3, phase), 0.04f - 0.5f * lean, -0.04f * wave(t, 2, phase)),
        .head = turned(0.15f * wave(t, 3, phase), 0.05f * wave(t, 5, phase), 0.05f * wave(t, 4, phase + 1)),
    };
    const float crouch = couple->dance == DANCE_BALL ? 0.02f : 0.03f; // long steps need bent knees
    stance.hips.y = -crouch - 0.014f * bounce;
    for (figure_side side = 0; side < FIGURE_SIDES; side++) {
        stance.feet[side] = foot_at(dancer, side, t);
        stance.feet[side].ball = vec3_scale(stance.feet[side].ball, to_own);
    }
    figure_pose pose = figure_stand(&stance);
    // The skirt lags behind the turn and swings against the hips.
    const float swing = -0.12f * couple->turns / 2 - 0.12f * cosf(pi * t / beat) * partner_sign(dancer);
    pose.rotations[JOINT_SKIRT] =
        quat_multiply(pose.rotations[JOINT_HIPS], turned(swing, 0.03f * bounce, 0.04f * weight));
    return pose;
}

// How far the skirt flies out.
static vec3 skirt_scale_at(uint32_t dancer, float t)
{
    const float flare = 1.05f + 0.05f * cosf(2 * pi * t / beat) + 0.03f * wave(t, 2, dancers[dancer].phase);
    return (vec3){flare, 1, flare};
}

// ---- Arms

// Reaches for a place in the dancer's space, the elbow hanging out and down.
static void reach(figure_pose *pose, figure_side side, vec3 wrist)
{
    const vec3 elbow = {side == FIGURE_LEFT ? 0.6f : -0.6f, -0.7f, -0.45f};
    figure_reach(pose, side, wrist, quat_rotate(pose->rotations[JOINT_CHEST], elbow));
}

// Both hands meet the partner's half way and rise and fall in turn.
static void hands_join(uint32_t dancer, float t, figure_pose *pose)
{
    const struct couple *couple = &couples[dancer / 2];
    const float to_own = 1 / dancers[dancer].size;
    const place place = path_at(dancer, t);
    for (figure_side side = 0; side < FIGURE_SIDES; side++) {
        const float outward = side == FIGURE_LEFT ? 1 : -1;
        // The first dancer's left hand holds the second one's right.
        const float hands = outward * partner_sign(dancer);
        const float height = 1.18f + 0.17f * wave(t, 5, couple->angle + (hands > 0 ? 0 : pi));
        const float apart = 0.27f + 0.05f * wave(t, 10, couple->angle);
        const vec3 from_middle = vec3_yaw((vec3){outward * apart, height, -0.085f}, place.yaw);
        reach(pose, side, vec3_scale(vec3_add(couple_middle(couple, t), from_middle), to_own));
    }
}

// Arms swing in arcs, up to over the head.
static void arms_swing(uint32_t dancer, float t, figure_pose *pose)
{
    for (figure_side side = 0; side < FIGURE_SIDES; side++) {
        const float outward = side == FIGURE_LEFT ? 1 : -1, phase = dancers[dancer].phase + (side ? 2.2f : 0);
        const float turn = wave(t, 5, phase), quarter = wave(t, 5, phase + pi / 2), slow = wave(t, 1, phase);
        const vec3 place = {outward * (0.48f + 0.1f * quarter), 0.22f + 0.3f * turn + 0.06f * slow,
                            0.16f + 0.1f * quarter};
        reach(pose, side, figure_chest_place(pose, place));
    }
}

// ---- The ball: each player holds it for hold_length, then it flies.

static const float exchange = 1.25f, hold_length = 0.5f, gravity = 9.81f, ball_radius = 0.11f;
enum { FIRST_PLAYER = 6 };

// Where a player holds the ball, `held` of the hold having passed: it gives way, then is pushed off. In the court.
static vec3 hold_place(uint32_t player, float t, float held)
{
    const figure_pose pose = stand_at(player, t);
    const vec3 place = figure_chest_place(&pose, (vec3){0, 0.06f - 0.14f * sinf(pi * held), 0.36f});
    return vec3_scale(place, dancers[player].size);
}

static vec3 ball_at(float t)
{
    const float thrown = floorf(t / exchange), into = t - thrown * exchange;
    const uint32_t holder = FIRST_PLAYER + ((uint32_t)thrown & 1), catcher = 2 * FIRST_PLAYER + 1 - holder;
    if (into <= hold_length)
        return hold_place(holder, t, into / hold_length);
    const float duration = exchange - hold_length, flown = into - hold_length;
    const vec3 from = hold_place(holder, t - flown, 1), to = hold_place(catcher, t - flown + duration, 0);
    vec3 ball = mix3(from, to, flown / duration);
    ball.y += 0.5f * gravity * flown * (duration - flown);
    return ball;
}

// Hands follow the ball from shortly before the catch to shortly after the throw, and swing low meanwhile.
static void arms_play(uint32_t dancer, float t, figure_pose *pose)
{
    const float cycle = 2 * exchange, start = dancer == FIRST_PLAYER ? 0 : exchange;
    const float into = t - start - floorf((t - start) / cycle) * cycle;
    const float until = into - cycle, before = 0.4f, after = 0.35f;
    const float follow = fmaxf(smooth(-before, 0, until), 1 - smooth(hold_length, hold_length + after, into));
    // Only as far as arms go: where it was or will be held.
    const float held = fminf(fmaxf(into / hold_length, 0), 1);
    const float at = into > hold_length + after ? 0 : held;
    const vec3 ball = vec3_scale(hold_place(dancer, t, at), 1 / dancers[dancer].size);
    const quat chest = pose->rotations[JOINT_CHEST];
    for (figure_side side = 0; side < FIGURE_SIDES; side++) {
        const float outward = side == FIGURE_LEFT ? 1 : -1;
        const vec3 beside = quat_rotate(chest, (vec3){outward * 0.12f, 0, -0.08f});
        const float swing = wave(t, 10, dancers[dancer].phase + (side ? pi : 0));
        const vec3 low = figure_chest_place(pose, (vec3){outward * 0.29f, -0.2f + 0.04f * swing, 0.14f + 0.1f * swing});
        reach(pose, side, mix3(low, vec3_add(ball, beside), follow));
    }
}

static figure_pose pose_at(uint32_t dancer, float t)
{
    figure_pose pose = stand_at(dancer, t);
    switch (couples[dancer / 2].dance) {
    case DANCE_HAND_IN_HAND:
        hands_join(dancer, t, &pose);
        break;
    case DANCE_AROUND:
        arms_swing(dancer, t, &pose);
        break;
    case DANCE_BALL:
        arms_play(dancer, t, &pose);
        break;
    }
    return pose;
}

// ---- Clips

static float key_time(int key)
{
    return (float)key * key_length;
}

static gltf_times times_add(gltf_file *file)
{
    float seconds[KEYS];
    for (int i = 0; i < KEYS; i++)
        seconds[i] = key_time(i);
    return gltf_times_add(file, seconds, KEYS);
}

static void channel_add(gltf_file *file, gltf_clip clip, gltf_times times, gltf_node node, gltf_path path,
                        const void *values)
{
    gltf_channel_add(file, gltf_sampler_add(file, clip, path, GLTF_LINEAR, times, values), node, path);
}

// The sign of a rotation that is nearer to the one before.
static quat continued(quat q, quat before)
{
    const float dot = q.x * before.x + q.y * before.y + q.z * before.z + q.w * before.w;
    return dot < 0 ? (quat){-q.x, -q.y, -q.z, -q.w} : q;
}

static void dancer_animate(gltf_file *file, gltf_clip clip, gltf_times times, uint32_t dancer,
                           const gltf_node joints[JOINT_COUNT])
{
    static quat rotations[JOINT_COUNT][KEYS];
    vec3 hips[KEYS], flare[KEYS];
    for (int key = 0; key < KEYS; key++) {
        // The last key is the first pose again, to the bit but for rotations' sign.
        const float t = key == KEYS - 1 ? 0 : key_time(key);
        const figure_pose pose = pose_at(dancer, t);
        hips[key] = pose.positions[JOINT_HIPS];
        flare[key] = skirt_scale_at(dancer, t);
        for (figure_joint joint = 0; joint < JOINT_COUNT; joint++) {
            const quat q = figure_local_rotation(&pose, joint);
            rotations[joint][key] = key ? continued(q, rotations[joint][key - 1]) : q;
        }
    }
    channel_add(file, clip, times, joints[JOINT_HIPS], GLTF_TRANSLATION, hips);
    for (figure_joint joint = 0; joint < JOINT_COUNT; joint++)
        channel_add(file, clip, times, joints[joint], GLTF_ROTATION, rotations[joint]);
    if (dancers[dancer].costume >= COSTUME_RED_SKIRT)
        channel_add(file, clip, times, joints[JOINT_SKIRT], GLTF_SCALE, flare);
}

static void costumes_add(gltf_file *file, gltf_mesh meshes[COSTUMES])
{
    const gltf_geometry broad = figure_geometry_add(
                            file, &(figure_build){.shoulders = 1.12f, .waist = 1.08f, .hips = 0.97f, .limbs = 1.06f}),
                        slim = figure_geometry_add(
                            file, &(figure_build){.shoulders = 1.04f, .waist = 0.96f, .hips = 0.93f, .limbs = 0.94f}),
                        skirted = figure_geometry_add(file, &(figure_build){.shoulders = 0.93f,
                                                                            .waist = 0.88f,
                                                                            .hips = 1.02f,
                                                                            .limbs = 0.88f,
                                                                            .bust = 0.022f,
                                                                            .skirt = true,
                                                                            .bun = true,
                                                                            .short_sleeves = true});
    const struct {
        const char *name;
        texture_recipe recipe;
        gltf_geometry geometry;
    } table[COSTUMES] = {
        [COSTUME_WAISTCOAT] = {"waistcoat", texture_costume_waistcoat, broad},
        [COSTUME_BRACES] = {"braces", texture_costume_braces, slim},
        [COSTUME_RED_SKIRT] = {"red skirt", texture_costume_red_skirt, skirted},
        [COSTUME_BLUE_SKIRT] = {"blue skirt", texture_costume_blue_skirt, skirted},
    };
    for (costume i = 0; i < COSTUMES; i++) {
        const gltf_material material = gltf_material_add(
            file, &(gltf_material_desc){.name = table[i].name,
                                        .roughness = 0.85f,
                                        .texture = texture_add(file, table[i].name, table[i].recipe, false)});
        meshes[i] = gltf_mesh_add(file, table[i].name, table[i].geometry, material);
        gltf_mesh_subdivide(file, meshes[i], 3);
    }
}

static void dancers_add(gltf_file *file, gltf_clip clip, gltf_times times)
{
    gltf_mesh meshes[COSTUMES];
    costumes_add(file, meshes);
    for (uint32_t i = 0; i < DANCERS; i++) {
        gltf_node joints[JOINT_COUNT];
        const gltf_node root = gltf_node_create(file, &(gltf_node_desc){"skeleton", .scale = dancers[i].size});
        const figure_pose first = pose_at(i, 0);
        figure_skeleton_add(file, root, &first, joints);
        // A root: its own transform would not move the mesh.
        gltf_node_create(file, &(gltf_node_desc){
                                   .name = dancers[i].name,
                                   .mesh = meshes[dancers[i].costume],
                                   .skin = figure_skin_add(file, dancers[i].name, joints),
                               });
        dancer_animate(file, clip, times, i, joints);
    }
}

static void ball_add(gltf_file *file, gltf_clip clip, gltf_times times)
{
    enum { POINTS = 13 };
    vec2 profile[POINTS];
    for (int i = 0; i < POINTS; i++) {
        const float angle = pi * ((float)i / (POINTS - 1) - 0.5f);
        profile[i] = (vec2){i % (POINTS - 1) ? ball_radius * cosf(angle) : 0, ball_radius * sinf(angle)};
    }
    mesh sphere = {.repeat = 0.4f};
    mesh_lathe_add(&sphere, profile, POINTS, 24);
    const gltf_material cloth = gltf_material_add(
        file, &(gltf_material_desc){"ball", .texture = texture_add(file, "ball", texture_cloth_ochre, false)});
    const gltf_mesh mesh = atrium_mesh_add(file, "ball", &sphere, cloth);

    vec3 places[KEYS];
    quat spins[KEYS];
    for (int key = 0; key < KEYS; key++) {
        const float t = key == KEYS - 1 ? 0 : key_time(key);
        const float turns = 16; // whole ones, in the dance's length
        places[key] = ball_at(t);
        const quat spin = quat_axis((vec3){0.8f, 0, 0.6f}, 2 * pi * turns * t / dance_length);
        spins[key] = key ? continued(spin, spins[key - 1]) : spin;
    }
    const gltf_node node = gltf_node_create(file, &(gltf_node_desc){"ball", .translation = places[0], .mesh = mesh});
    channel_add(file, clip, times, node, GLTF_TRANSLATION, places);
    channel_add(file, clip, times, node, GLTF_ROTATION, spins);
}

// ---- Sun: latitude 40 degrees, declination 20 degrees (late May), from 9 to 15 o'clock. North is -Z.

static vec3 towards_sun_at(float hour_angle)
{
    const float latitude = 40 * pi / 180, declination = 20 * pi / 180;
    const float height = sinf(latitude) * sinf(declination) + cosf(latitude) * cosf(declination) * cosf(hour_angle);
    const float south = sinf(latitude) * cosf(declination) * cosf(hour_angle) - cosf(latitude) * sinf(declination);
    return (vec3){-cosf(declination) * sinf(hour_angle), height, south};
}

static void sun_add(gltf_file *file, gltf_times times)
{
    quat rotations[KEYS];
    for (int key = 0; key < KEYS; key++) {
        const float hour_angle = pi / 4 * (2 * key_time(key) / dance_length - 1);
        const quat q = gltf_look(vec3_scale(towards_sun_at(hour_angle), -1));
        rotations[key] = key ? continued(q, rotations[key - 1]) : q;
    }
    const gltf_node sun = gltf_sun_add(file, "sun", towards_sun_at(-pi / 4), (vec3){1, 0.93f, 0.82f}, 100);
    channel_add(file, gltf_clip_add(file, "sun"), times, sun, GLTF_ROTATION, rotations);
}

void dancers_build(gltf_file *file)
{
    atrium_add(file, true);
    const float degrees = pi / 180, aspect = 16.0f / 9.0f;
    gltf_camera_add(file, "dance", (vec3){-4.7f, 1.55f, 2.9f}, (vec3){-0.1f, 1.05f, -1.2f}, 48 * degrees, aspect);
    gltf_camera_add(file, "gallery", (vec3){6.3f, 6, 4.7f}, (vec3){0, 0.6f, -1.1f}, 44 * degrees, aspect);
    const gltf_clip dance = gltf_clip_add(file, "dance");
    const gltf_times times = times_add(file);
    dancers_add(file, dance, times);
    ball_add(file, dance, times);
    sun_add(file, times);
}
