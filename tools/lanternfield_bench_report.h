// A report as it is written: what its tables (lanternfield_bench_report.c) and its pictures
// (lanternfield_bench_pictures.c) share.
#pragma once

#include "lanternfield_bench.h"

typedef struct report {
    const bench_results *results;
    arena memory;
    FILE *out;
    bool markdown;
    bool failed; // a picture could not be read; the rest is written all the same
} report;

void report_html_write(FILE *out, const char *text); // with what HTML would read escaped
void report_base64_write(FILE *out, const uint8_t *bytes, size_t size);
void report_heading_write(report *r, int level, const char *text);
const char *report_path(report *r, const char *name); // of a file in the results' folder

// The suite's pictures with their error maps: a heading each, and a row a view. HTML alone.
void report_pictures_write(report *r);
