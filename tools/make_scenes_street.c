// The night market's street: cobbles, houses on both sides, gates at both ends, and stalls with awnings and goods.
#include "tools/make_scenes_lanterns.h"
#include "tools/make_scenes_texture.h"

#include <math.h>

enum { HOUSES = 10, HOUSE_KINDS = 3 };
static const float pi = 3.14159265358979f;
static const float house_width = 6, house_depth = 3;

typedef struct street_materials {
    gltf_material cobbles, stone, wood, tiles, brick, plaster[HOUSE_KINDS];
} street_materials;

static gltf_material textured(gltf_file *file, const char *name, gltf_texture texture, gltf_texture normals, vec3 tint)
{
    return gltf_material_add(
        file,
        &(gltf_material_desc){.name = name, .albedo = tint, .roughness = 0.9f, .texture = texture, .normals = normals});
}

static street_materials materials_add(gltf_file *file)
{
    static const vec3 tints[HOUSE_KINDS] = {{0.62f, 0.46f, 0.27f}, {0.40f, 0.48f, 0.53f}, {0.60f, 0.36f, 0.31f}};
    const gltf_texture plaster = texture_add(file, "plaster", texture_plaster, false);
    const gltf_texture none = {0};
    const vec3 white = {1, 1, 1};
    street_materials m = {
        .cobbles = textured(file, "cobbles", texture_add(file, "cobbles", texture_cobbles, false),
                            texture_normals_add(file, "cobble normals", texture_cobbles, 1.2f), white),
        .stone = textured(file, "stone", texture_add(file, "stone", texture_limestone, false), none, white),
        .wood = textured(file, "wood", texture_add(file, "wood", texture_wood, false), none, white),
        .brick = textured(file, "brick", texture_add(file, "brick", texture_brick, false),
                          texture_normals_add(file, "brick normals", texture_brick, 1), white),
        .tiles = gltf_material_add(file, &(gltf_material_desc){"roof tiles", .albedo = {0.16f, 0.08f, 0.06f}}),
    };
    for (int i = 0; i < HOUSE_KINDS; i++)
        m.plaster[i] = textured(file, "plaster", plaster, none, tints[i]);
    return m;
}

// ---- Houses. In the frame of a house: its front at z = 0 faces +Z.

// Two leaves with raised panels between jambs, lintel and sill; half of an opening's width, its foot and its head.
static void opening_add(mesh *wood, mesh *stone, float x, float half, float foot, float head)
{
    for (int leaf = 0; leaf < 2; leaf++) {
        const float left = x + (leaf ? 0.006f : -half), right = x + (leaf ? half : -0.006f);
        const float middle = (foot + head) / 2;
        mesh_box_add(wood, (vec3){left, foot, -0.1f}, (vec3){right, head, 0.04f});
        mesh_box_add(wood, (vec3){left + 0.07f, foot + 0.08f, 0}, (vec3){right - 0.07f, middle - 0.05f, 0.06f});
        mesh_box_add(wood, (vec3){left + 0.07f, middle + 0.05f, 0}, (vec3){right - 0.07f, head - 0.08f, 0.06f});
    }
    const float out = half + 0.12f;
    mesh_box_add(stone, (vec3){x - out, foot, -0.1f}, (vec3){x - half + 0.01f, head + 0.02f, 0.09f});
    mesh_box_add(stone, (vec3){x + half - 0.01f, foot, -0.1f}, (vec3){x + out, head + 0.02f, 0.09f});
    mesh_box_add(stone, (vec3){x - out - 0.05f, head, -0.1f}, (vec3){x + out + 0.05f, head + 0.16f, 0.12f});
    mesh_box_add(stone, (vec3){x - out - 0.05f, foot - 0.1f, -0.1f}, (vec3){x + out + 0.05f, foot + 0.01f, 0.14f});
}

// A balcony of wood before the first floor.
static void balcony_add(mesh *wood)
{
    mesh_box_add(wood, (vec3){-1.6f, 3.42f, -0.1f}, (vec3){1.6f, 3.54f, 0.7f});
    mesh_box_add(wood, (vec3){-1.6f, 4.3f, 0.62f}, (vec3){1.6f, 4.38f, 0.7f});
    for (int i = 0; i < 17; i++) {
        const float x = -1.57f + 0.19625f * (float)i;
        mesh_box_add(wood, (vec3){x - 0.02f, 3.5f, 0.64f}, (vec3){x + 0.02f, 4.32f, 0.68f});
    }
    for (int i = 0; i < 3; i++) {
        const float x = -1.4f + 1.4f * (float)i;
        mesh_box_add(wood, (vec3){x - 0.05f, 3.2f, -0.1f}, (vec3){x + 0.05f, 3.45f, 0.5f});
    }
}

