// Shadows of the reservoirs' samples: makes the pair `shadow_u`, `shadow_s`, and counts the rays in `rays_shadow`. With
// a ray budget, `shadow_plan` says which pixels have how many, by what the filter knows of them.
#include "filters.h"
#include "light_rays.h"
#include "modules.h"
#include "shadow_again.h"

#include "lanternfield_renderer_shaders.h"

// Bits of a pipeline's index
enum { EXACT = 1, UNIFORM = 2, JITTER = 4, VPL = 8, PAPER_BLEND = 16, BUDGET = 32, VARIANTS = 64 };

typedef struct shadow {
    gpu_pipeline pipelines[VARIANTS]; // made when first used
    gpu_pipeline priority, budget;
} shadow;

typedef struct shadow_pass {
    gpu_pipeline pipeline;
    uint32_t width, height;
    struct {
        uint32_t interleave, emission, start_level, samples;
        uint32_t first, layers;
        float singularity, ray_budget;
    } push;
} shadow_pass;

enum { BUDGET_HEADER_SIZE = (512 + 2) * 4 }; // budget_header of shadow_budget.glsl.h

typedef struct budget_pass {
    gpu_pipeline priority, budget;
    uint32_t width, height, interleave, samples;
    float ray_budget;
    const char *counter;
} budget_pass;

static gpu_pipeline pipeline_of(renderer *r, shadow *state, uint32_t variant)
{
    gpu_pipeline *pipeline = &state->pipelines[variant];
    const uint32_t constants[] = {(variant & EXACT) != 0, (variant & UNIFORM) != 0, (variant & JITTER) != 0,
                                  (variant & PAPER_BLEND) != 0, (variant & BUDGET) != 0};
    const gpu_compute_pipeline_desc desc = {
        .shader = variant & VPL ? &shader_shadow_vpl_comp : &shader_shadow_comp,
        .constants = constants,
        .constant_count = countof(constants),
    };
    if (!pipeline->id)
        *pipeline = gpu_compute_pipeline_create(r->gpu, &desc);
    return *pipeline;
}

static void execute(const frame_graph_context *context, void *user)
{
    const shadow_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->push, sizeof pass->push);
    gpu_dispatch(context->commands, div_up_u32(pass->width, PIXEL_GROUP_WIDTH), pass->height, 1);
}

// Once the picture has settled these passes are culled, unless somebody looks at what they make; then they count for
// nothing.
static const char *counter_name(const renderer *r)
{
    return renderer_is_settled(r) ? "rays_shadow_idle" : "rays_shadow";
}

// ---- The budget

// Whether the filter has a history; what it keeps is as old as the last of it.
static bool filter_history_valid(const frame_graph_context *context)
{
    return reprojection_is_valid(context) && frame_graph_history_valid(context, "shadow_moments");
}

static void priority_execute(const frame_graph_context *context, void *user)
{
    const budget_pass *pass = user;
    const uint32_t push[] = {pass->interleave, filter_history_valid(context)};
    gpu_buffer_fill(context->commands, frame_graph_buffer(context, "shadow_priorities"), 0, BUDGET_HEADER_SIZE, 0);
    gpu_memory_barrier(context->commands);
    frame_graph_bind(context, pass->priority);
    gpu_push(context->commands, push, sizeof push);
    gpu_dispatch(context->commands, div_up_u32(pass->width, 16), div_up_u32(pass->height, 16), 1);
}

static void budget_execute(const frame_graph_context *context, void *user)
{
    const budget_pass *pass = user;
    const struct {
        float budget, most;
        uint32_t history_valid;
    } push = {
        .budget = pass->ray_budget,
        .most = (float)pass->samples,
        .history_valid =
            frame_graph_history_valid(context, "shadow_budget") && frame_graph_history_valid(context, pass->counter),
    };
    frame_graph_bind(context, pass->budget);
    gpu_push(context->commands, &push, sizeof push);
    gpu_dispatch(context->commands, 1, 1, 1);
}

static frame_graph_pass *budget_pass_add(renderer *r, const char *name, budget_pass *args,
                                         void (*execute)(const frame_graph_context *, void *))
{
    const frame_graph_pass_desc desc = {
        .name = name, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = args, .user_size = sizeof *args};
    return frame_graph_pass_add(r->graph, &desc);
}

static void priority_declare(renderer *r, budget_pass *args)
{
    static const char *const before[] = {"shadow_u_accumulated", "shadow_s_accumulated", "shadow_moments"};
    const frame_graph_resource_desc header = frame_graph_buffer_of(BUDGET_HEADER_SIZE);
    const frame_graph_resource_desc plan = frame_graph_buffer_of((uint64_t)args->width * args->height * 4);
    frame_graph_pass *p = budget_pass_add(r, "shadow/priority", args, priority_execute);
    frame_graph_create_resource(p, "shadow_priorities", &header, ACCESS_STORAGE_READ_WRITE);
    frame_graph_create_resource(p, "shadow_plan", &plan, ACCESS_STORAGE_WRITE);
    reprojection_declare(p);
    frame_graph_read(p, "indirect", ACCESS_SAMPLED);
    for (size_t i = 0; i < countof(before); i++)
        frame_graph_read_previous(p, before[i], ACCESS_SAMPLED);
}

