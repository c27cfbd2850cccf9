// The sum over every VPL with a shadow ray to each: what the filtered shadow ratio approximates.
#version 460
#extension GL_GOOGLE_include_directive : require
#define TLAS_BINDING 4
#include "../../shaders/ray.glsl.h"
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
    if (gbuffer_read(depth_map, normal_map, pixel, p)) {
        vec3 origin = offset_origin(p.position, p.geometric, frame.scene_radius);
        for (uint i = 0u; i < push.slot_count; i++) {
            vec3 light = vpl_light(vpls[i], p, push.singularity);
            if (vpls[i].intensity <= 0.0 || luminance(light) <= 0.0)
                continue;
            vec3 offset = vpls[i].position - origin;
            float reach = length(offset);
            if (ray_visible(origin, offset / max(reach, 1e-20), reach * 0.9999))
                sum += light;
        }
    }
    imageStore(sum_map, ivec2(pixel), vec4(sum, 1.0));
}
