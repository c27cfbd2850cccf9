// Keeps last frame's number of levels or chooses one from the counted vertices, and fills the header: places of the
// levels, indirect arguments.
//
// Chosen is the largest number of levels with fewer vertices in S1 than half the VPLs (Lin and Yuksel 2019, section 4.3).
// It is kept, so that small changes of the light do not pop, while S1 has fewer vertices than 5/8 of the VPLs, and per VPL
// at least half of what it had when chosen; otherwise it is chosen anew, and the grid with it.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.state.glsl.h"

layout(local_size_x = 1) in;
layout(set = 0, binding = 4, scalar) buffer header_block { lgh_header header; };
layout(set = 0, binding = 5, scalar) buffer state_block { lgh_state state; };
layout(push_constant, scalar) uniform push_block {
    uint stage;
    uint partial_count;
    uint exponent; // finest candidate
    uint levels;   // asked for; 0: automatic
    uint capacity; // grid lights that fit
    uint interleave;
    uint sorted;   // 1: stage 1 goes on with a sort
    float alpha;
} push;

uint lights_up_to(uint c)
{
    uint sum = 0u;
    for (uint i = 0u; i <= c; i++)
        sum += state.counts[i];
    return sum;
}

uint choose_levels()
{
    if (header.vpl_count == 0u)
        return 0u;
    uint levels = push.levels > 0u ? min(push.levels, push.exponent + 1u) : push.exponent + 1u;
    while (levels > 1u && (lights_up_to(levels - 1u) > push.capacity ||
                           (push.levels == 0u && 2u * state.counts[levels - 1u] >= header.vpl_count)))
        levels--;
    return levels;
}

float density_of(uint levels) { return float(state.counts[levels - 1u]) / float(header.vpl_count); }

bool levels_fit(uint levels)
{
    float density = density_of(levels);
    bool few = push.levels > 0u || levels == 1u || density < 0.625;
    return few && density >= 0.5 * state.density && lights_up_to(levels - 1u) <= push.capacity;
}

// Instances of a level's light volumes: each light in one tile, or in all where there are too few to deal.
uint volume_instances(uint c)
{
    uint tiles = push.interleave * push.interleave, count = state.counts[c];
    return count < 4u * tiles ? count * tiles : count;
}

void fill_header(uint levels)
{
    uint first = 0u;
    for (uint c = 0u; c < LGH_EXPONENTS; c++) {
        uint occupied = c < levels ? state.counts[c] : 0u;
        float size = header.top_size / float(1u << c);
        header.levels[c] = lgh_level(occupied, first, size, push.alpha * size);
        first += occupied;
        uint built = levels - 1u - c; // S_(c+1) has this exponent
        uint vertices = c >= 1u && c < levels ? state.counts[built] : 0u;
        header.restrict_dispatch[c] = dispatch_of((vertices + 63u) / 64u);
        header.gather_dispatch[c] = dispatch_of(vertices);
    }
    header.level_count = levels;
    header.light_count = first;
    header.word_count = LGH_MASK_OFFSET[levels];
    uint words[2] = uint[](header.word_count, levels > 0u ? cell_words(levels - 1u) : 0u);
    for (uint i = 0u; i < 2u; i++)
        header.scan_dispatch[i] = dispatch_of((words[i] + LGH_SCAN_WORDS - 1u) / LGH_SCAN_WORDS);
    header.light_dispatch = dispatch_of((first + 255u) / 256u);
    header.first_dispatch = dispatch_of(levels > 0u ? (state.counts[levels - 1u] + 63u) / 64u : 0u);
    uint instances = 0u;
    for (uint c = 1u; c + 1u < levels; c++)
        instances += volume_instances(c);
    header.volume_draw = lgh_draw(14u, instances, 0u, 0u);
    header.volume_first_draw = lgh_draw(14u, levels > 1u ? volume_instances(levels - 1u) : 0u, 0u, 0u);
}

void main()
{
    for (uint i = 0u; i < uint(LGH_SORT_PASSES); i++)
        state.sort[i] = dispatch_of(0u);
    if (push.stage == 0u && !levels_fit(header.level_count)) {
        state.fresh = 1u;
        state.once[1] = dispatch_of(1u);
        state.stretches[1] = dispatch_of(push.partial_count);
        return;
    }
    uint levels = push.stage == 0u ? header.level_count : choose_levels();
    fill_header(levels);
    state.list = dispatch_of((header.vpl_count + 255u) / 256u);
    if (push.stage == 0u)
        return;
    state.density = levels > 0u ? density_of(levels) : 0.0;
    for (uint i = 0u; push.sorted != 0u && i < sort_passes(levels); i++)
        state.sort[i] = dispatch_of(sort_blocks(state.listed));
}
