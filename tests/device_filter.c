// The filters over pixels on images made here: interleave, svgf and taa, without a scene or a renderer.
#include "test.h"

#include "modules/filters.h"

#include <math.h>

enum { SIDE_MAX = 128, TEXELS_MAX = SIDE_MAX * SIDE_MAX };

static gpu *device;
static interleave interleaver;
static svgf filter;
static taa steadier;

typedef float texel[4];

// What a test sees: a picture of planes before a camera at the origin that looks along -z.
typedef struct stage {
    frame_graph *graph;
    frame_constants constants;
    gpu_buffer frame;
    uint32_t width, height;
    float view_z[TEXELS_MAX];
    float normal[TEXELS_MAX][3];
    gpu_buffer uploads[16];
    uint32_t upload_count;
    uint16_t motion_x; // of every pixel, a half float
    uint16_t identity[TEXELS_MAX]; // what tells instances apart
} stage;

// ---- Helpers

static float random_unit(uint32_t *state)
{
    *state = *state * 747796405u + 2891336453u;
    const uint32_t word = ((*state >> ((*state >> 28) + 4)) ^ *state) * 277803737u;
    return (float)(((word >> 22) ^ word) >> 8) / 16777216.0f;
}

static stage *stage_create(uint32_t width, uint32_t height)
{
    stage *s = memory_alloc(sizeof *s);
    s->graph = frame_graph_create(device);
    s->width = width;
    s->height = height;
    s->constants = (frame_constants){
        .width = width,
        .height = height,
        .near_plane = 0.1f,
        .forward = {0, 0, -1},
        .right = {1, 0, 0},
        .up = {0, 1, 0},
        .previous_forward = {0, 0, -1},
        .previous_right = {1, 0, 0},
        .previous_up = {0, 1, 0},
        .scene_radius = 10,
        // Rows (1 0 0 0), (0 -1 0 0), (0 0 0 0.1), (0 0 -1 0), column by column.
        .view_projection = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, -1, 0, 0, 0.1f, 0},
        .previous_view_projection = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, -1, 0, 0, 0.1f, 0},
    };
    const gpu_buffer_desc desc = {
        .name = "frame", .size = sizeof s->constants, .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT};
    s->frame = gpu_buffer_create(device, &desc);
    gpu_scene_bind_buffer(device, SCENE_FRAME, s->frame);
    for (uint32_t i = 0; i < width * height; i++) {
        s->identity[i] = 1;
        s->view_z[i] = 10;
        s->normal[i][2] = 1;
    }
    return s;
}

static void stage_destroy(stage *s)
{
    frame_graph_destroy(s->graph);
    gpu_buffer_destroy(device, s->frame);
    free(s);
}

typedef struct injection {
    gpu_buffer from;
    char name[32];
    VkImageAspectFlags aspect;
    uint32_t width, height;
} injection;

static void injection_execute(const frame_graph_context *context, void *user)
{
    const injection *in = user;
    const VkBufferImageCopy region = {
        .imageSubresource = {.aspectMask = in->aspect, .layerCount = 1},
        .imageExtent = {in->width, in->height, 1},
    };
    vkCmdCopyBufferToImage(gpu_commands_handle(context->commands), gpu_buffer_handle(device, in->from),
                           gpu_image_handle(device, frame_graph_image(context, in->name)),
                           VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region);
}

// Adds a pass that makes image `name` of these texels.
static void inject(stage *s, const char *name, VkFormat format, uint32_t width, uint32_t height, const void *texels)
{
    const gpu_buffer_desc buffer = {
        .name = name, .size = (VkDeviceSize)width * height * gpu_format_size(format), .data = texels};
    injection in = {.from = gpu_buffer_create(device, &buffer), .width = width, .height = height};
    in.aspect = format == VK_FORMAT_D32_SFLOAT ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT;
    snprintf(in.name, sizeof in.name, "%s", name);
    s->uploads[s->upload_count++] = in.from;
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = FRAME_GRAPH_TRANSFER,
        .execute = injection_execute,
        .user = &in,
        .user_size = sizeof in,
    };
    const frame_graph_resource_desc image = frame_graph_image_of(format, width, height);
    frame_graph_create_resource(frame_graph_pass_add(s->graph, &desc), name, &image, ACCESS_TRANSFER_WRITE);
}

static int16_t snorm(float value)
{
    return (int16_t)lroundf(value * 32767.0f);
}

