// FLIP: both pictures are filtered as the eye does, then compared in colour and in features. Names of constants are the
// papers'.
//
// Opponent colours are kept without the constants of YCxCz: y = Y/Yn, cx = X/Xn - Y/Yn, cz = Y/Yn - Z/Zn. Filters that
// sum to 1 commute with those constants, which cancel on the way to CIELAB and in the features.
#include "image_flip.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- Filters

static const double PIXELS_PER_DEGREE = 0.7 * (3840 / 0.7) * M_PI / 180;

// A sampled Gaussian exp(-x^2 / (2 deviation^2)), x in pixels, that sums to 1. Returns the sum it had.
static double gaussian_make(double deviation, int radius, float *taps)
{
    double sum = 0;
    for (int x = -radius; x <= radius; x++) {
        sum += exp(-x * x / (2 * deviation * deviation));
    }
    for (int x = -radius; x <= radius; x++) {
        taps[x + radius] = (float)(exp(-x * x / (2 * deviation * deviation)) / sum);
    }
    return sum;
}

// The contrast sensitivity function's Gaussian a sqrt(pi/b) exp(-pi^2 x^2 / b), x in degrees. Returns what the
// two-dimensional filter summed to.
static double csf_make(double a, double b, float taps[FLIP_CSF_TAPS])
{
    const double deviation = sqrt(b / (2 * M_PI * M_PI)) * PIXELS_PER_DEGREE;
    const double sum = gaussian_make(deviation, FLIP_CSF_RADIUS, taps);
    return a * sqrt(M_PI / b) * sum * sum;
}

// Positive taps sum to 1 and negative ones to -1.
static void feature_normalize(float taps[FLIP_FEATURE_TAPS])
{
    double positive = 0, negative = 0;
    for (int i = 0; i < FLIP_FEATURE_TAPS; i++) {
        positive += fmax((double)taps[i], 0);
        negative += fmax((double)-taps[i], 0);
    }
    for (int i = 0; i < FLIP_FEATURE_TAPS; i++) {
        taps[i] = (float)((double)taps[i] / (taps[i] > 0 ? positive : negative));
    }
}

void flip_filters_make(flip_filters *filters)
{
    // Three standard deviations of the widest filter, rounded up.
    assert(FLIP_CSF_RADIUS == (int)ceil(3 * sqrt(0.04 / (2 * M_PI * M_PI)) * PIXELS_PER_DEGREE));
    csf_make(1, 0.0047, filters->achromatic);
    csf_make(1, 0.0053, filters->red_green);
    const double wide = csf_make(34.1, 0.04, filters->blue_yellow[0]);
    const double narrow = csf_make(13.5, 0.025, filters->blue_yellow[1]);
    filters->blue_yellow_weights[0] = (float)(wide / (wide + narrow));
    filters->blue_yellow_weights[1] = (float)(narrow / (wide + narrow));

    const double deviation = 0.5 * 0.082 * PIXELS_PER_DEGREE;
    assert(FLIP_FEATURE_RADIUS == (int)ceil(3 * deviation));
    gaussian_make(deviation, FLIP_FEATURE_RADIUS, filters->gaussian);
    for (int x = -FLIP_FEATURE_RADIUS; x <= FLIP_FEATURE_RADIUS; x++) {
        const int i = x + FLIP_FEATURE_RADIUS;
        const double gaussian = exp(-x * x / (2 * deviation * deviation));
        filters->edge[i] = (float)(-x * gaussian);
        filters->point[i] = (float)((x * x / (deviation * deviation) - 1) * gaussian);
    }
    feature_normalize(filters->edge);
    feature_normalize(filters->point);
}

// ---- Colours

