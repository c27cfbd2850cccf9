// One iteration of the edge-avoiding a-trous wavelet filter (Dammertz et al. 2010) on a pair (U, S), stopped by
// geometry and, guided by the variances in the alpha channels (Schied et al. 2017), by the values. U and S have the same
// weights, so that S <= U stays true.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "svgf.glsl.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D geometry_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2, rgba32f) uniform readonly image2D unshadowed_map;
layout(set = 0, binding = 3, rgba32f) uniform readonly image2D shadowed_map;
layout(set = 0, binding = 4, rgba32f) uniform writeonly image2D out_unshadowed;
layout(set = 0, binding = 5, rgba32f) uniform writeonly image2D out_shadowed;
layout(push_constant, scalar) uniform push_block {
    int step;
    float light_tolerance; // of U, relative, beyond its noise
    uint any_value;        // 1: not stopped by the values
} push;

const float KERNEL[3] = float[3](3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0); // cubic B-spline
const float NOISE_TOLERANCE = 4.0;  // standard deviations
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

// The light's noise is absolute and so the same for bright and dim pixels, which keeps the mean; beyond it the tolerance is
// relative to the dimmer of the two, so that a bright spot does not decide what is around it.
float value_weight(value_stop center, vec3 unshadowed, vec3 shadowed)
{
    float light = luminance(unshadowed);
    float tolerance = center.light_noise + push.light_tolerance * min(light, center.light) + 1e-30;
    float distance = abs(light - center.light) / tolerance;
    if (light > 0.0 && center.light > 0.0)
        distance += abs(clamp(luminance(shadowed) / light, 0.0, 1.0) - center.ratio) * center.inverse_noise;
    return exp(-distance);
}

void filter_pair(ivec2 pixel, filter_center center, inout vec4 unshadowed, inout vec4 shadowed)
{
    value_stop stop = value_stop_of(unshadowed, shadowed);
    float weights = KERNEL[0] * KERNEL[0];
    vec4 u_sum = unshadowed * vec4(vec3(weights), weights * weights);
    vec4 s_sum = shadowed * vec4(vec3(weights), weights * weights);
    for (int y = -2; y <= 2; y++)
        for (int x = -2; x <= 2; x++) {
            ivec2 tap = pixel + push.step * ivec2(x, y);
            if ((x == 0 && y == 0) || any(greaterThanEqual(uvec2(tap), uvec2(frame.width, frame.height))))
                continue;
            float weight = KERNEL[abs(x)] * KERNEL[abs(y)];
            weight *= filter_geometry_weight(center, tap, imageLoad(geometry_map, tap));
            vec4 u = imageLoad(unshadowed_map, tap), s = imageLoad(shadowed_map, tap);
            if (push.any_value == 0u)
                weight *= value_weight(stop, u.rgb, s.rgb);
            weights += weight;
            u_sum += u * vec4(vec3(weight), weight * weight);
            s_sum += s * vec4(vec3(weight), weight * weight);
        }
    unshadowed = u_sum / vec4(vec3(weights), weights * weights);
    shadowed = s_sum / vec4(vec3(weights), weights * weights);
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
        unshadowed = imageLoad(unshadowed_map, pixel);
        shadowed = imageLoad(shadowed_map, pixel);
        filter_pair(pixel, filter_center_of(pixel, geometry, geometric), unshadowed, shadowed);
    }
    imageStore(out_unshadowed, pixel, unshadowed);
    imageStore(out_shadowed, pixel, shadowed);
}
