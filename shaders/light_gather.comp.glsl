// Gathers: every pixel adds up the lights of its cells' lists in registers, with its shadow reservoirs. Makes what the
// light volumes make (Lin and Yuksel 2019, sections 3.2 and 3.3).
//
// The lanes of a subgroup have a compact block of one tile's pixels, two each, and walk a list together: each loads
// another light and tests it against the block, then the lights that pass go to all lanes one by one. Where the block's
// pixels lie in several cells it walks several lists, each for its own pixels.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_EXT_control_flow_attributes : require
#define LGH_BLEND_CONSTANT 5
#define GATHER_EVEN_CONSTANT 6
#include "light_gather.glsl.h"
#include "reservoir.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1, scalar) readonly buffer counts_block { gather_counts counts; };
layout(set = 0, binding = 2, scalar) readonly buffer table_block { gather_slot table[GATHER_TABLE]; };
layout(set = 0, binding = 3, scalar) readonly buffer ranges_block { gather_range ranges[]; };
layout(set = 0, binding = 4, scalar) readonly buffer entries_block { uint entries[]; };
layout(set = 0, binding = 5, rgba32ui) uniform readonly uimage2D packed_lights;
layout(set = 0, binding = 6) uniform sampler2D depth_map;
layout(set = 0, binding = 7) uniform sampler2D normal_map;
layout(set = 0, binding = 8, rgba32f) uniform writeonly image2D indirect;
layout(set = 0, binding = 9, scalar) writeonly buffer reservoirs_block { uint reservoir_words[]; };
layout(set = 0, binding = 10, r32f) uniform writeonly image2D lights_per_pixel;

layout(constant_id = 0) const uint EMISSION = 0u;
layout(constant_id = 1) const bool UNIFORM = false;
layout(constant_id = 2) const bool COUNT = false; // makes lights_per_pixel
layout(constant_id = 3) const uint SAMPLES = 0u;  // reservoirs
layout(constant_id = 4) const bool START_LEVEL_0 = false;
const uint SAMPLES_MAX = 8u;

// ---- The pixels of a lane, one below the other in their tile

const uint PIXELS = 2u;

struct shaded_pixel {
    gbuffer_point point;
    bool valid; // something was drawn
    vec4 light; // rgb: radiance over albedo; a: sum of f over the lights that were offered
    float count;
    uint random; // state of a linear congruential generator
    uint chosen[SAMPLES_MAX];
};
shaded_pixel pixels[PIXELS];

void pixel_start(uint j, uint key)
{
    pixels[j].light = vec4(0.0);
    pixels[j].count = 0.0;
    pixels[j].random = key;
    [[unroll]] for (uint s = 0u; s < SAMPLES; s++)
        pixels[j].chosen[s] = RESERVOIR_EMPTY;
}

// A reservoir takes light i with probability f_i / (f_1 + ... + f_i). All share a random number a light, shifted by equal
// steps: which keeps them apart. Lights without weight draw none, so that more candidates change nothing.
void reservoirs_offer(uint j, uint name, float f)
{
    pixels[j].light.a += f;
    pixels[j].random = f > 0.0 ? pixels[j].random * 747796405u + 2891336453u : pixels[j].random;
    [[unroll]] for (uint s = 0u; s < SAMPLES; s++) {
        float u = float(pixels[j].random + s * (0xffffffffu / SAMPLES) >> 8) * (1.0 / 16777216.0);
        pixels[j].chosen[s] = u * pixels[j].light.a < f ? name : pixels[j].chosen[s];
    }
}

void reservoirs_write(uint j, uint index)
{
    uint first = index * (SAMPLES + 1u);
    reservoir_words[first] = floatBitsToUint(pixels[j].light.a);
    [[unroll]] for (uint s = 0u; s < SAMPLES; s++)
        reservoir_words[first + 1u + s] = pixels[j].chosen[s];
}

// ---- The block of pixels that a subgroup shades

