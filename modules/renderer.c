// The frame: cameras and frame constants, pass entities, and the system that declares and runs the frame graph.
#include "renderer.h"
#include "modules.h"
#include "world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CGLM_FORCE_DEPTH_ZERO_TO_ONE
#include <cglm/cglm.h>

// ---- Cameras

// Far enough away for the whole bounding sphere to be in view, from the front, a little above and to the right.
static render_camera camera_of_bounds(const renderer *r)
{
    const scene_data *scene = r->scene;
    const float yfov = 0.8f;
    render_camera camera = {.up = {0, 1, 0}, .yfov = yfov};
    float diagonal[3];
    for (int k = 0; k < 3; k++) {
        camera.target[k] = 0.5f * (scene->bounds_min[k] + scene->bounds_max[k]);
        diagonal[k] = 0.5f * (scene->bounds_max[k] - scene->bounds_min[k]);
    }
    const float length = glm_vec3_norm(diagonal);
    const float radius = length > 0 ? length : 1;
    const float aspect = (float)r->settings.width / (float)r->settings.height;
    const float half_angle = aspect < 1 ? atanf(tanf(0.5f * yfov) * aspect) : 0.5f * yfov;
    const float distance = radius / sinf(half_angle);
    float direction[3] = {0.4f, 0.35f, 1};
    glm_vec3_normalize(direction);
    for (int k = 0; k < 3; k++)
        camera.eye[k] = camera.target[k] + distance * direction[k];
    camera.near_plane = 1e-3f * radius;
    return camera;
}

static const float *node_local(const renderer *r, uint32_t node)
{
    const node_component *component = ecs_get(r->world, r->gpu_world->node_entities[node], r->gpu_world->node);
    return component ? component->matrix : r->scene->nodes[node].matrix;
}

// Where the scene's node stands by the node components of it and its parents: before the transforms of the next frame
// are made. As the loader multiplies them, so that a node that nothing moved is where the loader put it.
static void node_world(const renderer *r, uint32_t node, float world[16])
{
    const scene_node *nodes = r->scene->nodes;
    uint32_t depth = 0;
    for (uint32_t i = node; i != SCENE_NONE; i = nodes[i].parent)
        depth++;
    uint32_t *chain = memory_alloc(depth * sizeof *chain); // from the root
    for (uint32_t i = node, k = depth; i != SCENE_NONE; i = nodes[i].parent)
        chain[--k] = i;
    memcpy(world, node_local(r, chain[0]), 16 * sizeof(float));
    for (uint32_t k = 1; k < depth; k++) {
        float parent[16];
        memcpy(parent, world, sizeof parent);
        scene_matrix_multiply(parent, node_local(r, chain[k]), world);
    }
    free(chain);
}

render_camera renderer_camera_of_scene(const renderer *r, uint32_t index)
{
    if (index == SCENE_NONE)
        return camera_of_bounds(r);
    assert(index < r->scene->camera_count);
    const scene_camera *source = &r->scene->cameras[index];
    float world[16];
    node_world(r, source->node, world);
    render_camera camera = {.yfov = source->yfov, .near_plane = source->near_plane};
    for (int k = 0; k < 3; k++) {
        camera.eye[k] = world[12 + k];
        camera.target[k] = world[12 + k] - world[8 + k];
        camera.up[k] = world[4 + k];
    }
    return camera;
}

// Unit axes of the camera. An `up` along the line of sight is replaced by the world axis furthest from it.
static void camera_axes(const render_camera *camera, float right[3], float up[3], float forward[3])
{
    glm_vec3_sub((float *)camera->target, (float *)camera->eye, forward);
    glm_vec3_normalize(forward);
    glm_vec3_cross(forward, (float *)camera->up, right);
    if (glm_vec3_norm(right) < 1e-6f * glm_vec3_norm((float *)camera->up)) {
        const bool upright = fabsf(forward[1]) > 0.5f;
        glm_vec3_cross(forward, (float[3]){0, !upright, upright}, right);
    }
    glm_vec3_normalize(right);
    glm_vec3_cross(right, forward, up);
}

