// The last iteration, where only the ratio counts: S / U, and in a the standard deviation that the filter estimates to
// remain.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "svgf.atrous.glsl.h"

layout(set = 0, binding = 3, rgba16f) uniform writeonly image2D out_ratio;

void pair_store(ivec2 pixel, vec4 unshadowed, vec4 shadowed)
{
    imageStore(out_ratio, pixel, vec4(shadow_ratio(unshadowed.rgb, shadowed.rgb), sqrt(shadowed.a)));
}
