// What the shaders of a ray-tracing pipeline tell each other of a ray. Before including, define RAY_PAYLOAD_QUALIFIER:
// rayPayloadEXT where the ray starts, rayPayloadInEXT where it ends.
#ifndef RAY_PAYLOAD_GLSL_H
#define RAY_PAYLOAD_GLSL_H

#include "common.glsl.h"
#extension GL_EXT_ray_tracing : require

layout(location = 0) RAY_PAYLOAD_QUALIFIER ray_hit payload; // instance RAY_MISS: nothing was hit

#endif
