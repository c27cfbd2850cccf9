// Light volumes: the lighting grid hierarchy rasterised over the G-buffer (Lin and Yuksel 2019, section 3.2). Makes
// `indirect` (tiled when interleaved), `reservoirs` and, when asked, `lights_per_pixel`.
#include "modules.h"

#include "lanternfield_renderer_shaders.h"

typedef enum volume_draw { DRAW_TOP, DRAW_MIDDLE, DRAW_FIRST, DRAW_VPLS } volume_draw; // as in light_volume.glsl.h

enum { EXACT = 1, UNIFORM = 2, COUNT = 4, PAPER_BLEND = 8, VARIANTS = 16 }; // bits of a pipeline's index

typedef struct light_volume {
    gpu_pipeline depth;
    gpu_pipeline top[VARIANTS], cube[VARIANTS]; // made when first used
} light_volume;

typedef struct volume_pass {
    gpu_pipeline pipeline;
    struct {
        uint32_t draw, interleave, emission, start_level, samples, sampled;
        float singularity;
        uint32_t slot_count;
    } push;
} volume_pass;

static gpu_pipeline pipeline_of(renderer *r, light_volume *state, bool top, uint32_t variant)
{
    gpu_pipeline *pipeline = &(top ? state->top : state->cube)[variant];
    if (pipeline->id)
        return *pipeline;
    const uint32_t constants[] = {(variant & EXACT) != 0, (variant & UNIFORM) != 0, (variant & PAPER_BLEND) != 0};
    const gpu_graphics_pipeline_desc desc = {
        .vertex = top ? &shader_fullscreen_vert : &shader_light_volume_vert,
        .fragment = top ? &shader_light_volume_top_frag : &shader_light_volume_frag,
        .constants = constants,
        .constant_count = countof(constants),
        .topology = top ? VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST : VK_PRIMITIVE_TOPOLOGY_TRIANGLE_STRIP,
        .cull = top ? VK_CULL_MODE_NONE : VK_CULL_MODE_FRONT_BIT,
        // Reversed depth: a volume's back face must lie behind the surface, or the surface lies behind the volume.
        .depth_compare = top ? VK_COMPARE_OP_NEVER : VK_COMPARE_OP_LESS_OR_EQUAL,
        .color_formats = {VK_FORMAT_R32G32B32A32_SFLOAT, VK_FORMAT_R32_SFLOAT},
        .color_count = variant & COUNT ? 2 : 1,
        .blend = GPU_BLEND_ADD,
        .depth_format = top ? VK_FORMAT_UNDEFINED : VK_FORMAT_D32_SFLOAT,
    };
    return *pipeline = gpu_graphics_pipeline_create(r->gpu, &desc);
}

typedef struct clear_pass {
    VkDeviceSize size;
    uint32_t value; // exact: keys larger than any; unlocked: running sums of zero
} clear_pass;

static void execute_clear(const frame_graph_context *context, void *user)
{
    const clear_pass *pass = user;
    gpu_buffer_fill(context->commands, frame_graph_buffer(context, "reservoirs_empty"), 0, pass->size, pass->value);
}

static void execute_depth(const frame_graph_context *context, void *user)
{
    const volume_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->push.interleave, 4);
    gpu_draw(context->commands, 3, 1, 0);
}

static void execute_volumes(const frame_graph_context *context, void *user)
{
    const volume_pass *pass = user;
    frame_graph_bind(context, pass->pipeline);
    gpu_push(context->commands, &pass->push, sizeof pass->push);
    switch ((volume_draw)pass->push.draw) {
    case DRAW_TOP:
        gpu_draw(context->commands, 3, 1, 0);
        break;
    case DRAW_MIDDLE:
        gpu_draw_indirect(context->commands, frame_graph_buffer(context, "lgh_header"),
                          offsetof(lgh_header, volume_draw));
        break;
    case DRAW_FIRST:
        gpu_draw_indirect(context->commands, frame_graph_buffer(context, "lgh_header"),
                          offsetof(lgh_header, volume_first_draw));
        break;
    case DRAW_VPLS:
        gpu_draw(context->commands, 14, pass->push.slot_count, 0);
        break;
    }
}

