// What a person reads of `lanternfield stability`: frames.csv, charts over the frames, a strip of frames, report.html
// and report.md.
#include "lanternfield_bench_report.h"
#include "lanternfield_gnuplot.h"
#include "lanternfield_stability.h"

#include "modules/image_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- Columns

typedef struct column {
    const char *name, *title;
    double (*value)(const stability_frame *frame);
} column;

static double flicker_of(const stability_frame *f)
{
    return f->flicker;
}
static double flip_of(const stability_frame *f)
{
    return f->error.flip_mean;
}
static double flip_p99_of(const stability_frame *f)
{
    return f->error.flip_p99;
}
static double error_of(const stability_frame *f)
{
    return f->error.relative_l2;
}
static double energy_of(const stability_frame *f)
{
    return f->error.energy;
}
static double blocks_of(const stability_frame *f)
{
    return f->blocks;
}
static double changed_of(const stability_frame *f)
{
    return f->changed;
}

static const column columns[] = {
    {"flicker", "flicker", flicker_of},
    {"flip_mean", "FLIP", flip_of},
    {"energy", "light over that of the reference", energy_of},
    {"blocks", "relative L2 of 8x8 block means", blocks_of},
    {"relative_l2", "relative L2 error", error_of},
    {"flip_p99", "FLIP, 99th percentile", flip_p99_of},
    {"changed", "changed", changed_of},
};
enum { CHARTS = 4 }; // of the first columns

static uint32_t frame_count(const stability_run *run)
{
    return run->end - run->begin;
}

typedef struct summary { // over the frames of a column that have a value
    double mean, worst;
    uint32_t worst_frame;
} summary;

static summary summary_of(const stability_run *run, const stability_variant *variant, const column *column)
{
    summary s = {.worst = -INFINITY};
    uint32_t count = 0;
    for (uint32_t i = 0; i < frame_count(run); i++) {
        const double value = column->value(&variant->frames[i]);
        if (isnan(value)) {
            continue;
        }
        s.mean += value;
        count++;
        if (value > s.worst) {
            s.worst = value;
            s.worst_frame = run->begin + i;
        }
    }
    s.mean /= max_u32(count, 1);
    return s;
}

// ---- frames.csv

static bool text_file_write(const stability_run *run, const char *name, char *text, size_t size)
{
    arena memory = {0};
    const bool ok = file_write(arena_printf(&memory, "%s/%s", run->request->folder, name), text, size);
    arena_fini(&memory);
    free(text);
    return ok;
}

static bool csv_write(const stability_run *run)
{
    char *text = NULL;
    size_t size = 0;
    FILE *const out = open_memstream(&text, &size);
    fputs("variant,frame,seconds", out);
    for (size_t c = 0; c < countof(columns); c++) {
        fprintf(out, ",%s", columns[c].name);
    }
    fputs("\n", out);
    for (uint32_t v = 0; v < STABILITY_VARIANTS; v++) {
        for (uint32_t i = 0; i < frame_count(run); i++) {
            const stability_variant *const variant = &run->variants[v];
            fprintf(out, "\"%s\",%u,%g", variant->name, run->begin + i, playback_time(run->script, run->begin + i));
            for (size_t c = 0; c < countof(columns); c++) {
                const double value = columns[c].value(&variant->frames[i]);
                fprintf(out, isnan(value) ? "," : ",%.7g", value);
            }
            fputs("\n", out);
        }
    }
    fclose(out);
    return text_file_write(run, "frames.csv", text, size);
}

// ---- Charts

static void chart_events_write(const stability_run *run, FILE *out)
{
    for (uint32_t e = 0; e < run->event_count; e++) {
        fprintf(out, "set arrow from %u, graph 0 to %u, graph 1 nohead lc rgb '#999999' dt 2\n", run->events[e].frame,
                run->events[e].frame);
    }
}