// Linear RGB to X/Xn, Y/Yn, Z/Zn: the primaries and the white point (D65) of sRGB. Rows sum to 1.
static const float XYZ_OF_RGB[3][3] = {
    {10135552.0 / 23359437, 8788810.0 / 23359437, 4435075.0 / 23359437},
    {2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
    {1425312.0 / 80288307, 8788810.0 / 80288307, 70074185.0 / 80288307},
};

// The way back: the inverse by cofactors.
static void rgb_of_xyz_make(float inverse[3][3])
{
    const float(*const m)[3] = XYZ_OF_RGB;
    double cofactors[3][3];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            const int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
            cofactors[i][j] = (double)m[a][c] * m[b][d] - (double)m[a][d] * m[b][c];
        }
    }
    const double determinant = m[0][0] * cofactors[0][0] + m[0][1] * cofactors[0][1] + m[0][2] * cofactors[0][2];
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            inverse[i][j] = (float)(cofactors[j][i] / determinant);
        }
    }
}

static float lab_curve(float t)
{
    const float delta = 6.0f / 29;
    return t > delta * delta * delta ? cbrtf(t) : t / (3 * delta * delta) + 4.0f / 29;
}

typedef struct lab_color {
    float l, a, b;
} lab_color;

// CIELAB with the Hunt effect, by which colours look more saturated where it is bright. Takes X/Xn, Y/Yn, Z/Zn.
static lab_color lab_hunt(float x, float y, float z)
{
    const float fx = lab_curve(x), fy = lab_curve(y), fz = lab_curve(z);
    const float l = 116 * fy - 16;
    return (lab_color){.l = l, .a = 0.01f * l * 500 * (fx - fy), .b = 0.01f * l * 200 * (fy - fz)};
}

// HyAB to the power q_c = 0.7.
static float color_difference(lab_color a, lab_color b)
{
    const float da = a.a - b.a, db = a.b - b.b;
    return powf(fabsf(a.l - b.l) + sqrtf(da * da + db * db), 0.7f);
}

static lab_color lab_of_rgb(float r, float g, float b)
{
    float xyz[3];
    for (int i = 0; i < 3; i++) {
        xyz[i] = XYZ_OF_RGB[i][0] * r + XYZ_OF_RGB[i][1] * g + XYZ_OF_RGB[i][2] * b;
    }
    return lab_hunt(xyz[0], xyz[1], xyz[2]);
}

// ---- What is seen of a picture: filtered colours and strengths of features

// Planes after the horizontal filters.
enum { ACROSS_Y, ACROSS_CX, ACROSS_CZ, ACROSS_CZ_2, ACROSS_GAUSSIAN, ACROSS_EDGE, ACROSS_POINT, ACROSS_COUNT };
// Planes of what is seen.
enum { SEEN_L, SEEN_A, SEEN_B, SEEN_EDGE, SEEN_POINT, SEEN_COUNT };

enum { PADDING = FLIP_CSF_RADIUS }; // the widest filter's

typedef struct flip_work {
    uint32_t width, height;
    flip_filters filters;
    float rgb_of_xyz[3][3];
    float largest; // color_difference of any two colours: green and blue
    float *across[ACROSS_COUNT];
    float *seen[2][SEEN_COUNT]; // image, reference
    float *padded[3]; // opponent colours of one row, `PADDING` pixels longer at both ends
    float *filtered[8]; // rows
    float *memory;
} flip_work;

static void work_init(flip_work *work, uint32_t width, uint32_t height)
{
    *work = (flip_work){.width = width, .height = height};
    flip_filters_make(&work->filters);
    rgb_of_xyz_make(work->rgb_of_xyz);
    work->largest = color_difference(lab_of_rgb(0, 1, 0), lab_of_rgb(0, 0, 1));

    const size_t plane = (size_t)width * height, padded = (size_t)width + 2 * PADDING;
    const size_t planes = ACROSS_COUNT + 2 * SEEN_COUNT;
    const size_t rows = countof(work->padded) * padded + countof(work->filtered) * (size_t)width;
    float *next = work->memory = memory_alloc((planes * plane + rows) * sizeof(float));
    for (size_t i = 0; i < ACROSS_COUNT; i++, next += plane) {
        work->across[i] = next;
    }
    for (size_t i = 0; i < 2 * SEEN_COUNT; i++, next += plane) {
        work->seen[i / SEEN_COUNT][i % SEEN_COUNT] = next;
    }
    for (size_t i = 0; i < countof(work->padded); i++, next += padded) {
        work->padded[i] = next;
    }
    for (size_t i = 0; i < countof(work->filtered); i++, next += width) {
        work->filtered[i] = next;
    }
}

