// The atrium's building: arcades, vaults, cornices, walls, sun and cameras. Furniture is in make_scenes_furniture.c.
//
// Solids sink a little into each other where they meet, so that no faces coincide and no light leaks.
#include "tools/make_scenes_atrium.h"
#include "tools/make_scenes_texture.h"

#include <math.h>

static const float pi = 3.14159265358979f;

// Heights and, outward from the columns' axis, distances.
static const float wall_half_thickness = 0.25f, outer_wall = 2.6f;
static const float lower_wall_top = 4.05f, upper_wall_top = 7.9f;
static const float arch_radius = 1.05f;
// The passage between arcade and outer wall, and its vault, which runs 2 cm into both.
static const float passage_middle = 1.425f, passage_half = 1.175f, vault_rise = 1.28f, vault_top = 4.03f;

atrium_place atrium_side_place(atrium_side side, float along, float outward, float height)
{
    const float yaws[SIDE_COUNT] = {[SIDE_NORTH] = 0, [SIDE_EAST] = -pi / 2, [SIDE_SOUTH] = pi, [SIDE_WEST] = pi / 2};
    const bool is_long = side == SIDE_NORTH || side == SIDE_SOUTH;
    const vec3 position = {along, height, -(is_long ? atrium_half_z : atrium_half_x) - outward};
    return (atrium_place){vec3_yaw(position, yaws[side]), yaws[side]};
}

gltf_mesh atrium_mesh_add(gltf_file *file, const char *name, mesh *mesh, gltf_material material)
{
    const gltf_mesh added = gltf_mesh_add(file, name, gltf_geometry_add(file, mesh), material);
    mesh_fini(mesh);
    return added;
}

static void node_add(gltf_file *file, gltf_mesh mesh, atrium_place place)
{
    gltf_node_add(file, mesh, place.position, place.yaw);
}

static void frame_node_add(gltf_file *file, const char *name, float repeat, const vec2 *profile, size_t count,
                           gltf_material material)
{
    mesh frame = {.repeat = repeat};
    mesh_frame_add(&frame, atrium_half_x, atrium_half_z, profile, count);
    gltf_node_add(file, atrium_mesh_add(file, name, &frame, material), (vec3){0}, 0);
}

static atrium_materials materials_add(gltf_file *file)
{
    const gltf_texture ashlar_normals = texture_normals_add(file, "ashlar normals", texture_ashlar, 1.6f);
    const gltf_texture brick_normals = texture_normals_add(file, "brick normals", texture_brick, 1);
    const gltf_texture paving_normals = texture_normals_add(file, "paving normals", texture_paving, 2.4f);
    const struct {
        size_t member;
        gltf_material_desc desc;
        texture_recipe recipe;
    } table[] = {
        {offsetof(atrium_materials, ashlar),
         {.name = "ashlar", .roughness = 0.9f, .normals = ashlar_normals},
         texture_ashlar},
        {offsetof(atrium_materials, brick),
         {.name = "brick", .roughness = 0.9f, .normals = brick_normals},
         texture_brick},
        {offsetof(atrium_materials, limestone), {.name = "limestone", .roughness = 0.8f}, texture_limestone},
        {offsetof(atrium_materials, plaster), {.name = "plaster", .roughness = 1}, texture_plaster},
        {offsetof(atrium_materials, paving),
         {.name = "paving", .roughness = 0.75f, .normals = paving_normals},
         texture_paving},
        {offsetof(atrium_materials, marble), {.name = "marble", .roughness = 0.3f}, texture_marble},
        {offsetof(atrium_materials, wood), {.name = "wood", .roughness = 0.7f}, texture_wood},
        {offsetof(atrium_materials, cloth_red), {.name = "red cloth", .double_sided = true}, texture_cloth_red},
        {offsetof(atrium_materials, cloth_ochre), {.name = "ochre cloth", .double_sided = true}, texture_cloth_ochre},
        {offsetof(atrium_materials, cloth_blue), {.name = "blue cloth", .double_sided = true}, texture_cloth_blue},
        {offsetof(atrium_materials, leaves),
         {.name = "leaves", .roughness = 0.6f, .alpha_mask = true, .double_sided = true},
         texture_leaves},
        {offsetof(atrium_materials, terracotta),
         {.name = "terracotta", .roughness = 0.85f, .albedo = {0.45f, 0.20f, 0.11f}},
         NULL},
        {offsetof(atrium_materials, soil), {.name = "soil", .albedo = {0.10f, 0.07f, 0.05f}}, NULL},
        {offsetof(atrium_materials, water),
         {.name = "water", .roughness = 0.05f, .albedo = {0.06f, 0.13f, 0.13f}},
         NULL},
    };
    atrium_materials materials = {0};
    for (size_t i = 0; i < countof(table); i++) {
        gltf_material_desc desc = table[i].desc;
        if (table[i].recipe)
            desc.texture = texture_add(file, desc.name, table[i].recipe, desc.alpha_mask);
        *(gltf_material *)((char *)&materials + table[i].member) = gltf_material_add(file, &desc);
    }
    return materials;
}

