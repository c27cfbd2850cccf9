// What is made of a bench's results by hand: charts through gnuplot, report.html and report.md.
#include "modules/image_file.h"
#include "test.h"
#include "tools/lanternfield_bench.h"

#include <unistd.h>

#define FOLDER "." // main goes to a folder of its own

enum { WIDTH = 8, HEIGHT = 4, ROWS = 5 };

// ---- In place of lanternfield_bench_results.c, which needs measurements

double bench_metric(const bench_results *results, const bench_row *row, const char *name)
{
    (void)results;
    const struct {
        const char *name;
        double value;
    } metrics[] = {
        {"picture_ms", row->picture_ms},
        {"relative_l2", row->errors[0].relative_l2},
        {"path.relative_l2", row->errors[0].relative_l2},
        {"psnr", row->errors[0].psnr},
        {"energy", row->errors[0].energy},
        {"vpls", row->settings.vpls},
    };
    for (size_t i = 0; i < countof(metrics); i++) {
        if (strcmp(metrics[i].name, name) == 0) {
            return metrics[i].value;
        }
    }
    return NAN;
}

const bench_row *bench_row_find(const bench_results *results, const bench_view *view, const char *configuration)
{
    for (uint32_t i = 0; i < results->row_count; i++) {
        if (results->rows[i].view == view && strcmp(results->rows[i].configuration->name, configuration) == 0) {
            return &results->rows[i];
        }
    }
    return NULL;
}

// ---- A suite with one view and five configurations, of which the last was skipped. Of the others "c" is beaten by
// "b".

static bench_view view = {.name = "hall"};
static const bench_configuration configurations[ROWS] = {
    {.name = "a", .series = "S"}, {.name = "b", .series = "S"},        {.name = "c", .series = "S"},
    {.name = "d", .series = "S"}, {.name = "slow|<e>", .series = "S"},
};
static const bench_setting reference_settings[] = {{"method", "path"}};
static const bench_reference reference = {.name = "path", .settings = reference_settings, .setting_count = 1};
static const bench_chart plain_chart = {.name = "chart",
                                        .title = "it's {a}_b <&> \\n",
                                        .x = "picture_ms",
                                        .y = "relative_l2",
                                        .x_log = true,
                                        .y_log = true,
                                        .pareto = true};
static const char *const columns[] = {"picture_ms", "relative_l2", "psnr", "energy", "vpls"};
static const bench_table plain_table = {.title = "Table", .columns = columns, .column_count = countof(columns)};
static const bench_comparison comparisons[] = {
    {.text = "d over a", .metric = "picture_ms", .of = "d", .to = "a", .paper = 1.25, .note = "Smaller | *here*."},
    {.text = "against what was skipped", .metric = "picture_ms", .of = "slow|<e>", .to = "a", .paper = NAN},
};
static const bench_pictures picture_kinds[] = {
    {.title = "Pictures"},
    {.title = "FLIP", .what = "flip"},
    {.title = "Lights", .what = "lights-per-pixel"},
};

static bench_row rows[ROWS];
static image_measures errors[ROWS];
static bench_reference_result reference_result;
static bench_chart chart;
static bench_suite suite;
static bench_results results;

static void rows_make(void)
{
    static const double times[ROWS] = {10, 20, 40, 8, NAN}, l2[ROWS] = {0.4, 0.2, 0.3, 0.8, NAN};
    for (uint32_t i = 0; i < ROWS; i++) {
        errors[i] = (image_measures){.relative_l2 = l2[i], .psnr = 30 + i, .energy = 0.9 + 0.06 * i, .flip_mean = 0.1};
        rows[i] = (bench_row){.view = &view,
                              .configuration = &configurations[i],
                              .settings = render_settings_default(),
                              .done = i < 4,
                              .picture_ms = times[i],
                              .frame_ms_p50 = times[i],
                              .errors = &errors[i],
                              .lights_per_pixel = 12,
                              .image = "image.exr",
                              .lights_image = "lights.exr"};
        rows[i].settings.vpls = 1000 * (i + 1);
    }
    rows[4].skipped = "a frame takes 9 s";
}

