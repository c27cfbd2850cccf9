// Adds up the light of a batch's rays that reach their end.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0, scalar) readonly buffer estimates_block { vec3 estimates[]; };
layout(set = 0, binding = 1, scalar) readonly buffer visible_block { uint visible[]; };
layout(set = 0, binding = 2, rgba32f) uniform image2D sum_map;
layout(push_constant, scalar) uniform push_block {
    uint layers; // of the batch
    uint first;  // layers before it, whose sum the image holds
} push;

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, uvec2(frame.width, frame.height))))
        return;
    vec3 sum = push.first == 0u ? vec3(0.0) : imageLoad(sum_map, ivec2(pixel)).rgb;
    uint ray = pixel.y * frame.width + pixel.x;
    for (uint layer = 0u; layer < push.layers; layer++, ray += frame.width * frame.height)
        if (visible[ray] != 0u) // undefined where there is no ray, and no light either
            sum += estimates[ray];
    imageStore(sum_map, ivec2(pixel), vec4(sum, 0.0));
}