// ---- Floors, walls and mouldings that run all around.

static void shell_add(gltf_file *file, const atrium_materials *materials)
{
    mesh court = {.repeat = 2.4f};
    mesh_box_add(&court, (vec3){-7.4f, -0.3f, -4.8f}, (vec3){7.4f, atrium_court_floor, 4.8f});
    gltf_node_add(file, atrium_mesh_add(file, "court floor", &court, materials->paving), (vec3){0}, 0);

    const float lower = atrium_lower_floor, upper = atrium_upper_floor;
    const vec2 step[] = {
        {-0.6f, -0.3f}, {2.8f, -0.3f}, {2.8f, lower - 0.02f}, {-0.57f, lower - 0.02f}, {-0.6f, lower - 0.05f}};
    frame_node_add(file, "step", 1, step, countof(step), materials->limestone);
    const vec2 lower_tiles[] = {{-0.35f, 0}, {2.7f, 0}, {2.7f, lower}, {-0.35f, lower}};
    frame_node_add(file, "lower arcade floor", 1.2f, lower_tiles, countof(lower_tiles), materials->marble);
    const vec2 upper_tiles[] = {{-0.22f, 4.2f}, {2.7f, 4.2f}, {2.7f, upper}, {-0.22f, upper}};
    frame_node_add(file, "upper arcade floor", 1.2f, upper_tiles, countof(upper_tiles), materials->marble);

    const vec2 walls[] = {{outer_wall, -0.3f}, {outer_wall + 0.4f, -0.3f}, {outer_wall + 0.4f, 8}, {outer_wall, 8}};
    frame_node_add(file, "outer walls", 2, walls, countof(walls), materials->plaster);
    const vec2 dado[] = {{2.56f, 0.1f}, {2.7f, 0.1f}, {2.7f, 1.1f}, {2.56f, 1.1f}};
    frame_node_add(file, "dado", 1, dado, countof(dado), materials->brick);
    const vec2 dado_cap[] = {{2.54f, 1.08f}, {2.7f, 1.08f},  {2.7f, 1.17f},
                             {2.58f, 1.17f}, {2.53f, 1.14f}, {2.52f, 1.11f}};
    frame_node_add(file, "dado cap", 1, dado_cap, countof(dado_cap), materials->limestone);
    const vec2 skirting[] = {{2.565f, 4.2f}, {2.7f, 4.2f}, {2.7f, 4.56f}, {2.59f, 4.56f}, {2.565f, 4.53f}};
    frame_node_add(file, "skirting", 1, skirting, countof(skirting), materials->limestone);

    // The upper floor slab; its nose is the string course.
    const vec2 slab[] = {{-0.24f, 3.9f}, {-0.24f, 3.98f}, {2.8f, 3.98f},  {2.8f, 4.28f},   {-0.44f, 4.28f},
                         {-0.44f, 4.2f}, {-0.41f, 4.18f}, {-0.4f, 4.13f}, {-0.37f, 4.07f}, {-0.32f, 4.03f},
                         {-0.3f, 4.02f}, {-0.3f, 3.97f},  {-0.27f, 3.94f}};
    frame_node_add(file, "upper floor slab", 1, slab, countof(slab), materials->limestone);
    // The roof slab; its nose is the main cornice.
    const vec2 roof[] = {{-0.24f, 7.6f},   {-0.24f, 7.84f}, {3.1f, 7.84f},   {3.1f, 8.2f},    {-0.78f, 8.2f},
                         {-0.78f, 8.14f},  {-0.76f, 8.12f}, {-0.75f, 8.07f}, {-0.71f, 8.01f}, {-0.65f, 7.98f},
                         {-0.63f, 7.97f},  {-0.63f, 7.89f}, {-0.4f, 7.885f}, {-0.39f, 7.74f}, {-0.37f, 7.7f},
                         {-0.32f, 7.665f}, {-0.29f, 7.66f}, {-0.28f, 7.61f}};
    frame_node_add(file, "roof slab", 1, roof, countof(roof), materials->limestone);
    const vec2 ceiling[] = {{0.2f, 7.76f}, {2.7f, 7.76f}, {2.7f, 7.86f}, {0.2f, 7.86f}};
    frame_node_add(file, "upper ceiling", 1, ceiling, countof(ceiling), materials->wood);

    const vec2 bottom_rail[] = {{-0.1f, 4.25f}, {0.1f, 4.25f},  {0.1f, 4.38f},
                                {0.08f, 4.4f},  {-0.08f, 4.4f}, {-0.1f, 4.38f}};
    frame_node_add(file, "bottom rail", 1, bottom_rail, countof(bottom_rail), materials->limestone);
    const vec2 top_rail[] = {{-0.09f, 5.08f}, {0.09f, 5.08f},  {0.1f, 5.12f},  {0.13f, 5.15f},  {0.14f, 5.2f},
                             {0.11f, 5.24f},  {-0.11f, 5.24f}, {-0.14f, 5.2f}, {-0.13f, 5.15f}, {-0.1f, 5.12f}};
    frame_node_add(file, "top rail", 1, top_rail, countof(top_rail), materials->limestone);
}

