// How far the history of the shadow ratio, this frame's samples included, lags behind them. One invocation a stratum.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ratio.glsl.h"
#include "shadow_again.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D unshadowed_map;
layout(set = 0, binding = 1, rgba32f) uniform readonly image2D shadowed_map;
layout(set = 0, binding = 2, rgba32f) uniform readonly image2D accumulated_unshadowed;
layout(set = 0, binding = 3, rgba32f) uniform readonly image2D accumulated_shadowed;
layout(set = 0, binding = 4, rgba32f) uniform readonly image2D accumulated_moments;
layout(set = 0, binding = 5) uniform sampler2D motion_map;
layout(set = 0, binding = 6, scalar) readonly buffer before_block { shadow_lag before[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer lags_block { shadow_lag lags[]; };
layout(push_constant, scalar) uniform push_block { uint history_valid; } push;

const float KEPT = 0.75; // of what the frames before found

void main()
{
    uvec2 stratum = gl_GlobalInvocationID.xy, size = uvec2(frame.width, frame.height);
    if (any(greaterThanEqual(stratum, again_size())))
        return;
    shadow_lag sum = shadow_lag(vec2(0.0), 0.0, 0.0, vec2(0.0));
    float history = 0.0; // how much of the light the history had before this frame
    for (uint i = 0u; i < AGAIN_SIDE * AGAIN_SIDE; i++) {
        ivec2 pixel = ivec2(stratum * AGAIN_SIDE + uvec2(i % AGAIN_SIDE, i / AGAIN_SIDE));
        if (any(greaterThanEqual(uvec2(pixel), size)))
            continue;
        float light = luminance(imageLoad(unshadowed_map, pixel).rgb);
        float ratio = shadow_ratio_luminance(imageLoad(accumulated_unshadowed, pixel).rgb,
                                             imageLoad(accumulated_shadowed, pixel).rgb);
        float share = 1.0 - 1.0 / max(imageLoad(accumulated_moments, pixel).w, 1.0);
        float shadowed = luminance(imageLoad(shadowed_map, pixel).rgb), lag = shadowed - ratio * light;
        sum.now += vec2(light, shadowed);
        sum.lag += lag;
        sum.squares += vec2(lag * lag, share * share * ratio * (1.0 - ratio) * light * light);
        history += share * light;
    }
    sum.light = sum.now.x;
    if (push.history_valid != 0u && sum.light > 0.0) {
        history /= sum.light;
        vec2 moved = texelFetch(motion_map, ivec2(min(stratum * AGAIN_SIDE + AGAIN_SIDE / 2u, size - 1u)), 0).xy;
        ivec2 place = ivec2(round(vec2(stratum) + moved / float(AGAIN_SIDE)));
        shadow_lag last = before[again_index(uvec2(clamp(place, ivec2(0), ivec2(again_size()) - 1)))];
        // As the history takes up new samples its lag shrinks.
        sum.light += KEPT * last.light;
        sum.lag += KEPT * history * last.lag;
        sum.squares += KEPT * KEPT * history * history * last.squares;
    }
    lags[again_index(stratum)] = sum;
}
