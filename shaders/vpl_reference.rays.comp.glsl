// Makes a shadow ray for each pixel and each of `count` slots that sends light to it: ray = layer * pixels + pixel, where
// layer i belongs to slot first + i.
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAY_ORIGINS_BINDING 3
#include "rays.glsl.h"
#define RAYS_BINDING 5
#include "ray_count.glsl.h"
#include "vpl_reference.glsl.h"

void main()
{
    uint pixel = gl_GlobalInvocationID.x, pixels = frame.width * frame.height;
    uint layers = (push.count + gl_NumWorkGroups.y - 1u) / gl_NumWorkGroups.y; // of one invocation
    uint begin = gl_WorkGroupID.y * layers, end = min(begin + layers, push.count);
    uint rays = 0u;
    if (pixel < pixels) {
        gbuffer_point p;
        bool drawn = pixel_read(pixel, p);
        vec3 origin = offset_origin(p.position, p.geometric, frame.scene_radius);
        for (uint layer = begin; layer < end; layer++) {
            uint slot = push.first + layer, ray = layer * pixels + pixel;
            if (drawn && luminance(slot_light(slot, p)) > 0.0) {
                ray_write_to(ray, origin, vpls[slot].position);
                rays++;
            } else {
                ray_write_none(ray);
            }
        }
    }
    ray_count(rays);
}
