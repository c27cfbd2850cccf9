// Rays on the CPU by Embree 3, over the same geometry, instances and alpha masks as the acceleration structures of the
// GPU. One scene a mesh, with its primitives as geometries, and a scene of instances on top.
#pragma once

#include "world.h"

typedef struct embree_rays embree_rays;

// Shares the memory of `positions` (vertex_count of the scene, mesh space) and `indices` (index_count): no copy is
// made, so both outlive the tracer and keep their contents, but for what embree_rays_update is told of. 16 bytes behind
// the last position must be readable. `scene` outlives the tracer too, as do `materials`: the scene's, whose colours
// may change. NULL when there is no Embree device (not logged).
embree_rays *embree_rays_create(const scene_data *scene, const material *materials, const float (*positions)[3],
                                const uint32_t *indices);
void embree_rays_destroy(embree_rays *rays); // accepts NULL

// Makes the tracer follow the deformations (those of the scene, whose vertices `positions` hold by now) and the
// instances; hits count in them. Meshes are built when first instanced, and what did not move costs a comparison.
// Matrices are invertible. False when Embree failed (logged).
bool embree_rays_update(embree_rays *rays, const mesh_instance_gpu *instances, uint32_t count,
                        const world_deformation *deformations);

// Answer `count` rays, as modules/rays.h has them, on all CPUs. Once Embree has failed, nothing is hit and `visible` is
// left as it is. The same rays get the same answers every time.
void embree_rays_visible(embree_rays *rays, const float (*origins)[4], const float (*directions)[4], uint32_t *visible,
                         uint32_t count);
void embree_rays_nearest(embree_rays *rays, const float (*origins)[4], const float (*directions)[4], ray_hit *hits,
                         uint32_t count);
