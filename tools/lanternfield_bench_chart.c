// Charts of a bench's results as SVG and PNG, drawn by gnuplot. What is shown and where is decided here - ranges,
// ticks, and places for labels where they keep clear of points and of each other - and gnuplot gets it as a finished
// script.
#include "lanternfield_bench.h"
#include "lanternfield_gnuplot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct box { // pixels, y upwards
    double left, bottom, right, top;
} box;
typedef struct axis {
    bool log;
    double low, high;
} axis;
typedef struct chart_point {
    const bench_row *row;
    uint32_t series; // of bars: the configuration
    double x, y;
    double place[2]; // pixels
    const char *label;
} chart_point;
typedef struct panel {
    const char *title; // NULL: none
    chart_point *points; // of one view after the other
    uint32_t count;
    axis x, y;
    box area; // inside the axes
} panel;
typedef struct chart {
    const bench_results *results;
    const bench_chart *desc;
    arena memory;
    const char **series; // all of the suite, so that a series keeps its colour over all charts
    const char **key_texts; // one a series
    bool *series_used;
    uint64_t *labels_spelled; // one a series: the settings that its labels spell out, a bit each
    uint32_t series_count, used_count;
    chart_point *points;
    uint32_t point_count;
    panel *panels;
    uint32_t panel_count, columns;
    const char **footnotes; // lines
    uint32_t footnote_count;
    double width, height, key_left; // pixels
    FILE *script;
} chart;

enum {
    COLUMNS_MAX = 3,
    TITLE_FONT = 15,
    PANEL_TITLE_FONT = 13,
    TEXT_FONT = 12,
    TICK_FONT = 11,
    LABEL_FONT = 9,
    TITLE_HEIGHT = 40,
    PANEL_TITLE_HEIGHT = 26,
    LEFT_MARGIN = 72, // of a panel: ticks and axis label
    BOTTOM_MARGIN = 60,
    RIGHT_MARGIN = 18,
    FOOTNOTE_HEIGHT = 16,
    KEY_SAMPLE = 62, // width of a line or marker in the legend, with what is around it
};

// ---- Text

// Roughly what sans-serif letters take, in pixels.
static double text_width(const char *text, double font)
{
    double em = 0;
    for (const char *c = text; *c; c++) {
        const bool continues = (*c & 0xc0) == 0x80; // UTF-8
        em += continues ? 0 : strchr("iljtfI.,:;'|!() ", *c) ? 0.3 : strchr("mwMW@%", *c) ? 0.86 : 0.57;
    }
    return em * font;
}

// As a string of gnuplot's, in quotes; the terminals are told not to look for markup.
static const char *quoted(chart *c, const char *text)
{
    char *const result = arena_alloc(&c->memory, 2 * strlen(text) + 3);
    char *out = result;
    *out++ = '\'';
    for (; *text; text++) {
        if (*text == '\'') {
            *out++ = '\'';
        }
        *out++ = (unsigned char)*text < ' ' ? ' ' : *text;
    }
    *out = '\'';
    return result;
}

static const char *tick_text(chart *c, double value)
{
    if (fabs(value) >= 1e6) {
        return arena_printf(&c->memory, "%gM", value / 1e6);
    }
    return fabs(value) >= 1e3 ? arena_printf(&c->memory, "%gK", value / 1e3) : arena_printf(&c->memory, "%g", value);
}

// Numbers as at ticks.
static const char *setting_text(chart *c, const render_settings *settings, const setting_info *info)
{
    char text[32], *end;
    settings_get(settings, info, text);
    const double value = strtod(text, &end);
    return *end ? arena_strdup(&c->memory, text) : tick_text(c, value);
}

// ---- The points

static const char *series_of(const chart *c, const bench_configuration *configuration)
{
    return c->desc->bars ? configuration->name : configuration->series;
}

static const char *label_of(const bench_configuration *configuration)
{
    return configuration->label ? configuration->label : configuration->name;
}

static bool series_wanted(const bench_chart *desc, const bench_configuration *configuration)
{
    bool wanted = desc->series_count == 0;
    for (uint32_t i = 0; i < desc->series_count; i++) {
        wanted |= strcmp(desc->series[i], configuration->series) == 0;
    }
    return wanted;
}

static uint32_t series_find(const chart *c, const char *name)
{
    uint32_t i = 0;
    while (i < c->series_count && strcmp(c->series[i], name) != 0) {
        i++;
    }
    return i;
}

