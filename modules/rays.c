// The tracing passes of ray batches: see rays.h.
#include "rays.h"
#include "embree_rays.h"
#include "modules.h"
#include "world.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>
#include <string.h>

enum { NAME_SIZE = 64 };

enum { KINDS = RAYS_NEAREST + 1 };
enum { ORDER_COUNT, ORDER_ROOM, ORDER_PLACE, ORDER_STEPS };

typedef struct rays_state {
    // By whether the rays are ordered; made when first needed: no device need have both.
    gpu_pipeline query[KINDS][2], pipeline[KINDS][2];
    gpu_pipeline order[ORDER_STEPS];
    embree_rays *embree; // made when first needed
    bool no_embree; // it could not be made
} rays_state;

typedef struct rays_pass { // of a tracing pass
    rays_kind kind;
    uint32_t count;
    bool ordered;
    gpu_pipeline pipeline; // of a GPU's passes
    embree_rays *embree;
    char origins[NAME_SIZE], directions[NAME_SIZE], answers[NAME_SIZE];
    char order_header[NAME_SIZE], order[NAME_SIZE];
} rays_pass;

typedef struct order_pass {
    gpu_pipeline steps[ORDER_STEPS];
    char header[NAME_SIZE];
    struct {
        uint32_t count, all;
    } push;
} order_pass;

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

// ---- Order

static uint32_t ray_groups(uint32_t count)
{
    return div_up_u32(count, RAYS_GROUP);
}

static void order_execute(const frame_graph_context *context, void *user)
{
    const order_pass *pass = user;
    const uint32_t groups[ORDER_STEPS] = {
        [ORDER_COUNT] = ray_groups(pass->push.count),
        [ORDER_ROOM] = RAY_ORDER_GROUPS,
        [ORDER_PLACE] = ray_groups(pass->push.count),
    };
    const gpu_buffer header = frame_graph_buffer(context, pass->header);
    gpu_buffer_fill(context->commands, header, 0, gpu_buffer_size(context->gpu, header), 0);
    for (int step = 0; step < ORDER_STEPS; step++) {
        gpu_memory_barrier(context->commands);
        frame_graph_bind(context, pass->steps[step]);
        gpu_push(context->commands, &pass->push, sizeof pass->push);
        gpu_dispatch(context->commands, groups[step], 1, 1);
    }
}

static void order_declare(renderer *r, const char *batch, const rays_pass *trace)
{
    order_pass args = {.push = {trace->count, trace->kind == RAYS_NEAREST}};
    memcpy(args.steps, state_of(r)->order, sizeof args.steps);
    memcpy(args.header, trace->order_header, sizeof args.header);
    char name[NAME_SIZE];
    name_print(name, batch, "/order");
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = order_execute,
        .user = &args,
        .user_size = sizeof args,
    };
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &desc);
    frame_graph_read(pass, trace->origins, ACCESS_STORAGE_READ);
    frame_graph_read(pass, trace->directions, ACCESS_STORAGE_READ);
    const frame_graph_resource_desc header =
        frame_graph_buffer_of(sizeof(ray_order_header) + RAY_ORDER_BUCKETS * sizeof(uint32_t));
    const frame_graph_resource_desc order = frame_graph_buffer_of(max_u32(trace->count, 1) * sizeof(uint32_t));
    frame_graph_create_resource(pass, trace->order_header, &header, ACCESS_STORAGE_READ_WRITE);
    frame_graph_create_resource(pass, trace->order, &order, ACCESS_STORAGE_WRITE);
}

// The tracing pass's next two bindings: the order, or buffers that are not read.
static void order_use(frame_graph_pass *pass, const rays_pass *trace)
{
    static const frame_graph_resource_desc unused = {.kind = FRAME_GRAPH_BUFFER, .size = 16};
    const char *const names[] = {trace->order_header, trace->order};
    for (size_t i = 0; i < countof(names); i++)
        if (trace->ordered)
            frame_graph_read(pass, names[i], ACCESS_STORAGE_READ);
        else
            frame_graph_create_resource(pass, names[i], &unused, ACCESS_STORAGE_WRITE);
    if (trace->ordered)
        frame_graph_read(pass, trace->order_header, ACCESS_INDIRECT);
}

// ---- Tracing

