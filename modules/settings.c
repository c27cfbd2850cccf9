// The table of settings, and reading and printing values through it: see settings.h.
#include "settings.h"

#include "shaders/shared.h"
#include "subdivision.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIZE_MAX_PIXELS = 16384, EXPOSURE_MAX = 64 };

render_settings render_settings_default(void)
{
    return (render_settings){
        .width = 1280,
        .height = 720,
        .method = METHOD_LGH,
        .rays = RAYS_AUTO,
        .ray_order = true,
        .ray_budget = 0,
        .vpls = 100000,
        .bounces = 3,
        .many_lights = 256,
        .alpha = 1,
        .levels = 0,
        .grid = GRID_SCENE,
        .lighting = LIGHTING_GATHER,
        .shadow_samples = 1,
        .interleave = 1,
        .emission = EMISSION_AB,
        .blend = BLEND_LATE,
        .end_point = END_POINT_VPL,
        .build = LGH_BUILD_RESTRICT,
        .s1 = LGH_S1_ORDERED,
        .incremental = true,
        .reservoirs = RESERVOIRS_EXACT,
        .sampling = SAMPLING_IMPORTANCE,
        .start_level = 0,
        .sample_s1 = true,
        .filter = true,
        .taa = true,
        .taa_target = TAA_RATIO,
        .singularity = 0.003f,
        .only = ONLY_ALL,
        .subdivision_max = 3,
        .seed = 1,
        .auto_exposure = true,
        .exposure = 0,
        .target_ms = 0,
        .target_error = 0,
        .frames = 8,
        .spp = 64,
        .until = 0,
        .ir_vpls = 300,
    };
}

// ---- Numbers. Stricter than strtod: no blanks, no hexadecimal, no "nan", nothing behind the number.

static bool number_read(const char *text, double *value)
{
    if (!*text || strspn(text, "0123456789+-.eE") != strlen(text)) {
        return false;
    }
    char *end;
    *value = strtod(text, &end);
    return *end == '\0';
}

// Clamped to what a long long holds, which no setting's range comes near. `*end` is the first character behind it.
static bool integer_read(const char *text, long long *value, const char **end)
{
    const char *const digits = text + (*text == '-' || *text == '+');
    if (!isdigit((unsigned char)*digits)) {
        return false;
    }
    char *stop;
    *value = strtoll(text, &stop, 10);
    *end = stop;
    return true;
}

static bool uint_read(const char *text, double min, double max, uint32_t *value, bool *out_of_range)
{
    const char *end;
    long long number;
    if (!integer_read(text, &number, &end) || *end) {
        return false;
    }
    *out_of_range = (double)number < min || (double)number > max;
    if (*out_of_range) {
        return false;
    }
    *value = (uint32_t)number;
    return true;
}

static bool float_read(const char *text, const setting_info *info, float *value, bool *out_of_range)
{
    double number;
    if (!number_read(text, &number)) {
        return false;
    }
    // In the range as a float too: 1e-60 rounds to 0.
    const float rounded = (float)number;
    *out_of_range = !(rounded >= info->min && number <= info->max) || (info->above_min && rounded <= info->min);
    if (*out_of_range) {
        return false;
    }
    *value = rounded;
    return true;
}

// The shortest decimal that reads back to the same float.
static void float_print(float value, char text[32])
{
    for (int digits = 1; digits <= 9; digits++) {
        snprintf(text, 32, "%.*g", digits, (double)value);
        if (strtof(text, NULL) == value) {
            return;
        }
    }
}

// One of NULL-terminated names, by its place.
static bool enum_read(const char *text, const char *const *names, uint32_t *value)
{
    for (uint32_t i = 0; names[i]; i++) {
        if (strcmp(names[i], text) == 0) {
            *value = i;
            return true;
        }
    }
    return false;
}

// ---- Settings with a form of their own

static bool size_read(render_settings *settings, const char *text, bool *out_of_range)
{
    const char *end;
    long long width, height = 0;
    if (!integer_read(text, &width, &end) || (*end == 'x' && !integer_read(end + 1, &height, &end)) || *end) {
        return false;
    }
    // A lone number ("0") is a size that lacks its height, so it is refused as a value.
    *out_of_range = width < 1 || height < 1 || width > SIZE_MAX_PIXELS || height > SIZE_MAX_PIXELS;
    if (*out_of_range) {
        return false;
    }
    settings->width = (uint32_t)width;
    settings->height = (uint32_t)height;
    return true;
}

