// People of the market: rigid parts under nodes that a clip turns and moves. A figure is 1.7 m tall, stands on y = 0
// and faces +Z.
#include "tools/make_scenes_lanterns.h"

#include <math.h>

enum { KEYS = 33, SEGMENTS = 12, ROBES = 4 };
static const float pi = 3.14159265358979f;
static const float period = 8; // seconds

typedef struct people_maker {
    gltf_file *file;
    gltf_clip clip;
    gltf_times times;
    gltf_mesh robes[ROBES], sleeves[ROBES];
    gltf_mesh head, hand, hat, hair, shoe;
} people_maker;

// What a person does: `from` and `to` on the ground, between which it strolls; the same where it stands.
typedef struct person {
    vec3 from, to;
    float yaw; // of who stands
    int robe;
    bool hat;
    float phase; // turns
} person;

static gltf_mesh turned_add(gltf_file *file, const char *name, const vec2 *profile, size_t count,
                            gltf_material material)
{
    mesh part = {0};
    mesh_lathe_add(&part, profile, count, SEGMENTS);
    return lanterns_mesh_add(file, name, &part, material);
}

static void parts_add(people_maker *m)
{
    static const vec3 dyes[ROBES] = {
        {0.30f, 0.09f, 0.07f}, {0.10f, 0.16f, 0.28f}, {0.45f, 0.36f, 0.22f}, {0.12f, 0.24f, 0.18f}};
    // Around the vertical through the figure, and sleeves down from the shoulder.
    static const vec2 robe[] = {{0.25f, 0.1f},  {0.23f, 0.5f},  {0.17f, 0.98f}, {0.19f, 1.16f},
                                {0.205f, 1.3f}, {0.17f, 1.39f}, {0.075f, 1.45f}};
    static const vec2 sleeve[] = {{0.075f, -0.5f}, {0.085f, -0.46f}, {0.06f, -0.2f}, {0.072f, -0.03f}, {0.05f, 0.04f}};
    static const vec2 head[] = {{0.04f, -0.14f}, {0.045f, -0.06f}, {0.075f, -0.03f}, {0.1f, 0.06f},
                                {0.098f, 0.13f}, {0.07f, 0.19f},   {0, 0.215f}};
    static const vec2 hair[] = {{0.1f, 0.09f},   {0.108f, 0.12f}, {0.085f, 0.19f},
                                {0.03f, 0.225f}, {0.04f, 0.26f},  {0, 0.29f}};
    static const vec2 hat[] = {{0.03f, 0.17f}, {0.26f, 0.115f}, {0.265f, 0.12f}, {0.02f, 0.29f}, {0, 0.295f}};
    static const vec2 hand[] = {{0, -0.6f}, {0.035f, -0.57f}, {0.035f, -0.5f}, {0.025f, -0.47f}};
    gltf_file *f = m->file;
    const gltf_material skin = gltf_material_add(f, &(gltf_material_desc){"skin", .albedo = {0.52f, 0.33f, 0.23f}});
    const gltf_material straw = gltf_material_add(f, &(gltf_material_desc){"straw", .albedo = {0.62f, 0.48f, 0.26f}});
    const gltf_material black = gltf_material_add(f, &(gltf_material_desc){"hair", .albedo = {0.04f, 0.03f, 0.03f}});
    for (int i = 0; i < ROBES; i++) {
        const gltf_material dye = gltf_material_add(f, &(gltf_material_desc){"robe", .albedo = dyes[i]});
        m->robes[i] = turned_add(f, "robe", robe, countof(robe), dye);
        m->sleeves[i] = turned_add(f, "sleeve", sleeve, countof(sleeve), dye);
    }
    m->head = turned_add(f, "head", head, countof(head), skin);
    m->hand = turned_add(f, "hand", hand, countof(hand), skin);
    m->hair = turned_add(f, "hair", hair, countof(hair), black);
    m->hat = turned_add(f, "hat", hat, countof(hat), straw);
    mesh shoe = {0};
    mesh_box_add(&shoe, (vec3){-0.05f, 0, -0.1f}, (vec3){0.05f, 0.13f, 0.15f});
    m->shoe = lanterns_mesh_add(f, "shoe", &shoe, black);
}

