// The last frame's recorded samples as rays of this frame: from the same points, to where their VPLs are now. From
// instances that moved no ray leaves. One invocation a stratum.
#version 460
#extension GL_GOOGLE_include_directive : require
#define RAY_ORIGINS_BINDING 3
#include "rays.glsl.h"
#include "lgh_shade.glsl.h"
#include "shadow_again.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer records_block { shadow_record records[]; }; // the last frame's
layout(set = 0, binding = 1, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 2, scalar) readonly buffer moved_block { uint moved[]; }; // a bit an identity
layout(set = 0, binding = 5, scalar) writeonly buffer light_block { float light_now[]; }; // negative: no ray
layout(push_constant, scalar) uniform push_block {
    uint slot_count;
    float singularity; // b, metres
    uint records_valid;
} push;

void main()
{
    uint index = gl_GlobalInvocationID.x;
    if (index >= again_size().x * again_size().y)
        return;
    shadow_record r = records[index];
    if (push.records_valid == 0u || r.light <= 0.0) {
        ray_write_none(index);
        return;
    }
    float light = r.light;
    vec3 end = r.end;
    gbuffer_point point =
        gbuffer_point(r.position, octahedral_decode(r.normals.xy), octahedral_decode(r.normals.zw), 0.0);
    if (r.slot < push.slot_count) {
        vpl now = vpls[r.slot];
        light = now.intensity > 0.0 ? luminance(vpl_light(now, point, push.singularity)) : 0.0;
        end = now.position;
    }
    bool rests = (moved[r.identity >> 5u] >> (r.identity & 31u) & 1u) == 0u;
    light_now[index] = rests ? light : -light;
    if (rests && light > 0.0)
        ray_write_to(index, offset_origin(point.position, point.geometric, frame.scene_radius), end);
    else
        ray_write_none(index);
}
