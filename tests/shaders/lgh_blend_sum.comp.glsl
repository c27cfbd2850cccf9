// The blending functions of all levels at one distance, summed: distance i of many, for one alpha and level count.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LGH_BLEND_CONSTANT 0
#include "../../shaders/lgh_shade.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) writeonly buffer sums_block { float sums[]; };
layout(push_constant, scalar) uniform push_block { uint count, levels, start_level; float alpha; } push;

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count)
        return;
    float d = 3.0 * push.alpha * float(i) / float(push.count); // h_top = 1
    uint lowest = push.start_level == 0u ? push.levels : push.levels - 1u;
    float sum = 0.0;
    for (uint c = 0u; c <= lowest; c++)
        sum += lgh_blend(blend_kind(c, lowest), d, push.alpha / float(1u << c));
    sums[i] = sum;
}