// ---- Columns and piers.

// Lists `points` times `scale` above `bottom`.
static void lathe_scaled_add(mesh *mesh, const vec2 *points, size_t count, float scale, float bottom, uint32_t segments)
{
    vec2 profile[32];
    assert(count <= countof(profile));
    for (size_t i = 0; i < count; i++)
        profile[i] = (vec2){points[i].x * scale, bottom + points[i].y * scale};
    mesh_lathe_add(mesh, profile, count, segments);
}

// From the floor at 0 to the springing line at `height`.
static void column_add(mesh *mesh, float height, float scale, bool fluted)
{
    const uint32_t segments = fluted ? 18 : 16;
    const vec2 plinth[] = {{0, -0.05f}, {0, 0.1f * scale}, {-0.015f, 0.12f * scale}};
    mesh_block_add(mesh, 0.27f * scale, 0.27f * scale, plinth, countof(plinth));
    static const vec2 base[] = {{0.245f, 0.1f},  {0.265f, 0.135f}, {0.262f, 0.175f}, {0.235f, 0.2f}, {0.215f, 0.22f},
                                {0.22f, 0.245f}, {0.238f, 0.255f}, {0.24f, 0.285f},  {0.2f, 0.31f}};
    lathe_scaled_add(mesh, base, countof(base), scale, 0, segments);

    const float bottom = 0.3f * scale, top = height - 0.4f * scale;
    const float radius_bottom = 0.195f * scale, radius_top = 0.165f * scale;
    if (fluted) {
        mesh_fluted_shaft_add(mesh, radius_bottom, radius_top, bottom, top, 16);
    } else {
        const vec2 shaft[] = {{radius_bottom, bottom},
                              {radius_bottom * 0.985f, bottom + 0.35f * (top - bottom)},
                              {radius_bottom * 0.94f, bottom + 0.7f * (top - bottom)},
                              {radius_top, top}};
        mesh_lathe_add(mesh, shaft, countof(shaft), segments);
    }
    static const vec2 capital[] = {{0.16f, -0.42f},   {0.19f, -0.405f}, {0.19f, -0.38f},
                                   {0.168f, -0.365f}, {0.172f, -0.27f}, {0.19f, -0.245f},
                                   {0.24f, -0.205f},  {0.272f, -0.16f}, {0.28f, -0.13f}};
    lathe_scaled_add(mesh, capital, countof(capital), scale, height, segments);
    const vec2 abacus[] = {{0, height - 0.14f * scale},
                           {0, height - 0.1f * scale},
                           {0.025f, height - 0.06f * scale},
                           {0.04f, height - 0.05f * scale},
                           {0.04f, height + 0.01f}};
    mesh_block_add(mesh, 0.28f * scale, 0.28f * scale, abacus, countof(abacus));
}

