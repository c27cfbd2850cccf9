// Progressive methods, frame by frame: when to save the state, and what the terminal shows.
#include "lanternfield.h"

#include <math.h>
#include <stdlib.h>
#include <unistd.h>

// The state is saved this often, and less often where saving would take more than its part of the time.
static const double save_interval_s = 5, save_time_part = 0.05;

bool progressive_run_begin(progressive_run *run, const render_session *session, const render_request *request)
{
    renderer *const r = session->renderer;
    run->state = request->state;
    if (run->state) {
        run->identity = render_identity(session, request);
    }
    if (run->state && access(run->state, F_OK) == 0 && !progressive_load(r, run->state, run->identity)) {
        return false;
    }
    run->before = run->now = progressive_status_get(r, false);
    run->spp = r->settings.spp;
    if (run->before.finished) {
        // By --until: the frame that makes the picture must not add samples.
        r->settings.spp = (uint32_t)run->before.done;
    }
    run->saved_done = run->before.done;
    run->start = run->saved_at = time_now();
    return true;
}

double progressive_run_rays(const progressive_run *run)
{
    return run->now.rays - run->before.rays;
}

const char *progressive_run_unit(const renderer *r, uint64_t count)
{
    const bool is_path = r->settings.method == METHOD_PATH;
    return count == 1 ? (is_path ? "sample" : "VPL slot") : (is_path ? "samples" : "VPL slots");
}

// ---- The state

static void state_save(progressive_run *run, renderer *r)
{
    if (!run->state || run->save_failed || run->saved_done == run->now.done) {
        return;
    }
    const double start = time_now();
    run->save_failed = !progressive_save(r, run->state, run->identity);
    run->saved_at = time_now();
    run->save_seconds = run->saved_at - start;
    run->saved_done = run->now.done;
}

static bool save_is_due(const progressive_run *run)
{
    return time_now() - run->saved_at > fmax(save_interval_s, run->save_seconds / save_time_part);
}

// ---- The terminal

// How many samples there will be: the error falls as 1 / sqrt(N), so --until may need fewer than there are.
static double done_expected(const progressive_status *status, double until)
{
    const double total = (double)status->total;
    if (!(until > 0 && status->error > 0)) { // also where the error is not known
        return total;
    }
    const double ratio = status->error / until;
    return fmin(total, (double)status->done * ratio * ratio);
}

static void progress_print(const progressive_run *run, const renderer *r)
{
    const progressive_status *const now = &run->now;
    const double expected = done_expected(now, (double)r->settings.until);
    const uint64_t here = now->done - run->before.done;
    char error[32] = "", left[32] = "";
    if (!isnan(now->error)) {
        snprintf(error, sizeof(error), "  error %.2g %%", 100 * now->error);
    }
    if (here > 0) {
        const double seconds = (time_now() - run->start) / (double)here * fmax(0, expected - (double)now->done);
        time_left_print(seconds, left);
    }
    progress_show("%llu/%llu %s  %.0f %%%s%s", (unsigned long long)now->done, (unsigned long long)now->total,
                  progressive_run_unit(r, now->total),
                  expected > 0 ? fmin(100, 100 * (double)now->done / expected) : 100, error, left);
}

// ---- Frames

void progressive_run_step(progressive_run *run, renderer *r)
{
    run->now = progressive_status_get(r, true);
    r->settings.spp = run->spp;
    progress_print(run, r);
    if (save_is_due(run)) {
        state_save(run, r);
    }
}

void progressive_run_end(progressive_run *run, renderer *r)
{
    state_save(run, r);
}

void progressive_run_fini(progressive_run *run)
{
    free(run->identity);
    *run = (progressive_run){0};
}
