// FLIP, the error that a viewer sees who flips between two pictures. LDR-FLIP: Andersson et al. 2020, "FLIP: A
// Difference Evaluator for Alternating Images". HDR-FLIP: Andersson et al. 2021, "Visualizing Errors in Rendered High
// Dynamic Range Images". The viewer is the papers': a screen 3840 pixels and 0.7 m wide, seen from 0.7 m (67.02 pixels
// per degree).
//
// Images are RGB interleaved, rows from the top; pixels over the border repeat the border's. A map is one value a
// pixel, 0 to 1. Results are the same to the bit from run to run.
#pragma once

#include "engine/base.h"

// LDR-FLIP of two pictures in linear RGB of sRGB's primaries, 0 to 1: pictures in sRGB are to be decoded first.
void image_flip(const float *image, const float *reference, uint32_t width, uint32_t height, float *map);

// HDR-FLIP of two images of finite radiance: the largest LDR-FLIP over the exposures below, each tone-mapped by the
// paper's default curve. Negative radiance counts as 0.
void image_flip_hdr(const float *image, const float *reference, uint32_t width, uint32_t height, float *map);

// `count` exposures, in EV, evenly from `start`, which maps the reference's largest luminance to 0.85 of the curve, to
// `stop`, which does so with its median. Where more than half of the reference is black, which the paper leaves open,
// the median is that of the other pixels; a black reference has the one exposure 0.
typedef struct flip_exposures {
    double start, stop;
    uint32_t count;
} flip_exposures;
flip_exposures image_flip_exposures(const float *reference, uint32_t width, uint32_t height);

// ---- The filters, for tests. All are separable; taps go from -radius to radius.
enum {
    FLIP_CSF_RADIUS = 10,
    FLIP_CSF_TAPS = 2 * FLIP_CSF_RADIUS + 1,
    FLIP_FEATURE_RADIUS = 9,
    FLIP_FEATURE_TAPS = 2 * FLIP_FEATURE_RADIUS + 1,
};
typedef struct flip_filters {
    // Contrast sensitivity: each sums to 1. Blue-yellow is a weighted sum of two; the weights sum to 1.
    float achromatic[FLIP_CSF_TAPS], red_green[FLIP_CSF_TAPS], blue_yellow[2][FLIP_CSF_TAPS];
    float blue_yellow_weights[2];
    // Features: a Gaussian that sums to 1, and its first and second derivative, whose positive taps sum to 1 and
    // negative taps to -1.
    float gaussian[FLIP_FEATURE_TAPS], edge[FLIP_FEATURE_TAPS], point[FLIP_FEATURE_TAPS];
} flip_filters;
void flip_filters_make(flip_filters *filters);
