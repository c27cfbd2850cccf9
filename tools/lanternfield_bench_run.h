// One run of `lanternfield bench`: what the files that measure share.
#pragma once

#include "lanternfield_bench.h"

typedef struct bench_options {
    const char *suite, *folder, *references, *views, *device;
    bool validate, report_only, fresh_references, help;
} bench_options;

typedef struct bench_run {
    bench_options options;
    bench_suite *suite;
    bench_results results;
    bench_journal *journal;
    arena memory;
    uint64_t program; // hash of version and executable
    double start;
    uint32_t reused, anew; // rows that were there; rows that were there, but of another program, scene or device
    // Of the view being measured:
    const bench_view *view;
    render_session session;
    render_request request;
    bench_row **rows;
    uint32_t row_count;
    uint32_t *pending; // per row: repeats to do
    double *seconds; // per configuration of the suite: what a repeat takes; 0: not known
    // For the progress line:
    uint32_t done_repeats;
} bench_run;

// Whether a view is asked for (--views) and its scene is there.
bool bench_view_selected(const bench_run *run, const bench_view *view);
// A file of the -o folder.
const char *bench_path(bench_run *run, const char *name);

// ---- lanternfield_bench_measure.c
// References and configurations of run->view, but what the journal has. EXIT_DONE, EXIT_INTERRUPTED or EXIT_FAILED.
int bench_view_run(bench_run *run);
// Gives rows and references of views that were not opened the keys of what the journal has of them by name.
void bench_recall(bench_run *run);

// ---- lanternfield_bench_errors.c
bool bench_errors_measure(bench_run *run); // of all rows that are done against all references that are there
