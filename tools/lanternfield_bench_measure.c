// The measuring of a suite: references, warm-up, and repeats in rounds over the configurations of a view.
#include "lanternfield_bench_run.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void bench_restart(renderer *r)
{
    frame_graph_history_drop(r->graph);
    progressive_restart(r);
    r->frame = 0;
}

// ---- Keys

static uint64_t row_key(const bench_run *run, const bench_row *row)
{
    renderer *const r = run->session.renderer;
    render_request request = run->request;
    request.settings = r->settings = row->settings;
    char *const identity = render_identity(&run->session, &request);
    uint64_t hash = bench_hash(run->program, identity, strlen(identity));
    free(identity);
    // Also what does not change the picture: who traces rays, how many frames are timed, the layer that is in the way.
    const uint64_t settings = bench_settings_hash(&row->settings);
    hash = bench_hash(hash, &settings, sizeof(settings));
    hash = bench_hash(hash, gpu_name(r->gpu), strlen(gpu_name(r->gpu)));
    return bench_hash(hash, &run->options.validate, sizeof(bool));
}

// Of an entry with a view's name and another's: does it speak of these, with these settings?
static bool line_speaks_of(const cJSON *line, const bench_view *view, const char *what, const char *name,
                           const render_settings *settings)
{
    char hash[BENCH_KEY_SIZE];
    bench_key_print(bench_settings_hash(settings), hash);
    const struct {
        const char *key, *value;
    } members[] = {{"view", view->name}, {what, name}, {"settings", hash}};
    for (size_t i = 0; i < countof(members); i++) {
        const char *const text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(line, members[i].key));
        if (!text || strcmp(text, members[i].value) != 0) {
            return false;
        }
    }
    return true;
}

// The newest line of a kind that speaks of a row, whatever its key.
static const cJSON *row_line_find(const bench_run *run, const bench_row *row, const char *kind)
{
    size_t place = 0;
    const cJSON *line;
    while ((line = bench_journal_next(run->journal, kind, NULL, &place)) &&
           !line_speaks_of(line, row->view, "configuration", row->configuration->name, &row->settings)) {
    }
    return line;
}

static cJSON *line_make(const bench_view *view, const char *what, const char *name, const render_settings *settings)
{
    char hash[BENCH_KEY_SIZE];
    bench_key_print(bench_settings_hash(settings), hash);
    cJSON *const line = cJSON_CreateObject();
    cJSON_AddStringToObject(line, "view", view->name);
    cJSON_AddStringToObject(line, what, name);
    cJSON_AddStringToObject(line, "settings", hash);
    return line;
}

static bool row_line_add(const bench_run *run, const bench_row *row, const char *kind, cJSON *line)
{
    char program[BENCH_KEY_SIZE];
    bench_key_print(run->program, program);
    cJSON_AddStringToObject(line, "program", program);
    return bench_journal_add(run->journal, kind, row->key, line);
}

// ---- The progress line

static double pending_seconds(const bench_run *run)
{
    double known = 0, sum = 0, all = 0;
    uint32_t known_count = 0;
    for (uint32_t c = 0; c < run->suite->configuration_count; c++) {
        known += run->seconds[c];
        known_count += run->seconds[c] > 0;
    }
    const double mean = known_count ? known / known_count : 0;
    for (uint32_t i = 0; i < run->row_count; i++) {
        const double seconds = run->seconds[run->rows[i]->configuration - run->suite->configurations];
        sum += run->pending[i] * (seconds > 0 ? seconds : mean);
    }
    // Views to come: taken to cost as much.
    for (uint32_t i = 0; i < run->results.row_count; i++) {
        const bench_row *const row = &run->results.rows[i];
        if (row->view > run->view && bench_view_selected(run, row->view)) {
            const double seconds = run->seconds[row->configuration - run->suite->configurations];
            all += run->suite->repeats * (seconds > 0 ? seconds : mean);
        }
    }
    return sum + all;
}

static uint32_t pending_repeats(const bench_run *run)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < run->row_count; i++) {
        count += run->pending[i];
    }
    for (uint32_t i = 0; i < run->results.row_count; i++) {
        const bench_row *const row = &run->results.rows[i];
        const bool comes = row->view > run->view && bench_view_selected(run, row->view);
        count += comes ? run->suite->repeats : 0;
    }
    return count;
}

