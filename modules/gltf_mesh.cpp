// glTF accessors and primitives. Every accessor is checked against its buffer view and buffer before any is read.
#include "gltf_import.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <numeric>

namespace gltf
{
namespace
{

// What a file may ask for in all, so that small files cannot ask for all memory by naming the same bytes many times.
const uint64_t VERTICES_MAX = 1u << 25, INDICES_MAX = 1u << 26;
// Elements that an accessor may claim without a buffer view behind them: they are zeros, and cost the file nothing.
const uint64_t UNBACKED_MAX = 1u << 20;

// ---- Accessors

size_t element_size(const tinygltf::Accessor &accessor)
{
    const int size = tinygltf::GetComponentSizeInBytes(static_cast<uint32_t>(accessor.componentType));
    const int count = tinygltf::GetNumComponentsInType(static_cast<uint32_t>(accessor.type));
    return size > 0 && count > 0 ? static_cast<size_t>(size) * static_cast<size_t>(count) : 0;
}

// Elements of `size` bytes, `stride` apart, from `offset` on: do they all lie in the view?
void range_check(const importer &in, int view, uint64_t offset, uint64_t count, uint64_t size, uint64_t stride,
                 const std::string &where)
{
    const uint64_t length =
        in.model.bufferViews[index_check(view, in.model.bufferViews.size(), where, "buffer view")].byteLength;
    const bool fits =
        count == 0 || (offset <= length && size <= length - offset && (count - 1) <= (length - offset - size) / stride);
    if (!fits) {
        fail("%s: %llu elements of %llu bytes from byte %llu on go past the %llu bytes of buffer view %d",
             where.c_str(), static_cast<unsigned long long>(count), static_cast<unsigned long long>(size),
             static_cast<unsigned long long>(offset), static_cast<unsigned long long>(length), view);
    }
}

size_t index_size(int component_type)
{
    return component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE    ? 1
           : component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? 2
           : component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT   ? 4
                                                                      : 0;
}

void sparse_check(const importer &in, const tinygltf::Accessor &accessor, const std::string &where)
{
    const auto &sparse = accessor.sparse;
    const size_t size = index_size(sparse.indices.componentType);
    if (sparse.count < 0 || static_cast<uint64_t>(sparse.count) > accessor.count) {
        fail("%s: %d sparse elements, expected at most its count, %zu", where.c_str(), sparse.count, accessor.count);
    }
    if (size == 0) {
        fail("%s: sparse indices of component type %d, expected 5121, 5123 or 5125", where.c_str(),
             sparse.indices.componentType);
    }
    if (sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0) {
        fail("%s: negative sparse byteOffset", where.c_str());
    }
    const uint64_t count = static_cast<uint64_t>(sparse.count);
    range_check(in, sparse.indices.bufferView, static_cast<uint64_t>(sparse.indices.byteOffset), count, size, size,
                where + ".sparse.indices");
    range_check(in, sparse.values.bufferView, static_cast<uint64_t>(sparse.values.byteOffset), count,
                element_size(accessor), element_size(accessor), where + ".sparse.values");
}

uint64_t stride_of(const importer &in, const tinygltf::Accessor &accessor)
{
    const uint64_t stride = in.model.bufferViews[static_cast<size_t>(accessor.bufferView)].byteStride;
    return stride ? stride : element_size(accessor);
}

std::string accessor_label(const importer &in, size_t index)
{
    return label("accessor", index, in.model.accessors[index].name);
}

void accessor_check(const importer &in, size_t index)
{
    const tinygltf::Accessor &accessor = in.model.accessors[index];
    const std::string where = accessor_label(in, index);
    if (element_size(accessor) == 0) {
        fail("%s: unknown component type %d", where.c_str(), accessor.componentType);
    }
    if (accessor.bufferView != -1) {
        index_check(accessor.bufferView, in.model.bufferViews.size(), where, "buffer view");
        const uint64_t stride = stride_of(in, accessor);
        if (stride < element_size(accessor)) {
            fail("%s: a stride of %llu bytes, its elements have %zu", where.c_str(),
                 static_cast<unsigned long long>(stride), element_size(accessor));
        }
        range_check(in, accessor.bufferView, accessor.byteOffset, accessor.count, element_size(accessor), stride,
                    where);
    } else if (accessor.count > UNBACKED_MAX) {
        fail("%s claims %zu elements without a buffer view", where.c_str(), accessor.count);
    }
    if (accessor.sparse.isSparse) {
        sparse_check(in, accessor, where);
    }
}

// Elements of one accessor, checked: `base` is NULL for zeros; sparse replacements are looked up by element.
struct accessor_reader {
    const tinygltf::Accessor &accessor;
    const uint8_t *base = nullptr;
    uint64_t stride = 0;
    const uint8_t *sparse_values = nullptr;
    std::vector<uint32_t> sparse_indices; // strictly increasing
    size_t size = 0;

