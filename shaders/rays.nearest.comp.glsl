// Answers a batch of rays by ray query: what is hit first?
#version 460
#extension GL_GOOGLE_include_directive : require
#include "rays_nearest.glsl.h"
