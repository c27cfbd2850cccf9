// References of `lanternfield bench`: pictures that errors are measured against, kept in a folder by what they show.
// The key says nothing of the executable, so that they serve later builds too.
//
//   KEY.exr    the picture
//   KEY.state  its sums while it is not finished, saved every few seconds
//   KEY.json   how far it is and the seconds that it took over all its parts; "picture": KEY.exr is of this
#include "lanternfield_bench.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct reference_files {
    const char *image, *state, *info;
} reference_files;

// What the file with the numbers says.
typedef struct reference_info {
    bool picture, finished;
    uint64_t done;
    double error, seconds;
} reference_info;

static double number_of(const cJSON *json, const char *name)
{
    const cJSON *const item = cJSON_GetObjectItemCaseSensitive(json, name);
    return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

static reference_info info_read(const char *path)
{
    reference_info info = {.error = NAN};
    size_t size;
    char *const text = access(path, F_OK) == 0 ? (char *)file_read(path, &size) : NULL;
    cJSON *const json = text ? cJSON_Parse(text) : NULL;
    if (json) {
        info.picture = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(json, "picture"));
        info.finished = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(json, "finished"));
        info.done = (uint64_t)fmax(0, number_of(json, "done"));
        info.error = number_of(json, "error");
        info.seconds = fmax(0, number_of(json, "seconds"));
    }
    cJSON_Delete(json);
    free(text);
    return info;
}

static bool info_write(const char *path, const reference_info *info, const char *identity)
{
    cJSON *const json = cJSON_CreateObject();
    cJSON_AddBoolToObject(json, "picture", info->picture);
    cJSON_AddBoolToObject(json, "finished", info->finished);
    cJSON_AddNumberToObject(json, "done", (double)info->done);
    cJSON_AddNumberToObject(json, "error", info->error); // null where it is not known
    cJSON_AddNumberToObject(json, "seconds", info->seconds);
    cJSON_AddStringToObject(json, "identity", identity);
    char *const text = cJSON_Print(json);
    const bool ok = file_write(path, text, strlen(text));
    cJSON_free(text);
    cJSON_Delete(json);
    return ok;
}

// Everything that the picture depends on, its length too: what the state depends on does not name that.
static char *identity_with_length(const render_session *session, const render_request *request)
{
    char *const identity = render_identity(session, request);
    char *text;
    size_t size;
    FILE *const out = open_memstream(&text, &size);
    fputs(identity, out);
    if (request->settings.method == METHOD_PATH) {
        char until[32];
        settings_get(&request->settings, settings_find("until"), until);
        fprintf(out, "spp %u\nuntil %s\n", request->settings.spp, until);
    } else if (!progressive_is(session->renderer)) {
        fprintf(out, "frames %u\n", request->settings.frames);
    }
    fclose(out);
    free(identity);
    return text;
}

// Which reference it is, and what is left of it or of its budget.
static void progress_print(const bench_reference_desc *desc, const progressive_run *run, double seconds)
{
    const progressive_status *const now = &run->now;
    const double here = (double)(now->done - run->before.done), budget = desc->reference->budget_s;
    double left = here > 0 ? (time_now() - run->start) / here * (double)(now->total - now->done) : 0;
    left = budget > 0 ? fmin(left, fmax(0, budget - seconds)) : left;
    char error[32] = "";
    if (!isnan(now->error)) {
        snprintf(error, sizeof(error), "  error %.2g %%", 100 * now->error);
    }
    progress_show(left < 90 ? "%s  %llu/%llu%s  at most %.0f s left" : "%s  %llu/%llu%s  at most %.0f min left",
                  desc->title, (unsigned long long)now->done, (unsigned long long)now->total, error,
                  left < 90 ? left : left / 60);
}

