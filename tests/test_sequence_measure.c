// The measures over time on sequences whose measure is known.
#include "modules/sequence_measure.h"

#include "test.h"

enum { WIDTH = 20, HEIGHT = 12, PIXELS = WIDTH * HEIGHT, FRAMES = 32 };
typedef float picture[3 * PIXELS];

static picture frames[FRAMES], references[FRAMES];

static void fill(float *image, float value)
{
    for (size_t i = 0; i < 3 * PIXELS; i++)
        image[i] = value;
}

// Any picture that is not flat.
static void pattern(float *image, float scale)
{
    for (size_t i = 0; i < 3 * PIXELS; i++)
        image[i] = scale * (0.1f + (float)(i * 7919 % 100) / 100);
}

static double deviation_of(uint32_t count)
{
    const float *list[FRAMES];
    for (uint32_t f = 0; f < count; f++)
        list[f] = frames[f];
    return sequence_deviation(list, count, WIDTH, HEIGHT, NULL);
}

TEST(what_does_not_change_has_no_deviation)
{
    for (uint32_t f = 0; f < FRAMES; f++)
        pattern(frames[f], 0.3f);
    CHECK(deviation_of(FRAMES) == 0);
    memset(frames, 0, sizeof frames);
    CHECK(deviation_of(FRAMES) == 0); // no light at all
}

TEST(deviation_of_an_alternation_is_its_amplitude)
{
    for (uint32_t f = 0; f < FRAMES; f++)
        pattern(frames[f], f % 2 ? 1.1f : 0.9f);
    CHECK_NEAR(deviation_of(FRAMES), 0.1, 1e-6);
}

TEST(deviation_of_one_pixel_counts_by_its_share)
{
    float map[PIXELS];
    const float *list[FRAMES];
    for (uint32_t f = 0; f < FRAMES; f++) {
        fill(frames[f], 2);
        for (int k = 0; k < 3; k++)
            frames[f][3 * 17 + k] = f % 2 ? 3 : 1;
        list[f] = frames[f];
    }
    CHECK_NEAR(sequence_deviation(list, FRAMES, WIDTH, HEIGHT, map), 0.5 / PIXELS, 1e-9);
    for (uint32_t i = 0; i < PIXELS; i++)
        CHECK_NEAR(map[i], i == 17 ? 0.5 : 0, 1e-7);
}

static double flicker_at(uint32_t f)
{
    return sequence_flicker(frames[f], frames[f - 1], references[f], references[f - 1], WIDTH, HEIGHT, NULL);
}

TEST(a_sequence_that_changes_as_the_reference_does_not_flicker)
{
    for (uint32_t f = 0; f < 4; f++) {
        fill(references[f], 1.0f + (float)f);
        fill(frames[f], 3.5f + (float)f); // too bright, and steadily so
    }
    for (uint32_t f = 1; f < 4; f++)
        CHECK_NEAR(flicker_at(f), 0, 1e-6);
}

TEST(noise_flickers_by_its_difference)
{
    for (uint32_t f = 0; f < 4; f++) {
        fill(references[f], 2);
        fill(frames[f], f % 2 ? 2.1f : 1.9f);
    }
    CHECK_NEAR(flicker_at(1), 0.1, 1e-6);
    CHECK_NEAR(flicker_at(2), 0.1, 1e-6);
}

// The reference steps from 1 to 2; the image goes a tenth of the way in each frame.
TEST(lag_flickers_while_it_catches_up)
{
    float value = 1;
    for (uint32_t f = 0; f < 4; f++) {
        fill(references[f], f == 0 ? 1 : 2);
        value += f == 0 ? 0 : 0.1f * (2 - value);
        fill(frames[f], value);
    }
    CHECK_NEAR(flicker_at(1), 0.9 / 2, 1e-6);
    CHECK_NEAR(flicker_at(2), 0.09 / 2, 1e-6);
}

