// Radix sort, step 1: how often each digit occurs in each block.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.sort.glsl.h"

void main()
{
    uint thread = gl_LocalInvocationIndex;
    uint first = min(gl_WorkGroupID.x * SORT_BLOCK + thread * SORT_RUN, push.slot_count);
    count_digits(thread, first, min(first + SORT_RUN, push.slot_count));
    if (thread < 16u) {
        uint sum = 0u;
        for (uint i = 0u; i < 64u; i++)
            sum += counts[thread * 64u + i];
        table[thread * push.block_count + gl_WorkGroupID.x] = sum;
    }
}
