// FLIP against closed cases, and against the papers' formulas written out in double precision with unseparated filters.
#include "modules/image_flip.h"

#include "test.h"

enum { PIXELS_MAX = 48 * 48 };
static const double PIXELS_PER_DEGREE = 67.0206432765823; // 3840 pixels on 0.7 m from 0.7 m

// ---- The papers' formulas

typedef struct color {
    double v[3];
} color;

static color xyz_of_rgb(color c)
{
    static const double m[3][3] = {{10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794},
                                   {2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
                                   {1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382}};
    color xyz = {{0}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            xyz.v[i] += m[i][j] * c.v[j];
        }
    }
    return xyz;
}

// The known inverse of the matrix above, to nine digits.
static color rgb_of_xyz(color c)
{
    static const double m[3][3] = {{3.241003275, -1.537398934, -0.498615861},
                                   {-0.969224334, 1.875930071, 0.041554224},
                                   {0.055639423, -0.204011202, 1.057148933}};
    color rgb = {{0}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            rgb.v[i] += m[i][j] * c.v[j];
        }
    }
    return rgb;
}

static const double WHITE[3] = {0.950428545, 1, 1.088900371};

static color ycxcz_of_rgb(color c)
{
    const color xyz = xyz_of_rgb(c);
    const double x = xyz.v[0] / WHITE[0], y = xyz.v[1], z = xyz.v[2] / WHITE[2];
    return (color){{116 * y - 16, 500 * (x - y), 200 * (y - z)}};
}

static color rgb_of_ycxcz(color c)
{
    const double y = (c.v[0] + 16) / 116;
    return rgb_of_xyz((color){{WHITE[0] * (y + c.v[1] / 500), y, WHITE[2] * (y - c.v[2] / 200)}});
}

static double lab_curve(double t)
{
    return t > 216.0 / 24389 ? cbrt(t) : 841.0 / 108 * t + 4.0 / 29;
}

static color hunt_lab_of_rgb(color c)
{
    const color xyz = xyz_of_rgb(c);
    const double x = lab_curve(xyz.v[0] / WHITE[0]), y = lab_curve(xyz.v[1]), z = lab_curve(xyz.v[2] / WHITE[2]);
    const double l = 116 * y - 16;
    return (color){{l, 0.01 * l * 500 * (x - y), 0.01 * l * 200 * (y - z)}};
}

static double hyab(color a, color b)
{
    return fabs(a.v[0] - b.v[0]) + hypot(a.v[1] - b.v[1], a.v[2] - b.v[2]);
}

// Of two colours that fill their pictures.
static double color_error(color a, color b)
{
    const double largest = pow(hyab(hunt_lab_of_rgb((color){{0, 1, 0}}), hunt_lab_of_rgb((color){{0, 0, 1}})), 0.7);
    const double difference = pow(hyab(hunt_lab_of_rgb(a), hunt_lab_of_rgb(b)), 0.7);
    const double knee = 0.4 * largest;
    return difference < knee ? 0.95 / knee * difference : 0.95 + (difference - knee) / (largest - knee) * 0.05;
}

// An image whose pixels outside repeat the border.
typedef struct picture {
    const float *rgb;
    int width, height;
} picture;

static color pixel(const picture *p, int x, int y)
{
    x = x < 0 ? 0 : x >= p->width ? p->width - 1 : x;
    y = y < 0 ? 0 : y >= p->height ? p->height - 1 : y;
    const float *const rgb = p->rgb + 3 * (y * p->width + x);
    return (color){{(double)rgb[0], (double)rgb[1], (double)rgb[2]}};
}

static double csf(int channel, int x, int y)
{
    static const double parameters[3][4] = {{1, 0.0047, 0, 1e-5}, {1, 0.0053, 0, 1e-5}, {34.1, 0.04, 13.5, 0.025}};
    const double *const p = parameters[channel];
    const double square = (x * x + y * y) / (PIXELS_PER_DEGREE * PIXELS_PER_DEGREE);
    return p[0] * sqrt(M_PI / p[1]) * exp(-M_PI * M_PI * square / p[1]) +
           p[2] * sqrt(M_PI / p[3]) * exp(-M_PI * M_PI * square / p[3]);
}

// The colour that is seen at a pixel.
static color seen_color(const picture *p, int px, int py)
{
    color sum = {{0}};
    for (int c = 0; c < 3; c++) {
        double weights = 0;
        for (int y = -10; y <= 10; y++) {
            for (int x = -10; x <= 10; x++) {
                const double weight = csf(c, x, y);
                sum.v[c] += weight * ycxcz_of_rgb(pixel(p, px + x, py + y)).v[c];
                weights += weight;
            }
        }
        sum.v[c] /= weights;
    }
    color rgb = rgb_of_ycxcz(sum);
    for (int c = 0; c < 3; c++) {
        rgb.v[c] = fmin(fmax(rgb.v[c], 0), 1);
    }
    return rgb;
}

