// The lighting grid hierarchy against what it promises: conservation of flux, agreement of its construction methods,
// the brute-force sum over the same VPLs, the reservoirs' probabilities, and identical bytes.
#include "brute_force.h"
#include "quad_scene.h"
#include "test.h"

#include "modules/renderer.h"
#include "modules/world.h"

#include "test_shaders_shaders.h"

#define SCENES BUILD_DIR "/scenes/"

static gpu *device;

// ---- A pass of our own: every light's sampling weight at every pixel

enum { SELECTION_LIGHTS = 64 };

typedef struct selection {
    gpu_pipeline pipeline;
    uint32_t pixels;
    struct {
        uint32_t light_capacity, emission;
        float singularity;
    } push;
} selection;

static void selection_execute(const frame_graph_context *context, void *user)
{
    const selection *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->push, sizeof pass->push);
    gpu_dispatch(context->commands, div_up_u32(pass->pixels, 64), 1, 1);
}

static void selection_setup(renderer *r, void *state)
{
    selection *pass = state;
    pass->pixels = r->settings.width * r->settings.height;
    pass->push.light_capacity = SELECTION_LIGHTS;
    pass->push.emission = r->settings.emission;
    pass->push.singularity = renderer_singularity(r);
    frame_graph_pass *p = frame_graph_pass_add(
        r->graph, &(frame_graph_pass_desc){
                      .name = "selection", .kind = FRAME_GRAPH_COMPUTE, .execute = selection_execute, .user = pass});
    const frame_graph_resource_desc weights = frame_graph_buffer_of(4ull * pass->pixels * SELECTION_LIGHTS);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_lights", ACCESS_STORAGE_READ);
    frame_graph_read(p, "depth", ACCESS_SAMPLED);
    frame_graph_read(p, "normals", ACCESS_SAMPLED);
    frame_graph_create_resource(p, "selection_weights", &weights, ACCESS_STORAGE_WRITE);
}

static void selection_fini(renderer *r, void *state)
{
    gpu_pipeline_destroy(r->gpu, ((selection *)state)->pipeline);
}

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
    f.r->camera = renderer_camera_of_scene(f.r, camera                  ? scene_camera_find(f.scene, camera)
                                                : f.scene->camera_count ? 0
                                                                        : SCENE_NONE);
    return f;
}

static void fixture_destroy(fixture *f)
{
    renderer_destroy(f->r);
    scene_destroy(f->scene);
}

static render_settings small_settings(uint32_t width, uint32_t height, uint32_t vpls)
{
    render_settings s = render_settings_default();
    s.width = width;
    s.height = height;
    s.vpls = vpls;
    return s;
}

static void export_names(renderer *r, const char *const *names, uint32_t count)
{
    for (r->export_count = 0; r->export_count < count; r->export_count++)
        r->exports[r->export_count] = names[r->export_count];
}

// Reads an exported buffer or image whole; free() it.
static void *read_buffer(renderer *r, const char *name)
{
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, name);
    const VkDeviceSize size = gpu_buffer_size(r->gpu, buffer);
    void *bytes = memory_alloc(size);
    CHECK(gpu_buffer_read(r->gpu, buffer, 0, bytes, size));
    return bytes;
}

static float *read_image(renderer *r, const char *name)
{
    const gpu_image image = frame_graph_find_image(r->graph, name);
    const gpu_image_desc *info = gpu_image_info(r->gpu, image);
    const size_t size = (size_t)info->width * info->height * gpu_format_size(info->format);
    float *texels = memory_alloc(size);
    CHECK(gpu_image_read(r->gpu, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, size));
    return texels;
}

typedef struct hierarchy {
    lgh_header *header;
    grid_light *lights;
    vpl *vpls;
} hierarchy;

static hierarchy hierarchy_render(renderer *r)
{
    static const char *const names[] = {"lgh_header", "lgh_lights", "vpls"};
    export_names(r, names, countof(names));
    CHECK(renderer_frame(r));
    return (hierarchy){read_buffer(r, "lgh_header"), read_buffer(r, "lgh_lights"), read_buffer(r, "vpls")};
}

static void hierarchy_free(hierarchy *h)
{
    free(h->header);
    free(h->lights);
    free(h->vpls);
}

typedef struct comparison {
    double error, energy; // relative L2, energy ratio
} comparison;

// The sum over every VPL at each pixel; free() it. It depends on the scene and the VPLs alone.
static float *brute_force_render(renderer *r)
{
    brute_force_add(r, &shader_brute_force_comp);
    export_names(r, (const char *const[]){"brute_force"}, 1);
    CHECK(renderer_frame(r));
    ecs_remove(r->world, renderer_pass_find(r, "brute_force"), r->pass);
    return read_image(r, "brute_force");
}

