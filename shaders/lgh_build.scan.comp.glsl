// Exclusive prefix sums of `count` numbers in place, by one workgroup.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "common.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 3, scalar) buffer values_block { uint values[]; };
layout(push_constant, scalar) uniform push_block { uint count; } push;

shared uint sums[256];

void main()
{
    uint thread = gl_LocalInvocationIndex;
    uint run = (push.count + 255u) / 256u;
    uint first = min(thread * run, push.count), last = min(first + run, push.count);
    uint sum = 0u;
    for (uint i = first; i < last; i++)
        sum += values[i];
    sums[thread] = sum;
    barrier();
    if (thread == 0u) {
        uint total = 0u;
        for (uint i = 0u; i < 256u; i++) {
            uint value = sums[i];
            sums[i] = total;
            total += value;
        }
    }
    barrier();
    uint total = sums[thread];
    for (uint i = first; i < last; i++) {
        uint value = values[i];
        values[i] = total;
        total += value;
    }
}
