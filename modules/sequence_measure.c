// Measures over time: see sequence_measure.h.
#include "sequence_measure.h"

#include <math.h>

static double luminance(const float *image, size_t pixel)
{
    const float *rgb = image + 3 * pixel;
    return 0.2126 * (double)rgb[0] + 0.7152 * (double)rgb[1] + 0.0722 * (double)rgb[2];
}

// 0 over 0 is 0, anything else over 0 infinite.
static double ratio(double a, double b)
{
    return b != 0 ? a / b : a == 0 ? 0 : INFINITY;
}

static double mean_luminance(const float *image, size_t pixels)
{
    double sum = 0;
    for (size_t i = 0; i < pixels; i++)
        sum += luminance(image, i);
    return sum / (double)pixels;
}

// Differences from the first frame: no cancellation, and exactly 0 where nothing differs.
static double pixel_deviation(const float *const *frames, uint32_t count, size_t pixel)
{
    const double first = luminance(frames[0], pixel);
    double sum = 0, squares = 0;
    for (uint32_t f = 1; f < count; f++) {
        const double d = luminance(frames[f], pixel) - first;
        sum += d;
        squares += d * d;
    }
    const double mean = sum / count;
    return ratio(sqrt(fmax(squares / count - mean * mean, 0)), first + mean);
}

double sequence_deviation(const float *const *frames, uint32_t count, uint32_t width, uint32_t height, float *map)
{
    const size_t pixels = (size_t)width * height;
    double sum = 0;
    for (size_t i = 0; i < pixels; i++) {
        const double deviation = pixel_deviation(frames, count, i);
        sum += deviation;
        if (map)
            map[i] = (float)deviation;
    }
    return sum / (double)pixels;
}

double sequence_flicker(const float *image, const float *image_before, const float *reference,
                        const float *reference_before, uint32_t width, uint32_t height, float *map)
{
    const size_t pixels = (size_t)width * height;
    const double mean = mean_luminance(reference, pixels);
    double sum = 0;
    for (size_t i = 0; i < pixels; i++) {
        const double change = luminance(image, i) - luminance(image_before, i);
        const double flicker = fabs(change - (luminance(reference, i) - luminance(reference_before, i)));
        sum += flicker;
        if (map)
            map[i] = (float)ratio(flicker, mean);
    }
    return ratio(sum / (double)pixels, mean);
}

static double block_mean(const float *image, uint32_t width, uint32_t height, uint32_t left, uint32_t top)
{
    const uint32_t right = min_u32(left + SEQUENCE_BLOCK, width), bottom = min_u32(top + SEQUENCE_BLOCK, height);
    double sum = 0;
    for (uint32_t y = top; y < bottom; y++)
        for (uint32_t x = left; x < right; x++)
            sum += luminance(image, (size_t)y * width + x);
    return sum / ((double)(right - left) * (bottom - top));
}

sequence_distance sequence_distance_to(const float *image, const float *steady, uint32_t width, uint32_t height)
{
    const size_t pixels = (size_t)width * height;
    const double steady_mean = mean_luminance(steady, pixels);
    double differences = 0, squares = 0;
    uint32_t blocks = 0, within = 0;
    for (uint32_t y = 0; y < height; y += SEQUENCE_BLOCK)
        for (uint32_t x = 0; x < width; x += SEQUENCE_BLOCK) {
            const double s = block_mean(steady, width, height, x, y), d = block_mean(image, width, height, x, y) - s;
            differences += d * d;
            squares += s * s;
            blocks++;
            within += fabs(d) <= fmax(0.1 * s, 0.01 * steady_mean);
        }
    return (sequence_distance){
        .mean = ratio(fabs(mean_luminance(image, pixels) - steady_mean), steady_mean),
        .blocks = sqrt(ratio(differences, squares)),
        .blocks_within = (double)within / blocks,
    };
}

uint32_t sequence_settled_after(const double *values, uint32_t count, double limit)
{
    uint32_t first = count;
    while (first > 0 && values[first - 1] <= limit)
        first--;
    return first;
}
