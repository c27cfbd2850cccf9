// Shared by the C++ files of the glTF import: the state of one import and its checks. Failures are thrown as
// std::runtime_error with the message to log, and caught in gltf_import.
#pragma once

extern "C" {
#include "modules/gltf.h"
}

#include <array>
#include <stdexcept>
#include <string>
#include <tiny_gltf.h>
#include <vector>

namespace gltf
{

[[noreturn]] void fail(const char *format, ...) __attribute__((format(printf, 1, 2)));

// Checks an index into a table of `count` and returns it; `what` and `where` as in "node 3: mesh 7 does not exist".
uint32_t index_check(int index, size_t count, const std::string &where, const char *what);

// `node 3 "lamp"`, or `node 3` when it has no name.
std::string label(const char *kind, size_t index, const std::string &name);

// A member of an extension's object, `fallback` when it is missing or not a number.
double number_of(const tinygltf::Value &object, const char *key, double fallback);

struct importer {
    const gltf_file &file;
    tinygltf::Model model;
    scene_data *scene;

    // Used images, and textures by (glTF texture, srgb): what no material refers to is not loaded.
    std::vector<uint32_t> image_of; // by glTF image, SCENE_NONE: unused
    std::vector<uint32_t> used_images; // glTF images, in order of first use
    std::vector<uint32_t> texture_of[2]; // by glTF texture; [1] as sRGB
    std::vector<scene_texture> textures;
    bool uv_set_warned = false;
    uint32_t textures_without_image = 0;

    // Primitives
    std::vector<gltf_primitive> primitives; // freed by the destructor unless taken
    std::vector<uint32_t> local_of; // scratch: accessor's vertex to primitive's vertex
    uint32_t skipped_modes = 0, skipped_without_positions = 0, cut_lists = 0;

    importer(const gltf_file &file, scene_data *scene) : file(file), scene(scene) {}
    ~importer();
    importer(const importer &) = delete;
    importer &operator=(const importer &) = delete;

    template <typename T> T *allocate(size_t count)
    {
        return static_cast<T *>(arena_alloc(&scene->arena, count * sizeof(T)));
    }
    const char *keep(const std::string &text) { return arena_strdup(&scene->arena, text.c_str()); }
};

// gltf_material.cpp
void materials_read(importer &in);
void images_load(importer &in);

// gltf_mesh.cpp
void views_check(importer &in);
void accessors_check(importer &in);
gltf_bytes view_bytes(const importer &in, uint32_t view);
void meshes_read(importer &in);
// All positions that the primitive's accessor has, used or not.
std::vector<std::array<float, 3>> positions_all(const importer &in, const tinygltf::Primitive &primitive,
                                                const std::string &where);

// gltf_subdivision.cpp
// What the mesh's extras say; NULL when they say nothing, or something wrong, which is a warning.
const scene_subdivision_rules *subdivision_rules_read(importer &in, size_t mesh);

} // namespace gltf
