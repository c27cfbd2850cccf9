// The list of VPLs to sort, in the order of their slots, with the Morton codes of their cells for keys. In an incremental
// build, of those that changed, whose cells of before and after are marked as dirty on every level.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.state.glsl.h"
#include "lgh_build.slots.glsl.h"

layout(set = 0, binding = 4, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 7, scalar) buffer keys_block { uint keys[]; };
layout(set = 0, binding = 8, scalar) buffer order_block { uint order[]; };
layout(set = 0, binding = 9, scalar) buffer keys_swap_block { uint keys_swap[]; };
layout(set = 0, binding = 10, scalar) buffer order_swap_block { uint order_swap[]; };
layout(set = 0, binding = 11, scalar) buffer dirty_block { uint dirty_cells[]; };
layout(set = 0, binding = 12, scalar) buffer filled_block { uint filled[]; };
layout(push_constant, scalar) uniform push_block {
    uint slot_count;
    uint exponent; // of the keys' cells; LGH_NO_EXPONENT: S1's
    uint sorted;   // 1: they go where the sort begins
} push;

const uint LGH_NO_EXPONENT = 0xffffffffu;

shared uint counts[64];

uint run_count()
{
    uint count = 0u;
    for (uint first = slot_run(); first < slot_run() + SLOT_RUN; first += 32u)
        for (uint bits = slot_bits(first, push.slot_count); bits != 0u; bits &= bits - 1u)
            if (vpls[first + uint(findLSB(bits))].intensity > 0.0)
                count++;
    return count;
}

// This invocation's first place in the list.
uint list_place(uint thread)
{
    counts[thread] = run_count();
    barrier();
    uint place = partials[gl_WorkGroupID.x].count;
    for (uint i = 0u; i < thread; i++)
        place += counts[i];
    return place;
}

// A cell that is dirty already has dirty parents.
void mark_dirty(uint cell)
{
    if (cell == NO_CELL)
        return;
    for (uint c = header.level_count; c-- > 0u; cell >>= 3) {
        uint word = LGH_CELL_OFFSET[c] + (cell >> 5), flag = 1u << (cell & 31u);
        uint before = atomicOr(dirty_cells[word], flag);
        if (before == 0u)
            atomicOr(filled[word >> 5], 1u << (word & 31u));
        if ((before & flag) != 0u)
            break;
    }
}

void list_add(bool swap, uint place, uint key, uint slot)
{
    if (swap) {
        keys_swap[place] = key;
        order_swap[place] = slot;
    } else {
        keys[place] = key;
        order[place] = slot;
    }
}

void main()
{
    uint place = list_place(gl_LocalInvocationIndex);
    bool first_exponent = push.exponent == LGH_NO_EXPONENT;
    uint c = first_exponent ? header.level_count - 1u : push.exponent;
    bool swap = push.sorted != 0u && (sort_passes(header.level_count) & 1u) != 0u;
    for (uint first = slot_run(); first < slot_run() + SLOT_RUN; first += 32u)
        for (uint bits = slot_bits(first, push.slot_count); bits != 0u; bits &= bits - 1u) {
            uint slot = first + uint(findLSB(bits)), cell = NO_CELL;
            if (vpls[slot].intensity > 0.0) {
                cell = morton(uvec3(grid_position(vpls[slot].position, header.origin, header.top_size, c)));
                list_add(swap, place++, cell, slot);
            }
            if (CHANGED) {
                mark_dirty(slot_cells[slot]);
                mark_dirty(cell);
            }
            if (first_exponent)
                slot_cells[slot] = cell;
        }
}
