// Playback scripts: what a scene, its camera and its lights do over time, read from JSON. No GPU here; modules/player.h
// plays them.
//
// Everything is a function of the frame alone: frame n is at n / frame_rate seconds. Units are glTF's: metres, radians,
// candela (lux for directional lights), seconds; +y is up. Unknown keys, wrong types, tracks without keys, keys out of
// order and names that the scene does not have are refused with one line that names file, line, thing and what was
// expected.
//
//     {
//       "scene": "room.glb",            relative to the script                                        (required)
//       "duration": 2,                  seconds, > 0; round(duration * frame_rate) frames, at least 1 (required)
//       "frame_rate": 30,               frames a second, > 0 to 1000 (default 30)
//       "size": "640x360", "seed": 1,   as the options --size and --seed
//       "settings": {"vpls": 20000, "no-taa": true},   render options by name, but not frames, target-ms, target-error
//       "outputs": ["png", "exr", "depth"],  files a frame: the displayed picture (png), radiance in nits (exr), and
//                                       parts of the picture by the names of render's --aov (default ["png"])
//       "cameras": [TRACK...],          (default: the scene's first camera, or one that frames the scene)
//       "lights": [TRACK...], "nodes": [TRACK...], "animations": [CLIP...], "events": [EVENT...]
//     }
//
// Key frames. A track has "keys": [{"time": 0, ...}, ...] with strictly increasing times and the same members in every
// key, and "interpolation": "spline" (default), "linear" or "step". Before the first key it stays at the first, after
// the last at the last. A spline is the plain Catmull-Rom one over time: a key's tangent is (next - previous) / (their
// times' difference), one-sided at the ends; it goes through the keys, once continuously differentiable, and what moves
// evenly on a line between keys does so on the spline. Rotations are unit quaternions, and take the shorter arc: slerp
// where linear, the spline of their numbers made unit again else. Colours and intensities stay at least 0.
//
// A camera: "start" (seconds, default 0; the first at 0, increasing), and one of
//   "camera": NAME                      of the scene; it follows its node
//   "keys"                              of "position", "target" and maybe "yfov"
//   "orbit": {"target": [x,y,z], "position": [x,y,z], "speed": radians a second about +y through the target;
//             the position is that at "start"}
//   "walk": FILE                        relative to the script; a pose a line, "time x y z  tx ty tz [yfov]" with the
//                                       time in seconds, taken linearly between; lines of "#..." and empty ones count
//                                       for nothing
// with "yfov" (radians, > 0 and < pi) for those that have none, and "znear" (metres). Without: as the scene's first
// camera, or 0.8. A camera after the first begins with a cut unless "cut": false.
//
// A light: "light": NAME, a node with a light (or its light's name), or a new one: "name": NAME, "type": "point",
// "spot" or "directional", "color" (default white), "intensity" (default 1), "position", "direction" (default down),
// "innerConeAngle", "outerConeAngle" (spots; default 0 and pi/4). "keys" of "color", "intensity", "position" and
// "direction", all of them in the world and as many as wanted; a light of the scene that gets a position or a direction
// leaves its parent. A new light may do without keys.
//
// A node: "node": NAME (its own, or its mesh's) and "keys" of "translation", "rotation" and "scale", as glTF has them:
// local. A clip that moves the same node wins.
//
// A clip of the scene: "clip": NAME, "start" (seconds, default 0), "speed" (default 1), "loop" (default false).
//
// An event: "time" (seconds, 0 to duration, none before the one above), at the first frame that is not before it, and
// one of
//   "light": NAME and "on": BOOL        also a light of the script
//   "node": NAME and "visible": BOOL    its mesh and those of the nodes below it
//   "settings": {...}                   as above, but not size and method
//   "cut": true                         the history of the picture is dropped
//
// A cut makes the renderer anew, so that nothing of the frames before is left: what follows depends on nothing before
// it. Frames from a cut on are therefore the same whether the frames before it were rendered or not; every other frame
// depends on all since the last cut (filters, TAA, the lights' distribution and hysteresis keep something).
#pragma once

#include "scene.h"
#include "settings.h"

typedef enum playback_interpolation { PLAYBACK_SPLINE, PLAYBACK_LINEAR, PLAYBACK_STEP } playback_interpolation;

enum { PLAYBACK_WIDTH_MAX = 4 };
typedef struct playback_curve {
    uint32_t width; // numbers of a value, at most PLAYBACK_WIDTH_MAX; 0: there is no such curve
    uint32_t key_count; // at least 1
    const double *times; // [key_count], seconds, strictly increasing
    const float *values; // [key_count][width]
    playback_interpolation interpolation;
    bool rotation; // unit quaternions, each in the half space of the one before
} playback_curve;
void playback_curve_at(const playback_curve *curve, double time, float *value); // [width]

