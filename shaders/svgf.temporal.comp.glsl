// Temporal accumulation of a pair (U, S) with the same weights for both, and of the second moments of their luminances.
// U.a: 1 where there is no sample in this frame, and the history stays as it is.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "reproject.glsl.h"
#include "shadow_again.glsl.h"
#include "svgf.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 7, rgba32f) uniform readonly image2D geometry_map;
layout(set = 0, binding = 8, rgba32f) uniform readonly image2D unshadowed_map;
layout(set = 0, binding = 9, rgba32f) uniform readonly image2D shadowed_map;
layout(set = 0, binding = 10, rgba32f) uniform readonly image2D previous_unshadowed;
layout(set = 0, binding = 11, rgba32f) uniform readonly image2D previous_shadowed;
layout(set = 0, binding = 12, rgba32f) uniform readonly image2D previous_moments;
layout(set = 0, binding = 13, rg32f) uniform readonly image2D previous_means;
layout(set = 0, binding = 14, rgba32f) uniform writeonly image2D accumulated_unshadowed;
layout(set = 0, binding = 15, rgba32f) uniform writeonly image2D accumulated_shadowed;
layout(set = 0, binding = 16, rgba32f) uniform writeonly image2D accumulated_moments;
layout(set = 0, binding = 17, rgba32ui) uniform writeonly uimage2D out_pair;
layout(set = 0, binding = 18) uniform sampler2D limit_map;
layout(push_constant, scalar) uniform push_block {
    uint history_valid;
    uint light_shown;  // 1: U is shown, not only the ratio
    uint has_limit;    // 1: limit_map is what shadow_again.limit.comp.glsl makes
    float frames_max;  // that a history counts
    float share_min;   // of a new frame
} push;

struct accumulated {
    vec3 unshadowed, shadowed;
    vec4 moments; // UU, SU, SS, and the number of frames
};

// This frame's pixels around on the same surface, this one included.
struct surroundings {
    float count;   // sum of the weights; 0: no sample around
    vec2 means;    // of the luminances of U and S
    vec3 moments;  // means of UU, SU, SS
    float brightest_neighbour; // of U; on any surface
};

vec2 pair_now(ivec2 pixel)
{
    return vec2(luminance(imageLoad(unshadowed_map, pixel).rgb), luminance(imageLoad(shadowed_map, pixel).rgb));
}

bool is_sampled(ivec2 pixel) { return imageLoad(unshadowed_map, pixel).a == 0.0; }

surroundings surroundings_of(ivec2 pixel, gbuffer_point point)
{
    uvec2 size = uvec2(frame.width, frame.height);
    filter_center center = filter_center_of(pixel, vec4(point.shading, point.view_z), point.geometric);
    surroundings around = surroundings(0.0, vec2(0.0), vec3(0.0), 0.0);
    for (int y = -1; y <= 1; y++)
        for (int x = -1; x <= 1; x++) {
            ivec2 tap = pixel + ivec2(x, y);
            if (any(greaterThanEqual(uvec2(tap), size)) || !is_sampled(tap))
                continue;
            vec2 now = pair_now(tap);
            if (x != 0 || y != 0)
                around.brightest_neighbour = max(around.brightest_neighbour, now.x);
            float weight = filter_geometry_weight(center, tap, imageLoad(geometry_map, tap));
            around.count += weight;
            around.means += weight * now;
            around.moments += weight * vec3(now.x * now.x, now.y * now.x, now.y * now.y);
        }
    // The pixel itself weighs about 1, where it has a sample.
    around.means /= max(around.count, 1e-6);
    around.moments /= max(around.count, 1e-6);
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
    return accumulated(u, s, vec4(light * light, shadowed * light, shadowed * shadowed, 1.0));
}

// `means`: luminances of U and S around, as the last frame had accumulated them.
accumulated history(reprojection r, out vec2 means)
{
    accumulated sum = accumulated(vec3(0.0), vec3(0.0), vec4(0.0));
    means = vec2(0.0);
    for (int i = 0; i < 4; i++) {
        if (r.weights[i] == 0.0)
            continue;
        ivec2 tap = reprojection_tap(r, i);
        sum.unshadowed += r.weights[i] * imageLoad(previous_unshadowed, tap).rgb;
        sum.shadowed += r.weights[i] * imageLoad(previous_shadowed, tap).rgb;
        sum.moments += r.weights[i] * imageLoad(previous_moments, tap);
        means += r.weights[i] * imageLoad(previous_means, tap).xy;
    }
    return sum;
}

