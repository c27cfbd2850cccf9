// Four finer vertices for each vertex of S2..top, out of the 27 around it, drawn in proportion to their shares of its
// intensity. A shadow ray walks down such choices to a VPL, so that from the top 4^levels VPLs may be met each frame.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_sums.glsl.h"

layout(push_constant, scalar) uniform push_block { uint step, key; } push;
#include "lgh_build.coarse.glsl.h"
#include "lgh_build.draw.glsl.h"

layout(set = 0, binding = 6, scalar) readonly buffer sums_block { lgh_sums sums[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer samples_block { uvec4 samples[]; };

void main()
{
    uint c, place;
    if (!coarse_vertex(gl_WorkGroupID.y * 65535u * 64u + gl_GlobalInvocationID.x, c, place))
        return;
    ivec3 fine_vertex = 2 * ivec3(unpack_vertex(vertices[place]));
    lgh_draws draws = draws_begin(hash(push.key, vertices[place], c), luminance(sums[place].color));
    for (int j = 0; j < 27; j++) {
        ivec3 d = finer_offset(j);
        uint fine = place_of(c + 1u, fine_vertex + d);
        if (fine != LGH_NONE)
            draws_add(draws, fine, trilinear(0.5 * vec3(d)) * luminance(sums[fine].color));
    }
    samples[place] = draws.chosen;
}
