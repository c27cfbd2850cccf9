// Puts the parts of the light together: radiance, and the direct and indirect parts of it as images of their own.
#include "modules.h"
#include "world.h"

#include "lanternfield_renderer_shaders.h"

typedef struct composite_state {
    const renderer *r;
    gpu_pipeline pipeline;
    gpu_image black, white;
} composite_state;

enum { PART_EMISSION = 1, PART_DIRECT = 2, PART_INDIRECT = 4, PART_INDIRECT_SHADOWS = 8 };

static uint32_t parts_of_radiance(render_only only)
{
    switch (only) {
    case ONLY_ALL:
        return PART_EMISSION | PART_DIRECT | PART_INDIRECT | PART_INDIRECT_SHADOWS;
    case ONLY_DIRECT:
        return PART_EMISSION | PART_DIRECT;
    case ONLY_INDIRECT:
        return PART_INDIRECT | PART_INDIRECT_SHADOWS;
    case ONLY_INDIRECT_UNSHADOWED:
        return PART_INDIRECT;
    }
    return 0;
}

static void composite_run(const frame_graph_context *context, void *user)
{
    const composite_state *state = user;
    const render_settings *settings = &state->r->settings;
    frame_graph_bind(context, state->pipeline);
    gpu_dispatch(context->commands, div_up_u32(settings->width, PIXEL_GROUP_WIDTH), settings->height, 1);
}

static bool has_emission(const renderer *r)
{
    for (uint32_t i = 0; i < r->scene->material_count; i++)
        if (world_material_emits(r, i))
            return true;
    return false;
}

// One pass that makes the image `target` of the given parts; what is left out or absent is read as black, absent ratios
// as white.
static void composite_declare(renderer *r, composite_state *state, const char *name, const char *target, uint32_t parts)
{
    const frame_graph_pass_desc desc = {
        .name = name, .kind = FRAME_GRAPH_COMPUTE, .execute = composite_run, .user = state};
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &desc);
    const bool direct = parts & PART_DIRECT, indirect = parts & PART_INDIRECT;
    const bool shadows = parts & PART_INDIRECT_SHADOWS;
    const bool steadied = shadows && renderer_has_shadows(r) && r->settings.taa && r->settings.taa_target == TAA_LIGHT;
    const char *const uses[] = {
        "albedo",
        parts & PART_EMISSION && has_emission(r) ? "emission" : "black",
        direct ? "direct|black" : "black",
        direct ? "direct_analytic|direct_u_filtered|direct_u|black" : "black",
        direct ? "direct_ratio|direct_ratio_now|white" : "white",
        steadied   ? "shadow_steadied"
        : indirect ? "indirect_gathered|indirect|black"
                   : "black",
        shadows && !steadied ? "shadow_ratio|shadow_ratio_now|white" : "white",
    };
    for (size_t i = 0; i < countof(uses); i++)
        frame_graph_read(pass, uses[i], ACCESS_SAMPLED);
    const frame_graph_resource_desc image =
        frame_graph_image_of(VK_FORMAT_R32G32B32A32_SFLOAT, r->settings.width, r->settings.height);
    frame_graph_create_resource(pass, target, &image, ACCESS_STORAGE_WRITE);
}

static void composite_setup(renderer *r, void *user)
{
    composite_state *state = user;
    frame_graph_import_image(r->graph, "black", state->black, ACCESS_SAMPLED, ACCESS_SAMPLED);
    frame_graph_import_image(r->graph, "white", state->white, ACCESS_SAMPLED, ACCESS_SAMPLED);
    if (r->settings.method != METHOD_LGH)
        return; // progressive makes the picture
    const uint32_t parts = parts_of_radiance(r->settings.only);
    composite_declare(r, state, "composite", "radiance", parts);
    composite_declare(r, state, "composite/aov_direct", "aov_direct", parts & PART_DIRECT);
    composite_declare(r, state, "composite/aov_indirect", "aov_indirect",
                      parts & (PART_INDIRECT | PART_INDIRECT_SHADOWS));
}

static void composite_fini(renderer *r, void *user)
{
    composite_state *state = user;
    gpu_pipeline_destroy(r->gpu, state->pipeline);
    gpu_image_destroy(r->gpu, state->black);
    gpu_image_destroy(r->gpu, state->white);
}

static gpu_image one_texel(gpu *gpu, const char *name, uint32_t rgba)
{
    const gpu_image_desc desc = {
        .name = name,
        .format = VK_FORMAT_R8G8B8A8_UNORM,
        .width = 1,
        .height = 1,
        .usage = VK_IMAGE_USAGE_SAMPLED_BIT,
        .data = &rgba,
    };
    return gpu_image_create(gpu, &desc);
}

bool composite_init(renderer *r)
{
    composite_state *state =
        renderer_pass_add(r, "composite", sizeof(composite_state), composite_setup, composite_fini);
    state->r = r;
    const gpu_compute_pipeline_desc desc = {.shader = &shader_composite_comp};
    state->pipeline = gpu_compute_pipeline_create(r->gpu, &desc);
    state->black = one_texel(r->gpu, "black", 0);
    state->white = one_texel(r->gpu, "white", 0xffffffff);
    return state->pipeline.id && state->black.id && state->white.id;
}
