// The path tracer against closed forms, its estimate of its own error, and its state in files.
#include "modules/progressive.h"
#include "modules/world.h"
#include "quad_scene.h"
#include "scene_test.h"

#include <sys/stat.h>

#define CORNELL BUILD_DIR "/scenes/cornell.glb"

static gpu *device;

typedef float texel[4];

// ---- Pictures

static renderer *renderer_of(const scene_data *scene, uint32_t side)
{
    render_settings settings = render_settings_default();
    settings.method = METHOD_PATH;
    settings.width = settings.height = side;
    settings.vpls = 0;
    renderer *r = scene ? renderer_create(device, scene, &settings) : NULL;
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    return r;
}

static size_t pixel_count(const renderer *r)
{
    return (size_t)r->settings.width * r->settings.height;
}

// Until `spp` samples are done.
static progressive_status picture_finish(renderer *r, uint32_t spp)
{
    r->settings.spp = spp;
    progressive_status status;
    do {
        CHECK(renderer_frame(r));
        status = progressive_status_get(r, true);
    } while (!r->failed && !status.finished);
    return status;
}

static texel *radiance_read(renderer *r)
{
    texel *texels = memory_alloc(pixel_count(r) * sizeof *texels);
    const gpu_image image = frame_graph_find_image(r->graph, "radiance");
    CHECK(image.id &&
          gpu_image_read(device, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, pixel_count(r) * sizeof *texels));
    return texels;
}

static texel *picture_of(renderer *r, uint32_t spp)
{
    picture_finish(r, spp);
    return radiance_read(r);
}

static double mean_of(const texel *texels, size_t pixels)
{
    double sum = 0;
    for (size_t i = 0; i < pixels; i++)
        for (int k = 0; k < 3; k++)
            sum += (double)texels[i][k];
    return sum / (3 * (double)pixels);
}

static double relative_l2(const texel *a, const texel *b, size_t pixels)
{
    double error = 0, square = 0;
    for (size_t i = 0; i < pixels; i++)
        for (int k = 0; k < 3; k++) {
            const double x = (double)a[i][k], y = (double)b[i][k];
            error += (x - y) * (x - y);
            square += y * y;
        }
    return sqrt(error / square);
}

// ---- Scenes

// A quad about `centre`; it faces the cross product of its half edges.
static material *quad_place(quad_scene *s, const float centre[3], const float across[3], const float up[3])
{
    const float normal[3] = {across[1] * up[2] - across[2] * up[1], across[2] * up[0] - across[0] * up[2],
                             across[0] * up[1] - across[1] * up[0]};
    const float matrix[16] = {across[0], across[1], across[2], 0, up[0],     up[1],     up[2],     0,
                              normal[0], normal[1], normal[2], 0, centre[0], centre[1], centre[2], 1};
    return quad_add(s, matrix);
}

static void color_set(float color[3], float value)
{
    color[0] = color[1] = color[2] = value;
}

// The inside of a cube of 2 m, all faces alike.
static void furnace_init(quad_scene *s, float albedo, float emission)
{
    quad_scene_init(s);
    for (int axis = 0; axis < 3; axis++)
        for (float side = -1; side <= 1; side += 2) {
            float centre[3] = {0}, across[3] = {0}, up[3] = {0};
            centre[axis] = side;
            across[(axis + 1) % 3] = -side;
            up[(axis + 2) % 3] = 1;
            material *m = quad_place(s, centre, across, up);
            color_set(m->base_color, albedo);
            color_set(m->emissive, emission);
        }
}

// A floor of 4 m x 4 m, and a square lamp of 5 nits that faces it from `height`, `half_width` and `half_depth` about
// the axis at `x`.
static material *lamp_init(quad_scene *s, float height, float half_width, float half_depth, float x)
{
    quad_scene_init(s);
    quad_place(s, (float[3]){0, 0, 0}, (float[3]){0, 0, 2}, (float[3]){2, 0, 0});
    material *m = quad_place(s, (float[3]){x, height, 0}, (float[3]){half_width, 0, 0}, (float[3]){0, 0, half_depth});
    color_set(m->emissive, 5);
    return m;
}

