// What a person reads of a bench's results: report.html, one file with all its pictures and charts, and report.md, the
// tables alone. Nothing in them depends on when or where they were written.
#include "lanternfield_bench_report.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// ---- Numbers and headings

// 1234567 as "1,234,567".
static const char *with_commas(arena *memory, const char *digits)
{
    const size_t count = strspn(digits, "0123456789");
    char *const text = arena_alloc(memory, 2 * strlen(digits) + 1);
    char *out = text;
    for (size_t i = 0; digits[i]; i++) {
        if (i > 0 && i < count && (count - i) % 3 == 0) {
            *out++ = ',';
        }
        *out++ = digits[i];
    }
    return text;
}

const char *bench_number(arena *memory, double value)
{
    if (!isfinite(value)) {
        return isnan(value) ? "–" : value > 0 ? "∞" : "−∞";
    }
    const double size = fabs(value);
    const char *const sign = value < 0 ? "−" : "";
    const char *digits;
    if (size < 1e15 && size == floor(size)) {
        digits = arena_printf(memory, "%.0f", size);
    } else if (size < 1e-3 || size >= 1e15) {
        digits = arena_printf(memory, "%.2e", size);
    } else {
        // Rounded first: 9.999 has three digits as 10.0.
        char rounded[32];
        snprintf(rounded, sizeof(rounded), "%.2e", size);
        const double kept = strtod(rounded, NULL);
        const int decimals = 2 - (int)floor(log10(kept) + 1e-9);
        digits = arena_printf(memory, "%.*f", decimals > 0 ? decimals : 0, kept);
    }
    return arena_printf(memory, "%s%s", sign, with_commas(memory, digits));
}

typedef struct metric_info {
    const char *name, *title;
} metric_info;
static const metric_info metric_titles[] = {
    {"frame_ms", "frame, ms"},
    {"frame_ms_p95", "frame p95, ms"},
    {"picture_ms", "time, ms"},
    {"lights_per_pixel", "lights per pixel"},
    {"rays_per_pixel", "rays per pixel"},
    {"grid_lights", "grid lights"},
    {"memory_mb", "memory, MB"},
    {"relative_l2", "relative L2 error"},
    {"relative_mse", "relMSE"},
    {"energy", "energy ratio"},
    {"psnr", "PSNR, dB"},
    {"flip_mean", "FLIP"},
    {"flip_p95", "FLIP p95"},
    {"flip_p99", "FLIP p99"},
    {"hdr_flip_mean", "HDR-FLIP"},
    {"hdr_flip_p95", "HDR-FLIP p95"},
    {"hdr_flip_p99", "HDR-FLIP p99"},
};

static const char *title_find(const char *name)
{
    for (size_t i = 0; i < countof(metric_titles); i++) {
        if (strcmp(metric_titles[i].name, name) == 0) {
            return metric_titles[i].title;
        }
    }
    return name;
}

// "a+b-c" as "a + b − c".
static const char *sum_title(arena *memory, const char *sum)
{
    char *const text = arena_alloc(memory, 5 * strlen(sum) + 1);
    char *out = text;
    for (const char *c = sum; *c; c++) {
        if (*c == '+' || *c == '-') {
            out += sprintf(out, "%s", *c == '+' ? " + " : " − ");
        } else {
            out += sprintf(out, "%s", *c == '*' ? "all passes" : (const char[]){*c, '\0'});
        }
    }
    return text;
}

const char *bench_metric_title(arena *memory, const char *name)
{
    if (strncmp(name, "ms:", 3) == 0) {
        return arena_printf(memory, "%s, ms", sum_title(memory, name + 3));
    }
    if (strncmp(name, "ms_p95:", 7) == 0) {
        return arena_printf(memory, "%s p95, ms", sum_title(memory, name + 7));
    }
    const char *const dot = strchr(name, '.');
    if (dot) {
        return arena_printf(memory, "%s to %.*s", title_find(dot + 1), (int)(dot - name), name);
    }
    return title_find(name);
}

// Which of several values is the best: of times and errors the smallest, of PSNR the largest, of energy that nearest to
// 1; counts and settings have no best.
typedef enum preference { PREFER_NONE, PREFER_SMALL, PREFER_LARGE, PREFER_ONE } preference;
static preference metric_preference(const char *name)
{
    static const struct {
        const char *part;
        preference preference;
    } preferences[] = {
        {"ms", PREFER_SMALL},   {"relative_", PREFER_SMALL}, {"flip_", PREFER_SMALL},
        {"psnr", PREFER_LARGE}, {"energy", PREFER_ONE},
    };
    for (size_t i = 0; i < countof(preferences); i++) {
        if (strstr(name, preferences[i].part)) {
            return preferences[i].preference;
        }
    }
    return PREFER_NONE;
}

