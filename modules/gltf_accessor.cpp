// glTF accessors. Every one is checked against its buffer view and buffer before any is read.
#include "gltf_import.hpp"

#include <algorithm>
#include <cstring>

namespace gltf
{

size_t index_size(int component_type)
{
    return component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE    ? 1
           : component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? 2
           : component_type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT   ? 4
                                                                      : 0;
}

namespace
{

// Elements that an accessor may claim without a buffer view behind them: they are zeros, and cost the file nothing.
const uint64_t UNBACKED_MAX = 1u << 20;

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

uint32_t index_load(const uint8_t *bytes, size_t size)
{
    uint32_t value = 0;
    memcpy(&value, bytes, size); // little endian, as this machine
    return value;
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
    default: // accessor_use lets only float through
        return static_cast<float>(component_load<float>(bytes));
    }
}

} // namespace

accessor_reader::accessor_reader(const importer &in, size_t index)
    : accessor(in.model.accessors[index]), size(element_size(accessor)),
      components(static_cast<uint32_t>(tinygltf::GetNumComponentsInType(static_cast<uint32_t>(accessor.type))))
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

void accessor_reader::numbers(uint32_t i, float *values) const
{
    const uint8_t *const from = element(i);
    for (uint32_t c = 0; c < components; c++) {
        values[c] = component_read(from + c * (size / components), accessor.componentType, accessor.normalized);
    }
}

uint32_t accessor_reader::integer(uint32_t i, uint32_t component) const
{
    return index_load(element(i) + component * (size / components), size / components);
}

uint32_t accessor_use(const importer &in, int accessor, const accessor_rule &rule, const std::string &where)
{
    const uint32_t index = index_check(accessor, in.model.accessors.size(), where, "accessor");
    const tinygltf::Accessor &used = in.model.accessors[index];
    const int type = used.componentType;
    const bool is_integer = type >= TINYGLTF_COMPONENT_TYPE_BYTE && type <= TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT;
    if (std::find(rule.types.begin(), rule.types.end(), used.type) == rule.types.end() ||
        !(type == TINYGLTF_COMPONENT_TYPE_FLOAT || (is_integer && (used.normalized || rule.may_be_integer)))) {
        fail("%s: accessor %u has the wrong type for %s (component type %d)", where.c_str(), index, rule.name, type);
    }
    return index;
}

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

} // namespace gltf
