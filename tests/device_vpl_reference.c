// The references made of VPLs, `vpl` and `ir`, against sums on the CPU, an independent shader, the lighting grid
// hierarchy and path tracing.
//
//     device_vpl_reference               the tests
//     device_vpl_reference bias [VPLS]   error against path tracing by the singularity b, cornell, 64x64
#include "brute_force.h"
#include "test.h"

#include "modules/progressive.h"
#include "modules/renderer.h"
#include "modules/rays.h"
#include "modules/world.h"

#include "test_shaders_shaders.h"

#include <unistd.h>

#define SCENES BUILD_DIR "/scenes/"

static gpu *device;

// ---- Helpers

typedef struct fixture {
    scene_data *scene;
    renderer *r;
} fixture;

static fixture fixture_create(const char *path, const char *camera, const render_settings *settings)
{
    fixture f = {.scene = scene_load(path)};
    if (f.scene)
        f.r = renderer_create(device, f.scene, settings);
    if (!f.r) {
        printf("cannot set up %s\n", path);
        exit(EXIT_FAILURE);
    }
    if (camera)
        f.r->camera = renderer_camera_of_scene(f.r, scene_camera_find(f.scene, camera));
    return f;
}

static void fixture_destroy(fixture *f)
{
    renderer_destroy(f->r);
    scene_destroy(f->scene);
}

static render_settings settings_of(uint32_t method, uint32_t size, uint32_t vpls)
{
    render_settings s = render_settings_default();
    s.method = method;
    s.width = s.height = size;
    s.vpls = s.ir_vpls = vpls;
    s.only = ONLY_INDIRECT;
    return s;
}

static size_t pixels_of(const renderer *r)
{
    return (size_t)r->settings.width * r->settings.height;
}

// Whole, as it lies in memory; free() it.
static void *image_read(renderer *r, const char *name)
{
    const gpu_image image = frame_graph_find_image(r->graph, name);
    const size_t size = pixels_of(r) * gpu_format_size(gpu_image_info(device, image)->format);
    void *texels = memory_alloc(size);
    CHECK(gpu_image_read(device, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, size));
    return texels;
}

static float *radiance_read(renderer *r)
{
    return image_read(r, "radiance");
}

static uint32_t counter_read(renderer *r, const char *name)
{
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, name);
    return buffer.id ? *(const uint32_t *)gpu_buffer_map(device, buffer) : 0;
}

// Renders until the picture is finished; returns the number of frames.
static uint32_t finish(renderer *r)
{
    uint32_t frames = 0;
    do {
        CHECK(renderer_frame(r));
        frames++;
    } while (!r->failed && !progressive_status_get(r, false).finished);
    return frames;
}

// The finished picture; free() it.
static float *picture_of(const char *scene, const char *camera, const render_settings *settings)
{
    fixture f = fixture_create(scene, camera, settings);
    finish(f.r);
    float *radiance = radiance_read(f.r);
    fixture_destroy(&f);
    return radiance;
}

typedef struct comparison {
    double error, energy; // relative L2; sum over sum
} comparison;

// Over the pixels where `mask` (may be NULL) is set. Images are four floats a pixel.
static comparison compare(const float *image, const float *reference, const bool *mask, size_t pixels)
{
    double difference = 0, square = 0, sum = 0, reference_sum = 0;
    for (size_t i = 0; i < pixels; i++)
        for (int c = 0; c < 3 && (!mask || mask[i]); c++) {
            const double a = (double)image[4 * i + c], b = (double)reference[4 * i + c];
            difference += (a - b) * (a - b);
            square += b * b;
            sum += a;
            reference_sum += b;
        }
    return (comparison){sqrt(difference / square), sum / reference_sum};
}

// ---- The G-buffer on the CPU

typedef struct vec {
    double x, y, z;
} vec;

