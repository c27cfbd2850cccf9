// Playback scripts: what is read, what is refused and with which line, curves against closed forms, and what holds
// when.
#include "modules/json_file.h"
#include "modules/playback.h"

#include "shaders/shared.h"
#include "test.h"

#include <cjson/cJSON.h>
#include <sys/stat.h>

static char logged[4096]; // all lines
static uint32_t logged_lines;

static void log_keep(log_level level, const char *line, void *user)
{
    (void)level, (void)user;
    snprintf(logged + strlen(logged), sizeof(logged) - strlen(logged), "%s\n", line);
    logged_lines++;
}

#ifdef __SANITIZE_ADDRESS__ // so that both builds may run at once
#define FOLDER BUILD_DIR "/playback_scripts_sanitized"
#else
#define FOLDER BUILD_DIR "/playback_scripts"
#endif
#define SCRIPT FOLDER "/script.json"

static void text_write(const char *path, const char *text)
{
    mkdir(FOLDER, 0777);
    const bool ok = file_write(path, text, strlen(text));
    assert(ok);
    (void)ok;
}

static playback *load(const char *text)
{
    text_write(SCRIPT, text);
    logged[0] = '\0';
    logged_lines = 0;
    log_sink_set(log_keep, NULL);
    playback *const script = playback_load(SCRIPT);
    log_sink_set(NULL, NULL);
    if (script ? logged_lines > 0 : logged_lines != 1) {
        test_failures++;
        printf("logged: %s\n", logged);
    }
    return script;
}

// Refused with one line that names the file, the line, and has `words` in it.
static bool refused(const char *text, uint32_t line, const char *words)
{
    playback *const script = load(text);
    char place[512];
    snprintf(place, sizeof(place), SCRIPT ":%u: ", line);
    const bool ok = !script && strncmp(logged, place, strlen(place)) == 0 && strstr(logged, words);
    if (!ok) {
        printf("expected line %u and \"%s\", got: %s\n", line, words, logged);
    }
    playback_destroy(script);
    return ok;
}

#define HEAD "{\"scene\": \"room.glb\", \"duration\": 2"

// ---- Reading

TEST(least_script_has_the_documented_defaults)
{
    playback *const s = load(HEAD "}");
    CHECK(s != NULL);
    CHECK(s->frame_rate == 30 && s->frame_count == 60 && s->output_count == 1);
    CHECK_STRING(s->outputs[0], "png");
    CHECK_STRING(s->scene, FOLDER "/room.glb");
    CHECK(playback_camera_of(s, 0) == NULL);
    const render_settings settings = playback_settings_at(s, 0), defaults = render_settings_default();
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        char text[32], expected[32];
        settings_get(&settings, &table[i], text);
        settings_get(&defaults, &table[i], expected);
        CHECK_STRING(text, expected);
    }
    playback_destroy(s);
}

TEST(absolute_scene_paths_stay)
{
    playback *const s = load("{\"scene\": \"/a/b.glb\", \"duration\": 1}");
    CHECK_STRING(s->scene, "/a/b.glb");
    playback_destroy(s);
}

TEST(frames_are_rounded_and_at_least_one)
{
    playback *s = load("{\"scene\": \"a\", \"duration\": 1.0333, \"frame_rate\": 30}");
    CHECK(s->frame_count == 31);
    playback_destroy(s);
    s = load("{\"scene\": \"a\", \"duration\": 0.001, \"frame_rate\": 10}");
    CHECK(s->frame_count == 1);
    playback_destroy(s);
}

TEST(settings_of_script_events_and_overrides_stand_above_each_other)
{
    playback *const s =
        load(HEAD ", \"size\": \"64x36\", \"seed\": 4294967295,\n"
                  "\"settings\": {\"vpls\": 1000, \"alpha\": 1.5, \"no-taa\": true, \"rays\": \"query\"},\n"
                  "\"events\": [{\"time\": 1, \"settings\": {\"vpls\": 50, \"no-taa\": false}},\n"
                  "             {\"time\": 1.5, \"settings\": {\"alpha\": 3, \"vpls\": 70}}]}");
    render_settings before = playback_settings_at(s, 29), at = playback_settings_at(s, 30),
                    after = playback_settings_at(s, 59);
    CHECK(before.width == 64 && before.height == 36 && before.seed == UINT32_MAX && before.rays == RAYS_QUERY);
    CHECK(before.vpls == 1000 && before.alpha == 1.5f && !before.taa);
    CHECK(at.vpls == 50 && at.alpha == 1.5f && at.taa);
    CHECK(after.vpls == 70 && after.alpha == 3);
    setting_error error;
    CHECK(playback_override(s, settings_find("alpha"), "2", &error));
    CHECK(playback_override(s, settings_find("no-filter"), NULL, &error));
    CHECK(!playback_override(s, settings_find("alpha"), "-1", &error));
    after = playback_settings_at(s, 59);
    CHECK(after.alpha == 2 && after.vpls == 70 && !after.filter);
    playback_destroy(s);
}

