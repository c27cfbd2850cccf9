// Evaluation of animations: small cases computed by hand, and models against an evaluation of their files in double
// precision that shares nothing with the loader or with modules/animation.c.
#include "modules/animation.h"
#include "scene_test.h"

#include <cjson/cJSON.h>

#define MODELS "../shared/scenes/animated/"

// ---- Channels by hand

static const float times[] = {1, 2, 4};

static scene_channel channel_of(scene_target target, scene_interpolation interpolation, uint32_t width,
                                const float *values)
{
    return (scene_channel){.target = target,
                           .interpolation = interpolation,
                           .width = width,
                           .key_count = countof(times),
                           .times = times,
                           .values = values};
}

static double value_at(const scene_channel *channel, double time)
{
    float value[4];
    animation_channel_value(channel, time, value);
    return (double)value[0];
}

TEST(steps_hold_until_the_next_key)
{
    static const float values[] = {10, 20, 40};
    const scene_channel channel = channel_of(SCENE_LIGHT_INTENSITY, SCENE_STEP, 1, values);
    static const double expected[][2] = {{-1, 10}, {1, 10}, {1.999, 10}, {2, 20}, {3.999, 20}, {4, 40}, {99, 40}};
    for (uint32_t i = 0; i < countof(expected); i++) {
        CHECK(value_at(&channel, expected[i][0]) == expected[i][1]);
    }
}

TEST(lines_go_from_key_to_key_and_end_with_them)
{
    static const float values[] = {10, 20, 40};
    const scene_channel channel = channel_of(SCENE_LIGHT_INTENSITY, SCENE_LINEAR, 1, values);
    static const double expected[][2] = {{0, 10}, {1, 10}, {1.25, 12.5}, {2, 20}, {3, 30}, {3.5, 35}, {4, 40}, {5, 40}};
    for (uint32_t i = 0; i < countof(expected); i++) {
        CHECK_NEAR(value_at(&channel, expected[i][0]), expected[i][1], 1e-5);
    }
}

// In-tangent, value, out-tangent. From 1 s to 2 s: p(t) = h00 1 + h10 2 + h01 3 + h11 4; from 2 s to 4 s tangents count
// twice, as they are per second.
TEST(splines_pass_their_keys_with_their_tangents)
{
    static const float values[] = {99, 1, 2, 4, 3, 6, -8, 5, 99};
    const scene_channel channel = channel_of(SCENE_LIGHT_INTENSITY, SCENE_CUBIC, 1, values);
    CHECK(value_at(&channel, 0) == 1 && value_at(&channel, 1) == 1 && value_at(&channel, 2) == 3);
    CHECK(value_at(&channel, 4) == 5 && value_at(&channel, 9) == 5);
    CHECK_NEAR(value_at(&channel, 1.5), 0.5 * 1 + 0.125 * 2 + 0.5 * 3 - 0.125 * 4, 1e-6);
    CHECK_NEAR(value_at(&channel, 1.25), 0.84375 * 1 + 0.140625 * 2 + 0.15625 * 3 - 0.046875 * 4, 1e-6);
    CHECK_NEAR(value_at(&channel, 3), 0.5 * 3 + 0.25 * 6 + 0.5 * 5 - 0.25 * -8, 1e-6);
}

TEST(one_key_is_constant)
{
    static const float values[] = {7, 8, 9};
    static const scene_interpolation kinds[] = {SCENE_STEP, SCENE_LINEAR, SCENE_CUBIC};
    for (uint32_t i = 0; i < countof(kinds); i++) {
        scene_channel channel = channel_of(SCENE_LIGHT_INTENSITY, kinds[i], 1, values);
        channel.key_count = 1;
        const double expected = kinds[i] == SCENE_CUBIC ? 8 : 7;
        CHECK(value_at(&channel, 0) == expected && value_at(&channel, 1) == expected &&
              value_at(&channel, 2) == expected);
    }
}