static comparison compare_with_brute_force(renderer *r, const float *reference)
{
    export_names(r, (const char *const[]){"indirect"}, 1);
    CHECK(renderer_frame(r));
    float *image = read_image(r, "indirect");
    double difference = 0, square = 0, sum = 0, reference_sum = 0;
    const size_t pixels = (size_t)r->settings.width * r->settings.height;
    for (size_t i = 0; i < pixels; i++) {
        for (int c = 0; c < 3; c++) {
            const double a = image[4 * i + c], b = reference[4 * i + c];
            difference += (a - b) * (a - b);
            square += b * b;
            sum += a;
            reference_sum += b;
        }
    }
    free(image);
    return (comparison){sqrt(difference / square), sum / reference_sum};
}

// ---- Tests

// Largest deviation from 1 of the blending functions' sum, over distances, level counts and alphas.
static double blend_sum_error(blend_method blend)
{
    enum { COUNT = 4096 };
    const uint32_t paper = blend == BLEND_PAPER;
    gpu_pipeline pipeline = gpu_compute_pipeline_create(
        device,
        &(gpu_compute_pipeline_desc){.shader = &shader_lgh_blend_sum_comp, .constants = &paper, .constant_count = 1});
    gpu_buffer buffer =
        gpu_buffer_create(device, &(gpu_buffer_desc){.size = COUNT * 4, .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT});
    static const float alphas[] = {0.5f, 1, 1.7f, 4};
    double worst = 0;
    for (uint32_t levels = 1; levels <= LGH_EXPONENTS; levels++)
        for (uint32_t start_level = 0; start_level < 2; start_level++)
            for (size_t a = 0; a < countof(alphas); a++) {
                const struct {
                    uint32_t count, levels, start_level;
                    float alpha;
                } push = {COUNT, levels, start_level, alphas[a]};
                gpu_commands *commands = gpu_commands_begin(device);
                gpu_bind(commands, pipeline, &(gpu_binding){.buffer = buffer}, 1);
                gpu_push(commands, &push, sizeof push);
                gpu_dispatch(commands, COUNT / 64, 1, 1);
                CHECK(gpu_commands_submit_and_wait(device, commands));
                float sums[COUNT];
                CHECK(gpu_buffer_read(device, buffer, 0, sums, sizeof sums));
                for (int i = 0; i < COUNT; i++)
                    worst = fmax(worst, fabs(sums[i] - 1.0));
            }
    gpu_buffer_destroy(device, buffer);
    gpu_pipeline_destroy(device, pipeline);
    return worst;
}

TEST(blending_functions_sum_to_one)
{
    const double late = blend_sum_error(BLEND_LATE), paper = blend_sum_error(BLEND_PAPER);
    printf("  worst deviation from 1: %.2e, the papers' %.2e\n", late, paper);
    CHECK(late <= 1e-6 && paper <= 1e-6);
}

// Largest relative difference, over levels and channels, between a level's colour sum and the VPLs'.
static double flux_error(const hierarchy *h, uint32_t slots)
{
    double total[3] = {0}, worst = 0;
    for (uint32_t i = 0; i < slots; i++)
        for (int c = 0; c < 3; c++)
            total[c] += h->vpls[i].intensity > 0 ? h->vpls[i].color[c] : 0;
    for (uint32_t e = 0; e < h->header->level_count; e++) {
        double sum[3] = {0};
        for (uint32_t i = 0; i < h->header->levels[e].occupied; i++)
            for (int c = 0; c < 3; c++)
                sum[c] += h->lights[h->header->levels[e].first_light + i].color[c];
        for (int c = 0; c < 3; c++)
            worst = fmax(worst, fabs(sum[c] - total[c]) / total[c]);
    }
    return worst;
}

static double flux_error_of(const char *scene, uint32_t vpls, uint32_t build, uint32_t s1)
{
    render_settings s = small_settings(16, 16, vpls);
    s.build = build;
    s.s1 = s1;
    fixture f = fixture_create(scene, NULL, &s);
    hierarchy h = hierarchy_render(f.r);
    const double error = flux_error(&h, vpls);
    printf("  %u slots, build %u, s1 %u: %u levels, %u grid lights, worst flux error %.2e\n", vpls, build, s1,
           h.header->level_count, h.header->light_count, error);
    CHECK(h.header->level_count > 1);
    hierarchy_free(&h);
    fixture_destroy(&f);
    return error;
}

TEST(every_level_carries_the_flux_of_the_vpls)
{
    static const uint32_t counts[] = {1000, 100000, 1000000};
    for (size_t i = 0; i < countof(counts); i++)
        CHECK(flux_error_of(SCENES "cornell.glb", counts[i], LGH_BUILD_RESTRICT, LGH_S1_ORDERED) < 1e-4);
}

