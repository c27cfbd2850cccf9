// Adds this frame's direct light to the second sum.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl.h"

layout(local_size_x = 128) in; // x: pixels in rows from the top
layout(set = 0, binding = 0) uniform sampler2D exact_map;
layout(set = 0, binding = 1) uniform sampler2D sampled_map;
layout(set = 0, binding = 2, scalar) buffer sums_block { vec4 sums[]; };

// What is absent is bound as one texel that stands for every pixel.
vec3 light_at(sampler2D map, ivec2 pixel) { return texelFetch(map, min(pixel, textureSize(map, 0) - 1), 0).rgb; }

void main()
{
    uint index = gl_GlobalInvocationID.x, pixels = frame.width * frame.height;
    if (index >= pixels)
        return;
    ivec2 pixel = ivec2(index % frame.width, index / frame.width);
    sums[pixels + index].rgb += light_at(exact_map, pixel) + light_at(sampled_map, pixel);
}
