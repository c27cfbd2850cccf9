// A glTF file before its meaning: container, buffers, and what tinygltf gets to see. tinygltf trusts offsets and sizes,
// so all reading of bytes is done here.
#include "gltf.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

bool gltf_fail(const gltf_file *file, const char *format, ...)
{
    char message[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof(message), format, arguments);
    va_end(arguments);
    log_error("\"%s\": %s", file->path, message);
    return false;
}

// ---- URIs

static int base64_digit(char c)
{
    if (c >= 'A' && c <= 'Z') {
        return c - 'A';
    }
    if (c >= 'a' && c <= 'z') {
        return c - 'a' + 26;
    }
    if (c >= '0' && c <= '9') {
        return c - '0' + 52;
    }
    return c == '+' || c == '-' ? 62 : c == '/' || c == '_' ? 63 : -1;
}

// NULL when a character is not base64. `=` only as the end.
static uint8_t *base64_decode(const char *text, uint64_t *size)
{
    size_t length = strlen(text);
    while (length > 0 && text[length - 1] == '=') {
        length--;
    }
    uint8_t *const bytes = memory_alloc(length / 4 * 3 + 3);
    uint32_t bits = 0, bit_count = 0;
    size_t count = 0;
    for (size_t i = 0; i < length; i++) {
        const int digit = base64_digit(text[i]);
        if (digit < 0) {
            free(bytes);
            return NULL;
        }
        bits = bits << 6 | (uint32_t)digit;
        bit_count += 6;
        if (bit_count >= 8) {
            bit_count -= 8;
            bytes[count++] = (uint8_t)(bits >> bit_count);
        }
    }
    *size = count;
    return bytes;
}

// In place; the length of the result. A percent sign without two digits stays as it is.
static size_t percent_decode(char *text)
{
    char *out = text;
    for (const char *in = text; *in; in++) {
        const char digits[3] = {in[0] == '%' ? in[1] : 0, in[0] == '%' && in[1] ? in[2] : 0, 0};
        if (strlen(digits) == 2 && strspn(digits, "0123456789abcdefABCDEF") == 2) {
            *out++ = (char)strtoul(digits, NULL, 16);
            in += 2;
        } else {
            *out++ = *in;
        }
    }
    *out = 0;
    return (size_t)(out - text);
}

static uint8_t *data_uri_read(const gltf_file *file, const char *label, const char *uri, uint64_t *size)
{
    const char *const comma = strchr(uri, ',');
    if (!comma) {
        gltf_fail(file, "%s: expected a data URI of the form data:TYPE;base64,...", label);
        return NULL;
    }
    static const char encoding[] = ";base64";
    const size_t encoding_length = sizeof(encoding) - 1;
    if ((size_t)(comma - uri) < encoding_length || strncmp(comma - encoding_length, encoding, encoding_length) != 0) {
        char *const text = memory_alloc(strlen(comma));
        memcpy(text, comma + 1, strlen(comma));
        *size = percent_decode(text);
        return (uint8_t *)text;
    }
    uint8_t *const bytes = base64_decode(comma + 1, size);
    if (!bytes) {
        gltf_fail(file, "%s: its data URI is not valid base64", label);
    }
    return bytes;
}

static bool is_file(const char *path)
{
    struct stat status;
    return stat(path, &status) == 0 && S_ISREG(status.st_mode);
}

static uint8_t *external_read(const gltf_file *file, const char *label, const char *uri, uint64_t *size)
{
    if (strstr(uri, "://")) {
        gltf_fail(file, "%s: expected a file name or a data URI; nothing is fetched", label);
        return NULL;
    }
    const char *const slash = strrchr(file->path, '/');
    const int folder_length = slash ? (int)(slash + 1 - file->path) : 0;
    const size_t path_size = (size_t)folder_length + strlen(uri) + 1;
    char *const path = memory_alloc(path_size);
    uint8_t *bytes = NULL;
    snprintf(path, path_size, "%.*s%s", folder_length, file->path, uri);
    // A name that holds a percent sign as it stands is not valid, but common.
    if (!is_file(path)) {
        percent_decode(path + folder_length);
    }
    struct stat status;
    if (stat(path, &status) != 0) {
        gltf_fail(file, "%s: cannot read \"%s\": %s", label, path, strerror(errno));
    } else if (!S_ISREG(status.st_mode)) {
        gltf_fail(file, "%s: cannot read \"%s\": it is not a regular file", label, path);
    } else {
        size_t file_size = 0;
        bytes = file_read(path, &file_size);
        *size = file_size;
    }
    free(path);
    return bytes;
}

uint8_t *gltf_uri_read(const gltf_file *file, const char *label, const char *uri, uint64_t *size)
{
    *size = 0;
    return strncmp(uri, "data:", 5) == 0 ? data_uri_read(file, label, uri, size)
                                         : external_read(file, label, uri, size);
}

// ---- Container

