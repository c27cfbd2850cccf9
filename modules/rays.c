// The tracing passes of ray batches: see rays.h.
#include "rays.h"
#include "embree_rays.h"
#include "modules.h"
#include "world.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>

enum { NAME_SIZE = 64 };

enum { KINDS = RAYS_NEAREST + 1 };

typedef struct rays_state {
    gpu_pipeline query[KINDS], pipeline[KINDS]; // made when first needed: no device need have both
    embree_rays *embree; // made when first needed
    bool no_embree; // it could not be made
} rays_state;

typedef struct rays_pass { // of a tracing pass
    rays_kind kind;
    uint32_t count;
    gpu_pipeline pipeline; // of a GPU's passes
    embree_rays *embree;
    char origins[NAME_SIZE], directions[NAME_SIZE], answers[NAME_SIZE];
} rays_pass;

// Host passes that trace read it: they come after the pass that lets Embree follow the instances.
static const char scene_token[] = "rays_scene";

static void name_print(char name[NAME_SIZE], const char *batch, const char *suffix)
{
    const int length = snprintf(name, NAME_SIZE, "%s%s", batch, suffix);
    assert(length < NAME_SIZE);
    (void)length;
}

static rays_state *state_of(const renderer *r)
{
    return ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "rays"), r->pass))->state;
}

ray_method rays_tracer(const renderer *r)
{
    if (r->settings.rays != RAYS_AUTO)
        return r->settings.rays;
    if (gpu_is_cpu(r->gpu) && !state_of(r)->no_embree)
        return RAYS_EMBREE;
    return gpu_has_ray_query(r->gpu) ? RAYS_QUERY : RAYS_PIPELINE;
}

bool rays_are_host(const renderer *r)
{
    return rays_tracer(r) == RAYS_EMBREE;
}

// ---- Batches

uint32_t rays_layers(const renderer *r, uint32_t wanted)
{
    const uint64_t pixels = (uint64_t)r->settings.width * r->settings.height;
    const uint64_t fit = RAYS_BATCH / pixels;
    return fit < 1 ? 1 : fit < wanted ? (uint32_t)fit : wanted;
}

static frame_graph_resource_desc batch_buffer(const renderer *r, uint32_t count, uint64_t item_size)
{
    frame_graph_resource_desc desc = frame_graph_buffer_of(max_u32(count, 1) * item_size);
    desc.host = rays_are_host(r);
    return desc;
}

void rays_create(renderer *r, frame_graph_pass *pass, const char *batch, uint32_t count)
{
    static const char *const suffixes[] = {"_origins", "_directions"};
    const frame_graph_resource_desc desc = batch_buffer(r, count, 4 * sizeof(float));
    for (size_t i = 0; i < countof(suffixes); i++) {
        char name[NAME_SIZE];
        name_print(name, batch, suffixes[i]);
        frame_graph_create_resource(pass, name, &desc, ACCESS_STORAGE_WRITE);
    }
}

void rays_modify(renderer *r, frame_graph_pass *pass, const char *from, const char *to)
{
    (void)r;
    static const char *const suffixes[] = {"_origins", "_directions"};
    for (size_t i = 0; i < countof(suffixes); i++) {
        char from_name[NAME_SIZE], to_name[NAME_SIZE];
        name_print(from_name, from, suffixes[i]);
        name_print(to_name, to, suffixes[i]);
        frame_graph_modify(pass, from_name, to_name, ACCESS_STORAGE_READ_WRITE);
    }
}

// ---- Tracing

static void query_execute(const frame_graph_context *context, void *user)
{
    const rays_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->count, sizeof pass->count);
    // 128 a group would be one group too many for two rays at each of 2048x2048 pixels.
    gpu_dispatch(context->commands, div_up_u32(pass->count, 256), 1, 1);
}

static void pipeline_execute(const frame_graph_context *context, void *user)
{
    const rays_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->count, sizeof pass->count);
    gpu_trace_rays(context->commands, pass->count);
}

static void *mapping_of(const frame_graph_context *context, const char *name)
{
    return gpu_buffer_map(context->gpu, frame_graph_buffer(context, name));
}

static void embree_execute(const frame_graph_context *context, void *user)
{
    const rays_pass *pass = user;
    const float(*origins)[4] = mapping_of(context, pass->origins);
    const float(*directions)[4] = mapping_of(context, pass->directions);
    void *answers = mapping_of(context, pass->answers);
    if (pass->kind == RAYS_NEAREST)
        embree_rays_nearest(pass->embree, origins, directions, answers, pass->count);
    else
        embree_rays_visible(pass->embree, origins, directions, answers, pass->count);
}

void rays_trace(renderer *r, const char *batch, rays_kind kind, uint32_t count)
{
    static const struct {
        frame_graph_pass_kind pass_kind;
        void (*execute)(const frame_graph_context *context, void *user);
    } tracers[] = {
        [RAYS_QUERY] = {FRAME_GRAPH_COMPUTE, query_execute},
        [RAYS_PIPELINE] = {FRAME_GRAPH_RAY_TRACING, pipeline_execute},
        [RAYS_EMBREE] = {FRAME_GRAPH_HOST, embree_execute},
    };
    const rays_state *state = state_of(r);
    const ray_method tracer = rays_tracer(r);
    const bool host = tracer == RAYS_EMBREE;
    rays_pass args = {.kind = kind, .count = count, .embree = state->embree};
    args.pipeline = tracer == RAYS_PIPELINE ? state->pipeline[kind] : state->query[kind];
    name_print(args.origins, batch, "_origins");
    name_print(args.directions, batch, "_directions");
    name_print(args.answers, batch, kind == RAYS_NEAREST ? "_hits" : "_visible");
    char name[NAME_SIZE];
    name_print(name, batch, "/trace");
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = tracers[tracer].pass_kind,
        .execute = tracers[tracer].execute,
        .user = &args,
        .user_size = sizeof args,
    };
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &desc);
    frame_graph_read(pass, host ? scene_token : "tlas", host ? ACCESS_HOST_READ : ACCESS_TRACE);
    frame_graph_read(pass, args.origins, host ? ACCESS_HOST_READ : ACCESS_STORAGE_READ);
    frame_graph_read(pass, args.directions, host ? ACCESS_HOST_READ : ACCESS_STORAGE_READ);
    const frame_graph_resource_desc answers =
        batch_buffer(r, count, kind == RAYS_NEAREST ? sizeof(ray_hit) : sizeof(uint32_t));
    frame_graph_create_resource(pass, args.answers, &answers, host ? ACCESS_HOST_WRITE : ACCESS_STORAGE_WRITE);
}

