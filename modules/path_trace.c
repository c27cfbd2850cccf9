// Reference: unbiased path tracing with next-event estimation and multiple importance sampling to all light kinds
// (Kajiya 1986; Veach 1997, chapter 9). A path's first vertex is what the G-buffer holds for the pixel, at its centre,
// with the same normal maps as the other methods have, so that errors against this reference compare like with like;
// later vertices are Lambertian with the geometric normal, and every surface reflects on both sides, as virtual point
// lights have it. At each vertex one ray goes to a punctual light, one to an emissive triangle and one on along the
// path, until `bounces` indirect bounces are made. Nothing is clamped, and no path is ended by chance.
//
// Paths advance together, a vertex at a time: a frame's paths are layers of one path a pixel, path = layer * pixels +
// pixel. Random numbers are keyed by pixel, sample and vertex, so a picture does not depend on how many a frame takes.
#include "deform.h"
#include "modules.h"
#include "progressive.h"
#include "rays.h"
#include "resource_chain.h"
#include "world.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>

enum {
    // Paths in a frame, where the picture does not have more pixels: under a second a frame.
    PATHS_HOST_RAYS = 1 << 18,
    PATHS_CPU = 1 << 16,
    PATHS_GPU = 1 << 21,
    LIGHT_KINDS_MAX = 2, // rays to lights at each vertex: punctual, emissive
};

typedef struct path_trace {
    gpu_pipeline start, vertex, add;
} path_trace;

typedef struct path_pass {
    gpu_pipeline pipeline;
    uint32_t invocations;
    path_step step;
} path_pass;

typedef char resource_name[32];

static const char *name_of(resource_name name, const char *what, uint32_t vertex)
{
    snprintf(name, sizeof(resource_name), "path_%s_%u", what, vertex);
    return name;
}

static const char *answer_of(resource_name name, const char *batch, uint32_t vertex, const char *suffix)
{
    snprintf(name, sizeof(resource_name), "path_%s_%u_%s", batch, vertex, suffix);
    return name;
}

static uint32_t bounces_of(const renderer *r)
{
    return r->settings.only == ONLY_DIRECT ? 0 : r->settings.bounces;
}

static uint32_t light_kinds(const renderer *r)
{
    return (r->constants.light_count > 0) + (r->constants.emitter_count > 0);
}

static uint32_t layers_of(const renderer *r, uint64_t left)
{
    const uint64_t pixels = (uint64_t)r->settings.width * r->settings.height;
    const uint64_t paths = rays_are_host(r) ? PATHS_HOST_RAYS : gpu_is_cpu(r->gpu) ? PATHS_CPU : PATHS_GPU;
    uint64_t layers = paths > pixels ? paths / pixels : 1;
    layers = layers < left ? layers : left;
    return max_u32(rays_layers(r, LIGHT_KINDS_MAX * (uint32_t)layers) / LIGHT_KINDS_MAX, 1);
}

static void execute(const frame_graph_context *context, void *user)
{
    const path_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->step, sizeof pass->step);
    // 64 a group would be one group too many for 2048x2048 pixels.
    gpu_dispatch(context->commands, div_up_u32(pass->invocations, 128), 1, 1);
}

static frame_graph_pass *pass_add(renderer *r, const char *name, const path_pass *pass)
{
    const frame_graph_pass_desc desc = {
        .name = name,
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = execute,
        .user = (void *)pass,
        .user_size = sizeof *pass,
    };
    return frame_graph_pass_add(r->graph, &desc);
}

// What arrives at a vertex and what leaves it, by the settings.
static uint32_t flags_of(const renderer *r, uint32_t vertex)
{
    const uint32_t last = bounces_of(r);
    const bool indirect = r->settings.only == ONLY_INDIRECT;
    const bool gather = !(indirect && vertex == 0);
    const bool emission = !(indirect && vertex == 1);
    const bool next = vertex < last || (r->constants.emitter_count > 0 && gather);
    return (gather ? PATH_GATHER : 0) | (emission ? PATH_EMISSION : 0) | (next ? PATH_NEXT : 0);
}

// The rays that leave a vertex: bindings of path_trace_scatter.glsl.h, but for the counter.
static void scatter_declare(renderer *r, frame_graph_pass *pass, const path_step *step)
{
    resource_name name;
    const uint32_t rays = light_kinds(r) * step->count;
    const frame_graph_resource_desc pending = frame_graph_buffer_of(3 * sizeof(float) * (uint64_t)rays);
    frame_graph_create_resource(pass, name_of(name, "pending", step->vertex), &pending, ACCESS_STORAGE_WRITE);
    rays_create(r, pass, name_of(name, "lights", step->vertex), rays);
    rays_create(r, pass, name_of(name, "next", step->vertex), step->count);
}

static void rays_declare(renderer *r, const path_step *step)
{
    resource_name name;
    rays_trace(r, name_of(name, "lights", step->vertex), RAYS_VISIBLE, light_kinds(r) * step->count);
    rays_trace(r, name_of(name, "next", step->vertex), RAYS_NEAREST, step->count);
}

