// Many point lights in the lighting grid hierarchy: against closed forms, against the sum over all of them, against the
// reference methods, and from frame to frame.
#include "brute_force.h"
#include "quad_scene.h"
#include "test.h"

#include "modules/vpl_trace.h"
#include "modules/world.h"

#include "test_shaders_shaders.h"

#define SCENES BUILD_DIR "/scenes/"

static gpu *devices[2]; // one for each renderer: a device holds one scene

enum { SIDE = 64, LIGHTS_MAX = 4096 };
static const double reach = 4; // metres of the floor that the camera sees, from its middle

// ---- Lights

typedef struct light {
    float position[3], candela[3];
    entity e;
} light;

typedef struct lights {
    light all[LIGHTS_MAX];
    uint32_t count, random;
} lights;

static float random_float(lights *l, float low, float high)
{
    l->random = l->random * 747796405u + 2891336453u;
    return low + (high - low) * (float)(l->random >> 8) / (float)(1 << 24);
}

static light light_random(lights *l, const float low[3], const float high[3])
{
    light made = {0};
    for (int k = 0; k < 3; k++)
        made.position[k] = random_float(l, low[k], high[k]);
    made.candela[0] = random_float(l, 0.5f, 1);
    made.candela[1] = random_float(l, 0.3f, 0.6f);
    made.candela[2] = random_float(l, 0.1f, 0.3f);
    return made;
}

static void light_place(renderer *r, const light *l)
{
    node_component *node = ecs_get(r->world, l->e, r->gpu_world->node);
    light_component *component = ecs_get(r->world, l->e, r->gpu_world->light);
    memcpy(node->matrix + 12, l->position, sizeof l->position);
    memcpy(component->color, l->candela, sizeof l->candela);
}

static void light_spawn(renderer *r, light *l)
{
    l->e = ecs_entity_create(r->world);
    node_component *node = ecs_add(r->world, l->e, r->gpu_world->node);
    *node = (node_component){.name = "light"};
    for (int k = 0; k < 4; k++)
        node->matrix[5 * k] = 1;
    *(light_component *)ecs_add(r->world, l->e, r->gpu_world->light) = (light_component){.type = LIGHT_POINT};
    light_place(r, l);
}

// ---- A floor of ten metres, black so that there are no VPLs, in the plane z = 0 under a camera

static quad_scene floor_quad;

static render_settings floor_settings(void)
{
    render_settings s = render_settings_default();
    s.width = s.height = SIDE;
    s.vpls = 30;
    s.many_lights = 0;
    s.shadow_samples = 0;
    s.filter = s.taa = false;
    return s;
}

// A lid that lets nothing through, and that the camera above sees through: it shows its back.
static void lid_add(float height)
{
    const float matrix[16] = {5, 0, 0, 0, 0, -5, 0, 0, 0, 0, -1, 0, 0, 0, height, 1};
    quad_add(&floor_quad, matrix);
}

// `lid`: metres over the floor, see lid_add; 0: none.
static renderer *floor_create_with(const render_settings *settings, float lid)
{
    static const float matrix[16] = {5, 0, 0, 0, 0, 5, 0, 0, 0, 0, 5, 0, 0, 0, 0, 1};
    quad_scene_init(&floor_quad);
    memcpy(quad_add(&floor_quad, matrix)->base_color, (float[4]){0, 0, 0, 1}, 4 * sizeof(float));
    if (lid > 0)
        lid_add(lid);
    renderer *r = renderer_create(devices[0], &floor_quad.data, settings);
    if (!r)
        exit(EXIT_FAILURE);
    r->camera =
        (render_camera){.eye = {0, 0, 10}, .up = {0, 1, 0}, .yfov = 2 * atanf((float)reach / 10), .near_plane = 0.01f};
    return r;
}

static renderer *floor_create(const render_settings *settings)
{
    return floor_create_with(settings, 0);
}

static void lights_scatter(renderer *r, lights *l, uint32_t count, float low, float high)
{
    l->random = 1;
    for (l->count = 0; l->count < count; l->count++) {
        l->all[l->count] = light_random(l, (float[]){-5, -5, low}, (float[]){5, 5, high});
        light_spawn(r, &l->all[l->count]);
    }
}