static void work_fini(flip_work *work)
{
    free(work->memory);
}

// Opponent colours of one row into `padded`.
static void row_opponent(flip_work *work, const float *rgb)
{
    const uint32_t width = work->width;
    const float(*const m)[3] = XYZ_OF_RGB;
    for (uint32_t x = 0; x < width; x++) {
        const float r = rgb[3 * x], g = rgb[3 * x + 1], b = rgb[3 * x + 2];
        const float y = m[1][0] * r + m[1][1] * g + m[1][2] * b;
        work->padded[0][PADDING + x] = y;
        work->padded[1][PADDING + x] = m[0][0] * r + m[0][1] * g + m[0][2] * b - y;
        work->padded[2][PADDING + x] = y - (m[2][0] * r + m[2][1] * g + m[2][2] * b);
    }
    for (size_t c = 0; c < countof(work->padded); c++) {
        float *const row = work->padded[c];
        for (uint32_t i = 0; i < PADDING; i++) {
            row[i] = row[PADDING];
            row[PADDING + width + i] = row[PADDING + width - 1];
        }
    }
}

static void filter_across(const flip_work *work, const float *padded, const float *taps, int radius,
                          float *restrict out)
{
    const uint32_t width = work->width;
    memset(out, 0, width * sizeof(float));
    for (int i = -radius; i <= radius; i++) {
        const float tap = taps[i + radius];
        const float *const in = padded + PADDING + i;
        for (uint32_t x = 0; x < width; x++) {
            out[x] += tap * in[x];
        }
    }
}

static void filter_down(const flip_work *work, const float *plane, uint32_t y, const float *taps, int radius,
                        float *restrict out)
{
    const uint32_t width = work->width;
    memset(out, 0, width * sizeof(float));
    for (int i = -radius; i <= radius; i++) {
        const int64_t row = (int64_t)y + i, last = (int64_t)work->height - 1;
        const float tap = taps[i + radius];
        const float *const in = plane + (size_t)(row < 0 ? 0 : row > last ? last : row) * width;
        for (uint32_t x = 0; x < width; x++) {
            out[x] += tap * in[x];
        }
    }
}

static void picture_filter_across(flip_work *work, const float *picture)
{
    const flip_filters *const f = &work->filters;
    float *const *const padded = work->padded;
    for (uint32_t y = 0; y < work->height; y++) {
        const size_t row = (size_t)y * work->width;
        row_opponent(work, picture + 3 * row);
        const struct {
            const float *in, *taps;
            int radius;
        } filters[ACROSS_COUNT] = {
            [ACROSS_Y] = {padded[0], f->achromatic, FLIP_CSF_RADIUS},
            [ACROSS_CX] = {padded[1], f->red_green, FLIP_CSF_RADIUS},
            [ACROSS_CZ] = {padded[2], f->blue_yellow[0], FLIP_CSF_RADIUS},
            [ACROSS_CZ_2] = {padded[2], f->blue_yellow[1], FLIP_CSF_RADIUS},
            [ACROSS_GAUSSIAN] = {padded[0], f->gaussian, FLIP_FEATURE_RADIUS},
            [ACROSS_EDGE] = {padded[0], f->edge, FLIP_FEATURE_RADIUS},
            [ACROSS_POINT] = {padded[0], f->point, FLIP_FEATURE_RADIUS},
        };
        for (size_t i = 0; i < ACROSS_COUNT; i++) {
            filter_across(work, filters[i].in, filters[i].taps, filters[i].radius, work->across[i] + row);
        }
    }
}

static float clamp_unit(float value)
{
    return value < 0 ? 0 : value > 1 ? 1 : value;
}

