// S2..top by restriction: trilinear hats are refinable, so a vertex's sums are the weighted sums of the 27 finer vertices
// around it. Equal, to rounding, to scattering every VPL, without the smoothing of the paper's gather.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_sums.glsl.h"

layout(push_constant, scalar) uniform push_block { uint step; } push;
#include "lgh_build.coarse.glsl.h"

layout(set = 0, binding = 6, scalar) buffer sums_block { lgh_sums sums[]; };

void main()
{
    uint c, place;
    if (!coarse_vertex(gl_WorkGroupID.y * 65535u * 64u + gl_GlobalInvocationID.x, c, place))
        return;
    ivec3 fine_vertex = 2 * ivec3(unpack_vertex(vertices[place]));
    float fine_size = header.levels[c + 1u].cell_size;
    lgh_sums s = sums_zero();
    for (int j = 0; j < 27; j++) {
        ivec3 d = finer_offset(j);
        uint fine = place_of(c + 1u, fine_vertex + d);
        if (fine != LGH_NONE)
            sums_add(s, sums_moved(sums[fine], vec3(d) * fine_size, trilinear(0.5 * vec3(d))));
    }
    sums[place] = s;
}
