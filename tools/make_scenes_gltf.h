// Writes binary glTF 2.0: meshes, materials with embedded PNG textures, nodes, skins, animations, cameras and
// KHR_lights_punctual lights.
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
typedef struct gltf_node {
    uint32_t id;
} gltf_node;
typedef struct gltf_light {
    uint32_t id;
} gltf_light;
typedef struct gltf_skin {
    uint32_t id;
} gltf_skin;
typedef struct gltf_clip {
    uint32_t id;
} gltf_clip;
typedef struct gltf_times {
    uint32_t id;
} gltf_times;
typedef struct gltf_sampler {
    uint32_t clip, id;
} gltf_sampler;

typedef struct quat { // a rotation: unit, w = cos(angle / 2); all 0 where a desc says so: none
    float x, y, z, w;
} quat;

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

// Marks a mesh as a control cage by its extras: {"lanternfield_subdivision": {"scheme": "catmark", "max_level": N}}.
// Quads are to be written as pairs of triangles, (a, b, c) and (a, c, d).
void gltf_mesh_subdivide(gltf_file *file, gltf_mesh mesh, uint32_t max_level);

typedef struct gltf_influences { // of a vertex: JOINTS_0 and WEIGHTS_0
    uint8_t joints[4]; // index into the skin's joints; 0 where the weight is
    float weights[4]; // sum 1
} gltf_influences;
// Makes all meshes of this geometry that are added later skinned ones. As many influences as it has vertices.
void gltf_geometry_influences_add(gltf_file *file, gltf_geometry geometry, const gltf_influences *influences,
                                  size_t count);

typedef struct gltf_node_desc {
    const char *name; // NULL: none
    gltf_node parent; // {0}: a root of the scene
    vec3 translation;
    quat rotation; // all 0: none
    float scale; // 0 means 1
    gltf_mesh mesh; // {0}: none
    gltf_skin skin; // {0}: none
    gltf_light light; // {0}: none
} gltf_node_desc;
// A point light that any number of nodes may carry.
gltf_light gltf_light_add(gltf_file *file, const char *name, vec3 color, float candela);
gltf_node gltf_node_create(gltf_file *file, const gltf_node_desc *desc);

// `inverse_bind`, column-major, brings a point from mesh space to the joint's.
gltf_skin gltf_skin_add(gltf_file *file, const char *name, const gltf_node *joints, const float (*inverse_bind)[16],
                        size_t count);

// ---- Animation. A sampler may drive several nodes, times may serve several samplers and clips.

typedef enum gltf_interpolation { GLTF_LINEAR, GLTF_STEP, GLTF_CUBIC } gltf_interpolation;
typedef enum gltf_path { GLTF_TRANSLATION, GLTF_ROTATION, GLTF_SCALE } gltf_path;

gltf_clip gltf_clip_add(gltf_file *file, const char *name);
// Seconds, strictly increasing, from 0.
gltf_times gltf_times_add(gltf_file *file, const float *seconds, size_t count);
// `values`: for each time 3 floats, or 4 of a rotation; three times as many where cubic: in-tangent, value,
// out-tangent.
gltf_sampler gltf_sampler_add(gltf_file *file, gltf_clip clip, gltf_path path, gltf_interpolation interpolation,
                              gltf_times times, const float *values);
void gltf_channel_add(gltf_file *file, gltf_sampler sampler, gltf_node node, gltf_path path);

// An instance of a mesh: turned about +Y, then moved.
void gltf_node_add(gltf_file *file, gltf_mesh mesh, vec3 position, float yaw);
// `yfov` is the full vertical angle of view in radians. The first camera is the default one.
void gltf_camera_add(gltf_file *file, const char *name, vec3 eye, vec3 target, float yfov, float aspect);
void gltf_point_light_add(gltf_file *file, const char *name, vec3 position, vec3 color, float candela);
// The rotation of a node whose -Z, where cameras and lights look, points along `forward`, without roll.
quat gltf_look(vec3 forward);
// `towards_sun` need not be normalised.
gltf_node gltf_sun_add(gltf_file *file, const char *name, vec3 towards_sun, vec3 color, float lux);

size_t gltf_triangle_count(const gltf_file *file); // over all nodes