// Derivative number `order` across or down, before normalisation.
static double feature_weight(int order, int along, int aside)
{
    const double deviation = 0.5 * 0.082 * PIXELS_PER_DEGREE, s = deviation * deviation;
    const double gaussian = exp(-(along * along + aside * aside) / (2 * s));
    return gaussian * (order == 1 ? -along : along * along / s - 1);
}

static double feature_along(const picture *p, int px, int py, int order, bool down)
{
    double positive = 0, negative = 0, positive_weights = 0, negative_weights = 0;
    for (int y = -9; y <= 9; y++) {
        for (int x = -9; x <= 9; x++) {
            const double weight = feature_weight(order, down ? y : x, down ? x : y);
            const double value = (ycxcz_of_rgb(pixel(p, px + x, py + y)).v[0] + 16) / 116;
            *(weight > 0 ? &positive : &negative) += weight * value;
            *(weight > 0 ? &positive_weights : &negative_weights) += fabs(weight);
        }
    }
    return positive / positive_weights + negative / negative_weights;
}

static double feature(const picture *p, int x, int y, int order)
{
    return hypot(feature_along(p, x, y, order, false), feature_along(p, x, y, order, true));
}

static double flip_at(const picture *a, const picture *b, int x, int y)
{
    const double edges = fabs(feature(a, x, y, 1) - feature(b, x, y, 1));
    const double points = fabs(feature(a, x, y, 2) - feature(b, x, y, 2));
    const double features = sqrt(fmax(edges, points) / sqrt(2));
    return pow(color_error(seen_color(a, x, y), seen_color(b, x, y)), 1 - features);
}

// ---- Images

static void fill(float *image, size_t pixels, float r, float g, float b)
{
    for (size_t i = 0; i < pixels; i++) {
        image[3 * i] = r;
        image[3 * i + 1] = g;
        image[3 * i + 2] = b;
    }
}

// 0 to 1, the same for the same (i, seed).
static float arbitrary(size_t i, uint32_t seed)
{
    uint32_t h = (uint32_t)i * 2654435761u + seed * 40503u;
    h = (h ^ h >> 15) * 2246822519u;
    h = (h ^ h >> 13) * 3266489917u;
    return (float)(h >> 8) / 16777216.0f;
}

// Shapes and a little noise, 0 to 1.
static void picture_make(float *image, int width, int height, float noise, uint32_t seed)
{
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            float *const rgb = image + 3 * (y * width + x);
            const bool inside = (x - 12) * (x - 12) + (y - 8) * (y - 8) < 30;
            rgb[0] = inside ? 0.9f : 0.2f + 0.4f * (float)x / (float)width;
            rgb[1] = x > width / 2 ? 0.7f : 0.15f;
            rgb[2] = y > height / 2 ? 0.8f : 0.05f;
            for (int c = 0; c < 3; c++) {
                const float value = rgb[c] + noise * (arbitrary((size_t)(3 * (y * width + x) + c), seed) - 0.5f);
                rgb[c] = fminf(fmaxf(value, 0), 1);
            }
        }
    }
}

static double map_mean(const float *map, size_t pixels)
{
    double sum = 0;
    for (size_t i = 0; i < pixels; i++) {
        CHECK(map[i] >= 0 && map[i] <= 1); // also not NaN
        sum += (double)map[i];
    }
    return sum / (double)pixels;
}

static float a[3 * PIXELS_MAX], b[3 * PIXELS_MAX], map[PIXELS_MAX], other_map[PIXELS_MAX];

// ---- Filters

static double taps_sum(const float *taps, int count, int sign)
{
    double sum = 0;
    for (int i = 0; i < count; i++) {
        sum += (double)taps[i] * sign > 0 || sign == 0 ? (double)taps[i] : 0;
    }
    return sum;
}

