// Bindings and push constants of the lgh_build passes that look at VPLs as a whole: bounds and keys.
#ifndef LGH_BUILD_GLSL_H
#define LGH_BUILD_GLSL_H

const uint BOUNDS_STRETCH = 4096u; // slots per partial

struct bounds_partial {
    vec3 low;
    uint count;
    vec3 high;
};

layout(set = 0, binding = 0, scalar) readonly buffer vpls_block { vpl vpls[]; };
layout(set = 0, binding = 1, scalar) buffer partials_block { bounds_partial partials[]; };
layout(set = 0, binding = 2, scalar) buffer header_block { lgh_header header; };
layout(push_constant, scalar) uniform push_block { uint slot_count, partial_count; } push;

#endif
