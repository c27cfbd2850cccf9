// The controller of automatic settings: models of time and error, their fit to what is measured, and the choice.
#include "automatic.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    TIME_TRANSIENT = 2, // frames after a change that allocate, compile and rebuild
    TIME_FRAMES = 4, // then measured, before a time is believed, and between looks at it
    ERROR_TRANSIENT = 8, // frames after a change until the filter's history is of the new settings
    ERROR_FRAMES_MIN = 8, // then measured at least, before an error is believed: bright spots are rare
    ERROR_FRAMES_MAX = 40, // and at most
    SETTLED_AGE = 16, // frames: as long as the filter's history
    PATIENT_CHANGES = 3, // each later one waits twice as long
};

// What a change must gain, and how far off the target calls for one.
static const double ms_high = 1.07, ms_low = 0.93, ms_aim = 0.98; // of target_ms
static const double error_high = 1.12, error_low = 1 / 1.15, error_aim = 0.98; // of target_error
static const double gain_needed = 0.9; // of the error, for a change while the time is met
static const double leap = 5; // octaves of VPLs, at most, in a change
static const double nearly = 1.2; // off the target by less: changes go a little way
static const double view_changed = 1.5; // off by so much after it was met: another view, start anew
static const double cost_step = 3; // towards an error, of the modelled time
static const double error_floor = 0.02; // a scene needs no less
static const double fit_decay = 0.97; // of what is known of the models' scales, a frame; 0.5 at a change

// ---- The choices

enum { VPL_CHOICES = 29, ALPHA_CHOICES = 17, INTERLEAVE_CHOICES = 3, RAY_CHOICES = 6 };
enum { CHOICES = VPL_CHOICES * ALPHA_CHOICES * INTERLEAVE_CHOICES * RAY_CHOICES };

// From 61 to 1,000,000 VPLs by factors of sqrt(2), alpha from 1 to 4 by the eighth root of 2, 1/4 to 8 rays a pixel.
static render_settings choice_of(const render_settings *base, uint32_t index)
{
    render_settings s = *base;
    s.vpls = (uint32_t)lround(1e6 * exp2(-0.5 * (index % VPL_CHOICES)));
    index /= VPL_CHOICES;
    s.alpha = (float)exp2(0.125 * (index % ALPHA_CHOICES));
    index /= ALPHA_CHOICES;
    s.interleave = 1u << index % INTERLEAVE_CHOICES;
    index /= INTERLEAVE_CHOICES;
    const double rays = exp2((double)index - 2);
    s.shadow_samples = (uint32_t)ceil(rays);
    s.ray_budget = rays < 1 && base->filter ? (float)rays : 0; // a budget goes by what the filter knows
    return s;
}

static bool choices_equal(const render_settings *a, const render_settings *b)
{
    return a->vpls == b->vpls && a->alpha == b->alpha && a->interleave == b->interleave &&
           a->shadow_samples == b->shadow_samples && a->ray_budget == b->ray_budget;
}

static double rays_of(const render_settings *s)
{
    return s->ray_budget > 0 ? fmin((double)s->ray_budget, s->shadow_samples) : s->shadow_samples;
}

// ---- Models. Milliseconds on two CPU cores, as measured in atrium and Sponza, 1,000 to 1,000,000 VPLs, alpha 1 to 4,
// all interleavings, 1/4 to 8 rays; only ratios matter where times are measured.

// Lights at a pixel: so many of each level (Lin and Yuksel 2019, section 4), but no more than there are, and those that
// are too few to share out among tiles. 4x4 tiles have a sixteenth, each at half as much again.
static double model_lights(const render_settings *s)
{
    const double reached = 12 * pow((double)s->alpha, 1.9) * log2(2 + 0.125 * s->vpls), all = 0.5 * s->vpls;
    const double tiles = s->interleave, lights = reached * all / (reached + all);
    return lights * pow(tiles, -1.75) + (tiles > 1 ? 10 : 0);
}

