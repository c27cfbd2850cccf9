// What the steps of the filter share. The filter steers by two values: the ratio r = S / U, which lies in [0,1] however
// many decades the light spans, and U itself. Their variances follow from the second moments E[U U], E[S U], E[S S] of
// luminances by linearisation (delta method):
//     Var(r) = E[(S - r U)^2] / E[U]^2        Var(U) / E[U]^2 = E[U^2] / E[U]^2 - 1
#ifndef SVGF_GLSL_H
#define SVGF_GLSL_H

#include "filter_geometry.glsl.h"
#include "ratio.glsl.h"

// Frames below which a variance over time means nothing.
const float SVGF_TEMPORAL_FRAMES = 4.0;

// Independent frames that a history is worth: as many as it counts.
float svgf_frames(float frames) { return max(frames, 1.0); }

// (Var(r), Var(U) / E[U]^2) of one sample from the means of U and S and the second moments (UU, SU, SS).
vec2 svgf_variance(float unshadowed, float shadowed, vec3 moments)
{
    if (unshadowed <= 0.0)
        return vec2(1.0);
    vec3 relative = moments / max(unshadowed * unshadowed, 1e-37);
    float r = shadowed / unshadowed;
    float ratio = dot(vec3(r * r, -2.0 * r, 1.0), relative);
    return clamp(vec2(ratio, relative.x - 1.0), vec2(0.0), vec2(1.0, 1e3));
}

// Of U and of the ratio of what is accumulated, from the variances of one sample.
vec2 svgf_mean_variance(vec2 variance, float unshadowed, float frames)
{
    return vec2(variance.y * unshadowed * unshadowed, variance.x) / svgf_frames(frames);
}

// ---- The pair between the steps of one frame: a word per channel, U's upper 16 bits and S's (float32 cut to 8 bits of
// precision, as bfloat16). One load a tap in place of two; rounding is monotonous, so S <= U stays true.
// In alpha the variances: of U, and of the ratio.

uvec4 pair_pack(vec4 unshadowed, vec4 shadowed)
{
    uvec4 u = floatBitsToUint(min(unshadowed, 3e38)) + 0x8000u, s = floatBitsToUint(min(shadowed, 3e38)) + 0x8000u;
    return (u & 0xffff0000u) | (s >> 16);
}
vec4 pair_unshadowed(uvec4 pair) { return uintBitsToFloat(pair & 0xffff0000u); }
vec4 pair_shadowed(uvec4 pair) { return uintBitsToFloat(pair << 16); }

#endif
