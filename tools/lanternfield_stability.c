// `lanternfield stability`: plays a script with and without temporal filters, and measures how steady the pictures are
// against a reference of each frame.
#include "lanternfield_stability.h"
#include "lanternfield_bench.h"

#include "modules/image_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// ---- Options

static bool output_read(render_request *request, const char *value, setting_error *error)
{
    ((stability_request *)request)->folder = value;
    return *value || option_refuse(error, "-o", "a folder", value);
}

static bool references_read(render_request *request, const char *value, setting_error *error)
{
    ((stability_request *)request)->references = value;
    return *value || option_refuse(error, "--references", "a folder", value);
}

static bool range_read(render_request *request, const char *value, setting_error *error)
{
    stability_request *const r = (stability_request *)request;
    int length = 0;
    const bool is_range = strspn(value, "0123456789:") == strlen(value) &&
                          sscanf(value, "%9u:%9u%n", &r->begin, &r->end, &length) == 2 && !value[length];
    error->out_of_range = is_range;
    r->has_range = true;
    return (is_range && r->begin + 1 < r->end) ||
           option_refuse(error, "--range", "A:B with A + 1 < B: frames A, A + 1, ..., B - 1, the first is 0", value);
}

static bool reference_vpls_read(render_request *request, const char *value, setting_error *error)
{
    render_settings settings = render_settings_default();
    if (!settings_set(&settings, settings_find("vpls"), value, error)) {
        return option_refuse(error, "--reference-vpls", "a whole number from 0 to 2500000", value);
    }
    ((stability_request *)request)->reference_vpls = settings.vpls;
    return true;
}

static bool reference_spp_read(render_request *request, const char *value, setting_error *error)
{
    render_settings settings = render_settings_default();
    if (!settings_set(&settings, settings_find("spp"), value, error)) {
        return option_refuse(error, "--reference-spp", "a whole number from 1 to 16777216", value);
    }
    ((stability_request *)request)->reference_spp = settings.spp;
    return true;
}

static const command_option stability_options[] = {
    {"o", "DIR", "folder for report.html, report.md, frames.csv and the charts", output_read},
    {"range", "A:B",
     "measure frames A to B - 1, counted from 0; those before are played for their\n"
     "                             history alone (default: all)",
     range_read},
    {"references", "DIR", "folder that keeps the references of all runs (default: DIR/references)", references_read},
    {"reference-vpls", "N", "virtual point lights of the references (default: 10000)", reference_vpls_read},
    {"reference-spp", "N",
     "references by path tracing with N samples a pixel instead: where lights move, each\n"
     "                             of the VPLs goes in leaps (default: off)",
     reference_spp_read},
};

static bool setting_read(render_request *request, const setting_info *info, const char *value, setting_error *error)
{
    stability_request *const r = (stability_request *)request;
    const char *refusal = playback_setting_refusal(info, false);
    if (strcmp(info->name, "taa") == 0 || strcmp(info->name, "no-taa") == 0 || strcmp(info->name, "method") == 0) {
        refusal = "it is what is compared";
    }
    if (refusal) {
        snprintf(error->message, sizeof(error->message), "--%s: cannot be used here: %s", info->name, refusal);
        error->out_of_range = true;
        return false;
    }
    if (!settings_set(&request->settings, info, value, error)) {
        return false;
    }
    assert(r->override_count < countof(r->overrides));
    r->overrides[r->override_count++] = (playback_setting){info, value};
    r->has_size = r->has_size || strcmp(info->name, "size") == 0;
    return true;
}

static bool script_read(render_request *request, const char *word)
{
    stability_request *const r = (stability_request *)request;
    const bool is_first = !r->script;
    if (!is_first) {
        log_error("one SCRIPT.json is enough: \"%s\" and \"%s\"; see lanternfield stability --help", r->script, word);
    }
    r->script = word;
    return is_first;
}

static command_syntax stability_syntax(void)
{
    return (command_syntax){
        .command = "stability",
        .groups = {{"Files and frames", stability_options, countof(stability_options)}, device_option_group},
        .setting_read = setting_read,
        .word_read = script_read,
    };
}

