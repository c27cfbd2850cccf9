// Shadow rays towards VPLs under the lights.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#define END_POINT_VPL
#include "shadow.glsl.h"
