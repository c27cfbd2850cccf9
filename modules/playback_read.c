// Reads playback scripts by tables of keys. The first thing wrong is logged with its line, and ends the reading.
#include "json_file.h"
#include "playback.h"

#include "shaders/shared.h"

#include <cjson/cJSON.h>
#include <libgen.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FRAMES_MAX = 1000000 };
static const double pi = 3.14159265358979323846;
static const double number_max = 1e9; // where nothing else is said: its square is far from a float's end

typedef struct reader {
    playback *script;
    const json_file *file;
    arena *memory; // the script's
} reader;

// `expected` may end in ", got ...".
static bool refuse(const reader *r, const cJSON *at, const char *thing, const char *expected)
{
    log_error("%s:%u: %s: %s", r->script->path, json_file_line(r->file, at), thing, expected);
    return false;
}

static const char *got(const reader *r, const cJSON *json)
{
    char *const text = cJSON_PrintUnformatted(json);
    const char *const cut = arena_printf(r->memory, "got %.40s", text ? text : "nothing");
    cJSON_free(text);
    return cut;
}

static bool refuse_value(const reader *r, const cJSON *at, const char *thing, const char *expected)
{
    return refuse(r, at, thing, arena_printf(r->memory, "expected %s, %s", expected, got(r, at)));
}

// ---- Objects, by tables of keys

typedef struct key_info key_info;
// `object` is what the table's offsets count from.
typedef bool (*key_reader)(const reader *r, const cJSON *json, const key_info *key, void *object);
struct key_info {
    const char *name;
    key_reader read;
    size_t offset; // of the member in the object
    size_t count_offset; // lists: of the uint32_t with their length; numbers: how many of them
    double min, max; // numbers, inclusive; both 0: any
    bool above_min, required;
    const struct object_info *items; // lists of objects
};
typedef struct object_info {
    const char *what; // "a camera"
    const key_info *keys;
    size_t key_count, size;
    const void *initial; // NULL: zero
    // After the keys: what they must be together, and what follows from them. NULL: nothing.
    bool (*finish)(const reader *r, const cJSON *json, void *object);
} object_info;

static const char *key_names(const reader *r, const object_info *info)
{
    const char *names = "";
    for (size_t i = 0; i < info->key_count; i++) {
        names = arena_printf(r->memory, "%s%s%s", names, i ? ", " : "", info->keys[i].name);
    }
    return names;
}

static const key_info *key_find(const object_info *info, const char *name)
{
    for (size_t i = 0; i < info->key_count; i++) {
        if (strcmp(info->keys[i].name, name) == 0) {
            return &info->keys[i];
        }
    }
    return NULL;
}

// Whether a member of this name came before.
static bool given_before(const cJSON *object, const cJSON *member)
{
    return cJSON_GetObjectItemCaseSensitive(object, member->string) != member;
}

static bool object_read(const reader *r, const cJSON *json, const object_info *info, void *object)
{
    if (!cJSON_IsObject(json)) {
        return refuse_value(r, json, info->what, "an object {...}");
    }
    for (const cJSON *member = json->child; member; member = member->next) {
        const key_info *const key = key_find(info, member->string);
        if (!key) {
            return refuse(
                r, member, arena_printf(r->memory, "\"%.40s\"", member->string),
                arena_printf(r->memory, "unknown key of %s; expected one of %s", info->what, key_names(r, info)));
        }
        if (given_before(json, member)) {
            return refuse(r, member, key->name, "given twice");
        }
        if (!key->read(r, member, key, object)) {
            return false;
        }
    }
    for (size_t i = 0; i < info->key_count; i++) {
        if (info->keys[i].required && !cJSON_GetObjectItemCaseSensitive(json, info->keys[i].name)) {
            return refuse(r, json, info->what, arena_printf(r->memory, "expected \"%s\"", info->keys[i].name));
        }
    }
    return !info->finish || info->finish(r, json, object);
}

static bool list_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    const object_info *const info = key->items;
    if (!cJSON_IsArray(json)) {
        return refuse_value(r, json, key->name, "a list [...]");
    }
    const uint32_t count = (uint32_t)cJSON_GetArraySize(json);
    char *const items = arena_alloc(r->memory, count * info->size + 1);
    *(void **)((char *)object + key->offset) = items;
    for (const cJSON *child = json->child; child; child = child->next) {
        uint32_t *const done = (uint32_t *)((char *)object + key->count_offset);
        void *const item = items + *done * info->size;
        if (info->initial) {
            memcpy(item, info->initial, info->size);
        }
        if (!object_read(r, child, info, item)) {
            return false;
        }
        ++*done;
    }
    return true;
}

// ---- Values