static void series_list(chart *c)
{
    const bench_suite *const suite = c->results->suite;
    c->series = arena_alloc(&c->memory, suite->configuration_count * sizeof(*c->series));
    c->key_texts = arena_alloc(&c->memory, suite->configuration_count * sizeof(*c->key_texts));
    c->labels_spelled = arena_alloc(&c->memory, suite->configuration_count * sizeof(*c->labels_spelled));
    c->series_used = arena_alloc(&c->memory, suite->configuration_count);
    for (uint32_t i = 0; i < suite->configuration_count; i++) {
        const bench_configuration *const configuration = &suite->configurations[i];
        // Bars are told apart by their order, so those that are left out take no colour.
        const char *const name = series_of(c, configuration);
        const bool listed = !c->desc->bars || series_wanted(c->desc, configuration);
        if (listed && series_find(c, name) == c->series_count) {
            c->key_texts[c->series_count] = c->desc->bars ? label_of(configuration) : name;
            c->series[c->series_count++] = name;
        }
    }
}

static bool value_shown(double value, bool log)
{
    return isfinite(value) && (!log || value > 0);
}

static void points_gather(chart *c)
{
    const bench_results *const results = c->results;
    c->points = arena_alloc(&c->memory, results->row_count * sizeof(*c->points));
    uint32_t not_positive = 0;
    for (uint32_t i = 0; i < results->row_count; i++) {
        const bench_row *const row = &results->rows[i];
        if (!row->done || !series_wanted(c->desc, row->configuration)) {
            continue;
        }
        const double x = c->desc->bars ? 1 : bench_metric(results, row, c->desc->x);
        const double y = bench_metric(results, row, c->desc->y);
        if (value_shown(x, c->desc->x_log) && value_shown(y, c->desc->y_log)) {
            const uint32_t series = series_find(c, series_of(c, row->configuration));
            c->points[c->point_count++] = (chart_point){.row = row, .series = series, .x = x, .y = y};
            c->used_count += !c->series_used[series];
            c->series_used[series] = true;
        } else if (isfinite(x) && isfinite(y)) {
            not_positive++;
        }
    }
    if (not_positive > 0) {
        log_warning("chart \"%s\": a logarithmic axis cannot show %u point%s at zero or below", c->desc->name,
                    not_positive, not_positive == 1 ? "" : "s");
    }
}

// The end of the points of one view that start at `first`.
static uint32_t view_end(const panel *p, uint32_t first)
{
    uint32_t end = first + 1;
    while (end < p->count && p->points[end].row->view == p->points[first].row->view) {
        end++;
    }
    return end;
}

static uint32_t view_count(const panel *p)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < p->count; i = view_end(p, i)) {
        count++;
    }
    return count;
}

static uint64_t settings_that_differ(const render_settings *a, const render_settings *b)
{
    uint32_t count;
    uint64_t differ = 0; // a bit a setting
    const setting_info *const table = settings_table(&count);
    assert(count <= 64);
    for (uint32_t i = 0; i < count; i++) {
        char text_a[32], text_b[32];
        settings_get(a, &table[i], text_a);
        settings_get(b, &table[i], text_b);
        differ |= strcmp(text_a, text_b) != 0 ? (uint64_t)1 << i : 0;
    }
    return differ;
}

// In which the points of a series differ.
static uint64_t settings_swept(const chart_point *points, uint32_t count, uint32_t series)
{
    const chart_point *start = NULL;
    uint64_t swept = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (points[i].series == series) {
            start = start ? start : &points[i];
            swept |= settings_that_differ(&start->row->settings, &points[i].row->settings);
        }
    }
    return swept;
}

// What stands at points: the label of the configuration, or else the settings that the series sweeps over.
static void points_label(chart *c)
{
    uint32_t setting_count;
    const setting_info *const infos = settings_table(&setting_count);
    for (uint32_t i = 0; i < c->point_count; i++) {
        chart_point *const point = &c->points[i];
        const uint64_t swept = settings_swept(c->points, c->point_count, point->series);
        point->label = label_of(point->row->configuration);
        if (point->row->configuration->label || c->desc->bars || !swept) {
            continue;
        }
        point->label = "";
        for (uint32_t k = 0; k < setting_count; k++) {
            if (swept >> k & 1) {
                const char *const slash = *point->label ? "/" : "";
                const char *const value = setting_text(c, &point->row->settings, &infos[k]);
                point->label = arena_printf(&c->memory, "%s%s%s", point->label, slash, value);
            }
        }
        c->labels_spelled[point->series] = swept;
    }
}

