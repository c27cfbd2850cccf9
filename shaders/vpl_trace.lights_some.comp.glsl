// Writes the point lights that join the hierarchy into their slots, and marks those that are not what they were.
#version 460
#extension GL_GOOGLE_include_directive : require
#define CHANGED_BINDING 2
#include "vpl_trace_lights.glsl.h"
