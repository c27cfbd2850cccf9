// Subdivided meshes in the renderer: an instance of a control cage is drawn as the level that suits its size in the
// picture, and where the cage moves the level's vertices follow on the GPU.
#pragma once

#include "renderer.h"

// Length in pixels that a refined edge is to have, and how far beyond the limits of a level, in levels, its size may go
// before another is taken: so nothing flickers between two levels.
#define SUBDIVIDE_EDGE_PIXELS 8.0f
#define SUBDIVIDE_HYSTERESIS 0.15f

// The level for a cage whose edges are `edge_pixels` long: the first whose edges are SUBDIVIDE_EDGE_PIXELS or shorter,
// 1 to `max_level`, or 0 where that is 0. `current`: the level in use; 0: none yet.
uint32_t subdivide_level(float edge_pixels, uint32_t current, uint32_t max_level);

typedef struct subdivide_stencils { // of one scene_subdivision, for shaders/subdivide.comp.glsl
    gpu_buffer vertices; // subdivision_vertex[], level after level
    gpu_buffer offsets, entries;
} subdivide_stencils;

// False when there is no memory (logged); subdivide_stencils_destroy either way.
bool subdivide_stencils_create(gpu *gpu, const scene_subdivision *source, subdivide_stencils *stencils);
void subdivide_stencils_destroy(gpu *gpu, const subdivide_stencils *stencils);

typedef struct subdivide_target { // buffers of the whole scene
    gpu_buffer positions, attributes;
    gpu_buffer previous_positions; // from `first_kept` on: where the level's vertices were
    uint32_t first_kept;
    bool is_new; // they were nowhere: what is drawn for the first time has not moved
} subdivide_target;

// Records the evaluation of `level` (from 1): from the vertices of the cage's mesh in the positions to those of the
// level, with their normals and tangents in the attributes. The caller sees to it that the cage's positions are there,
// by a barrier, and that nobody reads the level's meanwhile.
void subdivide_record(gpu_commands *commands, gpu_pipeline pipeline, const subdivide_stencils *stencils,
                      const scene_subdivision *source, uint32_t level, const subdivide_target *target);
