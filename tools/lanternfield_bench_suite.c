// Suites of `lanternfield bench`: reads the JSON by tables of keys, spells sweeps out, and checks that what is named
// exists. The first error is logged with its place, and ends the reading.
#include "lanternfield_bench.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- What is in the file, where it differs from what becomes of it

typedef struct setting_list {
    bench_setting *items;
    uint32_t count;
} setting_list;
typedef struct sweep { // one option and its values
    const char *name;
    const char **values;
    uint32_t count;
} sweep;
typedef struct file_view {
    bench_view view;
    const float *sun; // NULL: none
    setting_list settings;
} file_view;
typedef struct file_configuration {
    bench_configuration configuration;
    setting_list settings;
    sweep *sweeps;
    uint32_t sweep_count;
} file_configuration;
typedef struct file_reference {
    bench_reference reference;
    setting_list settings;
} file_reference;
typedef struct file_suite {
    bench_suite suite;
    setting_list settings;
    file_view *views;
    file_configuration *configurations;
    file_reference *references;
    uint32_t configuration_count;
} file_suite;

typedef struct reader {
    const char *path;
    arena *memory;
} reader;

static bool refuse(const reader *reader, const char *place, const char *expected)
{
    log_error("%s: %s: %s", reader->path, place, expected);
    return false;
}

// ---- Objects, by tables of keys

typedef struct key_info key_info;
typedef bool (*key_reader)(const reader *reader, const char *place, const cJSON *json, const key_info *key,
                           void *object);
typedef struct object_info {
    const key_info *keys;
    size_t key_count, size;
    const void *initial; // NULL: zero
} object_info;
struct key_info {
    const char *name;
    key_reader read;
    size_t offset; // of the member in the object
    size_t count_offset; // lists: of the uint32_t with their length
    bool required;
    const object_info *items; // lists of objects
};

static const key_info *key_find(const object_info *info, const char *name)
{
    for (size_t i = 0; i < info->key_count; i++) {
        if (strcmp(info->keys[i].name, name) == 0) {
            return &info->keys[i];
        }
    }
    return NULL;
}

static const char *key_names(const reader *reader, const object_info *info)
{
    const char *names = "";
    for (size_t i = 0; i < info->key_count; i++) {
        names = arena_printf(reader->memory, "%s%s%s", names, i ? ", " : "", info->keys[i].name);
    }
    return names;
}

static const char *place_of(const reader *reader, const char *place, const char *name)
{
    return arena_printf(reader->memory, "%s%s%s", place, *place ? "." : "", name);
}

static bool object_read(const reader *reader, const char *place, const cJSON *json, const object_info *info,
                        void *object)
{
    if (!cJSON_IsObject(json)) {
        return refuse(reader, *place ? place : "the file", "expected an object {...}");
    }
    uint64_t seen = 0;
    assert(info->key_count <= 64);
    for (const cJSON *child = json->child; child; child = child->next) {
        const char *const child_place = place_of(reader, place, child->string);
        const key_info *const key = key_find(info, child->string);
        if (!key) {
            return refuse(reader, child_place,
                          arena_printf(reader->memory, "unknown key; expected one of %s", key_names(reader, info)));
        }
        const uint64_t bit = (uint64_t)1 << (key - info->keys);
        if (seen & bit) {
            return refuse(reader, child_place, "given twice");
        }
        seen |= bit;
        if (!key->read(reader, child_place, child, key, object)) {
            return false;
        }
    }
    for (size_t i = 0; i < info->key_count; i++) {
        if (info->keys[i].required && !(seen >> i & 1)) {
            return refuse(reader, place_of(reader, place, info->keys[i].name), "missing");
        }
    }
    return true;
}

// ---- Values

static bool string_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    if (!cJSON_IsString(json) || !*json->valuestring) {
        return refuse(reader, place, "expected a string that is not empty");
    }
    *(const char **)((char *)object + key->offset) = arena_strdup(reader->memory, json->valuestring);
    return true;
}

