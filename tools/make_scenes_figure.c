// The figure's cage and skeleton; its poses are in make_scenes_pose.c.
//
// Rings of 8 vertices make trunk and head, rings of 6 the limbs. Radii are those of the smooth surface: the cage lies
// outside of it by the shrinkage of cubic B-splines on regular polygons, (4 + 2 cos(2 pi / n)) / 6.
#include "tools/make_scenes_figure.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const float pi = 3.14159265358979f;
static const float trunk_swell = 1.108f, limb_swell = 1.2f;

// ---- Cage

enum { TRUNK = 8, LIMB = 6, CAGE_VERTICES = 640, CAGE_QUADS = 640 };

typedef struct joint_weights {
    figure_joint joints[4];
    float weights[4]; // sum 1
} joint_weights;

typedef struct cage {
    vec3 positions[CAGE_VERTICES];
    joint_weights weights[CAGE_VERTICES];
    uint32_t vertex_count;
    uint32_t quads[CAGE_QUADS][4];
    figure_region regions[CAGE_QUADS];
    uint32_t quad_count;
    figure_side side; // which half is built; quads of the right one are mirrored
} cage;

static uint32_t vertex_add(cage *cage, vec3 position, joint_weights weights)
{
    assert(cage->vertex_count < CAGE_VERTICES);
    cage->positions[cage->vertex_count] = position;
    cage->weights[cage->vertex_count] = weights;
    return cage->vertex_count++;
}

static void quad_add(cage *cage, uint32_t a, uint32_t b, uint32_t c, uint32_t d, figure_region region)
{
    assert(cage->quad_count < CAGE_QUADS);
    const bool mirrored = cage->side == FIGURE_RIGHT;
    const uint32_t quad[4] = {a, mirrored ? d : b, c, mirrored ? b : d};
    memcpy(cage->quads[cage->quad_count], quad, sizeof quad);
    cage->regions[cage->quad_count++] = region;
}

static void column_add(cage *cage, const uint32_t *from, const uint32_t *to, uint32_t count, uint32_t column,
                       figure_region region)
{
    const uint32_t next = (column + 1) % count;
    quad_add(cage, from[column], from[next], to[next], to[column], region);
}

// Quads between two loops that run clockwise as seen from where they lead to.
static void bridge(cage *cage, const uint32_t *from, const uint32_t *to, uint32_t count, figure_region region)
{
    for (uint32_t i = 0; i < count; i++)
        column_add(cage, from, to, count, i, region);
}

static void cap_limb(cage *cage, const uint32_t loop[LIMB], figure_region region)
{
    quad_add(cage, loop[0], loop[1], loop[2], loop[3], region);
    quad_add(cage, loop[0], loop[3], loop[4], loop[5], region);
}

static joint_weights weights_of(figure_joint a, float weight_a, figure_joint b)
{
    return (joint_weights){{a, b}, {weight_a, 1 - weight_a}};
}

// ---- Trunk and head

typedef struct trunk_ring {
    float y, width, front, back; // half axes of the surface
    float z; // of the middle
    figure_joint a, b;
    float weight_a;
} trunk_ring;

// Vertices from the left over the front to the right and the back; the diagonal ones are a little outside an ellipse.
static void trunk_ring_add(cage *cage, const trunk_ring *ring, uint32_t loop[TRUNK])
{
    static const float across[TRUNK] = {1, 0.74f, 0, -0.74f, -1, -0.74f, 0, 0.74f};
    static const float along[TRUNK] = {0, 0.74f, 1, 0.74f, 0, -0.74f, -1, -0.74f};
    for (int i = 0; i < TRUNK; i++) {
        const float depth = along[i] > 0 ? ring->front : ring->back;
        const vec3 position = {ring->width * across[i] * trunk_swell, ring->y,
                               ring->z + depth * along[i] * trunk_swell};
        loop[i] = vertex_add(cage, position, weights_of(ring->a, ring->weight_a, ring->b));
    }
}