typedef struct house {
    gltf_mesh walls, plinth, trim, wood, roof;
} house;

static house house_make(gltf_file *file, const street_materials *m, int kind)
{
    const float half = house_width / 2, height = 8.2f + 0.9f * (float)kind,
                door = kind == 1   ? 0
                       : kind == 0 ? -1.5f
                                   : 1.5f;
    mesh walls = {.repeat = 2}, plinth = {.repeat = 1}, trim = {.repeat = 1}, wood = {.repeat = 1, .grain_up = true},
         roof = {0};
    mesh_box_add(&walls, (vec3){-half, -0.1f, -house_depth}, (vec3){half, height, 0});
    mesh_box_add(&plinth, (vec3){-half - 0.01f, -0.1f, -0.5f}, (vec3){half + 0.01f, 0.9f, 0.05f});
    // String courses and a cornice.
    mesh_box_add(&trim, (vec3){-half - 0.01f, 3.1f, -0.2f}, (vec3){half + 0.01f, 3.24f, 0.1f});
    mesh_box_add(&trim, (vec3){-half - 0.01f, height - 0.35f, -0.2f}, (vec3){half + 0.01f, height - 0.2f, 0.16f});
    opening_add(&wood, &trim, door, 0.62f, 0.06f, 2.35f);
    for (int i = -1; i <= 1; i++) {
        const float x = 1.9f * (float)i;
        if (fabsf(x - door) > 1.3f)
            opening_add(&wood, &trim, x, 0.5f, 1.15f, 2.45f);
        opening_add(&wood, &trim, x, 0.48f, i == 0 && kind == 2 ? 3.6f : 4, 5.35f);
        if (height > 8.5f)
            opening_add(&wood, &trim, x, 0.45f, 6.15f, 7.3f);
    }
    if (kind == 2)
        balcony_add(&wood);
    static const vec2 eaves[] = {{0.5f, 0}, {0.52f, 0.12f}, {-1.4f, 1.2f}};
    vec2 profile[countof(eaves)];
    for (size_t i = 0; i < countof(eaves); i++)
        profile[i] = (vec2){eaves[i].x, eaves[i].y + height - 0.05f};
    roof.origin = (vec3){0, 0, -house_depth / 2};
    mesh_block_add(&roof, half - 0.5f, house_depth / 2, profile, countof(profile));
    return (house){
        .walls = lanterns_mesh_add(file, "walls", &walls, m->plaster[kind]),
        .plinth = lanterns_mesh_add(file, "plinth", &plinth, m->brick),
        .trim = lanterns_mesh_add(file, "trim", &trim, m->stone),
        .wood = lanterns_mesh_add(file, "shutters", &wood, m->wood),
        .roof = lanterns_mesh_add(file, "roof", &roof, m->tiles),
    };
}

static void houses_add(gltf_file *file, const street_materials *m)
{
    house houses[HOUSE_KINDS];
    for (int kind = 0; kind < HOUSE_KINDS; kind++)
        houses[kind] = house_make(file, m, kind);
    for (int side = 0; side < 2; side++)
        for (int i = 0; i < HOUSES; i++) {
            const house *h = &houses[(i * 2 + side + i / 4) % HOUSE_KINDS];
            const vec3 position = {side ? street_half_width : -street_half_width, 0,
                                   house_width * ((float)i + 0.5f) - street_half_length};
            const float yaw = side ? -pi / 2 : pi / 2;
            const gltf_mesh parts[] = {h->walls, h->plinth, h->trim, h->wood, h->roof};
            for (size_t k = 0; k < countof(parts); k++)
                gltf_node_add(file, parts[k], position, yaw);
        }
}

// Gates: an arch through a wall of brick, closed by a wall some steps behind it.
static void gates_add(gltf_file *file, const street_materials *m)
{
    mesh gate = {.repeat = 1}, back = {.repeat = 2}, ring = {.repeat = 1};
    mesh_arcade_add(&gate, &(mesh_arcade_desc){.bays = 1,
                                               .pitch = 9.6f,
                                               .half_span = 2.1f,
                                               .rise = 2.1f,
                                               .springing = 2.6f,
                                               .top = 8.6f,
                                               .half_thickness = 0.6f,
                                               .segments = 24});
    mesh_box_add(&gate, (vec3){-4.8f, -0.1f, -0.6f}, (vec3){-2.1f, 2.6f, 0.6f});
    mesh_box_add(&gate, (vec3){2.1f, -0.1f, -0.6f}, (vec3){4.8f, 2.6f, 0.6f});
    mesh_box_add(&back, (vec3){-5, -0.1f, -3.4f}, (vec3){5, 8, -3});
    static const vec2 moulding[] = {{0, 0.55f}, {0.3f, 0.55f}, {0.3f, 0.68f}, {0.05f, 0.7f}};
    mesh_archivolt_add(&ring, 2.1f, 2.6f, moulding, countof(moulding), 24);
    const gltf_mesh parts[] = {
        lanterns_mesh_add(file, "gate", &gate, m->brick),
        lanterns_mesh_add(file, "wall behind the gate", &back, m->plaster[1]),
        lanterns_mesh_add(file, "gate's arch", &ring, m->stone),
    };
    for (int end = 0; end < 2; end++)
        for (size_t k = 0; k < countof(parts); k++)
            gltf_node_add(file, parts[k], (vec3){0, 0, end ? street_half_length : -street_half_length}, end ? pi : 0);
}

