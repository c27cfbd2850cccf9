// The files of `lanternfield play`: a folder with the frames, and a note of what they depend on, so that frames of
// different runs are never mixed.
#include "lanternfield_play.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static const char identity_name[] = "playback.txt";

// ---- Which files

static bool output_add(play_files *files, const char *where, const char *name)
{
    static const play_output pictures[] = {{"frame", "png", NULL}, {"frame", "exr", NULL}};
    play_output output = {.name = name, .extension = "exr", .aov = aov_find(name)};
    for (size_t i = 0; i < countof(pictures); i++) {
        output = strcmp(name, pictures[i].extension) == 0 ? pictures[i] : output;
    }
    if (!output.aov && strcmp(output.name, "frame") != 0) {
        char names[160];
        aov_names_print(names, sizeof(names));
        log_error("%s: expected png, exr, %s, got \"%.40s\"", where, names, name);
        return false;
    }
    for (uint32_t i = 0; i < files->output_count; i++) {
        const play_output *const other = &files->outputs[i];
        if (strcmp(other->name, output.name) == 0 && strcmp(other->extension, output.extension) == 0) {
            log_error("%s: \"%s\" is given twice", where, name);
            return false;
        }
    }
    output.name = output.aov ? aov_name(output.aov) : output.name;
    files->outputs[files->output_count++] = output;
    return true;
}

static bool outputs_of_option(play_files *files, const char *list)
{
    char name[40];
    for (const char *from = list; *from;) {
        const size_t length = strcspn(from, ",");
        snprintf(name, sizeof(name), "%.*s", (int)length, from);
        if (!output_add(files, "--outputs", name)) {
            return false;
        }
        from += length + (from[length] == ',');
    }
    return true;
}

static bool outputs_of_script(play_files *files, const playback *script)
{
    for (uint32_t i = 0; i < script->output_count; i++) {
        char where[512];
        snprintf(where, sizeof(where), "%s:%u: outputs", script->path,
                 script->output_lines ? script->output_lines[i] : 0);
        if (!output_add(files, where, script->outputs[i])) {
            return false;
        }
    }
    return true;
}

static bool has_picture(const play_files *files)
{
    bool has = false;
    for (uint32_t i = 0; i < files->output_count; i++) {
        has = has || strcmp(files->outputs[i].extension, "png") == 0;
    }
    return has;
}

static char *text_make(const char *format, ...) __attribute__((format(printf, 1, 2)));
static char *text_make(const char *format, ...)
{
    char *text = NULL;
    va_list arguments;
    va_start(arguments, format);
    const int length = vasprintf(&text, format, arguments);
    va_end(arguments);
    assert(length >= 0);
    (void)length;
    return text;
}

// "a/b/slow_pan.json" becomes "slow_pan".
static char *folder_of_script(const char *path)
{
    const char *const slash = strrchr(path, '/');
    const char *const name = slash ? slash + 1 : path;
    const char *const dot = strrchr(name, '.');
    return text_make("%.*s%s", dot && dot > name ? (int)(dot - name) : (int)strlen(name), name,
                     dot && dot > name ? "" : ".frames");
}

bool play_files_init(play_files *files, const play_request *request, const playback *script)
{
    if (request->outputs ? !outputs_of_option(files, request->outputs) : !outputs_of_script(files, script)) {
        return false;
    }
    files->folder_is_temporary = request->movie && !request->folder;
    if (request->movie && !has_picture(files) && !output_add(files, "-o", "png")) {
        return false;
    }
    if (files->folder_is_temporary && files->output_count > 1) {
        log_error("-o %s: the outputs exr and parts of the picture need a folder too; expected -o DIR as well",
                  request->movie);
        return false;
    }
    files->folder = files->folder_is_temporary ? text_make("%s.frames", request->movie)
                    : request->folder          ? text_make("%s", request->folder)
                                               : folder_of_script(script->path);
    return true;
}

void play_files_fini(play_files *files)
{
    free(files->folder);
    free(files->identity);
    *files = (play_files){0};
}

// ---- What the frames depend on

