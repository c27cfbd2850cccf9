// Direct light against closed forms: a floor under a point, spot, sun and quad light, a shadow, and many lights.
#include "test.h"

#include "modules/direct_light.h"
#include "modules/rays.h"
#include "modules/world.h"

#include <math.h>
#include <string.h>

#define SCENES "../shared/scenes/cornell/"
enum { SIDE = 96 };

static gpu *device;
static const double albedo[3] = {0.5, 0.25, 0.75};

typedef float texel[4];
typedef struct vec {
    double x, y, z;
} vec;

// ---- Helpers

static vec vec_sub(vec a, vec b)
{
    return (vec){a.x - b.x, a.y - b.y, a.z - b.z};
}
static double vec_dot(vec a, vec b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
static vec vec_cross(vec a, vec b)
{
    return (vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

typedef struct fixture {
    scene_data *scene;
    renderer *r;
} fixture;

static fixture fixture_create(const char *name)
{
    char path[256];
    snprintf(path, sizeof path, SCENES "%s", name);
    render_settings settings = render_settings_default();
    settings.width = settings.height = SIDE;
    settings.vpls = 0;
    fixture f = {.scene = scene_load(path)};
    if (f.scene)
        f.r = renderer_create(device, f.scene, &settings);
    CHECK(f.r != NULL);
    if (!f.r)
        exit(EXIT_FAILURE);
    return f;
}

static void fixture_destroy(fixture *f)
{
    renderer_destroy(f->r);
    scene_destroy(f->scene);
}

static void point_light_add(renderer *r, vec position, double candela)
{
    const world_gpu *w = r->gpu_world;
    const entity e = ecs_entity_create(r->world);
    const node_component node = {
        .matrix = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, (float)position.x, (float)position.y, (float)position.z, 1}};
    *(node_component *)ecs_add(r->world, e, w->node) = node;
    ecs_add(r->world, e, w->transform);
    const float c = (float)candela;
    *(light_component *)ecs_add(r->world, e, w->light) = (light_component){.type = LIGHT_POINT, .color = {c, c, c}};
}

static void image_read(renderer *r, const char *name, texel *texels)
{
    const gpu_image image = frame_graph_find_image(r->graph, name);
    const size_t size = sizeof(texel) * r->settings.width * r->settings.height;
    CHECK(image.id != 0);
    if (image.id)
        CHECK(gpu_image_read(device, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, size));
}

// Where the middle of a pixel meets the floor y = 0.
static vec floor_point(const renderer *r, uint32_t x, uint32_t y)
{
    const frame_constants *c = &r->constants;
    const double across = (x + 0.5) / c->width * 2 - 1, down = (y + 0.5) / c->height * 2 - 1;
    double ray[3];
    for (int k = 0; k < 3; k++)
        ray[k] = c->forward[k] + across * c->right[k] - down * c->up[k];
    const double t = -c->eye[1] / ray[1];
    return (vec){c->eye[0] + t * ray[0], 0, c->eye[2] + t * ray[2]};
}

// Pixels of the floor, in the middle and aside, of a picture of SIDE x SIDE.
static const uint32_t places[][2] = {{48, 48}, {20, 60}, {70, 40}, {48, 80}, {30, 30}};

// `irradiance` in lux (nits times pi) at each place against the picture.
static void radiance_check(renderer *r, double (*irradiance)(vec p), double tolerance)
{
    const uint32_t width = r->settings.width, height = r->settings.height;
    texel *radiance = memory_alloc(sizeof(texel) * width * height);
    image_read(r, "radiance", radiance);
    for (size_t i = 0; i < countof(places); i++) {
        const uint32_t x = places[i][0] * width / SIDE, y = places[i][1] * height / SIDE;
        const double e = irradiance(floor_point(r, x, y));
        for (int k = 0; k < 3; k++) {
            const double expected = albedo[k] * e / M_PI;
            CHECK_NEAR((double)radiance[y * width + x][k], expected, tolerance * expected);
        }
    }
    free(radiance);
}

// ---- Closed forms, lux

static double point_irradiance(vec p, vec light, double candela)
{
    const vec offset = vec_sub(light, p);
    const double square = vec_dot(offset, offset);
    return candela * offset.y / (square * sqrt(square));
}

static double irradiance_of_point(vec p)
{
    return point_irradiance(p, (vec){0, 2, 0}, 100);
}

static double irradiance_of_spot(vec p)
{
    const vec offset = vec_sub((vec){0, 2, 0}, p);
    const double cosine = offset.y / sqrt(vec_dot(offset, offset));
    const double cone = (cosine - cos(0.9)) / (cos(0.3) - cos(0.9));
    const double clamped = fmin(fmax(cone, 0), 1);
    return clamped * clamped * irradiance_of_point(p);
}

static double irradiance_of_sun(vec p)
{
    (void)p;
    return 3 * cos(M_PI / 6); // 3 lux, tilted 60 degrees from the horizon
}

// Lambert's formula for the square lamp of 5 nits at a height of 1 m.
static double irradiance_of_quad(vec p)
{
    const vec corners[4] = {{-0.5, 1, -0.5}, {0.5, 1, -0.5}, {0.5, 1, 0.5}, {-0.5, 1, 0.5}};
    double sum = 0;
    for (int i = 0; i < 4; i++) {
        const vec a = vec_sub(corners[i], p), b = vec_sub(corners[(i + 1) % 4], p), area = vec_cross(a, b);
        const double sine = sqrt(vec_dot(area, area));
        sum += area.y / sine * atan2(sine, vec_dot(a, b));
    }
    return 5 * 0.5 * fabs(sum);
}

// ---- Tests

TEST(floor_under_a_point_light_has_its_closed_form)
{
    fixture f = fixture_create("plane_point.gltf");
    CHECK(renderer_frame(f.r));
    radiance_check(f.r, irradiance_of_point, 1e-3);
    CHECK(!direct_light_is_sampled(f.r));
    fixture_destroy(&f);
}

TEST(floor_under_a_spot_light_has_its_closed_form)
{
    fixture f = fixture_create("plane_spot.gltf");
    CHECK(renderer_frame(f.r));
    radiance_check(f.r, irradiance_of_spot, 1e-3);
    fixture_destroy(&f);
}

TEST(floor_under_a_sun_has_its_closed_form)
{
    fixture f = fixture_create("plane_sun.gltf");
    CHECK(renderer_frame(f.r));
    radiance_check(f.r, irradiance_of_sun, 1e-3);
    fixture_destroy(&f);
}

TEST(floor_under_a_square_lamp_has_its_closed_form)
{
    fixture f = fixture_create("plane_quad.gltf");
    CHECK(renderer_frame(f.r));
    CHECK(direct_light_is_analytic(f.r));
    radiance_check(f.r, irradiance_of_quad, 1e-3);
    fixture_destroy(&f);
}

// Over the pixels within 2 of each place, and over the whole floor.
TEST(samples_of_a_square_lamp_average_to_its_closed_form)
{
    static texel unshadowed[SIDE * SIDE], analytic[SIDE * SIDE];
    enum { FRAMES = 64 };
    double sampled[countof(places) + 1] = {0}, exact[countof(places) + 1] = {0};
    fixture f = fixture_create("plane_quad.gltf");
    f.r->settings.filter = f.r->settings.taa = false;
    f.r->exports[f.r->export_count++] = "direct_u";
    f.r->exports[f.r->export_count++] = "direct_analytic";
    for (int frame = 0; frame < FRAMES; frame++) {
        CHECK(renderer_frame(f.r));
        image_read(f.r, "direct_u", unshadowed);
        image_read(f.r, "direct_analytic", analytic);
        for (uint32_t i = 0; i < SIDE * SIDE; i++) {
            sampled[countof(places)] += (double)unshadowed[i][0];
            exact[countof(places)] += (double)analytic[i][0];
            for (size_t k = 0; k < countof(places); k++)
                if (abs((int)(i % SIDE) - (int)places[k][0]) <= 2 && abs((int)(i / SIDE) - (int)places[k][1]) <= 2) {
                    sampled[k] += (double)unshadowed[i][0];
                    exact[k] += (double)analytic[i][0];
                }
        }
    }
    for (size_t k = 0; k <= countof(places); k++)
        CHECK_NEAR(sampled[k] / exact[k], 1, 0.01);
    printf("  samples over closed form: %.4f %.4f %.4f, whole floor %.5f\n", sampled[0] / exact[0],
           sampled[1] / exact[1], sampled[2] / exact[2], sampled[countof(places)] / exact[countof(places)]);
    fixture_destroy(&f);
}

// The sun's power leaves the lamp a share of the light sources' distribution that floats can hardly tell from nothing.
TEST(lamp_beside_a_strong_sun_is_sampled_right)
{
    static texel unshadowed[SIDE * SIDE], analytic[SIDE * SIDE];
    double sampled = 0, exact = 0;
    fixture f = fixture_create("plane_quad.gltf");
    world_sun_add(f.r, (float[3]){0.6f, -0.8f, 0}, 1e6f);
    f.r->settings.filter = f.r->settings.taa = false;
    f.r->exports[f.r->export_count++] = "direct_u";
    f.r->exports[f.r->export_count++] = "direct_analytic";
    for (int frame = 0; frame < 4; frame++) {
        CHECK(renderer_frame(f.r));
        image_read(f.r, "direct_u", unshadowed);
        image_read(f.r, "direct_analytic", analytic);
        for (uint32_t i = 0; i < SIDE * SIDE; i++) {
            sampled += (double)unshadowed[i][0];
            exact += (double)analytic[i][0];
        }
    }
    printf("  samples over closed form: %.4f\n", sampled / exact);
    CHECK_NEAR(sampled / exact, 1, 0.01);
    fixture_destroy(&f);
}

// Whether the square lamp stands between p and a light at (0, 2, 0): its shadow on the floor reaches to +-1.
static double irradiance_of_quad_and_shadowed_point(vec p)
{
    const bool shadowed = fabs(p.x) < 1 && fabs(p.z) < 1;
    return irradiance_of_quad(p) + (shadowed ? 0 : point_irradiance(p, (vec){0, 2, 0}, 10));
}

TEST(lamp_casts_the_shadow_of_a_point_light)
{
    fixture f = fixture_create("plane_quad.gltf");
    point_light_add(f.r, (vec){0, 2, 0}, 10);
    CHECK(renderer_frame(f.r));
    bool any_shadowed = false, any_lit = false;
    for (size_t i = 0; i < countof(places); i++) {
        const vec p = floor_point(f.r, places[i][0], places[i][1]);
        *(fabs(p.x) < 1 && fabs(p.z) < 1 ? &any_shadowed : &any_lit) = true;
    }
    CHECK(any_shadowed && any_lit);
    radiance_check(f.r, irradiance_of_quad_and_shadowed_point, 1e-3);
    fixture_destroy(&f);
}

enum { MANY = 24 };
static vec many_position(int i)
{
    return (vec){0.25 * (i % 5) - 0.5, 1.5 + 0.1 * (i % 3), 0.3 * (i % 7) - 1};
}

static double irradiance_of_many(vec p)
{
    double sum = irradiance_of_point(p);
    for (int i = 0; i < MANY; i++)
        sum += point_irradiance(p, many_position(i), 1 + i);
    return sum;
}

TEST(many_lights_sum_up_exactly)
{
    fixture f = fixture_create("plane_point.gltf");
    for (int i = 0; i < MANY; i++)
        point_light_add(f.r, many_position(i), 1 + i);
    CHECK(renderer_frame(f.r));
    CHECK(f.r->constants.light_count == MANY + 1 && direct_light_is_analytic(f.r));
    radiance_check(f.r, irradiance_of_many, 1e-3);
    fixture_destroy(&f);
}

// Under the lamp's shadow of many lights: on average the shadowed estimate is the lamp's own light.
TEST(shadowed_samples_of_many_lights_and_a_lamp_average_to_what_is_visible)
{
    static texel shadowed[SIDE * SIDE];
    enum { FRAMES = 48 };
    fixture f = fixture_create("plane_quad.gltf");
    f.r->settings.filter = f.r->settings.taa = false;
    f.r->exports[f.r->export_count++] = "direct_s";
    for (int i = 0; i < MANY; i++)
        point_light_add(f.r, (vec){0.02 * (i % 5), 2, 0.02 * (i % 7)}, 0.1 * (1 + i));
    double sum = 0, expected = 0;
    for (int frame = 0; frame < FRAMES; frame++) {
        CHECK(renderer_frame(f.r));
        image_read(f.r, "direct_s", shadowed);
        for (uint32_t i = 0; i < SIDE * SIDE; i++) {
            const vec p = floor_point(f.r, i % SIDE, i / SIDE);
            // Where the camera sees the floor below the lamp, and every light is hidden.
            if (fabs(p.x) > 0.3 || fabs(p.z - 0.5) > 0.2)
                continue;
            sum += (double)shadowed[i][0];
            expected += irradiance_of_quad(p) / M_PI;
        }
    }
    printf("  samples over closed form: %.4f\n", sum / expected);
    CHECK_NEAR(sum / expected, 1, 0.02);
    fixture_destroy(&f);
}

// ---- Several batches: more rays than RAYS_BATCH

enum { LARGE = 728, FEW = 8 }; // 7 rays a pixel fit into one batch

static double irradiance_of_few(vec p)
{
    double sum = irradiance_of_point(p);
    for (int i = 0; i < FEW; i++)
        sum += point_irradiance(p, many_position(i), 1 + i);
    return sum;
}

static fixture large_fixture_create(int lights)
{
    fixture f = fixture_create("plane_point.gltf");
    f.r->settings.width = f.r->settings.height = LARGE;
    f.r->settings.filter = f.r->settings.taa = false;
    f.r->settings.shadow_samples = 8;
    f.r->exports[f.r->export_count++] = "rays_direct";
    for (int i = 0; i < lights; i++)
        point_light_add(f.r, many_position(i), 1 + i);
    return f;
}

static uint32_t rays_of_pixel(const fixture *f, uint32_t pixels)
{
    const uint32_t *rays = gpu_buffer_map(device, frame_graph_find_buffer(f->r->graph, "rays_direct"));
    CHECK(rays[0] % pixels == 0);
    return rays[0] / pixels;
}

// Pixels of the floor that any light reaches.
static uint32_t lit_pixels(renderer *r, const char *name, texel *texels)
{
    uint32_t lit = 0;
    image_read(r, name, texels);
    for (uint32_t i = 0; i < LARGE * LARGE; i++)
        lit += texels[i][0] > 0;
    CHECK(lit > LARGE * LARGE / 4);
    return lit;
}

TEST(lights_of_two_batches_sum_up_exactly)
{
    static texel direct[LARGE * LARGE];
    fixture f = large_fixture_create(FEW);
    CHECK(rays_layers(f.r, FEW + 1) < FEW + 1);
    f.r->exports[f.r->export_count++] = "direct";
    CHECK(renderer_frame(f.r));
    radiance_check(f.r, irradiance_of_few, 1e-3);
    CHECK(rays_of_pixel(&f, lit_pixels(f.r, "direct", direct)) == FEW + 1);
    fixture_destroy(&f);
}

// With nothing in the way the two estimates are the same to the bit, and right on average.
TEST(samples_of_two_batches_are_each_taken_once)
{
    static texel unshadowed[LARGE * LARGE], shadowed[LARGE * LARGE], analytic[LARGE * LARGE];
    static const char *const names[] = {"direct_u", "direct_s", "direct_analytic"};
    fixture f = large_fixture_create(MANY);
    CHECK(rays_layers(f.r, 8) < 8);
    for (size_t i = 0; i < countof(names); i++)
        f.r->exports[f.r->export_count++] = names[i];
    CHECK(renderer_frame(f.r));
    image_read(f.r, "direct_u", unshadowed);
    image_read(f.r, "direct_s", shadowed);
    CHECK(memcmp(unshadowed, shadowed, sizeof shadowed) == 0);
    CHECK(rays_of_pixel(&f, lit_pixels(f.r, "direct_analytic", analytic)) == 8);
    double sampled = 0, exact = 0;
    for (uint32_t i = 0; i < LARGE * LARGE; i++) {
        sampled += (double)unshadowed[i][0];
        exact += (double)analytic[i][0];
    }
    printf("  samples over closed form: %.5f\n", sampled / exact);
    CHECK_NEAR(sampled / exact, 1, 0.005);
    fixture_destroy(&f);
}

TEST(rays_are_counted)
{
    fixture f = fixture_create("plane_point.gltf");
    f.r->exports[f.r->export_count++] = "rays_direct";
    f.r->exports[f.r->export_count++] = "direct";
    static texel direct[SIDE * SIDE];
    for (int frame = 0; frame < 2; frame++) {
        CHECK(renderer_frame(f.r));
        uint32_t lit = 0;
        image_read(f.r, "direct", direct);
        for (uint32_t i = 0; i < SIDE * SIDE; i++)
            lit += direct[i][0] > 0;
        const uint32_t *rays = gpu_buffer_map(device, frame_graph_find_buffer(f.r->graph, "rays_direct"));
        CHECK(lit > 0 && rays[0] == lit);
    }
    fixture_destroy(&f);
}

TEST(indirect_only_has_no_direct_light)
{
    fixture f = fixture_create("plane_point.gltf");
    f.r->settings.only = ONLY_INDIRECT;
    f.r->exports[f.r->export_count++] = "direct|-";
    CHECK(renderer_frame(f.r));
    CHECK(frame_graph_find_image(f.r->graph, "direct").id == 0);
    fixture_destroy(&f);
}

TEST(validation_layer_is_silent)
{
    CHECK(gpu_validation_messages(device) == 0);
}

int main(void)
{
    FILE *scene = fopen(SCENES "plane_quad.gltf", "rb");
    if (!scene) {
        printf("no scenes at " SCENES ": nothing to compare with\n");
        return 77;
    }
    fclose(scene);
    device = gpu_create(&(gpu_desc){.validation = true});
    if (!device) {
        printf("no device with a validation layer\n");
        return 77;
    }
    RUN(floor_under_a_point_light_has_its_closed_form);
    RUN(floor_under_a_spot_light_has_its_closed_form);
    RUN(floor_under_a_sun_has_its_closed_form);
    RUN(floor_under_a_square_lamp_has_its_closed_form);
    RUN(samples_of_a_square_lamp_average_to_its_closed_form);
    RUN(lamp_beside_a_strong_sun_is_sampled_right);
    RUN(lamp_casts_the_shadow_of_a_point_light);
    RUN(many_lights_sum_up_exactly);
    RUN(shadowed_samples_of_many_lights_and_a_lamp_average_to_what_is_visible);
    RUN(lights_of_two_batches_sum_up_exactly);
    RUN(samples_of_two_batches_are_each_taken_once);
    RUN(rays_are_counted);
    RUN(indirect_only_has_no_direct_light);
    RUN(validation_layer_is_silent);
    gpu_destroy(device);
    return test_end();
}
