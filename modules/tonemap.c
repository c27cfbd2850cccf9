// Exposure and tone curve: radiance in nits to what a display shows.
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

typedef struct tonemap_state {
    const renderer *r;
    gpu_pipeline luminance, exposure, tonemap;
} tonemap_state;

// One workgroup a row of pixels.
static void luminance_run(const frame_graph_context *context, void *user)
{
    const tonemap_state *state = user;
    frame_graph_bind(context, state->luminance);
    gpu_dispatch(context->commands, state->r->settings.height, 1, 1);
}

static void exposure_run(const frame_graph_context *context, void *user)
{
    const tonemap_state *state = user;
    frame_graph_bind(context, state->exposure);
    gpu_dispatch(context->commands, 1, 1, 1);
}

static void tonemap_run(const frame_graph_context *context, void *user)
{
    const tonemap_state *state = user;
    const render_settings *settings = &state->r->settings;
    frame_graph_bind(context, state->tonemap);
    gpu_dispatch(context->commands, div_up_u32(settings->width, PIXEL_GROUP_WIDTH), settings->height, 1);
}

static frame_graph_pass *pass_add(frame_graph *graph, tonemap_state *state, const char *name,
                                  void (*execute)(const frame_graph_context *, void *))
{
    const frame_graph_pass_desc desc = {.name = name, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = state};
    return frame_graph_pass_add(graph, &desc);
}

static void tonemap_setup(renderer *r, void *user)
{
    tonemap_state *state = user;
    const uint32_t width = r->settings.width, height = r->settings.height;

    frame_graph_pass *luminance = pass_add(r->graph, state, "tonemap/luminance", luminance_run);
    const frame_graph_resource_desc rows = frame_graph_buffer_of(2 * sizeof(float) * (uint64_t)height);
    frame_graph_read(luminance, "radiance", ACCESS_SAMPLED);
    frame_graph_create_resource(luminance, "luminance_rows", &rows, ACCESS_STORAGE_WRITE);

    frame_graph_pass *exposure = pass_add(r->graph, state, "tonemap/exposure", exposure_run);
    const frame_graph_resource_desc factor = frame_graph_buffer_of(sizeof(float));
    frame_graph_read(exposure, "luminance_rows", ACCESS_STORAGE_READ);
    frame_graph_create_resource(exposure, "exposure", &factor, ACCESS_STORAGE_WRITE);

    frame_graph_pass *tonemap = pass_add(r->graph, state, "tonemap", tonemap_run);
    const frame_graph_resource_desc display = frame_graph_image_of(VK_FORMAT_R8G8B8A8_UNORM, width, height);
    frame_graph_read(tonemap, "radiance", ACCESS_SAMPLED);
    frame_graph_read(tonemap, "exposure", ACCESS_STORAGE_READ);
    frame_graph_create_resource(tonemap, "display", &display, ACCESS_STORAGE_WRITE);
}

static void tonemap_fini(renderer *r, void *user)
{
    tonemap_state *state = user;
    gpu_pipeline_destroy(r->gpu, state->luminance);
    gpu_pipeline_destroy(r->gpu, state->exposure);
    gpu_pipeline_destroy(r->gpu, state->tonemap);
}

static gpu_pipeline pipeline_of(gpu *gpu, const gpu_shader *shader)
{
    const gpu_compute_pipeline_desc desc = {.shader = shader};
    return gpu_compute_pipeline_create(gpu, &desc);
}

bool tonemap_init(renderer *r)
{
    tonemap_state *state = renderer_pass_add(r, "tonemap", sizeof(tonemap_state), tonemap_setup, tonemap_fini);
    state->r = r;
    state->luminance = pipeline_of(r->gpu, &shader_tonemap_luminance_comp);
    state->exposure = pipeline_of(r->gpu, &shader_tonemap_exposure_comp);
    state->tonemap = pipeline_of(r->gpu, &shader_tonemap_comp);
    return state->luminance.id && state->exposure.id && state->tonemap.id;
}