// A prefix may be empty, which is as good as none.
static bool prefix_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    return (cJSON_IsString(json) && !*json->valuestring) || string_read(reader, place, json, key, object);
}

static bool file_name_read(const reader *reader, const char *place, const cJSON *json, const key_info *key,
                           void *object)
{
    if (!string_read(reader, place, json, key, object)) {
        return false;
    }
    const char *const allowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
    return strspn(json->valuestring, allowed) == strlen(json->valuestring) ||
           refuse(reader, place, "expected letters, digits, - and _, for it names a file or a column");
}

static bool strings_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    const uint32_t count = cJSON_IsArray(json) ? (uint32_t)cJSON_GetArraySize(json) : 0;
    if (count == 0) {
        return refuse(reader, place, "expected a list of strings [\"...\"] that is not empty");
    }
    const char **const strings = arena_alloc(reader->memory, count * sizeof(char *));
    uint32_t i = 0;
    for (const cJSON *item = json->child; item; item = item->next, i++) {
        const key_info string = {.offset = i * sizeof(char *)};
        if (!string_read(reader, arena_printf(reader->memory, "%s[%u]", place, i), item, &string, strings)) {
            return false;
        }
    }
    *(const char ***)((char *)object + key->offset) = strings;
    if (key->count_offset) {
        *(uint32_t *)((char *)object + key->count_offset) = count;
    }
    return true;
}

static bool count_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    const double value = json->valuedouble;
    if (!cJSON_IsNumber(json) || value < 0 || value > 1000 || value != floor(value)) {
        return refuse(reader, place, "expected a whole number from 0 to 1000");
    }
    *(uint32_t *)((char *)object + key->offset) = (uint32_t)value;
    return true;
}

static bool number_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    if (!cJSON_IsNumber(json) || !isfinite(json->valuedouble)) {
        return refuse(reader, place, "expected a number");
    }
    *(double *)((char *)object + key->offset) = json->valuedouble;
    return true;
}

static bool number_or_null_read(const reader *reader, const char *place, const cJSON *json, const key_info *key,
                                void *object)
{
    return cJSON_IsNull(json) || number_read(reader, place, json, key, object);
}

static bool seconds_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    return (cJSON_IsNumber(json) && json->valuedouble > 0 && number_read(reader, place, json, key, object)) ||
           refuse(reader, place, "expected a number of seconds greater than 0");
}

static bool switch_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    if (!cJSON_IsBool(json)) {
        return refuse(reader, place, "expected true or false");
    }
    *(bool *)((char *)object + key->offset) = cJSON_IsTrue(json);
    return true;
}

static bool sun_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    static const char expected[] = "expected [dx, dy, dz, lux] with a direction that is not zero and at least 0 lux";
    if (!cJSON_IsArray(json) || cJSON_GetArraySize(json) != 4) {
        return refuse(reader, place, expected);
    }
    float *const sun = arena_alloc(reader->memory, 4 * sizeof(float));
    uint32_t i = 0;
    for (const cJSON *item = json->child; item; item = item->next, i++) {
        sun[i] = (float)item->valuedouble;
        if (!cJSON_IsNumber(item) || !isfinite(sun[i])) {
            return refuse(reader, place, expected);
        }
    }
    *(const float **)((char *)object + key->offset) = sun;
    return ((sun[0] != 0 || sun[1] != 0 || sun[2] != 0) && sun[3] >= 0) || refuse(reader, place, expected);
}

// ---- Options

// The value as text that settings_set takes, checked; NULL when it cannot be used (logged).
static const char *setting_text(const reader *reader, const char *place, const setting_info *info, const cJSON *json)
{
    const char *text = NULL;
    if (cJSON_IsNumber(json)) {
        text = arena_printf(reader->memory, "%.10g", json->valuedouble);
    } else if (cJSON_IsString(json)) {
        text = arena_strdup(reader->memory, json->valuestring);
    } else if (cJSON_IsBool(json)) {
        text = cJSON_IsTrue(json) ? "true" : "false";
    } else {
        refuse(reader, place, "expected a number, a string, true or false");
        return NULL;
    }
    render_settings scratch = render_settings_default();
    setting_error error;
    if (!settings_set(&scratch, info, text, &error)) {
        refuse(reader, place, error.message + strlen("--: ") + strlen(info->name));
        return NULL;
    }
    return text;
}

