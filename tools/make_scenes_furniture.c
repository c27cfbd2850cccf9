// What stands and hangs in the atrium: cloth, potted plants, a fountain and benches.
#include "tools/make_scenes_atrium.h"

#include <math.h>

static const float pi = 3.14159265358979f;
static const float cloth_repeat = 0.8f; // metres

static float mix(float a, float b, float t)
{
    return a + (b - a) * t;
}

static float smooth(float low, float high, float x)
{
    const float t = fminf(fmaxf((x - low) / (high - low), 0), 1);
    return t * t * (3 - 2 * t);
}

static vec2 cloth_uv(float width, float height)
{
    return (vec2){width / cloth_repeat, height / cloth_repeat};
}

static void node_add(gltf_file *file, gltf_mesh mesh, atrium_place place)
{
    gltf_node_add(file, mesh, place.position, place.yaw);
}

// ---- Cloth.

// A swag across the court, from cornice to cornice along Z, gathered at both ends and spread in the middle.
typedef struct swag {
    float x, height, sag, width, phase;
} swag;

static vec3 swag_position(float s, float t, const void *user)
{
    const swag *swag = user;
    const float span = 2 * t - 1, spread = fmaxf(0, sinf(pi * t)), across = 2 * s - 1;
    const float width = swag->width * mix(0.3f, 1, powf(spread, 0.7f));
    const float gather = mix(0.065f, 0.03f, spread);
    const float folds =
        gather * cosf(2 * pi * 4.5f * s + swag->phase) + 0.5f * gather * sinf(2 * pi * (2.6f * s + 1.3f * t));
    // The cloth's own weight pulls its middle further down than its hems.
    const float droop = swag->sag * (1 - span * span) * (1 - 0.16f * across * across);
    const float sway = 0.12f * sinf(pi * t) * sinf(swag->phase + 3 * t);
    return (vec3){swag->x + sway + across * width / 2, swag->height - droop + folds, 4.97f * span};
}

static void swags_add(gltf_file *file, const atrium_materials *materials)
{
    const struct {
        const char *name;
        swag shape;
        gltf_material material;
    } table[] = {
        {"red swag", {-4.9f, 7.35f, 1.9f, 2.1f, 0.4f}, materials->cloth_red},
        {"ochre swag", {0.1f, 7.4f, 2, 2, 2.1f}, materials->cloth_ochre},
        {"blue swag", {4.8f, 7.35f, 1.8f, 2.1f, 4}, materials->cloth_blue},
    };
    for (size_t i = 0; i < countof(table); i++) {
        mesh cloth = {0};
        const vec2 size = cloth_uv(table[i].shape.width, 11.2f);
        mesh_sheet_add(&cloth, 32, 28, (vec2){0, 0}, size, swag_position, &table[i].shape);
        gltf_node_add(file, atrium_mesh_add(file, table[i].name, &cloth, table[i].material), (vec3){0}, 0);
    }
}

// A hanging over the upper balustrade: over the rail, past the string course and down before the arch. In the frame of
// a side, +Z towards the court.
typedef struct hanging {
    float half_width, bottom, phase;
} hanging;

static vec3 hanging_position(float s, float t, const void *user)
{
    const hanging *hanging = user;
    const float across = 2 * s - 1;
    // Swallow-tailed: the hem is highest in the middle.
    const float hem = hanging->bottom + 0.28f * (1 - fabsf(across));
    const float y = mix(5.262f, hem, t), below = 5.262f - y;
    const float out = 0.03f + 0.17f * smooth(0, 0.06f, below) + 0.30f * smooth(0.05f, 1.05f, below);
    const float folds = 0.035f * smooth(0.1f, 1.5f, below) * sinf(2 * pi * (2.2f * s + 0.12f * below) + hanging->phase);
    return (vec3){across * hanging->half_width * (1 - 0.04f * t), y, out + folds};
}