TEST(keys_are_found_among_many)
{
    enum { KEYS = 1000 };
    float many[KEYS], values[KEYS];
    for (uint32_t i = 0; i < KEYS; i++) {
        many[i] = 0.25f * (float)i;
        values[i] = (float)(i * i);
    }
    const scene_channel channel = {.target = SCENE_LIGHT_INTENSITY,
                                   .interpolation = SCENE_LINEAR,
                                   .width = 1,
                                   .key_count = KEYS,
                                   .times = many,
                                   .values = values};
    for (uint32_t i = 0; i + 1 < KEYS; i++) {
        CHECK_NEAR(value_at(&channel, 0.25 * i), values[i], 0);
        CHECK_NEAR(value_at(&channel, 0.25 * i + 0.125), 0.5 * (values[i] + values[i + 1]), 0.1);
    }
}

// Rotations about z by an angle in degrees, and the same rotation's other quaternion.
static void rotation_z(double degrees, double sign, float q[4])
{
    const double half = degrees * M_PI / 360;
    q[0] = q[1] = 0;
    q[2] = (float)(sign * sin(half));
    q[3] = (float)(sign * cos(half));
}

static void check_rotation(const scene_channel *channel, double time, double degrees)
{
    float q[4], expected[4];
    animation_channel_value(channel, time, q);
    rotation_z(degrees, 1, expected);
    double cosine = 0, length = 0;
    for (int i = 0; i < 4; i++) {
        cosine += (double)q[i] * (double)expected[i];
        length += (double)q[i] * (double)q[i];
    }
    CHECK_NEAR(length, 1, 1e-6);
    CHECK_NEAR(fabs(cosine), 1, 1e-9 + 1e-6 * fabs(cosine));
    CHECK_NEAR(fmin(fabs(q[2] - expected[2]), fabs(q[2] + expected[2])), 0, 1e-6);
}

TEST(rotations_take_the_shorter_arc_at_even_speed)
{
    float values[3][4];
    rotation_z(10, 1, values[0]);
    rotation_z(70, -1, values[1]); // the quaternions are far from each other, the rotations are not
    rotation_z(330, 1, values[2]); // 100 degrees back is shorter than 260 on
    const scene_channel channel = channel_of(SCENE_ROTATION, SCENE_LINEAR, 4, values[0]);
    check_rotation(&channel, 1.25, 25);
    check_rotation(&channel, 1.5, 40);
    check_rotation(&channel, 2, 70);
    check_rotation(&channel, 2.5, 45);
    check_rotation(&channel, 3, 20);
    check_rotation(&channel, 3.5, -5);
    check_rotation(&channel, 7, 330);
}

TEST(rotations_that_hardly_differ_or_are_opposite_stay_unit)
{
    float values[3][4];
    rotation_z(10, 1, values[0]);
    rotation_z(10.0001, 1, values[1]);
    rotation_z(190.0001, 1, values[2]); // half a turn
    const scene_channel channel = channel_of(SCENE_ROTATION, SCENE_LINEAR, 4, values[0]);
    check_rotation(&channel, 1.5, 10);
    float q[4];
    for (double time = 2; time <= 4; time += 0.125) {
        animation_channel_value(&channel, time, q);
        CHECK_NEAR(q[2] * q[2] + q[3] * q[3], 1, 1e-6);
    }
}

// Without tangents a spline from the identity to a half turn about z passes (0 0 1 1) / 2 half way.
TEST(splines_of_rotations_are_normalised)
{
    static const float values[3][3][4] = {{{0}, {0, 0, 0, 1}, {0}}, {{0}, {0, 0, 1, 0}, {0}}, {{0}, {0, 0, 1, 0}, {0}}};
    const scene_channel channel = channel_of(SCENE_ROTATION, SCENE_CUBIC, 4, values[0][0]);
    check_rotation(&channel, 1.5, 90);
    check_rotation(&channel, 1.25, 2 * 180 / M_PI * atan2(0.15625, 0.84375));
}

// ---- Clips

static double clip_at(animation_clip clip, double duration, double time)
{
    double at;
    return animation_clip_time(&clip, duration, time, &at) ? at : -1;
}