// Normals here all have z > 0, where the octahedral map is a plain division.
static void normal_encode(const float n[3], int16_t out[4])
{
    const float sum = fabsf(n[0]) + fabsf(n[1]) + fabsf(n[2]);
    out[0] = out[2] = snorm(n[0] / sum);
    out[1] = out[3] = snorm(n[1] / sum);
}

// Starts a frame: the stage's surfaces.
static void frame_begin(stage *s)
{
    static float depth[TEXELS_MAX];
    static int16_t normals[TEXELS_MAX][4];
    static uint16_t motion[TEXELS_MAX][2];
    static uint16_t albedo[TEXELS_MAX][4];
    for (uint32_t i = 0; i < s->width * s->height; i++) {
        depth[i] = s->view_z[i] > 0 ? 0.1f / s->view_z[i] : 0;
        normal_encode(s->normal[i], normals[i]);
        motion[i][0] = s->motion_x;
        albedo[i][3] = s->identity[i];
    }
    CHECK(gpu_buffer_write(device, s->frame, 0, &s->constants, sizeof s->constants));
    frame_graph_begin(s->graph);
    inject(s, "depth", VK_FORMAT_D32_SFLOAT, s->width, s->height, depth);
    inject(s, "normals", VK_FORMAT_R16G16B16A16_SNORM, s->width, s->height, normals);
    inject(s, "motion", VK_FORMAT_R16G16_SFLOAT, s->width, s->height, motion);
    inject(s, "albedo", VK_FORMAT_R16G16B16A16_UNORM, s->width, s->height, albedo);
    svgf_declare_geometry(&filter, s->graph, s->width, s->height);
}

static void frame_end(stage *s)
{
    CHECK(frame_graph_execute(s->graph));
    for (uint32_t i = 0; i < s->upload_count; i++)
        gpu_buffer_destroy(device, s->uploads[i]);
    s->upload_count = 0;
}

static void read_back(const stage *s, const char *name, texel *texels)
{
    const gpu_image image = frame_graph_find_image(s->graph, name);
    CHECK(image.id != 0);
    if (image.id)
        CHECK(gpu_image_read(device, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels,
                             sizeof(texel) * s->width * s->height));
}

static void pair_inject(stage *s, const texel *unshadowed, const texel *shadowed)
{
    inject(s, "shadow_u", VK_FORMAT_R32G32B32A32_SFLOAT, s->width, s->height, unshadowed);
    inject(s, "shadow_s", VK_FORMAT_R32G32B32A32_SFLOAT, s->width, s->height, shadowed);
}

// One frame of svgf.
static void filter_frame_of(stage *s, const texel *unshadowed, const texel *shadowed, const svgf_desc *desc,
                            texel *out_u, texel *out_s)
{
    frame_begin(s);
    pair_inject(s, unshadowed, shadowed);
    svgf_declare(&filter, s->graph, s->width, s->height, "shadow", desc);
    frame_graph_export(s->graph, "shadow_u_filtered", ACCESS_TRANSFER_READ);
    frame_graph_export(s->graph, "shadow_s_filtered", ACCESS_TRANSFER_READ);
    frame_graph_export(s->graph, "shadow_moments", ACCESS_TRANSFER_READ);
    frame_end(s);
    read_back(s, "shadow_u_filtered", out_u);
    read_back(s, "shadow_s_filtered", out_s);
}

static void filter_frame(stage *s, const texel *unshadowed, const texel *shadowed, texel *out_u, texel *out_s)
{
    filter_frame_of(s, unshadowed, shadowed, &(svgf_desc){0}, out_u, out_s);
}

static float half_decode(uint16_t half) // of non-negative finite numbers
{
    const int exponent = half >> 10;
    return exponent ? ldexpf((float)(1024 + (half & 1023)), exponent - 25) : ldexpf((float)(half & 1023), -24);
}

// One frame of taa with history; the ratio's red channel.
static void taa_frame(stage *s, const texel *unshadowed, const texel *shadowed, float *ratio)
{
    static uint16_t halves[TEXELS_MAX][4];
    frame_begin(s);
    pair_inject(s, unshadowed, shadowed);
    taa_declare_ratio(&steadier, s->graph, s->width, s->height, "shadow");
    taa_declare(&steadier, s->graph, s->width, s->height, "shadow", &(taa_desc){0});
    frame_graph_export(s->graph, "shadow_ratio", ACCESS_TRANSFER_READ);
    frame_end(s);
    const gpu_image image = frame_graph_find_image(s->graph, "shadow_ratio");
    CHECK(gpu_image_read(device, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, halves,
                         sizeof halves[0] * s->width * s->height));
    for (uint32_t i = 0; i < s->width * s->height; i++)
        ratio[i] = half_decode(halves[i][0]);
}

