// What the files of `lanternfield stability` share.
#pragma once

#include "lanternfield.h"

#include "modules/image_measure.h"
#include "modules/player.h"
#include "modules/sequence_measure.h"

enum { STABILITY_VARIANTS = 4 };

typedef struct stability_request { // strings belong to argv
    render_request render; // scene, settings, device, validate and help of it
    const char *script, *folder, *references; // references: NULL: a folder in `folder`
    uint32_t begin, end; // frames; the end is not among them
    bool has_range, has_size;
    uint32_t reference_vpls, reference_spp; // spp 0: VPLs
    playback_setting overrides[64];
    uint32_t override_count;
} stability_request;

typedef struct stability_frame { // of one variant
    float *image; // RGB
    image_measures error; // against this frame's reference
    double flicker; // NAN: the first
    double blocks; // relative L2 of the block means, against the reference
    bool changed; // other bytes than the frame before
} stability_frame;

typedef struct stability_variant {
    const char *name; // "TAA on the ratio"
    const char *taa; // text of the setting; NULL: as the script says
    bool random_seeds; // a seed of its own for every frame
    stability_frame *frames;
    double deviation; // measure (i), over the last STABILITY_STILL frames
} stability_variant;
enum { STABILITY_STILL = 32 };

// An event of the script: measure (iii) is taken between it and the next.
typedef struct stability_event {
    uint32_t frame;
    char what[96];
} stability_event;

typedef struct stability_run {
    const stability_request *request;
    playback *script;
    render_session session; // without a renderer, which the players have
    uint32_t width, height, begin, end;
    char *references_folder;
    float **references; // [end - begin]
    double reference_seconds; // that making them took, now; 0: all were there
    stability_variant variants[STABILITY_VARIANTS];
    stability_event *events;
    uint32_t event_count;
    double ev; // of all pictures
} stability_run;

int stability_command(int argc, char **argv); // returns the exit code

// Frames after the event from which on the picture's light stays within 5 % of what it comes to (its ratio to the
// reference's, against the mean of that over the last quarter before the next event); NAN: not before the next event.
double stability_settling(const stability_run *run, const stability_variant *variant, uint32_t event);
// frames.csv, charts, the strip of frames, report.html and report.md. False on failure (logged).
bool stability_report_write(const stability_run *run);
