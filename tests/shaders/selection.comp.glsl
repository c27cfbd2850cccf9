// Each grid light's sampling weight f at each pixel, straight from the definition: f[pixel * count + light].
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../shaders/scene.glsl.h"
#include "../../shaders/gbuffer.glsl.h"
#include "../../shaders/lgh_shade.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1, scalar) readonly buffer grid_lights_block { grid_light grid_lights[]; };
layout(set = 0, binding = 2) uniform sampler2D depth_map;
layout(set = 0, binding = 3) uniform sampler2D normal_map;
layout(set = 0, binding = 4, scalar) writeonly buffer weights_block { float weights[]; };
layout(push_constant, scalar) uniform push_block { uint light_capacity, emission; float singularity; } push;

void main()
{
    uint pixel = gl_GlobalInvocationID.x;
    if (pixel >= frame.width * frame.height)
        return;
    gbuffer_point p;
    bool hit = gbuffer_read(depth_map, normal_map, uvec2(pixel % frame.width, pixel / frame.width), p);
    for (uint i = 0u; i < push.light_capacity; i++) {
        float f = 0.0;
        if (hit && i < header.light_count) {
            grid_light g = grid_lights[i];
            uint c = light_exponent(header, i);
            float blend = lgh_blend(blend_kind(c, header.level_count - 1u), distance(g.position, p.position),
                                    header.levels[c].radius);
            f = luminance(blend * grid_light_sent(g, g.position, push.emission, p, push.singularity));
        }
        weights[pixel * push.light_capacity + i] = f;
    }
}
