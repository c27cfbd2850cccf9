// The last iteration, where the pair itself is wanted.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "svgf.atrous.glsl.h"

layout(set = 0, binding = 3, rgba32f) uniform writeonly image2D out_unshadowed;
layout(set = 0, binding = 4, rgba32f) uniform writeonly image2D out_shadowed;

void pair_store(ivec2 pixel, vec4 unshadowed, vec4 shadowed)
{
    imageStore(out_unshadowed, pixel, unshadowed);
    imageStore(out_shadowed, pixel, shadowed);
}
