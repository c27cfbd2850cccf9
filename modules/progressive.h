// Pictures that get better from frame to frame, for the reference methods: the sums that the frames have left so far,
// the picture made from them, how far it is, and its state in a file. A method keeps two images of light ("radiance
// over albedo") as sums, and the picture is
//
//     radiance = emission + albedo * (factor[0] * sums[0] + factor[1] * sums[1])
//
// where something was drawn, else 0; emission is left out of `--only indirect`. `path` puts even samples in one and odd
// ones in the other, so that their difference estimates the error. `vpl` puts the light of the VPLs so far in one, and
// each frame's direct light in the other.
#pragma once

#include "renderer.h"

typedef struct progressive_status {
    // path: samples per pixel; vpl, ir: slots for VPLs, or frames without any. After a failed frame: as before it.
    uint64_t done, total;
    // Estimated relative L2 error of the picture, sqrt(sum variance / sum radiance^2) over all channels of all pixels,
    // from the two halves; NAN where it is not known: below 2 samples, where the sums are no halves, not measured yet.
    double error;
    bool finished; // done >= total, or the estimated error of at least 16 samples is at most settings.until
    double rays; // traced so far, all kinds, those before a loaded state was saved included
} progressive_status;

// ---- For the command and others who drive frames.
bool progressive_is(const renderer *r); // the method gets better with every frame (path, vpl)
// After a frame. The error is brought up to date when `measure` asks or settings.until is set, which adds up a few
// numbers per workgroup; else it is that of the last time.
progressive_status progressive_status_get(renderer *r, bool measure);
// The state as a file, written beside and renamed; a read-back that changes nothing of what follows. `identity` is text
// that names everything that the sums depend on (scene, camera, settings); loading fails with one logged line when it
// differs (the first line that does is named), when the file is damaged, or when it is none. Load before a frame, with
// settings' size set; that frame takes the sums as they are, and the status before it is that of the state (total 0).
// A state may be continued with another spp or until.
// Numbers are stored as the machine has them (little-endian).
bool progressive_save(renderer *r, const char *path, const char *identity);
bool progressive_load(renderer *r, const char *path, const char *identity);
// The next frame begins anew. Done by itself when the camera, the size, instances, punctual lights or settings change,
// except the settings spp, until, frames, exposure and rays.
void progressive_restart(renderer *r);

// ---- For the methods, in their setup. Sums are the buffer "sums_before", of vec4[2][pixels] in rows from the top;
// zero where `done` is 0. The method modifies it to "sums", counts what this frame adds, and has the picture made. One
// storage buffer holds both halves, so where maxStorageBufferRange is 128 MiB pictures have at most 4,194,304 pixels;
// larger ones fail with a line.
bool progressive_is_fresh(renderer *r); // this frame begins anew: `done` is 0 before it
uint64_t progressive_begin(renderer *r, uint64_t total); // imports "sums_before"; returns `done` before this frame
// This frame adds `count` to `done`; makes "radiance" of "sums" and the two factors. `halves`: sums[0] holds the even
// samples' and sums[1] the odd ones', counted from 0. With count = 0 "sums" need not exist.
void progressive_end(renderer *r, uint64_t count, const float factors[2], bool halves);
