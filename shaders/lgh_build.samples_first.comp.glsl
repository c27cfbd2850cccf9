// Four VPLs for each vertex of S1, drawn in proportion to trilinear weight times intensity: where shadow rays may end.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.first.glsl.h"
#include "lgh_build.draw.glsl.h"

layout(set = 0, binding = 9, scalar) readonly buffer sums_block { lgh_sums sums[]; };
layout(set = 0, binding = 10, scalar) writeonly buffer samples_block { uvec4 samples[]; };
layout(push_constant, scalar) uniform push_block { uint key; } push;

void main()
{
    uint place;
    uvec3 vertex;
    if (!first_vertex(place, vertex))
        return;
    lgh_draws draws = draws_begin(hash(push.key, vertices[place], header.level_count), luminance(sums[place].color));
    uint slot;
    for (vpl_walk walk = walk_begin(vertex); walk_next(walk, slot);)
        draws_add(draws, slot, trilinear(cell_offset(vpls[slot], vertex)) * vpls[slot].intensity);
    samples[place] = draws.chosen;
}