enum { RING_CROTCH, RING_HIPS, RING_WAIST, RING_RIBS, RING_ARMPITS, RING_SHOULDERS, RING_NECK, RING_COUNT };
typedef struct trunk {
    uint32_t rings[RING_COUNT][TRUNK];
    uint32_t crotch; // between the legs
} trunk;

static const figure_joint left_hip = JOINT_HIP + FIGURE_LEFT, right_hip = JOINT_HIP + FIGURE_RIGHT;

// The crotch ring dips from the hips' sides to the middle and follows the thighs there.
static void crotch_shape(cage *cage, trunk *trunk)
{
    const uint32_t *ring = trunk->rings[RING_CROTCH];
    static const float lift[TRUNK] = {0.05f, 0.03f, 0.01f, 0.03f, 0.05f, 0.005f, -0.008f, 0.005f};
    for (int i = 0; i < TRUNK; i++) {
        const bool in_middle = i % 4 == 2;
        cage->positions[ring[i]].y += lift[i];
        if (!in_middle)
            cage->weights[ring[i]] = weights_of(JOINT_HIPS, 0.6f, i < 2 || i == 7 ? left_hip : right_hip);
    }
    trunk->crotch = vertex_add(cage, (vec3){0, 0.802f, -0.01f}, weights_of(JOINT_HIPS, 1, JOINT_HIPS));
}

// The shoulders are highest at their sides and move with the collar bones; the armpits are hollow.
static void shoulders_shape(cage *cage, trunk *trunk)
{
    const uint32_t *top = trunk->rings[RING_SHOULDERS], *armpits = trunk->rings[RING_ARMPITS];
    for (int i = 0; i < TRUNK; i++) {
        const bool in_middle = i % 4 == 2;
        if (in_middle)
            continue;
        const figure_side side = i < 2 || i == 7 ? FIGURE_LEFT : FIGURE_RIGHT;
        cage->positions[top[i]].y += i % 4 == 0 ? 0.015f : -0.01f;
        if (i % 4 == 0) {
            cage->positions[armpits[i]].x *= 0.82f;
            cage->positions[armpits[i]].y -= 0.02f;
        } else {
            cage->positions[armpits[i]].z -= cage->positions[armpits[i]].z > 0 ? 0.012f : 0;
        }
        cage->weights[top[i]] = weights_of(JOINT_CHEST, i % 4 == 0 ? 0.3f : 0.6f, JOINT_CLAVICLE + side);
        cage->weights[armpits[i]] = weights_of(JOINT_CHEST, i % 4 == 0 ? 0.65f : 0.8f, JOINT_SHOULDER + side);
    }
}

static void trunk_add(cage *cage, const figure_build *build, trunk *trunk)
{
    const float hips = build->hips, waist = build->waist, chest = build->shoulders;
    const trunk_ring rings[RING_COUNT] = {
        [RING_CROTCH] = {0.86f, 0.168f * hips, 0.105f, 0.12f, 0, JOINT_HIPS, JOINT_HIPS, 1},
        [RING_HIPS] = {0.97f, 0.163f * hips, 0.11f, 0.122f, -0.005f, JOINT_HIPS, JOINT_SPINE, 1},
        [RING_WAIST] = {1.09f, 0.138f * waist, 0.1f * waist, 0.09f * waist, 0, JOINT_HIPS, JOINT_SPINE, 0.5f},
        [RING_RIBS] = {1.2f, 0.146f * chest, 0.112f + 0.5f * build->bust, 0.1f, -0.005f, JOINT_SPINE, JOINT_CHEST,
                       0.5f},
        [RING_ARMPITS] = {1.305f, 0.16f * chest, 0.115f + build->bust, 0.115f, -0.01f, JOINT_CHEST, JOINT_CHEST, 1},
        [RING_SHOULDERS] = {1.42f, 0.152f * chest, 0.075f, 0.09f, -0.015f, JOINT_CHEST, JOINT_CHEST, 1},
        [RING_NECK] = {1.468f, 0.062f, 0.05f, 0.057f, -0.018f, JOINT_CHEST, JOINT_NECK, 0.5f},
    };
    for (int i = 0; i < RING_COUNT; i++)
        trunk_ring_add(cage, &rings[i], trunk->rings[i]);
    crotch_shape(cage, trunk);
    shoulders_shape(cage, trunk);
    for (int i = 0; i + 1 < RING_COUNT; i++)
        for (uint32_t column = 0; column < TRUNK; column++) {
            const bool arm_hole = i == RING_ARMPITS && (column == 7 || column == 0 || column == 3 || column == 4);
            const bool is_skirt = i == RING_CROTCH && build->skirt;
            const figure_region region = i <= RING_HIPS ? REGION_LOWER : REGION_SHIRT;
            if (!arm_hole && !is_skirt)
                column_add(cage, trunk->rings[i + 1], trunk->rings[i], TRUNK, column, region);
        }
}

