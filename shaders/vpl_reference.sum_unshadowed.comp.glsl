// Adds the light of the slots, whatever lies between.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "vpl_reference_sum.glsl.h"
