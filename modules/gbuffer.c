// What each pixel sees: rasterizes every primitive of every instance into depth, normals, albedo, emission and motion.
#include "clusters.h"
#include "deform.h"
#include "modules.h"
#include "world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lanternfield_renderer_shaders.h"

// What a draw's shading needs, a bit each: the constants of shaders/gbuffer_draw.glsl.h in their order.
enum {
    ALPHA_MASK = 1 << 0,
    BASE_TEXTURE = 1 << 1,
    EMISSIVE_TEXTURE = 1 << 2,
    NORMAL_TEXTURE = 1 << 3,
    VERTEX_COLORS = 1 << 4,
    MOVES = 1 << 5,
    DEFORMS = 1 << 6,
    NEEDS = 7
};

typedef struct primitive_draws { // of one primitive, whatever its instances
    uint32_t needs; // without MOVES and DEFORMS
    uint32_t first_cluster;
} primitive_draws;

// A primitive of an instance that may be seen.
typedef struct draw {
    uint32_t needs;
    float distance; // metres, from the eye to its box
    uint32_t instance, primitive;
} draw;

typedef struct gbuffer_state {
    const renderer *r;
    gpu_pipeline pipelines[1 << NEEDS]; // made when first needed
    gpu_buffer corners; // uint32 each, parallel to the scene's indices: see corners_order
    cluster *clusters;
    primitive_draws *primitives;
    draw *draws; // this frame's, in their order
    size_t draw_capacity;
    uint32_t draw_count;
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

// A box of an instance in the world, relative to the eye.
typedef struct placed_box {
    float centre[3], axes[3][3]; // axes[k]: half of its k-th edge
} placed_box;

static placed_box box_place(const mesh_instance_gpu *instance, const box *b, const float eye[3])
{
    placed_box placed;
    for (int row = 0; row < 3; row++) {
        const float *m = instance->world[row];
        placed.centre[row] = m[3] - eye[row];
        for (int k = 0; k < 3; k++) {
            placed.centre[row] += m[k] * 0.5f * (b->min[k] + b->max[k]);
            placed.axes[k][row] = m[k] * 0.5f * (b->max[k] - b->min[k]);
        }
    }
    return placed;
}

static bool frustum_meets(const frustum *f, const placed_box *b)
{
    for (int p = 0; p < FRUSTUM_PLANES; p++) {
        const float *plane = f->planes[p];
        float reach = plane[0] * b->centre[0] + plane[1] * b->centre[1] + plane[2] * b->centre[2] + plane[3];
        for (int k = 0; k < 3; k++)
            reach += fabsf(plane[0] * b->axes[k][0] + plane[1] * b->axes[k][1] + plane[2] * b->axes[k][2]);
        if (reach < 0)
            return false;
    }
    return true;
}

// From the eye to the box around it along the world's axes; 0 inside.
static float box_distance(const placed_box *b)
{
    float square = 0;
    for (int row = 0; row < 3; row++) {
        const float reach = fabsf(b->axes[0][row]) + fabsf(b->axes[1][row]) + fabsf(b->axes[2][row]);
        const float outside = fmaxf(fabsf(b->centre[row]) - reach, 0);
        square += outside * outside;
    }
    return sqrtf(square);
}

// ---- Drawing

// Mirroring turns the winding around.
static VkCullModeFlags cull_of(const mesh_instance_gpu *instance, const material *m)
{
    if (m->flags & MATERIAL_DOUBLE_SIDED)
        return VK_CULL_MODE_NONE;
    return instance->mirrored ? VK_CULL_MODE_FRONT_BIT : VK_CULL_MODE_BACK_BIT;
}

// The eye in mesh space. In double: instances may be far away and scaled to little.
static void eye_of(const mesh_instance_gpu *instance, const float eye[3], float out[3])
{
    double m[3][3], cofactors[3][3], offset[3], determinant = 0;
    for (int row = 0; row < 3; row++) {
        for (int k = 0; k < 3; k++)
            m[row][k] = (double)instance->world[row][k];
        offset[row] = (double)eye[row] - (double)instance->world[row][3];
    }
    for (int row = 0; row < 3; row++) {
        const double *p = m[(row + 1) % 3], *q = m[(row + 2) % 3];
        for (int k = 0; k < 3; k++)
            cofactors[row][k] = p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3];
    }
    for (int k = 0; k < 3; k++)
        determinant += m[0][k] * cofactors[0][k];
    for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int row = 0; row < 3; row++)
            sum += cofactors[row][k] * offset[row];
        out[k] = (float)(sum / determinant);
    }
}

