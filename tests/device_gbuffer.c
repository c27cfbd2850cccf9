// The G-buffer and the tone curve on a device, on small scenes made here: what a pixel sees must be what geometry says.
#include "modules/renderer.h"
#include "modules/world.h"
#include "quad_scene.h"
#include "test.h"

enum { WIDTH = 96, HEIGHT = 64, PIXELS = WIDTH * HEIGHT };

static gpu *device;

static void turned(float matrix[16], float angle_x, float angle_y, const float translation[3])
{
    const float cx = cosf(angle_x), sx = sinf(angle_x), cy = cosf(angle_y), sy = sinf(angle_y);
    const float m[16] = {cy,
                         0,
                         -sy,
                         0,
                         sx * sy,
                         cx,
                         sx * cy,
                         0,
                         cx * sy,
                         -sx,
                         cx * cy,
                         0,
                         translation[0],
                         translation[1],
                         translation[2],
                         1};
    memcpy(matrix, m, sizeof m);
}

// ---- Frames

static renderer *renderer_of(const quad_scene *s)
{
    render_settings settings = render_settings_default();
    settings.width = WIDTH;
    settings.height = HEIGHT;
    settings.vpls = 0;
    renderer *r = renderer_create(device, &s->data, &settings);
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    static const char *const names[] = {"depth", "normals", "albedo", "emission", "motion", "exposure"};
    for (size_t i = 0; i < countof(names); i++)
        r->exports[r->export_count++] = names[i];
    r->camera = (render_camera){.eye = {0, 0, 3}, .up = {0, 1, 0}, .yfov = 0.8f, .near_plane = 0.05f};
    return r;
}

// Texels of an exported image; `size` bytes each.
static void *image_of(renderer *r, const char *name, size_t size)
{
    void *texels = memory_alloc(PIXELS * size);
    const gpu_image image = frame_graph_find_image(r->graph, name);
    CHECK(image.id && gpu_image_read(device, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, PIXELS * size));
    return texels;
}

static void octahedral_decode(const int16_t encoded[2], float n[3])
{
    const float x = fmaxf((float)encoded[0] / 32767, -1), y = fmaxf((float)encoded[1] / 32767, -1);
    n[2] = 1 - fabsf(x) - fabsf(y);
    const float fold = fmaxf(-n[2], 0);
    n[0] = x + (x >= 0 ? -fold : fold);
    n[1] = y + (y >= 0 ? -fold : fold);
    const float length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3; k++)
        n[k] /= length;
}

// `which` 0: geometric, 1: shading.
static void normal_at(const int16_t (*normals)[4], uint32_t pixel, int which, float n[3])
{
    octahedral_decode(&normals[pixel][2 * which], n);
}

static uint32_t pixel_at(uint32_t x, uint32_t y)
{
    return y * WIDTH + x;
}

// The direction, in units of view depth, in which a pixel's centre looks.
static void pixel_direction(const frame_constants *c, uint32_t x, uint32_t y, float direction[3])
{
    const float u = ((float)x + 0.5f) / WIDTH * 2 - 1, v = ((float)y + 0.5f) / HEIGHT * 2 - 1;
    for (int k = 0; k < 3; k++)
        direction[k] = c->forward[k] + u * c->right[k] - v * c->up[k];
}

static uint32_t drawn_count(renderer *r)
{
    float *depth = image_of(r, "depth", sizeof *depth);
    uint32_t count = 0;
    for (uint32_t i = 0; i < PIXELS; i++)
        count += depth[i] > 0;
    free(depth);
    return count;
}

// ---- Geometry

static float dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