static void help_print(FILE *out)
{
    fputs(
        "usage: lanternfield stability SCRIPT.json -o DIR [OPTION...]\n"
        "Plays a script with TAA on the shadow ratio, on the light and on neither, and with VPLs that are chosen anew\n"
        "in every frame, and measures each against a reference of every frame: all of --reference-vpls at every\n"
        "pixel, with one seed for all frames. Render options given here stand above those of the script.\n",
        out);
    const command_syntax syntax = stability_syntax();
    options_help_print(out, &syntax);
    fputs("\nThe default size is 160x90. References take most of the time (10,000 VPLs are 144 million rays a frame),\n"
          "and are kept: a run that was ended goes on, and later runs use them. They do not depend on how frames are\n"
          "filtered.\n"
          "\nMeasures: (i) deviation of each pixel over the last 32 frames, for still scripts; (ii) flicker: change\n"
          "from frame to frame that the reference does not have, over its light; (iii) frames until the light stays\n"
          "within 5 % of what it comes to after an event; (iv) FLIP, of the worst frame.\n"
          "\nExit codes: 0 done, 1 failed (also a value that cannot be used), 2 wrong usage, 130 interrupted.\n",
          out);
}

static int options_read(int argc, char **argv, stability_request *request)
{
    *request = (stability_request){.render = {.settings = render_settings_default()}, .reference_vpls = 10000};
    const command_syntax syntax = stability_syntax();
    const int code = command_line_read(&syntax, argc, argv, &request->render);
    if (code != EXIT_DONE || request->render.help) {
        return code;
    }
    if (!request->script || !request->folder) {
        log_error("stability needs %s; see lanternfield stability --help",
                  request->script ? "-o DIR" : "a SCRIPT.json");
        return EXIT_WRONG_USAGE;
    }
    return EXIT_DONE;
}

// ---- Playing

static void override(playback *script, const char *name, const char *text)
{
    setting_error error;
    const bool ok = playback_override(script, settings_find(name), text, &error);
    assert(ok && "read before");
    (void)ok;
}

// The script with what the command line says.
static playback *script_load(const stability_request *request)
{
    playback *const script = playback_load(request->script);
    if (script && !request->has_size) {
        override(script, "size", "160x90");
    }
    for (uint32_t i = 0; script && i < request->override_count; i++) {
        override(script, request->overrides[i].info->name, request->overrides[i].text);
    }
    return script;
}

// The last frame as RGB; free() it. NULL on failure (logged).
static float *radiance_read(const stability_run *run, renderer *r)
{
    const size_t pixels = (size_t)run->width * run->height;
    float *const texels = memory_alloc(pixels * 4 * sizeof(float)), *image = NULL;
    if (gpu_image_read(run->session.gpu, frame_graph_find_image(r->graph, "radiance"),
                       VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, texels, pixels * 4 * sizeof(float))) {
        image = memory_alloc(pixels * 3 * sizeof(float));
        for (size_t i = 0; i < pixels; i++) {
            memcpy(image + 3 * i, texels + 4 * i, 3 * sizeof(float));
        }
    }
    free(texels);
    return image;
}

// ---- References: frames of the method vpl, in files by what they depend on.

static char *references_folder_make(const stability_run *run)
{
    const stability_request *const request = run->request;
    char *text = NULL, *folder = NULL, key[BENCH_KEY_SIZE];
    size_t size = 0;
    FILE *const out = open_memstream(&text, &size);
    fprintf(out, "version 2\nscript %016llx\n%s %u\n", (unsigned long long)run->script->hash,
            request->reference_spp ? "spp" : "vpls",
            request->reference_spp ? request->reference_spp : request->reference_vpls);
    scene_identity_print(out, run->session.scene);
    const render_settings settings = playback_settings_at(run->script, 0);
    fprintf(out, "shadows %d\n", settings.shadow_samples > 0);
    static const char *const parts[] = {"size", "bounces", "singularity", "subdivision-max", "seed", "only", "until"};
    for (size_t i = 0; i < countof(parts); i++) {
        char value[32];
        settings_get(&settings, settings_find(parts[i]), value);
        fprintf(out, "%s %s\n", parts[i], value);
    }
    fclose(out);
    bench_key_print(bench_hash(BENCH_HASH_START, text, size), key);
    const char *const parent = request->references ? request->references : request->folder;
    const int length = asprintf(&folder, "%s%s/%s", parent, request->references ? "" : "/references", key);
    assert(length > 0);
    (void)length;
    free(text);
    return folder;
}

static void reference_path(const stability_run *run, uint32_t frame, char path[1024])
{
    snprintf(path, 1024, "%s/%06u.exr", run->references_folder, frame);
}

static player *reference_player(stability_run *run, playback *script)
{
    const bool path = run->request->reference_spp > 0;
    char count[32];
    snprintf(count, sizeof(count), "%u", path ? run->request->reference_spp : run->request->reference_vpls);
    override(script, "method", path ? "path" : "vpl");
    override(script, path ? "spp" : "vpls", count);
    return player_create(run->session.gpu, run->session.scene, script, NULL, NULL);
}