typedef struct view { // of one instance
    frustum frustum;
    const mesh_instance_gpu *instance;
    const float *eye; // world
    float mesh_eye[3];
} view;

static bool cluster_is_seen(const view *v, const cluster *c, bool two_sided)
{
    const placed_box placed = box_place(v->instance, &c->bounds, v->eye);
    return (two_sided || !cluster_faces_away(c, v->mesh_eye)) && frustum_meets(&v->frustum, &placed);
}

// Draws the clusters that can be seen, neighbours in one draw.
static void clusters_draw(const frame_graph_context *context, const gbuffer_state *state, const view *v,
                          uint32_t primitive, bool two_sided)
{
    enum { STEP = 3 * CLUSTER_TRIANGLES };
    const mesh_primitive *p = &state->r->scene->primitives[primitive];
    const cluster *clusters = state->clusters + state->primitives[primitive].first_cluster;
    for (uint32_t first = 0, end = 0; first < p->index_count; first = end + STEP) {
        for (end = first; end < p->index_count && cluster_is_seen(v, &clusters[end / STEP], two_sided);)
            end += STEP;
        if (end > first)
            gpu_draw_indexed(context->commands, state->corners, p->first_index + first,
                             min_u32(end, p->index_count) - first);
    }
}

// Of what deforms: the clusters know it at rest only.
static void primitive_draw(const frame_graph_context *context, const gbuffer_state *state, uint32_t primitive)
{
    const mesh_primitive *p = &state->r->scene->primitives[primitive];
    gpu_draw_indexed(context->commands, state->corners, p->first_index, p->index_count);
}

static bool instance_moves(const frame_constants *c, const mesh_instance_gpu *instance)
{
    return memcmp(instance->world, instance->previous_world, sizeof instance->world) != 0 ||
           memcmp(c->view_projection, c->previous_view_projection, sizeof c->view_projection) != 0 ||
           memcmp(c->eye, c->previous_eye, sizeof c->eye) != 0;
}

static uint32_t motion_needs(const frame_constants *c, const mesh_instance_gpu *instance)
{
    if (instance->previous_vertex != PREVIOUS_SAME)
        return MOVES | DEFORMS;
    return instance_moves(c, instance) ? MOVES : 0;
}

static int draw_compare(const void *left, const void *right)
{
    const draw *a = left, *b = right;
    if (a->needs != b->needs) // the mask's bit is the lowest, but masked draws come last: they write depth late
        return (a->needs & ALPHA_MASK) != (b->needs & ALPHA_MASK) ? (a->needs & ALPHA_MASK ? 1 : -1)
               : a->needs < b->needs                              ? -1
                                                                  : 1;
    if (a->distance != b->distance)
        return a->distance < b->distance ? -1 : 1;
    return a->instance != b->instance ? (a->instance < b->instance ? -1 : 1)
                                      : (a->primitive > b->primitive) - (a->primitive < b->primitive);
}

// Lists what meets the view: by pipeline, then from near to far, so that little is shaded that is hidden later.
static void draws_list(gbuffer_state *state)
{
    const renderer *r = state->r;
    const world_gpu *w = r->gpu_world;
    const frustum f = frustum_of(&r->constants);
    state->draw_count = 0;
    for (uint32_t i = 0; i < w->instance_count; i++) {
        const mesh_instance_gpu *instance = &w->instance_data[i];
        const uint32_t moves = motion_needs(&r->constants, instance);
        for (uint32_t k = 0; k < instance->primitive_count; k++) {
            const uint32_t primitive = instance->first_primitive + k;
            const placed_box b = box_place(instance, &w->primitive_boxes[primitive], r->constants.eye);
            if (!frustum_meets(&f, &b))
                continue;
            memory_reserve((void **)&state->draws, &state->draw_capacity, state->draw_count + 1, sizeof *state->draws);
            state->draws[state->draw_count++] =
                (draw){state->primitives[primitive].needs | moves, box_distance(&b), i, primitive};
        }
    }
    qsort(state->draws, state->draw_count, sizeof *state->draws, draw_compare);
}

