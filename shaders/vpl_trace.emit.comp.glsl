// Launches all light paths.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "vpl_trace_emit.glsl.h"