// The option of that name, which none of the others sets; NULL when there is none, or it is set twice (logged).
static const setting_info *option_find(const reader *reader, const char *place, const char *name,
                                       const setting_list *others)
{
    for (uint32_t i = 0; i < others->count; i++) {
        if (strcmp(others->items[i].name, name) == 0) {
            refuse(reader, place, "set twice");
            return NULL;
        }
    }
    const setting_info *const info = settings_find(name);
    if (!info) {
        refuse(reader, place, "unknown option; see lanternfield render --help");
        return NULL;
    }
    if (strcmp(name, "target-ms") == 0 || strcmp(name, "target-error") == 0) {
        refuse(reader, place, "a row of a suite has the settings that it names; automatic ones are for render alone");
        return NULL;
    }
    return info;
}

static bool settings_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    if (!cJSON_IsObject(json)) {
        return refuse(reader, place, "expected an object {\"option\": value, ...}");
    }
    setting_list list = {arena_alloc(reader->memory, (size_t)cJSON_GetArraySize(json) * sizeof(bench_setting)), 0};
    for (const cJSON *child = json->child; child; child = child->next) {
        const char *const child_place = place_of(reader, place, child->string);
        const setting_info *const info = option_find(reader, child_place, child->string, &list);
        const char *const text = info ? setting_text(reader, child_place, info, child) : NULL;
        if (!text) {
            return false;
        }
        list.items[list.count++] = (bench_setting){info->name, text};
    }
    *(setting_list *)((char *)object + key->offset) = list;
    return true;
}

static bool sweep_values_read(const reader *reader, const char *place, const cJSON *json, const setting_info *info,
                              sweep *sweep)
{
    const int count = cJSON_IsArray(json) ? cJSON_GetArraySize(json) : 0;
    if (count == 0) {
        return refuse(reader, place, "expected a list of values [...] that is not empty");
    }
    *sweep = (struct sweep){.name = info->name};
    sweep->values = arena_alloc(reader->memory, (size_t)count * sizeof(char *));
    for (const cJSON *item = json->child; item; item = item->next) {
        const char *const item_place = arena_printf(reader->memory, "%s[%u]", place, sweep->count);
        const char *const text = setting_text(reader, item_place, info, item);
        if (!text) {
            return false;
        }
        sweep->values[sweep->count++] = text;
    }
    return true;
}

static bool sweeps_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    if (!cJSON_IsObject(json) || !json->child) {
        return refuse(reader, place, "expected an object {\"option\": [value, ...], ...} that is not empty");
    }
    const size_t count = (size_t)cJSON_GetArraySize(json);
    setting_list names = {arena_alloc(reader->memory, count * sizeof(bench_setting)), 0};
    sweep *const sweeps = arena_alloc(reader->memory, count * sizeof(sweep));
    for (const cJSON *child = json->child; child; child = child->next) {
        const char *const child_place = place_of(reader, place, child->string);
        const setting_info *const info = option_find(reader, child_place, child->string, &names);
        if (!info || !sweep_values_read(reader, child_place, child, info, &sweeps[names.count])) {
            return false;
        }
        names.items[names.count++].name = info->name;
    }
    *(sweep **)((char *)object + key->offset) = sweeps;
    *(uint32_t *)((char *)object + key->count_offset) = names.count;
    return true;
}