static void texel_set(texel t, float red, float green, float blue)
{
    t[0] = red;
    t[1] = green;
    t[2] = blue;
    t[3] = 0;
}

// ---- Interleaving

// The tiled image whose pixel (x, y) is value(x, y) in all channels.
static void gather(stage *s, uint32_t n, float (*value)(uint32_t x, uint32_t y, uint32_t n), texel *out)
{
    static texel tiled[TEXELS_MAX];
    const uint32_t tile_width = div_up_u32(s->width, n), tile_height = div_up_u32(s->height, n);
    memset(tiled, 0, sizeof tiled);
    for (uint32_t y = 0; y < s->height; y++)
        for (uint32_t x = 0; x < s->width; x++) {
            const uint32_t column = x % n * tile_width + x / n, row = y % n * tile_height + y / n;
            for (int k = 0; k < 4; k++)
                tiled[row * n * tile_width + column][k] = value(x, y, n);
        }
    frame_begin(s);
    inject(s, "indirect", VK_FORMAT_R32G32B32A32_SFLOAT, n * tile_width, n * tile_height, tiled);
    interleave_declare(&interleaver, s->graph, s->width, s->height, n);
    frame_graph_export(s->graph, "indirect_gathered", ACCESS_TRANSFER_READ);
    frame_end(s);
    read_back(s, "indirect_gathered", out);
}

static float value_constant(uint32_t x, uint32_t y, uint32_t n)
{
    (void)x, (void)y, (void)n;
    return 3.25f;
}

static float value_of_tile(uint32_t x, uint32_t y, uint32_t n)
{
    return (float)(y % n * n + x % n);
}

static float value_of_half(uint32_t x, uint32_t y, uint32_t n)
{
    (void)y, (void)n;
    return x < 30 ? 1.0f : 2.0f;
}

TEST(gathering_a_constant_gives_the_constant)
{
    static texel out[TEXELS_MAX];
    for (uint32_t n = 2; n <= 4; n *= 2) {
        stage *s = stage_create(61, 47);
        gather(s, n, value_constant, out);
        for (uint32_t i = 0; i < s->width * s->height; i++)
            for (int k = 0; k < 4; k++)
                CHECK_NEAR(out[i][k], 3.25, 2e-6);
        stage_destroy(s);
    }
}

TEST(gathering_tiles_gives_their_mean)
{
    static texel out[TEXELS_MAX];
    for (uint32_t n = 2; n <= 4; n *= 2) {
        stage *s = stage_create(61, 47);
        gather(s, n, value_of_tile, out);
        for (uint32_t i = 0; i < s->width * s->height; i++)
            CHECK_NEAR(out[i][0], 0.5 * (n * n - 1), 1e-5);
        stage_destroy(s);
    }
}

static float value_of_slope(uint32_t x, uint32_t y, uint32_t n)
{
    (void)y;
    return (float)(x * (x % n));
}

// Each tile's light is linear over the picture, with a slope of its own.
TEST(gathering_interpolates_each_tile)
{
    static texel out[TEXELS_MAX];
    for (uint32_t n = 2; n <= 4; n *= 2) {
        stage *s = stage_create(61, 47);
        gather(s, n, value_of_slope, out);
        for (uint32_t i = 0; i < s->width * s->height; i++) {
            const uint32_t x = i % s->width;
            if (x >= n && x + n < s->width)
                CHECK_NEAR(out[i][0], 0.5 * (n - 1) * x, 1e-4);
        }
        stage_destroy(s);
    }
}

TEST(gathering_stops_at_a_step_in_depth)
{
    static texel out[TEXELS_MAX];
    stage *s = stage_create(61, 47);
    for (uint32_t i = 0; i < s->width * s->height; i++)
        s->view_z[i] = i % s->width < 30 ? 10 : 5;
    gather(s, 4, value_of_half, out);
    for (uint32_t i = 0; i < s->width * s->height; i++)
        CHECK_NEAR(out[i][0], i % s->width < 30 ? 1 : 2, 1e-5);
    stage_destroy(s);
}

// ---- SVGF

static texel in_u[TEXELS_MAX], in_s[TEXELS_MAX], out_u[TEXELS_MAX], out_s[TEXELS_MAX];

