// Few punctual lights: every one of them, with a shadow ray each.
#version 460
#extension GL_GOOGLE_include_directive : require
#define TLAS_BINDING 2
#define RAYS_BINDING 4
#include "direct_light.glsl.h"
#include "ray.glsl.h"
#include "ray_count.glsl.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0) uniform sampler2D depth_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 3, rgba32f) uniform writeonly image2D direct;

vec3 shade(gbuffer_point point, inout uint rays)
{
    vec3 origin = offset_origin(point.position, point.geometric, frame.scene_radius);
    vec3 sum = vec3(0.0);
    for (uint i = 0u; i < frame.light_count; i++) {
        light_arrival a = punctual_arrival(lights[i], point);
        if (luminance(a.light) <= 0.0)
            continue;
        rays++;
        // Shortened by what rounding may add at the far end.
        if (ray_visible(origin, a.direction, 0.9999 * a.distance))
            sum += a.light;
    }
    return sum;
}

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    uint rays = 0u;
    if (all(lessThan(pixel, uvec2(frame.width, frame.height)))) {
        gbuffer_point point;
        vec3 light = vec3(0.0);
        if (gbuffer_read(depth_map, normal_map, pixel, point))
            light = shade(point, rays);
        imageStore(direct, ivec2(pixel), vec4(light, 0.0));
    }
    ray_count(rays);
}
