// `lanternfield bench`: measures the configurations of a suite in each of its views, against its references. What is
// finished is in the journal; a run that is started again does the rest.
#include "lanternfield_bench_run.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

// ---- Options

static const struct {
    const char *name, *value_name;
    size_t offset; // of a const char *, or of a bool where there is no value
    const char *help;
} option_table[] = {
    {"-o", "DIR", offsetof(bench_options, folder), "where results.csv, report.html, charts, pictures and journal go"},
    {"--references", "DIR", offsetof(bench_options, references),
     "where references are kept, to share them between suites (default: references in the -o folder)"},
    {"--views", "A,B", offsetof(bench_options, views),
     "measure these views alone; the report shows all that is measured (default: all)"},
    {"--device", "NAME", offsetof(bench_options, device), "first device whose name contains NAME"},
    {"--validate", NULL, offsetof(bench_options, validate),
     "run under the validation layer; fail when it reports anything"},
    {"--fresh-references", NULL, offsetof(bench_options, fresh_references), "render references even if they are there"},
    {"--report-only", NULL, offsetof(bench_options, report_only), "make CSV, charts and report of what is measured"},
    {"--help", NULL, offsetof(bench_options, help), "print this"},
    {"-h", NULL, offsetof(bench_options, help), NULL},
};

static void help_print(void)
{
    puts(
        "usage: lanternfield bench SUITE.json -o DIR [OPTION...]\n"
        "Measures the configurations of a suite: times, lights and rays per pixel, memory, errors against references.\n"
        "Stopped at any moment and started again, it goes on where it was. The keys of a suite are described in\n"
        "assets/suites/README.md.\n");
    for (size_t i = 0; i < countof(option_table) && option_table[i].help; i++) {
        const char *const value_name = option_table[i].value_name;
        char left[40];
        snprintf(left, sizeof(left), "%s %s", option_table[i].name, value_name ? value_name : "");
        printf("  %-20s %s\n", left, option_table[i].help);
    }
    puts("\nCtrl-C writes what there is. Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted.");
}

static int wrong_usage(const char *what, const char *word)
{
    log_error("%s%s; see lanternfield bench --help", what, word);
    return EXIT_WRONG_USAGE;
}

static int option_read(bench_options *options, int argc, char **argv, int *i)
{
    const char *const word = argv[*i], *const equals = strchr(word, '=');
    const size_t length = equals ? (size_t)(equals - word) : strlen(word);
    for (size_t o = 0; o < countof(option_table); o++) {
        const char *const name = option_table[o].name;
        if (strlen(name) != length || strncmp(word, name, length) != 0) {
            continue;
        }
        void *const member = (char *)options + option_table[o].offset;
        if (!option_table[o].value_name) {
            *(bool *)member = true;
            return equals ? wrong_usage(name, ": it takes no value") : EXIT_DONE;
        }
        const char *const value = equals ? equals + 1 : *i + 1 < argc ? argv[++*i] : "";
        *(const char **)member = value;
        return *value ? EXIT_DONE : wrong_usage(name, ": its value is missing");
    }
    return wrong_usage("unknown option ", word);
}

static int options_read(bench_options *options, int argc, char **argv)
{
    for (int i = 0; i < argc; i++) {
        if (argv[i][0] == '-') {
            const int code = option_read(options, argc, argv, &i);
            if (code != EXIT_DONE) {
                return code;
            }
        } else if (options->suite) {
            return wrong_usage("one SUITE is enough, not also ", argv[i]);
        } else {
            options->suite = argv[i];
        }
    }
    if (!options->help && !options->suite) {
        return wrong_usage("bench needs a SUITE.json", "");
    }
    return options->help || options->folder ? EXIT_DONE : wrong_usage("bench needs -o DIR", "");
}

// The item of "a,b,c" after this one; NULL: there is none.
static const char *item_next(const char *item)
{
    const char *const comma = strchr(item, ',');
    return comma ? comma + 1 : NULL;
}

// Whether this item of "a,b,c" is a name.
static bool item_is(const char *item, const char *name)
{
    return strcspn(item, ",") == strlen(name) && strncmp(item, name, strlen(name)) == 0;
}

// Whether a name is in "a,b,c"; all are when the list is NULL.
static bool list_names(const char *list, const char *name)
{
    for (const char *item = list; item; item = item_next(item)) {
        if (item_is(item, name)) {
            return true;
        }
    }
    return !list;
}

bool bench_view_selected(const bench_run *run, const bench_view *view)
{
    return !view->absent && list_names(run->options.views, view->name);
}

const char *bench_path(bench_run *run, const char *name)
{
    return arena_printf(&run->memory, "%s/%s", run->options.folder, name);
}

// ---- Before any work: are the views there, and their scenes?

static bool view_names_check(const bench_run *run)
{
    for (const char *item = run->options.views; item; item = item_next(item)) {
        bool found = false;
        for (uint32_t v = 0; v < run->suite->view_count; v++) {
            found = found || item_is(item, run->suite->views[v].name);
        }
        if (!found) {
            log_error("--views: %s has no view \"%.*s\"", run->suite->path, (int)strcspn(item, ","), item);
            return false;
        }
    }
    return true;
}

