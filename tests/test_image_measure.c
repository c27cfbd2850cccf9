// Error measures against closed cases, the tone curve, and the false colours.
#include "modules/image_measure.h"

#include "test.h"

enum { WIDTH = 24, HEIGHT = 16, PIXELS = WIDTH * HEIGHT };
static float reference[3 * PIXELS], image[3 * PIXELS];

static char last_error[512];

static void remember_errors(log_level level, const char *line, void *user)
{
    (void)level;
    (void)user;
    snprintf(last_error, sizeof(last_error), "%s", line);
}

static void reference_make(void)
{
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        reference[i] = 0.01f + 5 * (float)(i * 7919 % 1000) / 1000;
    }
}

static image_measures measure(void)
{
    image_measures m;
    CHECK(image_measure(image, reference, WIDTH, HEIGHT, NAN, &m, NULL));
    return m;
}

// ---- Radiance

TEST(a_factor_k_has_relative_l2_of_k_minus_one_and_energy_k)
{
    static const float factors[] = {0, 0.5f, 0.9f, 1.25f, 4};
    reference_make();
    for (size_t f = 0; f < countof(factors); f++) {
        for (size_t i = 0; i < 3 * PIXELS; i++) {
            image[i] = factors[f] * reference[i];
        }
        const image_measures m = measure();
        CHECK_NEAR(m.relative_l2, fabs((double)factors[f] - 1), 1e-6);
        CHECK_NEAR(m.energy, (double)factors[f], 1e-6);
    }
}

TEST(relative_mse_of_a_plain_reference)
{
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        reference[i] = 2;
        image[i] = i % 2 ? 3 : 2; // half of the values differ by half
    }
    CHECK_NEAR(measure().relative_mse, 0.5 * 1.0 / (4 + 0.01 * 4), 1e-9);
}

TEST(relative_mse_does_not_depend_on_the_unit)
{
    reference_make();
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        image[i] = reference[i] + 0.25f;
    }
    const double before = measure().relative_mse;
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        image[i] *= 1024;
        reference[i] *= 1024;
    }
    CHECK(before > 0);
    CHECK_NEAR(measure().relative_mse, before, 1e-12 * before);
}

TEST(energy_is_of_luminance)
{
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        reference[i] = 1;
        image[i] = i % 3 == 1 ? 1 : 0; // green alone
    }
    CHECK_NEAR(measure().energy, 0.7152, 1e-9);
}

TEST(equal_images_have_no_error)
{
    reference_make();
    memcpy(image, reference, sizeof(image));
    const image_measures m = measure();
    CHECK(m.relative_l2 == 0 && m.relative_mse == 0 && m.energy == 1 && m.psnr == INFINITY);
    CHECK(m.flip_mean == 0 && m.flip_p95 == 0 && m.flip_p99 == 0);
    CHECK(m.hdr_flip_mean == 0 && m.hdr_flip_p95 == 0 && m.hdr_flip_p99 == 0);
}

TEST(against_black_the_relative_errors_are_infinite_and_never_nan)
{
    memset(reference, 0, sizeof(reference));
    memset(image, 0, sizeof(image));
    image_measures m = measure();
    CHECK(m.relative_l2 == 0 && m.relative_mse == 0 && m.energy == 1 && m.psnr == INFINITY && m.hdr_flip_mean == 0);
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        image[i] = 1;
    }
    m = measure();
    CHECK(m.relative_l2 == INFINITY && m.relative_mse == INFINITY && m.energy == INFINITY);
    CHECK(m.psnr < 20 && m.flip_mean > 0.5 && m.hdr_flip_mean > 0.5);
}

TEST(what_is_not_finite_is_refused_with_its_place)
{
    static const float bad[] = {NAN, INFINITY, -INFINITY};
    image_measures m;
    reference_make();
    for (size_t i = 0; i < countof(bad); i++) {
        memcpy(image, reference, sizeof(image));
        CHECK(image_find_bad(image, WIDTH, HEIGHT) == SIZE_MAX);
        image[3 * (5 * WIDTH + 7) + i] = bad[i];
        image[3 * (6 * WIDTH + 7)] = NAN;
        CHECK(image_find_bad(image, WIDTH, HEIGHT) == 5 * WIDTH + 7);
        CHECK(!image_measure(image, reference, WIDTH, HEIGHT, NAN, &m, NULL));
        CHECK(strstr(last_error, "the image") && strstr(last_error, "pixel 7,5"));
        CHECK(!image_measure(reference, image, WIDTH, HEIGHT, NAN, &m, NULL));
        CHECK(strstr(last_error, "the reference") && strstr(last_error, "pixel 7,5"));
    }
}

