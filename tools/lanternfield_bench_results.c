// Results of `lanternfield bench`: rows made from the journal, their metrics by name, and results.csv.
#include "lanternfield_bench.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

bool bench_configuration_in_view(const bench_configuration *configuration, const bench_view *view)
{
    bool found = configuration->view_count == 0;
    for (uint32_t i = 0; i < configuration->view_count; i++) {
        found = found || strcmp(configuration->views[i], view->name) == 0;
    }
    return found;
}

uint64_t bench_settings_hash(const render_settings *settings)
{
    uint64_t hash = BENCH_HASH_START;
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        char text[32];
        settings_get(settings, &table[i], text);
        hash = bench_hash(hash, table[i].name, strlen(table[i].name) + 1);
        hash = bench_hash(hash, text, strlen(text) + 1);
    }
    return hash;
}

static void row_init(bench_results *results, bench_row *row, const bench_view *view,
                     const bench_configuration *configuration)
{
    const uint32_t references = results->suite->reference_count;
    *row = (bench_row){.view = view, .configuration = configuration, .settings = view->settings};
    bench_settings_apply(&row->settings, configuration->settings, configuration->setting_count);
    row->frame_ms_p50 = row->frame_ms_p95 = row->picture_ms = NAN;
    row->lights_per_pixel = row->rays_per_pixel = row->grid_lights = row->memory_bytes = NAN;
    row->errors = arena_alloc(&results->memory, references * sizeof(image_measures));
    for (size_t k = 0; k < references * sizeof(image_measures) / sizeof(double); k++) {
        ((double *)row->errors)[k] = NAN;
    }
}

void bench_results_init(bench_results *results, const bench_suite *suite, const char *folder)
{
    *results = (bench_results){.suite = suite, .folder = folder};
    const size_t rows = (size_t)suite->view_count * suite->configuration_count;
    results->rows = arena_alloc(&results->memory, rows * sizeof(bench_row));
    results->reference_count = suite->view_count * suite->reference_count;
    results->references = arena_alloc(&results->memory, results->reference_count * sizeof(bench_reference_result));
    for (size_t i = 0; i < rows; i++) {
        const bench_view *const view = &suite->views[i / suite->configuration_count];
        const bench_configuration *const configuration = &suite->configurations[i % suite->configuration_count];
        if (bench_configuration_in_view(configuration, view)) {
            row_init(results, &results->rows[results->row_count++], view, configuration);
        }
    }
    for (uint32_t i = 0; i < results->reference_count; i++) {
        results->references[i].view = &suite->views[i / suite->reference_count];
        results->references[i].reference = &suite->references[i % suite->reference_count];
        results->references[i].error = NAN;
    }
}
_Static_assert(sizeof(image_measures) % sizeof(double) == 0, "doubles alone");

void bench_results_fini(bench_results *results)
{
    arena_fini(&results->memory);
}

// ---- From the journal

// Values of all repeats, percentiles of which are reported.
static void values_add(time_series *series, const cJSON *list)
{
    const cJSON *item;
    cJSON_ArrayForEach(item, list)
    {
        memory_reserve((void **)&series->milliseconds, &series->capacity, series->count + 1, sizeof(double));
        series->milliseconds[series->count++] = item->valuedouble;
    }
}

// NAN for null and for what is not there.
static double number_of(const cJSON *json, const char *name)
{
    const cJSON *const item = cJSON_GetObjectItemCaseSensitive(json, name);
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

static const char *string_of(bench_results *results, const cJSON *json, const char *name)
{
    const char *const text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(json, name));
    return text ? arena_strdup(&results->memory, text) : NULL;
}

static bool time_exists(const bench_pass_time *times, uint32_t count, const char *name)
{
    for (uint32_t i = 0; i < count; i++) {
        if (strcmp(times[i].name, name) == 0) {
            return true;
        }
    }
    return false;
}

// One pass over all repeats. `group` is "passes" or "steps".
static bench_pass_time time_collect(bench_results *results, const bench_row *row, const bench_journal *journal,
                                    const char *group, const char *name)
{
    time_series series = {0};
    size_t place = 0;
    for (const cJSON *line; (line = bench_journal_next(journal, "times", row->key, &place));) {
        values_add(&series, cJSON_GetObjectItemCaseSensitive(cJSON_GetObjectItemCaseSensitive(line, group), name));
    }
    const bench_pass_time time = {
        .name = arena_strdup(&results->memory, name),
        .p50 = time_series_percentile(&series, 0.5),
        .p95 = time_series_percentile(&series, 0.95),
    };
    free(series.milliseconds);
    return time;
}

