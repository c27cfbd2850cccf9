// The option table: every option reads what it should, refuses what it should, and says so.
#include "modules/settings.h"

#include "shaders/shared.h"
#include "test.h"

static render_settings settings;
static setting_error error;

static bool set(const char *name, const char *text)
{
    const setting_info *const info = settings_find(name);
    assert(info);
    return settings_set(&settings, info, text, &error);
}

static bool refused(const char *name, const char *text, bool out_of_range)
{
    const render_settings before = settings;
    memset(&error, 0, sizeof(error));
    const bool ok = set(name, text);
    // Names the option, repeats what was given, and leaves the settings alone.
    return !ok && error.out_of_range == out_of_range && strncmp(error.message, "--", 2) == 0 &&
           strstr(error.message, name) && strstr(error.message, "expected") && strstr(error.message, text) &&
           memcmp(&before, &settings, sizeof(settings)) == 0;
}

static bool malformed(const char *name, const char *text)
{
    return refused(name, text, false);
}
static bool beyond(const char *name, const char *text)
{
    return refused(name, text, true);
}

TEST(defaults_are_the_documented_ones)
{
    CHECK(settings.width == 1280 && settings.height == 720);
    CHECK(settings.vpls == 100000 && settings.bounces == 3 && settings.alpha == 1 && settings.levels == 0);
    CHECK(settings.shadow_samples == 1 && settings.interleave == 1 && settings.emission == EMISSION_AB);
    CHECK(settings.end_point == END_POINT_VPL && settings.build == LGH_BUILD_RESTRICT && settings.s1 == LGH_S1_ORDERED);
    CHECK(settings.lighting == LIGHTING_GATHER && settings.grid == GRID_SCENE);
    CHECK(settings.reservoirs == RESERVOIRS_EXACT && settings.sampling == SAMPLING_IMPORTANCE);
    CHECK(settings.start_level == 0 && settings.sample_s1 && settings.filter && settings.taa);
    CHECK_NEAR(settings.singularity, 0.003, 1e-9);
    CHECK(settings.only == ONLY_ALL && settings.seed == 1 && settings.auto_exposure && settings.frames == 8);
    CHECK(settings.method == METHOD_LGH && settings.rays == RAYS_AUTO);
    CHECK(settings.many_lights == 256);
    CHECK(settings.spp == 64 && settings.until == 0 && settings.ir_vpls == 300);
}

TEST(every_default_reads_back_as_itself)
{
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        char text[32], again[32];
        settings_get(&settings, &table[i], text);
        CHECK(settings_set(&settings, &table[i], text, &error));
        settings_get(&settings, &table[i], again);
        CHECK_STRING(again, text);
    }
}

TEST(every_setting_has_a_help_line_and_its_own_name)
{
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        CHECK(table[i].help && strlen(table[i].help) > 10);
        CHECK(settings_find(table[i].name) == &table[i]);
        CHECK(table[i].value_name || table[i].type == SETTING_ENUM || table[i].type == SETTING_TRUE ||
              table[i].type == SETTING_FALSE);
    }
    CHECK(settings_find("no-such-setting") == NULL);
}

TEST(size_takes_two_sides_of_1_to_16384_pixels)
{
    CHECK(set("size", "1x16384") && settings.width == 1 && settings.height == 16384);
    CHECK(beyond("size", "0") && beyond("size", "0x0") && beyond("size", "-3x5") && beyond("size", "100000x100000"));
    CHECK(beyond("size", "16385x1") && beyond("size", "99999999999999999999x1") && beyond("size", "640"));
    CHECK(malformed("size", "x") && malformed("size", "640x") && malformed("size", "640x480x1"));
    CHECK(malformed("size", " 640x480") && malformed("size", "640X480") && malformed("size", "1.5x2"));
    CHECK(strstr(error.message, "1 to 16384 pixels"));
}

TEST(whole_numbers_keep_to_their_ranges)
{
    CHECK(set("vpls", "0") && settings.vpls == 0);
    CHECK(set("vpls", "2500000") && settings.vpls == 2500000);
    CHECK(set("seed", "4294967295") && settings.seed == UINT32_MAX);
    CHECK(set("start-level", "1") && settings.start_level == 1);
    CHECK(set("shadow-samples", "8") && settings.shadow_samples == 8);
    CHECK(set("bounces", "8") && settings.bounces == 8);
    CHECK(set("frames", "1") && settings.frames == 1);
    CHECK(beyond("vpls", "-1") && beyond("vpls", "4000001") && beyond("seed", "4294967296"));
    CHECK(beyond("start-level", "2") && beyond("shadow-samples", "9") && beyond("frames", "0"));
    CHECK(beyond("bounces", "0") && beyond("bounces", "9"));
    CHECK(malformed("vpls", "1e5") && malformed("vpls", "10 ") && malformed("vpls", "0x10") &&
          malformed("vpls", "1.5"));
    CHECK(malformed("vpls", "") && malformed("vpls", "ten"));
    CHECK_STRING(error.message, "--vpls: expected a whole number from 0 to 2500000, got \"ten\"");
}

