// `lanternfield play`: plays a script and writes its frames, or the movie of them.
#include "lanternfield_play.h"

#include <stdlib.h>
#include <string.h>

// ---- Options

static bool output_read(render_request *request, const char *value, setting_error *error)
{
    play_request *const play = (play_request *)request;
    const char **const which = movie_is(value) ? &play->movie : &play->folder;
    if (!*value || *which) {
        return option_refuse(error, "-o", *which ? "at most one folder and one movie" : "a folder or a movie", value);
    }
    *which = value;
    return true;
}

static bool outputs_read(render_request *request, const char *value, setting_error *error)
{
    ((play_request *)request)->outputs = value;
    return *value || option_refuse(error, "--outputs", "names separated by commas", value);
}

static bool range_read(render_request *request, const char *value, setting_error *error)
{
    play_request *const play = (play_request *)request;
    int length = 0;
    const bool is_range = strspn(value, "0123456789:") == strlen(value) &&
                          sscanf(value, "%9u:%9u%n", &play->begin, &play->end, &length) == 2 && !value[length];
    error->out_of_range = is_range;
    play->has_range = true;
    return (is_range && play->begin < play->end) ||
           option_refuse(error, "--range", "A:B with A < B: frames A, A + 1, ..., B - 1, the first is 0", value);
}

static bool resume_read(render_request *request, const char *value, setting_error *error)
{
    (void)value, (void)error;
    ((play_request *)request)->resume = true;
    return true;
}

static bool record_read(render_request *request, const char *value, setting_error *error)
{
    ((play_request *)request)->record = value;
    return path_has_extension(value, ".json") ||
           option_refuse(error, "--record", "a file name that ends in .json", value);
}

static bool stats_read(render_request *request, const char *value, setting_error *error)
{
    request->stats = value;
    return path_has_extension(value, ".csv") || option_refuse(error, "--stats", "a file name that ends in .csv", value);
}

static const command_option play_options[] = {
    {"o", "DIR|MOVIE",
     "a folder for the frames, or a movie (.mp4, .mkv, .mov; needs ffmpeg), or one of each\n"
     "                             (default: a folder by the script's name)",
     output_read},
    {"outputs", "LIST", "of each frame: png, exr, or parts of the picture, with commas (default: the script's)",
     outputs_read},
    {"range", "A:B", "frames A to B - 1, counted from 0 (default: all)", range_read},
    {"resume", NULL, "leave the frames that are there (default: off)", resume_read},
    {"record", "FILE.json", "write the script with what --target-ms or --target-error chose (default: none)",
     record_read},
    {"stats", "FILE.csv", "write a row a frame: times in ms, lights and rays per pixel (default: none)", stats_read},
};

static bool setting_read(render_request *request, const setting_info *info, const char *value, setting_error *error)
{
    play_request *const play = (play_request *)request;
    if (!settings_set(&request->settings, info, value, error)) {
        return false;
    }
    uint32_t at = 0; // the last one holds
    while (at < play->override_count && play->overrides[at].info != info) {
        at++;
    }
    assert(at < PLAY_OVERRIDES_MAX && "more than there are settings");
    play->overrides[at].info = info;
    play->overrides[at].text = value;
    play->override_count = max_u32(play->override_count, at + 1);
    return true;
}

// Targets may be given where they are recorded, which is not known yet.
static const char *setting_refusal(const setting_info *info)
{
    return strcmp(info->name, "frames") == 0 ? playback_setting_refusal(info, false) : NULL;
}

static bool script_read(render_request *request, const char *word)
{
    play_request *const play = (play_request *)request;
    const bool is_first = !play->script;
    if (!is_first) {
        log_error("one SCRIPT.json is enough: \"%s\" and \"%s\"; see lanternfield play --help", play->script, word);
    }
    play->script = word;
    return is_first;
}

static command_syntax play_syntax(void)
{
    return (command_syntax){
        .command = "play",
        .groups = {{"Files and frames", play_options, countof(play_options)}, device_option_group},
        .setting_read = setting_read,
        .word_read = script_read,
        .setting_refusal = setting_refusal,
    };
}