// A square pier from below `floor` up to `top`, with a base and an impost at the springing line.
static void pier_add(mesh *mesh, float half_x, float half_z, float floor, float springing, float top)
{
    const vec2 profile[] = {{0.04f, floor - 0.05f},
                            {0.04f, floor + 0.12f},
                            {0.03f, floor + 0.14f},
                            {0.03f, floor + 0.2f},
                            {0, floor + 0.23f},
                            {0, springing - 0.16f},
                            {0.012f, springing - 0.15f},
                            {0.012f, springing - 0.11f},
                            {0.03f, springing - 0.07f},
                            {0.04f, springing - 0.06f},
                            {0.04f, springing + 0.01f},
                            {0, springing + 0.012f},
                            {0, top}};
    mesh_block_add(mesh, half_x, half_z, profile, top > springing + 0.02f ? countof(profile) : countof(profile) - 2);
}

static void supports_add(gltf_file *file, const atrium_materials *materials)
{
    mesh lower_column = {0}, upper_column = {0}, lower_pier = {0}, upper_pier = {0};
    column_add(&lower_column, atrium_lower_springing - atrium_lower_floor, 1, true);
    column_add(&upper_column, atrium_upper_springing - atrium_upper_floor, 0.85f, false);
    pier_add(&lower_pier, 0.3f, 0.3f, atrium_lower_floor, atrium_lower_springing, 4.02f);
    pier_add(&upper_pier, 0.3f, 0.3f, atrium_upper_floor, atrium_upper_springing, 7.9f);
    const gltf_mesh lower = atrium_mesh_add(file, "lower column", &lower_column, materials->limestone);
    const gltf_mesh upper = atrium_mesh_add(file, "upper column", &upper_column, materials->limestone);
    for (atrium_side side = 0; side < SIDE_COUNT; side++)
        for (int i = 1; i < atrium_side_bays(side); i++) {
            const float along = atrium_bay_middle(side, i) - atrium_bay / 2;
            node_add(file, lower, atrium_side_place(side, along, 0, atrium_lower_floor));
            node_add(file, upper, atrium_side_place(side, along, 0, atrium_upper_floor));
        }
    const gltf_mesh lower_corner = atrium_mesh_add(file, "lower pier", &lower_pier, materials->limestone);
    const gltf_mesh upper_corner = atrium_mesh_add(file, "upper pier", &upper_pier, materials->limestone);
    for (int corner = 0; corner < 4; corner++) {
        const vec3 position = {corner % 2 ? atrium_half_x : -atrium_half_x, 0,
                               corner / 2 ? atrium_half_z : -atrium_half_z};
        gltf_node_add(file, lower_corner, position, 0);
        gltf_node_add(file, upper_corner, position, 0);
    }
}

// ---- Arches.

static gltf_mesh arcade_wall_add(gltf_file *file, const char *name, int bays, float springing, float top,
                                 gltf_material material)
{
    mesh wall = {.repeat = 1.6f};
    mesh_arcade_add(&wall, &(mesh_arcade_desc){
                               .bays = (uint32_t)bays,
                               .pitch = atrium_bay,
                               .half_span = arch_radius,
                               .rise = arch_radius,
                               .springing = springing,
                               .top = top,
                               .half_thickness = wall_half_thickness,
                               .segments = 24,
                           });
    return atrium_mesh_add(file, name, &wall, material);
}