vec3 block_low, block_high; // bounds, of points moved into the grid
bool block_moved;           // some were
bool block_flat;            // all pixels have this normal
vec3 block_normal;
float block_height;         // least along the normal

void block_bound()
{
    vec3 low = vec3(1e30), high = vec3(-1e30), normal_low = vec3(2.0), normal_high = vec3(-2.0);
    bool moved = false;
    [[unroll]] for (uint j = 0u; j < PIXELS; j++) {
        if (!pixels[j].valid)
            continue;
        gbuffer_point p = pixels[j].point;
        vec3 cells = grid_position(p.position, header.origin, header.top_size, 0u);
        vec3 inside = header.origin + cells * header.levels[0].cell_size;
        vec3 shift = abs(inside - p.position);
        moved = moved || max(max(shift.x, shift.y), shift.z) > 1e-3 * header.top_size;
        low = min(low, inside);
        high = max(high, inside);
        normal_low = min(normal_low, p.geometric);
        normal_high = max(normal_high, p.geometric);
    }
    block_low = subgroupMin(low);
    block_high = subgroupMax(high);
    block_moved = subgroupAny(moved);
    block_normal = subgroupMin(normal_low);
    block_flat = block_normal == subgroupMax(normal_high);
    float height = 1e30;
    [[unroll]] for (uint j = 0u; j < PIXELS; j++)
        if (pixels[j].valid)
            height = min(height, dot(block_normal, pixels[j].point.position));
    block_height = subgroupMin(height);
}

// ---- Lights

struct gather_level {
    uint c, kind;
    bool vpls; // S0
    float inverse_radius;
    float reach_square;   // beyond it the blending function is zero; not so at the top
    float near_square;    // nearer than that too; not so at the lowest level
    float factor; // 1, or the number of tiles where its lights are dealt to them
};

// Whether a light may reach any of the block's pixels.
bool may_light(vec3 position, gather_level level)
{
    vec3 near = position - clamp(position, block_low, block_high);
    if (dot(near, near) > level.reach_square)
        return false;
    vec3 far = max(position - block_low, block_high - position);
    if (!block_moved && dot(far, far) < level.near_square)
        return false;
    return COUNT || !block_flat || dot(block_normal, position) > block_height;
}

// The light of another lane.
gather_light shuffled(gather_light g, uint lane)
{
    return gather_light(subgroupShuffle(g.position, lane), subgroupShuffle(g.spread, lane),
                        subgroupShuffle(g.color, lane), subgroupShuffle(g.name, lane),
                        subgroupShuffle(g.normal, lane), subgroupShuffle(g.diagonal, lane),
                        subgroupShuffle(g.mixed, lane));
}

void add_light(uint j, gather_level level, gather_light g, bool mine, bool offered)
{
    vec3 v;
    gbuffer_point point = pixels[j].point;
    float share = EVEN_LIGHTS ? gather_share(g.name) : 1.0;
    float received = receive(g.position, g.spread, point, square_singularity(push.singularity, share), v);
    float d = dot(point.position - g.position, v);
    float blend = mine ? lgh_blend(level.kind, d * level.inverse_radius, 1.0) : 0.0;
    grid_light moments = grid_light(vec3(0.0), 0.0, vec3(0.0), 0u, vec3(0.0), g.normal, g.diagonal, g.mixed);
    float emitted = level.vpls ? max(0.0, dot(g.normal, v)) + EVEN_EMISSION * (1.0 - share)
                               : grid_emission(EMISSION, moments, share, v);
    vec3 light = g.color * (blend * received * emitted * level.factor);
    pixels[j].light.rgb += light;
    if (COUNT)
        pixels[j].count += blend > 0.0 ? 1.0 : 0.0;
    if (SAMPLES == 0u)
        return;
    float f = offered ? luminance(light) : 0.0;
    reservoirs_offer(j, g.name & ~GATHER_EVEN, UNIFORM && f > 0.0 ? 1.0 : f);
}

// ---- Lists