TEST(other_ways_to_build_carry_the_flux_too)
{
    if (!gpu_has_float_atomics(device)) {
        printf("  skipped: the device has no float atomics\n");
        return;
    }
    CHECK(flux_error_of(SCENES "cornell.glb", 20000, LGH_BUILD_RESTRICT, LGH_S1_ATOMIC) < 1e-4);
    CHECK(flux_error_of(SCENES "cornell.glb", 20000, LGH_BUILD_SCATTER, LGH_S1_ATOMIC) < 1e-4);
    CHECK(flux_error_of(SCENES "cornell.glb", 20000, LGH_BUILD_GATHER, LGH_S1_ORDERED) < 1e-4);
}

static void check_same_light(const grid_light *a, const grid_light *b, double size, double *worst)
{
    const double scale = a->intensity + 1e-12;
    CHECK(a->vertex == b->vertex);
    for (int c = 0; c < 3; c++) {
        *worst = fmax(*worst, fabs(a->color[c] - b->color[c]) / scale);
        *worst = fmax(*worst, fabs(a->position[c] - b->position[c]) / size);
        *worst = fmax(*worst, fabs(a->normal[c] - b->normal[c]));
        *worst = fmax(*worst, fabs(a->moment_diagonal[c] - b->moment_diagonal[c]));
        *worst = fmax(*worst, fabs(a->moment_mixed[c] - b->moment_mixed[c]));
    }
}

TEST(restriction_equals_scattering)
{
    if (!gpu_has_float_atomics(device)) {
        printf("  skipped: the device has no float atomics\n");
        return;
    }
    render_settings s = small_settings(16, 16, 20000);
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    hierarchy restricted = hierarchy_render(f.r);
    f.r->settings.build = LGH_BUILD_SCATTER;
    hierarchy scattered = hierarchy_render(f.r);
    CHECK(restricted.header->light_count == scattered.header->light_count);
    double worst = 0;
    for (uint32_t i = 0; i < restricted.header->light_count; i++)
        // Where hardly any light reaches a vertex its normalised moments are the rounding's.
        if (restricted.lights[i].intensity > 1e-6f * restricted.lights[0].intensity)
            check_same_light(&restricted.lights[i], &scattered.lights[i], restricted.header->top_size, &worst);
    printf("  worst relative difference %.2e\n", worst);
    CHECK(worst < 1e-3);
    hierarchy_free(&restricted);
    hierarchy_free(&scattered);
    fixture_destroy(&f);
}

TEST(level_count_is_the_largest_with_fewer_vertices_than_half_the_vpls)
{
    render_settings s = small_settings(16, 16, 30000);
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    hierarchy h = hierarchy_render(f.r);
    const uint32_t levels = h.header->level_count;
    CHECK(2 * h.header->levels[levels - 1].occupied < h.header->vpl_count);
    hierarchy_free(&h);
    f.r->settings.levels = levels + 1;
    h = hierarchy_render(f.r);
    CHECK(h.header->level_count == levels + 1);
    CHECK(2 * h.header->levels[levels].occupied >= h.header->vpl_count);
    hierarchy_free(&h);
    fixture_destroy(&f);
}

// Auto levels of a strip of 40 m by 1 m in the sun, where grids much finer than in a room stay below half the VPLs.
TEST(long_scenes_get_the_finer_grids_that_they_can_use)
{
    static const float strip[16] = {20, 0, 0, 0, 0, 0, -0.5f, 0, 0, 1, 0, 0, 0, 0, 0, 1};
    quad_scene q;
    quad_scene_init(&q);
    quad_add(&q, strip);
    memcpy(q.data.bounds_min, (float[3]){-20, -0.01f, -0.5f}, 12);
    memcpy(q.data.bounds_max, (float[3]){20, 0.01f, 0.5f}, 12);
    const render_settings s = small_settings(16, 16, 60000);
    renderer *r = renderer_create(device, &q.data, &s);
    r->camera = renderer_camera_of_scene(r, SCENE_NONE);
    world_sun_add(r, (float[3]){0, -1, 0.1f}, 10);
    hierarchy h = hierarchy_render(r);
    const uint32_t levels = h.header->level_count;
    printf("  %u VPLs, %u levels, S1 has %u vertices\n", h.header->vpl_count, levels,
           h.header->levels[levels - 1].occupied);
    CHECK(levels >= 8);
    CHECK(2 * h.header->levels[levels - 1].occupied < h.header->vpl_count);
    hierarchy_free(&h);
    r->settings.levels = levels + 1;
    h = hierarchy_render(r);
    CHECK(h.header->level_count == levels + 1 || levels == LGH_EXPONENTS);
    CHECK(levels == LGH_EXPONENTS || 2 * h.header->levels[levels].occupied >= h.header->vpl_count);
    hierarchy_free(&h);
    renderer_destroy(r);
}

