// A scene as plain data, read from glTF 2.0: what every other module draws, traces and lights. No GPU here.
#pragma once

#include "engine/base.h"
#include "shaders/shared.h"

#include <stdio.h>

typedef struct scene_node {
    const char *name;
    uint32_t parent; // index, SCENE_NONE for a root; parents come before their children
    // Local transform: glTF's matrix, or translation * rotation * scale when `has_trs`.
    float matrix[16]; // column-major, always valid
    bool has_trs;
    float translation[3], rotation[4], scale[3]; // rotation: unit quaternion x y z w
    uint32_t mesh, camera, light; // SCENE_NONE: none
    float world[16];
} scene_node;
enum { SCENE_NONE = UINT32_MAX };

typedef struct scene_mesh {
    const char *name;
    uint32_t first_primitive, primitive_count;
} scene_mesh;

typedef struct scene_image {
    const char *name;
    uint32_t width, height;
    uint8_t *texels; // RGBA8
} scene_image;

typedef struct scene_texture { // what a material's texture_reference.texture counts in
    uint32_t image;
    bool srgb; // base colour and emission; linear otherwise
    // glTF's sampler enums (9728 NEAREST, 10497 REPEAT, ...); 0: the default
    int mag_filter, min_filter, wrap_s, wrap_t;
} scene_texture;

typedef struct scene_light { // KHR_lights_punctual; the node gives position and direction (-z)
    const char *name;
    uint32_t type; // LIGHT_*
    float color[3]; // linear, times intensity: candela, or lux for directional
    float inner_cone, outer_cone; // radians
} scene_light;

typedef struct scene_camera {
    const char *name; // the node's name when the camera itself has none
    uint32_t node;
    float yfov; // radians, vertical; orthographic cameras are read as a perspective one with a warning
    float near_plane;
} scene_camera;

typedef struct scene_data {
    const char *path;
    scene_node *nodes;
    uint32_t node_count;
    scene_mesh *meshes;
    uint32_t mesh_count;
    mesh_primitive *primitives;
    uint32_t primitive_count;
    float (*positions)[3];
    vertex_attributes *attributes;
    uint32_t vertex_count;
    uint32_t *indices; // relative to the primitive's first_vertex
    uint32_t index_count;
    material *materials; // the last one is glTF's default material
    const char **material_names;
    uint32_t material_count;
    scene_image *images;
    uint32_t image_count;
    scene_texture *textures;
    uint32_t texture_count;
    scene_light *lights;
    uint32_t light_count;
    scene_camera *cameras;
    uint32_t camera_count;
    uint32_t animation_count, skin_count; // counted; not played yet
    uint64_t instanced_triangles; // over all nodes
    float bounds_min[3], bounds_max[3]; // world, over all nodes' meshes; both 0 when there is no geometry;
                                        // transformed boxes, so larger than need be where nodes are rotated
    char **warnings; // also logged when loading
    uint32_t warning_count;
    struct arena arena; // owns everything above but the images' texels
} scene_data;

// Reads a .gltf or .glb with all it refers to. What is broken but can be left out (zero-area triangles, optional
// extensions, points and lines) is a warning; a file that lies (index past its buffer, cycle in the node tree,
// positions that are not finite, ...) or lacks something (a buffer, an image that a material uses, an extension that it
// requires) is refused: NULL, and one logged line naming file and thing. The primitives of a mesh may change their
// order.
scene_data *scene_load(const char *path);
void scene_destroy(scene_data *scene); // accepts NULL

// A part of what scene_load does, for tests and for meshes made at run time: orders triangles by recursive median split
// (halves of n/2, axis by the surface area heuristic), so that drivers that build BVHs by halving the list as given
// build good ones. O(n log n); the same on every machine.
void scene_primitive_reorder(uint32_t *indices, uint32_t index_count, const float (*positions)[3]);

// What `lanternfield info` prints.
void scene_print_info(const scene_data *scene, FILE *out);

// Index of the first camera named `name`, or SCENE_NONE.
uint32_t scene_camera_find(const scene_data *scene, const char *name);