// The answers to the rays of a vertex: bindings of path_trace_arrive.glsl.h.
static void arrive_declare(frame_graph_pass *pass, uint32_t vertex)
{
    resource_name name;
    frame_graph_read(pass, answer_of(name, "next", vertex, "hits"), ACCESS_STORAGE_READ);
    frame_graph_read(pass, answer_of(name, "next", vertex, "origins"), ACCESS_STORAGE_READ);
    frame_graph_read(pass, answer_of(name, "next", vertex, "directions"), ACCESS_STORAGE_READ);
    frame_graph_read(pass, answer_of(name, "lights", vertex, "visible"), ACCESS_STORAGE_READ);
    frame_graph_read(pass, name_of(name, "pending", vertex), ACCESS_STORAGE_READ);
}

// What is handed on from vertex to vertex.
typedef struct path_chains {
    resource_chain counter, states;
} path_chains;

static path_chains chains_of(renderer *r, const path_step *step)
{
    const uint32_t vertices = 1 + bounces_of(r);
    return (path_chains){
        .counter = resource_chain_counter(r->graph, "path_trace/clear", "rays_path", vertices),
        .states = {.name = "path_states",
                   .desc = frame_graph_buffer_of(sizeof(path_state) * (uint64_t)step->count),
                   .length = vertices},
    };
}

static void start_declare(renderer *r, const path_trace *state, path_step step, path_chains *chains)
{
    step.flags = flags_of(r, 0);
    const path_pass args = {state->start, step.count, step};
    frame_graph_pass *pass = pass_add(r, "path_trace", &args);
    frame_graph_read(pass, "depth", ACCESS_SAMPLED);
    frame_graph_read(pass, "normals", ACCESS_SAMPLED);
    resource_chain_next(&chains->states, pass);
    scatter_declare(r, pass, &step);
    resource_chain_next(&chains->counter, pass);
    rays_declare(r, &step);
}

static void vertex_declare(renderer *r, const path_trace *state, path_step step, path_chains *chains, uint32_t vertex)
{
    step.vertex = vertex;
    step.flags = flags_of(r, vertex);
    const path_pass args = {state->vertex, step.count, step};
    resource_name name;
    snprintf(name, sizeof name, "path_trace/%u", vertex);
    frame_graph_pass *pass = pass_add(r, name, &args);
    arrive_declare(pass, vertex - 1);
    resource_chain_next(&chains->states, pass);
    scatter_declare(r, pass, &step);
    resource_chain_next(&chains->counter, pass);
    deform_read(pass);
    rays_declare(r, &step);
}

static void add_declare(renderer *r, const path_trace *state, path_step step)
{
    const uint32_t last = bounces_of(r);
    step.flags = flags_of(r, last + 1);
    const path_pass args = {state->add, step.pixels, step};
    frame_graph_pass *pass = pass_add(r, "path_trace/add", &args);
    arrive_declare(pass, last);
    frame_graph_read(pass, "path_states", ACCESS_STORAGE_READ);
    frame_graph_modify(pass, "sums_before", "sums", ACCESS_STORAGE_READ_WRITE);
    deform_read(pass);
}

static void path_trace_setup(renderer *r, void *user)
{
    if (r->settings.method != METHOD_PATH)
        return;
    if (r->settings.only == ONLY_INDIRECT_UNSHADOWED) {
        log_error("--only indirect-unshadowed: path tracing has no light without shadows; use --method lgh, vpl or ir");
        r->failed = true;
        return;
    }
    const uint64_t total = r->settings.spp, done = progressive_begin(r, total);
    if (r->failed)
        return;
    const uint64_t left = done < total ? total - done : 0;
    uint64_t count = left; // without any light all samples are known at once
    if (left > 0 && light_kinds(r) > 0) {
        const uint32_t pixels = r->settings.width * r->settings.height;
        count = layers_of(r, left);
        const path_step step = {
            .pixels = pixels,
            .count = (uint32_t)count * pixels,
            .first_sample = (uint32_t)done,
        };
        path_chains chains = chains_of(r, &step);
        start_declare(r, user, step, &chains);
        for (uint32_t vertex = 1; vertex <= bounces_of(r); vertex++)
            vertex_declare(r, user, step, &chains, vertex);
        add_declare(r, user, step);
    }
    const float factor = 1 / (float)(done + count > 0 ? done + count : 1);
    progressive_end(r, count, (float[2]){factor, factor}, true);
}

static void path_trace_fini(renderer *r, void *user)
{
    const path_trace *state = user;
    gpu_pipeline_destroy(r->gpu, state->start);
    gpu_pipeline_destroy(r->gpu, state->vertex);
    gpu_pipeline_destroy(r->gpu, state->add);
}

static gpu_pipeline pipeline_of(gpu *gpu, const gpu_shader *shader)
{
    return gpu_compute_pipeline_create(gpu, &(gpu_compute_pipeline_desc){.shader = shader});
}

bool path_trace_init(renderer *r)
{
    path_trace *state = renderer_pass_add(r, "path_trace", sizeof(path_trace), path_trace_setup, path_trace_fini);
    state->start = pipeline_of(r->gpu, &shader_path_trace_start_comp);
    state->vertex = pipeline_of(r->gpu, &shader_path_trace_vertex_comp);
    state->add = pipeline_of(r->gpu, &shader_path_trace_add_comp);
    return state->start.id && state->vertex.id && state->add.id;
}
