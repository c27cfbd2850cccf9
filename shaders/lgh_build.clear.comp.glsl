// Empties the vertex masks.
#version 460
#extension GL_GOOGLE_include_directive : require
#define CLEAR_BINDING 12
#include "lgh_build.clear.glsl.h"
