// What the steps of lgh_build that decide share: the dispatches of the steps after them.
#ifndef LGH_BUILD_STATE_GLSL_H
#define LGH_BUILD_STATE_GLSL_H

#include "lgh.glsl.h"

const uint SORT_RUN = 32u; // pairs that one invocation of the sort handles
const uint SORT_BLOCK = 64u * SORT_RUN;
const uint MERGE_RUN = 32u;

lgh_dispatch dispatch_of(uint groups)
{
    return lgh_dispatch(min(groups, 65535u), (groups + 65534u) / 65535u, 1u, 0u);
}

// Passes that sort the keys of the cells of S1.
uint sort_passes(uint levels) { return (3u * levels + uint(LGH_SORT_BITS) - 1u) / uint(LGH_SORT_BITS); }

uint sort_blocks(uint count) { return (count + SORT_BLOCK - 1u) / SORT_BLOCK; }

// One run more than full ones, so that the last has room for what comes after the list.
uint merge_runs(uint count) { return count / MERGE_RUN + 1u; }

#endif
