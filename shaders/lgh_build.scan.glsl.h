// Exclusive prefix sums in place, by one workgroup: of ranks, of the sort's digits, of the merge's runs.
#ifndef LGH_BUILD_SCAN_GLSL_H
#define LGH_BUILD_SCAN_GLSL_H

#include "lgh_build.state.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 3, scalar) buffer values_block { uint values[]; };

shared uint sums[256];

void scan(uint count)
{
    uint thread = gl_LocalInvocationIndex;
    uint run = (count + 255u) / 256u;
    uint first = min(thread * run, count), last = min(first + run, count);
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

#endif
