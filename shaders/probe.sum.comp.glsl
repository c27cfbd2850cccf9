// What the rays of a probe found, and what the picture shows at its pixel. One invocation a probe.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "common.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer estimates_block { vec3 estimates[]; };
layout(set = 0, binding = 1, scalar) readonly buffer visible_block { uint visible[]; };
layout(set = 0, binding = 2) uniform sampler2D albedo_map;
layout(set = 0, binding = 3) uniform sampler2D indirect_map;
layout(set = 0, binding = 4) uniform sampler2D ratio_map;
layout(set = 0, binding = 5, scalar) buffer probes_block { probe probes[]; };
layout(push_constant, scalar) uniform push_block { uint count; } push;

// What is absent is bound as one texel that stands for every pixel.
vec3 light_at(sampler2D map, ivec2 pixel) { return texelFetch(map, min(pixel, textureSize(map, 0) - 1), 0).rgb; }

vec3 estimate(uint block, uint index)
{
    const uint CHOICES = PROBE_RAYS / 4u;
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < CHOICES; i++) {
        uint ray = index * PROBE_RAYS + block * CHOICES + i;
        if (visible[ray] != 0u) // undefined where there is no ray, and no light either
            sum += estimates[ray];
    }
    return sum;
}

void main()
{
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.count)
        return;
    ivec2 pixel = ivec2(probes[index].x, probes[index].y);
    vec3 albedo = probes[index].drawn != 0u ? texelFetch(albedo_map, pixel, 0).rgb : vec3(0.0);
    vec3 unshadowed = albedo * light_at(indirect_map, pixel);
    probes[index].shown_unshadowed = unshadowed;
    probes[index].shown = unshadowed * light_at(ratio_map, pixel);
    probes[index].unshadowed *= albedo;
    for (uint block = 0u; block < 4u; block++)
        probes[index].shadowed[block >> 1][block & 1u] = albedo * estimate(block, index);
}
