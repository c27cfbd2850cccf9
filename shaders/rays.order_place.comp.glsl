// Ordering rays, step 3: each ray to the next place of its bucket.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "rays_order.glsl.h"

void main()
{
    uint i = gl_GlobalInvocationID.x, bucket;
    if (bucket_of(i, bucket))
        order[atomicAdd(buckets[bucket], 1u)] = i;
}
