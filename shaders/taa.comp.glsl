// The shadow ratio S / U, steadied over time: blended with its own history, which is first clipped to what the pixels
// around show now, so that no shadow drags behind (Karis 2014, "High Quality Temporal Supersampling").
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ratio.glsl.h"
#include "reproject.glsl.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform sampler2D depth_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2) uniform sampler2D motion_map;
layout(set = 0, binding = 3) uniform sampler2D previous_depth;
layout(set = 0, binding = 4) uniform sampler2D previous_normals;
layout(set = 0, binding = 5, rgba32f) uniform readonly image2D unshadowed_map;
layout(set = 0, binding = 6, rgba32f) uniform readonly image2D shadowed_map;
layout(set = 0, binding = 7, rgba16f) uniform readonly image2D previous_ratio;
layout(set = 0, binding = 8, rgba16f) uniform writeonly image2D ratio_map;
layout(push_constant, scalar) uniform push_block { uint history_valid; } push;

// The new frame's share. More in the first frames, which are averages over time of the filter's own: the newest is the best.
const float SHARE = 0.1, FIRST_FRAMES = 4.0;

// Bounds of the ratio over the lit pixels around, widened by the noise that the filter left (its variance is in S.a):
// what remains after filtering is blotches wider than the neighbourhood, which would pull the history along.
void neighbourhood(ivec2 pixel, vec3 ratio, out vec3 low, out vec3 high)
{
    low = high = ratio;
    for (int y = -1; y <= 1; y++)
        for (int x = -1; x <= 1; x++) {
            ivec2 tap = pixel + ivec2(x, y);
            if (any(greaterThanEqual(uvec2(tap), uvec2(frame.width, frame.height))))
                continue;
            vec3 u = imageLoad(unshadowed_map, tap).rgb;
            if (luminance(u) <= 0.0)
                continue;
            vec3 tap_ratio = shadow_ratio(u, imageLoad(shadowed_map, tap).rgb);
            low = min(low, tap_ratio);
            high = max(high, tap_ratio);
        }
    float noise = 2.0 * sqrt(imageLoad(shadowed_map, pixel).a);
    low -= noise;
    high += noise;
}

// The ratio, and in a the number of frames in it.
vec4 steadied(ivec2 pixel, gbuffer_point point)
{
    vec3 ratio = shadow_ratio(imageLoad(unshadowed_map, pixel).rgb, imageLoad(shadowed_map, pixel).rgb);
    vec2 motion = texelFetch(motion_map, pixel, 0).xy;
    reprojection r;
    if (push.history_valid == 0u || !reproject(uvec2(pixel), point, motion, previous_depth, previous_normals, r))
        return vec4(ratio, 1.0);
    vec4 before = vec4(0.0);
    for (int i = 0; i < 4; i++)
        if (r.weights[i] > 0.0)
            before += r.weights[i] * imageLoad(previous_ratio, reprojection_tap(r, i));
    vec3 low, high;
    neighbourhood(pixel, ratio, low, high);
    float frames = min(before.a + 1.0, FIRST_FRAMES / SHARE);
    float share = clamp(FIRST_FRAMES / frames, SHARE, 1.0);
    return vec4(clamp(mix(clamp(before.rgb, low, high), ratio, share), 0.0, 1.0), frames);
}

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, uvec2(frame.width, frame.height))))
        return;
    gbuffer_point point;
    vec4 ratio = vec4(1.0);
    if (gbuffer_read(depth_map, normal_map, pixel, point))
        ratio = steadied(ivec2(pixel), point);
    imageStore(ratio_map, ivec2(pixel), ratio);
}