static bool number_take(const reader *r, const cJSON *json, const key_info *key, const char *name, double *value)
{
    const bool any = key->min == 0 && key->max == 0;
    const double min = any ? -number_max : key->min, max = any ? number_max : key->max;
    const bool ok = cJSON_IsNumber(json) && json->valuedouble >= min && json->valuedouble <= max &&
                    !(key->above_min && json->valuedouble <= min);
    if (!ok) {
        const char *const range = any ? "a number"
                                      : arena_printf(r->memory, "a number %s %.7g and at most %.7g",
                                                     key->above_min ? "greater than" : "of at least", min, max);
        return refuse_value(r, json, name, range);
    }
    *value = json->valuedouble;
    return true;
}

static bool double_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    return number_take(r, json, key, key->name, (double *)((char *)object + key->offset));
}

static bool float_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    double value;
    const bool ok = number_take(r, json, key, key->name, &value);
    if (ok) {
        *(float *)((char *)object + key->offset) = (float)value;
    }
    return ok;
}

// `count_offset` floats in a list.
static bool floats_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    float *const values = (float *)((char *)object + key->offset);
    if (!cJSON_IsArray(json) || (size_t)cJSON_GetArraySize(json) != key->count_offset) {
        return refuse_value(r, json, key->name, arena_printf(r->memory, "%zu numbers [...]", key->count_offset));
    }
    size_t i = 0;
    for (const cJSON *child = json->child; child; child = child->next) {
        double value;
        if (!number_take(r, child, key, key->name, &value)) {
            return false;
        }
        values[i++] = (float)value;
    }
    return true;
}

static bool bool_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    if (!cJSON_IsBool(json)) {
        return refuse_value(r, json, key->name, "true or false");
    }
    *(bool *)((char *)object + key->offset) = cJSON_IsTrue(json);
    return true;
}

static bool string_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    if (!cJSON_IsString(json) || !*json->valuestring) {
        return refuse_value(r, json, key->name, "a text that is not empty");
    }
    *(const char **)((char *)object + key->offset) = arena_strdup(r->memory, json->valuestring);
    return true;
}

// One of the names, which stand in the order of the enum's values.
static bool name_take(const reader *r, const cJSON *json, const char *thing, const char *const *names, uint32_t count,
                      uint32_t *value)
{
    const char *expected = "one of";
    for (*value = 0; *value < count; ++*value) {
        if (cJSON_IsString(json) && strcmp(json->valuestring, names[*value]) == 0) {
            return true;
        }
        expected = arena_printf(r->memory, "%s%s \"%s\"", expected, *value ? "," : "", names[*value]);
    }
    return refuse_value(r, json, thing, expected);
}

static const char *path_of(const reader *r, const char *path)
{
    return *path == '/' ? path : arena_printf(r->memory, "%s/%s", r->script->folder, path);
}

// ---- Settings

static bool setting_take(const reader *r, const cJSON *json, bool in_event, playback_setting *setting)
{
    const char *text = "";
    const char *const name = json->string;
    setting->info = settings_find(name);
    if (!setting->info) {
        return refuse(r, json, arena_printf(r->memory, "\"%.40s\"", name),
                      "expected the name of a render option (see lanternfield render --help)");
    }
    const char *const refusal = playback_setting_refusal(setting->info, in_event);
    if (refusal) {
        return refuse(r, json, name, arena_printf(r->memory, "cannot be set here: %s", refusal));
    }
    if (cJSON_IsNumber(json)) {
        text = arena_printf(r->memory, "%.17g", json->valuedouble);
    } else if (cJSON_IsBool(json)) {
        text = cJSON_IsTrue(json) ? "true" : "false";
    } else if (cJSON_IsString(json)) {
        text = arena_strdup(r->memory, json->valuestring);
    }
    render_settings settings = render_settings_default();
    setting_error error;
    if (!*text || !settings_set(&settings, setting->info, text, &error)) {
        // "--vpls: expected ..., got ...", where the option's dashes do not belong.
        return *text ? refuse(r, json, name, strstr(error.message, "expected"))
                     : refuse_value(r, json, name, "a number, a text, true or false");
    }
    setting->text = text;
    return true;
}

// Grows `*list` by one, which costs little as often as it happens.
static playback_setting *setting_add(const reader *r, const playback_setting **list, uint32_t *count)
{
    playback_setting *const grown = arena_alloc(r->memory, (*count + 1) * sizeof(*grown));
    if (*count > 0) {
        memcpy(grown, *list, *count * sizeof(*grown));
    }
    *list = grown;
    return &grown[(*count)++];
}

static bool settings_take(const reader *r, const cJSON *json, bool in_event, const playback_setting **list,
                          uint32_t *count)
{
    if (!cJSON_IsObject(json)) {
        return refuse_value(r, json, "settings", "an object {...}");
    }
    for (const cJSON *member = json->child; member; member = member->next) {
        if (given_before(json, member)) {
            return refuse(r, member, member->string, "given twice");
        }
        if (!setting_take(r, member, in_event, setting_add(r, list, count))) {
            return false;
        }
    }
    return true;
}

static bool script_settings_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    (void)key, (void)object;
    return settings_take(r, json, false, &r->script->settings, &r->script->setting_count);
}

