// Marks the occupied cells of S1, by Morton code: the first VPL of each cell in the sorted list does it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) buffer masks_block { uint masks[]; };
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 4, scalar) readonly buffer keys_block { uint keys[]; };
layout(set = 0, binding = 5, scalar) buffer filled_block { uint filled[]; };

void main()
{
    uint i = gl_WorkGroupID.y * 65535u * 256u + gl_GlobalInvocationID.x;
    if (i >= header.vpl_count)
        return;
    uint cell = keys[i], word = cell >> 5;
    if (i > 0u && keys[i - 1u] == cell)
        return;
    if (atomicOr(masks[word], 1u << (cell & 31u)) == 0u)
        atomicOr(filled[word >> 5], 1u << (word & 31u));
}
