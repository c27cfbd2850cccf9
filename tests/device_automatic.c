// Probe pixels against brute force, and automatic settings in the renderer.
#include "brute_force.h"
#include "test.h"

#include "modules/automatic_system.h"
#include "modules/probe.h"

#include "test_shaders_shaders.h"

enum { SIZE = 40, PIXELS = SIZE * SIZE, FRAMES = 40 };

static gpu *device;
static scene_data *cornell;

// ---- Helpers

static render_settings small_settings(uint32_t vpls)
{
    render_settings s = render_settings_default();
    s.width = s.height = SIZE;
    s.vpls = vpls;
    s.only = ONLY_INDIRECT;
    return s;
}

static renderer *renderer_of(const render_settings *settings)
{
    renderer *r = renderer_create(device, cornell, settings);
    if (!r) {
        printf("cannot set up a renderer\n");
        exit(EXIT_FAILURE);
    }
    return r;
}

static void export_add(renderer *r, const char *name)
{
    r->exports[r->export_count++] = name;
}

// Whole; free() it.
static void *image_read(renderer *r, const char *name)
{
    const gpu_image image = frame_graph_find_image(r->graph, name);
    const size_t size = (size_t)PIXELS * gpu_format_size(gpu_image_info(device, image)->format);
    void *texels = memory_alloc(size);
    CHECK(gpu_image_read(device, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, size));
    return texels;
}

// Radiance of the sum over all VPLs: brute force times albedo. Renders a frame.
typedef struct truth {
    float (*radiance)[3];
} truth;

static truth truth_make(renderer *r, const gpu_shader *shader)
{
    brute_force_add(r, shader);
    export_add(r, "brute_force");
    export_add(r, "albedo");
    CHECK(renderer_frame(r));
    float *light = image_read(r, "brute_force");
    uint16_t *albedo = image_read(r, "albedo");
    truth t = {memory_alloc(sizeof(float[3]) * PIXELS)};
    for (size_t i = 0; i < PIXELS; i++)
        for (int c = 0; c < 3; c++)
            t.radiance[i][c] = light[4 * i + c] * (float)albedo[4 * i + c] / 65535.0f;
    free(light);
    free(albedo);
    r->export_count = 0; // what nobody reads is not made again
    return t;
}

static size_t pixel_of(const probe *p)
{
    CHECK(p->x < SIZE && p->y < SIZE);
    return (size_t)p->y * SIZE + p->x;
}

// ---- Probes

static void check_probes(bool taa, uint32_t taa_target)
{
    render_settings settings = small_settings(3000);
    settings.interleave = 2;
    settings.taa = taa;
    settings.taa_target = taa_target;
    renderer *r = renderer_of(&settings);
    r->probes = true;
    const truth t = truth_make(r, &shader_brute_force_comp);
    float *radiance = image_read(r, "radiance");
    uint32_t count;
    const probe *probes = probe_results(r, &count);
    CHECK(count == probe_count(r) && count >= 8);
    uint32_t lit = 0;
    for (uint32_t i = 0; i < count; i++) {
        const size_t pixel = pixel_of(&probes[i]);
        for (int c = 0; c < 3; c++) {
            const double expected = (double)t.radiance[pixel][c], shown = (double)radiance[4 * pixel + c];
            CHECK_NEAR((double)probes[i].unshadowed[c], expected, 1e-4 * expected);
            CHECK_NEAR((double)probes[i].shown[c], shown, 1e-5 * shown);
            lit += expected > 0;
        }
    }
    CHECK(lit > count);
    free(t.radiance);
    free(radiance);
    renderer_destroy(r);
}

TEST(probes_sum_every_vpl_and_see_what_is_shown)
{
    check_probes(true, TAA_RATIO);
    check_probes(true, TAA_LIGHT);
    check_probes(false, TAA_RATIO);
}

// Mean of a series, and by how many of its standard errors it is off what is expected.
typedef struct series {
    double count, sum, squares;
} series;

static void series_add(series *s, double value)
{
    s->count++;
    s->sum += value;
    s->squares += value * value;
}

static double series_sigmas(const series *s)
{
    const double mean = s->sum / s->count, variance = s->squares / s->count - mean * mean;
    return mean / sqrt(variance / s->count);
}

