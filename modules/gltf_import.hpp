// Shared by the C++ files of the glTF import: the state of one import and its checks. Failures are thrown as
// std::runtime_error with the message to log, and caught in gltf_import.
#pragma once

extern "C" {
#include "modules/gltf.h"
}

#include <array>
#include <initializer_list>
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

    std::vector<uint32_t> light_of; // by glTF light, SCENE_NONE: left out
    std::vector<uint32_t> node_of; // by glTF node, SCENE_NONE: not in the scene that is loaded
    std::vector<uint32_t> source_of; // by node: glTF's

    // Meshes; by glTF mesh, then copies
    std::vector<scene_mesh> meshes;
    std::vector<uint32_t> skin_of_mesh; // of those that its nodes have, one with the fewest joints; SCENE_NONE: none
    std::vector<mesh_primitive> mesh_primitives;
    std::vector<gltf_primitive> primitives; // the same order; freed by the destructor unless taken
    uint64_t vertices = 0, indices = 0, morphs = 0; // asked for so far
    std::vector<uint32_t> local_of; // scratch: accessor's vertex to primitive's vertex
    uint32_t skipped_modes = 0, skipped_without_positions = 0, cut_lists = 0, cut_joints = 0, weightless_vertices = 0;

    // Animations
    uint64_t animated_numbers = 0;
    uint32_t skipped_channels = 0;
    std::string skipped_channel; // the first, and why

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

// ---- gltf_accessor.cpp

void views_check(importer &in);
void accessors_check(importer &in);
gltf_bytes view_bytes(const importer &in, uint32_t view);

struct accessor_rule {
    const char *name;
    std::initializer_list<int> types;
    bool may_be_integer; // not normalised, as KHR_mesh_quantization allows
};
// Refuses other types, and integers that are not normalised where they have to be. Returns the index, checked.
uint32_t accessor_use(const importer &in, int index, const accessor_rule &rule, const std::string &where);
// Bytes of an index; 0 for what is no unsigned integer.
size_t index_size(int component_type);

// Elements of one accessor, checked: `base` is NULL for zeros; sparse replacements are looked up by element.
struct accessor_reader {
    const tinygltf::Accessor &accessor;
    const uint8_t *base = nullptr;
    uint64_t stride = 0;
    const uint8_t *sparse_values = nullptr;
    std::vector<uint32_t> sparse_indices; // strictly increasing
    size_t size = 0; // bytes of an element
    uint32_t components; // of an element

    accessor_reader(const importer &in, size_t index);
    const uint8_t *element(uint32_t i) const;
    void numbers(uint32_t i, float *values) const; // `components` of them
    uint32_t integer(uint32_t i, uint32_t component) const; // of unsigned ones
};

// ---- gltf_material.cpp
void materials_read(importer &in);
void images_load(importer &in);

// ---- gltf_mesh.cpp
void meshes_read(importer &in);
uint32_t mesh_copy(importer &in, uint32_t mesh, const std::string &where); // `where` wants it
void meshes_keep(importer &in); // once all are there

// All positions that the primitive's accessor has, used or not.
std::vector<std::array<float, 3>> positions_all(const importer &in, const tinygltf::Primitive &primitive,
                                                const std::string &where);

// ---- gltf_subdivision.cpp
// What the mesh's extras say; NULL when they say nothing, or something wrong, which is a warning.
const scene_subdivision_rules *subdivision_rules_read(importer &in, size_t mesh);

// ---- gltf_skin.cpp
void skins_read(importer &in); // before the meshes
void deformations_read(importer &in); // after them

// ---- gltf_animation.cpp
void animations_read(importer &in);

} // namespace gltf
