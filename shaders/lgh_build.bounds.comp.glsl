// Bounds of the occupied VPL slots, first half: each workgroup reduces a stretch of slots to one partial.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"
#include "lgh_build.glsl.h"

layout(local_size_x = 64) in;

shared vec3 group_min[64], group_max[64];
shared uint group_count[64];

void main()
{
    uint thread = gl_LocalInvocationIndex;
    vec3 low = vec3(1e30), high = vec3(-1e30);
    uint count = 0u;
    uint first = gl_WorkGroupID.x * BOUNDS_STRETCH;
    for (uint i = first + thread; i < min(first + BOUNDS_STRETCH, push.slot_count); i += 64u)
        if (vpls[i].intensity > 0.0) {
            low = min(low, vpls[i].position);
            high = max(high, vpls[i].position);
            count++;
        }
    group_min[thread] = low;
    group_max[thread] = high;
    group_count[thread] = count;
    for (uint step = 32u; step > 0u; step >>= 1) {
        barrier();
        if (thread < step) {
            group_min[thread] = min(group_min[thread], group_min[thread + step]);
            group_max[thread] = max(group_max[thread], group_max[thread + step]);
            group_count[thread] += group_count[thread + step];
        }
    }
    if (thread == 0u)
        partials[gl_WorkGroupID.x] = bounds_partial(group_min[0], group_count[0], group_max[0]);
}