static double model_milliseconds(const render_settings *s, automatic_group group)
{
    const double megapixels = 1e-6 * s->width * s->height, tiles = s->interleave;
    switch (group) {
    case AUTOMATIC_VPLS:
        return 20 + 6e-4 * s->vpls;
    case AUTOMATIC_LISTS:
        return 0.3 + 2.2e-4 * s->vpls + 20 * megapixels;
    case AUTOMATIC_LIGHTING: // which has VPLs one by one, too
        return megapixels * (200 + 7e-4 * s->vpls + 6.3 * (1 + 0.05 * s->shadow_samples) * model_lights(s));
    case AUTOMATIC_TILES:
        return tiles > 1 ? megapixels * (30 + 15 * tiles) : 0;
    case AUTOMATIC_SHADOWS: // a budget has to be shared out
        return megapixels * (60 + 145 * rays_of(s) + (s->ray_budget > 0 ? 90 : 0));
    case AUTOMATIC_FIXED:
    case AUTOMATIC_GROUPS:
        return 500 * megapixels;
    }
    return 0;
}

static double model_cost(const render_settings *s)
{
    double sum = 0;
    for (automatic_group group = 0; group < AUTOMATIC_GROUPS; group++)
        sum += model_milliseconds(s, group);
    return sum;
}

// Squares of relative errors.
static double model_error(const render_settings *s, automatic_part part)
{
    const double alpha = (double)s->alpha;
    switch (part) {
    case AUTOMATIC_HIERARCHY:
        // In small pictures 4x4 tiles, filtered across edges, take several times the error of none.
        return 0.01 / (alpha * alpha * sqrt(alpha)) * (1 + 0.15 * (s->interleave * s->interleave - 1));
    case AUTOMATIC_SHADOW_RATIO:
        // Measured against path tracing, 128x72, indirect light, cornell and atrium: alpha 2 takes 0.35 and 0.66 of it,
        // four rays 0.92 and 0.86, as most is bias; 2x2 tiles add 0.16 (alpha 4: 0.3) and 0.6 of it.
        return 0.01 * ((0.8 + 0.2 / rays_of(s)) / alpha + 0.1 * (s->interleave * s->interleave - 1));
    case AUTOMATIC_VPL_SET:
    case AUTOMATIC_PARTS:
        return 10.0 / fmax(1, s->vpls);
    }
    return 0;
}

// ---- Probes

void automatic_probes_add(automatic_probes *sum, const automatic_probes *more)
{
    sum->count += more->count;
    sum->hierarchy += more->hierarchy;
    sum->unshadowed += more->unshadowed;
    sum->shadows += more->shadows;
    sum->vpls += more->vpls;
    sum->light += more->light;
    sum->error_error += more->error_error;
    sum->error_light += more->error_light;
    sum->light_light += more->light_light;
}

double automatic_probes_error(const automatic_probes *sum, double *standard_error)
{
    if (standard_error)
        *standard_error = INFINITY;
    if (!(sum->light > 0))
        return NAN;
    const double square = (sum->shadows + sum->vpls) / sum->light, error = sqrt(fmax(0, square));
    // Of a ratio of sums, to first order: the spread of e - square * l; then of its root.
    const double spread = sum->error_error - 2 * square * sum->error_light + square * square * sum->light_light;
    if (standard_error && error > 0)
        *standard_error = sqrt(fmax(0, spread)) / sum->light / (2 * error);
    return error;
}

automatic_group automatic_group_of(const char *pass)
{
    static const struct {
        const char *name;
        automatic_group group;
    } names[] = {
        {"vpl_trace", AUTOMATIC_VPLS},
        {"lgh_build", AUTOMATIC_VPLS},
        {"light_volume", AUTOMATIC_LIGHTING},
        {"light_gather/gather", AUTOMATIC_LIGHTING},
        {"light_gather", AUTOMATIC_LISTS},
        {"interleave", AUTOMATIC_TILES},
        {"shadow", AUTOMATIC_SHADOWS},
    };
    for (size_t i = 0; i < countof(names); i++) {
        const size_t length = strlen(names[i].name);
        if (strncmp(names[i].name, pass, length) == 0 && (pass[length] == '\0' || pass[length] == '/'))
            return names[i].group;
    }
    return AUTOMATIC_FIXED;
}

