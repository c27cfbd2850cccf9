// Finds the light paths that may not be what they were: those of sources that changed, and those with a segment that
// meets a box where surfaces changed. A bit a path. One invocation a path.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "vpl_trace.glsl.h"

layout(local_size_x = 64) in;
layout(set = 0, binding = 0, scalar) readonly buffer shares_block { vpl_share shares[]; };
layout(set = 0, binding = 1, scalar) readonly buffer sources_block { vpl_source sources[]; };
layout(set = 0, binding = 2, scalar) readonly buffer boxes_block { vpl_box boxes[]; };
layout(set = 0, binding = 3, scalar) readonly buffer starts_block { vec3 starts[]; }; // where the paths left their source
layout(set = 0, binding = 4, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 5, scalar) writeonly buffer mask_block { uint mask[]; };
layout(set = 0, binding = 6, scalar) writeonly buffer changed_block { uint changed[]; }; // cleared here, by slot
layout(push_constant, scalar) uniform push_block {
    uint slot_count, bounces;
    uint path_count;
    uint box_count;
    uint changed_count; // slots of VPLs and, behind, of lights
} push;

shared uint group_mask[2];

// Whether origin + t * offset, t in [0, reach], meets a box.
bool meets_a_box(vec3 origin, vec3 offset, float reach)
{
    // No component is zero, so that what starts on a side's plane makes no 0 * infinity.
    vec3 inverse = 1.0 / mix(offset, vec3(1e-30), lessThan(abs(offset), vec3(1e-30)));
    for (uint i = 0u; i < push.box_count; i++) {
        vec3 a = (boxes[i].low - origin) * inverse, b = (boxes[i].high - origin) * inverse;
        vec3 enter = min(a, b), leave = max(a, b);
        if (max(max(enter.x, enter.y), max(enter.z, 0.0)) <= min(min(leave.x, leave.y), min(leave.z, reach)))
            return true;
    }
    return false;
}

bool surfaces_changed(uint path)
{
    vec3 origin = starts[path];
    uint first = path * push.bounces, end = min(first + push.bounces, push.slot_count);
    for (uint slot = first; slot < end; slot++) {
        vpl v = vpls[slot];
        if (v.bounce == VPL_NO_RAY)
            return false;
        if (v.intensity <= 0.0)
            return meets_a_box(v.position, v.normal, 1e30);
        if (meets_a_box(origin, v.position - origin, 1.0))
            return true;
        origin = v.position;
    }
    return false;
}

void main()
{
    uint path = gl_GlobalInvocationID.x, lane = gl_LocalInvocationIndex;
    if (lane < 2u)
        group_mask[lane] = 0u;
    barrier();
    if (path < push.path_count && (sources[shares[path].source].changed != 0u || surfaces_changed(path)))
        atomicOr(group_mask[lane / 32u], 1u << (lane & 31u));
    barrier();
    if (lane < 2u)
        mask[gl_WorkGroupID.x * 2u + lane] = group_mask[lane];
    for (uint word = path; word < (push.changed_count + 31u) / 32u; word += gl_NumWorkGroups.x * 64u)
        changed[word] = 0u;
}
