// The budget of shadow rays: it is met, does not bias, and spends nothing where there is no light.
#include "test.h"

#include "modules/renderer.h"

#include <math.h>

#define SCENE BUILD_DIR "/scenes/cornell.glb"

enum { WIDTH = 96, HEIGHT = 54, PIXELS = WIDTH * HEIGHT };

static gpu *device;

typedef float texel[4];

typedef struct fixture {
    scene_data *scene;
    renderer *r;
} fixture;

// From outside, so that there is background beside the box.
static fixture fixture_create(uint32_t samples, float budget, const char *const *exports, uint32_t export_count)
{
    render_settings s = render_settings_default();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.vpls = 2000;
    s.shadow_samples = samples;
    s.ray_budget = budget;
    fixture f = {.scene = scene_load(SCENE)};
    if (f.scene)
        f.r = renderer_create(device, f.scene, &s);
    if (!f.r) {
        printf("cannot set up " SCENE "\n");
        exit(EXIT_FAILURE);
    }
    f.r->camera = renderer_camera_of_scene(f.r, SCENE_NONE);
    for (uint32_t i = 0; i < export_count; i++)
        f.r->exports[f.r->export_count++] = exports[i];
    return f;
}

static void fixture_destroy(fixture *f)
{
    renderer_destroy(f->r);
    scene_destroy(f->scene);
}

static void image_read(renderer *r, const char *name, texel *texels)
{
    const gpu_image image = frame_graph_find_image(r->graph, name);
    CHECK(image.id &&
          gpu_image_read(device, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, PIXELS * sizeof *texels));
}

static uint32_t rays_traced(renderer *r)
{
    return *(const uint32_t *)gpu_buffer_map(device, frame_graph_find_buffer(r->graph, "rays_shadow"));
}

TEST(budget_is_met)
{
    static const char *const exports[] = {"rays_shadow"};
    static const float budgets[] = {0.05f, 0.1f, 0.3f};
    enum { SETTLING = 12, FRAMES = 16 }; // at first every pixel is new and has at least one sample
    for (size_t i = 0; i < countof(budgets); i++) {
        fixture f = fixture_create(4, budgets[i], exports, countof(exports));
        uint32_t rays = 0, first = 0;
        for (int frame = 0; frame < SETTLING + FRAMES; frame++) {
            CHECK(renderer_frame(f.r));
            first = frame == 0 ? rays_traced(f.r) : first;
            rays += frame >= SETTLING ? rays_traced(f.r) : 0;
        }
        const double average = (double)rays / (FRAMES * PIXELS);
        printf("  %g rays a pixel: %.4f, in the first frame %.3f\n", (double)budgets[i], average,
               (double)first / PIXELS);
        CHECK_NEAR(average / (double)budgets[i], 1, 0.03);
        fixture_destroy(&f);
    }
}

TEST(pixels_without_light_have_no_rays)
{
    static const char *const exports[] = {"rays_shadow", "shadow_origins", "indirect", "shadow_u"};
    static texel indirect[PIXELS], unshadowed[PIXELS], origins[PIXELS];
    for (int budget = 0; budget < 2; budget++) {
        fixture f = fixture_create(1, budget ? 0.1f : 0, exports, countof(exports));
        uint32_t dark = 0, rays = 0, missing = 0;
        for (int frame = 0; frame < 12; frame++)
            CHECK(renderer_frame(f.r));
        image_read(f.r, "indirect", indirect);
        image_read(f.r, "shadow_u", unshadowed);
        const gpu_buffer buffer = frame_graph_find_buffer(f.r->graph, "shadow_origins");
        CHECK(gpu_buffer_read(device, buffer, 0, origins, sizeof origins));
        for (uint32_t i = 0; i < PIXELS; i++) {
            const bool ray = origins[i][3] > 0, light = indirect[i][3] > 0;
            CHECK(light || (!ray && unshadowed[i][3] == 0));
            CHECK(unshadowed[i][3] == 0 || (!ray && unshadowed[i][0] == 0));
            dark += !light;
            rays += ray;
            missing += unshadowed[i][3] != 0;
        }
        CHECK(dark > PIXELS / 10 && rays > 0 && rays == rays_traced(f.r));
        CHECK(budget ? missing > PIXELS / 50 : missing == 0);
        fixture_destroy(&f);
    }
}

