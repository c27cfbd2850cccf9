// Chooses the number of levels from the counted vertices and fills the header: places of the levels, indirect arguments.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh.glsl.h"

layout(local_size_x = 1) in;
layout(set = 0, binding = 2, scalar) readonly buffer counts_block { uint counts[LGH_EXPONENTS]; };
layout(set = 0, binding = 3, scalar) buffer header_block { lgh_header header; };
layout(push_constant, scalar) uniform push_block {
    uint exponent;  // finest candidate
    uint levels;    // asked for; 0: automatic
    uint capacity;  // grid lights that fit
    uint interleave;
    float alpha;
} push;

uint lights_up_to(uint c)
{
    uint sum = 0u;
    for (uint i = 0u; i <= c; i++)
        sum += counts[i];
    return sum;
}

// Automatic: the largest number of levels with fewer vertices in S1 than half the VPLs (Lin and Yuksel 2019, section 4.3).
uint choose_levels()
{
    if (header.vpl_count == 0u)
        return 0u;
    uint levels = push.levels > 0u ? min(push.levels, push.exponent + 1u) : push.exponent + 1u;
    while (levels > 1u && (lights_up_to(levels - 1u) > push.capacity ||
                           (push.levels == 0u && 2u * counts[levels - 1u] >= header.vpl_count)))
        levels--;
    return levels;
}

lgh_dispatch dispatch_of(uint groups)
{
    return lgh_dispatch(min(groups, 65535u), (groups + 65534u) / 65535u, 1u, 0u);
}

// Instances of a level's light volumes: each light in one tile, or in all where there are too few to deal.
uint volume_instances(uint c)
{
    uint tiles = push.interleave * push.interleave;
    return counts[c] < 4u * tiles ? counts[c] * tiles : counts[c];
}

void main()
{
    uint levels = choose_levels();
    uint first = 0u;
    for (uint c = 0u; c < LGH_EXPONENTS; c++) {
        uint occupied = c < levels ? counts[c] : 0u;
        float size = header.top_size / float(1u << c);
        header.levels[c] = lgh_level(occupied, first, size, push.alpha * size);
        first += occupied;
        uint built = levels - 1u - c; // S_(c+1) has this exponent
        uint vertices = c >= 1u && c < levels ? counts[built] : 0u;
        header.restrict_dispatch[c] = dispatch_of((vertices + 63u) / 64u);
        header.gather_dispatch[c] = dispatch_of(vertices);
    }
    header.level_count = levels;
    header.light_count = first;
    header.word_count = LGH_MASK_OFFSET[levels];
    uint words[2] = uint[](header.word_count, levels > 0u ? cell_words(levels - 1u) : 0u);
    for (uint i = 0u; i < 2u; i++) {
        header.word_dispatch[i] = dispatch_of((words[i] + 255u) / 256u);
        header.scan_dispatch[i] = dispatch_of((words[i] + LGH_SCAN_WORDS - 1u) / LGH_SCAN_WORDS);
    }
    header.light_dispatch = dispatch_of((first + 63u) / 64u);
    header.first_dispatch = dispatch_of(levels > 0u ? (counts[levels - 1u] + 63u) / 64u : 0u);
    uint instances = 0u;
    for (uint c = 1u; c + 1u < levels; c++)
        instances += volume_instances(c);
    header.volume_draw = lgh_draw(14u, instances, 0u, 0u);
    header.volume_first_draw = lgh_draw(14u, levels > 1u ? volume_instances(levels - 1u) : 0u, 0u, 0u);
}