static void floor_point(uint32_t pixel, double point[3])
{
    point[0] = (2 * (pixel % SIDE + 0.5) / SIDE - 1) * reach;
    point[1] = (1 - 2 * (pixel / SIDE + 0.5) / SIDE) * reach;
    point[2] = 0;
}

// What a white floor would send out, nits: I cos / (pi d^2), summed over the lights below a height.
static double floor_light(const lights *l, const double point[3], double height, int channel)
{
    double sum = 0;
    for (uint32_t i = 0; i < l->count; i++) {
        double square = 0;
        if ((double)l->all[i].position[2] >= height)
            continue;
        for (int k = 0; k < 3; k++)
            square += (l->all[i].position[k] - point[k]) * (l->all[i].position[k] - point[k]);
        sum += l->all[i].candela[channel] * l->all[i].position[2] / (square * sqrt(square));
    }
    return sum / M_PI;
}

// An exported image of four floats a texel; free() it.
static float *image_read(renderer *r, const char *name)
{
    const gpu_image image = frame_graph_find_image(r->graph, name);
    const gpu_image_desc *info = gpu_image_info(r->gpu, image);
    const size_t size = (size_t)info->width * info->height * 4 * sizeof(float);
    float *texels = memory_alloc(size);
    CHECK(gpu_image_read(r->gpu, image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, size));
    return texels;
}

static float *frame_image(renderer *r, const char *name)
{
    r->exports[0] = name;
    r->export_count = 1;
    CHECK(renderer_frame(r));
    return image_read(r, name);
}

static double mean_of(const float *image, size_t pixels)
{
    double sum = 0;
    for (size_t i = 0; i < 4 * pixels; i++)
        sum += i % 4 < 3 ? image[i] : 0;
    return sum / (3 * (double)pixels);
}

typedef struct comparison {
    double error, energy, worst; // relative L2, ratio, largest relative deviation
} comparison;

static comparison compare(const float *image, const float *reference, size_t pixels)
{
    double difference = 0, square = 0, sum = 0, reference_sum = 0, worst = 0;
    for (size_t i = 0; i < 4 * pixels; i++) {
        if (i % 4 == 3)
            continue;
        const double a = image[i], b = reference[i];
        difference += (a - b) * (a - b);
        square += b * b;
        sum += a;
        reference_sum += b;
        worst = fmax(worst, b > 0 ? fabs(a - b) / b : 0);
    }
    return (comparison){sqrt(difference / square), sum / reference_sum, worst};
}

// ---- Closed forms

static lights scattered;

// With levels so large that every light is near, each is used as itself.
static void check_level_0(uint32_t lighting)
{
    render_settings s = floor_settings();
    s.levels = 1;
    s.alpha = 4;
    s.lighting = lighting;
    renderer *r = floor_create(&s);
    lights_scatter(r, &scattered, 400, 0.3f, 1.5f);
    float *image = frame_image(r, "indirect");
    CHECK(renderer_light_slots(r) == 512 && r->gpu_world->first_joined == 0);
    double worst = 0;
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        double point[3];
        floor_point(i, point);
        for (int c = 0; c < 3; c++) {
            const double expected = floor_light(&scattered, point, 1e9, c);
            worst = fmax(worst, fabs(image[4 * i + c] - expected) / expected);
        }
    }
    printf("  400 lights one by one, lighting %u: worst relative deviation %.1e\n", lighting, worst);
    CHECK(worst < 1e-4);
    free(image);
    renderer_destroy(r);
}

TEST(lights_over_a_floor_sum_up_as_they_should)
{
    check_level_0(LIGHTING_GATHER);
    check_level_0(LIGHTING_VOLUMES);
}

static comparison hierarchy_against_all(render_settings s, float low, float high, uint32_t count)
{
    renderer *r = floor_create(&s);
    lights_scatter(r, &scattered, count, low, high);
    float *image = frame_image(r, "indirect");
    brute_force_add(r, &shader_brute_force_comp);
    float *all = frame_image(r, "brute_force");
    const comparison c = compare(image, all, SIDE * SIDE);
    free(image);
    free(all);
    renderer_destroy(r);
    return c;
}

