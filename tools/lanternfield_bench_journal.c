// The journal of `lanternfield bench`, which makes runs resumable, and the hashes that its keys are made of.
#include "lanternfield_bench.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

// ---- Hashes

uint64_t bench_hash(uint64_t hash, const void *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ ((const uint8_t *)bytes)[i]) * 0x100000001b3ull;
    }
    return hash;
}

bool bench_hash_file(const char *path, uint64_t *hash)
{
    size_t size;
    uint8_t *const bytes = file_read(path, &size);
    if (bytes) {
        *hash = bench_hash(BENCH_HASH_START, bytes, size);
    }
    free(bytes);
    return bytes != NULL;
}

void bench_key_print(uint64_t hash, char key[BENCH_KEY_SIZE])
{
    snprintf(key, BENCH_KEY_SIZE, "%016" PRIx64, hash);
}

bool bench_folder_make(const char *path)
{
    char *const copy = strdup(path);
    bool ok = true;
    for (char *slash = strchr(copy + 1, '/'); ok; slash = strchr(slash + 1, '/')) {
        if (slash) {
            *slash = 0;
        }
        ok = mkdir(copy, 0777) == 0 || errno == EEXIST;
        if (!slash) {
            break;
        }
        *slash = '/';
    }
    struct stat status;
    ok = ok && stat(path, &status) == 0 && S_ISDIR(status.st_mode);
    if (!ok) {
        log_error("cannot make the folder \"%s\": %s", path, strerror(errno == EEXIST ? ENOTDIR : errno));
    }
    free(copy);
    return ok;
}

// ---- The journal

typedef struct entry {
    const char *kind, *key; // in `json`
    cJSON *json;
} entry;
struct bench_journal {
    int file;
    char *path;
    entry *entries;
    size_t count, capacity;
};

static bool entry_add(bench_journal *journal, cJSON *json)
{
    const char *const kind = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(json, "kind"));
    const char *const key = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(json, "key"));
    if (!kind || !key) {
        cJSON_Delete(json);
        return false;
    }
    memory_reserve((void **)&journal->entries, &journal->capacity, journal->count + 1, sizeof(entry));
    journal->entries[journal->count++] = (entry){kind, key, json};
    return true;
}

static void lines_read(bench_journal *journal, char *text, size_t size)
{
    uint32_t number = 1;
    for (char *line = text; line < text + size; number++) {
        // There is an end, for torn lines are cut; zeros, which a crash of the system may leave, end nothing.
        char *const end = memchr(line, '\n', (size_t)(text + size - line));
        *end = 0;
        if (!entry_add(journal, cJSON_Parse(line))) {
            log_warning("%s:%u: damaged; what it held is measured again", journal->path, number);
        }
        line = end + 1;
    }
}

// A last line without its end was being written when the process ended: it is cut off, so that the next one begins on a
// line of its own.
static bool torn_line_cut(bench_journal *journal, char *text, size_t *size)
{
    const size_t whole = *size;
    while (*size > 0 && text[*size - 1] != '\n') {
        text[--*size] = 0;
    }
    return *size == whole || ftruncate(journal->file, (off_t)*size) == 0;
}

bench_journal *bench_journal_open(const char *folder)
{
    bench_journal *journal = memory_alloc(sizeof(bench_journal));
    journal->path = memory_alloc(strlen(folder) + sizeof("/journal.jsonl"));
    sprintf(journal->path, "%s/journal.jsonl", folder);
    journal->file = open(journal->path, O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    char *text = NULL;
    size_t size;
    if (journal->file < 0) {
        log_error("cannot write \"%s\": %s", journal->path, strerror(errno));
        goto fail;
    }
    if (flock(journal->file, LOCK_EX | LOCK_NB) != 0) {
        log_error("cannot write \"%s\": another run uses this folder", journal->path);
        goto fail;
    }
    text = (char *)file_read(journal->path, &size);
    if (!text) {
        goto fail;
    }
    if (!torn_line_cut(journal, text, &size)) {
        log_error("cannot write \"%s\": %s", journal->path, strerror(errno));
        goto fail;
    }
    lines_read(journal, text, size);
    free(text);
    return journal;

fail:
    free(text);
    bench_journal_close(journal);
    return NULL;
}

void bench_journal_close(bench_journal *journal)
{
    if (!journal) {
        return;
    }
    for (size_t i = 0; i < journal->count; i++) {
        cJSON_Delete(journal->entries[i].json);
    }
    if (journal->file >= 0) {
        close(journal->file);
    }
    free(journal->entries);
    free(journal->path);
    free(journal);
}

static bool line_append(const bench_journal *journal, const char *line, size_t size)
{
    for (size_t done = 0; done < size;) {
        const ssize_t count = write(journal->file, line + done, size - done);
        if (count < 0 && errno != EINTR) {
            return false;
        }
        done += count > 0 ? (size_t)count : 0;
    }
    return fsync(journal->file) == 0;
}

bool bench_journal_add(bench_journal *journal, const char *kind, const char *key, cJSON *line)
{
    cJSON_AddStringToObject(line, "kind", kind);
    cJSON_AddStringToObject(line, "key", key);
    char *const text = cJSON_PrintUnformatted(line);
    const size_t length = strlen(text);
    text[length] = '\n'; // in place of the final zero: the length says where it ends
    const bool ok = line_append(journal, text, length + 1);
    if (!ok) {
        log_error("cannot write \"%s\": %s", journal->path, strerror(errno));
    }
    cJSON_free(text);
    return entry_add(journal, line) && ok;
}

const cJSON *bench_journal_next(const bench_journal *journal, const char *kind, const char *key, size_t *place)
{
    while (*place < journal->count) {
        const entry *const entry = &journal->entries[journal->count - ++*place];
        if (strcmp(entry->kind, kind) == 0 && (!key || strcmp(entry->key, key) == 0)) {
            return entry->json;
        }
    }
    return NULL;
}
