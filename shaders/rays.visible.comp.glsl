// Answers a batch of rays by ray query: is anything in the way?
#version 460
#extension GL_GOOGLE_include_directive : require
#include "rays_visible.glsl.h"
