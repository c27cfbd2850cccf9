// Variance of the accumulated pair, into the alpha channels: U.a = Var(U), S.a = Var(S / U). From the moments over
// time, averaged over the nearest pixels since they are noisy themselves; from the moments over the neighbourhood in the
// first frames after a disocclusion.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "svgf.glsl.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D geometry_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2, rgba32f) uniform readonly image2D unshadowed_map;
layout(set = 0, binding = 3, rgba32f) uniform readonly image2D shadowed_map;
layout(set = 0, binding = 4, rgba32f) uniform readonly image2D moments_map;
layout(set = 0, binding = 5, rgba32f) uniform writeonly image2D out_unshadowed;
layout(set = 0, binding = 6, rgba32f) uniform writeonly image2D out_shadowed;

const float FRAMES_MIN = 4.0; // below, a variance over time means nothing

vec2 variance_at(ivec2 pixel, filter_center center, float frames)
{
    bool spatial = frames < FRAMES_MIN;
    int radius = spatial ? 3 : 1;
    float weights = 0.0, u_sum = 0.0, s_sum = 0.0;
    vec3 moments_sum = vec3(0.0);
    vec2 temporal_sum = vec2(0.0);
    float lowest = 1.0, highest = 0.0; // ratio around
    for (int y = -radius; y <= radius; y++)
        for (int x = -radius; x <= radius; x++) {
            ivec2 tap = pixel + ivec2(x, y);
            if (any(greaterThanEqual(uvec2(tap), uvec2(frame.width, frame.height))))
                continue;
            float weight = filter_geometry_weight(center, tap, imageLoad(geometry_map, tap));
            float u = luminance(imageLoad(unshadowed_map, tap).rgb), s = luminance(imageLoad(shadowed_map, tap).rgb);
            weights += weight;
            u_sum += weight * u;
            s_sum += weight * s;
            if (spatial) {
                moments_sum += weight * vec3(u * u, s * u, s * s);
            } else {
                vec4 moments = imageLoad(moments_map, tap);
                temporal_sum += weight * svgf_variance(u, s, moments.xyz) * vec2(1.0, u * u) / svgf_frames(moments.w);
                if ((x != 0 || y != 0) && weight > 0.5 && u > 0.0) {
                    lowest = min(lowest, s / u);
                    highest = max(highest, s / u);
                }
            }
        }
    if (weights <= 0.0)
        return vec2(1.0);
    if (spatial) {
        float u = u_sum / weights;
        return svgf_variance(u, s_sum / weights, moments_sum / weights) * vec2(1.0, u * u);
    }
    // A ratio beyond all those around is an error of its own (a ray that slips through a corner in every frame).
    float r = shadow_ratio_luminance(imageLoad(unshadowed_map, pixel).rgb, imageLoad(shadowed_map, pixel).rgb);
    float beyond = lowest <= highest ? max(r - highest, lowest - r) : 0.0;
    return temporal_sum / weights + vec2(beyond > 0.0 ? beyond * beyond : 0.0, 0.0);
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
        filter_center center = filter_center_of(pixel, geometry, geometric);
        vec2 variance = variance_at(pixel, center, imageLoad(moments_map, pixel).w);
        unshadowed = vec4(imageLoad(unshadowed_map, pixel).rgb, variance.y);
        shadowed = vec4(imageLoad(shadowed_map, pixel).rgb, variance.x);
    }
    imageStore(out_unshadowed, pixel, unshadowed);
    imageStore(out_shadowed, pixel, shadowed);
}
