// Radix sort, step 3: moves each pair to its place; `table` now holds each digit's and block's first place.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.sort.glsl.h"

void main()
{
    uint thread = gl_LocalInvocationIndex;
    count_digits(thread);
    if (thread < SORT_DIGITS) { // one digit each: from counts to first places
        uint place = table[thread * sort_blocks(state.listed) + gl_WorkGroupID.x];
        for (uint i = 0u; i < 64u; i++) {
            uint count = counts[thread * 64u + i];
            counts[thread * 64u + i] = place;
            place += count;
        }
    }
    barrier();
    for (uint i = run_first(thread); i < run_last(thread); i++) {
        uint key = sort_key(i);
        uint place = counts[sort_digit(key) * 64u + thread]++;
        if (from_swap()) {
            keys[place] = key;
            order[place] = order_swap[i];
        } else {
            keys_swap[place] = key;
            order_swap[place] = order[i];
        }
    }
}