static void results_make(void)
{
    rows_make();
    view.settings = render_settings_default();
    chart = plain_chart;
    reference_result = (bench_reference_result){.view = &view,
                                                .reference = &reference,
                                                .image = FOLDER "/reference.exr",
                                                .done = 64,
                                                .error = 0.0123,
                                                .seconds = 2};
    suite = (bench_suite){.name = "suite",
                          .title = "A <b>title</b>",
                          .description = "x < y & z",
                          .repeats = 3,
                          .views = &view,
                          .view_count = 1,
                          .configurations = (bench_configuration *)configurations,
                          .configuration_count = ROWS,
                          .references = (bench_reference *)&reference,
                          .reference_count = 1,
                          .charts = &chart,
                          .chart_count = 1,
                          .comparisons = (bench_comparison *)comparisons,
                          .comparison_count = countof(comparisons),
                          .tables = (bench_table *)&plain_table,
                          .table_count = 1,
                          .pictures = (bench_pictures *)picture_kinds,
                          .picture_count = countof(picture_kinds)};
    results = (bench_results){.suite = &suite,
                              .folder = FOLDER,
                              .device = "device",
                              .rows = rows,
                              .row_count = ROWS,
                              .references = &reference_result,
                              .reference_count = 1};
}

static void images_make(void)
{
    float image[WIDTH * HEIGHT * 3], other[WIDTH * HEIGHT * 3], lights[WIDTH * HEIGHT];
    for (int i = 0; i < WIDTH * HEIGHT * 3; i++) {
        image[i] = 0.1f + 0.01f * (float)i;
        other[i] = image[i] * (i % 2 ? 1.2f : 0.9f);
    }
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        lights[i] = (float)i; // up to 31: the scale ends at 50
    }
    CHECK(image_write_exr(FOLDER "/image.exr", other, WIDTH, HEIGHT, 3));
    CHECK(image_write_exr(FOLDER "/reference.exr", image, WIDTH, HEIGHT, 3));
    CHECK(image_write_exr(FOLDER "/lights.exr", lights, WIDTH, HEIGHT, 1));
}

// ---- What was written

static char *text_of(const char *name) // free() it
{
    size_t size;
    return (char *)file_read(name, &size);
}

static bool holds(const char *name, const char *text)
{
    char *const file = text_of(name);
    const bool found = file && strstr(file, text);
    free(file);
    return found;
}

static uint32_t count_of(const char *name, const char *text)
{
    char *const file = text_of(name);
    uint32_t count = 0;
    for (const char *at = file; at && (at = strstr(at, text)); at += strlen(text)) {
        count++;
    }
    free(file);
    return count;
}

static bool exists(const char *name)
{
    return access(name, F_OK) == 0;
}

static void remove_written(void)
{
    static const char *const names[] = {"chart.svg", "chart.png", "report.html", "report.md"};
    for (size_t i = 0; i < countof(names); i++) {
        unlink(names[i]);
    }
}

static uint32_t warnings;
static char last_line[512];
static void sink(log_level level, const char *line, void *user)
{
    (void)user;
    warnings += level >= LOG_WARNING;
    snprintf(last_line, sizeof(last_line), "%s", line);
}

// ---- Numbers

TEST(numbers_have_three_digits)
{
    arena memory = {0};
    CHECK_STRING(bench_number(&memory, 0.012345), "0.0123");
    CHECK_STRING(bench_number(&memory, 9.999), "10.0");
    CHECK_STRING(bench_number(&memory, 99.96), "100");
    CHECK_STRING(bench_number(&memory, 12345.6), "12,300");
    CHECK_STRING(bench_number(&memory, 1000000), "1,000,000");
    CHECK_STRING(bench_number(&memory, 65536), "65,536");
    CHECK_STRING(bench_number(&memory, 0), "0");
    CHECK_STRING(bench_number(&memory, -1.5), "−1.50");
    CHECK_STRING(bench_number(&memory, 0.00001234), "1.23e-05");
    CHECK_STRING(bench_number(&memory, NAN), "–");
    CHECK_STRING(bench_number(&memory, INFINITY), "∞");
    arena_fini(&memory);
}

TEST(metrics_have_titles_with_units)
{
    arena memory = {0};
    CHECK_STRING(bench_metric_title(&memory, "picture_ms"), "time, ms");
    CHECK_STRING(bench_metric_title(&memory, "path.relative_l2"), "relative L2 error to path");
    CHECK_STRING(bench_metric_title(&memory, "ms:*-vpl_trace-lgh_build"), "all passes − vpl_trace − lgh_build, ms");
    CHECK_STRING(bench_metric_title(&memory, "ms_p95:shadow"), "shadow p95, ms");
    CHECK_STRING(bench_metric_title(&memory, "alpha"), "alpha");
    arena_fini(&memory);
}

// ---- The report

TEST(text_of_suites_is_never_markup)
{
    CHECK(bench_report_write(&results));
    CHECK(holds("report.html", "A &lt;b&gt;title&lt;/b&gt;") && !holds("report.html", "<b>title"));
    CHECK(holds("report.html", "x &lt; y &amp; z"));
    CHECK(holds("report.md", "# A \\<b\\>title\\</b\\>"));
    CHECK(holds("report.md", "Smaller \\| \\*here\\*."));
}

