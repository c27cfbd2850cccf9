// Ranks, step 3, of cells.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.ranks.glsl.h"

void main()
{
    uint rank = run_rank();
    for (uint words = run_filled(); words != 0u; words &= words - 1u) {
        uint word = run_first() + uint(findLSB(words));
        ranks[word] = rank;
        rank += uint(bitCount(masks[word]));
    }
}
