// Gathers: every pixel adds up the lights of its cells' lists in registers, with its shadow reservoirs. Makes what the
// light volumes make (Lin and Yuksel 2019, sections 3.2 and 3.3).
//
// The lanes of a subgroup, a compact block of one tile's pixels, walk a list together: each loads another light and
// tests it against the block, then the lights that pass go to all lanes one by one. Where the block's pixels lie in
// several cells it walks several lists, each for its own pixels.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_EXT_control_flow_attributes : require
#define LGH_BLEND_CONSTANT 5
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

// ---- The pixel

gbuffer_point point;
vec4 light_sum = vec4(0.0); // rgb: radiance over albedo; a: sum of f over the lights that were offered
float light_count = 0.0;

// A reservoir takes light i with probability f_i / (f_1 + ... + f_i). Instead of a random number a light it keeps the sum
// at which the next replacement comes: from the sum W of the last one on none comes before W' with probability
// W / W', so W / u does, u uniform (exponential jumps, Efraimidis and Spirakis 2006). Reservoirs that replace together
// share a random number, shifted by equal steps: which keeps them apart.
uint chosen[SAMPLES_MAX];
float threshold[SAMPLES_MAX];
float nearest_threshold = 0.0;
uint random; // state of a linear congruential generator

void reservoirs_start(uint key)
{
    random = key;
    [[unroll]] for (uint s = 0u; s < SAMPLES; s++) {
        chosen[s] = RESERVOIR_EMPTY;
        threshold[s] = 0.0;
    }
}

void reservoirs_replace(uint light)
{
    random = random * 747796405u + 2891336453u;
    nearest_threshold = 3e38;
    [[unroll]] for (uint s = 0u; s < SAMPLES; s++) {
        uint shifted = random + s * (0xffffffffu / max(SAMPLES, 1u));
        bool replaced = light_sum.a > threshold[s];
        chosen[s] = replaced ? light : chosen[s];
        threshold[s] = replaced ? max(light_sum.a, light_sum.a / unit_float_positive(shifted)) : threshold[s];
        nearest_threshold = min(nearest_threshold, threshold[s]);
    }
}

void reservoirs_write(uint pixel)
{
    uint first = pixel * (SAMPLES + 1u);
    reservoir_words[first] = floatBitsToUint(light_sum.a);
    [[unroll]] for (uint s = 0u; s < SAMPLES; s++)
        reservoir_words[first + 1u + s] = chosen[s];
}

// ---- The block of pixels that a subgroup shades

vec3 block_low, block_high; // bounds, of points moved into the grid
bool block_flat;            // all pixels have this normal
vec3 block_normal;
float block_height;         // least along the normal

void block_bound(bool valid)
{
    vec3 cells = grid_position(point.position, header.origin, header.top_size, 0u);
    vec3 inside = header.origin + cells * header.levels[0].cell_size;
    block_low = subgroupMin(valid ? inside : vec3(1e30));
    block_high = subgroupMax(valid ? inside : vec3(-1e30));
    block_normal = subgroupMin(valid ? point.geometric : vec3(2.0));
    block_flat = block_normal == subgroupMax(valid ? point.geometric : vec3(-2.0));
    block_height = subgroupMin(valid ? dot(block_normal, point.position) : 1e30);
}

// ---- Lights

struct gather_level {
    uint c, kind;
    bool vpls; // S0
    float inverse_radius;
    float reach_square;   // beyond it the blending function is zero; not so at the top
    float factor; // 1, or the number of tiles where its lights are dealt to them
    bool offered; // at this pixel
};

// Whether a light may reach any of the block's pixels.
bool may_light(gather_light g, float reach_square)
{
    vec3 offset = g.position - clamp(g.position, block_low, block_high);
    if (g.intensity <= 0.0 || dot(offset, offset) > reach_square)
        return false;
    return COUNT || !block_flat || dot(block_normal, g.position) > block_height;
}

// The light of another lane.
gather_light shuffled(gather_light g, uint lane)
{
    return gather_light(subgroupShuffle(g.position, lane), subgroupShuffle(g.spread, lane),
                        subgroupShuffle(g.color, lane), subgroupShuffle(g.intensity, lane),
                        subgroupShuffle(g.normal, lane), subgroupShuffle(g.diagonal, lane),
                        subgroupShuffle(g.mixed, lane));
}

void add_light(gather_level level, gather_light g, uint light, bool mine)
{
    vec3 v;
    float received = receive(g.position, g.spread, point, push.singularity, v);
    float d = dot(point.position - g.position, v);
    float blend = mine ? lgh_blend(level.kind, d * level.inverse_radius, 1.0) : 0.0;
    grid_light moments = grid_light(vec3(0.0), 0.0, vec3(0.0), 0u, vec3(0.0), g.normal, g.diagonal, g.mixed);
    float emitted = level.vpls ? max(0.0, dot(g.normal, v)) : grid_emission(EMISSION, moments, v);
    float sent = blend * received * emitted * level.factor;
    light_sum.rgb += sent * g.color;
    if (COUNT)
        light_count += blend > 0.0 ? 1.0 : 0.0;
    if (SAMPLES == 0u)
        return;
    float f = level.offered ? sent * g.intensity : 0.0;
    light_sum.a += UNIFORM && f > 0.0 ? 1.0 : f;
    // A loop of at most one turn: unlike the body of an `if`, some drivers (lavapipe) skip it where no lane enters.
    while (light_sum.a > nearest_threshold)
        reservoirs_replace(light);
}