static void arches_add(gltf_file *file, const atrium_materials *materials)
{
    const gltf_mesh walls[2][2] = {
        {arcade_wall_add(file, "lower long arcade", 6, atrium_lower_springing, lower_wall_top, materials->ashlar),
         arcade_wall_add(file, "lower short arcade", 4, atrium_lower_springing, lower_wall_top, materials->ashlar)},
        {arcade_wall_add(file, "upper long arcade", 6, atrium_upper_springing, upper_wall_top, materials->ashlar),
         arcade_wall_add(file, "upper short arcade", 4, atrium_upper_springing, upper_wall_top, materials->ashlar)},
    };
    // Springs at 0. The keystone tapers towards the arch's middle.
    mesh archivolt = {0};
    const float face = wall_half_thickness;
    const vec2 ring[] = {{0.015f, face - 0.03f},
                         {0.235f, face - 0.03f},
                         {0.235f, face + 0.035f},
                         {0.2f, face + 0.05f},
                         {0.015f, face + 0.025f}};
    mesh_archivolt_add(&archivolt, arch_radius, 0, ring, countof(ring), 20);
    const vec2 keystone[] = {{-0.035f, arch_radius - 0.01f}, {0.01f, arch_radius + 0.25f}};
    archivolt.origin = (vec3){0, 0, face};
    mesh_block_add(&archivolt, 0.105f, 0.08f, keystone, countof(keystone));
    const gltf_mesh moulding = atrium_mesh_add(file, "archivolt", &archivolt, materials->limestone);

    for (atrium_side side = 0; side < SIDE_COUNT; side++) {
        const int is_short = side == SIDE_EAST || side == SIDE_WEST;
        node_add(file, walls[0][is_short], atrium_side_place(side, 0, 0, 0));
        node_add(file, walls[1][is_short], atrium_side_place(side, 0, 0, 0));
        for (int bay = 0; bay < atrium_side_bays(side); bay++) {
            const float along = atrium_bay_middle(side, bay);
            node_add(file, moulding, atrium_side_place(side, along, 0, atrium_lower_springing));
            node_add(file, moulding, atrium_side_place(side, along, 0, atrium_upper_springing));
        }
    }
}

// ---- Ceilings of the arcades: groin vaults between transverse bands below, wooden beams above.

static void band_add(gltf_file *file, gltf_mesh band, gltf_mesh pilaster, atrium_side side, float along)
{
    atrium_place across = atrium_side_place(side, along, passage_middle, 0);
    across.yaw += pi / 2;
    node_add(file, band, across);
    node_add(file, pilaster, atrium_side_place(side, along, outer_wall, 0));
}

static void vaults_add(gltf_file *file, const atrium_materials *materials)
{
    const float half = passage_half + 0.02f, springing = atrium_lower_springing;
    mesh vault = {.repeat = 2}, corner_vault = {.repeat = 2}, band = {.repeat = 1}, pilaster = {0};
    mesh_groin_vault_add(&vault, atrium_bay / 2, half, vault_rise, springing, vault_top, 10);
    mesh_groin_vault_add(&corner_vault, half, half, vault_rise, springing, vault_top, 10);
    mesh_arcade_add(&band, &(mesh_arcade_desc){
                               .bays = 1,
                               .pitch = 2 * passage_half + 0.1f,
                               .half_span = passage_half - 0.08f,
                               .rise = vault_rise - 0.08f,
                               .springing = springing,
                               .top = vault_top,
                               .half_thickness = 0.24f,
                               .segments = 16,
                           });
    pier_add(&pilaster, 0.24f, 0.1f, atrium_lower_floor, springing, springing);

    const gltf_mesh vault_mesh = atrium_mesh_add(file, "vault", &vault, materials->plaster);
    const gltf_mesh corner_mesh = atrium_mesh_add(file, "corner vault", &corner_vault, materials->plaster);
    const gltf_mesh band_mesh = atrium_mesh_add(file, "transverse band", &band, materials->limestone);
    const gltf_mesh pilaster_mesh = atrium_mesh_add(file, "pilaster", &pilaster, materials->limestone);
    for (atrium_side side = 0; side < SIDE_COUNT; side++) {
        const int bays = atrium_side_bays(side);
        for (int bay = 0; bay < bays; bay++) {
            const float along = atrium_bay_middle(side, bay);
            node_add(file, vault_mesh, atrium_side_place(side, along, passage_middle, 0));
            if (bay > 0)
                band_add(file, band_mesh, pilaster_mesh, side, along - atrium_bay / 2);
        }
        // The last bands close the gap between the column line and the corner bay, which is square.
        const float end = (float)bays * atrium_bay / 2 + 0.05f;
        band_add(file, band_mesh, pilaster_mesh, side, -end);
        band_add(file, band_mesh, pilaster_mesh, side, end);
        const bool is_long = side == SIDE_NORTH || side == SIDE_SOUTH;
        if (is_long) {
            node_add(file, corner_mesh, atrium_side_place(side, -atrium_half_x - passage_middle, passage_middle, 0));
            node_add(file, corner_mesh, atrium_side_place(side, atrium_half_x + passage_middle, passage_middle, 0));
        }
    }
}

