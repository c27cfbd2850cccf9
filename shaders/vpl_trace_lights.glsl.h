// Point lights as VPLs, one invocation a slot. A light of I candela has the flux 4 pi I of a Lambertian VPL of colour
// 4 I; its normal is 0, which marks it as radiating evenly (see lgh_shade.glsl.h).
#ifndef VPL_TRACE_LIGHTS_GLSL_H
#define VPL_TRACE_LIGHTS_GLSL_H

#define VPLS_BINDING 0
#include "scene.glsl.h"
#include "vpl_trace_slots.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 1, scalar) readonly buffer slot_lights_block { uint slot_lights[]; };
layout(push_constant, scalar) uniform push_block { uint first, count; } push; // slots

const uint SLOT_EMPTY = 0xffffffffu;

vpl vpl_of(uint light)
{
    vpl empty = vpl(vec3(0.0), 0.0, vec3(0.0), 0u, vec3(0.0), VPL_NO_RAY);
    if (light == SLOT_EMPTY)
        return empty;
    vec3 color = 4.0 * lights[light].color;
    return luminance(color) > 0.0 ? vpl(lights[light].position, luminance(color), color, 0u, vec3(0.0), 0u) : empty;
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i < push.count)
        slot_write(push.first + i, vpl_of(slot_lights[i]));
}

#endif
