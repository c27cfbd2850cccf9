// Sum of log2 luminance over the lit pixels of one row, by one workgroup. The order of the additions is fixed, so two
// runs agree to the bit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl.h"

// Few: on a CPU device a barrier stops and goes on with each subgroup.
layout(local_size_x = 32) in;

layout(set = 0, binding = 0) uniform sampler2D radiance_map;
layout(set = 0, binding = 1, scalar) writeonly buffer rows_block { vec2 rows[]; }; // sum, number of pixels

shared vec2 sums[32];

void main()
{
    if (frame.auto_exposure == 0u)
        return;
    uint lane = gl_LocalInvocationIndex;
    uint y = gl_WorkGroupID.x;
    vec2 sum = vec2(0.0);
    for (uint x = lane; x < frame.width; x += 32u) {
        float light = luminance(texelFetch(radiance_map, ivec2(x, y), 0).rgb);
        if (light > 0.0)
            sum += vec2(log2(light), 1.0);
    }
    sums[lane] = sum;
    for (uint half_count = 16u; half_count > 0u; half_count /= 2u) {
        barrier();
        if (lane < half_count)
            sums[lane] += sums[lane + half_count];
    }
    if (lane == 0u)
        rows[y] = sums[0];
}
