// Few punctual lights: every one of them, with a shadow ray each.
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAYS_BINDING 2
#include "ray_count.glsl.h"
#define RAY_ORIGINS_BINDING 3
#include "light_rays.glsl.h"
#include "direct_light.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0) uniform sampler2D depth_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(push_constant, scalar) uniform push_block { uint first, layers; } push; // lights of this batch

// Returns the number of rays.
uint make_ray(uint index, punctual_light light, gbuffer_point point)
{
    light_arrival a = punctual_arrival(light, point);
    if (luminance(a.light) <= 0.0) {
        light_ray_write_none(index);
        return 0u;
    }
    // Shortened by what rounding may add at the far end.
    vec3 origin = offset_origin(point.position, point.geometric, frame.scene_radius);
    light_ray_write(index, origin, a.direction, 0.9999 * a.distance, a.light);
    return 1u;
}

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    uint rays = 0u;
    if (all(lessThan(pixel, uvec2(frame.width, frame.height)))) {
        gbuffer_point point;
        bool drawn = gbuffer_read(depth_map, normal_map, pixel, point);
        for (uint i = 0u; i < push.layers; i++)
            if (drawn)
                rays += make_ray(light_ray_index(pixel, i), lights[push.first + i], point);
            else
                light_ray_write_none(light_ray_index(pixel, i));
    }
    ray_count(rays);
}
