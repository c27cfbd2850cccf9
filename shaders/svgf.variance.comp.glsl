// Smooths the variances in the pair's alpha channels, which are noisy themselves, over the pixels around, and writes the
// mean luminances of the pair around, which the next frame compares with its own. Takes the weight of isolated spikes.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "svgf.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D geometry_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2, rgba32f) uniform readonly image2D moments_map;
layout(set = 0, binding = 3, rgba32ui) uniform readonly uimage2D pair_map;
layout(set = 0, binding = 4, rgba32ui) uniform writeonly uimage2D out_pair;
layout(set = 0, binding = 5, rg32f) uniform writeonly image2D out_means;
layout(push_constant, scalar) uniform push_block { uint light_shown; } push; // 1: U is shown, not only the ratio

struct smoothed {
    vec2 means;    // luminances of U and S around
    vec2 variance; // of U, and of the ratio
    float brightest_neighbour; // of U, on the same surface; 0: none
};

smoothed smooth_around(ivec2 pixel, filter_center center, uvec4 pair)
{
    uvec2 size = uvec2(frame.width, frame.height);
    // In the first frames each pixel's variance comes from the 3x3 pixels around: what is three pixels away has its own.
    bool settled = imageLoad(moments_map, pixel).w >= SVGF_TEMPORAL_FRAMES;
    int stride = settled ? 1 : 3;
    float weights = 0.0, brightest_neighbour = 0.0;
    float lowest = 1.0, highest = 0.0; // ratio around
    vec2 means = vec2(0.0), variance = vec2(0.0);
    for (int y = -stride; y <= stride; y += stride)
        for (int x = -stride; x <= stride; x += stride) {
            ivec2 tap = pixel + ivec2(x, y);
            if (any(greaterThanEqual(uvec2(tap), size)))
                continue;
            float weight = filter_geometry_weight(center, tap, imageLoad(geometry_map, tap));
            uvec4 tap_pair = imageLoad(pair_map, tap);
            vec4 unshadowed = pair_unshadowed(tap_pair), shadowed = pair_shadowed(tap_pair);
            float u = luminance(unshadowed.rgb), s = luminance(shadowed.rgb);
            weights += weight;
            means += weight * vec2(u, s);
            variance += weight * vec2(unshadowed.a, shadowed.a);
            if ((x != 0 || y != 0) && weight > 0.5 && u > 0.0) {
                brightest_neighbour = max(brightest_neighbour, u);
                lowest = min(lowest, s / u);
                highest = max(highest, s / u);
            }
        }
    smoothed result = smoothed(means / weights, variance / weights, brightest_neighbour); // the pixel weighs about 1
    // A ratio beyond all those around is an error of its own (a ray that slips through a corner in every frame).
    float r = shadow_ratio_luminance(pair_unshadowed(pair).rgb, pair_shadowed(pair).rgb);
    float beyond = settled && lowest <= highest ? max(max(r - highest, lowest - r), 0.0) : 0.0;
    result.variance.y += beyond * beyond;
    return result;
}

// A pixel with more light than all around would decide the ratio of what it is averaged with, and stay as a dark dot
// where it is occluded. Scaling U and S alike leaves its ratio. What the history holds is not touched.
float spike_scale(float light, float brightest_neighbour)
{
    bool spike = push.light_shown == 0u && brightest_neighbour > 0.0 && light > brightest_neighbour;
    return spike ? brightest_neighbour / light : 1.0;
}

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), uvec2(frame.width, frame.height))))
        return;
    vec4 geometry = imageLoad(geometry_map, pixel);
    uvec4 pair = uvec4(0u);
    vec2 means = vec2(0.0);
    if (geometry.w > 0.0) {
        vec3 geometric = octahedral_decode(texelFetch(normal_map, pixel, 0).xy);
        pair = imageLoad(pair_map, pixel);
        smoothed around = smooth_around(pixel, filter_center_of(pixel, geometry, geometric), pair);
        vec3 unshadowed = pair_unshadowed(pair).rgb, shadowed = pair_shadowed(pair).rgb;
        float scale = spike_scale(luminance(unshadowed), around.brightest_neighbour);
        pair = pair_pack(vec4(scale * unshadowed, around.variance.x), vec4(scale * shadowed, around.variance.y));
        means = around.means;
    }
    imageStore(out_pair, pixel, pair);
    imageStore(out_means, pixel, vec4(means, 0.0, 0.0));
}
