// `lanternfield compare`: error measures of pictures against a reference, as a table or as JSON, and maps of the error.
#include "lanternfield_bench.h"

#include "modules/image_file.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef enum map_kind { MAP_DIFFERENCE, MAP_FLIP } map_kind;

typedef struct compare_request { // strings belong to argv
    const char *reference;
    const char **images;
    uint32_t image_count;
    bool json, help;
    const char *map; // NULL: none
    map_kind map_kind;
    double map_range;
    double exposure; // EV; NAN: the reference's own
} compare_request;

// ---- The command line

static const char usage_hint[] = "; see lanternfield compare --help";

static int refuse(const char *option, const char *expected, const char *value)
{
    log_error("%s: expected %s, got \"%.80s\"%s", option, expected, value, usage_hint);
    return EXIT_WRONG_USAGE;
}

static int json_read(compare_request *request, const char *value)
{
    (void)value;
    request->json = true;
    return EXIT_DONE;
}

static int map_read(compare_request *request, const char *value)
{
    request->map = value;
    return path_has_extension(value, ".png") ? EXIT_DONE : refuse("--map", "a file name that ends in .png", value);
}

static int map_kind_read(compare_request *request, const char *value)
{
    request->map_kind = strcmp(value, "flip") == 0 ? MAP_FLIP : MAP_DIFFERENCE;
    const bool known = request->map_kind == MAP_FLIP || strcmp(value, "difference") == 0;
    return known ? EXIT_DONE : refuse("--map-kind", "difference or flip", value);
}

static int map_range_read(compare_request *request, const char *value)
{
    char *end;
    request->map_range = strtod(value, &end);
    if (end == value || *end || !isfinite(request->map_range)) {
        return refuse("--map-range", "a number", value);
    }
    if (request->map_range <= 0) {
        log_error("--map-range: expected a number above 0, got \"%.80s\"", value);
        return EXIT_FAILED;
    }
    return EXIT_DONE;
}

// As `render` reads it.
static int exposure_read(compare_request *request, const char *value)
{
    render_settings settings = render_settings_default();
    setting_error error = {0};
    if (!settings_set(&settings, settings_find("exposure"), value, &error)) {
        log_error("%s%s", error.message, error.out_of_range ? "" : usage_hint);
        return error.out_of_range ? EXIT_FAILED : EXIT_WRONG_USAGE;
    }
    request->exposure = settings.auto_exposure ? NAN : (double)settings.exposure;
    return EXIT_DONE;
}

static int help_read(compare_request *request, const char *value)
{
    (void)value;
    request->help = true;
    return EXIT_DONE;
}

static const struct compare_option {
    const char *name, *value_name; // NULL: takes no value
    const char *help;
    int (*read)(compare_request *request, const char *value); // returns the exit code
} options[] = {
    {"--json", NULL, "print one JSON object; what is infinite is null", json_read},
    {"--map", "FILE.png", "write the error in false colours; of several images FILE-1.png, FILE-2.png, ...", map_read},
    {"--map-kind", "difference|flip", "what the map shows (default difference)", map_kind_read},
    {"--map-range", "X", "difference at which the map's colours end (default 0.5)", map_range_read},
    {"--exposure", "EV", "exposure of all tone-mapped pictures (default auto: the reference's)", exposure_read},
    {"--help", NULL, "print this", help_read},
    {"-h", NULL, NULL, help_read},
};

static void help_print(FILE *out)
{
    fputs("usage: lanternfield compare REF IMG... [OPTION...]\n"
          "Measures the error of each IMG against the reference REF. All are .exr files of linear radiance and of one\n"
          "size.\n\n",
          out);
    for (size_t i = 0; i < countof(options); i++) {
        if (options[i].help) {
            fprintf(out, "  %-12s%-17s%s\n", options[i].name, options[i].value_name ? options[i].value_name : "",
                    options[i].help);
        }
    }
    fputs("\nMeasures (i: image, r: reference)\n", out);
    uint32_t count;
    const image_measure_info *const table = image_measure_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        fprintf(out, "  %-15s%s\n", table[i].name, table[i].help);
    }
    fputs("\nPictures are tone-mapped as `render` writes PNG files, both at the reference's exposure. FLIP is that of\n"
          "Andersson et al. 2020 and 2021 at 67 pixels per degree.\n"
          "The difference map shows the luminance of i - r over the reference's mean luminance: blue is too dark, red\n"
          "too bright. The FLIP map goes from black, 0, to bright yellow, 1.\n"
          "Exit codes: 0 done, 1 failed (also a value that cannot be used), 2 wrong usage.\n",
          out);
}