TEST(the_best_of_a_column_is_bold)
{
    CHECK(bench_report_write(&results));
    CHECK(holds("report.md", "| d | **8** | 0.800 | **33** |")); // fastest, highest PSNR
    CHECK(holds("report.md", "| b | 20 | **0.200** | 31 |"));
    CHECK(holds("report.md", "| c | 40 | 0.300 | 32 | **1.02** | 3,000 |")); // nearest to 1; settings have no best
    CHECK(holds("report.html", "<td class=\"n\"><b>0.200</b></td>"));
}

TEST(ratios_stand_beside_the_paper)
{
    CHECK(bench_report_write(&results));
    CHECK(holds("report.md", "| d over a | 0.800 | 1.25 |"));
    CHECK(holds("report.md", "| against what was skipped | – | – |"));
}

TEST(what_was_skipped_is_named_with_the_reason)
{
    CHECK(bench_report_write(&results));
    CHECK(holds("report.md", "| hall | slow\\|\\<e\\> | a frame takes 9 s |"));
    CHECK(holds("report.html", "<td>slow|&lt;e&gt;</td><td>a frame takes 9 s</td>"));
    CHECK(count_of("report.md", "slow\\|") == 1); // in no table of results
}

TEST(rows_of_a_scene_that_is_missing_say_so)
{
    rows[4].skipped = NULL;
    CHECK(bench_report_write(&results));
    CHECK(holds("report.md", "| hall | slow\\|\\<e\\> | not measured yet |"));
    view.absent = true;
    CHECK(bench_report_write(&results));
    CHECK(holds("report.md", "| hall | slow\\|\\<e\\> | the file of its scene is missing |"));
    view.absent = false;
    results_make();
}

TEST(pictures_are_inside_the_report)
{
    CHECK(bench_report_write(&results));
    // Two rows of a scale, a reference, the same behind the pictures, four pictures and four maps; one of a scale and
    // four maps. Each is a whole PNG file.
    CHECK(count_of("report.html", "data:image/png;base64,iVBORw0KGgo") == 2 * 11 + 5);
    CHECK(count_of("report.html", "data:image/png") == 2 * 11 + 5);
    CHECK(!holds("report.html", "http") && !holds("report.html", "<script"));
    CHECK(holds("report.html", "64 samples per pixel, 2,000 ms<br>estimates its own relative error at 1.23 %"));
    CHECK(holds("report.html", "12 lights per pixel"));
    CHECK(holds("report.html", " 50 &nbsp; lights per pixel"));
}

TEST(a_picture_that_cannot_be_read_fails_and_leaves_the_rest)
{
    rows[1].image = "none.exr";
    warnings = 0;
    CHECK(!bench_report_write(&results));
    CHECK(warnings > 0 && strstr(last_line, "none.exr"));
    CHECK(holds("report.html", "All results"));
    results_make();
}

TEST(nothing_measured_is_no_failure)
{
    for (uint32_t i = 0; i < ROWS; i++) {
        rows[i].done = false;
    }
    results.device = NULL;
    CHECK(bench_report_write(&results));
    CHECK(holds("report.md", "| hall | a | not measured yet |"));
    results_make();
}

// ---- Charts

TEST(text_of_charts_is_never_markup)
{
    CHECK(bench_charts_write(&results));
    CHECK(holds("chart.svg", ">it's {a}_b &lt;&amp;> \\n</text>") ||
          holds("chart.svg", ">it's {a}_b &lt;&amp;&gt; \\n</text>"));
    CHECK(holds("chart.png", "PNG"));
}

// Numbers "x,y" of the translucent line.
static uint32_t front_vertices(void)
{
    char *const svg = text_of("chart.svg");
    uint32_t count = 0;
    for (const char *at = svg; at && (at = strstr(at, "opacity=")); at++) {
        const char *const path = strstr(at, "d='M");
        uint32_t commas = 0;
        for (const char *c = path + strlen("d='"); path && *c && *c != '\''; c++) {
            commas += *c == ',';
        }
        count = max_u32(count, commas);
    }
    free(svg);
    return count;
}

TEST(the_front_leaves_out_what_is_beaten)
{
    CHECK(bench_charts_write(&results));
    CHECK(front_vertices() == 5); // steps over d, a and b; not c
    rows[2].picture_ms = 15; // neither a nor b beats it now
    CHECK(bench_charts_write(&results));
    CHECK(front_vertices() == 7);
    results_make();
}

