// The `lanternfield` command: reads its first word and hands over.
#include "lanternfield_bench.h"
#include "lanternfield_play.h"
#include "lanternfield_stability.h"

#include <string.h>

static const char help[] =
    "lanternfield " LANTERNFIELD_VERSION ": renders glTF scenes with a lighting grid hierarchy on Vulkan\n"
    "\n"
    "usage:\n"
    "  lanternfield render SCENE [OPTION...]   render a picture; by default out.png, 1280x720, 100000 virtual lights\n"
    "  lanternfield compare REF IMG...         error measures of pictures against a reference, and error maps\n"
    "  lanternfield bench SUITE.json -o DIR    measure a suite of configurations: CSV, charts, report; can be resumed\n"
    "  lanternfield play SCRIPT.json           frames or a movie of a playback script; can be resumed\n"
    "  lanternfield stability SCRIPT.json -o DIR  measures over time of a playback script, against references: report\n"
    "  lanternfield info SCENE                 triangles, materials, lights, animations, cameras, bounds, warnings\n"
    "  lanternfield devices                    Vulkan devices, and for each what it lacks\n"
    "  lanternfield COMMAND --help             all options of the first five, with units and defaults\n"
    "  lanternfield --version\n"
    "\n"
    "SCENE is a .gltf or .glb file. Units are glTF's: metres, candela, lux, nits; angles are in degrees.\n"
    "Exit codes: 0 done, 1 failed (also a value that cannot be used), 2 wrong usage, 130 interrupted.\n";

static bool is_help(const char *word)
{
    return strcmp(word, "--help") == 0 || strcmp(word, "-h") == 0;
}

static int wrong_usage(const char *what, const char *word)
{
    log_error("%s%s; see lanternfield --help", what, word);
    return EXIT_WRONG_USAGE;
}

static int render_command(int argc, char **argv)
{
    render_request request;
    const int code = render_options_read(argc, argv, &request);
    if (code != EXIT_DONE) {
        return code;
    }
    if (request.help) {
        render_help_print(stdout);
        return EXIT_DONE;
    }
    return render_run(&request);
}

static int info_command(int argc, char **argv)
{
    if (argc != 1) {
        return argc == 0 ? wrong_usage("info needs a SCENE", "")
                         : wrong_usage("info takes one SCENE, not also ", argv[1]);
    }
    if (argv[0][0] == '-') {
        return wrong_usage("unknown option ", argv[0]);
    }
    scene_data *const scene = scene_load(argv[0]);
    if (!scene) {
        return EXIT_FAILED;
    }
    scene_print_info(scene, stdout);
    scene_destroy(scene);
    return EXIT_DONE;
}

static int devices_command(int argc, char **argv)
{
    if (argc != 0) {
        return wrong_usage("devices takes no argument, got ", argv[0]);
    }
    return gpu_devices_print(stdout) > 0 ? EXIT_DONE : EXIT_FAILED;
}

int main(int argc, char **argv)
{
    static const struct {
        const char *name;
        int (*run)(int argc, char **argv); // the words behind the name
        bool has_help; // of its own
    } commands[] = {
        {"render", render_command, true},       {"compare", compare_command, true}, {"bench", bench_command, true},
        {"stability", stability_command, true}, {"play", play_command, true},       {"info", info_command, false},
        {"devices", devices_command, false},
    };

    if (argc < 2) {
        return wrong_usage("a command is missing", "");
    }
    if (is_help(argv[1])) {
        fputs(help, stdout);
        return EXIT_DONE;
    }
    if (strcmp(argv[1], "--version") == 0) {
        puts("lanternfield " LANTERNFIELD_VERSION);
        return EXIT_DONE;
    }
    for (size_t i = 0; i < countof(commands); i++) {
        if (strcmp(argv[1], commands[i].name) != 0) {
            continue;
        }
        if (argc > 2 && is_help(argv[2]) && !commands[i].has_help) {
            fputs(help, stdout);
            return EXIT_DONE;
        }
        return commands[i].run(argc - 2, argv + 2);
    }
    return wrong_usage("unknown command ", argv[1]);
}
