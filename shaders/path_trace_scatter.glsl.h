// The rays that leave a vertex. Before including, define PATH_BINDING, the first of the bindings: pending light, the
// batches of rays to the lights and of next rays (origins and directions each), and the counter of rays.
#ifndef PATH_TRACE_SCATTER_GLSL_H
#define PATH_TRACE_SCATTER_GLSL_H

#include "path_trace.glsl.h"

#define RAYS_BINDING (PATH_BINDING + 5)
#include "ray_count.glsl.h"

layout(local_size_x = 128) in;
layout(set = 0, binding = PATH_BINDING, scalar) writeonly buffer pending_block { vec3 pending[]; };
layout(set = 0, binding = PATH_BINDING + 1, scalar) writeonly buffer light_origins_block { vec4 light_origins[]; };
layout(set = 0, binding = PATH_BINDING + 2, scalar) writeonly buffer light_directions_block { vec4 light_directions[]; };
layout(set = 0, binding = PATH_BINDING + 3, scalar) writeonly buffer next_origins_block { vec4 next_origins[]; };
layout(set = 0, binding = PATH_BINDING + 4, scalar) writeonly buffer next_directions_block { vec4 next_directions[]; };

uint light_ray_write(uint index, vec3 origin, light_sample s, vec3 throughput)
{
    vec3 light = s.light * throughput;
    bool any_light = light != vec3(0.0);
    pending[index] = light;
    light_origins[index] = vec4(origin, any_light ? s.distance : 0.0);
    light_directions[index] = vec4(s.direction, 0.0);
    return any_light ? 1u : 0u;
}

// The path ends here: no rays.
void path_end(uint path)
{
    const light_sample dark = light_sample(vec3(0.0), vec3(0.0, 0.0, 1.0), 0.0);
    uint kinds = (frame.emitter_count > 0u ? 1u : 0u) + (frame.light_count > 0u ? 1u : 0u);
    for (uint kind = 0u; kind < kinds; kind++)
        light_ray_write(kind * push.count + path, vec3(0.0), dark, vec3(0.0));
    next_origins[path] = vec4(0.0);
}

// Returns the number of rays. The point lies off the surface already.
uint path_scatter(uint path, gbuffer_point point, vec3 throughput)
{
    uint pixel = path % push.pixels, sample_index = push.first_sample + path / push.pixels, rays = 0u;
    vec4 u = path_random(pixel, sample_index, 0u), v = path_random(pixel, sample_index, 1u);
    vec3 gathered = (push.flags & PATH_GATHER) != 0u ? throughput : vec3(0.0);
    if (frame.emitter_count > 0u)
        rays += light_ray_write(path, point.position, emitter_sample(point, v.xyz), gathered);
    if (frame.light_count > 0u) {
        uint index = (frame.emitter_count > 0u ? push.count : 0u) + path;
        rays += light_ray_write(index, point.position, punctual_sample(point, vec2(u.z, u.w)), gathered);
    }
    vec3 local = cosine_direction(u.xy), direction = basis_of(point.shading) * local;
    bool leaves = dot(point.geometric, direction) > 0.0 && throughput != vec3(0.0) && (push.flags & PATH_NEXT) != 0u;
    next_origins[path] = vec4(point.position, leaves ? 1e30 : 0.0);
    next_directions[path] = vec4(direction, local.z / PI);
    return rays + (leaves ? 1u : 0u);
}

#endif
