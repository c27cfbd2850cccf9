// Measures of how a rendered sequence behaves over time: noise that moves, changes that the truth does not have, and
// lag behind a change. Images are linear radiance, RGB interleaved, rows from the top, all of one size; luminance
// counts (Rec. 709). No image may hold NaN or infinity: see image_find_bad in image_measure.h.
#pragma once

#include "engine/base.h"

// (i) Of a still camera, light and scene: per pixel the standard deviation of the luminance over the frames, over its
// mean; 0 where there is no light. The mean over the pixels; `map` (NULL: none) takes the values of all.
double sequence_deviation(const float *const *frames, uint32_t count, uint32_t width, uint32_t height, float *map);

// (ii) Flicker of a frame: the mean over the pixels of |(I - I before) - (R - R before)| in luminance, over the mean of
// R. The reference R has the same random numbers in every frame, so that its noise does not flicker. 0 where neither
// has light. Infinite where only the image has.
double sequence_flicker(const float *image, const float *image_before, const float *reference,
                        const float *reference_before, uint32_t width, uint32_t height, float *map);

// (iii) How far a frame is from a steady state, by the means over blocks of SEQUENCE_BLOCK x SEQUENCE_BLOCK pixels (the
// last ones of a row or column may be smaller): means, since one sample a pixel leaves noise that is no lag.
enum { SEQUENCE_BLOCK = 8 };
typedef struct sequence_distance {
    double mean; // |mean luminance / steady one - 1|
    double blocks; // relative L2 of the block means
    double
        blocks_within; // share of the blocks whose mean is within 10 % of the steady one, or 1 % of the picture's mean
} sequence_distance;
sequence_distance sequence_distance_to(const float *image, const float *steady, uint32_t width, uint32_t height);

// The first of `count` values from which on all are at most `limit`; `count` when the last is not.
uint32_t sequence_settled_after(const double *values, uint32_t count, double limit);