static void help_print(FILE *out)
{
    fputs("usage: lanternfield play SCRIPT.json [OPTION...]\n"
          "Renders the frames of a playback script; modules/playback.h and assets/playback tell how to write one.\n"
          "Render options given here stand above those of the script, its events included.\n",
          out);
    const command_syntax syntax = play_syntax();
    options_help_print(out, &syntax);
    char names[160];
    aov_names_print(names, sizeof(names));
    fprintf(
        out,
        "\nParts of the picture (--outputs): %s\n"
        "\nFrame n is at n / frame_rate seconds, and is written as frame_00000n.png (or .exr), albedo_00000n.exr,\n"
        "... A script gives the same bytes each time on one machine. --range and --resume give the bytes of the\n"
        "whole run: frames are rendered again from the last cut (or the first frame) on, but not written, so the\n"
        "first frame that is wanted costs as much as all between the cut and it; --method path, vpl and ir keep\n"
        "nothing over a frame and render only what is wanted. A cut makes the renderer anew, which costs about\n"
        "what loading the scene onto the device does.\n"
        "\nA file is there whole or not at all. A folder that holds frames of another script, scene or settings is\n"
        "refused. The frames of a movie are kept in MOVIE.frames until it is complete, and it is made from all of\n"
        "them at the end; a run that was killed goes on from them with --resume. --stats counts lights in every\n"
        "frame, which its times include.\n"
        "\n--target-ms and --target-error follow what is measured, so that two runs differ; they are refused without\n"
        "--record, which writes a script that gives the bytes of this run whenever it is played with the same other\n"
        "options. Ctrl-C ends after the frame, with what there is; a movie is then made of the frames so far. Exit "
        "codes: 0 done, 1 failed (also a value that cannot be\n"
        "used), 2 wrong usage, 130 interrupted.\n",
        names);
}

// What belongs together.
static bool options_check(const play_request *request)
{
    const render_settings *const settings = &request->render.settings;
    const char *const target = settings->target_ms > 0      ? "target-ms"
                               : settings->target_error > 0 ? "target-error"
                                                            : NULL;
    if (target && !request->record) {
        log_error("--%s: cannot be used to play: %s", target, playback_setting_refusal(settings_find(target), false));
        return false;
    }
    if (request->record && (!target || request->has_range || request->resume)) {
        log_error("--record: expected with --target-ms or --target-error, and without --range and --resume");
        return false;
    }
    return !request->record || output_path_check(request->record);
}

static int options_read(int argc, char **argv, play_request *request)
{
    *request = (play_request){.render = {.settings = render_settings_default()}};
    const command_syntax syntax = play_syntax();
    const int code = command_line_read(&syntax, argc, argv, &request->render);
    if (code == EXIT_DONE && !request->render.help && !request->script) {
        log_error("play needs a SCRIPT.json; see lanternfield play --help");
        return EXIT_WRONG_USAGE;
    }
    return code != EXIT_DONE || request->render.help || options_check(request) ? code : EXIT_FAILED;
}

// ---- One run

typedef struct play_run {
    play_request *request;
    playback *script;
    render_session session; // without a renderer, which the player has
    player *player;
    play_files files;
    play_stats stats;
    play_record record;
    uint32_t begin, end; // frames
    uint32_t written; // by this run
    uint32_t rendered;
    double start; // time_now() before the first frame
} play_run;

// What the script and the options say together.
static bool request_complete(play_run *run)
{
    play_request *const request = run->request;
    for (uint32_t i = 0; i < request->override_count; i++) {
        setting_error error;
        const bool ok = playback_override(run->script, request->overrides[i].info, request->overrides[i].text, &error);
        assert(ok && "read before");
        (void)ok;
    }
    request->render.scene = run->script->scene;
    request->render.settings = playback_settings_at(run->script, 0);
    run->begin = request->has_range ? request->begin : 0;
    run->end = request->has_range ? request->end : run->script->frame_count;
    if (run->end > run->script->frame_count) {
        log_error("--range %u:%u: expected at most %u, as \"%s\" has so many frames", run->begin, run->end,
                  run->script->frame_count, run->script->path);
        return false;
    }
    if (!play_files_init(&run->files, request, run->script)) {
        return false;
    }
    for (uint32_t i = 0; i < run->files.output_count; i++) {
        const struct aov_info *const aov = run->files.outputs[i].aov;
        if (aov) {
            request->render.aovs[request->render.aov_count++].aov = aov;
        }
    }
    return render_request_fits(&request->render);
}

// Called with every renderer that the player makes.
static void renderer_prepare(renderer *r, void *user)
{
    const render_request *const request = user;
    r->count_lights = request->stats != NULL && r->settings.method == METHOD_LGH;
    for (uint32_t i = 0; i < request->aov_count; i++) {
        aov_export(r, request->aovs[i].aov);
        r->count_lights = r->count_lights || aov_counts_lights(request->aovs[i].aov);
    }
    if (request->stats) {
        counters_export(r);
    }
}

static bool run_open(play_run *run)
{
    play_request *const request = run->request;
    run->script = playback_load(request->script);
    if (!run->script || !request_complete(run) || (request->movie && !movie_check(request->movie)) ||
        !play_stats_open(&run->stats, request->render.stats, request->resume) ||
        !render_session_prepare(&run->session, &request->render)) {
        return false;
    }
    run->player = player_create(run->session.gpu, run->session.scene, run->script, renderer_prepare, &request->render);
    return run->player && play_files_open(&run->files, &run->session, run->script);
}

static void run_close(play_run *run)
{
    play_stats_fini(&run->stats);
    play_record_fini(&run->record);
    play_files_fini(&run->files);
    player_destroy(run->player);
    render_session_close(&run->session);
    playback_destroy(run->script);
}