static void gbuffer_draw(const frame_graph_context *context, void *user)
{
    const gbuffer_state *state = user;
    const renderer *r = state->r;
    view v = {.frustum = frustum_of(&r->constants), .eye = r->constants.eye};
    for (uint32_t i = 0; i < state->draw_count; i++) {
        const draw *d = &state->draws[i];
        if (i == 0 || d->needs != d[-1].needs)
            frame_graph_bind(context, state->pipelines[d->needs]);
        const material *m = &r->scene->materials[r->scene->primitives[d->primitive].material];
        const uint32_t push[] = {d->instance, d->primitive, world_identity(r->gpu_world->order[d->instance].entity)};
        v.instance = &r->gpu_world->instance_data[d->instance];
        eye_of(v.instance, v.eye, v.mesh_eye);
        gpu_cull_set(context->commands, cull_of(v.instance, m));
        gpu_push(context->commands, push, sizeof push);
        if (world_deformation_of(r, v.instance->mesh))
            primitive_draw(context, state, d->primitive);
        else
            clusters_draw(context, state, &v, d->primitive, m->flags & MATERIAL_DOUBLE_SIDED);
    }
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

static gpu_pipeline pipeline_of(gpu *gpu, uint32_t needs)
{
    uint32_t constants[NEEDS];
    for (uint32_t i = 0; i < NEEDS; i++)
        constants[i] = needs >> i & 1;
    gpu_graphics_pipeline_desc desc = {
        .vertex = &shader_gbuffer_vert,
        .fragment = &shader_gbuffer_frag,
        .constants = constants,
        .constant_count = NEEDS,
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

static bool pipelines_require(gbuffer_state *state)
{
    for (uint32_t i = 0; i < state->draw_count; i++) {
        gpu_pipeline *pipeline = &state->pipelines[state->draws[i].needs];
        if (!pipeline->id)
            *pipeline = pipeline_of(state->r->gpu, state->draws[i].needs);
        if (!pipeline->id)
            return false;
    }
    return true;
}

static void gbuffer_setup(renderer *r, void *user)
{
    gbuffer_state *state = user;
    draws_list(state);
    if (!pipelines_require(state)) {
        r->failed = true;
        return;
    }
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
    deform_read(pass);
}

static uint32_t needs_of(const scene_data *s, const mesh_primitive *p)
{
    const material *m = &s->materials[p->material];
    uint32_t needs = m->flags & MATERIAL_ALPHA_MASK ? ALPHA_MASK : 0;
    needs |= m->base_texture.texture != TEXTURE_NONE ? BASE_TEXTURE : 0;
    needs |= m->emissive_texture.texture != TEXTURE_NONE ? EMISSIVE_TEXTURE : 0;
    needs |= m->normal_texture.texture != TEXTURE_NONE ? NORMAL_TEXTURE : 0;
    for (uint32_t i = 0; i < p->vertex_count; i++) {
        const vertex_attributes *vertex = &s->attributes[p->first_vertex + i];
        needs |= (vertex->color_rg & vertex->color_ba) != UINT32_MAX ? VERTEX_COLORS : 0;
    }
    return needs;
}

static bool clusters_create(gbuffer_state *state)
{
    const scene_data *s = state->r->scene;
    uint32_t count = 0;
    state->primitives = memory_alloc(max_u32(s->primitive_count, 1) * sizeof *state->primitives);
    for (uint32_t i = 0; i < s->primitive_count; i++) {
        state->primitives[i] = (primitive_draws){needs_of(s, &s->primitives[i]), count};
        count += div_up_u32(s->primitives[i].index_count, 3 * CLUSTER_TRIANGLES);
    }
    state->clusters = memory_alloc(max_u32(count, 1) * sizeof *state->clusters);
    uint32_t *corners = memory_alloc(max_u32(s->index_count, 1) * sizeof *corners);
    for (uint32_t i = 0; i < s->primitive_count; i++) {
        const mesh_primitive *p = &s->primitives[i];
        const uint32_t *indices = s->indices + p->first_index;
        clusters_make(indices, p->index_count, (const float(*)[3])s->positions + p->first_vertex, p->vertex_count,
                      state->clusters + state->primitives[i].first_cluster);
        corners_order(indices, p->index_count, p->vertex_count, corners + p->first_index);
    }
    const gpu_buffer_desc desc = {
        .name = "corners",
        .size = s->index_count * sizeof *corners,
        .usage = VK_BUFFER_USAGE_INDEX_BUFFER_BIT,
        .data = s->index_count ? corners : NULL,
    };
    state->corners = gpu_buffer_create(state->r->gpu, &desc);
    free(corners);
    return state->corners.id != 0;
}

static void gbuffer_fini(renderer *r, void *user)
{
    gbuffer_state *state = user;
    for (size_t i = 0; i < countof(state->pipelines); i++)
        gpu_pipeline_destroy(r->gpu, state->pipelines[i]);
    gpu_buffer_destroy(r->gpu, state->corners);
    free(state->clusters);
    free(state->primitives);
    free(state->draws);
}

bool gbuffer_init(renderer *r)
{
    gbuffer_state *state = renderer_pass_add(r, "gbuffer", sizeof(gbuffer_state), gbuffer_setup, gbuffer_fini);
    state->r = r;
    return clusters_create(state);
}
