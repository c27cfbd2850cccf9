// The scene `lanterns`: strings of lanterns from house to house, each swaying about its string. Houses and stalls are
// in make_scenes_street.c, people in make_scenes_people.c.
//
// A lantern's light hangs just below its closed paper body, which it so lights from beneath and never hides in.
#include "tools/make_scenes_lanterns.h"

#include <math.h>

enum {
    STRINGS = 238,
    STRING_LANTERNS = 20,
    STALL_LANTERNS = 10, // 238 * 20 + 24 * 10 = 5,000
    COLORS = 4,
    SWAYS = 16, // shared by all lanterns
    SWAY_KEYS = 25, // in `period` seconds
};
static const float pi = 3.14159265358979f;
static const float period = 8; // seconds, of the whole clip
static const float body_drop = 0.2f, light_drop = 0.34f; // metres, from the string to a body's middle and to its light
static const float cable_reach = 4.4f, cable_sag = 0.45f;

typedef struct lantern_maker {
    gltf_file *file;
    gltf_mesh bodies[COLORS];
    gltf_light lights[COLORS];
    gltf_sampler sways[SWAYS];
    uint32_t count; // lanterns so far
    uint32_t alight; // one of so many
    random_sequence random;
} lantern_maker;

gltf_mesh lanterns_mesh_add(gltf_file *file, const char *name, mesh *mesh, gltf_material material)
{
    const gltf_mesh added = gltf_mesh_add(file, name, gltf_geometry_add(file, mesh), material);
    mesh_fini(mesh);
    return added;
}

// ---- What all lanterns share

static void bodies_add(lantern_maker *m)
{
    static const struct {
        const char *name;
        vec3 paper, light;
    } colors[COLORS] = {
        {"red lantern", {0.72f, 0.10f, 0.05f}, {1, 0.36f, 0.13f}},
        {"amber lantern", {0.85f, 0.52f, 0.12f}, {1, 0.60f, 0.24f}},
        {"ivory lantern", {0.86f, 0.78f, 0.60f}, {1, 0.75f, 0.45f}},
        {"rose lantern", {0.80f, 0.32f, 0.28f}, {1, 0.46f, 0.30f}},
    };
    // From the belly up to the string.
    static const vec2 profile[] = {{0.05f, -0.1f}, {0.105f, -0.04f}, {0.105f, 0.03f}, {0.045f, 0.09f}, {0, 0.2f}};
    mesh body = {.origin = {0, -body_drop, 0}};
    mesh_lathe_add(&body, profile, countof(profile), 8);
    const gltf_geometry geometry = gltf_geometry_add(m->file, &body);
    mesh_fini(&body);
    for (int i = 0; i < COLORS; i++) {
        const gltf_material_desc paper = {.name = colors[i].name, .albedo = colors[i].paper, .roughness = 0.9f};
        m->bodies[i] = gltf_mesh_add(m->file, colors[i].name, geometry, gltf_material_add(m->file, &paper));
        m->lights[i] = gltf_light_add(m->file, colors[i].name, colors[i].light, (float)m->alight);
    }
}

// Pendulums about X, of two frequencies that fit into the clip, and of eight phases.
static void sways_add(lantern_maker *m, gltf_clip clip)
{
    float seconds[SWAY_KEYS];
    for (int key = 0; key < SWAY_KEYS; key++)
        seconds[key] = period * (float)key / (SWAY_KEYS - 1);
    const gltf_times times = gltf_times_add(m->file, seconds, SWAY_KEYS);
    for (int i = 0; i < SWAYS; i++) {
        const float turns = i % 2 ? 3 : 2, phase = 2 * pi * (float)(i / 2) / (SWAYS / 2), reach = i % 2 ? 0.10f : 0.16f;
        float rotations[SWAY_KEYS][4];
        for (int key = 0; key < SWAY_KEYS; key++) {
            const float at = (float)(key % (SWAY_KEYS - 1)) / (SWAY_KEYS - 1);
            const float angle = reach * sinf(2 * pi * turns * at + phase);
            rotations[key][0] = sinf(angle / 2);
            rotations[key][1] = rotations[key][2] = 0;
            rotations[key][3] = cosf(angle / 2);
        }
        m->sways[i] = gltf_sampler_add(m->file, clip, GLTF_ROTATION, GLTF_LINEAR, times, rotations[0]);
    }
}

// ---- Lanterns