static bool reference_frame_make(stability_run *run, player *player, uint32_t frame, const char *path)
{
    progress_show("reference of frame %u of %u to %u", frame, run->begin, run->end - 1);
    const double start = time_now();
    float *const image = player_frame(player, frame) ? radiance_read(run, player_renderer(player)) : NULL;
    const bool ok = image && image_write_exr(path, image, run->width, run->height, 3);
    free(image);
    run->reference_seconds += time_now() - start;
    return ok;
}

static bool reference_frame_read(stability_run *run, uint32_t frame, const char *path)
{
    uint32_t width, height;
    float *const image = image_read_exr(path, &width, &height);
    run->references[frame - run->begin] = image;
    if (image && (width != run->width || height != run->height)) {
        log_error("\"%s\": expected %ux%u pixels, got %ux%u", path, run->width, run->height, width, height);
        return false;
    }
    return image != NULL;
}

static bool references_make(stability_run *run)
{
    run->references_folder = references_folder_make(run);
    run->references = memory_alloc((run->end - run->begin) * sizeof(*run->references));
    playback *const script = script_load(run->request);
    player *const player = script ? reference_player(run, script) : NULL;
    bool ok = player && bench_folder_make(run->references_folder);
    for (uint32_t frame = run->begin; ok && frame < run->end && !interrupt_seen(); frame++) {
        char path[1024];
        reference_path(run, frame, path);
        ok = (access(path, F_OK) == 0 || reference_frame_make(run, player, frame, path)) &&
             reference_frame_read(run, frame, path);
    }
    player_destroy(player);
    playback_destroy(script);
    return ok;
}

// ---- Variants

static bool frame_measure(const stability_run *run, stability_variant *variant, uint32_t index)
{
    const size_t bytes = (size_t)run->width * run->height * 3 * sizeof(float);
    stability_frame *const f = &variant->frames[index];
    const float *const reference = run->references[index];
    f->flicker = NAN;
    f->changed = index > 0 && memcmp(f->image, f[-1].image, bytes) != 0;
    f->blocks = sequence_distance_to(f->image, reference, run->width, run->height).blocks;
    if (index > 0) {
        f->flicker = sequence_flicker(f->image, f[-1].image, reference, run->references[index - 1], run->width,
                                      run->height, NULL);
    }
    return image_measure(f->image, reference, run->width, run->height, run->ev, &f->error, NULL);
}

static bool variant_frames_make(stability_run *run, stability_variant *variant, playback *script, player *player)
{
    for (uint32_t frame = playback_segment_begin(script, run->begin); frame < run->end; frame++) {
        if (interrupt_seen()) {
            return true;
        }
        progress_show("%s: frame %u of %u to %u", variant->name, frame, run->begin, run->end - 1);
        char seed[16];
        snprintf(seed, sizeof(seed), "%u", 1000 + frame);
        if (variant->random_seeds) { // the last override
            script->overrides[script->override_count - 1].text = seed;
        }
        if (!player_frame(player, frame)) {
            return false;
        }
        if (frame < run->begin) {
            continue;
        }
        float *const image = radiance_read(run, player_renderer(player));
        variant->frames[frame - run->begin].image = image;
        if (!image || !frame_measure(run, variant, frame - run->begin)) {
            return false;
        }
    }
    return true;
}

static double variant_deviation(const stability_run *run, const stability_variant *variant)
{
    const uint32_t all = run->end - run->begin, count = min_u32(all, STABILITY_STILL);
    const float *images[STABILITY_STILL];
    for (uint32_t i = 0; i < count; i++) {
        images[i] = variant->frames[all - count + i].image;
    }
    return sequence_deviation(images, count, run->width, run->height, NULL);
}

static bool variant_make(stability_run *run, stability_variant *variant)
{
    variant->frames = memory_alloc((run->end - run->begin) * sizeof(*variant->frames));
    playback *const script = script_load(run->request);
    if (script) {
        override(script, "taa", variant->taa);
        override(script, "seed", "1000");
        script->override_count -= !variant->random_seeds;
    }
    player *const player = script ? player_create(run->session.gpu, run->session.scene, script, NULL, NULL) : NULL;
    const bool ok = player && variant_frames_make(run, variant, script, player);
    if (ok && !interrupt_seen()) {
        variant->deviation = variant_deviation(run, variant);
    }
    player_destroy(player);
    playback_destroy(script);
    return ok;
}

// ---- Settling

double stability_settling(const stability_run *run, const stability_variant *variant, uint32_t event)
{
    const uint32_t begin = run->events[event].frame - run->begin,
                   end = (event + 1 < run->event_count ? run->events[event + 1].frame : run->end) - run->begin;
    const uint32_t count = end - begin, quarter = max_u32(count / 4, 1);
    double steady = 0, *off = memory_alloc(count * sizeof(*off));
    for (uint32_t i = 0; i < quarter; i++) {
        steady += variant->frames[end - 1 - i].error.energy / quarter;
    }
    for (uint32_t i = 0; i < count; i++) {
        off[i] = fabs(variant->frames[begin + i].error.energy / steady - 1);
    }
    const uint32_t settled = sequence_settled_after(off, count, 0.05);
    free(off);
    return settled == count ? NAN : settled;
}