static const render_camera floor_camera = {
    .eye = {0.2f, 3, 2.5f}, .target = {0, 0, 0.3f}, .up = {0, 1, 0}, .yfov = 0.7f, .near_plane = 0.01f};

// The light at the transform of the node; spots and suns shine straight down, a little aside.
static light_component *light_add(renderer *r, uint32_t type, const float position[3], float intensity)
{
    const world_gpu *w = r->gpu_world;
    const entity e = ecs_entity_create(r->world);
    const node_component node = {
        .matrix = {1, 0, 0, 0, 0, 0.28f, -0.96f, 0, 0, 0.96f, 0.28f, 0, position[0], position[1], position[2], 1}};
    *(node_component *)ecs_add(r->world, e, w->node) = node;
    ecs_add(r->world, e, w->transform);
    light_component *light = ecs_add(r->world, e, w->light);
    *light = (light_component){
        .type = type, .color = {intensity, intensity, intensity}, .inner_cone = 0.3f, .outer_cone = 0.9f};
    return light;
}

// ---- Closed forms

static double series(double ratio, int terms)
{
    double sum = 0;
    for (int i = 0; i < terms; i++)
        sum += pow(ratio, i);
    return sum;
}

// L = E (1 + rho + ... + rho^(B+1)); by many independent pictures, which tell each pixel's standard error.
static void furnace_check(uint32_t bounces)
{
    enum { SIDE = 16, PIXELS = SIDE * SIDE, PICTURES = 64, SPP = 8 };
    static quad_scene s;
    furnace_init(&s, 0.5f, 1);
    renderer *r = renderer_of(&s.data, SIDE);
    r->camera = (render_camera){
        .eye = {0.3f, 0.2f, 0.1f}, .target = {-1, -0.5f, -1}, .up = {0, 1, 0}, .yfov = 1.5f, .near_plane = 0.01f};
    r->settings.bounces = bounces;
    double sum[PIXELS] = {0}, square[PIXELS] = {0}, mean = 0, worst = 0;
    for (uint32_t picture = 0; picture < PICTURES; picture++) {
        r->settings.seed = picture;
        texel *radiance = picture_of(r, SPP);
        for (int i = 0; i < PIXELS; i++) {
            sum[i] += (double)radiance[i][1] / PICTURES;
            square[i] += (double)radiance[i][1] * (double)radiance[i][1] / PICTURES;
        }
        free(radiance);
    }
    const double expected = series(0.5, (int)bounces + 2);
    for (int i = 0; i < PIXELS; i++) {
        const double error = sqrt((square[i] - sum[i] * sum[i]) / (PICTURES - 1));
        worst = fmax(worst, fabs(sum[i] - expected) / error);
        mean += sum[i] / PIXELS;
    }
    printf("  %u bounces: mean %.5f, expected %.5f; worst pixel %.2f standard errors off\n", bounces, mean, expected,
           worst);
    CHECK_NEAR(mean, expected, 0.005 * expected);
    CHECK(worst < 5);
    renderer_destroy(r);
}

TEST(furnace_has_the_sum_of_its_series)
{
    furnace_check(0);
    furnace_check(1);
    furnace_check(3);
}

// A sphere of radius 2 from inside, as a mesh in rings.
enum { RINGS = 48, SECTORS = 96 };
typedef struct sphere_scene {
    scene_data data;
    scene_node node;
    scene_mesh mesh;
    mesh_primitive primitive;
    material material;
    float positions[(RINGS + 1) * SECTORS][3];
    vertex_attributes attributes[(RINGS + 1) * SECTORS];
    uint32_t indices[6 * RINGS * SECTORS];
} sphere_scene;