enum { GLB_HEADER_SIZE = 12, GLB_CHUNK_HEADER_SIZE = 8, GLB_JSON = 0x4E4F534A, GLB_BIN = 0x004E4942 };

static uint32_t read_u32(const uint8_t *bytes) // little endian
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

// Takes the chunk at *offset and steps over it.
static bool glb_chunk_next(const gltf_file *file, uint64_t length, uint64_t *offset, uint32_t *type, gltf_bytes *chunk)
{
    if (length - *offset < GLB_CHUNK_HEADER_SIZE) {
        return gltf_fail(file, "truncated: a chunk header at byte %llu ends past the %llu bytes of the file",
                         (unsigned long long)*offset, (unsigned long long)length);
    }
    const uint8_t *const header = file->bytes + *offset;
    const uint32_t size = read_u32(header);
    *type = read_u32(header + 4);
    *offset += GLB_CHUNK_HEADER_SIZE;
    if (size > length - *offset) {
        return gltf_fail(file, "truncated: the chunk at byte %llu claims %u bytes, %llu are left",
                         (unsigned long long)*offset, size, (unsigned long long)(length - *offset));
    }
    *chunk = (gltf_bytes){file->bytes + *offset, size};
    // Chunks are padded to four bytes; a writer that forgot the padding of the last one is forgiven.
    *offset += align_up(size, 4) <= length - *offset ? align_up(size, 4) : size;
    return true;
}

static bool glb_split(const gltf_file *file, uint64_t size, gltf_bytes *json, gltf_bytes *binary)
{
    if (size < GLB_HEADER_SIZE) {
        return gltf_fail(file, "truncated: %llu bytes, a .glb header has 12", (unsigned long long)size);
    }
    const uint32_t version = read_u32(file->bytes + 4), length = read_u32(file->bytes + 8);
    if (version != 2) {
        return gltf_fail(file, "GLB version %u, expected 2", version);
    }
    if (length > size || length < GLB_HEADER_SIZE) {
        return gltf_fail(file, "truncated: the header claims %u bytes, the file has %llu", length,
                         (unsigned long long)size);
    }
    uint64_t offset = GLB_HEADER_SIZE;
    uint32_t type = 0;
    if (!glb_chunk_next(file, length, &offset, &type, json)) {
        return false;
    }
    if (type != GLB_JSON) {
        return gltf_fail(file, "the first chunk has type 0x%08x, expected JSON", type);
    }
    if (offset < length) {
        gltf_bytes second;
        if (!glb_chunk_next(file, length, &offset, &type, &second)) {
            return false;
        }
        if (type == GLB_BIN) { // chunks of other types are to be ignored
            *binary = second;
        }
    }
    return true;
}

static bool has_suffix(const char *text, const char *suffix)
{
    const size_t length = strlen(text), suffix_length = strlen(suffix);
    return length >= suffix_length && strcmp(text + length - suffix_length, suffix) == 0;
}

static bool container_split(const gltf_file *file, uint64_t size, gltf_bytes *json, gltf_bytes *binary)
{
    if (size == 0) {
        return gltf_fail(file, "the file is empty");
    }
    if (size >= 4 && memcmp(file->bytes, "glTF", 4) == 0) {
        return glb_split(file, size, json, binary);
    }
    if (has_suffix(file->path, ".glb")) {
        return gltf_fail(file, "wrong magic: a .glb file starts with \"glTF\"");
    }
    *json = (gltf_bytes){file->bytes, size};
    return true;
}

// ---- Buffers and images

static const char *optional_string(const cJSON *object, const char *key)
{
    return cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, key));
}

// A URI is the best name for a file; data URIs are none.
static const char *label_make(gltf_file *file, const char *kind, uint32_t index, const char *name, const char *uri)
{
    if (uri && strncmp(uri, "data:", 5) != 0) {
        return arena_printf(&file->arena, "%s \"%.200s\"", kind, uri);
    }
    return name ? arena_printf(&file->arena, "%s %u \"%.200s\"", kind, index, name)
                : arena_printf(&file->arena, "%s %u", kind, index);
}

static bool buffer_load(gltf_file *file, uint32_t index, const cJSON *json, gltf_bytes binary)
{
    gltf_buffer *const buffer = &file->buffers[index];
    const char *const uri = optional_string(json, "uri");
    const uint64_t length = (uint64_t)cJSON_GetObjectItemCaseSensitive(json, "byteLength")->valuedouble;
    buffer->name = label_make(file, "buffer", index, optional_string(json, "name"), uri);
    if (uri) {
        buffer->owned = gltf_uri_read(file, buffer->name, uri, &buffer->bytes.size);
        buffer->bytes.data = buffer->owned;
        if (!buffer->owned) {
            return false;
        }
    } else if (index == 0 && binary.data) {
        buffer->bytes = binary;
    } else {
        return true;
    }
    if (buffer->bytes.size < length) {
        return gltf_fail(file, "%s has %llu bytes, expected byteLength %llu", buffer->name,
                         (unsigned long long)buffer->bytes.size, (unsigned long long)length);
    }
    buffer->bytes.size = length;
    return true;
}

