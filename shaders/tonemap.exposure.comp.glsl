// The exposure's factor: 2^EV as set, or what puts the log-average luminance at 0.18. One workgroup.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl.h"

layout(local_size_x = 256) in;

layout(set = 0, binding = 0, scalar) readonly buffer rows_block { vec2 rows[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer exposure_block { float exposure; };

shared vec2 sums[256];

const float MIDDLE_GREY = 0.18;

void main()
{
    uint lane = gl_LocalInvocationIndex;
    if (frame.auto_exposure == 0u) {
        if (lane == 0u)
            exposure = exp2(frame.exposure_ev);
        return;
    }
    vec2 sum = vec2(0.0);
    for (uint y = lane; y < frame.height; y += 256u)
        sum += rows[y];
    sums[lane] = sum;
    for (uint half_count = 128u; half_count > 0u; half_count /= 2u) {
        barrier();
        if (lane < half_count)
            sums[lane] += sums[lane + half_count];
    }
    if (lane == 0u) {
        float average = sums[0].x / max(sums[0].y, 1.0);
        exposure = sums[0].y > 0.0 ? exp2(clamp(log2(MIDDLE_GREY) - average, -100.0, 100.0)) : 1.0;
    }
}