static bool list_read(const reader *reader, const char *place, const cJSON *json, const key_info *key, void *object)
{
    const object_info *const info = key->items;
    if (!cJSON_IsArray(json)) {
        return refuse(reader, place, "expected a list of objects [{...}]");
    }
    const uint32_t count = (uint32_t)cJSON_GetArraySize(json);
    char *const items = arena_alloc(reader->memory, count * info->size);
    uint32_t i = 0;
    for (const cJSON *child = json->child; child; child = child->next, i++) {
        void *const item = items + i * info->size;
        if (info->initial) {
            memcpy(item, info->initial, info->size);
        }
        if (!object_read(reader, arena_printf(reader->memory, "%s[%u]", place, i), child, info, item)) {
            return false;
        }
    }
    *(void **)((char *)object + key->offset) = items;
    *(uint32_t *)((char *)object + key->count_offset) = count;
    return true;
}

// ---- The tables: what a suite may say

#define KEY(name, read, type, member)                                                                                  \
    {                                                                                                                  \
        name, read, offsetof(type, member), 0, false, NULL                                                             \
    }
#define NEEDED(name, read, type, member)                                                                               \
    {                                                                                                                  \
        name, read, offsetof(type, member), 0, true, NULL                                                              \
    }
#define LIST(name, read, type, member, count)                                                                          \
    {                                                                                                                  \
        name, read, offsetof(type, member), offsetof(type, count), false, NULL                                         \
    }
#define OBJECT(keys, type, initial)                                                                                    \
    {                                                                                                                  \
        keys, countof(keys), sizeof(type), initial                                                                     \
    }

static const key_info view_keys[] = {
    NEEDED("name", string_read, file_view, view.name),   NEEDED("scene", string_read, file_view, view.scene),
    KEY("camera", string_read, file_view, view.camera),  KEY("sun", sun_read, file_view, sun),
    KEY("settings", settings_read, file_view, settings), KEY("optional", switch_read, file_view, view.optional),
};
static const key_info reference_keys[] = {
    NEEDED("name", file_name_read, file_reference, reference.name),
    NEEDED("settings", settings_read, file_reference, settings),
    KEY("budget_s", seconds_read, file_reference, reference.budget_s),
};
static const key_info configuration_keys[] = {
    KEY("name", prefix_read, file_configuration, configuration.name),
    KEY("series", string_read, file_configuration, configuration.series),
    KEY("label", string_read, file_configuration, configuration.label),
    KEY("settings", settings_read, file_configuration, settings),
    LIST("sweep", sweeps_read, file_configuration, sweeps, sweep_count),
    LIST("views", strings_read, file_configuration, configuration.views, configuration.view_count),
    KEY("time_limit_s", seconds_read, file_configuration, configuration.time_limit_s),
};
static const key_info chart_keys[] = {
    NEEDED("name", file_name_read, bench_chart, name),
    NEEDED("title", string_read, bench_chart, title),
    KEY("x", string_read, bench_chart, x),
    NEEDED("y", string_read, bench_chart, y),
    KEY("x_label", string_read, bench_chart, x_label),
    KEY("y_label", string_read, bench_chart, y_label),
    KEY("x_log", switch_read, bench_chart, x_log),
    KEY("y_log", switch_read, bench_chart, y_log),
    KEY("pareto", switch_read, bench_chart, pareto),
    KEY("labels", switch_read, bench_chart, labels),
    KEY("lines", switch_read, bench_chart, lines),
    KEY("bars", switch_read, bench_chart, bars),
    KEY("per_view", switch_read, bench_chart, per_view),
    LIST("series", strings_read, bench_chart, series, series_count),
};
static const key_info comparison_keys[] = {
    NEEDED("text", string_read, bench_comparison, text),
    NEEDED("metric", string_read, bench_comparison, metric),
    NEEDED("of", string_read, bench_comparison, of),
    KEY("to", string_read, bench_comparison, to),
    KEY("paper", number_or_null_read, bench_comparison, paper),
    KEY("note", string_read, bench_comparison, note),
};
static const key_info table_keys[] = {
    NEEDED("title", string_read, bench_table, title),
    LIST("columns", strings_read, bench_table, columns, column_count),
    KEY("column_titles", strings_read, bench_table, column_titles),
    KEY("metric", string_read, bench_table, metric),
};
static const key_info picture_keys[] = {
    NEEDED("title", string_read, bench_pictures, title),
    LIST("configurations", strings_read, bench_pictures, configurations, configuration_count),
    KEY("what", string_read, bench_pictures, what),
};