TEST(pixels_hold_the_plane_that_they_look_at)
{
    quad_scene s;
    quad_scene_init(&s);
    float matrix[16];
    turned(matrix, 0.4f, -0.3f, (float[3]){0.2f, 0.1f, -0.5f});
    quad_add(&s, matrix);
    renderer *r = renderer_of(&s);
    r->camera = (render_camera){
        .eye = {1, 2, 3}, .target = {0.1f, 0, -0.4f}, .up = {0.3f, 1, 0}, .yfov = 0.5f, .near_plane = 0.05f};
    CHECK(renderer_frame(r));
    float *depth = image_of(r, "depth", sizeof *depth);
    int16_t(*normals)[4] = image_of(r, "normals", sizeof *normals);
    uint16_t(*albedo)[4] = image_of(r, "albedo", sizeof *albedo);
    const float *normal = matrix + 8, *origin = matrix + 12, *eye = r->constants.eye;
    uint32_t inside = 0;
    for (uint32_t y = 3; y < HEIGHT; y += 7)
        for (uint32_t x = 2; x < WIDTH; x += 7) {
            float direction[3], offset[3], across[2];
            pixel_direction(&r->constants, x, y, direction);
            const float to_plane[3] = {origin[0] - eye[0], origin[1] - eye[1], origin[2] - eye[2]};
            const float distance = dot(to_plane, normal) / dot(direction, normal);
            for (int k = 0; k < 3; k++)
                offset[k] = distance * direction[k] - to_plane[k];
            for (int k = 0; k < 2; k++)
                across[k] = fabsf(dot(offset, matrix + 4 * k));
            const uint32_t i = pixel_at(x, y);
            if (fmaxf(across[0], across[1]) > 1) {
                CHECK(depth[i] == 0 && albedo[i][3] == 0);
                continue;
            }
            inside++;
            CHECK_NEAR(0.05f / depth[i], distance, 1e-4);
            for (int which = 0; which < 2; which++) {
                float n[3];
                normal_at(normals, i, which, n);
                for (int k = 0; k < 3; k++)
                    CHECK_NEAR(n[k], normal[k], 1e-4);
            }
            const float expected[3] = {0.5f, 0.25f, 0.75f};
            for (int k = 0; k < 3; k++)
                CHECK_NEAR(albedo[i][k] / 65535.0, expected[k], 1e-4);
            CHECK(albedo[i][3] == world_identity(r->gpu_world->order[0].entity));
        }
    CHECK(inside > 20);
    free(depth);
    free(normals);
    free(albedo);
    renderer_destroy(r);
}

TEST(pixel_row_zero_is_the_top)
{
    quad_scene s;
    quad_scene_init(&s);
    float matrix[16];
    turned(matrix, 0, 0, (float[3]){0, 1, 0}); // the upper half of the picture's middle
    quad_add(&s, matrix);
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    float *depth = image_of(r, "depth", sizeof *depth);
    CHECK(depth[pixel_at(WIDTH / 2, 4)] > 0);
    CHECK(depth[pixel_at(WIDTH / 2, HEIGHT - 5)] == 0);
    free(depth);
    renderer_destroy(r);
}

// How much of the picture a quad with this matrix and these flags covers, and its normal in the middle.
static uint32_t coverage(const float matrix[16], uint32_t flags, float normal[3])
{
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, matrix)->flags = flags;
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    int16_t(*normals)[4] = image_of(r, "normals", sizeof *normals);
    normal_at(normals, pixel_at(WIDTH / 2, HEIGHT / 2), 1, normal);
    const uint32_t count = drawn_count(r);
    free(normals);
    renderer_destroy(r);
    return count;
}

TEST(back_faces_are_culled_unless_double_sided)
{
    float front[16], back[16], n[3];
    turned(front, 0, 0, (float[3]){0, 0, 0});
    turned(back, 0, (float)M_PI, (float[3]){0, 0, 0});
    const uint32_t whole = coverage(front, 0, n);
    CHECK(whole > PIXELS / 4);
    CHECK(coverage(back, 0, n) == 0);
    const uint32_t both = coverage(back, MATERIAL_DOUBLE_SIDED, n);
    CHECK(both + WIDTH >= whole && both <= whole + WIDTH);
    CHECK_NEAR(n[2], 1, 1e-4);
}

TEST(mirrored_instances_show_their_front)
{
    float mirrored[16], n[3];
    memcpy(mirrored, IDENTITY, sizeof mirrored);
    mirrored[0] = -1;
    CHECK(coverage(mirrored, 0, n) > PIXELS / 4);
    CHECK_NEAR(n[2], 1, 1e-4);
    mirrored[0] = 1;
    mirrored[10] = -1; // now the front looks away
    CHECK(coverage(mirrored, 0, n) == 0);
}

TEST(primitives_outside_of_the_view_are_not_missed_at_its_border)
{
    // A quad much larger than the view, whose centre and corners are all outside of it.
    float matrix[16], n[3];
    memcpy(matrix, IDENTITY, sizeof matrix);
    matrix[0] = matrix[5] = 100;
    matrix[12] = 90;
    CHECK(coverage(matrix, 0, n) == PIXELS);
}

// ---- Materials