// "size" and "seed" of the script itself.
static bool script_setting_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    (void)key, (void)object;
    return setting_take(r, json, false, setting_add(r, &r->script->settings, &r->script->setting_count));
}

// ---- Key frames

typedef struct key_member {
    const char *name;
    uint32_t width;
    size_t offset; // of the playback_curve in the track
    double min, max; // both 0: any
    bool rotation;
    bool above_min;
} key_member;
typedef struct track_info {
    const key_member *members;
    size_t member_count;
    uint32_t needed; // so many members, from the first on, must be there
} track_info;

static playback_curve *curve_of(void *track, const key_member *member)
{
    return (playback_curve *)((char *)track + member->offset);
}

static const key_member *member_find(const track_info *info, const char *name)
{
    for (size_t i = 0; i < info->member_count; i++) {
        if (strcmp(info->members[i].name, name) == 0) {
            return &info->members[i];
        }
    }
    return NULL;
}

static const char *member_names(const reader *r, const track_info *info)
{
    const char *names = "time";
    for (size_t i = 0; i < info->member_count; i++) {
        names = arena_printf(r->memory, "%s, %s", names, info->members[i].name);
    }
    return names;
}

// Makes a unit quaternion of it, in the half space of the one before. False: it has no length.
static bool rotation_finish(float *value, const float *before)
{
    double square = 0, along = 0;
    for (int i = 0; i < 4; i++) {
        square += (double)value[i] * (double)value[i];
        along += before ? (double)value[i] * (double)before[i] : 0;
    }
    for (int i = 0; i < 4 && square > 0; i++) {
        value[i] = (float)((along < 0 ? -1 : 1) * (double)value[i] / sqrt(square));
    }
    return square > 0;
}

static bool value_take(const reader *r, const cJSON *json, const key_member *member, uint32_t k, playback_curve *curve)
{
    float *const value = (float *)curve->values + (size_t)k * member->width;
    const key_info as_key = {.name = member->name,
                             .count_offset = member->width,
                             .min = member->min,
                             .max = member->max,
                             .above_min = member->above_min};
    const bool read = member->width == 1 ? float_read(r, json, &as_key, value) : floats_read(r, json, &as_key, value);
    if (read && member->rotation && !rotation_finish(value, k > 0 ? value - 4 : NULL)) {
        return refuse_value(r, json, member->name, "a quaternion that is not zero");
    }
    return read;
}

static bool time_take(const reader *r, const cJSON *key, uint32_t k, double *times)
{
    const cJSON *const json = cJSON_GetObjectItemCaseSensitive(key, "time");
    if (!json) {
        return refuse(r, key, "a key", "expected \"time\"");
    }
    if (!number_take(r, json, &(key_info){.min = 0, .max = FRAMES_MAX}, "time", &times[k])) {
        return false;
    }
    return k == 0 || times[k] > times[k - 1] ||
           refuse_value(r, json, "time", arena_printf(r->memory, "a time after the key before, at %.7g", times[k - 1]));
}

// One key, with the members that the first key has, which make the curves.
static bool key_read(const reader *r, const cJSON *key, const track_info *info, void *track, uint32_t k,
                     const double *times)
{
    for (const cJSON *json = key->child; json; json = json->next) {
        const key_member *const member = member_find(info, json->string);
        if (given_before(key, json)) {
            return refuse(r, json, json->string, "given twice");
        }
        if (strcmp(json->string, "time") == 0) {
            continue;
        }
        if (!member) {
            return refuse(
                r, json, arena_printf(r->memory, "\"%.40s\"", json->string),
                arena_printf(r->memory, "unknown key of a key frame; expected one of %s", member_names(r, info)));
        }
        playback_curve *const curve = curve_of(track, member);
        if (curve->width == 0) {
            return refuse(r, json, member->name, "expected in all keys or in none, and the first has none");
        }
        if (!value_take(r, json, member, k, curve)) {
            return false;
        }
    }
    for (size_t i = 0; i < info->member_count; i++) {
        const playback_curve *const curve = curve_of(track, &info->members[i]);
        if (curve->times == times && !cJSON_GetObjectItemCaseSensitive(key, info->members[i].name)) {
            return refuse(r, key, "a key",
                          arena_printf(r->memory, "expected \"%s\", which the first key has", info->members[i].name));
        }
    }
    return true;
}

