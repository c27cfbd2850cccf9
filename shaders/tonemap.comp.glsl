// Exposure, tone curve and the sRGB transfer function: radiance in nits to display values.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "common.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;

layout(set = 0, binding = 0) uniform sampler2D radiance_map;
layout(set = 0, binding = 1, scalar) readonly buffer exposure_block { float exposure; };
layout(set = 0, binding = 2, rgba8) uniform writeonly image2D display_map;

// Narkowicz 2015, "ACES Filmic Tone Mapping Curve". The bound keeps the squares finite; the curve is at 1 by then.
vec3 tone_curve(vec3 x)
{
    x = min(x, 1e4);
    return clamp(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0);
}

// IEC 61966-2-1.
vec3 srgb_encode(vec3 linear)
{
    return mix(1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, 12.92 * linear, lessThanEqual(linear, vec3(0.0031308)));
}

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(display_map))))
        return;
    vec3 radiance = texelFetch(radiance_map, pixel, 0).rgb;
    imageStore(display_map, pixel, vec4(srgb_encode(tone_curve(radiance * exposure)), 1.0));
}
