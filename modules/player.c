// Plays scripts: sets what holds at a frame as settings, camera and components, and renders it.
#include "player.h"
#include "animation_system.h"
#include "progressive.h"
#include "world.h"

#include <stdlib.h>
#include <string.h>

#include <cglm/cglm.h>

struct player {
    gpu *gpu;
    const scene_data *scene;
    playback *script;
    void (*prepare)(renderer *r, void *user);
    void *user;
    renderer *renderer;
    entity *lights; // by the script's
    uint32_t next; // frame that follows from the renderer's state
    render_settings last; // of the last frame
    bool has_last;
    double milliseconds;
};

// ---- Placing things

// At a point, with -z along the unit vector.
static void matrix_look(const float position[3], const float direction[3], float matrix[16])
{
    float x[3], y[3], z[3];
    glm_vec3_negate_to((float *)direction, z);
    glm_vec3_ortho(z, x);
    glm_vec3_normalize(x);
    glm_vec3_cross(z, x, y);
    memset(matrix, 0, 16 * sizeof(float));
    for (int k = 0; k < 3; k++) {
        matrix[k] = x[k];
        matrix[4 + k] = y[k];
        matrix[8 + k] = z[k];
        matrix[12 + k] = position[k];
    }
    matrix[15] = 1;
}

static void nodes_place(player *p, double time)
{
    for (uint32_t i = 0; i < p->script->node_count; i++) {
        const playback_node *const track = &p->script->nodes[i];
        const scene_node *const rest = &p->scene->nodes[track->node];
        float translation[3], rotation[4], scale[3];
        memcpy(translation, rest->translation, sizeof(translation));
        memcpy(rotation, rest->rotation, sizeof(rotation));
        memcpy(scale, rest->scale, sizeof(scale));
        const struct {
            const playback_curve *curve;
            float *value;
        } parts[] = {{&track->translation, translation}, {&track->rotation, rotation}, {&track->scale, scale}};
        for (size_t k = 0; k < countof(parts); k++) {
            if (parts[k].curve->width > 0) {
                playback_curve_at(parts[k].curve, time, parts[k].value);
            }
        }
        node_component *const node = ecs_get(p->renderer->world, p->renderer->gpu_world->node_entities[track->node],
                                             p->renderer->gpu_world->node);
        scene_matrix_compose(translation, rotation, scale, node->matrix);
    }
}

// A light of the scene that no key places stays with its node.
static void lights_set(player *p, uint32_t frame)
{
    const world_gpu *const w = p->renderer->gpu_world;
    for (uint32_t i = 0; i < p->script->light_count; i++) {
        const playback_light *const track = &p->script->lights[i];
        const playback_light_state state = playback_light_at(p->script, track, frame);
        light_component *const light = ecs_add(p->renderer->world, p->lights[i], w->light);
        *light =
            (light_component){.type = track->type, .inner_cone = track->inner_cone, .outer_cone = track->outer_cone};
        memcpy(light->color, state.color, sizeof(light->color));
        if (track->added || track->position.width > 0 || track->direction.width > 0) {
            node_component *const node = ecs_get(p->renderer->world, p->lights[i], w->node);
            node->parent = (entity){0};
            matrix_look(state.position, state.direction, node->matrix);
        }
    }
}

// ---- Switches

static bool node_is_below(const scene_data *scene, uint32_t node, uint32_t ancestor)
{
    while (node != SCENE_NONE && node != ancestor) {
        node = scene->nodes[node].parent;
    }
    return node == ancestor;
}

// The last event so far that reaches the node decides.
static bool node_is_visible(const player *p, uint32_t node, uint32_t frame)
{
    bool visible = true;
    for (uint32_t i = 0; i < p->script->event_count && p->script->events[i].frame <= frame; i++) {
        const playback_event *const event = &p->script->events[i];
        if (event->type == PLAYBACK_NODE_SWITCH && node_is_below(p->scene, node, event->node)) {
            visible = event->on;
        }
    }
    return visible;
}

// A mesh that stays keeps its component, whose level of subdivision has a history.
static void nodes_switch(player *p, uint32_t frame)
{
    const world_gpu *const w = p->renderer->gpu_world;
    for (uint32_t i = 0; i < p->scene->node_count; i++) {
        const uint32_t mesh = p->scene->nodes[i].mesh;
        if (mesh == SCENE_NONE) {
            continue;
        }
        ecs_world *const world = p->renderer->world;
        const entity node = w->node_entities[i];
        const bool visible = node_is_visible(p, i, frame);
        if (!visible) {
            ecs_remove(world, node, w->mesh);
        } else if (!ecs_get(world, node, w->mesh)) {
            *(mesh_component *)ecs_add(world, node, w->mesh) = (mesh_component){mesh};
        }
    }
}

static light_component scene_light_component(const scene_light *light)
{
    light_component component = {.type = light->type, .inner_cone = light->inner_cone, .outer_cone = light->outer_cone};
    memcpy(component.color, light->color, sizeof(component.color));
    return component;
}

// After lights_set, which makes the lights of tracks.
static void light_switch(player *p, const playback_event *event, bool on)
{
    const renderer *const r = p->renderer;
    const entity light =
        event->light != SCENE_NONE ? p->lights[event->light] : p->renderer->gpu_world->node_entities[event->node];
    if (!on) {
        ecs_remove(r->world, light, r->gpu_world->light);
    } else if (!ecs_get(r->world, light, r->gpu_world->light)) {
        const scene_light *const source = &p->scene->lights[p->scene->nodes[event->node].light];
        *(light_component *)ecs_add(r->world, light, r->gpu_world->light) = scene_light_component(source);
    }
}