static const bench_comparison no_comparison = {.paper = NAN};
static const bench_pictures no_pictures = {.what = "picture"};
static const object_info view_object = OBJECT(view_keys, file_view, NULL);
static const object_info reference_object = OBJECT(reference_keys, file_reference, NULL);
static const object_info configuration_object = OBJECT(configuration_keys, file_configuration, NULL);
static const object_info chart_object = OBJECT(chart_keys, bench_chart, NULL);
static const object_info comparison_object = OBJECT(comparison_keys, bench_comparison, &no_comparison);
static const object_info table_object = OBJECT(table_keys, bench_table, NULL);
static const object_info picture_object = OBJECT(picture_keys, bench_pictures, &no_pictures);

#define OBJECTS(name, member, count, required, info)                                                                   \
    {                                                                                                                  \
        name, list_read, offsetof(file_suite, member), offsetof(file_suite, count), required, &(info)                  \
    }
static const key_info suite_keys[] = {
    NEEDED("name", file_name_read, file_suite, suite.name),
    NEEDED("title", string_read, file_suite, suite.title),
    KEY("description", string_read, file_suite, suite.description),
    KEY("repeats", count_read, file_suite, suite.repeats),
    KEY("warm_up", count_read, file_suite, suite.warm_up),
    KEY("settings", settings_read, file_suite, settings),
    OBJECTS("views", views, suite.view_count, true, view_object),
    OBJECTS("references", references, suite.reference_count, false, reference_object),
    OBJECTS("configurations", configurations, configuration_count, true, configuration_object),
    OBJECTS("charts", suite.charts, suite.chart_count, false, chart_object),
    OBJECTS("comparisons", suite.comparisons, suite.comparison_count, false, comparison_object),
    OBJECTS("tables", suite.tables, suite.table_count, false, table_object),
    OBJECTS("pictures", suite.pictures, suite.picture_count, false, picture_object),
};
static const object_info suite_object = OBJECT(suite_keys, file_suite, NULL);

// ---- From the file to the suite

void bench_settings_apply(render_settings *settings, const bench_setting *items, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        setting_error error;
        const bool ok = settings_set(settings, settings_find(items[i].name), items[i].value, &error);
        assert(ok && "checked when the suite was read");
        (void)ok;
    }
}

static void views_finish(const reader *reader, file_suite *file)
{
    bench_suite *const suite = &file->suite;
    suite->views = arena_alloc(reader->memory, suite->view_count * sizeof(bench_view));
    for (uint32_t v = 0; v < suite->view_count; v++) {
        const file_view *const source = &file->views[v];
        bench_view *const view = &suite->views[v];
        *view = source->view;
        view->has_sun = source->sun != NULL;
        if (source->sun) {
            memcpy(view->sun, source->sun, sizeof(view->sun));
        }
        view->settings = render_settings_default();
        bench_settings_apply(&view->settings, file->settings.items, file->settings.count);
        bench_settings_apply(&view->settings, source->settings.items, source->settings.count);
    }
}

static void references_finish(const reader *reader, file_suite *file)
{
    bench_suite *const suite = &file->suite;
    suite->references = arena_alloc(reader->memory, suite->reference_count * sizeof(bench_reference));
    for (uint32_t i = 0; i < suite->reference_count; i++) {
        suite->references[i] = file->references[i].reference;
        suite->references[i].settings = file->references[i].settings.items;
        suite->references[i].setting_count = file->references[i].settings.count;
    }
}

static uint64_t combinations_count(const file_configuration *source)
{
    uint64_t count = 1;
    for (uint32_t s = 0; s < source->sweep_count; s++) {
        count *= source->sweeps[s].count;
    }
    return count;
}

