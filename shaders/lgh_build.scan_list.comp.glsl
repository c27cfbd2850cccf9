// Prefix sums whose number depends on that of the VPLs: radix sort, step 2, or merge, step 2.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.scan.glsl.h"

layout(set = 0, binding = 5, scalar) readonly buffer state_block { lgh_state state; };
layout(push_constant, scalar) uniform push_block {
    uint merge;  // 1: of the merge's runs
    uint follow; // 0: of the pass of the sort after which so many follow
} push;

void main()
{
    if (gl_WorkGroupID.x > 0u)
        return; // the dispatch is that of the steps before and after, which may be none
    if (push.merge != 0u)
        scan(merge_runs(state.last_count));
    else
        scan(sort_blocks(state.listed) << LGH_SORT_BITS);
}
