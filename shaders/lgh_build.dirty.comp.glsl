// Incremental: dispatches over the dirty vertices, by the step that builds their level.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.state.glsl.h"

layout(local_size_x = 1) in;
layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1, scalar) buffer state_block { lgh_state state; };

void main()
{
    for (uint step = 0u; step < LGH_EXPONENTS; step++) {
        uint vertices = step < header.level_count ? state.dirty[header.level_count - 1u - step] : 0u;
        state.dirty_dispatch[step] = dispatch_of((vertices + 63u) / 64u);
    }
}
