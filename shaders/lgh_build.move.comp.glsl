// Incremental: what is left of last frame moves to its new places. A vertex is dirty when a VPL came, went or changed in
// one of the cells around it, on its own level's grid: exactly those vertices' sums depend on the VPL. Dirty vertices are
// listed, level by level; of the others, sums and samples are last frame's.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1, scalar) buffer state_block { lgh_state state; };
layout(set = 0, binding = 2, scalar) readonly buffer vertices_block { uint vertices[]; };
layout(set = 0, binding = 3, scalar) readonly buffer masks_block { uint masks[]; };
layout(set = 0, binding = 4, scalar) readonly buffer ranks_block { uint ranks[]; };
layout(set = 0, binding = 5, scalar) readonly buffer dirty_block { uint dirty_cells[]; };
layout(set = 0, binding = 6, scalar) readonly buffer old_vertices_block { uint old_vertices[]; };
layout(set = 0, binding = 7, scalar) readonly buffer old_masks_block { uint old_masks[]; };
layout(set = 0, binding = 8, scalar) readonly buffer old_ranks_block { uint old_ranks[]; };
layout(set = 0, binding = 9, scalar) readonly buffer old_sums_block { lgh_sums old_sums[]; };
layout(set = 0, binding = 10, scalar) writeonly buffer sums_block { lgh_sums sums[]; };
layout(set = 0, binding = 11, scalar) writeonly buffer dirty_places_block { uint dirty_places[]; };
layout(set = 0, binding = 12, scalar) readonly buffer old_samples_block { uvec4 old_samples[]; };
layout(set = 0, binding = 13, scalar) writeonly buffer samples_block { uvec4 samples[]; };
layout(constant_id = 0) const bool SAMPLES = false; // there are samples

#include "lgh_lookup.glsl.h"

bool cell_is_dirty(uint c, ivec3 cell)
{
    if (any(lessThan(cell, ivec3(0))) || any(greaterThanEqual(cell, ivec3(grid_cells(c)))))
        return false;
    uint code = morton(uvec3(cell));
    return (dirty_cells[LGH_CELL_OFFSET[c] + (code >> 5)] >> (code & 31u) & 1u) != 0u;
}

bool is_dirty(uint c, uvec3 vertex)
{
    if (state.fresh != 0u)
        return true;
    for (uint corner = 0u; corner < 8u; corner++)
        if (cell_is_dirty(c, ivec3(vertex) - ivec3(uvec3(corner, corner >> 1, corner >> 2) & 1u)))
            return true;
    return false;
}

uint old_place(uint c, uvec3 vertex)
{
    uint bit = mask_bit(c, vertex);
    return old_ranks[bit >> 5] + uint(bitCount(old_masks[bit >> 5] & ((1u << (bit & 31u)) - 1u)));
}

// Samples of S1 are slots of VPLs; those of coarser levels are places of finer vertices, which have moved too.
uvec4 moved_samples(uint c, uvec4 old)
{
    for (uint k = 0u; k < 4u && c + 1u < header.level_count; k++)
        if (old[k] != LGH_NO_SAMPLE)
            old[k] = lookup(c + 1u, unpack_vertex(old_vertices[old[k]]));
    return old;
}

void main()
{
    uint place = gl_WorkGroupID.y * 65535u * 256u + gl_GlobalInvocationID.x;
    if (place >= header.light_count)
        return;
    uint c = light_exponent(header, place);
    uvec3 vertex = unpack_vertex(vertices[place]);
    if (is_dirty(c, vertex)) {
        dirty_places[header.levels[c].first_light + atomicAdd(state.dirty[c], 1u)] = place;
        return;
    }
    uint old = old_place(c, vertex);
    sums[place] = old_sums[old];
    if (SAMPLES)
        samples[place] = moved_samples(c, old_samples[old]);
}