static void sphere_init(sphere_scene *s, float radius, float albedo)
{
    uint32_t count = 0;
    for (uint32_t ring = 0; ring <= RINGS; ring++)
        for (uint32_t sector = 0; sector < SECTORS; sector++) {
            const double theta = M_PI * ring / RINGS, phi = 2 * M_PI * sector / SECTORS;
            const double n[3] = {sin(theta) * cos(phi), cos(theta), sin(theta) * sin(phi)};
            const uint32_t i = ring * SECTORS + sector;
            for (int k = 0; k < 3; k++) {
                s->positions[i][k] = (float)(radius * n[k]);
                s->attributes[i].normal[k] = (float)-n[k];
            }
            s->attributes[i].color_rg = s->attributes[i].color_ba = ~0u;
            const uint32_t right = ring * SECTORS + (sector + 1) % SECTORS;
            const uint32_t quad[6] = {i, i + SECTORS, right, right, i + SECTORS, right + SECTORS};
            for (int half = 0; half < 2 && ring < RINGS; half++) {
                if (ring != (half ? RINGS - 1 : 0)) { // at the poles one of the two has no area
                    memcpy(&s->indices[count], quad + 3 * (1 - half), 3 * sizeof(uint32_t));
                    count += 3;
                }
            }
        }
    const texture_reference none = {.texture = TEXTURE_NONE, .transform = {1, 0, 0, 1}};
    s->material = (material){.base_color = {albedo, albedo, albedo, 1},
                             .base_texture = none,
                             .emissive_texture = none,
                             .normal_texture = none,
                             .metallic_roughness_texture = none};
    s->node = (scene_node){
        .name = "sphere", .parent = SCENE_NONE, .camera = SCENE_NONE, .light = SCENE_NONE, .skin = SCENE_NONE};
    memcpy(s->node.matrix, IDENTITY, sizeof s->node.matrix);
    s->mesh = (scene_mesh){.primitive_count = 1, .deformation = SCENE_NONE};
    s->primitive = (mesh_primitive){.index_count = count, .vertex_count = (RINGS + 1) * SECTORS};
    scene_primitive_reorder(s->indices, count, (const float(*)[3])s->positions);
    s->data = (scene_data){
        .path = "sphere",
        .nodes = &s->node,
        .node_count = 1,
        .meshes = &s->mesh,
        .mesh_count = 1,
        .primitives = &s->primitive,
        .primitive_count = 1,
        .positions = s->positions,
        .attributes = s->attributes,
        .vertex_count = (RINGS + 1) * SECTORS,
        .indices = s->indices,
        .index_count = count,
        .materials = &s->material,
        .material_count = 1,
    };
}

// L = rho/pi I/R^2 (1 + rho + ... + rho^B).
TEST(point_light_in_a_sphere_has_the_sum_of_its_series)
{
    const float radius = 2, albedo = 0.7f, candela = 100;
    static sphere_scene s;
    sphere_init(&s, radius, albedo);
    renderer *r = renderer_of(&s.data, 32);
    light_add(r, LIGHT_POINT, (float[3]){0, 0, 0}, candela);
    r->camera = (render_camera){.target = {-1, 0.3f, -1}, .up = {0, 1, 0}, .yfov = 1.2f, .near_plane = 0.01f};
    for (uint32_t bounces = 0; bounces <= 4; bounces += bounces ? 3 : 1) {
        r->settings.bounces = bounces;
        texel *radiance = picture_of(r, 16);
        const double expected = (double)albedo / M_PI * 100 / 4 * series((double)albedo, (int)bounces + 1);
        const double mean = mean_of(radiance, pixel_count(r));
        printf("  %u bounces: mean %.5f, expected %.5f\n", bounces, mean, expected);
        CHECK_NEAR(mean, expected, 0.005 * expected);
        free(radiance);
    }
    renderer_destroy(r);
}

// ---- Direct light against the renderer's own closed forms (device_direct_light.c checks those)

static texel *direct_light_exact(renderer *r)
{
    r->camera = floor_camera;
    r->settings.method = METHOD_LGH;
    r->settings.only = ONLY_DIRECT;
    r->settings.vpls = 0;
    CHECK(renderer_frame(r));
    r->settings.method = METHOD_PATH;
    return radiance_read(r);
}

