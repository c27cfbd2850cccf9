// The top level over the whole screen: its blending function does not fall to zero.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "light_volume_fragment.glsl.h"

void main()
{
    light_sum = vec4(0.0);
    light_count = 0.0;
    shaded_pixel pixel;
    if (header.level_count == 0u || !read_pixel(pixel))
        discard;
    uint kind = blend_kind(0u, lowest_exponent());
    for (uint i = 0u; i < header.levels[0].occupied; i++) {
        grid_light g = grid_lights[i];
        float blend = lgh_blend(kind, distance(g.position, pixel.point.position), radius_of(0u));
        if (blend <= 0.0)
            continue;
        vec3 light = grid_light_sent(g, g.position, push.emission, pixel.point, push.singularity);
        add_light(pixel, light, blend, i, g.vertex, 0u);
    }
}
