// make_scenes DIR: writes the scenes of our own as binary glTF, by the table at the end.
// Metres, candela and lux; the same program gives the same bytes.
#include "tools/make_scenes_atrium.h"
#include "tools/make_scenes_lanterns.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

static const float pi = 3.14159265358979f;

static void solid_add(gltf_file *file, const char *name, mesh *solid, gltf_material material, vec3 position, float yaw)
{
    const gltf_mesh added = gltf_mesh_add(file, name, gltf_geometry_add(file, solid), material);
    mesh_fini(solid);
    gltf_node_add(file, added, position, yaw);
}

// The Cornell box at a hundredth of its scale, 5.5 m wide, open towards +Z, with a lamp instead of its glowing panel.
static void cornell_build(gltf_file *file)
{
    const gltf_material white =
        gltf_material_add(file, &(gltf_material_desc){"white", .albedo = {0.73f, 0.71f, 0.68f}});
    const gltf_material red = gltf_material_add(file, &(gltf_material_desc){"red", .albedo = {0.61f, 0.06f, 0.05f}});
    const gltf_material green =
        gltf_material_add(file, &(gltf_material_desc){"green", .albedo = {0.12f, 0.44f, 0.10f}});

    // Walls 20 cm thick, set into floor and ceiling so that no faces coincide.
    const float half = 2.75f, height = 5.5f, wall = 0.2f;
    mesh shell = {0}, left = {0}, right = {0}, low_block = {0}, tall_block = {0};
    mesh_box_add(&shell, (vec3){-half - 0.3f, -wall, -half - 0.3f}, (vec3){half + 0.3f, 0, half});
    mesh_box_add(&shell, (vec3){-half - 0.3f, height, -half - 0.3f}, (vec3){half + 0.3f, height + wall, half});
    mesh_box_add(&shell, (vec3){-half - 0.1f, -0.1f, -half - wall}, (vec3){half + 0.1f, height + 0.1f, -half});
    mesh_box_add(&left, (vec3){-half - wall, -0.1f, -half - 0.1f}, (vec3){-half, height + 0.1f, half - 0.01f});
    mesh_box_add(&right, (vec3){half, -0.1f, -half - 0.1f}, (vec3){half + wall, height + 0.1f, half - 0.01f});
    mesh_box_add(&low_block, (vec3){-0.82f, -0.05f, -0.82f}, (vec3){0.82f, 1.65f, 0.82f});
    mesh_box_add(&tall_block, (vec3){-0.82f, -0.05f, -0.82f}, (vec3){0.82f, 3.3f, 0.82f});
    solid_add(file, "shell", &shell, white, (vec3){0}, 0);
    solid_add(file, "left wall", &left, red, (vec3){0}, 0);
    solid_add(file, "right wall", &right, green, (vec3){0}, 0);
    solid_add(file, "low block", &low_block, white, (vec3){0.92f, 0, 1.06f}, -17 * pi / 180);
    solid_add(file, "tall block", &tall_block, white, (vec3){-0.93f, 0, -0.76f}, 17 * pi / 180);

    gltf_point_light_add(file, "lamp", (vec3){0, 4.8f, 0}, (vec3){1, 0.78f, 0.52f}, 300);
    gltf_camera_add(file, "cornell", (vec3){0, height / 2, 10.6f}, (vec3){0, height / 2, 0}, 40 * pi / 180, 1);
}

typedef struct rooms_materials {
    gltf_material white, orange, blue;
} rooms_materials;

static rooms_materials rooms_materials_add(gltf_file *file)
{
    return (rooms_materials){
        .white = gltf_material_add(file, &(gltf_material_desc){"white", .albedo = {0.7f, 0.7f, 0.7f}}),
        .orange = gltf_material_add(file, &(gltf_material_desc){"orange", .albedo = {0.7f, 0.35f, 0.12f}}),
        .blue = gltf_material_add(file, &(gltf_material_desc){"blue", .albedo = {0.15f, 0.3f, 0.6f}}),
    };
}

// Two equal closed rooms of 4 x 3 x 4 m, without the wall of 2 * `shared` m between them. Walls stand in floor and
// ceiling, and in each other, so that no faces coincide.
static void rooms_shell_add(gltf_file *file, gltf_material white, float shared)
{
    const float outer = 4 + shared;
    mesh shell = {0};
    mesh_box_add(&shell, (vec3){-outer - 0.3f, -0.2f, -2.3f}, (vec3){outer + 0.3f, 0, 2.3f});
    mesh_box_add(&shell, (vec3){-outer - 0.3f, 3, -2.3f}, (vec3){outer + 0.3f, 3.2f, 2.3f});
    mesh_box_add(&shell, (vec3){-outer - 0.25f, -0.1f, -2.2f}, (vec3){outer + 0.25f, 3.1f, -2});
    mesh_box_add(&shell, (vec3){-outer - 0.25f, -0.1f, 2}, (vec3){outer + 0.25f, 3.1f, 2.2f});
    mesh_box_add(&shell, (vec3){-outer - 0.2f, -0.05f, -2.1f}, (vec3){-outer, 3.05f, 2.1f});
    mesh_box_add(&shell, (vec3){outer, -0.05f, -2.1f}, (vec3){outer + 0.2f, 3.05f, 2.1f});
    solid_add(file, "shell", &shell, white, (vec3){0}, 0);
}

