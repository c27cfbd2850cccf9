// The dispatch over the cells that were noted.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "light_gather.glsl.h"

layout(local_size_x = 1) in;
layout(set = 0, binding = 3, scalar) buffer counts_block { gather_counts counts; };

void main()
{
    counts.cell_dispatch = lgh_dispatch((min(counts.cells, GATHER_CELLS) + 63u) / 64u, 1u, 1u, 0u);
}
