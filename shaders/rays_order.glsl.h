// Listing the rays of a batch in an order that is good to trace: rays that are there, those next to each other starting
// and ending close together. A counting sort by 2^18 buckets: count, make room, place. Within a bucket, and among groups
// of buckets, the order is that of the atomics and differs from run to run; a ray's answer does not depend on it.
#ifndef RAYS_ORDER_GLSL_H
#define RAYS_ORDER_GLSL_H

#include "scene.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) readonly buffer origins_block { vec4 origins[]; };
layout(set = 0, binding = 1, scalar) readonly buffer directions_block { vec4 directions[]; };
layout(set = 0, binding = 2, scalar) buffer header_block {
    ray_order_header header; // starts as zeros
    uint buckets[];          // RAY_ORDER_BUCKETS: rays in each, then the next one's place
};
layout(set = 0, binding = 3, scalar) writeonly buffer order_block { uint order[]; };
layout(push_constant, scalar) uniform push_block {
    uint count;
    uint all; // 1: what is no ray is listed too, since it wants an answer
} push;

const uint CELLS = 8u; // along an axis of the scene's box

// Bits 0..2 of x, y and z to bits 0, 6, 12 and the two after each.
uint cell_bits(uvec3 cell)
{
    uvec3 spread = (cell & 1u) | (cell & 2u) << 5 | (cell & 4u) << 10;
    return spread.x | spread.y << 1 | spread.z << 2;
}

uint cell_of(vec3 position)
{
    vec3 extent = max(frame.scene_max - frame.scene_min, 1e-20);
    return cell_bits(uvec3(clamp((position - frame.scene_min) / extent * float(CELLS), 0.0, float(CELLS) - 0.5)));
}

// Morton order of the cells of both ends, six numbers: neither end's cells are finer than the other's. Of 2 to 7 levels
// and of orders that put one end first it was among the best (Sponza and atrium, query: 1.45 and 1.9 times unordered);
// finer ones gain 3 % more. False: not listed.
bool bucket_of(uint i, out uint bucket)
{
    if (i >= push.count)
        return false;
    vec4 origin = origins[i];
    bucket = RAY_ORDER_BUCKETS - 1u;
    if (!(origin.w > 0.0))
        return push.all != 0u;
    vec3 end = origin.xyz + directions[i].xyz * min(origin.w, 4.0 * frame.scene_radius);
    bucket = cell_of(end) | cell_of(origin.xyz) << 3;
    return true;
}

#endif