TEST(few_and_no_vpls_are_fine)
{
    static const uint32_t counts[] = {0, 1, 2, 3, 7, 65};
    for (size_t i = 0; i < countof(counts); i++) {
        render_settings s = small_settings(16, 16, counts[i]);
        fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
        CHECK(renderer_frame(f.r));
        fixture_destroy(&f);
    }
}

// `ratio`: what the error at alpha 1 is at most, of the paper's settings at more lights per pixel.
static void check_error_falls(const char *scene, double ratio)
{
    render_settings s = small_settings(96, 54, 20000);
    s.only = ONLY_INDIRECT_UNSHADOWED;
    s.emission = EMISSION_AB;
    fixture f = fixture_create(scene, NULL, &s);
    float *reference = brute_force_render(f.r);
    double errors[5] = {1e9};
    for (uint32_t alpha = 1; alpha <= 4; alpha *= 2) {
        f.r->settings.alpha = (float)alpha;
        const comparison c = compare_with_brute_force(f.r, reference);
        printf("  %s, alpha %u: relative L2 %.4f, energy %.4f\n", strrchr(scene, '/') + 1, alpha, c.error, c.energy);
        errors[alpha] = c.error;
        CHECK(c.error < errors[alpha / 2]);
        CHECK_NEAR(c.energy, 1, 0.1);
    }
    f.r->settings.alpha = 1;
    f.r->settings.emission = EMISSION_DEMO;
    f.r->settings.blend = BLEND_PAPER;
    f.r->settings.start_level = 1;
    f.r->settings.build = LGH_BUILD_GATHER;
    const comparison paper = compare_with_brute_force(f.r, reference);
    printf("  %s, alpha 1, the paper's: relative L2 %.4f, energy %.4f\n", strrchr(scene, '/') + 1, paper.error,
           paper.energy);
    CHECK(errors[1] < ratio * paper.error);
    free(reference);
    fixture_destroy(&f);
}

TEST(error_falls_with_alpha)
{
    check_error_falls(SCENES "cornell.glb", 0.4);
    check_error_falls(SCENES "atrium.glb", 0.3);
}

// The mean of an image's red channel.
static double mean_red(renderer *r, const char *name)
{
    float *image = read_image(r, name);
    double sum = 0;
    for (size_t i = 0; i < (size_t)r->settings.width * r->settings.height; i++)
        sum += image[4 * i];
    free(image);
    return sum / ((double)r->settings.width * r->settings.height);
}

// In a scene where nothing emits.
TEST(the_parts_of_a_picture_add_up)
{
    render_settings s = small_settings(96, 54, 5000);
    s.shadow_samples = 2;
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    export_names(f.r, (const char *const[]){"aov_direct", "aov_indirect"}, 2);
    for (int frame = 0; frame < 3; frame++)
        CHECK(renderer_frame(f.r));
    float *all = read_image(f.r, "radiance"), *direct = read_image(f.r, "aov_direct"),
          *indirect = read_image(f.r, "aov_indirect");
    double worst = 0, shares[2] = {0};
    for (size_t i = 0; i < 4 * 96 * 54; i++)
        if (i % 4 != 3) {
            worst = fmax(worst, fabs((double)(direct[i] + indirect[i]) - (double)all[i]) / fmax(1, (double)all[i]));
            shares[0] += direct[i];
            shares[1] += indirect[i];
        }
    printf("  direct %.0f, indirect %.0f, off by %.1e\n", shares[0], shares[1], worst);
    CHECK(worst < 1e-5 && shares[0] > 0 && shares[1] > 0);
    free(all);
    free(direct);
    free(indirect);
    fixture_destroy(&f);
}

// A closed box of albedo 1/2 that emits 1 nit everywhere: 1 of emission, 1/2 of direct light, then 1/4 + 1/8 + 1/16 of
// three indirect bounces, whatever the place. Settles every factor between light, VPL and pixel.
static void check_furnace(const char *path, blend_method blend)
{
    render_settings s = small_settings(48, 48, 30000);
    s.alpha = 2;
    s.blend = blend;
    s.bounces = 3;
    s.shadow_samples = 4;
    fixture f = fixture_create(path, NULL, &s);
    export_names(f.r, (const char *const[]){"aov_indirect"}, 1);
    for (int frame = 0; frame < 4; frame++)
        CHECK(renderer_frame(f.r));
    const double indirect = mean_red(f.r, "aov_indirect"), radiance = mean_red(f.r, "radiance");
    printf("  indirect %.4f of 0.4375, all %.4f of 1.9375\n", indirect, radiance);
    CHECK_NEAR(indirect / 0.4375, 1, 0.02);
    CHECK_NEAR(radiance / 1.9375, 1, 0.02); // no shadow in a convex room
    fixture_destroy(&f);
}