// Makes the curves of a track.
static bool keys_read(const reader *r, const cJSON *json, const track_info *info, void *track)
{
    if (!cJSON_IsArray(json)) {
        return refuse_value(r, json, "keys", "a list [...]");
    }
    const uint32_t count = (uint32_t)cJSON_GetArraySize(json);
    if (count == 0) {
        return refuse(r, json, "keys", "expected at least one key, got none");
    }
    double *const times = arena_alloc(r->memory, count * sizeof(*times));
    size_t found = 0;
    for (size_t i = 0; i < info->member_count; i++) {
        const key_member *const member = &info->members[i];
        if (!cJSON_GetObjectItemCaseSensitive(json->child, member->name)) {
            if (i < info->needed && cJSON_IsObject(json->child)) {
                return refuse(r, json->child, "a key", arena_printf(r->memory, "expected \"%s\"", member->name));
            }
            continue;
        }
        found++;
        *curve_of(track, member) = (playback_curve){
            .width = member->width,
            .key_count = count,
            .times = times,
            .values = arena_alloc(r->memory, count * member->width * sizeof(float)),
            .rotation = member->rotation,
        };
    }
    uint32_t k = 0;
    for (const cJSON *key = json->child; key; key = key->next, k++) {
        if (!cJSON_IsObject(key)) {
            return refuse_value(r, key, "a key", "an object {...}");
        }
        if (!time_take(r, key, k, times) || !key_read(r, key, info, track, k, times)) {
            return false;
        }
    }
    return found > 0 || refuse(r, json->child, "a key",
                               arena_printf(r->memory, "expected also one of %s", member_names(r, info) + 6));
}

static const char *const interpolation_names[] = {
    [PLAYBACK_SPLINE] = "spline", [PLAYBACK_LINEAR] = "linear", [PLAYBACK_STEP] = "step"};

// "keys" and "interpolation" of a track, whatever order they came in.
static bool track_finish(const reader *r, const cJSON *json, const track_info *info, void *track)
{
    const cJSON *const keys = cJSON_GetObjectItemCaseSensitive(json, "keys");
    const cJSON *const interpolation = cJSON_GetObjectItemCaseSensitive(json, "interpolation");
    uint32_t value = PLAYBACK_SPLINE;
    if (interpolation && !keys) {
        return refuse(r, interpolation, "interpolation", "expected with \"keys\"");
    }
    if (interpolation &&
        !name_take(r, interpolation, "interpolation", interpolation_names, countof(interpolation_names), &value)) {
        return false;
    }
    if (keys && !keys_read(r, keys, info, track)) {
        return false;
    }
    for (size_t i = 0; i < info->member_count; i++) {
        curve_of(track, &info->members[i])->interpolation = value;
    }
    return true;
}

// Keys that `finish` reads.
static bool later_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    (void)r, (void)json, (void)key, (void)object;
    return true;
}

// ---- Cameras

static uint32_t frame_of(const reader *r, double time)
{
    // A millionth of a frame: what a time like 0.1 lacks to the frame that is meant.
    return (uint32_t)fmax(0, ceil(time * r->script->frame_rate - 1e-6));
}

static const key_member camera_members[] = {
    {.name = "position", .width = 3, .offset = offsetof(playback_camera, position)},
    {.name = "target", .width = 3, .offset = offsetof(playback_camera, target)},
    {.name = "yfov", .width = 1, .offset = offsetof(playback_camera, yfov), .max = 3.1415, .above_min = true},
};
static const track_info camera_track = {camera_members, countof(camera_members), 2};

static bool orbit_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    (void)key;
    static const key_info keys[] = {
        {.name = "target",
         .read = floats_read,
         .offset = offsetof(playback_camera, orbit.target),
         .count_offset = 3,
         .required = true},
        {.name = "position",
         .read = floats_read,
         .offset = offsetof(playback_camera, orbit.position),
         .count_offset = 3,
         .required = true},
        {.name = "speed", .read = float_read, .offset = offsetof(playback_camera, speed), .required = true},
    };
    static const object_info info = {.what = "an orbit", .keys = keys, .key_count = countof(keys)};
    playback_camera *const camera = object;
    camera->orbits = true;
    return object_read(r, json, &info, camera);
}

// ---- Walks

static bool walk_refuse(const char *path, uint32_t line, const char *expected)
{
    log_error("%s:%u: expected %s", path, line, expected);
    return false;
}

// "time x y z tx ty tz [yfov]"; `numbers` is how many the line must have, 0: 7 or 8, which it is set to.
static bool pose_read(const char *path, uint32_t line, char *text, uint32_t *numbers, double values[8])
{
    uint32_t count = 0;
    char *save;
    for (char *word = strtok_r(text, " \t\r", &save); word; word = strtok_r(NULL, " \t\r", &save)) {
        char *end;
        const double value = strtod(word, &end);
        if (*end || !(fabs(value) <= number_max) || count == 8) {
            return walk_refuse(path, line, "7 or 8 numbers: time, position, target and maybe yfov");
        }
        values[count++] = value;
    }
    if (count < 7 || (*numbers && count != *numbers)) {
        return walk_refuse(path, line,
                           *numbers == 7   ? "7 numbers, as in the first line: time, position and target"
                           : *numbers == 8 ? "8 numbers, as in the first line: time, position, target and yfov"
                                           : "7 or 8 numbers: time, position, target and maybe yfov");
    }
    *numbers = count;
    return (count < 8 || (values[7] > 0 && values[7] < pi)) ||
           walk_refuse(path, line, "a yfov greater than 0 and less than pi");
}

typedef struct walk {
    double *times;
    float *positions, *targets, *yfovs;
    uint32_t count, numbers;
} walk;