// The crown: 2 x 2 quads.
static void crown_add(cage *cage, const uint32_t loop[TRUNK], vec3 top)
{
    const uint32_t middle = vertex_add(cage, top, weights_of(JOINT_HEAD, 1, JOINT_HEAD));
    for (uint32_t i = 1; i < TRUNK; i += 2)
        quad_add(cage, middle, loop[(i + 1) % TRUNK], loop[i], loop[i - 1], REGION_HAIR);
}

// Hair tied together at the back: two quads of the head pulled out.
static void bun_add(cage *cage, const uint32_t upper[TRUNK], const uint32_t lower[TRUNK])
{
    const uint32_t root[LIMB] = {upper[5], upper[6], upper[7], lower[7], lower[6], lower[5]};
    static const vec3 offsets[2] = {{0.052f, 0.04f, -0.135f}, {0.034f, 0.03f, -0.175f}};
    uint32_t loops[2][LIMB];
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < LIMB; k++) {
            const float across = (float)(k < 3 ? k - 1 : 4 - k), up = k < 3 ? 1 : -1;
            const vec3 position = {across * offsets[i].x, 1.648f + up * offsets[i].y, offsets[i].z};
            loops[i][k] = vertex_add(cage, position, weights_of(JOINT_HEAD, 1, JOINT_HEAD));
        }
    bridge(cage, root, loops[0], LIMB, REGION_HAIR);
    bridge(cage, loops[0], loops[1], LIMB, REGION_HAIR);
    quad_add(cage, loops[1][0], loops[1][1], loops[1][4], loops[1][5], REGION_HAIR);
    quad_add(cage, loops[1][1], loops[1][2], loops[1][3], loops[1][4], REGION_HAIR);
}

static void head_add(cage *cage, const figure_build *build, const uint32_t neck_base[TRUNK])
{
    enum { NECK, JAW, MOUTH, NOSE, EYES, FOREHEAD, CROWN, COUNT };
    static const trunk_ring rings[COUNT] = {
        [NECK] = {1.51f, 0.046f, 0.044f, 0.05f, -0.012f, JOINT_NECK, JOINT_HEAD, 0.7f},
        [JAW] = {1.54f, 0.051f, 0.08f, 0.058f, 0.003f, JOINT_NECK, JOINT_HEAD, 0.1f},
        [MOUTH] = {1.582f, 0.066f, 0.092f, 0.082f, 0.005f, JOINT_HEAD, JOINT_HEAD, 1},
        [NOSE] = {1.625f, 0.073f, 0.094f, 0.094f, 0.005f, JOINT_HEAD, JOINT_HEAD, 1},
        [EYES] = {1.665f, 0.077f, 0.093f, 0.1f, 0.005f, JOINT_HEAD, JOINT_HEAD, 1},
        [FOREHEAD] = {1.71f, 0.08f, 0.091f, 0.103f, 0.002f, JOINT_HEAD, JOINT_HEAD, 1},
        [CROWN] = {1.755f, 0.064f, 0.066f, 0.08f, -0.006f, JOINT_HEAD, JOINT_HEAD, 1},
    };
    uint32_t loops[COUNT][TRUNK];
    for (int i = 0; i < COUNT; i++)
        trunk_ring_add(cage, &rings[i], loops[i]);
    cage->positions[loops[NOSE][2]].z += 0.018f;
    cage->positions[loops[JAW][2]].z += 0.012f;

    bridge(cage, loops[NECK], neck_base, TRUNK, REGION_SKIN);
    bridge(cage, loops[JAW], loops[NECK], TRUNK, REGION_SKIN);
    for (int i = JAW; i < CROWN; i++)
        for (uint32_t column = 0; column < TRUNK; column++) {
            const bool in_front = column < 4 && i < FOREHEAD, at_nape = i == JAW;
            const bool is_bun = build->bun && i == NOSE && (column == 5 || column == 6);
            const figure_region behind = at_nape ? REGION_SKIN : REGION_HAIR;
            if (!is_bun)
                column_add(cage, loops[i + 1], loops[i], TRUNK, column, in_front ? REGION_FACE : behind);
        }
    if (build->bun)
        bun_add(cage, loops[EYES], loops[NOSE]);
    crown_add(cage, loops[CROWN], (vec3){0, 1.8f, -0.01f});
}

