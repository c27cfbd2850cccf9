// Prefix sums of as many numbers as the host says.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.scan.glsl.h"

layout(push_constant, scalar) uniform push_block { uint count; } push;

void main() { scan(push.count); }
