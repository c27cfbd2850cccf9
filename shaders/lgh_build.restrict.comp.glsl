// S2..top by restriction: trilinear hats are refinable, so a vertex's sums are the weighted sums of the 27 finer vertices
// around it. Equal, to rounding, to scattering every VPL, without the smoothing of the paper's gather.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_sums.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1, scalar) readonly buffer vertices_block { uint vertices[]; };
layout(set = 0, binding = 2, scalar) readonly buffer masks_block { uint masks[]; };
layout(set = 0, binding = 3, scalar) readonly buffer ranks_block { uint ranks[]; };
layout(set = 0, binding = 4, scalar) buffer sums_block { lgh_sums sums[]; };
layout(push_constant, scalar) uniform push_block { uint step; } push; // builds S_(step+1)

#include "lgh_lookup.glsl.h"

void main()
{
    uint i = gl_WorkGroupID.y * 65535u * 64u + gl_GlobalInvocationID.x;
    if (push.step >= header.level_count)
        return;
    uint c = header.level_count - 1u - push.step;
    if (i >= header.levels[c].occupied)
        return;
    uint place = header.levels[c].first_light + i;
    ivec3 fine_vertex = 2 * ivec3(unpack_vertex(vertices[place]));
    float fine_size = header.levels[c + 1u].cell_size;
    lgh_sums s = sums_zero();
    for (int j = 0; j < 27; j++) {
        ivec3 d = ivec3(j % 3, j / 3 % 3, j / 9) - 1;
        ivec3 v = fine_vertex + d;
        if (any(lessThan(v, ivec3(0))) || any(greaterThan(v, ivec3(1 << (c + 1u)))))
            continue;
        uint fine = lookup(c + 1u, uvec3(v));
        if (fine != LGH_NONE)
            sums_add(s, sums_moved(sums[fine], vec3(d) * fine_size, trilinear(0.5 * vec3(d))));
    }
    sums[place] = s;
}