// The smaller the better; NAN: no part in it.
static double badness(preference preference, double value)
{
    switch (preference) {
    case PREFER_SMALL:
        return value;
    case PREFER_LARGE:
        return -value;
    case PREFER_ONE:
        return value > 0 ? fabs(log(value)) : NAN;
    case PREFER_NONE:
        return NAN;
    }
    return NAN;
}

// ---- Tables, for both files

typedef struct cell {
    const char *text;
    bool number, best;
    double value;
} cell;
typedef struct table {
    uint32_t columns, rows; // rows: with that of titles
    cell *cells; // row by row
} table;

static table table_make(report *r, uint32_t columns, uint32_t rows_max)
{
    return (table){.columns = columns, .cells = arena_alloc(&r->memory, (size_t)columns * rows_max * sizeof(cell))};
}

// The next row, of empty texts.
static cell *table_row(table *t)
{
    cell *const row = &t->cells[(size_t)t->rows++ * t->columns];
    for (uint32_t i = 0; i < t->columns; i++) {
        row[i].text = "";
    }
    return row;
}

static cell cell_number(report *r, double value)
{
    return (cell){.text = bench_number(&r->memory, value), .number = true, .value = value};
}

// Marks the best of a column, and all that equal it, unless all do.
static void table_mark_best(table *t, uint32_t column, preference preference)
{
    double best = INFINITY, worst = -INFINITY;
    for (uint32_t i = 1; i < t->rows; i++) {
        const cell *const c = &t->cells[(size_t)i * t->columns + column];
        const double bad = c->number ? badness(preference, c->value) : NAN;
        best = fmin(best, bad);
        worst = fmax(worst, bad);
    }
    for (uint32_t i = 1; i < t->rows && best < worst; i++) {
        cell *const c = &t->cells[(size_t)i * t->columns + column];
        c->best = c->number && badness(preference, c->value) == best;
    }
}

void report_html_write(FILE *out, const char *text)
{
    for (; *text; text++) {
        switch (*text) {
        case '<':
            fputs("&lt;", out);
            break;
        case '>':
            fputs("&gt;", out);
            break;
        case '&':
            fputs("&amp;", out);
            break;
        case '"':
            fputs("&quot;", out);
            break;
        default:
            fputc(*text, out);
            break;
        }
    }
}

// On one line; what Markdown or HTML would read is escaped.
static void markdown_write(FILE *out, const char *text)
{
    for (; *text; text++) {
        if (strchr("\\`*_[]<>|#&~", *text)) {
            fputc('\\', out);
        }
        fputc(*text == '\n' || *text == '\r' ? ' ' : *text, out);
    }
}

const char *report_path(report *r, const char *name)
{
    return arena_printf(&r->memory, "%s/%s", r->results->folder, name);
}

static void text_write(report *r, const char *text)
{
    (r->markdown ? markdown_write : report_html_write)(r->out, text);
}

static void table_html_write(report *r, const table *t)
{
    fputs("<div class=\"wide\"><table>\n", r->out);
    for (uint32_t i = 0; i < t->rows; i++) {
        const char *const tag = i == 0 ? "th" : "td";
        fputs("<tr>", r->out);
        for (uint32_t k = 0; k < t->columns; k++) {
            const cell *const c = &t->cells[(size_t)i * t->columns + k];
            fprintf(r->out, "<%s%s>%s", tag, c->number ? " class=\"n\"" : "", c->best ? "<b>" : "");
            report_html_write(r->out, c->text);
            fprintf(r->out, "%s</%s>", c->best ? "</b>" : "", tag);
        }
        fputs("</tr>\n", r->out);
    }
    fputs("</table></div>\n", r->out);
}

static void table_markdown_write(report *r, const table *t)
{
    for (uint32_t i = 0; i < t->rows; i++) {
        for (uint32_t k = 0; k < t->columns; k++) {
            const cell *const c = &t->cells[(size_t)i * t->columns + k];
            fprintf(r->out, "%s%s", k == 0 ? "| " : " | ", c->best ? "**" : "");
            markdown_write(r->out, c->text);
            fputs(c->best ? "**" : "", r->out);
        }
        fputs(" |\n", r->out);
        for (uint32_t k = 0; i == 0 && k < t->columns; k++) {
            fputs(t->cells[k].number ? "|---:" : "|---", r->out);
        }
        fputs(i == 0 ? "|\n" : "", r->out);
    }
    fputc('\n', r->out);
}

