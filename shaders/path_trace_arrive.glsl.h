// What the answers to a vertex's rays bring. Bindings 0 to 4.
#ifndef PATH_TRACE_ARRIVE_GLSL_H
#define PATH_TRACE_ARRIVE_GLSL_H

#include "path_trace.glsl.h"

layout(set = 0, binding = 0, scalar) readonly buffer hits_block { ray_hit hits[]; };
layout(set = 0, binding = 1, scalar) readonly buffer last_origins_block { vec4 last_origins[]; };
layout(set = 0, binding = 2, scalar) readonly buffer last_directions_block { vec4 last_directions[]; };
layout(set = 0, binding = 3, scalar) readonly buffer visible_block { uint visible[]; };
layout(set = 0, binding = 4, scalar) readonly buffer last_pending_block { vec3 last_pending[]; };

path_ray last_ray(uint path)
{
    vec4 direction = last_directions[path];
    return path_ray(last_origins[path].xyz, direction.xyz, direction.w);
}

// Light of the sources that the last vertex sees, and that its next ray met.
vec3 light_arrived(uint path, vec3 throughput)
{
    vec3 light = vec3(0.0);
    uint kinds = (frame.emitter_count > 0u ? 1u : 0u) + (frame.light_count > 0u ? 1u : 0u);
    for (uint kind = 0u; kind < kinds; kind++) {
        uint index = kind * push.count + path;
        vec3 waiting = last_pending[index];
        if (waiting != vec3(0.0) && visible[index] != 0u)
            light += waiting;
    }
    ray_hit hit = hits[path];
    if (hit.instance != RAY_MISS && (push.flags & PATH_EMISSION) != 0u) {
        surface_hit s = surface_hit(hit.instance, hit.geometry, hit.triangle, hit.barycentrics);
        light += throughput * hit_emission(s, hit_vertices(s), last_ray(path));
    }
    return light;
}

#endif
