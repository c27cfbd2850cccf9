// What a VPL sends to a pixel, for the passes that sum all of them: the same formula as the lighting grid hierarchy's.
#ifndef VPL_REFERENCE_GLSL_H
#define VPL_REFERENCE_GLSL_H

#include "gbuffer.glsl.h"
#include "lgh_shade.glsl.h"

layout(local_size_x = 128) in; // x: pixels in rows from the top
layout(set = 0, binding = 0, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 1) uniform sampler2D depth_map;
layout(set = 0, binding = 2) uniform sampler2D normal_map;
layout(push_constant, scalar) uniform push_block {
    uint first, count; // slots
    float singularity; // b, metres
} push;

bool pixel_read(uint pixel, out gbuffer_point p)
{
    return gbuffer_read(depth_map, normal_map, uvec2(pixel % frame.width, pixel / frame.width), p);
}

// Radiance over albedo, unshadowed. Zero for an empty slot, whose other fields are undefined.
vec3 slot_light(uint slot, gbuffer_point p)
{
    vpl light = vpls[slot];
    return light.intensity > 0.0 ? vpl_light(light, p, push.singularity) : vec3(0.0);
}

#endif