// Rows: right / tan(fov_x / 2), -up / tan(fov_y / 2) (pixel row 0 is the top), (0, 0, 0, near), forward.
static void view_projection_make(const frame_constants *c, float matrix[16])
{
    const float right_square = glm_vec3_norm2((float *)c->right), up_square = glm_vec3_norm2((float *)c->up);
    memset(matrix, 0, 16 * sizeof(float));
    for (int k = 0; k < 3; k++) {
        matrix[4 * k + 0] = c->right[k] / right_square;
        matrix[4 * k + 1] = -c->up[k] / up_square;
        matrix[4 * k + 3] = c->forward[k];
    }
    for (int row = 0; row < 4; row++)
        matrix[12 + row] = -(matrix[row] * c->eye[0] + matrix[4 + row] * c->eye[1] + matrix[8 + row] * c->eye[2]);
    matrix[14] = c->near_plane;
}

static void camera_constants(renderer *r)
{
    frame_constants *c = &r->constants;
    const float tangent_y = tanf(0.5f * r->camera.yfov);
    const float tangent_x = tangent_y * (float)r->settings.width / (float)r->settings.height;
    camera_axes(&r->camera, c->right, c->up, c->forward);
    glm_vec3_scale(c->right, tangent_x, c->right);
    glm_vec3_scale(c->up, tangent_y, c->up);
    memcpy(c->eye, r->camera.eye, sizeof c->eye);
    c->near_plane = r->camera.near_plane;
    view_projection_make(c, c->view_projection);
}

static void previous_constants(frame_constants *c, const frame_constants *last)
{
    memcpy(c->previous_view_projection, last->view_projection, sizeof c->previous_view_projection);
    memcpy(c->previous_eye, last->eye, sizeof c->previous_eye);
    memcpy(c->previous_forward, last->forward, sizeof c->previous_forward);
    memcpy(c->previous_right, last->right, sizeof c->previous_right);
    memcpy(c->previous_up, last->up, sizeof c->previous_up);
}

// ---- What stays as it is

// Whether light and surfaces are those of the last frame, and are to be rendered as they were.
static bool frame_is_steady(const renderer *r)
{
    return !world_has_changed(r->gpu_world) && settings_equal(&r->settings, &r->last_settings);
}

// Whether nothing differs from the last frame but the random numbers.
static bool frame_is_still(const renderer *r)
{
    const frame_constants *c = &r->constants;
    return r->frame > 0 && frame_graph_has_history(r->graph, "depth") && frame_is_steady(r) &&
           memcmp(c->view_projection, c->previous_view_projection, 64) == 0 &&
           memcmp(c->eye, c->previous_eye, sizeof c->eye) == 0;
}

bool renderer_is_settled(const renderer *r)
{
    const render_settings *s = &r->settings;
    const float budget = s->ray_budget > 0 ? fminf(s->ray_budget, 1) : 1;
    return s->filter && (float)r->still_frames * budget >= STILL_SAMPLES;
}

// ---- Systems

// After the world's extraction, which has filled in bounds and the numbers of lights.
static void constants_extract(ecs_world *world, void *user)
{
    (void)world;
    renderer *r = user;
    frame_constants *c = &r->constants;
    const frame_constants last = *c;
    camera_constants(r);
    previous_constants(c, last.width == 0 ? c : &last); // a loaded state's first frame has no last one
    c->width = r->settings.width;
    c->height = r->settings.height;
    c->frame = r->frame;
    c->seed = r->settings.seed;
    c->auto_exposure = r->settings.auto_exposure;
    c->exposure_ev = r->settings.exposure;
    r->still_frames = frame_is_still(r) ? r->still_frames + 1 : 0;
    r->steady_frames = r->frame == 0 ? STILL_SAMPLES : frame_is_steady(r) ? r->steady_frames + 1 : 0;
    r->last_settings = r->settings;
    memcpy(gpu_buffer_map(r->gpu, r->gpu_world->frame), c, sizeof *c);
}

static void frame_render(ecs_world *world, void *user)
{
    renderer *r = user;
    if (r->failed)
        return;
    frame_graph_begin(r->graph);
    for (ecs_iterator it = ecs_iterate(world, r->pass); ecs_next(&it);) {
        const render_pass pass = *(render_pass *)it.component;
        pass.setup(r, pass.state);
    }
    if (r->failed)
        return;
    frame_graph_export(r->graph, "radiance", ACCESS_TRANSFER_READ);
    frame_graph_export(r->graph, "display", ACCESS_TRANSFER_READ);
    for (uint32_t i = 0; i < r->export_count; i++)
        frame_graph_export(r->graph, r->exports[i], ACCESS_TRANSFER_READ);
    r->failed |= !frame_graph_execute(r->graph);
}

// ---- Passes

typedef struct pass_state {
    const char *name;
    void *state;
    void (*fini)(renderer *r, void *state);
} pass_state;

