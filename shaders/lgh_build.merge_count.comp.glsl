// Merge, step 1: how many pairs of each run are kept.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.merge.glsl.h"

void main()
{
    uint run = merge_run();
    if (run >= merge_runs(state.last_count))
        return;
    uint count = 0u;
    for (uint i = run * MERGE_RUN; i < run_last(run); i++)
        count += is_kept(i) ? 1u : 0u;
    table[run] = count;
}