TEST(ratio_of_a_filtered_pair_stays_between_0_and_1)
{
    stage *s = stage_create(67, 45);
    uint32_t random = 1;
    for (int frame = 0; frame < 3; frame++) {
        for (uint32_t i = 0; i < s->width * s->height; i++)
            for (int k = 0; k < 3; k++) { // six decades of light, and none
                in_u[i][k] = random_unit(&random) < 0.2f ? 0 : powf(10, 6 * random_unit(&random) - 3);
                in_s[i][k] = in_u[i][k] * fminf(1, 1.5f * random_unit(&random));
            }
        filter_frame(s, in_u, in_s, out_u, out_s);
        for (uint32_t i = 0; i < s->width * s->height; i++)
            for (int k = 0; k < 3; k++)
                CHECK(isfinite(out_u[i][k]) && out_s[i][k] >= 0 && out_s[i][k] <= out_u[i][k]);
    }
    stage_destroy(s);
}

TEST(filter_keeps_a_constant)
{
    stage *s = stage_create(67, 45);
    for (uint32_t i = 0; i < s->width * s->height; i++) {
        texel_set(in_u[i], 4, 2, 1);
        texel_set(in_s[i], 3, 1, 1);
    }
    for (int frame = 0; frame < 3; frame++)
        filter_frame(s, in_u, in_s, out_u, out_s);
    for (uint32_t i = 0; i < s->width * s->height; i++)
        for (int k = 0; k < 3; k++) {
            CHECK_NEAR(out_u[i][k], in_u[i][k], 1e-5);
            CHECK_NEAR(out_s[i][k], in_s[i][k], 1e-5);
        }
    stage_destroy(s);
}

TEST(pixels_without_geometry_are_zero)
{
    stage *s = stage_create(16, 16);
    for (uint32_t i = 0; i < 256; i++) {
        s->view_z[i] = i % 16 < 8 ? 10 : 0;
        texel_set(in_u[i], 1, 1, 1);
        texel_set(in_s[i], 1, 1, 1);
    }
    filter_frame(s, in_u, in_s, out_u, out_s);
    for (uint32_t i = 0; i < 256; i++)
        CHECK_NEAR(out_u[i][0], i % 16 < 8 ? 1 : 0, 1e-6);
    stage_destroy(s);
}

// Light that falls off to the right by a factor of ten, four shadow samples of which `visible` reach it.
static void pair_of_samples(const stage *s, float visible, uint32_t *random)
{
    for (uint32_t i = 0; i < s->width * s->height; i++) {
        const float light = 5 * powf(10, -(float)(i % s->width) / (float)s->width);
        float hits = 0;
        for (int k = 0; k < 4; k++)
            hits += random_unit(random) < visible;
        texel_set(in_u[i], light, light, light);
        texel_set(in_s[i], 0.25f * hits * light, 0.25f * hits * light, 0.25f * hits * light);
    }
}

typedef struct statistics {
    double mean_u, mean_s, mean_ratio, ratio_variance; // over all pixels
} statistics;

static statistics statistics_of(const stage *s, const texel *unshadowed, const texel *shadowed)
{
    statistics result = {0};
    const uint32_t count = s->width * s->height;
    double sum = 0, square = 0;
    for (uint32_t i = 0; i < count; i++) {
        const double ratio = (double)shadowed[i][0] / (double)unshadowed[i][0];
        result.mean_u += (double)unshadowed[i][0] / count;
        result.mean_s += (double)shadowed[i][0] / count;
        sum += ratio;
        square += ratio * ratio;
    }
    result.mean_ratio = sum / count;
    result.ratio_variance = square / count - sum / count * sum / count;
    return result;
}

TEST(filter_removes_noise_and_keeps_the_mean)
{
    stage *s = stage_create(SIDE_MAX, SIDE_MAX);
    uint32_t random = 7;
    double mean_s = 0;
    for (int frame = 0; frame < 16; frame++) {
        pair_of_samples(s, 0.7f, &random);
        filter_frame(s, in_u, in_s, out_u, out_s);
        const statistics raw = statistics_of(s, in_u, in_s), filtered = statistics_of(s, out_u, out_s);
        mean_s += raw.mean_s / (frame + 1) - mean_s / (frame + 1);
        if (frame == 0 || frame == 15) {
            printf("  after %d frames: variance of the ratio %.5f to %.6f (1/%.0f), mean of S %.4f to %.4f\n",
                   frame + 1, raw.ratio_variance, filtered.ratio_variance, raw.ratio_variance / filtered.ratio_variance,
                   mean_s, filtered.mean_s);
            CHECK(filtered.ratio_variance < raw.ratio_variance / 10);
            CHECK_NEAR(filtered.mean_u / raw.mean_u, 1, 0.01);
            CHECK_NEAR(filtered.mean_s / mean_s, 1, 0.01);
        }
    }
    stage_destroy(s);
}

