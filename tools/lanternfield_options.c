// The options of `lanternfield render`: those of the settings' table, and what concerns one run of the command.
#include "lanternfield.h"

#include "modules/automatic.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

// `count` finite numbers separated by commas, and nothing else.
static bool numbers_read(const char *text, float *values, uint32_t count)
{
    if (strspn(text, "0123456789+-.eE,") != strlen(text)) {
        return false;
    }
    for (uint32_t i = 0; i < count; i++) {
        char *end;
        values[i] = strtof(text, &end);
        if (end == text || *end != (i + 1 < count ? ',' : '\0') || !isfinite(values[i])) {
            return false;
        }
        text = end + 1;
    }
    return true;
}

// ---- One function an option

static bool output_read(render_request *request, const char *value, setting_error *error)
{
    if (!path_has_extension(value, ".png") && !path_has_extension(value, ".exr")) {
        return option_refuse(error, "-o", "a file name that ends in .png or .exr", value);
    }
    if (request->output_count == OUTPUTS_MAX) {
        return option_refuse(error, "-o", "at most 8 files", value);
    }
    request->outputs[request->output_count++] = value;
    return true;
}

static bool aov_read(render_request *request, const char *value, setting_error *error)
{
    const char *const equals = strchr(value, '=');
    if (!equals || !path_has_extension(equals + 1, ".exr")) {
        return option_refuse(error, "--aov", "NAME=FILE.exr", value);
    }
    if (request->aov_count == AOVS_MAX) {
        return option_refuse(error, "--aov", "at most 16 of these", value);
    }
    char name[32];
    snprintf(name, sizeof(name), "%.*s", (int)(equals - value), value);
    const struct aov_info *const aov = aov_find(name);
    if (!aov) {
        char expected[160] = "one of ";
        aov_names_print(expected + strlen(expected), sizeof(expected) - strlen(expected));
        return option_refuse(error, "--aov", expected, name);
    }
    request->aovs[request->aov_count++] = (aov_request){.aov = aov, .path = equals + 1};
    return true;
}

static bool camera_read(render_request *request, const char *value, setting_error *error)
{
    (void)error;
    request->camera = value;
    return true;
}

static bool eye_read(render_request *request, const char *value, setting_error *error)
{
    request->has_eye = true;
    return numbers_read(value, request->eye, 3) || option_refuse(error, "--eye", "x,y,z in metres", value);
}

static bool target_read(render_request *request, const char *value, setting_error *error)
{
    request->has_target = true;
    return numbers_read(value, request->target, 3) || option_refuse(error, "--target", "x,y,z in metres", value);
}

static bool fov_read(render_request *request, const char *value, setting_error *error)
{
    request->has_fov = true;
    const bool is_number = numbers_read(value, &request->fov, 1);
    error->out_of_range = is_number;
    return (is_number && request->fov >= 1 && request->fov <= 179) ||
           option_refuse(error, "--fov", "a number of degrees from 1 to 179", value);
}

static bool sun_read(render_request *request, const char *value, setting_error *error)
{
    request->has_sun = true;
    const float *const sun = request->sun;
    const bool is_sun = numbers_read(value, request->sun, 4);
    error->out_of_range = is_sun;
    return (is_sun && (sun[0] != 0 || sun[1] != 0 || sun[2] != 0) && sun[3] >= 0) ||
           option_refuse(error, "--sun", "dx,dy,dz,LUX with a direction that is not zero and at least 0 lux", value);
}

static bool animation_read(render_request *request, const char *value, setting_error *error)
{
    (void)error;
    request->animation = value;
    return true;
}

static bool time_read(render_request *request, const char *value, setting_error *error)
{
    request->has_time = true;
    const bool is_number = numbers_read(value, &request->time, 1);
    error->out_of_range = is_number;
    return (is_number && request->time >= 0) || option_refuse(error, "--time", "a number of seconds, 0 or more", value);
}

static bool stats_read(render_request *request, const char *value, setting_error *error)
{
    (void)error;
    request->stats = value;
    return true;
}

static bool state_read(render_request *request, const char *value, setting_error *error)
{
    (void)error;
    request->state = value;
    return true;
}

static bool dump_graph_read(render_request *request, const char *value, setting_error *error)
{
    (void)error;
    request->dump_graph = value;
    return true;
}

static bool device_read(render_request *request, const char *value, setting_error *error)
{
    (void)error;
    request->device = value;
    return true;
}

static bool validate_read(render_request *request, const char *value, setting_error *error)
{
    (void)value, (void)error;
    request->validate = true;
    return true;
}

static const command_option output_options[] = {
    {"o", "FILE", "write FILE: .png is tone-mapped sRGB, .exr linear radiance in nits; repeatable (default out.png)",
     output_read},
    {"aov", "NAME=FILE.exr", "also write one part of the picture; repeatable; the names are below", aov_read},
    {"state", "FILE", "path, vpl: go on from FILE where there is one, and keep it up to date (default: none)",
     state_read},
    {"stats", "FILE.json", "write times in ms, rays, lights and flux (default: none)", stats_read},
    {"dump-graph", "FILE.dot", "write the frame graph for graphviz, or as text to FILE.txt (default: none)",
     dump_graph_read},
};
static const command_option view_options[] = {
    {"camera", "NAME", "the scene's camera NAME (default: its first, or one that frames the scene)", camera_read},
    {"eye", "x,y,z", "camera position in metres; looks at the middle of the scene without --target", eye_read},
    {"target", "x,y,z", "the point that the camera looks at, in metres", target_read},
    {"fov", "DEG", "vertical field of view in degrees, 1 to 179 (default: the camera's)", fov_read},
    {"sun", "dx,dy,dz,LUX", "add a directional light that travels along dx,dy,dz (default: none)", sun_read},
    {"animation", "NAME|all", "pose the scene by its animation NAME, or by all of them (default: as it is at rest)",
     animation_read},
    {"time", "SECONDS", "the moment of --animation that is shown; animations repeat (default 0)", time_read},
};
static const command_option device_options[] = {
    {"device", "NAME", "first device whose name contains NAME (default: the first that has all it takes)", device_read},
    {"validate", NULL, "run under the validation layer and fail when it reports anything (default: off)",
     validate_read},
};