    accessor_reader(const importer &in, size_t index);
    const uint8_t *element(uint32_t i) const;
};

uint32_t index_load(const uint8_t *bytes, size_t size)
{
    uint32_t value = 0;
    memcpy(&value, bytes, size); // little endian, as this machine
    return value;
}

accessor_reader::accessor_reader(const importer &in, size_t index)
    : accessor(in.model.accessors[index]), size(element_size(accessor))
{
    if (accessor.bufferView != -1) {
        base = view_bytes(in, static_cast<uint32_t>(accessor.bufferView)).data + accessor.byteOffset;
        stride = stride_of(in, accessor);
    }
    if (!accessor.sparse.isSparse || accessor.sparse.count == 0) {
        return;
    }
    const auto &sparse = accessor.sparse;
    const uint8_t *const indices =
        view_bytes(in, static_cast<uint32_t>(sparse.indices.bufferView)).data + sparse.indices.byteOffset;
    const size_t bytes = index_size(sparse.indices.componentType);
    for (size_t i = 0; i < static_cast<size_t>(sparse.count); i++) {
        const uint32_t element = index_load(indices + i * bytes, bytes);
        if (element >= accessor.count || (i > 0 && element <= sparse_indices.back())) {
            fail("%s: sparse index %zu is %u, expected increasing ones below %zu", accessor_label(in, index).c_str(), i,
                 element, accessor.count);
        }
        sparse_indices.push_back(element);
    }
    sparse_values = view_bytes(in, static_cast<uint32_t>(sparse.values.bufferView)).data + sparse.values.byteOffset;
}

const uint8_t *accessor_reader::element(uint32_t i) const
{
    static const uint8_t zeros[16 * sizeof(double)] = {};
    const auto replaced = std::lower_bound(sparse_indices.begin(), sparse_indices.end(), i);
    if (replaced != sparse_indices.end() && *replaced == i) {
        return sparse_values + static_cast<size_t>(replaced - sparse_indices.begin()) * size;
    }
    return base ? base + i * stride : zeros;
}

template <typename T> double component_load(const uint8_t *bytes)
{
    T value;
    memcpy(&value, bytes, sizeof(value));
    return value;
}

// Normalised integers by the equations of the glTF specification, section 3.11; others (KHR_mesh_quantization) as they
// are.
float component_read(const uint8_t *bytes, int type, bool normalized)
{
    switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
        return static_cast<float>(normalized ? std::max(component_load<int8_t>(bytes) / 127, -1.0)
                                             : component_load<int8_t>(bytes));
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
        return static_cast<float>(component_load<uint8_t>(bytes) / (normalized ? 255 : 1));
    case TINYGLTF_COMPONENT_TYPE_SHORT:
        return static_cast<float>(normalized ? std::max(component_load<int16_t>(bytes) / 32767, -1.0)
                                             : component_load<int16_t>(bytes));
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
        return static_cast<float>(component_load<uint16_t>(bytes) / (normalized ? 65535 : 1));
    default: // the attributes' check lets only float through
        return static_cast<float>(component_load<float>(bytes));
    }
}

// ---- Attributes

struct attribute_rule {
    const char *name;
    std::initializer_list<int> types;
    bool may_be_integer; // not normalised, as KHR_mesh_quantization allows
};

const attribute_rule position_rule = {"POSITION", {TINYGLTF_TYPE_VEC3}, true};
const attribute_rule normal_rule = {"NORMAL", {TINYGLTF_TYPE_VEC3}, false};
const attribute_rule tangent_rule = {"TANGENT", {TINYGLTF_TYPE_VEC4}, false};
const attribute_rule uv_rules[2] = {{"TEXCOORD_0", {TINYGLTF_TYPE_VEC2}, true},
                                    {"TEXCOORD_1", {TINYGLTF_TYPE_VEC2}, true}};
const attribute_rule color_rule = {"COLOR_0", {TINYGLTF_TYPE_VEC3, TINYGLTF_TYPE_VEC4}, false};

void attribute_check(const importer &in, uint32_t index, const attribute_rule &rule, size_t count,
                     const std::string &where)
{
    const tinygltf::Accessor &accessor = in.model.accessors[index];
    const int type = accessor.componentType;
    const bool is_integer = type >= TINYGLTF_COMPONENT_TYPE_BYTE && type <= TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
    if (std::find(rule.types.begin(), rule.types.end(), accessor.type) == rule.types.end() ||
        !(type == TINYGLTF_COMPONENT_TYPE_FLOAT || (is_integer && (accessor.normalized || rule.may_be_integer)))) {
        fail("%s: accessor %u has the wrong type for %s (component type %d)", where.c_str(), index, rule.name, type);
    }
    if (accessor.count != count) {
        fail("%s: accessor %u (%s) has %zu elements, POSITION has %zu", where.c_str(), index, rule.name, accessor.count,
             count);
    }
}

// Calls store(vertex, components) for each used vertex; false when the primitive lacks the attribute.
template <typename F>
bool attribute_read(const importer &in, const tinygltf::Primitive &primitive, const attribute_rule &rule,
                    const std::vector<uint32_t> &used, const std::string &where, F store)
{
    const auto attribute = primitive.attributes.find(rule.name);
    if (attribute == primitive.attributes.end()) {
        return false;
    }
    const uint32_t index = index_check(attribute->second, in.model.accessors.size(), where, "accessor");
    const size_t count = in.model.accessors[static_cast<size_t>(primitive.attributes.at("POSITION"))].count;
    attribute_check(in, index, rule, count, where);
    const accessor_reader reader(in, index);
    const int type = reader.accessor.componentType;
    const size_t components =
        static_cast<size_t>(tinygltf::GetNumComponentsInType(static_cast<uint32_t>(reader.accessor.type)));
    const size_t bytes = reader.size / components;
    for (uint32_t i = 0; i < used.size(); i++) {
        float values[4] = {0, 0, 0, 1}; // alpha is 1 where colours have none
        const uint8_t *const element = reader.element(used[i]);
        for (size_t c = 0; c < components; c++) {
            values[c] = component_read(element + c * bytes, type, reader.accessor.normalized);
        }
        store(i, values);
    }
    return true;
}

uint32_t unorm16(float value) // not a number becomes 0
{
    return value > 0 ? static_cast<uint32_t>(std::min(value, 1.0f) * 65535 + 0.5f) : 0;
}

void positions_read(const importer &in, const tinygltf::Primitive &source, const std::vector<uint32_t> &used,
                    const std::string &where, gltf_primitive &out)
{
    out.positions = static_cast<float(*)[3]>(memory_alloc(used.size() * sizeof(*out.positions)));
    attribute_read(in, source, position_rule, used, where, [&](uint32_t i, const float *p) {
        if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) {
            fail("%s: the position of vertex %u (accessor %d) is not finite", where.c_str(), used[i],
                 source.attributes.at("POSITION"));
        }
        std::copy_n(p, 3, out.positions[i]);
    });
}