// What has moved on leaves half of its light in the pixels behind.
TEST(a_ghost_flickers_where_it_is)
{
    float map[PIXELS];
    for (uint32_t f = 0; f < 2; f++) {
        fill(references[f], 1);
        for (int k = 0; k < 3; k++)
            references[f][3 * (100 + f) + k] = 5;
        memcpy(frames[f], references[f], sizeof(picture));
    }
    for (int k = 0; k < 3; k++)
        frames[1][3 * 100 + k] += 2;
    const double mean = 1 + 4.0 / PIXELS;
    CHECK_NEAR(sequence_flicker(frames[1], frames[0], references[1], references[0], WIDTH, HEIGHT, map),
               2 / mean / PIXELS, 1e-7);
    for (uint32_t i = 0; i < PIXELS; i++)
        CHECK_NEAR(map[i], i == 100 ? 2 / mean : 0, 1e-6);
}

TEST(flicker_without_light_in_the_reference_is_infinite_or_none)
{
    memset(frames, 0, sizeof frames);
    memset(references, 0, sizeof references);
    CHECK(flicker_at(1) == 0);
    fill(frames[1], 1);
    CHECK(isinf(flicker_at(1)));
}

TEST(noise_within_blocks_is_no_distance)
{
    fill(references[0], 1);
    for (size_t i = 0; i < PIXELS; i++)
        for (int k = 0; k < 3; k++) // a checkerboard
            frames[0][3 * i + k] = (i % WIDTH + i / WIDTH) % 2 ? 1.5f : 0.5f;
    const sequence_distance d = sequence_distance_to(frames[0], references[0], WIDTH, HEIGHT);
    CHECK_NEAR(d.mean, 0, 1e-6);
    CHECK_NEAR(d.blocks, 0, 1e-6);
    CHECK_NEAR(d.blocks_within, 1, 0);
}

TEST(distance_of_one_wrong_block)
{
    fill(references[0], 1);
    fill(frames[0], 1);
    for (uint32_t y = 0; y < 8; y++)
        for (uint32_t x = 8; x < 16; x++)
            for (int k = 0; k < 3; k++)
                frames[0][3 * (y * WIDTH + x) + k] = 1.5f;
    const sequence_distance d = sequence_distance_to(frames[0], references[0], WIDTH, HEIGHT);
    CHECK_NEAR(d.mean, 0.5 * 64 / PIXELS, 1e-6);
    CHECK_NEAR(d.blocks, sqrt(0.25 / 6), 1e-6); // 3 x 2 blocks
    CHECK_NEAR(d.blocks_within, 5.0 / 6, 1e-9);
}

// An exponential average with a share of 1/4 in each frame after a switch: 0.75^n is within 5 % from n = 11 on.
TEST(a_known_lag_settles_when_it_should)
{
    double values[FRAMES];
    for (uint32_t f = 0; f < FRAMES; f++) {
        fill(references[0], 1);
        fill(frames[f], 1 - powf(0.75f, (float)f));
        values[f] = sequence_distance_to(frames[f], references[0], WIDTH, HEIGHT).blocks;
    }
    CHECK(sequence_settled_after(values, FRAMES, 0.05) == 11);
}

TEST(settling_is_for_good)
{
    const double values[] = {0.5, 0.01, 0.2, 0.04, 0.03};
    CHECK(sequence_settled_after(values, 5, 0.05) == 3);
    CHECK(sequence_settled_after(values, 3, 0.05) == 3);
    CHECK(sequence_settled_after(values, 5, 1) == 0);
}

int main(void)
{
    RUN(what_does_not_change_has_no_deviation);
    RUN(deviation_of_an_alternation_is_its_amplitude);
    RUN(deviation_of_one_pixel_counts_by_its_share);
    RUN(a_sequence_that_changes_as_the_reference_does_not_flicker);
    RUN(noise_flickers_by_its_difference);
    RUN(lag_flickers_while_it_catches_up);
    RUN(a_ghost_flickers_where_it_is);
    RUN(flicker_without_light_in_the_reference_is_infinite_or_none);
    RUN(noise_within_blocks_is_no_distance);
    RUN(distance_of_one_wrong_block);
    RUN(a_known_lag_settles_when_it_should);
    RUN(settling_is_for_good);
    return test_end();
}