static void hangings_add(gltf_file *file, const atrium_materials *materials)
{
    const gltf_material dyes[] = {materials->cloth_red, materials->cloth_ochre, materials->cloth_blue};
    static const char *const names[] = {"red hanging", "ochre hanging", "blue hanging"};
    gltf_mesh meshes[countof(dyes)];
    for (uint32_t i = 0; i < countof(dyes); i++) {
        const hanging shape = {0.52f, 2.95f, 1.9f * (float)i};
        mesh cloth = {0};
        mesh_sheet_add(&cloth, 12, 18, (vec2){0, 0}, cloth_uv(1.04f, 2.4f), hanging_position, &shape);
        meshes[i] = atrium_mesh_add(file, names[i], &cloth, dyes[i]);
    }
    static const struct {
        atrium_side side;
        int bay, dye;
    } table[] = {
        {SIDE_NORTH, 0, 1}, {SIDE_NORTH, 2, 0}, {SIDE_NORTH, 4, 2}, {SIDE_SOUTH, 1, 2}, {SIDE_SOUTH, 3, 0},
        {SIDE_SOUTH, 5, 1}, {SIDE_EAST, 0, 0},  {SIDE_EAST, 2, 1},  {SIDE_WEST, 1, 2},  {SIDE_WEST, 3, 1},
    };
    for (size_t i = 0; i < countof(table); i++) {
        const float along = atrium_bay_middle(table[i].side, table[i].bay);
        node_add(file, meshes[table[i].dye], atrium_side_place(table[i].side, along, 0, 0));
    }
}

// A curtain across a lower arch, hung from a rod at the capitals, in the frame of a side.
typedef struct curtain {
    float tied_left, tied_right; // what it is gathered to at the tie; the full width when it is drawn
    float phase;
} curtain;

static vec3 curtain_position(float s, float t, const void *user)
{
    const curtain *curtain = user;
    const float top = 2.56f, bottom = atrium_lower_floor + 0.02f, tie = 0.6f, half_width = 0.97f;
    // Swept aside down to the tie, then falling straight and a little wider.
    const float pull = t < tie ? powf(fmaxf(t, 0) / tie, 1.6f) : 1 - 0.12f * smooth(tie, 1, t);
    const float left = mix(-half_width, curtain->tied_left, pull);
    const float right = mix(half_width, curtain->tied_right, pull);
    const float gathered = 1 - (right - left) / (2 * half_width);
    const float depth = mix(0.04f, 0.085f, gathered) * smooth(-0.05f, 0.12f, t);
    const float fold = sinf(2 * pi * 7 * s + curtain->phase + 0.7f * sinf(2.3f * t));
    const float ripple = 0.3f * sinf(2 * pi * (3 * s + 0.6f * t));
    return (vec3){mix(left, right, s) + 0.012f * fold, mix(top, bottom, t), 0.01f + depth * (fold + ripple)};
}

static void curtains_add(gltf_file *file, const atrium_materials *materials)
{
    static const curtain shapes[] = {{-0.95f, -0.68f, 0.5f}, {0.68f, 0.95f, 2.2f}, {-0.93f, 0.95f, 1.3f}};
    gltf_geometry geometries[countof(shapes)];
    for (size_t i = 0; i < countof(shapes); i++) {
        mesh cloth = {0};
        mesh_sheet_add(&cloth, 48, 12, (vec2){0, 0}, cloth_uv(2.6f, 2.4f), curtain_position, &shapes[i]);
        geometries[i] = gltf_geometry_add(file, &cloth);
        mesh_fini(&cloth);
    }
    mesh rod = {.repeat = 1};
    mesh_box_add(&rod, (vec3){-1.15f, 2.535f, -0.018f}, (vec3){1.15f, 2.57f, 0.018f});
    const gltf_mesh rod_mesh = atrium_mesh_add(file, "curtain rod", &rod, materials->wood);

    enum { TIED_LEFT, TIED_RIGHT, DRAWN };
    const struct {
        atrium_side side;
        int bay, shape;
        gltf_material dye;
    } table[] = {
        {SIDE_NORTH, 1, TIED_LEFT, materials->cloth_blue},  {SIDE_NORTH, 3, DRAWN, materials->cloth_ochre},
        {SIDE_NORTH, 5, TIED_RIGHT, materials->cloth_red},  {SIDE_SOUTH, 1, TIED_LEFT, materials->cloth_red},
        {SIDE_SOUTH, 3, TIED_RIGHT, materials->cloth_blue}, {SIDE_EAST, 1, TIED_RIGHT, materials->cloth_ochre},
        {SIDE_EAST, 3, TIED_LEFT, materials->cloth_blue},   {SIDE_WEST, 2, DRAWN, materials->cloth_red},
    };
    for (size_t i = 0; i < countof(table); i++) {
        const float along = atrium_bay_middle(table[i].side, table[i].bay);
        const atrium_place place = atrium_side_place(table[i].side, along, 0, 0);
        node_add(file, rod_mesh, place);
        node_add(file, gltf_mesh_add(file, "curtain", geometries[table[i].shape], table[i].dye), place);
    }
}

