// Four VPLs for each vertex of S1, drawn in proportion to trilinear weight times intensity: where shadow rays may end.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.first.glsl.h"

layout(set = 0, binding = 9, scalar) writeonly buffer samples_block { uvec4 samples[]; };
layout(push_constant, scalar) uniform push_block { uint key; } push;

void main()
{
    uint place;
    uvec3 vertex;
    if (!first_vertex(place, vertex))
        return;
    uint random = hash(push.key, vertices[place], header.level_count);
    uvec4 chosen = uvec4(LGH_NO_SAMPLE);
    float sum = 0.0;
    for (uint corner = 0u; corner < 8u; corner++) {
        uvec2 range = corner_range(vertex, corner);
        for (uint j = range.x; j < range.y; j++) {
            vpl light = vpls[order[j]];
            float weight = trilinear(cell_offset(light, vertex)) * light.intensity;
            sum += weight;
            for (uint k = 0u; k < 4u; k++) {
                random = hash(random);
                if (unit_float(random) * sum < weight)
                    chosen[k] = order[j];
            }
        }
    }
    samples[place] = chosen;
}
