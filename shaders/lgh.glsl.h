// The lighting grid hierarchy's geometry: grids, vertex masks and ranks, and the order of the merged grid lights.
//
// The grid is a cube of two cells of the top level an axis, from header.origin; header.top_size is the edge of one.
// Exponent c has 2^(c+1) cells along each axis and one vertex more. Which vertices hold light is a bit mask per exponent
// (`lgh_masks`), stored in blocks of 8^3 vertices, Morton order inside a block, blocks in raster order (near enough to a
// Morton curve for dealing lights to interleaved tiles, without its powers of two), exponents 0, 1, ...
// one after the other. `lgh_ranks` counts the bits before each word over the whole array, so a vertex's rank is at once
// its place in the merged arrays (`lgh_vertices`, `lgh_sums`, `lgh_lights`): the top level first, S1 last. Words without a
// bit, which are nearly all, have no rank, and no step looks at them: `lgh_masks_filled` has a bit for each of the others.
#ifndef LGH_GLSL_H
#define LGH_GLSL_H

#include "common.glsl.h"

// In `lgh_samples`, four choices on the way from a grid light to one of its VPLs (a finer grid light's place, from S1 a
// VPL's slot): there is none, as the light has no intensity.
const uint LGH_NO_SAMPLE = 0xffffffffu;

// Words before exponent c's masks, and after the last: 16 ceil((2^(c+1) + 1) / 8)^3 words each.
const uint LGH_MASK_OFFSET[LGH_EXPONENTS + 1] =
    uint[](0u, 16u, 32u, 160u, 592u, 2592u, 14256u, 92864u, 667856u, 5061856u);

// The same for masks of cells, where those of all exponents are kept.
const uint LGH_CELL_OFFSET[LGH_EXPONENTS + 1] =
    uint[](0u, 1u, 3u, 19u, 147u, 1171u, 9363u, 74899u, 599187u, 4793491u);

// The bits of x (at most 9) spread to every third.
uint spread_bits(uint x)
{
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}
uint morton(uvec3 v) { return spread_bits(v.x) | spread_bits(v.y) << 1 | spread_bits(v.z) << 2; }

uint compact_bits(uint x)
{
    x &= 0x09249249u;
    x = (x | x >> 2) & 0x030c30c3u;
    x = (x | x >> 4) & 0x0300f00fu;
    x = (x | x >> 8) & 0x030000ffu;
    return (x | x >> 16) & 0x3ffu;
}
uvec3 morton_decode(uint code) { return uvec3(compact_bits(code), compact_bits(code >> 1), compact_bits(code >> 2)); }

uint pack_vertex(uvec3 v) { return v.x | v.y << 10 | v.z << 20; }
uvec3 unpack_vertex(uint packed) { return uvec3(packed, packed >> 10, packed >> 20) & 0x3ffu; }

uint grid_cells(uint c) { return 2u << c; } // along an axis

uint mask_blocks(uint c) { return (grid_cells(c) >> 3) + 1u; } // along an axis

// Bit number of a vertex in the mask array.
uint mask_bit(uint c, uvec3 v)
{
    uint blocks = mask_blocks(c);
    uvec3 block = v >> 3;
    return (LGH_MASK_OFFSET[c] << 5) + (((block.z * blocks + block.y) * blocks + block.x) << 9) + morton(v & 7u);
}

// The vertex of a bit number within exponent c.
uvec3 mask_vertex(uint c, uint bit)
{
    bit -= LGH_MASK_OFFSET[c] << 5;
    uint blocks = mask_blocks(c);
    uint block = bit >> 9;
    return uvec3(block % blocks, block / blocks % blocks, block / (blocks * blocks)) * 8u + morton_decode(bit & 511u);
}

// Words of the mask of exponent c's cells, by Morton code.
uint cell_words(uint c) { return ((8u << 3u * c) + 31u) / 32u; }

// Position on the grid of exponent c, in cells: in [0, 2^(c+1)). Powers of two scale exactly, so the cells of all
// exponents nest.
vec3 grid_position(vec3 position, vec3 origin, float top_size, uint c)
{
    return clamp((position - origin) / (2.0 * top_size), vec3(0.0), vec3(0.99999994)) * float(grid_cells(c));
}

// Exponent of a merged index: levels[c].first_light grows with c.
uint light_exponent(lgh_header header, uint light)
{
    uint c = header.level_count - 1u;
    while (c > 0u && light < header.levels[c].first_light)
        c--;
    return c;
}

#endif