static bool walk_pose_add(const char *path, uint32_t line, char *text, walk *w)
{
    double values[8];
    if (!pose_read(path, line, text, &w->numbers, values)) {
        return false;
    }
    if (w->count > 0 && values[0] <= w->times[w->count - 1]) {
        return walk_refuse(path, line, "a time after that of the pose before");
    }
    w->times[w->count] = values[0];
    for (int k = 0; k < 3; k++) {
        w->positions[3 * w->count + k] = (float)values[1 + k];
        w->targets[3 * w->count + k] = (float)values[4 + k];
    }
    w->yfovs[w->count++] = w->numbers == 8 ? (float)values[7] : 0;
    return true;
}

static playback_curve walk_curve(const walk *w, const float *values, uint32_t width)
{
    return (playback_curve){
        .width = width, .key_count = w->count, .times = w->times, .values = values, .interpolation = PLAYBACK_LINEAR};
}

static bool walk_parse(const reader *r, const char *path, char *text, playback_camera *camera)
{
    uint32_t lines = 1;
    for (const char *c = text; *c; c++) {
        lines += *c == '\n';
    }
    walk w = {
        .times = arena_alloc(r->memory, lines * sizeof(double)),
        .positions = arena_alloc(r->memory, lines * 3 * sizeof(float)),
        .targets = arena_alloc(r->memory, lines * 3 * sizeof(float)),
        .yfovs = arena_alloc(r->memory, lines * sizeof(float)),
    };
    uint32_t line = 1;
    for (char *from = text, *next; from; from = next, line++) {
        next = strchr(from, '\n');
        if (next) {
            *next++ = '\0';
        }
        from += strspn(from, " \t\r");
        if (*from && *from != '#' && !walk_pose_add(path, line, from, &w)) {
            return false;
        }
    }
    if (w.count == 0) {
        return walk_refuse(path, line - 1, "at least one pose, got none");
    }
    camera->position = walk_curve(&w, w.positions, 3);
    camera->target = walk_curve(&w, w.targets, 3);
    camera->yfov = walk_curve(&w, w.yfovs, w.numbers == 8);
    return true;
}

static bool walk_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    const char *name;
    size_t size;
    const key_info as_string = {.name = key->name};
    if (!string_read(r, json, &as_string, &name)) {
        return false;
    }
    const char *const path = path_of(r, name);
    char *const text = (char *)file_read(path, &size);
    if (!text) {
        return false;
    }
    r->script->hash = json_hash_add(r->script->hash, text, size);
    const bool ok = walk_parse(r, path, text, object);
    free(text);
    return ok;
}

static bool camera_finish(const reader *r, const cJSON *json, void *object)
{
    playback_camera *const camera = object;
    static const char *const ways[] = {"camera", "keys", "orbit", "walk"};
    uint32_t given = 0;
    for (size_t i = 0; i < countof(ways); i++) {
        given += cJSON_GetObjectItemCaseSensitive(json, ways[i]) != NULL;
    }
    if (given != 1) {
        return refuse(r, json, "a camera",
                      arena_printf(r->memory, "expected one of camera, keys, orbit, walk, got %u of them", given));
    }
    camera->line = json_file_line(r->file, json);
    return track_finish(r, json, &camera_track, camera);
}

static const key_info camera_keys[] = {
    {.name = "start", .read = double_read, .offset = offsetof(playback_camera, start), .max = FRAMES_MAX},
    {.name = "camera", .read = string_read, .offset = offsetof(playback_camera, name)},
    {.name = "keys", .read = later_read},
    {.name = "interpolation", .read = later_read},
    {.name = "orbit", .read = orbit_read},
    {.name = "walk", .read = walk_read},
    {.name = "yfov",
     .read = float_read,
     .offset = offsetof(playback_camera, orbit.yfov),
     .max = 3.1415,
     .above_min = true},
    {.name = "znear", .read = float_read, .offset = offsetof(playback_camera, znear), .max = 1e6, .above_min = true},
    {.name = "cut", .read = bool_read, .offset = offsetof(playback_camera, cut)},
};
static const playback_camera camera_initial = {.cut = true};
static const object_info camera_info = {
    .what = "a camera",
    .keys = camera_keys,
    .key_count = countof(camera_keys),
    .size = sizeof(playback_camera),
    .initial = &camera_initial,
    .finish = camera_finish,
};

// ---- Lights

static const key_member light_members[] = {
    {.name = "color", .width = 3, .offset = offsetof(playback_light, color), .max = 1e30},
    {.name = "intensity", .width = 1, .offset = offsetof(playback_light, intensity), .max = 1e30},
    {.name = "position", .width = 3, .offset = offsetof(playback_light, position)},
    {.name = "direction", .width = 3, .offset = offsetof(playback_light, direction)},
};
static const track_info light_track = {light_members, countof(light_members), 0};

static const char *const light_types[] = {
    [LIGHT_POINT] = "point", [LIGHT_SPOT] = "spot", [LIGHT_DIRECTIONAL] = "directional"};

