// Temporal accumulation of a pair (U, S) with the same weights for both, and of the second moments of their luminances.
// U.a: 1 where there is no sample in this frame, and the history stays as it is.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "reproject.glsl.h"
#include "svgf.glsl.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform sampler2D depth_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2) uniform sampler2D motion_map;
layout(set = 0, binding = 3) uniform sampler2D previous_depth;
layout(set = 0, binding = 4) uniform sampler2D previous_normals;
layout(set = 0, binding = 5, rgba32f) uniform readonly image2D unshadowed_map;
layout(set = 0, binding = 6, rgba32f) uniform readonly image2D shadowed_map;
layout(set = 0, binding = 7, rgba32f) uniform readonly image2D previous_unshadowed;
layout(set = 0, binding = 8, rgba32f) uniform readonly image2D previous_shadowed;
layout(set = 0, binding = 9, rgba32f) uniform readonly image2D previous_moments;
layout(set = 0, binding = 10, rgba32f) uniform writeonly image2D accumulated_unshadowed;
layout(set = 0, binding = 11, rgba32f) uniform writeonly image2D accumulated_shadowed;
layout(set = 0, binding = 12, rgba32f) uniform writeonly image2D accumulated_moments;
layout(set = 0, binding = 13, rgba32f) uniform readonly image2D geometry_map;
layout(push_constant, scalar) uniform push_block {
    uint history_valid;
    uint light_shown; // 1: U is shown, not only the ratio
} push;

struct accumulated {
    vec4 unshadowed, shadowed;
    vec4 moments; // UU, SU, SS, and the number of frames
};

// The pixels around on the same surface, this one included, in this frame and in the history.
struct surroundings {
    float count;
    vec2 now, before;          // sums of the luminances of U and S
    vec3 moments;              // sums of UU, SU, SS in this frame
    float brightest_neighbour; // of U in this frame; on any surface
};

bool inside(ivec2 pixel) { return all(lessThan(uvec2(pixel), uvec2(frame.width, frame.height))); }

vec2 pair_now(ivec2 pixel)
{
    return vec2(luminance(imageLoad(unshadowed_map, pixel).rgb), luminance(imageLoad(shadowed_map, pixel).rgb));
}

bool is_sampled(ivec2 pixel) { return imageLoad(unshadowed_map, pixel).a == 0.0; }

// `past` is the pixel's place in the last frame.
surroundings surroundings_of(ivec2 pixel, ivec2 past, gbuffer_point point)
{
    filter_center center = filter_center_of(pixel, vec4(point.shading, point.view_z), point.geometric);
    surroundings around = surroundings(0.0, vec2(0.0), vec2(0.0), vec3(0.0), 0.0);
    for (int y = -1; y <= 1; y++)
        for (int x = -1; x <= 1; x++) {
            ivec2 tap = pixel + ivec2(x, y), past_tap = past + ivec2(x, y);
            if (!inside(tap) || !is_sampled(tap))
                continue;
            vec2 now = pair_now(tap);
            if (x != 0 || y != 0)
                around.brightest_neighbour = max(around.brightest_neighbour, now.x);
            if (!inside(past_tap) || filter_geometry_weight(center, tap, imageLoad(geometry_map, tap)) < 0.5)
                continue;
            around.now += now;
            around.moments += vec3(now.x * now.x, now.y * now.x, now.y * now.y);
            around.before += vec2(luminance(imageLoad(previous_unshadowed, past_tap).rgb),
                                  luminance(imageLoad(previous_shadowed, past_tap).rgb));
            around.count += 1.0;
        }
    return around;
}

// This frame's pair. An isolated spike (a sample that ended close by) would decide the ratio of all pixels around; both
// U and S are scaled down, which leaves its ratio and takes its weight. Not where the loss of light would be seen.
accumulated current(ivec2 pixel, float brightest_neighbour)
{
    const float SPIKE = 4.0; // lower limits cost more light: at 1 the ratio was 0.02 too low
    vec3 u = imageLoad(unshadowed_map, pixel).rgb, s = imageLoad(shadowed_map, pixel).rgb;
    float limit = SPIKE * brightest_neighbour, peak = luminance(u);
    if (push.light_shown == 0u && limit > 0.0 && peak > limit) {
        u *= limit / peak;
        s *= limit / peak;
    }
    float light = luminance(u), shadowed = luminance(s);
    return accumulated(vec4(u, 0.0), vec4(s, 0.0), vec4(light * light, shadowed * light, shadowed * shadowed, 1.0));
}

