// Radix sort, step 3: moves each pair to its place; `table` now holds each digit's and block's first place.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.sort.glsl.h"

void main()
{
    uint thread = gl_LocalInvocationIndex;
    uint first = min(gl_WorkGroupID.x * SORT_BLOCK + thread * SORT_RUN, push.slot_count);
    uint last = min(first + SORT_RUN, push.slot_count);
    count_digits(thread, first, last);
    if (thread < 16u) { // one digit each: from counts to first places
        uint place = table[thread * push.block_count + gl_WorkGroupID.x];
        for (uint i = 0u; i < 64u; i++) {
            uint count = counts[thread * 64u + i];
            counts[thread * 64u + i] = place;
            place += count;
        }
    }
    barrier();
    for (uint i = first; i < last; i++) {
        uint key = sort_key(i);
        uint place = counts[sort_digit(key) * 64u + thread]++;
        if (push.from_swap != 0u) {
            keys[place] = key;
            order[place] = order_swap[i];
        } else {
            keys_swap[place] = key;
            order_swap[place] = order[i];
        }
    }
}
