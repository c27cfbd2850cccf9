// One vertex of each path: takes the light that has arrived at the last one, and goes on from what its ray hit.
#version 460
#extension GL_GOOGLE_include_directive : require
#define PATH_BINDING 6
#include "path_trace_arrive.glsl.h"
#include "path_trace_scatter.glsl.h"

layout(set = 0, binding = 5, scalar) buffer states_block { path_state states[]; };

void main()
{
    uint path = gl_GlobalInvocationID.x, rays = 0u;
    if (path < push.count) {
        path_state state = states[path];
        state.light += light_arrived(path, state.throughput);
        ray_hit hit = hits[path];
        if (hit.instance != RAY_MISS) {
            surface s = hit_surface(surface_hit(hit.instance, hit.geometry, hit.triangle, hit.barycentrics));
            vec3 normal = dot(s.normal, last_directions[path].xyz) < 0.0 ? s.normal : -s.normal;
            state.throughput *= s.albedo;
            gbuffer_point point =
                gbuffer_point(offset_origin(s.position, normal, frame.scene_radius), normal, normal, 0.0);
            rays = path_scatter(path, point, state.throughput);
        } else {
            path_end(path);
        }
        states[path] = state;
    }
    ray_count(rays);
}