static void size_print(const render_settings *settings, char text[32])
{
    snprintf(text, 32, "%ux%u", settings->width, settings->height);
}

static bool levels_read(render_settings *settings, const char *text, bool *out_of_range)
{
    if (strcmp(text, "auto") == 0) {
        settings->levels = 0;
        return true;
    }
    return uint_read(text, 1, LGH_EXPONENTS, &settings->levels, out_of_range);
}

static void levels_print(const render_settings *settings, char text[32])
{
    snprintf(text, 32, "%u", settings->levels);
    if (settings->levels == 0) {
        strcpy(text, "auto");
    }
}

static bool interleave_read(render_settings *settings, const char *text, bool *out_of_range)
{
    uint32_t n = 0;
    if (!uint_read(text, 1, 4, &n, out_of_range)) {
        return false;
    }
    if (n == 3) {
        *out_of_range = true;
        return false;
    }
    settings->interleave = n;
    return true;
}

static void interleave_print(const render_settings *settings, char text[32])
{
    snprintf(text, 32, "%u", settings->interleave);
}

static bool exposure_read(render_settings *settings, const char *text, bool *out_of_range)
{
    static const setting_info range = {.min = -EXPOSURE_MAX, .max = EXPOSURE_MAX};
    const bool automatic = strcmp(text, "auto") == 0;
    if (!automatic && !float_read(text, &range, &settings->exposure, out_of_range)) {
        return false;
    }
    settings->auto_exposure = automatic;
    return true;
}

static void exposure_print(const render_settings *settings, char text[32])
{
    float_print(settings->exposure, text);
    if (settings->auto_exposure) {
        strcpy(text, "auto");
    }
}

static const char *const taa_names[] = {[TAA_RATIO] = "ratio", [TAA_LIGHT] = "light", "off", NULL};

static bool taa_read(render_settings *settings, const char *text, bool *out_of_range)
{
    (void)out_of_range;
    uint32_t value;
    if (!enum_read(text, taa_names, &value)) {
        return false;
    }
    settings->taa = value <= TAA_LIGHT;
    settings->taa_target = settings->taa ? value : TAA_RATIO;
    return true;
}

static void taa_print(const render_settings *settings, char text[32])
{
    strcpy(text, settings->taa ? taa_names[settings->taa_target] : "off");
}

// ---- The table

static const char *const method_names[] = {
    [METHOD_LGH] = "lgh", [METHOD_PATH] = "path", [METHOD_VPL] = "vpl", [METHOD_IR] = "ir", NULL,
};
static const char *const ray_names[] = {
    [RAYS_AUTO] = "auto", [RAYS_QUERY] = "query", [RAYS_PIPELINE] = "pipeline", [RAYS_EMBREE] = "embree", NULL,
};
static const char *const only_names[] = {
    [ONLY_ALL] = "all",
    [ONLY_DIRECT] = "direct",
    [ONLY_INDIRECT] = "indirect",
    [ONLY_INDIRECT_UNSHADOWED] = "indirect-unshadowed",
    NULL,
};
static const char *const lighting_names[] = {[LIGHTING_GATHER] = "gather", [LIGHTING_VOLUMES] = "volumes", NULL};
static const char *const grid_names[] = {
    [GRID_SCENE] = "scene", [GRID_WORLD] = "world", [GRID_BOUNDS] = "bounds", NULL};
static const char *const build_names[] = {
    [LGH_BUILD_RESTRICT] = "restrict",
    [LGH_BUILD_GATHER] = "gather",
    [LGH_BUILD_SCATTER] = "scatter",
    NULL,
};
static const char *const s1_names[] = {[LGH_S1_ORDERED] = "ordered", [LGH_S1_ATOMIC] = "atomic", NULL};
static const char *const end_point_names[] = {
    [END_POINT_CENTRE] = "centre",
    [END_POINT_JITTER] = "jitter",
    [END_POINT_VPL] = "vpl",
    NULL,
};
static const char *const blend_names[] = {[BLEND_LATE] = "late", [BLEND_PAPER] = "paper", NULL};
static const char *const reservoir_names[] = {[RESERVOIRS_EXACT] = "exact", [RESERVOIRS_UNLOCKED] = "unlocked", NULL};
static const char *const sampling_names[] = {
    [SAMPLING_IMPORTANCE] = "importance",
    [SAMPLING_UNIFORM] = "uniform",
    NULL,
};
static const char *const emission_names[] = {
    [EMISSION_DEMO] = "demo", [EMISSION_MEAN_NORMAL] = "mean-normal",
    [EMISSION_A] = "A",       [EMISSION_B] = "B",
    [EMISSION_AB] = "AB",     NULL,
};

