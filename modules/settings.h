// Every setting of a render in one plain struct, and one table that describes them: the command line, --help, and later
// suites and playback scripts are all read through the table.
#pragma once

#include "engine/base.h"

typedef enum render_method { METHOD_LGH, METHOD_PATH, METHOD_VPL, METHOD_IR } render_method;
typedef enum ray_method { RAYS_AUTO, RAYS_QUERY, RAYS_PIPELINE, RAYS_EMBREE } ray_method;
typedef enum render_only { ONLY_ALL, ONLY_DIRECT, ONLY_INDIRECT, ONLY_INDIRECT_UNSHADOWED } render_only;
typedef enum lighting_method { LIGHTING_GATHER, LIGHTING_VOLUMES } lighting_method;
typedef enum grid_method { GRID_SCENE, GRID_WORLD, GRID_BOUNDS } grid_method;
typedef enum lgh_build_method { LGH_BUILD_RESTRICT, LGH_BUILD_GATHER, LGH_BUILD_SCATTER } lgh_build_method;
typedef enum lgh_s1_method { LGH_S1_ORDERED, LGH_S1_ATOMIC } lgh_s1_method;
typedef enum end_point { END_POINT_CENTRE, END_POINT_JITTER, END_POINT_VPL } end_point;
typedef enum reservoir_method { RESERVOIRS_EXACT, RESERVOIRS_UNLOCKED } reservoir_method;
typedef enum blend_method { BLEND_LATE, BLEND_PAPER } blend_method;
typedef enum taa_target { TAA_RATIO, TAA_LIGHT } taa_target;
typedef enum sampling_method { SAMPLING_IMPORTANCE, SAMPLING_UNIFORM } sampling_method;

typedef struct render_settings {
    uint32_t width, height; // pixels
    uint32_t method;
    uint32_t
        rays; // who traces them; RAYS_AUTO: Embree where the device is a CPU, else query where it can, else pipeline
    bool ray_order; // rays are compacted and ordered before a GPU traces them
    float ray_budget; // indirect shadow rays per pixel on average, at most shadow_samples; 0: shadow_samples everywhere
    uint32_t vpls; // slots, 0 to 2,500,000
    uint32_t bounces; // indirect bounces, 1 to 8
    uint32_t many_lights; // more point lights than this join the hierarchy, see renderer_light_slots
    float alpha; // r_l = alpha * h_l; > 0
    uint32_t levels; // 0: automatic
    uint32_t grid; // where the hierarchy's grid lies
    uint32_t lighting; // who adds up the grid lights at a pixel
    uint32_t shadow_samples; // reservoirs and shadow rays per pixel, 0 to 8; 0: no indirect shadows
    uint32_t interleave; // 1, 2 or 4
    uint32_t emission; // EMISSION_*
    uint32_t blend; // where a level gives way to the next: see lgh_blend in shaders/lgh_shade.glsl.h
    uint32_t end_point;
    uint32_t build;
    uint32_t s1;
    bool incremental; // what did not change since the last frame is not traced and built again
    uint32_t reservoirs;
    uint32_t sampling;
    uint32_t start_level; // 0: the VPLs themselves are the lowest level; 1
    bool sample_s1; // S1 (and S0) take part in the shadow sampling
    bool filter;
    bool taa;
    uint32_t taa_target; // what it steadies of the indirect light: the shadow ratio, or their product
    float singularity; // b as a fraction of the scene's radius: 1 / (d^2 + b^2)
    uint32_t only;
    uint32_t subdivision_max; // finest level of subdivided meshes, 0 to 5; 0: control cages are drawn as they are
    uint32_t seed;
    bool auto_exposure;
    float exposure; // EV, when not automatic
    float target_ms; // automatic settings: frame time in milliseconds; 0: none
    float target_error; // automatic settings: relative L2 error; 0: none. Not both
    uint32_t frames; // rendered; the last is written. The progressive methods (path, vpl) take as many as they need
    uint32_t spp; // path: samples per pixel at most
    float until; // path: stops at this estimated relative error; 0: never
    uint32_t ir_vpls; // ir: slots for VPLs, in place of `vpls`
} render_settings;

render_settings render_settings_default(void);

typedef enum setting_type {
    SETTING_UINT,
    SETTING_FLOAT,
    SETTING_ENUM,
    SETTING_TRUE,
    SETTING_FALSE,
    SETTING_SPECIAL
} setting_type;
typedef struct setting_error {
    char message[256];
    bool out_of_range; // the text has the right form, its value cannot be used; false: the text is not understood
} setting_error;
typedef struct setting_info {
    const char *name; // "shadow-samples": the option without its dashes, and the key in files
    setting_type type; // TRUE and FALSE: switches without a value that set the field so
    size_t offset; // into render_settings
    double min, max; // inclusive
    bool above_min; // `min` itself is not allowed
    const char *const *values; // SETTING_ENUM: names by value, NULL-terminated
    // SETTING_SPECIAL reads and prints itself; `expected` completes "expected ...".
    bool (*read)(render_settings *settings, const char *text, bool *out_of_range);
    void (*print)(const render_settings *settings, char text[32]);
    const char *expected;
    const char *value_name; // for --help: "N", "WxH", "B"; NULL: the names of an enum, nothing for a switch
    const char *help; // one line with the unit and the range; settings_get of the defaults gives the default
} setting_info;
// All settings, in the order of --help. `count` is written.
const setting_info *settings_table(uint32_t *count);
const setting_info *settings_find(const char *name); // NULL when unknown
// Sets one from text ("100000", "AB", "1280x720", "auto"); switches take NULL, "true" or "false". On failure returns
// false, changes nothing, and `error` says what was expected: `--alpha: expected ..., got "x"`.
bool settings_set(render_settings *settings, const setting_info *info, const char *text, setting_error *error);
// The value as text that settings_set reads back to the same value.
void settings_get(const render_settings *settings, const setting_info *info, char text[32]);
// Whether all settings have the same values; padding does not count.
bool settings_equal(const render_settings *a, const render_settings *b);
