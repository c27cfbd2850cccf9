// Empties the masks of the dirty cells.
#version 460
#extension GL_GOOGLE_include_directive : require
#define CLEAR_BINDING 11
#define FILLED_BINDING 12
#include "lgh_build.clear.glsl.h"
