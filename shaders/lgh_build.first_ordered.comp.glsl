// S1, ordered: each vertex gathers the VPLs of its eight cells in a fixed order, so two runs agree to the bit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.first.glsl.h"

layout(set = 0, binding = 9, scalar) writeonly buffer sums_block { lgh_sums sums[]; };
layout(push_constant, scalar) uniform push_block { uint demo; } push;

void main()
{
    uint place;
    uvec3 vertex;
    if (!first_vertex(place, vertex))
        return;
    float size = header.levels[header.level_count - 1u].cell_size;
    lgh_sums s = sums_zero();
    uint slot;
    for (vpl_walk walk = walk_begin(vertex); walk_next(walk, slot);) {
        vpl light = vpls[slot];
        vec3 offset = cell_offset(light, vertex);
        sums_add(s, sums_of(light, offset * size, trilinear(offset), push.demo != 0u));
    }
    sums[place] = s;
}
