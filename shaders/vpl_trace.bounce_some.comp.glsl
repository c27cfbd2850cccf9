// Leaves the VPLs of one bounce of the listed light paths, and marks those that are not what they were.
#version 460
#extension GL_GOOGLE_include_directive : require
#define LIST_BINDING 8
#include "vpl_trace_bounce.glsl.h"