// Where U is shown, its noise is filtered like that of S.
TEST(filter_keeps_the_mean_of_noisy_light_that_is_shown)
{
    stage *s = stage_create(SIDE_MAX, SIDE_MAX);
    uint32_t random = 17;
    double mean = 0, deviation = 0;
    for (int frame = 0; frame < 16; frame++) {
        for (uint32_t i = 0; i < s->width * s->height; i++) {
            const float light = 0.2f + 1.6f * random_unit(&random);
            const float visible = random_unit(&random) < 0.5f;
            texel_set(in_u[i], light, light, light);
            texel_set(in_s[i], visible * light, visible * light, visible * light);
        }
        filter_frame_of(s, in_u, in_s, &(svgf_desc){.light_shown = true}, out_u, out_s);
        const statistics filtered = statistics_of(s, out_u, out_s);
        CHECK_NEAR(filtered.mean_u, 1, 0.01);
        CHECK_NEAR(filtered.mean_s, 0.5, 0.01);
        mean = filtered.mean_u;
    }
    for (uint32_t i = 0; i < s->width * s->height; i++)
        deviation += pow((double)out_u[i][0] - mean, 2) / (s->width * s->height);
    printf("  deviation of U 0.46 to %.4f\n", sqrt(deviation));
    CHECK(sqrt(deviation) < 0.02);
    stage_destroy(s);
}

// Every tile has its own ratio, in every frame.
TEST(filter_hides_the_tiles_of_interleaving)
{
    for (uint32_t n = 2; n <= 4; n *= 2) {
        stage *s = stage_create(64, 64);
        for (uint32_t i = 0; i < 64 * 64; i++) {
            const float visible = value_of_tile(i % 64, i / 64, n) / (float)(n * n - 1);
            texel_set(in_u[i], 1, 1, 1);
            texel_set(in_s[i], visible, visible, visible);
        }
        for (int frame = 0; frame < 6; frame++)
            filter_frame_of(s, in_u, in_s, &(svgf_desc){.interleave = n}, out_u, out_s);
        for (uint32_t y = 16; y < 48; y++)
            for (uint32_t x = 16; x < 48; x++)
                CHECK_NEAR(out_s[y * 64 + x][0] / out_u[y * 64 + x][0], 0.5, 0.01);
        stage_destroy(s);
    }
}

// Frames in the history, by pixel: the alpha channel of the moments.
static const texel *history_read(const stage *s)
{
    static texel moments[TEXELS_MAX];
    read_back(s, "shadow_moments", moments);
    return (const texel *)moments;
}

// The eye moves to the right by four pixels a frame: what is four pixels right of a pixel's place in the last frame.
TEST(history_follows_the_camera)
{
    stage *s = stage_create(64, 64);
    s->motion_x = 0x4400; // 4
    for (uint32_t i = 0; i < 64 * 64; i++) {
        texel_set(in_u[i], 1, 1, 1);
        texel_set(in_s[i], 0.5f, 0.5f, 0.5f);
    }
    for (int frame = 0; frame < 6; frame++) {
        s->constants.previous_eye[0] = s->constants.eye[0];
        s->constants.eye[0] += 4 * 20.0f / 64;
        // clip x = x - eye x
        s->constants.previous_view_projection[12] = -s->constants.previous_eye[0];
        filter_frame(s, in_u, in_s, out_u, out_s);
    }
    const texel *history = history_read(s);
    for (uint32_t i = 0; i < 64 * 64; i++)
        CHECK_NEAR(history[i][3], fmin(6, 1 + (63 - i % 64) / 4), 0.01);
    stage_destroy(s);
}

TEST(history_ends_where_another_surface_appears)
{
    stage *s = stage_create(64, 64);
    for (uint32_t i = 0; i < 64 * 64; i++) {
        texel_set(in_u[i], 1, 1, 1);
        texel_set(in_s[i], 0.5f, 0.5f, 0.5f);
    }
    filter_frame(s, in_u, in_s, out_u, out_s);
    filter_frame(s, in_u, in_s, out_u, out_s);
    for (uint32_t i = 0; i < 64 * 64; i++) {
        s->view_z[i] = i % 64 < 20 ? 8 : 10; // nearer on the left
        s->normal[i][0] = i % 64 < 44 ? 0 : 0.6f; // turned away on the right
        s->normal[i][2] = i % 64 < 44 ? 1 : 0.8f;
    }
    filter_frame(s, in_u, in_s, out_u, out_s);
    const texel *history = history_read(s);
    for (uint32_t i = 0; i < 64 * 64; i++)
        CHECK_NEAR(history[i][3], i % 64 >= 20 && i % 64 < 44 ? 3 : 1, 0.01);
    stage_destroy(s);
}

