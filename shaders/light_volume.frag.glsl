// One light volume at one pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "light_volume_fragment.glsl.h"

// The reservoirs would otherwise put the depth test last.
layout(early_fragment_tests) in;


#define STAGE in
#include "light_volume_varyings.glsl.h"

void main()
{
    light_sum = vec4(0.0);
    light_count = 0.0;
    shaded_pixel pixel;
    if (!read_pixel(pixel))
        discard;
    float blend = lgh_blend(light_names.w, distance(light_position.xyz, pixel.point.position), light_position.w);
    if (blend <= 0.0)
        discard;
    grid_light light = grid_light(light_position.xyz, 0.0, light_color, light_names.y, vec3(0.0), light_normal,
                                  light_diagonal, light_mixed);
    vec3 v;
    float square_b = square_singularity(push.singularity, light_share);
    float received = receive(light.position, light_spread, pixel.point, square_b, v);
    float emitted = push.draw == DRAW_VPLS ? max(0.0, dot(light.normal, v)) + EVEN_EMISSION * (1.0 - light_share)
                                           : grid_emission(push.emission, light, light_share, v);
    add_light(pixel, light.color * (received * emitted), blend, light_names.x, light.vertex, light_names.z);
}