// Combination `index` of the sweeps; the last one written varies fastest.
static bench_configuration combination_make(const reader *reader, const file_configuration *source, uint64_t index)
{
    bench_configuration made = source->configuration;
    made.setting_count = source->settings.count + source->sweep_count;
    bench_setting *const settings = arena_alloc(reader->memory, made.setting_count * sizeof(bench_setting));
    made.settings = settings;
    if (source->settings.count > 0) {
        memcpy(settings, source->settings.items, source->settings.count * sizeof(bench_setting));
    }
    const char *swept = NULL;
    uint64_t combinations = combinations_count(source);
    for (uint32_t s = 0; s < source->sweep_count; s++) {
        const sweep *const sweep = &source->sweeps[s];
        combinations /= sweep->count;
        const char *const value = sweep->values[index / combinations % sweep->count];
        settings[source->settings.count + s] = (bench_setting){sweep->name, value};
        swept = arena_printf(reader->memory, "%s%s%s=%s", swept ? swept : "", swept ? " " : "", sweep->name, value);
    }
    if (swept) {
        made.name = made.name ? arena_printf(reader->memory, "%s %s", made.name, swept) : swept;
        made.label = made.label ? arena_printf(reader->memory, "%s %s", made.label, swept) : NULL;
    }
    if (!made.series) {
        made.series = source->configuration.name ? source->configuration.name : "sweep";
    }
    return made;
}

static bool configurations_finish(const reader *reader, file_suite *file)
{
    enum { MOST = 10000 };
    bench_suite *const suite = &file->suite;
    uint64_t count = 0;
    for (uint32_t c = 0; c < file->configuration_count; c++) {
        const file_configuration *const source = &file->configurations[c];
        const char *const place = arena_printf(reader->memory, "configurations[%u]", c);
        if (!source->configuration.name && source->sweep_count == 0) {
            return refuse(reader, place_of(reader, place, "name"), "missing");
        }
        for (uint32_t s = 0; s < source->sweep_count; s++) {
            const char *const name = source->sweeps[s].name;
            const char *const sweep_place = place_of(reader, place_of(reader, place, "sweep"), name);
            if (!option_find(reader, sweep_place, name, &source->settings)) {
                return false;
            }
        }
        count += combinations_count(source);
        if (count > MOST) {
            return refuse(reader, place, "there are more than 10000 configurations");
        }
    }
    suite->configurations = arena_alloc(reader->memory, count * sizeof(bench_configuration));
    for (uint32_t c = 0; c < file->configuration_count; c++) {
        const uint64_t combinations = combinations_count(&file->configurations[c]);
        for (uint64_t i = 0; i < combinations; i++) {
            suite->configurations[suite->configuration_count++] = combination_make(reader, &file->configurations[c], i);
        }
    }
    return true;
}

// ---- What is named must exist, and once

// Names of things in a list: items of `size` bytes, whose member at `offset` is the name.
typedef struct name_list {
    const char *what;
    const void *items;
    uint32_t count;
    size_t size, offset;
} name_list;

static const char *name_at(const name_list *list, uint32_t i)
{
    return *(const char *const *)((const char *)list->items + i * list->size + list->offset);
}

static bool name_exists(const name_list *list, const char *name)
{
    for (uint32_t i = 0; i < list->count; i++) {
        if (strcmp(name_at(list, i), name) == 0) {
            return true;
        }
    }
    return false;
}

static bool names_check_unique(const reader *reader, const name_list *list)
{
    for (uint32_t i = 0; i < list->count; i++) {
        const name_list before = {list->what, list->items, i, list->size, list->offset};
        if (name_exists(&before, name_at(list, i))) {
            return refuse(reader, arena_printf(reader->memory, "%ss", list->what),
                          arena_printf(reader->memory, "two are named \"%s\"", name_at(list, i)));
        }
    }
    return true;
}

static bool name_check(const reader *reader, const char *place, const name_list *list, const char *name)
{
    return !name || name_exists(list, name) ||
           refuse(reader, place, arena_printf(reader->memory, "there is no %s \"%s\"", list->what, name));
}

