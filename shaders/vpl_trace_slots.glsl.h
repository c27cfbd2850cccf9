// Writing VPLs into their slots. Before including, define VPLS_BINDING, and CHANGED_BINDING where it is to be noted which
// slots do not hold what they did.
#ifndef VPL_TRACE_SLOTS_GLSL_H
#define VPL_TRACE_SLOTS_GLSL_H

#include "vpl_trace.glsl.h"

layout(set = 0, binding = VPLS_BINDING, scalar) buffer vpls_block { vpl vpls[]; };
#ifdef CHANGED_BINDING
layout(set = 0, binding = CHANGED_BINDING, scalar) buffer changed_block { uint changed[]; }; // a bit a slot

bool is_same(vpl a, vpl b)
{
    return all(equal(floatBitsToUint(vec4(a.position, a.intensity)), floatBitsToUint(vec4(b.position, b.intensity)))) &&
           all(equal(floatBitsToUint(a.color), floatBitsToUint(b.color))) &&
           all(equal(floatBitsToUint(a.normal), floatBitsToUint(b.normal))) && a.bounce == b.bounce;
}
#endif

void slot_write(uint slot, vpl light)
{
#ifdef CHANGED_BINDING
    if (is_same(light, vpls[slot]))
        return;
    atomicOr(changed[slot / 32u], 1u << (slot & 31u));
#endif
    vpls[slot] = light;
}

#endif