static bool light_type_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    return name_take(r, json, key->name, light_types, countof(light_types), (uint32_t *)((char *)object + key->offset));
}

static bool light_name_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    playback_light *const light = object;
    light->added = strcmp(key->name, "name") == 0;
    return string_read(r, json, key, object);
}

// What only a new light has.
static const char *const new_light_keys[] = {"type",      "color",          "intensity",     "position",
                                             "direction", "innerConeAngle", "outerConeAngle"};

static bool light_finish(const reader *r, const cJSON *json, void *object)
{
    playback_light *const light = object;
    light->line = json_file_line(r->file, json);
    const bool has_name = cJSON_GetObjectItemCaseSensitive(json, "name"),
               has_light = cJSON_GetObjectItemCaseSensitive(json, "light");
    if (has_name == has_light) {
        return refuse(r, json, "a light", "expected either \"light\", of the scene, or \"name\", of a new one");
    }
    for (size_t i = 0; i < countof(new_light_keys); i++) {
        const cJSON *const given = cJSON_GetObjectItemCaseSensitive(json, new_light_keys[i]);
        if (given && !light->added) {
            return refuse(r, given, new_light_keys[i], "expected in the keys, as the light is one of the scene");
        }
    }
    if (light->added && !cJSON_GetObjectItemCaseSensitive(json, "type")) {
        return refuse(r, json, "a new light", "expected \"type\"");
    }
    if (!light->added && !cJSON_GetObjectItemCaseSensitive(json, "keys")) {
        return refuse(r, json, "a light", "expected \"keys\"");
    }
    if (light->type == LIGHT_SPOT && light->inner_cone >= light->outer_cone) {
        return refuse(r, json, "a spot light", "expected an innerConeAngle less than its outerConeAngle");
    }
    return track_finish(r, json, &light_track, light);
}

static const key_info light_keys[] = {
    {.name = "light", .read = light_name_read, .offset = offsetof(playback_light, name)},
    {.name = "name", .read = light_name_read, .offset = offsetof(playback_light, name)},
    {.name = "type", .read = light_type_read, .offset = offsetof(playback_light, type)},
    {.name = "color",
     .read = floats_read,
     .offset = offsetof(playback_light, base_color),
     .count_offset = 3,
     .max = 1e30},
    {.name = "intensity", .read = float_read, .offset = offsetof(playback_light, base_intensity), .max = 1e30},
    {.name = "position", .read = floats_read, .offset = offsetof(playback_light, base_position), .count_offset = 3},
    {.name = "direction", .read = floats_read, .offset = offsetof(playback_light, base_direction), .count_offset = 3},
    {.name = "innerConeAngle", .read = float_read, .offset = offsetof(playback_light, inner_cone), .max = 1.5707964},
    {.name = "outerConeAngle",
     .read = float_read,
     .offset = offsetof(playback_light, outer_cone),
     .max = 1.5707964,
     .above_min = true},
    {.name = "keys", .read = later_read},
    {.name = "interpolation", .read = later_read},
};
static const playback_light light_initial = {
    .node = SCENE_NONE,
    .outer_cone = 0.78539816f,
    .base_color = {1, 1, 1},
    .base_intensity = 1,
    .base_direction = {0, -1, 0},
};
static const object_info light_info = {
    .what = "a light",
    .keys = light_keys,
    .key_count = countof(light_keys),
    .size = sizeof(playback_light),
    .initial = &light_initial,
    .finish = light_finish,
};

// ---- Nodes and clips

static const key_member node_members[] = {
    {.name = "translation", .width = 3, .offset = offsetof(playback_node, translation)},
    {.name = "rotation", .width = 4, .offset = offsetof(playback_node, rotation), .rotation = true},
    {.name = "scale", .width = 3, .offset = offsetof(playback_node, scale)},
};
static const track_info node_track = {node_members, countof(node_members), 0};

static bool node_finish(const reader *r, const cJSON *json, void *object)
{
    playback_node *const node = object;
    node->line = json_file_line(r->file, json);
    return track_finish(r, json, &node_track, node);
}

static const key_info node_keys[] = {
    {.name = "node", .read = string_read, .offset = offsetof(playback_node, name), .required = true},
    {.name = "keys", .read = later_read, .required = true},
    {.name = "interpolation", .read = later_read},
};
static const object_info node_info = {.what = "a node",
                                      .keys = node_keys,
                                      .key_count = countof(node_keys),
                                      .size = sizeof(playback_node),
                                      .finish = node_finish};

static bool clip_finish(const reader *r, const cJSON *json, void *object)
{
    ((playback_clip *)object)->line = json_file_line(r->file, json);
    return true;
}

