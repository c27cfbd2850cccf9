// Answers a batch of rays by a ray-tracing pipeline: is anything in the way?
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAY_PIPELINE
#include "rays_visible.glsl.h"
