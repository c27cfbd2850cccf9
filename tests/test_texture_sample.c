// Texture reads on the CPU: wrapping and filtering in cases that can be worked out by hand.
#include "modules/texture_sample.h"
#include "test.h"

enum { NEAREST = 9728, LINEAR = 9729, REPEAT = 10497, CLAMP = 33071, MIRROR = 33648 };

// 4x1 texels with alpha 0, 51, 102, 255 (0, 0.2, 0.4, 1).
static uint8_t texels[16] = {0, 0, 0, 0, 1, 0, 0, 51, 2, 0, 0, 102, 3, 0, 0, 255};
static scene_image image = {.width = 4, .height = 1, .texels = texels};
static const scene_data scene = {.images = &image, .image_count = 1};

static double alpha_at(double u, double v, int filter, int wrap)
{
    const scene_texture texture = {.mag_filter = filter, .wrap_s = wrap, .wrap_t = wrap};
    return (double)texture_alpha(&scene, &texture, (float[2]){(float)u, (float)v});
}

TEST(nearest_takes_the_texel_that_holds_the_point)
{
    CHECK_NEAR(alpha_at(0.01, 0.5, NEAREST, REPEAT), 0, 0);
    CHECK_NEAR(alpha_at(0.26, 0.5, NEAREST, REPEAT), 0.2, 1e-6);
    CHECK_NEAR(alpha_at(0.74, 0.5, NEAREST, REPEAT), 0.4, 1e-6);
    CHECK_NEAR(alpha_at(0.99, 0.5, NEAREST, REPEAT), 1, 0);
}

TEST(outside_of_the_texture_it_is_wrapped)
{
    CHECK_NEAR(alpha_at(-0.3, 7.5, NEAREST, REPEAT), 0.4, 1e-6);
    CHECK_NEAR(alpha_at(5.3, -3, NEAREST, REPEAT), 0.2, 1e-6);
    CHECK_NEAR(alpha_at(-0.3, 0.5, NEAREST, MIRROR), 0.2, 1e-6);
    CHECK_NEAR(alpha_at(1.3, 0.5, NEAREST, MIRROR), 0.4, 1e-6);
    CHECK_NEAR(alpha_at(2.3, 0.5, NEAREST, MIRROR), 0.2, 1e-6);
    CHECK_NEAR(alpha_at(-3, 0.5, NEAREST, CLAMP), 0, 0);
    CHECK_NEAR(alpha_at(9, 0.5, NEAREST, CLAMP), 1, 0);
    CHECK_NEAR(alpha_at(0.3, 0.5, NEAREST, 0), 0.2, 1e-6); // glTF's default repeats
    CHECK_NEAR(alpha_at(1.3, 0.5, NEAREST, 0), 0.2, 1e-6);
}

TEST(linear_blends_texel_centres)
{
    CHECK_NEAR(alpha_at(0.375, 0.5, LINEAR, REPEAT), 0.2, 1e-6);
    CHECK_NEAR(alpha_at(0.5, 0.5, LINEAR, REPEAT), 0.3, 1e-6);
    CHECK_NEAR(alpha_at(0.6875, 0.5, 0, REPEAT), 0.55, 1e-6); // linear is the default; a quarter of the way to 1
    CHECK_NEAR(alpha_at(0, 0.5, LINEAR, REPEAT), 0.5, 1e-6); // half of each end
    CHECK_NEAR(alpha_at(0, 0.5, LINEAR, CLAMP), 0, 1e-6);
    CHECK_NEAR(alpha_at(1, 0.5, LINEAR, MIRROR), 1, 1e-6);
    CHECK_NEAR(alpha_at(-0.125, 0.2, LINEAR, MIRROR), 0, 1e-6);
}

TEST(coordinates_without_sense_read_something)
{
    static const float odd[] = {NAN, INFINITY, -INFINITY, 1e30f, -1e30f, -1e-9f};
    static const int wraps[] = {0, REPEAT, CLAMP, MIRROR};
    for (size_t w = 0; w < countof(wraps); w++)
        for (size_t i = 0; i < countof(odd); i++) {
            const double nearest = alpha_at((double)odd[i], (double)odd[i], NEAREST, wraps[w]);
            const double linear = alpha_at((double)odd[i], (double)odd[i], LINEAR, wraps[w]);
            CHECK(nearest >= 0 && nearest <= 1 && linear >= 0 && linear <= 1);
        }
}

TEST(an_image_that_could_not_be_read_is_solid)
{
    scene_image none = {.width = 4, .height = 4};
    const scene_data empty = {.images = &none, .image_count = 1};
    const scene_texture texture = {0};
    const float uv[2] = {0.5f, 0.5f};
    CHECK(texture_alpha(&empty, &texture, uv) == 1);
    CHECK(texture_texel(&empty, &texture, uv) == NULL);
}

TEST(vertices_are_read_through_their_uv_set_and_transform)
{
    const vertex_attributes vertex = {.uv0 = {2, 3}, .uv1 = {5, 7}};
    const texture_reference reference = {.uv_set = 1, .transform = {0, 1, -1, 0}, .offset = {0.5f, 0.25f}};
    float uv[2];
    texture_vertex_uv(&reference, &vertex, uv); // turned by a quarter: (5, 7) -> (-7, 5)
    CHECK(uv[0] == -6.5f && uv[1] == 5.25f);
}

int main(void)
{
    RUN(nearest_takes_the_texel_that_holds_the_point);
    RUN(outside_of_the_texture_it_is_wrapped);
    RUN(linear_blends_texel_centres);
    RUN(coordinates_without_sense_read_something);
    RUN(an_image_that_could_not_be_read_is_solid);
    RUN(vertices_are_read_through_their_uv_set_and_transform);
    return test_end();
}