// Lights that fill the space over the floor are the hierarchy's worst case: what a level leaves to the next depends on
// distance, most of the light comes from right above, and one cell's lights lie on both sides of such a distance. The
// error falls fast with alpha (measured, error and energy: 1: .151, 1.146; 2: .031, 1.029; 4: .006, 1.006).
TEST(the_hierarchy_of_lights_converges_to_their_sum)
{
    static const struct {
        float alpha;
        double error, energy;
    } rows[] = {{1, 0.16, 0.155}, {2, 0.034, 0.032}, {4, 0.008, 0.008}};
    for (size_t i = 0; i < countof(rows); i++) {
        render_settings s = floor_settings();
        s.alpha = rows[i].alpha;
        const comparison c = hierarchy_against_all(s, 0.2f, 3, 4000);
        printf("  4000 lights, alpha %g: error %.4f, energy %.4f\n", (double)s.alpha, c.error, c.energy);
        CHECK(c.error < rows[i].error);
        CHECK_NEAR(c.energy, 1, rows[i].energy);
    }
}

// U and S over all pixels and `frames` frames; their ratio.
static double ratio_over_frames(renderer *r, uint32_t frames)
{
    double sums[2] = {0};
    for (uint32_t frame = 0; frame < frames; frame++) {
        r->exports[0] = "shadow_u";
        r->exports[1] = "shadow_s";
        r->export_count = 2;
        CHECK(renderer_frame(r));
        for (uint32_t which = 0; which < 2; which++) {
            float *image = image_read(r, r->exports[which]);
            sums[which] += mean_of(image, SIDE * SIDE);
            free(image);
        }
    }
    return sums[1] / sums[0];
}

// The lights under a lid are seen and those above are not. What is near must not count more in the ratio than it does
// in the light (with the centres' shares as weights the ratio is 1.42 and 1.23 times the share of the light that is
// seen).
TEST(shadows_weigh_near_lights_as_far_ones)
{
    static const float lids[] = {0.8f, 1.6f};
    for (size_t i = 0; i < countof(lids); i++) {
        render_settings s = floor_settings();
        s.shadow_samples = 8;
        renderer *r = floor_create_with(&s, lids[i]);
        lights_scatter(r, &scattered, 4000, 0.2f, 3);
        double seen = 0, all = 0;
        for (uint32_t pixel = 0; pixel < SIDE * SIDE; pixel += 5) {
            double point[3];
            floor_point(pixel, point);
            all += floor_light(&scattered, point, 1e9, 0);
            seen += floor_light(&scattered, point, (double)lids[i], 0);
        }
        const double ratio = ratio_over_frames(r, 8);
        printf("  lid at %.1f m: ratio %.4f, of the light %.4f are seen\n", (double)lids[i], ratio, seen / all);
        CHECK_NEAR(ratio / (seen / all), 1, 0.13); // 1.111 and 1.107
        renderer_destroy(r);
    }
}

// Each tile has a quarter of the lights, times four.
TEST(interleaved_tiles_share_the_lights_out)
{
    render_settings s = floor_settings();
    s.alpha = 2;
    const comparison whole = hierarchy_against_all(s, 0.2f, 3, 4000);
    s.interleave = 2;
    const comparison dealt = hierarchy_against_all(s, 0.2f, 3, 4000);
    printf("  energy in tiles %.4f, without %.4f\n", dealt.energy, whole.energy);
    CHECK_NEAR(dealt.energy / whole.energy, 1, 0.02);
}

// A cell of lights radiates evenly by every model, for its normals have no moments.
TEST(emission_models_agree_on_lights)
{
    static const uint32_t models[] = {EMISSION_A, EMISSION_B, EMISSION_AB};
    float *images[countof(models)];
    for (size_t i = 0; i < countof(models); i++) {
        render_settings s = floor_settings();
        s.emission = models[i];
        renderer *r = floor_create(&s);
        lights_scatter(r, &scattered, 1000, 0.2f, 3);
        images[i] = frame_image(r, "indirect");
        renderer_destroy(r);
    }
    for (size_t i = 1; i < countof(models); i++)
        CHECK(compare(images[i], images[0], SIDE * SIDE).worst < 1e-5);
    render_settings s = floor_settings();
    s.lighting = LIGHTING_VOLUMES;
    renderer *r = floor_create(&s);
    lights_scatter(r, &scattered, 1000, 0.2f, 3);
    float *volumes = frame_image(r, "indirect");
    const comparison c = compare(volumes, images[2], SIDE * SIDE);
    printf("  light volumes against the gather: %.1e\n", c.worst);
    CHECK(c.worst < 1e-4);
    free(volumes);
    renderer_destroy(r);
    for (size_t i = 0; i < countof(models); i++)
        free(images[i]);
}

