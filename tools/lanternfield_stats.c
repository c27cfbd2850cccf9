// Timings over the frames, and the statistics file.
#include "lanternfield.h"

#include "modules/automatic_system.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- Timings

static void time_series_add(time_series *series, double milliseconds)
{
    memory_reserve((void **)&series->milliseconds, &series->capacity, series->count + 1, sizeof(double));
    series->milliseconds[series->count++] = milliseconds;
}

// The series of that name, which is made when it is new.
static time_series *time_series_find(arena *names, time_series **all, size_t *count, size_t *capacity, const char *name)
{
    for (size_t i = 0; i < *count; i++) {
        if (strcmp((*all)[i].name, name) == 0) {
            return &(*all)[i];
        }
    }
    memory_reserve((void **)all, capacity, *count + 1, sizeof(time_series));
    time_series *const series = &(*all)[(*count)++];
    series->name = arena_strdup(names, name);
    return series;
}

void render_times_add(render_times *times, const renderer *r, double milliseconds)
{
    uint32_t count;
    const frame_graph_timing *const timings = frame_graph_timings(r->graph, &count);
    for (size_t m = 0; m < times->module_count; m++) {
        times->modules[m].current = 0;
        times->modules[m].seen = false;
    }
    for (uint32_t i = 0; i < count; i++) {
        time_series *const step =
            time_series_find(&times->names, &times->steps, &times->step_count, &times->step_capacity, timings[i].name);
        time_series_add(step, timings[i].milliseconds);

        char name[64];
        snprintf(name, sizeof(name), "%.*s", (int)strcspn(timings[i].name, "/"), timings[i].name);
        time_series *const module =
            time_series_find(&times->names, &times->modules, &times->module_count, &times->module_capacity, name);
        module->current += timings[i].milliseconds;
        module->seen = true;
    }
    for (size_t m = 0; m < times->module_count; m++) {
        if (times->modules[m].seen) {
            time_series_add(&times->modules[m], times->modules[m].current);
        }
    }
    time_series_add(&times->frames, milliseconds);
}

static int double_compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double time_series_percentile(const time_series *series, double fraction)
{
    if (series->count == 0) {
        return 0;
    }
    double *const sorted = memory_alloc(series->count * sizeof(double));
    memcpy(sorted, series->milliseconds, series->count * sizeof(double));
    qsort(sorted, series->count, sizeof(double), double_compare);
    const double place = fraction * (double)(series->count - 1);
    const size_t below = (size_t)place;
    const size_t above = below + 1 < series->count ? below + 1 : below;
    const double value = sorted[below] + (place - (double)below) * (sorted[above] - sorted[below]);
    free(sorted);
    return value;
}

void render_times_fini(render_times *times)
{
    for (size_t i = 0; i < times->step_count; i++) {
        free(times->steps[i].milliseconds);
    }
    for (size_t i = 0; i < times->module_count; i++) {
        free(times->modules[i].milliseconds);
    }
    free(times->steps);
    free(times->modules);
    free(times->frames.milliseconds);
    arena_fini(&times->names);
}

// ---- The parts of the file

// Tenths of a microsecond: clocks tell no more, and the file is easier to read.
static void percentile_to_json(cJSON *object, const char *key, const time_series *series, double fraction)
{
    cJSON_AddNumberToObject(object, key, round(1e4 * time_series_percentile(series, fraction)) / 1e4);
}

static void series_to_json(cJSON *object, const time_series *series)
{
    cJSON_AddStringToObject(object, "name", series->name);
    percentile_to_json(object, "ms_p50", series, 0.5);
    percentile_to_json(object, "ms_p95", series, 0.95);
}

// The steps of module "lgh_build" are "lgh_build" and "lgh_build/...".
static bool step_is_of(const time_series *step, const time_series *module)
{
    const size_t length = strlen(module->name);
    return strncmp(step->name, module->name, length) == 0 && (step->name[length] == '/' || !step->name[length]);
}

static void passes_to_json(cJSON *root, const render_times *times)
{
    cJSON *const passes = cJSON_AddArrayToObject(root, "passes");
    for (size_t m = 0; m < times->module_count; m++) {
        cJSON *const pass = cJSON_CreateObject();
        cJSON_AddItemToArray(passes, pass);
        series_to_json(pass, &times->modules[m]);
        cJSON *const steps = cJSON_AddArrayToObject(pass, "steps");
        for (size_t s = 0; s < times->step_count; s++) {
            if (step_is_of(&times->steps[s], &times->modules[m])) {
                cJSON *const step = cJSON_CreateObject();
                cJSON_AddItemToArray(steps, step);
                series_to_json(step, &times->steps[s]);
            }
        }
    }
}

// Numbers and truth values as such, all else as text.
static void setting_to_json(cJSON *object, const render_settings *settings, const setting_info *info)
{
    char text[32];
    settings_get(settings, info, text);
    char *end;
    const double number = strtod(text, &end);
    if (*end == '\0') {
        cJSON_AddNumberToObject(object, info->name, number);
    } else if (info->type == SETTING_TRUE || info->type == SETTING_FALSE) {
        cJSON_AddBoolToObject(object, info->name, strcmp(text, "true") == 0);
    } else {
        cJSON_AddStringToObject(object, info->name, text);
    }
}

