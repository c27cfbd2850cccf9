// Error measures between a rendered image and a reference. Images are linear radiance, RGB interleaved, rows from the
// top. No image may hold NaN or infinity: image_find_bad says where the first is.
#pragma once

#include "engine/base.h"

typedef struct image_measures {
    double relative_l2; // sqrt(sum (i - r)^2 / sum r^2) over all channels of all pixels
    double relative_mse; // mean over pixels and channels of (i - r)^2 / (r^2 + 0.01 * mean(r)^2): scale-free
    double energy; // sum i / sum r, of luminances
    double psnr; // decibel, of the tone-mapped 8-bit pictures at the reference's exposure; infinity when equal
    double flip_mean, flip_p95, flip_p99; // LDR-FLIP of the tone-mapped pictures (Andersson et al. 2020), 0 to 1
    double hdr_flip_mean, hdr_flip_p95, hdr_flip_p99; // HDR-FLIP (Andersson et al. 2021), 0 to 1
} image_measures;

// Of two images without light the errors are 0 and the energy is 1; against a reference without light they are
// infinite.
//
// `ev`: exposure of the tone-mapped measures, L * 2^ev through the renderer's own tone curve; NAN: the reference's
// log-average at 0.18, as the renderer does by itself. `maps` may be NULL, else takes width * height values each;
// `measures` may be NULL where the maps alone are wanted.
// False, and one logged line, when a value is not finite.
typedef struct image_maps {
    float *flip; // LDR-FLIP per pixel, 0 to 1
    float *difference; // (luminance of i - r) / mean luminance of r, signed
} image_maps;
bool image_measure(const float *image, const float *reference, uint32_t width, uint32_t height, double ev,
                   image_measures *measures, image_maps *maps);

// Index of the first pixel with a value that is not finite, or SIZE_MAX.
size_t image_find_bad(const float *image, uint32_t width, uint32_t height);

// One table of the measures for text, JSON and CSV: name ("relative_l2"), offset into image_measures, one-line help.
typedef struct image_measure_info {
    const char *name;
    size_t offset;
    const char *help;
} image_measure_info;
const image_measure_info *image_measure_table(uint32_t *count);

// ---- Colour maps: value to 8-bit sRGB; what is outside of [0,1] counts as its nearer end, NAN as 0.
// Dark to bright, perceptually even ("magma", as FLIP's papers use).
void color_map_sequential(float value, uint8_t rgb[3]);
void color_map_diverging(float value, uint8_t rgb[3]); // 0 blue, 0.5 white-ish, 1 red

// The exposure in EV that puts the log-average luminance of the lit pixels at 0.18 (0 without any), and the tone-mapped
// 8-bit sRGB picture as tonemap.comp makes it, to one step.
double image_exposure(const float *image, uint32_t width, uint32_t height);
void image_tonemap(const float *image, uint32_t width, uint32_t height, double ev, uint8_t *rgb);
