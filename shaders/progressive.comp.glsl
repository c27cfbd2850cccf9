// Makes the picture of a progressive method from its two sums, and what its estimated error needs: one pair of numbers
// a workgroup.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "common.glsl.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, scalar) readonly buffer sums_block { vec4 sums[]; };
layout(set = 0, binding = 1) uniform sampler2D albedo_map;
layout(set = 0, binding = 2) uniform sampler2D emission_map;
layout(set = 0, binding = 3, rgba32f) uniform writeonly image2D radiance_map;
// Sums over the workgroup's pixels: variance of the radiance, radiance squared; both over all channels.
layout(set = 0, binding = 4, scalar) writeonly buffer error_block { vec2 error[]; };
layout(push_constant, scalar) uniform push_block {
    vec2 factors;
    vec2 half_factors;
    float variance_factor;
    uint emission;
} push;

shared vec2 group_error[64];

void error_write(vec2 pixel_error)
{
    uint i = gl_LocalInvocationIndex;
    group_error[i] = pixel_error;
    for (uint step = 32u; step > 0u; step /= 2u) {
        barrier();
        if (i < step)
            group_error[i] += group_error[i + step];
    }
    if (i == 0u)
        error[gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x] = group_error[0];
}

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(radiance_map);
    vec2 pixel_error = vec2(0.0);
    if (all(lessThan(pixel, size))) {
        uint index = uint(pixel.y * size.x + pixel.x);
        vec4 albedo = texelFetch(albedo_map, pixel, 0);
        vec3 radiance = vec3(0.0);
        if (albedo.a > 0.0) {
            vec3 first = sums[index].rgb, second = sums[uint(size.x * size.y) + index].rgb;
            vec3 emission = push.emission != 0u ? texelFetch(emission_map, pixel, 0).rgb : vec3(0.0);
            radiance = emission + albedo.rgb * (push.factors.x * first + push.factors.y * second);
            vec3 difference = albedo.rgb * (push.half_factors.x * first - push.half_factors.y * second);
            pixel_error = vec2(push.variance_factor * dot(difference, difference), dot(radiance, radiance));
        }
        imageStore(radiance_map, pixel, vec4(radiance, 1.0));
    }
    error_write(pixel_error);
}