static void settings_to_json(cJSON *root, const render_settings *settings)
{
    cJSON *const object = cJSON_AddObjectToObject(root, "settings");
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        setting_to_json(object, settings, &table[i]);
    }
}

static const struct {
    const char *name, *buffer;
} ray_counters[] = {
    {"vpl", "rays_vpl|-"}, {"direct", "rays_direct|-"}, {"shadow", "rays_shadow|-"}, {"path", "rays_path|-"}};

// Of the last frame; a pass that did not run has no counter.
static uint32_t rays_count(renderer *r, size_t counter)
{
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, ray_counters[counter].buffer);
    uint32_t rays = 0;
    return buffer.id && gpu_buffer_read(r->gpu, buffer, 0, &rays, sizeof(rays)) ? rays : 0;
}

double rays_per_pixel(renderer *r)
{
    double sum = 0;
    for (size_t i = 0; i < countof(ray_counters); i++) {
        sum += rays_count(r, i);
    }
    return sum / ((double)r->settings.width * r->settings.height);
}

// Rays per pixel are those that the picture took: of the last frame, or of all frames of a progressive method.
static void rays_to_json(cJSON *root, renderer *r, const progressive_run *progress)
{
    cJSON *const object = cJSON_AddObjectToObject(root, "rays");
    for (size_t i = 0; i < countof(ray_counters); i++) {
        cJSON_AddNumberToObject(object, ray_counters[i].name, rays_count(r, i));
    }
    const double pixels = (double)r->settings.width * r->settings.height;
    cJSON_AddNumberToObject(root, "rays_per_pixel",
                            progress ? progressive_run_rays(progress) / pixels : rays_per_pixel(r));
}

// The first `count` items of an exported buffer; free() them. NULL when there is no such buffer.
static void *buffer_items_read(renderer *r, const char *name, size_t count, size_t item_size)
{
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, name);
    if (!buffer.id) {
        return NULL;
    }
    assert(count * item_size <= gpu_buffer_size(r->gpu, buffer));
    void *items = memory_alloc(count * item_size);
    if (count > 0 && !gpu_buffer_read(r->gpu, buffer, 0, items, count * item_size)) {
        free(items);
        items = NULL;
    }
    return items;
}

static void color_add(double sum[3], const float color[3])
{
    for (int c = 0; c < 3; c++) {
        sum[c] += (double)color[c];
    }
}

static void vpls_to_json(cJSON *root, cJSON *flux, renderer *r)
{
    const uint32_t slots = renderer_slots(r);
    vpl *const vpls = buffer_items_read(r, "vpls|-", slots, sizeof(vpl));
    uint32_t occupied = 0;
    double sum[3] = {0};
    for (uint32_t i = 0; vpls && i < slots; i++) {
        if (vpls[i].intensity > 0) {
            occupied++;
            color_add(sum, vpls[i].color);
        }
    }
    cJSON_AddNumberToObject(root, "vpls", occupied);
    cJSON_AddItemToObject(flux, "vpl", cJSON_CreateDoubleArray(sum, 3));
    free(vpls);
}

// Levels from S1 upwards.
static void levels_to_json(cJSON *root, cJSON *flux, renderer *r)
{
    const lgh_header none = {0};
    lgh_header *const read = buffer_items_read(r, "lgh_header|-", 1, sizeof(lgh_header));
    const lgh_header *const header = read ? read : &none;
    grid_light *const lights = buffer_items_read(r, "lgh_lights|-", header->light_count, sizeof(grid_light));

    cJSON_AddNumberToObject(root, "levels", header->level_count);
    cJSON *const counts = cJSON_AddArrayToObject(root, "grid_lights");
    cJSON *const sums = cJSON_AddArrayToObject(flux, "per_level");
    for (uint32_t c = header->level_count; lights && c-- > 0;) {
        const lgh_level *const level = &header->levels[c];
        double sum[3] = {0};
        for (uint32_t i = 0; i < level->occupied; i++) {
            color_add(sum, lights[level->first_light + i].color);
        }
        cJSON_AddItemToArray(counts, cJSON_CreateNumber(level->occupied));
        cJSON_AddItemToArray(sums, cJSON_CreateDoubleArray(sum, 3));
    }
    free(lights);
    free(read);
}

static void lights_per_pixel_to_json(cJSON *root, renderer *r)
{
    const double mean = lights_per_pixel_mean(r);
    if (mean >= 0) {
        cJSON_AddNumberToObject(root, "lights_per_pixel", mean);
    } else {
        cJSON_AddNullToObject(root, "lights_per_pixel");
    }
}

void counters_export(renderer *r)
{
    for (size_t i = 0; i < countof(ray_counters); i++) {
        export_add(r, ray_counters[i].buffer);
    }
    export_add(r, "lights_per_pixel|-");
    export_add(r, "depth");
}

