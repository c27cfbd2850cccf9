// `lanternfield render`: loads a scene, renders its frames and writes what was asked for.
#include "lanternfield.h"

#include "modules/animation_system.h"
#include "modules/automatic_system.h"
#include "modules/rays.h"
#include "modules/world.h"

#include <errno.h>
#include <libgen.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

// What one run holds.
typedef struct render_state {
    const render_request *request;
    render_session session;
    render_times times;
    progressive_run progress;
    uint32_t frames_done;
    double seconds; // that they took
    bool lights_counted; // by the last frame done
} render_state;

// ---- Before any work: can the files be written at all?

bool output_path_check(const char *path)
{
    struct stat status;
    if (stat(path, &status) == 0 && !S_ISREG(status.st_mode)) {
        log_error("cannot write \"%s\": it is not a regular file", path);
        return false;
    }
    char *const copy = strdup(path);
    const char *const folder = dirname(copy);
    const bool is_folder = stat(folder, &status) == 0 && S_ISDIR(status.st_mode);
    const bool ok = is_folder && access(folder, W_OK) == 0;
    if (!is_folder) {
        log_error("cannot write \"%s\": there is no folder \"%s\"", path, folder);
    } else if (!ok) {
        log_error("cannot write \"%s\": folder \"%s\": %s", path, folder, strerror(errno));
    }
    free(copy);
    return ok;
}

static bool output_paths_check(const render_request *request)
{
    bool ok = true;
    for (uint32_t i = 0; i < request->output_count; i++) {
        ok = output_path_check(request->outputs[i]) && ok;
    }
    for (uint32_t i = 0; i < request->aov_count; i++) {
        ok = output_path_check(request->aovs[i].path) && ok;
    }
    ok = (!request->stats || output_path_check(request->stats)) && ok;
    ok = (!request->state || output_path_check(request->state)) && ok;
    return (!request->dump_graph || output_path_check(request->dump_graph)) && ok;
}

// ---- Camera and light

// False, and the cameras are listed, when the one that is asked for does not exist.
static bool camera_find(const scene_data *scene, const char *name, uint32_t *camera)
{
    *camera = scene->camera_count > 0 ? 0 : SCENE_NONE;
    if (!name) {
        return true;
    }
    *camera = scene_camera_find(scene, name);
    if (*camera != SCENE_NONE) {
        return true;
    }
    arena names = {0};
    const char *list = scene->camera_count > 0 ? "its cameras are" : "it has no camera";
    for (uint32_t i = 0; i < scene->camera_count; i++) {
        list = arena_printf(&names, "%s%s \"%s\"", list, i ? "," : "", scene->cameras[i].name);
    }
    log_error("%s: there is no camera \"%s\"; %s", scene->path, name, list);
    arena_fini(&names);
    return false;
}

static bool camera_place(renderer *r, const render_request *request, uint32_t camera)
{
    r->camera = renderer_camera_of_scene(r, camera);
    if (request->has_fov) {
        r->camera.yfov = request->fov * (3.14159265f / 180);
    }
    if (!request->has_eye && !request->has_target) {
        return true;
    }
    if (request->has_eye) {
        memcpy(r->camera.eye, request->eye, sizeof(r->camera.eye));
        for (int k = 0; k < 3; k++) {
            r->camera.target[k] = 0.5f * (r->scene->bounds_min[k] + r->scene->bounds_max[k]);
        }
    }
    if (request->has_target) {
        memcpy(r->camera.target, request->target, sizeof(r->camera.target));
    }
    memcpy(r->camera.up, (const float[3]){0, 1, 0}, sizeof(r->camera.up));
    if (memcmp(r->camera.eye, r->camera.target, sizeof(r->camera.eye)) == 0) {
        log_error("the camera's position and target are the same point (%g,%g,%g)", (double)r->camera.eye[0],
                  (double)r->camera.eye[1], (double)r->camera.eye[2]);
        return false;
    }
    return true;
}

// ---- Animation