accumulated history(reprojection r)
{
    accumulated sum = accumulated(vec4(0.0), vec4(0.0), vec4(0.0));
    for (int i = 0; i < 4; i++) {
        if (r.weights[i] == 0.0)
            continue;
        ivec2 tap = reprojection_tap(r, i);
        sum.unshadowed += r.weights[i] * imageLoad(previous_unshadowed, tap);
        sum.shadowed += r.weights[i] * imageLoad(previous_shadowed, tap);
        sum.moments += r.weights[i] * imageLoad(previous_moments, tap);
    }
    return sum;
}

// How much of the history still holds, so that a change of light or of a shadow leaves no lag: 1 while what the
// surroundings show now lies within three standard deviations of what they showed, 0 from five on (of a bright past even
// a small rest would outshine what is dim now).
float agreement(surroundings around, accumulated before)
{
    const float KEPT = 3.0 * 3.0, DROPPED = 5.0 * 5.0, TOLERANCE = 0.05;
    if (around.before.x <= 0.0)
        return around.now.x <= 0.0 ? 1.0 : 0.0;
    // The larger of what the pixel showed over time and of what the pixels around show now: either is too small by chance.
    float u = luminance(before.unshadowed.rgb), s = luminance(before.shadowed.rgb), n = around.count;
    vec2 variance = max(svgf_variance(u, s, before.moments.xyz),
                        svgf_variance(around.now.x / n, around.now.y / n, around.moments / n));
    variance *= (1.0 + 1.0 / svgf_frames(before.moments.w)) / n;
    // Nothing now may be chance, where few samples find light.
    vec2 off = vec2(0.0, log(max(around.now.x / around.before.x, 0.01)));
    if (around.now.x > 0.0)
        off.x = around.now.y / around.now.x - around.before.y / around.before.x;
    vec2 squares = off * off / (variance + TOLERANCE * TOLERANCE);
    return clamp((DROPPED - max(squares.x, squares.y)) / (DROPPED - KEPT), 0.0, 1.0);
}

accumulated accumulate(ivec2 pixel, gbuffer_point point)
{
    vec2 motion = texelFetch(motion_map, pixel, 0).xy;
    surroundings around = surroundings_of(pixel, ivec2(floor(vec2(pixel) + motion + 0.5)), point);
    accumulated now = current(pixel, around.brightest_neighbour);
    reprojection r;
    if (push.history_valid == 0u || !reproject(uvec2(pixel), point, motion, previous_depth, previous_normals, r))
        return is_sampled(pixel) ? now : accumulated(vec4(0.0), vec4(0.0), vec4(0.0));
    accumulated before = history(r);
    float kept = around.count > 0.0 ? before.moments.w * agreement(around, before) : before.moments.w;
    if (!is_sampled(pixel))
        return accumulated(before.unshadowed, before.shadowed, vec4(before.moments.xyz, kept));
    float frames = min(kept + 1.0, 2.0 / SVGF_SHARE);
    float share = max(1.0 / frames, SVGF_SHARE);
    return accumulated(mix(before.unshadowed, now.unshadowed, share), mix(before.shadowed, now.shadowed, share),
                       vec4(mix(before.moments.xyz, now.moments.xyz, share), frames));
}

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, uvec2(frame.width, frame.height))))
        return;
    accumulated result = accumulated(vec4(0.0), vec4(0.0), vec4(0.0));
    gbuffer_point point;
    if (gbuffer_read(depth_map, normal_map, pixel, point))
        result = accumulate(ivec2(pixel), point);
    imageStore(accumulated_unshadowed, ivec2(pixel), result.unshadowed);
    imageStore(accumulated_shadowed, ivec2(pixel), result.shadowed);
    imageStore(accumulated_moments, ivec2(pixel), result.moments);
}
