// For the scene tests: glTF files written into a temporary folder, loaded, with the log kept to be looked at.
#pragma once

#include "modules/scene.h"
#include "test.h"

#include <unistd.h>

// What has been logged since the last log_clear.
static struct {
    uint32_t errors, warnings;
    char error[1024], warning[1024]; // the last of each
} test_log;

static inline void test_log_sink(log_level level, const char *line, void *user)
{
    (void)user;
    if (level == LOG_ERROR) {
        test_log.errors++;
        snprintf(test_log.error, sizeof(test_log.error), "%s", line);
    } else if (level == LOG_WARNING) {
        test_log.warnings++;
        snprintf(test_log.warning, sizeof(test_log.warning), "%s", line);
    }
}

static inline void log_clear(void)
{
    memset(&test_log, 0, sizeof(test_log));
}

static char test_folder[] = "/tmp/lanternfield_scene_XXXXXX";

static inline void scene_test_begin(void)
{
    log_sink_set(test_log_sink, NULL);
    if (!mkdtemp(test_folder)) {
        perror(test_folder);
        exit(EXIT_FAILURE);
    }
}

static inline int scene_test_end(void)
{
    char command[128];
    snprintf(command, sizeof(command), "rm -r '%s'", test_folder);
    CHECK(system(command) == 0);
    return test_end();
}

// Lives until the next call but three.
static inline const char *test_path(const char *name)
{
    static char paths[4][256];
    static uint32_t next;
    char *const path = paths[next++ % countof(paths)];
    snprintf(path, sizeof(paths[0]), "%s/%s", test_folder, name);
    return path;
}

static inline void test_file(const char *name, const void *bytes, size_t size)
{
    CHECK(file_write(test_path(name), bytes, size));
}

static inline void base64_encode(const uint8_t *bytes, size_t size, char *out)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3) {
        const uint32_t bits = (uint32_t)bytes[i] << 16 | (i + 1 < size ? (uint32_t)bytes[i + 1] << 8 : 0) |
                              (i + 2 < size ? bytes[i + 2] : 0);
        for (int k = 0; k < 4; k++) {
            *out++ = i + (size_t)k <= size ? digits[bits >> (18 - 6 * k) & 63] : '=';
        }
    }
    *out = 0;
}

// Writes {asset, buffers: [bytes], members} and loads it. Members are JSON with ' for ", so that tests can be read.
static inline scene_data *load_members(const char *name, const void *bytes, size_t size, const char *members)
{
    static char base64[65536], json[131072];
    base64_encode(bytes, size, base64);
    int length =
        snprintf(json, sizeof(json),
                 "{'asset':{'version':'2.0'},'buffers':[{'byteLength':%zu,'uri':'data:application/octet-stream;"
                 "base64,%s'}],%s}",
                 size, base64, members);
    for (char *c = json; *c; c++) {
        *c = *c == '\'' ? '"' : *c;
    }
    test_file(name, json, (size_t)length);
    log_clear();
    return scene_load(test_path(name));
}

// The last load must have failed with one line that holds the file's name and `thing`.
static inline void check_refused(const char *file, int line, scene_data *scene, const char *name, const char *thing)
{
    const bool ok = !scene && test_log.errors == 1 && strstr(test_log.error, name) && strstr(test_log.error, thing);
    if (!ok) {
        test_failures++;
        printf("%s:%d: failed: expected one error with %s and \"%s\", got %u: %s\n", file, line, name, thing,
               test_log.errors, scene ? "(it loaded)" : test_log.error);
    }
    scene_destroy(scene);
}

// A right triangle in the plane z = 0 and its indices.
typedef struct triangle_bytes {
    float positions[3][3];
    uint16_t indices[3], padding;
} triangle_bytes;
static const triangle_bytes triangle = {{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}}, {0, 1, 2}, 0};

#define TRIANGLE_VIEWS "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':6}]"
#define TRIANGLE_ACCESSORS                                                                                             \
    "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"                                      \
    "{'bufferView':1,'componentType':5123,'count':3,'type':'SCALAR'}]"
#define TRIANGLE_MESH "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1}]}]"
#define TRIANGLE_NODE "'nodes':[{'mesh':0}]"
#define TRIANGLE TRIANGLE_VIEWS "," TRIANGLE_ACCESSORS "," TRIANGLE_MESH

static inline scene_data *load_triangle(const char *members)
{
    return load_members("triangle.gltf", &triangle, sizeof(triangle), members);
}

// The driver's builder: the sum over all inner nodes of surface area, relative to the root's, when the list of
// triangles is halved as given. Triangles are three corners each.
typedef struct test_box {
    float min[3], max[3];
} test_box;

static inline double test_box_area(const test_box *b)
{
    const double x = b->max[0] - b->min[0], y = b->max[1] - b->min[1], z = b->max[2] - b->min[2];
    return x * y + y * z + z * x;
}

static inline test_box test_box_of(const float (*corners)[3], uint32_t count)
{
    test_box b = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (uint32_t i = 0; i < count; i++) {
        for (int axis = 0; axis < 3; axis++) {
            b.min[axis] = fminf(b.min[axis], corners[i][axis]);
            b.max[axis] = fmaxf(b.max[axis], corners[i][axis]);
        }
    }
    return b;
}

static inline test_box halving_area(const float (*corners)[3], uint32_t triangles, double *area)
{
    if (triangles == 1) {
        return test_box_of(corners, 3);
    }
    const uint32_t half = triangles / 2;
    const test_box first = halving_area(corners, half, area),
                   second = halving_area(corners + 3 * half, triangles - half, area);
    const float both[4][3] = {{first.min[0], first.min[1], first.min[2]},
                              {first.max[0], first.max[1], first.max[2]},
                              {second.min[0], second.min[1], second.min[2]},
                              {second.max[0], second.max[1], second.max[2]}};
    const test_box b = test_box_of(both, 4);
    *area += test_box_area(&b);
    return b;
}

static inline double halving_cost(const float (*corners)[3], uint32_t triangles)
{
    double area = 0;
    const test_box root = halving_area(corners, triangles, &area);
    return area / test_box_area(&root);
}
