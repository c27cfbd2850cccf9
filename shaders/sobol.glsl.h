// Owen-scrambled Sobol points by hashing (Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4)); direction
// numbers by Joe and Kuo (2008). Four dimensions at a time; further groups of four are decorrelated by shuffling.
#ifndef SOBOL_GLSL_H
#define SOBOL_GLSL_H

#include "common.glsl.h"

const uint SOBOL_DIRECTIONS[3][32] = uint[3][32](
    uint[32](
        0x80000000u, 0xc0000000u, 0xa0000000u, 0xf0000000u, 0x88000000u, 0xcc000000u, 0xaa000000u, 0xff000000u,
        0x80800000u, 0xc0c00000u, 0xa0a00000u, 0xf0f00000u, 0x88880000u, 0xcccc0000u, 0xaaaa0000u, 0xffff0000u,
        0x80008000u, 0xc000c000u, 0xa000a000u, 0xf000f000u, 0x88008800u, 0xcc00cc00u, 0xaa00aa00u, 0xff00ff00u,
        0x80808080u, 0xc0c0c0c0u, 0xa0a0a0a0u, 0xf0f0f0f0u, 0x88888888u, 0xccccccccu, 0xaaaaaaaau, 0xffffffffu),
    uint[32](
        0x80000000u, 0xc0000000u, 0x60000000u, 0x90000000u, 0xe8000000u, 0x5c000000u, 0x8e000000u, 0xc5000000u,
        0x68800000u, 0x9cc00000u, 0xee600000u, 0x55900000u, 0x80680000u, 0xc09c0000u, 0x60ee0000u, 0x90550000u,
        0xe8808000u, 0x5cc0c000u, 0x8e606000u, 0xc5909000u, 0x6868e800u, 0x9c9c5c00u, 0xeeee8e00u, 0x5555c500u,
        0x8000e880u, 0xc0005cc0u, 0x60008e60u, 0x9000c590u, 0xe8006868u, 0x5c009c9cu, 0x8e00eeeeu, 0xc5005555u),
    uint[32](
        0x80000000u, 0xc0000000u, 0x20000000u, 0x50000000u, 0xf8000000u, 0x74000000u, 0xa2000000u, 0x93000000u,
        0xd8800000u, 0x25400000u, 0x59e00000u, 0xe6d00000u, 0x78080000u, 0xb40c0000u, 0x82020000u, 0xc3050000u,
        0x208f8000u, 0x51474000u, 0xfbea2000u, 0x75d93000u, 0xa0858800u, 0x914e5400u, 0xdbe79e00u, 0x25db6d00u,
        0x58800080u, 0xe54000c0u, 0x79e00020u, 0xb6d00050u, 0x800800f8u, 0xc00c0074u, 0x200200a2u, 0x50050093u));

// Owen scrambling of the bits of x, most significant first (the Laine-Karras hash on reversed bits).
uint owen_scramble(uint x, uint seed)
{
    x = bitfieldReverse(x);
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return bitfieldReverse(x);
}

// Point `index` of the sequence, dimensions 4 * group .. 4 * group + 3, each in [0,1).
vec4 sobol(uint index, uint group, uint seed)
{
    seed = hash(seed, group);
    index = owen_scramble(index, seed); // a shuffle within aligned blocks, so prefixes stay nets
    uvec4 x = uvec4(bitfieldReverse(index), 0u, 0u, 0u);
    for (uint bit = 0u; bit < 32u && (index >> bit) != 0u; bit++)
        if ((index >> bit & 1u) != 0u)
            x.yzw ^= uvec3(SOBOL_DIRECTIONS[0][bit], SOBOL_DIRECTIONS[1][bit], SOBOL_DIRECTIONS[2][bit]);
    return vec4(unit_float(owen_scramble(x.x, hash(seed, 1u))), unit_float(owen_scramble(x.y, hash(seed, 2u))),
                unit_float(owen_scramble(x.z, hash(seed, 3u))), unit_float(owen_scramble(x.w, hash(seed, 4u))));
}

#endif