static void progress_print(const bench_run *run, uint32_t row, const char *what)
{
    const double seconds = pending_seconds(run);
    const uint32_t pending = pending_repeats(run);
    char left[64] = "";
    if (seconds > 0) {
        snprintf(left, sizeof(left), seconds < 90 ? "%.0f s left" : "%.0f min left",
                 seconds < 90 ? seconds : seconds / 60);
    }
    progress_show("%s  %u/%u %s  %s  %.0f %%  %s", run->view->name, row + 1, run->row_count,
                  run->rows[row]->configuration->name, what,
                  100.0 * run->done_repeats / fmax(1, run->done_repeats + pending), left);
}

// ---- One repeat

typedef struct repeat {
    render_times times;
    double picture_ms, memory_bytes;
    progressive_status status; // of the progressive methods
} repeat;

// The frames of one picture, the first of which begins anew. EXIT_INTERRUPTED: after a frame.
static int picture_render(renderer *r, repeat *repeat)
{
    const bool progressive = progressive_is(r);
    const uint32_t frames = r->settings.frames;
    bench_restart(r);
    for (uint32_t f = 0; progressive ? !repeat->status.finished : f < frames; f++) {
        if (interrupt_seen()) {
            return EXIT_INTERRUPTED;
        }
        const double start = time_now();
        if (!renderer_frame(r)) {
            return EXIT_FAILED;
        }
        // History is valid from the second frame on.
        if (progressive || f > 0 || frames == 1) {
            render_times_add(&repeat->times, r, 1000 * (time_now() - start));
        }
        if (progressive) {
            repeat->status = progressive_status_get(r, false);
        }
    }
    repeat->picture_ms = 0;
    for (size_t i = 0; i < repeat->times.frames.count; i++) {
        repeat->picture_ms += repeat->times.frames.milliseconds[i];
    }
    if (!progressive) {
        repeat->picture_ms = time_series_percentile(&repeat->times.frames, 0.5);
    }
    repeat->memory_bytes = (double)gpu_memory_peak(r->gpu);
    return EXIT_DONE;
}

// After a switch of settings: a frame that allocates what the new ones need and compiles their shaders, its seconds.
static int settings_switch(renderer *r, const render_settings *settings, double *seconds)
{
    r->settings = *settings;
    r->export_count = 0;
    r->count_lights = false;
    bench_restart(r);
    const double start = time_now();
    if (!renderer_frame(r)) {
        return EXIT_FAILED;
    }
    *seconds = time_now() - start;
    // What the settings before had is gone by now.
    gpu_memory_peak_reset(r->gpu);
    return interrupt_seen() ? EXIT_INTERRUPTED : EXIT_DONE;
}

// Times of the frames, or their sum as one number.
static void series_to_json(cJSON *object, const time_series *series, bool sum)
{
    double total = 0;
    for (size_t i = 0; i < series->count; i++) {
        total += series->milliseconds[i];
    }
    cJSON_AddItemToObject(object, series->name,
                          sum ? cJSON_CreateDoubleArray(&total, 1)
                              : cJSON_CreateDoubleArray(series->milliseconds, (int)series->count));
}

static cJSON *repeat_to_json(const bench_row *row, const repeat *repeat, uint32_t number, bool progressive)
{
    cJSON *const line = line_make(row->view, "configuration", row->configuration->name, &row->settings);
    const render_times *const times = &repeat->times;
    cJSON_AddNumberToObject(line, "repeat", number);
    cJSON_AddItemToObject(line, "frames",
                          cJSON_CreateDoubleArray(times->frames.milliseconds, (int)times->frames.count));
    cJSON_AddNumberToObject(line, "picture_ms", repeat->picture_ms);
    cJSON *const passes = cJSON_AddObjectToObject(line, "passes");
    for (size_t i = 0; i < times->module_count; i++) {
        series_to_json(passes, &times->modules[i], progressive);
    }
    cJSON *const steps = cJSON_AddObjectToObject(line, "steps");
    for (size_t i = 0; i < times->step_count; i++) {
        if (strchr(times->steps[i].name, '/')) {
            series_to_json(steps, &times->steps[i], progressive);
        }
    }
    return line;
}

// ---- What is measured once a row

static bool lights_are_shown(const bench_suite *suite, const char *configuration)
{
    for (uint32_t i = 0; i < suite->picture_count; i++) {
        const bench_pictures *const pictures = &suite->pictures[i];
        bool shown = !pictures->configurations;
        for (uint32_t c = 0; c < pictures->configuration_count; c++) {
            shown = shown || strcmp(pictures->configurations[c], configuration) == 0;
        }
        if (shown && strcmp(pictures->what, "lights-per-pixel") == 0) {
            return true;
        }
    }
    return false;
}