static gnuplot_result chart_write(const stability_run *run, const column *column)
{
    static const char *const colors[STABILITY_VARIANTS] = {"#0072b2", "#d55e00", "#009e73", "#999999"};
    char *text = NULL;
    size_t size = 0;
    FILE *const out = open_memstream(&text, &size);
    fprintf(out,
            "set xlabel 'frame'\nset ylabel '%s'\nset xrange [%u:%u]\nset yrange [0:*]\nset grid lc rgb '#dddddd'\n"
            "set key outside bottom center horizontal maxrows 2\n",
            column->title, run->begin, run->end - 1);
    chart_events_write(run, out);
    for (uint32_t v = 0; v < STABILITY_VARIANTS; v++) {
        fprintf(out, "$v%u << EOD\n", v);
        for (uint32_t i = 0; i < frame_count(run); i++) {
            const double value = column->value(&run->variants[v].frames[i]);
            if (isfinite(value)) {
                fprintf(out, "%u %.7g\n", run->begin + i, value);
            }
        }
        fputs("EOD\n", out);
    }
    for (uint32_t v = 0; v < STABILITY_VARIANTS; v++) {
        fprintf(out, "%s$v%u using 1:2 with lines lw 1.5 lc rgb '%s' title '%s'", v ? ", " : "plot ", v, colors[v],
                run->variants[v].name);
    }
    fputs("\n", out);
    fclose(out);
    arena memory = {0};
    const char *const path = arena_printf(&memory, "%s/%s", run->request->folder, column->name);
    const gnuplot_result result = gnuplot_draw(text, path, 640, 300);
    arena_fini(&memory);
    free(text);
    return result;
}

static gnuplot_result charts_write(const stability_run *run)
{
    gnuplot_result result = GNUPLOT_DONE;
    for (int c = 0; c < CHARTS && result == GNUPLOT_DONE; c++) {
        result = chart_write(run, &columns[c]);
    }
    if (result == GNUPLOT_MISSING) {
        log_warning("no charts: the program gnuplot was not found");
    }
    return result;
}

// ---- The strip: frames from left to right; the reference above, then each variant, each with its flicker below.

enum { STRIP_FRAMES = 6, STRIP_ROWS = 1 + 2 * STABILITY_VARIANTS };

static uint32_t strip_frame(const stability_run *run, uint32_t column)
{
    const uint32_t last = frame_count(run) - 1, shown = min_u32(STRIP_FRAMES, last);
    return 1 + (uint32_t)((uint64_t)column * (last - 1) / max_u32(shown - 1, 1));
}

static uint32_t strip_columns(const stability_run *run)
{
    return min_u32(STRIP_FRAMES, frame_count(run) - 1);
}

static void strip_flicker(const stability_run *run, const stability_variant *variant, uint32_t i, uint8_t *rgb)
{
    const size_t pixels = (size_t)run->width * run->height;
    float *const map = memory_alloc(pixels * sizeof(*map));
    sequence_flicker(variant->frames[i].image, variant->frames[i - 1].image, run->references[i], run->references[i - 1],
                     run->width, run->height, map);
    for (size_t p = 0; p < pixels; p++) {
        color_map_sequential(5 * map[p], rgb + 3 * p); // white: a fifth of the mean light
    }
    free(map);
}

static void strip_cell(const stability_run *run, uint32_t row, uint32_t i, uint8_t *rgb)
{
    if (row == 0) {
        image_tonemap(run->references[i], run->width, run->height, run->ev, rgb);
    } else if (row % 2) {
        image_tonemap(run->variants[row / 2].frames[i].image, run->width, run->height, run->ev, rgb);
    } else {
        strip_flicker(run, &run->variants[row / 2 - 1], i, rgb);
    }
}

static bool strip_write(const stability_run *run)
{
    const uint32_t columns_shown = strip_columns(run), width = columns_shown * run->width;
    uint8_t *const strip = memory_alloc((size_t)width * run->height * STRIP_ROWS * 3);
    uint8_t *const cell = memory_alloc((size_t)run->width * run->height * 3);
    for (uint32_t row = 0; row < STRIP_ROWS; row++) {
        for (uint32_t c = 0; c < columns_shown; c++) {
            strip_cell(run, row, strip_frame(run, c), cell);
            for (uint32_t y = 0; y < run->height; y++) {
                memcpy(strip + 3 * (((size_t)row * run->height + y) * width + (size_t)c * run->width),
                       cell + 3 * (size_t)y * run->width, 3 * (size_t)run->width);
            }
        }
    }
    arena memory = {0};
    const bool ok = image_write_png(arena_printf(&memory, "%s/strip.png", run->request->folder), strip, width,
                                    run->height * STRIP_ROWS, 3);
    arena_fini(&memory);
    free(strip);
    free(cell);
    return ok;
}