static const key_info clip_keys[] = {
    {.name = "clip", .read = string_read, .offset = offsetof(playback_clip, name), .required = true},
    {.name = "start", .read = double_read, .offset = offsetof(playback_clip, start), .max = FRAMES_MAX},
    {.name = "speed", .read = float_read, .offset = offsetof(playback_clip, speed), .min = -1000, .max = 1000},
    {.name = "loop", .read = bool_read, .offset = offsetof(playback_clip, loop)},
};
static const playback_clip clip_initial = {.speed = 1};
static const object_info clip_info = {
    .what = "an animation",
    .keys = clip_keys,
    .key_count = countof(clip_keys),
    .size = sizeof(playback_clip),
    .initial = &clip_initial,
    .finish = clip_finish,
};

// ---- Events

typedef struct file_event { // as it is in the file
    playback_event event;
    double time;
    bool cut;
} file_event;

static bool event_settings_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    (void)key;
    playback_event *const event = &((file_event *)object)->event;
    return settings_take(r, json, true, &event->settings, &event->setting_count);
}

static const struct {
    const char *key, *with; // the second is needed with the first and with nothing else; NULL: none
    playback_event_type type;
} event_types[] = {
    {"light", "on", PLAYBACK_LIGHT_SWITCH},
    {"node", "visible", PLAYBACK_NODE_SWITCH},
    {"settings", NULL, PLAYBACK_SETTINGS},
    {"cut", NULL, PLAYBACK_CUT},
};

static bool event_finish(const reader *r, const cJSON *json, void *object)
{
    file_event *const e = object;
    uint32_t given = 0;
    e->event.line = json_file_line(r->file, json);
    for (size_t i = 0; i < countof(event_types); i++) {
        const char *const with = event_types[i].with;
        const bool has = cJSON_GetObjectItemCaseSensitive(json, event_types[i].key),
                   has_with = with && cJSON_GetObjectItemCaseSensitive(json, with);
        if (with && has != has_with) {
            return refuse(r, json, "an event",
                          arena_printf(r->memory, "expected \"%s\" and \"%s\" together", event_types[i].key, with));
        }
        given += has;
        e->event.type = has ? event_types[i].type : e->event.type;
    }
    const cJSON *const cut = cJSON_GetObjectItemCaseSensitive(json, "cut");
    if (cut && !e->cut) {
        return refuse_value(r, cut, "cut", "true");
    }
    return given == 1 ||
           refuse(r, json, "an event",
                  arena_printf(r->memory, "expected one of light, node, settings, cut, got %u of them", given));
}

static const key_info event_keys[] = {
    {.name = "time", .read = double_read, .offset = offsetof(file_event, time), .max = FRAMES_MAX, .required = true},
    {.name = "light", .read = string_read, .offset = offsetof(file_event, event.name)},
    {.name = "on", .read = bool_read, .offset = offsetof(file_event, event.on)},
    {.name = "node", .read = string_read, .offset = offsetof(file_event, event.name)},
    {.name = "visible", .read = bool_read, .offset = offsetof(file_event, event.on)},
    {.name = "settings", .read = event_settings_read},
    {.name = "cut", .read = bool_read, .offset = offsetof(file_event, cut)},
};
static const object_info event_info = {.what = "an event",
                                       .keys = event_keys,
                                       .key_count = countof(event_keys),
                                       .size = sizeof(file_event),
                                       .finish = event_finish};

// ---- The script

typedef struct file_script {
    playback *script;
    const char *scene;
    double duration, frame_rate;
    file_event *events;
    uint32_t event_count;
} file_script;

#define LIST(key, field, count, info)                                                                                  \
    {                                                                                                                  \
        .name = key, .read = script_list_read, .offset = offsetof(playback, field),                                    \
        .count_offset = offsetof(playback, count), .items = &(info)                                                    \
    }

static bool script_list_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    (void)object;
    return list_read(r, json, key, r->script);
}

static bool outputs_read(const reader *r, const cJSON *json, const key_info *key, void *object)
{
    (void)object;
    playback *const script = r->script;
    if (!cJSON_IsArray(json) || cJSON_GetArraySize(json) == 0) {
        return refuse_value(r, json, key->name, "a list of at least one name [...]");
    }
    const uint32_t count = (uint32_t)cJSON_GetArraySize(json);
    script->outputs = arena_alloc(r->memory, count * sizeof(*script->outputs));
    script->output_lines = arena_alloc(r->memory, count * sizeof(*script->output_lines));
    for (const cJSON *child = json->child; child; child = child->next) {
        const key_info as_string = {.name = key->name};
        if (!string_read(r, child, &as_string, &script->outputs[script->output_count])) {
            return false;
        }
        script->output_lines[script->output_count++] = json_file_line(r->file, child);
    }
    return true;
}