// ---- Measured times

static uint32_t window_length(const automatic *a)
{
    return a->age <= TIME_TRANSIENT ? 0 : min_u32(a->age - TIME_TRANSIENT, AUTOMATIC_WINDOW);
}

static void sort(const double *values, uint32_t count, double sorted[AUTOMATIC_WINDOW])
{
    for (uint32_t i = 0; i < count; i++) {
        uint32_t place = i;
        for (; place > 0 && sorted[place - 1] > values[i]; place--)
            sorted[place] = sorted[place - 1];
        sorted[place] = values[i];
    }
}

static double median(const double *values, uint32_t count)
{
    double sorted[AUTOMATIC_WINDOW];
    sort(values, count, sorted);
    return count == 0 ? 0 : 0.5 * (sorted[(count - 1) / 2] + sorted[count / 2]);
}

// Of the frames in the window; returns how many.
static uint32_t frame_times(const automatic *a, double times[AUTOMATIC_WINDOW])
{
    const uint32_t length = window_length(a);
    for (uint32_t i = 0; i < length; i++) {
        times[i] = 0;
        for (automatic_group group = 0; group < AUTOMATIC_GROUPS; group++)
            times[i] += a->window[group][i];
    }
    return length;
}

double automatic_milliseconds(const automatic *a)
{
    double times[AUTOMATIC_WINDOW];
    const uint32_t length = frame_times(a, times);
    return median(times, length);
}

// Standard error of that median, as for normal times, by the middle half of the window: a few slow frames do not count.
static double milliseconds_error(const automatic *a)
{
    double times[AUTOMATIC_WINDOW], sorted[AUTOMATIC_WINDOW];
    const uint32_t length = frame_times(a, times);
    if (length < TIME_FRAMES)
        return INFINITY;
    sort(times, length, sorted);
    const double deviation = (sorted[length - 1 - length / 4] - sorted[length / 4]) / 1.35;
    return 1.25 * deviation / sqrt(length);
}

// Where nothing moves, VPLs are traced and built after changes only, and the median frame tells nothing of it.
static void vpl_time_add(automatic *a, double milliseconds)
{
    const double model = model_milliseconds(&a->current, AUTOMATIC_VPLS), scale = milliseconds / model;
    if (a->age == 1)
        a->vpl_scale = scale;
    else if (scale > 0.2 * a->vpl_scale) // they were traced again, without what the first time takes
        a->vpl_scale = fmin(a->vpl_scale, scale);
}

static void times_add(automatic *a, const automatic_frame *frame)
{
    vpl_time_add(a, frame->milliseconds[AUTOMATIC_VPLS]);
    if (a->age <= TIME_TRANSIENT)
        return;
    for (automatic_group group = 0; group < AUTOMATIC_GROUPS; group++)
        a->window[group][(a->age - TIME_TRANSIENT - 1) % AUTOMATIC_WINDOW] = frame->milliseconds[group];
    for (automatic_group group = 0; group < AUTOMATIC_GROUPS; group++) {
        const double model = model_milliseconds(&a->current, group);
        if (model > 0)
            a->time_scales[group] = median(a->window[group], window_length(a)) / model;
    }
}

double automatic_predict_milliseconds(const automatic *a, const render_settings *settings)
{
    double sum = 0;
    for (automatic_group group = 0; group < AUTOMATIC_GROUPS; group++) {
        // A group that has not run yet is as far off the model as the lighting.
        const double scale = group == AUTOMATIC_TILES && a->time_scales[group] == 0 ? a->time_scales[AUTOMATIC_LIGHTING]
                                                                                    : a->time_scales[group];
        sum += scale * model_milliseconds(settings, group);
    }
    return sum;
}