TEST(clips_start_end_and_repeat)
{
    const animation_clip once = {.start = 10, .speed = 1}, loop = {.start = 10, .speed = 1, .loop = true};
    CHECK(clip_at(once, 3, 9.99) == -1 && clip_at(loop, 3, 9.99) == -1);
    CHECK(clip_at(once, 3, 10) == 0 && clip_at(once, 3, 12) == 2 && clip_at(once, 3, 13) == 3);
    CHECK(clip_at(once, 3, 1000) == 3);
    CHECK(clip_at(loop, 3, 10) == 0 && clip_at(loop, 3, 12.5) == 2.5 && clip_at(loop, 3, 13.5) == 0.5);
    CHECK(clip_at(loop, 3, 10 + 3e6 + 1) == 1);
}

TEST(clips_have_a_speed_which_may_be_negative)
{
    const animation_clip twice = {.speed = 2}, back = {.speed = -1}, round = {.speed = -1, .loop = true}, still = {0};
    CHECK(clip_at(twice, 3, 1) == 2 && clip_at(twice, 3, 2) == 3);
    CHECK(clip_at(back, 3, 0) == 3 && clip_at(back, 3, 1) == 2 && clip_at(back, 3, 9) == 0);
    CHECK(clip_at(round, 3, 0) == 3 && clip_at(round, 3, 1) == 2 && clip_at(round, 3, 4) == 2);
    CHECK(clip_at(still, 3, 5) == 0);
    CHECK(clip_at(twice, 0, 5) == 0 && clip_at(round, 0, 5) == 0); // a single key at 0 s
}

// ---- Poses

TEST(later_clips_override_what_they_share_and_rest_comes_back)
{
    scene_node nodes[2];
    for (int i = 0; i < 2; i++) {
        nodes[i] = (scene_node){.parent = i ? 0 : SCENE_NONE, .has_trs = true, .mesh = SCENE_NONE, .light = SCENE_NONE};
        nodes[i].rotation[3] = nodes[i].scale[0] = nodes[i].scale[1] = nodes[i].scale[2] = 1;
        nodes[i].translation[0] = 5;
    }
    const scene_data scene = {.nodes = nodes, .node_count = 2};
    static const float first[] = {1, 0, 0, 2, 0, 0, 4, 0, 0}, second[] = {0, 1, 0, 0, 2, 0, 0, 4, 0};
    static const float scales[] = {3, 3, 3, 3, 3, 3, 3, 3, 3};
    scene_channel both[2] = {channel_of(SCENE_TRANSLATION, SCENE_LINEAR, 3, first),
                             channel_of(SCENE_SCALE, SCENE_LINEAR, 3, scales)};
    scene_channel one = channel_of(SCENE_TRANSLATION, SCENE_LINEAR, 3, second);
    animation_pose pose = {0};
    animation_pose_init(&pose, &scene);
    animation_pose_apply(&pose, &(scene_animation){.channels = both, .channel_count = 2}, 2);
    CHECK(pose.nodes[0].translation[0] == 2 && pose.nodes[0].scale[1] == 3 && pose.nodes_set[0] && !pose.nodes_set[1]);
    animation_pose_apply(&pose, &(scene_animation){.channels = &one, .channel_count = 1}, 4);
    CHECK(pose.nodes[0].translation[0] == 0 && pose.nodes[0].translation[1] == 4 && pose.nodes[0].scale[1] == 3);
    float worlds[2][16];
    animation_pose_worlds(&pose, worlds);
    CHECK(worlds[1][12] == 3 * 5 && worlds[1][13] == 4 && worlds[1][0] == 3);
    animation_pose_rest(&pose);
    CHECK(pose.nodes[0].translation[0] == 5 && pose.nodes[0].scale[1] == 1 && !pose.nodes_set[0]);
    animation_pose_fini(&pose);
}