// ---- Limbs, of the side that the cage is at

static float side_sign(figure_side side)
{
    return side == FIGURE_LEFT ? 1 : -1;
}

typedef struct limb_ring {
    float at; // metres along the limb: from the shoulder's joint, or the height
    float radius_up, radius_front, radius_back; // `up`: of an arm, away from its underside; of a leg, sideways
    float x, z; // of a leg's middle; x, of an arm: how much further along its underside is than its middle
    figure_joint a, b; // of the left side
    float weight_a;
} limb_ring;

static joint_weights limb_weights(const cage *cage, const limb_ring *ring)
{
    const figure_joint a = ring->a >= JOINT_CLAVICLE ? ring->a + cage->side : ring->a;
    const figure_joint b = ring->b >= JOINT_CLAVICLE ? ring->b + cage->side : ring->b;
    return weights_of(a, ring->weight_a, b);
}

static vec3 arm_place(figure_side side, float along, float up, float front)
{
    const vec3 shoulder = figure_rest_position(JOINT_SHOULDER + FIGURE_LEFT);
    const float diagonal = sqrtf(0.5f);
    const vec3 place = {shoulder.x + diagonal * (along + up), shoulder.y + diagonal * (up - along), shoulder.z + front};
    return (vec3){place.x * side_sign(side), place.y, place.z};
}

// Vertices from the upper side over the front to the underside and the back.
static void arm_ring_add(cage *cage, const limb_ring *ring, float thickness, uint32_t loop[LIMB])
{
    for (int i = 0; i < LIMB; i++) {
        const float angle = (float)i * pi / 3;
        loop[i] = vertex_add(cage,
                             arm_place(cage->side, ring->at - ring->x * cosf(angle),
                                       cosf(angle) * ring->radius_up * limb_swell * thickness,
                                       ring->z + sinf(angle) * ring->radius_front * limb_swell * thickness),
                             limb_weights(cage, ring));
    }
}

// A thumb pulled out of the hand's front quad.
static void thumb_add(cage *cage, const uint32_t wrist[LIMB], const uint32_t knuckles[LIMB], float along)
{
    const uint32_t root[4] = {wrist[1], wrist[2], knuckles[2], knuckles[1]};
    uint32_t tip[4];
    for (int i = 0; i < 4; i++) {
        const float up = i == 0 || i == 3 ? 0.01f : -0.016f, forward = i < 2 ? 0 : 0.036f;
        tip[i] = vertex_add(cage, arm_place(cage->side, along + forward, up, 0.092f - 0.4f * forward),
                            weights_of(JOINT_WRIST + cage->side, 1, JOINT_WRIST));
    }
    bridge(cage, root, tip, 4, REGION_SKIN);
    quad_add(cage, tip[0], tip[1], tip[2], tip[3], REGION_SKIN);
}