static uint32_t samples_of(const renderer *r)
{
    return renderer_has_shadows(r) ? r->settings.shadow_samples : 0;
}

static VkDeviceSize reservoirs_size(const renderer *r)
{
    const VkDeviceSize pixels = (VkDeviceSize)r->settings.width * r->settings.height, samples = samples_of(r);
    if (samples == 0)
        return 16;
    return r->settings.reservoirs == RESERVOIRS_EXACT ? pixels * samples * 8 : pixels * (samples + 1) * 4;
}

static void declare_clear(renderer *r)
{
    clear_pass pass = {reservoirs_size(r), r->settings.reservoirs == RESERVOIRS_EXACT ? UINT32_MAX : 0};
    const frame_graph_pass_desc desc = {.name = "light_volume/clear",
                                        .kind = FRAME_GRAPH_TRANSFER,
                                        .execute = execute_clear,
                                        .user = &pass,
                                        .user_size = sizeof pass};
    const frame_graph_resource_desc buffer = frame_graph_buffer_of(pass.size);
    frame_graph_create_resource(frame_graph_pass_add(r->graph, &desc), "reservoirs_empty", &buffer,
                                ACCESS_TRANSFER_WRITE);
}

// Size of the tiled layout: whole tiles (shaders/interleave.glsl.h).
static frame_graph_resource_desc tiled_image(const render_settings *s, VkFormat format)
{
    const uint32_t n = s->interleave;
    return frame_graph_image_of(format, n * div_up_u32(s->width, n), n * div_up_u32(s->height, n));
}

static frame_graph_pass *add_pass(renderer *r, const char *name, void (*execute)(const frame_graph_context *, void *),
                                  volume_pass *pass)
{
    return frame_graph_pass_add(
        r->graph,
        &(frame_graph_pass_desc){
            .name = name, .kind = FRAME_GRAPH_GRAPHICS, .execute = execute, .user = pass, .user_size = sizeof *pass});
}

static void declare_depth(renderer *r, const light_volume *state)
{
    volume_pass pass = {.pipeline = state->depth, .push.interleave = r->settings.interleave};
    frame_graph_pass *p = add_pass(r, "light_volume/depth", execute_depth, &pass);
    frame_graph_read(p, "depth", ACCESS_SAMPLED);
    const frame_graph_resource_desc depth = tiled_image(&r->settings, VK_FORMAT_D32_SFLOAT);
    frame_graph_create_resource(p, "depth_tiled", &depth, ACCESS_DEPTH_ATTACHMENT);
}

// What each draw makes from what the one before it made.
typedef struct volume_step {
    const char *name;
    const char *indirect, *reservoirs, *count; // made; the last draw's go by their plain names
} volume_step;
static const volume_step volume_steps[] = {
    [DRAW_TOP] = {"light_volume/top", "indirect_top", "reservoirs_top", "lights_per_pixel_top"},
    [DRAW_MIDDLE] = {"light_volume/middle", "indirect_middle", "reservoirs_middle", "lights_per_pixel_middle"},
    [DRAW_FIRST] = {"light_volume/s1", "indirect_first", "reservoirs_first", "lights_per_pixel_first"},
    [DRAW_VPLS] = {"light_volume/s0", "indirect_vpls", "reservoirs_vpls", "lights_per_pixel_vpls"},
};

static void declare_targets(frame_graph_pass *p, const renderer *r, volume_draw draw, bool last)
{
    const volume_step *step = &volume_steps[draw], *before = draw == DRAW_TOP ? NULL : &volume_steps[draw - 1];
    const char *indirect = last ? "indirect" : step->indirect, *count = last ? "lights_per_pixel" : step->count;
    if (before) {
        frame_graph_modify(p, before->indirect, indirect, ACCESS_COLOR_ATTACHMENT);
        if (r->count_lights)
            frame_graph_modify(p, before->count, count, ACCESS_COLOR_ATTACHMENT);
        return;
    }
    const frame_graph_resource_desc light = tiled_image(&r->settings, VK_FORMAT_R32G32B32A32_SFLOAT);
    frame_graph_create_cleared(p, indirect, &light, ACCESS_COLOR_ATTACHMENT, (VkClearValue){0});
    const frame_graph_resource_desc number = tiled_image(&r->settings, VK_FORMAT_R32_SFLOAT);
    if (r->count_lights)
        frame_graph_create_cleared(p, count, &number, ACCESS_COLOR_ATTACHMENT, (VkClearValue){0});
}