static bench_pass_time *times_of(bench_results *results, const bench_row *row, const bench_journal *journal,
                                 const char *group, uint32_t *count)
{
    enum { TIMES_MAX = 256 };
    bench_pass_time *const times = arena_alloc(&results->memory, TIMES_MAX * sizeof(bench_pass_time));
    *count = 0;
    size_t place = 0;
    for (const cJSON *line; (line = bench_journal_next(journal, "times", row->key, &place));) {
        const cJSON *pass;
        cJSON_ArrayForEach(pass, cJSON_GetObjectItemCaseSensitive(line, group))
        {
            if (!time_exists(times, *count, pass->string) && *count < TIMES_MAX) {
                times[(*count)++] = time_collect(results, row, journal, group, pass->string);
            }
        }
    }
    return times;
}

// False when there are fewer repeats than the suite asks for.
static bool times_collect(bench_results *results, bench_row *row, const bench_journal *journal)
{
    time_series frames = {0}, pictures = {0};
    size_t place = 0;
    uint32_t repeats = 0;
    for (const cJSON *line; (line = bench_journal_next(journal, "times", row->key, &place)); repeats++) {
        values_add(&frames, cJSON_GetObjectItemCaseSensitive(line, "frames"));
        memory_reserve((void **)&pictures.milliseconds, &pictures.capacity, pictures.count + 1, sizeof(double));
        pictures.milliseconds[pictures.count++] = number_of(line, "picture_ms");
    }
    if (repeats > 0) {
        row->frame_ms_p50 = time_series_percentile(&frames, 0.5);
        row->frame_ms_p95 = time_series_percentile(&frames, 0.95);
        row->picture_ms = time_series_percentile(&pictures, 0.5);
        row->passes = times_of(results, row, journal, "passes", &row->pass_count);
        row->steps = times_of(results, row, journal, "steps", &row->step_count);
    }
    free(frames.milliseconds);
    free(pictures.milliseconds);
    return repeats >= results->suite->repeats;
}

void bench_row_collect(bench_results *results, bench_row *row, const bench_journal *journal)
{
    size_t place = 0;
    const cJSON *const slow = bench_journal_next(journal, "slow", row->key, &place);
    const double limit = row->configuration->time_limit_s;
    if (slow && limit > 0 && number_of(slow, "seconds") > limit) {
        row->skipped = arena_printf(&results->memory, "a frame takes %.3g s, more than the limit of %.3g s",
                                    number_of(slow, "seconds"), limit);
        return;
    }
    place = 0;
    const cJSON *const line = bench_journal_next(journal, "row", row->key, &place);
    row->done = times_collect(results, row, journal) && line;
    if (!line) {
        return;
    }
    row->lights_per_pixel = number_of(line, "lights_per_pixel");
    row->rays_per_pixel = number_of(line, "rays_per_pixel");
    row->grid_lights = number_of(line, "grid_lights");
    row->memory_bytes = number_of(line, "memory_bytes");
    row->image = string_of(results, line, "image");
    row->lights_image = string_of(results, line, "lights_image");
    if (!results->device) {
        results->device = string_of(results, line, "device");
    }
}

const bench_row *bench_row_find(const bench_results *results, const bench_view *view, const char *configuration)
{
    for (uint32_t i = 0; i < results->row_count; i++) {
        const bench_row *const row = &results->rows[i];
        if (row->view == view && strcmp(row->configuration->name, configuration) == 0) {
            return row;
        }
    }
    return NULL;
}

// ---- Metrics

typedef struct metric_info {
    const char *name;
    size_t offset; // of a double in bench_row
    double factor;
} metric_info;
static const metric_info metrics[] = {
    {"frame_ms", offsetof(bench_row, frame_ms_p50), 1},
    {"frame_ms_p95", offsetof(bench_row, frame_ms_p95), 1},
    {"picture_ms", offsetof(bench_row, picture_ms), 1},
    {"lights_per_pixel", offsetof(bench_row, lights_per_pixel), 1},
    {"rays_per_pixel", offsetof(bench_row, rays_per_pixel), 1},
    {"grid_lights", offsetof(bench_row, grid_lights), 1},
    {"memory_mb", offsetof(bench_row, memory_bytes), 1e-6},
};

static double metric_value(const bench_row *row, const metric_info *info)
{
    return info->factor * *(const double *)((const char *)row + info->offset);
}

static const metric_info *metric_find(const char *name)
{
    for (size_t i = 0; i < countof(metrics); i++) {
        if (strcmp(metrics[i].name, name) == 0) {
            return &metrics[i];
        }
    }
    return NULL;
}

