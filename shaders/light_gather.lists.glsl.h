// Makes the lists: each invocation walks the lights around one cell twice, to count and, once it knows how much room
// there is, to fill. Entries are in the order of the lights. A cell has a list per interleaved tile where its level is
// dealt to the tiles.
#ifndef LIGHT_GATHER_LISTS_GLSL_H
#define LIGHT_GATHER_LISTS_GLSL_H

#include "light_gather.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1, scalar) buffer counts_block { gather_counts counts; };
layout(set = 0, binding = 2, scalar) readonly buffer cells_block { uint cell_keys[]; };
layout(set = 0, binding = 3, scalar) buffer ranges_block { gather_range ranges[]; }; // [cell][tile]
layout(set = 0, binding = 4, scalar) writeonly buffer entries_block { uint entries[]; };
layout(set = 0, binding = 5, scalar) readonly buffer masks_block { uint masks[]; };
layout(set = 0, binding = 6, scalar) readonly buffer ranks_block { uint ranks[]; };
layout(set = 0, binding = 7, rgba32ui) uniform readonly uimage2D packed_lights;
#ifdef START_LEVEL_0
layout(set = 0, binding = 8, scalar) readonly buffer cell_masks_block { uint cell_masks[]; };
layout(set = 0, binding = 9, scalar) readonly buffer cell_ranks_block { uint cell_ranks[]; };
layout(set = 0, binding = 10, scalar) readonly buffer cell_starts_block { uint cell_starts[]; };
layout(set = 0, binding = 11, scalar) readonly buffer order_block { uint order[]; };
#include "lgh_cells.glsl.h"
#endif

struct list_cell {
    uint c;
    uvec3 cell;
    vec3 low, high;     // world
    float reach_square; // of the level's lights
    uint first_range, tiles; // tiles: 1 where the level is not dealt
    bool fill;          // else count
};

// Of the cell's only list, where it has one: counted here, and not in memory.
gather_range only;

void take(list_cell l, uint light, uint tile)
{
    if (l.tiles == 1u) {
        if (l.fill)
            entries[only.first + only.count] = light;
        only.count++;
        return;
    }
    uint place = l.first_range + tile, count = ranges[place].count;
    if (l.fill)
        entries[ranges[place].first + count] = light;
    ranges[place].count = count + 1u;
}

// Whether the ball around the light that it reaches meets the cell, and the light is not black.
bool reaches(list_cell l, uint light)
{
    ivec2 texel = gather_texel(light);
    vec3 position = uintBitsToFloat(imageLoad(packed_lights, texel).xyz);
    vec3 offset = position - clamp(position, l.low, l.high);
    return dot(offset, offset) < l.reach_square;
}

// Takes the lights of the vertices of one mask word.
void walk_word(list_cell l, uint word)
{
    uint light = ranks[word];
    for (uint bits = masks[word]; bits != 0u; bits &= bits - 1u, light++)
        if (reaches(l, light))
            take(l, light, (light - header.levels[l.c].first_light) % l.tiles);
}

// Vertices stray from their cells by up to a cell, so those within 2 alpha + 1 may have a light that reaches this one.
// Words hold 4 x 4 x 2 vertices, and a block of 8^3 sixteen words in Morton order.
void walk_vertices(list_cell l)
{
    int blocks = int(mask_blocks(l.c)), edge = 1 << push.coarser, ring = int(ceil(2.0 * push.alpha)) + 1;
    ivec3 low = ivec3(l.cell) * edge - ring, high = low + edge + 2 * ring;
    ivec3 first = max(low >> 3, 0), count = min(high >> 3, blocks - 1) - first + 1;
    for (int i = 0; i < count.x * count.y * count.z; i++) {
        ivec3 block = first + ivec3(i % count.x, i / count.x % count.y, i / (count.x * count.y));
        uint first_word = mask_bit(l.c, uvec3(block) * 8u) >> 5;
        for (uint w = 0u; w < 16u; w++) {
            ivec3 vertex = block * 8 + ivec3(w << 1 & 4u, w & 4u, (w << 1 & 2u) | (w >> 1 & 4u));
            if (all(lessThanEqual(vertex, high)) && all(greaterThanEqual(vertex + ivec3(3, 3, 1), low)))
                walk_word(l, first_word + w);
        }
    }
}

#ifdef START_LEVEL_0
// The VPLs of S1's cells around.
void walk_vpls(list_cell l)
{
    float size = gather_cell_size(header, header.level_count - 1u);
    float reach = sqrt(l.reach_square);
    ivec3 low = ivec3(floor((l.low - reach - header.origin) / size));
    ivec3 high = ivec3(floor((l.high + reach - header.origin) / size));
    uint tiles = push.interleave * push.interleave;
    for (int z = low.z; z <= high.z; z++)
        for (int y = low.y; y <= high.y; y++)
            for (int x = low.x; x <= high.x; x++) {
                uvec2 range = cell_range(ivec3(x, y, z));
                for (uint i = range.x; i < range.y; i++)
                    if (reaches(l, push.grid_capacity + i))
                        take(l, push.grid_capacity + i, tiles > 1u ? gather_slot_tile(order[i], tiles) : 0u);
            }
}
#endif

void walk(list_cell l)
{
    only = gather_range(ranges[l.first_range].first, 0u);
    for (uint t = 0u; t < l.tiles; t++)
        ranges[l.first_range + t].count = 0u;
#ifdef START_LEVEL_0
    if (l.c == header.level_count)
        walk_vpls(l);
    else
#endif
        walk_vertices(l);
    if (l.tiles == 1u)
        ranges[l.first_range].count = only.count;
}

// Gives the counted lists their places. False: there is no room.
bool place_lists(list_cell l)
{
    uint sum = 0u;
    for (uint t = 0u; t < l.tiles; t++) {
        ranges[l.first_range + t].first = sum;
        sum += ranges[l.first_range + t].count;
    }
    uint first = atomicAdd(counts.entries, sum);
    bool fits = first <= push.entry_capacity && sum <= push.entry_capacity - first;
    for (uint t = 0u; t < l.tiles; t++)
        ranges[l.first_range + t].first = fits ? first + ranges[l.first_range + t].first : GATHER_NONE;
    return fits;
}

void main()
{
    uint cell = gl_GlobalInvocationID.x;
    if (cell >= min(counts.cells, GATHER_CELLS))
        return;
    list_cell l;
    gather_cell_of_key(cell_keys[cell], l.cell, l.c);
    float unit = gather_cell_size(header, l.c), edge = unit * float(1u << push.coarser);
    float slack = 1e-4 * edge; // of the pixels' rounding
    l.low = header.origin + vec3(l.cell) * edge - slack;
    l.high = l.low + edge + 2.0 * slack;
    l.reach_square = 4.0 * push.alpha * push.alpha * unit * unit;
    l.tiles = gather_dealt(header, l.c) ? push.interleave * push.interleave : 1u;
    l.first_range = cell * push.interleave * push.interleave;
    l.fill = false;
    walk(l);
    l.fill = place_lists(l);
    if (l.fill)
        walk(l);
}

#endif
