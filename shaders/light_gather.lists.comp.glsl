// Lists of grid lights.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "light_gather.lists.glsl.h"
