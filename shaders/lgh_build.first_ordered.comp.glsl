// S1, ordered: each vertex gathers the VPLs of its eight cells in a fixed order, so two runs agree to the bit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_sums.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 2, scalar) readonly buffer vertices_block { uint vertices[]; };
layout(set = 0, binding = 3, scalar) readonly buffer order_block { uint order[]; };
layout(set = 0, binding = 4, scalar) readonly buffer cell_masks_block { uint cell_masks[]; };
layout(set = 0, binding = 5, scalar) readonly buffer cell_ranks_block { uint cell_ranks[]; };
layout(set = 0, binding = 6, scalar) readonly buffer cell_starts_block { uint cell_starts[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer sums_block { lgh_sums sums[]; };
layout(push_constant, scalar) uniform push_block { uint demo; } push;

#include "lgh_cells.glsl.h"

void main()
{
    uint i = gl_WorkGroupID.y * 65535u * 64u + gl_GlobalInvocationID.x;
    uint c = header.level_count - 1u;
    if (i >= header.levels[c].occupied)
        return;
    uint place = header.levels[c].first_light + i;
    uvec3 vertex = unpack_vertex(vertices[place]);
    lgh_sums s = sums_zero();
    for (uint corner = 0u; corner < 8u; corner++) {
        uvec2 range = cell_range(ivec3(vertex) - 1 + ivec3(uvec3(corner, corner >> 1, corner >> 2) & 1u));
        for (uint j = range.x; j < range.y; j++) {
            vpl light = vpls[order[j]];
            vec3 offset = grid_position(light.position, header.origin, header.top_size, c) - vec3(vertex);
            sums_add(s, sums_of(light, offset * header.levels[c].cell_size, trilinear(offset), push.demo != 0u));
        }
    }
    sums[place] = s;
}