static void lantern_add(lantern_maker *m, gltf_node parent, vec3 position)
{
    const uint32_t color = (uint32_t)random_uniform(&m->random, 0, COLORS);
    const uint32_t sway = (uint32_t)random_uniform(&m->random, 0, SWAYS);
    const gltf_node pivot = gltf_node_create(
        m->file, &(gltf_node_desc){.parent = parent, .translation = position, .mesh = m->bodies[color]});
    if (m->count++ % m->alight == 0)
        gltf_node_create(
            m->file, &(gltf_node_desc){.parent = pivot, .translation = {0, -light_drop, 0}, .light = m->lights[color]});
    gltf_channel_add(m->file, m->sways[sway], pivot, GLTF_ROTATION);
}

static float cable_height(float x)
{
    return cable_sag * (x * x / (cable_reach * cable_reach) - 1);
}

// A thin rope of three sides along X, between the houses.
static gltf_mesh cable_add(gltf_file *file)
{
    enum { PIECES = 10 };
    const gltf_material rope = gltf_material_add(file, &(gltf_material_desc){"rope", .albedo = {0.12f, 0.10f, 0.08f}});
    const float end = street_half_width + 0.1f, thick = 0.007f;
    mesh cable = {0};
    for (int i = 0; i < PIECES; i++) {
        const float a = end * (2 * (float)i / PIECES - 1), b = end * (2 * (float)(i + 1) / PIECES - 1);
        const float ya = cable_height(a), yb = cable_height(b);
        for (int side = 0; side < 3; side++) {
            const float from = 2 * pi * (float)side / 3, to = 2 * pi * (float)(side + 1) / 3;
            mesh_quad_add(&cable, (vec3){a, ya + thick * cosf(to), thick * sinf(to)},
                          (vec3){b, yb + thick * cosf(to), thick * sinf(to)},
                          (vec3){b, yb + thick * cosf(from), thick * sinf(from)},
                          (vec3){a, ya + thick * cosf(from), thick * sinf(from)});
        }
    }
    return lanterns_mesh_add(file, "cable", &cable, rope);
}

// In three tiers, one string of each in turn.
static void strings_add(lantern_maker *m)
{
    static const float tiers[] = {4.5f, 5.5f, 6.5f};
    const gltf_mesh cable = cable_add(m->file);
    for (int i = 0; i < STRINGS; i++) {
        const float t = ((float)i + 0.5f) / STRINGS, z = (2 * t - 1) * (street_half_length - 0.6f);
        const float y = tiers[i % 3] + random_uniform(&m->random, -0.12f, 0.12f);
        const gltf_node string = gltf_node_create(m->file, &(gltf_node_desc){.translation = {0, y, z}, .mesh = cable});
        for (int k = 0; k < STRING_LANTERNS; k++) {
            const float x = cable_reach * 0.95f * (2 * ((float)k + 0.5f) / STRING_LANTERNS - 1);
            lantern_add(m, string, (vec3){x, cable_height(x), 0});
        }
    }
}

// Under the stalls' awnings.
static void stall_lanterns_add(lantern_maker *m)
{
    for (int stall = 0; stall < STALLS; stall++) {
        const stall_place place = stall_place_of(stall);
        const quat turn = {0, sinf(place.yaw / 2), 0, cosf(place.yaw / 2)};
        const gltf_node rail =
            gltf_node_create(m->file, &(gltf_node_desc){.translation = place.position, .rotation = turn});
        for (int k = 0; k < STALL_LANTERNS; k++) {
            const float x = 2.1f * (((float)k + 0.5f) / STALL_LANTERNS - 0.5f);
            lantern_add(m, rail, (vec3){x, 2.2f, k % 2 ? 0.5f : -0.25f});
        }
    }
}

static void build(gltf_file *file, uint32_t alight)
{
    lantern_maker m = {.file = file, .alight = alight, .random = {7}};
    const gltf_clip clip = gltf_clip_add(file, "evening");
    street_add(file);
    stalls_add(file);
    people_add(file, clip);
    bodies_add(&m);
    sways_add(&m, clip);
    strings_add(&m);
    stall_lanterns_add(&m);
    const float degrees = pi / 180, aspect = 16.0f / 9.0f;
    gltf_camera_add(file, "street", (vec3){0.7f, 1.7f, 26}, (vec3){-0.5f, 2.7f, 8}, 60 * degrees, aspect);
    gltf_camera_add(file, "stall", (vec3){-1.2f, 1.7f, 13.5f}, (vec3){3.2f, 1.5f, 9.5f}, 55 * degrees, aspect);
}

void lanterns_build(gltf_file *file)
{
    build(file, 1);
}

void lanterns_500_build(gltf_file *file)
{
    build(file, 10);
}
