// Still pixels while a light moves a little: a small spot light far away, behind a wall, moves by 0.1 % of the scene's
// size. What it gives the pixels is next to nothing, so what changes there is the grid's doing: the light's spot is the
// lights' outermost point.
#include "quad_scene.h"
#include "test.h"

#include "modules/renderer.h"
#include "modules/world.h"

static gpu *device;

enum { SIZE = 32, VPLS = 100000 };

// ---- The scene

static void quad_place(quad_scene *s, float half_size, bool is_floor, bool faces_x, float x, float y, float z)
{
    float m[16] = {0};
    const int u = faces_x ? 2 : 0, v = is_floor ? 2 : 1, n = is_floor ? 1 : faces_x ? 0 : 2;
    m[u] = faces_x ? -half_size : half_size; // right-handed, so that the quad faces along +n
    m[4 + v] = is_floor ? -half_size : half_size;
    m[8 + n] = half_size;
    m[12] = x;
    m[13] = y;
    m[14] = z;
    m[15] = 1;
    quad_add(s, m);
}

// The lit room is a floor and two walls around the origin; the spot falls on a floor 100 m away, which only it reaches.
static void scene_make(quad_scene *s)
{
    quad_scene_init(s);
    quad_place(s, 3, true, false, 0, 0, 0);
    quad_place(s, 3, false, false, 0, 3, -3);
    quad_place(s, 6, false, true, -6, 6, 0);
    quad_place(s, 4, true, false, -100, 0, -10);
}

static entity light_add(renderer *r, light_component made, float x, float y, float z)
{
    const entity e = ecs_entity_create(r->world);
    node_component *node = ecs_add(r->world, e, r->gpu_world->node);
    const float down[16] = {1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, x, y, z, 1};
    memcpy(node->matrix, down, sizeof down);
    *(light_component *)ecs_add(r->world, e, r->gpu_world->light) = made;
    return e;
}

// ---- Before and after

typedef struct motion {
    double change; // relative L2
    double share; // of the lit pixels, those that changed by more than 0.5 %
} motion;

static float *radiance_after_frame(renderer *r)
{
    float *radiance = memory_alloc(SIZE * SIZE * 16);
    CHECK(renderer_frame(r));
    CHECK(gpu_image_read(device, frame_graph_find_image(r->graph, "radiance"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                         radiance, SIZE * SIZE * 16));
    return radiance;
}

static motion motion_between(const float *before, const float *after)
{
    double difference = 0, square = 0;
    uint32_t lit = 0, moved = 0;
    for (uint32_t i = 0; i < SIZE * SIZE; i++) {
        const double a = (double)before[4 * i + 1], b = (double)after[4 * i + 1];
        difference += (b - a) * (b - a);
        square += a * a;
        lit += a > 0;
        moved += fabs(b - a) > 0.005 * a;
    }
    CHECK(lit > SIZE * SIZE / 2);
    return (motion){sqrt(difference / square), (double)moved / lit};
}

// The mean and the worst of `steps` small motions.
static motion motion_of(uint32_t method, uint32_t grid, motion *worst)
{
    enum { STEPS = 8 };
    quad_scene s;
    scene_make(&s);
    render_settings settings = render_settings_default();
    settings.width = settings.height = SIZE;
    settings.method = method;
    settings.grid = grid;
    settings.vpls = VPLS;
    settings.ir_vpls = 6000;
    settings.only = ONLY_INDIRECT_UNSHADOWED;
    settings.interleave = 1;
    renderer *r = renderer_create(device, &s.data, &settings);
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    r->camera =
        (render_camera){.eye = {2.5f, 3, 5}, .target = {-1, 1, -1}, .up = {0, 1, 0}, .yfov = 0.9f, .near_plane = 0.01f};
    light_add(r, (light_component){.type = LIGHT_POINT, .color = {100, 100, 100}}, 0, 2.5f, 0);
    const light_component spot = {.type = LIGHT_SPOT, .color = {200, 200, 200}, .inner_cone = 0.1f, .outer_cone = 0.2f};
    const entity e = light_add(r, spot, -100, 1.5f, -11);
    float *before = radiance_after_frame(r);
    motion mean = {0};
    *worst = mean;
    for (uint32_t step = 0; step < STEPS; step++) {
        ((node_component *)ecs_get(r->world, e, r->gpu_world->node))->matrix[14] += 0.107f;
        float *after = radiance_after_frame(r);
        const motion m = motion_between(before, after);
        mean.change += m.change / STEPS;
        mean.share += m.share / STEPS;
        *worst = (motion){fmax(worst->change, m.change), fmax(worst->share, m.share)};
        free(before);
        before = after;
    }
    free(before);
    renderer_destroy(r);
    printf("  %s, grid %u: mean change %.2e, worst %.2e; pixels changed by more than 0.5 %%: mean %.4f, worst %.4f\n",
           method == METHOD_IR ? "sum of all VPLs" : "hierarchy", grid, mean.change, worst->change, mean.share,
           worst->share);
    return mean;
}

TEST(a_small_motion_far_away_leaves_still_pixels_alone)
{
    motion worst;
    CHECK(motion_of(METHOD_IR, GRID_WORLD, &worst).change < 1e-4); // what the light itself does
    const motion bounds = motion_of(METHOD_LGH, GRID_BOUNDS, &worst);
    CHECK(bounds.change > 0.005 && bounds.share > 0.2); // the test can tell
    motion_of(METHOD_LGH, GRID_SCENE, &worst);
    CHECK(worst.change < 0.005 && worst.share == 0);
    motion_of(METHOD_LGH, GRID_WORLD, &worst);
    CHECK(worst.change < 0.005 && worst.share == 0);
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
    RUN(a_small_motion_far_away_leaves_still_pixels_alone);
    RUN(the_validation_layer_has_nothing_to_say);
    gpu_destroy(device);
    return test_end();
}