// "images/atrium.alpha_2.0123456789abcdef.exr": the key tells pictures of other settings and programs apart.
static const char *image_name(bench_run *run, const bench_row *row, const char *what)
{
    char *const name = arena_printf(&run->memory, "images/%.60s.%.100s.%s%s.exr", row->view->name,
                                    row->configuration->name, row->key, what);
    for (char *c = name + strlen("images/"); *c; c++) {
        const bool plain = (*c >= 'a' && *c <= 'z') || (*c >= 'A' && *c <= 'Z') || (*c >= '0' && *c <= '9');
        *c = plain || strchr(".-", *c) ? *c : '_';
    }
    return name;
}

static double rays_counted(renderer *r)
{
    static const char *const counters[] = {"rays_vpl|-", "rays_direct|-", "rays_shadow|-"};
    double sum = 0;
    for (size_t i = 0; i < countof(counters); i++) {
        const gpu_buffer buffer = frame_graph_find_buffer(r->graph, counters[i]);
        uint32_t rays = 0;
        sum += buffer.id && gpu_buffer_read(r->gpu, buffer, 0, &rays, sizeof(rays)) ? rays : 0;
    }
    return sum;
}

static double grid_lights_counted(renderer *r)
{
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, "lgh_header|-");
    lgh_header header;
    return buffer.id && gpu_buffer_read(r->gpu, buffer, 0, &header, sizeof(header)) ? header.light_count : NAN;
}

// One more frame, which counts: counting costs time.
static bool counts_to_json(bench_run *run, const bench_row *row, cJSON *line)
{
    static const char *const names[] = {"lgh_header|-",  "rays_vpl|-",         "rays_direct|-",
                                        "rays_shadow|-", "lights_per_pixel|-", "depth"};
    renderer *const r = run->session.renderer;
    for (size_t i = 0; i < countof(names); i++) {
        export_add(r, names[i]);
    }
    r->count_lights = true;
    const bool ok = renderer_frame(r);
    r->count_lights = false;
    if (!ok) {
        return false;
    }
    const double lights = lights_per_pixel_mean(r), pixels = (double)r->settings.width * r->settings.height;
    cJSON_AddNumberToObject(line, "lights_per_pixel", lights >= 0 ? lights : NAN); // NAN is written as null
    cJSON_AddNumberToObject(line, "rays_per_pixel", rays_counted(r) / pixels);
    cJSON_AddNumberToObject(line, "grid_lights", grid_lights_counted(r));
    const struct aov_info *const aov = aov_find("lights-per-pixel");
    bool written = true;
    if (lights_are_shown(run->suite, row->configuration->name) && aov_present(r, aov)) {
        const char *const name = image_name(run, row, ".lights");
        written = aov_write(r, aov, bench_path(run, name));
        cJSON_AddStringToObject(line, "lights_image", name);
    }
    r->export_count = 0;
    return written;
}

// After the last frame of a picture.
static bool row_write(bench_run *run, const bench_row *row, const repeat *repeat)
{
    renderer *const r = run->session.renderer;
    const char *const image = image_name(run, row, "");
    if (!picture_write(r, bench_path(run, image))) {
        return false;
    }
    cJSON *const line = line_make(row->view, "configuration", row->configuration->name, &row->settings);
    cJSON_AddStringToObject(line, "image", image);
    cJSON_AddStringToObject(line, "device", gpu_name(r->gpu));
    cJSON_AddNumberToObject(line, "memory_bytes", repeat->memory_bytes);
    if (progressive_is(r)) {
        cJSON_AddNumberToObject(line, "rays_per_pixel",
                                repeat->status.rays / ((double)r->settings.width * r->settings.height));
    } else if (!counts_to_json(run, row, line)) {
        cJSON_Delete(line);
        return false;
    }
    if (lights_are_shown(run->suite, row->configuration->name) && !cJSON_HasObjectItem(line, "lights_image")) {
        cJSON_AddNullToObject(line, "lights_image"); // was asked for, but there are no lights to count
    }
    return row_line_add(run, row, "row", line);
}

// ---- The configurations of a view

// Takes a row out when a frame of it takes longer than its limit.
static bool limit_check(bench_run *run, uint32_t i, double seconds)
{
    const bench_row *const row = run->rows[i];
    if (row->configuration->time_limit_s <= 0 || seconds <= row->configuration->time_limit_s) {
        return true;
    }
    run->pending[i] = 0;
    cJSON *const line = line_make(row->view, "configuration", row->configuration->name, &row->settings);
    cJSON_AddNumberToObject(line, "seconds", seconds);
    return row_line_add(run, row, "slow", line);
}

static int row_fail(const bench_row *row)
{
    log_error("%s, %s: cannot be rendered", row->view->name, row->configuration->name);
    return EXIT_FAILED;
}