static vec vec_of(const float v[3])
{
    return (vec){(double)v[0], (double)v[1], (double)v[2]};
}
static vec vec_mad(vec a, double t, vec b)
{
    return (vec){a.x + t * b.x, a.y + t * b.y, a.z + t * b.z};
}
static double vec_dot(vec a, vec b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static vec octahedral(const int16_t xy[2])
{
    vec n = {xy[0] / 32767.0, xy[1] / 32767.0, 0};
    n.z = 1 - fabs(n.x) - fabs(n.y);
    const double fold = fmax(-n.z, 0);
    n.x += n.x >= 0 ? -fold : fold;
    n.y += n.y >= 0 ? -fold : fold;
    return vec_mad((vec){0}, 1 / sqrt(vec_dot(n, n)), n);
}

typedef struct point {
    vec position, geometric, shading;
    double albedo[3];
    bool drawn;
} point;

// What each pixel sees; "depth", "normals" and "albedo" are exported. free() it.
static point *points_read(renderer *r)
{
    const frame_constants *c = &r->constants;
    float *depth = image_read(r, "depth");
    int16_t(*normals)[4] = image_read(r, "normals");
    uint16_t(*albedo)[4] = image_read(r, "albedo");
    point *points = memory_alloc(pixels_of(r) * sizeof *points);
    for (size_t i = 0; i < pixels_of(r); i++) {
        const double x = ((double)(i % c->width) + 0.5) / c->width * 2 - 1;
        const double y = ((double)(i / c->width) + 0.5) / c->height * 2 - 1;
        point *p = &points[i];
        p->drawn = depth[i] > 0;
        vec ray = vec_mad(vec_mad(vec_of(c->forward), x, vec_of(c->right)), -y, vec_of(c->up));
        p->position = vec_mad(vec_of(c->eye), p->drawn ? (double)c->near_plane / (double)depth[i] : 0, ray);
        p->geometric = octahedral(normals[i]);
        p->shading = octahedral(normals[i] + 2);
        for (int k = 0; k < 3; k++)
            p->albedo[k] = albedo[i][k] / 65535.0;
    }
    free(depth);
    free(normals);
    free(albedo);
    return points;
}

// Light over albedo that a VPL of one candela in each direction's cosine sends to a point: G / pi with the
// singularity b (Lin and Yuksel 2019, section 4).
static double vpl_to_point(const vpl *light, const point *p, double b)
{
    const vec offset = vec_mad(p->position, -1, vec_of(light->position));
    const double square = vec_dot(offset, offset), length = sqrt(square);
    if (vec_dot(p->geometric, offset) >= 0)
        return 0;
    const double received = fmax(0, -vec_dot(p->shading, offset) / length);
    const double sent = fmax(0, vec_dot(vec_of(light->normal), offset) / length);
    return received * sent / (M_PI * (square + b * b));
}

static const char *const gbuffer_exports[] = {"depth", "normals", "albedo", "vpls"};

static void exports_set(renderer *r, const char *const *names, uint32_t count)
{
    for (r->export_count = 0; r->export_count < count; r->export_count++)
        r->exports[r->export_count] = names[r->export_count];
}

// The slots of the last frame; free() them.
static vpl *vpls_read(renderer *r)
{
    const size_t size = renderer_vpl_slots(r) * sizeof(vpl);
    vpl *vpls = memory_alloc(size);
    CHECK(gpu_buffer_read(device, frame_graph_find_buffer(r->graph, "vpls"), 0, vpls, size));
    return vpls;
}

// ---- Against the CPU and an independent shader

// Relative to the brightest pixel, the largest difference between the picture and the sum of the slots in doubles.
// Counts the pairs of pixel and slot with light.
static double worst_difference(renderer *r, size_t *pairs)
{
    point *points = points_read(r);
    vpl *vpls = vpls_read(r);
    float *radiance = radiance_read(r);
    double worst = 0, brightest = 0;
    for (size_t i = 0; i < pixels_of(r); i++) {
        double sum[3] = {0};
        for (uint32_t s = 0; s < renderer_vpl_slots(r) && points[i].drawn; s++) {
            const bool is_empty = vpls[s].intensity <= 0;
            const double light = is_empty ? 0 : vpl_to_point(&vpls[s], &points[i], (double)renderer_singularity(r));
            *pairs += light > 0;
            for (int c = 0; c < 3 && light > 0; c++)
                sum[c] += points[i].albedo[c] * light * (double)vpls[s].color[c];
        }
        for (int c = 0; c < 3; c++) {
            worst = fmax(worst, fabs(sum[c] - (double)radiance[4 * i + c]));
            brightest = fmax(brightest, sum[c]);
        }
    }
    free(points);
    free(vpls);
    free(radiance);
    return worst / brightest;
}

TEST(unshadowed_light_is_the_sum_over_the_slots)
{
    static const uint32_t methods[] = {METHOD_VPL, METHOD_IR};
    for (size_t m = 0; m < countof(methods); m++) {
        render_settings s = settings_of(methods[m], 24, 1000);
        s.only = ONLY_INDIRECT_UNSHADOWED;
        fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
        exports_set(f.r, gbuffer_exports, countof(gbuffer_exports));
        const uint32_t frames = finish(f.r);
        CHECK(methods[m] == METHOD_IR ? frames == 1 : frames >= 64);
        size_t pairs = 0;
        const double worst = worst_difference(f.r, &pairs);
        printf("  %s, %u frames: worst difference %.1e of the brightest\n", m ? "ir" : "vpl", frames, worst);
        CHECK(pairs > 0 && worst < 1e-4);
        fixture_destroy(&f);
    }
}

TEST(no_shadow_samples_means_no_shadows)
{
    render_settings s = settings_of(METHOD_VPL, 24, 300);
    s.only = ONLY_INDIRECT_UNSHADOWED;
    float *unshadowed = picture_of(SCENES "cornell.glb", NULL, &s);
    s.only = ONLY_INDIRECT;
    s.shadow_samples = 0;
    float *without_rays = picture_of(SCENES "cornell.glb", NULL, &s);
    s.shadow_samples = 1;
    float *shadowed = picture_of(SCENES "cornell.glb", NULL, &s);
    CHECK(memcmp(unshadowed, without_rays, sizeof(float) * 4 * 24 * 24) == 0);
    const comparison c = compare(shadowed, unshadowed, NULL, 24 * 24);
    printf("  with shadows %.4f of the light\n", c.energy);
    CHECK(c.energy < 0.95);
    free(unshadowed);
    free(without_rays);
    free(shadowed);
}

// Not square, so that no pixel's centre lies on an edge of the box, where it depends on rounding what is visible.
static void check_one_shader(uint32_t rays)
{
    render_settings s = settings_of(METHOD_VPL, 40, 300);
    s.height = 37;
    s.rays = rays;
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    exports_set(f.r, (const char *const[]){"brute_force", "albedo"}, 2);
    brute_force_add(f.r, &shader_brute_force_shadowed_comp);
    finish(f.r);
    float *expected = image_read(f.r, "brute_force"), *radiance = radiance_read(f.r);
    uint16_t(*albedo)[4] = image_read(f.r, "albedo");
    for (size_t i = 0; i < pixels_of(f.r); i++)
        for (int c = 0; c < 3; c++)
            expected[4 * i + c] *= (float)albedo[i][c] / 65535;
    const comparison c = compare(radiance, expected, NULL, pixels_of(f.r));
    printf("  by %s: relative L2 %.1e, energy %.6f\n", rays_are_host(f.r) ? "Embree" : "ray query", c.error, c.energy);
    CHECK(c.error < 1e-5);
    free(expected);
    free(radiance);
    free(albedo);
    fixture_destroy(&f);
}

TEST(shadowed_light_is_what_one_shader_makes_of_it)
{
    check_one_shader(RAYS_QUERY);
    check_one_shader(RAYS_AUTO);
}

TEST(no_light_comes_through_a_wall)
{
    static const uint32_t methods[] = {METHOD_VPL, METHOD_IR};
    for (size_t m = 0; m < countof(methods); m++) {
        render_settings s = settings_of(methods[m], 32, 600);
        s.only = ONLY_ALL;
        float *unlit = picture_of(SCENES "two_rooms.glb", "unlit", &s);
        float *lit = picture_of(SCENES "two_rooms.glb", "lit", &s);
        double unlit_sum = 0, lit_sum = 0;
        for (size_t i = 0; i < 4 * 32 * 32; i++) {
            unlit_sum += i % 4 < 3 ? (double)unlit[i] : 0;
            lit_sum += i % 4 < 3 ? (double)lit[i] : 0;
        }
        CHECK(unlit_sum == 0);
        CHECK(lit_sum > 0);
        free(unlit);
        free(lit);
    }
}

// ---- Frames

TEST(rays_are_counted)
{
    render_settings s = settings_of(METHOD_IR, 24, 300);
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    exports_set(f.r, gbuffer_exports, countof(gbuffer_exports));
    CHECK(renderer_frame(f.r));
    size_t pairs = 0;
    worst_difference(f.r, &pairs);
    const uint32_t rays = counter_read(f.r, "rays_shadow|-"), traced = counter_read(f.r, "rays_vpl|-");
    printf("  %u shadow rays for %zu pairs with light\n", rays, pairs);
    CHECK_NEAR(rays, (double)pairs, 1e-4 * (double)pairs + 1); // floats lose what is parallel to a surface
    CHECK(rays > 0 && progressive_status_get(f.r, false).rays == (double)rays + traced);
    fixture_destroy(&f);
}

TEST(vpls_are_traced_once)
{
    render_settings s = settings_of(METHOD_VPL, 16, 300);
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    exports_set(f.r, (const char *const[]){"vpls"}, 1);
    CHECK(renderer_frame(f.r));
    CHECK(counter_read(f.r, "rays_vpl|-") > 0);
    vpl *first = vpls_read(f.r);
    CHECK(renderer_frame(f.r));
    CHECK(counter_read(f.r, "rays_vpl|-") == 0);
    vpl *second = vpls_read(f.r);
    CHECK(memcmp(first, second, 300 * sizeof(vpl)) == 0);
    f.r->settings.seed++; // another picture
    CHECK(renderer_frame(f.r));
    CHECK(counter_read(f.r, "rays_vpl|-") > 0);
    free(second);
    second = vpls_read(f.r);
    CHECK(memcmp(first, second, 300 * sizeof(vpl)) != 0);
    free(first);
    free(second);
    fixture_destroy(&f);
}

// The VPLs so far stand for all from the first frame on, and one frame's slice ends where a path ends.
TEST(an_unfinished_picture_is_about_as_bright)
{
    render_settings s = settings_of(METHOD_VPL, 32, 10000);
    s.bounces = 7;
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    CHECK(renderer_frame(f.r));
    progressive_status status = progressive_status_get(f.r, false);
    CHECK(status.total == 9996 && status.done > 0 && status.done % 7 == 0 && !status.finished);
    CHECK(isnan(status.error));
    float *first = radiance_read(f.r);
    const uint32_t frames = 1 + finish(f.r);
    CHECK(progressive_status_get(f.r, false).done == 9996);
    float *last = radiance_read(f.r);
    const comparison c = compare(first, last, NULL, pixels_of(f.r));
    printf("  energy after 1 of %u frames: %.4f\n", frames, c.energy);
    CHECK(frames >= 64);
    CHECK_NEAR(c.energy, 1, 0.1);
    CHECK(renderer_frame(f.r)); // finished stays finished
    float *again = radiance_read(f.r);
    CHECK(progressive_status_get(f.r, false).done == 9996);
    CHECK(memcmp(last, again, pixels_of(f.r) * 16) == 0);
    free(first);
    free(last);
    free(again);
    fixture_destroy(&f);
}

TEST(ir_with_all_vpls_is_vpl)
{
    const uint32_t sizes[] = {16, 33, 160};
    for (size_t i = 0; i < countof(sizes); i++) {
        const render_settings vpl_settings = settings_of(METHOD_VPL, sizes[i], 500),
                              ir_settings = settings_of(METHOD_IR, sizes[i], 500);
        float *vpl_picture = picture_of(SCENES "cornell.glb", NULL, &vpl_settings);
        float *ir_picture = picture_of(SCENES "cornell.glb", NULL, &ir_settings); // at 160x160 in 4 batches
        const comparison c = compare(ir_picture, vpl_picture, NULL, sizes[i] * sizes[i]);
        printf("  %ux%u: relative L2 %.1e\n", sizes[i], sizes[i], c.error);
        CHECK(c.error < 1e-5);
        free(vpl_picture);
        free(ir_picture);
    }
}

TEST(ir_accumulates_nothing)
{
    const render_settings s = settings_of(METHOD_IR, 24, 100);
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    CHECK(renderer_frame(f.r));
    float *first = radiance_read(f.r);
    CHECK(progressive_status_get(f.r, false).finished && !progressive_is(f.r));
    CHECK(renderer_frame(f.r));
    float *second = radiance_read(f.r);
    CHECK(memcmp(first, second, pixels_of(f.r) * 16) == 0);
    free(first);
    free(second);
    fixture_destroy(&f);
}

// Batches of one frame take turns in the same memory.
TEST(ir_needs_no_more_memory_for_more_vpls)
{
    VkDeviceSize used[2];
    for (uint32_t i = 0; i < 2; i++) {
        const render_settings s = settings_of(METHOD_IR, 512, i ? 64 * 3 : 16 * 3);
        fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
        CHECK(renderer_frame(f.r));
        used[i] = gpu_memory_used(device);
        fixture_destroy(&f);
    }
    printf("  %.0f MiB for 3 batches, %.0f MiB for 12\n", (double)used[0] / 1048576, (double)used[1] / 1048576);
    CHECK(used[1] < used[0] + (1 << 20));
}

static bool is_there(const char *path)
{
    const bool there = access(path, R_OK) == 0;
    if (!there)
        printf("  skipped: no %s\n", path);
    return there;
}

TEST(a_continued_picture_is_the_whole_one)
{
    static const char scene[] = "../shared/scenes/cornell/cornell_quad.gltf"; // its direct light is sampled
    if (!is_there(scene))
        return;
    char path[] = "/tmp/lanternfield_vpl_XXXXXX";
    close(mkstemp(path));
    render_settings s = settings_of(METHOD_VPL, 20, 900);
    s.only = ONLY_ALL;
    float *whole = picture_of(scene, NULL, &s);
    fixture f = fixture_create(scene, NULL, &s);
    for (int frame = 0; frame < 20; frame++)
        CHECK(renderer_frame(f.r));
    CHECK(progressive_save(f.r, path, "picture"));
    const uint64_t done = progressive_status_get(f.r, false).done;
    fixture_destroy(&f);
    f = fixture_create(scene, NULL, &s);
    CHECK(progressive_load(f.r, path, "picture"));
    CHECK(renderer_frame(f.r));
    CHECK(progressive_status_get(f.r, false).done > done);
    finish(f.r);
    float *continued = radiance_read(f.r);
    CHECK(memcmp(whole, continued, pixels_of(f.r) * 16) == 0);
    unlink(path);
    free(whole);
    free(continued);
    fixture_destroy(&f);
}

static char last_error[512];

static void error_keep(log_level level, const char *line, void *user)
{
    (void)user;
    if (level == LOG_ERROR)
        snprintf(last_error, sizeof last_error, "%s", line);
}

TEST(what_does_not_fit_is_refused_by_name)
{
    render_settings s = settings_of(METHOD_VPL, 16, 300);
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    log_sink_set(error_keep, NULL);
    f.r->settings.width = 4096;
    f.r->settings.height = 1025;
    CHECK(!renderer_frame(f.r));
    CHECK_STRING(last_error, "--size 4096x1025: expected at most 4194304 pixels for --method vpl");
    f.r->settings.method = METHOD_IR;
    f.r->settings.width = f.r->settings.height = 2048;
    f.r->settings.ir_vpls = 151;
    f.r->settings.bounces = 1;
    CHECK(!renderer_frame(f.r));
    CHECK_STRING(last_error, "--ir-vpls 151: expected at most 150 at 2048x2048, as all are traced in one frame; "
                             "--method vpl takes many");
    log_sink_set(NULL, NULL);
    f.r->settings = s;
    CHECK(renderer_frame(f.r));
    fixture_destroy(&f);
}

TEST(the_largest_picture_takes_a_vpl_at_a_time)
{
    render_settings s = settings_of(METHOD_VPL, 2048, 64);
    s.bounces = 1;
    fixture f = fixture_create(SCENES "two_rooms.glb", "unlit", &s);
    CHECK(renderer_frame(f.r));
    CHECK(progressive_status_get(f.r, false).done == 1);
    fixture_destroy(&f);
}

// ---- Direct light

TEST(direct_light_is_the_renderers)
{
    render_settings s = settings_of(METHOD_VPL, 32, 0);
    s.only = ONLY_DIRECT;
    float *direct = picture_of(SCENES "cornell.glb", NULL, &s);
    s.method = METHOD_LGH;
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    CHECK(renderer_frame(f.r));
    float *expected = radiance_read(f.r);
    const comparison c = compare(direct, expected, NULL, pixels_of(f.r));
    printf("  relative L2 %.1e\n", c.error);
    CHECK(c.error < 1e-5);
    free(direct);
    free(expected);
    fixture_destroy(&f);
}

TEST(few_vpls_and_none_are_fine)
{
    static const uint32_t methods[] = {METHOD_VPL, METHOD_IR}, counts[] = {0, 1, 2, 4};
    for (size_t m = 0; m < countof(methods); m++)
        for (size_t i = 0; i < countof(counts); i++) {
            render_settings s = settings_of(methods[m], 16, max_u32(counts[i], methods[m] == METHOD_IR));
            s.only = ONLY_ALL;
            float *picture = picture_of(SCENES "cornell.glb", NULL, &s);
            double sum = 0;
            for (size_t k = 0; k < 16 * 16; k++)
                sum += (double)picture[4 * k];
            CHECK(isfinite(sum) && sum > 0);
            free(picture);
        }
}

// ---- Against the other methods

// A closed box of albedo 1/2 that emits 1 nit everywhere: 1 of emission, 1/2 of direct light, then 1/4 + 1/8 + 1/16 of
// three indirect bounces. Settles every factor between light, VPL and pixel.
TEST(the_furnace_has_its_closed_form)
{
    static const char scene[] = "../shared/scenes/cornell/furnace.gltf";
    if (!is_there(scene))
        return;
    render_settings s = settings_of(METHOD_VPL, 24, 30000);
    s.only = ONLY_ALL;
    s.singularity = 0.001f;
    float *picture = picture_of(scene, NULL, &s);
    double sum = 0;
    for (size_t i = 0; i < 24 * 24; i++)
        sum += (double)picture[4 * i] / (24 * 24);
    printf("  mean %.4f of 1.9375\n", sum);
    CHECK_NEAR(sum / 1.9375, 1, 0.01);
    free(picture);
}

// The wider the grid lights' reach, the more of the light is the VPLs' own; in the end all of it.
TEST(the_hierarchy_converges_to_the_reference)
{
    render_settings s = settings_of(METHOD_VPL, 64, 3000);
    s.only = ONLY_INDIRECT_UNSHADOWED;
    float *reference = picture_of(SCENES "cornell.glb", NULL, &s);
    s.method = METHOD_LGH;
    s.start_level = 0;
    s.levels = 2;
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    double error = INFINITY;
    for (uint32_t alpha = 1; alpha <= 16; alpha *= 4) {
        f.r->settings.alpha = (float)alpha;
        CHECK(renderer_frame(f.r));
        float *radiance = radiance_read(f.r);
        const comparison c = compare(radiance, reference, NULL, pixels_of(f.r));
        printf("  alpha %u: relative L2 %.2e, energy %.6f\n", alpha, c.error, c.energy);
        CHECK(c.error < error || c.error < 1e-5); // 1e-6 is the sum's rounding
        error = c.error;
        free(radiance);
    }
    CHECK(error < 1e-4);
    free(reference);
    fixture_destroy(&f);
}

// ---- The bias of the singularity

typedef struct face {
    vec corners[3], normal;
} face;

static face face_of(const float world[16], const float *const positions[3])
{
    face f;
    for (int i = 0; i < 3; i++) {
        f.corners[i] = vec_of(world + 12);
        for (int k = 0; k < 3; k++)
            f.corners[i] = vec_mad(f.corners[i], (double)positions[i][k], vec_of(world + 4 * k));
    }
    const vec a = vec_mad(f.corners[1], -1, f.corners[0]), b = vec_mad(f.corners[2], -1, f.corners[0]);
    const vec n = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    f.normal = vec_mad((vec){0}, 1 / sqrt(vec_dot(n, n)), n);
    return f;
}

// All triangles of the scene; free() it.
static face *faces_of(const scene_data *scene, size_t *count)
{
    face *faces = NULL;
    size_t capacity = 0;
    *count = 0;
    for (uint32_t n = 0; n < scene->node_count; n++) {
        const scene_node *node = &scene->nodes[n];
        const scene_mesh *mesh = node->mesh == SCENE_NONE ? NULL : &scene->meshes[node->mesh];
        for (uint32_t p = 0; mesh && p < mesh->primitive_count; p++) {
            const mesh_primitive *primitive = &scene->primitives[mesh->first_primitive + p];
            const uint32_t *indices = scene->indices + primitive->first_index;
            memory_reserve((void **)&faces, &capacity, *count + primitive->index_count / 3, sizeof *faces);
            for (uint32_t i = 0; i < primitive->index_count; i += 3) {
                const float *corners[3];
                for (int k = 0; k < 3; k++)
                    corners[k] = scene->positions[primitive->first_vertex + indices[i + k]];
                faces[(*count)++] = face_of(node->world, corners);
            }
        }
    }
    return faces;
}

static double segment_distance(vec p, vec a, vec b)
{
    const vec edge = vec_mad(b, -1, a), offset = vec_mad(p, -1, a);
    const double t = fmin(fmax(vec_dot(offset, edge) / vec_dot(edge, edge), 0), 1);
    const vec apart = vec_mad(offset, -t, edge);
    return sqrt(vec_dot(apart, apart));
}

static double face_distance(vec p, const face *f)
{
    double distance = INFINITY;
    bool inside = true;
    for (int i = 0; i < 3; i++) {
        const vec a = f->corners[i], b = f->corners[(i + 1) % 3];
        const vec edge = vec_mad(b, -1, a), offset = vec_mad(p, -1, a), n = f->normal;
        const vec across = {n.y * edge.z - n.z * edge.y, n.z * edge.x - n.x * edge.z, n.x * edge.y - n.y * edge.x};
        inside = inside && vec_dot(across, offset) >= 0;
        distance = fmin(distance, segment_distance(p, a, b));
    }
    return inside ? fabs(vec_dot(vec_mad(p, -1, f->corners[0]), f->normal)) : distance;
}

// Whether light could go straight from one to the other: each lies, if only in part, in front of the other.
static bool faces_point(const face *f, const point *p)
{
    const double nearly = 1e-3;
    bool in_front = false;
    for (int i = 0; i < 3; i++)
        in_front = in_front || vec_dot(p->geometric, vec_mad(f->corners[i], -1, p->position)) > nearly;
    return in_front && vec_dot(f->normal, vec_mad(p->position, -1, f->corners[0])) > nearly;
}

// The pixels that are farther than `distance` from every face that they could see. "depth", "normals" and "albedo" are
// exported. free() it.
static bool *far_pixels(renderer *r, double distance)
{
    size_t count;
    face *faces = faces_of(r->scene, &count);
    point *points = points_read(r);
    bool *far = memory_alloc(pixels_of(r));
    for (size_t i = 0; i < pixels_of(r); i++) {
        far[i] = points[i].drawn;
        for (size_t f = 0; f < count && far[i]; f++)
            far[i] = !faces_point(&faces[f], &points[i]) || face_distance(points[i].position, &faces[f]) > distance;
    }
    free(faces);
    free(points);
    return far;
}

typedef struct truth {
    float *picture; // by path tracing
    bool *far; // farther than 5 % of the box's edge from other faces
    double error; // its own, estimated
    size_t pixels;
} truth;

static truth truth_of(const char *scene, render_settings s, uint32_t spp)
{
    s.method = METHOD_PATH;
    s.spp = spp;
    fixture f = fixture_create(scene, NULL, &s);
    exports_set(f.r, gbuffer_exports, 3);
    finish(f.r);
    const scene_data *d = f.scene;
    truth t = {radiance_read(f.r), far_pixels(f.r, 0.05 * (double)(d->bounds_max[1] - d->bounds_min[1])),
               progressive_status_get(f.r, true).error, pixels_of(f.r)};
    fixture_destroy(&f);
    return t;
}

static void truth_free(truth *t)
{
    free(t->picture);
    free(t->far);
}

TEST(small_singularity_and_many_vpls_are_path_tracing)
{
    render_settings s = settings_of(METHOD_VPL, 24, 20000);
    s.only = ONLY_ALL;
    s.singularity = 0.001f;
    truth t = truth_of(SCENES "cornell.glb", s, 1024);
    float *picture = picture_of(SCENES "cornell.glb", NULL, &s);
    const comparison all = compare(picture, t.picture, NULL, t.pixels),
                     far = compare(picture, t.picture, t.far, t.pixels);
    printf("  energy %.4f, relative L2 %.4f; far from other faces %.4f, %.4f; path's own error %.4f\n", all.energy,
           all.error, far.energy, far.error, t.error);
    CHECK_NEAR(all.energy, 1, 0.01);
    CHECK_NEAR(far.energy, 1, 0.01);
    CHECK(far.error < 0.03);
    free(picture);
    truth_free(&t);
}

// `direct` becomes what is left of `picture` without it: the indirect light.
static void direct_remove(float *direct, const float *picture, size_t pixels)
{
    for (size_t i = 0; i < 4 * pixels; i++)
        direct[i] = picture[i] - direct[i];
}

static void bias_row_print(const float *picture, const float *truth, const bool *far, size_t pixels)
{
    const comparison a = compare(picture, truth, NULL, pixels), f = compare(picture, truth, far, pixels);
    printf("    %.4f  %.4f    %.4f  %.4f", a.energy, a.error, f.energy, f.error);
}

static void bias_print(const char *scene, uint32_t vpls)
{
    enum { SPP = 4096 };
    static const float singularities[] = {0.01f, 0.003f, 0.001f, 0.0003f, 0};
    render_settings s = settings_of(METHOD_VPL, 64, vpls);
    s.only = ONLY_DIRECT;
    float *direct = picture_of(scene, NULL, &s);
    s.only = ONLY_ALL;
    truth t = truth_of(scene, s, SPP);
    float *indirect = memory_alloc(t.pixels * 16);
    memcpy(indirect, direct, t.pixels * 16);
    direct_remove(indirect, t.picture, t.pixels);
    size_t far_count = 0;
    for (size_t i = 0; i < t.pixels; i++)
        far_count += t.far[i];
    printf("%s, 64x64, %u slots; path: %u spp, its own error %.4f; %zu pixels are far from other faces\n", scene, vpls,
           SPP, t.error, far_count);
    printf("               all light         far from faces    indirect light    far from faces\n"
           "       b    energy  error     energy  error     energy  error     energy  error\n");
    for (size_t i = 0; i < countof(singularities); i++) {
        s.singularity = singularities[i];
        float *picture = picture_of(scene, NULL, &s), *part = memory_alloc(t.pixels * 16);
        memcpy(part, direct, t.pixels * 16);
        direct_remove(part, picture, t.pixels);
        printf("  %6.4f", (double)s.singularity);
        bias_row_print(picture, t.picture, t.far, t.pixels);
        bias_row_print(part, indirect, t.far, t.pixels);
        printf("\n");
        fflush(stdout);
        free(picture);
        free(part);
    }
    free(direct);
    free(indirect);
    truth_free(&t);
}

TEST(validation_layer_is_silent)
{
    CHECK(gpu_validation_messages(device) == 0);
}

int main(int argc, char **argv)
{
    const bool bias = argc > 1 && strcmp(argv[1], "bias") == 0;
    device = gpu_create(&(gpu_desc){.validation = !bias});
    if (!device) {
        printf("no device with a validation layer\n");
        return 77;
    }
    if (bias) {
        bias_print(SCENES "cornell.glb", argc > 2 ? (uint32_t)atoi(argv[2]) : 100000);
        gpu_destroy(device);
        return test_end();
    }
    RUN(unshadowed_light_is_the_sum_over_the_slots);
    RUN(no_shadow_samples_means_no_shadows);
    RUN(shadowed_light_is_what_one_shader_makes_of_it);
    RUN(no_light_comes_through_a_wall);
    RUN(rays_are_counted);
    RUN(vpls_are_traced_once);
    RUN(an_unfinished_picture_is_about_as_bright);
    RUN(ir_with_all_vpls_is_vpl);
    RUN(ir_accumulates_nothing);
    RUN(ir_needs_no_more_memory_for_more_vpls);
    RUN(a_continued_picture_is_the_whole_one);
    RUN(what_does_not_fit_is_refused_by_name);
    RUN(the_largest_picture_takes_a_vpl_at_a_time);
    RUN(direct_light_is_the_renderers);
    RUN(few_vpls_and_none_are_fine);
    RUN(the_furnace_has_its_closed_form);
    RUN(the_hierarchy_converges_to_the_reference);
    RUN(small_singularity_and_many_vpls_are_path_tracing);
    RUN(validation_layer_is_silent);
    gpu_destroy(device);
    return test_end();
}