void attributes_read(const importer &in, const tinygltf::Primitive &source, const std::vector<uint32_t> &used,
                     const std::string &where, gltf_primitive &out)
{
    vertex_attributes *const vertices =
        static_cast<vertex_attributes *>(memory_alloc(used.size() * sizeof(*out.attributes)));
    out.attributes = vertices;
    for (size_t i = 0; i < used.size(); i++) {
        vertices[i].color_rg = vertices[i].color_ba = 0xffffffff;
    }
    out.has_normals = attribute_read(in, source, normal_rule, used, where,
                                     [=](uint32_t i, const float *n) { std::copy_n(n, 3, vertices[i].normal); });
    // Tangents without normals are to be ignored (glTF 2.0, section 3.7.2.1).
    out.has_tangents =
        out.has_normals && attribute_read(in, source, tangent_rule, used, where,
                                          [=](uint32_t i, const float *t) { std::copy_n(t, 4, vertices[i].tangent); });
    attribute_read(in, source, uv_rules[0], used, where,
                   [=](uint32_t i, const float *uv) { std::copy_n(uv, 2, vertices[i].uv0); });
    attribute_read(in, source, uv_rules[1], used, where,
                   [=](uint32_t i, const float *uv) { std::copy_n(uv, 2, vertices[i].uv1); });
    attribute_read(in, source, color_rule, used, where, [=](uint32_t i, const float *c) {
        vertices[i].color_rg = unorm16(c[0]) | unorm16(c[1]) << 16;
        vertices[i].color_ba = unorm16(c[2]) | unorm16(c[3]) << 16;
    });
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
        indices[i] = index_load(reader.element(static_cast<uint32_t>(i)), bytes);
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

void primitive_read(importer &in, const tinygltf::Primitive &source, const std::string &where,
                    std::vector<mesh_primitive> &list)
{
    if (!is_drawable(in, source)) {
        return;
    }
    const uint32_t position =
        index_check(source.attributes.at("POSITION"), in.model.accessors.size(), where, "accessor");
    const size_t vertex_count = in.model.accessors[position].count;
    attribute_check(in, position, position_rule, vertex_count, where);
    std::vector<uint32_t> indices = triangles_make(in, indices_read(in, source, vertex_count, where), source.mode);
    const std::vector<uint32_t> used = vertices_used(in, indices, vertex_count);

    in.primitives.emplace_back(); // the importer owns it from here on, whatever is thrown
    gltf_primitive &out = in.primitives.back();
    out = {};
    out.vertex_count = static_cast<uint32_t>(used.size());
    out.index_count = static_cast<uint32_t>(indices.size());
    out.indices = static_cast<uint32_t *>(memory_alloc(indices.size() * sizeof(uint32_t)));
    std::copy(indices.begin(), indices.end(), out.indices);
    positions_read(in, source, used, where, out);
    attributes_read(in, source, used, where, out);

    mesh_primitive primitive = {};
    const uint32_t last = in.scene->material_count - 1;
    primitive.material = source.material == -1 ? last : index_check(source.material, last, where, "material");
    list.push_back(primitive);
}

std::string primitive_label(const importer &in, size_t mesh, size_t primitive)
{
    return label("mesh", mesh, in.model.meshes[mesh].name) + " primitive " + std::to_string(primitive);
}

// Before anything is allocated; sums of numbers up to 2^40 do not overflow before one of them is found too large.
void totals_check(const importer &in)
{
    uint64_t vertices = 0, indices = 0;
    for (size_t i = 0; i < in.model.meshes.size(); i++) {
        for (size_t k = 0; k < in.model.meshes[i].primitives.size(); k++) {
            const std::map<std::string, int> &attributes = in.model.meshes[i].primitives[k].attributes;
            const auto position = attributes.find("POSITION"), index = attributes.find(GLTF_INDICES);
            const std::string where = primitive_label(in, i, k);
            const auto count_of = [&](int accessor) -> uint64_t {
                return in.model.accessors[index_check(accessor, in.model.accessors.size(), where, "accessor")].count;
            };
            const uint64_t corners = position == attributes.end() ? 0 : count_of(position->second);
            const uint64_t used = index == attributes.end() ? corners : count_of(index->second);
            const bool is_list = in.model.meshes[i].primitives[k].mode == TINYGLTF_MODE_TRIANGLES;
            vertices += std::min(corners, used);
            indices += is_list ? used : 3 * used;
            if (vertices > VERTICES_MAX || indices > INDICES_MAX) {
                fail("%s: more than %llu vertices or %llu triangles in all", where.c_str(),
                     static_cast<unsigned long long>(VERTICES_MAX), static_cast<unsigned long long>(INDICES_MAX / 3));
            }
        }
    }
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
}

} // namespace

