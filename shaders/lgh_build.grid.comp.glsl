// Bounds of the VPLs, second half: one invocation joins the partials, and keeps last frame's grid or lays a new one.
//
// The top level's cell is the longest edge of the VPLs' bounds, a little padded (Lin and Yuksel 2019, section 3.1); of the
// scene's, around which VPLs may move as they like; or the next power of two, and the corner a multiple of it. The latter
// two are kept for as long as every VPL lies in them, and the level count too (see lgh_build.levels.comp.glsl). The
// scene's outer walls lie on the grid's faces, and have one layer of vertices with light, not two: powers of two
// have 1.3 to 1.4 times the lights per pixel at equal alpha (measured, atrium and Sponza).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lgh_build.state.glsl.h"

layout(local_size_x = 1) in;
layout(set = 0, binding = 1, scalar) buffer partials_block { lgh_partial partials[]; };
layout(set = 0, binding = 4, scalar) buffer header_block { lgh_header header; };
layout(set = 0, binding = 5, scalar) buffer state_block { lgh_state state; };
layout(push_constant, scalar) uniform push_block {
    uint partial_count;
    uint exponent; // finest candidate
    uint stage;
    uint history; // 1: header and state are last frame's
    uint changed; // 1: the partials are of the changed VPLs alone
    uint kept;    // 1: a grid is kept while it fits
    uint snapped; // 1: it lies at powers of two
    vec3 scene_low, scene_high; // that a grid is laid around, if not empty
} push;

void lay_grid(vec3 low, vec3 high)
{
    vec3 extent = high - low;
    float longest = max(max(extent.x, extent.y), extent.z);
    vec3 reach = max(abs(low), abs(high));
    float pad = 1e-4 * longest + 1e-5 * max(max(reach.x, reach.y), reach.z) + 1e-6;
    header.origin = low - pad;
    header.top_size = longest + 2.0 * pad;
    if (push.snapped != 0u) {
        header.top_size = uintBitsToFloat((floatBitsToUint(header.top_size) + 0x7fffffu) & 0x7f800000u);
        header.origin = floor(header.origin / header.top_size) * header.top_size;
    }
}

bool grid_fits(vec3 low, vec3 high)
{
    return all(greaterThanEqual(low, header.origin)) &&
           all(lessThanEqual(high, header.origin + 2.0 * header.top_size));
}

// Joins the partials, and gives each the number of VPLs before it.
lgh_partial join_partials()
{
    lgh_partial all = lgh_partial(vec3(1e30), 0u, vec3(-1e30), 0u);
    for (uint i = 0u; i < push.partial_count; i++) {
        lgh_partial partial = partials[i];
        partials[i].count = all.count;
        all = lgh_partial(min(all.low, partial.low), all.count + partial.count, max(all.high, partial.high),
                          all.removed + partial.removed);
    }
    return all;
}

void set_dispatches(uint stage)
{
    state.once[stage] = dispatch_of(1u);
    state.stretches[stage] = dispatch_of(push.partial_count);
    uint words = LGH_MASK_OFFSET[push.exponent + 1u];
    if (stage == 1u)
        state.words = dispatch_of((words + uint(LGH_CLEAR_WORDS) - 1u) / uint(LGH_CLEAR_WORDS));
    state.vpls[stage] = dispatch_of((header.vpl_count + 255u) / 256u);
}

void clear_dispatches()
{
    for (uint stage = 0u; stage < 2u; stage++)
        state.once[stage] = state.stretches[stage] = state.vpls[stage] = dispatch_of(0u);
    for (uint i = 0u; i < uint(LGH_SORT_PASSES); i++)
        state.sort[i] = dispatch_of(0u);
    state.runs = state.words = dispatch_of(0u);
}

void main()
{
    lgh_partial all = join_partials();
    for (uint c = 0u; c < LGH_EXPONENTS; c++)
        state.counts[c] = state.dirty[c] = 0u;
    clear_dispatches();
    bool changed = push.changed != 0u && push.stage == 0u;
    state.listed = all.count;
    state.last_count = changed ? header.vpl_count : 0u;
    uint count = state.last_count - all.removed + all.count;
    if (push.stage == 1u || (push.kept == 0u && !changed)) {
        if (count == 0u)
            all.low = all.high = vec3(0.0);
        lay_grid(min(all.low, push.scene_low), max(all.high, push.scene_high));
    }
    if (push.stage == 0u)
        state.fresh = push.history == 0u || header.level_count == 0u || count == 0u ||
                      (all.count > 0u && !grid_fits(all.low, all.high)) ? 1u : 0u;
    header.vpl_count = push.stage == 0u && state.fresh != 0u ? header.vpl_count : count;
    set_dispatches(push.stage == 0u ? state.fresh : 1u);
    if (state.fresh != 0u)
        return;
    for (uint i = 0u; i < sort_passes(header.level_count); i++)
        state.sort[i] = dispatch_of(sort_blocks(state.listed));
    state.runs = dispatch_of((merge_runs(state.last_count) + 255u) / 256u);
}
