// Leaves the VPLs of one bounce of all light paths.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "vpl_trace_bounce.glsl.h"
