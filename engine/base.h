// What every other file may rely on: the log, arenas, whole-file input and output, and a few helpers.
#pragma once

#include <assert.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define countof(array) (sizeof(array) / sizeof((array)[0]))

static inline uint32_t min_u32(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}
static inline uint32_t max_u32(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}
static inline uint32_t div_up_u32(uint32_t a, uint32_t b)
{
    return (a + b - 1) / b;
}
// `alignment` is a power of two.
static inline uint64_t align_up(uint64_t value, uint64_t alignment)
{
    return (value + alignment - 1) & ~(alignment - 1);
}

// ---- Log. One line a call, no trailing newline in the format.
//
// A failure is logged once, where its reason is known, naming the thing and what was expected;
// callers pass the failure on in silence.
typedef enum log_level { LOG_DEBUG, LOG_INFO, LOG_WARNING, LOG_ERROR } log_level;
typedef void (*log_sink)(log_level level, const char *line, void *user);

// Replaces the sink; NULL restores the default, which writes "lanternfield: error: ..." to stderr and drops LOG_DEBUG.
void log_sink_set(log_sink sink, void *user);
void log_write(log_level level, const char *format, ...) __attribute__((format(printf, 2, 3)));
#define log_debug(...) log_write(LOG_DEBUG, __VA_ARGS__)
#define log_info(...) log_write(LOG_INFO, __VA_ARGS__)
#define log_warning(...) log_write(LOG_WARNING, __VA_ARGS__)
#define log_error(...) log_write(LOG_ERROR, __VA_ARGS__)

// ---- Memory. Running out of memory is not recoverable here: these log and abort, and never return NULL.
void *memory_alloc(size_t size); // zeroed
void *memory_realloc(void *pointer, size_t size);
// Grows `*items` so that it holds at least `count` items of `item_size`, by doubling; new space is zeroed.
void memory_reserve(void **items, size_t *capacity, size_t count, size_t item_size);

// Bump allocator: allocations live until the next reset. Zero-initialise to use; keeps its largest block over resets,
// so a loop that resets every frame stops allocating once warm.
typedef struct arena {
    struct arena_block *block;
} arena;
void *arena_alloc(arena *arena, size_t size); // zeroed, 16-byte aligned
char *arena_printf(arena *arena, const char *format, ...) __attribute__((format(printf, 2, 3)));
char *arena_strdup(arena *arena, const char *text);
void arena_reset(arena *arena); // O(blocks); invalidates all that was allocated
void arena_fini(arena *arena);

// ---- Files.
// Reads a whole regular file into memory_alloc'd bytes (free() them), with one zero byte after the end. Returns NULL
// and logs the reason when the file is missing, a directory or unreadable.
uint8_t *file_read(const char *path, size_t *size);
// Writes beside `path` and renames, so that `path` is either whole or untouched. Returns false and logs on failure
// (no such folder, disk full, ...), leaving nothing behind.
bool file_write(const char *path, const void *bytes, size_t size);

// Monotonic time in seconds.
double time_now(void);
