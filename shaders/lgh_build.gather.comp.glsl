// S2..top by the paper's gather (Lin and Yuksel 2019, section 3.1): each vertex collects the grid lights of S1, whose
// centres' trilinear weights decide, from an index range that is closed on both sides. One workgroup a vertex.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_sums.glsl.h"

layout(push_constant, scalar) uniform push_block { uint step; } push;
#include "lgh_build.coarse.glsl.h"

layout(set = 0, binding = 6, scalar) buffer sums_block { lgh_sums sums[]; };

shared lgh_sums group_sums[64];

// The S1 vertex's sums as one light at its centre, seen from a coarse vertex.
void add_first(inout lgh_sums s, uint fine, ivec3 offset, float fine_size, float size)
{
    lgh_sums light = sums[fine];
    if (light.weight <= 0.0)
        return;
    vec3 shift = vec3(offset) * fine_size;
    float t = trilinear((light.position / light.weight + shift) / size);
    sums_add(s, sums_moved(light, shift, t));
}

void main()
{
    uint c, place, first = header.level_count - 1u;
    if (!coarse_vertex(gl_WorkGroupID.y * 65535u + gl_WorkGroupID.x, c, place))
        return;
    int scale = 1 << push.step, width = 2 * scale + 1;
    ivec3 centre = scale * ivec3(unpack_vertex(vertices[place]));
    lgh_sums s = sums_zero();
    for (int j = int(gl_LocalInvocationIndex); j < width * width * width; j += 64) {
        ivec3 offset = ivec3(j % width, j / width % width, j / (width * width)) - scale;
        uint fine = place_of(first, centre + offset);
        if (fine != LGH_NONE)
            add_first(s, fine, offset, header.levels[first].cell_size, header.levels[c].cell_size);
    }
    group_sums[gl_LocalInvocationIndex] = s;
    for (uint step = 32u; step > 0u; step >>= 1) {
        barrier();
        if (gl_LocalInvocationIndex < step)
            sums_add(group_sums[gl_LocalInvocationIndex], group_sums[gl_LocalInvocationIndex + step]);
    }
    if (gl_LocalInvocationIndex == 0u)
        sums[place] = group_sums[0];
}