static void table_write(report *r, const table *t)
{
    (r->markdown ? table_markdown_write : table_html_write)(r, t);
}

void report_heading_write(report *r, int level, const char *text)
{
    if (r->markdown) {
        fprintf(r->out, "%.*s ", level, "######");
        markdown_write(r->out, text);
        fputs("\n\n", r->out);
    } else {
        fprintf(r->out, "<h%d>", level);
        report_html_write(r->out, text);
        fprintf(r->out, "</h%d>\n", level);
    }
}

static void paragraph_write(report *r, const char *text)
{
    fputs(r->markdown ? "" : "<p>", r->out);
    text_write(r, text);
    fputs(r->markdown ? "\n\n" : "</p>\n", r->out);
}

// ---- What the suite asks for as tables

static const bench_row *row_done(const report *r, const bench_view *view, const char *configuration)
{
    const bench_row *const row = bench_row_find(r->results, view, configuration);
    return row && row->done ? row : NULL;
}

static bool configuration_is_done(const report *r, const char *name)
{
    bool done = false;
    for (uint32_t v = 0; v < r->results->suite->view_count; v++) {
        done |= row_done(r, &r->results->suite->views[v], name) != NULL;
    }
    return done;
}

static double metric_of(const report *r, const bench_row *row, const char *metric)
{
    return row ? bench_metric(r->results, row, metric) : NAN;
}

static void view_table_write(report *r, const bench_table *desc, const bench_view *view)
{
    const bench_suite *const suite = r->results->suite;
    table t = table_make(r, 1 + desc->column_count, 1 + suite->configuration_count);
    cell *const titles = table_row(&t);
    titles[0].text = view->name;
    for (uint32_t k = 0; k < desc->column_count; k++) {
        const char *const title = desc->column_titles ? desc->column_titles[k] : NULL;
        titles[1 + k] =
            (cell){.text = title ? title : bench_metric_title(&r->memory, desc->columns[k]), .number = true};
    }
    for (uint32_t i = 0; i < suite->configuration_count; i++) {
        const bench_row *const row = row_done(r, view, suite->configurations[i].name);
        if (row) {
            cell *const cells = table_row(&t);
            cells[0].text = suite->configurations[i].name;
            for (uint32_t k = 0; k < desc->column_count; k++) {
                cells[1 + k] = cell_number(r, metric_of(r, row, desc->columns[k]));
            }
        }
    }
    for (uint32_t k = 0; k < desc->column_count; k++) {
        table_mark_best(&t, 1 + k, metric_preference(desc->columns[k]));
    }
    if (t.rows > 1) {
        table_write(r, &t);
    }
}

static void metric_table_write(report *r, const bench_table *desc)
{
    const bench_suite *const suite = r->results->suite;
    table t = table_make(r, 1 + suite->view_count, 1 + suite->configuration_count);
    cell *const titles = table_row(&t);
    titles[0].text = bench_metric_title(&r->memory, desc->metric);
    for (uint32_t v = 0; v < suite->view_count; v++) {
        titles[1 + v] = (cell){.text = suite->views[v].name, .number = true};
    }
    for (uint32_t i = 0; i < suite->configuration_count; i++) {
        const char *const name = suite->configurations[i].name;
        if (!configuration_is_done(r, name)) {
            continue;
        }
        cell *const cells = table_row(&t);
        cells[0].text = name;
        for (uint32_t v = 0; v < suite->view_count; v++) {
            cells[1 + v] = cell_number(r, metric_of(r, row_done(r, &suite->views[v], name), desc->metric));
        }
    }
    for (uint32_t v = 0; v < suite->view_count; v++) {
        table_mark_best(&t, 1 + v, metric_preference(desc->metric));
    }
    table_write(r, &t);
}

static void tables_write(report *r)
{
    const bench_suite *const suite = r->results->suite;
    for (uint32_t i = 0; i < suite->table_count; i++) {
        const bench_table *const desc = &suite->tables[i];
        report_heading_write(r, 2, desc->title);
        for (uint32_t v = 0; v < suite->view_count && !desc->metric; v++) {
            view_table_write(r, desc, &suite->views[v]);
        }
        if (desc->metric) {
            metric_table_write(r, desc);
        }
    }
}