// ---- Plants.

// One leaf: a ribbon that starts upwards at `rise` radians and bends over by its own weight, folded along its rib.
typedef struct leaf {
    float yaw, rise, length, half_width, droop, fold;
} leaf;

static vec3 leaf_position(float s, float t, const void *user)
{
    const leaf *leaf = user;
    const float along = 1 - t, across = 2 * s - 1; // t runs from the tip, the image's top, to the stalk
    const float out = leaf->length * along * (cosf(leaf->rise) + 0.35f * leaf->droop * along);
    const float up = leaf->length * along * (sinf(leaf->rise) - leaf->droop * along);
    const float valley = leaf->fold * leaf->half_width * fabsf(across);
    return vec3_yaw((vec3){-across * leaf->half_width, up + valley, out + 0.02f}, leaf->yaw);
}

typedef struct plant {
    uint32_t leaves, columns, rows;
    vec2 uv_low, uv_high;
    vec2 rise, length, half_width, droop; // ranges, from the outermost leaves to the innermost
    uint64_t seed;
} plant;

// Stands at the origin.
static gltf_mesh plant_add(gltf_file *file, const char *name, const plant *plant, gltf_material material)
{
    mesh foliage = {0};
    random_sequence random = {plant->seed};
    for (uint32_t i = 0; i < plant->leaves; i++) {
        const float inner = (float)i / (float)(plant->leaves - 1), vary = random_uniform(&random, 0.85f, 1.15f);
        const float golden_angle = 2.39996f;
        const leaf leaf = {
            .yaw = golden_angle * (float)i + random_uniform(&random, -0.25f, 0.25f),
            .rise = mix(plant->rise.x, plant->rise.y, inner) * random_uniform(&random, 0.9f, 1.1f),
            .length = mix(plant->length.x, plant->length.y, inner) * vary,
            .half_width = mix(plant->half_width.x, plant->half_width.y, inner) * vary,
            .droop = mix(plant->droop.x, plant->droop.y, inner),
            .fold = random_uniform(&random, 0.25f, 0.5f),
        };
        mesh_sheet_add(&foliage, plant->columns, plant->rows, plant->uv_low, plant->uv_high, leaf_position, &leaf);
    }
    return atrium_mesh_add(file, name, &foliage, material);
}

// Where people would dance.
static bool in_court_middle(vec3 position)
{
    return position.y < atrium_lower_floor && fabsf(position.x) < 5 && fabsf(position.z) < 3.6f;
}