// ---- Measured errors

static void fit_scale(automatic *a, double factor)
{
    for (automatic_part part = 0; part < AUTOMATIC_PARTS; part++) {
        a->error_sums[part] *= factor;
        a->model_sums[part] *= factor;
    }
}

static void errors_add(automatic *a, const automatic_probes *probes)
{
    if (a->age <= (a->target_ms > 0 ? TIME_TRANSIENT : ERROR_TRANSIENT))
        return;
    automatic_probes_add(&a->probes, probes);
    fit_scale(a, fit_decay);
    // Both relative to the light that reaches the pixels. The hierarchy's part is measured without shadows, and taken
    // to be the same with them; so much of the rest is not the shadows'.
    const double hierarchy = probes->unshadowed > 0 ? probes->hierarchy / probes->unshadowed * probes->light : 0;
    const double measured[AUTOMATIC_PARTS] = {
        [AUTOMATIC_HIERARCHY] = hierarchy,
        [AUTOMATIC_SHADOW_RATIO] = probes->shadows - hierarchy,
        [AUTOMATIC_VPL_SET] = probes->vpls,
    };
    for (automatic_part part = 0; part < AUTOMATIC_PARTS; part++) {
        a->error_sums[part] += measured[part];
        a->model_sums[part] += probes->light * model_error(&a->current, part);
    }
}

// A hundredth of the model stays: noise must not make a part vanish or negative.
static double error_scale(const automatic *a, automatic_part part)
{
    return a->model_sums[part] > 0 ? fmax(0.01, a->error_sums[part] / a->model_sums[part]) : 1;
}

static double predict_error(const automatic *a, const render_settings *settings, double parts[AUTOMATIC_PARTS])
{
    double sum = 0;
    for (automatic_part part = 0; part < AUTOMATIC_PARTS; part++) {
        const double square = error_scale(a, part) * model_error(settings, part);
        sum += square;
        if (parts)
            parts[part] = sqrt(square);
    }
    return sqrt(sum);
}

double automatic_predict_error(const automatic *a, const render_settings *settings)
{
    return predict_error(a, settings, NULL);
}

double automatic_error(const automatic *a, double parts[AUTOMATIC_PARTS])
{
    return predict_error(a, &a->current, parts);
}

// ---- The choice

// What a choice is judged by: less than the floor is no gain.
static double predict_score(const automatic *a, const render_settings *s)
{
    return fmax(error_floor, automatic_predict_error(a, s));
}

// A frame in which all VPLs are traced and built stays near the target, so that a light that moves after a while does
// not stall a still picture for seconds. A thousand never do.
static bool traces_in_time(const automatic *a, const render_settings *s)
{
    return s->vpls <= 1000 || a->vpl_scale * model_milliseconds(s, AUTOMATIC_VPLS) <= a->target_ms;
}

// `s` asks for no more than `other` in any respect.
static bool is_at_most(const render_settings *s, const render_settings *other)
{
    return s->vpls <= other->vpls && s->alpha <= other->alpha && s->interleave >= other->interleave &&
           rays_of(s) <= rays_of(other);
}

// What may follow the current settings. Not VPLs by orders of magnitude more or fewer: what they cost in a scene shows
// once there are more. Back to the target after a change it only takes, or only gives: what it would trade, the models do
// not know well enough. And where the time is nearly right it goes only a little way: they are fitted there, and what they
// say of settings far away is not worth the frames that it takes to find out.
static bool is_near(const automatic *a, const render_settings *s)
{
    const double ms = automatic_milliseconds(a), octaves = fabs(log2((double)s->vpls / a->current.vpls));
    if (octaves > leap)
        return false;
    if (a->changes == 0)
        return true;
    if ((ms > ms_high * a->target_ms && !is_at_most(s, &a->current)) ||
        (ms < ms_low * a->target_ms && !is_at_most(&a->current, s)))
        return false;
    const bool far = ms > nearly * a->target_ms || ms * nearly < a->target_ms;
    return far || (octaves <= 2.1 && fabs(log2((double)(s->alpha / a->current.alpha))) <= 0.6);
}

