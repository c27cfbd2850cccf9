// A glTF file's JSON, checked: tinygltf wraps, truncates or ignores numbers that do not fit, so every number that
// counts or points is checked here, and that what it requires is there, so that messages can name the thing.
#include "gltf.h"

#include <cjson/cJSON.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>

// ---- Parsing

static uint32_t line_of(const char *text, const char *position)
{
    uint32_t line = 1;
    for (const char *c = text; c < position; c++) {
        line += *c == '\n';
    }
    return line;
}

static cJSON *object_parse(const gltf_file *file, gltf_bytes json)
{
    const char *const text = (const char *)json.data;
    const char *end = text;
    cJSON *const root = cJSON_ParseWithLengthOpts(text, json.size, &end, false);
    if (!root) {
        gltf_fail(file, "not valid JSON near line %u, byte %td (or nested deeper than %d)", line_of(text, end),
                  end - text, CJSON_NESTING_LIMIT);
    } else if (!cJSON_IsObject(root)) {
        gltf_fail(file, "expected a JSON object");
        cJSON_Delete(root);
        return NULL;
    }
    return root;
}

// ---- Numbers

// Where a value stands, as "accessors[3].sparse.count"; cut when too long.
typedef struct json_place {
    char text[192];
} json_place;

static json_place place_of(const json_place *parent, const cJSON *item, int index)
{
    json_place place;
    if (item->string) {
        const char *const dot = parent->text[0] ? "." : "";
        snprintf(place.text, sizeof(place.text), "%.128s%s%.48s", parent->text, dot, item->string);
    } else {
        snprintf(place.text, sizeof(place.text), "%.160s[%d]", parent->text, index);
    }
    return place;
}

// 2^40: cJSON writes no more than 15 digits. tinygltf reads sparse offsets and all indices as int.
static const double SIZE_LIMIT = 1099511627776.0;

typedef struct integer_key {
    const char *name;
    double limit;
} integer_key;

static const integer_key integer_keys[] = {
    {"buffer", INT_MAX},        {"bufferView", INT_MAX}, {"componentType", INT_MAX}, {"material", INT_MAX},
    {"indices", INT_MAX},       {"mesh", INT_MAX},       {"camera", INT_MAX},        {"skin", INT_MAX},
    {"node", INT_MAX},          {"nodes", INT_MAX},      {"children", INT_MAX},      {"joints", INT_MAX},
    {"skeleton", INT_MAX},      {"input", INT_MAX},      {"output", INT_MAX},        {"sampler", INT_MAX},
    {"source", INT_MAX},        {"index", INT_MAX},      {"texCoord", INT_MAX},      {"inverseBindMatrices", INT_MAX},
    {"scene", INT_MAX},         {"mode", INT_MAX},       {"count", SIZE_LIMIT},      {"byteOffset", SIZE_LIMIT},
    {"byteLength", SIZE_LIMIT}, {"byteStride", INT_MAX},
};

static double integer_limit(const char *key, bool sparse) // 0: may be any number
{
    for (uint32_t i = 0; key && i < countof(integer_keys); i++) {
        if (strcmp(key, integer_keys[i].name) == 0) {
            return sparse && integer_keys[i].limit > INT_MAX ? INT_MAX : integer_keys[i].limit;
        }
    }
    return 0;
}

static bool is_scalar(const cJSON *item)
{
    return cJSON_IsNumber(item) || cJSON_IsString(item) || cJSON_IsBool(item);
}

static bool scalar_check(const gltf_file *file, const cJSON *item, const json_place *place, double limit)
{
    if (limit > 0 && !cJSON_IsNumber(item)) {
        return gltf_fail(file, "%s: expected a number", place->text);
    }
    const double value = item->valuedouble;
    if (cJSON_IsNumber(item) && !(value - value == 0)) {
        return gltf_fail(file, "%s: the number is too large", place->text);
    }
    // The cast is safe: the value has been found to lie in range before it is made.
    if (limit > 0 && !(value >= 0 && value <= limit && value == (double)(uint64_t)value)) {
        return gltf_fail(file, "%s is %.17g, expected an integer from 0 to %.0f", place->text, value, limit);
    }
    return true;
}

