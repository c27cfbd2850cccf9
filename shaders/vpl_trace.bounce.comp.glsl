// Leaves a virtual point light where a path's ray hits (Keller 1997; Lin and Yuksel 2019, section 4), and sends the path
// on. One invocation a path; each has `bounces` slots, and those after its end stay empty.
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAYS_BINDING 0
#include "ray_count.glsl.h"
#define RAY_ORIGINS_BINDING 1
#include "rays.glsl.h"
#include "sobol.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 3, scalar) buffer flux_block { vec3 flux[]; }; // of the path before the hit
layout(set = 0, binding = 4, scalar) writeonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 5, scalar) readonly buffer hits_block { ray_hit hits[]; };
layout(push_constant, scalar) uniform push_block {
    uint slot_count, bounces;
    uint bounce;
    uint last; // 1: no path goes on
} push;

// Fills the slot; true when the path goes on.
bool bounce(uint path, uint slot)
{
    surface_hit hit = surface_hit_of(hits[path]);
    if (hit.instance == RAY_MISS) {
        vpls[slot].intensity = 0.0;
        ray_write_none(path);
        return false;
    }
    vec3 direction = ray_directions[path].xyz;
    surface s = hit_surface(hit);
    vec3 normal = dot(s.normal, direction) < 0.0 ? s.normal : -s.normal;
    vec3 origin = offset_origin(s.position, normal, frame.scene_radius);
    vec3 reflected = flux[path] * s.albedo;
    vec3 color = reflected / PI;
    vpls[slot] = vpl(origin, luminance(color), color, path, normal, push.bounce);
    if (push.last != 0u)
        return false;
    vec4 u = sobol(path, 2u + push.bounce, frame.seed);
    ray_write(path, origin, basis_of(normal) * cosine_direction(u.xy), RAY_FAR);
    flux[path] = reflected;
    return true;
}

void main()
{
    uint path = gl_GlobalInvocationID.x;
    uint slot = path * push.bounces + push.bounce;
    bool goes_on = slot < push.slot_count && bounce(path, slot);
    ray_count(uint(goes_on));
}
