// The sum over every VPL, unshadowed, at each pixel: what the lighting grid hierarchy approximates.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../shaders/scene.glsl.h"
#include "../../shaders/gbuffer.glsl.h"
#include "../../shaders/lgh_shade.glsl.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = 0, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 1) uniform sampler2D depth_map;
layout(set = 0, binding = 2) uniform sampler2D normal_map;
layout(set = 0, binding = 3, rgba32f) writeonly uniform image2D sum_map;
layout(push_constant, scalar) uniform push_block { uint slot_count; float singularity; } push;

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, uvec2(frame.width, frame.height))))
        return;
    vec3 sum = vec3(0.0);
    gbuffer_point p;
    if (gbuffer_read(depth_map, normal_map, pixel, p))
        for (uint i = 0u; i < push.slot_count; i++)
            if (vpls[i].intensity > 0.0)
                sum += vpl_light(vpls[i], p, push.singularity);
    imageStore(sum_map, ivec2(pixel), vec4(sum, 1.0));
}
