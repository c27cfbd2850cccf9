// The bindings of the tracing shaders: a batch of rays as in modules/rays.h. Each shader exists twice, as a compute
// shader with ray queries and as the ray generation shader of a pipeline, which defines RAY_PIPELINE.
#ifndef RAYS_TRACE_GLSL_H
#define RAYS_TRACE_GLSL_H

#define TLAS_BINDING 0
#ifdef RAY_PIPELINE
#include "ray_pipeline.glsl.h"
#define INVOCATION gl_LaunchIDEXT.x
#else
#include "ray.glsl.h"
layout(local_size_x = 256) in;
#define INVOCATION gl_GlobalInvocationID.x
#endif

layout(set = 0, binding = 1, scalar) readonly buffer origins_block { vec4 origins[]; };
layout(set = 0, binding = 2, scalar) readonly buffer directions_block { vec4 directions[]; };
layout(push_constant, scalar) uniform push_block { uint count; } push;

#endif
