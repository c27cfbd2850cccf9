// Bindings and constants that all of the light volumes' shaders share.
#ifndef LIGHT_VOLUME_GLSL_H
#define LIGHT_VOLUME_GLSL_H

#include "scene.glsl.h"
#include "interleave.glsl.h"
#define LGH_BLEND_CONSTANT 2
#include "lgh_shade.glsl.h"

layout(set = 0, binding = 0, scalar) readonly buffer header_block { lgh_header header; };
layout(set = 0, binding = 1, scalar) readonly buffer grid_lights_block { grid_light grid_lights[]; };
layout(set = 0, binding = 2, scalar) readonly buffer vpls_block { vpl vpls[]; };

// What is drawn: the top level over the whole screen, or cubes of the levels between, of S1, or of the VPLs (S0).
const uint DRAW_TOP = 0u;
const uint DRAW_MIDDLE = 1u;
const uint DRAW_FIRST = 2u;
const uint DRAW_VPLS = 3u;

layout(push_constant, scalar) uniform push_block {
    uint draw;
    uint interleave;
    uint emission;
    uint start_level;
    uint samples;     // reservoirs per pixel
    uint sampled;     // 1: this draw's lights take part in the sampling; 2: only where nothing before it did
    float singularity; // b, metres
    uint slot_count;
} push;

uint lowest_exponent() { return push.start_level == 0u ? header.level_count : header.level_count - 1u; }

float radius_of(uint c)
{
    // S0 continues the halving: h_0 = h_1 / 2.
    return c < header.level_count ? header.levels[c].radius : 0.5 * header.levels[header.level_count - 1u].radius;
}

#endif
