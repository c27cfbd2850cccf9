// Shadow samples that are traced again: see shadow_again.h.
#include "shadow_again.h"
#include "modules.h"
#include "rays.h"
#include "world.h"

#include "lanternfield_renderer_shaders.h"

#include <string.h>

// As shadow_record and shadow_lag in shaders/shadow_again.glsl.h.
enum { SIDE = 4, RECORD_SIZE = 15 * 4, LAG_SIZE = 6 * 4, MOVED_WORDS = WORLD_IDENTITIES / 32 + 1 };

typedef struct shadow_again {
    gpu_pipeline record, hold, lag, rays, limit;
    gpu_buffer moved; // host: a bit for each identity whose instance moved
} shadow_again;

typedef struct again_pass {
    gpu_pipeline pipeline;
    uint32_t columns, rows; // strata
    bool traced, has_lags; // limit
    struct {
        uint32_t slot_count;
        float singularity;
        uint32_t records_valid;
    } push; // rays
} again_pass;

static again_pass pass_of(const renderer *r, gpu_pipeline pipeline)
{
    const render_settings *s = &r->settings;
    return (again_pass){
        .pipeline = pipeline,
        .columns = div_up_u32(s->width, SIDE),
        .rows = div_up_u32(s->height, SIDE),
        .push = {renderer_slots(r), renderer_singularity(r)},
    };
}

static void strata_execute(const frame_graph_context *context, void *user)
{
    const again_pass *args = user;
    frame_graph_bind(context, args->pipeline);
    gpu_dispatch(context->commands, div_up_u32(args->columns * args->rows, 64), 1, 1);
}

static void rays_execute(const frame_graph_context *context, void *user)
{
    again_pass *args = user;
    args->push.records_valid = frame_graph_history_valid(context, "shadow_records");
    frame_graph_bind(context, args->pipeline);
    gpu_push(context->commands, &args->push, sizeof args->push);
    gpu_dispatch(context->commands, div_up_u32(args->columns * args->rows, 64), 1, 1);
}

static void limit_execute(const frame_graph_context *context, void *user)
{
    const again_pass *args = user;
    const uint32_t push[] = {frame_graph_history_valid(context, "shadow_limit"),
                             frame_graph_history_valid(context, "shadow_records"), args->traced, args->has_lags};
    frame_graph_bind(context, args->pipeline);
    gpu_push(context->commands, push, sizeof push);
    gpu_dispatch(context->commands, div_up_u32(args->columns, PIXEL_GROUP_WIDTH), args->rows, 1);
}

static void lag_execute(const frame_graph_context *context, void *user)
{
    const again_pass *args = user;
    const uint32_t history_valid = frame_graph_history_valid(context, "shadow_lag");
    frame_graph_bind(context, args->pipeline);
    gpu_push(context->commands, &history_valid, sizeof history_valid);
    gpu_dispatch(context->commands, div_up_u32(args->columns, PIXEL_GROUP_WIDTH), args->rows, 1);
}

// `keep`: what it makes is for the next frame.
static frame_graph_pass *pass_add(renderer *r, const char *name, bool keep, const again_pass *args,
                                  void (*execute)(const frame_graph_context *, void *))
{
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = FRAME_GRAPH_COMPUTE,
        .keep = keep,
        .execute = execute,
        .user = (void *)args, // copied
        .user_size = sizeof *args,
    };
    return frame_graph_pass_add(r->graph, &desc);
}

static void records_create(frame_graph_pass *pass, const char *name, const again_pass *args)
{
    const frame_graph_resource_desc desc = frame_graph_buffer_of((uint64_t)args->columns * args->rows * RECORD_SIZE);
    frame_graph_create_resource(pass, name, &desc, ACCESS_STORAGE_WRITE);
}

void shadow_again_record(renderer *r, frame_graph_pass *pass, bool first)
{
    const again_pass args = pass_of(r, (gpu_pipeline){0});
    if (first)
        records_create(pass, "shadow_records_made", &args);
    else
        frame_graph_read(pass, "lgh_header", ACCESS_STORAGE_READ); // stands in, and is not written
}