static void panels_divide(chart *c)
{
    panel all = {.points = c->points, .count = c->point_count};
    if (!c->desc->per_view || c->point_count == 0) {
        c->panels = arena_alloc(&c->memory, sizeof(*c->panels));
        c->panels[c->panel_count++] = all;
        return;
    }
    c->panels = arena_alloc(&c->memory, view_count(&all) * sizeof(*c->panels));
    for (uint32_t i = 0, end; i < all.count; i = end) {
        end = view_end(&all, i);
        c->panels[c->panel_count++] =
            (panel){.title = all.points[i].row->view->name, .points = &all.points[i], .count = end - i};
    }
}

// ---- Axes

static axis axis_fit(const panel *p, bool vertical, bool log, bool from_zero)
{
    double low = INFINITY, high = -INFINITY;
    for (uint32_t i = 0; i < p->count; i++) {
        const double value = vertical ? p->points[i].y : p->points[i].x;
        low = fmin(low, value);
        high = fmax(high, value);
    }
    if (log) {
        const double pad = fmax(1.15, pow(high / low, 0.09));
        return (axis){.log = true, .low = low / pad, .high = high * pad};
    }
    const double start = low >= 0 && (from_zero || low < 0.5 * high) ? 0 : low;
    const double span = high > start ? high - start : fmax(fabs(high), 1);
    return (axis){.low = start == 0 ? 0 : start - 0.08 * span, .high = start + 1.1 * span};
}

// 0 to 1 along the axis.
static double axis_place(const axis *a, double value)
{
    return a->log ? log(value / a->low) / log(a->high / a->low) : (value - a->low) / (a->high - a->low);
}

static void tick_write(chart *c, const axis *a, double value, bool major, bool *first)
{
    if (value < a->low * (a->low > 0 ? 1 - 1e-9 : 1 + 1e-9) - 1e-12 || value > a->high * (1 + 1e-9)) {
        return;
    }
    fprintf(c->script, "%s%s %.12g %d", *first ? "" : ", ", quoted(c, major ? tick_text(c, value) : ""), value, !major);
    *first = false;
}

// Labels at few enough of 1 ... 9 times the powers of ten.
static bool log_tick_is_major(int digit, int exponent, double decades)
{
    if (decades > 6) {
        return digit == 1 && exponent % 2 == 0;
    }
    return digit == 1 || decades < 0.8 || (decades < 2.6 && (digit == 2 || digit == 5));
}

static void log_ticks_write(chart *c, const axis *a, bool *first)
{
    const double decades = log10(a->high / a->low);
    for (int exponent = (int)floor(log10(a->low)); exponent <= (int)floor(log10(a->high)); exponent++) {
        for (int digit = 1; digit <= 9; digit++) {
            tick_write(c, a, digit * pow(10, exponent), log_tick_is_major(digit, exponent, decades), first);
        }
        if (decades < 0.8) { // else there may be nothing between 1 and 2
            tick_write(c, a, 1.5 * pow(10, exponent), true, first);
        }
    }
}

static double step_nice(double span)
{
    const double raw = span / 5, power = pow(10, floor(log10(raw)));
    const double digit = raw / power;
    return power * (digit < 1.5 ? 1 : digit < 3.5 ? 2 : digit < 7.5 ? 5 : 10);
}

static void linear_ticks_write(chart *c, const axis *a, bool *first)
{
    const double step = step_nice(a->high - a->low);
    for (double n = ceil(a->low / step); n * step <= a->high; n++) {
        tick_write(c, a, n * step, true, first);
    }
}

static void axis_write(chart *c, const axis *a, char name)
{
    fprintf(c->script, "set %crange [%.12g:%.12g]\n%s logscale %c\nset %ctics (", name, a->low, a->high,
            a->log ? "set" : "unset", name, name);
    bool first = true;
    (a->log ? log_ticks_write : linear_ticks_write)(c, a, &first);
    fprintf(c->script, ")\n");
}

// ---- Colours and markers

// Okabe and Ito, "Color Universal Design" (2008), without its yellow, which does not show on white.
static const uint8_t palette[][3] = {{0, 114, 178}, {213, 94, 0},   {0, 158, 115}, {204, 121, 167},
                                     {230, 159, 0}, {86, 180, 233}, {40, 40, 40},  {140, 140, 140}};
static const uint32_t markers[] = {7, 5, 9, 13, 11, 15, 6, 4}; // gnuplot's: disc, square, triangle, rhomb, ...

// Each time round the palette is paler.
static const char *color_of(chart *c, uint32_t index)
{
    const uint8_t *const color = palette[index % countof(palette)];
    const double keep = pow(0.55, index / countof(palette));
    uint32_t rgb = 0;
    for (int i = 0; i < 3; i++) {
        rgb = rgb << 8 | (uint32_t)(255 - keep * (255 - color[i]));
    }
    return arena_printf(&c->memory, "lc rgb '#%06X'", rgb);
}

