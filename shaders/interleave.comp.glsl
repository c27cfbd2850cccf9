// Brings interleaved light back: a pixel's light is the mean over the tiles of what each tile knows there, interpolated
// linearly between its nearest pixels on the same surface. Along one axis after the other: first over the n tiles of the
// pixel's row of tiles, then over the rows. Weights are normalised tile by tile, since each tile has its own share of the
// lights.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "filter_geometry.glsl.h"
#include "interleave.glsl.h"

layout(local_size_x = PIXEL_GROUP_WIDTH) in;
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D geometry_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2, rgba32f) uniform readonly image2D from;
layout(set = 0, binding = 3, rgba32f) uniform writeonly image2D gathered;
layout(push_constant, scalar) uniform push_block {
    uint n;
    uint down; // 0: across, from the tiled image; 1: down, from what that made
} push;

// A tap on the same surface weighs at least exp(-4) / n. What is far below is another surface, and a tile that shows
// nothing else is left out: normalising would make it count in full.
const float WEIGHT_MIN = 1e-3;

// Adds a tap and its weight, where it lies inside of the picture.
void tap_add(filter_center center, ivec2 tap, float weight, inout vec4 sum, inout float total)
{
    uvec2 size = uvec2(frame.width, frame.height);
    if (any(greaterThanEqual(uvec2(tap), size)))
        return;
    weight *= filter_geometry_weight(center, tap, imageLoad(geometry_map, tap));
    sum += weight * imageLoad(from, push.down != 0u ? tap : ivec2(interleave_texel(uvec2(tap), push.n, size)));
    total += weight;
}

vec4 tiles_mean(filter_center center, ivec2 pixel)
{
    ivec2 axis = push.down != 0u ? ivec2(0, 1) : ivec2(1, 0);
    int n = int(push.n);
    vec4 mean = vec4(0.0);
    float tiles = 0.0;
    for (int i = 0; i < n; i++) { // the tile's nearest pixels: i to one side and n - i to the other
        vec4 sum = vec4(0.0);
        float total = 0.0;
        tap_add(center, pixel + i * axis, float(n - i) / float(n), sum, total);
        if (i > 0)
            tap_add(center, pixel + (i - n) * axis, float(i) / float(n), sum, total);
        if (total > WEIGHT_MIN) {
            mean += sum / total;
            tiles += 1.0;
        }
    }
    return mean / max(tiles, 1.0);
}

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), uvec2(frame.width, frame.height))))
        return;
    vec4 geometry = imageLoad(geometry_map, pixel);
    vec4 mean = vec4(0.0);
    if (geometry.w > 0.0) {
        vec3 geometric = octahedral_decode(texelFetch(normal_map, pixel, 0).xy);
        mean = tiles_mean(filter_center_of(pixel, geometry, geometric), pixel);
    }
    imageStore(gathered, pixel, mean);
}
