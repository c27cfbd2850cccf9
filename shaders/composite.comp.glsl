// radiance = emission + albedo * (direct + sampled direct * its ratio + indirect * its ratio).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "common.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;

layout(set = 0, binding = 0) uniform sampler2D albedo_map;
layout(set = 0, binding = 1) uniform sampler2D emission_map;
layout(set = 0, binding = 2) uniform sampler2D direct_map;
layout(set = 0, binding = 3) uniform sampler2D sampled_direct_map;
layout(set = 0, binding = 4) uniform sampler2D direct_ratio_map;
layout(set = 0, binding = 5) uniform sampler2D indirect_map;
layout(set = 0, binding = 6) uniform sampler2D shadow_ratio_map;
layout(set = 0, binding = 7, rgba32f) uniform writeonly image2D radiance_map;

// What is absent is bound as one texel that stands for every pixel.
vec3 light_at(sampler2D map, ivec2 pixel) { return texelFetch(map, min(pixel, textureSize(map, 0) - 1), 0).rgb; }

// Comparisons with NaN are false.
float finite_positive(float value) { return value > 0.0 ? min(value, 3e38) : 0.0; }

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(radiance_map))))
        return;
    vec4 albedo = texelFetch(albedo_map, pixel, 0);
    vec3 radiance = vec3(0.0);
    if (albedo.a > 0.0) {
        vec3 light = light_at(direct_map, pixel) +
                     light_at(sampled_direct_map, pixel) * light_at(direct_ratio_map, pixel) +
                     light_at(indirect_map, pixel) * light_at(shadow_ratio_map, pixel);
        radiance = light_at(emission_map, pixel) + albedo.rgb * light;
    }
    imageStore(radiance_map, pixel,
               vec4(finite_positive(radiance.r), finite_positive(radiance.g), finite_positive(radiance.b), 1.0));
}