TEST(lights_and_materials_are_products_cut_to_their_range)
{
    scene_light light = {.hue = {1, 0.5f, 0}, .intensity = 0, .inner_cone = 0.1f, .outer_cone = 0.2f};
    material surface = {.base_color = {0.5f, 0.5f, 0.5f, 1}};
    scene_emission emission = {.factor = {1, 0.5f, 0}, .strength = 0};
    const scene_data scene = {
        .lights = &light, .light_count = 1, .materials = &surface, .emissions = &emission, .material_count = 1};
    static const float on[] = {0, 8, 8}, wide[] = {0, 3, 3}, strong[] = {0, 4, 4}, beyond[12] = {-1, 2, 0.5f, 1};
    scene_channel channels[] = {
        channel_of(SCENE_LIGHT_INTENSITY, SCENE_LINEAR, 1, on),
        channel_of(SCENE_LIGHT_OUTER_CONE, SCENE_LINEAR, 1, wide),
        channel_of(SCENE_EMISSIVE_STRENGTH, SCENE_LINEAR, 1, strong),
        channel_of(SCENE_BASE_COLOR, SCENE_STEP, 4, beyond),
    };
    channels[3].key_count = 1;
    animation_pose pose = {0};
    animation_pose_init(&pose, &scene);
    animation_pose_apply(&pose, &(scene_animation){.channels = channels, .channel_count = 4}, 2);
    const scene_light lit = animation_pose_light(&pose, 0);
    CHECK(lit.color[0] == 8 && lit.color[1] == 4 && lit.color[2] == 0);
    CHECK_NEAR(lit.outer_cone, M_PI_2, 1e-6);
    CHECK(lit.inner_cone == 0.1f);
    material changed = surface;
    animation_pose_material(&pose, 0, &changed);
    CHECK(changed.emissive[0] == 4 && changed.emissive[1] == 2 && changed.emissive[2] == 0);
    CHECK(changed.base_color[0] == 0 && changed.base_color[1] == 1 && changed.base_color[2] == 0.5f);
    CHECK(pose.lights_set[0] && pose.materials_set[0]);
    animation_pose_fini(&pose);
}

// ---- An evaluation of its own: the file's JSON and bytes, in double precision

typedef struct model {
    cJSON *json;
    uint8_t *buffers[8];
    scene_data *scene;
} model;

static uint8_t *base64_bytes(const char *digits)
{
    static const char alphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    uint8_t *const bytes = memory_alloc(strlen(digits) + 1);
    uint32_t bits = 0, bit_count = 0;
    size_t size = 0;
    for (; *digits && *digits != '='; digits++) {
        bits = bits << 6 | (uint32_t)(strchr(alphabet, *digits) - alphabet);
        bit_count += 6;
        if (bit_count >= 8) {
            bit_count -= 8;
            bytes[size++] = (uint8_t)(bits >> bit_count);
        }
    }
    return bytes;
}

static const cJSON *member(const cJSON *object, const char *key)
{
    return cJSON_GetObjectItemCaseSensitive(object, key);
}

static const cJSON *element(const model *m, const char *array, int index)
{
    return cJSON_GetArrayItem(member(m->json, array), index);
}

static int integer(const cJSON *object, const char *key, int fallback)
{
    const cJSON *const item = member(object, key);
    return item ? item->valueint : fallback;
}

// False, and said, where the model is not there.
static bool model_open(model *m, const char *name)
{
    char path[256];
    snprintf(path, sizeof path, MODELS "%s/%s.gltf", name, name);
    *m = (model){0};
    if (access(path, R_OK) != 0) {
        printf("  skipped: no %s\n", path);
        return false;
    }
    size_t size;
    uint8_t *const text = file_read(path, &size);
    m->json = cJSON_Parse((const char *)text);
    free(text);
    for (int i = 0; i < cJSON_GetArraySize(member(m->json, "buffers")); i++) {
        const char *const uri = member(element(m, "buffers", i), "uri")->valuestring;
        if (strncmp(uri, "data:", 5) != 0) {
            snprintf(path, sizeof path, MODELS "%s/%s", name, uri);
            m->buffers[i] = file_read(path, &size);
            continue;
        }
        m->buffers[i] = base64_bytes(strchr(uri, ',') + 1);
    }
    snprintf(path, sizeof path, MODELS "%s/%s.gltf", name, name);
    m->scene = scene_load(path);
    CHECK(m->scene != NULL);
    return m->scene != NULL;
}