// ---- report.html and report.md

typedef struct writer {
    const stability_run *run;
    FILE *out;
    bool markdown, ok;
    arena memory;
} writer;

static void row_begin(writer *w)
{
    fputs(w->markdown ? "|" : "<tr>", w->out);
}

static void cell_write(writer *w, const char *text)
{
    if (w->markdown) {
        fprintf(w->out, " %s |", text);
        return;
    }
    fputs("<td>", w->out);
    report_html_write(w->out, text);
    fputs("</td>", w->out);
}

static void row_end(writer *w)
{
    fputs(w->markdown ? "\n" : "</tr>\n", w->out);
}

static void number_cell(writer *w, double value)
{
    cell_write(w, bench_number(&w->memory, value));
}

static void titles_write(writer *w)
{
    static const char *const titles[] = {"",
                                         "flicker (ii), mean",
                                         "worst",
                                         "FLIP (iv), mean",
                                         "worst frame",
                                         "relative L2",
                                         "deviation (i)",
                                         "changed frames"};
    row_begin(w);
    for (size_t i = 0; i < countof(titles); i++) {
        cell_write(w, titles[i]);
    }
    for (uint32_t e = 0; e < w->run->event_count; e++) {
        cell_write(w, arena_printf(&w->memory, "frames to settle (iii): %s at %u", w->run->events[e].what,
                                   w->run->events[e].frame));
    }
    row_end(w);
    for (size_t i = 0; w->markdown && i < countof(titles) + w->run->event_count; i++) {
        fputs(i ? "---:|" : "|---|", w->out);
    }
    fputs(w->markdown ? "\n" : "", w->out);
}

static void variant_row(writer *w, const stability_variant *variant)
{
    const summary flicker = summary_of(w->run, variant, &columns[0]), flip = summary_of(w->run, variant, &columns[1]);
    uint32_t changed = 0;
    const uint32_t count = frame_count(w->run), still = min_u32(count, STABILITY_STILL);
    for (uint32_t i = count - still + 1; i < count; i++) {
        changed += variant->frames[i].changed;
    }
    row_begin(w);
    cell_write(w, variant->name);
    number_cell(w, flicker.mean);
    number_cell(w, flicker.worst);
    number_cell(w, flip.mean);
    cell_write(w, arena_printf(&w->memory, "%s (frame %u)", bench_number(&w->memory, flip.worst), flip.worst_frame));
    number_cell(w, summary_of(w->run, variant, &columns[4]).mean);
    number_cell(w, variant->deviation);
    cell_write(w, arena_printf(&w->memory, "%u of %u", changed, still - 1));
    for (uint32_t e = 0; e < w->run->event_count; e++) {
        number_cell(w, stability_settling(w->run, variant, e));
    }
    row_end(w);
}

static void paragraph(writer *w, const char *text)
{
    fputs(w->markdown ? "" : "<p>", w->out);
    (w->markdown ? (void)fputs(text, w->out) : report_html_write(w->out, text));
    fputs(w->markdown ? "\n\n" : "</p>\n", w->out);
}

static void heading(writer *w, const char *text)
{
    fputs(w->markdown ? "## " : "<h2>", w->out);
    (w->markdown ? (void)fputs(text, w->out) : report_html_write(w->out, text));
    fputs(w->markdown ? "\n\n" : "</h2>\n", w->out);
}

static void picture(writer *w, const char *title, const char *name)
{
    if (w->markdown) {
        fprintf(w->out, "![%s](%s)\n\n", title, name);
        return;
    }
    size_t size;
    uint8_t *const bytes = file_read(arena_printf(&w->memory, "%s/%s", w->run->request->folder, name), &size);
    w->ok = w->ok && bytes;
    fprintf(w->out, "<p><img alt=\"%s\" src=\"data:image/png;base64,", title);
    report_base64_write(w->out, bytes, bytes ? size : 0);
    fputs("\"></p>\n", w->out);
    free(bytes);
}