TEST(contrast_sensitivity_filters_sum_to_one)
{
    flip_filters f;
    flip_filters_make(&f);
    CHECK_NEAR(taps_sum(f.achromatic, FLIP_CSF_TAPS, 0), 1, 1e-6);
    CHECK_NEAR(taps_sum(f.red_green, FLIP_CSF_TAPS, 0), 1, 1e-6);
    CHECK_NEAR(taps_sum(f.blue_yellow[0], FLIP_CSF_TAPS, 0), 1, 1e-6);
    CHECK_NEAR(taps_sum(f.blue_yellow[1], FLIP_CSF_TAPS, 0), 1, 1e-6);
    CHECK_NEAR((double)f.blue_yellow_weights[0] + (double)f.blue_yellow_weights[1], 1, 1e-6);
    // The eye sees blue and yellow blurred most.
    CHECK(f.blue_yellow[0][FLIP_CSF_RADIUS] < f.red_green[FLIP_CSF_RADIUS]);
    CHECK(f.red_green[FLIP_CSF_RADIUS] < f.achromatic[FLIP_CSF_RADIUS]);
}

TEST(feature_filters_sum_to_one_on_either_side)
{
    flip_filters f;
    flip_filters_make(&f);
    CHECK_NEAR(taps_sum(f.gaussian, FLIP_FEATURE_TAPS, 0), 1, 1e-6);
    CHECK_NEAR(taps_sum(f.edge, FLIP_FEATURE_TAPS, 1), 1, 1e-6);
    CHECK_NEAR(taps_sum(f.edge, FLIP_FEATURE_TAPS, -1), -1, 1e-6);
    CHECK_NEAR(taps_sum(f.point, FLIP_FEATURE_TAPS, 1), 1, 1e-6);
    CHECK_NEAR(taps_sum(f.point, FLIP_FEATURE_TAPS, -1), -1, 1e-6);
}

// ---- LDR-FLIP

TEST(equal_pictures_have_no_error)
{
    picture_make(a, 48, 32, 0.5f, 1);
    image_flip(a, a, 48, 32, map);
    CHECK(map_mean(map, 48 * 32) == 0);
}

TEST(of_two_plain_colours_only_the_colour_counts)
{
    static const color colors[] = {{{0, 0, 0}},       {{1, 1, 1}},        {{0, 1, 0}},           {{0, 0, 1}},
                                   {{0.5, 0.5, 0.5}}, {{0.51, 0.5, 0.5}}, {{0.02, 0.01, 0.005}}, {{1, 0.2, 0}}};
    for (size_t i = 0; i < countof(colors); i++) {
        for (size_t j = 0; j < countof(colors); j++) {
            const double *const p = colors[i].v, *const q = colors[j].v;
            fill(a, 25, (float)p[0], (float)p[1], (float)p[2]);
            fill(b, 25, (float)q[0], (float)q[1], (float)q[2]);
            image_flip(a, b, 5, 5, map);
            // On plain pictures the features are rounding, of which the square root is taken. Measured: 5e-5.
            CHECK_NEAR((double)map[12], i == j ? 0 : color_error(colors[i], colors[j]), 1e-4);
        }
    }
}

TEST(green_against_blue_is_one_and_black_against_white_is_near_it)
{
    fill(a, 9, 0, 1, 0);
    fill(b, 9, 0, 0, 1);
    image_flip(a, b, 3, 3, map);
    CHECK_NEAR((double)map[4], 1, 1e-5);
    // L differs by 100, and green and blue by 203.3017: (100^0.7 / 203.3017^0.7 - 0.4) / 0.6 of the last twentieth.
    fill(a, 9, 0, 0, 0);
    fill(b, 9, 1, 1, 1);
    image_flip(a, b, 3, 3, map);
    CHECK_NEAR((double)map[4], 0.95 + 0.05 * (pow(100 / 203.3017, 0.7) - 0.4) / 0.6, 1e-5);
}

TEST(image_and_reference_may_change_places)
{
    picture_make(a, 48, 32, 0.1f, 1);
    picture_make(b, 48, 32, 0.3f, 2);
    image_flip(a, b, 48, 32, map);
    image_flip(b, a, 48, 32, other_map);
    CHECK(memcmp(map, other_map, 48 * 32 * sizeof(float)) == 0);
}

TEST(the_error_grows_with_the_noise)
{
    double last = 0;
    picture_make(a, 48, 32, 0, 0);
    for (int i = 1; i <= 5; i++) {
        picture_make(b, 48, 32, 0.1f * (float)i, 3);
        image_flip(b, a, 48, 32, map);
        const double error = map_mean(map, 48 * 32);
        CHECK(error > last);
        last = error;
    }
}

TEST(separable_filters_give_what_the_formulas_give)
{
    enum { WIDTH = 30, HEIGHT = 20 };
    picture_make(a, WIDTH, HEIGHT, 0.2f, 1);
    picture_make(b, WIDTH, HEIGHT, 0.4f, 2);
    image_flip(a, b, WIDTH, HEIGHT, map);
    const picture p = {a, WIDTH, HEIGHT}, q = {b, WIDTH, HEIGHT};
    static const int places[][2] = {{0, 0}, {29, 19}, {15, 10}, {12, 8}, {3, 17}, {28, 1}, {7, 7}, {16, 0}};
    for (size_t i = 0; i < countof(places); i++) {
        const int x = places[i][0], y = places[i][1];
        // Measured: 1e-6.
        CHECK_NEAR((double)map[y * WIDTH + x], flip_at(&p, &q, x, y), 1e-5);
    }
}