TEST(a_light_that_touches_a_pixel_neither_glares_nor_breaks)
{
    render_settings s = floor_settings();
    s.shadow_samples = 2;
    renderer *r = floor_create(&s);
    lights_scatter(r, &scattered, 300, 0.5f, 1);
    double point[3];
    floor_point(SIDE * SIDE / 2 + 7, point);
    for (uint32_t i = 0; i < 3; i++) { // in the surface, on it, and nearly on it
        memcpy(scattered.all[i].position, (float[]){(float)point[0], (float)point[1], (float)i * 1e-5f},
               sizeof scattered.all[i].position);
        light_place(r, &scattered.all[i]);
    }
    r->exports[0] = "indirect";
    r->exports[1] = "shadow_s";
    r->export_count = 2;
    CHECK(renderer_frame(r));
    const double nearest = 3e-4 * (double)r->constants.scene_radius;
    for (uint32_t which = 0; which < 2; which++) {
        float *image = image_read(r, r->exports[which]);
        for (uint32_t i = 0; i < 4 * SIDE * SIDE; i++)
            CHECK(isfinite(image[i]) && image[i] >= 0 && image[i] < 4 / (nearest * nearest));
        free(image);
    }
    renderer_destroy(r);
}

// NULL where there is none; free() it.
static void *output_read(renderer *r, const char *name, size_t *size)
{
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, name);
    *size = buffer.id ? gpu_buffer_size(r->gpu, buffer) : 0;
    void *bytes = buffer.id ? memory_alloc(*size) : NULL;
    if (bytes)
        CHECK(gpu_buffer_read(r->gpu, buffer, 0, bytes, *size));
    return bytes;
}

// ---- In a room, with VPLs

static scene_data *scene_of(const char *path)
{
    scene_data *scene = scene_load(path);
    if (!scene)
        exit(EXIT_FAILURE);
    return scene;
}

static renderer *renderer_of(gpu *device, const scene_data *scene, const render_settings *settings)
{
    renderer *r = renderer_create(device, scene, settings);
    if (!r)
        exit(EXIT_FAILURE);
    return r;
}

static void room_lights_spawn(renderer *r, lights *l, uint32_t count)
{
    l->random = 5;
    for (l->count = 0; l->count < count; l->count++) {
        l->all[l->count] = light_random(l, (float[]){-2.4f, 3.5f, -2.4f}, (float[]){2.4f, 5.2f, 2.4f});
        light_spawn(r, &l->all[l->count]);
    }
}

// Mean radiance of the Cornell box with 300 lights below its ceiling, over the frames (references: when finished).
static double room_mean(render_settings s, uint32_t frames, uint32_t *slots)
{
    scene_data *scene = scene_of(SCENES "cornell.glb");
    renderer *r = renderer_of(devices[0], scene, &s);
    room_lights_spawn(r, &scattered, 300);
    double sum = 0;
    for (uint32_t i = 0; i < frames; i++) {
        float *image = frame_image(r, "radiance");
        const double mean = mean_of(image, (size_t)s.width * s.height);
        sum = s.method == METHOD_LGH ? sum + mean / frames : mean;
        free(image);
    }
    *slots = renderer_light_slots(r);
    renderer_destroy(r);
    scene_destroy(scene);
    return sum;
}

