// Ranks, step 3, of cells.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.ranks.glsl.h"

void main()
{
    uint rank = run_rank();
    for (uint i = run_first(); i < run_last(); i++) {
        ranks[i] = rank;
        rank += uint(bitCount(masks[i]));
    }
}
