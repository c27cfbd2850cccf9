// What the files of the `lanternfield` command share. The command is a thin user of modules/renderer.h.
#pragma once

#include "modules/progressive.h"

#include <stdio.h>

// Exit codes. Wrong usage is a command line that cannot be understood; a value that is understood and cannot be used is
// a failure.
enum { EXIT_DONE = 0, EXIT_FAILED = 1, EXIT_WRONG_USAGE = 2, EXIT_INTERRUPTED = 130 };

// ---- What `lanternfield render` is asked for: lanternfield_options.c.
enum { OUTPUTS_MAX = 8, AOVS_MAX = 16 };

struct aov_info;
typedef struct aov_request {
    const struct aov_info *aov;
    const char *path;
} aov_request;

typedef struct render_request { // strings belong to argv
    const char *scene;
    render_settings settings;
    const char *outputs[OUTPUTS_MAX]; // .png or .exr
    uint32_t output_count;
    aov_request aovs[AOVS_MAX];
    uint32_t aov_count;
    const char *camera; // NULL: the scene's first, or one that frames the scene
    bool has_eye, has_target, has_fov, has_sun;
    float eye[3], target[3]; // world, metres
    float fov; // degrees, vertical
    float sun[4]; // direction in which the light travels, lux
    const char *animation; // name, or "all"; NULL: at rest
    bool has_time;
    float time; // seconds
    const char *stats, *dump_graph, *device; // NULL: not asked for
    const char *state; // file that keeps a progressive picture; NULL: none
    bool validate;
    bool help;
} render_request;

// Reads the arguments behind "render". Returns EXIT_DONE, or the exit code of an error that it has logged.
int render_options_read(int argc, char **argv, render_request *request);
void render_help_print(FILE *out);
bool render_request_fits(const render_request *request); // the method can do what is asked for; else logged

// ---- Options by tables: lanternfield_words.c. A command with more to be asked for has a render_request first in its
// own.
typedef struct command_option {
    const char *name; // without dashes; one letter: one dash
    const char *value_name; // NULL: takes no value
    const char *help;
    // `value` is NULL for those without. False: `error` says what was expected.
    bool (*read)(render_request *request, const char *value, setting_error *error);
} command_option;
typedef struct option_group {
    const char *title;
    const command_option *options;
    size_t count;
} option_group;
enum { OPTION_GROUPS_MAX = 3 };
typedef struct command_syntax {
    const char *command; // "render"
    option_group groups[OPTION_GROUPS_MAX];
    bool (*setting_read)(render_request *request, const setting_info *info, const char *value, setting_error *error);
    bool (*word_read)(render_request *request, const char *word); // one that is no option; false: logged
    const char *(*setting_refusal)(
        const setting_info *info); // why it has no use here, NULL: it has; may be NULL itself
} command_syntax;
extern const option_group device_option_group; // of render: --device, --validate
// Returns EXIT_DONE, or the exit code of an error that it has logged. Ends at --help, which it notes in the request.
int command_line_read(const command_syntax *syntax, int argc, char **argv, render_request *request);
void options_help_print(FILE *out, const command_syntax *syntax); // the groups, and all settings
// Makes the message of `error`: "--fov: expected ..., got ...". Returns false.
bool option_refuse(setting_error *error, const char *option, const char *expected, const char *value);
bool path_has_extension(const char *path, const char *extension); // ".png", without regard to case

// ---- The rendering: lanternfield_render.c.
int render_run(const render_request *request); // returns the exit code
bool output_path_check(const char *path); // before any work: false, and logged, when the file cannot be written

// A scene on a device, seen as a request asks (scene, camera, eye, target, fov, sun, device, validate; its settings).
typedef struct render_session {
    scene_data *scene;
    gpu *gpu;
    renderer *renderer;
} render_session;
bool render_session_open(render_session *session,
                         const render_request *request); // false: logged; close it all the same
// The same without a renderer and without what a request says of camera and sun.
bool render_session_prepare(render_session *session, const render_request *request);
void render_session_close(render_session *session);
// False, and logged, when the request asks for the validation layer and it reported anything.
bool render_session_validated(const render_session *session, const render_request *request);
void darkness_warn(const renderer *r); // after a frame: when there is nothing to see in it
// Text that names all that a picture depends on: the scene by hashes of what was loaded, camera, sun, size, and those
// settings that the method reads; for the progressive methods without what only says how long they go on. One line
// "key value" each. Equal text, equal picture (or sums), but for rounding where another tracer is asked for. free() it.
// lanternfield_identity.c.
char *render_identity(const render_session *session, const render_request *request);
void scene_identity_print(FILE *out, const scene_data *scene); // its part about the scene

