// A scene as plain data, read from glTF 2.0: what every other module draws, traces and lights. No GPU here.
#pragma once

#include "engine/base.h"
#include "shaders/shared.h"
#include "subdivision.h"

#include <stdio.h>

typedef struct scene_node {
    const char *name;
    uint32_t parent; // index, SCENE_NONE for a root; parents come before their children
    // Local transform: glTF's matrix, or translation * rotation * scale when `has_trs`.
    float matrix[16]; // column-major, always valid
    bool has_trs;
    float translation[3], rotation[4], scale[3]; // rotation: unit quaternion x y z w
    uint32_t mesh, camera, light; // SCENE_NONE: none
    uint32_t skin; // SCENE_NONE: none; with one, the node's own transform does not move its mesh
    float world[16];
} scene_node;
enum { SCENE_NONE = UINT32_MAX };

typedef struct scene_mesh {
    const char *name;
    uint32_t first_primitive, primitive_count;
    uint32_t deformation; // SCENE_NONE: its vertices never change
    const struct scene_subdivision_rules *subdivision_rules; // NULL: it is drawn as it is
} scene_mesh;

// ---- Subdivision. A mesh is a control cage where its glTF `extras` say so:
//
//     "extras": {"lanternfield_subdivision": {
//         "scheme": "catmark",         or "loop"
//         "max_level": 3,              1 to 5; the default is 3
//         "boundary": "edge",          or "edge_and_corner", the default
//         "creases": [[0, 1, 10.0]]    edges by two indices into POSITION of the mesh's first primitive; sharpness
//     }}                               0 (smooth) to 10 (sharp for ever)
//
// Vertices at the same position are one vertex of the cage, over all primitives; their texture coordinates and colours
// become face-varying, their normals and tangents are not used. In a catmark cage two triangles that follow each other
// in a primitive are one quad when they share an edge, position and texture coordinates alike, their normals are at
// most 30 degrees apart and the quad is convex seen along their mean. What is wrong with the extras or the cage (an
// edge with three faces, a triangle without area, ...) is a warning that names the mesh, which is then drawn as it is.

typedef struct scene_crease {
    float ends[2][3]; // positions
    float sharpness;
} scene_crease;

typedef struct scene_subdivision_rules { // what the extras say
    subdivision_scheme scheme;
    subdivision_boundary boundary;
    uint32_t max_level;
    const scene_crease *creases;
    uint32_t crease_count;
} scene_subdivision_rules;

typedef struct scene_subdivision_level {
    uint32_t mesh; // refined, with primitives, vertices and indices of its own; no node of the scene has it
    uint32_t first_vertex, vertex_count; // of all its primitives, one after the other
    const subdivision_vertex *vertices; // [vertex_count]
} scene_subdivision_level;

typedef struct scene_subdivision { // a mesh that may be drawn as one of its levels instead
    uint32_t mesh; // the cage, as it came
    uint32_t first_vertex; // of the cage's mesh, from which the stencils' entries count
    subdivision_stencils stencils;
    scene_subdivision_level levels[SUBDIVISION_LEVELS_MAX]; // [0] is level 1
    uint32_t level_count;
    float edge_length; // of the cage, root mean square, in mesh space
} scene_subdivision;

// ---- Deformation. A node whose mesh is skinned or morphed has a mesh of its own, so that each has vertices of its own
// to change. Vertices and attributes of the scene are those at rest: the mesh as it came.

enum { SCENE_INFLUENCES = 8 };
typedef struct scene_influences { // of a vertex
    uint16_t joints[SCENE_INFLUENCES]; // index into the skin's joints
    float weights[SCENE_INFLUENCES]; // sum 1; unused ones 0, last
} scene_influences;

typedef struct scene_morph { // what a morph target adds to a vertex, times its weight
    float position[3], normal[3], tangent[3];
} scene_morph;

