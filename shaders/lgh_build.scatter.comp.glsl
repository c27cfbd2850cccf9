// The paper's scatter: each VPL adds itself to eight vertices by float atomics, on S1 alone or on every level (Table 1).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_atomic_float : require
#include "lgh_sums.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 2, scalar) readonly buffer masks_block { uint masks[]; };
layout(set = 0, binding = 3, scalar) readonly buffer ranks_block { uint ranks[]; };
layout(set = 0, binding = 4, scalar) buffer sums_block { float sums[]; }; // lgh_sums as 20 floats
layout(push_constant, scalar) uniform push_block { uint slot_count, demo, step; } push; // step t adds to S_(t+1)

#include "lgh_lookup.glsl.h"

void add3(uint place, vec3 value)
{
    atomicAdd(sums[place], value.x);
    atomicAdd(sums[place + 1u], value.y);
    atomicAdd(sums[place + 2u], value.z);
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.slot_count || push.step >= header.level_count || vpls[i].intensity <= 0.0)
        return;
    uint c = header.level_count - 1u - push.step;
    vpl light = vpls[i];
    vec3 position = grid_position(light.position, header.origin, header.top_size, c);
    for (uint corner = 0u; corner < 8u; corner++) {
        uvec3 vertex = uvec3(position) + (uvec3(corner, corner >> 1, corner >> 2) & 1u);
        vec3 offset = position - vec3(vertex);
        lgh_sums s = sums_of(light, offset * header.levels[c].cell_size, trilinear(offset), push.demo != 0u);
        uint place = 20u * lookup(c, vertex);
        add3(place, s.color);
        atomicAdd(sums[place + 3u], s.weight);
        add3(place + 4u, s.position);
        add3(place + 7u, s.square);
        add3(place + 10u, s.normal);
        add3(place + 13u, s.moment_diagonal);
        add3(place + 16u, s.moment_mixed);
    }
}