// Colours outside the screen's gamut, which the filters may make, are clamped.
static lab_color filtered_color(const flip_work *work, uint32_t x)
{
    float *const *const row = work->filtered;
    const float *const weights = work->filters.blue_yellow_weights;
    const float y = row[0][x], cx = row[1][x], cz = weights[0] * row[2][x] + weights[1] * row[3][x];
    const float xyz[3] = {y + cx, y, y - cz};
    float rgb[3];
    for (int i = 0; i < 3; i++) {
        const float *const m = work->rgb_of_xyz[i];
        rgb[i] = clamp_unit(m[0] * xyz[0] + m[1] * xyz[1] + m[2] * xyz[2]);
    }
    return lab_of_rgb(rgb[0], rgb[1], rgb[2]);
}

static void row_see(const flip_work *work, uint32_t y, float *const seen[SEEN_COUNT])
{
    const flip_filters *const f = &work->filters;
    const struct {
        const float *plane, *taps;
        int radius;
    } filters[countof(work->filtered)] = {
        {work->across[ACROSS_Y], f->achromatic, FLIP_CSF_RADIUS},
        {work->across[ACROSS_CX], f->red_green, FLIP_CSF_RADIUS},
        {work->across[ACROSS_CZ], f->blue_yellow[0], FLIP_CSF_RADIUS},
        {work->across[ACROSS_CZ_2], f->blue_yellow[1], FLIP_CSF_RADIUS},
        {work->across[ACROSS_EDGE], f->gaussian, FLIP_FEATURE_RADIUS},
        {work->across[ACROSS_GAUSSIAN], f->edge, FLIP_FEATURE_RADIUS},
        {work->across[ACROSS_POINT], f->gaussian, FLIP_FEATURE_RADIUS},
        {work->across[ACROSS_GAUSSIAN], f->point, FLIP_FEATURE_RADIUS},
    };
    float *const *const row = work->filtered;
    for (size_t i = 0; i < countof(filters); i++) {
        filter_down(work, filters[i].plane, y, filters[i].taps, filters[i].radius, row[i]);
    }
    for (uint32_t x = 0; x < work->width; x++) {
        const size_t pixel = (size_t)y * work->width + x;
        const lab_color color = filtered_color(work, x);
        seen[SEEN_L][pixel] = color.l;
        seen[SEEN_A][pixel] = color.a;
        seen[SEEN_B][pixel] = color.b;
        seen[SEEN_EDGE][pixel] = sqrtf(row[4][x] * row[4][x] + row[5][x] * row[5][x]);
        seen[SEEN_POINT][pixel] = sqrtf(row[6][x] * row[6][x] + row[7][x] * row[7][x]);
    }
}

static void picture_see(flip_work *work, const float *picture, float *const seen[SEEN_COUNT])
{
    picture_filter_across(work, picture);
    for (uint32_t y = 0; y < work->height; y++) {
        row_see(work, y, seen);
    }
}

// ---- Comparison

// The difference as 0 to 1: what is below p_c = 0.4 of the largest takes p_t = 0.95 of the range.
static float color_error(float difference, float largest)
{
    const float knee = 0.4f * largest;
    return difference < knee ? 0.95f * difference / knee : 0.95f + 0.05f * (difference - knee) / (largest - knee);
}

static float pixel_error(const flip_work *work, size_t i)
{
    float *const *const a = work->seen[0], *const *const b = work->seen[1];
    const lab_color color_a = {a[SEEN_L][i], a[SEEN_A][i], a[SEEN_B][i]};
    const lab_color color_b = {b[SEEN_L][i], b[SEEN_A][i], b[SEEN_B][i]};
    const float color = color_error(color_difference(color_a, color_b), work->largest);
    const float edge = fabsf(a[SEEN_EDGE][i] - b[SEEN_EDGE][i]), point = fabsf(a[SEEN_POINT][i] - b[SEEN_POINT][i]);
    const float feature = sqrtf(fmaxf(edge, point) * (float)M_SQRT1_2); // q_f = 0.5
    return clamp_unit(powf(color, 1 - feature)); // features amplify
}