static void beams_add(gltf_file *file, const atrium_materials *materials)
{
    // Along X, to be turned across the passage.
    mesh beam = {.repeat = 1};
    const float half_length = passage_half + 0.06f;
    mesh_box_add(&beam, (vec3){-half_length, 7.57f, -0.07f}, (vec3){half_length, 7.8f, 0.07f});
    const gltf_mesh beam_mesh = atrium_mesh_add(file, "beam", &beam, materials->wood);
    for (atrium_side side = 0; side < SIDE_COUNT; side++) {
        // The long sides' beams run on into the corners.
        const bool is_long = side == SIDE_NORTH || side == SIDE_SOUTH;
        const int count = is_long ? 32 : 16;
        for (int i = 0; i < count; i++) {
            const float along = ((float)i - 0.5f * (float)(count - 1)) * atrium_bay / 4;
            atrium_place place = atrium_side_place(side, along, passage_middle, 0);
            place.yaw += pi / 2;
            node_add(file, beam_mesh, place);
        }
    }
}

// ---- What repeats in every bay: balusters, dentils, windows; and here and there a door.

static void balustrade_add(gltf_file *file, const atrium_materials *materials)
{
    enum { PER_BAY = 8 };
    mesh baluster = {0};
    static const vec2 profile[] = {{0.062f, -0.01f}, {0.062f, 0.05f}, {0.036f, 0.08f}, {0.066f, 0.2f},
                                   {0.03f, 0.5f},    {0.032f, 0.57f}, {0.055f, 0.6f},  {0.055f, 0.7f}};
    mesh_lathe_add(&baluster, profile, countof(profile), 8);
    const gltf_mesh baluster_mesh = atrium_mesh_add(file, "baluster", &baluster, materials->limestone);
    for (atrium_side side = 0; side < SIDE_COUNT; side++)
        for (int bay = 0; bay < atrium_side_bays(side); bay++)
            for (int i = 0; i < PER_BAY; i++) {
                const float along = atrium_bay_middle(side, bay) + ((float)i - (PER_BAY - 1) / 2.0f) * 0.265f;
                node_add(file, baluster_mesh, atrium_side_place(side, along, 0, 4.4f));
            }
}

static void dentils_add(gltf_file *file, const atrium_materials *materials)
{
    enum { PER_BAY = 9 };
    mesh dentils = {0};
    for (int i = 0; i < PER_BAY; i++) {
        const float x = ((float)i - (PER_BAY - 1) / 2.0f) * atrium_bay / PER_BAY;
        mesh_box_add(&dentils, (vec3){x - 0.065f, 7.76f, 0.3f}, (vec3){x + 0.065f, 7.9f, 0.53f});
    }
    const gltf_mesh dentils_mesh = atrium_mesh_add(file, "dentils", &dentils, materials->limestone);
    for (atrium_side side = 0; side < SIDE_COUNT; side++) {
        for (int bay = 0; bay < atrium_side_bays(side); bay++)
            node_add(file, dentils_mesh, atrium_side_place(side, atrium_bay_middle(side, bay), 0, 0));
    }
}

// A leaf of a door or a shutter, its face towards +Z: a board with raised panels, one above the other.
static void leaf_add(mesh *mesh, float left, float right, float bottom, float top, float face, int panels)
{
    mesh_box_add(mesh, (vec3){left, bottom, -0.1f}, (vec3){right, top, face});
    const float height = (top - bottom) / (float)panels;
    for (int i = 0; i < panels; i++) {
        const float low = bottom + (float)i * height;
        mesh_box_add(mesh, (vec3){left + 0.08f, low + 0.08f, 0},
                     (vec3){right - 0.08f, low + height - 0.08f, face + 0.018f});
    }
}

