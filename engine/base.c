// The log, arenas and whole-file input and output: see base.h.
#include "base.h"

#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

// ---- Log

static void stderr_sink(log_level level, const char *line, void *user)
{
    (void)user;
    static const char *const prefixes[] = {
        [LOG_INFO] = "",
        [LOG_WARNING] = "lanternfield: warning: ",
        [LOG_ERROR] = "lanternfield: error: ",
    };
    if (level != LOG_DEBUG) {
        fprintf(stderr, "%s%s\n", prefixes[level], line);
    }
}

static log_sink current_sink = stderr_sink;
static void *current_sink_user;

void log_sink_set(log_sink sink, void *user)
{
    current_sink = sink ? sink : stderr_sink;
    current_sink_user = sink ? user : NULL;
}

void log_write(log_level level, const char *format, ...)
{
    // Short lines stay on the stack, so that running out of memory can be logged.
    char short_line[512];
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(short_line, sizeof(short_line), format, arguments);
    va_end(arguments);
    assert(length >= 0);
    if ((size_t)length < sizeof(short_line)) {
        current_sink(level, short_line, current_sink_user);
        return;
    }

    char *const line = memory_alloc((size_t)length + 1);
    va_start(arguments, format);
    vsnprintf(line, (size_t)length + 1, format, arguments);
    va_end(arguments);
    current_sink(level, line, current_sink_user);
    free(line);
}

// ---- Memory

static void *memory_check(void *pointer, size_t size)
{
    if (!pointer) {
        log_error("out of memory: cannot allocate %zu bytes", size);
        abort();
    }
    return pointer;
}

void *memory_alloc(size_t size)
{
    // The C library may answer a request for nothing with NULL.
    return memory_check(calloc(1, size ? size : 1), size);
}

void *memory_realloc(void *pointer, size_t size)
{
    return memory_check(realloc(pointer, size ? size : 1), size);
}

void memory_reserve(void **items, size_t *capacity, size_t count, size_t item_size)
{
    if (count <= *capacity) {
        return;
    }
    const size_t grown = count > 2 * *capacity ? count : 2 * *capacity;
    size_t size;
    if (__builtin_mul_overflow(grown, item_size, &size)) {
        memory_check(NULL, SIZE_MAX);
    }

    // Callers cast from `T **`: going through memcpy keeps the compiler from assuming that no `T *` changes here.
    char *bytes;
    memcpy(&bytes, items, sizeof(bytes));
    bytes = memory_realloc(bytes, size);
    memset(bytes + *capacity * item_size, 0, size - *capacity * item_size);
    memcpy(items, &bytes, sizeof(bytes));
    *capacity = grown;
}

enum { ARENA_ALIGNMENT = 16, ARENA_FIRST_BLOCK_SIZE = 64 * 1024 };

struct arena_block {
    struct arena_block *previous;
    size_t capacity, used;
    _Alignas(ARENA_ALIGNMENT) unsigned char bytes[];
};
_Static_assert(_Alignof(max_align_t) >= ARENA_ALIGNMENT, "blocks come from calloc");

static void arena_grow(arena *arena, size_t size)
{
    // Each block is at least twice the one before, so the newest is the largest and the one that a reset keeps.
    const size_t doubled = arena->block ? 2 * arena->block->capacity : ARENA_FIRST_BLOCK_SIZE;
    const size_t capacity = size > doubled ? size : doubled;
    struct arena_block *const block = memory_alloc(sizeof(*block) + capacity);
    block->previous = arena->block;
    block->capacity = capacity;
    arena->block = block;
}

void *arena_alloc(arena *arena, size_t size)
{
    assert(size <= PTRDIFF_MAX);
    const size_t padded = align_up(size, ARENA_ALIGNMENT);
    if (!arena->block || padded > arena->block->capacity - arena->block->used) {
        arena_grow(arena, padded);
    }
    void *const bytes = arena->block->bytes + arena->block->used;
    arena->block->used += padded;
    return memset(bytes, 0, size);
}

char *arena_printf(arena *arena, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(NULL, 0, format, arguments);
    va_end(arguments);
    assert(length >= 0);

    char *const text = arena_alloc(arena, (size_t)length + 1);
    va_start(arguments, format);
    vsnprintf(text, (size_t)length + 1, format, arguments);
    va_end(arguments);
    return text;
}

