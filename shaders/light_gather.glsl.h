// Gather lighting: which lights may reach a pixel, and where they are packed.
//
// A level with exponent c (c = level_count: the VPLs themselves, start level 0) has lists for its list cells: cubes of
// 2^push.coarser of its own cells an edge, about its lights' reach. Only cells that a pixel lies in have lists; a hash
// table finds them. Levels too coarse for such cells have no lists: every one of their lights is a candidate, as it is
// wherever a list is missing because the buffers are full. That is slow, never wrong.
//
// Pixels outside the grid belong to the nearest cell. Lights lie inside, and to move a point to the nearest point of a
// box moves it nearer to all that lies in the box, so no light is missed.
#ifndef LIGHT_GATHER_GLSL_H
#define LIGHT_GATHER_GLSL_H

#include "gbuffer.glsl.h"
#include "interleave.glsl.h"
#include "lgh_shade.glsl.h"

const uint GATHER_NONE = 0xffffffffu;
const uint GATHER_CELLS = 1u << 16;       // lists at most, times the interleaved tiles
const uint GATHER_TABLE = 2u * GATHER_CELLS; // slots of the hash table

struct gather_slot {
    uint key; // gather_key of a cell; 0: free
    uint cell;
};

// Where a list lies among the entries; `first` is GATHER_NONE where it found no room.
struct gather_range {
    uint first, count;
};

struct gather_counts {
    lgh_dispatch cell_dispatch; // one invocation per cell
    uint cells;                 // wanted; those from GATHER_CELLS on have no list
    uint entries;               // wanted
};

layout(push_constant, scalar) uniform push_block {
    uint interleave;
    uint start_level;
    uint coarser;        // a list cell has 2^coarser cells of its level along an edge; at least 1
    uint entry_capacity;
    uint grid_capacity;  // packed VPLs lie behind as many packed grid lights, in the order of `lgh_order`
    uint slot_count;     // VPL slots
    uint late_s1;        // 1: S1 and S0 are offered only where no other light was
    float alpha;
    float singularity;   // b, metres
} push;

// ---- Levels

uint gather_levels(lgh_header header) { return header.level_count + (push.start_level == 0u ? 1u : 0u); }

float gather_cell_size(lgh_header header, uint c)
{
    return c < header.level_count ? header.levels[c].cell_size : 0.5 * header.levels[header.level_count - 1u].cell_size;
}

// Of the level's lights tile t has those whose number in the level is t modulo the tiles, where it has enough to deal.
bool gather_dealt(lgh_header header, uint c)
{
    return c == header.level_count || header.levels[c].occupied >= 4u * push.interleave * push.interleave;
}

// VPL slots lie path by path; the shift keeps bounces from falling into one tile each.
uint gather_slot_tile(uint slot, uint tiles) { return (slot + slot / tiles) % tiles; }

// ---- Cells

bool gather_has_cells(uint c) { return c > push.coarser; }

// The list cell of a point, on the grid of list cells.
uvec3 gather_cell(lgh_header header, vec3 position, uint c)
{
    return uvec3(grid_position(position, header.origin, header.top_size, c)) >> push.coarser;
}

// Unique over all levels, never 0: the Morton code behind a leading one whose place tells the level.
uint gather_key(uvec3 cell, uint c) { return morton(cell) | 1u << 3u * (c - push.coarser + 1u); }

void gather_cell_of_key(uint key, out uvec3 cell, out uint c)
{
    uint leading = uint(findMSB(key));
    c = leading / 3u + push.coarser - 1u;
    cell = morton_decode(key & ~(1u << leading));
}

// Where the search for a key in the hash table starts; it goes on slot by slot.
uint gather_probe(uint key) { return hash(key) % GATHER_TABLE; }

// ---- Packed lights: what a light sends, in three texels, next to each other.

const uint GATHER_ROW = 1024u; // lights in a row of the image

struct gather_light {
    vec3 position;
    float spread;    // grid_spread
    vec3 color;
    uint name; // gather_name
    vec3 normal;
    vec3 diagonal, mixed; // second moments of the normals
};

// A light's name in reservoirs has free bits between the number and RESERVOIR_VPL. They hold which share of its flux is
// not that of surfaces, 0 to 1, and are zero where there are no lights that radiate evenly.
const uint GATHER_NUMBER = 0x3fffffu;
const uint GATHER_EVEN = 0x1ffu << 22;

uint gather_name(uint name, float share) { return name | uint((1.0 - share) * 511.0 + 0.5) << 22; }
float gather_share(uint name) { return 1.0 - float(name >> 22 & 0x1ffu) * (1.0 / 511.0); }

ivec2 gather_texel(uint light) { return ivec2(3u * (light % GATHER_ROW), light / GATHER_ROW); }

uvec4 gather_pack_position(gather_light g) { return floatBitsToUint(vec4(g.position, g.spread)); }
uvec4 gather_pack_color(gather_light g) { return uvec4(floatBitsToUint(g.color), g.name); }
// To 3e-5, from -1 to 1.
uvec4 gather_pack_moments(gather_light g)
{
    return uvec4(packSnorm2x16(g.normal.xy), packSnorm2x16(vec2(g.normal.z, g.diagonal.x)),
                 packSnorm2x16(vec2(g.diagonal.y, g.mixed.x)), packSnorm2x16(g.mixed.yz));
}

#ifdef GATHER_EVEN_CONSTANT
layout(constant_id = GATHER_EVEN_CONSTANT) const bool EVEN_LIGHTS = false; // there are lights that radiate evenly
gather_light gather_unpack(uvec4 position, uvec4 color, uvec4 moments)
{
    vec4 p = uintBitsToFloat(position);
    vec2 a = unpackSnorm2x16(moments.x), b = unpackSnorm2x16(moments.y), d = unpackSnorm2x16(moments.z);
    // The trace of the second moments is the surfaces' share.
    float last = (EVEN_LIGHTS ? gather_share(color.a) : 1.0) - b.y - d.x;
    return gather_light(p.xyz, p.w, uintBitsToFloat(color.rgb), color.a, vec3(a, b.x), vec3(b.y, d.x, last),
                        vec3(d.y, unpackSnorm2x16(moments.w)));
}
#endif

#endif