TEST(lines_of_members_and_values_are_those_of_the_file)
{
    text_write(
        SCRIPT,
        "\n{ \"a\": 1,\n  \"b\\\"\\\\\": [\n 1, 2,\n\n {\"c\": \"x\\ny]}\", \"d\":\n null}\n ],\n\"e\": {}, \"f\":"
        " [\n]\n}\n");
    json_file file;
    CHECK(json_file_read(&file, SCRIPT));
    const cJSON *const b = cJSON_GetArrayItem(file.root, 1), *const third = cJSON_GetArrayItem(b, 2);
    CHECK(json_file_line(&file, file.root) == 2);
    CHECK(json_file_line(&file, b) == 3);
    CHECK(json_file_line(&file, cJSON_GetArrayItem(b, 1)) == 4);
    CHECK(json_file_line(&file, third) == 6);
    CHECK(json_file_line(&file, cJSON_GetArrayItem(third, 1)) == 6);
    CHECK(json_file_line(&file, cJSON_GetArrayItem(file.root, 2)) == 9);
    CHECK(json_file_line(&file, cJSON_GetArrayItem(file.root, 3)) == 9);
    json_file_fini(&file);
}

// ---- What is refused

TEST(what_is_no_json_is_refused_with_its_line)
{
    CHECK(refused("{\n\"scene\": \"a\",\n\"duration\" 1}", 3, "expected JSON"));
    CHECK(refused("{\"scene\": \"a\", \"duration\": 1}\n\n}", 3, "expected JSON"));
    CHECK(refused("", 1, "expected JSON"));
    CHECK(refused("[1]", 1, "an object"));
    logged[0] = '\0';
    log_sink_set(log_keep, NULL);
    CHECK(playback_load(FOLDER "/none.json") == NULL);
    log_sink_set(NULL, NULL);
    CHECK(strstr(logged, "none.json"));
}

TEST(unknown_wrong_missing_and_repeated_keys_of_the_script_are_refused)
{
    CHECK(
        refused(HEAD ",\n\"lihgts\": []}", 2, "\"lihgts\": unknown key of a script; expected one of scene, duration"));
    CHECK(refused("{\"duration\": 2}", 1, "expected \"scene\""));
    CHECK(refused("{\"scene\": \"a\"}", 1, "expected \"duration\""));
    CHECK(refused("{\"scene\":\n 7, \"duration\": 2}", 1, "scene: expected a text"));
    CHECK(refused("{\"scene\": \"\", \"duration\": 2}", 1, "scene: expected a text that is not empty"));
    CHECK(refused(HEAD ",\n\n\"duration\": 3}", 3, "duration: given twice"));
    CHECK(refused("{\"scene\": \"a\",\n\"duration\": 0}", 2, "duration: expected a number greater than 0"));
    CHECK(refused("{\"scene\": \"a\",\n\"duration\": 1e999}", 2, "duration: expected a number"));
    CHECK(refused(HEAD ",\n\"frame_rate\": \"fast\"}", 2, "frame_rate: expected a number"));
    CHECK(refused(HEAD ",\n\"cameras\": {}}", 2, "cameras: expected a list"));
    CHECK(refused(HEAD ",\n\"cameras\": [\n3]}", 3, "a camera: expected an object"));
    CHECK(refused(HEAD ",\n\"outputs\": []}", 2, "outputs: expected a list of at least one"));
    CHECK(refused(HEAD ",\n\"outputs\": [\"png\",\n 1]}", 3, "outputs: expected a text"));
}

TEST(too_many_frames_are_refused)
{
    CHECK(load("{\"scene\": \"a\", \"duration\": 10000, \"frame_rate\": 1000}") == NULL);
    CHECK(strstr(logged, "at most 1000000 frames, got 10000000"));
}

TEST(settings_are_refused_by_name_and_value)
{
    CHECK(refused(HEAD ",\n\"settings\": {\n\"vlps\": 1}}", 3, "\"vlps\": expected the name of a render option"));
    CHECK(refused(HEAD ",\n\"settings\": {\n\"vpls\": -1}}", 3, "vpls: expected a whole number from 0"));
    CHECK(refused(HEAD ",\n\"settings\": {\"vpls\": 1.5}}", 2, "vpls: expected a whole number"));
    CHECK(refused(HEAD ",\n\"settings\": {\"vpls\": [1]}}", 2, "vpls: expected a number, a text"));
    CHECK(refused(HEAD ",\n\"settings\": {\"no-taa\": 1}}", 2, "no-taa: expected no value, true or false"));
    CHECK(refused(HEAD ",\n\"settings\": {\"vpls\": 1,\n \"vpls\": 2}}", 3, "vpls: given twice"));
    CHECK(refused(HEAD ",\n\"settings\": 1}", 2, "settings: expected an object"));
    CHECK(refused(HEAD ",\n\"size\": \"64\"}", 2, "size: expected WIDTHxHEIGHT"));
    CHECK(refused(HEAD ",\n\"settings\": {\"frames\": 3}}", 2, "frames: cannot be set here"));
    CHECK(
        refused(HEAD ",\n\"settings\": {\"target-ms\": 3}}", 2, "target-ms: cannot be set here: it follows measured"));
    CHECK(refused(HEAD ",\n\"settings\": {\"target-error\": 0.1}}", 2, "target-error: cannot be set here"));
    CHECK(refused(HEAD ",\n\"events\": [{\"time\": 1,\n\"settings\": {\"size\": \"1x1\"}}]}", 3,
                  "size: cannot be set here"));
    CHECK(refused(HEAD ",\n\"events\": [{\"time\": 1,\n\"settings\": {\"method\": \"ir\"}}]}", 3, "method: cannot"));
}

