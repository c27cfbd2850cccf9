// Direct light: few punctual lights exactly, with a shadow ray each; many of them, and emissive triangles, by samples.
// Point lights that join the lighting grid hierarchy (renderer_light_slots) are left out: they are many more.
#include "direct_light.h"
#include "light_rays.h"
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

// Those that did not join the hierarchy.
static uint32_t punctual_lights(const renderer *r)
{
    return r->gpu_world->first_joined;
}

static bool has_direct(const renderer *r)
{
    const bool shown = r->settings.only == ONLY_ALL || r->settings.only == ONLY_DIRECT;
    return shown && r->settings.method != METHOD_PATH && punctual_lights(r) + r->constants.emitter_count > 0;
}

static bool has_many_punctual(const renderer *r)
{
    return punctual_lights(r) > EXACT_LIGHTS_MAX;
}

static bool has_exact(const renderer *r)
{
    return has_direct(r) && punctual_lights(r) > 0 && !has_many_punctual(r);
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

// What a pass that makes rays needs when it runs.
typedef struct direct_light_dispatch {
    gpu_pipeline pipeline;
    uint32_t width, height;
    struct {
        uint32_t first, layers;
        uint32_t samples, candidates, punctual; // of sampled light: see direct_light_sample.glsl.h
    } push;
} direct_light_dispatch;

static void direct_light_execute(const frame_graph_context *context, void *user)
{
    const direct_light_dispatch *d = user;
    frame_graph_bind(context, d->pipeline);
    gpu_push(context->commands, &d->push, sizeof d->push);
    gpu_dispatch(context->commands, div_up_u32(d->width, PIXEL_GROUP_WIDTH), d->height, 1);
}

// Adds the pass that makes the rays of the current batch, with the bindings that are the same for both kinds.
static frame_graph_pass *rays_pass_add(renderer *r, direct_light_dispatch dispatch, const light_rays *rays,
                                       resource_chain *counter)
{
    dispatch.width = r->settings.width;
    dispatch.height = r->settings.height;
    dispatch.push.first = rays->first;
    dispatch.push.layers = rays->count;
    const frame_graph_pass_desc desc = {
        .name = rays->pass,
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = direct_light_execute,
        .user = &dispatch,
        .user_size = sizeof dispatch,
    };
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &desc);
    frame_graph_read(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    resource_chain_next(counter, pass);
    light_rays_make(r, rays, pass);
    return pass;
}

static void exact_declare(renderer *r, const direct_light *state, light_rays rays, resource_chain *counter)
{
    do
        rays_pass_add(r, (direct_light_dispatch){.pipeline = state->exact}, &rays, counter);
    while (light_rays_trace(r, &rays));
}

// Samples of each kind. The references for which it matters have no filter.
static uint32_t sample_count(const renderer *r)
{
    return r->settings.method == METHOD_LGH ? max_u32(1, r->settings.shadow_samples) : DIRECT_SAMPLES_MAX;
}

static uint32_t sampled_layers(const renderer *r)
{
    return sample_count(r) * ((r->constants.emitter_count > 0) + has_many_punctual(r));
}

static void sample_declare(renderer *r, const direct_light *state, light_rays rays, resource_chain *counter)
{
    resource_chain unshadowed = {.name = "direct_u", .desc = rays.sum.desc, .length = rays.batches};
    do {
        const bool analytic = rays.first == 0 && direct_light_is_analytic(r);
        const direct_light_dispatch dispatch = {
            .pipeline = analytic ? state->sample_analytic : state->sample,
            .push.samples = sample_count(r),
            .push.candidates = r->constants.emitter_count > EXACT_EMITTERS_MAX ? CANDIDATES_MANY : CANDIDATES_FEW,
            .push.punctual = has_many_punctual(r) ? punctual_lights(r) : 0,
        };
        frame_graph_pass *pass = rays_pass_add(r, dispatch, &rays, counter);
        resource_chain_next(&unshadowed, pass);
        if (analytic)
            frame_graph_create_resource(pass, "direct_analytic", &rays.sum.desc, ACCESS_STORAGE_WRITE);
    } while (light_rays_trace(r, &rays));
}

static void direct_light_setup(renderer *r, void *user)
{
    const direct_light *state = user;
    light_rays exact = {0}, sampled = {0};
    if (has_exact(r))
        exact = light_rays_begin(r, "direct_light", "direct", punctual_lights(r));
    if (direct_light_is_sampled(r))
        sampled = light_rays_begin(r, "direct_light/sample", "direct_s", sampled_layers(r));
    if (exact.batches + sampled.batches == 0)
        return;
    resource_chain counter =
        resource_chain_counter(r->graph, "direct_light/clear", "rays_direct", exact.batches + sampled.batches);
    if (exact.batches > 0)
        exact_declare(r, state, exact, &counter);
    if (sampled.batches > 0)
        sample_declare(r, state, sampled, &counter);
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
