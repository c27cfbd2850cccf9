// Merge, step 3: each run's kept pairs, and the new ones before each, move to their places. The new ones after the old
// list belong to its last run, which is never full.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.merge.glsl.h"

layout(set = 0, binding = 1, scalar) readonly buffer old_keys_block { uint old_keys[]; };
layout(set = 0, binding = 4, scalar) readonly buffer new_keys_block { uint new_keys[]; };
layout(set = 0, binding = 6, scalar) readonly buffer new_order_block { uint new_order[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer keys_block { uint keys[]; };
layout(set = 0, binding = 8, scalar) writeonly buffer order_block { uint order[]; };

// Does new pair j come before old pair i? By key, then slot, as in the stable sort of all.
bool comes_before(uint j, uint i)
{
    return new_keys[j] < old_keys[i] || (new_keys[j] == old_keys[i] && new_order[j] < old_order[i]);
}

// New pairs that come before the old pairs from i on: those before old pair i - 1.
uint new_before(uint i)
{
    uint low = 0u, high = i == 0u ? 0u : state.listed;
    while (low < high) {
        uint middle = (low + high) / 2u;
        if (comes_before(middle, i - 1u))
            low = middle + 1u;
        else
            high = middle;
    }
    return low;
}

void main()
{
    uint run = merge_run();
    if (run >= merge_runs(state.last_count))
        return;
    uint j = new_before(run * MERGE_RUN);
    uint place = table[run] + j;
    for (uint i = run * MERGE_RUN; i < run_last(run); i++) {
        for (; j < state.listed && comes_before(j, i); j++, place++) {
            keys[place] = new_keys[j];
            order[place] = new_order[j];
        }
        if (is_kept(i)) {
            keys[place] = old_keys[i];
            order[place++] = old_order[i];
        }
    }
    if (run + 1u == merge_runs(state.last_count))
        for (; j < state.listed; j++, place++) {
            keys[place] = new_keys[j];
            order[place] = new_order[j];
        }
}