static void arm_add(cage *cage, const figure_build *build, const trunk *trunk)
{
    enum { DELTOID, UPPER, OVER_ELBOW, ELBOW, UNDER_ELBOW, FOREARM, WRIST, KNUCKLES, TIPS, COUNT };
    static const limb_ring rings[COUNT] = {
        [DELTOID] = {0.11f, 0.052f, 0.061f, 0, 0.035f, 0.004f, JOINT_SHOULDER, JOINT_CLAVICLE, 0.75f},
        [UPPER] = {0.175f, 0.046f, 0.048f, 0, 0.01f, -0.002f, JOINT_SHOULDER, JOINT_SHOULDER, 1},
        [OVER_ELBOW] = {0.235f, 0.041f, 0.043f, 0, 0, -0.004f, JOINT_SHOULDER, JOINT_ELBOW, 0.87f},
        [ELBOW] = {0.28f, 0.04f, 0.041f, 0, 0, -0.005f, JOINT_SHOULDER, JOINT_ELBOW, 0.5f},
        [UNDER_ELBOW] = {0.33f, 0.039f, 0.042f, 0, 0, -0.002f, JOINT_SHOULDER, JOINT_ELBOW, 0.1f},
        [FOREARM] = {0.42f, 0.033f, 0.036f, 0, 0, 0.004f, JOINT_ELBOW, JOINT_ELBOW, 1},
        [WRIST] = {0.525f, 0.021f, 0.029f, 0, 0, 0.01f, JOINT_ELBOW, JOINT_WRIST, 0.6f},
        [KNUCKLES] = {0.62f, 0.018f, 0.045f, 0, 0, 0.01f, JOINT_WRIST, JOINT_WRIST, 1},
        [TIPS] = {0.71f, 0.012f, 0.036f, 0, 0, 0.012f, JOINT_WRIST, JOINT_WRIST, 1},
    };
    const uint32_t *top = trunk->rings[RING_SHOULDERS], *bottom = trunk->rings[RING_ARMPITS];
    const bool left = cage->side == FIGURE_LEFT;
    const int outer = left ? 0 : 4, front = left ? 1 : 3, back = left ? 7 : 5;
    uint32_t loops[COUNT][LIMB];
    const uint32_t hole[LIMB] = {top[outer], top[front], bottom[front], bottom[outer], bottom[back], top[back]};
    const uint32_t *from = hole;
    for (int i = 0; i < COUNT; i++) {
        const int bare_from = build->short_sleeves ? OVER_ELBOW : KNUCKLES;
        const figure_region region = i < bare_from ? REGION_SHIRT : REGION_SKIN;
        arm_ring_add(cage, &rings[i], i < WRIST ? build->limbs : 1, loops[i]);
        for (uint32_t column = 0; column < LIMB; column++)
            if (i != KNUCKLES || column != 1)
                column_add(cage, from, loops[i], LIMB, column, region);
        from = loops[i];
    }
    cap_limb(cage, loops[TIPS], REGION_SKIN);
    thumb_add(cage, loops[WRIST], loops[KNUCKLES], rings[WRIST].at + 0.055f);
}

// Vertices from the outer side over the front to the inner side and the back.
static void leg_ring_add(cage *cage, const limb_ring *ring, float thickness, uint32_t loop[LIMB])
{
    for (int i = 0; i < LIMB; i++) {
        const float angle = (float)i * pi / 3, depth = sinf(angle) > 0 ? ring->radius_front : ring->radius_back;
        const float across = ring->x + cosf(angle) * ring->radius_up * limb_swell * thickness;
        const vec3 position = {across * side_sign(cage->side), ring->at,
                               ring->z + sinf(angle) * depth * limb_swell * thickness};
        loop[i] = vertex_add(cage, position, limb_weights(cage, ring));
    }
}

// Instep, ball and tip, pulled out of the front quad between ankle and sole.
static void foot_add(cage *cage, const uint32_t ankle[LIMB], const uint32_t sole[LIMB])
{
    static const struct {
        float z, top, bottom, half_width, x;
        float weight_ankle;
    } rings[] = {
        {0.05f, 0.085f, 0, 0.046f, 0.102f, 1},
        {0.115f, 0.056f, 0, 0.054f, 0.107f, 0.55f},
        {0.185f, 0.04f, 0.002f, 0.042f, 0.107f, 0},
    };
    uint32_t from[4] = {ankle[1], ankle[2], sole[2], sole[1]}, to[4];
    for (size_t i = 0; i < countof(rings); i++) {
        for (int k = 0; k < 4; k++) {
            const float across = rings[i].x + (k == 0 || k == 3 ? rings[i].half_width : -rings[i].half_width);
            const vec3 position = {across * side_sign(cage->side), k < 2 ? rings[i].top : rings[i].bottom, rings[i].z};
            to[k] = vertex_add(cage, position,
                               weights_of(JOINT_ANKLE + cage->side, rings[i].weight_ankle, JOINT_TOES + cage->side));
        }
        bridge(cage, from, to, 4, REGION_SHOES);
        memcpy(from, to, sizeof from);
    }
    quad_add(cage, from[0], from[1], from[2], from[3], REGION_SHOES);
}

