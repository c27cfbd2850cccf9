// Playback scripts over time: what holds at a frame, and what of the scene a script names.
#include "playback.h"
#include "animation.h"

#include "shaders/shared.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void playback_destroy(playback *script)
{
    if (!script) {
        return;
    }
    free(script->overrides);
    arena memory = script->memory; // holds the script itself
    arena_fini(&memory);
}

// ---- Settings

const char *playback_setting_refusal(const setting_info *info, bool in_event)
{
    static const struct {
        const char *name, *why;
        bool in_events_only;
    } refusals[] = {
        {"frames", "a script has as many frames as duration and frame_rate say", false},
        {"target-ms", "it follows measured times, so no two runs would be alike; see play --record", false},
        {"target-error", "it chooses settings from what it measures on the way; see play --record", false},
        {"size", "the size stays as it is", true},
        {"method", "the method stays as it is", true},
    };
    for (size_t i = 0; i < countof(refusals); i++) {
        if (strcmp(refusals[i].name, info->name) == 0 && (in_event || !refusals[i].in_events_only)) {
            return refusals[i].why;
        }
    }
    return NULL;
}

bool playback_override(playback *script, const setting_info *info, const char *text, setting_error *error)
{
    render_settings settings = render_settings_default();
    if (!settings_set(&settings, info, text, error)) {
        return false;
    }
    char read[32]; // as it was read, which outlives `text`
    settings_get(&settings, info, read);
    script->overrides = memory_realloc(script->overrides, (script->override_count + 1) * sizeof(*script->overrides));
    script->overrides[script->override_count++] = (playback_setting){info, arena_strdup(&script->memory, read)};
    return true;
}

static void settings_apply(render_settings *settings, const playback_setting *list, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        setting_error error;
        const bool ok = settings_set(settings, list[i].info, list[i].text, &error);
        assert(ok && "checked when read");
        (void)ok;
    }
}

render_settings playback_settings_at(const playback *script, uint32_t frame)
{
    render_settings settings = render_settings_default();
    settings_apply(&settings, script->settings, script->setting_count);
    for (uint32_t i = 0; i < script->event_count; i++) {
        const playback_event *const event = &script->events[i];
        if (event->frame <= frame) {
            settings_apply(&settings, event->settings, event->setting_count);
        }
    }
    settings_apply(&settings, script->overrides, script->override_count);
    return settings;
}

// ---- Time

double playback_time(const playback *script, uint32_t frame)
{
    return (double)frame / script->frame_rate;
}

uint32_t playback_segment_begin(const playback *script, uint32_t frame)
{
    if (playback_settings_at(script, 0).method != METHOD_LGH) {
        return frame;
    }
    uint32_t begin = 0;
    for (uint32_t i = 0; i < script->event_count; i++) {
        const playback_event *const event = &script->events[i];
        if (event->type == PLAYBACK_CUT && event->frame <= frame) {
            begin = max_u32(begin, event->frame);
        }
    }
    const playback_camera *const camera = playback_camera_of(script, frame);
    for (const playback_camera *c = script->cameras; camera && c <= camera; c++) {
        begin = c->cut ? max_u32(begin, c->first_frame) : begin;
    }
    return begin;
}

bool playback_switched_on(const playback *script, const playback_event *event, uint32_t frame)
{
    bool on = true;
    for (uint32_t i = 0; i < script->event_count; i++) {
        const playback_event *const other = &script->events[i];
        if (other->type == event->type && other->light == event->light && other->node == event->node &&
            other->frame <= frame) {
            on = other->on;
        }
    }
    return on;
}

// ---- Camera

const playback_camera *playback_camera_of(const playback *script, uint32_t frame)
{
    const playback_camera *found = NULL;
    for (uint32_t i = 0; i < script->camera_count && script->cameras[i].first_frame <= frame; i++) {
        found = &script->cameras[i];
    }
    return found;
}