// How much of the history still holds, so that a change of light or of a shadow leaves no lag: 1 while what the
// surroundings show now lies within three standard deviations of what they showed, 0 from five on (of a bright past even
// a small rest would outshine what is dim now).
float agreement(surroundings around, accumulated before, vec2 means_before)
{
    const float KEPT = 3.0 * 3.0, DROPPED = 5.0 * 5.0, TOLERANCE = 0.05;
    if (means_before.x <= 0.0)
        return around.means.x <= 0.0 ? 1.0 : 0.0;
    // The larger of what the pixel showed over time and of what the pixels around show now: either is too small by chance.
    vec2 variance = max(svgf_variance(luminance(before.unshadowed), luminance(before.shadowed), before.moments.xyz),
                        svgf_variance(around.means.x, around.means.y, around.moments));
    // Nor do n frames that were all lit rule out a shadow in the next (rule of succession: p = (n + 1) / (n + 2)).
    float n = before.moments.w;
    variance.x = max(variance.x, (n + 1.0) / ((n + 2.0) * (n + 2.0)));
    variance *= (1.0 + 1.0 / svgf_frames(before.moments.w)) / around.count;
    // Nothing now may be chance, where few samples find light.
    vec2 off = vec2(0.0, log(max(around.means.x / means_before.x, 0.01)));
    if (around.means.x > 0.0)
        off.x = around.means.y / around.means.x - means_before.y / means_before.x;
    vec2 squares = off * off / (variance + TOLERANCE * TOLERANCE);
    return clamp((DROPPED - max(squares.x, squares.y)) / (DROPPED - KEPT), 0.0, 1.0);
}

accumulated accumulate(ivec2 pixel, gbuffer_point point, surroundings around)
{
    accumulated now = current(pixel, around.brightest_neighbour);
    reprojection r;
    if (push.history_valid == 0u || !reproject(uvec2(pixel), point, r))
        return is_sampled(pixel) ? now : accumulated(vec3(0.0), vec3(0.0), vec4(0.0));
    vec2 means_before;
    accumulated before = history(r, means_before);
    // One sample alone proves nothing: of a thing as small as a pixel, lit nearly by one light, a rare other one is no change.
    float kept = before.moments.w * (around.count > 1.5 ? agreement(around, before, means_before) : 1.0);
    if (push.has_limit != 0u)
        kept = min(kept, again_limit(limit_map, reprojection_place(uvec2(pixel))));
    if (!is_sampled(pixel))
        return accumulated(before.unshadowed, before.shadowed, vec4(before.moments.xyz, kept));
    float frames = min(kept + 1.0, push.frames_max);
    float share = max(1.0 / frames, push.share_min);
    return accumulated(mix(before.unshadowed, now.unshadowed, share), mix(before.shadowed, now.shadowed, share),
                       vec4(mix(before.moments.xyz, now.moments.xyz, share), frames));
}

// Of U and of the ratio of what is accumulated: over time, and over the pixels around while there is little of that.
vec2 variance_of(accumulated sum, surroundings around)
{
    float u = luminance(sum.unshadowed), s = luminance(sum.shadowed);
    vec2 variance = svgf_variance(u, s, sum.moments.xyz);
    if (sum.moments.w < SVGF_TEMPORAL_FRAMES)
        variance = max(variance, svgf_variance(around.means.x, around.means.y, around.moments));
    return svgf_mean_variance(variance, u, sum.moments.w);
}

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, uvec2(frame.width, frame.height))))
        return;
    accumulated result = accumulated(vec3(0.0), vec3(0.0), vec4(0.0));
    uvec4 pair = uvec4(0u);
    gbuffer_point point;
    if (gbuffer_read(depth_map, normal_map, pixel, point)) {
        surroundings around = surroundings_of(ivec2(pixel), point);
        result = accumulate(ivec2(pixel), point, around);
        vec2 variance = variance_of(result, around);
        pair = pair_pack(vec4(result.unshadowed, variance.x), vec4(result.shadowed, variance.y));
    }
    imageStore(accumulated_unshadowed, ivec2(pixel), vec4(result.unshadowed, 0.0));
    imageStore(accumulated_shadowed, ivec2(pixel), vec4(result.shadowed, 0.0));
    imageStore(accumulated_moments, ivec2(pixel), result.moments);
    imageStore(out_pair, ivec2(pixel), pair);
}