static double comparison_value(const report *r, const bench_comparison *comparison, const bench_view *view)
{
    const double value = metric_of(r, row_done(r, view, comparison->of), comparison->metric);
    return comparison->to ? value / metric_of(r, row_done(r, view, comparison->to), comparison->metric) : value;
}

static void comparisons_write(report *r)
{
    const bench_suite *const suite = r->results->suite;
    if (suite->comparison_count == 0) {
        return;
    }
    report_heading_write(r, 2, "Beside the paper");
    table t = table_make(r, suite->view_count + 3, 1 + suite->comparison_count);
    cell *const titles = table_row(&t);
    titles[0].text = "figure";
    for (uint32_t v = 0; v < suite->view_count; v++) {
        titles[1 + v] = (cell){.text = arena_printf(&r->memory, "ours, %s", suite->views[v].name), .number = true};
    }
    titles[suite->view_count + 1] = (cell){.text = "paper", .number = true};
    titles[suite->view_count + 2].text = "note";
    for (uint32_t i = 0; i < suite->comparison_count; i++) {
        const bench_comparison *const comparison = &suite->comparisons[i];
        cell *const cells = table_row(&t);
        cells[0].text = comparison->text;
        for (uint32_t v = 0; v < suite->view_count; v++) {
            cells[1 + v] = cell_number(r, comparison_value(r, comparison, &suite->views[v]));
        }
        cells[suite->view_count + 1] = cell_number(r, comparison->paper);
        cells[suite->view_count + 2].text = comparison->note ? comparison->note : "";
    }
    table_write(r, &t);
}

// Rows that were not measured, and why.
static void skipped_write(report *r)
{
    const bench_results *const results = r->results;
    table t = table_make(r, 3, 1 + results->row_count);
    cell *const titles = table_row(&t);
    titles[0].text = "view";
    titles[1].text = "configuration";
    titles[2].text = "reason";
    for (uint32_t i = 0; i < results->row_count; i++) {
        const bench_row *const row = &results->rows[i];
        if (!row->done) {
            cell *const cells = table_row(&t);
            cells[0].text = row->view->name;
            cells[1].text = row->configuration->name;
            cells[2].text = row->skipped        ? row->skipped
                            : row->view->absent ? "the file of its scene is missing"
                                                : "not measured yet";
        }
    }
    if (t.rows > 1) {
        report_heading_write(r, 2, "Left out");
        table_write(r, &t);
    }
}

// ---- Settings

static bool setting_is_common(const bench_results *results, const setting_info *info)
{
    const bench_row *first = NULL;
    bool common = true;
    for (uint32_t i = 0; i < results->row_count; i++) {
        const bench_row *const row = &results->rows[i];
        if (!row->done) {
            continue;
        }
        first = first ? first : row;
        char text[32], first_text[32];
        settings_get(&row->settings, info, text);
        settings_get(&first->settings, info, first_text);
        common = common && strcmp(text, first_text) == 0;
    }
    return common;
}

static const char *settings_common(report *r)
{
    const bench_row *row = NULL;
    for (uint32_t i = 0; i < r->results->row_count && !row; i++) {
        row = r->results->rows[i].done ? &r->results->rows[i] : NULL;
    }
    const char *text = "";
    uint32_t count;
    const setting_info *const infos = settings_table(&count);
    for (uint32_t i = 0; row && i < count; i++) {
        if (setting_is_common(r->results, &infos[i])) {
            char value[32];
            settings_get(&row->settings, &infos[i], value);
            text = arena_printf(&r->memory, "%s%s%s %s", text, *text ? ", " : "", infos[i].name, value);
        }
    }
    return text;
}

static void introduction_write(report *r)
{
    const bench_suite *const suite = r->results->suite;
    report_heading_write(r, 1, suite->title ? suite->title : suite->name);
    if (suite->description) {
        paragraph_write(r, suite->description);
    }
    if (r->results->device) { // something was measured
        paragraph_write(r, arena_printf(&r->memory, "Device: %s. Times are medians of %u repeat%s.", r->results->device,
                                        suite->repeats, suite->repeats == 1 ? "" : "s"));
        paragraph_write(r, arena_printf(&r->memory, "Settings common to all: %s.", settings_common(r)));
    }
}

// ---- Everything, in report.html