// The whole picture's mean against the exact light; frees that.
static void direct_check_against(const char *what, renderer *r, texel *exact, uint32_t spp, double tolerance)
{
    r->camera = floor_camera;
    r->settings.only = ONLY_DIRECT;
    texel *radiance = picture_of(r, spp);
    const double ratio = mean_of(radiance, pixel_count(r)) / mean_of(exact, pixel_count(r));
    printf("  %s: mean over closed form %.5f, relative L2 %.5f\n", what, ratio,
           relative_l2(radiance, exact, pixel_count(r)));
    CHECK_NEAR(ratio, 1, tolerance);
    free(exact);
    free(radiance);
}

static void direct_check(const char *what, renderer *r, uint32_t spp, double tolerance)
{
    direct_check_against(what, r, direct_light_exact(r), spp, tolerance);
}

TEST(punctual_lights_are_exact)
{
    static const char *const names[] = {"point", "spot", "sun"};
    static quad_scene s;
    for (uint32_t type = LIGHT_POINT; type <= LIGHT_DIRECTIONAL; type++) {
        quad_scene_init(&s);
        quad_place(&s, (float[3]){0, 0, 0}, (float[3]){0, 0, 2}, (float[3]){2, 0, 0});
        renderer *r = renderer_of(&s.data, 32);
        light_add(r, type, (float[3]){0.1f, 1.5f, 0.2f}, 10);
        direct_check(names[type], r, 1, 1e-4); // rays leave a little off the surface
        renderer_destroy(r);
    }
}

TEST(a_weak_light_beside_strong_ones_is_not_lost)
{
    static quad_scene s;
    quad_scene_init(&s);
    quad_place(&s, (float[3]){0, 0, 0}, (float[3]){0, 0, 2}, (float[3]){2, 0, 0});
    renderer *r = renderer_of(&s.data, 64);
    light_add(r, LIGHT_SPOT, (float[3]){50, 5, 0}, 1e9f); // lights only what is far away
    for (int i = 0; i < 5; i++)
        light_add(r, LIGHT_POINT, (float[3]){0.1f * (float)i, 1.5f, 0.2f}, 1 + (float)i);
    direct_check("five weak lights beside a strong one", r, 256, 0.005);
    renderer_destroy(r);
}

// Far away the samples of the lamp decide, close to it the directions that hit it by chance; and their sum is right.
TEST(square_lamps_have_their_closed_form)
{
    static const float heights[] = {1, 0.02f};
    static quad_scene s;
    for (size_t i = 0; i < countof(heights); i++) {
        lamp_init(&s, heights[i], 0.5f, 0.5f, 0);
        renderer *r = renderer_of(&s.data, 64);
        char what[32];
        snprintf(what, sizeof what, "lamp at %g m", (double)heights[i]);
        direct_check(what, r, 256, 0.005);
        renderer_destroy(r);
    }
}

TEST(double_sided_lamp_shines_to_both_sides)
{
    static quad_scene s;
    lamp_init(&s, 0.5f, 0.4f, -0.4f, 0)->flags = MATERIAL_DOUBLE_SIDED; // its back towards the floor
    renderer *r = renderer_of(&s.data, 64);
    direct_check("double-sided lamp from behind", r, 64, 0.005);
    renderer_destroy(r);

    s.materials[1].flags = 0;
    r = renderer_of(&s.data, 64);
    r->camera = floor_camera;
    r->camera.eye[1] = 0.4f; // below the lamp, so that only the floor is seen
    texel *radiance = picture_of(r, 16);
    CHECK(mean_of(radiance, pixel_count(r)) == 0);
    free(radiance);
    renderer_destroy(r);
}

TEST(lamp_beside_a_strong_sun_has_its_closed_form)
{
    static quad_scene s;
    lamp_init(&s, 0.2f, 0.5f, 0.5f, 0);
    renderer *r = renderer_of(&s.data, 64);
    // Below the floor's horizon, so that it lights nothing.
    light_add(r, LIGHT_DIRECTIONAL, (float[3]){0, 0, 0}, 1e7f);
    for (ecs_iterator it = ecs_iterate(r->world, r->gpu_world->light); ecs_next(&it);) {
        node_component *node = ecs_get(r->world, it.entity, r->gpu_world->node);
        memcpy(node->matrix, (const float[16]){1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1}, sizeof node->matrix);
    }
    direct_check("lamp beside a strong sun", r, 64, 0.005);
    renderer_destroy(r);
}

