// Shadow rays towards the lights' centres, or points jittered around them.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#include "shadow.glsl.h"