// Colour tells series, and marker and dash too, unless several views share the panel: then those tell views. A lone
// series leaves the colour to the views.
typedef struct look {
    uint32_t color, marker, dash;
} look;
static look look_of(const chart *c, uint32_t series, const bench_view *view)
{
    const uint32_t v = (uint32_t)(view - c->results->suite->views);
    if (c->panel_count > 1 || view_count(&c->panels[0]) == 1) {
        return (look){series, series, 0};
    }
    return (look){c->used_count > 1 ? series : v, v, v};
}

static const char *curve_style(chart *c, look look, bool connected)
{
    const char *const lines = arena_printf(&c->memory, "linespoints lw 1.8 dt %u", look.dash % 5 + 1);
    return arena_printf(&c->memory, "%s pt %u ps 0.85 %s", connected ? lines : "points",
                        markers[look.marker % countof(markers)], color_of(c, look.color));
}

// ---- Curves

// Whether the points of one series in [first, end) are joined; see bench_chart.
static bool curve_is_connected(const chart *c, const panel *p, uint32_t first, uint32_t end, uint32_t series)
{
    const uint64_t swept = settings_swept(&p->points[first], end - first, series);
    return c->desc->lines || __builtin_popcountll(swept) == 1;
}

typedef void curve_visit(chart *c, const panel *p, uint32_t first, uint32_t end, uint32_t series);

// Calls for each series with points in the panel, one view after the other.
static void curves_visit(chart *c, const panel *p, curve_visit *visit)
{
    for (uint32_t first = 0, end; first < p->count; first = end) {
        end = view_end(p, first);
        for (uint32_t series = 0; series < c->series_count; series++) {
            bool any = false;
            for (uint32_t i = first; i < end; i++) {
                any |= p->points[i].series == series;
            }
            if (any) {
                visit(c, p, first, end, series);
            }
        }
    }
}

static void curve_data_write(chart *c, const panel *p, uint32_t first, uint32_t end, uint32_t series)
{
    fprintf(c->script, "$curve_%u_%u << END\n", first, series);
    for (uint32_t i = first; i < end; i++) {
        if (p->points[i].series == series) {
            fprintf(c->script, "%.9g %.9g\n", p->points[i].x, p->points[i].y);
        }
    }
    fprintf(c->script, "END\n");
}

static void curve_plot_write(chart *c, const panel *p, uint32_t first, uint32_t end, uint32_t series)
{
    const look look = look_of(c, series, p->points[first].row->view);
    const bool connected = curve_is_connected(c, p, first, end, series);
    fprintf(c->script, ", $curve_%u_%u with %s notitle", first, series, curve_style(c, look, connected));
}

static int points_compare(const void *a, const void *b)
{
    const chart_point *const p = a, *const q = b;
    return p->x != q->x ? (p->x > q->x) - (p->x < q->x) : (p->y > q->y) - (p->y < q->y);
}

// Steps along the points that no other beats in both x and y.
static void front_data_write(chart *c, const panel *p, uint32_t first, uint32_t end)
{
    const uint32_t count = end - first;
    chart_point *const sorted = arena_alloc(&c->memory, count * sizeof(*sorted));
    memcpy(sorted, &p->points[first], count * sizeof(*sorted));
    qsort(sorted, count, sizeof(*sorted), points_compare);

    fprintf(c->script, "$front_%u << END\n", first);
    double best = INFINITY;
    for (uint32_t i = 0; i < count; i++) {
        if (sorted[i].y < best) {
            if (isfinite(best)) {
                fprintf(c->script, "%.9g %.9g\n", sorted[i].x, best);
            }
            fprintf(c->script, "%.9g %.9g\n", sorted[i].x, sorted[i].y);
            best = sorted[i].y;
        }
    }
    fprintf(c->script, "END\n");
}

static const char front_style[] = "lines lw 7 lc rgb '#C0707070'";

// ---- Labels. A few places around each point are tried; one costs what it covers.

typedef struct label {
    const char *text;
    const chart_point *point;
    box box;
    bool far; // enough for a line to its point
} label;

static double overlap(box a, box b)
{
    const double width = fmin(a.right, b.right) - fmax(a.left, b.left);
    const double height = fmin(a.top, b.top) - fmax(a.bottom, b.bottom);
    return width > 0 && height > 0 ? width * height : 0;
}

static box box_around(const double place[2], double radius)
{
    return (box){place[0] - radius, place[1] - radius, place[0] + radius, place[1] + radius};
}