#define FIELD(field) .offset = offsetof(render_settings, field)
static const setting_info table[] = {
    {.name = "size",
     .type = SETTING_SPECIAL,
     .read = size_read,
     .print = size_print,
     .expected = "WIDTHxHEIGHT, each from 1 to 16384 pixels",
     .value_name = "WxH",
     .help = "size in pixels, each 1 to 16384"},
    {.name = "method",
     .type = SETTING_ENUM,
     FIELD(method),
     .values = method_names,
     .help = "lighting grid hierarchy; references: path tracing, every VPL at every pixel; instant radiosity"},
    {.name = "rays",
     .type = SETTING_ENUM,
     FIELD(rays),
     .values = ray_names,
     .help = "who traces rays; auto: Embree where the device is a CPU, else query, else pipeline"},
    {.name = "no-ray-order",
     .type = SETTING_FALSE,
     FIELD(ray_order),
     .help = "trace rays on a GPU in the order of the pixels"},
    {.name = "ray-budget",
     .type = SETTING_FLOAT,
     FIELD(ray_budget),
     .max = 8,
     .value_name = "R",
     .help = "indirect shadow rays a pixel on average, up to --shadow-samples; 0: --shadow-samples at every pixel"},
    {.name = "vpls",
     .type = SETTING_UINT,
     FIELD(vpls),
     .max = 2500000,
     .value_name = "N",
     .help = "slots for virtual point lights, 0 to 2500000; 0: no indirect light"},
    {.name = "bounces",
     .type = SETTING_UINT,
     FIELD(bounces),
     .min = 1,
     .max = 8,
     .value_name = "N",
     .help = "indirect bounces, 1 to 8"},
    {.name = "many-lights",
     .type = SETTING_UINT,
     FIELD(many_lights),
     .max = 1 << 20,
     .value_name = "N",
     .help = "more point lights than this are lit by the hierarchy, as virtual ones are; fewer one by one"},
    {.name = "alpha",
     .type = SETTING_FLOAT,
     FIELD(alpha),
     .max = 16,
     .above_min = true,
     .value_name = "A",
     .help = "radius of a grid light in cells of its level, up to 16; larger is smoother, slower and truer"},
    {.name = "levels",
     .type = SETTING_SPECIAL,
     .read = levels_read,
     .print = levels_print,
     .expected = "\"auto\" or a whole number from 1 to 9",
     .value_name = "auto|N",
     .help = "levels of the hierarchy, 1 to 9"},
    {.name = "grid",
     .type = SETTING_ENUM,
     FIELD(grid),
     .values = grid_names,
     .help = "the hierarchy's grid: around the scene, at powers of two in the world, or around the lights' bounds"},
    {.name = "lighting",
     .type = SETTING_ENUM,
     FIELD(lighting),
     .values = lighting_names,
     .help = "who adds up a pixel's grid lights: lists per cell, or the paper's rasterised light volumes"},
    {.name = "shadow-samples",
     .type = SETTING_UINT,
     FIELD(shadow_samples),
     .max = 8,
     .value_name = "K",
     .help = "shadow rays a pixel for indirect light, 0 to 8; 0: no indirect shadows"},
    {.name = "interleave",
     .type = SETTING_SPECIAL,
     .read = interleave_read,
     .print = interleave_print,
     .expected = "1, 2 or 4",
     .value_name = "1|2|4",
     .help = "a pixel takes one in N x N of the grid lights"},
    {.name = "emission",
     .type = SETTING_ENUM,
     FIELD(emission),
     .values = emission_names,
     .help = "how a grid light emits over directions"},
    {.name = "blend",
     .type = SETTING_ENUM,
     FIELD(blend),
     .values = blend_names,
     .help = "where a level gives way to the next; late keeps coarse lights farther away"},
    {.name = "end-point",
     .type = SETTING_ENUM,
     FIELD(end_point),
     .values = end_point_names,
     .help = "where a shadow ray ends within its grid light"},
    {.name = "start-level",
     .type = SETTING_UINT,
     FIELD(start_level),
     .max = 1,
     .value_name = "0|1",
     .help = "lowest level used; 0: the virtual point lights themselves"},
    {.name = "no-sample-s1",
     .type = SETTING_FALSE,
     FIELD(sample_s1),
     .help = "the paper's shadow sampling: S1 takes part only where no other level reaches"},
    {.name = "sampling",
     .type = SETTING_ENUM,
     FIELD(sampling),
     .values = sampling_names,
     .help = "choice of the lights that get shadow rays"},
    {.name = "reservoirs",
     .type = SETTING_ENUM,
     FIELD(reservoirs),
     .values = reservoir_names,
     .help = "of --lighting volumes; exact: the same picture each run; unlocked: the paper's races"},
    {.name = "build",
     .type = SETTING_ENUM,
     FIELD(build),
     .values = build_names,
     .help = "how the levels above S1 are made; gather and scatter are the paper's"},
    {.name = "s1",
     .type = SETTING_ENUM,
     FIELD(s1),
     .values = s1_names,
     .help = "how S1 is made; ordered: the same bits each run; atomic: the paper's"},
    {.name = "no-incremental",
     .type = SETTING_FALSE,
     FIELD(incremental),
     .help = "trace and build everything anew in every frame"},
    {.name = "singularity",
     .type = SETTING_FLOAT,
     FIELD(singularity),
     .max = 1,
     .value_name = "B",
     .help = "b in 1 / (d^2 + b^2) as a fraction of the scene's radius, 0 to 1"},
    {.name = "only", .type = SETTING_ENUM, FIELD(only), .values = only_names, .help = "render one part of the light"},
    {.name = "no-filter", .type = SETTING_FALSE, FIELD(filter), .help = "leave the shadows unfiltered"},
    {.name = "taa",
     .type = SETTING_SPECIAL,
     .read = taa_read,
     .print = taa_print,
     .expected = "one of ratio, light, off",
     .value_name = "ratio|light|off",
     .help = "temporal anti-aliasing of the shadows, or of the shadowed indirect light, which lags"},
    {.name = "no-taa", .type = SETTING_FALSE, FIELD(taa), .help = "the same as --taa off"},
    {.name = "subdivision-max",
     .type = SETTING_UINT,
     FIELD(subdivision_max),
     .max = SUBDIVISION_LEVELS_MAX,
     .value_name = "N",
     .help = "finest level of subdivided meshes, 0 to 5; coarser ones are taken far away; 0: cages as they are"},
    {.name = "seed",
     .type = SETTING_UINT,
     FIELD(seed),
     .max = UINT32_MAX,
     .value_name = "N",
     .help = "seed of all random numbers, 0 to 4294967295"},
    {.name = "exposure",
     .type = SETTING_SPECIAL,
     .read = exposure_read,
     .print = exposure_print,
     .expected = "\"auto\" or a number from -64 to 64",
     .value_name = "auto|EV",
     .help = "the PNG shows radiance times 2^EV; auto: log-average at 0.18"},
    {.name = "target-ms",
     .type = SETTING_FLOAT,
     FIELD(target_ms),
     .max = 100000,
     .value_name = "T",
     .help = "choose settings for frames of so many milliseconds; 0: as set"},
    {.name = "target-error",
     .type = SETTING_FLOAT,
     FIELD(target_error),
     .max = 1,
     .value_name = "E",
     .help = "choose settings for this relative error (0.05 is 5 %), up to 1; 0: as set"},
    {.name = "frames",
     .type = SETTING_UINT,
     FIELD(frames),
     .min = 1,
     .max = 1000000,
     .value_name = "N",
     .help = "lgh: frames rendered so that temporal history settles, 1 to 1000000; the last is written"},
    {.name = "spp",
     .type = SETTING_UINT,
     FIELD(spp),
     .min = 1,
     .max = 1 << 24,
     .value_name = "N",
     .help = "path: samples a pixel, 1 to 16777216"},
    {.name = "until",
     .type = SETTING_FLOAT,
     FIELD(until),
     .max = 1,
     .value_name = "E",
     .help = "path: stop at this estimated relative error (0.01 is 1 %), 0 to 1; 0: after all samples"},
    {.name = "ir-vpls",
     .type = SETTING_UINT,
     FIELD(ir_vpls),
     .min = 1,
     .max = 65536,
     .value_name = "N",
     .help = "ir: slots for virtual point lights, in place of --vpls, 1 to 65536"},
};
#undef FIELD