// Raises `map` to LDR-FLIP where that is larger.
static void flip_accumulate(flip_work *work, const float *image, const float *reference, float *map)
{
    picture_see(work, image, work->seen[0]);
    picture_see(work, reference, work->seen[1]);
    for (size_t i = 0; i < (size_t)work->width * work->height; i++) {
        map[i] = fmaxf(map[i], pixel_error(work, i));
    }
}

void image_flip(const float *image, const float *reference, uint32_t width, uint32_t height, float *map)
{
    flip_work work;
    work_init(&work, width, height);
    memset(map, 0, (size_t)width * height * sizeof(float));
    flip_accumulate(&work, image, reference, map);
    work_fini(&work);
}

// ---- HDR-FLIP

// (k0 x + k1) x / ((k3 x + k4) x + k5): Narkowicz 2015, with its pre-exposure of 0.6 in the constants.
static const double K0 = 0.6 * 0.6 * 2.51, K1 = 0.6 * 0.03, K3 = 0.6 * 0.6 * 2.43, K4 = 0.6 * 0.59, K5 = 0.14;

// Radiance at which the curve is at 0.85: the positive root of a quadratic equation.
static double tone_curve_knee(void)
{
    const double t = 0.85, a = K0 - t * K3, b = K1 - t * K4, c = -t * K5;
    return (-b + sqrt(b * b - 4 * a * c)) / (2 * a);
}

// In double precision, so that no exposure of any radiance overflows.
static void tone_map(const float *image, size_t count, double factor, float *picture)
{
    for (size_t i = 0; i < count; i++) {
        const double x = image[i] > 0 ? (double)image[i] * factor : 0;
        picture[i] = clamp_unit((float)((K0 * x + K1) * x / ((K3 * x + K4) * x + K5)));
    }
}

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// Of sorted values.
static double median(const double *values, size_t count)
{
    return (values[(count - 1) / 2] + values[count / 2]) / 2;
}

flip_exposures image_flip_exposures(const float *reference, uint32_t width, uint32_t height)
{
    const size_t count = (size_t)width * height;
    double *const luminances = memory_alloc(count * sizeof(double));
    size_t black = 0;
    for (size_t i = 0; i < count; i++) {
        const float *const rgb = reference + 3 * i;
        const double luminance = 0.2126 * (double)rgb[0] + 0.7152 * (double)rgb[1] + 0.0722 * (double)rgb[2];
        luminances[i] = luminance > 0 ? luminance : 0;
        black += !(luminance > 0);
    }
    qsort(luminances, count, sizeof(double), compare_doubles);

    flip_exposures exposures = {.count = 1};
    if (black < count) {
        double middle = median(luminances, count);
        if (middle <= 0) {
            middle = median(luminances + black, count - black);
        }
        exposures.start = log2(tone_curve_knee() / luminances[count - 1]);
        exposures.stop = log2(tone_curve_knee() / middle);
        // At least two: both ends.
        exposures.count = max_u32(2, (uint32_t)ceil(exposures.stop - exposures.start));
    }
    free(luminances);
    return exposures;
}

void image_flip_hdr(const float *image, const float *reference, uint32_t width, uint32_t height, float *map)
{
    const size_t count = (size_t)width * height;
    const flip_exposures exposures = image_flip_exposures(reference, width, height);
    const double step = exposures.count > 1 ? (exposures.stop - exposures.start) / (exposures.count - 1) : 0;
    flip_work work;
    work_init(&work, width, height);
    float *const pictures = memory_alloc(2 * 3 * count * sizeof(float));
    memset(map, 0, count * sizeof(float));
    for (uint32_t i = 0; i < exposures.count; i++) {
        const double factor = exp2(exposures.start + i * step);
        tone_map(image, 3 * count, factor, pictures);
        tone_map(reference, 3 * count, factor, pictures + 3 * count);
        flip_accumulate(&work, pictures, pictures + 3 * count, map);
    }
    free(pictures);
    work_fini(&work);
}
