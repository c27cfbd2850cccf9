// An iteration whose result the next one reads.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "svgf.atrous.glsl.h"

layout(set = 0, binding = 3, rgba32ui) uniform writeonly uimage2D out_pair;

void pair_store(ivec2 pixel, vec4 unshadowed, vec4 shadowed)
{
    imageStore(out_pair, pixel, pair_pack(unshadowed, shadowed));
}