static void record_declare(renderer *r, const shadow_again *state)
{
    const again_pass args = pass_of(r, state->record);
    frame_graph_pass *p = pass_add(r, "shadow_again/record", true, &args, strata_execute);
    frame_graph_read(p, "depth", ACCESS_SAMPLED);
    frame_graph_read(p, "normals", ACCESS_SAMPLED);
    frame_graph_read(p, "albedo", ACCESS_SAMPLED);
    frame_graph_read(p, "shadow_visible", ACCESS_STORAGE_READ);
    frame_graph_read(p, "shadow_records_made", ACCESS_STORAGE_READ);
    records_create(p, "shadow_records", &args);
    frame_graph_read_previous(p, "shadow_records", ACCESS_STORAGE_READ); // unread: so that they are kept
}

static void hold_declare(renderer *r, const shadow_again *state)
{
    const again_pass args = pass_of(r, state->hold);
    frame_graph_pass *p = pass_add(r, "shadow_again/hold", true, &args, strata_execute);
    frame_graph_read_previous(p, "shadow_records", ACCESS_STORAGE_READ);
    records_create(p, "shadow_records", &args);
}

static void lag_declare(renderer *r, const shadow_again *state)
{
    static const char *const images[] = {"shadow_u", "shadow_s", "shadow_u_accumulated", "shadow_s_accumulated",
                                         "shadow_moments"};
    const again_pass args = pass_of(r, state->lag);
    frame_graph_pass *p = pass_add(r, "shadow_again/lag", true, &args, lag_execute);
    for (size_t i = 0; i < countof(images); i++)
        frame_graph_read(p, images[i], ACCESS_STORAGE_READ);
    frame_graph_read(p, "motion", ACCESS_SAMPLED);
    frame_graph_read_previous(p, "shadow_lag", ACCESS_STORAGE_READ);
    const frame_graph_resource_desc lags = frame_graph_buffer_of((uint64_t)args.columns * args.rows * LAG_SIZE);
    frame_graph_create_resource(p, "shadow_lag", &lags, ACCESS_STORAGE_WRITE);
}

// ---- The limit

// Whether samples are traced again in this frame.
static bool is_traced(const renderer *r)
{
    return r->frame > 0 && world_has_changed(r->gpu_world);
}

// Whether the history may hold frames of another light.
static bool may_lag(const renderer *r)
{
    return r->settings.filter && r->steady_frames < STILL_SAMPLES && !renderer_is_settled(r);
}

static bool has_lags(const renderer *r)
{
    return may_lag(r) && frame_graph_has_history(r->graph, "shadow_lag");
}

const char *shadow_again_limit(const renderer *r)
{
    return renderer_has_shadows(r) && (is_traced(r) || has_lags(r)) &&
                   frame_graph_has_history(r->graph, "shadow_records")
               ? "shadow_limit"
               : NULL;
}

static bool moved_write(renderer *r, shadow_again *state)
{
    const world_gpu *w = r->gpu_world;
    uint32_t *moved =
        world_buffer_reserve(r, &state->moved, "shadow moved", BINDING_NONE, MOVED_WORDS * sizeof(uint32_t));
    if (!moved)
        return false;
    memset(moved, 0, MOVED_WORDS * sizeof *moved);
    for (uint32_t i = 0; i < w->instance_count; i++) {
        const mesh_instance_gpu *instance = &w->instance_data[i];
        const uint32_t identity = world_identity(w->order[i].entity);
        if (world_instance_moved(instance))
            moved[identity / 32] |= 1u << identity % 32;
    }
    return true;
}