static void event_add(stability_run *run, const playback_event *event)
{
    static const char *const kinds[] = {
        [PLAYBACK_LIGHT_SWITCH] = "light",
        [PLAYBACK_NODE_SWITCH] = "node",
        [PLAYBACK_SETTINGS] = "settings",
        [PLAYBACK_CUT] = "cut",
    };
    if (event->frame < run->begin || event->frame >= run->end) {
        return;
    }
    stability_event made = {.frame = event->frame};
    const bool named = event->type == PLAYBACK_LIGHT_SWITCH || event->type == PLAYBACK_NODE_SWITCH;
    snprintf(made.what, sizeof(made.what), "%s%s%s%s", kinds[event->type], named ? " " : "", named ? event->name : "",
             named ? event->on ? " on" : " off" : "");
    run->events = memory_realloc(run->events, (run->event_count + 1) * sizeof(*run->events));
    // Of several at one frame the last speaks for all.
    run->event_count -= run->event_count > 0 && run->events[run->event_count - 1].frame == event->frame;
    run->events[run->event_count++] = made;
}

// ---- The run

static bool run_open(stability_run *run)
{
    const stability_request *const request = run->request;
    run->script = script_load(request);
    if (!run->script) {
        return false;
    }
    run->begin = request->has_range ? request->begin : 0;
    run->end = request->has_range ? request->end : run->script->frame_count;
    if (run->end > run->script->frame_count || run->begin + 1 >= run->end) {
        log_error("--range %u:%u: expected at least 2 frames, of the %u that \"%s\" has", run->begin, run->end,
                  run->script->frame_count, run->script->path);
        return false;
    }
    render_request render = request->render;
    render.scene = run->script->scene;
    render.settings = playback_settings_at(run->script, 0);
    if (render.settings.method != METHOD_LGH) {
        log_error("\"%s\": the setting \"method\" must be lgh, which is what is measured", run->script->path);
        return false;
    }
    run->width = render.settings.width;
    run->height = render.settings.height;
    if (!bench_folder_make(request->folder) || !render_session_prepare(&run->session, &render) ||
        !playback_resolve(run->script, run->session.scene)) {
        return false;
    }
    for (uint32_t i = 0; i < run->script->event_count; i++) {
        event_add(run, &run->script->events[i]);
    }
    return true;
}

static void run_close(stability_run *run)
{
    const uint32_t count = run->end - run->begin;
    for (uint32_t v = 0; v < STABILITY_VARIANTS; v++) {
        for (uint32_t i = 0; run->variants[v].frames && i < count; i++) {
            free(run->variants[v].frames[i].image);
        }
        free(run->variants[v].frames);
    }
    for (uint32_t i = 0; run->references && i < count; i++) {
        free(run->references[i]);
    }
    free(run->references);
    free(run->references_folder);
    free(run->events);
    render_session_close(&run->session);
    playback_destroy(run->script);
}

static bool variants_make(stability_run *run)
{
    const render_settings settings = playback_settings_at(run->script, run->begin);
    run->ev = settings.auto_exposure ? image_exposure(run->references[0], run->width, run->height)
                                     : (double)settings.exposure;
    bool ok = true;
    for (uint32_t v = 0; v < STABILITY_VARIANTS && ok && !interrupt_seen(); v++) {
        ok = variant_make(run, &run->variants[v]);
    }
    return ok;
}

int stability_command(int argc, char **argv)
{
    stability_request request;
    int code = options_read(argc, argv, &request);
    if (code != EXIT_DONE) {
        return code;
    }
    if (request.render.help) {
        help_print(stdout);
        return EXIT_DONE;
    }
    stability_run run = {
        .request = &request,
        .variants = {{"TAA on the ratio", "ratio"},
                     {"TAA on the light", "light"},
                     {"no TAA", "off"},
                     {"VPLs anew without TAA", "off", .random_seeds = true}},
    };
    interrupt_watch();
    progress_begin();
    bool ok = run_open(&run) && references_make(&run);
    ok = ok && (interrupt_seen() || variants_make(&run));
    progress_end();
    ok = ok && (interrupt_seen() || stability_report_write(&run));
    ok = ok && render_session_validated(&run.session, &request.render);
    code = !ok ? EXIT_FAILED : interrupt_seen() ? EXIT_INTERRUPTED : EXIT_DONE;
    run_close(&run);
    return code;
}