static double box_area(box b)
{
    return (b.right - b.left) * (b.top - b.bottom);
}

// What a label there covers of other labels, of points and of lines between points; or reaches out of the panel.
static double label_cost(const panel *p, const label *labels, uint32_t count, uint32_t index, box place)
{
    double cost = 4 * (box_area(place) - overlap(place, p->area));
    for (uint32_t i = 0; i < count; i++) {
        if (i != index && labels[i].text) {
            cost += 3 * overlap(place, labels[i].box);
        }
    }
    for (uint32_t i = 0; i < p->count; i++) {
        const chart_point *const q = &p->points[i];
        cost += 2 * overlap(place, box_around(q->place, 5));
        if (i + 1 < p->count && q[1].series == q->series && q[1].row->view == q->row->view) {
            for (int step = 1; step < 16; step++) {
                const double t = step / 16.0;
                const double on_line[2] = {q->place[0] + t * (q[1].place[0] - q->place[0]),
                                           q->place[1] + t * (q[1].place[1] - q->place[1])};
                cost += 0.5 * overlap(place, box_around(on_line, 2));
            }
        }
    }
    return cost;
}

// Twelve directions around the point.
static box label_candidate(const label *l, int direction, double distance)
{
    const double angle = direction * 3.14159265358979 / 6;
    const double half_width = 0.5 * text_width(l->text, LABEL_FONT), half_height = 0.5 * LABEL_FONT;
    const double x = l->point->place[0] + cos(angle) * (distance + half_width);
    const double y = l->point->place[1] + sin(angle) * (distance + half_height);
    return (box){x - half_width, y - half_height, x + half_width, y + half_height};
}

static void label_place(const panel *p, label *labels, uint32_t count, uint32_t index)
{
    static const double distances[] = {7, 16, 30, 48};
    label *const l = &labels[index];
    double best = INFINITY;
    for (size_t d = 0; d < countof(distances); d++) {
        for (int direction = 0; direction < 12; direction++) {
            const box place = label_candidate(l, direction, distances[d]);
            // Near is better, and of equals the right one: directions start there.
            const double cost = label_cost(p, labels, count, index, place) + 1.5 * (distances[d] - 7) + 0.5 * direction;
            if (cost < best) {
                best = cost;
                l->box = place;
                l->far = d > 0;
            }
        }
    }
}

static void text_write(chart *c, const char *text, double x, double y, const char *more)
{
    fprintf(c->script, "set label %s at screen %.6f,%.6f %s\n", quoted(c, text), x / c->width, y / c->height, more);
}

static void labels_write(chart *c, const panel *p)
{
    label *const labels = arena_alloc(&c->memory, p->count * sizeof(*labels));
    for (uint32_t i = 0; i < p->count; i++) {
        labels[i] = (label){.text = p->points[i].label, .point = &p->points[i]};
    }
    // Once more each when all others have a place.
    for (uint32_t round = 0; round < 3; round++) {
        for (uint32_t i = 0; i < p->count; i++) {
            label_place(p, labels, p->count, i);
        }
    }
    for (uint32_t i = 0; i < p->count; i++) {
        const label *const l = &labels[i];
        const double x = 0.5 * (l->box.left + l->box.right), y = 0.5 * (l->box.bottom + l->box.top);
        if (l->far) {
            const double *const place = l->point->place;
            const double end_x = fmin(fmax(place[0], l->box.left), l->box.right);
            const double end_y = fmin(fmax(place[1], l->box.bottom), l->box.top);
            fprintf(c->script,
                    "set arrow from screen %.6f,%.6f to screen %.6f,%.6f nohead lw 0.6 lc rgb '#999999' back\n",
                    place[0] / c->width, place[1] / c->height, end_x / c->width, end_y / c->height);
        }
        text_write(c, l->text, x, y, "center font ',9' tc rgb '#333333' front");
    }
}

// ---- Bars

// Where the bar of a point lies along x: groups are one apart.
static void bar_place(const chart *c, const panel *p, const chart_point *point, double *left, double *right)
{
    uint32_t group = 0, slot = 0;
    for (uint32_t i = 0; &p->points[i] < point && p->points[i].row->view != point->row->view; i = view_end(p, i)) {
        group++;
    }
    for (uint32_t i = 0; i < point->series; i++) {
        slot += c->series_used[i];
    }
    const double width = 0.8 / c->used_count;
    *left = group - 0.4 + slot * width;
    *right = *left + 0.92 * width;
}

static void bars_plot_write(chart *c, const panel *p)
{
    for (uint32_t i = 0; i < p->count; i++) {
        fprintf(c->script, ", $bar_%u with boxxyerror fs solid 1 noborder %s notitle", i,
                color_of(c, p->points[i].series));
    }
}

