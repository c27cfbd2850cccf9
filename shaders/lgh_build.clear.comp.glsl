// Empties the vertex masks.
#version 460
#extension GL_GOOGLE_include_directive : require
#define CLEAR_BINDING 13
#define FILLED_BINDING 14
#include "lgh_build.clear.glsl.h"