const option_group device_option_group = {"Device", device_options, countof(device_options)};

static bool setting_read(render_request *request, const setting_info *info, const char *value, setting_error *error)
{
    return settings_set(&request->settings, info, value, error);
}

static bool scene_read(render_request *request, const char *word)
{
    const bool is_first = !request->scene;
    if (!is_first) {
        log_error("one SCENE is enough: \"%s\" and \"%s\"; see lanternfield render --help", request->scene, word);
    }
    request->scene = word;
    return is_first;
}

static command_syntax render_syntax(void)
{
    return (command_syntax){
        .command = "render",
        .groups = {{"Files", output_options, countof(output_options)},
                   {"View and light", view_options, countof(view_options)},
                   device_option_group},
        .setting_read = setting_read,
        .word_read = scene_read,
    };
}

// ---- Help

void render_help_print(FILE *out)
{
    fputs("usage: lanternfield render SCENE [OPTION...]\n"
          "Renders a .gltf or .glb scene. Units are glTF's: metres, candela, lux, nits.\n",
          out);
    const command_syntax syntax = render_syntax();
    options_help_print(out, &syntax);
    char names[160];
    aov_names_print(names, sizeof(names));
    fprintf(
        out,
        "\nParts of the picture (--aov): %s\n"
        "  depth is in metres along the view, 0 where nothing is; direct and indirect (unshadowed) are in nits;\n"
        "  normal is in world space; shadow-u, shadow-s and shadow-ratio are the estimates behind the shadows.\n"
        "  Methods other than lgh make albedo, normal and depth only.\n"
        "\nThe references (--method path, vpl) get better until they have all their samples or VPLs, or are as\n"
        "good as --until asks, and take as many frames as that needs. With --state FILE they go on where they\n"
        "were stopped, killed or finished; FILE is saved every few seconds. Settings that a method does not\n"
        "read change nothing.\n"
        "\n--target-ms and --target-error choose vpls, alpha, interleave, shadow-samples and ray-budget from where\n"
        "these are set, say so whenever they change them, and end when they have settled, or after --frames\n"
        "(default 60 and 600). The error is the relative L2 error of the indirect light, estimated at probe\n"
        "pixels against all VPLs with shadow rays, with the noise of the VPLs themselves. --target-ms depends on\n"
        "measured times, so two runs may differ; --target-error does not.\n"
        "\nCtrl-C writes what there is. Exit codes: 0 done, 1 failed (also a value that cannot be used),\n"
        "2 wrong usage, 130 interrupted.\n",
        names);
}

// ---- Reading the command line

// Settings that the method does not read are let pass, so that methods can be compared by changing one word; what the
// user would wait for in vain is not.
bool render_request_fits(const render_request *request)
{
    const render_settings *const settings = &request->settings;
    char method[32], only[32];
    settings_get(settings, settings_find("method"), method);
    settings_get(settings, settings_find("only"), only);
    if (request->state && settings->method != METHOD_PATH && settings->method != METHOD_VPL) {
        log_error("--state: --method %s has no state to keep, only path and vpl have", method);
        return false;
    }
    if (settings->until > 0 && settings->method != METHOD_PATH) {
        log_error("--until: --method %s does not estimate its error, only path does", method);
        return false;
    }
    if (settings->only == ONLY_INDIRECT_UNSHADOWED && settings->method == METHOD_PATH) {
        log_error("--only %s: --method %s has no unshadowed light", only, method);
        return false;
    }
    const char *const refusal = automatic_refusal(settings);
    if (refusal) {
        log_error("%s", refusal);
        return false;
    }
    if (request->has_time && !request->animation) {
        log_error("--time: nothing moves without --animation");
        return false;
    }
    for (uint32_t i = 0; i < request->aov_count; i++) {
        const struct aov_info *const aov = request->aovs[i].aov;
        if (!aov_is_made_by(aov, settings->method)) {
            log_error("--aov %s: --method %s does not make it", aov_name(aov), method);
            return false;
        }
    }
    return true;
}

// Where --frames is not given. Automatic settings end by themselves, so it only says when to give up.
static void frames_complete(render_settings *settings)
{
    if (settings->frames == 0) {
        settings->frames = settings->target_ms > 0      ? 60
                           : settings->target_error > 0 ? 600
                                                        : render_settings_default().frames;
    }
}

int render_options_read(int argc, char **argv, render_request *request)
{
    *request = (render_request){.settings = render_settings_default()};
    request->settings.frames = 0; // not given
    const command_syntax syntax = render_syntax();
    const int code = command_line_read(&syntax, argc, argv, request);
    if (code != EXIT_DONE || request->help) {
        return code;
    }
    if (!request->scene) {
        log_error("render needs a SCENE; see lanternfield render --help");
        return EXIT_WRONG_USAGE;
    }
    frames_complete(&request->settings);
    if (request->output_count == 0) {
        request->outputs[request->output_count++] = "out.png";
    }
    return render_request_fits(request) ? EXIT_DONE : EXIT_FAILED;
}
