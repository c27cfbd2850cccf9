// What ray.glsl.h offers by ray query, by a ray-tracing pipeline: for ray generation shaders. Before including, define
// TLAS_BINDING.
#ifndef RAY_PIPELINE_GLSL_H
#define RAY_PIPELINE_GLSL_H

#include "scene.glsl.h"
#define RAY_PAYLOAD_QUALIFIER rayPayloadEXT
#include "ray_payload.glsl.h"

layout(set = 0, binding = TLAS_BINDING) uniform accelerationStructureEXT tlas;

bool ray_nearest(vec3 origin, vec3 direction, float distance, out surface_hit hit)
{
    traceRayEXT(tlas, gl_RayFlagsNoneEXT, 0xff, 0, 0, 0, origin, 0.0, direction, distance, 0);
    hit = surface_hit(payload.instance, payload.geometry, payload.triangle, payload.barycentrics);
    return payload.instance != RAY_MISS;
}

bool ray_visible(vec3 origin, vec3 direction, float distance)
{
    const uint FLAGS = gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;
    payload.instance = 0u; // stays so unless the ray misses
    traceRayEXT(tlas, FLAGS, 0xff, 0, 0, 0, origin, 0.0, direction, distance, 0);
    return payload.instance == RAY_MISS;
}

#endif
