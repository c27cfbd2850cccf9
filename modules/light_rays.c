// Shadow rays that carry light: see light_rays.h.
#include "light_rays.h"
#include "modules.h"
#include "rays.h"

#include "lanternfield_renderer_shaders.h"

#include <stdio.h>
#include <string.h>

typedef struct light_rays_state {
    gpu_pipeline sum;
} light_rays_state;

typedef struct sum_pass {
    gpu_pipeline pipeline;
    uint32_t width, height;
    struct {
        uint32_t layers, first;
    } push;
} sum_pass;

typedef struct resource_name {
    char text[64];
} resource_name;

// "shadow_estimates" of the first batch, "shadow/2_estimates" of the next.
static resource_name named(const light_rays *rays, uint32_t batch, const char *suffix)
{
    resource_name name;
    const int length = batch == 0 ? snprintf(name.text, sizeof name.text, "%s%s", rays->name, suffix)
                                  : snprintf(name.text, sizeof name.text, "%s/%u%s", rays->name, batch + 1, suffix);
    assert((size_t)length < sizeof name.text);
    (void)length;
    return name;
}

static uint32_t ray_count(const renderer *r, const light_rays *rays)
{
    return rays->count * r->settings.width * r->settings.height;
}

// Makes the batch that starts at layer `first` the current one.
static void batch_start(const renderer *r, light_rays *rays, uint32_t batch, uint32_t first)
{
    rays->batch = batch;
    rays->first = first;
    rays->count = rays_layers(r, rays->layers - first);
    memcpy(rays->pass, named(rays, batch, "/rays").text, sizeof rays->pass);
}

light_rays light_rays_begin(const renderer *r, const char *name, const char *sum, uint32_t layers)
{
    assert(layers > 0);
    light_rays rays = {.name = name, .layers = layers, .batches = div_up_u32(layers, rays_layers(r, layers))};
    rays.sum = (resource_chain){
        .name = sum,
        .desc = frame_graph_image_of(VK_FORMAT_R32G32B32A32_SFLOAT, r->settings.width, r->settings.height),
        .length = rays.batches,
    };
    batch_start(r, &rays, 0, 0);
    return rays;
}

// A batch takes over the buffers of the one before it, and so waits until that one is summed: there are never two.
void light_rays_make(renderer *r, const light_rays *rays, frame_graph_pass *pass)
{
    const uint32_t batch = rays->batch;
    const resource_name estimates = named(rays, batch, "_estimates");
    const frame_graph_resource_desc desc = frame_graph_buffer_of(ray_count(r, rays) * 3ull * sizeof(float));
    if (batch == 0) {
        rays_create(r, pass, rays->name, ray_count(r, rays));
        frame_graph_create_resource(pass, estimates.text, &desc, ACCESS_STORAGE_WRITE);
    } else {
        rays_modify(r, pass, named(rays, batch - 1, "").text, named(rays, batch, "").text);
        frame_graph_modify(pass, named(rays, batch - 1, "_estimates").text, estimates.text, ACCESS_STORAGE_READ_WRITE);
    }
}

static void sum_execute(const frame_graph_context *context, void *user)
{
    const sum_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->push, sizeof pass->push);
    gpu_dispatch(context->commands, div_up_u32(pass->width, PIXEL_GROUP_WIDTH), pass->height, 1);
}

static void sum_declare(renderer *r, light_rays *rays)
{
    const light_rays_state *state =
        ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "light_rays"), r->pass))->state;
    const resource_name name = named(rays, rays->batch, "/sum");
    const sum_pass args = {state->sum, r->settings.width, r->settings.height, {rays->count, rays->first}};
    const frame_graph_pass_desc desc = {
        .name = name.text,
        .kind = FRAME_GRAPH_COMPUTE,
        .execute = sum_execute,
        .user = (void *)&args,
        .user_size = sizeof args,
    };
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &desc);
    frame_graph_read(pass, named(rays, rays->batch, "_estimates").text, ACCESS_STORAGE_READ);
    frame_graph_read(pass, named(rays, rays->batch, "_visible").text, ACCESS_STORAGE_READ);
    resource_chain_next(&rays->sum, pass);
}

bool light_rays_trace(renderer *r, light_rays *rays)
{
    rays_trace(r, named(rays, rays->batch, "").text, RAYS_VISIBLE, ray_count(r, rays));
    sum_declare(r, rays);
    const uint32_t end = rays->first + rays->count;
    if (end == rays->layers)
        return false;
    batch_start(r, rays, rays->batch + 1, end);
    return true;
}

static void light_rays_setup(renderer *r, void *state)
{
    (void)r, (void)state; // only other modules add passes
}

static void light_rays_fini(renderer *r, void *state)
{
    gpu_pipeline_destroy(r->gpu, ((light_rays_state *)state)->sum);
}

bool light_rays_init(renderer *r)
{
    light_rays_state *state =
        renderer_pass_add(r, "light_rays", sizeof(light_rays_state), light_rays_setup, light_rays_fini);
    const gpu_compute_pipeline_desc desc = {.shader = &shader_light_rays_sum_comp};
    state->sum = gpu_compute_pipeline_create(r->gpu, &desc);
    return state->sum.id != 0;
}