// The i-th of a level's lights as a tile knows them. GATHER_NONE: it is another tile's, or there is none.
uint level_light(gather_level level, uint i, uint tile)
{
    uint tiles = push.interleave * push.interleave;
    if (level.vpls) {
        uint light = push.grid_capacity + i, name = imageLoad(packed_lights, gather_texel(light) + ivec2(1, 0)).w;
        return gather_slot_tile(name & GATHER_NUMBER, tiles) == tile ? light : GATHER_NONE;
    }
    uint number = level.factor > 1.0 ? i * tiles + tile : i;
    return number < header.levels[level.c].occupied ? header.levels[level.c].first_light + number : GATHER_NONE;
}

// All that level_light can give. `first` is GATHER_NONE.
gather_range level_range(gather_level level)
{
    uint count = level.vpls ? header.vpl_count : header.levels[level.c].occupied;
    uint step = level.vpls ? 1u : uint(level.factor);
    return gather_range(GATHER_NONE, (count + step - 1u) / step);
}

// The list of a pixel's cell, or the whole level where there is none.
gather_range find_range(gather_level level, vec3 position, uint tile)
{
    // The VPLs' lists alone are not in the order of the level, so they are used all or none: the sum stays the same.
    if (!gather_has_cells(level.c) ||
        (level.vpls && (counts.cells > GATHER_CELLS || counts.entries > push.entry_capacity)))
        return level_range(level);
    uint key = gather_key(gather_cell(header, position, level.c), level.c);
    for (uint i = 0u, slot = gather_probe(key); i < GATHER_TABLE; i++, slot = (slot + 1u) % GATHER_TABLE) {
        uint found = table[slot].key;
        if (found == 0u)
            break;
        if (found != key)
            continue;
        uint cell = table[slot].cell;
        if (cell == GATHER_NONE)
            break;
        gather_range range = ranges[cell * push.interleave * push.interleave + (level.factor > 1.0 ? tile : 0u)];
        if (range.first == GATHER_NONE)
            break;
        return range;
    }
    return level_range(level);
}

// Adds the lights of a list, the same in all lanes, at the pixels that are `mine`; `offered`: also to their reservoirs.
void walk_range(gather_level level, gather_range range, uint tile, bool mine[PIXELS], bool offered[PIXELS])
{
    uvec4 lanes = subgroupBallot(true);
    uint width = subgroupBallotBitCount(lanes), lane = subgroupBallotExclusiveBitCount(lanes);
    for (uint first = 0u; first < range.count; first += width) {
        uint i = first + lane, light = GATHER_NONE;
        if (i < range.count)
            light = range.first == GATHER_NONE ? level_light(level, i, tile) : entries[range.first + i];
        ivec2 texel = gather_texel(light == GATHER_NONE ? 0u : light);
        uvec4 position = imageLoad(packed_lights, texel);
        bool passes = light != GATHER_NONE && may_light(uintBitsToFloat(position.xyz), level);
        uvec4 passed = subgroupBallot(passes);
        if (passed == uvec4(0u))
            continue;
        gather_light g = gather_unpack(position, imageLoad(packed_lights, texel + ivec2(1, 0)),
                                       imageLoad(packed_lights, texel + ivec2(2, 0)));
        for (uint word = 0u; word < (gl_SubgroupSize + 31u) / 32u; word++)
            for (uint bits = passed[word]; bits != 0u; bits &= bits - 1u) {
                uint from = word * 32u + uint(findLSB(bits));
                gather_light one = shuffled(g, from);
                [[unroll]] for (uint j = 0u; j < PIXELS; j++)
                    add_light(j, level, one, mine[j], offered[j]);
            }
    }
}

// The first range that a pixel of the block still waits for. False: none does.
bool next_range(gather_range ranges_of[PIXELS], bool pending[PIXELS], out gather_range range)
{
    [[unroll]] for (uint j = 0u; j < PIXELS; j++) {
        uvec4 ballot = subgroupBallot(pending[j]);
        if (ballot == uvec4(0u))
            continue;
        uint leader = subgroupBallotFindLSB(ballot);
        range = gather_range(subgroupShuffle(ranges_of[j].first, leader), subgroupShuffle(ranges_of[j].count, leader));
        return true;
    }
    return false;
}

