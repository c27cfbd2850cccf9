// JSON with lines: cJSON reads the text, and a scanner walks the text beside the tree that came of it.
#include "json_file.h"

#include <cjson/cJSON.h>
#include <stdlib.h>
#include <string.h>

// ---- The scanner. The text is known to be JSON as cJSON takes it, so it only looks for the ends of things.

typedef struct scanner {
    const char *at;
    uint32_t line;
} scanner;

static void step(scanner *s)
{
    s->line += *s->at == '\n';
    s->at++;
}

static void blanks_skip(scanner *s)
{
    while (*s->at && (unsigned char)*s->at <= ' ') { // as cJSON does
        step(s);
    }
}

static void string_skip(scanner *s)
{
    step(s);
    while (*s->at && *s->at != '"') {
        if (*s->at == '\\') {
            step(s);
        }
        step(s);
    }
    step(s);
}

static void place_note(json_file *file, const cJSON *item, uint32_t line)
{
    memory_reserve((void **)&file->places, &file->place_capacity, file->place_count + 1, sizeof(json_place));
    file->places[file->place_count++] = (json_place){item, line};
}

static void value_scan(json_file *file, scanner *s, const cJSON *item, bool is_member)
{
    blanks_skip(s);
    place_note(file, item, s->line);
    if (is_member) {
        string_skip(s);
        blanks_skip(s);
        step(s); // ':'
        blanks_skip(s);
    }
    if (cJSON_IsObject(item) || cJSON_IsArray(item)) {
        step(s); // the bracket
        for (const cJSON *child = item->child; child; child = child->next) {
            value_scan(file, s, child, cJSON_IsObject(item));
            blanks_skip(s);
            if (child->next) {
                step(s); // ','
            }
        }
        blanks_skip(s);
        step(s);
    } else if (cJSON_IsString(item)) {
        string_skip(s);
    } else {
        while (*s->at && !strchr(",]}", *s->at) && (unsigned char)*s->at > ' ') {
            step(s);
        }
    }
}

// ---- The file

uint64_t json_hash_add(uint64_t hash, const void *bytes, size_t size)
{
    const uint8_t *const byte = bytes;
    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ byte[i]) * 1099511628211u;
    }
    return hash;
}

static int place_compare(const void *left, const void *right)
{
    const uintptr_t a = (uintptr_t)((const json_place *)left)->item, b = (uintptr_t)((const json_place *)right)->item;
    return (a > b) - (a < b);
}

static uint32_t lines_before(const char *text, const char *end)
{
    uint32_t lines = 0;
    for (; text < end; text++) {
        lines += *text == '\n';
    }
    return lines;
}

bool json_file_read(json_file *file, const char *path)
{
    size_t size;
    *file = (json_file){.path = path};
    char *const text = (char *)file_read(path, &size);
    if (!text) {
        return false;
    }
    file->hash = json_hash_add(JSON_HASH_START, text, size);
    const char *end = text;
    // What is behind the value must be blank: a zero byte within the text ends it for cJSON and must end it here.
    if (strlen(text) == size) {
        file->root = cJSON_ParseWithOpts(text, &end, true);
    }
    if (file->root) {
        const bool has_mark = strncmp(text, "\xEF\xBB\xBF", 3) == 0; // byte order mark
        value_scan(file, &(scanner){.at = text + (has_mark ? 3 : 0), .line = 1}, file->root, false);
        qsort(file->places, file->place_count, sizeof(json_place), place_compare);
    } else {
        log_error("%s:%u: expected JSON, got \"%.*s\"", path, 1 + lines_before(text, end), (int)strcspn(end, "\n"),
                  strlen(end) > 40 ? "something else" : end);
    }
    free(text);
    return file->root != NULL;
}

void json_file_fini(json_file *file)
{
    cJSON_Delete(file->root);
    free(file->places);
    *file = (json_file){0};
}

uint32_t json_file_line(const json_file *file, const cJSON *item)
{
    const json_place wanted = {.item = item};
    const json_place *const found =
        bsearch(&wanted, file->places, file->place_count, sizeof(json_place), place_compare);
    assert(found && "an item of this file");
    return found->line;
}
