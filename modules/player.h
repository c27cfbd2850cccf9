// Plays a script: renders its frames, with a renderer that it makes anew at every cut, which takes 0.4 s of processor
// time for a small scene on lavapipe.
//
//     player *p = player_create(gpu, scene, script, NULL, NULL);
//     for (uint32_t n = playback_segment_begin(script, wanted); n <= wanted; n++)
//         player_frame(p, n);
//     picture = frame_graph_find_image(player_renderer(p)->graph, "display");
//
// A frame's bytes are a function of script, scene and device, whatever was played before, because a frame can only
// follow from the one before it or from nothing.
#pragma once

#include "playback.h"
#include "renderer.h"

typedef struct player player;

// Resolves the script. `prepare` (may be NULL) is called with each renderer that is made, before its first frame; it
// asks for exports and such. Gpu, scene and script must outlive the player. NULL on failure (logged).
player *player_create(gpu *gpu, const scene_data *scene, playback *script, void (*prepare)(renderer *r, void *user),
                      void *user);
void player_destroy(player *p); // accepts NULL
// Renders frame `frame`: the beginning of a segment (see playback_segment_begin), or the one after the last. The
// progressive methods take as many frames of the renderer as they need. False on failure (logged).
bool player_frame(player *p, uint32_t frame);
renderer *player_renderer(const player *p); // NULL before the first frame; another one after a cut
double player_milliseconds(const player *p); // that the last frame took
