// Gathers interleaved indirect light over the tiles, each of which knows the light of its own share of the grid lights.
#include "filters.h"
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

typedef struct interleave_dispatch {
    gpu_pipeline pipeline;
    uint32_t width, height;
    struct {
        uint32_t n;
        uint32_t down; // along y; 0: along x
    } push;
} interleave_dispatch;

static void interleave_execute(const frame_graph_context *context, void *user)
{
    const interleave_dispatch *d = user;
    frame_graph_bind(context, d->pipeline);
    gpu_push(context->commands, &d->push, sizeof d->push);
    gpu_dispatch(context->commands, div_up_u32(d->width, PIXEL_GROUP_WIDTH), d->height, 1);
}

static void axis_declare(frame_graph *graph, interleave_dispatch dispatch, const char *name, const char *from,
                         const char *to)
{
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = interleave_execute,
        .user = &dispatch,
        .user_size = sizeof dispatch,
    };
    frame_graph_pass *pass = frame_graph_pass_add(graph, &desc);
    frame_graph_read(pass, "filter_geometry", ACCESS_STORAGE_READ);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    frame_graph_read(pass, from, ACCESS_STORAGE_READ);
    const frame_graph_resource_desc image =
        frame_graph_image_of(VK_FORMAT_R32G32B32A32_SFLOAT, dispatch.width, dispatch.height);
    frame_graph_create_resource(pass, to, &image, ACCESS_STORAGE_WRITE);
}

void interleave_declare(const interleave *state, frame_graph *graph, uint32_t width, uint32_t height, uint32_t n)
{
    interleave_dispatch dispatch = {state->pipeline, width, height, {.n = n}};
    axis_declare(graph, dispatch, "interleave/across", "indirect", "indirect_across");
    dispatch.push.down = 1;
    axis_declare(graph, dispatch, "interleave/down", "indirect_across", "indirect_gathered");
}

bool interleave_create(gpu *gpu, interleave *state)
{
    const gpu_compute_pipeline_desc desc = {.shader = &shader_interleave_comp};
    state->pipeline = gpu_compute_pipeline_create(gpu, &desc);
    return state->pipeline.id != 0;
}

void interleave_fini(gpu *gpu, interleave *state)
{
    gpu_pipeline_destroy(gpu, state->pipeline);
}

// ---- The module

static void interleave_setup(renderer *r, void *state)
{
    const render_settings *s = &r->settings;
    if (s->interleave > 1 && renderer_has_indirect(r))
        interleave_declare(state, r->graph, s->width, s->height, s->interleave);
}

static void interleave_release(renderer *r, void *state)
{
    interleave_fini(r->gpu, state);
}

bool interleave_init(renderer *r)
{
    interleave *state = renderer_pass_add(r, "interleave", sizeof(interleave), interleave_setup, interleave_release);
    return interleave_create(r->gpu, state);
}
