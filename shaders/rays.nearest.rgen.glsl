// Answers a batch of rays by a ray-tracing pipeline: what is hit first?
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAY_PIPELINE
#include "rays_nearest.glsl.h"