// Channels are blurred differently, so that beside pure colours colours arise that no screen has.
TEST(colours_that_no_screen_has_are_clamped)
{
    enum { SIDE = 16 };
    for (int i = 0; i < SIDE * SIDE; i++) {
        for (int c = 0; c < 3; c++) {
            a[3 * i + c] = c == i % SIDE / 6; // bars of red, green, blue
            b[3 * i + c] = c == (i % SIDE / 6 + 1) % 3;
        }
    }
    image_flip(a, b, SIDE, SIDE, map);
    const picture p = {a, SIDE, SIDE}, q = {b, SIDE, SIDE};
    for (int x = 0; x < SIDE; x += 2) {
        CHECK_NEAR((double)map[8 * SIDE + x], flip_at(&p, &q, x, 8), 1e-5);
    }
}

TEST(one_pixel_is_seen_as_far_as_the_widest_filter_and_no_farther)
{
    enum { SIDE = 48, MIDDLE = 24 };
    fill(a, SIDE * SIDE, 0.2f, 0.2f, 0.2f);
    memcpy(b, a, sizeof(a));
    b[3 * (MIDDLE * SIDE + MIDDLE) + 2] = 1; // blue, which is blurred most
    image_flip(b, a, SIDE, SIDE, map);
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const bool inside = abs(x - MIDDLE) <= FLIP_CSF_RADIUS && abs(y - MIDDLE) <= FLIP_CSF_RADIUS;
            CHECK(inside || map[y * SIDE + x] == 0);
        }
    }
    CHECK(map[MIDDLE * SIDE + MIDDLE + FLIP_CSF_RADIUS] > 0);
    CHECK(map[(MIDDLE - FLIP_CSF_RADIUS) * SIDE + MIDDLE] > 0);
    CHECK(map[MIDDLE * SIDE + MIDDLE] > map[MIDDLE * SIDE + MIDDLE + 3]);
}

TEST(one_pixel_is_a_picture)
{
    fill(a, 1, 0, 0, 0);
    fill(b, 1, 1, 1, 1);
    image_flip(a, b, 1, 1, map);
    CHECK(map[0] > 0.95f);
}

// ---- HDR-FLIP

// Narkowicz 2015 with the papers' pre-exposure.
static double tone_curve(double x)
{
    x *= 0.6;
    return fmin(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 1);
}

// Radiance of five decades.
static void radiance_make(float *image, size_t pixels, uint32_t seed)
{
    for (size_t i = 0; i < 3 * pixels; i++) {
        image[i] = powf(10, 5 * arbitrary(i / 3, 7) - 3) * (1 + 0.3f * arbitrary(i, seed));
    }
}

TEST(exposures_put_maximum_and_median_at_the_knee_of_the_curve)
{
    static const float luminances[5] = {0.01f, 0.5f, 2, 8, 1000};
    for (int i = 0; i < 5; i++) {
        fill(a + 3 * i, 1, luminances[i], luminances[i], luminances[i]);
    }
    const flip_exposures e = image_flip_exposures(a, 5, 1);
    CHECK_NEAR(tone_curve(1000 * exp2(e.start)), 0.85, 1e-6);
    CHECK_NEAR(tone_curve(2 * exp2(e.stop)), 0.85, 1e-6);
    CHECK(e.count == 9); // log2(1000 / 2) = 8.97
}

TEST(the_median_of_a_mostly_black_reference_is_that_of_its_light)
{
    fill(a, 16, 0, 0, 0);
    fill(a, 3, 4, 4, 4);
    a[3] = a[4] = a[5] = 1;
    const flip_exposures e = image_flip_exposures(a, 4, 4);
    CHECK_NEAR(e.start, e.stop, 1e-6);
    CHECK_NEAR(tone_curve(4 * exp2(e.start)), 0.85, 1e-6);
    CHECK(e.count == 2);
}