gltf_bytes view_bytes(const importer &in, uint32_t view)
{
    const std::string where = label("buffer view", view, "");
    const tinygltf::BufferView &source =
        in.model.bufferViews[index_check(static_cast<int>(view), in.model.bufferViews.size(), "file", "buffer view")];
    const gltf_buffer &buffer = in.file.buffers[index_check(source.buffer, in.file.buffer_count, where, "buffer")];
    if (!buffer.bytes.data) {
        fail("%s: %s has no bytes: neither a URI nor a binary chunk", where.c_str(), buffer.name);
    }
    return {buffer.bytes.data + source.byteOffset, source.byteLength};
}

std::vector<std::array<float, 3>> positions_all(const importer &in, const tinygltf::Primitive &primitive,
                                                const std::string &where)
{
    const auto position = primitive.attributes.find("POSITION");
    if (position == primitive.attributes.end()) {
        return {};
    }
    const size_t count =
        in.model.accessors[index_check(position->second, in.model.accessors.size(), where, "accessor")].count;
    std::vector<uint32_t> all(count);
    std::iota(all.begin(), all.end(), 0u);
    std::vector<std::array<float, 3>> positions(count);
    attribute_read(in, primitive, position_rule, all, where,
                   [&](uint32_t i, const float *p) { std::copy_n(p, 3, positions[i].begin()); });
    return positions;
}