// About +y: from +z towards +x.
static void orbit_turn(playback_pose *pose, double angle)
{
    const double x = (double)pose->position[0] - (double)pose->target[0],
                 z = (double)pose->position[2] - (double)pose->target[2];
    pose->position[0] = (float)((double)pose->target[0] + x * cos(angle) + z * sin(angle));
    pose->position[2] = (float)((double)pose->target[2] + z * cos(angle) - x * sin(angle));
}

playback_pose playback_pose_at(const playback *script, const playback_camera *camera, uint32_t frame)
{
    assert(!camera->name);
    const double time = playback_time(script, frame);
    playback_pose pose = camera->orbit;
    if (camera->orbits) {
        orbit_turn(&pose, (time - camera->start) * (double)camera->speed);
        return pose;
    }
    playback_curve_at(&camera->position, time, pose.position);
    playback_curve_at(&camera->target, time, pose.target);
    if (camera->yfov.width > 0) {
        playback_curve_at(&camera->yfov, time, &pose.yfov);
    }
    return pose;
}

// ---- Lights

static void curve_or(const playback_curve *curve, double time, float *value)
{
    if (curve->width > 0) {
        playback_curve_at(curve, time, value);
    }
}

playback_light_state playback_light_at(const playback *script, const playback_light *light, uint32_t frame)
{
    const double time = playback_time(script, frame);
    playback_light_state state;
    float intensity = light->base_intensity;
    memcpy(state.color, light->base_color, sizeof(state.color));
    memcpy(state.position, light->base_position, sizeof(state.position));
    memcpy(state.direction, light->base_direction, sizeof(state.direction));
    curve_or(&light->color, time, state.color);
    curve_or(&light->intensity, time, &intensity);
    curve_or(&light->position, time, state.position);
    curve_or(&light->direction, time, state.direction);
    double square = 0;
    for (int k = 0; k < 3; k++) {
        // At most what a scene may have.
        state.color[k] = fminf(fmaxf(state.color[k], 0) * fmaxf(intensity, 0), 1e30f);
        square += (double)state.direction[k] * (double)state.direction[k];
    }
    for (int k = 0; k < 3; k++) {
        // Between two opposite directions there may be none.
        const float rest = k == 1 ? -1.0f : 0.0f;
        state.direction[k] = square > 0 ? (float)((double)state.direction[k] / sqrt(square)) : rest;
    }
    return state;
}

// ---- Names

static bool missing(const playback *script, uint32_t line, const char *what, const char *name)
{
    log_error("%s:%u: expected the name of %s of \"%s\", got \"%s\"", script->path, line, what, script->scene, name);
    return false;
}

// By its own name, or else by its mesh's.
static uint32_t node_find(const scene_data *scene, const char *name)
{
    uint32_t by_mesh = SCENE_NONE;
    for (uint32_t i = scene->node_count; i-- > 0;) {
        const scene_node *const node = &scene->nodes[i];
        const char *const mesh = node->mesh != SCENE_NONE ? scene->meshes[node->mesh].name : NULL;
        by_mesh = mesh && strcmp(mesh, name) == 0 ? i : by_mesh;
    }
    for (uint32_t i = 0; i < scene->node_count; i++) {
        if (scene->nodes[i].name && strcmp(scene->nodes[i].name, name) == 0) {
            return i;
        }
    }
    return by_mesh;
}

// A node with a light: by its own name, or else by its light's.
static uint32_t light_node_find(const scene_data *scene, const char *name)
{
    uint32_t by_light = SCENE_NONE;
    for (uint32_t i = scene->node_count; i-- > 0;) {
        const scene_node *const node = &scene->nodes[i];
        const char *const light = node->light != SCENE_NONE ? scene->lights[node->light].name : NULL;
        by_light = light && strcmp(light, name) == 0 ? i : by_light;
    }
    for (uint32_t i = 0; i < scene->node_count; i++) {
        const scene_node *const node = &scene->nodes[i];
        if (node->light != SCENE_NONE && node->name && strcmp(node->name, name) == 0) {
            return i;
        }
    }
    return by_light;
}