#define NODE HEAD ",\n\"nodes\": [{\"node\": \"door\",\n\"keys\": "

TEST(tracks_without_keys_or_with_wrong_ones_are_refused)
{
    CHECK(refused(HEAD ",\n\"nodes\": [\n{\"node\": \"door\"}]}", 3, "a node: expected \"keys\""));
    CHECK(refused(NODE "[]}]}", 3, "keys: expected at least one key, got none"));
    CHECK(refused(NODE "3}]}", 3, "keys: expected a list"));
    CHECK(refused(NODE "[\n3]}]}", 4, "a key: expected an object"));
    CHECK(refused(NODE "[\n{\"time\": 0}]}]}", 4, "a key: expected also one of translation, rotation, scale"));
    CHECK(refused(NODE "[\n{\"scale\": [1,1,1]}]}]}", 4, "a key: expected \"time\""));
    CHECK(refused(NODE "[\n{\"time\": -1, \"scale\": [1,1,1]}]}]}", 4, "time: expected a number"));
    CHECK(refused(NODE "[{\"time\": 1, \"scale\": [1,1,1]},\n{\"time\": 1, \"scale\": [1,1,1]}]}]}", 4,
                  "time: expected a time after the key before, at 1, got 1"));
    CHECK(refused(NODE "[{\"time\": 0, \"scale\": [1,1,1]},\n{\"time\": 1}]}]}", 4,
                  "a key: expected \"scale\", which the first key has"));
    CHECK(refused(
        NODE "[{\"time\": 0, \"scale\": [1,1,1]},\n{\"time\": 1, \"scale\": [1,1,1],\n\"translation\": [0,0,0]}]}]}", 5,
        "translation: expected in all keys or in none"));
    CHECK(refused(NODE "[{\"time\": 0, \"scale\": [1,1]}]}]}", 3, "scale: expected 3 numbers"));
    CHECK(refused(NODE "[{\"time\": 0, \"scale\": [1,\n\"1\",1]}]}]}", 4, "scale: expected a number, got \"1\""));
    CHECK(refused(NODE "[{\"time\": 0, \"rotation\": [0,0,0,0]}]}]}", 3, "rotation: expected a quaternion"));
    CHECK(refused(NODE "[{\"time\": 0,\n\"turn\": [0,0,0]}]}]}", 4,
                  "\"turn\": unknown key of a key frame; expected one of time, translation"));
    CHECK(refused(NODE "[{\"time\": 0, \"scale\": [1,1,1],\n\"scale\": [1,1,1]}]}]}", 4, "scale: given twice"));
    CHECK(refused(NODE "[{\"time\": 0, \"scale\": [1,1,1]}],\n\"interpolation\": \"bezier\"}]}", 4,
                  "interpolation: expected one of \"spline\", \"linear\", \"step\", got \"bezier\""));
}

#define CAMERA HEAD ",\n\"cameras\": [{"

TEST(cameras_are_refused)
{
    CHECK(refused(CAMERA "}]}", 2, "a camera: expected one of camera, keys, orbit, walk, got 0 of them"));
    CHECK(refused(CAMERA "\"camera\": \"a\",\n\"keys\": []}]}", 2,
                  "a camera: expected one of camera, keys, orbit, walk, got 2 of them"));
    CHECK(refused(CAMERA "\"camera\": \"a\", \"interpolation\": \"step\"}]}", 2,
                  "interpolation: expected with \"keys\""));
    CHECK(refused(CAMERA "\"keys\": [\n{\"time\": 0, \"position\": [0,0,0]}]}]}", 3, "a key: expected \"target\""));
    CHECK(refused(CAMERA "\"keys\": [{\"time\": 0, \"position\": [0,0,0], \"target\": [0,0,1],\n\"yfov\": 0}]}]}", 3,
                  "yfov: expected a number greater than 0"));
    CHECK(refused(CAMERA "\"orbit\": {\"target\": [0,0,0],\n\"position\": [0,0,1]}}]}", 2,
                  "an orbit: expected \"speed\""));
    CHECK(refused(CAMERA "\"camera\": \"a\", \"start\": 1}]}", 2, "start: expected 0 of the first camera, got 1"));
    CHECK(refused(CAMERA "\"camera\": \"a\"},\n{\"camera\": \"b\"}]}", 3,
                  "start: expected a time after the camera before"));
    CHECK(refused(CAMERA "\"camera\": \"a\", \"cut\": 1}]}", 2, "cut: expected true or false"));
}