TEST(the_references_have_limits_of_their_own)
{
    CHECK(set("spp", "1") && settings.spp == 1);
    CHECK(set("spp", "16777216") && settings.spp == 1 << 24);
    CHECK(set("ir-vpls", "65536") && settings.ir_vpls == 65536);
    CHECK(set("until", "0.01") && settings.until == 0.01f);
    CHECK(set("until", "0") && settings.until == 0);
    CHECK(set("until", "1") && settings.until == 1);
    CHECK(beyond("spp", "0") && beyond("spp", "16777217") && beyond("ir-vpls", "0") && beyond("ir-vpls", "65537"));
    CHECK(beyond("until", "-0.01") && beyond("until", "1.5"));
    CHECK(malformed("spp", "1e3") && malformed("ir-vpls", "many") && malformed("until", "1%"));
    CHECK_STRING(error.message, "--until: expected a number of at least 0 and at most 1, got \"1%\"");
    CHECK(malformed("method", "lgh,path") && malformed("method", "LGH"));
    CHECK_STRING(error.message, "--method: expected one of lgh, path, vpl, ir, got \"LGH\"");
    CHECK(malformed("rays", "cpu"));
    CHECK_STRING(error.message, "--rays: expected one of auto, query, pipeline, embree, got \"cpu\"");
    CHECK(set("method", "ir") && settings.method == METHOD_IR && set("rays", "embree") && settings.rays == RAYS_EMBREE);
}

TEST(help_says_which_method_a_setting_belongs_to)
{
    static const struct {
        const char *name, *method;
    } settings_of[] = {{"spp", "path:"}, {"until", "path:"}, {"ir-vpls", "ir:"}, {"frames", "lgh"}};
    for (size_t i = 0; i < countof(settings_of); i++) {
        const char *const text = settings_find(settings_of[i].name)->help;
        CHECK(strncmp(text, settings_of[i].method, strlen(settings_of[i].method)) == 0);
    }
}

TEST(alpha_is_greater_than_0_and_at_most_16)
{
    CHECK(set("alpha", "1.5") && settings.alpha == 1.5f);
    CHECK(set("alpha", "16") && settings.alpha == 16.0f);
    CHECK(set("alpha", "5e-1") && settings.alpha == 0.5f);
    CHECK(beyond("alpha", "0") && beyond("alpha", "-1") && beyond("alpha", "16.001") && beyond("alpha", "1e999"));
    CHECK(beyond("alpha", "1e-60")); // 0 as a float
    CHECK(malformed("alpha", "nan") && malformed("alpha", "inf") && malformed("alpha", "1,5") &&
          malformed("alpha", "1e"));
    CHECK(malformed("alpha", "x"));
    CHECK_STRING(error.message, "--alpha: expected a number greater than 0 and at most 16, got \"x\"");
}

TEST(singularity_is_a_fraction)
{
    CHECK(set("singularity", "0") && settings.singularity == 0);
    CHECK(set("singularity", "0.1") && settings.singularity == 0.1f);
    CHECK(beyond("singularity", "-0.1") && beyond("singularity", "1.5") && malformed("singularity", "1%"));
    CHECK_STRING(error.message, "--singularity: expected a number of at least 0 and at most 1, got \"1%\"");
}

TEST(levels_and_exposure_can_be_automatic)
{
    CHECK(set("levels", "9") && settings.levels == 9);
    CHECK(set("levels", "auto") && settings.levels == 0);
    CHECK(beyond("levels", "0") && beyond("levels", "10") && malformed("levels", "Auto"));
    CHECK(set("exposure", "-2.5") && !settings.auto_exposure && settings.exposure == -2.5f);
    CHECK(set("exposure", "auto") && settings.auto_exposure);
    CHECK(beyond("exposure", "65") && malformed("exposure", "-"));
}

TEST(interleave_is_1_2_or_4)
{
    CHECK(set("interleave", "1") && settings.interleave == 1);
    CHECK(set("interleave", "2") && settings.interleave == 2);
    CHECK(set("interleave", "4") && settings.interleave == 4);
    CHECK(beyond("interleave", "3") && beyond("interleave", "0") && beyond("interleave", "8"));
    CHECK(malformed("interleave", "2x2"));
}

