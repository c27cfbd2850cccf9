// Many punctual lights and emissive triangles, sampled; the unshadowed light is known from the samples only.
#version 460
#extension GL_GOOGLE_include_directive : require
#define ANALYTIC 0
#include "direct_light_sample.glsl.h"