static void model_close(model *m)
{
    for (size_t i = 0; i < countof(m->buffers); i++) {
        free(m->buffers[i]);
    }
    cJSON_Delete(m->json);
    scene_destroy(m->scene);
}

// Number `n` of an accessor, counted through its elements of `width`. Floats and normalised bytes and shorts.
static double accessor_number(const model *m, int index, int width, int n)
{
    const cJSON *const accessor = element(m, "accessors", index);
    const cJSON *const view = element(m, "bufferViews", integer(accessor, "bufferView", 0));
    const int type = integer(accessor, "componentType", 0), bytes = type == 5126 ? 4 : type >= 5122 ? 2 : 1;
    const int stride = integer(view, "byteStride", width * bytes);
    const uint8_t *const at = m->buffers[integer(view, "buffer", 0)] + integer(view, "byteOffset", 0) +
                              integer(accessor, "byteOffset", 0) + n / width * stride + n % width * bytes;
    float real = 0;
    int16_t word = 0;
    memcpy(&real, at, type == 5126 ? 4 : 0);
    memcpy(&word, at, type == 5122 || type == 5123 ? 2 : 0);
    return type == 5126   ? (double)real
           : type == 5120 ? fmax((int8_t)*at / 127.0, -1)
           : type == 5121 ? *at / 255.0
           : type == 5122 ? fmax(word / 32767.0, -1)
                          : (uint16_t)word / 65535.0;
}

// a * b, quaternions x y z w.
static void quaternion_multiply(const double a[4], const double b[4], double out[4])
{
    out[0] = a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1];
    out[1] = a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0];
    out[2] = a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3];
    out[3] = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2];
}

// a times the power `t` of the rotation from a to b, which turns by less than half a turn.
static void rotation_between(const double a[4], const double b[4], double t, double out[4])
{
    const double inverse[4] = {-a[0], -a[1], -a[2], a[3]};
    double turn[4];
    quaternion_multiply(inverse, b, turn);
    const double sign = turn[3] < 0 ? -1 : 1;
    const double sine = sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
    const double angle = atan2(sine, sign * turn[3]);
    double part[4] = {0, 0, 0, cos(t * angle)};
    for (int i = 0; i < 3 && sine > 0; i++) {
        part[i] = sign * turn[i] / sine * sin(t * angle);
    }
    quaternion_multiply(a, part, out);
}

// What sampler `index` of the animation gives at `time`.
static void sampler_evaluate(const model *m, const cJSON *animation, int index, int width, bool rotation, double time,
                             double *out)
{
    const cJSON *const sampler = cJSON_GetArrayItem(member(animation, "samplers"), index);
    const int input = integer(sampler, "input", -1), output = integer(sampler, "output", -1);
    const int keys = integer(element(m, "accessors", input), "count", 0);
    const cJSON *const kind = member(sampler, "interpolation");
    const char *const name = kind ? kind->valuestring : "LINEAR";
    const bool cubic = strcmp(name, "CUBICSPLINE") == 0;
    const bool scalars = strcmp(member(element(m, "accessors", output), "type")->valuestring, "SCALAR") == 0;
    int key = 0;
    while (key + 1 < keys && accessor_number(m, input, 1, key + 1) <= time) {
        key++;
    }
    const int next = key + 1 < keys ? key + 1 : key;
    const double from = accessor_number(m, input, 1, key), to = accessor_number(m, input, 1, next);
    const double t = next == key || time < from ? 0 : strcmp(name, "STEP") == 0 ? 0 : (time - from) / (to - from);
    double a[16], b[16];
    for (int i = 0; i < width; i++) {
        const int parts = cubic ? 3 : 1, part = cubic ? 1 : 0, w = scalars ? 1 : width;
        a[i] = accessor_number(m, output, w, (parts * key + part) * width + i);
        b[i] = accessor_number(m, output, w, (parts * next + part) * width + i);
        out[i] = a[i] + t * (b[i] - a[i]);
        if (cubic) { // de Casteljau of the same curve
            const double leave = accessor_number(m, output, w, (3 * key + 2) * width + i);
            const double arrive = accessor_number(m, output, w, 3 * next * width + i);
            double p[4] = {a[i], a[i] + leave * (to - from) / 3, b[i] - arrive * (to - from) / 3, b[i]};
            for (int level = 3; level > 0; level--) {
                for (int k = 0; k < level; k++) {
                    p[k] += t * (p[k + 1] - p[k]);
                }
            }
            out[i] = p[0];
        }
    }
    if (rotation && !cubic) {
        rotation_between(a, b, t, out);
    }
}