// "path.relative_l2", or "relative_l2" of the first reference.
static const image_measure_info *measure_find(const bench_suite *suite, const char *name, uint32_t *reference)
{
    const char *const dot = strchr(name, '.');
    const char *const measure = dot ? dot + 1 : name;
    *reference = 0;
    while (dot && *reference < suite->reference_count &&
           (strncmp(suite->references[*reference].name, name, (size_t)(dot - name)) != 0 ||
            suite->references[*reference].name[dot - name] != 0)) {
        ++*reference;
    }
    uint32_t count;
    const image_measure_info *const table = image_measure_table(&count);
    for (uint32_t i = 0; i < count && *reference < suite->reference_count; i++) {
        if (strcmp(table[i].name, measure) == 0) {
            return &table[i];
        }
    }
    return NULL;
}

static double measure_value(const bench_row *row, uint32_t reference, const image_measure_info *info)
{
    return *(const double *)((const char *)&row->errors[reference] + info->offset);
}

// A setting that is a number; "auto" is none.
static double setting_value(const bench_row *row, const setting_info *info)
{
    char text[32], *end;
    settings_get(&row->settings, info, text);
    const double value = strtod(text, &end);
    return *end ? NAN : value;
}

// "ms:a+b", "ms:*-a-b"; "ms_p95:" likewise. The names in `list` end at + or -.
static bool list_names(const char *list, const char *name)
{
    const size_t length = strlen(name);
    for (const char *item = list; *item; item += *item != 0) {
        const size_t item_length = strcspn(item, "+-");
        if (item_length == length && strncmp(item, name, length) == 0) {
            return true;
        }
        item += item_length;
    }
    return false;
}

static const char *passes_of(const char *metric, bool *p95)
{
    *p95 = strncmp(metric, "ms_p95:", 7) == 0;
    return *p95 ? metric + 7 : strncmp(metric, "ms:", 3) == 0 ? metric + 3 : NULL;
}

static void times_add(double *sum, const bench_pass_time *times, uint32_t count, const char *list, bool p95)
{
    const bool all_but = *list == '*';
    for (uint32_t i = 0; i < count; i++) {
        if (list_names(list, times[i].name) != all_but) {
            *sum = (isnan(*sum) ? 0 : *sum) + (p95 ? times[i].p95 : times[i].p50);
        }
    }
}

// NAN when none of the passes ran; those that did not take no time.
static double passes_value(const bench_row *row, const char *list, bool p95)
{
    double sum = NAN;
    times_add(&sum, row->passes, row->pass_count, list, p95);
    if (*list != '*') { // all passes are all steps
        times_add(&sum, row->steps, row->step_count, list, p95);
    }
    return sum;
}

double bench_metric(const bench_results *results, const bench_row *row, const char *name)
{
    bool p95;
    uint32_t reference;
    const metric_info *const metric = metric_find(name);
    const char *const passes = passes_of(name, &p95);
    const image_measure_info *const measure = measure_find(results->suite, name, &reference);
    const setting_info *const setting = settings_find(name);
    if (metric) {
        return metric_value(row, metric);
    }
    if (passes) {
        return passes_value(row, passes, p95);
    }
    if (measure) {
        return measure_value(row, reference, measure);
    }
    return setting ? setting_value(row, setting) : NAN;
}

// "a", "a+b+c", "*", "*-a-b", of names that passes may have.
static bool passes_well_formed(const char *list)
{
    const bool all_but = *list == '*';
    if (all_but && !list[1]) {
        return true;
    }
    if (all_but && list[1] != '-') {
        return false;
    }
    for (const char *item = all_but ? list + 2 : list;; item++) {
        const size_t length = strspn(item, "abcdefghijklmnopqrstuvwxyz0123456789_/");
        item += length;
        if (length == 0 || (*item && *item != (all_but ? '-' : '+'))) {
            return false;
        }
        if (!*item) {
            return true;
        }
    }
}

static bool setting_is_number(const setting_info *info)
{
    return info->type == SETTING_UINT || info->type == SETTING_FLOAT ||
           (info->type == SETTING_SPECIAL && strcmp(info->name, "size") != 0);
}

bool bench_metric_known(const bench_suite *suite, const char *name)
{
    bool p95;
    uint32_t reference;
    const char *const passes = passes_of(name, &p95);
    const setting_info *const setting = settings_find(name);
    return metric_find(name) || (passes && passes_well_formed(passes)) || measure_find(suite, name, &reference) ||
           (setting && setting_is_number(setting));
}

// ---- results.csv