// Progressive methods are warm after one frame; the others after as many pictures as the suite says.
static int row_warm_up(bench_run *run, uint32_t i)
{
    renderer *const r = run->session.renderer;
    progress_print(run, i, "warm-up");
    double seconds;
    int code = settings_switch(r, &run->rows[i]->settings, &seconds);
    if (code == EXIT_DONE && !limit_check(run, i, seconds)) {
        return EXIT_FAILED;
    }
    for (uint32_t n = 0; code == EXIT_DONE && run->pending[i] && n < run->suite->warm_up && !progressive_is(r); n++) {
        repeat repeat = {0};
        code = picture_render(r, &repeat);
        render_times_fini(&repeat.times);
    }
    return code == EXIT_FAILED ? row_fail(run->rows[i]) : code;
}

static int row_repeat(bench_run *run, uint32_t i, uint32_t number)
{
    renderer *const r = run->session.renderer;
    const bench_row *const row = run->rows[i];
    const bool last = number + 1 == run->suite->repeats;
    char what[32];
    snprintf(what, sizeof(what), "repeat %u/%u", number + 1, run->suite->repeats);
    progress_print(run, i, what);
    const double start = time_now();
    double seconds;
    repeat repeat = {0};
    int code = settings_switch(r, &row->settings, &seconds);
    code = code == EXIT_DONE ? picture_render(r, &repeat) : code;
    if (code == EXIT_DONE) {
        cJSON *const line = repeat_to_json(row, &repeat, number, progressive_is(r));
        // The picture comes before the line that says it is there.
        const bool written = !last || row_write(run, row, &repeat);
        code = row_line_add(run, row, "times", line) && written ? EXIT_DONE : EXIT_FAILED;
        run->pending[i]--;
        run->done_repeats++;
        run->seconds[row->configuration - run->suite->configurations] = time_now() - start;
    }
    render_times_fini(&repeat.times);
    return code == EXIT_FAILED ? row_fail(row) : code;
}

// In rounds, so that what drifts over time drifts for all alike.
static int rows_measure(bench_run *run)
{
    int code = EXIT_DONE;
    for (uint32_t i = 0; code == EXIT_DONE && i < run->row_count; i++) {
        code = run->pending[i] ? row_warm_up(run, i) : EXIT_DONE;
    }
    for (uint32_t number = 0; number < run->suite->repeats; number++) {
        for (uint32_t i = 0; code == EXIT_DONE && i < run->row_count; i++) {
            const bool is_due = run->pending[i] >= run->suite->repeats - number;
            code = is_due ? row_repeat(run, i, number) : EXIT_DONE;
        }
    }
    return code;
}

static bool image_is_there(bench_run *run, const char *image)
{
    return image && access(bench_path(run, image), R_OK) == 0;
}

// Whether all pictures that the report shows of a row are there, or cannot be made.
static bool images_are_there(bench_run *run, const bench_row *row)
{
    size_t place = 0;
    const cJSON *const line = bench_journal_next(run->journal, "row", row->key, &place);
    const bool lights_made =
        !lights_are_shown(run->suite, row->configuration->name) || cJSON_HasObjectItem(line, "lights_image");
    return lights_made && image_is_there(run, row->image) &&
           (!row->lights_image || image_is_there(run, row->lights_image));
}

// What is in the journal under the row's key is not measured again.
static uint32_t row_pending(bench_run *run, bench_row *row)
{
    bench_key_print(row_key(run, row), row->key);
    bench_row_collect(&run->results, row, run->journal);
    if (row->skipped || (row->done && images_are_there(run, row))) {
        run->reused++;
        return 0;
    }
    run->anew += !row->image && row_line_find(run, row, "row");
    size_t place = 0;
    uint32_t there = 0;
    while (bench_journal_next(run->journal, "times", row->key, &place)) {
        there++;
    }
    // The last one makes the picture.
    return run->suite->repeats - min_u32(there, run->suite->repeats - 1);
}

static void view_rows_init(bench_run *run)
{
    run->row_count = 0;
    for (uint32_t i = 0; i < run->results.row_count; i++) {
        bench_row *const row = &run->results.rows[i];
        if (row->view == run->view) {
            run->pending[run->row_count] = row_pending(run, row);
            run->rows[run->row_count++] = row;
        }
    }
}

static bool reference_line_add(bench_run *run, const bench_reference_result *result, const char *key)
{
    render_settings settings = result->view->settings;
    bench_settings_apply(&settings, result->reference->settings, result->reference->setting_count);
    cJSON *const line = line_make(result->view, "reference", result->reference->name, &settings);
    cJSON_AddStringToObject(line, "image", result->image);
    cJSON_AddNumberToObject(line, "done", (double)result->done);
    cJSON_AddNumberToObject(line, "error", result->error);
    cJSON_AddNumberToObject(line, "seconds", result->seconds);
    return bench_journal_add(run->journal, "reference", key, line);
}