// ---- Motion, by the part t in [0, 1) of the clip

typedef struct key_maker {
    const person *who;
    float side; // of an arm or a foot: 1 left, -1 right; 0 of the rest
} key_maker;

static bool strolls(const person *p)
{
    return p->from.x != p->to.x || p->from.z != p->to.z;
}

static float smooth(float x)
{
    const float t = fminf(fmaxf(x, 0), 1);
    return t * t * (3 - 2 * t);
}

// There in 3.2 s, a turn, back, a turn. `way` in [0, 1]; `yaw` is what is added to the way's direction.
static void stroll_at(const person *p, float t, float *way, float *yaw)
{
    const float at = t + p->phase - floorf(t + p->phase);
    *way = at < 0.5f ? fminf(at / 0.4f, 1) : 1 - fminf((at - 0.5f) / 0.4f, 1);
    *yaw = pi * (at < 0.5f ? smooth((at - 0.4f) / 0.1f) : 1 + smooth((at - 0.9f) / 0.1f));
}

static vec3 place_at(const person *p, float t)
{
    float way = 0, yaw;
    if (strolls(p))
        stroll_at(p, t, &way, &yaw);
    const float bob = strolls(p) ? 0.02f * fabsf(sinf(pi * 8 * way)) : 0;
    return (vec3){p->from.x + way * (p->to.x - p->from.x), bob, p->from.z + way * (p->to.z - p->from.z)};
}

static quat turn_about_y(float angle)
{
    return (quat){0, sinf(angle / 2), 0, cosf(angle / 2)};
}

static quat turn_about_x(float angle)
{
    return (quat){sinf(angle / 2), 0, 0, cosf(angle / 2)};
}

static quat facing_at(const key_maker *k, float t)
{
    const person *p = k->who;
    float way, yaw;
    if (!strolls(p))
        return turn_about_y(p->yaw + 0.12f * sinf(2 * pi * (t + p->phase)));
    stroll_at(p, t, &way, &yaw);
    return turn_about_y(atan2f(p->to.x - p->from.x, p->to.z - p->from.z) + yaw);
}

static quat head_at(const key_maker *k, float t)
{
    return turn_about_y(0.45f * sinf(2 * pi * (2 * t + 1.7f * k->who->phase)));
}

// Swings in step, or shows and offers; forward is a negative angle about X.
static quat arm_at(const key_maker *k, float t)
{
    const person *p = k->who;
    float way, yaw;
    if (!strolls(p)) {
        const float lift = k->side > 0 ? 0.75f + 0.35f * sinf(2 * pi * (2 * t + p->phase)) : 0.25f;
        return turn_about_x(-lift);
    }
    stroll_at(p, t, &way, &yaw);
    return turn_about_x(k->side * 0.45f * sinf(pi * 8 * way));
}

static vec3 foot_at(const key_maker *k, float t)
{
    float way = 0, yaw;
    if (strolls(k->who))
        stroll_at(k->who, t, &way, &yaw);
    return (vec3){k->side * 0.09f, 0, 0.03f - k->side * 0.14f * sinf(pi * 8 * way)};
}

static void rotations_add(const people_maker *m, gltf_node node, quat (*at)(const key_maker *, float), key_maker k)
{
    quat keys[KEYS];
    for (int i = 0; i < KEYS; i++)
        keys[i] = at(&k, (float)(i % (KEYS - 1)) / (KEYS - 1));
    const gltf_sampler sampler = gltf_sampler_add(m->file, m->clip, GLTF_ROTATION, GLTF_LINEAR, m->times, &keys[0].x);
    gltf_channel_add(m->file, sampler, node, GLTF_ROTATION);
}

