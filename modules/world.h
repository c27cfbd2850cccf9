// The scene as entities, and its mirror on the GPU: spawns nodes and lights as entities with components, uploads
// geometry, materials and textures once, and extracts instances, lights and frame constants every frame.
#pragma once

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

// What is not as it was in the last frame; all of it in the first. Geometry, materials and textures never change.
typedef struct world_changes {
    bool bounds; // the constants' scene_min, scene_max and scene_radius
    bool sources; // one changed, came, went or was numbered anew
    const box *boxes; // world: what the instances that moved, came or went cover, and what they covered
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
    component_type node, transform, mesh, light;
    // Where the device is a CPU, `positions` and `indices` are mapped, for Embree.
    gpu_buffer frame, positions, attributes, indices, primitives, instances, materials, lights, emitters, light_cdf;
    gpu_buffer tlas_instances; // VkAccelerationStructureInstanceKHR[instance_count], host
    gpu_acceleration *blas; // per mesh; {0} for meshes without triangles
    uint32_t blas_count;
    gpu_image *textures; // one per image and colour space
    uint32_t texture_count;
    uint32_t instance_count; // this frame's
    uint32_t instance_max; // for which there is room in the buffers; grows
    const world_source *sources; // this frame's, by kind and entity
    uint32_t source_count;
    world_changes changes; // of this frame
    float light_power; // of all sources: luminous flux in lumen-like units (watts of luminance); 0: no light at all

    // What the CPU knows of the scene. Instances are ordered by recursive median split over their centres, for drivers
    // that build BVHs by halving the list as given; the order changes only when meshes come or go.
    box *primitive_boxes; // mesh space, per primitive
    world_instance *order; // instance_count, in the order of the TLAS
    mesh_instance_gpu *instance_data; // the same order
    struct world_state *state; // private to world.c
    struct world_lights *light_state; // private to world_lights.c
} world_gpu;

// Spawns the scene, uploads it and registers the systems. False on failure (logged). Called by renderer_create.
bool world_init(renderer *r);
void world_fini(renderer *r);

// Adds a directional light entity that travels along `direction` with `lux` (white).
entity world_sun_add(renderer *r, const float direction[3], float lux);

// Luminous flux of a light source's element, as `light_power`.
float world_element_power(const renderer *r, uint32_t element);

// ---- Between the world's files.
bool world_upload(renderer *r); // world_upload.c: what never changes
// world_lights.c: punctual lights, emissive triangles and the choice among them. Emitters are gathered anew when
// `moved`, that is when an instance with an emissive material moved, or any instance came or went.
bool world_lights_init(renderer *r);
bool world_lights_extract(renderer *r, bool moved);
void world_lights_fini(renderer *r);
bool world_material_emits(const renderer *r, uint32_t material);
// Makes a host buffer hold at least `size` bytes and binds it at `binding` of the scene set (BINDING_NONE: nowhere).
// Contents are lost when it grows. Its mapping, or NULL when there is no memory (logged).
enum { BINDING_NONE = UINT32_MAX };
void *world_buffer_reserve(renderer *r, gpu_buffer *buffer, const char *name, uint32_t binding, VkDeviceSize size);