void views_check(importer &in)
{
    for (size_t i = 0; i < in.model.bufferViews.size(); i++) {
        const tinygltf::BufferView &view = in.model.bufferViews[i];
        const std::string where = label("buffer view", i, view.name);
        const gltf_buffer &buffer = in.file.buffers[index_check(view.buffer, in.file.buffer_count, where, "buffer")];
        // A placeholder has no bytes; that matters only to those who want them.
        if (buffer.bytes.data &&
            (view.byteOffset > buffer.bytes.size || view.byteLength > buffer.bytes.size - view.byteOffset)) {
            fail("%s: %zu bytes from byte %zu on go past the %llu bytes of %s", where.c_str(), view.byteLength,
                 view.byteOffset, static_cast<unsigned long long>(buffer.bytes.size), buffer.name);
        }
    }
}

void accessors_check(importer &in)
{
    for (size_t i = 0; i < in.model.accessors.size(); i++) {
        accessor_check(in, i);
    }
}

void meshes_read(importer &in)
{
    totals_check(in);
    scene_data *const scene = in.scene;
    std::vector<mesh_primitive> list;
    scene->meshes = in.allocate<scene_mesh>(in.model.meshes.size());
    for (size_t i = 0; i < in.model.meshes.size(); i++) {
        const tinygltf::Mesh &mesh = in.model.meshes[i];
        scene_mesh &out = scene->meshes[scene->mesh_count++];
        out.name = in.keep(mesh.name);
        out.deformation = SCENE_NONE;
        out.subdivision_rules = subdivision_rules_read(in, i);
        out.first_primitive = static_cast<uint32_t>(list.size());
        for (size_t k = 0; k < mesh.primitives.size(); k++) {
            primitive_read(in, mesh.primitives[k], label("mesh", i, mesh.name) + " primitive " + std::to_string(k),
                           list);
        }
        out.primitive_count = static_cast<uint32_t>(list.size()) - out.first_primitive;
    }
    scene->primitives = in.allocate<mesh_primitive>(list.size());
    std::copy(list.begin(), list.end(), scene->primitives);
    scene->primitive_count = static_cast<uint32_t>(list.size());
    skipped_warn(in);
}

} // namespace gltf