TEST(hdr_flip_is_the_largest_over_the_exposures)
{
    enum { WIDTH = 16, HEIGHT = 12, PIXELS = WIDTH * HEIGHT };
    static float radiance[2][3 * PIXELS];
    radiance_make(radiance[0], PIXELS, 1);
    radiance_make(radiance[1], PIXELS, 2);
    float largest[PIXELS] = {0};
    const flip_exposures e = image_flip_exposures(radiance[1], WIDTH, HEIGHT);
    CHECK(e.count > 5);
    for (uint32_t k = 0; k < e.count; k++) {
        const double factor = exp2(e.start + (e.stop - e.start) * k / (e.count - 1));
        for (size_t i = 0; i < 3 * PIXELS; i++) {
            a[i] = (float)tone_curve((double)radiance[0][i] * factor);
            b[i] = (float)tone_curve((double)radiance[1][i] * factor);
        }
        image_flip(a, b, WIDTH, HEIGHT, map);
        for (size_t i = 0; i < PIXELS; i++) {
            largest[i] = fmaxf(largest[i], map[i]);
        }
    }
    image_flip_hdr(radiance[0], radiance[1], WIDTH, HEIGHT, map);
    for (size_t i = 0; i < PIXELS; i++) {
        CHECK_NEAR((double)map[i], (double)largest[i], 1e-3);
    }
}

TEST(hdr_flip_of_equal_images_is_zero)
{
    radiance_make(a, 256, 1);
    image_flip_hdr(a, a, 16, 16, map);
    CHECK(map_mean(map, 256) == 0);
}

TEST(hdr_flip_does_not_depend_on_the_unit_of_radiance)
{
    radiance_make(a, 256, 1);
    radiance_make(b, 256, 2);
    image_flip_hdr(a, b, 16, 16, map);
    for (size_t i = 0; i < 3 * 256; i++) {
        a[i] *= 1000;
        b[i] *= 1000;
    }
    image_flip_hdr(a, b, 16, 16, other_map);
    CHECK_NEAR(map_mean(map, 256), map_mean(other_map, 256), 1e-4);
}

TEST(hdr_flip_grows_with_a_factor)
{
    radiance_make(a, 256, 1);
    double last = 0;
    for (int e = 1; e <= 3; e++) {
        for (size_t i = 0; i < 3 * 256; i++) {
            b[i] = a[i] * powf(10, (float)e);
        }
        image_flip_hdr(b, a, 16, 16, map);
        const double error = map_mean(map, 256);
        CHECK(error > last);
        last = error;
    }
    CHECK(last > 0.5);
}

TEST(black_plain_and_extreme_references_have_numbers)
{
    radiance_make(b, 256, 1);
    fill(a, 256, 0, 0, 0);
    image_flip_hdr(a, a, 16, 16, map);
    CHECK(map_mean(map, 256) == 0);
    image_flip_hdr(b, a, 16, 16, map); // a black reference
    CHECK(map_mean(map, 256) > 0);
    image_flip_hdr(a, b, 16, 16, map); // a black image
    CHECK(map_mean(map, 256) > 0);
    fill(a, 256, 3, 3, 3);
    image_flip_hdr(b, a, 16, 16, map); // a plain reference
    CHECK(map_mean(map, 256) > 0);
    a[0] = a[1] = a[2] = 3e38f;
    a[3] = a[4] = a[5] = 1e-38f;
    a[6] = -5; // counts as 0
    image_flip_hdr(b, a, 16, 16, map);
    CHECK(map_mean(map, 256) > 0);
    fill(a, 9, 1e-45f, 1e-45f, 1e-45f);
    a[0] = 3e38f;
    image_flip_hdr(a, a, 3, 3, map);
    CHECK(map_mean(map, 9) == 0);
}

int main(void)
{
    RUN(contrast_sensitivity_filters_sum_to_one);
    RUN(feature_filters_sum_to_one_on_either_side);
    RUN(equal_pictures_have_no_error);
    RUN(of_two_plain_colours_only_the_colour_counts);
    RUN(green_against_blue_is_one_and_black_against_white_is_near_it);
    RUN(image_and_reference_may_change_places);
    RUN(the_error_grows_with_the_noise);
    RUN(separable_filters_give_what_the_formulas_give);
    RUN(colours_that_no_screen_has_are_clamped);
    RUN(one_pixel_is_seen_as_far_as_the_widest_filter_and_no_farther);
    RUN(one_pixel_is_a_picture);
    RUN(exposures_put_maximum_and_median_at_the_knee_of_the_curve);
    RUN(the_median_of_a_mostly_black_reference_is_that_of_its_light);
    RUN(hdr_flip_is_the_largest_over_the_exposures);
    RUN(hdr_flip_of_equal_images_is_zero);
    RUN(hdr_flip_does_not_depend_on_the_unit_of_radiance);
    RUN(hdr_flip_grows_with_a_factor);
    RUN(black_plain_and_extreme_references_have_numbers);
    return test_end();
}