// What the fastest choice takes.
static double milliseconds_least(const automatic *a)
{
    double least = INFINITY;
    for (uint32_t i = 0; i < CHOICES; i++) {
        const render_settings s = choice_of(&a->current, i);
        if (is_near(a, &s))
            least = fmin(least, automatic_predict_milliseconds(a, &s));
    }
    return least;
}

// The smallest error within `most` milliseconds; of equal errors, also those below the floor, the cheapest choice.
// False where there is none.
static bool plan_within(const automatic *a, double most, render_settings *best)
{
    double best_score = INFINITY;
    for (uint32_t i = 0; i < CHOICES; i++) {
        const render_settings s = choice_of(&a->current, i);
        double score = predict_score(a, &s);
        if (score > best_score || !is_near(a, &s) || !traces_in_time(a, &s) ||
            automatic_predict_milliseconds(a, &s) > most)
            continue;
        score *= 1 + 1e-3 * log(model_cost(&s));
        if (score < best_score) {
            best_score = score;
            *best = s;
        }
    }
    return isfinite(best_score);
}

// Where nothing is fast enough, within little more than the least time, but not off the target for that.
static render_settings plan_for_time(const automatic *a)
{
    render_settings best = a->current;
    if (plan_within(a, ms_aim * a->target_ms, &best))
        return best;
    const double least = milliseconds_least(a), most = ms_high * a->target_ms;
    plan_within(a, least < most ? most : 1.1 * least, &best);
    return best;
}

// Nothing that asks for no more than what was too little, nothing as dear as what was enough; and VPLs by no more than
// a factor of 8 at a time: their noise is hard to measure where it is small, and 61 instead of 100,000 had an error of
// 0.7. Nor all at once what costs many times as much: the first estimates are noisy, the models crude, and a trial of
// the dearest settings takes as long as all others together.
// What was too little only gives, and what was more than enough only takes: the models do not know well what trades
// bring.
static bool is_candidate(const automatic *a, const render_settings *s, bool more)
{
    if (more ? !is_at_most(&a->current, s) : !is_at_most(s, &a->current))
        return false;
    if (8 * s->vpls < a->current.vpls || s->vpls > 8 * a->current.vpls ||
        model_cost(s) > cost_step * model_cost(&a->current))
        return false;
    for (uint32_t i = 0; i < a->trial_count; i++) {
        const automatic_trial *trial = &a->trials[i];
        if (trial->enough ? model_cost(s) > 0.9 * model_cost(&trial->settings) : is_at_most(s, &trial->settings))
            return false;
    }
    return true;
}

// The cheapest trial that was enough; NULL where none was.
static const automatic_trial *cheapest_enough(const automatic *a)
{
    const automatic_trial *best = NULL;
    for (uint32_t i = 0; i < a->trial_count; i++) {
        const automatic_trial *trial = &a->trials[i];
        if (trial->enough && (!best || model_cost(&trial->settings) < model_cost(&best->settings)))
            best = trial;
    }
    return best;
}

// The cheapest candidate that reaches the error, and asks for `more` or for less than the current settings. Where there
// is none, what was enough, or else the least error.
static render_settings plan_for_error(const automatic *a, bool more)
{
    const automatic_trial *enough = cheapest_enough(a);
    render_settings best = enough ? enough->settings : a->current;
    double best_score = INFINITY;
    for (uint32_t i = 0; i < CHOICES && a->trial_count < AUTOMATIC_TRIALS; i++) {
        const render_settings s = choice_of(&a->current, i);
        if (!is_candidate(a, &s, more))
            continue;
        const double error = automatic_predict_error(a, &s);
        const bool reaches = error <= error_aim * a->target_error;
        const double score = reaches ? model_cost(&s) : 1e9 * error;
        if (score < best_score && (reaches || !enough)) {
            best_score = score;
            best = s;
        }
    }
    return best;
}