// Half of the lamp is dark, by its emissive texture or by a hole in its base colour's alpha: the other half is a lamp
// of half the width. The hole's rim is where the filter mixes both, so it is drawn with a nearest filter.
static void half_lamp_check(const char *what, bool masked)
{
    static quad_scene whole, half;
    uint8_t texels[2][4] = {{255, 255, 255, 255}, {0, 0, 0, 0}};
    material *m = lamp_init(&whole, 0.3f, 0.5f, 0.5f, 0);
    texture_set(&whole, texels[0], 2, 1, false);
    if (masked) {
        m->base_texture.texture = 0;
        m->flags = MATERIAL_ALPHA_MASK;
    } else {
        m->emissive_texture.texture = 0;
    }
    lamp_init(&half, 0.3f, 0.25f, 0.5f, -0.25f);
    renderer *r = renderer_of(&half.data, 64);
    texel *exact = direct_light_exact(r);
    renderer_destroy(r); // a device holds one scene at a time
    r = renderer_of(&whole.data, 64);
    direct_check_against(what, r, exact, 512, 0.005);
    renderer_destroy(r);
}

TEST(textured_lamps_shine_where_their_texture_does)
{
    half_lamp_check("half dark by texture", false);
    half_lamp_check("half cut out by alpha", true);
}

// A bright spot that the few points miss by which a triangle's mean emission is known: the triangle is not among the
// emitters, and what hits it by chance counts in full.
TEST(spots_that_are_no_known_emitters_shine_too)
{
    enum { TEXELS = 16 };
    static quad_scene s;
    static uint8_t texels[TEXELS * TEXELS][4];
    memset(texels, 0, sizeof texels);
    memset(texels[10 * TEXELS + 6], 255, sizeof texels[0]);
    const float side = 1.0f / TEXELS, x = 6.5f * side - 0.5f, z = 10.5f * side - 0.5f;
    lamp_init(&s, 0.5f, 0.5f * side, 0.5f * side, x);
    s.nodes[1].matrix[14] = -z; // v runs against the node's y axis, which is the world's z
    renderer *r = renderer_of(&s.data, 64);
    texel *exact = direct_light_exact(r);
    renderer_destroy(r);

    lamp_init(&s, 0.5f, 0.5f, 0.5f, 0)->emissive_texture.texture = 0;
    texture_set(&s, texels[0], TEXELS, TEXELS, false);
    // Another lamp that shines away from the floor, so that emitters are looked for at all.
    material *m = quad_place(&s, (float[3]){0, -1, 0}, (float[3]){1, 0, 0}, (float[3]){0, 0, 1});
    color_set(m->emissive, 1);
    r = renderer_of(&s.data, 64);
    // One ray in 200 meets the spot, so this is noisy; weights as if samples reached it would lose a third.
    direct_check_against("spot", r, exact, 2048, 0.05);
    CHECK(r->constants.emitter_count == 2);
    renderer_destroy(r);
}

TEST(direct_and_indirect_light_add_up)
{
    scene_data *scene = scene_load(CORNELL);
    renderer *r = renderer_of(scene, 32);
    texel *pictures[3]; // all, direct, indirect
    for (uint32_t only = ONLY_ALL; only <= ONLY_INDIRECT; only++) {
        r->settings.only = only;
        pictures[only] = picture_of(r, 8);
    }
    double worst = 0, indirect = 0;
    for (size_t i = 0; i < pixel_count(r); i++)
        for (int k = 0; k < 3; k++) {
            const double sum = (double)pictures[1][i][k] + (double)pictures[2][i][k], all = (double)pictures[0][i][k];
            worst = fmax(worst, fabs(all - sum) / fmax(all, 1e-3));
            indirect += (double)pictures[2][i][k];
        }
    CHECK(worst < 1e-5); // the same random numbers, so but for rounding
    CHECK(indirect > 0);
    for (int i = 0; i < 3; i++)
        free(pictures[i]);
    r->settings.only = ONLY_INDIRECT_UNSHADOWED;
    log_clear();
    CHECK(!renderer_frame(r) && test_log.errors == 1 && strstr(test_log.error, "--only indirect-unshadowed"));
    renderer_destroy(r);
    scene_destroy(scene);
}