// ---- Pictures

// Radiance that at exposure 0 is shown as the 8-bit value: sRGB and the tone curve solved for it.
static float radiance_of(int shown)
{
    const double s = shown / 255.0, t = s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
    const double a = 2.51 - 2.43 * t, b = 0.03 - 0.59 * t, c = -0.14 * t;
    return (float)((-b + sqrt(b * b - 4 * a * c)) / (2 * a));
}

TEST(every_shown_value_comes_from_its_radiance)
{
    for (int i = 0; i < 256; i++) {
        const float grey[3] = {radiance_of(i), radiance_of(i), radiance_of(i)};
        uint8_t rgb[3];
        image_tonemap(grey, 1, 1, 0, rgb);
        CHECK(rgb[0] == i && rgb[1] == i && rgb[2] == i);
        const float four_times_darker[3] = {grey[0] / 4, grey[1] / 4, grey[2] / 4};
        image_tonemap(four_times_darker, 1, 1, 2, rgb);
        CHECK(rgb[0] == i);
    }
}

TEST(extreme_radiance_is_shown_as_black_or_white)
{
    const float values[6] = {-1, 0, 1e-30f, 100, 1e30f, 3e38f};
    uint8_t rgb[6];
    image_tonemap(values, 2, 1, 3, rgb);
    CHECK(rgb[0] == 0 && rgb[1] == 0 && rgb[2] == 0 && rgb[3] == 255 && rgb[4] == 255 && rgb[5] == 255);
}

TEST(psnr_of_pictures_a_step_apart)
{
    static const int steps[] = {1, 2, 10, 100};
    for (size_t s = 0; s < countof(steps); s++) {
        for (size_t i = 0; i < 3 * PIXELS; i++) {
            const int shown = (int)(i % 150);
            reference[i] = radiance_of(shown);
            image[i] = radiance_of(shown + steps[s]);
        }
        image_measures m;
        CHECK(image_measure(image, reference, WIDTH, HEIGHT, 0, &m, NULL));
        CHECK_NEAR(m.psnr, 20 * log10(255.0 / steps[s]), 1e-9);
    }
}

TEST(exposure_puts_the_log_average_at_middle_grey)
{
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        image[i] = i / 3 % 2 ? 2 : 8; // log-average 4
    }
    CHECK_NEAR(image_exposure(image, WIDTH, HEIGHT), log2(0.18 / 4), 1e-9);
    memset(image, 0, 3 * PIXELS / 2 * sizeof(float)); // what is black does not count
    CHECK_NEAR(image_exposure(image, WIDTH, HEIGHT), log2(0.18 / 4), 1e-9);
    memset(image, 0, sizeof(image));
    CHECK(image_exposure(image, WIDTH, HEIGHT) == 0);
}

TEST(both_pictures_are_shown_at_the_reference_s_exposure)
{
    reference_make();
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        image[i] = 4 * reference[i]; // equal pictures if each had its own
    }
    const image_measures own = measure();
    CHECK(own.psnr < 30 && own.flip_mean > 0.05);
    image_measures same;
    const double ev = image_exposure(reference, WIDTH, HEIGHT);
    CHECK(image_measure(image, reference, WIDTH, HEIGHT, ev, &same, NULL));
    CHECK(memcmp(&own, &same, sizeof(own)) == 0);
}

