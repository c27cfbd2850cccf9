// Empties the mask of S1's cells.
#version 460
#extension GL_GOOGLE_include_directive : require
#define CLEAR_BINDING 0
#define FILLED_BINDING 5
#include "lgh_build.clear.glsl.h"
