// One pass of a stable least-significant-digit radix sort over LGH_SORT_BITS bits: what its steps share. Pairs go back
// and forth between two places; passes are counted from the last, which ends in `keys` and `order`.
// A workgroup of 64 handles SORT_BLOCK consecutive pairs, each invocation SORT_RUN consecutive ones, so that digits
// counted digit-major, invocation-minor are counted in the order in which stability wants them.
#ifndef LGH_BUILD_SORT_GLSL_H
#define LGH_BUILD_SORT_GLSL_H

#include "lgh_build.state.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 4, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 5, scalar) readonly buffer state_block { lgh_state state; };
layout(set = 0, binding = 7, scalar) buffer keys_block { uint keys[]; };
layout(set = 0, binding = 3, scalar) buffer table_block { uint table[]; }; // [digit][block]
layout(set = 0, binding = 8, scalar) buffer order_block { uint order[]; };
layout(set = 0, binding = 9, scalar) buffer keys_swap_block { uint keys_swap[]; };
layout(set = 0, binding = 10, scalar) buffer order_swap_block { uint order_swap[]; };
layout(push_constant, scalar) uniform push_block { uint follow; } push; // passes after this one

const uint SORT_DIGITS = 1u << LGH_SORT_BITS;

shared uint counts[SORT_DIGITS * 64u]; // [digit][invocation]

bool from_swap() { return (push.follow & 1u) == 0u; }
uint sort_key(uint i) { return from_swap() ? keys_swap[i] : keys[i]; }
uint sort_digit(uint key)
{
    uint shift = uint(LGH_SORT_BITS) * (sort_passes(header.level_count) - 1u - push.follow);
    return key >> shift & (SORT_DIGITS - 1u);
}

uint run_first(uint thread) { return min(gl_WorkGroupID.x * SORT_BLOCK + thread * SORT_RUN, state.listed); }
uint run_last(uint thread) { return min(run_first(thread) + SORT_RUN, state.listed); }

void count_digits(uint thread)
{
    for (uint digit = 0u; digit < SORT_DIGITS; digit++)
        counts[digit * 64u + thread] = 0u;
    for (uint i = run_first(thread); i < run_last(thread); i++)
        counts[sort_digit(sort_key(i)) * 64u + thread]++;
    barrier();
}

#endif
