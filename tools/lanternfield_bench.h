// What the files of `lanternfield bench` share: the suite as read, the results as measured, and the report made of
// them. A suite is a JSON file; every key is described in assets/suites/README.md.
#pragma once

#include "lanternfield.h"
#include "modules/image_measure.h"

// ---- The suite: lanternfield_bench_suite.c. Strings live in `memory`.

typedef struct bench_view { // a scene seen by a camera
    const char *name; // "atrium"
    const char *scene; // path, relative to the folder that the command runs in
    const char *camera; // NULL: the first
    bool optional; // left out, with a warning, where the scene's file is missing
    bool absent; // so it is
    bool has_sun;
    float sun[4];
    render_settings settings; // the suite's with the view's own, before a configuration's
} bench_view;

typedef struct bench_setting { // one option that a configuration sets, as text for settings_set
    const char *name, *value;
} bench_setting;
typedef struct bench_configuration { // sweeps are spelled out: one configuration a combination
    const char *name; // unique; "alpha=2 vpls=1000" for what a sweep makes without a name of its own
    const char *series; // joins points to a curve in charts; never NULL
    const char *label; // at a point in charts; NULL: the name
    const bench_setting *settings;
    uint32_t setting_count;
    const char *const *views; // only these; NULL: all
    uint32_t view_count;
    double time_limit_s; // 0: none. A configuration whose warm-up frame takes longer is skipped, and the report says so
} bench_configuration;

typedef struct bench_reference { // errors are measured against each
    const char *name; // "path": prefix of its error columns
    const bench_setting *settings; // on top of the view's: method, spp, until, ...
    uint32_t setting_count;
    double budget_s; // rendering stops after this long; 0: when the method is finished
} bench_reference;

// A series keeps its colour and marker over all charts of a suite; where several views share a panel, marker and dashes
// tell the view. Points whose configurations have no label show the settings in which their series differs, as "2/10K",
// and a line below the chart says which these are.
typedef struct bench_chart {
    const char *name, *title; // name: of the files NAME.svg and NAME.png
    const char *x, *y; // columns of results.csv, or a metric (see bench_metric); bars do without x, and
    // may say "configuration"
    const char *x_label, *y_label;
    bool x_log, y_log;
    bool pareto; // draws the front of each view: points that no other beats in both
    bool labels; // at the points
    // Joins the points of each series in the suite's order. False: only of those whose points differ in a single
    // setting; for sweeps over several there is no order that means anything.
    bool lines;
    bool bars; // instead of curves: one group a view, one bar a configuration
    bool per_view; // one chart a view, side by side; false: all views in one
    const char *const *series; // only these; NULL: all
    uint32_t series_count;
} bench_chart;

// A ratio that the paper prints, beside ours: metric of configuration `of` over that of configuration `to`; without
// `to` the metric itself.
typedef struct bench_comparison {
    const char *text; // "construction, scatter over gather"
    const char *metric;
    const char *of, *to;
    double paper; // NAN: the paper does not say
    const char *note; // why ours differs, one sentence; NULL
} bench_comparison;

typedef struct bench_table { // configurations down, columns across; one table a view, or `metric` alone with views
                             // across
    const char *title;
    const char *const *columns; // metrics
    const char *const *column_titles; // NULL: the metrics themselves
    uint32_t column_count;
    const char *metric; // views across instead
} bench_table;

typedef struct bench_pictures { // a row of pictures a view
    const char *title;
    const char *const *configurations; // NULL: all
    uint32_t configuration_count;
    const char *what; // "picture" (default), "lights-per-pixel" (heat map), "flip" (map against the first reference)
} bench_pictures;

typedef struct bench_suite {
    arena memory;
    const char *path, *name, *title, *description; // description: what it shows, in plain words
    uint32_t repeats, warm_up; // each of `frames` frames; warm-up repeats are not timed
    bench_view *views;
    uint32_t view_count;
    bench_configuration *configurations;
    uint32_t configuration_count;
    bench_reference *references;
    uint32_t reference_count;
    bench_chart *charts;
    uint32_t chart_count;
    bench_comparison *comparisons;
    uint32_t comparison_count;
    bench_table *tables;
    uint32_t table_count;
    bench_pictures *pictures;
    uint32_t picture_count;
} bench_suite;

// NULL, and one logged line with file, place ("configurations[2].settings.alpha") and what was expected.
bench_suite *bench_suite_read(const char *path);
void bench_suite_destroy(bench_suite *suite);

// ---- Results: lanternfield_bench.c measures them, one row a view and configuration.

enum { BENCH_KEY_SIZE = 17 }; // 16 hexadecimal digits
typedef struct bench_pass_time {
    const char *name; // module: "light_volume"
    double p50, p95; // ms
} bench_pass_time;
typedef struct bench_row {
    const bench_view *view;
    const bench_configuration *configuration;
    render_settings settings; // all of them, as rendered
    bool done; // false: not measured (skipped or not yet)
    const char *skipped; // why, or NULL
    double frame_ms_p50, frame_ms_p95;
    // What one picture costs: the frame for the real-time methods (p50), all frames together for the progressive ones.
    double picture_ms;
    bench_pass_time *passes; // by module
    uint32_t pass_count;
    bench_pass_time *steps; // "lgh_build/merge": the passes of the frame graph that a module is made of
    uint32_t step_count;
    double lights_per_pixel, rays_per_pixel; // NAN: not known
    double grid_lights; // in all levels; NAN without a hierarchy
    double memory_bytes; // peak on the device
    image_measures *errors; // one a reference
    const char *image; // EXR in the results' folder: "images/atrium.alpha_2.exr"
    const char *lights_image; // EXR of lights per pixel, or NULL
    char key[BENCH_KEY_SIZE]; // in the journal: names all that was measured depends on, the executable too
} bench_row;
typedef struct bench_reference_result {
    const bench_view *view;
    const bench_reference *reference;
    const char *image; // EXR, path usable as it is; NULL: not there (yet), and the errors against it are NAN
    uint64_t done; // samples or VPLs
    double error; // its own estimate; NAN: not known
    double seconds; // that it took
} bench_reference_result;
typedef struct bench_results {
    const bench_suite *suite;
    arena memory;
    const char *folder; // -o
    const char *device;
    bench_row *rows; // views x configurations, view by view, but those that a configuration's `views` leaves out
    uint32_t row_count;
    bench_reference_result *references; // views x references, view by view
    uint32_t reference_count;
} bench_results;

