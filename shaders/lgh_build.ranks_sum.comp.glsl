// Ranks, step 1: the set bits of each workgroup's words.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.ranks.glsl.h"

shared uint sum;

void main()
{
    if (gl_LocalInvocationIndex == 0u)
        sum = 0u;
    barrier();
    atomicAdd(sum, run_sum());
    barrier();
    if (gl_LocalInvocationIndex == 0u)
        group_sums[gl_WorkGroupID.x] = sum;
}
