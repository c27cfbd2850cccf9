// Ranks, step 3: the set bits before each word; `group_sums` now holds those before each workgroup.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.ranks.glsl.h"

shared uint sums[256];

void main()
{
    uint thread = gl_LocalInvocationIndex;
    sums[thread] = run_sum();
    barrier();
    if (thread == 0u) {
        uint total = group_sums[gl_WorkGroupID.x];
        for (uint i = 0u; i < 256u; i++) {
            uint sum = sums[i];
            sums[i] = total;
            total += sum;
        }
    }
    barrier();
    uint rank = sums[thread];
    for (uint i = run_first(); i < min(run_first() + RUN, word_count()); i++) {
        ranks[i] = rank;
        rank += uint(bitCount(masks[i]));
    }
}
