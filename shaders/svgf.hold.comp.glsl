// The history as it is, where the picture is still and the history full: see renderer_is_settled.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "svgf.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D previous_unshadowed;
layout(set = 0, binding = 1, rgba32f) uniform readonly image2D previous_shadowed;
layout(set = 0, binding = 2, rgba32f) uniform readonly image2D previous_moments;
layout(set = 0, binding = 3, rgba32f) uniform writeonly image2D accumulated_unshadowed;
layout(set = 0, binding = 4, rgba32f) uniform writeonly image2D accumulated_shadowed;
layout(set = 0, binding = 5, rgba32f) uniform writeonly image2D accumulated_moments;
layout(set = 0, binding = 6, rgba32ui) uniform writeonly uimage2D out_pair;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), uvec2(frame.width, frame.height))))
        return;
    vec4 unshadowed = imageLoad(previous_unshadowed, pixel), shadowed = imageLoad(previous_shadowed, pixel);
    vec4 moments = imageLoad(previous_moments, pixel);
    imageStore(accumulated_unshadowed, pixel, unshadowed);
    imageStore(accumulated_shadowed, pixel, shadowed);
    imageStore(accumulated_moments, pixel, moments);
    float light = luminance(unshadowed.rgb);
    vec2 variance = svgf_variance(light, luminance(shadowed.rgb), moments.xyz);
    variance = svgf_mean_variance(variance, light, moments.w);
    imageStore(out_pair, pixel, pair_pack(vec4(unshadowed.rgb, variance.x), vec4(shadowed.rgb, variance.y)));
}