TEST(the_furnace_has_its_closed_form)
{
    static const char path[] = "../shared/scenes/cornell/furnace.gltf";
    FILE *file = fopen(path, "rb");
    if (!file) {
        printf("  skipped: no %s\n", path);
        return;
    }
    fclose(file);
    check_furnace(path, BLEND_PAPER); // measured: 1.0007
    check_furnace(path, BLEND_LATE); // 0.986: its levels agree less on what each leaves to the next
}

TEST(start_level_0_and_a_wide_alpha_give_the_brute_force_sum)
{
    render_settings s = small_settings(48, 27, 600);
    s.only = ONLY_INDIRECT_UNSHADOWED;
    s.start_level = 0;
    s.alpha = 16;
    s.levels = 2;
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    float *reference = brute_force_render(f.r);
    const comparison c = compare_with_brute_force(f.r, reference);
    printf("  relative L2 %.2e, energy %.6f\n", c.error, c.energy);
    CHECK(c.error < 1e-4); // every pixel lies within r_0 of every VPL
    free(reference);
    fixture_destroy(&f);
}

TEST(interleaving_conserves_energy)
{
    render_settings s = small_settings(96, 54, 20000);
    s.only = ONLY_INDIRECT_UNSHADOWED;
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    double sums[3] = {0};
    for (uint32_t i = 0; i < 3; i++) {
        f.r->settings.interleave = 1u << i;
        export_names(f.r, (const char *const[]){"indirect_gathered|indirect"}, 1);
        CHECK(renderer_frame(f.r));
        float *image = read_image(f.r, "indirect_gathered|indirect");
        for (size_t p = 0; p < 96 * 54; p++)
            sums[i] += image[4 * p];
        free(image);
    }
    printf("  2x2: %.4f, 4x4: %.4f of the light without interleaving\n", sums[1] / sums[0], sums[2] / sums[0]);
    CHECK_NEAR(sums[1] / sums[0], 1, 0.02);
    CHECK_NEAR(sums[2] / sums[0], 1, 0.04);
    fixture_destroy(&f);
}

// The light that reservoir k of a pixel chose; RESERVOIR_EMPTY: none.
static const uint32_t RESERVOIR_EMPTY = 0xffffffffu;
static uint32_t reservoir_light(const uint32_t *reservoirs, uint32_t lighting, size_t pixel, int k, int samples)
{
    if (lighting == LIGHTING_GATHER)
        return reservoirs[pixel * (samples + 1) + 1 + k];
    return reservoirs[2 * (pixel * samples + k)]; // low word of a 64-bit key
}

static void check_reservoirs(uint32_t lighting)
{
    enum { WIDTH = 64, HEIGHT = 36, SAMPLES = 4 };
    // Gather spreads a pixel's reservoirs apart, so that only those of different pixels are independent: it is tested
    // by one a pixel, in turn.
    const int stride = lighting == LIGHTING_GATHER ? SAMPLES : 1;
    render_settings s = small_settings(WIDTH, HEIGHT, 60);
    s.levels = 2;
    s.shadow_samples = SAMPLES;
    s.start_level = 1; // VPLs have names of their own
    s.lighting = lighting;
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    selection *pass = renderer_pass_add(f.r, "selection", sizeof *pass, selection_setup, selection_fini);
    pass->pipeline =
        gpu_compute_pipeline_create(device, &(gpu_compute_pipeline_desc){.shader = &shader_selection_comp});
    export_names(f.r, (const char *const[]){"selection_weights", "reservoirs", "lgh_header"}, 3);
    double picked[SELECTION_LIGHTS] = {0}, expected[SELECTION_LIGHTS] = {0}, variance[SELECTION_LIGHTS] = {0};
    for (int frame = 0; frame < 8; frame++) {
        CHECK(renderer_frame(f.r));
        float *weights = read_buffer(f.r, "selection_weights");
        uint32_t *reservoirs = read_buffer(f.r, "reservoirs");
        lgh_header *header = read_buffer(f.r, "lgh_header");
        CHECK(header->level_count == 2 && header->light_count <= SELECTION_LIGHTS);
        for (size_t pixel = 0; pixel < WIDTH * HEIGHT; pixel++) {
            double sum = 0;
            for (int i = 0; i < SELECTION_LIGHTS; i++)
                sum += weights[pixel * SELECTION_LIGHTS + i];
            for (int i = 0; sum > 0 && i < SELECTION_LIGHTS; i++) {
                const double p = weights[pixel * SELECTION_LIGHTS + i] / sum;
                expected[i] += SAMPLES / stride * p;
                variance[i] += SAMPLES / stride * p * (1 - p);
            }
            for (int k = (int)pixel % stride; k < SAMPLES; k += stride) {
                const uint32_t light = reservoir_light(reservoirs, lighting, pixel, k, SAMPLES);
                CHECK((light == RESERVOIR_EMPTY) == (sum == 0));
                if (light != RESERVOIR_EMPTY)
                    picked[light]++;
            }
        }
        free(weights);
        free(reservoirs);
        free(header);
    }
    double chi_squared = 0;
    int lights = 0;
    for (int i = 0; i < SELECTION_LIGHTS; i++) {
        CHECK(picked[i] == 0 || expected[i] > 0);
        if (variance[i] > 10) { // enough for the normal approximation
            chi_squared += (picked[i] - expected[i]) * (picked[i] - expected[i]) / variance[i];
            lights++;
        }
    }
    // 99.9 % quantile of chi squared by Wilson and Hilferty's approximation.
    const double n = lights, quantile = n * pow(1 - 2 / (9 * n) + 3.09 * sqrt(2 / (9 * n)), 3);
    printf("  chi squared %.1f over %d lights, 99.9 %% quantile %.1f\n", chi_squared, lights, quantile);
    CHECK(lights >= 8);
    CHECK(chi_squared < quantile);
    CHECK(chi_squared > n * 0.3); // suspiciously good is wrong as well
    fixture_destroy(&f);
}