// A number of a row by name: any column of results.csv - "frame_ms", "picture_ms", "lights_per_pixel",
// "rays_per_pixel", "grid_lights", "memory_mb", "path.relative_l2" (reference.measure), "relative_l2" (the first
// reference's), any numeric setting ("vpls", "alpha") - or times of passes added up: "ms:light_volume+shadow",
// "ms:lgh_build/s1" for a step, and "ms:*-vpl_trace-lgh_build" for all passes but those; "ms_p95:" likewise. NAN when
// the row does not have it.
double bench_metric(const bench_results *results, const bench_row *row, const char *name);
bool bench_metric_known(const bench_suite *suite, const char *name); // for checking suites
const bench_row *bench_row_find(const bench_results *results, const bench_view *view, const char *configuration);

// A metric as heading, with its unit ("frame, ms"), and a number to three digits ("1,230", "0.0123"; whole numbers in
// full, NAN as a dash). Both live in `memory`. In lanternfield_bench_report.c.
const char *bench_metric_title(arena *memory, const char *name);
const char *bench_number(arena *memory, double value);

// ---- What is made of results: results.csv, charts as SVG and PNG, report.html, report.md (the tables and comparisons
// alone, for docs/). All written beside and renamed. Rows that are not done are left out and named.
bool bench_csv_write(const bench_results *results); // lanternfield_bench_results.c
bool bench_charts_write(const bench_results *results); // lanternfield_bench_chart.c, through gnuplot
bool bench_report_write(const bench_results *results); // lanternfield_bench_report.c

// ---- Between the files of the runner.

// Sets what the suite's reader has checked.
void bench_settings_apply(render_settings *settings, const bench_setting *items, uint32_t count);
// FNV-1a, 64 bit; begins with BENCH_HASH_START and goes on with the last result.
#define BENCH_HASH_START 0xcbf29ce484222325ull
uint64_t bench_hash(uint64_t hash, const void *bytes, size_t size);
bool bench_hash_file(const char *path, uint64_t *hash); // false: logged
void bench_key_print(uint64_t hash, char key[BENCH_KEY_SIZE]);
bool bench_folder_make(const char *path); // also its parents; false: logged

// The journal: what is finished, one JSON object a line, each with "kind" and "key". Only ever appended to, so that
// a process that ends at any moment loses nothing but the line it was writing.
//   times      key of the row; view, configuration, repeat, frames [ms], picture_ms, passes and steps {name: [ms]}
//   row        key of the row; view, configuration, device, image, lights_per_pixel, ...; where the suite shows it
//              lights_image, null when there are no lights to count
//   slow       key of the row; view, configuration, seconds of one frame: more than the time limit
//   reference  its key; view, reference, image, done, error, seconds
//   errors     contents of image and reference, "KEY-KEY"; the measures by name
typedef struct bench_journal bench_journal;
struct cJSON;
bench_journal *bench_journal_open(const char *folder); // NULL: logged; another process holds it, or it is unreadable
void bench_journal_close(bench_journal *journal); // accepts NULL
// Takes `line`; on the disk when this returns. False: logged.
bool bench_journal_add(bench_journal *journal, const char *kind, const char *key, struct cJSON *line);
// Newest first: the first with this kind and key (NULL: any) after `*place`, which begins at 0. NULL: no more.
const struct cJSON *bench_journal_next(const bench_journal *journal, const char *kind, const char *key, size_t *place);

bool bench_configuration_in_view(const bench_configuration *configuration, const bench_view *view);
// All settings as text, hashed.
uint64_t bench_settings_hash(const render_settings *settings);
// Fills the measurements of a row from the journal by its key.
void bench_row_collect(bench_results *results, bench_row *row, const bench_journal *journal);
void bench_results_init(bench_results *results, const bench_suite *suite, const char *folder);
void bench_results_fini(bench_results *results);

// The next frame is the first of a new picture: no history, no sums, the same random numbers each time.
void bench_restart(renderer *r);

// Renders a reference into `folder`, goes on with one that was begun, or finds it there. On the way r->settings change.
// EXIT_DONE, EXIT_INTERRUPTED or EXIT_FAILED (logged).
typedef struct bench_reference_desc {
    render_session *session;
    const render_request *request; // the view's
    const bench_reference *reference;
    const char *folder;
    const char *title; // for the progress line
    bool fresh; // even if it is there
} bench_reference_desc;
int bench_reference_make(const bench_reference_desc *desc, arena *memory, bench_reference_result *result,
                         char key[BENCH_KEY_SIZE], bool *reused);

// ---- The command's words behind "bench" and "compare".
int bench_command(int argc, char **argv);
int compare_command(int argc, char **argv);
