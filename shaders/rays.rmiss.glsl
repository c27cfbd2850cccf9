// A ray that hits nothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAY_PAYLOAD_QUALIFIER rayPayloadInEXT
#include "ray_payload.glsl.h"

void main() { payload.instance = RAY_MISS; }
