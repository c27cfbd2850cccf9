// What the files of `lanternfield play` share.
#pragma once

#include "lanternfield.h"

#include "modules/player.h"

enum { PLAY_OUTPUTS_MAX = 16, PLAY_OVERRIDES_MAX = 64 };

typedef struct play_request { // strings belong to argv
    render_request render; // scene, settings, stats, device, validate and help of it
    const char *script;
    const char *folder, *movie; // NULL: not asked for
    const char *outputs; // names, separated by commas; NULL: the script's
    const char *record; // file for the script with the choices of automatic settings; NULL: none
    bool has_range, resume;
    uint32_t begin, end; // frames; the end is not among them
    struct {
        const setting_info *info;
        const char *text; // NULL: a switch
    } overrides[PLAY_OVERRIDES_MAX];
    uint32_t override_count;
} play_request;

int play_command(int argc, char **argv); // returns the exit code

// ---- The files of frames: lanternfield_play_files.c.
typedef struct play_output { // one file a frame
    const char *name, *extension;
    const struct aov_info *aov; // NULL: the picture itself
} play_output;
typedef struct play_files {
    char *folder;
    bool folder_is_temporary; // holds the frames of a movie, and goes when it is complete
    bool folder_is_new;
    char *identity; // what the frames depend on
    play_output outputs[PLAY_OUTPUTS_MAX];
    uint32_t output_count;
} play_files;
// Finds out which files are wanted. False when one of them is not known (logged).
bool play_files_init(play_files *files, const play_request *request, const playback *script);
// Makes the folder, or sees that what it holds is of the same script, scene and settings. False on failure (logged).
bool play_files_open(play_files *files, const render_session *session, const playback *script);
bool play_frame_done(const play_files *files, uint32_t frame); // all its files are there
bool play_frame_write(const play_files *files, renderer *r, uint32_t frame); // false on failure (logged)
char *play_picture_path(const play_files *files, uint32_t frame); // of the PNG; free() it
// Removes the frames of a movie that is complete.
void play_files_discard(const play_files *files, uint32_t begin, uint32_t end);
void play_files_fini(play_files *files);

// ---- Movies by ffmpeg, which a pipe feeds: lanternfield_movie.c.
bool movie_is(const char *path); // by its extension: .mp4, .mkv, .mov
bool movie_check(const char *path); // before any work: false, and logged, when it cannot be written
// Makes the movie of the PNGs of the frames, beside `path`, and renames it. False on failure (logged).
bool movie_write(const char *path, const play_files *files, uint32_t begin, uint32_t end, double frame_rate);

// ---- The choices of automatic settings as a script: lanternfield_play_record.c.
typedef struct play_record { // zero-initialise
    struct cJSON *events; // {"time", "settings"}
    render_settings now; // as the events so far say; the target left out
} play_record;
// After a frame: notes what its settings had that the script and the events so far do not have.
void play_record_add(play_record *record, const playback *script, const renderer *r, uint32_t frame);
// Writes the script with the events among its own. False on failure (logged).
bool play_record_write(const play_record *record, const playback *script, const char *path);
void play_record_fini(play_record *record);

// ---- A row of statistics a frame: lanternfield_play_stats.c.
typedef struct play_row {
    uint32_t frame;
    double *values; // by column; NAN: none
    uint32_t count;
} play_row;
typedef struct play_stats { // zero-initialise
    const char *path;
    char **columns; // behind "frame"
    size_t column_count, column_capacity;
    play_row *rows; // by frame
    size_t row_count, row_capacity;
    render_times times;
} play_stats;
// With `keep` the rows that the file has stay, but for those of frames that are played again. False: it is none of
// these files (logged).
bool play_stats_open(play_stats *stats, const char *path, bool keep);
// Adds or replaces the row of the frame just played, and writes the file. False on failure (logged).
bool play_stats_add(play_stats *stats, const player *p, uint32_t frame, double time);
void play_stats_fini(play_stats *stats);