TEST(labels_give_what_was_swept)
{
    chart.labels = true;
    CHECK(bench_charts_write(&results));
    CHECK(holds("chart.svg", "<text>1K</text>") && holds("chart.svg", "<text>4K</text>"));
    CHECK(holds("chart.svg", "Labels give  S: vpls"));
    results_make();
}

TEST(one_point_missing_values_and_bars_are_drawn)
{
    for (uint32_t i = 1; i < ROWS; i++) {
        errors[i].relative_l2 = NAN;
    }
    warnings = 0;
    chart.labels = true;
    CHECK(bench_charts_write(&results) && warnings == 0);
    chart.bars = true;
    chart.y_log = false;
    CHECK(bench_charts_write(&results) && warnings == 0);
    CHECK(holds("chart.svg", "<text>0.400</text>") && holds("chart.svg", "<text>hall</text>"));
    results_make();
}

TEST(an_empty_chart_says_so_once)
{
    chart.y = "lights_per_pixel"; // which the metrics above do not know
    warnings = 0;
    CHECK(bench_charts_write(&results));
    CHECK(warnings == 1 && strstr(last_line, "chart \"chart\" is empty"));
    CHECK(holds("chart.svg", "nothing measured"));
    results_make();
}

TEST(values_that_a_logarithm_does_not_have_are_reported)
{
    errors[0].relative_l2 = 0;
    warnings = 0;
    CHECK(bench_charts_write(&results));
    CHECK(warnings == 1 && strstr(last_line, "1 point"));
    results_make();
}

TEST(the_same_results_give_the_same_bytes)
{
    static const char *const names[] = {"chart.svg", "report.html", "report.md"};
    char *first[countof(names)];
    CHECK(bench_charts_write(&results) && bench_report_write(&results));
    for (size_t i = 0; i < countof(names); i++) {
        first[i] = text_of(names[i]);
    }
    CHECK(bench_charts_write(&results) && bench_report_write(&results));
    for (size_t i = 0; i < countof(names); i++) {
        char *const second = text_of(names[i]);
        CHECK(first[i] && second && strcmp(first[i], second) == 0);
        free(first[i]);
        free(second);
    }
}

TEST(charts_are_in_the_report)
{
    CHECK(bench_charts_write(&results) && bench_report_write(&results));
    CHECK(count_of("report.html", "data:image/svg+xml;base64,PD94bWwg") == 1);
    CHECK(holds("report.md", "](chart.svg)"));
}

TEST(without_gnuplot_there_is_one_warning_and_a_report)
{
    remove_written();
    char *const path = strdup(getenv("PATH"));
    setenv("PATH", "/nonexistent", 1);
    warnings = 0;
    CHECK(bench_charts_write(&results) && warnings == 1 && strstr(last_line, "gnuplot"));
    setenv("PATH", path, 1);
    free(path);
    CHECK(!exists("chart.svg") && !exists("chart.png"));
    CHECK(bench_report_write(&results) && warnings == 1);
    CHECK(exists("report.html") && !holds("report.md", "chart.svg"));
}

static void charts_run(void)
{
    RUN(text_of_charts_is_never_markup);
    RUN(the_front_leaves_out_what_is_beaten);
    RUN(labels_give_what_was_swept);
    RUN(one_point_missing_values_and_bars_are_drawn);
    RUN(an_empty_chart_says_so_once);
    RUN(values_that_a_logarithm_does_not_have_are_reported);
    RUN(the_same_results_give_the_same_bytes);
    RUN(charts_are_in_the_report);
}

int main(void)
{
    char folder[] = "/tmp/test_bench_report.XXXXXX";
    if (!mkdtemp(folder) || chdir(folder) != 0) {
        perror(folder);
        return EXIT_FAILURE;
    }
    log_sink_set(sink, NULL);
    results_make();
    images_make();
    RUN(numbers_have_three_digits);
    RUN(metrics_have_titles_with_units);
    RUN(text_of_suites_is_never_markup);
    RUN(the_best_of_a_column_is_bold);
    RUN(ratios_stand_beside_the_paper);
    RUN(what_was_skipped_is_named_with_the_reason);
    RUN(rows_of_a_scene_that_is_missing_say_so);
    RUN(pictures_are_inside_the_report);
    RUN(a_picture_that_cannot_be_read_fails_and_leaves_the_rest);
    RUN(nothing_measured_is_no_failure);
    RUN(without_gnuplot_there_is_one_warning_and_a_report);
    if (system("gnuplot --version >/dev/null 2>&1") == 0) {
        charts_run();
    } else {
        printf("charts: skipped, gnuplot is not installed\n");
    }
    remove_written();
    unlink("image.exr");
    unlink("reference.exr");
    unlink("lights.exr");
    rmdir(folder);
    return test_end();
}
