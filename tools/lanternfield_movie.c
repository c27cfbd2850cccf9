// Movies: the PNGs of the frames go through a pipe to ffmpeg.
#include "lanternfield_play.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

static const char *const extensions[] = {".mp4", ".mkv", ".mov"};

bool movie_is(const char *path)
{
    bool is = false;
    for (size_t i = 0; i < countof(extensions); i++) {
        is = is || path_has_extension(path, extensions[i]);
    }
    return is;
}

// ---- The process

typedef struct process {
    pid_t id;
    int input, errors; // ends of pipes
} process;

// In a process group of its own, so that Ctrl-C reaches this program alone. Returns an errno.
static int process_start(process *p, char *const *words)
{
    int input[2], errors[2];
    if (pipe2(input, O_CLOEXEC) != 0 || pipe2(errors, O_CLOEXEC) != 0) {
        return errno;
    }
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input[0], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, errors[1], STDERR_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    const int error = posix_spawnp(&p->id, words[0], &actions, &attributes, words, environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    close(input[0]);
    close(errors[1]);
    p->input = input[1];
    p->errors = errors[0];
    if (error != 0) {
        close(p->input);
        close(p->errors);
    }
    return error;
}

// Waits for the end; `line` becomes the first line of what it complained about. False when it failed.
static bool process_end(process *p, char *line, size_t size)
{
    char rest[256];
    size_t length = 0;
    close(p->input);
    for (ssize_t got; (got = read(p->errors, line + length, size - 1 - length)) > 0;) {
        length += (size_t)got;
        if (length == size - 1) {
            while (read(p->errors, rest, sizeof(rest)) > 0) {
            }
            break;
        }
    }
    close(p->errors);
    line[length] = '\0';
    line[strcspn(line, "\r\n")] = '\0';
    int status = 0;
    while (waitpid(p->id, &status, 0) < 0 && errno == EINTR) {
    }
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

bool movie_check(const char *path)
{
    char line[200];
    process p;
    if (!output_path_check(path)) {
        return false;
    }
    const int error = process_start(&p, (char *[]){"ffmpeg", "-version", NULL});
    if (error != 0 || !process_end(&p, line, sizeof(line))) {
        log_error("cannot write \"%s\": movies need the program ffmpeg, and it does not run: %s", path,
                  error != 0 ? strerror(error) : line);
        return false;
    }
    return true;
}

// ---- The movie

static bool pipe_write(int pipe, const uint8_t *bytes, size_t size)
{
    while (size > 0) {
        const ssize_t written = write(pipe, bytes, size);
        if (written < 0 && errno != EINTR) {
            return false; // it ended, and says why itself
        }
        bytes += written > 0 ? written : 0;
        size -= written > 0 ? (size_t)written : 0;
    }
    return true;
}

static bool frames_send(const process *p, const play_files *files, uint32_t begin, uint32_t end)
{
    bool ok = true;
    for (uint32_t frame = begin; frame < end && ok; frame++) {
        size_t size;
        char *const path = play_picture_path(files, frame);
        uint8_t *const bytes = file_read(path, &size);
        ok = bytes && pipe_write(p->input, bytes, size);
        free(bytes);
        free(path);
    }
    return ok;
}

bool movie_write(const char *path, const play_files *files, uint32_t begin, uint32_t end, double frame_rate)
{
    arena memory = {0};
    // The extension stays, as ffmpeg goes by it.
    const char *const dot = strrchr(path, '.');
    char *const beside = arena_printf(&memory, "%.*s.part%s", (int)(dot - path), path, dot);
    char *const rate = arena_printf(&memory, "%.9g", frame_rate);
    char *const words[] = {"ffmpeg", "-y", "-nostdin", "-loglevel", "error", "-f", "image2pipe", "-framerate", rate,
                           "-c:v", "png", "-i", "pipe:0", "-c:v", "libx264", "-crf", "16", "-preset", "medium",
                           // Even sides, as 4:2:0 needs them; the same bytes each time.
                           "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-fflags", "+bitexact",
                           "-flags:v", "+bitexact", "-threads", "1", beside, NULL};
    const struct sigaction ignore = {.sa_handler = SIG_IGN};
    struct sigaction before;
    sigaction(SIGPIPE, &ignore, &before);
    char line[200] = "";
    process p;
    const int error = process_start(&p, words);
    bool ok = error == 0 && frames_send(&p, files, begin, end);
    if (error == 0) {
        ok = process_end(&p, line, sizeof(line)) && ok;
    }
    sigaction(SIGPIPE, &before, NULL);
    if (ok && rename(beside, path) != 0) {
        snprintf(line, sizeof(line), "%s", strerror(errno));
        ok = false;
    }
    if (!ok) {
        log_error("cannot write \"%s\": ffmpeg: %s", path, error != 0 ? strerror(error) : *line ? line : "it failed");
        unlink(beside);
    }
    arena_fini(&memory);
    return ok;
}
