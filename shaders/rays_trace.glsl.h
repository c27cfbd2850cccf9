// The bindings of the tracing shaders: a batch of rays as in modules/rays.h; the answers are bound at 3. Each shader
// exists twice, as a compute shader with ray queries and as the ray generation shader of a pipeline, which defines
// RAY_PIPELINE.
#ifndef RAYS_TRACE_GLSL_H
#define RAYS_TRACE_GLSL_H

#define TLAS_BINDING 0
#ifdef RAY_PIPELINE
#include "ray_pipeline.glsl.h"
#define INVOCATION gl_LaunchIDEXT.x
#define INVOCATIONS gl_LaunchSizeEXT.x
#else
#include "ray.glsl.h"
layout(local_size_x = RAYS_GROUP) in;
#define INVOCATION gl_GlobalInvocationID.x
#define INVOCATIONS (gl_NumWorkGroups.x * RAYS_GROUP)
#endif

layout(set = 0, binding = 1, scalar) readonly buffer origins_block { vec4 origins[]; };
layout(set = 0, binding = 2, scalar) readonly buffer directions_block { vec4 directions[]; };
layout(set = 0, binding = 4, scalar) readonly buffer header_block { ray_order_header header; };
layout(set = 0, binding = 5, scalar) readonly buffer order_block { uint order[]; };
layout(push_constant, scalar) uniform push_block { uint count; } push;

layout(constant_id = 0) const bool ORDERED = false; // else the order of the batch, and the last two are not read

// Deals the order's groups to PILES piles, one after the other. Where each thread of a device takes one piece of the
// invocations, as on a CPU, the pieces then take equally long: in order, rays of one corner of the scene are together,
// and those of another take more steps.
uint place_of(uint invocation)
{
    const uint PILES = 16u;
    uint group = invocation / RAYS_GROUP, pile = INVOCATIONS / (RAYS_GROUP * PILES); // groups of a pile
    if (group >= pile * PILES)
        return invocation;
    return ((group % pile) * PILES + group / pile) * RAYS_GROUP + invocation % RAYS_GROUP;
}

// The ray that an invocation traces; false: none.
bool ray_of(uint invocation, out uint ray)
{
    if (!ORDERED) {
        ray = invocation;
        return invocation < push.count;
    }
    uint place = place_of(invocation);
    if (place >= header.rays)
        return false;
    ray = order[place];
    return true;
}

#endif