static void plants_add(gltf_file *file, const atrium_materials *materials, bool clear_court)
{
    static const vec2 pot_profile[] = {{0.2f, -0.01f},  {0.22f, 0.02f},   {0.3f, 0.3f},   {0.31f, 0.4f},
                                       {0.305f, 0.43f}, {0.355f, 0.435f}, {0.37f, 0.46f}, {0.365f, 0.52f},
                                       {0.35f, 0.535f}, {0.32f, 0.535f},  {0.3f, 0.52f},  {0.285f, 0.4f}};
    static const vec2 soil_profile[] = {{0.292f, 0.38f}, {0.295f, 0.475f}, {0.1f, 0.505f}};
    mesh pot = {0}, soil = {0};
    mesh_lathe_add(&pot, pot_profile, countof(pot_profile), 16);
    mesh_lathe_add(&soil, soil_profile, countof(soil_profile), 16);
    const gltf_mesh pot_mesh = atrium_mesh_add(file, "pot", &pot, materials->terracotta);
    const gltf_mesh soil_mesh = atrium_mesh_add(file, "soil", &soil, materials->soil);

    const gltf_mesh kinds[] = {
        plant_add(file, "palm",
                  &(plant){
                      .leaves = 24,
                      .columns = 2,
                      .rows = 7,
                      .uv_low = {0, 0},
                      .uv_high = {0.5f, 1},
                      .rise = {0.75f, 1.45f},
                      .length = {1.35f, 1.7f},
                      .half_width = {0.19f, 0.17f},
                      .droop = {0.75f, 0.35f},
                      .seed = 5,
                  },
                  materials->leaves),
        plant_add(file, "broad-leaved plant",
                  &(plant){
                      .leaves = 32,
                      .columns = 2,
                      .rows = 4,
                      .uv_low = {0.5f, 0},
                      .uv_high = {1, 1},
                      .rise = {0.35f, 1.4f},
                      .length = {0.55f, 0.95f},
                      .half_width = {0.12f, 0.15f},
                      .droop = {0.5f, 0.3f},
                      .seed = 9,
                  },
                  materials->leaves),
    };
    const float court = atrium_court_floor, lower = atrium_lower_floor, upper = atrium_upper_floor;
    const struct {
        vec3 position;
        float yaw;
        int kind;
    } table[] = {
        {{-2.9f, court, -2.3f}, 0.3f, 0}, {{2.9f, court, -2.3f}, 1.4f, 0},  {{-2.9f, court, 2.3f}, 2.6f, 0},
        {{2.9f, court, 2.3f}, 3.9f, 0},   {{-6.6f, court, -4.0f}, 5, 1},    {{6.6f, court, -4.0f}, 0.8f, 1},
        {{6.6f, court, 4.0f}, 2, 1},      {{9.8f, lower, -7.2f}, 3.3f, 0},  {{-9.8f, lower, -7.2f}, 1.1f, 1},
        {{9.8f, lower, 7.2f}, 4.4f, 1},   {{-2.6f, upper, -7.3f}, 0.2f, 1}, {{2.6f, upper, 7.3f}, 1.8f, 1},
        {{9.9f, upper, -2.6f}, 2.9f, 1},
    };
    for (size_t i = 0; i < countof(table); i++) {
        const vec3 foot = table[i].position;
        if (clear_court && in_court_middle(foot))
            continue;
        gltf_node_add(file, pot_mesh, foot, table[i].yaw);
        gltf_node_add(file, soil_mesh, foot, table[i].yaw);
        gltf_node_add(file, kinds[table[i].kind], vec3_add(foot, (vec3){0, 0.46f, 0}), table[i].yaw);
    }
}

// ---- Fountain and benches.

