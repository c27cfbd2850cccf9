// The shadow ratio S / U of an unfiltered pair.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "ratio.glsl.h"
#include "scene.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D unshadowed_map;
layout(set = 0, binding = 1, rgba32f) uniform readonly image2D shadowed_map;
layout(set = 0, binding = 2, rgba16f) uniform writeonly image2D ratio_map;

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), uvec2(frame.width, frame.height))))
        return;
    vec3 ratio = shadow_ratio(imageLoad(unshadowed_map, pixel).rgb, imageLoad(shadowed_map, pixel).rgb);
    imageStore(ratio_map, pixel, vec4(ratio, 0.0));
}
