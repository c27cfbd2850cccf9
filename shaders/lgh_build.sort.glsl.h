// One pass of a stable least-significant-digit radix sort over four bits: what its count and scatter steps share.
// A workgroup of 64 handles SORT_BLOCK consecutive pairs, each invocation SORT_RUN consecutive ones, so that digits
// counted digit-major, invocation-minor are counted in the order in which stability wants them.
#ifndef LGH_BUILD_SORT_GLSL_H
#define LGH_BUILD_SORT_GLSL_H

#include "lgh.glsl.h"

const uint SORT_RUN = 32u;
const uint SORT_BLOCK = 64u * SORT_RUN;

layout(local_size_x = 64) in;
layout(set = 0, binding = 2, scalar) buffer keys_block { uint keys[]; };
layout(set = 0, binding = 4, scalar) buffer order_block { uint order[]; };
layout(set = 0, binding = 5, scalar) buffer keys_swap_block { uint keys_swap[]; };
layout(set = 0, binding = 6, scalar) buffer order_swap_block { uint order_swap[]; };
layout(set = 0, binding = 3, scalar) buffer table_block { uint table[]; }; // [digit][block]
layout(push_constant, scalar) uniform push_block { uint slot_count, shift, from_swap, block_count; } push;

shared uint counts[16 * 64]; // [digit][invocation]

uint sort_key(uint i) { return push.from_swap != 0u ? keys_swap[i] : keys[i]; }
uint sort_digit(uint key) { return key >> push.shift & 15u; }

void count_digits(uint thread, uint first, uint last)
{
    for (uint digit = 0u; digit < 16u; digit++)
        counts[digit * 64u + thread] = 0u;
    for (uint i = first; i < last; i++)
        counts[sort_digit(sort_key(i)) * 64u + thread]++;
    barrier();
}

#endif