static bool frame_is_wanted(const play_run *run, uint32_t frame)
{
    return frame >= run->begin && !(run->request->resume && play_frame_done(&run->files, frame));
}

static uint32_t frame_wanted_next(const play_run *run, uint32_t frame)
{
    while (frame < run->end && !frame_is_wanted(run, frame)) {
        frame++;
    }
    return frame;
}

static void progress_show_play(const play_run *run, uint32_t frame)
{
    const double seconds = time_now() - run->start;
    char left[32] = "";
    if (run->rendered > 0) {
        time_left_print(seconds / run->rendered * (run->end - frame), left);
    }
    progress_show("frame %u of %u to %u  %.0f %%  %.2g frames/s%s", frame, run->begin, run->end - 1,
                  100.0 * (frame > run->begin ? frame - run->begin : 0) / (run->end - run->begin),
                  run->rendered > 0 ? run->rendered / seconds : 0, left);
}

static bool frame_play(play_run *run, uint32_t frame, bool wanted)
{
    progress_show_play(run, frame);
    if (!player_frame(run->player, frame)) {
        return false;
    }
    renderer *const r = player_renderer(run->player);
    if (run->rendered++ == 0) {
        darkness_warn(r);
    }
    if (run->request->record) {
        play_record_add(&run->record, run->script, r, frame);
    }
    if (!wanted) {
        return true;
    }
    // The row first: a frame that is there has its row.
    const bool ok = play_stats_add(&run->stats, run->player, frame, playback_time(run->script, frame)) &&
                    play_frame_write(&run->files, r, frame);
    run->written += ok;
    return ok;
}

// From the cut before the first frame that is wanted, over those that are there already, to the last that is wanted.
static bool frames_play(play_run *run)
{
    run->start = time_now();
    uint32_t next = 0;
    for (uint32_t wanted = frame_wanted_next(run, run->begin); wanted < run->end && !interrupt_seen();
         wanted = frame_wanted_next(run, wanted + 1)) {
        next = max_u32(next, playback_segment_begin(run->script, wanted));
        for (; next <= wanted && !interrupt_seen(); next++) {
            if (!frame_play(run, next, next == wanted)) {
                return false;
            }
        }
    }
    return true;
}

// Of the frames from the first on, without a gap.
static bool movie_finish(const play_run *run, uint32_t *frames)
{
    uint32_t end = run->begin;
    while (end < run->end && play_frame_done(&run->files, end)) {
        end++;
    }
    *frames = end - run->begin;
    progress_show("%s", run->request->movie);
    if (*frames == 0) {
        return true;
    }
    const bool ok = movie_write(run->request->movie, &run->files, run->begin, end, run->script->frame_rate);
    if (ok && run->files.folder_is_temporary && end == run->end) {
        play_files_discard(&run->files, run->begin, run->end);
    }
    return ok;
}

static void closing_line_print(const play_run *run, uint32_t movie_frames)
{
    const render_settings *const settings = &run->request->render.settings;
    const bool has_movie = run->request->movie && movie_frames > 0;
    printf("wrote %s%s%s%s%s: %u of frames %u to %u, %ux%u", has_movie ? run->request->movie : "",
           has_movie && !run->files.folder_is_temporary ? ", " : "",
           run->files.folder_is_temporary ? "" : run->files.folder, run->request->render.stats ? ", " : "",
           run->request->render.stats ? run->request->render.stats : "", run->written, run->begin, run->end - 1,
           settings->width, settings->height);
    if (run->rendered > 0) {
        printf(", %u rendered, %.3g frames/s", run->rendered, run->rendered / (time_now() - run->start));
    }
    printf(" on %s\n", gpu_name(run->session.gpu));
}

static int play_run_do(play_request *request)
{
    play_run run = {.request = request};
    uint32_t movie_frames = 0;
    progress_begin();
    bool ok = run_open(&run);
    if (ok) {
        interrupt_watch();
        ok = frames_play(&run) && (!request->record || play_record_write(&run.record, run.script, request->record)) &&
             (!request->movie || movie_finish(&run, &movie_frames)) &&
             render_session_validated(&run.session, &request->render);
    }
    progress_end();
    if (ok) {
        closing_line_print(&run, movie_frames);
    }
    if (!ok && run.files.folder_is_new && run.written == 0) {
        play_files_discard(&run.files, 0, 0);
    }
    if (ok && interrupt_seen()) {
        log_info("interrupted after %u frames; the same command with --resume goes on", run.written);
    }
    run_close(&run);
    return !ok ? EXIT_FAILED : interrupt_seen() ? EXIT_INTERRUPTED : EXIT_DONE;
}

int play_command(int argc, char **argv)
{
    play_request request;
    const int code = options_read(argc, argv, &request);
    if (code != EXIT_DONE) {
        return code;
    }
    if (request.render.help) {
        help_print(stdout);
        return EXIT_DONE;
    }
    return play_run_do(&request);
}
