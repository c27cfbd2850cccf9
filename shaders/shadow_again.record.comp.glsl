// Completes the records of this frame's samples with what the pixels are and what the rays found. One invocation a
// stratum.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "gbuffer.glsl.h"
#include "shadow_again.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0) uniform sampler2D depth_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2) uniform sampler2D albedo_map;
layout(set = 0, binding = 3, scalar) readonly buffer visible_block { uint visible[]; }; // of the first samples
layout(set = 0, binding = 4, scalar) readonly buffer made_block { shadow_record made[]; }; // by shadow.glsl.h
layout(set = 0, binding = 5, scalar) writeonly buffer records_block { shadow_record records[]; };

void main()
{
    uint index = gl_GlobalInvocationID.x, width = again_size().x;
    if (index >= width * again_size().y)
        return;
    uvec2 pixel = again_pixel(uvec2(index % width, index / width));
    shadow_record r = made[index];
    gbuffer_point point;
    if (r.light <= 0.0 || !gbuffer_read(depth_map, normal_map, pixel, point)) {
        records[index].light = 0.0;
        return;
    }
    r.position = point.position;
    r.normals = texelFetch(normal_map, ivec2(pixel), 0);
    r.identity = uint(round(texelFetch(albedo_map, ivec2(pixel), 0).a * 65535.0));
    r.visible = visible[pixel.y * frame.width + pixel.x];
    records[index] = r;
}