static bool scenes_check(bench_run *run)
{
    uint32_t selected = 0;
    for (uint32_t v = 0; v < run->suite->view_count; v++) {
        bench_view *const view = &run->suite->views[v];
        if (!list_names(run->options.views, view->name)) {
            continue;
        }
        const bool is_missing = !run->options.report_only && access(view->scene, R_OK) != 0;
        if (is_missing && !view->optional) {
            log_error("%s: views[%u].scene: there is no readable file \"%s\"", run->suite->path, v, view->scene);
            return false;
        }
        view->absent = is_missing;
        selected += !view->absent;
        if (is_missing) {
            log_warning("%s: view \"%s\" is left out: there is no file \"%s\"", run->suite->path, view->name,
                        view->scene);
        }
    }
    if (selected == 0) {
        log_error("%s: none of its scenes is there", run->suite->path);
    }
    return selected > 0;
}

// ---- The command

static int views_run(bench_run *run)
{
    int code = EXIT_DONE;
    for (uint32_t v = 0; code == EXIT_DONE && v < run->suite->view_count; v++) {
        run->view = &run->suite->views[v];
        code = bench_view_selected(run, run->view) ? bench_view_run(run) : EXIT_DONE;
    }
    return code;
}

static uint32_t rows_done(const bench_run *run)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < run->results.row_count; i++) {
        count += run->results.rows[i].done || run->results.rows[i].skipped;
    }
    return count;
}

static const char *duration(bench_run *run, double seconds)
{
    return seconds < 90 ? arena_printf(&run->memory, "%.0f s", seconds)
                        : arena_printf(&run->memory, "%.0f min", seconds / 60);
}

static bool results_write(bench_run *run)
{
    for (uint32_t i = 0; i < run->results.row_count; i++) {
        if (run->results.rows[i].key[0]) {
            bench_row_collect(&run->results, &run->results.rows[i], run->journal);
        }
    }
    bool ok = bench_errors_measure(run);
    progress_show("charts and report");
    ok = bench_csv_write(&run->results) && ok;
    ok = bench_charts_write(&run->results) && ok;
    ok = bench_report_write(&run->results) && ok;
    progress_end();
    if (ok) {
        char anew[96] = "";
        if (run->anew > 0) {
            snprintf(anew, sizeof(anew), ", %u measured anew for a changed program, scene or device", run->anew);
        }
        printf("wrote %s/report.html, results.csv, %u charts: %u rows, %u reused%s, %s\n", run->options.folder,
               run->suite->chart_count, rows_done(run), run->reused, anew, duration(run, time_now() - run->start));
    }
    return ok;
}

static bool run_open(bench_run *run)
{
    run->start = time_now();
    run->suite = bench_suite_read(run->options.suite);
    if (!run->suite || !view_names_check(run) || !scenes_check(run)) {
        return false;
    }
    if (!run->options.references) {
        run->options.references = bench_path(run, "references");
    }
    run->program = bench_hash(BENCH_HASH_START, LANTERNFIELD_VERSION, sizeof(LANTERNFIELD_VERSION));
    uint64_t executable;
    if (!bench_folder_make(bench_path(run, "images")) || !bench_folder_make(run->options.references) ||
        !bench_hash_file("/proc/self/exe", &executable)) {
        return false;
    }
    run->program = bench_hash(run->program, &executable, sizeof(executable));
    run->journal = bench_journal_open(run->options.folder);
    const uint32_t configurations = run->suite->configuration_count;
    run->rows = arena_alloc(&run->memory, configurations * sizeof(*run->rows));
    run->pending = arena_alloc(&run->memory, configurations * sizeof(*run->pending));
    run->seconds = arena_alloc(&run->memory, configurations * sizeof(*run->seconds));
    bench_results_init(&run->results, run->suite, run->options.folder);
    return run->journal != NULL;
}

static int run_all(bench_run *run)
{
    const int measured = run->options.report_only ? EXIT_DONE : views_run(run);
    bench_recall(run);
    if (!results_write(run)) {
        return EXIT_FAILED;
    }
    if (interrupt_seen() && measured != EXIT_FAILED) {
        log_info("interrupted; what there was is written, and the same command goes on from here");
        return EXIT_INTERRUPTED;
    }
    return measured;
}

int bench_command(int argc, char **argv)
{
    bench_run run = {0};
    const int usage = options_read(&run.options, argc, argv);
    if (usage != EXIT_DONE) {
        return usage;
    }
    if (run.options.help) {
        help_print();
        return EXIT_DONE;
    }
    interrupt_watch();
    progress_begin();
    const int code = run_open(&run) ? run_all(&run) : EXIT_FAILED;
    progress_end();
    bench_journal_close(run.journal);
    bench_results_fini(&run.results);
    bench_suite_destroy(run.suite);
    arena_fini(&run.memory);
    return code;
}
