// Light volumes: a cube of half-size 2 r around each grid light, in the tile or tiles that the light is dealt to. Back
// faces are drawn, so that a camera inside sees them too and each pixel is covered once.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "light_volume.glsl.h"
#include "reservoir.glsl.h"

#define STAGE out
#include "light_volume_varyings.glsl.h"
out float gl_ClipDistance[4];

// A cube as a strip of 14 vertices, outside counter-clockwise.
vec3 cube_corner(uint i)
{
    uint bit = 1u << i;
    return vec3((0x287au & bit) != 0u, (0x02afu & bit) != 0u, (0x31e3u & bit) != 0u) * 2.0 - 1.0;
}

struct volume {
    uint light, c, tile;
    bool dealt;
};

// The instance's light, level and tile. Levels with fewer than 4 n^2 lights go to every tile whole.
volume find_volume(uint instance)
{
    uint tiles = push.interleave * push.interleave;
    if (push.draw == DRAW_VPLS) // slots lie path by path; the shift keeps bounces from falling into one tile each
        return volume(instance, header.level_count, (instance + instance / tiles) % tiles, true);
    uint c = push.draw == DRAW_FIRST ? header.level_count - 1u : 1u;
    for (;; c++) {
        uint count = header.levels[c].occupied;
        bool dealt = count >= 4u * tiles;
        uint instances = dealt ? count : count * tiles;
        if (instance < instances || c + 1u >= header.level_count) {
            uint light = dealt ? instance : instance / tiles;
            return volume(header.levels[c].first_light + light, c, instance % tiles, dealt);
        }
        instance -= instances;
    }
}

// From full-screen clip coordinates to the tile's part of the tiled image, so that texel centres fall on the rays of
// the pixels that they stand for; everything outside the tile is clipped.
vec4 into_tile(vec4 clip, uvec2 tile)
{
    vec2 size = vec2(frame.width, frame.height);
    vec2 tile_size = vec2(interleave_tile_size(push.interleave, uvec2(frame.width, frame.height)));
    float n = float(push.interleave);
    vec2 texel = (0.5 * (clip.xy + clip.w) * size - (vec2(tile) + 0.5) * clip.w) / n + 0.5 * clip.w; // times w
    gl_ClipDistance[0] = texel.x;
    gl_ClipDistance[1] = texel.y;
    gl_ClipDistance[2] = tile_size.x * clip.w - texel.x;
    gl_ClipDistance[3] = tile_size.y * clip.w - texel.y;
    vec2 image = vec2(tile) * tile_size * clip.w + texel;
    return vec4(2.0 * image / (n * tile_size) - clip.w, clip.zw);
}

// A VPL as a grid light of one.
grid_light light_of(uint light)
{
    if (push.draw != DRAW_VPLS)
        return grid_lights[light];
    vpl v = vpls[light];
    return grid_light(v.position, v.intensity, v.color, light, vec3(0.0), v.normal, vec3(0.0), vec3(0.0));
}

// Outside every plane: nothing is drawn.
void clip_away()
{
    gl_Position = vec4(0.0, 0.0, -1.0, 1.0);
    for (int i = 0; i < 4; i++)
        gl_ClipDistance[i] = -1.0;
}

void main()
{
    if (header.level_count == 0u) { // no light at all
        clip_away();
        return;
    }
    volume v = find_volume(gl_InstanceIndex);
    grid_light light = light_of(v.light);
    float radius = radius_of(v.c);
    float factor = v.dealt ? float(push.interleave * push.interleave) : 1.0;
    light_position = vec4(light.position, radius);
    light_color = light.color * factor;
    light_spread = grid_spread(push.emission, light);
    light_share = surface_share(light.moment_diagonal);
    if (push.draw == DRAW_VPLS) {
        light_share = surface_share(vpls[v.light]);
        light_spread = light_share == 0.0 ? even_near() : 0.0;
    }
    light_normal = light.normal;
    light_diagonal = light.moment_diagonal;
    light_mixed = light.moment_mixed;
    light_names = uvec4(v.light | (push.draw == DRAW_VPLS ? RESERVOIR_VPL : 0u), light.vertex, v.c,
                        blend_kind(v.c, lowest_exponent()));
    if (light.intensity <= 0.0) {
        clip_away();
        return;
    }
    vec3 position = light.position + 2.0 * radius * cube_corner(gl_VertexIndex);
    gl_Position = into_tile(frame.view_projection * vec4(position, 1.0),
                            uvec2(v.tile % push.interleave, v.tile / push.interleave));
}
