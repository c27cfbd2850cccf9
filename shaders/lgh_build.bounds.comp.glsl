// Bounds and number of the VPLs, first half: each workgroup reduces a stretch of slots to one partial. In an incremental
// build, of the changed ones.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.slots.glsl.h"

layout(push_constant, scalar) uniform push_block { uint slot_count; } push;

shared vec3 group_min[64], group_max[64];
shared uint group_count, group_removed;

void main()
{
    uint thread = gl_LocalInvocationIndex;
    if (thread == 0u)
        group_count = group_removed = 0u;
    barrier();
    vec3 low = vec3(1e30), high = vec3(-1e30);
    uint count = 0u, removed = 0u;
    for (uint first = slot_run(); first < slot_run() + SLOT_RUN; first += 32u)
        for (uint bits = slot_bits(first, push.slot_count); bits != 0u; bits &= bits - 1u) {
            uint slot = first + uint(findLSB(bits));
            if (CHANGED && slot_cells[slot] != NO_CELL)
                removed++;
            if (vpls[slot].intensity <= 0.0)
                continue;
            low = min(low, vpls[slot].position);
            high = max(high, vpls[slot].position);
            count++;
        }
    group_min[thread] = low;
    group_max[thread] = high;
    atomicAdd(group_count, count);
    atomicAdd(group_removed, removed);
    for (uint step = 32u; step > 0u; step >>= 1) {
        barrier();
        if (thread < step) {
            group_min[thread] = min(group_min[thread], group_min[thread + step]);
            group_max[thread] = max(group_max[thread], group_max[thread + step]);
        }
    }
    if (thread == 0u)
        partials[gl_WorkGroupID.x] = lgh_partial(group_min[0], group_count, group_max[0], group_removed);
}
