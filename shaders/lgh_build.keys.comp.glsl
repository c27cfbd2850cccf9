// Sort keys: the Morton code of each VPL's cell on the finest candidate grid; empty slots get the first code past the grid.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 2, scalar) buffer keys_block { uint keys[]; };
layout(set = 0, binding = 4, scalar) buffer order_block { uint order[]; };
layout(set = 0, binding = 5, scalar) buffer keys_swap_block { uint keys_swap[]; };
layout(set = 0, binding = 6, scalar) buffer order_swap_block { uint order_swap[]; };
layout(push_constant, scalar) uniform push_block { uint slot_count, exponent, into_swap; } push;

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.slot_count)
        return;
    uint key = 1u << 3u * push.exponent;
    if (vpls[i].intensity > 0.0)
        key = morton(uvec3(grid_position(vpls[i].position, header.origin, header.top_size, push.exponent)));
    if (push.into_swap != 0u) {
        keys_swap[i] = key;
        order_swap[i] = i;
    } else {
        keys[i] = key;
        order[i] = i;
    }
}
