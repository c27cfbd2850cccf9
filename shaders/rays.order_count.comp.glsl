// Ordering rays, step 1: how many there are in each bucket.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "rays_order.glsl.h"

void main()
{
    uint bucket;
    if (bucket_of(gl_GlobalInvocationID.x, bucket))
        atomicAdd(buckets[bucket], 1u);
}
