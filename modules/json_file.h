// A JSON file with the line of every value, which cJSON does not keep, so that what is wrong can be named by its line.
#pragma once

#include "engine/base.h"

struct cJSON;

typedef struct json_place { // private
    const struct cJSON *item;
    uint32_t line;
} json_place;
typedef struct json_file {
    const char *path; // as given
    struct cJSON *root;
    uint64_t hash; // of its bytes
    json_place *places; // by address
    size_t place_count, place_capacity;
} json_file;

// False when the file cannot be read or is no JSON (logged with the line). `path` must outlive it.
bool json_file_read(json_file *file, const char *path);
void json_file_fini(json_file *file); // accepts what failed to be read
// From 1; of a member the line of its key.
uint32_t json_file_line(const json_file *file, const struct cJSON *item);

// FNV-1a, 64 bits (Fowler, Noll and Vo), of more bytes; begin with JSON_HASH_START.
#define JSON_HASH_START 14695981039346656037u
uint64_t json_hash_add(uint64_t hash, const void *bytes, size_t size);