char *arena_strdup(arena *arena, const char *text)
{
    const size_t size = strlen(text) + 1;
    return memcpy(arena_alloc(arena, size), text, size);
}

static void arena_blocks_free(struct arena_block *newest)
{
    for (struct arena_block *block = newest; block;) {
        struct arena_block *const previous = block->previous;
        free(block);
        block = previous;
    }
}

void arena_reset(arena *arena)
{
    if (arena->block) {
        arena_blocks_free(arena->block->previous);
        arena->block->previous = NULL;
        arena->block->used = 0;
    }
}

void arena_fini(arena *arena)
{
    arena_blocks_free(arena->block);
    arena->block = NULL;
}

// ---- Files

// Opens a regular file to read and tells its size; -1 when it cannot, which is logged.
static int regular_file_open(const char *path, size_t *size)
{
    // Without O_NONBLOCK opening a pipe would wait for a writer before it could be refused.
    const int file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    struct stat status;
    if (file < 0 || fstat(file, &status) != 0) {
        log_error("cannot read \"%s\": %s", path, strerror(errno));
        goto fail;
    }
    if (!S_ISREG(status.st_mode)) {
        log_error("cannot read \"%s\": it is not a regular file", path);
        goto fail;
    }
    *size = (size_t)status.st_size;
    return file;

fail:
    if (file >= 0) {
        close(file);
    }
    return -1;
}

static bool read_all(int file, uint8_t *bytes, size_t size)
{
    for (size_t done = 0; done < size;) {
        const ssize_t count = read(file, bytes + done, size - done);
        if (count < 0 && errno != EINTR) {
            return false;
        }
        if (count == 0) {
            // The file was cut short after its size was asked for; the C library has no better name for it.
            errno = EIO;
            return false;
        }
        done += count > 0 ? (size_t)count : 0;
    }
    return true;
}

uint8_t *file_read(const char *path, size_t *size)
{
    size_t file_size;
    const int file = regular_file_open(path, &file_size);
    if (file < 0) {
        return NULL;
    }
    uint8_t *bytes = memory_alloc(file_size + 1);
    if (read_all(file, bytes, file_size)) {
        *size = file_size;
    } else {
        log_error("cannot read \"%s\": %s", path, strerror(errno));
        free(bytes);
        bytes = NULL;
    }
    close(file);
    return bytes;
}

// Creates a new file in the folder of `path` and writes its name to `name`.
static int temporary_file_create(const char *path, char *name, size_t name_size)
{
    static atomic_uint serial;
    const char *const slash = strrchr(path, '/');
    const int folder_length = slash ? (int)(slash + 1 - path) : 0;
    int file;
    do {
        const unsigned number = atomic_fetch_add(&serial, 1);
        snprintf(name, name_size, "%.*s.%ld.%u.tmp", folder_length, path, (long)getpid(), number);
        // Not mkstemp, which would make the file private instead of obeying the umask.
        file = open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    } while (file < 0 && errno == EEXIST);
    return file;
}

static bool write_all(int file, const uint8_t *bytes, size_t size)
{
    for (size_t done = 0; done < size;) {
        const ssize_t count = write(file, bytes + done, size - done);
        if (count < 0 && errno != EINTR) {
            return false;
        }
        done += count > 0 ? (size_t)count : 0;
    }
    return true;
}

// Writes the bytes and closes the file; some file systems report a full disk only on closing.
static bool write_and_close(int file, const uint8_t *bytes, size_t size)
{
    const bool written = write_all(file, bytes, size);
    const int write_error = errno;
    const bool closed = close(file) == 0;
    if (!written) {
        errno = write_error;
    }
    return written && closed;
}

bool file_write(const char *path, const void *bytes, size_t size)
{
    // Renaming over a device or a pipe would replace it: `-o /dev/null` run by root must not.
    struct stat status;
    if (stat(path, &status) == 0 && !S_ISREG(status.st_mode)) {
        log_error("cannot write \"%s\": it is not a regular file", path);
        return false;
    }

    const size_t name_size = strlen(path) + 64;
    char *const name = memory_alloc(name_size);
    const int file = temporary_file_create(path, name, name_size);
    const bool ok = file >= 0 && write_and_close(file, bytes, size) && rename(name, path) == 0;
    if (!ok) {
        log_error("cannot write \"%s\": %s", path, strerror(errno));
    }
    if (!ok && file >= 0) {
        unlink(name);
    }
    free(name);
    return ok;
}

double time_now(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
