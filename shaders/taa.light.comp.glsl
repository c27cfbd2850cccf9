// The shadowed light itself, steadied over time: what the paper rejects, since the light lags behind when it changes (Lin
// and Yuksel 2019, section 3.3).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "taa.glsl.h"

layout(set = 0, binding = 8, rgba32f) uniform readonly image2D previous_light;
layout(set = 0, binding = 9, rgba32f) uniform writeonly image2D light_map;
layout(set = 0, binding = 11) uniform sampler2D unshadowed_map;

vec4 taa_now(ivec2 pixel)
{
    vec4 ratio = imageLoad(ratio_now, pixel);
    vec3 light = texelFetch(unshadowed_map, pixel, 0).rgb;
    return vec4(light * ratio.rgb, luminance(light) * ratio.a);
}
vec4 taa_before(ivec2 pixel) { return imageLoad(previous_light, pixel); }
void taa_store(ivec2 pixel, vec4 value) { imageStore(light_map, pixel, max(value, vec4(0.0))); }
