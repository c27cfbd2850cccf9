// Where the history of the shadow ratio does not hold: one pixel in 16 keeps its first shadow sample, and when lights
// or geometry change it is traced again in the next frame, with the light that its VPL sends now. The camera alone
// changes nothing that these samples could tell.
//
// What they do not tell, changes that go on for frames, shows as a lag: over the pixels of a surface around, a frame's
// samples give another ratio than the history does. The history is cut where the lag of the last frames is beyond
// chance, also for STILL_SAMPLES frames in which nothing changes any more.
//
//   shadow_records     one a stratum of 4 x 4 pixels: see shaders/shadow_again.glsl.h
//   shadow_lag         the same of the lag
//   shadow_limit       RG32F, a texel a stratum of the *last* frame: frames that the history may count around there,
//                      and the change of light that was found. Light that changes alike in frame after frame does
//                      not count: under a moving sun in the atrium flicker was 1.6 times as much when it did
#pragma once

#include "renderer.h"

// The next binding of the pass that makes the shadow rays: where it writes what it knows of the samples. Only the pass
// of the first batch does.
void shadow_again_record(renderer *r, frame_graph_pass *pass, bool first);
// The name of the image, or NULL in a frame without limits.
const char *shadow_again_limit(const renderer *r);