// Something else in the same place, in the same plane: an instance that slid over another.
TEST(history_ends_where_another_instance_appears)
{
    stage *s = stage_create(64, 64);
    for (uint32_t i = 0; i < 64 * 64; i++) {
        texel_set(in_u[i], 1, 1, 1);
        texel_set(in_s[i], 0.5f, 0.5f, 0.5f);
    }
    filter_frame(s, in_u, in_s, out_u, out_s);
    filter_frame(s, in_u, in_s, out_u, out_s);
    for (uint32_t i = 0; i < 64 * 64; i++)
        s->identity[i] = i % 64 < 20 ? 2 : 1;
    filter_frame(s, in_u, in_s, out_u, out_s);
    const texel *history = history_read(s);
    for (uint32_t i = 0; i < 64 * 64; i++)
        CHECK_NEAR(history[i][3], i % 64 >= 20 ? 3 : 1, 0.01);
    stage_destroy(s);
}

// While nothing changes, the history is the mean of all frames: its noise falls with their number.
TEST(history_of_a_still_picture_grows_and_then_holds)
{
    static texel before_u[TEXELS_MAX], before_s[TEXELS_MAX];
    stage *s = stage_create(64, 64);
    uint32_t random = 29;
    for (uint32_t frame = 0; frame < STILL_SAMPLES; frame++) {
        pair_of_samples(s, 0.5f, &random);
        filter_frame_of(s, in_u, in_s, &(svgf_desc){.still_frames = frame}, out_u, out_s);
    }
    const texel *history = history_read(s);
    for (uint32_t i = 0; i < 64 * 64; i++)
        CHECK(history[i][3] >= 1 && history[i][3] <= STILL_SAMPLES);
    double frames = 0;
    for (uint32_t i = 0; i < 64 * 64; i++)
        frames += (double)history[i][3] / (64 * 64);
    printf("  %.1f frames of %u in the history\n", frames, STILL_SAMPLES);
    CHECK(frames > 0.9 * STILL_SAMPLES); // what looks like a change by chance costs some
    for (int frame = 0; frame < 3; frame++) { // the pair is not read any more
        memcpy(before_u, out_u, sizeof before_u);
        memcpy(before_s, out_s, sizeof before_s);
        pair_of_samples(s, 0.1f, &random);
        filter_frame_of(s, in_u, in_s, &(svgf_desc){.hold = true}, out_u, out_s);
        for (uint32_t i = 0; i < 64 * 64 && frame > 0; i++)
            CHECK(memcmp(before_u[i], out_u[i], sizeof(texel)) == 0 &&
                  memcmp(before_s[i], out_s[i], sizeof(texel)) == 0);
    }
    // Something changes: the history goes on from what was held.
    filter_frame(s, in_u, in_s, out_u, out_s);
    history = history_read(s);
    for (uint32_t i = 0; i < 64 * 64; i++)
        CHECK(history[i][3] <= 31);
    stage_destroy(s);
}

// Frames until the mean ratio is within 0.05 of its new value after a change of light and shadow.
static int frames_of_lag(float before, float after, float light_factor)
{
    stage *s = stage_create(64, 64);
    uint32_t random = 11;
    int frame = 0;
    for (double off = 1; frame < 20 + 64 && (frame <= 20 || off > 0.05); frame++) {
        pair_of_samples(s, frame < 20 ? before : after, &random);
        for (uint32_t i = 0; i < s->width * s->height && frame >= 20; i++)
            for (int k = 0; k < 3; k++) {
                in_u[i][k] *= light_factor;
                in_s[i][k] *= light_factor;
            }
        filter_frame(s, in_u, in_s, out_u, out_s);
        const statistics filtered = statistics_of(s, out_u, out_s);
        off = fabs(filtered.mean_ratio - (double)after);
    }
    stage_destroy(s);
    return frame - 20;
}

TEST(change_of_light_leaves_no_lag)
{
    const int dimmer = frames_of_lag(0.9f, 0.1f, 0.01f), brighter = frames_of_lag(0.1f, 0.9f, 100);
    const int shadow = frames_of_lag(0.95f, 0.05f, 1), sharp = frames_of_lag(1, 0, 1);
    printf("  frames until the ratio follows: light / 100 %d, light * 100 %d, soft shadow %d, sharp shadow %d\n",
           dimmer, brighter, shadow, sharp);
    CHECK(dimmer <= 2 && brighter <= 2 && shadow <= 4 && sharp <= 2);
}