TEST(frames_without_a_view_are_refused)
{
    CHECK(refused(
        CAMERA "\"interpolation\": \"linear\",\n\"keys\": [{\"time\": 0, \"position\": [0,0,0], \"target\": [1,0,0]},"
               "{\"time\": 2, \"position\": [2,0,0], \"target\": [1,0,0]}]}]}",
        2, "expected a position away from the target in each frame, got 0 in frame 30"));
    // The spline swings below its keys.
    CHECK(refused(CAMERA "\"keys\": [{\"time\": 0, \"position\": [0,0,0], \"target\": [1,0,0], \"yfov\": 3},"
                         "{\"time\": 0.5, \"position\": [0,0,0], \"target\": [1,0,0], \"yfov\": 0.1},"
                         "{\"time\": 1, \"position\": [0,0,0], \"target\": [1,0,0], \"yfov\": 0.1}]}]}",
                  2, "expected a yfov greater than 0"));
    CHECK(refused(CAMERA "\"keys\": [{\"time\": 0,\n\"position\": [0,1e10,0], \"target\": [1,0,0]}]}]}", 3,
                  "position: expected a number"));
}

#define LIGHT HEAD ",\n\"lights\": [{"

TEST(lights_are_refused)
{
    CHECK(refused(LIGHT "\"type\": \"point\"}]}", 2, "a light: expected either \"light\""));
    CHECK(refused(LIGHT "\"light\": \"a\"}]}", 2, "a light: expected \"keys\""));
    CHECK(refused(LIGHT "\"name\": \"a\"}]}", 2, "a new light: expected \"type\""));
    CHECK(refused(LIGHT "\"name\": \"a\", \"type\": \"area\"}]}", 2, "type: expected one of \"point\", \"spot\""));
    CHECK(refused(LIGHT "\"light\": \"a\",\n\"intensity\": 3, \"keys\": []}]}", 3, "intensity: expected in the keys"));
    CHECK(refused(LIGHT "\"name\": \"a\", \"type\": \"point\",\n\"intensity\": -3}]}", 3,
                  "intensity: expected a number"));
    CHECK(
        refused(LIGHT "\"name\": \"a\", \"type\": \"spot\", \"innerConeAngle\": 1}]}", 2, "innerConeAngle less than"));
    CHECK(refused(LIGHT "\"name\": \"a\", \"type\": \"point\", \"keys\": [\n{\"time\": 0, \"color\": [0,-1,0]}]}]}", 3,
                  "color: expected a number of at least 0"));
    CHECK(refused(LIGHT "\"name\": \"a\", \"type\": \"point\"},\n{\"name\": \"a\", \"type\": \"point\"}]}", 3,
                  "one track a light, and there is one in line 2"));
}

#define EVENT HEAD ",\n\"events\": [{"

TEST(events_are_refused)
{
    CHECK(refused(EVENT "\"cut\": true}]}", 2, "an event: expected \"time\""));
    CHECK(refused(EVENT "\"time\": 1}]}", 2, "an event: expected one of light, node, settings, cut, got 0"));
    CHECK(refused(EVENT "\"time\": 1, \"light\": \"a\"}]}", 2, "an event: expected \"light\" and \"on\" together"));
    CHECK(refused(EVENT "\"time\": 1, \"node\": \"a\", \"on\": true}]}", 2, "together"));
    CHECK(refused(EVENT "\"time\": 1, \"cut\": true, \"settings\": {}}]}", 2, "got 2 of them"));
    CHECK(refused(EVENT "\"time\": 1,\n\"cut\": false}]}", 3, "cut: expected true"));
    CHECK(refused(EVENT "\"time\": 1, \"cut\": true},\n{\"time\": 0.5, \"cut\": true}]}", 3,
                  "time: expected none before the event above, at 1, got 0.5"));
    CHECK(refused(EVENT "\"time\": 2.5, \"cut\": true}]}", 2, "time: expected at most the duration, 2, got 2.5"));
}

// ---- Curves

static playback_curve curve_make(uint32_t width, uint32_t count, const double *times, const float *values,
                                 playback_interpolation interpolation)
{
    return (playback_curve){.width = width,
                            .key_count = count,
                            .times = times,
                            .values = values,
                            .interpolation = interpolation,
                            .rotation = width == 4};
}

static double curve_value(const playback_curve *curve, double time)
{
    float value[PLAYBACK_WIDTH_MAX];
    playback_curve_at(curve, time, value);
    return (double)value[0];
}

static const double uneven[] = {0.5, 0.75, 2, 2.25, 4};

TEST(curves_pass_through_their_keys_and_stay_beyond_the_ends)
{
    const float values[] = {1, -3, 2, 2, 7};
    for (playback_interpolation how = PLAYBACK_SPLINE; how <= PLAYBACK_STEP; how++) {
        const playback_curve curve = curve_make(1, 5, uneven, values, how);
        for (uint32_t k = 0; k < 5; k++) {
            CHECK(curve_value(&curve, uneven[k]) == (double)values[k]);
        }
        CHECK(curve_value(&curve, 0) == 1 && curve_value(&curve, 100) == 7);
    }
}

