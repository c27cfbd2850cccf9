// The atrium, the show piece: a two-storey court with arcades, sunlit through its open roof.
#pragma once

#include "tools/make_scenes_gltf.h"

void atrium_build(gltf_file *file);
// Building and furniture without sun and cameras. A clear court has no fountain, benches and palms in the way.
void atrium_add(gltf_file *file, bool clear_court);
// Dancers in its cleared court under a moving sun (make_scenes_dancers.c).
void dancers_build(gltf_file *file);

// ---- Shared by the building and its furniture.

// Every material that the atrium needs. Textured ones are meant for the repeat that make_scenes_texture.h gives.
typedef struct atrium_materials {
    gltf_material ashlar, brick, limestone, plaster, paving, marble, wood, cloth_red, cloth_ochre, cloth_blue, leaves,
        terracotta, soil, water;
} atrium_materials;

// The columns' axes stand on a rectangle of 6 x 4 bays around the origin, the long sides along X.
static const float atrium_bay = 2.6f, atrium_half_x = 7.8f, atrium_half_z = 5.2f;
// Floors of the court, of the lower and of the upper arcade.
static const float atrium_court_floor = 0, atrium_lower_floor = 0.15f, atrium_upper_floor = 4.3f;
static const float atrium_lower_springing = 2.65f, atrium_upper_springing = 6.45f;

typedef enum atrium_side { SIDE_NORTH, SIDE_EAST, SIDE_SOUTH, SIDE_WEST, SIDE_COUNT } atrium_side;
static inline int atrium_side_bays(atrium_side side)
{
    return side == SIDE_NORTH || side == SIDE_SOUTH ? 6 : 4;
}
// Metres along a side to the middle of a bay.
static inline float atrium_bay_middle(atrium_side side, int bay)
{
    return ((float)bay - 0.5f * (float)(atrium_side_bays(side) - 1)) * atrium_bay;
}

// A place on a side: `along` it from its middle, `outward` from the columns' axis. Turned so that +Z faces the court.
typedef struct atrium_place {
    vec3 position; // on the height given
    float yaw;
} atrium_place;
atrium_place atrium_side_place(atrium_side side, float along, float outward, float height);

// Adds a mesh made of one geometry and releases the triangles.
gltf_mesh atrium_mesh_add(gltf_file *file, const char *name, mesh *mesh, gltf_material material);

// Cloth, plants, pots, fountain and benches (make_scenes_furniture.c).
void atrium_furnish(gltf_file *file, const atrium_materials *materials, bool clear_court);