static void declare_volumes(renderer *r, light_volume *state, volume_draw draw, bool last)
{
    const render_settings *s = &r->settings;
    const bool tiled = s->interleave > 1, top = draw == DRAW_TOP, lowest = draw >= DRAW_FIRST;
    const uint32_t variant = (s->reservoirs == RESERVOIRS_EXACT ? EXACT : 0) |
                             (s->sampling == SAMPLING_UNIFORM ? UNIFORM : 0) | (r->count_lights ? COUNT : 0) |
                             (s->blend == BLEND_PAPER ? PAPER_BLEND : 0);
    volume_pass pass = {
        .pipeline = pipeline_of(r, state, top, variant),
        .push = {draw, s->interleave, s->emission, s->start_level, samples_of(r), lowest && !s->sample_s1 ? 2 : 1,
                 renderer_singularity(r), renderer_slots(r)},
    };
    frame_graph_pass *p = add_pass(r, volume_steps[draw].name, execute_volumes, &pass);
    frame_graph_read(p, "lgh_header", ACCESS_STORAGE_READ);
    frame_graph_read(p, "lgh_lights", ACCESS_STORAGE_READ);
    frame_graph_read(p, "vpls", ACCESS_STORAGE_READ);
    frame_graph_read(p, "depth", top || tiled ? ACCESS_SAMPLED : ACCESS_DEPTH_TEST_SAMPLED);
    frame_graph_read(p, "normals", ACCESS_SAMPLED);
    frame_graph_modify(p, top ? "reservoirs_empty" : volume_steps[draw - 1].reservoirs,
                       last ? "reservoirs" : volume_steps[draw].reservoirs, ACCESS_STORAGE_READ_WRITE);
    declare_targets(p, r, draw, last);
    if (!top && tiled)
        frame_graph_read(p, "depth_tiled", ACCESS_DEPTH_TEST);
    if (!top)
        frame_graph_read(p, "lgh_header", ACCESS_INDIRECT);
}

static void light_volume_setup(renderer *r, void *state)
{
    if (!renderer_has_indirect(r) || r->settings.lighting != LIGHTING_VOLUMES)
        return;
    declare_clear(r);
    if (r->settings.interleave > 1)
        declare_depth(r, state);
    const volume_draw last = r->settings.start_level == 0 ? DRAW_VPLS : DRAW_FIRST;
    for (volume_draw draw = DRAW_TOP; draw <= last; draw++)
        declare_volumes(r, state, draw, draw == last);
}

static void light_volume_fini(renderer *r, void *state)
{
    const light_volume *v = state;
    gpu_pipeline_destroy(r->gpu, v->depth);
    for (uint32_t i = 0; i < VARIANTS; i++) {
        gpu_pipeline_destroy(r->gpu, v->top[i]);
        gpu_pipeline_destroy(r->gpu, v->cube[i]);
    }
}

bool light_volume_init(renderer *r)
{
    light_volume *state = renderer_pass_add(r, "light_volume", sizeof *state, light_volume_setup, light_volume_fini);
    const gpu_graphics_pipeline_desc depth = {
        .vertex = &shader_fullscreen_vert,
        .fragment = &shader_light_volume_depth_frag,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
        .depth_write = true,
        .depth_compare = VK_COMPARE_OP_ALWAYS,
        .depth_format = VK_FORMAT_D32_SFLOAT,
    };
    state->depth = gpu_graphics_pipeline_create(r->gpu, &depth);
    return state->depth.id != 0;
}
