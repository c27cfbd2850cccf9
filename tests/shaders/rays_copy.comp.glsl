// Makes a batch of rays from a list: origin and reach, then direction.
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAY_ORIGINS_BINDING 1
#include "../../shaders/rays.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer list_block { vec4 list[]; };
layout(push_constant, scalar) uniform push_block { uint count; } push;

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i < push.count)
        ray_write(i, list[2u * i].xyz, list[2u * i + 1u].xyz, list[2u * i].w);
}
