// Notes the list cells of every pixel in the hash table, finest first. Who finds a cell noted leaves its ancestors to
// the invocation that noted it. Which number a cell gets depends on the order of execution, and nothing else does.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "light_gather.glsl.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1) uniform sampler2D depth_map;
layout(set = 0, binding = 2, scalar) buffer table_block { gather_slot table[GATHER_TABLE]; };
layout(set = 0, binding = 3, scalar) buffer counts_block { gather_counts counts; };
layout(set = 0, binding = 4, scalar) writeonly buffer cells_block { uint cell_keys[]; };

// False where the cell was noted before.
bool note_cell(uint key)
{
    for (uint i = 0u, slot = gather_probe(key); i < GATHER_TABLE; i++, slot = (slot + 1u) % GATHER_TABLE) {
        uint found = table[slot].key;
        if (found == 0u)
            found = atomicCompSwap(table[slot].key, 0u, key);
        if (found == key)
            return false;
        if (found == 0u) {
            uint cell = atomicAdd(counts.cells, 1u);
            table[slot].cell = cell < GATHER_CELLS ? cell : GATHER_NONE;
            if (cell < GATHER_CELLS)
                cell_keys[cell] = key;
            return true;
        }
    }
    return true; // no room: no list
}

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, uvec2(frame.width, frame.height))) || header.level_count == 0u)
        return;
    float depth = texelFetch(depth_map, ivec2(pixel), 0).x;
    if (depth <= 0.0)
        return;
    vec3 position = gbuffer_position(pixel, depth);
    for (uint c = gather_levels(header) - 1u; gather_has_cells(c); c--)
        if (!note_cell(gather_key(gather_cell(header, position, c), c)))
            return;
}