// Of a thing as small as a pixel, under one light that is seen and another that is not and rarely sampled.
TEST(one_sample_of_another_light_leaves_the_history_of_a_pixel)
{
    stage *s = stage_create(48, 48);
    for (uint32_t i = 0; i < 48 * 48; i++) // no two neighbours on one surface
        s->view_z[i] = (float)(10 << (2 * (i % 48 % 2) + 4 * (i / 48 % 2)));
    for (int frame = 0; frame < 9; frame++) {
        for (uint32_t i = 0; i < 48 * 48; i++) {
            const bool rare = frame == 8 && i % 7 == 0;
            const float u = rare ? 0.5f : 1, visible = rare ? 0 : 1;
            texel_set(in_u[i], u, u, u);
            texel_set(in_s[i], visible, visible, visible);
        }
        filter_frame(s, in_u, in_s, out_u, out_s);
    }
    double lowest = 1;
    for (uint32_t i = 0; i < 48 * 48; i++)
        lowest = fmin(lowest, (double)(out_s[i][0] / out_u[i][0]));
    printf("  lowest ratio %.3f\n", lowest);
    CHECK(lowest > 0.9);
    stage_destroy(s);
}

// Lit on the left, shadowed on the right: what the two sides have become.
static void edge_check(stage *s)
{
    for (uint32_t i = 0; i < s->width * s->height; i++) {
        const float visible = i % s->width < s->width / 2;
        texel_set(in_u[i], 1, 1, 1);
        texel_set(in_s[i], visible, visible, visible);
    }
    filter_frame(s, in_u, in_s, out_u, out_s);
    for (uint32_t i = 0; i < s->width * s->height; i++)
        CHECK_NEAR(out_s[i][0] / out_u[i][0], in_s[i][0], 1e-3);
    stage_destroy(s);
}

// U.a = 1: no sample. The history stays, to the bit, and what is sampled again counts as before.
TEST(pixels_without_a_sample_keep_their_history)
{
    static texel before_u[TEXELS_MAX], before_s[TEXELS_MAX];
    stage *s = stage_create(67, 45);
    uint32_t random = 23;
    for (int frame = 0; frame < 8; frame++) {
        pair_of_samples(s, 0.6f, &random);
        filter_frame(s, in_u, in_s, before_u, before_s);
    }
    for (uint32_t i = 0; i < s->width * s->height; i++) {
        texel_set(in_u[i], 0, 0, 0);
        texel_set(in_s[i], 0, 0, 0);
        in_u[i][3] = 1;
    }
    for (int frame = 0; frame < 3; frame++)
        filter_frame(s, in_u, in_s, out_u, out_s);
    for (uint32_t i = 0; i < s->width * s->height; i++)
        CHECK(memcmp(before_u[i], out_u[i], sizeof(texel)) == 0 && memcmp(before_s[i], out_s[i], sizeof(texel)) == 0);
    stage_destroy(s);
}

TEST(filter_stops_at_a_step_in_depth)
{
    stage *s = stage_create(64, 64);
    for (uint32_t i = 0; i < 64 * 64; i++)
        s->view_z[i] = i % 64 < 32 ? 10 : 5;
    edge_check(s);
}

TEST(filter_stops_at_an_edge_between_walls)
{
    stage *s = stage_create(64, 64);
    for (uint32_t i = 0; i < 64 * 64; i++) {
        s->normal[i][0] = i % 64 < 32 ? 0.6f : -0.6f;
        s->normal[i][2] = 0.8f;
    }
    edge_check(s);
}

// The outer edge of a shadow on one surface, known without noise, is kept by the value stop once there is a history.
TEST(filter_keeps_a_sharp_shadow_once_it_is_sure)
{
    stage *s = stage_create(64, 64);
    for (uint32_t i = 0; i < 64 * 64; i++) {
        const float visible = i % 64 < 32;
        texel_set(in_u[i], 1, 1, 1);
        texel_set(in_s[i], visible, visible, visible);
    }
    for (int frame = 0; frame < 6; frame++)
        filter_frame(s, in_u, in_s, out_u, out_s);
    for (uint32_t i = 0; i < 64 * 64; i++)
        CHECK_NEAR(out_s[i][0] / out_u[i][0], in_s[i][0], 0.02);
    stage_destroy(s);
}

// ---- TAA