TEST(probe_estimates_are_unbiased_and_independent_and_tell_the_error)
{
    const render_settings settings = small_settings(1500);
    renderer *r = renderer_of(&settings);
    r->probes = true;
    const truth t = truth_make(r, &shader_brute_force_shadowed_comp);
    series first = {0}, second = {0}, product = {0};
    automatic_probes sums = {0};
    double error = 0, light = 0;
    for (uint32_t frame = 0; frame < FRAMES; frame++) {
        CHECK(renderer_frame(r));
        uint32_t count;
        const probe *probes = probe_results(r, &count);
        for (uint32_t i = 0; i < count; i++) {
            const float *expected = t.radiance[pixel_of(&probes[i])];
            double off[2];
            for (int k = 0; k < 2; k++)
                off[k] =
                    (double)probes[i].shadowed[k][0][1] + (double)probes[i].shadowed[k][1][1] - (double)expected[1];
            series_add(&first, off[0]);
            series_add(&second, off[1]);
            series_add(&product, off[0] * off[1]);
        }
        automatic_probes more = probe_sums(probes, count);
        automatic_probes_add(&sums, &more);
        float *radiance = image_read(r, "radiance");
        for (size_t i = 0; i < PIXELS; i++)
            for (int c = 0; c < 3; c++) {
                const double truth = (double)t.radiance[i][c], difference = (double)radiance[4 * i + c] - truth;
                error += difference * difference;
                light += truth * truth;
            }
        free(radiance);
    }
    CHECK_NEAR(series_sigmas(&first), 0, 4);
    CHECK_NEAR(series_sigmas(&second), 0, 4);
    CHECK_NEAR(series_sigmas(&product), 0, 4);
    // Against these very VPLs, so without what their own noise adds.
    double standard_error;
    automatic_probes_error(&sums, &standard_error);
    const double estimate = sqrt(sums.shadows / sums.light), actual = sqrt(error / light);
    printf("  error %.4f, estimated %.4f +- %.4f, and the VPLs' own %.4f\n", actual, estimate, standard_error,
           sqrt(fmax(0, sums.vpls / sums.light)));
    CHECK_NEAR(estimate, actual, 3 * standard_error);
    CHECK(standard_error < 0.2 * actual);
    CHECK(sums.vpls > 0);
    free(t.radiance);
    renderer_destroy(r);
}

// ---- In the renderer

static void check_finite(renderer *r)
{
    float *radiance = image_read(r, "radiance");
    double sum = 0;
    for (size_t i = 0; i < PIXELS; i++)
        for (int c = 0; c < 3; c++)
            sum += (double)radiance[4 * i + c];
    CHECK(isfinite(sum) && sum > 0);
    free(radiance);
}

TEST(what_is_chosen_may_change_in_every_frame)
{
    static const struct {
        uint32_t vpls, interleave, samples;
        float alpha;
    } choices[] = {{61, 1, 1, 1}, {9000, 4, 2, 2}, {8, 2, 1, 4}, {20000, 1, 4, 1.5f}, {8, 4, 1, 1}};
    render_settings settings = small_settings(1000);
    renderer *r = renderer_of(&settings);
    for (size_t i = 0; i < countof(choices); i++) {
        r->settings.vpls = choices[i].vpls;
        r->settings.interleave = choices[i].interleave;
        r->settings.shadow_samples = choices[i].samples;
        r->settings.alpha = choices[i].alpha;
        CHECK(renderer_frame(r));
        check_finite(r);
    }
    renderer_destroy(r);
}

TEST(eight_vpls_build_few_levels)
{
    const render_settings settings = small_settings(8);
    renderer *r = renderer_of(&settings);
    export_add(r, "lgh_header");
    CHECK(renderer_frame(r));
    lgh_header header = {0};
    CHECK(gpu_buffer_read(device, frame_graph_find_buffer(r->graph, "lgh_header"), 0, &header, sizeof header));
    CHECK(header.level_count >= 1 && header.level_count <= 2);
    renderer_destroy(r);
}

typedef struct outcome {
    render_settings settings;
    uint32_t frames;
    float *radiance;
} outcome;

