// Direct light: few punctual lights exactly, with a shadow ray each; many of them, and emissive triangles, by samples.
#include "direct_light.h"
#include "modules.h"
#include "world.h"

#include "lanternfield_renderer_shaders.h"

enum {
    EXACT_LIGHTS_MAX = 16, // punctual lights that get a shadow ray each
    EXACT_EMITTERS_MAX = 32, // emissive triangles whose unshadowed light is worth a closed form
    CANDIDATES_FEW = 8, // of a sample of at most EXACT_EMITTERS_MAX triangles
    CANDIDATES_MANY = 16,
};

typedef struct direct_light {
    gpu_pipeline exact, sample, sample_analytic;
} direct_light;

static bool has_direct(const renderer *r)
{
    // Paths bring their own; statistics that ask for its rays would keep it alive.
    const bool shown = r->settings.method != METHOD_PATH &&
                       (r->settings.only == ONLY_ALL || r->settings.only == ONLY_DIRECT);
    return shown && r->constants.light_count + r->constants.emitter_count > 0;
}

static bool has_many_punctual(const renderer *r)
{
    return r->constants.light_count > EXACT_LIGHTS_MAX;
}

static bool has_exact(const renderer *r)
{
    return has_direct(r) && r->constants.light_count > 0 && !has_many_punctual(r);
}

bool direct_light_is_sampled(const renderer *r)
{
    return has_direct(r) && (r->constants.emitter_count > 0 || has_many_punctual(r));
}

bool direct_light_is_analytic(const renderer *r)
{
    if (!direct_light_is_sampled(r) || r->constants.emitter_count > EXACT_EMITTERS_MAX)
        return false;
    if (r->constants.emitter_count == 0)
        return true;
    for (uint32_t i = 0; i < r->scene->material_count; i++) {
        if (world_material_emits(r, i) && r->scene->materials[i].emissive_texture.texture != TEXTURE_NONE)
            return false;
    }
    return true;
}

// What a pass needs when it runs.
typedef struct direct_light_dispatch {
    gpu_pipeline pipeline;
    uint32_t width, height;
    struct {
        uint32_t samples, candidates, punctual;
    } push;
    uint32_t push_size;
} direct_light_dispatch;

static void direct_light_execute(const frame_graph_context *context, void *user)
{
    const direct_light_dispatch *d = user;
    frame_graph_bind(context, d->pipeline);
    if (d->push_size > 0)
        gpu_push(context->commands, &d->push, d->push_size);
    gpu_dispatch(context->commands, div_up_u32(d->width, 8), div_up_u32(d->height, 8), 1);
}

static void rays_clear(const frame_graph_context *context, void *user)
{
    (void)user;
    gpu_buffer_fill(context->commands, frame_graph_buffer(context, "rays_direct_cleared"), 0, 16, 0);
}

static void rays_clear_declare(renderer *r)
{
    const frame_graph_pass_desc desc = {
        .name = "direct_light/clear_rays", .kind = FRAME_GRAPH_TRANSFER, .execute = rays_clear};
    const frame_graph_resource_desc rays = {.kind = FRAME_GRAPH_BUFFER, .size = 16, .host = true};
    frame_graph_create_resource(frame_graph_pass_add(r->graph, &desc), "rays_direct_cleared", &rays,
                                ACCESS_TRANSFER_WRITE);
}

// Adds a pass with its inputs, which are the same for both.
static frame_graph_pass *direct_light_pass_add(renderer *r, const char *name, direct_light_dispatch *dispatch)
{
    dispatch->width = r->settings.width;
    dispatch->height = r->settings.height;
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = direct_light_execute,
        .user = dispatch,
        .user_size = sizeof *dispatch,
    };
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &desc);
    frame_graph_read(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    frame_graph_read(pass, "tlas", ACCESS_TRACE);
    return pass;
}

static void exact_declare(renderer *r, const direct_light *state, const char *rays_to)
{
    direct_light_dispatch dispatch = {.pipeline = state->exact};
    frame_graph_pass *pass = direct_light_pass_add(r, "direct_light", &dispatch);
    const frame_graph_resource_desc image =
        frame_graph_image_of(VK_FORMAT_R32G32B32A32_SFLOAT, r->settings.width, r->settings.height);
    frame_graph_create_resource(pass, "direct", &image, ACCESS_STORAGE_WRITE);
    frame_graph_modify(pass, "rays_direct_cleared", rays_to, ACCESS_STORAGE_READ_WRITE);
}

static void sample_declare(renderer *r, const direct_light *state, const char *rays_from)
{
    const bool analytic = direct_light_is_analytic(r);
    direct_light_dispatch dispatch = {
        .pipeline = analytic ? state->sample_analytic : state->sample,
        .push.samples = max_u32(1, r->settings.shadow_samples),
        .push.candidates = r->constants.emitter_count > EXACT_EMITTERS_MAX ? CANDIDATES_MANY : CANDIDATES_FEW,
        .push.punctual = has_many_punctual(r),
        .push_size = sizeof dispatch.push,
    };
    frame_graph_pass *pass = direct_light_pass_add(r, "direct_light/sample", &dispatch);
    frame_graph_modify(pass, rays_from, "rays_direct", ACCESS_STORAGE_READ_WRITE);
    const frame_graph_resource_desc image =
        frame_graph_image_of(VK_FORMAT_R32G32B32A32_SFLOAT, r->settings.width, r->settings.height);
    frame_graph_create_resource(pass, "direct_u", &image, ACCESS_STORAGE_WRITE);
    frame_graph_create_resource(pass, "direct_s", &image, ACCESS_STORAGE_WRITE);
    if (analytic)
        frame_graph_create_resource(pass, "direct_analytic", &image, ACCESS_STORAGE_WRITE);
}

static void direct_light_setup(renderer *r, void *user)
{
    const direct_light *state = user;
    const bool exact = has_exact(r), sampled = direct_light_is_sampled(r);
    if (!exact && !sampled)
        return;
    rays_clear_declare(r);
    if (exact)
        exact_declare(r, state, sampled ? "rays_direct_exact" : "rays_direct");
    if (sampled)
        sample_declare(r, state, exact ? "rays_direct_exact" : "rays_direct_cleared");
}

static void direct_light_fini(renderer *r, void *user)
{
    const direct_light *state = user;
    gpu_pipeline_destroy(r->gpu, state->exact);
    gpu_pipeline_destroy(r->gpu, state->sample);
    gpu_pipeline_destroy(r->gpu, state->sample_analytic);
}

static gpu_pipeline pipeline_of(gpu *gpu, const gpu_shader *shader)
{
    return gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = shader});
}

bool direct_light_init(renderer *r)
{
    direct_light *state =
        renderer_pass_add(r, "direct_light", sizeof(direct_light), direct_light_setup, direct_light_fini);
    state->exact = pipeline_of(r->gpu, &shader_direct_light_exact_comp);
    state->sample = pipeline_of(r->gpu, &shader_direct_light_sample_comp);
    state->sample_analytic = pipeline_of(r->gpu, &shader_direct_light_sample_analytic_comp);
    return state->exact.id && state->sample.id && state->sample_analytic.id;
}