TEST(exact_reservoirs_pick_light_i_with_probability_f_i)
{
    check_reservoirs(LIGHTING_VOLUMES);
}

TEST(gathered_reservoirs_pick_light_i_with_probability_f_i)
{
    check_reservoirs(LIGHTING_GATHER);
}

// ---- Gather lighting

// The light and the numbers of lights of one frame, in the tiled layout; free() both.
typedef struct lighting_result {
    float *light, *count; // RGBA, R
    size_t texels;
} lighting_result;

static lighting_result lighting_render(renderer *r, uint32_t lighting)
{
    r->settings.lighting = lighting;
    r->count_lights = true;
    export_names(r, (const char *const[]){"indirect", "lights_per_pixel"}, 2);
    CHECK(renderer_frame(r));
    const gpu_image_desc *info = gpu_image_info(r->gpu, frame_graph_find_image(r->graph, "indirect"));
    return (lighting_result){read_image(r, "indirect"), read_image(r, "lights_per_pixel"),
                             (size_t)info->width * info->height};
}

static void lighting_result_free(lighting_result *result)
{
    free(result->light);
    free(result->count);
}

static void check_gather_equals_volumes(renderer *r, const char *what)
{
    lighting_result gathered = lighting_render(r, LIGHTING_GATHER), drawn = lighting_render(r, LIGHTING_VOLUMES);
    CHECK(gathered.texels == drawn.texels);
    double difference = 0, square = 0, lights = 0;
    size_t miscounted = 0;
    for (size_t i = 0; i < gathered.texels; i++) {
        for (int c = 0; c < 3; c++) {
            const double a = gathered.light[4 * i + c], b = drawn.light[4 * i + c];
            difference += (a - b) * (a - b);
            square += b * b;
        }
        miscounted += gathered.count[i] != drawn.count[i];
        lights += gathered.count[i];
    }
    printf("  %s: relative L2 %.1e, %.1f lights per pixel, other numbers at %zu of %zu pixels\n", what,
           sqrt(difference / square), lights / (double)gathered.texels, miscounted, gathered.texels);
    CHECK(square > 0);
    CHECK(sqrt(difference / square) < 1e-4);
    // Where the rounding of a distance decides whether a blending function is zero.
    CHECK(miscounted <= gathered.texels / 200);
    lighting_result_free(&gathered);
    lighting_result_free(&drawn);
}

TEST(gathering_adds_up_the_lights_of_the_volumes)
{
    static const struct {
        const char *name, *scene, *camera;
        uint32_t vpls, levels, start_level, interleave;
        float alpha;
    } cases[] = {
        {"atrium", SCENES "atrium.glb", NULL, 30000, 0, 1, 1, 1},
        {"2x2", SCENES "atrium.glb", NULL, 30000, 0, 1, 2, 1},
        {"4x4", SCENES "cornell.glb", NULL, 10000, 0, 1, 4, 1},
        {"pixels outside the lights' box", SCENES "two_rooms.glb", "unlit", 5000, 0, 1, 1, 1},
        {"alpha 0.4", SCENES "cornell.glb", NULL, 5000, 0, 1, 1, 0.4f},
        {"alpha 2", SCENES "atrium.glb", NULL, 5000, 0, 1, 1, 2},
        {"alpha 2.7, 2x2", SCENES "cornell.glb", NULL, 5000, 0, 1, 2, 2.7f},
        {"alpha 16", SCENES "cornell.glb", NULL, 1000, 0, 1, 1, 16},
        {"one level", SCENES "cornell.glb", NULL, 1000, 1, 1, 1, 1},
        {"one level, from the VPLs", SCENES "cornell.glb", NULL, 1000, 1, 0, 1, 1},
        {"from the VPLs", SCENES "cornell.glb", NULL, 5000, 0, 0, 1, 1},
        {"from the VPLs, 2x2, alpha 1.5", SCENES "cornell.glb", NULL, 5000, 0, 0, 2, 1.5f},
        {"ten levels", SCENES "cornell.glb", NULL, 300, LGH_EXPONENTS, 1, 1, 1},
        {"one VPL", SCENES "cornell.glb", NULL, 1, 0, 1, 1, 1},
    };
    for (size_t i = 0; i < countof(cases); i++) {
        render_settings s = small_settings(101, 57, cases[i].vpls); // of odd sizes tiles are padded
        s.levels = cases[i].levels;
        s.start_level = cases[i].start_level;
        s.interleave = cases[i].interleave;
        s.alpha = cases[i].alpha;
        s.only = ONLY_INDIRECT_UNSHADOWED;
        fixture f = fixture_create(cases[i].scene, cases[i].camera, &s);
        check_gather_equals_volumes(f.r, cases[i].name);
        fixture_destroy(&f);
    }
}