typedef struct scene_deformation {
    uint32_t mesh, node;
    uint32_t first_vertex, vertex_count; // of all its primitives, one after the other
    uint32_t skin; // SCENE_NONE: none
    const scene_influences *influences; // [vertex_count]; NULL without a skin
    uint32_t target_count;
    const scene_morph *morphs; // [target][vertex]
    const float *weights; // [target]: at rest, the node's or else the mesh's
    // A level of a subdivided mesh follows the deformation of its cage, which comes before it. Node and skin are the
    // cage's; influences and targets it has none. NULL: the mesh is no level.
    const struct scene_subdivision *subdivision;
    uint32_t level; // from 1
    uint32_t cage; // deformation
} scene_deformation;

typedef struct scene_skin {
    const char *name;
    uint32_t joint_count;
    const uint32_t *joints; // nodes
    const float (*inverse_bind)[16]; // column-major, from mesh space to the joint's at rest
} scene_skin;

// ---- Animation

typedef enum scene_interpolation {
    SCENE_STEP,
    SCENE_LINEAR, // rotations: slerp by the shorter arc
    SCENE_CUBIC, // Hermite spline; of each key in-tangent, value, out-tangent
} scene_interpolation;

typedef enum scene_target { // what a channel changes, and how many numbers it is
    SCENE_TRANSLATION, // of a node: 3
    SCENE_ROTATION, // of a node: 4, unit quaternion x y z w
    SCENE_SCALE, // of a node: 3
    SCENE_WEIGHTS, // of a node's morph targets: as many as they are
    // KHR_animation_pointer
    SCENE_LIGHT_COLOR, // of a light: 3, linear
    SCENE_LIGHT_INTENSITY, // 1
    SCENE_LIGHT_INNER_CONE, // 1, radians
    SCENE_LIGHT_OUTER_CONE, // 1, radians
    SCENE_BASE_COLOR, // of a material: 4, linear
    SCENE_EMISSIVE_FACTOR, // 3, linear
    SCENE_EMISSIVE_STRENGTH, // 1, nits
} scene_target;

typedef struct scene_channel {
    scene_target target;
    uint32_t index; // node, light or material
    scene_interpolation interpolation;
    uint32_t width; // numbers of a value
    uint32_t key_count; // at least 1
    const float *times; // [key_count], seconds, strictly increasing
    const float *values; // [key_count][width], or [key_count][3][width] where cubic
} scene_channel;

typedef struct scene_animation {
    const char *name;
    const scene_channel *channels;
    uint32_t channel_count;
    float duration; // seconds: the last key's time
} scene_animation;

typedef struct scene_emission { // of a material, whose `emissive` is the product
    float factor[3], strength;
} scene_emission;

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
    float hue[3], intensity; // whose product it is
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
    scene_emission *emissions; // per material; may be NULL where none is animated
    uint32_t material_count;
    scene_image *images;
    uint32_t image_count;
    scene_texture *textures;
    uint32_t texture_count;
    scene_light *lights;
    uint32_t light_count;
    scene_camera *cameras;
    uint32_t camera_count;
    scene_animation *animations;
    uint32_t animation_count;
    scene_skin *skins;
    uint32_t skin_count;
    scene_deformation *deformations;
    uint32_t deformation_count;
    scene_subdivision *subdivisions;
    uint32_t subdivision_count;
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

// The matrices of nodes: column-major; the rotation is a unit quaternion x y z w.
void scene_matrix_multiply(const float a[16], const float b[16], float out[16]); // `out` may be neither
// False, and `v` as it was, when it has no direction. Scaled first, so that no length over- or underflows.
bool scene_normalize(float v[3]);
void scene_matrix_compose(const float translation[3], const float rotation[4], const float scale[3], float out[16]);

// What `lanternfield info` prints.
void scene_print_info(const scene_data *scene, FILE *out);

// Index of the first camera named `name`, or SCENE_NONE.
uint32_t scene_camera_find(const scene_data *scene, const char *name);