// Passes of any row, each once, in the order of their first appearance.
static uint32_t pass_names(report *r, const char ***names)
{
    uint32_t count = 0;
    size_t capacity = 0;
    const char **found = NULL;
    for (uint32_t i = 0; i < r->results->row_count; i++) {
        const bench_row *const row = &r->results->rows[i];
        for (uint32_t p = 0; row->done && p < row->pass_count; p++) {
            uint32_t k = 0;
            while (k < count && strcmp(found[k], row->passes[p].name) != 0) {
                k++;
            }
            if (k == count) {
                memory_reserve((void **)&found, &capacity, count + 1, sizeof(*found));
                found[count++] = row->passes[p].name;
            }
        }
    }
    *names = arena_alloc(&r->memory, (count + 1) * sizeof(**names));
    if (count > 0) {
        memcpy(*names, found, count * sizeof(**names));
    }
    free(found);
    return count;
}

// The metrics of the full table: of all rows, in the order of results.csv.
static uint32_t all_metrics(report *r, const char ***metrics)
{
    static const char *const plain[] = {"frame_ms",       "frame_ms_p95", "picture_ms", "lights_per_pixel",
                                        "rays_per_pixel", "grid_lights",  "memory_mb"};
    const bench_suite *const suite = r->results->suite;
    uint32_t measure_count;
    const image_measure_info *const measures = image_measure_table(&measure_count);
    const char **passes;
    const uint32_t pass_count = pass_names(r, &passes);
    const size_t most = countof(plain) + (size_t)suite->reference_count * measure_count + pass_count;
    *metrics = arena_alloc(&r->memory, most * sizeof(**metrics));
    uint32_t count = 0;
    for (size_t i = 0; i < countof(plain); i++) {
        (*metrics)[count++] = plain[i];
    }
    for (uint32_t i = 0; i < suite->reference_count; i++) {
        for (uint32_t m = 0; m < measure_count; m++) {
            (*metrics)[count++] = arena_printf(&r->memory, "%s.%s", suite->references[i].name, measures[m].name);
        }
    }
    for (uint32_t i = 0; i < pass_count; i++) {
        (*metrics)[count++] = arena_printf(&r->memory, "ms:%s", passes[i]);
    }
    return count;
}

// Settings that differ between rows.
static uint32_t swept_settings(report *r, const setting_info ***swept)
{
    uint32_t setting_count, count = 0;
    const setting_info *const infos = settings_table(&setting_count);
    *swept = arena_alloc(&r->memory, setting_count * sizeof(**swept));
    for (uint32_t i = 0; i < setting_count; i++) {
        if (!setting_is_common(r->results, &infos[i])) {
            (*swept)[count++] = &infos[i];
        }
    }
    return count;
}

static void all_rows_write(report *r)
{
    const bench_results *const results = r->results;
    const setting_info **swept;
    const char **metrics;
    const uint32_t swept_count = swept_settings(r, &swept), metric_count = all_metrics(r, &metrics);
    table t = table_make(r, 2 + swept_count + metric_count, 1 + results->row_count);
    cell *const titles = table_row(&t);
    titles[0].text = "view";
    titles[1].text = "configuration";
    for (uint32_t k = 0; k < swept_count; k++) {
        titles[2 + k].text = swept[k]->name;
    }
    for (uint32_t k = 0; k < metric_count; k++) {
        titles[2 + swept_count + k] = (cell){.text = bench_metric_title(&r->memory, metrics[k]), .number = true};
    }
    for (uint32_t i = 0; i < results->row_count; i++) {
        const bench_row *const row = &results->rows[i];
        if (!row->done) {
            continue;
        }
        cell *const cells = table_row(&t);
        cells[0].text = row->view->name;
        cells[1].text = row->configuration->name;
        for (uint32_t k = 0; k < swept_count; k++) {
            char value[32];
            settings_get(&row->settings, swept[k], value);
            cells[2 + k].text = arena_strdup(&r->memory, value);
        }
        for (uint32_t k = 0; k < metric_count; k++) {
            cells[2 + swept_count + k] = cell_number(r, bench_metric(results, row, metrics[k]));
        }
    }
    fputs("<details><summary>All results</summary>\n", r->out);
    table_write(r, &t);
    fputs("</details>\n", r->out);
}

// ---- Charts

void report_base64_write(FILE *out, const uint8_t *bytes, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        const size_t count = size - i < 3 ? size - i : 3;
        uint32_t bits = 0;
        for (size_t k = 0; k < 3; k++) {
            bits = bits << 8 | (k < count ? bytes[i + k] : 0);
        }
        for (size_t k = 0; k < 4; k++) {
            fputc(k <= count ? digits[bits >> (18 - 6 * k) & 63] : '=', out);
        }
    }
}