static outcome settle(const render_settings *settings)
{
    renderer *r = renderer_of(settings);
    do
        CHECK(renderer_frame(r));
    while (!r->failed && !automatic_get(r)->settled && r->frame < 600);
    const automatic *a = automatic_get(r);
    CHECK(a->settled);
    CHECK_NEAR(automatic_probes_error(&a->probes, NULL), a->target_error, 0.3 * a->target_error);
    check_finite(r);
    const outcome o = {r->settings, r->frame, image_read(r, "radiance")};
    renderer_destroy(r);
    return o;
}

TEST(target_error_settles_the_same_way_every_time)
{
    render_settings settings = small_settings(500);
    settings.target_error = 0.15f;
    const outcome a = settle(&settings), b = settle(&settings);
    CHECK(a.settings.vpls > 500);
    CHECK(a.frames == b.frames);
    CHECK(a.settings.vpls == b.settings.vpls && a.settings.alpha == b.settings.alpha &&
          a.settings.interleave == b.settings.interleave && a.settings.shadow_samples == b.settings.shadow_samples &&
          a.settings.ray_budget == b.settings.ray_budget);
    CHECK(memcmp(a.radiance, b.radiance, sizeof(float[4]) * PIXELS) == 0);
    free(a.radiance);
    free(b.radiance);
}

TEST(automatic_settings_follow_whom_they_belong_to)
{
    render_settings settings = small_settings(1000);
    renderer *r = renderer_of(&settings);
    CHECK(renderer_frame(r));
    CHECK(!automatic_get(r));
    r->settings.target_ms = 50;
    CHECK(renderer_frame(r));
    CHECK(automatic_get(r) && automatic_get(r)->frame == 0);
    CHECK(renderer_frame(r));
    CHECK(automatic_get(r)->frame == 1);
    r->settings.vpls = 2000; // by hand: starts anew from there
    CHECK(renderer_frame(r));
    CHECK(automatic_get(r)->frame == 0 && automatic_get(r)->current.vpls == 2000);
    r->settings.target_ms = 0;
    CHECK(renderer_frame(r));
    CHECK(!automatic_get(r));
    uint32_t count;
    CHECK(!probe_results(r, &count) && count == 0);
    renderer_destroy(r);
}

// Budgets below a ray a pixel go by what the filter knows.
TEST(what_is_chosen_without_the_filter_can_be_rendered)
{
    render_settings settings = small_settings(1000);
    settings.filter = false;
    settings.target_ms = 0.1f; // the cheapest there is
    renderer *r = renderer_of(&settings);
    while (r->frame < 30 && !r->failed)
        renderer_frame(r);
    CHECK(!r->failed && automatic_get(r)->current.vpls < 1000);
    renderer_destroy(r);
}

// At rest passes are left out: what is measured then says nothing of what settings cost.
TEST(a_picture_at_rest_keeps_its_settings)
{
    render_settings settings = small_settings(1000);
    settings.target_error = 0.9f;
    renderer *r = renderer_of(&settings);
    while (r->frame < 600 && !renderer_is_settled(r))
        CHECK(renderer_frame(r));
    CHECK(renderer_is_settled(r));
    const uint32_t frame = automatic_get(r)->frame;
    for (int i = 0; i < 5; i++)
        CHECK(renderer_frame(r));
    CHECK(automatic_get(r)->frame == frame && renderer_is_settled(r));
    renderer_destroy(r);
}

TEST(validation_layer_is_silent)
{
    CHECK(gpu_validation_messages(device) == 0);
}

int main(void)
{
    device = gpu_create(&(gpu_desc){.validation = true});
    if (!device) {
        printf("no device with a validation layer\n");
        return 77;
    }
    cornell = scene_load(BUILD_DIR "/scenes/cornell.glb");
    if (!cornell)
        return EXIT_FAILURE;
    RUN(probes_sum_every_vpl_and_see_what_is_shown);
    RUN(probe_estimates_are_unbiased_and_independent_and_tell_the_error);
    RUN(what_is_chosen_may_change_in_every_frame);
    RUN(eight_vpls_build_few_levels);
    RUN(target_error_settles_the_same_way_every_time);
    RUN(automatic_settings_follow_whom_they_belong_to);
    RUN(what_is_chosen_without_the_filter_can_be_rendered);
    RUN(a_picture_at_rest_keeps_its_settings);
    RUN(validation_layer_is_silent);
    scene_destroy(cornell);
    gpu_destroy(device);
    return test_end();
}