static void numbers_of(const cJSON *node, const char *key, int count, double *out)
{
    for (int i = 0; member(node, key) && i < count; i++) {
        out[i] = cJSON_GetArrayItem(member(node, key), i)->valuedouble;
    }
}

// The animation's channel for a node's path, or NULL.
static const cJSON *channel_find(const cJSON *animation, int node, const char *path)
{
    const cJSON *channel;
    cJSON_ArrayForEach(channel, member(animation, "channels"))
    {
        const cJSON *const target = member(channel, "target");
        if (integer(target, "node", -1) == node && strcmp(member(target, "path")->valuestring, path) == 0) {
            return channel;
        }
    }
    return NULL;
}

// Applies the node's own transform to a point.
static void node_apply(const model *m, int index, const cJSON *animation, double time, double point[3])
{
    const cJSON *const node = element(m, "nodes", index);
    double translation[3] = {0}, rotation[4] = {0, 0, 0, 1}, scale[3] = {1, 1, 1}, matrix[16];
    if (member(node, "matrix")) {
        numbers_of(node, "matrix", 16, matrix);
        const double p[3] = {point[0], point[1], point[2]};
        for (int i = 0; i < 3; i++) {
            point[i] = matrix[i] * p[0] + matrix[4 + i] * p[1] + matrix[8 + i] * p[2] + matrix[12 + i];
        }
        return;
    }
    const struct {
        const char *path;
        double *value;
        int width;
    } parts[] = {{"translation", translation, 3}, {"rotation", rotation, 4}, {"scale", scale, 3}};
    for (int i = 0; i < 3; i++) {
        numbers_of(node, parts[i].path, parts[i].width, parts[i].value);
        const cJSON *const channel = channel_find(animation, index, parts[i].path);
        if (channel) {
            sampler_evaluate(m, animation, integer(channel, "sampler", -1), parts[i].width, i == 1, time,
                             parts[i].value);
        }
    }
    // q * (v, 0) * conjugate(q) / |q|^2
    const double v[4] = {scale[0] * point[0], scale[1] * point[1], scale[2] * point[2], 0};
    const double conjugate[4] = {-rotation[0], -rotation[1], -rotation[2], rotation[3]};
    double half[4], turned[4], square = 0;
    quaternion_multiply(rotation, v, half);
    quaternion_multiply(half, conjugate, turned);
    for (int i = 0; i < 4; i++) {
        square += rotation[i] * rotation[i];
    }
    for (int i = 0; i < 3; i++) {
        point[i] = turned[i] / square + translation[i];
    }
}

static int parent_find(const model *m, int node)
{
    for (int i = 0; i < cJSON_GetArraySize(member(m->json, "nodes")); i++) {
        const cJSON *child;
        cJSON_ArrayForEach(child, member(element(m, "nodes", i), "children"))
        {
            if (child->valueint == node) {
                return i;
            }
        }
    }
    return -1;
}

static void point_to_world(const model *m, int node, const cJSON *animation, double time, double point[3])
{
    for (; node >= 0; node = parent_find(m, node)) {
        node_apply(m, node, animation, time, point);
    }
}

// ---- Models against it

// How far the node's origin and a point beside it are from where they should be.
static double node_error(const model *m, int node, int animation, double time, const float world[16], double reach)
{
    double worst = 0;
    for (int i = 0; i < 4; i++) {
        double expected[3] = {0};
        const double local[3] = {i == 1 ? reach : 0, i == 2 ? reach : 0, i == 3 ? reach : 0};
        memcpy(expected, local, sizeof local);
        point_to_world(m, node, element(m, "animations", animation), time, expected);
        for (int k = 0; k < 3; k++) {
            const double actual = (double)world[12 + k] + (double)world[k] * local[0] +
                                  (double)world[4 + k] * local[1] + (double)world[8 + k] * local[2];
            worst = fmax(worst, fabs(actual - expected[k]));
        }
    }
    return worst;
}

