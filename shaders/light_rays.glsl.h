// Making shadow rays that carry light: see modules/light_rays.h. Before including, define RAY_ORIGINS_BINDING; the
// directions and the light are bound next to it.
#ifndef LIGHT_RAYS_GLSL_H
#define LIGHT_RAYS_GLSL_H

#include "rays.glsl.h"

layout(set = 0, binding = RAY_ORIGINS_BINDING + 2, scalar) writeonly buffer estimates_block { vec3 estimates[]; };

// `layer` counts from the batch's first.
uint light_ray_index(uvec2 pixel, uint layer)
{
    return (layer * frame.height + pixel.y) * frame.width + pixel.x;
}

void light_ray_write(uint index, vec3 origin, vec3 direction, float reach, vec3 light)
{
    ray_write(index, origin, direction, reach);
    estimates[index] = light;
}

void light_ray_write_to(uint index, vec3 origin, vec3 end, vec3 light)
{
    ray_write_to(index, origin, end);
    estimates[index] = light;
}

void light_ray_write_none(uint index)
{
    ray_write_none(index);
    estimates[index] = vec3(0.0);
}

#endif
