// Empties the mask of S1's cells, as much of it as this frame's grid needs.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) writeonly buffer masks_block { uint masks[]; };
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };

void main()
{
    if (header.level_count > 0u && gl_GlobalInvocationID.x < cell_words(header.level_count - 1u))
        masks[gl_GlobalInvocationID.x] = 0u;
}
