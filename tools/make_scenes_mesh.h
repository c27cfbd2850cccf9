// Triangle meshes as recipes: boxes, mouldings, turned solids, arches, vaults and draped sheets. Metres, +Y up.
//
// Every solid is closed and faces outwards, counter-clockwise; its builder asserts so. Texture coordinates are
// physical: metres along the surface over `repeat`, never mirrored, V pointing down as in glTF.
#pragma once

#include "engine/base.h"

typedef struct vec2 {
    float x, y;
} vec2;
typedef struct vec3 {
    float x, y, z;
} vec3;

static inline vec3 vec3_add(vec3 a, vec3 b)
{
    return (vec3){a.x + b.x, a.y + b.y, a.z + b.z};
}
static inline vec3 vec3_sub(vec3 a, vec3 b)
{
    return (vec3){a.x - b.x, a.y - b.y, a.z - b.z};
}
static inline vec3 vec3_scale(vec3 a, float s)
{
    return (vec3){a.x * s, a.y * s, a.z * s};
}
static inline float vec3_dot(vec3 a, vec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
vec3 vec3_cross(vec3 a, vec3 b);
vec3 vec3_normalize(vec3 a);
// Turns about +Y: a quarter turn brings +Z to +X.
vec3 vec3_yaw(vec3 a, float radians);

// A fixed pseudo-random sequence (PCG32): the same seed gives the same scene. Uniform in [low, high).
typedef struct random_sequence {
    uint64_t state;
} random_sequence;
float random_uniform(random_sequence *sequence, float low, float high);

typedef struct mesh_vertex {
    vec3 position, normal;
    vec2 uv;
} mesh_vertex;

// Zero-initialise to use.
typedef struct mesh {
    mesh_vertex *vertices;
    size_t vertex_count, vertex_capacity;
    uint32_t *indices;
    size_t index_count, index_capacity;
    float repeat; // metres that one repeat of the texture covers; 0 means 1
    bool grain_up; // swaps U and V on flat faces, for wood whose grain stands upright
    // Where the next shape goes: its coordinates are turned by `yaw` radians, then moved to `origin`.
    vec3 origin;
    float yaw;
} mesh;
void mesh_fini(mesh *mesh);

uint32_t mesh_vertex_add(mesh *mesh, vec3 position, vec3 normal, vec2 uv);
void mesh_triangle_add(mesh *mesh, uint32_t a, uint32_t b, uint32_t c);
// Flat, counter-clockwise seen from its front.
void mesh_quad_add(mesh *mesh, vec3 a, vec3 b, vec3 c, vec3 d);

void mesh_box_add(mesh *mesh, vec3 low, vec3 high);

// Profiles are points (outward, up) listed counter-clockwise: up along the outside, outward along the underside.
// Neighbouring pieces that turn by less than about 40 degrees are shaded as one curve.

// A turned solid about +Y; outward is the radius. It ends on the axis or is closed by flat discs.
void mesh_lathe_add(mesh *mesh, const vec2 *profile, size_t count, uint32_t segments);
// The mantle of a fluted shaft, open at both ends, which are to be sunk into base and capital; swells a little on its
// way up.
void mesh_fluted_shaft_add(mesh *mesh, float radius_bottom, float radius_top, float bottom, float top, uint32_t flutes);
// A block of half extents (half_x, half_z) whose sides follow an open profile (outward 0 is the extent itself).
void mesh_block_add(mesh *mesh, float half_x, float half_z, const vec2 *profile, size_t count);
// A ring with mitred corners: a closed profile swept around that rectangle.
void mesh_frame_add(mesh *mesh, float half_x, float half_z, const vec2 *profile, size_t count);

// A wall along X, centred on the origin, pierced by half-elliptical arches; it reaches from the springing line upwards.
typedef struct mesh_arcade_desc {
    uint32_t bays;
    float pitch; // metres from arch to arch; the wall is bays * pitch long
    float half_span, rise; // semi-axes of the arch
    float springing, top; // heights
    float half_thickness; // along Z
    uint32_t segments; // per arch
} mesh_arcade_desc;
void mesh_arcade_add(mesh *mesh, const mesh_arcade_desc *desc);
// A half ring in the XY plane: a closed convex profile (outward from `radius`, along Z) swept over the arch.
void mesh_archivolt_add(mesh *mesh, float radius, float springing, const vec2 *profile, size_t count,
                        uint32_t segments);
// The mass over a groin vault: two half-elliptical barrels crossing at a crown `rise` above the springing line, cut out
// of a block that reaches up to `top`.
void mesh_groin_vault_add(mesh *mesh, float half_x, float half_z, float rise, float springing, float top,
                          uint32_t segments);

// An open sheet: `position(s, t)` for s, t in [0, 1], s to the right and t downwards as seen from its front, smooth a
// little beyond its edges too. Texture coordinates run from `uv_low` to `uv_high`.
typedef vec3 (*mesh_sheet_position)(float s, float t, const void *user);
void mesh_sheet_add(mesh *mesh, uint32_t columns, uint32_t rows, vec2 uv_low, vec2 uv_high,
                    mesh_sheet_position position, const void *user);
