// Leaves a virtual point light where a path's ray hits (Keller 1997; Lin and Yuksel 2019, section 4), and sends the path
// on. One invocation a path; each has `bounces` slots, and those after its end stay empty. With LIST_BINDING, of the
// listed paths.
#ifndef VPL_TRACE_BOUNCE_GLSL_H
#define VPL_TRACE_BOUNCE_GLSL_H

#define RAYS_BINDING 0
#include "ray_count.glsl.h"
#define RAY_ORIGINS_BINDING 1
#include "rays.glsl.h"
#include "sobol.glsl.h"
#define VPLS_BINDING 4
#ifdef LIST_BINDING
#define CHANGED_BINDING (LIST_BINDING + 1)
#endif
#include "vpl_trace_slots.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 3, scalar) buffer flux_block { vec3 flux[]; }; // of the path before the hit, by ray
layout(set = 0, binding = 5, scalar) readonly buffer hits_block { ray_hit hits[]; };
layout(set = 0, binding = 6, scalar) readonly buffer shares_block { vpl_share shares[]; };
layout(set = 0, binding = 7, scalar) readonly buffer sources_block { vpl_source sources[]; };
layout(push_constant, scalar) uniform push_block {
    uint slot_count, bounces;
    uint bounce;
    uint last; // 1: no path goes on
} push;

// The direction in which the path goes on.
vec3 direction_from(uint path, vec3 normal)
{
    vpl_share share = shares[path];
    vec4 u = sobol(share.index, 2u + push.bounce, share_seed(sources[share.source], frame.seed));
    return basis_of(normal) * cosine_direction(u.xy);
}

// Fills the slot; true when the path goes on.
bool bounce(uint path, uint ray, uint slot)
{
    vec3 from = ray_origins[ray].xyz, direction = ray_directions[ray].xyz;
    bool traced = ray_origins[ray].w > 0.0;
    vpl empty = vpl(from, 0.0, vec3(0.0), path, direction, push.bounce);
    surface_hit hit = surface_hit_of(hits[ray]);
    if (!traced)
        empty = vpl(vec3(0.0), 0.0, vec3(0.0), path, vec3(0.0), VPL_NO_RAY);
    if (traced && hit.instance != RAY_MISS) {
        surface s = hit_surface(hit);
        vec3 reflected = flux[ray] * s.albedo;
        vec3 color = reflected / PI;
        if (luminance(color) > 0.0) {
            vec3 normal = dot(s.normal, direction) < 0.0 ? s.normal : -s.normal;
            vec3 origin = offset_origin(s.position, normal, frame.scene_radius);
            slot_write(slot, vpl(origin, luminance(color), color, path, normal, push.bounce));
            if (push.last != 0u)
                return false;
            ray_write(ray, origin, direction_from(path, normal), RAY_FAR);
            flux[ray] = reflected;
            return true;
        }
    }
    slot_write(slot, empty);
    ray_write_none(ray);
    return false;
}

void main()
{
    uint ray = gl_GlobalInvocationID.x;
#ifdef LIST_BINDING
    bool has_path = ray < list_count;
    uint path = has_path ? list_paths[ray] : 0u;
#else
    bool has_path = true;
    uint path = ray;
#endif
    uint slot = path * push.bounces + push.bounce;
    bool goes_on = has_path && slot < push.slot_count && bounce(path, ray, slot);
    ray_count(uint(goes_on));
}

#endif
