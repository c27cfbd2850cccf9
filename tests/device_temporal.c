// The picture over time: it comes to rest when nothing changes, follows a switched light and a swinging door, and keeps
// no ghost where something was uncovered. Figures are printed; see modules/sequence_measure.h.
#include "modules/renderer.h"
#include "modules/sequence_measure.h"
#include "modules/world.h"
#include "quad_scene.h"
#include "test.h"

#include <stdlib.h>

static gpu *device;

enum { WIDTH = 96, HEIGHT = 64, PIXELS = WIDTH * HEIGHT };

// ---- Fixtures

typedef struct fixture {
    scene_data *scene; // NULL: quads
    renderer *r;
} fixture;

static render_settings settings_small(void)
{
    render_settings s = render_settings_default();
    s.width = WIDTH;
    s.height = HEIGHT;
    s.vpls = 20000;
    s.shadow_samples = 1;
    return s;
}

static void *fixture_check(const void *made)
{
    if (!made) {
        printf("cannot set up the scene\n");
        exit(EXIT_FAILURE);
    }
    return (void *)made;
}

static fixture scene_create(const char *path, const char *camera, const render_settings *settings)
{
    fixture f = {.scene = fixture_check(scene_load(path))};
    f.r = fixture_check(renderer_create(device, f.scene, settings));
    f.r->camera = renderer_camera_of_scene(f.r, scene_camera_find(f.scene, camera));
    return f;
}

static fixture rooms_create(const render_settings *settings)
{
    return scene_create(BUILD_DIR "/scenes/two_rooms.glb", "lit", settings);
}

static void fixture_destroy(fixture *f)
{
    renderer_destroy(f->r);
    if (f->scene)
        scene_destroy(f->scene);
}

static entity lamp_add(renderer *r, float x, float y, float z, float candela)
{
    const entity e = ecs_entity_create(r->world);
    node_component *node = ecs_add(r->world, e, r->gpu_world->node);
    memcpy(node->matrix, IDENTITY, sizeof node->matrix);
    memcpy(node->matrix + 12, (float[3]){x, y, z}, 3 * sizeof(float));
    light_component *light = ecs_add(r->world, e, r->gpu_world->light);
    *light = (light_component){.type = LIGHT_POINT, .color = {candela, candela, 0.8f * candela}};
    return e;
}

static void lamp_switch(renderer *r, entity lamp, float candela)
{
    light_component *light = ecs_get(r->world, lamp, r->gpu_world->light);
    for (int k = 0; k < 3; k++)
        light->color[k] = candela;
}

// The scene's own lamp.
static entity lamp_of_scene(renderer *r)
{
    ecs_iterator it = ecs_iterate(r->world, r->gpu_world->light);
    CHECK(ecs_next(&it));
    const entity e = it.entity;
    ecs_iterate_end(&it);
    return e;
}