static bool names_check(const reader *reader, const char *place, const name_list *list, const char *const *names,
                        uint32_t count)
{
    bool ok = true;
    for (uint32_t i = 0; ok && i < count; i++) {
        ok = name_check(reader, arena_printf(reader->memory, "%s[%u]", place, i), list, names[i]);
    }
    return ok;
}

static bool metric_check(const reader *reader, const char *place, const bench_suite *suite, const char *metric)
{
    return !metric || bench_metric_known(suite, metric) ||
           refuse(reader, place, arena_printf(reader->memory, "unknown metric \"%s\"", metric));
}

#define NAMES(what, suite, list, count, type, member)                                                                  \
    {                                                                                                                  \
        what, (suite)->list, (suite)->count, sizeof(type), offsetof(type, member)                                      \
    }

static bool charts_check(const reader *reader, const bench_suite *suite)
{
    const name_list series = NAMES("series", suite, configurations, configuration_count, bench_configuration, series);
    bool ok = true;
    for (uint32_t i = 0; ok && i < suite->chart_count; i++) {
        const bench_chart *const chart = &suite->charts[i];
        const char *const place = arena_printf(reader->memory, "charts[%u]", i);
        if (!chart->x && !chart->bars) {
            return refuse(reader, place_of(reader, place, "x"), "missing; only bars do without");
        }
        const bool by_configuration = chart->bars && chart->x && strcmp(chart->x, "configuration") == 0;
        ok = (by_configuration || metric_check(reader, place_of(reader, place, "x"), suite, chart->x)) &&
             metric_check(reader, place_of(reader, place, "y"), suite, chart->y) &&
             names_check(reader, place_of(reader, place, "series"), &series, chart->series, chart->series_count);
    }
    return ok;
}

static bool tables_check(const reader *reader, const bench_suite *suite)
{
    for (uint32_t i = 0; i < suite->table_count; i++) {
        const bench_table *const table = &suite->tables[i];
        const char *const place = arena_printf(reader->memory, "tables[%u]", i);
        if (!table->columns == !table->metric) {
            return refuse(reader, place, "expected either columns or metric");
        }
        if (!metric_check(reader, place_of(reader, place, "metric"), suite, table->metric)) {
            return false;
        }
        for (uint32_t c = 0; c < table->column_count; c++) {
            if (!metric_check(reader, arena_printf(reader->memory, "%s.columns[%u]", place, c), suite,
                              table->columns[c])) {
                return false;
            }
        }
    }
    return true;
}

// The titles are as many as the columns: their number is in the file alone.
static bool column_titles_check(const reader *reader, const cJSON *json)
{
    uint32_t i = 0;
    const cJSON *const tables = cJSON_GetObjectItemCaseSensitive(json, "tables");
    for (const cJSON *table = tables ? tables->child : NULL; table; table = table->next, i++) {
        const cJSON *const titles = cJSON_GetObjectItemCaseSensitive(table, "column_titles");
        const cJSON *const columns = cJSON_GetObjectItemCaseSensitive(table, "columns");
        if (titles && (!columns || cJSON_GetArraySize(titles) != cJSON_GetArraySize(columns))) {
            return refuse(reader, arena_printf(reader->memory, "tables[%u].column_titles", i),
                          "expected as many as there are columns");
        }
    }
    return true;
}

static bool comparisons_check(const reader *reader, const bench_suite *suite, const name_list *configurations)
{
    bool ok = true;
    for (uint32_t i = 0; ok && i < suite->comparison_count; i++) {
        const bench_comparison *const comparison = &suite->comparisons[i];
        const char *const place = arena_printf(reader->memory, "comparisons[%u]", i);
        ok = metric_check(reader, place_of(reader, place, "metric"), suite, comparison->metric) &&
             name_check(reader, place_of(reader, place, "of"), configurations, comparison->of) &&
             name_check(reader, place_of(reader, place, "to"), configurations, comparison->to);
    }
    return ok;
}

