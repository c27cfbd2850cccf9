// Many punctual lights and few untextured emissive triangles, sampled; the unshadowed light in closed form beside it.
#version 460
#extension GL_GOOGLE_include_directive : require
#define ANALYTIC 1
#include "direct_light_sample.glsl.h"