TEST(ratio_of_a_still_picture_settles)
{
    static float ratio[TEXELS_MAX], before[TEXELS_MAX];
    stage *s = stage_create(64, 48);
    uint32_t random = 3;
    for (uint32_t i = 0; i < s->width * s->height; i++) {
        const float visible = random_unit(&random);
        texel_set(in_u[i], 2, 2, 2);
        texel_set(in_s[i], 2 * visible, 2 * visible, 2 * visible);
    }
    for (int frame = 0; frame < 8; frame++) {
        memcpy(before, ratio, sizeof before);
        taa_frame(s, in_u, in_s, ratio);
    }
    for (uint32_t i = 0; i < s->width * s->height; i++) {
        CHECK_NEAR(ratio[i], before[i], 1e-3);
        CHECK_NEAR(ratio[i], in_s[i][0] / in_u[i][0], 2e-3);
    }
    stage_destroy(s);
}

TEST(ratio_follows_a_change_of_light_at_once)
{
    static float ratio[TEXELS_MAX];
    stage *s = stage_create(64, 48);
    for (int frame = 0; frame < 5; frame++) {
        const float visible = frame < 4 ? 0.25f : 0.75f;
        for (uint32_t i = 0; i < s->width * s->height; i++) {
            texel_set(in_u[i], 1, 1, 1);
            texel_set(in_s[i], visible, visible, visible);
        }
        taa_frame(s, in_u, in_s, ratio);
    }
    for (uint32_t i = 0; i < s->width * s->height; i++)
        CHECK_NEAR(ratio[i], 0.75, 1e-3);
    stage_destroy(s);
}

TEST(noise_over_time_falls_in_the_steadied_ratio)
{
    static float ratio[TEXELS_MAX];
    static double sum[TEXELS_MAX], square[TEXELS_MAX];
    enum { FRAMES = 64, SETTLED = 40 };
    stage *s = stage_create(64, 48);
    const uint32_t count = s->width * s->height;
    uint32_t random = 5;
    double input = 0, output = 0;
    for (int frame = 0; frame < FRAMES; frame++) {
        for (uint32_t i = 0; i < count; i++) {
            const float visible = 0.5f + 0.1f * (random_unit(&random) - 0.5f);
            texel_set(in_u[i], 1, 1, 1);
            texel_set(in_s[i], visible, visible, visible);
        }
        taa_frame(s, in_u, in_s, ratio);
        for (uint32_t i = 0; i < count && frame >= SETTLED; i++) {
            input += pow((double)in_s[i][0] - 0.5, 2);
            sum[i] += (double)ratio[i];
            square[i] += (double)ratio[i] * (double)ratio[i];
        }
    }
    const double frames = FRAMES - SETTLED;
    for (uint32_t i = 0; i < count; i++)
        output += square[i] - sum[i] * sum[i] / frames;
    printf("  deviation over time %.5f to %.5f\n", sqrt(input / frames / count), sqrt(output / frames / count));
    CHECK(output < input / 4);
    stage_destroy(s);
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
    if (!interleave_create(device, &interleaver) || !svgf_create(device, &filter) || !taa_create(device, &steadier))
        return EXIT_FAILURE;
    RUN(gathering_a_constant_gives_the_constant);
    RUN(gathering_tiles_gives_their_mean);
    RUN(gathering_interpolates_each_tile);
    RUN(gathering_stops_at_a_step_in_depth);
    RUN(ratio_of_a_filtered_pair_stays_between_0_and_1);
    RUN(filter_keeps_a_constant);
    RUN(pixels_without_geometry_are_zero);
    RUN(filter_removes_noise_and_keeps_the_mean);
    RUN(filter_keeps_the_mean_of_noisy_light_that_is_shown);
    RUN(filter_hides_the_tiles_of_interleaving);
    RUN(history_follows_the_camera);
    RUN(history_ends_where_another_surface_appears);
    RUN(history_ends_where_another_instance_appears);
    RUN(history_of_a_still_picture_grows_and_then_holds);
    RUN(change_of_light_leaves_no_lag);
    RUN(one_sample_of_another_light_leaves_the_history_of_a_pixel);
    RUN(pixels_without_a_sample_keep_their_history);
    RUN(filter_stops_at_a_step_in_depth);
    RUN(filter_stops_at_an_edge_between_walls);
    RUN(filter_keeps_a_sharp_shadow_once_it_is_sure);
    RUN(ratio_of_a_still_picture_settles);
    RUN(ratio_follows_a_change_of_light_at_once);
    RUN(noise_over_time_falls_in_the_steadied_ratio);
    RUN(validation_layer_is_silent);
    interleave_fini(device, &interleaver);
    svgf_fini(device, &filter);
    taa_fini(device, &steadier);
    gpu_destroy(device);
    return test_end();
}