static bool buffers_load(gltf_file *file, const cJSON *buffers, gltf_bytes binary)
{
    file->buffers = arena_alloc(&file->arena, sizeof(*file->buffers) * (size_t)cJSON_GetArraySize(buffers));
    for (const cJSON *json = buffers ? buffers->child : NULL; json; json = json->next) {
        file->buffer_count++;
        if (!buffer_load(file, file->buffer_count - 1, json, binary)) {
            return false;
        }
    }
    return true;
}

// Only notes where images are: which of them are needed is known later.
static void images_note(gltf_file *file, const cJSON *images)
{
    file->images = arena_alloc(&file->arena, sizeof(*file->images) * (size_t)cJSON_GetArraySize(images));
    for (const cJSON *json = images ? images->child : NULL; json; json = json->next) {
        gltf_image_source *const image = &file->images[file->image_count];
        const char *const uri = optional_string(json, "uri"), *const name = optional_string(json, "name");
        const cJSON *const view = cJSON_GetObjectItemCaseSensitive(json, "bufferView");
        image->label = label_make(file, "image", file->image_count, name, uri);
        image->name = arena_strdup(&file->arena, name ? name : uri && strncmp(uri, "data:", 5) ? uri : "");
        image->uri = uri ? arena_strdup(&file->arena, uri) : NULL;
        image->view = view && !uri ? (uint32_t)view->valuedouble : SCENE_NONE;
        file->image_count++;
    }
}

// Also of a name that is there several times: tinygltf would take the last and open files on its own.
static void member_delete(cJSON *object, const char *name)
{
    while (cJSON_GetObjectItemCaseSensitive(object, name)) {
        cJSON_DeleteItemFromObjectCaseSensitive(object, name);
    }
}

// tinygltf refuses index accessors without a buffer view, which are legal, and says too little of those that do not
// exist. As one more attribute it lets them through.
static void indices_hide(cJSON *root)
{
    const cJSON *const meshes = cJSON_GetObjectItemCaseSensitive(root, "meshes");
    for (const cJSON *mesh = meshes ? meshes->child : NULL; mesh; mesh = mesh->next) {
        const cJSON *const primitives = cJSON_GetObjectItemCaseSensitive(mesh, "primitives");
        for (cJSON *primitive = primitives ? primitives->child : NULL; primitive; primitive = primitive->next) {
            cJSON *const attributes = cJSON_GetObjectItemCaseSensitive(primitive, "attributes");
            cJSON *const indices = cJSON_DetachItemFromObjectCaseSensitive(primitive, "indices");
            member_delete(primitive, "indices");
            member_delete(attributes, GLTF_INDICES);
            if (!cJSON_IsObject(attributes) || !indices || !cJSON_AddItemToObject(attributes, GLTF_INDICES, indices)) {
                cJSON_Delete(indices);
            }
        }
    }
}

// tinygltf drops channels whose target has no node, which are those of KHR_animation_pointer: they get one that is
// none.
static void channels_complete(cJSON *root)
{
    const cJSON *const animations = cJSON_GetObjectItemCaseSensitive(root, "animations");
    for (const cJSON *animation = animations ? animations->child : NULL; animation; animation = animation->next) {
        const cJSON *const channels = cJSON_GetObjectItemCaseSensitive(animation, "channels");
        for (const cJSON *channel = channels->child; channel; channel = channel->next) {
            cJSON *const target = cJSON_GetObjectItemCaseSensitive(channel, "target");
            if (!cJSON_GetObjectItemCaseSensitive(target, "node")) {
                cJSON_AddNumberToObject(target, "node", -1);
            }
        }
    }
}

bool gltf_file_open(gltf_file *file, const char *path)
{
    *file = (gltf_file){.path = path};
    size_t size = 0;
    file->bytes = file_read(path, &size);
    gltf_bytes json = {0}, binary = {0};
    if (!file->bytes || !container_split(file, size, &json, &binary)) {
        return false;
    }
    cJSON *const root = gltf_json_parse(file, json);
    if (!root) {
        return false;
    }
    bool ok = buffers_load(file, cJSON_GetObjectItemCaseSensitive(root, "buffers"), binary);
    if (ok) {
        images_note(file, cJSON_GetObjectItemCaseSensitive(root, "images"));
        indices_hide(root);
        channels_complete(root);
        member_delete(root, "buffers");
        member_delete(root, "images");
        file->json = cJSON_PrintUnformatted(root);
        ok = file->json != NULL || gltf_fail(file, "out of memory");
    }
    cJSON_Delete(root);
    return ok;
}

void gltf_file_close(gltf_file *file)
{
    for (uint32_t i = 0; i < file->buffer_count; i++) {
        free(file->buffers[i].owned);
    }
    free(file->bytes);
    free(file->json);
    arena_fini(&file->arena);
}