static bool pictures_check(const reader *reader, const bench_suite *suite, const name_list *configurations)
{
    static const char *const kinds[] = {"picture", "lights-per-pixel", "flip"};
    const name_list kind_names = {"kind of picture", kinds, countof(kinds), sizeof(char *), 0};
    bool ok = true;
    for (uint32_t i = 0; ok && i < suite->picture_count; i++) {
        const bench_pictures *const pictures = &suite->pictures[i];
        const char *const place = arena_printf(reader->memory, "pictures[%u]", i);
        ok = name_check(reader, place_of(reader, place, "what"), &kind_names, pictures->what) &&
             names_check(reader, place_of(reader, place, "configurations"), configurations, pictures->configurations,
                         pictures->configuration_count);
    }
    return ok;
}

static bool suite_check(const reader *reader, const file_suite *file)
{
    const bench_suite *const suite = &file->suite;
    const name_list views = NAMES("view", suite, views, view_count, bench_view, name);
    const name_list references = NAMES("reference", suite, references, reference_count, bench_reference, name);
    const name_list configurations =
        NAMES("configuration", suite, configurations, configuration_count, bench_configuration, name);
    const name_list charts = NAMES("chart", suite, charts, chart_count, bench_chart, name);
    if (suite->repeats == 0) {
        return refuse(reader, "repeats", "expected at least 1");
    }
    if (suite->view_count == 0 || suite->configuration_count == 0) {
        return refuse(reader, suite->view_count ? "configurations" : "views", "expected at least one");
    }
    bool ok = names_check_unique(reader, &views) && names_check_unique(reader, &references) &&
              names_check_unique(reader, &configurations) && names_check_unique(reader, &charts);
    for (uint32_t c = 0; ok && c < file->configuration_count; c++) {
        const bench_configuration *const configuration = &file->configurations[c].configuration;
        ok = names_check(reader, arena_printf(reader->memory, "configurations[%u].views", c), &views,
                         configuration->views, configuration->view_count);
    }
    return ok && charts_check(reader, suite) && tables_check(reader, suite) &&
           comparisons_check(reader, suite, &configurations) && pictures_check(reader, suite, &configurations);
}

// ---- The file

static cJSON *json_read(const char *path)
{
    size_t size;
    char *const text = (char *)file_read(path, &size);
    if (!text) {
        return NULL;
    }
    const char *end = text;
    cJSON *const json = cJSON_ParseWithOpts(text, &end, true);
    if (!json) {
        uint32_t line = 1;
        for (const char *c = text; c < end; c++) {
            line += *c == '\n';
        }
        const size_t rest = strcspn(end, "\r\n");
        log_error("%s:%u: not JSON from here on: \"%.*s\"", path, line, rest < 40 ? (int)rest : 40, end);
    }
    free(text);
    return json;
}

bench_suite *bench_suite_read(const char *path)
{
    cJSON *const json = json_read(path);
    if (!json) {
        return NULL;
    }
    arena memory = {0};
    const reader reader = {path, &memory};
    file_suite *const file = arena_alloc(&memory, sizeof(file_suite));
    file->suite.repeats = 3;
    file->suite.warm_up = 1;
    bool ok = object_read(&reader, "", json, &suite_object, file) && configurations_finish(&reader, file);
    if (ok) {
        views_finish(&reader, file);
        references_finish(&reader, file);
        ok = suite_check(&reader, file) && column_titles_check(&reader, json);
    }
    cJSON_Delete(json);
    if (!ok) {
        arena_fini(&memory);
        return NULL;
    }
    bench_suite *const suite = memory_alloc(sizeof(bench_suite));
    *suite = file->suite;
    suite->path = arena_strdup(&memory, path);
    suite->memory = memory;
    return suite;
}

void bench_suite_destroy(bench_suite *suite)
{
    if (suite) {
        arena_fini(&suite->memory);
        free(suite);
    }
}