// A stone surround of an opening: two jambs, a lintel that oversails them, and a sill or threshold.
static void surround_add(mesh *mesh, float half_width, float bottom, float top, float face)
{
    const float outside = half_width + 0.15f;
    mesh_box_add(mesh, (vec3){-outside, bottom, -0.1f}, (vec3){-half_width, top + 0.02f, face});
    mesh_box_add(mesh, (vec3){half_width, bottom, -0.1f}, (vec3){outside, top + 0.02f, face});
    mesh_box_add(mesh, (vec3){-outside - 0.03f, top, -0.1f}, (vec3){outside + 0.03f, top + 0.17f, face + 0.015f});
    mesh_box_add(mesh, (vec3){-outside - 0.07f, top + 0.15f, -0.1f},
                 (vec3){outside + 0.07f, top + 0.22f, face + 0.05f});
    mesh_box_add(mesh, (vec3){-outside - 0.05f, bottom - 0.08f, -0.1f},
                 (vec3){outside + 0.05f, bottom + 0.02f, face + 0.04f});
}

static void openings_add(gltf_file *file, const atrium_materials *materials)
{
    mesh door = {.repeat = 1, .grain_up = true}, door_stone = {0}, window = {.repeat = 1, .grain_up = true},
         window_stone = {0};
    leaf_add(&door, -0.6f, -0.004f, 0.1f, 2.3f, 0.09f, 3);
    leaf_add(&door, 0.004f, 0.6f, 0.1f, 2.3f, 0.09f, 3);
    surround_add(&door_stone, 0.59f, 0.17f, 2.29f, 0.15f);
    leaf_add(&window, -0.5f, -0.004f, 5.15f, 6.75f, 0.05f, 2);
    leaf_add(&window, 0.004f, 0.5f, 5.15f, 6.75f, 0.05f, 2);
    surround_add(&window_stone, 0.49f, 5.16f, 6.74f, 0.09f);
    const gltf_mesh door_leaves = atrium_mesh_add(file, "door", &door, materials->wood);
    const gltf_mesh door_frame = atrium_mesh_add(file, "door surround", &door_stone, materials->limestone);
    const gltf_mesh shutters = atrium_mesh_add(file, "shutters", &window, materials->wood);
    const gltf_mesh window_frame = atrium_mesh_add(file, "window surround", &window_stone, materials->limestone);

    for (atrium_side side = 0; side < SIDE_COUNT; side++)
        for (int bay = 0; bay < atrium_side_bays(side); bay++) {
            const atrium_place place = atrium_side_place(side, atrium_bay_middle(side, bay), outer_wall, 0);
            node_add(file, shutters, place);
            node_add(file, window_frame, place);
            if (bay % 3 == 1) {
                node_add(file, door_leaves, place);
                node_add(file, door_frame, place);
            }
        }
}

static void views_add(gltf_file *file)
{
    const float degrees = pi / 180, aspect = 16.0f / 9.0f;
    gltf_camera_add(file, "court", (vec3){-8.15f, 1.65f, 4.3f}, (vec3){0, 2.15f, -1.2f}, 57 * degrees, aspect);
    gltf_camera_add(file, "gallery", (vec3){6.5f, 6, 4.85f}, (vec3){-2.5f, 1.8f, -2.4f}, 60 * degrees, aspect);
    gltf_camera_add(file, "arcade", (vec3){-4.2f, 1.6f, 6.9f}, (vec3){1.2f, 1.9f, 5.7f}, 60 * degrees, aspect);
    gltf_sun_add(file, "sun", (vec3){0.4f, 1, 0.52f}, (vec3){1, 0.93f, 0.82f}, 100);
}

void atrium_add(gltf_file *file, bool clear_court)
{
    const atrium_materials materials = materials_add(file);
    shell_add(file, &materials);
    supports_add(file, &materials);
    arches_add(file, &materials);
    vaults_add(file, &materials);
    beams_add(file, &materials);
    balustrade_add(file, &materials);
    dentils_add(file, &materials);
    openings_add(file, &materials);
    atrium_furnish(file, &materials, clear_court);
}

void atrium_build(gltf_file *file)
{
    atrium_add(file, false);
    views_add(file);
}