// The things in both rooms, the lamp in the left one, and a camera in each.
static void rooms_furnish(gltf_file *file, const rooms_materials *materials, float shared)
{
    mesh crate = {0}, table = {0}, post = {0};
    mesh_box_add(&crate, (vec3){-0.4f, -0.01f, -0.4f}, (vec3){0.4f, 0.8f, 0.4f});
    mesh_box_add(&table, (vec3){-0.6f, 0.7f, -0.35f}, (vec3){0.6f, 0.76f, 0.35f});
    for (int leg = 0; leg < 4; leg++) {
        const float x = leg % 2 ? 0.5f : -0.5f, z = leg / 2 ? 0.27f : -0.27f;
        mesh_box_add(&table, (vec3){x - 0.04f, -0.01f, z - 0.04f}, (vec3){x + 0.04f, 0.71f, z + 0.04f});
    }
    mesh_box_add(&post, (vec3){-0.15f, -0.05f, -0.15f}, (vec3){0.15f, 3.05f, 0.15f});
    const gltf_mesh things[] = {
        gltf_mesh_add(file, "crate", gltf_geometry_add(file, &crate), materials->orange),
        gltf_mesh_add(file, "table", gltf_geometry_add(file, &table), materials->blue),
        gltf_mesh_add(file, "post", gltf_geometry_add(file, &post), materials->white),
    };
    mesh_fini(&crate);
    mesh_fini(&table);
    mesh_fini(&post);
    for (int room = -1; room <= 1; room += 2) {
        const float middle = (float)room * (2 + shared);
        gltf_node_add(file, things[0], (vec3){middle + 0.9f, 0, -1.1f}, 0.4f);
        gltf_node_add(file, things[1], (vec3){middle - 0.7f, 0, -0.3f}, -0.3f);
        gltf_node_add(file, things[2], (vec3){middle + 1.2f, 0, 0.8f}, 0);
    }
    gltf_point_light_add(file, "lamp", (vec3){-2 - shared, 2.6f, 0.2f}, (vec3){1, 0.9f, 0.75f}, 100);
    const float degrees = pi / 180, aspect = 16.0f / 9.0f;
    gltf_camera_add(file, "lit", (vec3){-3.7f, 1.7f, 1.75f}, (vec3){-1.2f, 1.2f, -0.9f}, 65 * degrees, aspect);
    gltf_camera_add(file, "unlit", (vec3){0.3f, 1.7f, 1.75f}, (vec3){2.8f, 1.2f, -0.9f}, 65 * degrees, aspect);
}

// The rooms share a wall of 1 cm; whatever light the right one shows has leaked.
static void two_rooms_build(gltf_file *file)
{
    const rooms_materials materials = rooms_materials_add(file);
    const float shared = 0.005f;
    mesh thin = {0};
    mesh_box_add(&thin, (vec3){-shared, -0.05f, -2.05f}, (vec3){shared, 3.05f, 2.05f});
    rooms_shell_add(file, materials.white, shared);
    solid_add(file, "shared wall", &thin, materials.white, (vec3){0}, 0);
    rooms_furnish(file, &materials, shared);
}

// The rooms share a wall of 10 cm with a doorway of 1 x 2.1 m. The door is closed, larger than the doorway all around,
// and lies on the wall in the right room; turned about +Y it swings into that room.
static void door_build(gltf_file *file)
{
    const rooms_materials materials = rooms_materials_add(file);
    const float shared = 0.05f, half_width = 0.5f, height = 2.1f, overlap = 0.05f;
    mesh wall = {0}, door = {0};
    mesh_box_add(&wall, (vec3){-shared, -0.05f, -2.05f}, (vec3){shared, 3.05f, -half_width});
    mesh_box_add(&wall, (vec3){-shared, -0.05f, half_width}, (vec3){shared, 3.05f, 2.05f});
    mesh_box_add(&wall, (vec3){-shared + 0.001f, height, -half_width - 0.01f},
                 (vec3){shared - 0.001f, 3.05f, half_width + 0.01f});
    mesh_box_add(&door, (vec3){-0.003f, -0.01f, 0}, (vec3){0.04f, height + overlap, 2 * (half_width + overlap)});
    rooms_shell_add(file, materials.white, shared);
    solid_add(file, "shared wall", &wall, materials.white, (vec3){0}, 0);
    solid_add(file, "door", &door, materials.orange, (vec3){shared, 0, -half_width - overlap}, 0);
    rooms_furnish(file, &materials, shared);
}

static bool scene_write(const char *folder, const char *name, void (*build)(gltf_file *file))
{
    arena strings = {0};
    gltf_file *file = gltf_create();
    build(file);
    const char *path = arena_printf(&strings, "%s/%s", folder, name);
    const bool written = gltf_write(file, path);
    if (written)
        log_info("%s: %zu triangles", path, gltf_triangle_count(file));
    gltf_destroy(file);
    arena_fini(&strings);
    return written;
}

static const struct {
    const char *name;
    void (*build)(gltf_file *file);
} scenes[] = {
    {"cornell.glb", cornell_build}, {"two_rooms.glb", two_rooms_build}, {"door.glb", door_build},
    {"atrium.glb", atrium_build},   {"lanterns.glb", lanterns_build},   {"lanterns_500.glb", lanterns_500_build},
    {"dancers.glb", dancers_build},
};

int main(int argc, char **argv)
{
    if (argc != 2) {
        log_error("usage: make_scenes DIR");
        return 1;
    }
    const char *folder = argv[1];
    if (mkdir(folder, 0777) != 0 && errno != EEXIST) {
        log_error("%s: cannot make the folder: %s", folder, strerror(errno));
        return 1;
    }
    for (size_t i = 0; i < countof(scenes); i++)
        if (!scene_write(folder, scenes[i].name, scenes[i].build))
            return 1;
    return 0;
}