TEST(path_tracing_and_the_sum_over_all_agree)
{
    render_settings s = render_settings_default();
    s.width = s.height = 48;
    s.vpls = 30000;
    s.spp = 400;
    uint32_t slots;
    s.many_lights = 100;
    const double joined = room_mean(s, 8, &slots);
    CHECK(slots == 512);
    s.many_lights = 1000;
    const double one_by_one = room_mean(s, 8, &slots);
    CHECK(slots == 0);
    s.many_lights = 100;
    s.method = METHOD_PATH;
    const double path = room_mean(s, 40, &slots);
    CHECK(slots == 0);
    s.method = METHOD_VPL;
    s.vpls = 3000;
    const double vpl = room_mean(s, 80, &slots);
    CHECK(slots == 0);
    printf("  mean radiance: in the hierarchy %.4f, one by one %.4f, path tracing %.4f, vpl %.4f\n", joined, one_by_one,
           path, vpl);
    CHECK_NEAR(joined / path, 1, 0.01);
    CHECK_NEAR(joined / vpl, 1, 0.01);
    CHECK_NEAR(joined / one_by_one, 1, 0.01);
}

// What the trace of a grid light's second moments lacks to 1 is its lights' share, level by level.
TEST(grid_lights_know_how_much_of_them_is_lights)
{
    render_settings s = render_settings_default();
    s.width = s.height = 16;
    s.vpls = 3000;
    scene_data *scene = scene_of(SCENES "cornell.glb");
    renderer *r = renderer_of(devices[0], scene, &s);
    room_lights_spawn(r, &scattered, 300);
    world_sun_add(r, (float[]){0, -1, 0}, 1);
    r->exports[0] = "lgh_header";
    r->exports[1] = "lgh_lights";
    r->export_count = 2;
    CHECK(renderer_frame(r));
    // The scene's own lamp joins too, the sun does not.
    CHECK(r->constants.light_count == 302 && r->gpu_world->first_joined == 1);
    double expected = 0;
    const punctual_light *lights = gpu_buffer_map(r->gpu, r->gpu_world->lights);
    for (uint32_t i = 1; i < 302; i++)
        for (int c = 0; c < 3; c++)
            expected += 4 * (double)lights[i].color[c] * (const double[]){0.2126, 0.7152, 0.0722}[c];
    size_t size;
    lgh_header *header = output_read(r, "lgh_header", &size);
    grid_light *grid = output_read(r, "lgh_lights", &size);
    CHECK(header->level_count > 2);
    for (uint32_t level = 0; level < header->level_count; level++) {
        double sum = 0, all = 0;
        for (uint32_t i = 0; i < header->levels[level].occupied; i++) {
            const grid_light *g = &grid[header->levels[level].first_light + i];
            const float *m = g->moment_diagonal;
            sum += (double)g->intensity * (1 - (double)m[0] - (double)m[1] - (double)m[2]);
            all += (double)g->intensity;
        }
        CHECK_NEAR(sum / expected, 1, 1e-4);
        CHECK(all > 1.2 * sum);
    }
    free(header);
    free(grid);
    renderer_destroy(r);
    scene_destroy(scene);
}

// One part of the light alone stays what its name says.
TEST(direct_light_alone_has_all_lights_one_by_one)
{
    render_settings s = render_settings_default();
    s.width = s.height = 48;
    s.vpls = 30000;
    s.many_lights = 100;
    uint32_t slots;
    const double all = room_mean(s, 4, &slots);
    s.only = ONLY_DIRECT;
    const double direct = room_mean(s, 4, &slots);
    CHECK(slots == 0);
    s.only = ONLY_INDIRECT;
    const double indirect = room_mean(s, 4, &slots);
    CHECK(slots == 0 && direct > 0.2 * all && indirect > 0.2 * all);
    CHECK_NEAR((direct + indirect) / all, 1, 0.02);
}

// ---- From frame to frame: a renderer that keeps what did not change, and one that makes all anew

static const char *const outputs[] = {"vpls", "lgh_header", "lgh_lights", "lgh_order", "vpl_changed|-"};
enum { CHANGED = countof(outputs) - 1 };

typedef struct pair {
    scene_data *scene;
    renderer *kept, *fresh;
    lights l;
} pair;

