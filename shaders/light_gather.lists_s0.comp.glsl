// Lists of grid lights and, for start level 0, of VPLs.
#version 460
#extension GL_GOOGLE_include_directive : require
#define START_LEVEL_0
#include "light_gather.lists.glsl.h"