void gather_of_level(gather_level level, uint tile, bool offered[PIXELS])
{
    gather_range ranges_of[PIXELS], range;
    bool pending[PIXELS], mine[PIXELS];
    [[unroll]] for (uint j = 0u; j < PIXELS; j++) {
        ranges_of[j] = find_range(level, pixels[j].point.position, tile);
        pending[j] = pixels[j].valid;
    }
    while (next_range(ranges_of, pending, range)) {
        [[unroll]] for (uint j = 0u; j < PIXELS; j++) {
            mine[j] = pending[j] && ranges_of[j] == range;
            pending[j] = pending[j] && !mine[j];
        }
        walk_range(level, range, tile, mine, offered);
    }
}

void gather(uint tile)
{
    uint levels = header.level_count, lowest = gather_levels(header) - 1u, tiles = push.interleave * push.interleave;
    // Level by level, the top first; where S1 and S0 are late, they are offered where no other light was.
    uint late = push.late_s1 != 0u && levels > 1u ? levels - 1u : lowest + 1u;
    bool offered[PIXELS];
    for (uint c = 0u; c <= lowest; c++) {
        if (c == 0u || c == late)
            [[unroll]] for (uint j = 0u; j < PIXELS; j++)
                offered[j] = pixels[j].light.a == 0.0;
        float radius = push.alpha * gather_cell_size(header, c), near = 0.5 * BLEND_START * radius;
        uint kind = blend_kind(c, lowest);
        bool rises = kind == BLEND_MIDDLE || kind == BLEND_TOP, falls = kind <= BLEND_MIDDLE;
        gather_level level = gather_level(c, kind, START_LEVEL_0 && c == levels, 1.0 / radius,
                                          falls ? 4.001 * radius * radius : 1e38, rises ? 0.999 * near * near : 0.0,
                                          gather_dealt(header, c) ? float(tiles) : 1.0);
        gather_of_level(level, tile, offered);
    }
}

// The bits 0, 2 and 4 of x.
uint even_bits(uint x) { return (x & 1u) | (x >> 1 & 2u) | (x >> 2 & 4u); }

void main()
{
    uvec2 size = uvec2(frame.width, frame.height), tile_size = interleave_tile_size(push.interleave, size);
    uint tile = gl_WorkGroupID.z;
    uvec2 corner = uvec2(tile % push.interleave, tile / push.interleave);
    // In Morton order, so that a subgroup of any size has a compact block.
    uint number = gl_LocalInvocationIndex;
    uvec2 place = gl_WorkGroupID.xy * uvec2(8u, 8u * PIXELS) +
                  uvec2(even_bits(number), even_bits(number >> 1) * PIXELS);
    [[unroll]] for (uint j = 0u; j < PIXELS; j++) {
        uvec2 pixel = (place + uvec2(0u, j)) * push.interleave + corner;
        pixel_start(j, hash(pixel.y * size.x + pixel.x, frame.frame, frame.seed));
        pixels[j].point = gbuffer_point(vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
        pixels[j].valid = all(lessThan(pixel, size)) && gbuffer_read(depth_map, normal_map, pixel, pixels[j].point);
    }
    // Every lane takes part, whether or not it has a pixel.
    if (header.level_count > 0u) {
        block_bound();
        gather(tile);
    }
    [[unroll]] for (uint j = 0u; j < PIXELS; j++) {
        uvec2 at = place + uvec2(0u, j), pixel = at * push.interleave + corner;
        if (any(greaterThanEqual(at, tile_size)))
            continue;
        ivec2 texel = ivec2(corner * tile_size + at);
        imageStore(indirect, texel, pixels[j].light);
        if (COUNT)
            imageStore(lights_per_pixel, texel, vec4(pixels[j].count));
        if (SAMPLES > 0u && all(lessThan(pixel, size)))
            reservoirs_write(j, pixel.y * size.x + pixel.x);
    }
}