static void chart_embed(report *r, const bench_chart *chart, const char *path)
{
    size_t size;
    uint8_t *const bytes = file_read(path, &size);
    r->failed |= !bytes;
    if (!bytes) {
        return;
    }
    // As an image: the names inside several SVGs would clash in one document.
    fputs("<div class=\"wide\"><img class=\"chart\" alt=\"", r->out);
    report_html_write(r->out, chart->title);
    fputs("\" src=\"data:image/svg+xml;base64,", r->out);
    report_base64_write(r->out, bytes, size);
    fputs("\"></div>\n", r->out);
    free(bytes);
}

static void charts_write(report *r)
{
    for (uint32_t i = 0; i < r->results->suite->chart_count; i++) {
        const bench_chart *const chart = &r->results->suite->charts[i];
        const char *const path = report_path(r, arena_printf(&r->memory, "%s.svg", chart->name));
        if (access(path, R_OK) != 0) {
            continue; // gnuplot is missing, which has been said
        }
        if (r->markdown) {
            fputs("![", r->out);
            markdown_write(r->out, chart->title);
            fprintf(r->out, "](%s.svg)\n\n", chart->name);
        } else {
            chart_embed(r, chart, path);
        }
    }
}

// ---- The two files

static const char style[] =
    ":root{color-scheme:light dark;--ink:#1a1a1a;--paper:#fff;--line:#d8d8d8;--soft:#f4f4f4}\n"
    "@media(prefers-color-scheme:dark){:root{--ink:#e4e4e4;--paper:#17181a;--line:#3a3c40;--soft:#222326}}\n"
    "body{font:15px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);margin:2em auto;"
    "padding:0 1.5em;max-width:92em}\n"
    "h1{font-size:1.6em}h2{font-size:1.25em;margin:2em 0 .6em;border-bottom:1px solid var(--line)}"
    "h3{font-size:1.05em;margin:1.2em 0 .4em}p{max-width:52em}\n"
    ".wide{overflow-x:auto;margin:.8em 0}table{border-collapse:collapse;font-size:.9em}\n"
    "th,td{padding:.25em .8em;text-align:left;border-bottom:1px solid var(--line)}"
    "th{background:var(--soft);vertical-align:bottom}td{white-space:nowrap}"
    "td:last-child{white-space:normal}.n{text-align:right;font-variant-numeric:tabular-nums}\n"
    ".row{display:flex;flex-wrap:wrap;gap:1em}figure{margin:0}figure img{display:block;margin-bottom:3px}\n"
    "figcaption{font-size:.85em;line-height:1.35}.compared .over{background:var(--reference) no-repeat}"
    ".over:hover img{opacity:0}.compared .over{cursor:crosshair}\n"
    ".scale{font-size:.85em;max-width:none}.scale img{vertical-align:middle}.chart{background:#fff}"
    "summary{cursor:pointer;margin:2em 0 .6em;font-weight:600}\n";

static void html_report_write(report *r)
{
    fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
          "<meta name=\"viewport\" content=\"width=device-width\"><title>",
          r->out);
    report_html_write(r->out, r->results->suite->title ? r->results->suite->title : r->results->suite->name);
    fprintf(r->out, "</title>\n<style>\n%s</style></head>\n<body>\n", style);
    introduction_write(r);
    charts_write(r);
    comparisons_write(r);
    tables_write(r);
    if (r->results->suite->picture_count > 0 && r->results->suite->reference_count > 0) {
        paragraph_write(r, "Pictures of a view share one exposure: the suite's, or else that of the first reference, "
                           "which appears in place of a picture while the pointer is on it.");
    }
    report_pictures_write(r);
    skipped_write(r);
    all_rows_write(r);
    fputs("</body></html>\n", r->out);
}

static void markdown_report_write(report *r)
{
    introduction_write(r);
    charts_write(r);
    comparisons_write(r);
    tables_write(r);
    skipped_write(r);
}

static bool report_file_write(const bench_results *results, const char *name, bool markdown)
{
    char *text = NULL;
    size_t size;
    report r = {.results = results, .markdown = markdown, .out = open_memstream(&text, &size)};
    (markdown ? markdown_report_write : html_report_write)(&r);
    fclose(r.out);
    const bool written = file_write(report_path(&r, name), text, size);
    free(text);
    arena_fini(&r.memory);
    return written && !r.failed;
}

bool bench_report_write(const bench_results *results)
{
    const bool html = report_file_write(results, "report.html", false);
    return report_file_write(results, "report.md", true) && html;
}
