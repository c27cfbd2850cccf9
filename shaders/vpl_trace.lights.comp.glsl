// Writes the point lights that join the hierarchy into their slots.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "vpl_trace_lights.glsl.h"