// Reads the option at argv[*i] and moves on to its value when it has one of its own. Returns the exit code.
static int option_read(int argc, char **argv, int *i, compare_request *request)
{
    const char *const word = argv[*i], *const equals = strchr(word, '=');
    const size_t length = equals ? (size_t)(equals - word) : strlen(word);
    const struct compare_option *option = options;
    while (option < options + countof(options) &&
           (strlen(option->name) != length || strncmp(option->name, word, length) != 0)) {
        option++;
    }
    if (option == options + countof(options)) {
        log_error("unknown option %s%s", word, usage_hint);
        return EXIT_WRONG_USAGE;
    }
    if (!option->value_name && equals) {
        log_error("%s: it takes no value%s", word, usage_hint);
        return EXIT_WRONG_USAGE;
    }
    if (option->value_name && !equals && *i + 1 == argc) {
        log_error("%s: its value is missing%s", word, usage_hint);
        return EXIT_WRONG_USAGE;
    }
    return option->read(request, !option->value_name ? NULL : equals ? equals + 1 : argv[++*i]);
}

static int request_read(int argc, char **argv, compare_request *request)
{
    *request = (compare_request){.map_range = 0.5, .exposure = NAN};
    request->images = memory_alloc((size_t)argc * sizeof(*request->images) + 1);
    for (int i = 0; i < argc && !request->help; i++) {
        if (argv[i][0] == '-') {
            const int code = option_read(argc, argv, &i, request);
            if (code != EXIT_DONE) {
                return code;
            }
        } else if (!request->reference) {
            request->reference = argv[i];
        } else {
            request->images[request->image_count++] = argv[i];
        }
    }
    if (!request->help && request->image_count == 0) {
        log_error("compare needs a reference and at least one image%s", usage_hint);
        return EXIT_WRONG_USAGE;
    }
    return EXIT_DONE;
}

// ---- The comparison

typedef struct comparison {
    const compare_request *request;
    uint32_t width, height;
    float *reference;
    double exposure; // EV
    image_measures *measures; // one an image
    uint8_t **maps; // one an image, sRGB; NULL without --map
} comparison;

// An image of finite values, or NULL.
static float *image_load(const char *path, uint32_t *width, uint32_t *height)
{
    float *const image = image_read_exr(path, width, height);
    const size_t bad = image ? image_find_bad(image, *width, *height) : SIZE_MAX;
    if (bad == SIZE_MAX) {
        return image;
    }
    const float *const rgb = image + 3 * bad;
    log_error("%s: expected finite values, pixel %zu,%zu is %g, %g, %g", path, bad % *width, bad / *width,
              (double)rgb[0], (double)rgb[1], (double)rgb[2]);
    free(image);
    return NULL;
}

// An image of the reference's size, or NULL.
static float *image_load_alike(const comparison *c, const char *path)
{
    uint32_t width, height;
    float *const image = image_load(path, &width, &height);
    if (!image || (width == c->width && height == c->height)) {
        return image;
    }
    log_error("%s is %ux%u, expected the %ux%u of the reference %s", path, width, height, c->width, c->height,
              c->request->reference);
    free(image);
    return NULL;
}

static uint8_t *map_make(const compare_request *request, const image_maps *maps, size_t pixels)
{
    uint8_t *const rgb = memory_alloc(3 * pixels);
    for (size_t i = 0; i < pixels; i++) {
        if (request->map_kind == MAP_FLIP) {
            color_map_sequential(maps->flip[i], rgb + 3 * i);
        } else {
            color_map_diverging((float)(0.5 + 0.5 * (double)maps->difference[i] / request->map_range), rgb + 3 * i);
        }
    }
    return rgb;
}

static bool image_compare(comparison *c, uint32_t i)
{
    float *const image = image_load_alike(c, c->request->images[i]);
    if (!image) {
        return false;
    }
    const size_t pixels = (size_t)c->width * c->height;
    float *const values = memory_alloc(2 * pixels * sizeof(float));
    image_maps maps = {.flip = values, .difference = values + pixels};
    const bool ok = image_measure(image, c->reference, c->width, c->height, c->exposure, &c->measures[i], &maps);
    if (ok && c->request->map) {
        c->maps[i] = map_make(c->request, &maps, pixels);
    }
    free(values);
    free(image);
    return ok;
}

// The map's file for image i: free() it.
static char *map_path(const compare_request *request, uint32_t i)
{
    char *path;
    const int stem = (int)(strlen(request->map) - strlen(".png"));
    const int length = request->image_count == 1
                           ? asprintf(&path, "%s", request->map)
                           : asprintf(&path, "%.*s-%u%s", stem, request->map, i + 1, request->map + stem);
    assert(length >= 0);
    return path;
}

