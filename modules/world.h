// The scene as entities, and its mirror on the GPU: spawns nodes and lights as entities with components, uploads
// geometry, materials and textures once, and extracts instances, lights and frame constants every frame.
#pragma once

#include "light_slots.h"
#include "renderer.h"

// Components. An engine adds, changes and removes them while running; the next frame follows.
typedef struct node_component { // local transform and parent; "node"
    entity parent; // {0}: the world
    float matrix[16]; // local to parent, column-major
    const char *name;
} node_component;
typedef struct transform_component { // "transform": filled by the world from node_component
    float world[16];
    float previous_world[16]; // last frame's
    uint32_t stamp; // frame of the last update, plus one; 0: never
} transform_component;
typedef struct mesh_component { // "mesh"
    uint32_t mesh; // index into scene_data.meshes
} mesh_component;
typedef struct light_component { // "light": a punctual light at the entity's transform, shining along -z
    uint32_t type; // LIGHT_*
    float color[3]; // candela, or lux for directional
    float inner_cone, outer_cone; // radians
} light_component;

// "weights": of the morph targets of the node's mesh; on each node whose mesh has any
typedef struct weights_component {
    float *weights; // [count]; owned by the component
    uint32_t count;
} weights_component;

typedef struct box {
    float min[3], max[3]; // min > max: empty
} box;

// What gives light: a punctual light, or all emissive triangles of one instance. Its elements are numbered through the
// punctual lights and, after them, the emissive triangles.
typedef struct world_source {
    entity entity;
    bool emissive; // the emissive triangles of its instance; false: its punctual light
    bool changed; // is new or sends other light than in the last frame
    uint32_t first, count; // elements
    float power; // as world_element_power, their sum
} world_source;

// A mesh that deforms, in this frame. What follows its vertices (the pass "deform", acceleration structures, Embree)
// keeps the version that it has followed to.
typedef struct world_deformation {
    uint32_t version; // changes of its vertices so far; 0: they are at rest
    bool changed; // the vertices are others than in the last frame
    bool drawn; // an instance of this frame has the mesh; of a level that has none, vertices and trees stay behind
    bool mirrored; // turned inside out: most of its joints' determinants are negative
    float scale; // mean of its joints': what they make of a length of 1
    bool stretched; // so far from rest that a tree over the triangles at rest is worth no keeping
    box box, previous_box; // mesh space, around all its vertices, in this frame and the last
    uint32_t first_kept; // number of its first vertex among those of all deformations
    const float (*joints)[3][4]; // [skin's joint_count]: rows, from the mesh at rest to the world
    const float *weights; // [target_count]
} world_deformation;

// What is not as it was in the last frame; all of it in the first. Textures never change, nor do materials but for
// their colours, nor does geometry but by deformations.
typedef struct world_changes {
    bool instances; // one moved, deformed, or is listed at another place
    bool bounds; // the constants' scene_min, scene_max and scene_radius
    bool sources; // one changed, came, went or was numbered anew
    // World: what the instances that moved, deformed, came or went cover, and what they covered; and what the
    // primitives cover whose base colour changed. Emission is a matter of the sources.
    const box *boxes;
    uint32_t box_count;
} world_changes;

// An instance by name; its data for the GPU has the same index in `instance_data`.
typedef struct world_instance {
    entity entity;
    uint32_t mesh;
} world_instance;

// What tells the instances of the picture apart, 1 to WORLD_IDENTITIES: the alpha of `albedo` is identity over
// WORLD_IDENTITIES. Stays with an entity for its life; far apart entities may share one.
enum { WORLD_IDENTITIES = 65535 };
static inline uint32_t world_identity(entity e)
{
    return 1 + e.id % WORLD_IDENTITIES;
}

