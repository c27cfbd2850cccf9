// Automatic settings: chooses the number of VPLs, alpha, interleaving and the shadow rays of the lighting grid
// hierarchy from what frames cost and how far probe pixels (probe.h) are from the truth. The number of levels follows
// the number of VPLs. A controller alone: no GPU, no clock; modules/automatic_system.c feeds it.
//
//     automatic a;
//     automatic_start(&a, &settings); // settings.target_ms or settings.target_error is set
//     for each frame:
//         render with `settings`, measure `frame`
//         if (automatic_step(&a, &frame, &settings)) log_info("%s", a.reason);
//
// Errors are relative L2 errors of the indirect light's radiance, against an endless number of VPLs with a shadow ray
// to each. The error's square has three parts, each measured, and each with a model of how it depends on the settings:
//
//   hierarchy   grid lights in place of VPLs: (L - U)^2, L the hierarchy's unshadowed sum, U that over all VPLs
//   shadows     the rest of the picture's distance from the shadowed sum over all VPLs: noise and bias of the ratio
//   vpls        the VPLs are a sample: part of the squared difference between the sums of two halves (probe.c)
//
// The models are crude; their scales are fitted to what is measured with the settings in use, so that a choice made
// from them is corrected by the next measurement. It changes nothing while the target is met but for a clear gain,
// never before the frames since the last change tell enough, and waits longer after each change: so it cannot
// oscillate. But a time that was met and then left, as along a camera's way, is followed without that wait. A picture
// at rest, which leaves passes out, is not measured. With a target error nothing depends on time: the same scene takes
// the same way.
#pragma once

#include "settings.h"

// Sums over a frame's probes, each over the colour channels.
typedef struct automatic_probes {
    uint32_t count;
    double hierarchy, unshadowed; // (L - U)^2, U^2
    double shadows, vpls; // see above; products of two independent estimates, so that single ones may be negative
    double light; // the square of the shadowed sum
    // For the standard error of (shadows + vpls) / light: its sums of squares and products over the probes.
    double error_error, error_light, light_light;
} automatic_probes;
void automatic_probes_add(automatic_probes *sum, const automatic_probes *more);
// sqrt((shadows + vpls) / light), 0 where noise makes it negative, NAN without light. `standard_error` may be NULL.
double automatic_probes_error(const automatic_probes *sum, double *standard_error);

typedef enum automatic_group { // passes by what their time grows with
    AUTOMATIC_VPLS, // VPLs: tracing, building
    AUTOMATIC_LISTS, // VPLs too, in every frame: packing lights, listing them by cell
    AUTOMATIC_LIGHTING, // grid lights at a pixel
    AUTOMATIC_TILES, // what interleaving alone needs
    AUTOMATIC_SHADOWS, // shadow rays
    AUTOMATIC_FIXED, // none of it; what no pass accounts for too
    AUTOMATIC_GROUPS,
} automatic_group;

typedef struct automatic_frame {
    double milliseconds[AUTOMATIC_GROUPS]; // their sum is the frame's time
    automatic_probes probes;
} automatic_frame;
automatic_group automatic_group_of(const char *pass); // by the parts of the name before a '/'

enum { AUTOMATIC_WINDOW = 9 }; // frames whose median counts

typedef enum automatic_part {
    AUTOMATIC_HIERARCHY,
    AUTOMATIC_SHADOW_RATIO,
    AUTOMATIC_VPL_SET,
    AUTOMATIC_PARTS
} automatic_part;

enum { AUTOMATIC_TRIALS = 12 };
typedef struct automatic_trial { // settings that were judged
    render_settings settings;
    automatic_probes probes; // what they were judged by
    bool enough; // they reach the target error
} automatic_trial;

typedef struct automatic {
    double target_ms, target_error; // one of them is 0
    render_settings current; // that the next frame is measured with
    uint32_t frame; // steps so far
    uint32_t age; // frames measured since the last change
    uint32_t changes; // since the start, or since the view changed
    bool met; // target_ms: at some time since the last change
    int aim; // target_ms: of the last change: 1: at longer frames, -1: at shorter ones, 0: at less error
    bool settled; // the target is met, or cannot be met better, and long enough since
    double window[AUTOMATIC_GROUPS][AUTOMATIC_WINDOW]; // ring by age
    double time_scales[AUTOMATIC_GROUPS]; // measured over model; 0: not measured yet
    double vpl_scale; // of AUTOMATIC_VPLS in frames in which they were traced, after the last change
    double error_sums[AUTOMATIC_PARTS], model_sums[AUTOMATIC_PARTS]; // measured and modelled squares, decaying
    automatic_probes probes; // since the last change and its transient
    automatic_trial trials[AUTOMATIC_TRIALS]; // target_error
    uint32_t trial_count;
    bool returned; // target_error: to a trial that was enough, after others that were not; nothing more is tried
    char reason[320]; // one line: what was chosen and why
} automatic;

// NULL, or what stands against automatic settings: a line "--target-ms: ...".
const char *automatic_refusal(const render_settings *settings);
void automatic_start(automatic *a, const render_settings *settings);
// After a frame with a->current: true when `settings` (and a->current) are changed for the next one.
bool automatic_step(automatic *a, const automatic_frame *frame, render_settings *settings);
// Estimated relative error with the current settings, all that is known taken together.
double automatic_error(const automatic *a, double parts[AUTOMATIC_PARTS]); // `parts` may be NULL
double automatic_milliseconds(const automatic *a); // median with the current settings; 0: not known yet
// Estimates of `settings` from the models as fitted.
double automatic_predict_milliseconds(const automatic *a, const render_settings *settings);
double automatic_predict_error(const automatic *a, const render_settings *settings);
