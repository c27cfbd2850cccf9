// Rays in batches against closed forms: the tracer finds what the geometry says.
#include "modules/rays.h"
#include "modules/world.h"
#include "quad_scene.h"
#include "test.h"

#include "test_shaders_shaders.h"

static gpu *device;

typedef struct ray {
    float origin[3], reach, direction[3], unused;
} ray;

typedef struct answers {
    ray_hit *hits; // per ray
    uint32_t *visible;
} answers;

// ---- A pass of our own: traces a list of rays in two batches, "near" for hits and "seen" for visibility

typedef struct batch_pass {
    gpu_pipeline pipeline;
    gpu_buffer list;
    uint32_t count;
} batch_pass;

static void batch_execute(const frame_graph_context *context, void *user)
{
    const batch_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->count, sizeof pass->count);
    gpu_dispatch(context->commands, div_up_u32(pass->count, 64), 1, 1);
}

static void batch_make(renderer *r, batch_pass *state, const char *batch, rays_kind kind)
{
    frame_graph_pass *pass = frame_graph_pass_add(
        r->graph,
        &(frame_graph_pass_desc){.name = batch, .kind = FRAME_GRAPH_COMPUTE, .execute = batch_execute, .user = state});
    frame_graph_read(pass, "list", ACCESS_STORAGE_READ);
    rays_create(r, pass, batch, state->count);
    rays_trace(r, batch, kind, state->count);
}

static void batch_setup(renderer *r, void *user)
{
    batch_pass *state = user;
    frame_graph_import_buffer(r->graph, "list", state->list, ACCESS_HOST_WRITE, ACCESS_NONE);
    batch_make(r, state, "near", RAYS_NEAREST);
    batch_make(r, state, "seen", RAYS_VISIBLE);
}

static void batch_fini(renderer *r, void *user)
{
    batch_pass *state = user;
    gpu_pipeline_destroy(r->gpu, state->pipeline);
    gpu_buffer_destroy(r->gpu, state->list);
}

// ---- Helpers

static renderer *renderer_of(const scene_data *scene)
{
    render_settings settings = render_settings_default();
    settings.width = settings.height = 16;
    settings.vpls = 0;
    renderer *r = renderer_create(device, scene, &settings);
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    batch_pass *state = renderer_pass_add(r, "test_batch", sizeof(batch_pass), batch_setup, batch_fini);
    state->pipeline =
        gpu_compute_pipeline_create(device, &(gpu_compute_pipeline_desc){.shader = &shader_rays_copy_comp});
    CHECK(state->pipeline.id != 0);
    r->exports[r->export_count++] = "near_hits";
    r->exports[r->export_count++] = "seen_visible";
    return r;
}

static void export_read(renderer *r, const char *name, void *data, size_t size)
{
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, name);
    CHECK(buffer.id && gpu_buffer_read(device, buffer, 0, data, size));
}

// Renders a frame that traces the rays.
static answers trace(renderer *r, const ray *rays, uint32_t count)
{
    batch_pass *state = ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "test_batch"), r->pass))->state;
    const gpu_buffer_desc desc = {.name = "list",
                                  .size = count * sizeof *rays,
                                  .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
                                  .host = true,
                                  .data = rays};
    gpu_buffer_destroy(device, state->list);
    state->list = gpu_buffer_create(device, &desc);
    state->count = count;
    CHECK(state->list.id && renderer_frame(r));
    const answers a = {memory_alloc(count * sizeof *a.hits), memory_alloc(count * sizeof *a.visible)};
    export_read(r, "near_hits", a.hits, count * sizeof *a.hits);
    export_read(r, "seen_visible", a.visible, count * sizeof *a.visible);
    return a;
}

static void answers_free(answers *a)
{
    free(a->hits);
    free(a->visible);
}

static void matrix_at(float matrix[16], float x, float y, float z)
{
    memcpy(matrix, IDENTITY, sizeof IDENTITY);
    matrix[12] = x;
    matrix[13] = y;
    matrix[14] = z;
}

// ---- Tests

TEST(rays_find_the_nearest_quad_within_their_reach)
{
    quad_scene s;
    quad_scene_init(&s);
    float matrix[16];
    for (int i = 0; i < 3; i++) {
        matrix_at(matrix, 0, 0, -2.0f * (float)i);
        quad_add(&s, matrix);
    }
    renderer *r = renderer_of(&s.data);
    const ray rays[] = {
        {{0.5f, -0.25f, 1}, 1e30f, {0, 0, -1}, 0}, // the first quad, lower right triangle
        {{-0.5f, 0.25f, -1}, 1e30f, {0, 0, -1}, 0}, // the second, upper left triangle
        {{-0.5f, 0.25f, -3}, 1e30f, {0, 0, 1}, 0}, // the second from behind
        {{0.5f, 0.25f, 1}, 0.999f, {0, 0, -1}, 0}, // ends before the first
        {{0.5f, 0.25f, 1}, 1.001f, {0, 0, -1}, 0}, // ends behind it
        {{1.5f, 0, 1}, 1e30f, {0, 0, -1}, 0}, // beside all
        {{0.5f, 0.25f, 1}, 0, {0, 0, -1}, 0}, // no ray
        {{0.5f, 0.25f, 1}, -1, {0, 0, -1}, 0}, // no ray
    };
    static const struct {
        uint32_t node, triangle; // node RAY_MISS: nothing
        float barycentrics[2];
    } expected[] = {
        {0, 0, {0.375f, 0.375f}}, // (x + 1) / 2 - (y + 1) / 2, (y + 1) / 2
        {1, 1, {0.25f, 0.375f}}, // (x + 1) / 2, (y - x) / 2
        {1, 1, {0.25f, 0.375f}},  {RAY_MISS, 0, {0}}, {0, 0, {0.125f, 0.625f}},
        {RAY_MISS, 0, {0}},       {RAY_MISS, 0, {0}}, {RAY_MISS, 0, {0}},
    };
    answers a = trace(r, rays, countof(rays));
    for (size_t i = 0; i < countof(rays); i++) {
        const ray_hit *hit = &a.hits[i];
        const bool found = hit->instance != RAY_MISS;
        CHECK(found == (expected[i].node != RAY_MISS));
        if (rays[i].reach > 0)
            CHECK(a.visible[i] == !found);
        if (!found)
            continue;
        CHECK(r->gpu_world->instance_data[hit->instance].mesh == expected[i].node);
        CHECK(hit->geometry == 0 && hit->triangle == expected[i].triangle);
        for (int k = 0; k < 2; k++)
            CHECK_NEAR(hit->barycentrics[k], expected[i].barycentrics[k], 1e-6);
    }
    answers_free(&a);
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
    RUN(rays_find_the_nearest_quad_within_their_reach);
    RUN(the_validation_layer_is_silent);
    gpu_destroy(device);
    return test_end();
}