TEST(even_motion_on_a_line_stays_so_on_the_spline)
{
    float values[15];
    for (uint32_t k = 0; k < 5; k++) {
        for (uint32_t i = 0; i < 3; i++) {
            values[3 * k + i] = (float)(1.0 + i + (0.5 - 2.0 * i) * uneven[k]);
        }
    }
    const playback_curve curve = curve_make(3, 5, uneven, values, PLAYBACK_SPLINE);
    for (double time = 0.5; time <= 4; time += 0.01) {
        float value[3];
        playback_curve_at(&curve, time, value);
        for (uint32_t i = 0; i < 3; i++) {
            CHECK_NEAR((double)value[i], 1.0 + i + (0.5 - 2.0 * i) * time, 2e-6);
        }
    }
}

TEST(splines_stay_on_the_line_of_their_keys_whatever_the_times)
{
    const float values[] = {0, 0, 1, 2, 1.5f, 3, 4, 8, 5, 10}; // y = 2 x
    const playback_curve curve = curve_make(2, 5, uneven, values, PLAYBACK_SPLINE);
    for (double time = 0.5; time <= 4; time += 0.01) {
        float value[2];
        playback_curve_at(&curve, time, value);
        CHECK_NEAR((double)value[1], 2 * (double)value[0], 2e-6);
    }
}

TEST(splines_are_those_of_catmull_and_rom)
{
    // On keys at 0, 1, 2, 3 the matrix form: 1/2 (2 p1 + (p2 - p0) u + (2 p0 - 5 p1 + 4 p2 - p3) u^2 + ...).
    static const double times[] = {0, 1, 2, 3};
    const float p[] = {1, 4, 2, -3};
    const playback_curve curve = curve_make(1, 4, times, p, PLAYBACK_SPLINE);
    for (double u = 0; u <= 1; u += 0.125) {
        const double expected =
            0.5 * (2 * 4 + (2 - 1) * u + (2 * 1 - 5 * 4 + 4 * 2 + 3) * u * u + (-1 + 3 * 4 - 3 * 2 - 3) * u * u * u);
        CHECK_NEAR(curve_value(&curve, 1 + u), expected, 1e-6);
    }
}

TEST(splines_have_the_tangents_of_their_neighbours_on_both_sides)
{
    const float values[] = {1, -3, 2, 2.5f, 7};
    const playback_curve curve = curve_make(1, 5, uneven, values, PLAYBACK_SPLINE);
    const double h = 1e-3;
    for (uint32_t k = 1; k < 4; k++) {
        const double expected = (double)(values[k + 1] - values[k - 1]) / (uneven[k + 1] - uneven[k - 1]);
        const double at = curve_value(&curve, uneven[k]);
        // Differences of second order: the third derivative is up to 700 here.
        const double before =
            (3 * at - 4 * curve_value(&curve, uneven[k] - h) + curve_value(&curve, uneven[k] - 2 * h)) / (2 * h);
        const double after =
            (-3 * at + 4 * curve_value(&curve, uneven[k] + h) - curve_value(&curve, uneven[k] + 2 * h)) / (2 * h);
        CHECK_NEAR(before, expected, 3e-3);
        CHECK_NEAR(after, expected, 3e-3);
    }
}

TEST(steps_hold_and_lines_connect)
{
    static const double times[] = {1, 3};
    const float values[] = {10, 20};
    const playback_curve step = curve_make(1, 2, times, values, PLAYBACK_STEP),
                         line = curve_make(1, 2, times, values, PLAYBACK_LINEAR);
    CHECK(curve_value(&step, 2.999) == 10 && curve_value(&step, 3) == 20);
    CHECK_NEAR(curve_value(&line, 1.5), 12.5, 1e-6);
}

TEST(rotations_turn_evenly_and_by_the_shorter_arc)
{
    // From 0 to 90 degrees about y; the second quaternion is given with the opposite sign.
    playback *const s = load(NODE "[{\"time\": 0, \"rotation\": [0,0,0,2]},\n"
                                  "{\"time\": 1, \"rotation\": [0,-0.7071067812,0,-0.7071067812]}],"
                                  "\"interpolation\": \"linear\"}]}");
    for (double u = 0; u <= 1; u += 0.125) {
        float q[4];
        playback_curve_at(&s->nodes[0].rotation, u, q);
        CHECK_NEAR((double)q[1], sin(u * M_PI / 4), 1e-6);
        CHECK_NEAR((double)q[3], cos(u * M_PI / 4), 1e-6);
    }
    playback_curve spline = s->nodes[0].rotation;
    spline.interpolation = PLAYBACK_SPLINE;
    float q[4];
    playback_curve_at(&spline, 0.3, q);
    CHECK_NEAR((double)(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), 1, 1e-6);
    playback_destroy(s);
}

// ---- Cameras

