// glTF primitives: vertices with what deforms them, and indices.
#include "gltf_import.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>

namespace gltf
{
namespace
{

// What a file may ask for in all, so that small files cannot ask for all memory by naming the same bytes many times.
// Morphs are counted by target and vertex.
const uint64_t VERTICES_MAX = 1u << 25, INDICES_MAX = 1u << 26, MORPHS_MAX = 1u << 25;

// ---- Attributes

typedef std::map<std::string, int> attribute_map; // accessors by name

const accessor_rule position_rule = {"POSITION", {TINYGLTF_TYPE_VEC3}, true};
const accessor_rule normal_rule = {"NORMAL", {TINYGLTF_TYPE_VEC3}, false};
const accessor_rule tangent_rule = {"TANGENT", {TINYGLTF_TYPE_VEC4}, false};
const accessor_rule tangent_morph_rule = {"TANGENT", {TINYGLTF_TYPE_VEC3}, false};
const accessor_rule uv_rules[2] = {{"TEXCOORD_0", {TINYGLTF_TYPE_VEC2}, true},
                                   {"TEXCOORD_1", {TINYGLTF_TYPE_VEC2}, true}};
const accessor_rule color_rule = {"COLOR_0", {TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC4}, false};
const accessor_rule weight_rules[2] = {{"WEIGHTS_0", {TINYGLTF_TYPE_VEC4}, false},
                                       {"WEIGHTS_1", {TINYGLTF_TYPE_VEC4}, false}};

// A primitive while it is read.
struct primitive_source {
    const tinygltf::Primitive &primitive;
    std::string where;
    size_t vertex_count; // of its accessors
    std::vector<uint32_t> used; // the accessors' number of each vertex
};

void count_check(const importer &in, uint32_t accessor, const char *name, const primitive_source &source,
                 const std::string &where)
{
    const size_t count = in.model.accessors[accessor].count;
    if (count != source.vertex_count) {
        fail("%s: accessor %u (%s) has %zu elements, POSITION has %zu", where.c_str(), accessor, name, count,
             source.vertex_count);
    }
}

// Calls store(vertex, components) for each used vertex; false when `attributes` lack it.
template <typename F>
bool attribute_read(const importer &in, const attribute_map &attributes, const accessor_rule &rule,
                    const primitive_source &source, const std::string &where, F store)
{
    const auto attribute = attributes.find(rule.name);
    if (attribute == attributes.end()) {
        return false;
    }
    const uint32_t index = accessor_use(in, attribute->second, rule, where);
    count_check(in, index, rule.name, source, where);
    const accessor_reader reader(in, index);
    for (uint32_t i = 0; i < source.used.size(); i++) {
        float values[4] = {0, 0, 0, 1}; // alpha is 1 where colours have none
        reader.numbers(source.used[i], values);
        store(i, values);
    }
    return true;
}

uint32_t unorm16(float value) // not a number becomes 0
{
    return value > 0 ? static_cast<uint32_t>(std::min(value, 1.0f) * 65535 + 0.5f) : 0;
}

void vector_check(const float *v, const char *what, uint32_t vertex, int accessor, const std::string &where)
{
    if (!std::isfinite(v[0]) || !std::isfinite(v[1]) || !std::isfinite(v[2])) {
        fail("%s: the %s of vertex %u (accessor %d) is not finite", where.c_str(), what, vertex, accessor);
    }
}

void positions_read(const importer &in, const primitive_source &source, gltf_primitive &out)
{
    const attribute_map &attributes = source.primitive.attributes;
    out.positions = static_cast<float(*)[3]>(memory_alloc(source.used.size() * sizeof(*out.positions)));
    attribute_read(in, attributes, position_rule, source, source.where, [&](uint32_t i, const float *p) {
        vector_check(p, "position", source.used[i], attributes.at("POSITION"), source.where);
        std::copy_n(p, 3, out.positions[i]);
    });
}

void attributes_read(const importer &in, const primitive_source &source, gltf_primitive &out)
{
    vertex_attributes *const vertices =
        static_cast<vertex_attributes *>(memory_alloc(source.used.size() * sizeof(*out.attributes)));
    out.attributes = vertices;
    for (size_t i = 0; i < source.used.size(); i++) {
        vertices[i].color_rg = vertices[i].color_ba = 0xffffffff;
    }
    const auto read = [&](const accessor_rule &rule, auto store) {
        return attribute_read(in, source.primitive.attributes, rule, source, source.where, store);
    };
    out.has_normals = read(normal_rule, [=](uint32_t i, const float *n) { std::copy_n(n, 3, vertices[i].normal); });
    // Tangents without normals are to be ignored (glTF 2.0, section 3.7.2.1).
    out.has_tangents = out.has_normals &&
                       read(tangent_rule, [=](uint32_t i, const float *t) { std::copy_n(t, 4, vertices[i].tangent); });
    read(uv_rules[0], [=](uint32_t i, const float *uv) { std::copy_n(uv, 2, vertices[i].uv0); });
    read(uv_rules[1], [=](uint32_t i, const float *uv) { std::copy_n(uv, 2, vertices[i].uv1); });
    read(color_rule, [=](uint32_t i, const float *c) {
        vertices[i].color_rg = unorm16(c[0]) | unorm16(c[1]) << 16;
        vertices[i].color_ba = unorm16(c[2]) | unorm16(c[3]) << 16;
    });
}

// ---- Morph targets

// Normals and tangents only where the primitive itself has them.
void target_read(const importer &in, const primitive_source &source, size_t target, gltf_primitive &out)
{
    const attribute_map &attributes = source.primitive.targets[target];
    const std::string where = source.where + " target " + std::to_string(target);
    scene_morph *const morphs = out.morphs + target * source.used.size();
    const auto read = [&](const accessor_rule &rule, const char *what, float(scene_morph::*member)[3]) {
        attribute_read(in, attributes, rule, source, where, [&](uint32_t i, const float *v) {
            vector_check(v, what, source.used[i], attributes.at(rule.name), where);
            std::copy_n(v, 3, morphs[i].*member);
        });
    };
    read(position_rule, "position", &scene_morph::position);
    if (out.has_normals) {
        read(normal_rule, "normal", &scene_morph::normal);
    }
    if (out.has_tangents) {
        read(tangent_morph_rule, "tangent", &scene_morph::tangent);
    }
}

void morphs_read(const importer &in, const primitive_source &source, gltf_primitive &out)
{
    const size_t count = source.primitive.targets.size();
    if (count == 0) {
        return;
    }
    out.target_count = static_cast<uint32_t>(count);
    out.morphs = static_cast<scene_morph *>(memory_alloc(count * source.used.size() * sizeof(scene_morph)));
    for (size_t i = 0; i < count; i++) {
        target_read(in, source, i, out);
    }
}

// ---- Influences

enum { SET_SIZE = 4 }; // joints of an attribute

uint32_t joints_use(const importer &in, const primitive_source &source, const std::string &name)
{
    const uint32_t index =
        index_check(source.primitive.attributes.at(name), in.model.accessors.size(), source.where, "accessor");
    const tinygltf::Accessor &accessor = in.model.accessors[index];
    const size_t size = index_size(accessor.componentType);
    if (accessor.type != TINYGLTF_TYPE_VEC4 || size == 0 || size > sizeof(uint16_t)) {
        fail("%s: accessor %u has the wrong type for %s (component type %d)", source.where.c_str(), index, name.c_str(),
             accessor.componentType);
    }
    count_check(in, index, name.c_str(), source, source.where);
    return index;
}

// Joints and weights `set`, if the primitive has them. What has no weight is joint 0.
bool influences_set_read(const importer &in, const primitive_source &source, uint32_t set, const scene_skin &skin,
                         scene_influences *influences)
{
    const attribute_map &attributes = source.primitive.attributes;
    const char *const where = source.where.c_str();
    const std::string joints_name = "JOINTS_" + std::to_string(set), weights_name = weight_rules[set].name;
    const bool has_joints = attributes.count(joints_name) > 0, has_weights = attributes.count(weights_name) > 0;
    if (has_joints != has_weights) {
        fail("%s has %s without %s", where, (has_joints ? joints_name : weights_name).c_str(),
             (has_joints ? weights_name : joints_name).c_str());
    }
    if (!has_joints) {
        return false;
    }
    const uint32_t accessor = joints_use(in, source, joints_name);
    const accessor_reader joints(in, accessor);
    attribute_read(in, attributes, weight_rules[set], source, source.where, [&](uint32_t i, const float *weights) {
        for (uint32_t k = 0; k < SET_SIZE; k++) {
            const uint32_t joint = weights[k] != 0 ? joints.integer(source.used[i], k) : 0;
            if (!(weights[k] >= 0 && weights[k] < 1e30f)) {
                fail("%s: weight %u of vertex %u (accessor %d) is %g, expected 0 or more", where, k, source.used[i],
                     attributes.at(weights_name), static_cast<double>(weights[k]));
            }
            if (joint >= skin.joint_count) {
                fail("%s: joint %u of vertex %u (accessor %u) is %u, skin \"%s\" has %u joints", where, k,
                     source.used[i], accessor, joint, skin.name, skin.joint_count);
            }
            influences[i].joints[SET_SIZE * set + k] = static_cast<uint16_t>(joint);
            influences[i].weights[SET_SIZE * set + k] = weights[k];
        }
    });
    return true;
}

// Sorts by falling weight, and makes the sum 1. False where there is no weight: the first joint then has it.
bool influences_normalize(scene_influences &of)
{
    double sum = 0;
    for (int i = 0; i < SCENE_INFLUENCES; i++) {
        sum += static_cast<double>(of.weights[i]);
        for (int k = i; k > 0 && of.weights[k] > of.weights[k - 1]; k--) {
            std::swap(of.weights[k], of.weights[k - 1]);
            std::swap(of.joints[k], of.joints[k - 1]);
        }
    }
    if (!(sum > 0)) {
        of.weights[0] = 1;
        return false;
    }
    for (float &weight : of.weights) {
        weight = static_cast<float>(static_cast<double>(weight) / sum);
    }
    return true;
}

void influences_read(importer &in, const primitive_source &source, const scene_skin &skin, gltf_primitive &out)
{
    if (source.primitive.attributes.count("JOINTS_0") == 0) {
        return;
    }
    out.influences = static_cast<scene_influences *>(memory_alloc(source.used.size() * sizeof(*out.influences)));
    for (uint32_t set = 0; set < SCENE_INFLUENCES / SET_SIZE; set++) {
        influences_set_read(in, source, set, skin, out.influences);
    }
    for (size_t i = 0; i < source.used.size(); i++) {
        in.weightless_vertices += !influences_normalize(out.influences[i]);
    }
    in.cut_joints += source.primitive.attributes.count("JOINTS_2") > 0;
}

// ---- Indices

std::vector<uint32_t> indices_read(const importer &in, const tinygltf::Primitive &primitive, size_t vertex_count,
                                   const std::string &where)
{
    std::vector<uint32_t> indices;
    const auto attribute = primitive.attributes.find(GLTF_INDICES);
    if (attribute == primitive.attributes.end()) {
        indices.resize(vertex_count);
        for (size_t i = 0; i < vertex_count; i++) {
            indices[i] = static_cast<uint32_t>(i);
        }
        return indices;
    }
    const uint32_t index = index_check(attribute->second, in.model.accessors.size(), where, "accessor");
    const tinygltf::Accessor &accessor = in.model.accessors[index];
    const size_t bytes = index_size(accessor.componentType);
    if (accessor.type != TINYGLTF_TYPE_SCALAR || bytes == 0) {
        fail("%s: accessor %u has the wrong type for indices (component type %d)", where.c_str(), index,
             accessor.componentType);
    }
    const accessor_reader reader(in, index);
    indices.resize(accessor.count);
    for (size_t i = 0; i < accessor.count; i++) {
        indices[i] = reader.integer(static_cast<uint32_t>(i), 0);
        if (indices[i] >= vertex_count) {
            fail("%s: index %zu (accessor %u) is %u, expected less than the %zu vertices", where.c_str(), i, index,
                 indices[i], vertex_count);
        }
    }
    return indices;
}

// Strips and fans to lists, by the vertex orders of glTF 2.0, section 3.7.2.1.
std::vector<uint32_t> triangles_make(importer &in, const std::vector<uint32_t> &indices, int mode)
{
    std::vector<uint32_t> triangles;
    if (mode == TINYGLTF_MODE_TRIANGLES) {
        triangles.assign(indices.begin(), indices.end() - static_cast<ptrdiff_t>(indices.size() % 3));
        in.cut_lists += indices.size() % 3 != 0;
        return triangles;
    }
    for (size_t i = 2; i < indices.size(); i++) {
        const bool fan = mode == TINYGLTF_MODE_TRIANGLE_FAN, odd = i % 2 == 1;
        const uint32_t first = fan ? indices[0] : indices[i - 2];
        const uint32_t second = fan || !odd ? indices[i - 1] : indices[i],
                       third = fan || !odd ? indices[i] : indices[i - 1];
        triangles.insert(triangles.end(), {first, second, third});
    }
    return triangles;
}

// Renumbers the vertices in order of first use and returns the accessors' number of each: primitives may share
// accessors, and each takes only its part.
std::vector<uint32_t> vertices_used(importer &in, std::vector<uint32_t> &indices, size_t vertex_count)
{
    std::vector<uint32_t> used;
    if (in.local_of.size() < vertex_count) {
        in.local_of.resize(vertex_count, SCENE_NONE);
    }
    for (uint32_t &index : indices) {
        uint32_t &local = in.local_of[index];
        if (local == SCENE_NONE) {
            local = static_cast<uint32_t>(used.size());
            used.push_back(index);
        }
        index = local;
    }
    for (const uint32_t vertex : used) {
        in.local_of[vertex] = SCENE_NONE;
    }
    return used;
}

// ---- Primitives

// False: nothing to draw, which has been counted.
bool is_drawable(importer &in, const tinygltf::Primitive &primitive)
{
    if (primitive.mode < TINYGLTF_MODE_TRIANGLES || primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN) {
        in.skipped_modes++;
        return false;
    }
    if (primitive.attributes.count("POSITION") == 0) {
        in.skipped_without_positions++;
        return false;
    }
    return true;
}

void primitive_read(importer &in, const tinygltf::Primitive &primitive, const std::string &where,
                    const scene_skin *skin)
{
    if (!is_drawable(in, primitive)) {
        return;
    }
    const uint32_t position = accessor_use(in, primitive.attributes.at("POSITION"), position_rule, where);
    const size_t vertex_count = in.model.accessors[position].count;
    std::vector<uint32_t> indices =
        triangles_make(in, indices_read(in, primitive, vertex_count, where), primitive.mode);
    const primitive_source source = {primitive, where, vertex_count, vertices_used(in, indices, vertex_count)};

    in.primitives.emplace_back(); // the importer owns it from here on, whatever is thrown
    gltf_primitive &out = in.primitives.back();
    out = {};
    out.vertex_count = static_cast<uint32_t>(source.used.size());
    out.index_count = static_cast<uint32_t>(indices.size());
    out.indices = static_cast<uint32_t *>(memory_alloc(indices.size() * sizeof(uint32_t)));
    std::copy(indices.begin(), indices.end(), out.indices);
    positions_read(in, source, out);
    attributes_read(in, source, out);
    morphs_read(in, source, out);
    if (skin) {
        influences_read(in, source, *skin, out);
    }

    mesh_primitive made = {};
    const uint32_t last = in.scene->material_count - 1;
    made.material = primitive.material == -1 ? last : index_check(primitive.material, last, where, "material");
    in.mesh_primitives.push_back(made);
}

std::string primitive_label(const importer &in, size_t mesh, size_t primitive)
{
    return label("mesh", mesh, in.model.meshes[mesh].name) + " primitive " + std::to_string(primitive);
}

// Before anything is allocated; sums of numbers up to 2^40 do not overflow before one of them is found too large.
void totals_add(importer &in, uint64_t vertices, uint64_t indices, uint64_t targets, bool has_normals,
                const std::string &where)
{
    in.vertices += vertices;
    in.indices += indices;
    in.morphs += targets * (has_normals ? vertices : indices); // without normals no triangles share vertices
    if (in.vertices > VERTICES_MAX || in.indices > INDICES_MAX || in.morphs > MORPHS_MAX) {
        fail("%s: more than %llu vertices, %llu triangles or %llu vertices of morph targets in all", where.c_str(),
             static_cast<unsigned long long>(VERTICES_MAX), static_cast<unsigned long long>(INDICES_MAX / 3),
             static_cast<unsigned long long>(MORPHS_MAX));
    }
}

void totals_check(importer &in)
{
    for (size_t i = 0; i < in.model.meshes.size(); i++) {
        for (size_t k = 0; k < in.model.meshes[i].primitives.size(); k++) {
            const tinygltf::Primitive &primitive = in.model.meshes[i].primitives[k];
            const attribute_map &attributes = primitive.attributes;
            const auto position = attributes.find("POSITION"), index = attributes.find(GLTF_INDICES);
            const std::string where = primitive_label(in, i, k);
            const auto count_of = [&](int accessor) -> uint64_t {
                return in.model.accessors[index_check(accessor, in.model.accessors.size(), where, "accessor")].count;
            };
            const uint64_t corners = position == attributes.end() ? 0 : count_of(position->second);
            const uint64_t used = index == attributes.end() ? corners : count_of(index->second);
            const bool is_list = primitive.mode == TINYGLTF_MODE_TRIANGLES;
            totals_add(in, std::min(corners, used), is_list ? used : 3 * used, primitive.targets.size(),
                       attributes.count("NORMAL") > 0, where);
        }
    }
}

// All of a mesh's primitives have the same number of targets, and have joints or not.
void mesh_check(const importer &in, const scene_mesh &mesh, const std::string &where)
{
    for (uint32_t i = 1; i < mesh.primitive_count; i++) {
        const gltf_primitive &first = in.primitives[mesh.first_primitive],
                             &other = in.primitives[mesh.first_primitive + i];
        if (other.target_count != first.target_count) {
            fail("%s: a primitive has %u morph targets, another has %u", where.c_str(), first.target_count,
                 other.target_count);
        }
        if (!other.influences != !first.influences) {
            fail("%s has a skin; one of its primitives has JOINTS_0, another has not", where.c_str());
        }
    }
}

template <typename T> T *copied(const T *from, size_t count)
{
    T *const copy = from ? static_cast<T *>(memory_alloc(count * sizeof(T))) : nullptr;
    if (copy && count > 0) {
        memcpy(copy, from, count * sizeof(T));
    }
    return copy;
}

gltf_primitive primitive_copied(const gltf_primitive &from)
{
    gltf_primitive copy = from;
    copy.positions = copied(from.positions, from.vertex_count);
    copy.attributes = copied(from.attributes, from.vertex_count);
    copy.indices = copied(from.indices, from.index_count);
    copy.influences = copied(from.influences, from.vertex_count);
    copy.morphs = copied(from.morphs, static_cast<size_t>(from.target_count) * from.vertex_count);
    return copy;
}

void skipped_warn(const importer &in)
{
    if (in.skipped_modes > 0) {
        scene_warning(in.scene, "%u primitives of points or lines are left out", in.skipped_modes);
    }
    if (in.skipped_without_positions > 0) {
        scene_warning(in.scene, "%u primitives without positions are left out", in.skipped_without_positions);
    }
    if (in.cut_lists > 0) {
        scene_warning(in.scene, "%u triangle lists are not a multiple of three long; the rest is left out",
                      in.cut_lists);
    }
    if (in.cut_joints > 0) {
        scene_warning(in.scene, "%u primitives have more than %d joints a vertex; the rest is left out", in.cut_joints,
                      SCENE_INFLUENCES);
    }
    if (in.weightless_vertices > 0) {
        scene_warning(in.scene, "%u vertices of skins have no weight; they follow the first joint",
                      in.weightless_vertices);
    }
}

} // namespace

std::vector<std::array<float, 3>> positions_all(const importer &in, const tinygltf::Primitive &primitive,
                                                const std::string &where)
{
    const auto position = primitive.attributes.find("POSITION");
    if (position == primitive.attributes.end()) {
        return {};
    }
    const accessor_reader reader(in, accessor_use(in, position->second, position_rule, where));
    std::vector<std::array<float, 3>> positions(reader.accessor.count);
    for (uint32_t i = 0; i < positions.size(); i++) {
        reader.numbers(i, positions[i].data());
    }
    return positions;
}

void meshes_read(importer &in)
{
    totals_check(in);
    for (size_t i = 0; i < in.model.meshes.size(); i++) {
        const tinygltf::Mesh &mesh = in.model.meshes[i];
        const uint32_t skin = in.skin_of_mesh[i];
        scene_mesh out = {};
        out.name = in.keep(mesh.name);
        out.first_primitive = static_cast<uint32_t>(in.primitives.size());
        out.deformation = SCENE_NONE;
        out.subdivision_rules = subdivision_rules_read(in, i);
        for (size_t k = 0; k < mesh.primitives.size(); k++) {
            primitive_read(in, mesh.primitives[k], primitive_label(in, i, k),
                           skin == SCENE_NONE ? nullptr : &in.scene->skins[skin]);
        }
        out.primitive_count = static_cast<uint32_t>(in.primitives.size()) - out.first_primitive;
        mesh_check(in, out, label("mesh", i, mesh.name));
        in.meshes.push_back(out);
    }
    skipped_warn(in);
}

uint32_t mesh_copy(importer &in, uint32_t mesh, const std::string &where)
{
    scene_mesh copy = in.meshes[mesh];
    const uint32_t first = copy.first_primitive;
    copy.first_primitive = static_cast<uint32_t>(in.primitives.size());
    for (uint32_t i = first; i < first + copy.primitive_count; i++) {
        const gltf_primitive &from = in.primitives[i];
        totals_add(in, from.vertex_count, from.index_count, from.target_count, from.has_normals, where);
        in.primitives.emplace_back();
        in.primitives.back() = primitive_copied(in.primitives[i]);
        in.mesh_primitives.push_back(mesh_primitive(in.mesh_primitives[i]));
    }
    in.meshes.push_back(copy);
    return static_cast<uint32_t>(in.meshes.size() - 1);
}

void meshes_keep(importer &in)
{
    scene_data *const scene = in.scene;
    scene->meshes = in.allocate<scene_mesh>(in.meshes.size());
    std::copy(in.meshes.begin(), in.meshes.end(), scene->meshes);
    scene->mesh_count = static_cast<uint32_t>(in.meshes.size());
    scene->primitives = in.allocate<mesh_primitive>(in.mesh_primitives.size());
    std::copy(in.mesh_primitives.begin(), in.mesh_primitives.end(), scene->primitives);
    scene->primitive_count = static_cast<uint32_t>(in.mesh_primitives.size());
}

} // namespace gltf