static pair *pair_create(uint32_t count)
{
    render_settings s = render_settings_default();
    s.width = s.height = 16;
    s.vpls = 3000;
    s.many_lights = 200;
    pair *p = memory_alloc(sizeof *p);
    p->scene = scene_of(SCENES "cornell.glb");
    s.incremental = true;
    p->kept = renderer_of(devices[0], p->scene, &s);
    s.incremental = false;
    p->fresh = renderer_of(devices[1], p->scene, &s);
    room_lights_spawn(p->kept, &p->l, count);
    room_lights_spawn(p->fresh, &p->l, count); // both worlds count alike
    for (size_t i = 0; i < countof(outputs); i++)
        p->kept->exports[i] = p->fresh->exports[i] = outputs[i];
    p->kept->export_count = p->fresh->export_count = countof(outputs);
    return p;
}

static void pair_destroy(pair *p)
{
    renderer_destroy(p->kept);
    renderer_destroy(p->fresh);
    scene_destroy(p->scene);
    free(p);
}

#define BOTH(p, r) for (renderer *r = (p)->kept; r; r = r == (p)->kept ? (p)->fresh : NULL)

static uint32_t bits_between(const uint32_t *bits, uint32_t first, uint32_t end)
{
    uint32_t count = 0;
    for (uint32_t i = first; i < end; i++)
        count += bits[i / 32] >> (i % 32) & 1;
    return count;
}

// Renders both and compares. Returns the number of light slots that changed, or UINT32_MAX where all was made anew.
static uint32_t frame_check(pair *p)
{
    CHECK(renderer_frame(p->kept) && renderer_frame(p->fresh));
    lgh_header *header = NULL;
    for (uint32_t i = 0; i < CHANGED; i++) {
        size_t size, fresh_size;
        void *kept = output_read(p->kept, outputs[i], &size), *fresh = output_read(p->fresh, outputs[i], &fresh_size);
        CHECK(kept && fresh && size == fresh_size);
        if (i == 1)
            header = kept;
        if (i == 2)
            size = header->light_count * sizeof(grid_light);
        if (i == 3)
            size = header->vpl_count * sizeof(uint32_t);
        const bool same = memcmp(kept, fresh, size) == 0;
        if (!same)
            printf("  %s differs\n", outputs[i]);
        CHECK(same);
        if (i != 1)
            free(kept);
        free(fresh);
    }
    free(header);
    const vpl_change change = vpl_trace_change(p->kept);
    if (change != VPLS_SOME)
        return change == VPLS_ALL ? UINT32_MAX : 0;
    size_t size;
    uint32_t *bits = output_read(p->kept, outputs[CHANGED], &size);
    const uint32_t vpls = renderer_vpl_slots(p->kept), slots = renderer_slots(p->kept);
    CHECK(bits && size >= div_up_u32(slots, 32) * sizeof(uint32_t));
    const uint32_t count = bits ? bits_between(bits, vpls, slots) : 0;
    free(bits);
    return count;
}

TEST(a_light_that_changes_changes_its_slot_alone)
{
    pair *p = pair_create(300);
    CHECK(frame_check(p) == UINT32_MAX && renderer_light_slots(p->kept) == 512);
    CHECK(frame_check(p) == 0);
    CHECK(vpl_trace_change(p->kept) == VPLS_NONE);
    for (uint32_t i = 0; i < 4; i++) { // moved, coloured, switched off, on again
        light *l = &p->l.all[100];
        l->position[0] += i == 0 ? 0.3f : 0;
        l->candela[1] = i == 2 ? 0 : 0.4f + 0.1f * (float)i;
        l->candela[0] = l->candela[2] = i == 2 ? 0 : 0.5f;
        BOTH(p, r)
        light_place(r, l);
        CHECK(frame_check(p) == 1);
    }
    CHECK(frame_check(p) == 0);
    pair_destroy(p);
}

