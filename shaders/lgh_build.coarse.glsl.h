// What the steps that make S2..top from finer levels share. Before including, declare push.step: S_(step+1) is made.
#ifndef LGH_BUILD_COARSE_GLSL_H
#define LGH_BUILD_COARSE_GLSL_H

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1, scalar) readonly buffer vertices_block { uint vertices[]; };
layout(set = 0, binding = 2, scalar) readonly buffer masks_block { uint masks[]; };
layout(set = 0, binding = 3, scalar) readonly buffer ranks_block { uint ranks[]; };
layout(set = 0, binding = 4, scalar) readonly buffer state_block { lgh_state state; };
layout(set = 0, binding = 5, scalar) readonly buffer dirty_places_block { uint dirty_places[]; };
layout(constant_id = 0) const bool DIRTY = false; // incremental: only vertices that are to be built again

#include "lgh_lookup.glsl.h"

// Exponent of the level that is made, and the place of its vertex i (or dirty vertex i) in the merged arrays; false past
// the last.
bool coarse_vertex(uint i, out uint c, out uint place)
{
    if (push.step >= header.level_count)
        return false;
    c = header.level_count - 1u - push.step;
    place = header.levels[c].first_light + i;
    if (i >= (DIRTY ? state.dirty[c] : header.levels[c].occupied))
        return false;
    if (DIRTY)
        place = dirty_places[place];
    return true;
}

// Place of a vertex of exponent c; LGH_NONE where it holds no light, and outside the grid.
uint place_of(uint c, ivec3 vertex)
{
    if (any(lessThan(vertex, ivec3(0))) || any(greaterThan(vertex, ivec3(grid_cells(c)))))
        return LGH_NONE;
    return lookup(c, uvec3(vertex));
}

// The 27 finer vertices around a vertex, as offsets in fine cells; their weights are trilinear(0.5 * offset).
ivec3 finer_offset(int j) { return ivec3(j % 3, j / 3 % 3, j / 9) - 1; }

#endif