typedef struct world_gpu {
    component_type node, transform, mesh, light, weights;
    entity *node_entities; // [node_count]: what the scene's nodes were spawned as
    material *material_data; // [material_count]: the scene's, with this frame's colours; see world_material_set
    // Where the device is a CPU, `positions` and `indices` are mapped, for Embree.
    gpu_buffer frame, positions, attributes, indices, primitives, instances, materials, lights, emitters, light_cdf;
    gpu_buffer tlas_instances; // VkAccelerationStructureInstanceKHR[instance_count], host
    gpu_acceleration *blas; // per mesh, at rest at first; {0} for meshes without triangles
    uint32_t blas_count;
    gpu_image *textures; // one per image and colour space
    uint32_t texture_count;
    uint32_t instance_count; // this frame's
    uint32_t instance_max; // for which there is room in the buffers; grows
    const world_source *sources; // this frame's, by kind and entity
    uint32_t source_count;
    world_changes changes; // of this frame
    // Lights from this one on, all of them point lights, join the lighting grid hierarchy, and direct_light leaves them
    // out; the number of punctual lights where none does. Their slots hold their indices.
    uint32_t first_joined;
    light_slots light_slots;
    float light_power; // of all sources: luminous flux in lumen-like units (watts of luminance); 0: no light at all

    // What the CPU knows of the scene. Instances are ordered by recursive median split over their centres, for drivers
    // that build BVHs by halving the list as given; the order changes only when meshes come or go.
    box *primitive_boxes; // mesh space, per primitive; of deforming meshes the whole mesh's
    world_instance *order; // instance_count, in the order of the TLAS
    mesh_instance_gpu *instance_data; // the same order
    world_deformation *deformations; // parallel to the scene's
    uint32_t *mesh_deformations; // per mesh: index, or SCENE_NONE
    uint32_t kept_vertices; // of all deformations
    gpu_buffer previous_positions; // vec3[kept_vertices]: of last frame, where `changed`
    struct deformation_state *deformation_states; // private to world_deform.c
    struct world_state *state; // private to world.c
    struct world_materials *material_state; // private to world_materials.c
    struct world_lights *light_state; // private to world_lights.c
} world_gpu;

// Spawns the scene, uploads it and registers the systems. False on failure (logged). Called by renderer_create.
bool world_init(renderer *r);
void world_fini(renderer *r);

// Adds a directional light entity that travels along `direction` with `lux` (white).
entity world_sun_add(renderer *r, const float direction[3], float lux);

// Gives a material of the scene other colours: linear base colour with alpha (0 to 1), emission in nits (0 to 1e30).
void world_material_set(renderer *r, uint32_t index, const float base_color[4], const float emissive[3]);

// Luminous flux of a light source's element, as `light_power`.
float world_element_power(const renderer *r, uint32_t element);

// The mesh's deformation in this frame; NULL: it has none.
const world_deformation *world_deformation_of(const renderer *r, uint32_t mesh);
// Where this frame's joints and targets put a vertex of the scene that is the deformation's, mesh space: what the GPU
// computes, but for rounding.
void world_deformed_position(const renderer *r, uint32_t deformation, uint32_t vertex, float position[3]);
// A skinned mesh stays where its joints put it: its node does not move it (glTF 2.0, section 3.7.3.3).
bool world_is_skinned(const renderer *r, uint32_t mesh);
// Triangles of a mesh, a geometry a primitive, for acceleration structures over `positions`, those of the scene's
// vertex 0, `stride` bytes apart. `geometries` has room for its primitives.
void world_mesh_triangles(const renderer *r, uint32_t mesh, VkDeviceAddress positions, uint32_t stride,
                          gpu_triangles *geometries);

// Moved or deformed since the last frame.
bool world_instance_moved(const mesh_instance_gpu *instance);
// Light or surfaces are not those of the last frame.
bool world_has_changed(const world_gpu *w);

// ---- Between the world's files.
bool world_upload(renderer *r); // world_upload.c: what never changes, and materials at first
// world_materials.c: before all else; at the start and at the end of each extraction.
enum { MATERIAL_COLOR_CHANGED = 1, MATERIAL_EMISSION_CHANGED = 2 };
void world_materials_init(renderer *r);
bool world_materials_extract(renderer *r); // false: no memory
void world_materials_rest(renderer *r);
void world_materials_fini(renderer *r);
uint8_t world_material_changes(const renderer *r, uint32_t index); // MATERIAL_*_CHANGED, since the last frame
uint8_t world_materials_changes(const renderer *r); // of any of them
void world_matrix_multiply(const float a[16], const float b[16], float product[16]); // `product` may be either
// world_deform.c: after the upload; after the transforms; once the instances are ordered; the last accepts a world half
// made.
bool world_deform_init(renderer *r);
void world_deform_update(renderer *r);
void world_deform_mark(renderer *r); // which deformations are drawn
void world_deform_fini(renderer *r);
// world_lights.c: punctual lights, emissive triangles and the choice among them. Emitters are gathered anew when
// `moved`, that is when an instance with an emissive material moved or deformed, any instance came or went, or emission
// changed.
bool world_lights_init(renderer *r);
bool world_lights_extract(renderer *r, bool moved);
void world_lights_fini(renderer *r);
bool world_material_emits(const renderer *r, uint32_t material);
// Makes a host buffer hold at least `size` bytes and binds it at `binding` of the scene set (BINDING_NONE: nowhere).
// Contents are lost when it grows. Its mapping, or NULL when there is no memory (logged).
enum { BINDING_NONE = UINT32_MAX };
void *world_buffer_reserve(renderer *r, gpu_buffer *buffer, const char *name, uint32_t binding, VkDeviceSize size);