// Joints, each with points a tenth of a unit beside it, at five times between, at and behind keys.
static void check_joints(const char *name)
{
    model m;
    if (!model_open(&m, name)) {
        return;
    }
    const cJSON *const joints = member(element(&m, "skins", 0), "joints");
    const scene_skin *const skin = &m.scene->skins[0];
    float(*const worlds)[16] = memory_alloc(m.scene->node_count * sizeof *worlds);
    animation_pose pose = {0};
    animation_pose_init(&pose, m.scene);
    CHECK(m.scene->skin_count == 1 && (int)skin->joint_count == cJSON_GetArraySize(joints));
    double worst = 0, moved = 0;
    for (uint32_t animation = 0; animation < m.scene->animation_count; animation++) {
        const double duration = (double)m.scene->animations[animation].duration;
        const double moments[5] = {0, 0.137 * duration, 0.5 * duration, 0.81 * duration, duration + 1};
        for (int i = 0; i < 5; i++) {
            animation_pose_rest(&pose);
            animation_pose_apply(&pose, &m.scene->animations[animation], moments[i]);
            animation_pose_worlds(&pose, worlds);
            for (uint32_t k = 0; k < skin->joint_count; k++) {
                const uint32_t node = skin->joints[k];
                const int joint = cJSON_GetArrayItem(joints, (int)k)->valueint;
                worst = fmax(worst, node_error(&m, joint, (int)animation, moments[i], worlds[node], 0.1));
                for (int c = 0; c < 16; c++) {
                    moved = fmax(moved, fabs((double)worlds[node][c] - (double)m.scene->nodes[node].world[c]));
                }
            }
        }
    }
    printf("  %s: %u animations, %u joints, off by at most %.2g; matrices move by %.2g\n", name,
           m.scene->animation_count, skin->joint_count, worst, moved);
    CHECK(worst < 1e-4 && moved > 0.1);
    animation_pose_fini(&pose);
    free(worlds);
    model_close(&m);
}

TEST(joints_of_models_are_where_another_evaluation_has_them)
{
    check_joints("Fox");
    check_joints("CesiumMan");
    check_joints("RiggedFigure");
    check_joints("RiggedSimple");
}

static uint32_t node_named(const scene_data *scene, const char *name)
{
    uint32_t found = SCENE_NONE;
    for (uint32_t i = 0; i < scene->node_count; i++) {
        if (strcmp(scene->nodes[i].name, name) == 0) {
            CHECK(found == SCENE_NONE);
            found = i;
        }
    }
    return found;
}

// Each animation of the model moves one of its cubes by one path with one interpolation.
TEST(steps_lines_and_splines_of_the_interpolation_test_agree)
{
    model m;
    if (!model_open(&m, "InterpolationTest")) {
        return;
    }
    float(*const worlds)[16] = memory_alloc(m.scene->node_count * sizeof *worlds);
    uint32_t kinds = 0;
    animation_pose pose = {0};
    animation_pose_init(&pose, m.scene);
    for (uint32_t animation = 0; animation < m.scene->animation_count; animation++) {
        const scene_animation *const played = &m.scene->animations[animation];
        const scene_channel *const channel = &played->channels[0];
        const cJSON *const source =
            cJSON_GetArrayItem(member(element(&m, "animations", (int)animation), "channels"), 0);
        const int node = integer(member(source, "target"), "node", -1);
        const uint32_t index = node_named(m.scene, member(element(&m, "nodes", node), "name")->valuestring);
        double worst = 0, moved = 0;
        kinds |= 1u << (3 * channel->target + channel->interpolation);
        CHECK(played->channel_count == 1 && channel->index == index);
        float first[16] = {0};
        for (int i = 0; i <= 20; i++) {
            const double time = 0.01 + i * 0.09;
            animation_pose_rest(&pose);
            animation_pose_apply(&pose, played, time);
            animation_pose_worlds(&pose, worlds);
            worst = fmax(worst, node_error(&m, node, (int)animation, time, worlds[index], 1));
            memcpy(first, worlds[index], i == 0 ? sizeof first : 0);
            for (int k = 0; k < 16; k++) {
                moved = fmax(moved, fabs((double)worlds[index][k] - (double)first[k]));
            }
        }
        CHECK(worst < 1e-5 && moved > 0.1);
    }
    CHECK(kinds == 0x1ff); // three targets by three interpolations
    animation_pose_fini(&pose);
    free(worlds);
    model_close(&m);
}