// ---- Its own error

// The reference errs too: in a picture of N samples against another of M the squared error is 1 + N / M times the true
// one, since the samples are independent.
TEST(estimated_error_is_the_true_one)
{
    enum { SIDE = 64, REFERENCE = 1024, COUNT = 3 };
    static const uint32_t spp[COUNT] = {16, 64, 256};
    scene_data *scene = scene_load(CORNELL);
    renderer *r = renderer_of(scene, SIDE);
    r->settings.seed = 7;
    CHECK(renderer_frame(r) && !isnan(progressive_status_get(r, true).error));
    texel *reference = picture_of(r, REFERENCE);
    r->settings.seed = 8;
    double estimated[COUNT], true_error[COUNT];
    for (int i = 0; i < COUNT; i++) {
        const progressive_status status = picture_finish(r, spp[i]);
        CHECK(status.done == spp[i] && status.rays > 0);
        texel *radiance = radiance_read(r);
        estimated[i] = status.error;
        true_error[i] = relative_l2(radiance, reference, SIDE * SIDE) / sqrt(1 + (double)spp[i] / REFERENCE);
        printf("  %3u samples: error %.5f, estimated %.5f, ratio %.3f\n", spp[i], true_error[i], estimated[i],
               estimated[i] / true_error[i]);
        CHECK_NEAR(estimated[i] / true_error[i], 1, 0.15);
        free(radiance);
    }
    for (int i = 1; i < COUNT; i++) {
        CHECK_NEAR(true_error[i - 1] / true_error[i], 2, 0.15 * 2);
        CHECK_NEAR(estimated[i - 1] / estimated[i], 2, 0.15 * 2);
    }
    free(reference);
    renderer_destroy(r);
    scene_destroy(scene);
}

TEST(error_of_odd_counts_is_estimated_and_of_one_sample_is_not)
{
    scene_data *scene = scene_load(CORNELL);
    renderer *r = renderer_of(scene, 64);
    CHECK(isnan(picture_finish(r, 1).error));
    const double three = picture_finish(r, 3).error, four = picture_finish(r, 4).error;
    printf("  3 samples %.4f, 4 samples %.4f\n", three, four);
    // Few samples tell their error only roughly; without the weights of unequal halves 3 samples would be far off.
    CHECK_NEAR(three / four, sqrt(4.0 / 3), 0.35);
    renderer_destroy(r);
    scene_destroy(scene);
}

TEST(picture_is_finished_at_the_error_asked_for)
{
    scene_data *scene = scene_load(CORNELL);
    renderer *r = renderer_of(scene, 128);
    r->settings.until = 0.1f;
    const progressive_status status = picture_finish(r, 100000);
    printf("  %u samples, error %.4f\n", (uint32_t)status.done, status.error);
    CHECK(status.error <= 0.1 && status.error > 0.05 && status.done >= 16 && status.done < 100);
    CHECK(status.total == 100000);
    renderer_destroy(r);
    scene_destroy(scene);
}

// ---- State

static const char identity[] = "scene cornell\ncamera 0\n";

static bool same_bytes(renderer *r, const texel *expected)
{
    texel *radiance = radiance_read(r);
    const bool same = memcmp(radiance, expected, pixel_count(r) * sizeof *radiance) == 0;
    free(radiance);
    return same;
}