TEST(alpha_mask_cuts)
{
    quad_scene s;
    quad_scene_init(&s);
    uint8_t texels[8] = {255, 255, 255, 100, 255, 255, 255, 200}; // left and right
    texture_set(&s, texels, 2, 1, true);
    material *m = quad_add(&s, IDENTITY);
    m->flags = MATERIAL_ALPHA_MASK;
    m->base_texture.texture = 0;
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    float *depth = image_of(r, "depth", sizeof *depth);
    CHECK(depth[pixel_at(WIDTH / 2 - 4, HEIGHT / 2)] == 0);
    CHECK(depth[pixel_at(WIDTH / 2 + 4, HEIGHT / 2)] > 0);
    free(depth);
    renderer_destroy(r);
}

TEST(texture_transforms_move_the_texture)
{
    quad_scene s;
    quad_scene_init(&s);
    uint8_t texels[8] = {255, 0, 0, 255, 0, 255, 0, 255};
    texture_set(&s, texels, 2, 1, true);
    material *m = quad_add(&s, IDENTITY);
    memcpy(m->base_color, (float[4]){1, 1, 1, 1}, sizeof m->base_color);
    m->base_texture.texture = 0;
    m->base_texture.offset[0] = 0.5f; // left half now shows the right texel
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    uint16_t(*albedo)[4] = image_of(r, "albedo", sizeof *albedo);
    const uint16_t *left = albedo[pixel_at(WIDTH / 2 - 4, HEIGHT / 2)];
    CHECK(left[0] == 0 && left[1] == 65535);
    free(albedo);
    renderer_destroy(r);
}

// The shading normal in the middle of a quad with a normal map of one texel.
static void mapped_normal(const uint8_t rgb[3], float tangent_sign, bool mirrored, float normal[3])
{
    quad_scene s;
    quad_scene_init(&s);
    uint8_t texel[4] = {rgb[0], rgb[1], rgb[2], 255};
    texture_set(&s, texel, 1, 1, false);
    float matrix[16];
    memcpy(matrix, IDENTITY, sizeof matrix);
    matrix[0] = mirrored ? -1 : 1;
    quad_add(&s, matrix)->normal_texture.texture = 0;
    for (int i = 0; i < 4; i++)
        memcpy(s.attributes[i].tangent, (float[4]){tangent_sign != 0, 0, 0, tangent_sign}, 4 * sizeof(float));
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    int16_t(*normals)[4] = image_of(r, "normals", sizeof *normals);
    normal_at(normals, pixel_at(WIDTH / 2, HEIGHT / 2), 1, normal);
    free(normals);
    renderer_destroy(r);
}

TEST(normal_maps_bend_along_u_and_against_v)
{
    static const uint8_t right[3] = {204, 128, 230}, upward[3] = {128, 204, 230}; // about (0.6, 0, 0.8)
    for (int mirrored = 0; mirrored < 2; mirrored++)
        for (int has_tangents = 0; has_tangents < 2; has_tangents++) {
            float n[3];
            mapped_normal(right, (float)has_tangents, mirrored, n);
            CHECK_NEAR(n[0], mirrored ? -0.6 : 0.6, 0.01);
            CHECK_NEAR(n[1], 0, 0.01);
            mapped_normal(upward, (float)has_tangents, mirrored, n);
            CHECK_NEAR(n[0], 0, 0.01);
            CHECK_NEAR(n[1], 0.6, 0.01);
        }
}

TEST(shading_normals_stay_on_the_visible_side)
{
    static const uint8_t away[3] = {255, 128, 60}; // points below the surface
    float n[3];
    mapped_normal(away, 1, false, n);
    CHECK(n[2] > 0);
    CHECK(n[0] > 0.9);
}

// ---- Motion

static float (*motion_of(renderer *r))[2]
{
    uint16_t(*half)[2] = image_of(r, "motion", sizeof *half);
    float(*motion)[2] = memory_alloc(PIXELS * sizeof *motion);
    for (uint32_t i = 0; i < 2 * PIXELS; i++) {
        const uint16_t bits = half[i / 2][i % 2];
        const int exponent = bits >> 10 & 31, mantissa = bits & 1023;
        const double value = exponent ? ldexp(1024 + mantissa, exponent - 25) : ldexp(mantissa, -24);
        motion[i / 2][i % 2] = (float)(bits >> 15 ? -value : value);
    }
    free(half);
    return motion;
}