// Recursion is bounded by cJSON's limit on nesting. `key` is the name that counts for an array's elements as well.
static bool numbers_check(const gltf_file *file, const cJSON *parent, const char *key, const json_place *place,
                          bool sparse)
{
    int index = 0;
    for (const cJSON *item = parent->child; item; item = item->next, index++) {
        const char *const name = item->string ? item->string : key;
        if (item->string && (!strcmp(name, "extras") || !strcmp(name, "extensions"))) {
            continue;
        }
        const json_place here = place_of(place, item, index);
        // All values in `attributes` and in the elements of `targets` are accessor indices.
        const bool accessors = key && (!strcmp(key, "attributes") || !strcmp(key, "targets"));
        if (is_scalar(item) && !scalar_check(file, item, &here, accessors ? INT_MAX : integer_limit(name, sparse))) {
            return false;
        }
        if (!numbers_check(file, item, name, &here, sparse || strcmp(name, "sparse") == 0)) {
            return false;
        }
    }
    return true;
}

// ---- Sections

static bool members_check(const gltf_file *file, const cJSON *object, const json_place *place,
                          const char *const *required)
{
    if (!cJSON_IsObject(object)) {
        return gltf_fail(file, "%s: expected an object", place->text);
    }
    for (; *required; required++) {
        if (!cJSON_GetObjectItemCaseSensitive(object, *required)) {
            return gltf_fail(file, "%s has no \"%s\"", place->text, *required);
        }
    }
    return true;
}

static bool is_one_of(const char *text, const char *const *list)
{
    while (*list && strcmp(*list, text) != 0) {
        list++;
    }
    return *list != NULL;
}

// 0 for what is no number.
static int integer_of(const cJSON *object, const char *key)
{
    const cJSON *const item = cJSON_GetObjectItemCaseSensitive(object, key);
    return cJSON_IsNumber(item) ? item->valueint : 0;
}

static const char *string_of(const cJSON *object, const char *key)
{
    const char *const text = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(object, key));
    return text ? text : "";
}