// ---- Lists

// The i-th of all lights of a level that a tile knows. GATHER_NONE: the level's last row of tiles is not full.
uint level_light(gather_level level, uint i, uint tile)
{
    uint tiles = push.interleave * push.interleave;
    if (level.vpls) {
        uint slot = i * tiles + (tile + tiles - i % tiles) % tiles;
        return slot < push.slot_count ? push.grid_capacity + slot : GATHER_NONE;
    }
    uint number = level.factor > 1.0 ? i * tiles + tile : i;
    return number < header.levels[level.c].occupied ? header.levels[level.c].first_light + number : GATHER_NONE;
}

// All that level_light can give. `first` is GATHER_NONE.
gather_range level_range(gather_level level)
{
    uint count = level.vpls ? push.slot_count : header.levels[level.c].occupied;
    uint step = uint(level.factor);
    return gather_range(GATHER_NONE, (count + step - 1u) / step);
}

// The list of a pixel's cell, or the whole level where there is none.
gather_range find_range(gather_level level, uint tile)
{
    // The VPLs' lists alone are not in the order of the level, so they are used all or none: the sum stays the same.
    if (!gather_has_cells(level.c) ||
        (level.vpls && (counts.cells > GATHER_CELLS || counts.entries > push.entry_capacity)))
        return level_range(level);
    uint key = gather_key(gather_cell(header, point.position, level.c), level.c);
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

// Adds the lights of a list, the same in all lanes, at the pixels that are `mine`.
void walk_range(gather_level level, gather_range range, uint tile, bool mine)
{
    uvec4 lanes = subgroupBallot(true);
    uint width = subgroupBallotBitCount(lanes), lane = subgroupBallotExclusiveBitCount(lanes);
    for (uint first = 0u; first < range.count; first += width) {
        uint i = first + lane, light = GATHER_NONE;
        if (i < range.count)
            light = range.first == GATHER_NONE ? level_light(level, i, tile) : entries[range.first + i];
        ivec2 texel = gather_texel(light == GATHER_NONE ? 0u : light);
        gather_light g = gather_unpack(imageLoad(packed_lights, texel), imageLoad(packed_lights, texel + ivec2(1, 0)),
                                       imageLoad(packed_lights, texel + ivec2(2, 0)));
        uvec4 passed = subgroupBallot(light != GATHER_NONE && may_light(g, level.reach_square));
        for (uint word = 0u; word < (gl_SubgroupSize + 31u) / 32u; word++)
            for (uint bits = passed[word]; bits != 0u; bits &= bits - 1u) {
                uint from = word * 32u + uint(findLSB(bits));
                add_light(level, shuffled(g, from), subgroupShuffle(light, from), mine);
            }
    }
}

void gather(uint tile, bool valid)
{
    uint levels = header.level_count, lowest = gather_levels(header) - 1u, tiles = push.interleave * push.interleave;
    uint offered = push.late_s1 == 0u ? lowest : max(levels, 2u) - 2u; // lowest level that is always offered
    bool open = true; // nothing is offered yet where the late levels begin
    for (uint i = 0u; i <= lowest; i++) {
        // Finer levels first, as they are brighter, so that reservoirs replace less often; the late levels last.
        uint c = i <= offered ? offered - i : i;
        bool late = i > offered;
        if (i == offered + 1u)
            open = light_sum.a == 0.0;
        gather_level level;
        level.c = c;
        level.kind = blend_kind(c, lowest);
        level.vpls = START_LEVEL_0 && c == levels;
        float radius = push.alpha * gather_cell_size(header, c);
        level.inverse_radius = 1.0 / radius;
        level.reach_square = level.kind <= BLEND_MIDDLE ? 4.001 * radius * radius : 1e38;
        level.factor = gather_dealt(header, c) ? float(tiles) : 1.0;
        level.offered = !late || open;
        gather_range range = find_range(level, tile);
        bool pending = valid;
        for (uvec4 ballot = subgroupBallot(pending); ballot != uvec4(0u); ballot = subgroupBallot(pending)) {
            uint leader = subgroupBallotFindLSB(ballot);
            gather_range shared_range =
                gather_range(subgroupShuffle(range.first, leader), subgroupShuffle(range.count, leader));
            bool mine = pending && range == shared_range;
            walk_range(level, shared_range, tile, mine);
            pending = pending && !mine;
        }
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
    uvec2 place = gl_WorkGroupID.xy * 8u + uvec2(even_bits(number), even_bits(number >> 1));
    uvec2 pixel = place * push.interleave + corner;
    bool inside = all(lessThan(place, tile_size)), on_screen = inside && all(lessThan(pixel, size));
    point = gbuffer_point(vec3(0.0), vec3(0.0), vec3(0.0), 0.0);
    bool valid = on_screen && header.level_count > 0u && gbuffer_read(depth_map, normal_map, pixel, point);
    uint index = pixel.y * size.x + pixel.x;
    reservoirs_start(hash(index, frame.frame, frame.seed));
    // Every lane takes part, whether or not it has a pixel.
    if (header.level_count > 0u) {
        block_bound(valid);
        gather(tile, valid);
    }
    if (!inside)
        return;
    ivec2 texel = ivec2(corner * tile_size + place);
    imageStore(indirect, texel, light_sum);
    if (COUNT)
        imageStore(lights_per_pixel, texel, vec4(light_count));
    if (SAMPLES > 0u && on_screen)
        reservoirs_write(index);
}
