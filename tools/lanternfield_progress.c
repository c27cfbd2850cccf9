// The progress line on a terminal.
#include "lanternfield.h"

#include <unistd.h>

static bool on_terminal, shown;

static void line_clear(void)
{
    if (shown) {
        fputs("\r\033[K", stderr);
        shown = false;
    }
}

static void log_over_progress(log_level level, const char *line, void *user)
{
    (void)user;
    line_clear();
    // The default sink knows how lines look.
    log_sink_set(NULL, NULL);
    log_write(level, "%s", line);
    log_sink_set(log_over_progress, NULL);
}

void progress_begin(void)
{
    on_terminal = isatty(STDERR_FILENO);
    if (on_terminal) {
        log_sink_set(log_over_progress, NULL);
    }
}

void progress_show(const char *format, ...)
{
    if (!on_terminal) {
        return;
    }
    line_clear();
    va_list arguments;
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fflush(stderr);
    shown = true;
}

void progress_end(void)
{
    line_clear();
    log_sink_set(NULL, NULL);
}

void time_left_print(double seconds, char text[32])
{
    snprintf(text, 32, seconds < 90 ? "  %.0f s left" : "  %.0f min left", seconds < 90 ? seconds : seconds / 60);
}
