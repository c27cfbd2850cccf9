// Launches the listed light paths.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIST_BINDING 8
#include "vpl_trace_emit.glsl.h"
