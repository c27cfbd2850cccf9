// What automatic settings chose while a script was played, as a script of its own that plays to the same pictures.
#include "lanternfield_play.h"

#include <cjson/cJSON.h>
#include <stdlib.h>
#include <string.h>

static bool is_target(const setting_info *info)
{
    return strcmp(info->name, "target-ms") == 0 || strcmp(info->name, "target-error") == 0;
}

// The script's own events of the frame come before those that are recorded in it.
static void own_events_apply(const playback *script, uint32_t frame, render_settings *settings)
{
    for (uint32_t i = 0; i < script->event_count; i++) {
        const playback_event *const event = &script->events[i];
        for (uint32_t k = 0; k < event->setting_count && event->frame == frame; k++) {
            setting_error error;
            settings_set(settings, event->settings[k].info, event->settings[k].text, &error);
        }
    }
}

void play_record_add(play_record *record, const playback *script, const renderer *r, uint32_t frame)
{
    if (!record->events) {
        record->events = cJSON_CreateArray();
        record->now = playback_settings_at(script, 0);
    }
    own_events_apply(script, frame, &record->now);
    cJSON *settings = NULL;
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        char before[32], now[32];
        settings_get(&record->now, &table[i], before);
        settings_get(&r->settings, &table[i], now);
        if (!is_target(&table[i]) && strcmp(before, now) != 0) {
            settings = settings ? settings : cJSON_CreateObject();
            cJSON_AddStringToObject(settings, table[i].name, now);
        }
    }
    record->now = r->settings;
    if (settings) {
        cJSON *const event = cJSON_CreateObject();
        cJSON_AddNumberToObject(event, "time", playback_time(script, frame));
        cJSON_AddItemToObject(event, "settings", settings);
        cJSON_AddItemToArray(record->events, event);
    }
}

void play_record_fini(play_record *record)
{
    cJSON_Delete(record->events);
    *record = (play_record){0};
}

// ---- The script

static double time_of(const cJSON *event)
{
    return cJSON_GetObjectItemCaseSensitive(event, "time")->valuedouble;
}

// Copies of both, by time; of the same time the recorded ones come last, so that they have their way. `own` may be
// NULL.
static cJSON *events_merge(const cJSON *own, const cJSON *recorded)
{
    cJSON *const merged = cJSON_CreateArray();
    const cJSON *a = own ? own->child : NULL, *b = recorded->child;
    while (a || b) {
        const cJSON **const next = a && (!b || time_of(a) <= time_of(b)) ? &a : &b;
        cJSON_AddItemToArray(merged, cJSON_Duplicate(*next, true));
        *next = (*next)->next;
    }
    return merged;
}

// The new file may lie elsewhere.
static void path_make_absolute(const playback *script, cJSON *object, const char *key)
{
    const cJSON *const path = cJSON_GetObjectItemCaseSensitive(object, key);
    if (!path || path->valuestring[0] == '/') {
        return;
    }
    char *const folder = realpath(script->folder, NULL);
    arena memory = {0};
    if (folder) {
        const char *const absolute = arena_printf(&memory, "%s/%s", folder, path->valuestring);
        cJSON_ReplaceItemInObjectCaseSensitive(object, key, cJSON_CreateString(absolute));
    }
    arena_fini(&memory);
    free(folder);
}

bool play_record_write(const play_record *record, const playback *script, const char *path)
{
    size_t size;
    char *const text = (char *)file_read(script->path, &size);
    cJSON *const root = text ? cJSON_Parse(text) : NULL;
    free(text);
    if (!root) {
        log_error("cannot write \"%s\": \"%s\" is no longer there", path, script->path);
        return false;
    }
    path_make_absolute(script, root, "scene");
    for (cJSON *camera = cJSON_GetArrayItem(cJSON_GetObjectItemCaseSensitive(root, "cameras"), 0); camera;
         camera = camera->next) {
        path_make_absolute(script, camera, "walk");
    }
    cJSON *const events = events_merge(cJSON_GetObjectItemCaseSensitive(root, "events"), record->events);
    cJSON_DeleteItemFromObjectCaseSensitive(root, "events");
    cJSON_AddItemToObject(root, "events", events);
    char *const printed = cJSON_Print(root);
    const bool ok = printed && file_write(path, printed, strlen(printed));
    cJSON_free(printed);
    cJSON_Delete(root);
    return ok;
}