static bool map_paths_check(const compare_request *request)
{
    bool ok = true;
    for (uint32_t i = 0; ok && request->map && i < request->image_count; i++) {
        char *const path = map_path(request, i);
        ok = output_path_check(path);
        free(path);
    }
    return ok;
}

static bool maps_write(const comparison *c)
{
    bool ok = true;
    for (uint32_t i = 0; ok && c->request->map && i < c->request->image_count; i++) {
        char *const path = map_path(c->request, i);
        ok = image_write_png(path, c->maps[i], c->width, c->height, 3);
        free(path);
    }
    return ok;
}

// ---- What is printed

static double measure_get(const image_measures *measures, const image_measure_info *info)
{
    return *(const double *)((const char *)measures + info->offset);
}

static int column_width(const image_measure_info *info)
{
    return (int)max_u32((uint32_t)strlen(info->name), (uint32_t)strlen("1.234e-05"));
}

static void text_print(const comparison *c)
{
    const compare_request *const request = c->request;
    uint32_t count;
    const image_measure_info *const table = image_measure_table(&count);
    int name_width = 0;
    for (uint32_t i = 0; i < request->image_count; i++) {
        name_width = (int)max_u32((uint32_t)name_width, (uint32_t)strlen(request->images[i]));
    }
    printf("reference %s, %ux%u, exposure %.2f EV\n%-*s", request->reference, c->width, c->height, c->exposure,
           name_width, "");
    for (uint32_t k = 0; k < count; k++) {
        printf("  %*s", column_width(&table[k]), table[k].name);
    }
    puts("");
    for (uint32_t i = 0; i < request->image_count; i++) {
        printf("%-*s", name_width, request->images[i]);
        for (uint32_t k = 0; k < count; k++) {
            printf("  %*.4g", column_width(&table[k]), measure_get(&c->measures[i], &table[k]));
        }
        puts("");
    }
}

static void json_print(const comparison *c)
{
    uint32_t count;
    const image_measure_info *const table = image_measure_table(&count);
    cJSON *const root = cJSON_CreateObject();
    cJSON_AddStringToObject(root, "reference", c->request->reference);
    const int size[2] = {(int)c->width, (int)c->height};
    cJSON_AddItemToObject(root, "size", cJSON_CreateIntArray(size, 2));
    cJSON_AddNumberToObject(root, "exposure", c->exposure);
    cJSON *const images = cJSON_AddArrayToObject(root, "images");
    for (uint32_t i = 0; i < c->request->image_count; i++) {
        cJSON *const image = cJSON_CreateObject();
        cJSON_AddItemToArray(images, image);
        cJSON_AddStringToObject(image, "image", c->request->images[i]);
        for (uint32_t k = 0; k < count; k++) {
            cJSON_AddNumberToObject(image, table[k].name, measure_get(&c->measures[i], &table[k]));
        }
    }
    char *const text = cJSON_Print(root);
    assert(text);
    puts(text);
    cJSON_free(text);
    cJSON_Delete(root);
}

// Measures all images before anything is written.
static bool compare_run(const compare_request *request)
{
    if (!map_paths_check(request)) {
        return false;
    }
    comparison c = {.request = request};
    c.measures = memory_alloc(request->image_count * sizeof(*c.measures));
    c.maps = memory_alloc(request->image_count * sizeof(*c.maps));
    c.reference = image_load(request->reference, &c.width, &c.height);
    bool ok = c.reference != NULL;
    if (ok) {
        c.exposure = isnan(request->exposure) ? image_exposure(c.reference, c.width, c.height) : request->exposure;
    }
    for (uint32_t i = 0; ok && i < request->image_count; i++) {
        ok = image_compare(&c, i);
    }
    ok = ok && maps_write(&c);
    if (ok) {
        (request->json ? json_print : text_print)(&c);
    }
    for (uint32_t i = 0; i < request->image_count; i++) {
        free(c.maps[i]);
    }
    free(c.reference);
    free(c.maps);
    free(c.measures);
    return ok;
}

int compare_command(int argc, char **argv)
{
    compare_request request;
    int code = request_read(argc, argv, &request);
    if (code == EXIT_DONE && request.help) {
        help_print(stdout);
    } else if (code == EXIT_DONE) {
        code = compare_run(&request) ? EXIT_DONE : EXIT_FAILED;
    }
    free(request.images);
    return code;
}