typedef struct playback_pose {
    float position[3], target[3];
    float yfov; // radians; 0: as the scene's
} playback_pose;

typedef struct playback_camera {
    uint32_t line;
    uint32_t first_frame;
    bool cut;
    const char *name; // of the scene's camera; NULL: by pose
    uint32_t camera; // index, after playback_resolve
    playback_curve position, target, yfov; // key frames or a walk
    bool orbits;
    playback_pose orbit; // at `start`; with `yfov` also of the key frames that have none
    double start; // seconds
    float speed; // radians a second
    float znear; // metres; 0: as the scene's
} playback_camera;

typedef struct playback_light {
    uint32_t line;
    const char *name;
    bool added; // by the script
    uint32_t node; // of the scene, after playback_resolve; SCENE_NONE where added
    uint32_t type; // LIGHT_*, where added
    float inner_cone, outer_cone; // radians
    float base_color[3], base_intensity, base_position[3], base_direction[3]; // where there is no curve
    playback_curve color, intensity, position, direction;
} playback_light;

typedef struct playback_light_state {
    float color[3]; // candela or lux: times intensity
    float position[3], direction[3]; // world; direction is of unit length
} playback_light_state;

typedef struct playback_node {
    uint32_t line;
    const char *name;
    uint32_t node; // after playback_resolve
    playback_curve translation, rotation, scale;
} playback_node;

typedef struct playback_clip {
    uint32_t line;
    const char *name;
    uint32_t animation; // after playback_resolve
    double start; // seconds
    float speed;
    bool loop;
} playback_clip;

typedef struct playback_setting { // a render option and its text, which it takes
    const setting_info *info;
    const char *text;
} playback_setting;

typedef enum playback_event_type {
    PLAYBACK_LIGHT_SWITCH,
    PLAYBACK_NODE_SWITCH,
    PLAYBACK_SETTINGS,
    PLAYBACK_CUT
} playback_event_type;
typedef struct playback_event {
    uint32_t line;
    uint32_t frame; // from which on it holds
    playback_event_type type;
    const char *name; // of the light or the node
    bool on;
    uint32_t light; // LIGHT_SWITCH, after playback_resolve: index into `lights`, SCENE_NONE: the light of `node`
    uint32_t node; // after playback_resolve; SCENE_NONE where `light` is none
    const playback_setting *settings;
    uint32_t setting_count;
} playback_event;

typedef struct playback {
    const char *path, *folder; // of the script; the folder of its relative paths
    const char *scene; // path
    double duration, frame_rate;
    uint32_t frame_count;
    uint64_t hash; // of the script and its walks: equal hash, equal script
    const playback_setting *settings;
    uint32_t setting_count;
    const char **outputs;
    uint32_t *output_lines, output_count;
    playback_camera *cameras;
    uint32_t camera_count;
    playback_light *lights;
    uint32_t light_count;
    playback_node *nodes;
    uint32_t node_count;
    playback_clip *clips;
    uint32_t clip_count;
    playback_event *events;
    uint32_t event_count;
    playback_setting *overrides; // stronger than all that the script says
    uint32_t override_count;
    arena memory; // owns it all
} playback;

// Reads and checks a script by itself. NULL on failure (one logged line).
playback *playback_load(const char *path);
void playback_destroy(playback *script); // accepts NULL
// Finds what the script names in the scene; before anything is played. False on failure (one logged line).
bool playback_resolve(playback *script, const scene_data *scene);
// Sets a render option for all frames, whatever the script says. `text` as for settings_set; NULL for a switch.
bool playback_override(playback *script, const setting_info *info, const char *text, setting_error *error);
// Whether a script may set this option, or one of its events. NULL, or why not.
const char *playback_setting_refusal(const setting_info *info, bool in_event);

// ---- What holds at a frame. All are functions of the script alone.
double playback_time(const playback *script, uint32_t frame); // seconds
render_settings playback_settings_at(const playback *script, uint32_t frame);
const playback_camera *playback_camera_of(const playback *script, uint32_t frame); // NULL: the script has none
playback_pose playback_pose_at(const playback *script, const playback_camera *camera, uint32_t frame); // by pose only
playback_light_state playback_light_at(const playback *script, const playback_light *light, uint32_t frame);
// Whether what the event switches is on; also before the event.
bool playback_switched_on(const playback *script, const playback_event *event, uint32_t frame);
// The last frame up to `frame` that begins with a cut; 0 does. The references (methods other than lgh) keep nothing
// over a frame, so each of their frames does.
uint32_t playback_segment_begin(const playback *script, uint32_t frame);