// ---- The scene for Embree

static void scene_update(const frame_graph_context *context, void *user)
{
    (void)context;
    renderer *r = user;
    const world_gpu *w = r->gpu_world;
    r->failed |= !embree_rays_update(state_of(r)->embree, w->instance_data, w->instance_count);
}

static void embree_make(renderer *r, rays_state *state)
{
    const world_gpu *w = r->gpu_world;
    state->embree =
        embree_rays_create(r->scene, gpu_buffer_map(r->gpu, w->positions), gpu_buffer_map(r->gpu, w->indices));
    state->no_embree = !state->embree;
    if (state->no_embree && r->settings.rays == RAYS_AUTO)
        log_info("--rays auto: Embree has no device here; rays are traced by the Vulkan device");
}

// Has Embree ready. False where it cannot be had (logged).
static bool embree_require(renderer *r, rays_state *state)
{
    if (!gpu_is_cpu(r->gpu)) {
        log_error(
            "--rays embree: Embree traces in the memory of a CPU, and %s is none; expected auto, query or pipeline",
            gpu_name(r->gpu));
        return false;
    }
    if (!state->embree && !state->no_embree)
        embree_make(r, state);
    if (!state->embree && r->settings.rays == RAYS_EMBREE)
        log_error("--rays embree: Embree has no device here; expected auto, query or pipeline");
    return state->embree;
}

static bool query_require(renderer *r, rays_state *state)
{
    static const gpu_shader *const shaders[KINDS] = {
        [RAYS_VISIBLE] = &shader_rays_visible_comp,
        [RAYS_NEAREST] = &shader_rays_nearest_comp,
    };
    if (!gpu_has_ray_query(r->gpu)) {
        log_error("--rays query: %s has no ray query; expected auto or pipeline", gpu_name(r->gpu));
        return false;
    }
    for (uint32_t kind = 0; kind < KINDS; kind++)
        if (!state->query[kind].id)
            state->query[kind] =
                gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = shaders[kind]});
    return state->query[RAYS_VISIBLE].id && state->query[RAYS_NEAREST].id;
}

static bool pipeline_require(renderer *r, rays_state *state)
{
    static const gpu_shader *const shaders[KINDS] = {
        [RAYS_VISIBLE] = &shader_rays_visible_rgen,
        [RAYS_NEAREST] = &shader_rays_nearest_rgen,
    };
    if (!gpu_has_ray_pipelines(r->gpu)) {
        log_error("--rays pipeline: %s has no ray-tracing pipelines; expected auto or query", gpu_name(r->gpu));
        return false;
    }
    for (uint32_t kind = 0; kind < KINDS; kind++) {
        const gpu_ray_pipeline_desc desc = {
            .raygen = shaders[kind],
            .miss = &shader_rays_rmiss,
            .closest_hit = &shader_rays_rchit,
            .any_hit = &shader_rays_rahit,
        };
        if (!state->pipeline[kind].id)
            state->pipeline[kind] = gpu_ray_pipeline_create(r->gpu, &desc);
    }
    return state->pipeline[RAYS_VISIBLE].id && state->pipeline[RAYS_NEAREST].id;
}

// Has the tracer of this frame ready. False where --rays asks for what cannot be had (logged).
static bool tracer_require(renderer *r, rays_state *state)
{
    // Where `auto` finds no Embree, that changes the choice.
    if (rays_are_host(r) && (embree_require(r, state) || rays_are_host(r)))
        return state->embree;
    return rays_tracer(r) == RAYS_QUERY ? query_require(r, state) : pipeline_require(r, state);
}

static void rays_setup(renderer *r, void *user)
{
    if (!tracer_require(r, user)) {
        r->failed = true;
        return;
    }
    if (!rays_are_host(r))
        return;
    frame_graph_pass *pass = frame_graph_pass_add(
        r->graph,
        &(frame_graph_pass_desc){.name = "rays/scene", .kind = FRAME_GRAPH_HOST, .execute = scene_update, .user = r});
    const frame_graph_resource_desc token = {.kind = FRAME_GRAPH_BUFFER, .size = 16, .host = true};
    frame_graph_create_resource(pass, scene_token, &token, ACCESS_HOST_WRITE);
}

static void rays_fini(renderer *r, void *user)
{
    rays_state *state = user;
    embree_rays_destroy(state->embree);
    for (uint32_t kind = 0; kind < KINDS; kind++) {
        gpu_pipeline_destroy(r->gpu, state->query[kind]);
        gpu_pipeline_destroy(r->gpu, state->pipeline[kind]);
    }
}

bool rays_init(renderer *r)
{
    renderer_pass_add(r, "rays", sizeof(rays_state), rays_setup, rays_fini);
    return true;
}