// ---- Progressive methods, frame by frame, with their state in a file: lanternfield_progressive.c.
typedef struct progressive_run { // zero-initialise
    const char *state; // file, or NULL
    char *identity;
    double start, saved_at, save_seconds; // time_now(); what the last save took
    uint64_t saved_done;
    bool save_failed; // logged; no further save is tried
    uint32_t spp; // that were asked for
    progressive_status before, now; // before the first frame, after the last
} progressive_run;
// Before the first frame: goes on from the state file where there is one. False when it does not fit (logged).
bool progressive_run_begin(progressive_run *run, const render_session *session, const render_request *request);
// After each frame: sees how far the picture is, shows it, and saves the state from time to time.
void progressive_run_step(progressive_run *run, renderer *r);
// After the last frame: saves the state.
void progressive_run_end(progressive_run *run, renderer *r);
void progressive_run_fini(progressive_run *run);
double progressive_run_rays(const progressive_run *run); // traced by this run
const char *progressive_run_unit(const renderer *r, uint64_t count); // "samples", "VPL slot"

// ---- Ctrl-C and SIGTERM: noted, so that what is running can finish and be written; a second one ends the process.
void interrupt_watch(void);
bool interrupt_seen(void);

// ---- One line on the terminal that is rewritten, nothing in a pipe: lanternfield_progress.c.
void progress_begin(void); // from now on log lines do not run into the progress line
void progress_show(const char *format, ...) __attribute__((format(printf, 1, 2)));
void progress_end(void);
void time_left_print(double seconds, char text[32]); // "  12 s left"

// ---- Pictures: lanternfield_images.c.
const struct aov_info *aov_find(const char *name); // NULL when unknown
void aov_names_print(char *text, size_t size); // "albedo, normal, ..."
const char *aov_name(const struct aov_info *aov);
bool aov_counts_lights(const struct aov_info *aov); // needs renderer.count_lights
bool aov_is_made_by(const struct aov_info *aov, uint32_t method); // METHOD_*
// Asks the renderer to keep what the picture is made from.
void aov_export(renderer *r, const struct aov_info *aov);
// False when this configuration does not make it. Call after a frame.
bool aov_present(const renderer *r, const struct aov_info *aov);
// False on failure (logged).
bool aov_write(renderer *r, const struct aov_info *aov, const char *path);
bool picture_write(renderer *r, const char *path);
// Adds `name` to the renderer's exports unless it is there.
void export_add(renderer *r, const char *name);
// Mean of `lights_per_pixel` over the pixels that show something; negative when it is not known.
double lights_per_pixel_mean(renderer *r);

// ---- Timings and statistics: lanternfield_stats.c.
typedef struct time_series {
    const char *name;
    double *milliseconds; // one a frame in which it ran
    size_t count, capacity;
    double current; // of the frame being added
    bool seen;
} time_series;
typedef struct render_times { // zero-initialise
    time_series *steps; // by frame graph pass, in the order of execution
    size_t step_count, step_capacity;
    time_series *modules; // by the part of the name before '/'
    size_t module_count, module_capacity;
    time_series frames; // wall clock
    arena names;
} render_times;
// Adds the last frame, which took `milliseconds`.
void render_times_add(render_times *times, const renderer *r, double milliseconds);
double time_series_percentile(const time_series *series, double fraction); // interpolated; 0 when it is empty
void render_times_fini(render_times *times);

typedef struct render_summary {
    const char *scene, *device;
    uint32_t frames; // rendered
    bool counting_is_timed; // the only frame also counted lights
    const render_times *times;
    const progressive_run *progress; // NULL: the method is none of those
    double seconds; // of all frames
} render_summary;
void counters_export(renderer *r); // asks the renderer to keep what the next and lights_per_pixel_mean are made from
double rays_per_pixel(renderer *r); // of the last frame, all kinds
void stats_export(renderer *r); // asks the renderer to keep what the statistics are made from
bool stats_write(renderer *r, const render_summary *summary, const char *path);