TEST(lights_that_move_come_and_go_leave_what_a_full_build_would)
{
    pair *p = pair_create(300);
    frame_check(p);
    uint32_t some = 0;
    for (uint32_t frame = 0; frame < 60; frame++) {
        const uint32_t what = frame % 4, which = (uint32_t)random_float(&p->l, 0, (float)p->l.count);
        light *l = &p->l.all[which];
        const light other = light_random(&p->l, (float[]){-2.4f, 0.3f, -2.4f}, (float[]){2.4f, 5.2f, 2.4f});
        light made = other;
        made.e = l->e;
        BOTH(p, r)
        {
            if (what == 0) {
                light_place(r, &made);
            } else if (what == 1) {
                ecs_entity_destroy(r->world, l->e);
            } else if (what == 2) {
                made.e = (entity){0};
                light_spawn(r, &made);
            } else {
                memset(made.candela, 0, sizeof made.candela);
                light_place(r, &made);
            }
        }
        if (what == 1)
            *l = p->l.all[--p->l.count];
        else
            p->l.all[what == 2 ? p->l.count++ : which] = made;
        const uint32_t changed = frame_check(p);
        CHECK(changed <= 1 || changed == UINT32_MAX);
        some += changed == 1;
    }
    printf("  %u of 60 frames were incremental\n", some);
    CHECK(some >= 45);
    // So many go that the others are lit one by one again, and then some come back.
    while (p->l.count > 190) {
        p->l.count--;
        BOTH(p, r)
        ecs_entity_destroy(r->world, p->l.all[p->l.count].e);
    }
    frame_check(p);
    CHECK(renderer_light_slots(p->kept) == 0 && p->kept->gpu_world->first_joined == 191);
    for (uint32_t i = 0; i < 30; i++) {
        light made = light_random(&p->l, (float[]){-2.4f, 0.3f, -2.4f}, (float[]){2.4f, 5.2f, 2.4f});
        BOTH(p, r)
        light_spawn(r, &made);
        p->l.all[p->l.count++] = made;
    }
    frame_check(p);
    CHECK(renderer_light_slots(p->kept) == 256);
    pair_destroy(p);
}

// ---- The scene made for it

static void check_lanterns(const char *path, uint32_t expected, double candela)
{
    scene_data *scene = scene_of(path);
    uint32_t lights = 0;
    double sum = 0;
    for (uint32_t i = 0; i < scene->node_count; i++) {
        if (scene->nodes[i].light == SCENE_NONE)
            continue;
        lights++;
        sum += (double)scene->lights[scene->nodes[i].light].color[0];
        const float *position = scene->nodes[i].world + 12;
        CHECK(fabsf(position[0]) < 4.5f && position[1] > 1 && position[1] < 7 && fabsf(position[2]) < 30);
    }
    CHECK(lights == expected && scene->warning_count == 0);
    CHECK(scene_camera_find(scene, "street") != SCENE_NONE);
    CHECK_NEAR(sum, candela, 1e-3); // red is 1 of each lantern's colour
    scene_destroy(scene);
}

TEST(lanterns_of_both_scenes_are_as_bright_together)
{
    check_lanterns(SCENES "lanterns.glb", 5000, 5000);
    check_lanterns(SCENES "lanterns_500.glb", 500, 5000);
}

TEST(the_validation_layer_has_nothing_to_say)
{
    CHECK(gpu_validation_messages(devices[0]) == 0 && gpu_validation_messages(devices[1]) == 0);
}

int main(void)
{
    for (size_t i = 0; i < countof(devices); i++) {
        devices[i] = gpu_create(&(gpu_desc){.validation = true});
        if (!devices[i]) {
            printf("skipped: no usable device\n");
            return 77;
        }
    }
    RUN(lights_over_a_floor_sum_up_as_they_should);
    RUN(the_hierarchy_of_lights_converges_to_their_sum);
    RUN(shadows_weigh_near_lights_as_far_ones);
    RUN(interleaved_tiles_share_the_lights_out);
    RUN(emission_models_agree_on_lights);
    RUN(a_light_that_touches_a_pixel_neither_glares_nor_breaks);
    RUN(path_tracing_and_the_sum_over_all_agree);
    RUN(grid_lights_know_how_much_of_them_is_lights);
    RUN(direct_light_alone_has_all_lights_one_by_one);
    RUN(a_light_that_changes_changes_its_slot_alone);
    RUN(lights_that_move_come_and_go_leave_what_a_full_build_would);
    RUN(lanterns_of_both_scenes_are_as_bright_together);
    RUN(the_validation_layer_has_nothing_to_say);
    for (size_t i = 0; i < countof(devices); i++)
        gpu_destroy(devices[i]);
    return test_end();
}
