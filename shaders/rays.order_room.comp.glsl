// Ordering rays, step 2: each bucket's first place, and how much there is to trace. Workgroups take room for their
// buckets in whatever order they come.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "rays_order.glsl.h"

const uint RUN = RAY_ORDER_BUCKETS / RAY_ORDER_GROUPS / 256u; // buckets of one invocation

shared uint places[256];

void group_places()
{
    uint total = 0u;
    for (uint i = 0u; i < 256u; i++) {
        uint rays = places[i];
        places[i] = total;
        total += rays;
    }
    uint first = atomicAdd(header.rays, total);
    for (uint i = 0u; i < 256u; i++)
        places[i] += first;
    atomicMax(header.groups_x, (first + total + RAYS_GROUP - 1u) / RAYS_GROUP);
}

void main()
{
    uint thread = gl_LocalInvocationIndex, first = gl_GlobalInvocationID.x * RUN, sum = 0u;
    for (uint i = first; i < first + RUN; i++)
        sum += buckets[i];
    places[thread] = sum;
    barrier();
    if (thread == 0u)
        group_places();
    if (gl_GlobalInvocationID.x == 0u)
        header.groups_y = header.groups_z = 1u;
    barrier();
    uint place = places[thread];
    for (uint i = first; i < first + RUN; i++) {
        uint rays = buckets[i];
        buckets[i] = place;
        place += rays;
    }
}