TEST(key_frames_give_the_pose_at_the_frames_time)
{
    playback *const s = load(CAMERA "\"yfov\": 0.5, \"znear\": 0.01, \"keys\": [\n"
                                    "{\"time\": 0, \"position\": [0,1,2], \"target\": [0,0,0]},\n"
                                    "{\"time\": 2, \"position\": [4,1,2], \"target\": [0,2,0]}]}]}");
    const playback_camera *const camera = playback_camera_of(s, 15);
    const playback_pose pose = playback_pose_at(s, camera, 15);
    CHECK_NEAR((double)pose.position[0], 1, 1e-6);
    CHECK_NEAR((double)pose.target[1], 0.5, 1e-6);
    CHECK(pose.yfov == 0.5f && camera->znear == 0.01f);
    playback_destroy(s);
}

TEST(orbits_keep_their_distance_and_return)
{
    playback *const s = load("{\"scene\": \"a\", \"duration\": 4, \"frame_rate\": 10, \"cameras\": [{\"orbit\":"
                             "{\"target\": [1,2,3], \"position\": [1,4,8], \"speed\": 1.5707963268}}]}");
    const playback_camera *const camera = playback_camera_of(s, 0);
    for (uint32_t frame = 0; frame < 40; frame++) {
        const playback_pose pose = playback_pose_at(s, camera, frame);
        const double angle = M_PI / 2 * frame / 10;
        CHECK_NEAR((double)pose.position[0], 1 + 5 * sin(angle), 1e-5);
        CHECK_NEAR((double)pose.position[1], 4, 0);
        CHECK_NEAR((double)pose.position[2], 3 + 5 * cos(angle), 1e-5);
        CHECK(pose.target[0] == 1 && pose.target[1] == 2 && pose.target[2] == 3);
    }
    playback_destroy(s);
}

#define WALK CAMERA "\"walk\": \"walk.txt\"}]}"

TEST(walks_are_read_by_lines)
{
    text_write(FOLDER "/walk.txt", "# time, position, target, yfov\n0 0 1 0  0 1 -1 0.5\n\n  1 2 1 0\t0 1 -1 0.7\r\n");
    playback *const s = load(WALK);
    CHECK(s != NULL);
    const playback_pose pose = playback_pose_at(s, playback_camera_of(s, 15), 15);
    CHECK_NEAR((double)pose.position[0], 1, 1e-6);
    CHECK_NEAR((double)pose.yfov, 0.6, 1e-6);
    const uint64_t hash = s->hash;
    playback_destroy(s);
    text_write(FOLDER "/walk.txt", "0 0 1 0 0 1 -1\n1 3 1 0 0 1 -1");
    playback *const other = load(WALK);
    CHECK(other && other->hash != hash && other->cameras[0].yfov.width == 0);
    playback_destroy(other);
}

static bool walk_refused(const char *walk, uint32_t line, const char *words)
{
    text_write(FOLDER "/walk.txt", walk);
    playback *const script = load(WALK);
    char place[512];
    snprintf(place, sizeof(place), FOLDER "/walk.txt:%u: ", line);
    const bool ok = !script && strncmp(logged, place, strlen(place)) == 0 && strstr(logged, words);
    if (!ok) {
        printf("expected line %u and \"%s\", got: %s\n", line, words, logged);
    }
    playback_destroy(script);
    return ok;
}

TEST(walks_are_refused_with_their_line)
{
    CHECK(walk_refused("", 1, "at least one pose"));
    CHECK(walk_refused("# nothing\n", 2, "at least one pose"));
    CHECK(walk_refused("0 0 0 0 0 0\n", 1, "7 or 8 numbers"));
    CHECK(walk_refused("0 0 0 0 0 0 1 0.5 9\n", 1, "7 or 8 numbers"));
    CHECK(walk_refused("0 0 0 0 0 0 1\n\n1 0 0 0 0 0 x\n", 3, "7 or 8 numbers"));
    CHECK(walk_refused("0 0 0 0 0 0 nan\n", 1, "7 or 8 numbers"));
    CHECK(walk_refused("0 0 0 0 0 0 1\n1 0 0 0 0 0 1 0.5\n", 2, "7 numbers, as in the first line"));
    CHECK(walk_refused("0 0 0 0 0 0 1\n0 0 0 0 0 0 1\n", 2, "a time after that of the pose before"));
    CHECK(walk_refused("0 0 0 0 0 0 1 4\n", 1, "a yfov greater than 0"));
    remove(FOLDER "/walk.txt");
    CHECK(load(WALK) == NULL && strstr(logged, "walk.txt"));
}

// ---- Lights, events and segments