const setting_info *settings_table(uint32_t *count)
{
    *count = countof(table);
    return table;
}

const setting_info *settings_find(const char *name)
{
    for (size_t i = 0; i < countof(table); i++) {
        if (strcmp(table[i].name, name) == 0) {
            return &table[i];
        }
    }
    return NULL;
}

// ---- Reading and printing through the table

static bool switch_read(const char *text, bool when_on, bool *value)
{
    const bool on = !text || strcmp(text, "true") == 0;
    if (!on && strcmp(text, "false") != 0) {
        return false;
    }
    *value = on ? when_on : !when_on;
    return true;
}

static bool value_read(render_settings *settings, const setting_info *info, const char *text, bool *out_of_range)
{
    void *const field = (char *)settings + info->offset;
    switch (info->type) {
    case SETTING_UINT:
        return uint_read(text, info->min, info->max, field, out_of_range);
    case SETTING_FLOAT:
        return float_read(text, info, field, out_of_range);
    case SETTING_ENUM:
        return enum_read(text, info->values, field);
    case SETTING_TRUE:
        return switch_read(text, true, field);
    case SETTING_FALSE:
        return switch_read(text, false, field);
    case SETTING_SPECIAL:
        return info->read(settings, text, out_of_range);
    }
    return false;
}

// "one of a, b, c"
static void names_print(const char *const *names, char *text, size_t size)
{
    size_t length = (size_t)snprintf(text, size, "one of");
    for (uint32_t i = 0; names[i]; i++) {
        length += (size_t)snprintf(text + length, size - length, "%s%s", i ? ", " : " ", names[i]);
        assert(length < size);
    }
}

