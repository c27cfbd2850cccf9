// From a vertex to its place in the merged arrays. The includer declares `masks` and `ranks`.
#ifndef LGH_LOOKUP_GLSL_H
#define LGH_LOOKUP_GLSL_H

const uint LGH_NONE = 0xffffffffu;

// LGH_NONE where the vertex holds no light.
uint lookup(uint c, uvec3 vertex)
{
    uint bit = mask_bit(c, vertex);
    uint word = masks[bit >> 5];
    if ((word >> (bit & 31u) & 1u) == 0u)
        return LGH_NONE;
    return ranks[bit >> 5] + uint(bitCount(word & ((1u << (bit & 31u)) - 1u)));
}

#endif