TEST(lights_are_colour_times_intensity_and_never_negative)
{
    playback *const s =
        load(LIGHT "\"name\": \"sun\", \"type\": \"directional\", \"color\": [1,0.5,0.25], \"keys\": [\n"
                   "{\"time\": 0, \"intensity\": 10, \"direction\": [0,-2,0]},"
                   "{\"time\": 0.5, \"intensity\": 0, \"direction\": [0,0,-3]},"
                   "{\"time\": 1, \"intensity\": 0, \"direction\": [0,0,3]}]},"
                   "{\"name\": \"dot\", \"type\": \"point\", \"position\": [1,2,3], \"intensity\": 4}]}");
    const playback_light_state first = playback_light_at(s, &s->lights[0], 0);
    CHECK(first.color[0] == 10 && first.color[1] == 5 && first.color[2] == 2.5f && first.direction[1] == -1);
    for (uint32_t frame = 0; frame < 60; frame++) {
        const playback_light_state state = playback_light_at(s, &s->lights[0], frame);
        double square = 0;
        for (int k = 0; k < 3; k++) {
            CHECK(state.color[k] >= 0);
            square += (double)state.direction[k] * (double)state.direction[k];
        }
        CHECK_NEAR(square, 1, 1e-6);
    }
    const playback_light_state dot = playback_light_at(s, &s->lights[1], 7);
    CHECK(dot.color[0] == 4 && dot.position[2] == 3 && dot.direction[1] == -1);
    playback_destroy(s);
}

// A room with a lamp, a door below a frame, a camera and a clip.
static scene_data room_make(void)
{
    static scene_node nodes[] = {
        {.name = "frame", .parent = SCENE_NONE, .has_trs = true, .light = SCENE_NONE, .mesh = SCENE_NONE},
        {.name = "door", .parent = 0, .has_trs = true, .light = SCENE_NONE, .mesh = 0},
        {.name = "lamp node", .parent = SCENE_NONE, .light = 0, .mesh = SCENE_NONE},
    };
    static scene_mesh meshes[] = {{.name = "leaf"}};
    static scene_light lights[] = {{.name = "lamp", .color = {100, 50, 0}, .intensity = 100}};
    static scene_camera cameras[] = {{.name = "hall", .node = 0, .yfov = 1, .near_plane = 0.1f}};
    static scene_animation animations[] = {{.name = "walk"}, {.name = "run"}};
    memcpy(nodes[2].world, (float[16]){1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1}, sizeof(nodes[2].world));
    return (scene_data){.nodes = nodes,
                        .node_count = countof(nodes),
                        .meshes = meshes,
                        .mesh_count = 1,
                        .lights = lights,
                        .light_count = 1,
                        .cameras = cameras,
                        .camera_count = 1,
                        .animations = animations,
                        .animation_count = 2};
}

static bool resolve_refused(const char *text, uint32_t line, const char *words)
{
    const scene_data room = room_make();
    playback *const script = load(text);
    char place[512];
    snprintf(place, sizeof(place), SCRIPT ":%u: ", line);
    logged[0] = '\0';
    log_sink_set(log_keep, NULL);
    const bool resolved = script && playback_resolve(script, &room);
    log_sink_set(NULL, NULL);
    const bool ok = script && !resolved && strncmp(logged, place, strlen(place)) == 0 && strstr(logged, words);
    if (!ok) {
        printf("expected line %u and \"%s\", got: %s\n", line, words, logged);
    }
    playback_destroy(script);
    return ok;
}

TEST(names_that_the_scene_does_not_have_are_refused)
{
    CHECK(resolve_refused(CAMERA "\"camera\": \"hal\"}]}", 2, "expected the name of a camera"));
    CHECK(resolve_refused(LIGHT "\"light\": \"door\", \"keys\": [{\"time\": 0, \"intensity\": 1}]}]}", 2,
                          "a node with a light of"));
    CHECK(resolve_refused(HEAD ",\n\"nodes\": [\n{\"node\": \"gate\", \"keys\": [{\"time\": 0, \"scale\": [1,1,1]}]}]}",
                          3, "a node of"));
    CHECK(resolve_refused(HEAD
                          ",\n\"nodes\": [{\"node\": \"lamp node\", \"keys\": [{\"time\": 0, \"scale\": [1,1,1]}]}]}",
                          2, "has a matrix"));
    CHECK(resolve_refused(HEAD ",\n\"animations\": [{\"clip\": \"fly\"}]}", 2, "an animation of"));
    CHECK(resolve_refused(EVENT "\"time\": 0, \"light\": \"moon\", \"on\": true}]}", 2, "a node with a light"));
    CHECK(resolve_refused(EVENT "\"time\": 0, \"node\": \"moon\", \"visible\": true}]}", 2, "a node of"));
}

TEST(names_are_found_by_node_by_light_and_by_mesh)
{
    const scene_data room = room_make();
    playback *const s =
        load(HEAD ", \"cameras\": [{\"camera\": \"hall\"}], \"animations\": [{\"clip\": \"run\", \"speed\": -2}],"
                  "\"lights\": [{\"light\": \"lamp\", \"keys\": [{\"time\": 0, \"intensity\": 7}]}],"
                  "\"nodes\": [{\"node\": \"leaf\", \"keys\": [{\"time\": 0, \"scale\": [1,1,1]}]}]}");
    CHECK(s && playback_resolve(s, &room));
    CHECK(s->cameras[0].camera == 0 && s->clips[0].animation == 1 && s->clips[0].speed == -2 && !s->clips[0].loop);
    CHECK(s->lights[0].node == 2 && s->nodes[0].node == 1);
    const playback_light_state state = playback_light_at(s, &s->lights[0], 0);
    CHECK(state.color[0] == 7 && state.color[1] == 3.5f && state.color[2] == 0); // the scene's colour
    CHECK(state.position[0] == 5 && state.position[2] == 7 && state.direction[2] == -1); // the scene's place
    playback_destroy(s);
}

