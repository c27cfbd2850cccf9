// What the passes that trace light paths share. With LIST_BINDING they trace the paths that `vpl_list` names, else all.
#ifndef VPL_TRACE_GLSL_H
#define VPL_TRACE_GLSL_H

#include "common.glsl.h"

const uint VPL_NO_RAY = 0xffffffffu; // vpl.bounce of an empty slot that no ray was traced for. In other empty slots
                                     // `position` and `normal` are origin and direction of a ray that met nothing

#ifdef LIST_BINDING
#ifndef LIST_ACCESS
#define LIST_ACCESS readonly
#endif
layout(set = 0, binding = LIST_BINDING, scalar) LIST_ACCESS buffer vpl_list_block {
    uvec3 list_dispatch; // workgroups of 64
    uint list_count;
    uint list_paths[]; // ascending
};
#endif

// The point that a path takes of its source's sequence: see sobol.
uint share_seed(vpl_source source, uint seed) { return hash(seed, source.key); }

#endif