void street_add(gltf_file *file)
{
    const street_materials m = materials_add(file);
    mesh ground = {.repeat = 1.2f}, kerb = {.repeat = 1};
    mesh_box_add(&ground, (vec3){-5.5f, -0.4f, -34}, (vec3){5.5f, 0, 34});
    for (int side = -1; side <= 1; side += 2) {
        const float x = (float)side * (street_half_width - 0.28f);
        mesh_box_add(&kerb, (vec3){x - 0.3f, -0.1f, -29.3f}, (vec3){x + 0.3f, 0.07f, 29.3f});
    }
    gltf_node_add(file, lanterns_mesh_add(file, "cobbles", &ground, m.cobbles), (vec3){0}, 0);
    gltf_node_add(file, lanterns_mesh_add(file, "kerb", &kerb, m.stone), (vec3){0}, 0);
    houses_add(file, &m);
    gates_add(file, &m);
}

// ---- Stalls

stall_place stall_place_of(int stall)
{
    const bool right = stall % 2;
    const float z = ((float)(stall / 2) + 0.5f) * 4.7f - 28.2f + (right ? 1.1f : -0.4f);
    return (stall_place){{right ? 3 : -3, 0, z}, right ? -pi / 2 : pi / 2};
}

// Falls from behind to the front, sags between its posts and ends in scallops.
static vec3 awning_position(float s, float t, const void *user)
{
    (void)user;
    const float x = 2.6f * (s - 0.5f), slope = fminf(t / 0.86f, 1), hem = fmaxf(t - 0.86f, 0) / 0.14f;
    const float sag = 0.05f * sinf(pi * slope) * (1 - 0.3f * cosf(2 * pi * 2 * s));
    const float scallop = 0.1f + 0.07f * fabsf(sinf(pi * 6 * s));
    return (vec3){x, 2.75f - 0.4f * slope - sag - hem * scallop, -0.75f + 1.6f * slope + 0.03f * hem};
}

static void ball_add(mesh *goods, vec3 centre, float radius)
{
    const vec2 profile[] = {
        {0, -radius}, {0.75f * radius, -0.66f * radius}, {radius, 0}, {0.75f * radius, 0.66f * radius}, {0, radius}};
    goods->origin = centre;
    mesh_lathe_add(goods, profile, countof(profile), 8);
    goods->origin = (vec3){0};
}

// Three layers, each in the hollows of the one below.
static void heap_add(mesh *goods, vec3 corner, float radius)
{
    for (int layer = 0; layer < 3; layer++)
        for (int i = 0; i < 4 - layer; i++)
            for (int k = 0; k < 3 - layer; k++) {
                const float step = 2 * radius, shift = (float)layer * radius;
                ball_add(goods,
                         (vec3){corner.x + shift + step * (float)i, corner.y + radius * (1 + 1.4f * (float)layer),
                                corner.z + shift + step * (float)k},
                         radius);
            }
}