TEST(switches_hold_from_their_frame_to_the_next)
{
    const scene_data room = room_make();
    playback *const s = load(HEAD ", \"frame_rate\": 10, \"lights\": [{\"name\": \"sun\", \"type\": \"directional\"}],"
                                  "\"events\": [{\"time\": 0, \"light\": \"sun\", \"on\": false},"
                                  "{\"time\": 0.3, \"light\": \"lamp\", \"on\": false},"
                                  "{\"time\": 0.3, \"node\": \"door\", \"visible\": false},"
                                  "{\"time\": 0.55, \"light\": \"lamp node\", \"on\": true},"
                                  "{\"time\": 0.9, \"light\": \"sun\", \"on\": true}]}");
    CHECK(s && playback_resolve(s, &room));
    CHECK(s->events[1].frame == 3); // 0.3 * 10 is a little more than 3
    for (uint32_t frame = 0; frame < s->frame_count; frame++) {
        CHECK(playback_switched_on(s, &s->events[0], frame) == (frame >= 9));
        CHECK(playback_switched_on(s, &s->events[1], frame) == (frame < 3 || frame >= 6));
        CHECK(playback_switched_on(s, &s->events[3], frame) == playback_switched_on(s, &s->events[1], frame));
        CHECK(playback_switched_on(s, &s->events[2], frame) == (frame < 3));
    }
    playback_destroy(s);
}

TEST(segments_begin_at_cuts)
{
    playback *const s =
        load(HEAD ", \"frame_rate\": 10, \"cameras\": [{\"camera\": \"a\"}, {\"camera\": \"b\", \"start\": 0.5},"
                  "{\"camera\": \"a\", \"start\": 0.8, \"cut\": false}],"
                  "\"events\": [{\"time\": 1.01, \"cut\": true}]}");
    for (uint32_t frame = 0; frame < s->frame_count; frame++) {
        CHECK(playback_segment_begin(s, frame) == (frame >= 11 ? 11 : frame >= 5 ? 5 : 0));
    }
    CHECK_STRING(playback_camera_of(s, 4)->name, "a");
    CHECK_STRING(playback_camera_of(s, 5)->name, "b");
    CHECK_STRING(playback_camera_of(s, 19)->name, "a");
    setting_error error;
    CHECK(playback_override(s, settings_find("method"), "path", &error));
    CHECK(playback_segment_begin(s, 7) == 7); // references keep nothing
    playback_destroy(s);
}

TEST(scripts_of_the_project_are_read)
{
    static const char *const names[] = {"still",        "slow_pan",      "fast_pan", "moving_sun",
                                        "light_switch", "swinging_door", "dancers",  "lanterns"};
    for (size_t i = 0; i < countof(names); i++) {
        char path[256];
        snprintf(path, sizeof(path), "assets/playback/%s.json", names[i]);
        playback *const s = playback_load(path);
        CHECK(s != NULL);
        playback_destroy(s);
    }
}

int main(void)
{
    RUN(least_script_has_the_documented_defaults);
    RUN(absolute_scene_paths_stay);
    RUN(frames_are_rounded_and_at_least_one);
    RUN(settings_of_script_events_and_overrides_stand_above_each_other);
    RUN(lines_of_members_and_values_are_those_of_the_file);
    RUN(what_is_no_json_is_refused_with_its_line);
    RUN(unknown_wrong_missing_and_repeated_keys_of_the_script_are_refused);
    RUN(too_many_frames_are_refused);
    RUN(settings_are_refused_by_name_and_value);
    RUN(tracks_without_keys_or_with_wrong_ones_are_refused);
    RUN(cameras_are_refused);
    RUN(frames_without_a_view_are_refused);
    RUN(lights_are_refused);
    RUN(events_are_refused);
    RUN(curves_pass_through_their_keys_and_stay_beyond_the_ends);
    RUN(even_motion_on_a_line_stays_so_on_the_spline);
    RUN(splines_stay_on_the_line_of_their_keys_whatever_the_times);
    RUN(splines_are_those_of_catmull_and_rom);
    RUN(splines_have_the_tangents_of_their_neighbours_on_both_sides);
    RUN(steps_hold_and_lines_connect);
    RUN(rotations_turn_evenly_and_by_the_shorter_arc);
    RUN(key_frames_give_the_pose_at_the_frames_time);
    RUN(orbits_keep_their_distance_and_return);
    RUN(walks_are_read_by_lines);
    RUN(walks_are_refused_with_their_line);
    RUN(lights_are_colour_times_intensity_and_never_negative);
    RUN(names_that_the_scene_does_not_have_are_refused);
    RUN(names_are_found_by_node_by_light_and_by_mesh);
    RUN(switches_hold_from_their_frame_to_the_next);
    RUN(segments_begin_at_cuts);
    RUN(scripts_of_the_project_are_read);
    return test_end();
}
