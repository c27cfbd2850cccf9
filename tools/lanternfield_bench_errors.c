// Errors of the pictures of a run against its references, kept in the journal.
#include "lanternfield_bench_run.h"

#include "modules/image_file.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>

typedef struct picture {
    float *texels; // NULL: not read yet, or unreadable
    uint32_t width, height;
} picture;

static void errors_to_json(cJSON *line, const image_measures *measures)
{
    uint32_t count;
    const image_measure_info *const table = image_measure_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        const double value = *(const double *)((const char *)measures + table[i].offset);
        if (isinf(value)) { // the PSNR of equal pictures; JSON has no number for it
            cJSON_AddStringToObject(line, table[i].name, "inf");
        } else {
            cJSON_AddNumberToObject(line, table[i].name, value);
        }
    }
}

static void errors_from_json(const cJSON *line, image_measures *measures)
{
    uint32_t count;
    const image_measure_info *const table = image_measure_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        const cJSON *const item = cJSON_GetObjectItemCaseSensitive(line, table[i].name);
        *(double *)((char *)measures + table[i].offset) = cJSON_IsNumber(item)   ? item->valuedouble
                                                          : cJSON_IsString(item) ? INFINITY
                                                                                 : NAN;
    }
}

// False: they cannot be compared (logged).
static bool pictures_measure(const char *path, const bench_reference_result *reference, image_measures *measures)
{
    picture image = {0}, truth = {0};
    image.texels = image_read_exr(path, &image.width, &image.height);
    truth.texels = image_read_exr(reference->image, &truth.width, &truth.height);
    bool ok = image.texels && truth.texels;
    if (ok && (image.width != truth.width || image.height != truth.height)) {
        log_warning("%s: %ux%u pixels, but the reference %s has %ux%u: no error is measured", path, image.width,
                    image.height, reference->reference->name, truth.width, truth.height);
        ok = false;
    }
    if (ok && image_find_bad(image.texels, image.width, image.height) != SIZE_MAX) {
        log_warning("%s: holds values that are not finite: no error is measured", path);
        ok = false;
    }
    ok = ok && image_measure(image.texels, truth.texels, image.width, image.height, NAN, measures, NULL);
    free(image.texels);
    free(truth.texels);
    return ok;
}

// By the contents of both files, so that pictures that were made again are measured again.
static bool row_errors_measure(bench_run *run, bench_row *row, uint32_t reference)
{
    const uint32_t view = (uint32_t)(row->view - run->suite->views);
    const bench_reference_result *const result =
        &run->results.references[view * run->suite->reference_count + reference];
    if (!row->done || !row->image || !result->image) {
        return true;
    }
    const char *const path = bench_path(run, row->image);
    uint64_t hashes[2];
    if (!bench_hash_file(path, &hashes[0]) || !bench_hash_file(result->image, &hashes[1])) {
        return false;
    }
    char keys[3][BENCH_KEY_SIZE];
    bench_key_print(hashes[0], keys[0]);
    bench_key_print(hashes[1], keys[1]);
    bench_key_print(run->program, keys[2]); // which measures
    const char *const key = arena_printf(&run->memory, "%s-%s-%s", keys[0], keys[1], keys[2]);
    size_t place = 0;
    const cJSON *const known = bench_journal_next(run->journal, "errors", key, &place);
    image_measures measures = {0};
    if (known) {
        errors_from_json(known, &row->errors[reference]);
        return true;
    }
    if (interrupt_seen() || !pictures_measure(path, result, &measures)) {
        return true; // NAN stays
    }
    row->errors[reference] = measures;
    cJSON *const line = cJSON_CreateObject();
    errors_to_json(line, &measures);
    return bench_journal_add(run->journal, "errors", key, line);
}

bool bench_errors_measure(bench_run *run)
{
    bool ok = true;
    for (uint32_t i = 0; ok && i < run->results.row_count; i++) {
        progress_show("errors  %u/%u", i + 1, run->results.row_count);
        for (uint32_t r = 0; ok && r < run->suite->reference_count; r++) {
            ok = row_errors_measure(run, &run->results.rows[i], r);
        }
    }
    return ok;
}