static void pass_state_fini(void *component, void *user)
{
    pass_state *pass = component;
    if (pass->fini)
        pass->fini(user, pass->state);
    free(pass->state);
}

void *renderer_pass_add(renderer *r, const char *name, size_t state_size, void (*setup)(renderer *r, void *state),
                        void (*fini)(renderer *r, void *state))
{
    assert(!renderer_pass_find(r, name).id && "a pass of this name exists");
    const entity e = ecs_entity_create(r->world);
    void *state = memory_alloc(state_size ? state_size : 1);
    *(pass_state *)ecs_add(r->world, e, r->pass_state) = (pass_state){name, state, fini};
    *(render_pass *)ecs_add(r->world, e, r->pass) = (render_pass){name, setup, state};
    return state;
}

uint32_t renderer_entity_key(const renderer *r, entity e)
{
    enum { INDEX_MASK = 0xfffff };
    ecs_iterator it = ecs_iterate(r->world, r->pass_state); // the first pass is the oldest
    const bool is_later = ecs_next(&it) && (e.id & INDEX_MASK) > (it.entity.id & INDEX_MASK);
    ecs_iterate_end(&it);
    return is_later ? e.id - (uint32_t)ecs_count(r->world, r->pass_state) : e.id;
}

entity renderer_pass_find(const renderer *r, const char *name)
{
    for (ecs_iterator it = ecs_iterate(r->world, r->pass_state); ecs_next(&it);) {
        if (strcmp(((pass_state *)it.component)->name, name) == 0) {
            const entity found = it.entity;
            ecs_iterate_end(&it);
            return found;
        }
    }
    return (entity){0};
}

uint32_t renderer_vpl_slots(const renderer *r)
{
    return r->settings.method == METHOD_IR ? r->settings.ir_vpls : r->settings.vpls;
}

bool renderer_has_vpls(const renderer *r)
{
    return r->settings.method != METHOD_PATH && r->settings.only != ONLY_DIRECT && renderer_vpl_slots(r) > 0 &&
           r->gpu_world->light_power > 0 && r->gpu_world->instance_count > 0;
}

bool renderer_has_indirect(const renderer *r)
{
    return r->settings.method == METHOD_LGH && renderer_has_vpls(r);
}

uint32_t renderer_light_slots(const renderer *r)
{
    return renderer_has_indirect(r) ? r->gpu_world->light_slots.count : 0;
}

uint32_t renderer_slots(const renderer *r)
{
    return renderer_vpl_slots(r) + renderer_light_slots(r);
}

bool renderer_has_shadows(const renderer *r)
{
    return renderer_has_indirect(r) && r->settings.shadow_samples > 0 && r->settings.only != ONLY_INDIRECT_UNSHADOWED;
}

// ---- Life

renderer *renderer_create(gpu *gpu, const scene_data *scene, const render_settings *settings)
{
    renderer *r = memory_alloc(sizeof *r);
    r->gpu = gpu;
    r->scene = scene;
    r->settings = *settings;
    r->world = ecs_world_create();
    r->graph = frame_graph_create(gpu);
    r->pass = ecs_component_register(r->world, &(component_desc){.name = "render_pass", .size = sizeof(render_pass)});
    const component_desc state_desc = {
        .name = "pass_state", .size = sizeof(pass_state), .fini = pass_state_fini, .user = r};
    r->pass_state = ecs_component_register(r->world, &state_desc);
    if (!r->graph || !world_init(r) || !modules_init(r)) {
        renderer_destroy(r);
        return NULL;
    }
    r->camera = renderer_camera_of_scene(r, scene->camera_count ? 0 : SCENE_NONE);
    const ecs_system_desc constants = {
        .name = "constants", .phase = ECS_PHASE_EXTRACT, .run = constants_extract, .user = r};
    ecs_system_register(r->world, &constants);
    const ecs_system_desc render = {.name = "render", .phase = ECS_PHASE_RENDER, .run = frame_render, .user = r};
    ecs_system_register(r->world, &render);
    return r;
}

void renderer_destroy(renderer *r)
{
    if (!r)
        return;
    frame_graph_destroy(r->graph);
    ecs_world_destroy(r->world); // releases the passes' states
    animation_fini(r);
    world_fini(r);
    free(r);
}

bool renderer_frame(renderer *r)
{
    const double start = time_now();
    r->failed = false;
    ecs_run(r->world);
    r->frame++;
    r->milliseconds = 1000 * (time_now() - start);
    return !r->failed;
}

float renderer_singularity(const renderer *r)
{
    return r->settings.singularity * r->constants.scene_radius;
}