static void expected_print(const setting_info *info, char *text, size_t size)
{
    switch (info->type) {
    case SETTING_UINT:
        snprintf(text, size, "a whole number from %.0f to %.0f", info->min, info->max);
        break;
    case SETTING_FLOAT:
        snprintf(text, size, "a number %s %g and at most %g", info->above_min ? "greater than" : "of at least",
                 info->min, info->max);
        break;
    case SETTING_ENUM:
        names_print(info->values, text, size);
        break;
    case SETTING_TRUE:
    case SETTING_FALSE:
        snprintf(text, size, "no value, true or false");
        break;
    case SETTING_SPECIAL:
        snprintf(text, size, "%s", info->expected);
        break;
    }
}

bool settings_set(render_settings *settings, const setting_info *info, const char *text, setting_error *error)
{
    const bool is_switch = info->type == SETTING_TRUE || info->type == SETTING_FALSE;
    error->out_of_range = false;
    if ((text || is_switch) && value_read(settings, info, text, &error->out_of_range)) {
        return true;
    }
    char expected[128];
    expected_print(info, expected, sizeof(expected));
    if (text) {
        // What was given is cut, so that the line stays whole.
        snprintf(error->message, sizeof(error->message), "--%s: expected %s, got \"%.40s\"", info->name, expected,
                 text);
    } else {
        snprintf(error->message, sizeof(error->message), "--%s: expected %s", info->name, expected);
    }
    return false;
}

void settings_get(const render_settings *settings, const setting_info *info, char text[32])
{
    const void *const field = (const char *)settings + info->offset;
    switch (info->type) {
    case SETTING_UINT:
        snprintf(text, 32, "%u", *(const uint32_t *)field);
        break;
    case SETTING_FLOAT:
        float_print(*(const float *)field, text);
        break;
    case SETTING_ENUM:
        snprintf(text, 32, "%s", info->values[*(const uint32_t *)field]);
        break;
    case SETTING_TRUE:
    case SETTING_FALSE:
        strcpy(text, *(const bool *)field == (info->type == SETTING_TRUE) ? "true" : "false");
        break;
    case SETTING_SPECIAL:
        info->print(settings, text);
        break;
    }
}

bool settings_equal(const render_settings *a, const render_settings *b)
{
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        char texts[2][32];
        settings_get(a, &table[i], texts[0]);
        settings_get(b, &table[i], texts[1]);
        if (strcmp(texts[0], texts[1]) != 0) {
            return false;
        }
    }
    return true;
}