// False, and the animations are listed, when the one that is asked for does not exist.
static bool animation_check(const scene_data *scene, const char *name)
{
    const bool all = name && strcmp(name, "all") == 0 && scene->animation_count > 0;
    if (!name || all || animation_find(scene, name) != SCENE_NONE) {
        return true;
    }
    arena names = {0};
    const char *list = scene->animation_count > 0 ? "its animations are" : "it has none";
    for (uint32_t i = 0; i < scene->animation_count; i++) {
        list = arena_printf(&names, "%s%s \"%s\"", list, i ? "," : "", scene->animations[i].name);
    }
    log_error("%s: there is no animation \"%s\"; %s", scene->path, name, list);
    arena_fini(&names);
    return false;
}

// Before the camera is placed, which may be on a node that moves.
static void animations_play(renderer *r, const render_request *request)
{
    const bool all = request->animation && strcmp(request->animation, "all") == 0;
    r->time = (double)request->time;
    for (uint32_t i = 0; request->animation && i < r->scene->animation_count; i++) {
        if (all || i == animation_find(r->scene, request->animation)) {
            animation_play(r, &(animation_clip){.animation = i, .speed = 1, .loop = true});
        }
    }
    animation_update(r);
}

// ---- Memory

// Bytes, measured on the device.
static double memory_needed(const render_settings *settings)
{
    const double pixels = (double)settings->width * settings->height;
    const uint32_t slots = settings->method == METHOD_IR ? settings->ir_vpls : settings->vpls;
    const bool has_vpls = slots > 0 && settings->only != ONLY_DIRECT;
    switch ((render_method)settings->method) {
    case METHOD_LGH: // G-buffer and read-back; indirect light's images and their history
        return pixels * (has_vpls ? 300 : 100);
    case METHOD_PATH: // and sums, one path's rays and their answers
        return pixels * 350;
    case METHOD_VPL: // and sums, and a batch of rays
    case METHOD_IR:
        return pixels * 150 + (has_vpls ? 52.0 * RAYS_BATCH : 0);
    }
    return 0;
}

// Whether a buffer takes what each pixel keeps in it: a ray's origin, or of the other methods the two sums.
static bool size_check(const gpu *gpu, const render_settings *settings)
{
    const uint64_t pixels = (uint64_t)settings->width * settings->height;
    const uint64_t most = gpu_storage_buffer_max(gpu) / (settings->method == METHOD_LGH ? 16 : 32);
    if (pixels > most) {
        log_error("--size %ux%u: expected at most %llu pixels, which is what the buffers of %s hold", settings->width,
                  settings->height, (unsigned long long)most, gpu_name(gpu));
    }
    return pixels <= most;
}

