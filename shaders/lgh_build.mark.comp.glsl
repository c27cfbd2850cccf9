// Marks the vertices around each VPL's cell on every grid, and counts the marks: integers, so the order of the atomics
// leaves no trace. A VPL whose neighbour in the list shares its cell leaves the marking to it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"

layout(local_size_x = 256) in;
layout(set = 0, binding = 7, scalar) readonly buffer keys_block { uint keys[]; };
layout(set = 0, binding = 13, scalar) buffer masks_block { uint masks[]; };
layout(set = 0, binding = 14, scalar) buffer filled_block { uint filled[]; };
layout(set = 0, binding = 4, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 5, scalar) buffer state_block { lgh_state state; };
layout(push_constant, scalar) uniform push_block { uint finest, stage; } push; // stage 1: keys of the exponent `finest`

shared uint group_counts[LGH_EXPONENTS];

void mark_cell(uint c, uvec3 cell)
{
    uint marked = 0u;
    for (uint corner = 0u; corner < 8u; corner++) {
        uint bit = mask_bit(c, cell + (uvec3(corner, corner >> 1, corner >> 2) & 1u));
        uint word = bit >> 5, flag = 1u << (bit & 31u);
        if ((masks[word] & flag) != 0u)
            continue;
        uint before = atomicOr(masks[word], flag);
        if (before == 0u)
            atomicOr(filled[word >> 5], 1u << (word & 31u));
        if ((before & flag) == 0u)
            marked++;
    }
    if (marked > 0u)
        atomicAdd(state.counts[c], marked);
}

void main()
{
    uint i = gl_WorkGroupID.y * 65535u * 256u + gl_GlobalInvocationID.x;
    uint finest = push.stage != 0u ? push.finest : header.level_count - 1u;
    if (i < header.vpl_count) {
        uint key = keys[i];
        uint neighbour = i > 0u ? keys[i - 1u] : 0xffffffffu;
        for (uint c = finest + 1u; c-- > 0u;) {
            uint shift = 3u * (finest - c);
            if (neighbour >> shift == key >> shift)
                break; // and so on all coarser grids
            mark_cell(c, morton_decode(key >> shift));
        }
    }
}