// Renders from where the state is until the method is finished or the budget is spent.
static int progressive_render(const bench_reference_desc *desc, const render_request *request,
                              const reference_files *files, const char *identity, reference_info *info)
{
    renderer *const r = desc->session->renderer;
    progressive_run run = {0};
    int code = EXIT_FAILED;
    if (!progressive_run_begin(&run, desc->session, request)) {
        // Logged: the state is damaged, or another program's. What it held is rendered again.
        unlink(files->state);
        *info = (reference_info){.error = NAN};
        progressive_run_fini(&run);
        progressive_restart(r);
        if (!progressive_run_begin(&run, desc->session, request)) {
            goto done;
        }
    }
    const double before = info->seconds, budget = desc->reference->budget_s;
    info->picture = false;
    double saved_at = run.saved_at;
    for (bool enough = false; !enough && !interrupt_seen();) {
        if (!renderer_frame(r)) {
            goto done;
        }
        progressive_run_step(&run, r);
        info->seconds = before + time_now() - run.start;
        progress_print(desc, &run, info->seconds);
        info->done = run.now.done;
        info->finished = run.now.finished;
        enough = info->finished || (budget > 0 && info->seconds >= budget);
        if (run.saved_at != saved_at) { // the state was: its seconds go with it
            saved_at = run.saved_at;
            if (!info_write(files->info, info, identity)) {
                goto done;
            }
        }
    }
    progressive_run_end(&run, r);
    info->error = progressive_status_get(r, true).error;
    const bool enough = info->finished || (budget > 0 && info->seconds >= budget);
    info->picture = enough && picture_write(r, files->image);
    code = !info_write(files->info, info, identity) || enough != info->picture ? EXIT_FAILED
           : enough                                                            ? EXIT_DONE
                                                                               : EXIT_INTERRUPTED;
    if (code == EXIT_DONE && info->finished) {
        unlink(files->state); // nothing can be added to it
    }

done:
    progressive_run_fini(&run);
    return code;
}

// A method of frames: those that its settings ask for.
static int frames_render(const bench_reference_desc *desc, const reference_files *files, const char *identity,
                         reference_info *info)
{
    renderer *const r = desc->session->renderer;
    const double start = time_now();
    for (uint32_t f = 0; f < r->settings.frames; f++) {
        if (interrupt_seen()) {
            return EXIT_INTERRUPTED;
        }
        progress_show("%s  frame %u/%u", desc->title, f + 1, r->settings.frames);
        if (!renderer_frame(r)) {
            return EXIT_FAILED;
        }
    }
    *info = (reference_info){true, true, r->settings.frames, NAN, time_now() - start};
    return picture_write(r, files->image) && info_write(files->info, info, identity) ? EXIT_DONE : EXIT_FAILED;
}

int bench_reference_make(const bench_reference_desc *desc, arena *memory, bench_reference_result *result,
                         char key[BENCH_KEY_SIZE], bool *reused)
{
    renderer *const r = desc->session->renderer;
    render_request request = *desc->request;
    bench_settings_apply(&request.settings, desc->reference->settings, desc->reference->setting_count);
    r->settings = request.settings;
    bench_restart(r);
    char *const identity = identity_with_length(desc->session, &request);
    bench_key_print(bench_hash(BENCH_HASH_START, identity, strlen(identity)), key);
    const reference_files files = {
        .image = arena_printf(memory, "%s/%s.exr", desc->folder, key),
        .state = arena_printf(memory, "%s/%s.state", desc->folder, key),
        .info = arena_printf(memory, "%s/%s.json", desc->folder, key),
    };
    if (desc->fresh) {
        unlink(files.info);
        unlink(files.state);
    }
    reference_info info = info_read(files.info);
    const double budget = desc->reference->budget_s;
    *reused =
        info.picture && (info.finished || (budget > 0 && info.seconds >= budget)) && access(files.image, R_OK) == 0;
    int code = EXIT_DONE;
    if (!*reused) {
        if (access(files.state, F_OK) != 0) {
            info = (reference_info){.error = NAN};
        }
        request.state = files.state;
        code = progressive_is(r) ? progressive_render(desc, &request, &files, identity, &info)
                                 : frames_render(desc, &files, identity, &info);
    }
    free(identity);
    result->image = code == EXIT_DONE ? files.image : NULL;
    result->done = info.done;
    result->error = info.error;
    result->seconds = info.seconds;
    return code;
}
