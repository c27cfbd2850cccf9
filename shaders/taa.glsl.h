// What is steadied over time: blended with its own history, which is first clipped to what the pixels around show now, so
// that no shadow drags behind (Karis 2014, "High Quality Temporal Supersampling"). Defines main(); includers define
// taa_now(), taa_before() and taa_store() and bind their images from 7 on; limit_map is bound by them too.
#ifndef TAA_GLSL_H
#define TAA_GLSL_H

#include "reproject.glsl.h"
#include "shadow_again.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 7, rgba16f) uniform readonly image2D ratio_now;
layout(set = 0, binding = 10) uniform sampler2D limit_map;
layout(push_constant, scalar) uniform push_block {
    uint history_valid;
    uint has_limit; // 1: limit_map is what shadow_again.limit.comp.glsl makes
    uint hold;      // 1: the last frame's result stays
} push;

vec4 taa_now(ivec2 pixel); // a: its standard deviation
vec4 taa_before(ivec2 pixel); // a: frames
void taa_store(ivec2 pixel, vec4 value);

// The new frame's share. More in the first frames, which are averages over time of the filter's own: the newest is the
// best.
const float SHARE = 0.1, FIRST_FRAMES = 4.0;

// Bounds over the pixels around, widened by the noise that the filter left: what remains after filtering is
// blotches wider than the neighbourhood, which would pull the history along.
void neighbourhood(ivec2 pixel, vec4 now, out vec3 low, out vec3 high)
{
    uvec2 size = uvec2(frame.width, frame.height);
    low = high = now.rgb;
    for (int y = -1; y <= 1; y++)
        for (int x = -1; x <= 1; x++) {
            ivec2 tap = pixel + ivec2(x, y);
            if (any(greaterThanEqual(uvec2(tap), size)))
                continue;
            vec3 value = taa_now(tap).rgb;
            low = min(low, value);
            high = max(high, value);
        }
    low -= 2.0 * now.a;
    high += 2.0 * now.a;
}

// In a the number of frames.
vec4 steadied(ivec2 pixel, gbuffer_point point)
{
    vec4 now = taa_now(pixel);
    reprojection r;
    if (push.history_valid == 0u || !reproject(uvec2(pixel), point, r))
        return vec4(now.rgb, 1.0);
    vec4 before = vec4(0.0);
    for (int i = 0; i < 4; i++)
        if (r.weights[i] > 0.0)
            before += r.weights[i] * taa_before(reprojection_tap(r, i));
    if (push.hold != 0u)
        return before;
    if (push.has_limit != 0u)
        before.a = min(before.a, again_limit(limit_map, reprojection_place(uvec2(pixel))));
    vec3 low, high;
    neighbourhood(pixel, now, low, high);
    float frames = min(before.a + 1.0, FIRST_FRAMES / SHARE);
    float share = clamp(FIRST_FRAMES / frames, SHARE, 1.0);
    return vec4(mix(clamp(before.rgb, low, high), now.rgb, share), frames);
}

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, uvec2(frame.width, frame.height))))
        return;
    gbuffer_point point;
    vec4 value = vec4(1.0);
    if (gbuffer_read(depth_map, normal_map, pixel, point))
        value = steadied(ivec2(pixel), point);
    taa_store(ivec2(pixel), value);
}

#endif
