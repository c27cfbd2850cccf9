// Error measures between linear images, and the renderer's tone curve on the host (shaders/tonemap*.glsl).
#include "image_measure.h"

#include "image_flip.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static double luminance(const float rgb[3])
{
    return 0.2126 * (double)rgb[0] + 0.7152 * (double)rgb[1] + 0.0722 * (double)rgb[2];
}

size_t image_find_bad(const float *image, uint32_t width, uint32_t height)
{
    for (size_t i = 0; i < (size_t)width * height; i++) {
        if (!isfinite(image[3 * i]) || !isfinite(image[3 * i + 1]) || !isfinite(image[3 * i + 2])) {
            return i;
        }
    }
    return SIZE_MAX;
}

// ---- Tone curve

double image_exposure(const float *image, uint32_t width, uint32_t height)
{
    double sum = 0;
    size_t lit = 0;
    for (size_t i = 0; i < (size_t)width * height; i++) {
        const double light = luminance(image + 3 * i);
        if (light > 0) {
            sum += log2(light);
            lit++;
        }
    }
    return lit > 0 ? fmin(fmax(log2(0.18) - sum / (double)lit, -100), 100) : 0;
}

// Narkowicz 2015, bounded as in the shader, which never sees negative radiance.
static float tone_curve(float x)
{
    x = fminf(fmaxf(x, 0), 1e4f);
    return fminf(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f), 1);
}

// IEC 61966-2-1.
static float srgb_encode(float linear)
{
    return linear <= 0.0031308f ? 12.92f * linear : 1.055f * powf(linear, 1 / 2.4f) - 0.055f;
}
static double srgb_decode(double encoded)
{
    return encoded <= 0.04045 ? encoded / 12.92 : pow((encoded + 0.055) / 1.055, 2.4);
}

void image_tonemap(const float *image, uint32_t width, uint32_t height, double ev, uint8_t *rgb)
{
    const float exposure = (float)exp2(ev);
    for (size_t i = 0; i < (size_t)width * height * 3; i++) {
        rgb[i] = (uint8_t)(255 * srgb_encode(tone_curve(image[i] * exposure)) + 0.5f);
    }
}

// ---- Measures

// 0 over 0 is `equal`, as of two images without light; anything else over 0 is infinite.
static double ratio(double a, double b, double equal)
{
    return b != 0 ? a / b : a == 0 ? equal : copysign(INFINITY, a);
}

static double mean(const float *values, size_t count)
{
    double sum = 0;
    for (size_t i = 0; i < count; i++) {
        sum += (double)values[i];
    }
    return sum / (double)count;
}

static void radiance_measure(const float *image, const float *reference, size_t pixels, image_measures *measures)
{
    const double reference_mean = mean(reference, 3 * pixels);
    const double floor = 0.01 * reference_mean * reference_mean;
    double errors = 0, squares = 0, relative = 0, light = 0, reference_light = 0;
    for (size_t i = 0; i < pixels; i++) {
        for (int c = 0; c < 3; c++) {
            const double r = (double)reference[3 * i + c], d = (double)image[3 * i + c] - r;
            errors += d * d;
            squares += r * r;
            relative += ratio(d * d, r * r + floor, 0);
        }
        light += luminance(image + 3 * i);
        reference_light += luminance(reference + 3 * i);
    }
    measures->relative_l2 = sqrt(ratio(errors, squares, 0));
    measures->relative_mse = relative / (3 * (double)pixels);
    measures->energy = ratio(light, reference_light, 1);
}

static void difference_map(const float *image, const float *reference, size_t pixels, float *map)
{
    double sum = 0;
    for (size_t i = 0; i < pixels; i++) {
        sum += luminance(reference + 3 * i);
    }
    for (size_t i = 0; i < pixels; i++) {
        const double difference = luminance(image + 3 * i) - luminance(reference + 3 * i);
        map[i] = (float)ratio(difference, sum / (double)pixels, 0);
    }
}