static void fountain_add(gltf_file *file, const atrium_materials *materials)
{
    static const vec2 basin[] = {{1.75f, -0.05f}, {1.75f, 0.11f}, {1.73f, 0.13f}, {1.5f, 0.13f},
                                 {1.46f, 0.17f},  {1.4f, 0.2f},   {1.38f, 0.3f},  {1.4f, 0.4f},
                                 {1.47f, 0.46f},  {1.5f, 0.48f},  {1.52f, 0.54f}, {1.5f, 0.59f},
                                 {1.44f, 0.61f},  {1.28f, 0.61f}, {1.25f, 0.59f}, {1.22f, 0.2f}};
    static const vec2 pedestal[] = {{0.36f, 0.15f}, {0.36f, 0.42f}, {0.3f, 0.48f},  {0.2f, 0.53f},  {0.15f, 0.62f},
                                    {0.14f, 0.75f}, {0.18f, 0.9f},  {0.16f, 0.98f}, {0.11f, 1.03f}, {0.13f, 1.07f},
                                    {0.3f, 1.1f},   {0.5f, 1.16f},  {0.66f, 1.26f}, {0.74f, 1.37f}, {0.76f, 1.41f},
                                    {0.74f, 1.43f}, {0.7f, 1.42f},  {0.6f, 1.31f},  {0.4f, 1.22f},  {0.1f, 1.19f}};
    static const vec2 finial[] = {{0.09f, 1.15f}, {0.09f, 1.38f}, {0.06f, 1.42f}, {0.05f, 1.5f},
                                  {0.08f, 1.56f}, {0.1f, 1.63f},  {0.08f, 1.71f}, {0.03f, 1.77f}};
    static const vec2 lower_water[] = {{1.3f, 0.25f}, {1.3f, 0.5f}},
                      upper_water[] = {{0.3f, 1.2f}, {0.64f, 1.32f}, {0.7f, 1.375f}};
    mesh stone = {0}, water = {0};
    mesh_lathe_add(&stone, basin, countof(basin), 40);
    mesh_lathe_add(&stone, pedestal, countof(pedestal), 24);
    mesh_lathe_add(&stone, finial, countof(finial), 12);
    mesh_lathe_add(&water, lower_water, countof(lower_water), 40);
    mesh_lathe_add(&water, upper_water, countof(upper_water), 24);
    gltf_node_add(file, atrium_mesh_add(file, "fountain", &stone, materials->limestone), (vec3){0}, 0);
    gltf_node_add(file, atrium_mesh_add(file, "water", &water, materials->water), (vec3){0}, 0);
}

static void benches_add(gltf_file *file, const atrium_materials *materials, bool clear_court)
{
    mesh legs = {0}, seat = {.repeat = 1};
    const vec2 leg[] = {{0.02f, -0.01f}, {0.02f, 0.06f}, {0, 0.09f}, {0, 0.34f}, {0.02f, 0.37f}, {0.02f, 0.42f}};
    for (int end = -1; end <= 1; end += 2) {
        legs.origin = (vec3){0.65f * (float)end, 0, 0};
        mesh_block_add(&legs, 0.07f, 0.17f, leg, countof(leg));
    }
    const vec2 board[] = {{-0.01f, 0.41f}, {0, 0.42f}, {0, 0.46f}, {-0.01f, 0.47f}};
    for (int i = -1; i <= 1; i++) {
        seat.origin = (vec3){0, 0, 0.145f * (float)i};
        mesh_block_add(&seat, 0.9f, 0.068f, board, countof(board));
    }
    const gltf_mesh legs_mesh = atrium_mesh_add(file, "bench legs", &legs, materials->limestone);
    const gltf_mesh seat_mesh = atrium_mesh_add(file, "bench seat", &seat, materials->wood);
    const float court = atrium_court_floor, lower = atrium_lower_floor;
    const atrium_place places[] = {
        {{-4.6f, court, 0}, pi / 2},
        {{4.6f, court, 0}, pi / 2},
        {{0, court, -3.4f}, 0},
        {{0, court, 3.4f}, 0},
        atrium_side_place(SIDE_NORTH, 1.3f, 2.2f, lower),
        atrium_side_place(SIDE_NORTH, -6.5f, 2.2f, lower),
        atrium_side_place(SIDE_EAST, 1.3f, 2.2f, lower),
        atrium_side_place(SIDE_SOUTH, 1.3f, 2.2f, lower),
    };
    for (size_t i = 0; i < countof(places); i++) {
        if (clear_court && in_court_middle(places[i].position))
            continue;
        node_add(file, legs_mesh, places[i]);
        node_add(file, seat_mesh, places[i]);
    }
}

void atrium_furnish(gltf_file *file, const atrium_materials *materials, bool clear_court)
{
    swags_add(file, materials);
    hangings_add(file, materials);
    curtains_add(file, materials);
    plants_add(file, materials, clear_court);
    if (!clear_court)
        fountain_add(file, materials);
    benches_add(file, materials, clear_court);
}