static void leg_add(cage *cage, const figure_build *build, const trunk *trunk)
{
    enum { THIGH, MIDDLE, OVER_KNEE, KNEE, UNDER_KNEE, CALF, SHIN, ANKLE, SOLE, COUNT };
    static const limb_ring rings[COUNT] = {
        [THIGH] = {0.745f, 0.073f, 0.085f, 0.092f, 0.1f, -0.005f, JOINT_HIP, JOINT_HIPS, 0.85f},
        [MIDDLE] = {0.64f, 0.072f, 0.077f, 0.076f, 0.096f, 0, JOINT_HIP, JOINT_HIP, 1},
        [OVER_KNEE] = {0.555f, 0.06f, 0.064f, 0.06f, 0.098f, 0.004f, JOINT_HIP, JOINT_KNEE, 0.87f},
        [KNEE] = {0.5f, 0.055f, 0.06f, 0.052f, 0.098f, 0.006f, JOINT_HIP, JOINT_KNEE, 0.5f},
        [UNDER_KNEE] = {0.44f, 0.053f, 0.053f, 0.057f, 0.098f, 0, JOINT_HIP, JOINT_KNEE, 0.1f},
        [CALF] = {0.35f, 0.052f, 0.049f, 0.06f, 0.099f, -0.01f, JOINT_KNEE, JOINT_KNEE, 1},
        [SHIN] = {0.19f, 0.046f, 0.046f, 0.05f, 0.1f, -0.012f, JOINT_KNEE, JOINT_KNEE, 1},
        [ANKLE] = {0.095f, 0.042f, 0.046f, 0.048f, 0.1f, -0.015f, JOINT_KNEE, JOINT_ANKLE, 0.4f},
        [SOLE] = {0, 0.039f, 0.048f, 0.056f, 0.1f, -0.02f, JOINT_ANKLE, JOINT_ANKLE, 1},
    };
    const uint32_t *ring = trunk->rings[RING_CROTCH];
    const bool left = cage->side == FIGURE_LEFT;
    const uint32_t hole[LIMB] = {ring[left ? 0 : 4], ring[left ? 1 : 3], ring[2], trunk->crotch, ring[6],
                                 ring[left ? 7 : 5]};
    const uint32_t *from = hole;
    uint32_t loops[COUNT][LIMB];
    for (int i = 0; i < COUNT; i++) {
        // Bare shins are slimmer than trousers.
        const float slim = build->skirt && i > UNDER_KNEE && i < SOLE ? 0.8f : 1;
        const figure_region leg = build->skirt ? REGION_SKIN : REGION_LOWER;
        leg_ring_add(cage, &rings[i], i < SOLE ? build->limbs * slim : 1, loops[i]);
        for (uint32_t column = 0; column < LIMB; column++)
            if (i != SOLE || column != 1)
                column_add(cage, from, loops[i], LIMB, column, i == SOLE ? REGION_SHOES : leg);
        from = loops[i];
    }
    cap_limb(cage, loops[SOLE], REGION_SHOES);
    foot_add(cage, loops[ANKLE], loops[SOLE]);
}