TEST(percentiles_are_of_the_map)
{
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        reference[i] = 1;
        image[i] = i / 3 % WIDTH < 3 ? 4 : 1; // an eighth of the picture
    }
    float flip[PIXELS], difference[PIXELS];
    image_maps maps = {.flip = flip, .difference = difference};
    image_measures m;
    CHECK(image_measure(image, reference, WIDTH, HEIGHT, NAN, &m, &maps));
    double sum = 0;
    size_t above_p95 = 0, above_p99 = 0;
    for (size_t i = 0; i < PIXELS; i++) {
        sum += (double)flip[i];
        above_p95 += (double)flip[i] > m.flip_p95;
        above_p99 += (double)flip[i] > m.flip_p99;
        CHECK_NEAR((double)difference[i], i % WIDTH < 3 ? 3 : 0, 1e-6);
    }
    CHECK_NEAR(m.flip_mean, sum / PIXELS, 1e-9);
    CHECK(above_p95 <= PIXELS * 5 / 100 + 1 && above_p99 <= PIXELS / 100 + 1);
    CHECK(m.flip_mean < m.flip_p95 && m.flip_p95 <= m.flip_p99);
}

TEST(the_difference_map_is_signed_and_relative_to_the_mean)
{
    float flip[PIXELS], difference[PIXELS];
    image_maps maps = {.flip = flip, .difference = difference};
    image_measures m;
    for (size_t i = 0; i < 3 * PIXELS; i++) {
        reference[i] = i / 3 % 2 ? 1 : 3; // mean 2
        image[i] = 2;
    }
    CHECK(image_measure(image, reference, WIDTH, HEIGHT, NAN, &m, &maps));
    CHECK_NEAR((double)difference[0], -0.5, 1e-6);
    CHECK_NEAR((double)difference[1], 0.5, 1e-6);
}

// ---- Tables

TEST(every_measure_is_in_the_table_once)
{
    uint32_t count;
    const image_measure_info *const table = image_measure_table(&count);
    CHECK(count * sizeof(double) == sizeof(image_measures));
    for (uint32_t i = 0; i < count; i++) {
        CHECK(table[i].offset == i * sizeof(double) && table[i].help[0]);
    }
    CHECK_STRING(table[0].name, "relative_l2");
    CHECK_STRING(table[count - 1].name, "hdr_flip_p99");
}

TEST(sequential_colours_get_brighter)
{
    double last = -1;
    for (int i = 0; i <= 100; i++) {
        uint8_t rgb[3];
        color_map_sequential((float)i / 100, rgb);
        const double luma = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
        CHECK(luma > last);
        last = luma;
    }
    uint8_t low[3], high[3], below[3], above[3], none[3];
    color_map_sequential(0, low);
    color_map_sequential(1, high);
    color_map_sequential(-INFINITY, below);
    color_map_sequential(INFINITY, above);
    color_map_sequential(NAN, none);
    CHECK(memcmp(low, below, 3) == 0 && memcmp(low, none, 3) == 0 && memcmp(high, above, 3) == 0);
}

TEST(diverging_colours_go_from_blue_over_white_to_red)
{
    uint8_t low[3], middle[3], high[3];
    color_map_diverging(0, low);
    color_map_diverging(0.5f, middle);
    color_map_diverging(1, high);
    CHECK(low[2] > 2 * low[0] && high[0] > 2 * high[2]);
    CHECK(middle[0] > 230 && middle[0] == middle[1] && middle[1] == middle[2]);
}

int main(void)
{
    log_sink_set(remember_errors, NULL);
    RUN(a_factor_k_has_relative_l2_of_k_minus_one_and_energy_k);
    RUN(relative_mse_of_a_plain_reference);
    RUN(relative_mse_does_not_depend_on_the_unit);
    RUN(energy_is_of_luminance);
    RUN(equal_images_have_no_error);
    RUN(against_black_the_relative_errors_are_infinite_and_never_nan);
    RUN(what_is_not_finite_is_refused_with_its_place);
    RUN(every_shown_value_comes_from_its_radiance);
    RUN(extreme_radiance_is_shown_as_black_or_white);
    RUN(psnr_of_pictures_a_step_apart);
    RUN(exposure_puts_the_log_average_at_middle_grey);
    RUN(both_pictures_are_shown_at_the_reference_s_exposure);
    RUN(percentiles_are_of_the_map);
    RUN(the_difference_map_is_signed_and_relative_to_the_mean);
    RUN(every_measure_is_in_the_table_once);
    RUN(sequential_colours_get_brighter);
    RUN(diverging_colours_go_from_blue_over_white_to_red);
    return test_end();
}