TEST(nothing_moves_in_a_still_frame)
{
    quad_scene s;
    quad_scene_init(&s);
    float matrix[16];
    turned(matrix, 0.4f, -0.3f, (float[3]){0.2f, 0.1f, -0.5f});
    quad_add(&s, matrix);
    renderer *r = renderer_of(&s);
    frame_graph_cull_set(r->graph, false);
    CHECK(renderer_frame(r) && renderer_frame(r));
    float(*motion)[2] = motion_of(r);
    uint32_t moving = 0;
    for (uint32_t i = 0; i < PIXELS; i++)
        moving += motion[i][0] != 0 || motion[i][1] != 0;
    CHECK(moving == 0);
    free(motion);
    renderer_destroy(r);
}

TEST(motion_leads_back_when_the_camera_moves)
{
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, IDENTITY);
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    r->camera.eye[0] = r->camera.target[0] = 0.1f; // the quad goes to the left by this much at 3 metres
    r->camera.eye[1] = r->camera.target[1] = 0.05f; // and down
    CHECK(renderer_frame(r));
    float(*motion)[2] = motion_of(r);
    const double pixels_a_metre = HEIGHT / (2 * tan(0.4) * 3);
    const uint32_t middle = pixel_at(WIDTH / 2, HEIGHT / 2);
    CHECK_NEAR(motion[middle][0], 0.1 * pixels_a_metre, 2e-3);
    CHECK_NEAR(motion[middle][1], -0.05 * pixels_a_metre, 2e-3);
    free(motion);
    renderer_destroy(r);
}

TEST(motion_leads_back_when_the_object_moves)
{
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, IDENTITY);
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    for (ecs_iterator it = ecs_iterate(r->world, r->gpu_world->node); ecs_next(&it);)
        ((node_component *)it.component)->matrix[12] = 0.1f;
    CHECK(renderer_frame(r));
    float(*motion)[2] = motion_of(r);
    CHECK_NEAR(motion[pixel_at(WIDTH / 2, HEIGHT / 2)][0], -0.1 * HEIGHT / (2 * tan(0.4) * 3), 2e-3);
    free(motion);
    CHECK(renderer_frame(r)); // it stands still again
    motion = motion_of(r);
    CHECK(motion[pixel_at(WIDTH / 2, HEIGHT / 2)][0] == 0);
    free(motion);
    renderer_destroy(r);
}

// ---- Composite and tone curve

TEST(radiance_is_the_sum_of_its_parts)
{
    static const struct {
        render_only only;
        bool emission, direct, indirect;
    } cases[] = {{ONLY_ALL, true, true, true}, {ONLY_DIRECT, true, true, false}, {ONLY_INDIRECT, false, false, true}};
    for (size_t c = 0; c < countof(cases); c++) {
        quad_scene s;
        quad_scene_init(&s);
        float floor[16];
        turned(floor, -0.5f * (float)M_PI, 0, (float[3]){0, -1, 1});
        quad_add(&s, IDENTITY)->emissive[0] = 1;
        quad_add(&s, floor);
        renderer *r = renderer_of(&s);
        r->settings.vpls = 1000;
        r->settings.only = cases[c].only;
        r->exports[r->export_count++] = "aov_direct";
        r->exports[r->export_count++] = "aov_indirect";
        CHECK(renderer_frame(r));
        float *radiance = image_of(r, "radiance", 16), *emission = image_of(r, "emission", 16);
        float *direct = image_of(r, "aov_direct", 16), *indirect = image_of(r, "aov_indirect", 16);
        float most_direct = 0, most_indirect = 0;
        for (uint32_t i = 0; i < 4 * PIXELS; i += 4 * 37) {
            most_direct = fmaxf(most_direct, direct[i]);
            most_indirect = fmaxf(most_indirect, indirect[i]);
            CHECK_NEAR(radiance[i],
                       cases[c].emission * emission[i] + cases[c].direct * direct[i] + cases[c].indirect * indirect[i],
                       1e-5);
        }
        CHECK(!cases[c].direct || most_direct > 0);
        CHECK(!cases[c].indirect || most_indirect > 0);
        free(radiance);
        free(emission);
        free(direct);
        free(indirect);
        renderer_destroy(r);
    }
}

static double display_of(double exposed)
{
    const double x = exposed, curve = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
    const double linear = fmin(fmax(curve, 0), 1);
    return 255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1 / 2.4) - 0.055);
}