static const key_info script_keys[] = {
    {.name = "scene", .read = string_read, .offset = offsetof(file_script, scene), .required = true},
    {.name = "duration",
     .read = double_read,
     .offset = offsetof(file_script, duration),
     .max = FRAMES_MAX,
     .above_min = true,
     .required = true},
    {.name = "frame_rate",
     .read = double_read,
     .offset = offsetof(file_script, frame_rate),
     .max = 1000,
     .above_min = true},
    {.name = "size", .read = script_setting_read},
    {.name = "seed", .read = script_setting_read},
    {.name = "settings", .read = script_settings_read},
    {.name = "outputs", .read = outputs_read},
    LIST("cameras", cameras, camera_count, camera_info),
    LIST("lights", lights, light_count, light_info),
    LIST("nodes", nodes, node_count, node_info),
    LIST("animations", clips, clip_count, clip_info),
    {.name = "events",
     .read = list_read,
     .offset = offsetof(file_script, events),
     .count_offset = offsetof(file_script, event_count),
     .items = &event_info},
};
static const object_info script_info = {
    .what = "a script", .keys = script_keys, .key_count = countof(script_keys), .size = sizeof(file_script)};

static bool cameras_finish(const reader *r)
{
    const playback *const script = r->script;
    for (uint32_t i = 0; i < script->camera_count; i++) {
        playback_camera *const camera = &script->cameras[i];
        camera->first_frame = frame_of(r, camera->start);
        if (i == 0 ? camera->start != 0 : camera->start <= camera[-1].start) {
            log_error("%s:%u: start: expected %s, got %g", script->path, camera->line,
                      i == 0 ? "0 of the first camera" : "a time after the camera before", camera->start);
            return false;
        }
    }
    return true;
}

// Every frame must have a picture, also where a spline swings beyond its keys.
static bool poses_check(const reader *r)
{
    const playback *const script = r->script;
    for (uint32_t frame = 0; frame < script->frame_count; frame++) {
        const playback_camera *const camera = playback_camera_of(script, frame);
        if (!camera || camera->name) {
            continue;
        }
        const playback_pose pose = playback_pose_at(script, camera, frame);
        bool seen = false;
        for (int k = 0; k < 3; k++) {
            seen = seen || pose.position[k] != pose.target[k];
        }
        if (!seen || pose.yfov < 0 || (double)pose.yfov >= pi) {
            log_error("%s:%u: a camera: expected %s in each frame, got %g in frame %u", script->path, camera->line,
                      seen ? "a yfov greater than 0 and less than pi" : "a position away from the target",
                      seen ? (double)pose.yfov : 0, frame);
            return false;
        }
    }
    return true;
}

static bool light_names_check(const reader *r)
{
    const playback *const script = r->script;
    for (uint32_t i = 0; i < script->light_count; i++) {
        for (uint32_t k = 0; k < i; k++) {
            if (strcmp(script->lights[i].name, script->lights[k].name) == 0) {
                log_error("%s:%u: \"%s\": expected one track a light, and there is one in line %u", script->path,
                          script->lights[i].line, script->lights[i].name, script->lights[k].line);
                return false;
            }
        }
    }
    return true;
}

static bool events_finish(const reader *r, const file_script *from)
{
    playback *const script = r->script;
    script->events = arena_alloc(r->memory, from->event_count * sizeof(*script->events) + 1);
    for (uint32_t i = 0; i < from->event_count; i++) {
        const file_event *const e = &from->events[i];
        const bool ordered = i == 0 || e->time >= e[-1].time;
        if (!ordered || e->time > script->duration) {
            log_error("%s:%u: time: expected %s, got %g", script->path, e->event.line,
                      ordered ? arena_printf(r->memory, "at most the duration, %g", script->duration)
                              : arena_printf(r->memory, "none before the event above, at %g", e[-1].time),
                      e->time);
            return false;
        }
        script->events[script->event_count] = e->event;
        script->events[script->event_count++].frame = frame_of(r, e->time);
    }
    return true;
}

static bool script_finish(const reader *r, const file_script *from)
{
    playback *const script = r->script;
    const double frames = round(from->duration * from->frame_rate);
    if (frames > FRAMES_MAX) {
        log_error("%s: duration * frame_rate: expected at most %d frames, got %.0f", script->path, FRAMES_MAX, frames);
        return false;
    }
    static const char *png = "png";
    script->scene = path_of(r, from->scene);
    script->duration = from->duration;
    script->frame_rate = from->frame_rate;
    script->frame_count = (uint32_t)fmax(1, frames);
    if (script->output_count == 0) {
        script->outputs = &png;
        script->output_count = 1;
    }
    return cameras_finish(r) && poses_check(r) && light_names_check(r) && events_finish(r, from);
}

playback *playback_load(const char *path)
{
    json_file file;
    if (!json_file_read(&file, path)) {
        json_file_fini(&file);
        return NULL;
    }
    arena memory = {0};
    playback *const script = arena_alloc(&memory, sizeof(*script));
    script->memory = memory;
    script->path = arena_strdup(&script->memory, path);
    script->folder = dirname(arena_strdup(&script->memory, path));
    script->hash = file.hash;
    const reader r = {.script = script, .file = &file, .memory = &script->memory};
    file_script read = {.script = script, .frame_rate = 30};
    const bool ok = object_read(&r, file.root, &script_info, &read) && script_finish(&r, &read);
    json_file_fini(&file);
    if (!ok) {
        playback_destroy(script);
        return NULL;
    }
    return script;
}