// Renders a frame; its radiance, RGB. free() it.
static float *frame_make(renderer *r)
{
    const uint32_t pixels = r->settings.width * r->settings.height;
    float(*texels)[4] = memory_alloc(pixels * sizeof *texels);
    float *radiance = memory_alloc(pixels * 3 * sizeof *radiance);
    CHECK(renderer_frame(r));
    CHECK(gpu_image_read(device, frame_graph_find_image(r->graph, "radiance"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                         texels, pixels * sizeof *texels));
    for (uint32_t i = 0; i < pixels; i++)
        memcpy(radiance + 3 * i, texels[i], 3 * sizeof(float));
    free(texels);
    return radiance;
}

static void frames_skip(renderer *r, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        free(frame_make(r));
}

// ---- A still picture

enum { STILL = 32 };

// The measure (i) over the next frames, and how many of them differ from the one before.
static double deviation_measure(renderer *r, uint32_t *changed)
{
    float *frames[STILL];
    for (uint32_t f = 0; f < STILL; f++)
        frames[f] = frame_make(r);
    *changed = 0;
    for (uint32_t f = 1; f < STILL; f++)
        *changed += memcmp(frames[f], frames[f - 1], PIXELS * 3 * sizeof(float)) != 0;
    const double deviation = sequence_deviation((const float *const *)frames, STILL, WIDTH, HEIGHT, NULL);
    for (uint32_t f = 0; f < STILL; f++)
        free(frames[f]);
    return deviation;
}

static void still_check(const char *what, const render_settings *settings, uint32_t settled)
{
    uint32_t changed_early, changed;
    fixture f = rooms_create(settings);
    frames_skip(f.r, 16);
    const double early = deviation_measure(f.r, &changed_early);
    frames_skip(f.r, settled + 1 - 16 - STILL);
    const double late = deviation_measure(f.r, &changed);
    printf("  %s: deviation %.5f from frame 16 on, %.5f from frame %u on; %u and %u of %u frames changed\n", what,
           early, late, settled + 1, changed_early, changed, STILL - 1);
    CHECK(early > 0 && early < 0.03); // it is noisy
    CHECK(changed == 0 && late == 0);
    fixture_destroy(&f);
}

TEST(a_still_picture_comes_to_rest)
{
    render_settings s = settings_small();
    still_check("default", &s, STILL_SAMPLES);
    s.ray_budget = 0.5f;
    still_check("half a ray a pixel", &s, 2 * STILL_SAMPLES);
    s = settings_small();
    s.taa = false;
    still_check("without TAA", &s, STILL_SAMPLES);
}

// What was at rest goes on from there, and comes to rest again.
TEST(a_picture_at_rest_follows_what_moves)
{
    const render_settings s = settings_small();
    fixture f = rooms_create(&s);
    frames_skip(f.r, STILL_SAMPLES + 4);
    float *before = frame_make(f.r);
    lamp_switch(f.r, lamp_of_scene(f.r), 50);
    float *after = frame_make(f.r);
    const sequence_distance d = sequence_distance_to(after, before, WIDTH, HEIGHT);
    CHECK(d.mean > 0.3);
    uint32_t changed;
    frames_skip(f.r, STILL_SAMPLES);
    CHECK(deviation_measure(f.r, &changed) == 0 && changed == 0);
    free(before);
    free(after);
    fixture_destroy(&f);
}

// ---- A light that is switched

enum { SETTLING = 24 };

// Frames until within 5 % by block means, and the share of blocks within 10 % after 16 frames. The steady state is the
// picture at rest.
static void switch_check(const char *what, float before, float after)
{
    render_settings s = settings_small();
    s.only = ONLY_INDIRECT; // direct light is exact, and would hide what lags
    s.width = 2 * WIDTH; // 384 blocks: of 96 a single one is more than the hundredth that may be off
    s.height = 2 * HEIGHT;
    float *frames[SETTLING];
    double means[SETTLING], blocks[SETTLING], within[SETTLING];
    fixture f = rooms_create(&s);
    lamp_add(f.r, -3.2f, 0.35f, -1.5f, 40); // low, so that the furniture shades otherwise
    const entity lamp = lamp_of_scene(f.r);
    lamp_switch(f.r, lamp, before);
    frames_skip(f.r, 32);
    lamp_switch(f.r, lamp, after);
    for (uint32_t i = 0; i < SETTLING; i++)
        frames[i] = frame_make(f.r);
    frames_skip(f.r, STILL_SAMPLES);
    float *steady = frame_make(f.r);
    for (uint32_t i = 0; i < SETTLING; i++) {
        const sequence_distance d = sequence_distance_to(frames[i], steady, s.width, s.height);
        means[i] = d.mean;
        blocks[i] = d.blocks;
        within[i] = d.blocks_within;
        free(frames[i]);
    }
    free(steady);
    fixture_destroy(&f);
    const uint32_t mean_frames = sequence_settled_after(means, SETTLING, 0.05),
                   block_frames = sequence_settled_after(blocks, SETTLING, 0.05);
    printf(
        "  %s: mean within 5 %% after %u frames, blocks after %u; off by %.3f in the first, %.3f in the 8th, %.3f in "
        "the 16th; blocks within 10 %%: %.3f, %.3f, %.3f\n",
        what, mean_frames, block_frames, blocks[0], blocks[7], blocks[15], within[0], within[7], within[15]);
    CHECK(mean_frames <= 8 && block_frames <= 8);
    CHECK(within[15] >= 0.99);
}

TEST(a_switched_light_settles_within_eight_frames)
{
    switch_check("on", 0, 100);
    switch_check("off", 100, 0);
}

// ---- A door that opens into a dark room, and closes

static node_component *door_find(renderer *r)
{
    for (ecs_iterator it = ecs_iterate(r->world, r->gpu_world->mesh); ecs_next(&it);)
        if (strcmp(r->scene->meshes[((mesh_component *)it.component)->mesh].name, "door") == 0) {
            const entity e = it.entity;
            ecs_iterate_end(&it);
            return ecs_get(r->world, e, r->gpu_world->node);
        }
    return NULL;
}

// `open` in [0,1], of a quarter turn.
static void door_turn(renderer *r, float open)
{
    node_component *door = fixture_check(door_find(r));
    const float angle = 1.5707963f * open;
    door->matrix[0] = door->matrix[10] = cosf(angle);
    door->matrix[8] = sinf(angle);
    door->matrix[2] = -door->matrix[8];
}

static double room_light(renderer *r)
{
    float *frame = frame_make(r);
    double sum = 0;
    for (uint32_t i = 0; i < 3 * PIXELS; i++)
        sum += (double)frame[i];
    free(frame);
    return sum / (3 * PIXELS);
}

enum { SWING = 6, AFTER = 9 };

// Turns it within SWING frames; light[i]: i frames after the last of them.
static void door_swing(renderer *r, bool opens, double light[AFTER])
{
    for (int i = 1; i < SWING; i++) {
        door_turn(r, (float)(opens ? i : SWING - i) / SWING);
        frames_skip(r, 1);
    }
    door_turn(r, opens ? 1 : 0);
    for (int i = 0; i < AFTER; i++)
        light[i] = room_light(r);
}

TEST(a_room_is_as_bright_as_the_door_lets_it_be)
{
    const render_settings s = settings_small();
    double opened[AFTER], closed[AFTER];
    fixture f = scene_create(BUILD_DIR "/scenes/door.glb", "unlit", &s);
    frames_skip(f.r, 12);
    const double before = room_light(f.r);
    door_swing(f.r, true, opened);
    frames_skip(f.r, 2 * STILL_SAMPLES);
    const double lit = room_light(f.r);
    door_swing(f.r, false, closed);
    printf("  of the open room's light: %.1e before; %.3f, %.3f and %.3f when open and 4 and 8 frames after; %.4f, "
           "%.4f and "
           "%.4f when closed and 1 and 8 frames after\n",
           before / lit, opened[0] / lit, opened[4] / lit, opened[8] / lit, closed[0] / lit, closed[1] / lit,
           closed[8] / lit);
    CHECK(lit > 0 && before < 1e-3 * lit);
    CHECK(fabs(opened[4] - lit) < 0.1 * lit && fabs(opened[8] - lit) < 0.06 * lit);
    CHECK(closed[0] < 0.1 * lit && closed[1] < 0.02 * lit && closed[8] < 0.002 * lit);
    fixture_destroy(&f);
}

// ---- What was uncovered

static void history_read(renderer *r, float (*moments)[4], float *depth)
{
    CHECK(gpu_image_read(device, frame_graph_find_image(r->graph, "shadow_moments"),
                         VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, moments, PIXELS * sizeof *moments));
    CHECK(gpu_image_read(device, frame_graph_find_image(r->graph, "depth"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, depth,
                         PIXELS * sizeof *depth));
}

// A lit floor, a wall around it, and a plate that hovers closely over the floor and moves along it.
static quad_scene plate_scene;

static entity plate_find(renderer *r)
{
    for (ecs_iterator it = ecs_iterate(r->world, r->gpu_world->mesh); ecs_next(&it);)
        if (((mesh_component *)it.component)->mesh == 1) {
            const entity e = it.entity;
            ecs_iterate_end(&it);
            return e;
        }
    return (entity){0};
}

static fixture plate_create(void)
{
    render_settings s = settings_small();
    s.vpls = 4000;
    quad_scene_init(&plate_scene);
    quad_add(&plate_scene, (float[16]){4, 0, 0, 0, 0, 0, -4, 0, 0, 4, 0, 0, 0, 0, 0, 1}); // floor
    material *plate = quad_add(&plate_scene, (float[16]){1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, -1, 0.02f, 0, 1});
    plate->base_color[0] = plate->base_color[1] = plate->base_color[2] = 0.1f;
    quad_add(&plate_scene, (float[16]){4, 0, 0, 0, 0, 4, 0, 0, 0, 0, 4, 0, 0, 3, -4, 1}); // wall
    fixture f = {.r = fixture_check(renderer_create(device, &plate_scene.data, &s))};
    f.r->camera =
        (render_camera){.eye = {0, 5, 3}, .target = {0, 0, -0.5f}, .up = {0, 1, 0}, .yfov = 0.9f, .near_plane = 0.1f};
    static const char *const exports[] = {"shadow_moments", "depth"};
    for (size_t i = 0; i < countof(exports); i++)
        f.r->exports[f.r->export_count++] = exports[i];
    lamp_add(f.r, 0, 3, 0, 100);
    return f;
}

// The world point of a pixel, on the plane y = 0 of the floor.
static void floor_point(const renderer *r, uint32_t pixel, float out[3])
{
    const frame_constants *c = &r->constants;
    const float x = ((float)(pixel % WIDTH) + 0.5f) / WIDTH * 2 - 1,
                y = ((float)(pixel / WIDTH) + 0.5f) / HEIGHT * 2 - 1;
    float ray[3];
    for (int k = 0; k < 3; k++)
        ray[k] = c->forward[k] + x * c->right[k] - y * c->up[k];
    for (int k = 0; k < 3; k++)
        out[k] = c->eye[k] - c->eye[1] / ray[1] * ray[k];
}

// The floor that the plate leaves behind takes none of its history, and the plate keeps its own.
TEST(a_moving_instance_leaves_no_history_behind)
{
    static float moments[PIXELS][4], depth[PIXELS];
    const float step = 0.5f;
    fixture f = plate_create();
    frames_skip(f.r, 12);
    node_component *node = ecs_get(f.r->world, plate_find(f.r), f.r->gpu_world->node);
    node->matrix[12] += step;
    frames_skip(f.r, 1);
    history_read(f.r, moments, depth);
    uint32_t uncovered = 0, of_plate = 0, kept = 0, still = 0;
    for (uint32_t i = 0; i < PIXELS; i++) {
        float p[3];
        floor_point(f.r, i, p);
        const float x = p[0] + 1, z = fabsf(p[2]),
                    margin = 0.12f; // from where the plate was; two pixels and its height
        if (z < 1 - margin && x > -1 + margin && x < -1 + step - margin) {
            uncovered++;
            CHECK(moments[i][3] <= 1);
        } else if (z < 1 - margin && x > -1 + step + margin && x < 1 + step - margin) {
            of_plate++;
            kept += moments[i][3] > 2; // some of it is gone, since the light has changed
        }
        still += z < 3 && x > 2.5f && moments[i][3] > 4;
    }
    printf("  %u pixels uncovered, %u of %u of the plate keep a history; %u of the floor beside\n", uncovered, kept,
           of_plate, still);
    CHECK(uncovered > 50 && of_plate > 200 && kept > 0.9 * of_plate && still > 100);
    fixture_destroy(&f);
}

// A pan: pixels that show what the last frame hid start anew, the others go on.
TEST(a_pan_starts_anew_where_it_uncovers)
{
    static float moments[PIXELS][4], depth[PIXELS], before[PIXELS];
    render_settings s = settings_small();
    fixture f = rooms_create(&s);
    static const char *const exports[] = {"shadow_moments", "depth"};
    for (size_t i = 0; i < countof(exports); i++)
        f.r->exports[f.r->export_count++] = exports[i];
    frames_skip(f.r, 12);
    history_read(f.r, moments, before);
    const frame_constants last = f.r->constants;
    f.r->camera.eye[0] += 0.5f;
    f.r->camera.target[0] += 0.5f;
    frames_skip(f.r, 1);
    history_read(f.r, moments, depth);
    const frame_constants *c = &f.r->constants;
    uint32_t hidden = 0, seen = 0, kept = 0;
    for (uint32_t i = 0; i < PIXELS; i++) {
        if (depth[i] <= 0)
            continue;
        const float x = ((float)(i % WIDTH) + 0.5f) / WIDTH * 2 - 1, y = ((float)(i / WIDTH) + 0.5f) / HEIGHT * 2 - 1;
        float p[3], clip[4] = {0};
        for (int k = 0; k < 3; k++)
            p[k] = c->eye[k] + c->near_plane / depth[i] * (c->forward[k] + x * c->right[k] - y * c->up[k]);
        for (int k = 0; k < 4; k++)
            clip[k] = last.view_projection[k] * p[0] + last.view_projection[4 + k] * p[1] +
                      last.view_projection[8 + k] * p[2] + last.view_projection[12 + k];
        const int column = (int)floorf((clip[0] / clip[3] * 0.5f + 0.5f) * WIDTH),
                  row = (int)floorf((clip[1] / clip[3] * 0.5f + 0.5f) * HEIGHT);
        if (column < 1 || row < 1 || column >= WIDTH - 1 || row >= HEIGHT - 1)
            continue;
        float nearest = 0, farthest = INFINITY; // view depths around that place then
        for (int k = 0; k < 9; k++) {
            const float z = last.near_plane / before[(row + k / 3 - 1) * WIDTH + column + k % 3 - 1];
            nearest = fmaxf(nearest, z);
            farthest = fminf(farthest, z);
        }
        if (clip[3] > 1.1f * nearest) { // all around stood before it
            hidden++;
            CHECK(moments[i][3] <= 1);
        } else if (clip[3] < 1.02f * nearest && clip[3] > 0.98f * farthest && nearest < 1.1f * farthest) {
            seen++;
            kept += moments[i][3] > 4;
        }
    }
    printf("  %u pixels were hidden; %u of %u others keep their history\n", hidden, kept, seen);
    CHECK(hidden > 20 && seen > PIXELS / 3 && kept > 0.85 * seen);
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
    RUN(a_still_picture_comes_to_rest);
    RUN(a_picture_at_rest_follows_what_moves);
    RUN(a_switched_light_settles_within_eight_frames);
    RUN(a_room_is_as_bright_as_the_door_lets_it_be);
    RUN(a_moving_instance_leaves_no_history_behind);
    RUN(a_pan_starts_anew_where_it_uncovers);
    RUN(the_validation_layer_has_nothing_to_say);
    gpu_destroy(device);
    return test_end();
}