static double psnr(const uint8_t *image, const uint8_t *reference, size_t count)
{
    uint64_t squares = 0;
    for (size_t i = 0; i < count; i++) {
        const int64_t d = (int64_t)image[i] - reference[i];
        squares += (uint64_t)(d * d);
    }
    return squares == 0 ? INFINITY : 10 * log10(255.0 * 255.0 * (double)count / (double)squares);
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// Interpolated between the two nearest ranks.
static double percentile(const float *sorted, size_t count, double fraction)
{
    const double at = fraction * (double)(count - 1);
    const size_t low = (size_t)at, high = low + 1 < count ? low + 1 : low;
    return (double)sorted[low] + ((double)sorted[high] - (double)sorted[low]) * (at - (double)low);
}

// Sorts `map`.
static void map_summarize(float *map, size_t count, double *mean_value, double *p95, double *p99)
{
    *mean_value = mean(map, count);
    qsort(map, count, sizeof(float), compare_floats);
    *p95 = percentile(map, count, 0.95);
    *p99 = percentile(map, count, 0.99);
}

static void decode(const uint8_t *picture, size_t count, float *linear)
{
    float table[256];
    for (int i = 0; i < 256; i++) {
        table[i] = (float)srgb_decode(i / 255.0);
    }
    for (size_t i = 0; i < count; i++) {
        linear[i] = table[picture[i]];
    }
}

// PSNR and LDR-FLIP, whose map is left in `map`.
static void pictures_measure(const float *image, const float *reference, uint32_t width, uint32_t height, double ev,
                             image_measures *measures, float *map)
{
    const size_t count = (size_t)width * height * 3;
    uint8_t *const pictures = memory_alloc(2 * count);
    float *const linear = memory_alloc(2 * count * sizeof(float));
    image_tonemap(image, width, height, ev, pictures);
    image_tonemap(reference, width, height, ev, pictures + count);
    measures->psnr = psnr(pictures, pictures + count, count);
    decode(pictures, 2 * count, linear);
    image_flip(linear, linear + count, width, height, map);
    free(linear);
    free(pictures);
}

static bool finite_check(const float *image, uint32_t width, uint32_t height, const char *what)
{
    const size_t bad = image_find_bad(image, width, height);
    if (bad == SIZE_MAX) {
        return true;
    }
    log_error("the %s cannot be measured: pixel %zu,%zu is not finite", what, bad % width, bad / width);
    return false;
}

bool image_measure(const float *image, const float *reference, uint32_t width, uint32_t height, double ev,
                   image_measures *measures, image_maps *maps)
{
    assert(width > 0 && height > 0);
    if (!finite_check(image, width, height, "image") || !finite_check(reference, width, height, "reference")) {
        return false;
    }
    const size_t pixels = (size_t)width * height;
    image_measures discarded;
    const bool maps_alone = !measures;
    measures = measures ? measures : &discarded;
    radiance_measure(image, reference, pixels, measures);

    float *const map = memory_alloc(pixels * sizeof(float));
    pictures_measure(image, reference, width, height, isnan(ev) ? image_exposure(reference, width, height) : ev,
                     measures, map);
    if (maps) {
        memcpy(maps->flip, map, pixels * sizeof(float));
        difference_map(image, reference, pixels, maps->difference);
    }
    map_summarize(map, pixels, &measures->flip_mean, &measures->flip_p95, &measures->flip_p99);

    if (!maps_alone) { // HDR-FLIP takes most of the time
        image_flip_hdr(image, reference, width, height, map);
        map_summarize(map, pixels, &measures->hdr_flip_mean, &measures->hdr_flip_p95, &measures->hdr_flip_p99);
    }
    free(map);
    return true;
}

#define MEASURE(name, help)                                                                                            \
    {                                                                                                                  \
#name, offsetof(image_measures, name), help                                                                    \
    }
static const image_measure_info table[] = {
    MEASURE(relative_l2, "sqrt(sum (i - r)^2 / sum r^2)"),
    MEASURE(relative_mse, "mean of (i - r)^2 / (r^2 + 0.01 mean(r)^2)"),
    MEASURE(energy, "sum i / sum r, of luminances"),
    MEASURE(psnr, "of the tone-mapped pictures, decibel; infinite when they are equal"),
    MEASURE(flip_mean, "FLIP of the tone-mapped pictures, 0 to 1"),
    MEASURE(flip_p95, "its 95th percentile over the pixels"),
    MEASURE(flip_p99, "its 99th percentile over the pixels"),
    MEASURE(hdr_flip_mean, "HDR-FLIP: the largest FLIP over all exposures, 0 to 1"),
    MEASURE(hdr_flip_p95, "its 95th percentile over the pixels"),
    MEASURE(hdr_flip_p99, "its 99th percentile over the pixels"),
};

const image_measure_info *image_measure_table(uint32_t *count)
{
    *count = countof(table);
    return table;
}
