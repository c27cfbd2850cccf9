// glTF import: the `extras` that make a mesh a control cage. The convention is in scene.h.
#include "gltf_import.hpp"

#include <algorithm>
#include <cmath>

namespace gltf
{
namespace
{

const char extras_key[] = "lanternfield_subdivision";

// What is wrong with the extras: `max_level: expected ...`.
struct extras_error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

bool is_whole(const tinygltf::Value &value, double min, double max)
{
    return value.IsNumber() && value.GetNumberAsDouble() >= min && value.GetNumberAsDouble() <= max &&
           value.GetNumberAsDouble() == std::floor(value.GetNumberAsDouble());
}

// The number of the name that the member has; `fallback` without one.
int choice_read(const tinygltf::Value &object, const char *key, const char *const (&names)[2], int fallback)
{
    if (!object.Has(key)) {
        return fallback;
    }
    const tinygltf::Value &value = object.Get(key);
    for (int i = 0; i < 2; i++) {
        if (value.IsString() && value.Get<std::string>() == names[i]) {
            return i;
        }
    }
    throw extras_error(std::string(key) + ": expected \"" + names[0] + "\" or \"" + names[1] + "\"");
}

uint32_t max_level_read(const tinygltf::Value &object)
{
    if (!object.Has("max_level")) {
        return 3;
    }
    if (!is_whole(object.Get("max_level"), 1, SUBDIVISION_LEVELS_MAX)) {
        throw extras_error("max_level: expected a whole number from 1 to " + std::to_string(SUBDIVISION_LEVELS_MAX));
    }
    return static_cast<uint32_t>(object.Get("max_level").GetNumberAsDouble());
}

scene_crease crease_read(const tinygltf::Value &value, size_t index, const std::vector<std::array<float, 3>> &positions)
{
    const double last = static_cast<double>(positions.size()) - 1;
    const bool right = value.IsArray() && value.ArrayLen() == 3 && is_whole(value.Get(0), 0, last) &&
                       is_whole(value.Get(1), 0, last) && value.Get(2).IsNumber() &&
                       value.Get(2).GetNumberAsDouble() >= 0;
    if (!right) {
        throw extras_error("creases: entry " + std::to_string(index) + ": expected two vertices below " +
                           std::to_string(positions.size()) + " and a sharpness of 0 or more");
    }
    scene_crease crease = {};
    for (size_t k = 0; k < 2; k++) {
        const size_t vertex = static_cast<size_t>(value.Get(k).GetNumberAsDouble());
        std::copy_n(positions[vertex].begin(), 3, crease.ends[k]);
    }
    crease.sharpness =
        static_cast<float>(std::min(value.Get(2).GetNumberAsDouble(), static_cast<double>(SUBDIVISION_SHARP)));
    return crease;
}

void creases_read(importer &in, const tinygltf::Value &object, const tinygltf::Mesh &mesh, const std::string &where,
                  scene_subdivision_rules &rules)
{
    if (!object.Has("creases")) {
        return;
    }
    const tinygltf::Value &list = object.Get("creases");
    if (!list.IsArray()) {
        throw extras_error("creases: expected a list of [vertex, vertex, sharpness]");
    }
    const std::vector<std::array<float, 3>> positions =
        mesh.primitives.empty() ? std::vector<std::array<float, 3>>() : positions_all(in, mesh.primitives[0], where);
    scene_crease *const creases = in.allocate<scene_crease>(list.ArrayLen());
    for (size_t i = 0; i < list.ArrayLen(); i++) {
        creases[i] = crease_read(list.Get(static_cast<int>(i)), i, positions);
    }
    rules.creases = creases;
    rules.crease_count = static_cast<uint32_t>(list.ArrayLen());
}

void keys_check(const tinygltf::Value &object)
{
    static const char *const known[] = {"scheme", "max_level", "boundary", "creases"};
    for (const std::string &key : object.Keys()) {
        if (std::find(std::begin(known), std::end(known), key) == std::end(known)) {
            throw extras_error(key.substr(0, 100) + ": expected scheme, max_level, boundary or creases");
        }
    }
}

scene_subdivision_rules rules_read(importer &in, const tinygltf::Value &object, const tinygltf::Mesh &mesh,
                                   const std::string &where)
{
    static const char *const schemes[] = {"catmark", "loop"};
    static const char *const boundaries[] = {"edge", "edge_and_corner"};
    if (!object.IsObject() || !object.Has("scheme")) {
        throw extras_error("scheme: expected \"catmark\" or \"loop\"");
    }
    keys_check(object);
    scene_subdivision_rules rules = {};
    rules.scheme = static_cast<subdivision_scheme>(choice_read(object, "scheme", schemes, 0));
    rules.boundary =
        static_cast<subdivision_boundary>(choice_read(object, "boundary", boundaries, SUBDIVISION_EDGE_AND_CORNER));
    rules.max_level = max_level_read(object);
    creases_read(in, object, mesh, where, rules);
    return rules;
}

} // namespace

const scene_subdivision_rules *subdivision_rules_read(importer &in, size_t index)
{
    const tinygltf::Mesh &mesh = in.model.meshes[index];
    if (!mesh.extras.IsObject() || !mesh.extras.Has(extras_key)) {
        return nullptr;
    }
    const std::string where = label("mesh", index, mesh.name);
    try {
        scene_subdivision_rules *const rules = in.allocate<scene_subdivision_rules>(1);
        *rules = rules_read(in, mesh.extras.Get(extras_key), mesh, where);
        return rules;
    } catch (const extras_error &error) {
        scene_warning(in.scene, "%s is not subdivided: %s: %s", where.c_str(), extras_key, error.what());
        return nullptr;
    }
}

} // namespace gltf