TEST(names_set_their_enums_and_errors_list_them)
{
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        if (table[i].type != SETTING_ENUM) {
            continue;
        }
        CHECK(malformed(table[i].name, "nonsense"));
        for (uint32_t v = 0; table[i].values[v]; v++) {
            CHECK(strstr(error.message, table[i].values[v]));
            CHECK(set(table[i].name, table[i].values[v]));
            CHECK(*(const uint32_t *)((const char *)&settings + table[i].offset) == v);
            memset(&error, 0, sizeof(error));
            CHECK(malformed(table[i].name, "nonsense"));
        }
    }
    CHECK(malformed("emission", "C"));
    CHECK_STRING(error.message, "--emission: expected one of demo, mean-normal, A, B, AB, got \"C\"");
    CHECK(set("emission", "mean-normal") && settings.emission == EMISSION_MEAN_NORMAL);
    CHECK(set("only", "indirect-unshadowed") && settings.only == ONLY_INDIRECT_UNSHADOWED);
    CHECK(set("build", "scatter") && settings.build == LGH_BUILD_SCATTER);
    CHECK(set("s1", "atomic") && settings.s1 == LGH_S1_ATOMIC);
    CHECK(set("reservoirs", "unlocked") && settings.reservoirs == RESERVOIRS_UNLOCKED);
    CHECK(set("sampling", "uniform") && settings.sampling == SAMPLING_UNIFORM);
    CHECK(set("end-point", "centre") && settings.end_point == END_POINT_CENTRE);
}

TEST(taa_names_what_it_steadies_or_is_off)
{
    char text[32];
    CHECK(set("taa", "light") && settings.taa && settings.taa_target == TAA_LIGHT);
    settings_get(&settings, settings_find("taa"), text);
    CHECK_STRING(text, "light");
    CHECK(set("taa", "off") && !settings.taa);
    settings_get(&settings, settings_find("taa"), text);
    CHECK_STRING(text, "off");
    CHECK(set("taa", "ratio") && settings.taa && settings.taa_target == TAA_RATIO);
    CHECK(malformed("taa", "true") && malformed("taa", ""));
}

TEST(switches_take_no_value_or_a_truth_value)
{
    CHECK(set("no-filter", NULL) && !settings.filter);
    CHECK(set("no-filter", "false") && settings.filter);
    CHECK(set("no-taa", "true") && !settings.taa);
    CHECK(set("no-taa", "false") && settings.taa);
    CHECK(set("no-sample-s1", NULL) && !settings.sample_s1);
    CHECK(set("no-sample-s1", "false") && settings.sample_s1);
    CHECK(malformed("no-sample-s1", "1"));
}

TEST(an_option_without_its_value_is_refused)
{
    CHECK(!set("vpls", NULL));
    CHECK_STRING(error.message, "--vpls: expected a whole number from 0 to 2500000");
}

TEST(a_long_value_is_cut_in_the_message)
{
    char text[5000];
    memset(text, '7', sizeof(text) - 1);
    text[sizeof(text) - 1] = '\0';
    CHECK(!set("vpls", text) && error.out_of_range);
    CHECK(strlen(error.message) < 200 && error.message[strlen(error.message) - 1] == '"');
}

#define RUN_FRESH(name) (settings = render_settings_default(), RUN(name))

TEST(settings_are_equal_by_their_values)
{
    const render_settings defaults = render_settings_default();
    render_settings a, b; // of different padding
    memset(&a, 0, sizeof a);
    memset(&b, 0xff, sizeof b);
    uint32_t count;
    const setting_info *table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        char text[32];
        setting_error error;
        settings_get(&defaults, &table[i], text);
        CHECK(settings_set(&a, &table[i], text, &error) && settings_set(&b, &table[i], text, &error));
    }
    CHECK(settings_equal(&a, &b) && settings_equal(&a, &defaults));
    b.alpha = nextafterf(b.alpha, 2);
    CHECK(!settings_equal(&a, &b));
    b = a;
    b.height++;
    CHECK(!settings_equal(&a, &b));
}

int main(void)
{
    RUN_FRESH(defaults_are_the_documented_ones);
    RUN_FRESH(every_default_reads_back_as_itself);
    RUN_FRESH(every_setting_has_a_help_line_and_its_own_name);
    RUN_FRESH(size_takes_two_sides_of_1_to_16384_pixels);
    RUN_FRESH(whole_numbers_keep_to_their_ranges);
    RUN_FRESH(the_references_have_limits_of_their_own);
    RUN_FRESH(help_says_which_method_a_setting_belongs_to);
    RUN_FRESH(alpha_is_greater_than_0_and_at_most_16);
    RUN_FRESH(singularity_is_a_fraction);
    RUN_FRESH(levels_and_exposure_can_be_automatic);
    RUN_FRESH(interleave_is_1_2_or_4);
    RUN_FRESH(names_set_their_enums_and_errors_list_them);
    RUN_FRESH(taa_names_what_it_steadies_or_is_off);
    RUN_FRESH(switches_take_no_value_or_a_truth_value);
    RUN_FRESH(an_option_without_its_value_is_refused);
    RUN_FRESH(a_long_value_is_cut_in_the_message);
    RUN(settings_are_equal_by_their_values);
    return test_end();
}