// Quoted where RFC 4180 asks for it.
static void text_print(FILE *out, const char *text)
{
    if (!text[strcspn(text, ",\"\r\n")]) {
        fputs(text, out);
        return;
    }
    fputc('"', out);
    for (; *text; text++) {
        fputs(*text == '"' ? "\"\"" : (const char[]){*text, 0}, out);
    }
    fputc('"', out);
}

static void number_print(FILE *out, double value)
{
    fputc(',', out);
    if (!isnan(value)) {
        fprintf(out, "%.9g", value);
    }
}

// Names of the passes of all rows.
static const char **passes_union(const bench_results *results, uint32_t *count)
{
    const char **names = NULL;
    size_t capacity = 0;
    *count = 0;
    for (uint32_t i = 0; i < results->row_count; i++) {
        for (uint32_t p = 0; p < results->rows[i].pass_count; p++) {
            const char *const name = results->rows[i].passes[p].name;
            uint32_t found = 0;
            while (found < *count && strcmp(names[found], name) != 0) {
                found++;
            }
            if (found == *count) {
                memory_reserve((void **)&names, &capacity, *count + 1, sizeof(char *));
                names[(*count)++] = name;
            }
        }
    }
    return names;
}

typedef struct csv {
    FILE *out;
    const bench_results *results;
    const setting_info *settings;
    const image_measure_info *measures;
    const char **passes;
    uint32_t setting_count, measure_count, pass_count;
} csv;

static void csv_header(const csv *csv)
{
    fputs("suite,view,configuration,series", csv->out);
    for (uint32_t i = 0; i < csv->setting_count; i++) {
        fprintf(csv->out, ",%s", csv->settings[i].name);
    }
    for (size_t i = 0; i < countof(metrics); i++) {
        fprintf(csv->out, ",%s", metrics[i].name);
    }
    for (uint32_t i = 0; i < csv->pass_count; i++) {
        fprintf(csv->out, ",ms:%s,ms_p95:%s", csv->passes[i], csv->passes[i]);
    }
    for (uint32_t r = 0; r < csv->results->suite->reference_count; r++) {
        for (uint32_t i = 0; i < csv->measure_count; i++) {
            fprintf(csv->out, ",%s.%s", csv->results->suite->references[r].name, csv->measures[i].name);
        }
    }
    fputs(",device,skipped\n", csv->out);
}

static void csv_texts(const csv *csv, const bench_row *row)
{
    const char *const texts[] = {csv->results->suite->name, row->view->name, row->configuration->name,
                                 row->configuration->series};
    for (size_t i = 0; i < countof(texts); i++) {
        fputs(i ? "," : "", csv->out);
        text_print(csv->out, texts[i]);
    }
    for (uint32_t i = 0; i < csv->setting_count; i++) {
        char text[32];
        settings_get(&row->settings, &csv->settings[i], text);
        fputc(',', csv->out);
        text_print(csv->out, text);
    }
}

static void csv_row(const csv *csv, const bench_row *row)
{
    csv_texts(csv, row);
    for (size_t i = 0; i < countof(metrics); i++) {
        number_print(csv->out, metric_value(row, &metrics[i]));
    }
    for (uint32_t i = 0; i < csv->pass_count; i++) {
        number_print(csv->out, passes_value(row, csv->passes[i], false));
        number_print(csv->out, passes_value(row, csv->passes[i], true));
    }
    for (uint32_t r = 0; r < csv->results->suite->reference_count; r++) {
        for (uint32_t i = 0; i < csv->measure_count; i++) {
            number_print(csv->out, measure_value(row, r, &csv->measures[i]));
        }
    }
    fputc(',', csv->out);
    text_print(csv->out, csv->results->device ? csv->results->device : "");
    fputc(',', csv->out);
    text_print(csv->out, row->skipped ? row->skipped : "");
    fputc('\n', csv->out);
}

bool bench_csv_write(const bench_results *results)
{
    char *text;
    size_t size;
    csv csv = {.out = open_memstream(&text, &size), .results = results};
    csv.settings = settings_table(&csv.setting_count);
    csv.measures = image_measure_table(&csv.measure_count);
    csv.passes = passes_union(results, &csv.pass_count);
    csv_header(&csv);
    for (uint32_t i = 0; i < results->row_count; i++) {
        if (results->rows[i].done || results->rows[i].skipped) {
            csv_row(&csv, &results->rows[i]);
        }
    }
    fclose(csv.out);
    free(csv.passes);
    arena paths = {0};
    const bool ok = file_write(arena_printf(&paths, "%s/results.csv", results->folder), text, size);
    arena_fini(&paths);
    free(text);
    return ok;
}