typedef struct mean {
    double light; // sum over the pixels of their mean over the frames
    double square_error; // of that
} mean;

// Of `shadow_u` and `shadow_s`.
static void means_of(uint32_t samples, float budget, mean means[2])
{
    enum { FRAMES = 72, SETTLING = 12 };
    static const char *const exports[] = {"shadow_u", "shadow_s"};
    static texel estimates[2][PIXELS];
    static double sum[2][PIXELS], squares[2][PIXELS], count[PIXELS];
    memset(sum, 0, sizeof sum);
    memset(squares, 0, sizeof squares);
    memset(count, 0, sizeof count);
    fixture f = fixture_create(samples, budget, exports, countof(exports));
    for (int frame = 0; frame < FRAMES; frame++) {
        CHECK(renderer_frame(f.r));
        for (int k = 0; k < 2; k++)
            image_read(f.r, exports[k], estimates[k]);
        for (uint32_t i = 0; i < PIXELS && frame >= SETTLING; i++) {
            const bool sampled = estimates[0][i][3] == 0;
            count[i] += sampled;
            for (int k = 0; k < 2 && sampled; k++) {
                const double value = (double)estimates[k][i][1];
                sum[k][i] += value;
                squares[k][i] += value * value;
            }
        }
    }
    fixture_destroy(&f);
    for (int k = 0; k < 2; k++) {
        means[k] = (mean){0};
        for (uint32_t i = 0; i < PIXELS; i++) {
            CHECK(count[i] >= 2); // in 60 frames: the least is 0.0375 samples a frame
            const double average = sum[k][i] / count[i];
            means[k].light += average;
            means[k].square_error += fmax(squares[k][i] / count[i] - average * average, 0) / (count[i] - 1);
        }
    }
}

// Estimates of pixels with a sample, however many samples they use, have the mean of one sample at every pixel.
TEST(budget_does_not_bias)
{
    mean full[2], sparse[2];
    means_of(1, 0, full);
    means_of(4, 0.15f, sparse);
    for (int k = 0; k < 2; k++) {
        const double error = sqrt(full[k].square_error + sparse[k].square_error);
        printf("  %s: %.1f, with a budget %.1f, standard error %.1f\n", k ? "S" : "U", full[k].light, sparse[k].light,
               error);
        CHECK(error < 0.015 * full[k].light); // measured: 0.008 and 0.010
        CHECK(fabs(full[k].light - sparse[k].light) < 4 * error);
    }
}

TEST(two_runs_give_the_same_bytes)
{
    static const char *const exports[] = {"radiance"};
    static texel pictures[2][PIXELS];
    for (int run = 0; run < 2; run++) {
        fixture f = fixture_create(2, 0.2f, exports, countof(exports));
        f.r->settings.interleave = 2;
        for (int frame = 0; frame < 11; frame++)
            CHECK(renderer_frame(f.r));
        image_read(f.r, "radiance", pictures[run]);
        fixture_destroy(&f);
    }
    CHECK(memcmp(pictures[0], pictures[1], sizeof pictures[0]) == 0);
}

static char last_error[256];

static void error_keep(log_level level, const char *line, void *user)
{
    (void)user;
    if (level == LOG_ERROR)
        snprintf(last_error, sizeof last_error, "%s", line);
}

TEST(budget_is_refused_without_the_filter)
{
    fixture f = fixture_create(1, 0.5f, NULL, 0);
    f.r->settings.filter = false;
    log_sink_set(error_keep, NULL);
    CHECK(!renderer_frame(f.r));
    log_sink_set(NULL, NULL);
    CHECK(strstr(last_error, "--ray-budget 0.5") && strstr(last_error, "--no-filter"));
    f.r->settings.ray_budget = 0;
    CHECK(renderer_frame(f.r));
    fixture_destroy(&f);
}

TEST(validation_layer_is_silent)
{
    CHECK(gpu_validation_messages(device) == 0);
}

int main(void)
{
    device = gpu_create(&(gpu_desc){.validation = true});
    if (!device) {
        printf("skipped: no device with the validation layer\n");
        return 77;
    }
    RUN(budget_is_met);
    RUN(pixels_without_light_have_no_rays);
    RUN(budget_does_not_bias);
    RUN(two_runs_give_the_same_bytes);
    RUN(budget_is_refused_without_the_filter);
    RUN(validation_layer_is_silent);
    gpu_destroy(device);
    return test_end();
}
