// What the steps that look through the VPL slots share: each invocation has SLOT_RUN consecutive ones, so that lists in
// the order of the slots need no more than prefix sums.
#ifndef LGH_BUILD_SLOTS_GLSL_H
#define LGH_BUILD_SLOTS_GLSL_H

#include "lgh.glsl.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool CHANGED = false; // only slots whose bit is set in `changed`
layout(set = 0, binding = 0, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 1, scalar) buffer partials_block { lgh_partial partials[]; };
layout(set = 0, binding = 2, scalar) buffer slot_cells_block { uint slot_cells[]; }; // as in last frame's list
layout(set = 0, binding = 6, scalar) readonly buffer changed_block { uint changed[]; };

const uint SLOT_RUN = uint(LGH_STRETCH) / 64u;
const uint NO_CELL = 0xffffffffu; // of an empty slot

uint slot_run() { return gl_WorkGroupID.x * uint(LGH_STRETCH) + gl_LocalInvocationIndex * SLOT_RUN; }

// The slots first..first + 31 of interest, as bits.
uint slot_bits(uint first, uint slot_count)
{
    if (first >= slot_count)
        return 0u;
    uint bits = CHANGED ? changed[first >> 5] : 0xffffffffu;
    return slot_count - first < 32u ? bits & ((1u << (slot_count - first)) - 1u) : bits;
}

#endif
