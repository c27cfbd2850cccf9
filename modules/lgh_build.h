// Sizes of the lighting grid hierarchy's buffers (see lgh_build.c).
#pragma once

#include "vpl_trace.h"
#include "shaders/shared.h"

// Who says what changed since the last frame: vpl_trace_change, unless a test brings its own VPLs.
void lgh_build_follow(renderer *r, vpl_change (*change)(const renderer *r));

uint32_t lgh_mask_words(uint32_t exponent); // vertex masks of the exponents 0..exponent
uint32_t lgh_cell_words(uint32_t exponent); // mask of the cells of one exponent
uint32_t lgh_cells_before(uint32_t exponent); // masks of the cells of the exponents 0..exponent - 1
uint32_t lgh_capacity(const renderer *r); // grid lights of all levels
