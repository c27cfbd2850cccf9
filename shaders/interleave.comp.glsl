// Brings interleaved light back: a pixel's light is the mean over the tiles of what each tile knows nearby on the same
// surface. Weights are normalised tile by tile, since each tile has its own share of the lights.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "filter_geometry.glsl.h"
#include "interleave.glsl.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, rgba32f) uniform readonly image2D geometry_map;
layout(set = 0, binding = 1) uniform sampler2D normal_map;
layout(set = 0, binding = 2, rgba32f) uniform readonly image2D tiled;
layout(set = 0, binding = 3, rgba32f) uniform writeonly image2D gathered;
layout(push_constant, scalar) uniform push_block { uint n; } push;

// A tap on the same surface weighs at least exp(-4). What is far below is another surface, and a tile that shows nothing
// else is left out: normalising would make it count in full.
const float WEIGHT_MIN = 1e-3;

// Weighted mean over the pixels `first`, `first` + n, ... within n of the pixel: all of one tile. False: no weight.
bool tile_mean(filter_center center, ivec2 pixel, ivec2 first, out vec4 mean)
{
    int n = int(push.n);
    uvec2 size = uvec2(frame.width, frame.height);
    // Of `first`, which may lie outside of the picture; pixels n apart are neighbours in their tile.
    ivec2 first_texel = ivec2(interleave_texel(uvec2(first + n), push.n, size)) - 1;
    vec4 sum = vec4(0.0);
    float total = 0.0;
    for (int y = 0; first.y + n * y <= pixel.y + n; y++)
        for (int x = 0; first.x + n * x <= pixel.x + n; x++) {
            ivec2 tap = first + n * ivec2(x, y);
            if (any(greaterThanEqual(uvec2(tap), size)))
                continue;
            vec2 offset = vec2(tap - pixel) / float(n);
            float weight = exp(-2.0 * dot(offset, offset)) *
                           filter_geometry_weight(center, tap, imageLoad(geometry_map, tap));
            sum += weight * imageLoad(tiled, first_texel + ivec2(x, y));
            total += weight;
        }
    mean = total > WEIGHT_MIN ? sum / total : vec4(0.0);
    return total > WEIGHT_MIN;
}

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(pixel), uvec2(frame.width, frame.height))))
        return;
    vec4 geometry = imageLoad(geometry_map, pixel);
    vec4 sum = vec4(0.0);
    float tiles = 0.0;
    if (geometry.w > 0.0) {
        vec3 geometric = octahedral_decode(texelFetch(normal_map, pixel, 0).xy);
        filter_center center = filter_center_of(pixel, geometry, geometric);
        for (int y = 0; y < int(push.n); y++)
            for (int x = 0; x < int(push.n); x++) {
                vec4 mean;
                if (tile_mean(center, pixel, pixel - int(push.n) + ivec2(x, y), mean)) {
                    sum += mean;
                    tiles += 1.0;
                }
            }
    }
    imageStore(gathered, pixel, sum / max(tiles, 1.0));
}