static void frame_add(mesh *wood)
{
    mesh_box_add(wood, (vec3){-1.2f, 0.82f, -0.4f}, (vec3){1.2f, 0.88f, 0.45f});
    mesh_box_add(wood, (vec3){-1.15f, 0.1f, 0.36f}, (vec3){1.15f, 0.83f, 0.4f});
    for (int i = 0; i < 4; i++) {
        const float x = i % 2 ? 1.15f : -1.15f, z = i / 2 ? 0.72f : -0.7f;
        mesh_box_add(wood, (vec3){x - 0.035f, -0.05f, z - 0.035f},
                     (vec3){x + 0.035f, i / 2 ? 2.37f : 2.73f, z + 0.035f});
    }
    mesh_box_add(wood, (vec3){-1.2f, 2.26f, 0.68f}, (vec3){1.2f, 2.32f, 0.74f});
    // Crates on the counter and beside it.
    for (int i = 0; i < 3; i++) {
        const float x = -0.8f + 0.8f * (float)i;
        mesh_box_add(wood, (vec3){x - 0.33f, 0.87f, -0.26f}, (vec3){x + 0.33f, 0.93f, 0.28f});
        mesh_box_add(wood, (vec3){x - 0.33f, 0.9f, 0.25f}, (vec3){x + 0.33f, 1.0f, 0.28f});
        mesh_box_add(wood, (vec3){x - 0.33f, 0.9f, -0.26f}, (vec3){x + 0.33f, 1.0f, -0.23f});
        mesh_box_add(wood, (vec3){x - 0.33f, 0.9f, -0.25f}, (vec3){x - 0.3f, 1.0f, 0.27f});
        mesh_box_add(wood, (vec3){x + 0.3f, 0.9f, -0.25f}, (vec3){x + 0.33f, 1.0f, 0.27f});
    }
    mesh_box_add(wood, (vec3){1.3f, -0.02f, -0.2f}, (vec3){1.8f, 0.4f, 0.3f});
    mesh_box_add(wood, (vec3){1.38f, 0.39f, -0.15f}, (vec3){1.75f, 0.7f, 0.22f});
}

static void pots_add(mesh *goods)
{
    static const vec2 pot[] = {{0.06f, 0}, {0.12f, 0.1f}, {0.13f, 0.18f}, {0.07f, 0.27f}, {0.08f, 0.3f}};
    for (int i = 0; i < 8; i++) {
        goods->origin = (vec3){-0.95f + 0.27f * (float)i, 0.92f, i % 2 ? 0.08f : -0.1f};
        mesh_lathe_add(goods, pot, countof(pot), 12);
    }
    goods->origin = (vec3){0};
}

void stalls_add(gltf_file *file)
{
    static const struct {
        const char *name;
        vec3 albedo;
    } fruits[] = {
        {"oranges", {0.75f, 0.30f, 0.04f}}, {"apples", {0.55f, 0.06f, 0.04f}}, {"limes", {0.25f, 0.45f, 0.07f}}};
    static const struct {
        const char *name;
        texture_recipe recipe;
    } cloths[] = {{"red awning", texture_awning_red},
                  {"blue awning", texture_awning_blue},
                  {"ochre awning", texture_awning_ochre}};
    mesh wood = {.repeat = 1}, awning = {0}, pots = {0};
    frame_add(&wood);
    mesh_sheet_add(&awning, 36, 12, (vec2){0, 0}, (vec2){2, 1}, awning_position, NULL);
    pots_add(&pots);
    const gltf_material planks = textured(file, "planks", texture_add(file, "planks", texture_wood, false),
                                          (gltf_texture){0}, (vec3){0.9f, 0.8f, 0.7f});
    const gltf_material clay = gltf_material_add(file, &(gltf_material_desc){"clay", .albedo = {0.40f, 0.19f, 0.11f}});
    const gltf_mesh frame = lanterns_mesh_add(file, "stall", &wood, planks);
    const gltf_mesh pottery = lanterns_mesh_add(file, "pots", &pots, clay);
    const gltf_geometry sheet = gltf_geometry_add(file, &awning);
    mesh_fini(&awning);
    gltf_mesh awnings[countof(cloths)], heaps[countof(fruits)];
    for (size_t i = 0; i < countof(cloths); i++) {
        const gltf_material_desc cloth = {.name = cloths[i].name,
                                          .texture = texture_add(file, cloths[i].name, cloths[i].recipe, false),
                                          .double_sided = true};
        awnings[i] = gltf_mesh_add(file, cloths[i].name, sheet, gltf_material_add(file, &cloth));
        mesh goods = {0};
        heap_add(&goods, (vec3){-0.96f + 0.8f * (float)i - 0.06f, 0.93f, -0.15f}, 0.062f);
        const gltf_material fruit =
            gltf_material_add(file, &(gltf_material_desc){fruits[i].name, .albedo = fruits[i].albedo});
        heaps[i] = lanterns_mesh_add(file, fruits[i].name, &goods, fruit);
    }
    for (int stall = 0; stall < STALLS; stall++) {
        const stall_place place = stall_place_of(stall);
        gltf_node_add(file, frame, place.position, place.yaw);
        gltf_node_add(file, awnings[(stall / 2 + stall) % (int)countof(cloths)], place.position, place.yaw);
        for (size_t i = 0; stall % 3 != 1 && i < countof(fruits); i++)
            gltf_node_add(file, heaps[i], place.position, place.yaw);
        if (stall % 3 == 1)
            gltf_node_add(file, pottery, place.position, place.yaw);
    }
}
