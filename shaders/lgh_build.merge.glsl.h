// Incremental: last frame's sorted list without the changed VPLs, merged with the sorted list of the changed ones. What
// its steps share: an invocation has MERGE_RUN pairs of the old list.
#ifndef LGH_BUILD_MERGE_GLSL_H
#define LGH_BUILD_MERGE_GLSL_H

#include "lgh_build.state.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 0, scalar) readonly buffer changed_block { uint changed[]; };
layout(set = 0, binding = 5, scalar) readonly buffer state_block { lgh_state state; };
layout(set = 0, binding = 2, scalar) readonly buffer old_order_block { uint old_order[]; };
layout(set = 0, binding = 3, scalar) buffer table_block { uint table[]; }; // pairs kept of each run, then before it

bool is_kept(uint i) { return (changed[old_order[i] >> 5] >> (old_order[i] & 31u) & 1u) == 0u; }

uint merge_run() { return gl_WorkGroupID.y * 65535u * 256u + gl_GlobalInvocationID.x; }
uint run_last(uint run) { return min((run + 1u) * MERGE_RUN, state.last_count); }

#endif