static bool reference_line_is_there(const bench_run *run, const bench_reference_result *result, const char *key)
{
    render_settings settings = result->view->settings;
    bench_settings_apply(&settings, result->reference->settings, result->reference->setting_count);
    size_t place = 0;
    const cJSON *const line = bench_journal_next(run->journal, "reference", key, &place);
    return line && line_speaks_of(line, result->view, "reference", result->reference->name, &settings);
}

static int view_references_make(bench_run *run)
{
    const uint32_t view = (uint32_t)(run->view - run->suite->views), count = run->suite->reference_count;
    for (uint32_t i = 0; i < count; i++) {
        bench_reference_result *const result = &run->results.references[view * count + i];
        const bench_reference_desc desc = {
            .session = &run->session,
            .request = &run->request,
            .reference = result->reference,
            .folder = run->options.references,
            .title = arena_printf(&run->memory, "%s  reference %s", run->view->name, result->reference->name),
            .fresh = run->options.fresh_references,
        };
        char key[BENCH_KEY_SIZE];
        bool reused;
        const int code = bench_reference_make(&desc, &run->memory, result, key, &reused);
        if (code != EXIT_DONE ||
            !((reused && reference_line_is_there(run, result, key)) || reference_line_add(run, result, key))) {
            return code == EXIT_DONE ? EXIT_FAILED : code;
        }
    }
    return EXIT_DONE;
}

int bench_view_run(bench_run *run)
{
    const bench_view *const view = run->view;
    run->session = (render_session){0};
    run->request = (render_request){
        .scene = view->scene,
        .settings = view->settings,
        .camera = view->camera,
        .has_sun = view->has_sun,
        .device = run->options.device,
        .validate = run->options.validate,
    };
    memcpy(run->request.sun, view->sun, sizeof(view->sun));
    int code = EXIT_FAILED;
    if (render_session_open(&run->session, &run->request)) {
        view_rows_init(run);
        code = interrupt_seen() ? EXIT_INTERRUPTED : view_references_make(run);
        code = code == EXIT_DONE ? rows_measure(run) : code;
    }
    if (run->session.gpu && run->options.validate && gpu_validation_messages(run->session.gpu) > 0) {
        log_error("%s: the validation layer reported %u messages", view->name,
                  gpu_validation_messages(run->session.gpu));
        code = EXIT_FAILED;
    }
    render_session_close(&run->session);
    return code;
}

// ---- From the journal alone: rows and references of views that were not opened, by name and settings

static bool line_is_of_program(const bench_run *run, const cJSON *line)
{
    char program[BENCH_KEY_SIZE];
    bench_key_print(run->program, program);
    const char *const of = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(line, "program"));
    return of && strcmp(of, program) == 0;
}

// With --report-only also what other programs have measured: the report may be what has changed.
static void rows_recall(bench_run *run)
{
    for (uint32_t i = 0; i < run->results.row_count; i++) {
        bench_row *const row = &run->results.rows[i];
        const cJSON *line = row_line_find(run, row, "row");
        line = line ? line : row_line_find(run, row, "slow");
        if (!row->key[0] && line && (run->options.report_only || line_is_of_program(run, line))) {
            snprintf(row->key, sizeof(row->key), "%s",
                     cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(line, "key")));
            run->reused++;
        }
    }
}

static void references_recall(bench_run *run)
{
    for (uint32_t i = 0; i < run->results.reference_count; i++) {
        bench_reference_result *const result = &run->results.references[i];
        if (result->image) {
            continue;
        }
        render_settings settings = result->view->settings;
        bench_settings_apply(&settings, result->reference->settings, result->reference->setting_count);
        size_t place = 0;
        const cJSON *line;
        while ((line = bench_journal_next(run->journal, "reference", NULL, &place)) &&
               !line_speaks_of(line, result->view, "reference", result->reference->name, &settings)) {
        }
        if (line) {
            const cJSON *const error = cJSON_GetObjectItemCaseSensitive(line, "error");
            const char *const image = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(line, "image"));
            result->image = image && access(image, R_OK) == 0 ? image : NULL;
            result->done = (uint64_t)cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(line, "done"));
            result->error = cJSON_IsNumber(error) ? error->valuedouble : NAN;
            result->seconds = cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(line, "seconds"));
        }
    }
}

void bench_recall(bench_run *run)
{
    rows_recall(run);
    references_recall(run);
}