// Lists that find no room are replaced by all lights of the level: the same light, to the bit, from the same lights.
// With rays to the centres, the luminance of U is that of the light from which the samples were picked.
TEST(gathered_samples_stand_for_all_of_the_light)
{
    static const char *const exports[] = {"shadow_u", "indirect", "reservoirs"};
    for (uint32_t start_level = 0; start_level < 2; start_level++) {
        render_settings s = small_settings(96, 64, 5000);
        s.start_level = start_level;
        s.shadow_samples = 4;
        s.end_point = END_POINT_CENTRE;
        fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
        export_names(f.r, exports, countof(exports));
        CHECK(renderer_frame(f.r));
        float *u = read_image(f.r, "shadow_u"), *light = read_image(f.r, "indirect");
        uint32_t *words = read_buffer(f.r, "reservoirs"), of_vpls = 0;
        double worst = 0;
        for (size_t i = 0; i < 96 * 64; i++) {
            const double a = 0.2126 * u[4 * i] + 0.7152 * u[4 * i + 1] + 0.0722 * u[4 * i + 2];
            const double b = 0.2126 * light[4 * i] + 0.7152 * light[4 * i + 1] + 0.0722 * light[4 * i + 2];
            worst = fmax(worst, b > 0 ? fabs(a - b) / b : 0);
            for (uint32_t k = 1; k <= 4; k++)
                of_vpls += words[5 * i + k] != UINT32_MAX && words[5 * i + k] >> 31;
        }
        printf("  start level %u: U off by %.1e at worst, %u samples of VPLs\n", start_level, worst, of_vpls);
        CHECK(worst < 1e-3);
        CHECK((of_vpls > 0) == (start_level == 0));
        free(u);
        free(light);
        free(words);
        fixture_destroy(&f);
    }
}

TEST(lists_that_do_not_fit_change_nothing)
{
    static const char *const names[] = {"indirect", "reservoirs"};
    for (uint32_t start_level = 0; start_level < 2; start_level++) {
        render_settings s = small_settings(64, 36, 3000);
        s.start_level = start_level;
        s.shadow_samples = 4;
        s.interleave = 1 + start_level;
        fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
        float *light[2];
        uint32_t *reservoirs[2];
        static const uint32_t entries[] = {0, 500}; // 0: enough
        for (int i = 0; i < 2; i++) {
            f.r->gather_entries = entries[i];
            f.r->frame = 0; // the same random numbers
            export_names(f.r, names, countof(names));
            CHECK(renderer_frame(f.r));
            light[i] = read_image(f.r, "indirect");
            reservoirs[i] = read_buffer(f.r, "reservoirs");
        }
        if (start_level == 1) {
            CHECK(memcmp(light[0], light[1], 64 * 36 * 16) == 0);
            CHECK(memcmp(reservoirs[0], reservoirs[1], 64 * 36 * 5 * 4) == 0);
        }
        double difference = 0, sum = 0;
        for (size_t k = 0; k < 64 * 36 * 4; k++) {
            difference += fabs(light[0][k] - light[1][k]);
            sum += light[0][k];
        }
        printf("  start level %u: relative difference %.1e\n", start_level, difference / sum);
        CHECK(sum > 0 && difference <= 1e-5 * sum); // the VPLs' lists are in another order than the VPLs
        for (int i = 0; i < 2; i++) {
            free(light[i]);
            free(reservoirs[i]);
        }
        fixture_destroy(&f);
    }
}

static double mean_radiance(const char *camera, uint32_t end)
{
    render_settings s = small_settings(64, 36, 20000);
    s.end_point = end;
    s.shadow_samples = 4;
    s.frames = 4;
    fixture f = fixture_create(SCENES "two_rooms.glb", camera, &s);
    for (int frame = 0; frame < 4; frame++)
        CHECK(renderer_frame(f.r));
    float *image = read_image(f.r, "radiance");
    double sum = 0;
    for (size_t i = 0; i < 64 * 36; i++)
        sum += image[4 * i] + image[4 * i + 1] + image[4 * i + 2];
    free(image);
    fixture_destroy(&f);
    return sum / (3 * 64 * 36);
}

