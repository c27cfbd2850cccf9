// One iteration of the edge-avoiding a-trous wavelet filter (Dammertz et al. 2010) on a pair (U, S), stopped by
// geometry and, guided by the variances in the alpha channels (Schied et al. 2017), by the values. U and S have the same
// weights, so that S <= U stays true. Defines main(); includers define pair_store() and bind its images from 3 on.
#ifndef SVGF_ATROUS_GLSL_H
#define SVGF_ATROUS_GLSL_H

#include "svgf.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D geometry_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2, rgba32ui) uniform readonly uimage2D pair_map;
layout(push_constant, scalar) uniform push_block {
    int step;
    float light_tolerance; // of U, relative, beyond its noise
    uint any_value;        // 1: not stopped by the values
} push;

void pair_store(ivec2 pixel, vec4 unshadowed, vec4 shadowed);

// Standard deviations. Relative L2 error with 4 and 6, one sample a pixel after 8 frames, 320x180: in the atrium 0.0981
// and 0.0963, in the kitchen 0.0938 and 0.0957; with 4 dark dots stay on the atrium's floor.
const float NOISE_TOLERANCE = 6.0;
const float RATIO_TOLERANCE = 0.01; // beyond the ratio's noise

struct value_stop {
    float light; // luminance of U
    float ratio;
    float light_noise;    // tolerated difference of U
    float inverse_noise;  // reciprocal of that of the ratio
};

value_stop value_stop_of(vec4 unshadowed, vec4 shadowed)
{
    return value_stop(luminance(unshadowed.rgb), shadow_ratio_luminance(unshadowed.rgb, shadowed.rgb),
                      NOISE_TOLERANCE * sqrt(unshadowed.a),
                      1.0 / (NOISE_TOLERANCE * sqrt(shadowed.a) + RATIO_TOLERANCE));
}

// exp2 of its negative is the weight. The light's noise is absolute and so the same for bright and dim pixels, which keeps
// the mean; beyond it the tolerance is relative to the dimmer of the two, so that a bright spot does not decide what is
// around it.
float value_distance(value_stop center, vec3 unshadowed, vec3 shadowed)
{
    const float LOG2_E = 1.442695;
    float light = luminance(unshadowed);
    float tolerance = center.light_noise + push.light_tolerance * min(light, center.light) + 1e-30;
    float distance = abs(light - center.light) / tolerance;
    if (light > 0.0 && center.light > 0.0)
        distance += abs(clamp(luminance(shadowed) / light, 0.0, 1.0) - center.ratio) * center.inverse_noise;
    return LOG2_E * distance;
}

// The kernel is (1 2 1) / 4 each way: like the usual (1 4 6 4 1) / 16 it cancels all that repeats every two steps, with 8
// taps in place of 24.
void filter_pair(ivec2 pixel, filter_center center, inout vec4 unshadowed, inout vec4 shadowed)
{
    uvec2 size = uvec2(frame.width, frame.height);
    value_stop stop = value_stop_of(unshadowed, shadowed);
    float weights = 1.0;
    for (int y = -1; y <= 1; y++)
        for (int x = -1; x <= 1; x++) {
            ivec2 tap = pixel + push.step * ivec2(x, y);
            if ((x == 0 && y == 0) || any(greaterThanEqual(uvec2(tap), size)))
                continue;
            vec4 geometry = imageLoad(geometry_map, tap);
            uvec4 pair = imageLoad(pair_map, tap);
            vec4 u = pair_unshadowed(pair), s = pair_shadowed(pair);
            float distance = filter_plane_distance2(center, tap, geometry);
            if (push.any_value == 0u)
                distance += value_distance(stop, u.rgb, s.rgb);
            float weight = (x == 0 || y == 0 ? 0.5 : 0.25) * filter_normal_weight(center, geometry) * exp2(-distance);
            weights += weight;
            unshadowed += u * vec4(vec3(weight), weight * weight);
            shadowed += s * vec4(vec3(weight), weight * weight);
        }
    unshadowed /= vec4(vec3(weights), weights * weights);
    shadowed /= vec4(vec3(weights), weights * weights);
}

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), uvec2(frame.width, frame.height))))
        return;
    vec4 geometry = imageLoad(geometry_map, pixel);
    vec4 unshadowed = vec4(0.0), shadowed = vec4(0.0);
    if (geometry.w > 0.0) {
        vec3 geometric = octahedral_decode(texelFetch(normal_map, pixel, 0).xy);
        uvec4 pair = imageLoad(pair_map, pixel);
        unshadowed = pair_unshadowed(pair);
        shadowed = pair_shadowed(pair);
        filter_pair(pixel, filter_center_of(pixel, geometry, geometric), unshadowed, shadowed);
    }
    pair_store(pixel, unshadowed, shadowed);
}

#endif