void stats_export(renderer *r)
{
    static const char *const names[] = {"vpls|-", "lgh_header|-", "lgh_lights|-"};
    for (size_t i = 0; i < countof(names); i++) {
        export_add(r, names[i]);
    }
    counters_export(r);
}

static void progress_to_json(cJSON *root, const render_settings *settings, const render_summary *summary)
{
    const progressive_status *const status = &summary->progress->now;
    const double rays = progressive_run_rays(summary->progress);
    char method[32];
    settings_get(settings, settings_find("method"), method);
    cJSON *const object = cJSON_AddObjectToObject(root, "progress");
    cJSON_AddStringToObject(object, "method", method);
    cJSON_AddNumberToObject(object, "done", (double)status->done);
    cJSON_AddNumberToObject(object, "done_before", (double)summary->progress->before.done); // in the state file
    cJSON_AddNumberToObject(object, "total", (double)status->total);
    cJSON_AddBoolToObject(object, "finished", status->finished);
    if (isnan(status->error)) {
        cJSON_AddNullToObject(object, "estimated_error");
    } else {
        cJSON_AddNumberToObject(object, "estimated_error", status->error);
    }
    cJSON_AddNumberToObject(object, "rays", rays); // by this run
    cJSON_AddNumberToObject(object, "seconds", summary->seconds);
    cJSON_AddNumberToObject(object, "mrays_per_second", 1e-6 * rays / summary->seconds);
}

static void number_or_null_to_json(cJSON *object, const char *key, double value)
{
    if (isfinite(value)) {
        cJSON_AddNumberToObject(object, key, value);
    } else {
        cJSON_AddNullToObject(object, key);
    }
}

// What automatic settings (the chosen ones are under "settings") know of the picture, and the time of every frame, in
// order, so that one sees how they got there.
static void automatic_to_json(cJSON *root, const renderer *r, const render_times *times)
{
    const automatic *const a = automatic_get(r);
    if (!a) {
        return;
    }
    double parts[AUTOMATIC_PARTS], standard_error;
    cJSON *const object = cJSON_AddObjectToObject(root, "automatic");
    cJSON_AddBoolToObject(object, "settled", a->settled);
    cJSON_AddNumberToObject(object, "changes", a->changes);
    cJSON_AddNumberToObject(object, "ms", automatic_milliseconds(a));
    cJSON_AddNumberToObject(object, "modelled_error", automatic_error(a, parts));
    cJSON_AddNumberToObject(object, "modelled_error_hierarchy", parts[AUTOMATIC_HIERARCHY]);
    cJSON_AddNumberToObject(object, "modelled_error_shadows", parts[AUTOMATIC_SHADOW_RATIO]);
    cJSON_AddNumberToObject(object, "modelled_error_vpls", parts[AUTOMATIC_VPL_SET]);
    number_or_null_to_json(object, "measured_error", automatic_probes_error(&a->probes, &standard_error));
    number_or_null_to_json(object, "measured_error_sigma", standard_error);
    const time_series *const frames = &times->frames;
    cJSON_AddItemToObject(object, "frame_ms", cJSON_CreateDoubleArray(frames->milliseconds, (int)frames->count));
}

static cJSON *stats_to_json(renderer *r, const render_summary *summary)
{
    cJSON *const root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "device", summary->device);
    cJSON_AddStringToObject(root, "scene", summary->scene);
    settings_to_json(root, &r->settings);
    const int size[2] = {(int)r->settings.width, (int)r->settings.height};
    cJSON_AddItemToObject(root, "size", cJSON_CreateIntArray(size, 2));
    cJSON_AddNumberToObject(root, "frames", summary->frames);
    if (summary->counting_is_timed) {
        cJSON_AddStringToObject(root, "note", "the only frame also counted lights per pixel, which its times include");
    }
    percentile_to_json(root, "frame_ms_p50", &summary->times->frames, 0.5);
    percentile_to_json(root, "frame_ms_p95", &summary->times->frames, 0.95);
    if (summary->progress) {
        progress_to_json(root, &r->settings, summary);
    }
    automatic_to_json(root, r, summary->times);
    passes_to_json(root, summary->times);
    cJSON *const flux = cJSON_CreateObject();
    vpls_to_json(root, flux, r);
    levels_to_json(root, flux, r);
    lights_per_pixel_to_json(root, r);
    rays_to_json(root, r, summary->progress);
    cJSON_AddItemToObject(root, "flux", flux);
    cJSON_AddNumberToObject(root, "gpu_memory_peak_bytes", (double)gpu_memory_peak(r->gpu));
    cJSON_AddNumberToObject(root, "validation_messages", gpu_validation_messages(r->gpu));
    return root;
}

bool stats_write(renderer *r, const render_summary *summary, const char *path)
{
    cJSON *const root = stats_to_json(r, summary);
    char *const text = cJSON_Print(root);
    const bool ok = text && file_write(path, text, strlen(text));
    if (!text) {
        log_error("cannot write \"%s\": out of memory", path);
    }
    cJSON_free(text);
    cJSON_Delete(root);
    return ok;
}