// From the hips down to the hem and, inside, up again to where the legs begin.
static void skirt_add(cage *cage, const trunk *trunk)
{
    static const struct {
        trunk_ring ring;
        float thighs; // weight of both; the rest is the skirt's own joint
    } rings[] = {
        {{0.84f, 0.21f, 0.165f, 0.175f, 0, 0, 0, 0}, 0.25f},  {{0.66f, 0.29f, 0.27f, 0.28f, 0, 0, 0, 0}, 0.35f},
        {{0.42f, 0.385f, 0.37f, 0.38f, 0, 0, 0, 0}, 0.35f},   {{0.425f, 0.365f, 0.35f, 0.36f, 0, 0, 0, 0}, 0.35f},
        {{0.66f, 0.265f, 0.245f, 0.255f, 0, 0, 0, 0}, 0.35f},
    };
    uint32_t loops[2][TRUNK];
    const uint32_t *from = trunk->rings[RING_HIPS];
    for (size_t i = 0; i < countof(rings); i++) {
        uint32_t *to = loops[i % 2];
        trunk_ring_add(cage, &rings[i].ring, to);
        for (int k = 0; k < TRUNK; k++) {
            const float width = rings[i].ring.width * trunk_swell;
            const float left = 0.5f + 0.5f * cage->positions[to[k]].x / width, thighs = rings[i].thighs;
            cage->weights[to[k]] =
                (joint_weights){{JOINT_SKIRT, left_hip, right_hip}, {1 - thighs, thighs * left, thighs * (1 - left)}};
        }
        bridge(cage, from, to, TRUNK, REGION_LOWER);
        from = to;
    }
    bridge(cage, from, trunk->rings[RING_CROTCH], TRUNK, REGION_LOWER);
}

// ---- From the cage to triangles

figure_rectangle figure_cell(figure_region region)
{
    static const figure_rectangle cells[REGION_COUNT] = {
        [REGION_SKIN] = {-0.75f, 0.75f, 0, 1.6f},      [REGION_FACE] = {-0.1f, 0.1f, 1.52f, 1.74f},
        [REGION_HAIR] = {-0.1f, 0.1f, 1.52f, 1.8f},    [REGION_SHIRT] = {-0.7f, 0.7f, 0.9f, 1.5f},
        [REGION_LOWER] = {-0.46f, 0.46f, 0.05f, 1.1f}, [REGION_SHOES] = {-0.2f, 0.2f, -0.02f, 0.12f},
    };
    return cells[region];
}

static vec2 cell_uv(figure_region region, vec3 position)
{
    const figure_rectangle cell = figure_cell(region);
    const float u = (position.x - cell.left) / (cell.right - cell.left);
    const float v = (cell.top - position.y) / (cell.top - cell.bottom);
    // Filtering must not reach the neighbours.
    const float inside_u = fminf(fmaxf(u, 0.04f), 0.96f), inside_v = fminf(fmaxf(v, 0.04f), 0.96f);
    return (vec2){((float)(region % 4) + inside_u) / 4, ((float)(region / 4) + inside_v) / 2};
}

// Area-weighted means over the quads around.
static void cage_normals(const cage *cage, vec3 *normals)
{
    memset(normals, 0, cage->vertex_count * sizeof *normals);
    for (uint32_t i = 0; i < cage->quad_count; i++) {
        const uint32_t *quad = cage->quads[i];
        const vec3 *p = cage->positions;
        const vec3 area = vec3_cross(vec3_sub(p[quad[2]], p[quad[0]]), vec3_sub(p[quad[3]], p[quad[1]]));
        for (int k = 0; k < 4; k++)
            normals[quad[k]] = vec3_add(normals[quad[k]], area);
    }
}

static gltf_influences influences_of(const joint_weights *weights)
{
    gltf_influences influences = {0};
    for (int i = 0; i < 4; i++)
        if (weights->weights[i] > 0) {
            influences.joints[i] = (uint8_t)weights->joints[i];
            influences.weights[i] = weights->weights[i];
        }
    return influences;
}

static vec3 corner_normal(const cage *cage, uint32_t a, uint32_t b, uint32_t c)
{
    const vec3 *p = cage->positions;
    return vec3_normalize(vec3_cross(vec3_sub(p[b], p[a]), vec3_sub(p[c], p[a])));
}

