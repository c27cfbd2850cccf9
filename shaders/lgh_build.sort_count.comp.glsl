// Radix sort, step 1: how often each digit occurs in each block.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.sort.glsl.h"

void main()
{
    uint thread = gl_LocalInvocationIndex;
    count_digits(thread);
    if (thread < SORT_DIGITS) {
        uint sum = 0u;
        for (uint i = 0u; i < 64u; i++)
            sum += counts[thread * 64u + i];
        table[thread * sort_blocks(state.listed) + gl_WorkGroupID.x] = sum;
    }
}