static char *identity_make(const render_session *session, const playback *script)
{
    char *text = NULL;
    size_t size = 0;
    FILE *const out = open_memstream(&text, &size);
    assert(out);
    fprintf(out, "program lanternfield %s\ndevice %s\nscript %016llx\n", LANTERNFIELD_VERSION, gpu_name(session->gpu),
            (unsigned long long)script->hash);
    scene_identity_print(out, session->scene);
    for (uint32_t i = 0; i < script->override_count; i++) {
        fprintf(out, "--%s %s\n", script->overrides[i].info->name, script->overrides[i].text);
    }
    fclose(out);
    return text;
}

// The first line that is not in both, without its end.
static char *difference_find(const char *stored, const char *expected)
{
    while (*stored && *stored == *expected) {
        const size_t a = strcspn(stored, "\n"), b = strcspn(expected, "\n");
        if (a != b || memcmp(stored, expected, a) != 0) {
            break;
        }
        stored += a + (stored[a] != 0);
        expected += b + (expected[b] != 0);
    }
    return text_make("\"%.*s\", expected \"%.*s\"", (int)strcspn(stored, "\n"), stored, (int)strcspn(expected, "\n"),
                     expected);
}

static bool identity_check(const play_files *files, const char *path)
{
    size_t size;
    char *const stored = (char *)file_read(path, &size);
    const bool same = stored && strcmp(stored, files->identity) == 0;
    if (stored && !same) {
        char *const difference = difference_find(stored, files->identity);
        log_error("%s: holds frames of something else, %s; remove them or choose another folder", files->folder,
                  difference);
        free(difference);
    }
    free(stored);
    return same;
}

static bool folder_make(play_files *files)
{
    struct stat status;
    if (stat(files->folder, &status) == 0) {
        if (!S_ISDIR(status.st_mode)) {
            log_error("%s: expected a folder, or nothing", files->folder);
            return false;
        }
        return true;
    }
    files->folder_is_new = mkdir(files->folder, 0777) == 0;
    if (!files->folder_is_new) {
        log_error("%s: cannot make the folder: %s", files->folder, strerror(errno));
    }
    return files->folder_is_new;
}

bool play_files_open(play_files *files, const render_session *session, const playback *script)
{
    if (!folder_make(files)) {
        return false;
    }
    files->identity = identity_make(session, script);
    char *const path = text_make("%s/%s", files->folder, identity_name);
    const bool ok = access(path, F_OK) == 0 ? identity_check(files, path)
                                            : file_write(path, files->identity, strlen(files->identity));
    free(path);
    return ok;
}

// ---- Frames

static char *frame_path(const play_files *files, const play_output *output, uint32_t frame)
{
    return text_make("%s/%s_%06u.%s", files->folder, output->name, frame, output->extension);
}

char *play_picture_path(const play_files *files, uint32_t frame)
{
    return frame_path(files, &(play_output){"frame", "png", NULL}, frame);
}

bool play_frame_done(const play_files *files, uint32_t frame)
{
    bool done = true;
    for (uint32_t i = 0; i < files->output_count; i++) {
        char *const path = frame_path(files, &files->outputs[i], frame);
        done = done && access(path, R_OK) == 0;
        free(path);
    }
    return done;
}

bool play_frame_write(const play_files *files, renderer *r, uint32_t frame)
{
    bool ok = true;
    for (uint32_t i = 0; i < files->output_count && ok; i++) {
        const play_output *const output = &files->outputs[i];
        if (output->aov && !aov_present(r, output->aov)) {
            log_error("outputs: %s: these settings and this scene do not make it in frame %u", output->name, frame);
            return false;
        }
        char *const path = frame_path(files, output, frame);
        ok = output->aov ? aov_write(r, output->aov, path) : picture_write(r, path);
        free(path);
    }
    return ok;
}

void play_files_discard(const play_files *files, uint32_t begin, uint32_t end)
{
    for (uint32_t frame = begin; frame < end; frame++) {
        char *const path = play_picture_path(files, frame);
        unlink(path);
        free(path);
    }
    char *const identity = text_make("%s/%s", files->folder, identity_name);
    unlink(identity);
    free(identity);
    rmdir(files->folder); // frames of another range stay, and are found again by what follows
}
