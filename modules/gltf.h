// The glTF import's inner interface, for scene.c and gltf_*: a file goes through gltf_file.c (container, buffers),
// gltf_json.c (checks), gltf.cpp, gltf_accessor.cpp, gltf_material.cpp, gltf_mesh.cpp, gltf_skin.cpp,
// gltf_animation.cpp and gltf_subdivision.cpp (tinygltf's structures to ours) and gltf_image.c (decoding); scene.c
// finishes what comes out, with scene_subdivision.c and triangle_order.c. Others include scene.h.
#pragma once

#include "scene.h"

// ---- gltf_file.c

typedef struct gltf_bytes {
    const uint8_t *data;
    uint64_t size;
} gltf_bytes;

typedef struct gltf_buffer {
    const char *name; // for messages: `buffer "x.bin"` or `buffer 0`
    uint8_t *owned; // NULL: part of the file itself
    gltf_bytes bytes; // exactly byteLength; data is NULL for a placeholder, which extensions may fill
} gltf_buffer;

typedef struct gltf_image_source {
    const char *label; // for messages: `image "x.png"` or `image 0 "name"`
    const char *name;
    const char *uri; // NULL: in a buffer view
    uint32_t view; // SCENE_NONE: none
} gltf_image_source;

#define GLTF_INDICES "(indices)"
typedef struct gltf_file {
    const char *path;
    uint8_t *bytes; // the whole file
    char *json; // what is left for tinygltf to parse: all but the buffers and images
    gltf_buffer *buffers;
    uint32_t buffer_count;
    gltf_image_source *images;
    uint32_t image_count;
    arena arena;
} gltf_file;

// Reads the container, its JSON and all buffers. False on failure, which is logged. gltf_file_close either way.
bool gltf_file_open(gltf_file *file, const char *path);
void gltf_file_close(gltf_file *file);

// Logs `"path": message` as an error; returns false, so that failing reads `return gltf_fail(...)`.
bool gltf_fail(const gltf_file *file, const char *format, ...) __attribute__((format(printf, 2, 3)));

// The bytes behind a URI (relative file name or base64 data URI), to free(). NULL on failure, logged naming `label`.
uint8_t *gltf_uri_read(const gltf_file *file, const char *label, const char *uri, uint64_t *size);

// ---- gltf_json.c

// Parses and checks the JSON: each number that counts or points is an integer in range, and what must be there is.
// NULL on failure, which is logged.
struct cJSON *gltf_json_parse(const gltf_file *file, gltf_bytes json);

// ---- gltf_image.c

// Decodes PNG and JPEG to RGBA8, images[i] from sources[i], on all cores; encoded[i] is used where the source has no
// URI. False on failure, which is logged; images already decoded stay with the caller.
bool gltf_images_decode(const gltf_file *file, const gltf_image_source *const *sources, const gltf_bytes *encoded,
                        uint32_t count, scene_image *images);

// ---- gltf.cpp

typedef struct gltf_primitive { // a triangle list as it came, vertices only those that are used; free()d by scene.c
    uint32_t vertex_count, index_count;
    float (*positions)[3];
    vertex_attributes *attributes;
    uint32_t *indices; // in range; a multiple of three
    uint32_t *tags; // a number that stays with its vertex, for scene_subdivision.c; NULL: none
    bool has_normals, has_tangents;
    scene_influences *influences; // [vertex_count]; NULL: no skin moves it
    uint32_t target_count;
    scene_morph *morphs; // [target_count][vertex_count]; NULL: none
} gltf_primitive;

// Fills `scene` (zeroed but for path and arena) but for vertices, indices, bounds, world matrices and what deformations
// know of vertices; `primitives` gets scene->primitive_count entries, to free(). False on failure, logged; the rest is
// then freed.
bool gltf_import(const char *path, scene_data *scene, gltf_primitive **primitives);
void gltf_primitive_free(gltf_primitive *primitive);

// ---- triangle_order.c

// Orders the triangles of a mesh for a BVH builder that halves the list of all of them: each primitive's indices in
// place, and in sequence[count] the order in which the primitives have to follow each other.
void mesh_triangles_reorder(gltf_primitive *primitives, uint32_t count, uint32_t *sequence);

// ---- scene_subdivision.c

// Adds a mesh for each level of the meshes that have rules; `primitives`, one for each of the scene's, grows with them.
void scene_subdivide(scene_data *scene, gltf_primitive **primitives);
// When the scene's vertices have their final places and deformations: stencils follow, and levels deform with their
// cages.
void scene_subdivisions_finish(scene_data *scene, const gltf_primitive *primitives);

// ---- scene.c

// Logs a warning and keeps it with the scene.
void scene_warning(scene_data *scene, const char *format, ...) __attribute__((format(printf, 2, 3)));