static void bars_data_write(chart *c, const panel *p)
{
    for (uint32_t i = 0; i < p->count; i++) {
        double left, right;
        bar_place(c, p, &p->points[i], &left, &right);
        const double foot = p->y.log ? p->y.low : 0;
        fprintf(c->script, "$bar_%u << END\n%.9g %.9g %.9g %.9g %.9g %.9g\nEND\n", i, 0.5 * (left + right),
                p->points[i].y, left, right, foot, p->points[i].y);
    }
}

static void bar_labels_write(chart *c, const panel *p)
{
    for (uint32_t i = 0; i < p->count; i++) {
        double left, right;
        bar_place(c, p, &p->points[i], &left, &right);
        const char *const text = bench_number(&c->memory, p->points[i].y);
        const double pixels = (right - left) / (p->x.high - p->x.low) * (p->area.right - p->area.left);
        const bool upright = text_width(text, LABEL_FONT) > 1.15 * pixels;
        const double x = p->area.left + axis_place(&p->x, 0.5 * (left + right)) * (p->area.right - p->area.left);
        const double top = fmax(p->points[i].place[1], p->area.bottom);
        text_write(c, text, x, top + (upright ? 4 : 8),
                   upright ? "left rotate by 90 font ',9' tc rgb '#333333' front"
                           : "center font ',9' tc rgb '#333333' front");
    }
}

// Below each group the name of its view, unless that is above the panel.
static void bar_groups_write(chart *c, const panel *p)
{
    fprintf(c->script, "set xrange [%.12g:%.12g]\nunset logscale x\nset xtics (", p->x.low, p->x.high);
    uint32_t group = 0;
    for (uint32_t i = 0; i < p->count; i = view_end(p, i), group++) {
        const char *const name = p->title ? "" : p->points[i].row->view->name;
        fprintf(c->script, "%s%s %u", group > 0 ? ", " : "", quoted(c, name), group);
    }
    fprintf(c->script, ") scale 0\n");
}

// ---- Below the panels: what the labels spell out

// "path tracing: spp"
static const char *footnote(chart *c, uint32_t series)
{
    uint32_t count;
    const setting_info *const infos = settings_table(&count);
    const char *names = "";
    for (uint32_t k = 0; k < count; k++) {
        if (c->labels_spelled[series] >> k & 1) {
            names = arena_printf(&c->memory, "%s%s%s", names, *names ? "/" : "", infos[k].name);
        }
    }
    return arena_printf(&c->memory, "%s: %s", c->key_texts[series], names);
}

// Lines of footnotes no wider than the chart, where a single one is not.
static void footnotes_make(chart *c)
{
    c->footnotes = arena_alloc(&c->memory, (c->series_count + 1) * sizeof(*c->footnotes));
    const double most = c->width - LEFT_MARGIN;
    for (uint32_t i = 0; i < c->series_count && c->desc->labels; i++) {
        if (!c->labels_spelled[i]) {
            continue;
        }
        const char **const last = c->footnote_count > 0 ? &c->footnotes[c->footnote_count - 1] : NULL;
        const char *const longer = last ? arena_printf(&c->memory, "%s;  %s", *last, footnote(c, i)) : NULL;
        if (longer && text_width(longer, LABEL_FONT) <= most) {
            *last = longer;
        } else {
            const char *const start = last ? "" : "Labels give  ";
            c->footnotes[c->footnote_count++] = arena_printf(&c->memory, "%s%s", start, footnote(c, i));
        }
    }
}

static void footnotes_write(chart *c)
{
    for (uint32_t i = 0; i < c->footnote_count; i++) {
        const double y = (c->footnote_count - i - 0.5) * FOOTNOTE_HEIGHT;
        text_write(c, c->footnotes[i], LEFT_MARGIN, y, "left font ',9' tc rgb '#666666'");
    }
}

// ---- Layout

static double key_width(chart *c)
{
    double width = 0;
    for (uint32_t i = 0; i < c->series_count && c->used_count > 1; i++) {
        width = c->series_used[i] ? fmax(width, text_width(c->key_texts[i], TICK_FONT)) : width;
    }
    const panel *const p = &c->panels[0];
    for (uint32_t i = 0; c->panel_count == 1 && view_count(p) > 1 && i < p->count; i = view_end(p, i)) {
        width = fmax(width, text_width(p->points[i].row->view->name, TICK_FONT));
    }
    width = c->desc->pareto ? fmax(width, text_width("Pareto front", TICK_FONT)) : width;
    return width > 0 ? width + KEY_SAMPLE : 0;
}