// Two emissive quads that fill the picture: `left` and `right` nits.
static renderer *two_emitters(quad_scene *s, float left, float right)
{
    quad_scene_init(s);
    for (int i = 0; i < 2; i++) {
        float matrix[16];
        memcpy(matrix, IDENTITY, sizeof matrix);
        matrix[0] = matrix[5] = 10;
        matrix[12] = i ? 10 : -10;
        material *m = quad_add(s, matrix);
        memcpy(m->base_color, (float[4]){0, 0, 0, 1}, sizeof m->base_color);
        for (int k = 0; k < 3; k++)
            m->emissive[k] = i ? right : left;
    }
    return renderer_of(s);
}

TEST(known_radiance_has_known_display_values)
{
    quad_scene s;
    renderer *r = two_emitters(&s, 0.05f, 0.8f);
    r->settings.auto_exposure = false;
    r->settings.exposure = 1;
    CHECK(renderer_frame(r));
    float(*radiance)[4] = image_of(r, "radiance", sizeof *radiance);
    uint8_t(*display)[4] = image_of(r, "display", sizeof *display);
    CHECK_NEAR(radiance[pixel_at(10, 10)][1], 0.05, 1e-7);
    CHECK_NEAR(radiance[pixel_at(WIDTH - 10, 10)][2], 0.8, 1e-7);
    CHECK_NEAR(display[pixel_at(10, 10)][0], display_of(0.1), 0.6);
    CHECK_NEAR(display[pixel_at(WIDTH - 10, 10)][2], display_of(1.6), 0.6);
    CHECK(display[0][3] == 255);
    free(radiance);
    free(display);
    renderer_destroy(r);
}

static float exposure_of(renderer *r)
{
    float exposure = 0;
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, "exposure");
    CHECK(buffer.id && gpu_buffer_read(device, buffer, 0, &exposure, sizeof exposure));
    return exposure;
}

TEST(automatic_exposure_puts_the_log_average_at_middle_grey)
{
    quad_scene s;
    renderer *r = two_emitters(&s, 0.05f, 0.8f);
    r->settings.auto_exposure = true;
    CHECK(renderer_frame(r));
    CHECK_NEAR(exposure_of(r) * sqrt(0.05 * 0.8), 0.18, 1e-5);
    renderer_destroy(r);
}

TEST(black_pixels_do_not_count_in_the_exposure)
{
    quad_scene s;
    renderer *r = two_emitters(&s, 0, 0.8f);
    r->settings.auto_exposure = true;
    CHECK(renderer_frame(r));
    CHECK_NEAR(exposure_of(r) * 0.8, 0.18, 1e-5);
    renderer_destroy(r);
}

TEST(an_empty_scene_is_black)
{
    quad_scene s;
    quad_scene_init(&s);
    s.data.vertex_count = s.data.index_count = 0;
    renderer *r = renderer_of(&s);
    frame_graph_cull_set(r->graph, false); // builds an acceleration structure over nothing too
    CHECK(renderer_frame(r) && renderer_frame(r));
    CHECK(drawn_count(r) == 0);
    CHECK_NEAR(exposure_of(r), 1, 0);
    uint8_t(*display)[4] = image_of(r, "display", sizeof *display);
    uint32_t lit = 0;
    for (uint32_t i = 0; i < PIXELS; i++)
        lit += display[i][0] || display[i][1] || display[i][2];
    CHECK(lit == 0);
    free(display);
    renderer_destroy(r);
}

TEST(the_validation_layer_is_silent)
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
    RUN(pixels_hold_the_plane_that_they_look_at);
    RUN(pixel_row_zero_is_the_top);
    RUN(back_faces_are_culled_unless_double_sided);
    RUN(mirrored_instances_show_their_front);
    RUN(primitives_outside_of_the_view_are_not_missed_at_its_border);
    RUN(alpha_mask_cuts);
    RUN(texture_transforms_move_the_texture);
    RUN(normal_maps_bend_along_u_and_against_v);
    RUN(shading_normals_stay_on_the_visible_side);
    RUN(nothing_moves_in_a_still_frame);
    RUN(motion_leads_back_when_the_camera_moves);
    RUN(motion_leads_back_when_the_object_moves);
    RUN(radiance_is_the_sum_of_its_parts);
    RUN(known_radiance_has_known_display_values);
    RUN(automatic_exposure_puts_the_log_average_at_middle_grey);
    RUN(black_pixels_do_not_count_in_the_exposure);
    RUN(an_empty_scene_is_black);
    RUN(the_validation_layer_is_silent);
    gpu_destroy(device);
    return test_end();
}
