// What both stages of the G-buffer know of a draw: one primitive of one instance, and what its shading needs. A constant
// for each, since a branch costs its texture reads and interpolation on some drivers even where it is not taken.
#ifndef GBUFFER_DRAW_GLSL_H
#define GBUFFER_DRAW_GLSL_H

#include "scene.glsl.h"

// In the order of modules/gbuffer.c.
layout(constant_id = 0) const bool ALPHA_MASK = false; // without discard the depth test stays early
layout(constant_id = 1) const bool BASE_TEXTURE = true;
layout(constant_id = 2) const bool EMISSIVE_TEXTURE = true;
layout(constant_id = 3) const bool NORMAL_TEXTURE = true;
layout(constant_id = 4) const bool VERTEX_COLORS = true;
layout(constant_id = 5) const bool MOVES = true; // the camera, the instance or its vertices, since the last frame
layout(constant_id = 6) const bool DEFORMS = true; // the vertices do; only where MOVES

layout(push_constant, scalar) uniform draw_block { uint instance; uint primitive; uint identity; } draw;

#endif
