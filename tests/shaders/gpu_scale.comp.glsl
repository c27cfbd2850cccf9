// out = in * factor + the scene's first word, for the first `count` elements.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gpu_test.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer input_block { uint input_values[]; };
layout(set = 0, binding = 3, scalar) writeonly buffer output_block { uint output_values[]; };
layout(set = 1, binding = 2, scalar) readonly buffer scene_block { uint scene_values[]; };
layout(push_constant, scalar) uniform push_block { uint count, factor; };

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i < count)
        output_values[i] = scale(input_values[i], factor) + scene_values[0];
}
