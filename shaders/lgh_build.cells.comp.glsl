// Where each occupied cell of S1 starts in the sorted list of VPLs; one more entry ends the last.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) readonly buffer masks_block { uint masks[]; };
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 2, scalar) readonly buffer ranks_block { uint ranks[]; };
layout(set = 0, binding = 4, scalar) readonly buffer keys_block { uint keys[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer starts_block { uint starts[]; };

void main()
{
    uint i = gl_WorkGroupID.y * 65535u * 256u + gl_GlobalInvocationID.x;
    if (i >= header.vpl_count)
        return;
    uint cell = keys[i];
    uint rank = ranks[cell >> 5] + uint(bitCount(masks[cell >> 5] & ((1u << (cell & 31u)) - 1u)));
    if (i == 0u || keys[i - 1u] != cell)
        starts[rank] = i;
    if (i + 1u == header.vpl_count)
        starts[rank + 1u] = header.vpl_count;
}