TEST(continued_picture_is_the_uninterrupted_one)
{
    enum { SIDE = 48, HALF_WAY = 13, SPP = 75 }; // a frame takes 28 samples, so the frames differ
    scene_data *scene = scene_load(CORNELL);
    const char *path = test_path("state"), *whole_path = test_path("whole");
    renderer *r = renderer_of(scene, SIDE);
    const progressive_status whole = picture_finish(r, SPP);
    texel *straight = radiance_read(r);
    CHECK(progressive_save(r, whole_path, identity));
    renderer_destroy(r);

    r = renderer_of(scene, SIDE);
    const progressive_status part = picture_finish(r, HALF_WAY);
    CHECK(progressive_save(r, path, identity));
    CHECK(picture_finish(r, SPP).rays == whole.rays);
    CHECK(same_bytes(r, straight)); // saving disturbs nothing
    renderer_destroy(r);

    r = renderer_of(scene, SIDE);
    CHECK(progressive_load(r, path, identity));
    CHECK(progressive_status_get(r, false).done == HALF_WAY && progressive_status_get(r, false).rays == part.rays);
    const progressive_status continued = picture_finish(r, SPP);
    CHECK(continued.done == SPP && continued.rays == whole.rays && continued.error == whole.error);
    CHECK(same_bytes(r, straight));
    renderer_destroy(r);

    // A finished state shows its picture without another sample.
    r = renderer_of(scene, SIDE);
    r->settings.spp = SPP;
    CHECK(progressive_load(r, whole_path, identity));
    CHECK(renderer_frame(r) && progressive_status_get(r, true).rays == whole.rays);
    CHECK(same_bytes(r, straight));
    free(straight);
    renderer_destroy(r);
    scene_destroy(scene);
}

static void refused(renderer *r, const char *path, const char *text, const char *expected)
{
    log_clear();
    CHECK(!progressive_load(r, path, text));
    CHECK(test_log.errors == 1 && strstr(test_log.error, path) && strstr(test_log.error, expected));
    if (!strstr(test_log.error, expected))
        printf("  %s\n", test_log.error);
}

TEST(states_that_cannot_be_continued_are_refused)
{
    scene_data *scene = scene_load(CORNELL);
    renderer *r = renderer_of(scene, 24);
    const char *path = test_path("state"), *broken = test_path("broken");
    log_clear();
    CHECK(!progressive_save(r, path, identity) && test_log.errors == 1); // nothing to save yet
    picture_finish(r, 2);
    CHECK(progressive_save(r, path, identity));
    size_t size;
    uint8_t *bytes = file_read(path, &size);
    CHECK(bytes && size > 24 * 24 * 32);

    refused(r, path, "scene cornell\ncamera 1\n", "expected \"camera 1\", got \"camera 0\"");
    refused(r, path, "scene cornell\ncamera 0", "another picture");
    refused(r, "/nowhere/state", identity, "/nowhere/state");
    for (size_t at = 8; at < size; at += size / 7) { // every part of the file
        bytes[at] ^= 4;
        CHECK(file_write(broken, bytes, size));
        bytes[at] ^= 4;
        refused(r, broken, identity, "it ");
    }
    for (size_t cut = 0; cut < size; cut += size / 5) {
        CHECK(file_write(broken, bytes, cut));
        refused(r, broken, identity, cut < 40 ? "expected the state of a progressive picture" : "it is cut short");
    }
    CHECK(file_write(broken, "P6 24 24 255 and no state of anything at all", 44));
    refused(r, broken, identity, "expected the state of a progressive picture");
    r->settings.width = 25;
    refused(r, path, identity, "expected a picture of 25x24, got one of 24x24");
    r->settings.width = 24;
    CHECK(progressive_status_get(r, false).done == 2); // as before
    free(bytes);
    renderer_destroy(r);
    scene_destroy(scene);
}

TEST(two_runs_give_the_same_bytes)
{
    scene_data *scene = scene_load(CORNELL);
    renderer *r = renderer_of(scene, 40);
    texel *first = picture_of(r, 8);
    renderer_destroy(r);
    r = renderer_of(scene, 40);
    picture_finish(r, 8);
    CHECK(same_bytes(r, first));

    // Nor has a picture anything of the one before it.
    r->settings.seed++;
    picture_finish(r, 8);
    CHECK(!same_bytes(r, first));
    r->settings.seed--;
    picture_finish(r, 8);
    CHECK(same_bytes(r, first));
    free(first);
    renderer_destroy(r);
    scene_destroy(scene);
}

