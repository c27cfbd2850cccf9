// Adds the light of the slots that their shadow rays reached.
#version 460
#extension GL_GOOGLE_include_directive : require
#define SHADOWED
#include "vpl_reference_sum.glsl.h"
