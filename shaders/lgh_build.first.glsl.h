// What the steps that walk the sorted VPLs around each vertex of S1 share: one invocation a vertex.
#ifndef LGH_BUILD_FIRST_GLSL_H
#define LGH_BUILD_FIRST_GLSL_H

#include "lgh_sums.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 2, scalar) readonly buffer vertices_block { uint vertices[]; };
layout(set = 0, binding = 3, scalar) readonly buffer order_block { uint order[]; };
layout(set = 0, binding = 4, scalar) readonly buffer cell_masks_block { uint cell_masks[]; };
layout(set = 0, binding = 5, scalar) readonly buffer cell_ranks_block { uint cell_ranks[]; };
layout(set = 0, binding = 6, scalar) readonly buffer cell_starts_block { uint cell_starts[]; };
layout(set = 0, binding = 7, scalar) readonly buffer state_block { lgh_state state; };
layout(set = 0, binding = 8, scalar) readonly buffer dirty_places_block { uint dirty_places[]; };
layout(constant_id = 0) const bool DIRTY = false; // incremental: only vertices that are to be built again

#include "lgh_cells.glsl.h"

// This invocation's vertex and its place in the merged arrays; false past the last.
bool first_vertex(out uint place, out uvec3 vertex)
{
    uint i = gl_WorkGroupID.y * 65535u * 64u + gl_GlobalInvocationID.x;
    uint c = header.level_count - 1u;
    if (i >= (DIRTY ? state.dirty[c] : header.levels[c].occupied))
        return false;
    place = header.levels[c].first_light + i;
    if (DIRTY)
        place = dirty_places[place];
    vertex = unpack_vertex(vertices[place]);
    return true;
}

// A walk over the VPLs in the eight cells around a vertex of S1, in a fixed order. One loop over all of them, as lanes with
// full and empty cells at different corners would otherwise wait for each other at each.
struct vpl_walk {
    uvec2 ranges[8]; // in the sorted order
    uint corner, next;
};

vpl_walk walk_begin(uvec3 vertex)
{
    vpl_walk walk;
    for (uint corner = 0u; corner < 8u; corner++)
        walk.ranges[corner] = cell_range(ivec3(vertex) - 1 + ivec3(uvec3(corner, corner >> 1, corner >> 2) & 1u));
    walk.corner = 0u;
    walk.next = walk.ranges[0].x;
    return walk;
}

// The slot of the next VPL; false after the last.
bool walk_next(inout vpl_walk walk, out uint slot)
{
    while (walk.next >= walk.ranges[walk.corner].y) {
        if (walk.corner == 7u)
            return false;
        walk.next = walk.ranges[++walk.corner].x;
    }
    slot = order[walk.next++];
    return true;
}

// Where a VPL lies relative to a vertex of S1, in cells.
vec3 cell_offset(vpl light, uvec3 vertex)
{
    return grid_position(light.position, header.origin, header.top_size, header.level_count - 1u) - vec3(vertex);
}

#endif