static uint64_t done_after_a_frame(renderer *r)
{
    CHECK(renderer_frame(r));
    return progressive_status_get(r, false).done;
}

TEST(picture_begins_anew_when_what_it_shows_changes)
{
    scene_data *scene = scene_load(CORNELL);
    renderer *r = renderer_of(scene, 256);
    r->settings.spp = 1000;
    const uint64_t n = done_after_a_frame(r);
    CHECK(n > 0 && done_after_a_frame(r) == 2 * n);
    r->settings.spp = 2000;
    r->settings.exposure = 3;
    r->settings.until = 1e-3f;
    CHECK(done_after_a_frame(r) == 3 * n);
    r->camera.eye[0] += 0.01f;
    CHECK(done_after_a_frame(r) == n && done_after_a_frame(r) == 2 * n);
    r->settings.bounces = 2;
    CHECK(done_after_a_frame(r) == n && done_after_a_frame(r) == 2 * n);
    light_add(r, LIGHT_POINT, (float[3]){0, 0.5f, 0}, 1);
    CHECK(done_after_a_frame(r) == n && done_after_a_frame(r) == 2 * n);
    r->settings.width = 240;
    CHECK(done_after_a_frame(r) == n);
    renderer_destroy(r);
    scene_destroy(scene);
}

TEST(scene_without_light_is_black_at_once)
{
    static quad_scene s;
    quad_scene_init(&s);
    quad_place(&s, (float[3]){0, 0, 0}, (float[3]){0, 0, 2}, (float[3]){2, 0, 0});
    renderer *r = renderer_of(&s.data, 16);
    r->camera = floor_camera;
    CHECK(renderer_frame(r) && progressive_status_get(r, true).finished);
    texel *radiance = radiance_read(r);
    CHECK(mean_of(radiance, pixel_count(r)) == 0);
    free(radiance);
    renderer_destroy(r);
}

// Two light kinds make more rays than any other picture has; the validation layer would tell of too large dispatches.
TEST(the_largest_picture_is_possible)
{
    static quad_scene s;
    lamp_init(&s, 1, 0.5f, 0.5f, 0);
    renderer *r = renderer_of(&s.data, 2048);
    light_add(r, LIGHT_POINT, (float[3]){0.1f, 1.5f, 0.2f}, 10);
    r->settings.rays = RAYS_QUERY;
    r->settings.only = ONLY_DIRECT;
    CHECK(renderer_frame(r));
    CHECK(progressive_status_get(r, false).done == 1);
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
    scene_test_begin();
    RUN(furnace_has_the_sum_of_its_series);
    RUN(point_light_in_a_sphere_has_the_sum_of_its_series);
    RUN(punctual_lights_are_exact);
    RUN(a_weak_light_beside_strong_ones_is_not_lost);
    RUN(square_lamps_have_their_closed_form);
    RUN(double_sided_lamp_shines_to_both_sides);
    RUN(lamp_beside_a_strong_sun_has_its_closed_form);
    RUN(textured_lamps_shine_where_their_texture_does);
    RUN(spots_that_are_no_known_emitters_shine_too);
    RUN(direct_and_indirect_light_add_up);
    RUN(estimated_error_is_the_true_one);
    RUN(error_of_odd_counts_is_estimated_and_of_one_sample_is_not);
    RUN(picture_is_finished_at_the_error_asked_for);
    RUN(continued_picture_is_the_uninterrupted_one);
    RUN(states_that_cannot_be_continued_are_refused);
    RUN(two_runs_give_the_same_bytes);
    RUN(picture_begins_anew_when_what_it_shows_changes);
    RUN(scene_without_light_is_black_at_once);
    RUN(the_largest_picture_is_possible);
    RUN(validation_layer_is_silent);
    gpu_destroy(device);
    return scene_test_end();
}