static void layout(chart *c)
{
    // Four panels are two rows of two, five or more rows of three.
    c->columns = c->panel_count == 4 ? 2 : min_u32(c->panel_count, COLUMNS_MAX);
    const bool single = c->panel_count == 1;
    const uint32_t rows = div_up_u32(c->panel_count, c->columns);
    const double panel_width = single ? 560 : c->columns == 2 ? 430 : 370, panel_height = single ? 380 : 340;
    const double cell_width = LEFT_MARGIN + panel_width + RIGHT_MARGIN;
    const double cell_height = (c->panels[0].title ? PANEL_TITLE_HEIGHT : 0) + panel_height + BOTTOM_MARGIN;
    c->key_left = c->columns * cell_width;
    c->width = fmax(c->key_left + key_width(c), text_width(c->desc->title, TITLE_FONT) + LEFT_MARGIN);
    footnotes_make(c);
    c->height = TITLE_HEIGHT + rows * cell_height + c->footnote_count * FOOTNOTE_HEIGHT;
    for (uint32_t i = 0; i < c->panel_count; i++) {
        const double left = (i % c->columns) * cell_width + LEFT_MARGIN;
        const double bottom = c->height - TITLE_HEIGHT - (i / c->columns + 1) * cell_height + BOTTOM_MARGIN;
        c->panels[i].area = (box){left, bottom, left + panel_width, bottom + panel_height};
    }
}

static void axes_fit(chart *c)
{
    for (uint32_t i = 0; i < c->panel_count; i++) {
        panel *const p = &c->panels[i];
        p->y = axis_fit(p, true, c->desc->y_log, c->desc->bars);
        p->x = c->desc->bars ? (axis){.low = -0.6, .high = view_count(p) - 0.4}
                             : axis_fit(p, false, c->desc->x_log, false);
        for (uint32_t k = 0; k < p->count; k++) {
            chart_point *const q = &p->points[k];
            q->place[0] = p->area.left + axis_place(&p->x, q->x) * (p->area.right - p->area.left);
            q->place[1] = p->area.bottom + axis_place(&p->y, q->y) * (p->area.top - p->area.bottom);
        }
    }
}

// ---- The script

static void key_entry_write(chart *c, const char *style, const char *text)
{
    fprintf(c->script, ", keyentry with %s title %s", style, quoted(c, text));
}

static void key_write(chart *c)
{
    const panel *const p = &c->panels[0];
    const bool views_share = c->panel_count == 1 && view_count(p) > 1;
    for (uint32_t i = 0; i < c->series_count && c->used_count > 1; i++) {
        if (!c->series_used[i]) {
            continue;
        }
        const look look = look_of(c, i, p->points[0].row->view);
        const char *const bar = arena_printf(&c->memory, "boxes fs solid 1 noborder %s", color_of(c, i));
        const char *const line = arena_printf(&c->memory, "lines lw 4 %s", color_of(c, i));
        key_entry_write(c, c->desc->bars ? bar : views_share ? line : curve_style(c, look, false), c->key_texts[i]);
    }
    for (uint32_t i = 0; views_share && !c->desc->bars && i < p->count; i = view_end(p, i)) {
        const bench_view *const view = p->points[i].row->view;
        look look = look_of(c, p->points[i].series, view);
        look.color = c->used_count > 1 ? countof(palette) - 1 : look.color; // grey
        key_entry_write(c, curve_style(c, look, true), view->name);
    }
    if (c->desc->pareto) {
        key_entry_write(c, front_style, "Pareto front");
    }
}

static void panel_frame_write(chart *c, const panel *p, uint32_t index)
{
    fprintf(c->script, "unset label\nunset arrow\nset lmargin at screen %.6f\nset rmargin at screen %.6f\n",
            p->area.left / c->width, p->area.right / c->width);
    fprintf(c->script, "set bmargin at screen %.6f\nset tmargin at screen %.6f\n", p->area.bottom / c->height,
            p->area.top / c->height);
    if (p->title) {
        text_write(c, p->title, p->area.left, p->area.top + 13, "left font ',13'");
    }
    if (index == 0) {
        footnotes_write(c);
        text_write(c, c->desc->title, LEFT_MARGIN, c->height - 0.5 * TITLE_HEIGHT, "left font ',15'");
        fprintf(c->script, "set key at screen %.6f,%.6f left top Left reverse samplen 2.6 spacing 1.35 font ',11'\n",
                (c->key_left - 6) / c->width, (p->area.top + 4) / c->height);
    } else {
        fprintf(c->script, "unset key\n");
    }
}

