// Ranks of a bit mask, the set bits before each word: what the steps before and after the scan of the workgroups' sums
// share. Each invocation has RUN words. Most are zero: those are passed over, and have no rank.
#ifndef LGH_BUILD_RANKS_GLSL_H
#define LGH_BUILD_RANKS_GLSL_H

#include "lgh.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) readonly buffer masks_block { uint masks[]; };
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 2, scalar) buffer ranks_block { uint ranks[]; };
layout(set = 0, binding = 3, scalar) buffer group_sums_block { uint group_sums[]; };
layout(set = 0, binding = 5, scalar) readonly buffer filled_block { uint filled[]; };
layout(push_constant, scalar) uniform push_block { uint cells; } push; // 1: the mask of S1's cells, else of the vertices

const uint RUN = LGH_SCAN_WORDS / 256u;

shared uint sums[256];

uint word_count()
{
    if (push.cells == 0u)
        return header.word_count;
    return header.level_count == 0u ? 0u : cell_words(header.level_count - 1u);
}

uint run_first() { return gl_WorkGroupID.x * LGH_SCAN_WORDS + gl_LocalInvocationIndex * RUN; }

// Which of this invocation's words are not zero.
uint run_filled()
{
    uint first = run_first();
    return first < word_count() ? filled[first >> 5] >> (first & 31u) & ((1u << RUN) - 1u) : 0u;
}

uint run_sum()
{
    uint sum = 0u;
    for (uint words = run_filled(); words != 0u; words &= words - 1u)
        sum += uint(bitCount(masks[run_first() + uint(findLSB(words))]));
    return sum;
}

// The set bits before this invocation's words; `group_sums` holds those before the workgroup's.
uint run_rank()
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
    return sums[thread];
}

#endif