static void rays_declare(renderer *r, const shadow_again *state)
{
    const again_pass args = pass_of(r, state->rays);
    const uint32_t count = args.columns * args.rows;
    frame_graph_import_buffer(r->graph, "shadow_moved", state->moved, ACCESS_HOST_WRITE, ACCESS_NONE);
    frame_graph_pass *rays = pass_add(r, "shadow_again/rays", false, &args, rays_execute);
    frame_graph_read_previous(rays, "shadow_records", ACCESS_STORAGE_READ);
    frame_graph_read(rays, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(rays, "shadow_moved", ACCESS_STORAGE_READ);
    rays_create(r, rays, "shadow_again", count);
    const frame_graph_resource_desc light = frame_graph_buffer_of(count * sizeof(float));
    frame_graph_create_resource(rays, "shadow_again_light", &light, ACCESS_STORAGE_WRITE);
    rays_trace(r, "shadow_again", RAYS_VISIBLE, count);
}

// What is absent has something else stand in, unread.
static void limit_declare(renderer *r, const shadow_again *state)
{
    again_pass args = pass_of(r, state->limit);
    args.traced = is_traced(r);
    args.has_lags = has_lags(r);
    frame_graph_pass *limit = pass_add(r, "shadow_again/limit", false, &args, limit_execute);
    frame_graph_read_previous(limit, "shadow_records", ACCESS_STORAGE_READ);
    frame_graph_read(limit, args.traced ? "shadow_again_light" : "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(limit, args.traced ? "shadow_again_visible" : "lgh_header", ACCESS_STORAGE_READ);
    const frame_graph_resource_desc image = frame_graph_image_of(VK_FORMAT_R32G32_SFLOAT, args.columns, args.rows);
    frame_graph_create_resource(limit, "shadow_limit", &image, ACCESS_STORAGE_WRITE);
    frame_graph_read_previous(limit, "shadow_limit", ACCESS_SAMPLED);
    if (args.has_lags)
        frame_graph_read_previous(limit, "shadow_lag", ACCESS_STORAGE_READ);
    else
        frame_graph_read(limit, "lgh_header", ACCESS_STORAGE_READ);
}

// ---- The module

static void shadow_again_setup(renderer *r, void *user)
{
    shadow_again *state = user;
    if (!renderer_has_shadows(r))
        return;
    if (renderer_is_settled(r))
        hold_declare(r, state);
    else
        record_declare(r, state);
    if (may_lag(r))
        lag_declare(r, state);
    if (!shadow_again_limit(r))
        return;
    if (is_traced(r)) {
        r->failed |= !moved_write(r, state);
        if (!r->failed)
            rays_declare(r, state);
    }
    if (!r->failed)
        limit_declare(r, state);
}

static void shadow_again_fini(renderer *r, void *user)
{
    const shadow_again *state = user;
    gpu_pipeline_destroy(r->gpu, state->record);
    gpu_pipeline_destroy(r->gpu, state->hold);
    gpu_pipeline_destroy(r->gpu, state->lag);
    gpu_pipeline_destroy(r->gpu, state->rays);
    gpu_pipeline_destroy(r->gpu, state->limit);
    gpu_buffer_destroy(r->gpu, state->moved);
}

static gpu_pipeline pipeline_of(renderer *r, const gpu_shader *shader)
{
    return gpu_compute_pipeline_create(r->gpu, &(gpu_compute_pipeline_desc){.shader = shader});
}

bool shadow_again_init(renderer *r)
{
    shadow_again *state =
        renderer_pass_add(r, "shadow_again", sizeof(shadow_again), shadow_again_setup, shadow_again_fini);
    state->record = pipeline_of(r, &shader_shadow_again_record_comp);
    state->hold = pipeline_of(r, &shader_shadow_again_hold_comp);
    state->lag = pipeline_of(r, &shader_shadow_again_lag_comp);
    state->rays = pipeline_of(r, &shader_shadow_again_rays_comp);
    state->limit = pipeline_of(r, &shader_shadow_again_limit_comp);
    return state->record.id && state->hold.id && state->lag.id && state->rays.id && state->limit.id;
}