static void text_write(writer *w, bool charts)
{
    const stability_run *const run = w->run;
    char *const settings =
        arena_printf(&w->memory, "%s, frames %u to %u at %g a second, %ux%u; references: %u %s.", run->script->path,
                     run->begin, run->end - 1, run->script->frame_rate, run->width, run->height,
                     run->request->reference_spp ? run->request->reference_spp : run->request->reference_vpls,
                     run->request->reference_spp ? "samples a pixel, path traced" : "VPLs at every pixel");
    paragraph(w, settings);
    fputs(w->markdown ? "" : "<table>\n", w->out);
    titles_write(w);
    for (uint32_t v = 0; v < STABILITY_VARIANTS; v++) {
        variant_row(w, &run->variants[v]);
    }
    fputs(w->markdown ? "\n" : "</table>\n", w->out);
    paragraph(w, "(i) Standard deviation over mean of each pixel over the last frames (32 at most), mean over the "
                 "pixels; it says something where script and history stand still. (ii) Change from frame to frame that "
                 "the reference does not have, over the reference's mean light. (iii) Frames until the light, over the "
                 "reference's, stays within 5 % of what it comes to before the next event. (iv) Mean FLIP of a frame.");
    for (int c = 0; c < CHARTS && charts; c++) {
        heading(w, columns[c].title);
        picture(w, columns[c].title, arena_printf(&w->memory, "%s.png", columns[c].name));
    }
    heading(w, "Frames");
    FILE *list;
    char *text = NULL;
    size_t size = 0;
    list = open_memstream(&text, &size);
    fputs("Frames", list);
    for (uint32_t c = 0; c < strip_columns(run); c++) {
        fprintf(list, "%s %u", c ? "," : "", run->begin + strip_frame(run, c));
    }
    fputs(". From above: the reference;", list);
    for (uint32_t v = 0; v < STABILITY_VARIANTS; v++) {
        fprintf(list, " %s, and its flicker%s", run->variants[v].name, v + 1 < STABILITY_VARIANTS ? ";" : "");
    }
    fputs(" (white: a fifth of the mean light or more).", list);
    fclose(list);
    paragraph(w, text);
    free(text);
    picture(w, "frames", "strip.png");
}

static bool document_write(const stability_run *run, const char *name, bool markdown, bool charts)
{
    char *text = NULL;
    size_t size = 0;
    writer w = {.run = run, .markdown = markdown, .ok = true, .out = open_memstream(&text, &size)};
    if (markdown) {
        fputs("# Stability\n\n", w.out);
    } else {
        fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Stability</title>\n<style>"
              "body{font:14px sans-serif;max-width:1100px;margin:2em auto;padding:0 1em}table{border-collapse:collapse}"
              "td{border:1px solid #ccc;padding:.2em .6em;text-align:right}td:first-child{text-align:left}"
              "tr:first-child{font-weight:bold}img{max-width:100%}</style></head>\n<body><h1>Stability</h1>\n",
              w.out);
    }
    text_write(&w, charts);
    fputs(markdown ? "" : "</body></html>\n", w.out);
    fclose(w.out);
    arena_fini(&w.memory);
    return text_file_write(run, name, text, size) && w.ok;
}

static void summary_print(const stability_run *run)
{
    for (uint32_t v = 0; v < STABILITY_VARIANTS; v++) {
        const stability_variant *const variant = &run->variants[v];
        const summary flicker = summary_of(run, variant, &columns[0]), flip = summary_of(run, variant, &columns[1]);
        log_info("%-22s flicker %.5f, worst %.5f; FLIP %.4f, worst %.4f (frame %u); deviation %.5f", variant->name,
                 flicker.mean, flicker.worst, flip.mean, flip.worst, flip.worst_frame, variant->deviation);
    }
    if (run->reference_seconds > 0) {
        log_info("references: %.0f s, kept in \"%s\"", run->reference_seconds, run->references_folder);
    }
}

bool stability_report_write(const stability_run *run)
{
    const gnuplot_result charts = charts_write(run);
    bool ok = charts != GNUPLOT_FAILED;
    ok = csv_write(run) && ok;
    ok = strip_write(run) && ok;
    ok = document_write(run, "report.html", false, charts == GNUPLOT_DONE) && ok;
    ok = document_write(run, "report.md", true, charts == GNUPLOT_DONE) && ok;
    summary_print(run);
    return ok;
}