static bool accessor_check(const gltf_file *file, const cJSON *accessor, const json_place *place)
{
    static const char *const types[] = {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4", NULL};
    const char *const type = string_of(accessor, "type");
    const int component_type = integer_of(accessor, "componentType");
    if (!is_one_of(type, types)) {
        return gltf_fail(file, "%s has the type \"%.32s\", expected SCALAR, VEC2, ... or MAT4", place->text, type);
    }
    return (component_type >= 5120 && component_type <= 5126 && component_type != 5124) ||
           gltf_fail(file, "%s has the component type %d, expected 5120 to 5123, 5125 or 5126", place->text,
                     component_type);
}

static bool view_check(const gltf_file *file, const cJSON *view, const json_place *place)
{
    const int stride = integer_of(view, "byteStride");
    return (stride <= 252 && stride % 4 == 0) ||
           gltf_fail(file, "%s has the byteStride %d, expected a multiple of 4 up to 252", place->text, stride);
}

static bool camera_check(const gltf_file *file, const cJSON *camera, const json_place *place)
{
    static const char *const perspective[] = {"yfov", "znear", NULL};
    static const char *const orthographic[] = {"xmag", "ymag", "zfar", "znear", NULL};
    static const char *const types[] = {"perspective", "orthographic", NULL};
    const char *const type = string_of(camera, "type");
    if (!is_one_of(type, types)) {
        return gltf_fail(file, "%s has the type \"%.32s\", expected perspective or orthographic", place->text, type);
    }
    const cJSON *const details = cJSON_GetObjectItemCaseSensitive(camera, type);
    json_place here;
    snprintf(here.text, sizeof(here.text), "%.160s.%.16s", place->text, type);
    return members_check(file, details, &here, type[0] == 'p' ? perspective : orthographic);
}

// Each element of the array `name` is an object with what is `required`.
static bool elements_check(const gltf_file *file, const cJSON *parent, const json_place *parent_place, const char *name,
                           const char *const *required)
{
    const cJSON *const array = cJSON_GetObjectItemCaseSensitive(parent, name);
    json_place place = place_of(parent_place, array, 0);
    if (!cJSON_IsArray(array)) {
        return gltf_fail(file, "%s: expected an array", place.text);
    }
    int index = 0;
    for (const cJSON *item = array->child; item; item = item->next, index++) {
        const json_place here = place_of(&place, item, index);
        if (!members_check(file, item, &here, required)) {
            return false;
        }
    }
    return true;
}

static bool animation_check(const gltf_file *file, const cJSON *animation, const json_place *place)
{
    static const char *const channel[] = {"sampler", "target", NULL}, *const sampler[] = {"input", "output", NULL},
                             *const target[] = {"path", NULL};
    if (!elements_check(file, animation, place, "channels", channel) ||
        !elements_check(file, animation, place, "samplers", sampler)) {
        return false;
    }
    const json_place channels = place_of(place, cJSON_GetObjectItemCaseSensitive(animation, "channels"), 0);
    int index = 0;
    for (const cJSON *item = cJSON_GetObjectItemCaseSensitive(animation, "channels")->child; item;
         item = item->next, index++) {
        const json_place here = place_of(&channels, item, index);
        const cJSON *const object = cJSON_GetObjectItemCaseSensitive(item, "target");
        const json_place there = place_of(&here, object, 0);
        if (!members_check(file, object, &there, target)) {
            return false;
        }
    }
    return true;
}

static bool light_check(const gltf_file *file, const cJSON *light, const json_place *place)
{
    return strcmp(string_of(light, "type"), "spot") != 0 ||
           cJSON_IsObject(cJSON_GetObjectItemCaseSensitive(light, "spot")) ||
           gltf_fail(file, "%s is a spot light without \"spot\"", place->text);
}

typedef struct section_rule {
    const char *section;
    const char *required[4];
    bool (*check)(const gltf_file *file, const cJSON *item, const json_place *place); // NULL: none
} section_rule;

static const section_rule section_rules[] = {
    {"accessors", {"componentType", "count", "type"}, accessor_check},
    {"animations", {"channels", "samplers"}, animation_check},
    {"buffers", {"byteLength"}, NULL},
    {"bufferViews", {"buffer", "byteLength"}, view_check},
    {"cameras", {"type"}, camera_check},
    {"images", {0}, NULL},
    {"materials", {0}, NULL},
    {"meshes", {"primitives"}, NULL},
    {"nodes", {0}, NULL},
    {"samplers", {0}, NULL},
    {"scenes", {0}, NULL},
    {"skins", {"joints"}, NULL},
    {"textures", {0}, NULL},
};
static const section_rule lights_rule = {"lights", {"type"}, light_check};

static bool section_check(const gltf_file *file, const cJSON *parent, const section_rule *rule)
{
    const cJSON *const section = cJSON_GetObjectItemCaseSensitive(parent, rule->section);
    if (section && !cJSON_IsArray(section)) {
        return gltf_fail(file, "%s: expected an array", rule->section);
    }
    int index = 0;
    for (const cJSON *item = section ? section->child : NULL; item; item = item->next, index++) {
        json_place place;
        snprintf(place.text, sizeof(place.text), "%s[%d]", rule->section, index);
        if (!members_check(file, item, &place, rule->required) || (rule->check && !rule->check(file, item, &place))) {
            return false;
        }
    }
    return true;
}

static bool version_check(const gltf_file *file, const cJSON *root)
{
    const cJSON *const asset = cJSON_GetObjectItemCaseSensitive(root, "asset");
    const char *const version = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(asset, "version"));
    const char *const minimum = cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(asset, "minVersion"));
    if (!version) {
        return gltf_fail(file, "asset.version: missing, expected 2.0");
    }
    if (strncmp(version, "2.", 2) != 0 || (minimum && strcmp(minimum, "2.0") != 0)) {
        return gltf_fail(file, "glTF version \"%s\"%s%s, expected 2.0", version, minimum ? ", at least " : "",
                         minimum ? minimum : "");
    }
    return true;
}

static bool json_check(const gltf_file *file, const cJSON *root)
{
    if (!version_check(file, root)) {
        return false;
    }
    for (uint32_t i = 0; i < countof(section_rules); i++) {
        if (!section_check(file, root, &section_rules[i])) {
            return false;
        }
    }
    const cJSON *const extensions = cJSON_GetObjectItemCaseSensitive(root, "extensions");
    if (!section_check(file, cJSON_GetObjectItemCaseSensitive(extensions, "KHR_lights_punctual"), &lights_rule)) {
        return false;
    }
    const json_place nowhere = {""};
    return numbers_check(file, root, NULL, &nowhere, false);
}

struct cJSON *gltf_json_parse(const gltf_file *file, gltf_bytes json)
{
    cJSON *const root = object_parse(file, json);
    if (root && !json_check(file, root)) {
        cJSON_Delete(root);
        return NULL;
    }
    return root;
}
