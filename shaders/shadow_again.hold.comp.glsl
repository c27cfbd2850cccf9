// The last frame's records as they are, where this frame takes no samples. One invocation a stratum.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shadow_again.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer before_block { shadow_record before[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer records_block { shadow_record records[]; };

void main()
{
    uint index = gl_GlobalInvocationID.x;
    if (index < again_size().x * again_size().y)
        records[index] = before[index];
}