static void lights_switch(player *p, uint32_t frame)
{
    for (uint32_t i = 0; i < p->script->event_count; i++) {
        const playback_event *const event = &p->script->events[i];
        if (event->type == PLAYBACK_LIGHT_SWITCH) {
            light_switch(p, event, playback_switched_on(p->script, event, frame));
        }
    }
}

// ---- Camera

// When the nodes are where they will be. What the scene itself shows gives what the script leaves out.
static void camera_set(player *p, uint32_t frame)
{
    renderer *const r = p->renderer;
    const playback_camera *const camera = playback_camera_of(p->script, frame);
    const uint32_t first = p->scene->camera_count > 0 ? 0 : SCENE_NONE;
    r->camera = renderer_camera_of_scene(r, camera && camera->name ? camera->camera : first);
    if (!camera) {
        return;
    }
    playback_pose pose = camera->orbit;
    if (!camera->name) {
        pose = playback_pose_at(p->script, camera, frame);
        memcpy(r->camera.eye, pose.position, sizeof(r->camera.eye));
        memcpy(r->camera.target, pose.target, sizeof(r->camera.target));
        memcpy(r->camera.up, (float[]){0, 1, 0}, sizeof(r->camera.up));
    }
    r->camera.yfov = pose.yfov > 0 ? pose.yfov : r->camera.yfov;
    r->camera.near_plane = camera->znear > 0 ? camera->znear : r->camera.near_plane;
}

// ---- A renderer for a segment

static void lights_add(player *p)
{
    for (uint32_t i = 0; i < p->script->light_count; i++) {
        const playback_light *const light = &p->script->lights[i];
        if (!light->added) {
            p->lights[i] = p->renderer->gpu_world->node_entities[light->node];
            continue;
        }
        p->lights[i] = ecs_entity_create(p->renderer->world);
        node_component *const node = ecs_add(p->renderer->world, p->lights[i], p->renderer->gpu_world->node);
        node->name = light->name;
    }
}

static void clips_play(player *p)
{
    for (uint32_t i = 0; i < p->script->clip_count; i++) {
        const playback_clip *const clip = &p->script->clips[i];
        animation_play(p->renderer, &(animation_clip){.animation = clip->animation,
                                                      .start = clip->start,
                                                      .speed = clip->speed,
                                                      .loop = clip->loop});
    }
}

static bool segment_begin(player *p, uint32_t frame)
{
    const render_settings settings = playback_settings_at(p->script, frame);
    renderer_destroy(p->renderer);
    p->renderer = renderer_create(p->gpu, p->scene, &settings);
    if (!p->renderer) {
        return false;
    }
    lights_add(p);
    clips_play(p);
    if (p->prepare) {
        p->prepare(p->renderer, p->user);
    }
    return true;
}

// ---- Frames

// Automatic settings have the last word on what they choose, also over a cut.
static void settings_set_of_frame(player *p, uint32_t frame)
{
    renderer *const r = p->renderer;
    const render_settings last = p->last;
    r->settings = playback_settings_at(p->script, frame);
    if (p->has_last && (r->settings.target_ms > 0 || r->settings.target_error > 0)) {
        r->settings.vpls = last.vpls;
        r->settings.alpha = last.alpha;
        r->settings.interleave = last.interleave;
        r->settings.shadow_samples = last.shadow_samples;
        r->settings.ray_budget = last.ray_budget;
    }
}

static bool progressive_frames_render(renderer *r)
{
    do {
        if (!renderer_frame(r)) {
            return false;
        }
    } while (!progressive_status_get(r, false).finished);
    return true;
}

bool player_frame(player *p, uint32_t frame)
{
    const double start = time_now();
    const bool begins = frame == playback_segment_begin(p->script, frame);
    assert((begins || (p->renderer && frame == p->next)) && "what is this frame to follow from?");
    if (begins && !segment_begin(p, frame)) {
        p->next = UINT32_MAX;
        return false;
    }
    renderer *const r = p->renderer;
    const double time = playback_time(p->script, frame);
    settings_set_of_frame(p, frame);
    r->time = time;
    nodes_place(p, time);
    lights_set(p, frame);
    lights_switch(p, frame);
    nodes_switch(p, frame);
    animation_update(r);
    camera_set(p, frame);
    const bool ok = progressive_is(r) ? progressive_frames_render(r) : renderer_frame(r);
    p->last = r->settings;
    p->has_last = true;
    p->next = frame + 1;
    p->milliseconds = 1000 * (time_now() - start);
    return ok;
}

renderer *player_renderer(const player *p)
{
    return p->renderer;
}

double player_milliseconds(const player *p)
{
    return p->milliseconds;
}

// ---- Life

player *player_create(gpu *gpu, const scene_data *scene, playback *script, void (*prepare)(renderer *r, void *user),
                      void *user)
{
    if (!playback_resolve(script, scene)) {
        return NULL;
    }
    player *const p = memory_alloc(sizeof(*p));
    *p = (player){.gpu = gpu, .scene = scene, .script = script, .prepare = prepare, .user = user, .next = UINT32_MAX};
    p->lights = memory_alloc(max_u32(script->light_count, 1) * sizeof(*p->lights));
    return p;
}

void player_destroy(player *p)
{
    if (!p) {
        return;
    }
    renderer_destroy(p->renderer);
    free(p->lights);
    free(p);
}