static void panel_axes_write(chart *c, const panel *p, uint32_t index)
{
    const bench_chart *const desc = c->desc;
    const char *const x_label = desc->bars      ? ""
                                : desc->x_label ? desc->x_label
                                                : bench_metric_title(&c->memory, desc->x);
    const char *const y_label = desc->y_label ? desc->y_label : bench_metric_title(&c->memory, desc->y);
    const bool lowest = index + c->columns >= c->panel_count, leftmost = index % c->columns == 0;
    fprintf(c->script, "set xlabel %s\nset ylabel %s\n", quoted(c, lowest ? x_label : ""),
            quoted(c, leftmost ? y_label : ""));
    if (desc->bars) {
        bar_groups_write(c, p);
    } else {
        axis_write(c, &p->x, 'x');
    }
    axis_write(c, &p->y, 'y');
}

static void panel_write(chart *c, const panel *p, uint32_t index)
{
    panel_frame_write(c, p, index);
    panel_axes_write(c, p, index);
    const bool fronts = c->desc->pareto && !c->desc->bars;
    for (uint32_t i = 0; fronts && i < p->count; i = view_end(p, i)) {
        front_data_write(c, p, i, view_end(p, i));
    }
    if (c->desc->bars) {
        bars_data_write(c, p);
    } else {
        curves_visit(c, p, curve_data_write);
    }
    if (c->desc->labels) {
        (c->desc->bars ? bar_labels_write : labels_write)(c, p);
    }

    fprintf(c->script, "plot NaN notitle");
    for (uint32_t i = 0; fronts && i < p->count; i = view_end(p, i)) {
        fprintf(c->script, ", $front_%u with %s notitle", i, front_style);
    }
    if (c->desc->bars) {
        bars_plot_write(c, p);
    } else {
        curves_visit(c, p, curve_plot_write);
    }
    if (index == 0) {
        key_write(c);
    }
    fprintf(c->script, "\n");
}

static void empty_write(chart *c)
{
    log_warning("chart \"%s\" is empty: no measured row has both \"%s\" and \"%s\"", c->desc->name,
                c->desc->bars ? "view" : c->desc->x, c->desc->y);
    text_write(c, c->desc->title, LEFT_MARGIN, c->height - 0.5 * TITLE_HEIGHT, "left font ',15'");
    text_write(c, "nothing measured", 0.5 * c->width, 0.5 * c->height, "center tc rgb '#777777'");
    fprintf(c->script, "unset border\nunset tics\nset xrange [0:1]\nset yrange [0:1]\nplot NaN notitle\n");
}

static const char script_begin[] = "set encoding utf8\n"
                                   "set border 3 lw 0.8 lc rgb '#555555'\n"
                                   "set tics nomirror out scale 0.6,0.3 font ',11' tc rgb '#333333'\n"
                                   "set xlabel font ',12'\nset ylabel font ',12'\n"
                                   "set grid xtics ytics lt 1 lw 0.6 lc rgb '#E2E2E2'\n"
                                   "set multiplot\n";

// All but the terminal; free() it.
static char *script_make(chart *c)
{
    series_list(c);
    points_gather(c);
    points_label(c);
    panels_divide(c);
    layout(c);
    char *text = NULL;
    size_t size;
    c->script = open_memstream(&text, &size);
    fputs(script_begin, c->script);
    if (c->point_count > 0) {
        axes_fit(c);
        for (uint32_t i = 0; i < c->panel_count; i++) {
            panel_write(c, &c->panels[i], i);
        }
    } else {
        empty_write(c);
    }
    fprintf(c->script, "unset multiplot\n");
    fclose(c->script);
    return text;
}

// ---- The files

static gnuplot_result chart_write(const bench_results *results, const bench_chart *desc)
{
    chart c = {.results = results, .desc = desc};
    char *const script = script_make(&c);
    const int width = (int)ceil(c.width), height = (int)ceil(c.height);
    const gnuplot_result result =
        gnuplot_draw(script, arena_printf(&c.memory, "%s/%s", results->folder, desc->name), width, height);
    free(script);
    arena_fini(&c.memory);
    return result;
}

bool bench_charts_write(const bench_results *results)
{
    bool ok = true;
    for (uint32_t i = 0; i < results->suite->chart_count; i++) {
        const gnuplot_result result = chart_write(results, &results->suite->charts[i]);
        if (result == GNUPLOT_MISSING) {
            log_warning("no charts: the program gnuplot was not found");
            return true;
        }
        ok = ok && result == GNUPLOT_DONE;
    }
    return ok;
}