// ---- Words

static const char *error_words(const automatic *a, const render_settings *s, char text[96])
{
    double parts[AUTOMATIC_PARTS];
    const double error = predict_error(a, s, parts);
    snprintf(text, 96, "error %.3f (hierarchy %.3f, shadows %.3f, VPLs %.3f)", error, parts[AUTOMATIC_HIERARCHY],
             parts[AUTOMATIC_SHADOW_RATIO], parts[AUTOMATIC_VPL_SET]);
    return text;
}

static void change(automatic *a, const render_settings *next, const char *why)
{
    char expected[96];
    snprintf(a->reason, sizeof a->reason,
             "automatic: frame %u: %u VPLs, alpha %.3g, interleave %u, %.3g rays a pixel, because %s; expected %s",
             a->frame, next->vpls, (double)next->alpha, next->interleave, rays_of(next), why,
             error_words(a, next, expected));
    if (a->target_ms > 0) {
        const size_t length = strlen(a->reason);
        snprintf(a->reason + length, sizeof a->reason - length, ", %.0f ms", automatic_predict_milliseconds(a, next));
    }
    a->current = *next;
    a->age = 0;
    a->changes++;
    a->met = a->settled = false;
    a->probes = (automatic_probes){0};
    fit_scale(a, 0.5);
}

// ---- Steps

// Frames to wait after a change: enough to measure, and more after each, so that changes come to an end.
static double patience(const automatic *a, double frames)
{
    return frames * pow(2, a->changes > PATIENT_CHANGES ? a->changes - PATIENT_CHANGES : 0);
}

static bool is_worth_it(const automatic *a, const render_settings *next, double ms)
{
    const double gain = predict_score(a, next) / predict_score(a, &a->current);
    if (ms > ms_high * a->target_ms)
        return automatic_predict_milliseconds(a, next) < 0.95 * ms;
    if (ms < ms_low * a->target_ms)
        return gain < 0.999 || (gain <= 1 && model_cost(next) < 0.7 * model_cost(&a->current));
    return gain < gain_needed && automatic_predict_milliseconds(a, next) <= ms_high * a->target_ms;
}

// Frames that a time needs to call for a change: few where it is far off or nothing was chosen yet, else a whole
// window.
static uint32_t frames_needed(const automatic *a, double ms)
{
    const bool far = ms > 1.2 * a->target_ms || ms < 0.8 * a->target_ms;
    const bool met = ms <= ms_high * a->target_ms && ms >= ms_low * a->target_ms;
    const uint32_t frames = far || a->changes == 0 ? TIME_FRAMES : AUTOMATIC_WINDOW;
    return TIME_TRANSIENT + (met && a->changes > 0 ? SETTLED_AGE : frames);
}

// Patience is for changes that miss the target, to this side and that. Where the last one met it and the time surely
// left it since, or did not go far enough, what is seen changes, as along a camera's way: that is followed.
static void drift_follow(automatic *a)
{
    const double ms = automatic_milliseconds(a), target = a->target_ms, noise = 2 * milliseconds_error(a);
    if (window_length(a) < TIME_FRAMES)
        return;
    if (ms <= ms_high * target && ms >= ms_low * target)
        a->met = true;
    const bool slow = ms - noise > ms_high * target, fast = ms + noise < ms_low * target;
    if ((slow && (a->met || a->aim < 0)) || (fast && (a->met || a->aim > 0)))
        a->changes = min_u32(a->changes, PATIENT_CHANGES);
    if (a->settled && (ms > view_changed * target || ms * view_changed < target))
        a->changes = 0;
}

