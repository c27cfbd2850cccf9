// What the files of `lanternfield bench` share: the suite as read, the results as measured, and the report made of them.
// A suite is a JSON file; every key is described in assets/suites/README.md.
#pragma once

#include "lanternfield.h"
#include "modules/image_measure.h"

// ---- The suite: lanternfield_bench_suite.c. Strings live in `memory`.

typedef struct bench_view { // a scene seen by a camera
    const char *name; // "atrium"
    const char *scene; // path, relative to the folder that the command runs in
    const char *camera; // NULL: the first
    bool has_sun;
    float sun[4];
    render_settings settings; // the suite's with the view's own, before a configuration's
} bench_view;

typedef struct bench_setting { // one option that a configuration sets, as text for settings_set
    const char *name, *value;
} bench_setting;
typedef struct bench_configuration { // sweeps are spelled out: one configuration a combination
    const char *name; // unique; "alpha=2 vpls=1000" for what a sweep makes without a name of its own
    const char *series; // joins points to a curve in charts
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

typedef struct bench_chart {
    const char *name, *title; // name: of the files NAME.svg and NAME.png
    const char *x, *y; // columns of results.csv, or a metric (see bench_metric)
    const char *x_label, *y_label;
    bool x_log, y_log;
    bool pareto; // draws the front of each view: points that no other beats in both
    bool labels; // at the points
    bool bars; // instead of curves: one group a view, one bar a configuration
    bool per_view; // one chart a view, side by side; false: all views in one
    const char *const *series; // only these; NULL: all
    uint32_t series_count;
} bench_chart;

// A ratio that the paper prints, beside ours: metric of configuration `of` over that of configuration `to`; without `to`
// the metric itself.
typedef struct bench_comparison {
    const char *text; // "construction, scatter over gather"
    const char *metric;
    const char *of, *to;
    double paper; // NAN: the paper does not say
    const char *note; // why ours differs, one sentence; NULL
} bench_comparison;

typedef struct bench_table { // configurations down, columns across; one table a view, or `metric` alone with views across
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
    bench_pass_time *passes;
    uint32_t pass_count;
    double lights_per_pixel, rays_per_pixel; // NAN: not known
    double grid_lights; // in all levels; NAN without a hierarchy
    double memory_bytes; // peak on the device
    image_measures *errors; // one a reference
    const char *image; // EXR in the results' folder: "images/atrium.alpha_2.exr"
    const char *lights_image; // EXR of lights per pixel, or NULL
} bench_row;
typedef struct bench_reference_result {
    const bench_view *view;
    const bench_reference *reference;
    const char *image; // EXR, path usable as it is
    uint64_t done; // samples or VPLs
    double error; // its own estimate; NAN: not known
    double seconds; // that it took
} bench_reference_result;
typedef struct bench_results {
    const bench_suite *suite;
    arena memory;
    const char *folder; // -o
    const char *device;
    bench_row *rows; // views x configurations, view by view
    uint32_t row_count;
    bench_reference_result *references; // views x references, view by view
    uint32_t reference_count;
} bench_results;

// A number of a row by name: any column of results.csv - "frame_ms", "picture_ms", "lights_per_pixel", "rays_per_pixel",
// "grid_lights", "memory_mb", "path.relative_l2" (reference.measure), "relative_l2" (the first reference's), any numeric
// setting ("vpls", "alpha") - or times of passes added up: "ms:light_volume+shadow", and "ms:*-vpl_trace-lgh_build" for
// all passes but those. NAN when the row does not have it.
double bench_metric(const bench_results *results, const bench_row *row, const char *name);
bool bench_metric_known(const bench_suite *suite, const char *name); // for checking suites
const bench_row *bench_row_find(const bench_results *results, const bench_view *view, const char *configuration);

// ---- What is made of results: results.csv, charts as SVG and PNG, report.html, report.md (the tables and comparisons
// alone, for docs/). All written beside and renamed. Rows that are not done are left out and named.
bool bench_csv_write(const bench_results *results); // lanternfield_bench_results.c
bool bench_charts_write(const bench_results *results); // lanternfield_bench_chart.c, through gnuplot
bool bench_report_write(const bench_results *results); // lanternfield_bench_report.c

// ---- The command's words behind "bench" and "compare".
int bench_command(int argc, char **argv);
int compare_command(int argc, char **argv);
