// The nearest hit of a ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAY_PAYLOAD_QUALIFIER rayPayloadInEXT
#include "ray_payload.glsl.h"

hitAttributeEXT vec2 barycentrics;

void main() { payload = ray_hit(gl_InstanceID, gl_GeometryIndexEXT, gl_PrimitiveID, barycentrics); }