static void translations_add(const people_maker *m, gltf_node node, key_maker k)
{
    vec3 keys[KEYS];
    for (int i = 0; i < KEYS; i++) {
        const float t = (float)(i % (KEYS - 1)) / (KEYS - 1);
        keys[i] = k.side == 0 ? place_at(k.who, t) : foot_at(&k, t);
    }
    const gltf_sampler sampler =
        gltf_sampler_add(m->file, m->clip, GLTF_TRANSLATION, GLTF_LINEAR, m->times, &keys[0].x);
    gltf_channel_add(m->file, sampler, node, GLTF_TRANSLATION);
}

// ---- Figures

static gltf_node part_add(const people_maker *m, gltf_node parent, gltf_mesh mesh, vec3 position)
{
    return gltf_node_create(m->file, &(gltf_node_desc){.parent = parent, .translation = position, .mesh = mesh});
}

static void person_add(const people_maker *m, const person *p)
{
    const key_maker whole = {p, 0};
    const gltf_node root = gltf_node_create(
        m->file, &(gltf_node_desc){.name = "person", .translation = place_at(p, 0), .rotation = facing_at(&whole, 0)});
    part_add(m, root, m->robes[p->robe], (vec3){0});
    const gltf_node head = part_add(m, root, m->head, (vec3){0, 1.52f, 0});
    part_add(m, head, p->hat ? m->hat : m->hair, (vec3){0, 0, p->hat ? 0 : -0.012f});
    rotations_add(m, root, facing_at, whole);
    rotations_add(m, head, head_at, whole);
    if (strolls(p))
        translations_add(m, root, whole);
    for (int i = 0; i < 2; i++) {
        const key_maker k = {p, i ? -1 : 1};
        const gltf_node arm = part_add(m, root, m->sleeves[p->robe], (vec3){k.side * 0.235f, 1.34f, 0});
        part_add(m, arm, m->hand, (vec3){0});
        rotations_add(m, arm, arm_at, k);
        const gltf_node foot = part_add(m, root, m->shoe, foot_at(&k, 0));
        if (strolls(p))
            translations_add(m, foot, k);
    }
}

void people_add(gltf_file *file, gltf_clip clip)
{
    people_maker m = {.file = file, .clip = clip};
    float seconds[KEYS];
    for (int i = 0; i < KEYS; i++)
        seconds[i] = period * (float)i / (KEYS - 1);
    m.times = gltf_times_add(file, seconds, KEYS);
    parts_add(&m);
    static const person people[] = {
        {{-0.9f, 0, 21.5f}, {-0.7f, 0, 17.6f}, 0, 0, true, 0.1f}, {{0.8f, 0, 14}, {0.5f, 0, 18}, 0, 1, false, 0.45f},
        {{-0.3f, 0, 9}, {0.2f, 0, 12.8f}, 0, 2, true, 0.7f},      {{1.1f, 0, 4.5f}, {0.9f, 0, 0.7f}, 0, 3, false, 0.3f},
        {{-1, 0, -3}, {-0.6f, 0, 1}, 0, 0, true, 0.85f},          {{0.4f, 0, -12}, {0.6f, 0, -8}, 0, 2, false, 0.2f},
    };
    for (size_t i = 0; i < countof(people); i++)
        person_add(&m, &people[i]);
    // A seller behind every second stall, and buyers before some.
    for (int stall = 0; stall < STALLS; stall++) {
        const stall_place place = stall_place_of(stall);
        const float phase = 0.137f * (float)stall;
        const vec3 behind = vec3_add(place.position, vec3_yaw((vec3){0.2f, 0, -0.75f}, place.yaw));
        const vec3 before = vec3_add(place.position, vec3_yaw((vec3){-0.35f, 0, 1.1f}, place.yaw));
        if (stall % 2 == 0)
            person_add(&m, &(person){behind, behind, place.yaw, stall % ROBES, stall % 4 == 0, phase});
        if (stall % 5 == 1)
            person_add(&m, &(person){before, before, place.yaw + pi, (stall + 1) % ROBES, stall % 2 == 1, phase});
    }
}
