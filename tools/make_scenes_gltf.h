// Writes binary glTF 2.0: meshes, materials with embedded PNG textures, nodes, cameras and KHR_lights_punctual lights.
#pragma once

#include "tools/make_scenes_mesh.h"

typedef struct gltf_file gltf_file;
gltf_file *gltf_create(void);
void gltf_destroy(gltf_file *file); // accepts NULL
// Returns false and logs when the file cannot be written. The same calls give the same bytes.
bool gltf_write(gltf_file *file, const char *path);

// {0} is none.
typedef struct gltf_texture {
    uint32_t id;
} gltf_texture;
typedef struct gltf_material {
    uint32_t id;
} gltf_material;
typedef struct gltf_geometry {
    uint32_t id;
} gltf_geometry;
typedef struct gltf_mesh {
    uint32_t id;
} gltf_mesh;

// Copies the PNG.
gltf_texture gltf_texture_add(gltf_file *file, const char *name, const void *png, size_t size);

// A dielectric, metallic-roughness with metallicFactor 0.
typedef struct gltf_material_desc {
    const char *name;
    vec3 albedo; // linear, multiplies the texture; 0 means white
    float roughness; // 0 means 1
    gltf_texture texture; // sRGB
    gltf_texture normals;
    bool alpha_mask; // cuts where the texture's alpha is under a half
    bool double_sided;
} gltf_material_desc;
gltf_material gltf_material_add(gltf_file *file, const gltf_material_desc *desc);

// Copies the triangles. Two meshes may share one geometry.
gltf_geometry gltf_geometry_add(gltf_file *file, const mesh *mesh);
gltf_mesh gltf_mesh_add(gltf_file *file, const char *name, gltf_geometry geometry, gltf_material material);

// An instance of a mesh: turned about +Y, then moved.
void gltf_node_add(gltf_file *file, gltf_mesh mesh, vec3 position, float yaw);
// `yfov` is the full vertical angle of view in radians. The first camera is the default one.
void gltf_camera_add(gltf_file *file, const char *name, vec3 eye, vec3 target, float yfov, float aspect);
void gltf_point_light_add(gltf_file *file, const char *name, vec3 position, vec3 color, float candela);
// `towards_sun` need not be normalised.
void gltf_sun_add(gltf_file *file, const char *name, vec3 towards_sun, vec3 color, float lux);

size_t gltf_triangle_count(const gltf_file *file); // over all nodes
