// The shadow ratio S / U, steadied over time.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "taa.glsl.h"

layout(set = 0, binding = 8, rgba16f) uniform readonly image2D previous_ratio;
layout(set = 0, binding = 9, rgba16f) uniform writeonly image2D ratio_map;

vec4 taa_now(ivec2 pixel) { return imageLoad(ratio_now, pixel); }
vec4 taa_before(ivec2 pixel) { return imageLoad(previous_ratio, pixel); }
void taa_store(ivec2 pixel, vec4 value) { imageStore(ratio_map, pixel, vec4(clamp(value.rgb, 0.0, 1.0), value.a)); }
