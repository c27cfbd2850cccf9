// Stream compaction: writes each marked vertex at its rank.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"

layout(local_size_x = 256) in; // enough for the finest masks in one row of workgroups
layout(set = 0, binding = 0, scalar) readonly buffer masks_block { uint masks[]; };
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 2, scalar) readonly buffer ranks_block { uint ranks[]; };
layout(set = 0, binding = 4, scalar) writeonly buffer vertices_block { uint vertices[]; };

void main()
{
    uint word = gl_GlobalInvocationID.x;
    if (word >= header.word_count)
        return;
    uint c = 0u;
    while (word >= LGH_MASK_OFFSET[c + 1u])
        c++;
    uint rank = ranks[word];
    for (uint bits = masks[word]; bits != 0u; bits &= bits - 1u)
        vertices[rank++] = pack_vertex(mask_vertex(c, word << 5 | uint(findLSB(bits))));
}