static bool step_for_time(automatic *a)
{
    drift_follow(a);
    const double ms = automatic_milliseconds(a), target = a->target_ms;
    a->settled = a->age >= SETTLED_AGE;
    if (a->age < patience(a, frames_needed(a, ms)) || a->age % 2 == 1)
        return false;
    const render_settings next = plan_for_time(a);
    if (!is_worth_it(a, &next, ms) || choices_equal(&next, &a->current))
        return false;
    a->aim = ms > ms_high * target ? -1 : ms < ms_low * target ? 1 : 0;
    char why[96];
    if (a->aim != 0)
        snprintf(why, sizeof why, "%.0f ms are %s than %g", ms, ms > target ? "more" : "less", target);
    else
        snprintf(why, sizeof why, "the same time has less error than %.3f", automatic_error(a, NULL));
    change(a, &next, why);
    return true;
}

// Whether the error measured with the current settings is known well enough to judge them: as precisely as errors
// differ that are met and not met, or surely too high or too low.
static bool error_is_known(const automatic *a, double error, double standard_error)
{
    if (a->age >= ERROR_TRANSIENT + ERROR_FRAMES_MAX)
        return true;
    return a->age >= ERROR_TRANSIENT + ERROR_FRAMES_MIN &&
           (standard_error < 0.05 * error || error - 2.5 * standard_error > error_high * a->target_error ||
            error + 2.5 * standard_error < error_low * a->target_error);
}

static bool step_for_error(automatic *a)
{
    double standard_error;
    const double error = automatic_probes_error(&a->probes, &standard_error), target = a->target_error;
    if (a->returned)
        a->settled = a->age >= SETTLED_AGE;
    if (a->settled || a->returned || isnan(error) || !error_is_known(a, error, standard_error))
        return false;
    const bool high = error > error_high * target, low = error < error_low * target;
    if (a->trial_count < AUTOMATIC_TRIALS)
        a->trials[a->trial_count++] = (automatic_trial){a->current, a->probes, !high};
    const render_settings next = plan_for_error(a, high);
    a->settled = (!high && !low) || choices_equal(&next, &a->current);
    if (a->settled)
        return false;
    const automatic_trial *enough = cheapest_enough(a);
    a->returned = enough && choices_equal(&next, &enough->settings);
    char why[96];
    snprintf(why, sizeof why, "an error of %.3f +- %.3f is %s than %g", error, standard_error, high ? "more" : "less",
             target);
    change(a, &next, why);
    if (a->returned)
        a->probes = enough->probes; // what is known of these settings already
    return true;
}

bool automatic_step(automatic *a, const automatic_frame *frame, render_settings *settings)
{
    a->frame++;
    a->age++;
    times_add(a, frame);
    errors_add(a, &frame->probes);
    if (frame->probes.light == 0 && a->probes.light == 0) { // no indirect light: there is nothing to choose
        a->settled = a->age >= SETTLED_AGE;
        return false;
    }
    if (!(a->target_ms > 0 ? step_for_time(a) : step_for_error(a)))
        return false;
    *settings = a->current;
    return true;
}

void automatic_start(automatic *a, const render_settings *settings)
{
    *a = (automatic){
        .target_ms = (double)settings->target_ms,
        .target_error = (double)settings->target_error,
        .current = *settings,
    };
}

const char *automatic_refusal(const render_settings *s)
{
    if (s->target_ms > 0 && s->target_error > 0)
        return "--target-ms and --target-error: expected one of them";
    if (s->target_ms == 0 && s->target_error == 0)
        return NULL;
    if (s->method != METHOD_LGH)
        return s->target_ms > 0 ? "--target-ms: only --method lgh has settings to choose"
                                : "--target-error: only --method lgh has settings to choose";
    if (s->only == ONLY_DIRECT || s->only == ONLY_INDIRECT_UNSHADOWED || s->shadow_samples == 0 || s->vpls == 0)
        return "--target-ms, --target-error: expected indirect light with shadows, whose settings they choose";
    return NULL;
}