// Cosine of the fold along the diagonal from corner `first`.
static float fold_cosine(const cage *cage, const uint32_t quad[4], int first)
{
    const uint32_t a = quad[first], b = quad[first + 1], c = quad[(first + 2) % 4], d = quad[(first + 3) % 4];
    return vec3_dot(corner_normal(cage, a, b, c), corner_normal(cage, a, c, d));
}

// A vertex of the cage becomes one of the mesh for each region around it. Quads are cut where they fold less.
static gltf_geometry cage_write(gltf_file *file, const cage *cage)
{
    static uint32_t written[CAGE_VERTICES][REGION_COUNT]; // 1 + vertex of the mesh
    static gltf_influences influences[CAGE_VERTICES * 2];
    static vec3 normals[CAGE_VERTICES];
    memset(written, 0, sizeof written);
    cage_normals(cage, normals);
    mesh mesh = {0};
    for (uint32_t i = 0; i < cage->quad_count; i++) {
        uint32_t corners[4];
        for (int k = 0; k < 4; k++) {
            const uint32_t vertex = cage->quads[i][k];
            uint32_t *known = &written[vertex][cage->regions[i]];
            if (!*known) {
                const vec3 position = cage->positions[vertex];
                *known = 1 + mesh_vertex_add(&mesh, position, normals[vertex], cell_uv(cage->regions[i], position));
                assert(*known <= countof(influences));
                influences[*known - 1] = influences_of(&cage->weights[vertex]);
            }
            corners[k] = *known - 1;
        }
        const int first = fold_cosine(cage, cage->quads[i], 1) > fold_cosine(cage, cage->quads[i], 0);
        const uint32_t from = corners[first], opposite = corners[first + 2];
        mesh_triangle_add(&mesh, from, corners[first + 1], opposite);
        mesh_triangle_add(&mesh, from, opposite, corners[(first + 3) % 4]);
    }
    assert(mesh.index_count == 6 * cage->quad_count);
    const gltf_geometry geometry = gltf_geometry_add(file, &mesh);
    gltf_geometry_influences_add(file, geometry, influences, mesh.vertex_count);
    mesh_fini(&mesh);
    return geometry;
}

gltf_geometry figure_geometry_add(gltf_file *file, const figure_build *build)
{
    cage *cage = memory_alloc(sizeof *cage);
    trunk trunk;
    trunk_add(cage, build, &trunk);
    head_add(cage, build, trunk.rings[RING_NECK]);
    if (build->skirt)
        skirt_add(cage, &trunk);
    for (figure_side side = 0; side < FIGURE_SIDES; side++) {
        cage->side = side;
        arm_add(cage, build, &trunk);
        leg_add(cage, build, &trunk);
    }
    const gltf_geometry geometry = cage_write(file, cage);
    free(cage);
    return geometry;
}

// ---- Skeleton

void figure_skeleton_add(gltf_file *file, gltf_node root, const figure_pose *pose, gltf_node joints[JOINT_COUNT])
{
    for (figure_joint joint = 0; joint < JOINT_COUNT; joint++) {
        const figure_joint parent = figure_parent(joint);
        const bool is_root = joint == JOINT_HIPS;
        const vec3 bone = vec3_sub(figure_rest_position(joint), figure_rest_position(parent));
        joints[joint] = gltf_node_create(file, &(gltf_node_desc){
                                                   .name = figure_joint_name(joint),
                                                   .parent = is_root ? root : joints[parent],
                                                   .translation = is_root ? pose->positions[JOINT_HIPS] : bone,
                                                   .rotation = figure_local_rotation(pose, joint),
                                               });
    }
}

gltf_skin figure_skin_add(gltf_file *file, const char *name, const gltf_node joints[JOINT_COUNT])
{
    float inverse_bind[JOINT_COUNT][16];
    for (figure_joint joint = 0; joint < JOINT_COUNT; joint++) {
        const vec3 p = figure_rest_position(joint);
        const float matrix[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -p.x, -p.y, -p.z, 1};
        memcpy(inverse_bind[joint], matrix, sizeof matrix);
    }
    return gltf_skin_add(file, name, joints, (const float(*)[16])inverse_bind, JOINT_COUNT);
}
