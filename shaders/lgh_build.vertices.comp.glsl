// Ranks, step 3, of vertices, and stream compaction: writes each marked vertex at its rank.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.ranks.glsl.h"

layout(set = 0, binding = 4, scalar) writeonly buffer vertices_block { uint vertices[]; };

void main()
{
    uint rank = run_rank();
    uint c = 0u;
    for (uint words = run_filled(); words != 0u; words &= words - 1u) {
        uint word = run_first() + uint(findLSB(words));
        ranks[word] = rank;
        while (word >= LGH_MASK_OFFSET[c + 1u])
            c++;
        for (uint bits = masks[word]; bits != 0u; bits &= bits - 1u)
            vertices[rank++] = pack_vertex(mask_vertex(c, word << 5 | uint(findLSB(bits))));
    }
}
