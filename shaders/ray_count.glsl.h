// Counts the rays of a dispatch: each invocation calls ray_count once, in uniform control flow. Before including,
// define RAYS_BINDING.
#ifndef RAY_COUNT_GLSL_H
#define RAY_COUNT_GLSL_H

#extension GL_EXT_scalar_block_layout : require
#extension GL_KHR_shader_subgroup_arithmetic : require

layout(set = 0, binding = RAYS_BINDING, scalar) buffer rays_block { uint rays_traced; };

// Without a barrier, which on a CPU device would stop and go on with every subgroup of the workgroup.
void ray_count(uint rays)
{
    uint sum = subgroupAdd(rays);
    if (subgroupElect())
        atomicAdd(rays_traced, sum);
}

#endif
