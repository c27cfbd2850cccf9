// The bindings of the tracing shaders: a batch of rays as in modules/rays.h.
#ifndef RAYS_TRACE_GLSL_H
#define RAYS_TRACE_GLSL_H

#define TLAS_BINDING 0
#include "ray.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 1, scalar) readonly buffer origins_block { vec4 origins[]; };
layout(set = 0, binding = 2, scalar) readonly buffer directions_block { vec4 directions[]; };
layout(push_constant, scalar) uniform push_block { uint count; } push;

#endif