static void budget_declare(renderer *r, const shadow *state)
{
    const render_settings *s = &r->settings;
    budget_pass args = {state->priority, state->budget,     s->width,      s->height,
                        s->interleave,   s->shadow_samples, s->ray_budget, counter_name(r)};
    priority_declare(r, &args);
    frame_graph_pass *p = budget_pass_add(r, "shadow/budget", &args, budget_execute);
    frame_graph_modify(p, "shadow_priorities", "shadow_budget", ACCESS_STORAGE_READ_WRITE);
    frame_graph_read_previous(p, "shadow_budget", ACCESS_STORAGE_READ);
    frame_graph_read_previous(p, args.counter, ACCESS_STORAGE_READ);
}

// ---- The rays

// The pass that makes the rays of the current batch.
static void declare_rays(renderer *r, shadow_pass args, const light_rays *rays, resource_chain *counter,
                         resource_chain *unshadowed)
{
    args.push.first = rays->first;
    args.push.layers = rays->count;
    const frame_graph_pass_desc desc = {
        .name = rays->pass, .kind = FRAME_GRAPH_COMPUTE, .execute = execute, .user = &args, .user_size = sizeof args};
    frame_graph_pass *p = frame_graph_pass_add(r->graph, &desc);
    resource_chain_next(counter, p);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_lights", ACCESS_STORAGE_READ);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(p, "depth", ACCESS_SAMPLED);
    frame_graph_read(p, "normals", ACCESS_SAMPLED);
    frame_graph_read(p, "indirect", ACCESS_SAMPLED);
    frame_graph_read(p, "reservoirs", ACCESS_STORAGE_READ);
    light_rays_make(r, rays, p);
    resource_chain_next(unshadowed, p);
    const bool budget = r->settings.ray_budget > 0; // otherwise something else stands in, and is not read
    frame_graph_read(p, budget ? "shadow_budget" : "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, budget ? "shadow_plan" : "lgh_header", ACCESS_STORAGE_READ);
    shadow_again_record(r, p, rays->first == 0);
    if (r->settings.end_point == END_POINT_VPL)
        frame_graph_read(p, "lgh_samples", ACCESS_STORAGE_READ);
}

static void shadow_setup(renderer *r, void *state)
{
    if (!renderer_has_shadows(r))
        return;
    const render_settings *s = &r->settings;
    const bool budget = s->ray_budget > 0;
    if (budget && !s->filter) {
        log_error("--ray-budget %g: pixels without a ray need the filter's history; expected 0 with --no-filter",
                  (double)s->ray_budget);
        r->failed = true;
        return;
    }
    if (budget)
        budget_declare(r, state);
    const uint32_t variant =
        (s->lighting == LIGHTING_VOLUMES && s->reservoirs == RESERVOIRS_EXACT ? EXACT : 0) |
        (s->sampling == SAMPLING_UNIFORM ? UNIFORM : 0) | (s->end_point == END_POINT_JITTER ? JITTER : 0) |
        (s->end_point == END_POINT_VPL ? VPL : 0) | (s->blend == BLEND_PAPER ? PAPER_BLEND : 0) | (budget ? BUDGET : 0);
    const shadow_pass pass = {
        .pipeline = pipeline_of(r, state, variant),
        .width = s->width,
        .height = s->height,
        .push = {s->interleave, s->emission, s->start_level, s->shadow_samples, 0, 0, renderer_singularity(r),
                 s->ray_budget},
    };
    light_rays rays = light_rays_begin(r, "shadow", "shadow_s", s->shadow_samples);
    resource_chain counter = resource_chain_counter(r->graph, "shadow/clear", counter_name(r), rays.batches);
    resource_chain unshadowed = {.name = "shadow_u", .desc = rays.sum.desc, .length = rays.batches};
    do
        declare_rays(r, pass, &rays, &counter, &unshadowed);
    while (light_rays_trace(r, &rays));
}

static void shadow_fini(renderer *r, void *state)
{
    for (uint32_t i = 0; i < VARIANTS; i++)
        gpu_pipeline_destroy(r->gpu, ((shadow *)state)->pipelines[i]);
    gpu_pipeline_destroy(r->gpu, ((shadow *)state)->priority);
    gpu_pipeline_destroy(r->gpu, ((shadow *)state)->budget);
}

bool shadow_init(renderer *r)
{
    shadow *state = renderer_pass_add(r, "shadow", sizeof(shadow), shadow_setup, shadow_fini);
    const gpu_compute_pipeline_desc priority = {.shader = &shader_shadow_priority_comp};
    const gpu_compute_pipeline_desc budget = {.shader = &shader_shadow_budget_comp};
    state->priority = gpu_compute_pipeline_create(r->gpu, &priority);
    state->budget = gpu_compute_pipeline_create(r->gpu, &budget);
    return state->priority.id && state->budget.id;
}
