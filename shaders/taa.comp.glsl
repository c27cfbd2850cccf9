// The shadow ratio S / U, steadied over time: blended with its own history, which is first clipped to what the pixels
// around show now, so that no shadow drags behind (Karis 2014, "High Quality Temporal Supersampling").
#version 460
#extension GL_GOOGLE_include_directive : require
#include "reproject.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0) uniform sampler2D depth_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2) uniform sampler2D motion_map;
layout(set = 0, binding = 3) uniform sampler2D previous_depth;
layout(set = 0, binding = 4) uniform sampler2D previous_normals;
layout(set = 0, binding = 5, rgba16f) uniform readonly image2D ratio_now;
layout(set = 0, binding = 6, rgba16f) uniform readonly image2D previous_ratio;
layout(set = 0, binding = 7, rgba16f) uniform writeonly image2D ratio_map;
layout(push_constant, scalar) uniform push_block { uint history_valid; } push;

// The new frame's share. More in the first frames, which are averages over time of the filter's own: the newest is the
// best.
const float SHARE = 0.1, FIRST_FRAMES = 4.0;

// Bounds of the ratio over the pixels around, widened by the noise that the filter left: what remains after filtering is
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
            vec3 ratio = imageLoad(ratio_now, tap).rgb;
            low = min(low, ratio);
            high = max(high, ratio);
        }
    low -= 2.0 * now.a;
    high += 2.0 * now.a;
}

// The ratio, and in a the number of frames in it.
vec4 steadied(ivec2 pixel, gbuffer_point point)
{
    vec4 now = imageLoad(ratio_now, pixel);
    vec2 motion = texelFetch(motion_map, pixel, 0).xy;
    reprojection r;
    if (push.history_valid == 0u || !reproject(uvec2(pixel), point, motion, previous_depth, previous_normals, r))
        return vec4(now.rgb, 1.0);
    vec4 before = vec4(0.0);
    for (int i = 0; i < 4; i++)
        if (r.weights[i] > 0.0)
            before += r.weights[i] * imageLoad(previous_ratio, reprojection_tap(r, i));
    vec3 low, high;
    neighbourhood(pixel, now, low, high);
    float frames = min(before.a + 1.0, FIRST_FRAMES / SHARE);
    float share = clamp(FIRST_FRAMES / frames, SHARE, 1.0);
    return vec4(clamp(mix(clamp(before.rgb, low, high), now.rgb, share), 0.0, 1.0), frames);
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