static void query_execute(const frame_graph_context *context, void *user)
{
    const rays_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->count, sizeof pass->count);
    if (pass->ordered)
        gpu_dispatch_indirect(context->commands, frame_graph_buffer(context, pass->order_header), 0);
    else
        gpu_dispatch(context->commands, ray_groups(pass->count), 1, 1);
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
    const bool ordered = !host && r->settings.ray_order;
    rays_pass args = {
        .kind = kind,
        .count = count,
        .ordered = ordered,
        .pipeline = tracer == RAYS_PIPELINE ? state->pipeline[kind][ordered] : state->query[kind][ordered],
        .embree = state->embree,
    };
    name_print(args.origins, batch, "_origins");
    name_print(args.directions, batch, "_directions");
    name_print(args.answers, batch, kind == RAYS_NEAREST ? "_hits" : "_visible");
    name_print(args.order_header, batch, "_order_header");
    name_print(args.order, batch, "_order");
    if (ordered)
        order_declare(r, batch, &args);
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
    if (!host)
        order_use(pass, &args);
}

// ---- The scene for Embree

static void scene_update(const frame_graph_context *context, void *user)
{
    (void)context;
    renderer *r = user;
    const world_gpu *w = r->gpu_world;
    r->failed |= !embree_rays_update(state_of(r)->embree, w->instance_data, w->instance_count, w->deformations);
}

static void embree_make(renderer *r, rays_state *state)
{
    const world_gpu *w = r->gpu_world;
    state->embree = embree_rays_create(r->scene, w->material_data, gpu_buffer_map(r->gpu, w->positions),
                                       gpu_buffer_map(r->gpu, w->indices));
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
    const uint32_t ordered = r->settings.ray_order;
    for (uint32_t kind = 0; kind < KINDS; kind++) {
        const gpu_compute_pipeline_desc desc = {.shader = shaders[kind], .constants = &ordered, .constant_count = 1};
        if (!state->query[kind][ordered].id)
            state->query[kind][ordered] = gpu_compute_pipeline_create(r->gpu, &desc);
    }
    return state->query[RAYS_VISIBLE][ordered].id && state->query[RAYS_NEAREST][ordered].id;
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
    const uint32_t ordered = r->settings.ray_order;
    for (uint32_t kind = 0; kind < KINDS; kind++) {
        const gpu_ray_pipeline_desc desc = {
            .raygen = shaders[kind],
            .miss = &shader_rays_rmiss,
            .closest_hit = &shader_rays_rchit,
            .any_hit = &shader_rays_rahit,
            .constants = &ordered,
            .constant_count = 1,
        };
        if (!state->pipeline[kind][ordered].id)
            state->pipeline[kind][ordered] = gpu_ray_pipeline_create(r->gpu, &desc);
    }
    return state->pipeline[RAYS_VISIBLE][ordered].id && state->pipeline[RAYS_NEAREST][ordered].id;
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
    frame_graph_read(pass, "positions|-", ACCESS_HOST_READ); // what the GPU deforms
}

static void rays_fini(renderer *r, void *user)
{
    rays_state *state = user;
    embree_rays_destroy(state->embree);
    for (uint32_t i = 0; i < 2 * KINDS; i++) {
        gpu_pipeline_destroy(r->gpu, state->query[i / 2][i % 2]);
        gpu_pipeline_destroy(r->gpu, state->pipeline[i / 2][i % 2]);
    }
    for (uint32_t step = 0; step < ORDER_STEPS; step++)
        gpu_pipeline_destroy(r->gpu, state->order[step]);
}

bool rays_init(renderer *r)
{
    rays_state *state = renderer_pass_add(r, "rays", sizeof(rays_state), rays_setup, rays_fini);
    static const gpu_shader *const steps[ORDER_STEPS] = {
        [ORDER_COUNT] = &shader_rays_order_count_comp,
        [ORDER_ROOM] = &shader_rays_order_room_comp,
        [ORDER_PLACE] = &shader_rays_order_place_comp,
    };
    bool made = true;
    for (uint32_t step = 0; step < ORDER_STEPS; step++) {
        const gpu_compute_pipeline_desc desc = {.shader = steps[step]};
        state->order[step] = gpu_compute_pipeline_create(r->gpu, &desc);
        made &= state->order[step].id != 0;
    }
    return made;
}
