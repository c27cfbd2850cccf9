// The first vertices of paths: what the pixels see.
#version 460
#extension GL_GOOGLE_include_directive : require
#define PATH_BINDING 3
#include "path_trace_scatter.glsl.h"

layout(set = 0, binding = 0) uniform sampler2D depth_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2, scalar) writeonly buffer states_block { path_state states[]; };

void main()
{
    uint path = gl_GlobalInvocationID.x, rays = 0u;
    if (path < push.count) {
        uint pixel = path % push.pixels;
        gbuffer_point point;
        states[path] = path_state(vec3(1.0), vec3(0.0));
        if (gbuffer_read(depth_map, normal_map, uvec2(pixel % frame.width, pixel / frame.width), point)) {
            point.position = offset_origin(point.position, point.geometric, frame.scene_radius);
            rays = path_scatter(path, point, vec3(1.0));
        } else {
            path_end(path);
        }
    }
    ray_count(rays);
}