static bool cameras_resolve(playback *script, const scene_data *scene)
{
    for (uint32_t i = 0; i < script->camera_count; i++) {
        playback_camera *const camera = &script->cameras[i];
        if (!camera->name) {
            continue;
        }
        camera->camera = scene_camera_find(scene, camera->name);
        if (camera->camera == SCENE_NONE) {
            return missing(script, camera->line, "a camera", camera->name);
        }
    }
    return true;
}

// Where the script does not say, a light of the scene is as it is there at rest.
static void light_take(playback_light *light, const scene_data *scene)
{
    const scene_node *const node = &scene->nodes[light->node];
    const scene_light *const source = &scene->lights[node->light];
    light->type = source->type;
    light->inner_cone = source->inner_cone;
    light->outer_cone = source->outer_cone;
    // A light that is dark in the file has no colour there.
    const bool dark = source->color[0] + source->color[1] + source->color[2] <= 0;
    light->base_intensity = dark ? 0 : source->intensity > 0 ? source->intensity : 1;
    for (int k = 0; k < 3; k++) {
        light->base_color[k] = dark ? 1 : source->color[k] / light->base_intensity;
        light->base_position[k] = node->world[12 + k];
        light->base_direction[k] = -node->world[8 + k];
    }
}

static bool lights_resolve(playback *script, const scene_data *scene)
{
    for (uint32_t i = 0; i < script->light_count; i++) {
        playback_light *const light = &script->lights[i];
        light->node = light->added ? SCENE_NONE : light_node_find(scene, light->name);
        if (light->node == SCENE_NONE && !light->added) {
            return missing(script, light->line, "a node with a light", light->name);
        }
        if (!light->added) {
            light_take(light, scene);
        }
    }
    return true;
}

static bool nodes_resolve(playback *script, const scene_data *scene)
{
    for (uint32_t i = 0; i < script->node_count; i++) {
        playback_node *const track = &script->nodes[i];
        track->node = node_find(scene, track->name);
        if (track->node == SCENE_NONE) {
            return missing(script, track->line, "a node", track->name);
        }
        const bool complete = track->translation.width && track->rotation.width && track->scale.width;
        if (!scene->nodes[track->node].has_trs && !complete) {
            log_error(
                "%s:%u: node \"%s\" has a matrix in \"%s\", so expected keys with translation, rotation and scale",
                script->path, track->line, track->name, script->scene);
            return false;
        }
    }
    return true;
}

static bool clips_resolve(playback *script, const scene_data *scene)
{
    for (uint32_t i = 0; i < script->clip_count; i++) {
        playback_clip *const clip = &script->clips[i];
        clip->animation = animation_find(scene, clip->name);
        if (clip->animation == SCENE_NONE) {
            return missing(script, clip->line, "an animation", clip->name);
        }
    }
    return true;
}

static bool light_event_resolve(playback *script, playback_event *event, const scene_data *scene)
{
    for (uint32_t k = 0; k < script->light_count; k++) {
        if (script->lights[k].added && strcmp(script->lights[k].name, event->name) == 0) {
            event->light = k;
            return true;
        }
    }
    event->node = light_node_find(scene, event->name);
    for (uint32_t k = 0; k < script->light_count && event->node != SCENE_NONE; k++) {
        event->light = script->lights[k].node == event->node ? k : event->light;
    }
    return event->node != SCENE_NONE || missing(script, event->line, "a node with a light", event->name);
}

static bool events_resolve(playback *script, const scene_data *scene)
{
    for (uint32_t i = 0; i < script->event_count; i++) {
        playback_event *const event = &script->events[i];
        event->light = event->node = SCENE_NONE;
        if (event->type == PLAYBACK_LIGHT_SWITCH && !light_event_resolve(script, event, scene)) {
            return false;
        }
        if (event->type == PLAYBACK_NODE_SWITCH) {
            event->node = node_find(scene, event->name);
            if (event->node == SCENE_NONE) {
                return missing(script, event->line, "a node", event->name);
            }
        }
    }
    return true;
}

bool playback_resolve(playback *script, const scene_data *scene)
{
    return cameras_resolve(script, scene) && lights_resolve(script, scene) && nodes_resolve(script, scene) &&
           clips_resolve(script, scene) && events_resolve(script, scene);
}