// A device that is the CPU takes what it likes until the system ends the process, so what a picture needs at least is
// compared with what there is; other devices refuse an allocation by themselves.
static bool memory_check(const gpu *gpu, const render_settings *settings)
{
    const double needed = memory_needed(settings);
    double available = (double)sysconf(_SC_AVPHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    FILE *const file = fopen("/proc/meminfo", "r");
    char line[128];
    double kilobytes;
    while (file && fgets(line, sizeof(line), file)) {
        if (sscanf(line, "MemAvailable: %lf kB", &kilobytes) == 1) {
            available = 1024 * kilobytes; // counts what the file cache would give back
        }
    }
    if (file) {
        fclose(file);
    }
    if (gpu_is_cpu(gpu) && needed > available) {
        log_error("--size %ux%u needs about %.1f GB of memory, and %.1f GB are free", settings->width, settings->height,
                  needed * 1e-9, available * 1e-9);
        return false;
    }
    return true;
}

// ---- Ctrl-C: the frame is finished and written; a second one ends the process.

static volatile sig_atomic_t interrupted;

static void interrupt_note(int number)
{
    (void)number;
    interrupted = 1;
}

void interrupt_watch(void)
{
    const struct sigaction action = {.sa_handler = interrupt_note, .sa_flags = (int)SA_RESETHAND | SA_RESTART};
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

bool interrupt_seen(void)
{
    return interrupted;
}

// ---- Frames

static bool wants_light_count(const render_request *request)
{
    bool wanted = request->stats != NULL && request->settings.method == METHOD_LGH;
    for (uint32_t i = 0; i < request->aov_count; i++) {
        wanted = wanted || aov_counts_lights(request->aovs[i].aov);
    }
    return wanted;
}

static void exports_set(renderer *r, const render_request *request)
{
    for (uint32_t i = 0; i < request->aov_count; i++) {
        aov_export(r, request->aovs[i].aov);
    }
    if (r->settings.levels > 0) {
        export_add(r, "lgh_header|-");
    }
    if (request->stats) {
        stats_export(r);
    }
}

// A number of levels that was asked for may not fit: into the finest grid, or into a buffer.
static void levels_check(renderer *r)
{
    const gpu_buffer buffer =
        r->settings.levels > 0 ? frame_graph_find_buffer(r->graph, "lgh_header|-") : (gpu_buffer){0};
    lgh_header header;
    if (buffer.id && gpu_buffer_read(r->gpu, buffer, 0, &header, sizeof(header)) && header.level_count > 0 &&
        header.level_count < r->settings.levels) {
        log_warning("--levels %u: %u are built; more grid lights than that do not fit into one buffer",
                    r->settings.levels, header.level_count);
    }
}

// Whether the frame just rendered made the parts of the picture that are asked for.
static bool aovs_check(const render_state *state)
{
    bool ok = true;
    for (uint32_t i = 0; i < state->request->aov_count; i++) {
        const struct aov_info *const aov = state->request->aovs[i].aov;
        const bool expected = !aov_counts_lights(aov) || state->lights_counted;
        if (expected && !aov_present(state->session.renderer, aov)) {
            log_error("--aov %s: these settings and this scene do not make it", aov_name(aov));
            ok = false;
        }
    }
    return ok;
}

static void progress_show_frame(uint32_t frame, uint32_t frames, double seconds_so_far)
{
    char left[32] = "";
    if (frame > 0) {
        time_left_print(seconds_so_far / frame * (frames - frame), left);
    }
    progress_show("frame %u/%u  %.0f %%%s", frame + 1, frames, 100.0 * frame / frames, left);
}

void darkness_warn(const renderer *r)
{
    if (r->gpu_world->instance_count == 0) {
        log_warning("%s: no geometry is in place (nodes scaled to nothing?): the picture will be black",
                    r->scene->path);
    } else if (r->gpu_world->light_power <= 0) {
        log_warning("%s: no lights: the picture will be black", r->scene->path);
    }
}

// Refuses parts of the picture that are not made, before the other frames are rendered.
static bool first_frame_check(const render_state *state)
{
    darkness_warn(state->session.renderer);
    levels_check(state->session.renderer);
    return aovs_check(state);
}

static bool frame_render(render_state *state, bool timed)
{
    renderer *const r = state->session.renderer;
    const double start = time_now();
    if (!renderer_frame(r)) {
        return false;
    }
    const double seconds = time_now() - start;
    state->seconds += seconds;
    if (timed) {
        render_times_add(&state->times, r, 1000 * seconds);
    }
    state->lights_counted = r->count_lights;
    return state->frames_done++ > 0 || first_frame_check(state);
}

// Whether automatic settings came to where they should.
static void automatic_tell(const renderer *r)
{
    const automatic *const a = automatic_get(r);
    if (!a) {
        return;
    }
    const double ms = automatic_milliseconds(a), error = automatic_error(a, NULL);
    const char *const state = a->settled ? "" : ", not settled yet";
    if (a->age < AUTOMATIC_WINDOW) {
        log_info("automatic: only %u frames since the last change; more --frames would tell what it brings", a->age);
    } else if (a->target_ms > 0) {
        log_info("automatic: %.0f ms a frame for --target-ms %g, estimated error %.3f%s", ms, a->target_ms, error,
                 state);
    } else {
        log_info("automatic: estimated error %.3f for --target-error %g%s", automatic_probes_error(&a->probes, NULL),
                 a->target_error, state);
    }
}

static bool settling_frames_render(render_state *state)
{
    renderer *const r = state->session.renderer;
    // Instant radiosity has no history to settle.
    const uint32_t frames = r->settings.method == METHOD_IR ? 1 : r->settings.frames;
    const bool wants_count = wants_light_count(state->request);
    bool last = false;
    do { // once at least, so that there is a picture
        progress_show_frame(state->frames_done, frames, state->seconds);
        last = state->frames_done + 1 == frames || (automatic_get(r) && automatic_get(r)->settled);
        // Counting costs time, so only the last frame does, and is left out of the timings.
        r->count_lights = wants_count && last;
        if (!frame_render(state, !r->count_lights || frames == 1)) {
            return false;
        }
    } while (!last && !interrupted);
    automatic_tell(r);
    return frames == 1 || aovs_check(state);
}

// At least one frame, which makes the picture of a state that is finished already.
static bool progressive_frames_render(render_state *state)
{
    progressive_run *const progress = &state->progress;
    if (!progressive_run_begin(progress, &state->session, state->request)) {
        return false;
    }
    do {
        if (!frame_render(state, true)) {
            return false;
        }
        progressive_run_step(progress, state->session.renderer);
    } while (!progress->now.finished && !interrupted);
    progressive_run_end(progress, state->session.renderer);
    return true;
}

static bool frames_render(render_state *state)
{
    return progressive_is(state->session.renderer) ? progressive_frames_render(state) : settling_frames_render(state);
}

// ---- What is left behind

static bool graph_write(const renderer *r, const char *path)
{
    const bool as_text = path_has_extension(path, ".txt");
    char *const text = as_text ? frame_graph_dump_text(r->graph) : frame_graph_dump_dot(r->graph);
    const bool ok = file_write(path, text, strlen(text));
    free(text);
    return ok;
}

static bool statistics_write(const render_state *state)
{
    const render_summary summary = {
        .scene = state->session.scene->path,
        .device = gpu_name(state->session.gpu),
        .frames = state->frames_done,
        .counting_is_timed = state->lights_counted && state->frames_done == 1,
        .times = &state->times,
        .progress = progressive_is(state->session.renderer) ? &state->progress : NULL,
        .seconds = state->seconds,
    };
    return stats_write(state->session.renderer, &summary, state->request->stats);
}

// Adds a file to the summary when it was written.
static bool note_written(arena *names, const char **list, const char *path, bool ok)
{
    if (ok) {
        *list = **list ? arena_printf(names, "%s, %s", *list, path) : path;
    }
    return ok;
}

// "2 frames, 31.0 ms a frame", or "path, 256 samples, estimated error 1.2 %, 34.1 s, 5.1 Mrays/s".
static const char *work_print(arena *memory, const render_state *state)
{
    const renderer *const r = state->session.renderer;
    if (!progressive_is(r)) {
        return arena_printf(memory, "%u frame%s, %.1f ms a frame", state->frames_done,
                            state->frames_done == 1 ? "" : "s", time_series_percentile(&state->times.frames, 0.5));
    }
    const progressive_status *const status = &state->progress.now;
    char method[32];
    settings_get(&r->settings, settings_find("method"), method);
    const char *const error =
        isnan(status->error) ? "" : arena_printf(memory, ", estimated error %.2g %%", 100 * status->error);
    const double rays = progressive_run_rays(&state->progress);
    const char *const speed = status->done > state->progress.before.done
                                  ? arena_printf(memory, ", %.1f Mrays/s", 1e-6 * rays / state->seconds)
                                  : "";
    return arena_printf(memory, "%s, %llu %s%s, %.1f s%s", method, (unsigned long long)status->done,
                        progressive_run_unit(r, status->done), error, state->seconds, speed);
}

// Writes every file, even when another cannot be written, and prints the closing line.
static bool outputs_write(const render_state *state)
{
    const render_request *const request = state->request;
    renderer *const r = state->session.renderer;
    arena names = {0};
    const char *list = "";
    bool ok = true;
    progress_show("write");
    for (uint32_t i = 0; i < request->output_count; i++) {
        const char *const path = request->outputs[i];
        ok = note_written(&names, &list, path, picture_write(r, path)) && ok;
    }
    for (uint32_t i = 0; i < request->aov_count; i++) {
        const aov_request *const aov = &request->aovs[i];
        if (aov_counts_lights(aov->aov) && !state->lights_counted) {
            log_warning("\"%s\" is not written: lights are counted in the last frame", aov->path);
            continue;
        }
        ok = note_written(&names, &list, aov->path, aov_write(r, aov->aov, aov->path)) && ok;
    }
    if (request->dump_graph) {
        ok = note_written(&names, &list, request->dump_graph, graph_write(r, request->dump_graph)) && ok;
    }
    if (request->stats) {
        ok = note_written(&names, &list, request->stats, statistics_write(state)) && ok;
    }
    progress_end();
    if (*list) {
        printf("wrote %s: %ux%u, %s on %s\n", list, r->settings.width, r->settings.height, work_print(&names, state),
               gpu_name(state->session.gpu));
    }
    arena_fini(&names);
    return ok;
}

bool render_session_validated(const render_session *session, const render_request *request)
{
    const uint32_t messages = request->validate ? gpu_validation_messages(session->gpu) : 0;
    if (messages > 0) {
        log_error("the validation layer reported %u message%s", messages, messages == 1 ? "" : "s");
    }
    return messages == 0;
}

// ---- From nothing to a renderer

bool render_session_prepare(render_session *session, const render_request *request)
{
    progress_show("load %s", request->scene);
    session->scene = scene_load(request->scene);
    if (!session->scene) {
        return false;
    }
    if (session->scene->instanced_triangles == 0) {
        log_error("%s: no geometry: there is nothing to render", request->scene);
        return false;
    }
    const gpu_desc desc = {.device = request->device, .validation = request->validate};
    session->gpu = gpu_create(&desc);
    return session->gpu && size_check(session->gpu, &request->settings) &&
           memory_check(session->gpu, &request->settings);
}

bool render_session_open(render_session *session, const render_request *request)
{
    uint32_t camera;
    if (!render_session_prepare(session, request) || !camera_find(session->scene, request->camera, &camera) ||
        !animation_check(session->scene, request->animation)) {
        return false;
    }
    progress_show("upload %s", request->scene);
    session->renderer = renderer_create(session->gpu, session->scene, &request->settings);
    if (!session->renderer) {
        return false;
    }
    animations_play(session->renderer, request);
    if (!camera_place(session->renderer, request, camera)) {
        return false;
    }
    if (request->has_sun) {
        world_sun_add(session->renderer, request->sun, request->sun[3]);
    }
    return true;
}

void render_session_close(render_session *session)
{
    renderer_destroy(session->renderer);
    gpu_destroy(session->gpu);
    scene_destroy(session->scene);
    *session = (render_session){0};
}

static void interruption_tell(const render_state *state)
{
    const renderer *const r = state->session.renderer;
    const render_request *const request = state->request;
    const progressive_status *const status = &state->progress.now;
    if (!progressive_is(r)) {
        log_info("interrupted after %u of %u frames; what there was is written", state->frames_done,
                 request->settings.frames);
        return;
    }
    log_info("interrupted after %llu of %llu %s; what there was is written%s%s", (unsigned long long)status->done,
             (unsigned long long)status->total, progressive_run_unit(r, status->total),
             request->state ? ", and the same command goes on from " : "", request->state ? request->state : "");
}

int render_run(const render_request *request)
{
    if (!output_paths_check(request)) {
        return EXIT_FAILED;
    }
    render_state state = {.request = request};
    progress_begin();
    bool ok = render_session_open(&state.session, request);
    if (ok) {
        interrupt_watch();
        exports_set(state.session.renderer, request);
        ok = frames_render(&state) && outputs_write(&state) && render_session_validated(&state.session, request) &&
             !state.progress.save_failed;
    }
    progress_end();
    if (ok && interrupted) {
        interruption_tell(&state);
    }
    render_session_close(&state.session);
    render_times_fini(&state.times);
    progressive_run_fini(&state.progress);
    return !ok ? EXIT_FAILED : interrupted ? EXIT_INTERRUPTED : EXIT_DONE;
}