TEST(a_thin_wall_keeps_the_light_out)
{
    static const char *const names[] = {"centre", "jitter", "vpl"};
    for (uint32_t end = END_POINT_CENTRE; end <= END_POINT_VPL; end++) {
        const double lit = mean_radiance("lit", end), unlit = mean_radiance("unlit", end);
        printf("  %s: %.3g nits in the lit room, %.3g in the unlit one: %.3f %%\n", names[end], lit, unlit,
               100 * unlit / lit);
        CHECK(lit > 0);
        if (end == END_POINT_CENTRE)
            CHECK(unlit < 0.01 * lit);
    }
}

// Every byte of what the last of some frames shows, hashed (FNV-1a).
static uint64_t radiance_hash(render_settings s)
{
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    for (int frame = 0; frame < 3; frame++)
        CHECK(renderer_frame(f.r));
    float *image = read_image(f.r, "radiance");
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < 16ull * s.width * s.height; i++)
        hash = (hash ^ ((const uint8_t *)image)[i]) * 0x100000001b3u;
    free(image);
    fixture_destroy(&f);
    return hash;
}

TEST(two_runs_give_the_same_bytes)
{
    for (uint32_t i = 0; i < 6; i++) {
        render_settings s = small_settings(64, 36, 5000);
        s.lighting = i < 3 ? LIGHTING_GATHER : LIGHTING_VOLUMES;
        s.shadow_samples = 4;
        s.interleave = 1u << i % 3;
        s.end_point = i % 3;
        CHECK(radiance_hash(s) == radiance_hash(s));
    }
}

TEST(every_variant_renders)
{
    render_settings s = small_settings(48, 27, 2000);
    fixture f = fixture_create(SCENES "cornell.glb", NULL, &s);
    f.r->count_lights = true;
    for (uint32_t i = 0; i < 128; i++) {
        f.r->settings.lighting = i & 64 ? LIGHTING_VOLUMES : LIGHTING_GATHER;
        f.r->settings.reservoirs = i & 1 ? RESERVOIRS_UNLOCKED : RESERVOIRS_EXACT;
        f.r->settings.sampling = i & 2 ? SAMPLING_UNIFORM : SAMPLING_IMPORTANCE;
        f.r->settings.start_level = i & 4 ? 0 : 1;
        f.r->settings.sample_s1 = i & 8;
        f.r->settings.interleave = i & 16 ? 2 : 1;
        f.r->settings.shadow_samples = i & 32 ? 8 : 1;
        f.r->settings.end_point = i % 3;
        CHECK(renderer_frame(f.r));
        float *image = read_image(f.r, "radiance");
        double sum = 0;
        for (size_t p = 0; p < 48 * 27; p++)
            sum += image[4 * p];
        CHECK(isfinite(sum) && sum > 0);
        free(image);
    }
    fixture_destroy(&f);
}

TEST(the_validation_layer_has_nothing_to_say)
{
    CHECK(gpu_validation_messages(device) == 0);
}

int main(void)
{
    device = gpu_create(&(gpu_desc){.validation = true});
    if (!device) {
        printf("skipped: no usable device\n");
        return 77;
    }
    RUN(blending_functions_sum_to_one);
    RUN(every_level_carries_the_flux_of_the_vpls);
    RUN(other_ways_to_build_carry_the_flux_too);
    RUN(restriction_equals_scattering);
    RUN(level_count_is_the_largest_with_fewer_vertices_than_half_the_vpls);
    RUN(long_scenes_get_the_finer_grids_that_they_can_use);
    RUN(few_and_no_vpls_are_fine);
    RUN(error_falls_with_alpha);
    RUN(the_parts_of_a_picture_add_up);
    RUN(the_furnace_has_its_closed_form);
    RUN(start_level_0_and_a_wide_alpha_give_the_brute_force_sum);
    RUN(interleaving_conserves_energy);
    RUN(exact_reservoirs_pick_light_i_with_probability_f_i);
    RUN(gathered_reservoirs_pick_light_i_with_probability_f_i);
    RUN(gathering_adds_up_the_lights_of_the_volumes);
    RUN(gathered_samples_stand_for_all_of_the_light);
    RUN(lists_that_do_not_fit_change_nothing);
    RUN(a_thin_wall_keeps_the_light_out);
    RUN(two_runs_give_the_same_bytes);
    RUN(every_variant_renders);
    RUN(the_validation_layer_has_nothing_to_say);
    gpu_destroy(device);
    return test_end();
}
