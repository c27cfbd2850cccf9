// One VPL for each vertex of S1, drawn in proportion to trilinear weight times intensity: where shadow rays to it may end.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_sums.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 1, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 2, scalar) readonly buffer vertices_block { uint vertices[]; };
layout(set = 0, binding = 3, scalar) readonly buffer order_block { uint order[]; };
layout(set = 0, binding = 4, scalar) readonly buffer cell_masks_block { uint cell_masks[]; };
layout(set = 0, binding = 5, scalar) readonly buffer cell_ranks_block { uint cell_ranks[]; };
layout(set = 0, binding = 6, scalar) readonly buffer cell_starts_block { uint cell_starts[]; };
layout(set = 0, binding = 7, scalar) writeonly buffer samples_block { uvec4 samples[]; };
layout(push_constant, scalar) uniform push_block { uint key; } push;

#include "lgh_cells.glsl.h"

void main()
{
    uint i = gl_WorkGroupID.y * 65535u * 64u + gl_GlobalInvocationID.x;
    uint c = header.level_count - 1u;
    if (i >= header.levels[c].occupied)
        return;
    uint place = header.levels[c].first_light + i;
    uvec3 vertex = unpack_vertex(vertices[place]);
    uint random = hash(push.key, vertices[place], c), chosen = LGH_NO_SAMPLE;
    float sum = 0.0;
    for (uint corner = 0u; corner < 8u; corner++) {
        uvec2 range = cell_range(ivec3(vertex) - 1 + ivec3(uvec3(corner, corner >> 1, corner >> 2) & 1u));
        for (uint j = range.x; j < range.y; j++) {
            vpl light = vpls[order[j]];
            vec3 offset = grid_position(light.position, header.origin, header.top_size, c) - vec3(vertex);
            float weight = trilinear(offset) * light.intensity;
            sum += weight;
            random = hash(random);
            if (unit_float(random) * sum < weight)
                chosen = order[j];
        }
    }
    samples[place] = uvec4(chosen);
}
