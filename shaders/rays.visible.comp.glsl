// Answers a batch of rays by ray query: is anything in the way?
#version 460
#extension GL_GOOGLE_include_directive : require
#include "rays_trace.glsl.h"

layout(set = 0, binding = 3, scalar) writeonly buffer visible_block { uint visible[]; };

void main()
{
    uint i;
    if (!ray_of(gl_GlobalInvocationID.x, i))
        return;
    vec4 origin = origins[i];
    if (origin.w > 0.0)
        visible[i] = uint(ray_visible(origin.xyz, directions[i].xyz, origin.w));
}