static void check_weights(const char *name)
{
    model m;
    if (!model_open(&m, name)) {
        return;
    }
    animation_pose pose = {0};
    animation_pose_init(&pose, m.scene);
    CHECK(m.scene->deformation_count == 1 && m.scene->deformations[0].target_count > 1);
    double worst = 0, largest = 0;
    for (uint32_t animation = 0; animation < m.scene->animation_count; animation++) {
        const cJSON *const source = element(&m, "animations", (int)animation);
        const cJSON *const channel = cJSON_GetArrayItem(member(source, "channels"), 0);
        for (int i = 0; i < 50; i++) {
            double expected[16], time = 0.19 * i;
            const uint32_t count = m.scene->deformations[0].target_count;
            sampler_evaluate(&m, source, integer(channel, "sampler", -1), (int)count, false, time, expected);
            animation_pose_rest(&pose);
            animation_pose_apply(&pose, &m.scene->animations[animation], time);
            CHECK(pose.deformations_set[0]);
            for (uint32_t k = 0; k < count; k++) {
                worst = fmax(worst, fabs((double)pose.weights[0][k] - expected[k]));
                largest = fmax(largest, expected[k]);
            }
        }
    }
    printf("  %s: off by at most %.2g of %.2g\n", name, worst, largest);
    CHECK(worst < 1e-6 && largest > 0.5);
    animation_pose_fini(&pose);
    model_close(&m);
}

TEST(morph_weights_of_models_agree)
{
    check_weights("AnimatedMorphCube");
    check_weights("MorphStressTest");
}

TEST(joint_matrices_take_vertices_to_the_world)
{
    const float bind[2][16] = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 1},
                               {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1}};
    const float worlds[3][16] = {
        {0}, {0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1}, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 7, 0, 1}};
    const uint32_t joints[2] = {1, 2};
    const scene_skin skin = {.joint_count = 2, .joints = joints, .inverse_bind = bind};
    float matrices[2][16];
    animation_joint_matrices(&skin, worlds, matrices);
    // (3 0 0) - (1 0 0), a quarter turn about z, plus (10 0 0); twice (3 0 0) plus (0 7 0).
    const float *const a = matrices[0], *const b = matrices[1];
    CHECK(a[0] * 3 + a[12] == 10 && a[1] * 3 + a[13] == 2 && a[2] * 3 + a[14] == 0);
    CHECK(b[0] * 3 + b[12] == 6 && b[1] * 3 + b[13] == 7 && b[15] == 1);
}

int main(void)
{
    scene_test_begin();
    RUN(steps_hold_until_the_next_key);
    RUN(lines_go_from_key_to_key_and_end_with_them);
    RUN(splines_pass_their_keys_with_their_tangents);
    RUN(one_key_is_constant);
    RUN(keys_are_found_among_many);
    RUN(rotations_take_the_shorter_arc_at_even_speed);
    RUN(rotations_that_hardly_differ_or_are_opposite_stay_unit);
    RUN(splines_of_rotations_are_normalised);
    RUN(clips_start_end_and_repeat);
    RUN(clips_have_a_speed_which_may_be_negative);
    RUN(later_clips_override_what_they_share_and_rest_comes_back);
    RUN(lights_and_materials_are_products_cut_to_their_range);
    RUN(joint_matrices_take_vertices_to_the_world);
    RUN(joints_of_models_are_where_another_evaluation_has_them);
    RUN(steps_lines_and_splines_of_the_interpolation_test_agree);
    RUN(morph_weights_of_models_agree);
    return scene_test_end();
}
