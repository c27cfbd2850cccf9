// Making a batch of rays: see modules/rays.h. Before including, define RAY_ORIGINS_BINDING; the directions are bound
// next to it. To read answers, bind `X_visible` as a uint array and `X_hits` as an array of ray_hit.
#ifndef RAYS_GLSL_H
#define RAYS_GLSL_H

#include "scene.glsl.h"

layout(set = 0, binding = RAY_ORIGINS_BINDING, scalar) buffer ray_origins_block { vec4 ray_origins[]; };
layout(set = 0, binding = RAY_ORIGINS_BINDING + 1, scalar) buffer ray_directions_block { vec4 ray_directions[]; };

const float RAY_FAR = 1e30;

void ray_write(uint index, vec3 origin, vec3 direction, float reach)
{
    ray_origins[index] = vec4(origin, reach);
    ray_directions[index] = vec4(direction, 0.0);
}

// Towards a point: shortened by what rounding may add at the far end. One at the origin itself leaves a ray still.
void ray_write_to(uint index, vec3 origin, vec3 end)
{
    vec3 offset = end - origin;
    float reach = max(length(offset), 1e-20);
    ray_write(index, origin, offset / reach, reach * 0.9999);
}

void ray_write_none(uint index) { ray_origins[index].w = 0.0; }

surface_hit surface_hit_of(ray_hit hit)
{
    return surface_hit(hit.instance, hit.geometry, hit.triangle, hit.barycentrics);
}

#endif
