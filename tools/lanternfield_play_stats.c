// Statistics of `lanternfield play`: a table with a row a frame, as comma-separated values.
#include "lanternfield_play.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// ---- The table

static size_t column_find(play_stats *stats, const char *name, size_t length)
{
    for (size_t i = 0; i < stats->column_count; i++) {
        if (strlen(stats->columns[i]) == length && memcmp(stats->columns[i], name, length) == 0) {
            return i;
        }
    }
    memory_reserve((void **)&stats->columns, &stats->column_capacity, stats->column_count + 1, sizeof(char *));
    stats->columns[stats->column_count] = strndup(name, length);
    return stats->column_count++;
}

static void value_set(play_stats *stats, play_row *row, const char *column, size_t length, double value)
{
    const size_t at = column_find(stats, column, length);
    if (at >= row->count) {
        row->values = memory_realloc(row->values, (at + 1) * sizeof(*row->values));
        for (; row->count <= at; row->count++) {
            row->values[row->count] = NAN;
        }
    }
    row->values[at] = value;
}

// The row of that frame, empty; rows stay in the order of the frames.
static play_row *row_make(play_stats *stats, uint32_t frame)
{
    size_t at = stats->row_count;
    while (at > 0 && stats->rows[at - 1].frame >= frame) {
        at--;
    }
    if (at < stats->row_count && stats->rows[at].frame == frame) {
        stats->rows[at].count = 0;
        return &stats->rows[at];
    }
    memory_reserve((void **)&stats->rows, &stats->row_capacity, stats->row_count + 1, sizeof(play_row));
    memmove(&stats->rows[at + 1], &stats->rows[at], (stats->row_count - at) * sizeof(play_row));
    stats->row_count++;
    stats->rows[at] = (play_row){.frame = frame};
    return &stats->rows[at];
}

// ---- The file

static bool table_write(const play_stats *stats)
{
    char *text = NULL;
    size_t size = 0;
    FILE *const out = open_memstream(&text, &size);
    assert(out);
    fputs("frame", out);
    for (size_t c = 0; c < stats->column_count; c++) {
        fprintf(out, ",%s", stats->columns[c]);
    }
    fputc('\n', out);
    for (size_t i = 0; i < stats->row_count; i++) {
        const play_row *const row = &stats->rows[i];
        fprintf(out, "%u", row->frame);
        for (size_t c = 0; c < stats->column_count; c++) {
            const double value = c < row->count ? row->values[c] : NAN;
            fprintf(out, isnan(value) ? "," : ",%.7g", value);
        }
        fputc('\n', out);
    }
    fclose(out);
    const bool ok = file_write(stats->path, text, size);
    free(text);
    return ok;
}

// One line into a row; the names of the columns are those of `header`.
static bool row_read(play_stats *stats, const char *header, const char *line)
{
    char *end;
    const unsigned long frame = strtoul(line, &end, 10);
    if (end == line || frame >= UINT32_MAX) {
        return false;
    }
    play_row *const row = row_make(stats, (uint32_t)frame);
    while (*end == ',' && *header == ',') {
        const char *const name = ++header, *const from = end + 1;
        header += strcspn(header, ",\n");
        const double value = strtod(from, &end);
        value_set(stats, row, name, (size_t)(header - name), end == from ? NAN : value);
    }
    return (*end == '\n' || !*end) && (*header == '\n' || !*header);
}

static bool table_read(play_stats *stats)
{
    size_t size;
    char *const text = (char *)file_read(stats->path, &size);
    if (!text) {
        return false;
    }
    bool ok = strncmp(text, "frame", 5) == 0;
    const char *line = text + strcspn(text, "\n");
    while (ok && *line && *++line) {
        ok = row_read(stats, text + 5, line);
        line += strcspn(line, "\n");
    }
    if (!ok) {
        log_error("%s: expected statistics of lanternfield play, to go on with", stats->path);
    }
    free(text);
    return ok;
}

bool play_stats_open(play_stats *stats, const char *path, bool keep)
{
    stats->path = path;
    return !path || (output_path_check(path) && (!keep || access(path, F_OK) != 0 || table_read(stats)));
}

static void named_set(play_stats *stats, play_row *row, const char *column, double value)
{
    value_set(stats, row, column, strlen(column), value);
}

bool play_stats_add(play_stats *stats, const player *p, uint32_t frame, double time)
{
    if (!stats->path) {
        return true;
    }
    renderer *const r = player_renderer(p);
    const double lights = lights_per_pixel_mean(r), pixels = (double)r->settings.width * r->settings.height;
    play_row *const row = row_make(stats, frame);
    render_times_add(&stats->times, r, player_milliseconds(p));
    named_set(stats, row, "time", time);
    named_set(stats, row, "ms", player_milliseconds(p));
    named_set(stats, row, "lights_per_pixel", lights >= 0 ? lights : NAN);
    named_set(stats, row, "rays_per_pixel",
              progressive_is(r) ? progressive_status_get(r, false).rays / pixels : rays_per_pixel(r));
    for (size_t i = 0; i < stats->times.module_count; i++) {
        const time_series *const module = &stats->times.modules[i];
        char name[80];
        snprintf(name, sizeof(name), "%s_ms", module->name);
        if (module->seen) {
            named_set(stats, row, name, module->current);
        }
    }
    return table_write(stats);
}

void play_stats_fini(play_stats *stats)
{
    for (size_t i = 0; i < stats->column_count; i++) {
        free(stats->columns[i]);
    }
    for (size_t i = 0; i < stats->row_count; i++) {
        free(stats->rows[i].values);
    }
    free(stats->columns);
    free(stats->rows);
    render_times_fini(&stats->times);
    *stats = (play_stats){0};
}
