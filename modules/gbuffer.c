// What each pixel sees: rasterizes every primitive of every instance into depth, normals, albedo, emission and motion.
#include "modules.h"
#include "world.h"

#include <math.h>

#include "lanternfield_renderer_shaders.h"

typedef struct gbuffer_state {
    const renderer *r;
    gpu_pipeline opaque, masked;
} gbuffer_state;

// ---- Frustum culling

enum { FRUSTUM_PLANES = 5 };
typedef struct frustum { // a point p relative to the eye is inside when dot(plane.xyz, p) + plane.w >= 0 for all planes
    float planes[FRUSTUM_PLANES][4];
} frustum;

static frustum frustum_of(const frame_constants *c)
{
    frustum f = {0};
    for (int k = 0; k < 3; k++) {
        const float x = c->view_projection[4 * k], y = c->view_projection[4 * k + 1], w = c->forward[k];
        f.planes[0][k] = w + x;
        f.planes[1][k] = w - x;
        f.planes[2][k] = w + y;
        f.planes[3][k] = w - y;
        f.planes[4][k] = w;
    }
    f.planes[4][3] = -c->near_plane;
    return f;
}

static bool frustum_meets(const frustum *f, const mesh_instance_gpu *instance, const box *b, const float eye[3])
{
    float centre[3], axes[3][3]; // of the box in the world, relative to the eye; axes[k]: half of its k-th edge
    for (int row = 0; row < 3; row++) {
        const float *m = instance->world[row];
        centre[row] = m[3] - eye[row];
        for (int k = 0; k < 3; k++) {
            centre[row] += m[k] * 0.5f * (b->min[k] + b->max[k]);
            axes[k][row] = m[k] * 0.5f * (b->max[k] - b->min[k]);
        }
    }
    for (int p = 0; p < FRUSTUM_PLANES; p++) {
        const float *plane = f->planes[p];
        float reach = plane[0] * centre[0] + plane[1] * centre[1] + plane[2] * centre[2] + plane[3];
        for (int k = 0; k < 3; k++)
            reach += fabsf(plane[0] * axes[k][0] + plane[1] * axes[k][1] + plane[2] * axes[k][2]);
        if (reach < 0)
            return false;
    }
    return true;
}

// ---- Drawing

// Mirroring turns the winding around.
static VkCullModeFlags cull_of(const mesh_instance_gpu *instance, const material *m)
{
    if (m->flags & MATERIAL_DOUBLE_SIDED)
        return VK_CULL_MODE_NONE;
    return instance->mirrored ? VK_CULL_MODE_FRONT_BIT : VK_CULL_MODE_BACK_BIT;
}

static void primitive_draw(const frame_graph_context *context, const renderer *r, uint32_t instance, uint32_t primitive)
{
    const uint32_t draw[2] = {instance, primitive};
    const mesh_primitive *p = &r->scene->primitives[primitive];
    gpu_cull_set(context->commands, cull_of(&r->gpu_world->instance_data[instance], &r->scene->materials[p->material]));
    gpu_push(context->commands, draw, sizeof draw);
    gpu_draw(context->commands, p->index_count, 1, 0);
}

// Draws the primitives whose material has the alpha mask, or those that have not.
static void primitives_draw(const frame_graph_context *context, const renderer *r, bool masked)
{
    const world_gpu *w = r->gpu_world;
    const frustum f = frustum_of(&r->constants);
    for (uint32_t i = 0; i < w->instance_count; i++) {
        const mesh_instance_gpu *instance = &w->instance_data[i];
        for (uint32_t k = 0; k < instance->primitive_count; k++) {
            const uint32_t primitive = instance->first_primitive + k;
            const material *m = &r->scene->materials[r->scene->primitives[primitive].material];
            const bool matches = !!(m->flags & MATERIAL_ALPHA_MASK) == masked;
            if (matches && frustum_meets(&f, instance, &w->primitive_boxes[primitive], r->constants.eye))
                primitive_draw(context, r, i, primitive);
        }
    }
}

static void gbuffer_draw(const frame_graph_context *context, void *user)
{
    const gbuffer_state *state = user;
    frame_graph_bind(context, state->opaque);
    primitives_draw(context, state->r, false);
    frame_graph_bind(context, state->masked);
    primitives_draw(context, state->r, true);
}

// ---- The pass

enum { TARGETS = 4 };
static const struct {
    const char *name;
    VkFormat format;
} targets[TARGETS] = {
    // in the order of the fragment shader's outputs
    {"normals", VK_FORMAT_R16G16B16A16_SNORM},
    {"albedo", VK_FORMAT_R16G16B16A16_UNORM},
    {"emission", VK_FORMAT_R32G32B32A32_SFLOAT},
    {"motion", VK_FORMAT_R16G16_SFLOAT},
};

static void gbuffer_setup(renderer *r, void *user)
{
    const uint32_t width = r->settings.width, height = r->settings.height;
    const frame_graph_pass_desc desc = {
        .name = "gbuffer", .kind = FRAME_GRAPH_GRAPHICS, .execute = gbuffer_draw, .user = user};
    frame_graph_pass *pass = frame_graph_pass_add(r->graph, &desc);
    const VkClearValue zero = {0}; // depth 0 is infinitely far away
    const frame_graph_resource_desc depth = frame_graph_image_of(VK_FORMAT_D32_SFLOAT, width, height);
    frame_graph_create_cleared(pass, "depth", &depth, ACCESS_DEPTH_ATTACHMENT, zero);
    for (int i = 0; i < TARGETS; i++) {
        const frame_graph_resource_desc image = frame_graph_image_of(targets[i].format, width, height);
        frame_graph_create_cleared(pass, targets[i].name, &image, ACCESS_COLOR_ATTACHMENT, zero);
    }
}

static gpu_pipeline pipeline_of(gpu *gpu, uint32_t masked)
{
    gpu_graphics_pipeline_desc desc = {
        .vertex = &shader_gbuffer_vert,
        .fragment = &shader_gbuffer_frag,
        .constants = &masked,
        .constant_count = 1,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
        .cull_dynamic = true,
        .depth_write = true,
        .depth_compare = VK_COMPARE_OP_GREATER,
        .depth_format = VK_FORMAT_D32_SFLOAT,
        .color_count = TARGETS,
    };
    for (int i = 0; i < TARGETS; i++)
        desc.color_formats[i] = targets[i].format;
    return gpu_graphics_pipeline_create(gpu, &desc);
}

static void gbuffer_fini(renderer *r, void *user)
{
    gbuffer_state *state = user;
    gpu_pipeline_destroy(r->gpu, state->opaque);
    gpu_pipeline_destroy(r->gpu, state->masked);
}

bool gbuffer_init(renderer *r)
{
    gbuffer_state *state = renderer_pass_add(r, "gbuffer", sizeof(gbuffer_state), gbuffer_setup, gbuffer_fini);
    state->r = r;
    state->opaque = pipeline_of(r->gpu, false);
    state->masked = pipeline_of(r->gpu, true);
    return state->opaque.id && state->masked.id;
}
