// Counts the rays of a dispatch: each invocation calls ray_count once, in uniform control flow. Before including,
// define RAYS_BINDING.
#ifndef RAY_COUNT_GLSL_H
#define RAY_COUNT_GLSL_H

#extension GL_EXT_scalar_block_layout : require

layout(set = 0, binding = RAYS_BINDING, scalar) buffer rays_block { uint rays_traced; };

shared uint group_rays;

void ray_count(uint rays)
{
    if (gl_LocalInvocationIndex == 0u)
        group_rays = 0u;
    barrier();
    atomicAdd(group_rays, rays);
    barrier();
    if (gl_LocalInvocationIndex == 0u)
        atomicAdd(rays_traced, group_rays);
}

#endif
