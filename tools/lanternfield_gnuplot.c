// Running gnuplot: see lanternfield_gnuplot.h.
#include "lanternfield_gnuplot.h"

#include "engine/base.h"

#include <errno.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>

// All of a temporary file from its start; free() it.
static char *file_take(FILE *file, size_t *size)
{
    fseek(file, 0, SEEK_END);
    *size = (size_t)ftell(file);
    rewind(file);
    char *const bytes = memory_alloc(*size + 1);
    *size = fread(bytes, 1, *size, file);
    return bytes;
}

extern char **environ;

// Runs gnuplot with its input and outputs in files; false with errno set when it could not be started.
static bool gnuplot_spawn(FILE *const files[3], int *status)
{
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    for (int i = 0; i < 3; i++) {
        posix_spawn_file_actions_adddup2(&actions, fileno(files[i]), i);
    }
    char *const arguments[] = {"gnuplot", "--default-settings", NULL};
    pid_t process;
    const int error = posix_spawnp(&process, arguments[0], &actions, NULL, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error) {
        errno = error;
        return false;
    }
    while (waitpid(process, status, 0) < 0 && errno == EINTR) {
    }
    return true;
}

static gnuplot_result picture_take(FILE *const files[3], int status, const char *path)
{
    size_t size, message_size;
    char *const picture = file_take(files[1], &size);
    char *const message = file_take(files[2], &message_size);
    gnuplot_result result = GNUPLOT_FAILED;
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || size == 0) {
        const char *const text = message + strspn(message, "\n \t");
        log_error("cannot draw \"%s\": gnuplot failed: %.*s", path, (int)strcspn(text, "\n"), text);
    } else if (file_write(path, picture, size)) {
        result = GNUPLOT_DONE;
    }
    free(picture);
    free(message);
    return result;
}

static gnuplot_result gnuplot_run(const char *terminal, const char *script, const char *path)
{
    FILE *const files[3] = {tmpfile(), tmpfile(), tmpfile()}; // input, picture, messages
    gnuplot_result result = GNUPLOT_FAILED;
    if (!files[0] || !files[1] || !files[2]) {
        log_error("cannot draw \"%s\": no temporary file: %s", path, strerror(errno));
        goto done;
    }
    fprintf(files[0], "%s%s", terminal, script);
    fflush(files[0]);
    rewind(files[0]);
    int status = 0;
    if (gnuplot_spawn(files, &status)) {
        result = picture_take(files, status, path);
    } else if (errno == ENOENT) {
        result = GNUPLOT_MISSING;
    } else {
        log_error("cannot draw \"%s\": gnuplot does not start: %s", path, strerror(errno));
    }
done:
    for (int i = 0; i < 3; i++) {
        if (files[i]) {
            fclose(files[i]);
        }
    }
    return result;
}

gnuplot_result gnuplot_draw(const char *script, const char *path, int width, int height)
{
    arena memory = {0};
    const char *const svg = arena_printf(
        &memory, "set terminal svg noenhanced size %d,%d font 'Arial,12' background 'white'\n", width, height);
    const char *const png = arena_printf(&memory,
                                         "set terminal pngcairo noenhanced size %d,%d font 'Arial,12' fontscale 1.5 "
                                         "linewidth 2 pointscale 2 background 'white'\n",
                                         2 * width, 2 * height);
    gnuplot_result result = gnuplot_run(svg, script, arena_printf(&memory, "%s.svg", path));
    if (result == GNUPLOT_DONE) {
        result = gnuplot_run(png, script, arena_printf(&memory, "%s.png", path));
    }
    arena_fini(&memory);
    return result;
}
