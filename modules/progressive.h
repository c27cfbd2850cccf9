// Pictures that get better from frame to frame, for the reference methods: the sums that the frames have left so far,
// the picture made from them, how far it is, and its state in a file. A method keeps two images of light ("radiance over
// albedo") as sums, and the picture is
//
//     radiance = emission + albedo * (factor[0] * sums[0] + factor[1] * sums[1])
//
// `path` puts even samples in one and odd ones in the other, so that their difference estimates the error. `vpl` puts
// the light of the VPLs so far in one, and each frame's direct light in the other.
#pragma once

#include "renderer.h"

typedef struct progressive_status {
    uint64_t done, total; // path: samples per pixel; vpl, ir: VPLs
    double error; // estimated relative L2 error of the picture, from the two halves; NAN where it is not known (yet)
    bool finished; // done == total, or the estimated error is at most settings.until
    double rays; // traced so far, all kinds
} progressive_status;

// ---- For the command and others who drive frames.
bool progressive_is(const renderer *r); // the method gets better with every frame (path, vpl)
// After a frame. Reading the error costs a read-back of the sums: it is kept up to date at powers of two of `done`,
// and whenever `measure` asks.
progressive_status progressive_status_get(renderer *r, bool measure);
// The state as a file, written beside and renamed. `identity` is text that names everything that the sums depend on
// (scene, camera, settings); loading fails with one logged line when it differs, when the file is damaged, or when it
// is none. Load before the first frame. A state may be continued with another spp or until.
bool progressive_save(renderer *r, const char *path, const char *identity);
bool progressive_load(renderer *r, const char *path, const char *identity);
void progressive_restart(renderer *r); // the next frame begins anew; done by itself when camera, size or settings change

// ---- For the methods, in their setup. Sums are the buffer "sums_before", of vec4[2][pixels] in rows from the top;
// zero where `done` is 0. The method modifies it to "sums", counts what this frame adds, and has the picture made.
uint64_t progressive_begin(renderer *r, uint64_t total); // imports "sums_before"; returns `done` before this frame
// This frame adds `count` to `done`; makes "radiance" of "sums" and the two factors.
void progressive_end(renderer *r, uint64_t count, const float factors[2], bool halves);
