// glTF animations: channels of the nodes that are loaded, and by KHR_animation_pointer those of lights and materials.
#include "gltf_import.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace gltf
{
namespace
{

// Numbers of keys in all, so that small files cannot ask for all memory by naming the same bytes many times.
const uint64_t NUMBERS_MAX = 1u << 26;

// ---- Targets

struct target_rule {
    const char *pointer; // {}: an index
    const char *path; // of a channel without pointer; NULL: only by pointer
    scene_target target;
    int type; // of the values
    uint32_t width; // 0: as many as the node has morph targets
};

const target_rule target_rules[] = {
    {"/nodes/{}/translation", "translation", SCENE_TRANSLATION, TINYGLTF_TYPE_VEC3, 3},
    {"/nodes/{}/rotation", "rotation", SCENE_ROTATION, TINYGLTF_TYPE_VEC4, 4},
    {"/nodes/{}/scale", "scale", SCENE_SCALE, TINYGLTF_TYPE_VEC3, 3},
    {"/nodes/{}/weights", "weights", SCENE_WEIGHTS, TINYGLTF_TYPE_SCALAR, 0},
    {"/extensions/KHR_lights_punctual/lights/{}/color", nullptr, SCENE_LIGHT_COLOR, TINYGLTF_TYPE_VEC3, 3},
    {"/extensions/KHR_lights_punctual/lights/{}/intensity", nullptr, SCENE_LIGHT_INTENSITY, TINYGLTF_TYPE_SCALAR, 1},
    {"/extensions/KHR_lights_punctual/lights/{}/spot/innerConeAngle", nullptr, SCENE_LIGHT_INNER_CONE,
     TINYGLTF_TYPE_SCALAR, 1},
    {"/extensions/KHR_lights_punctual/lights/{}/spot/outerConeAngle", nullptr, SCENE_LIGHT_OUTER_CONE,
     TINYGLTF_TYPE_SCALAR, 1},
    {"/materials/{}/pbrMetallicRoughness/baseColorFactor", nullptr, SCENE_BASE_COLOR, TINYGLTF_TYPE_VEC4, 4},
    {"/materials/{}/emissiveFactor", nullptr, SCENE_EMISSIVE_FACTOR, TINYGLTF_TYPE_VEC3, 3},
    {"/materials/{}/extensions/KHR_materials_emissive_strength/emissiveStrength", nullptr, SCENE_EMISSIVE_STRENGTH,
     TINYGLTF_TYPE_SCALAR, 1},
};

// The index that stands in `pointer` where `pattern` has {}; -1 when they differ elsewhere.
int pointer_match(const std::string &pointer, const std::string &pattern)
{
    const size_t hole = pattern.find("{}"), digits_max = 9;
    const std::string rest = pattern.substr(hole + 2);
    const size_t end = pointer.find_first_not_of("0123456789", hole);
    const bool matches = pointer.compare(0, hole, pattern, 0, hole) == 0 && end != std::string::npos && end > hole &&
                         end - hole <= digits_max && pointer.compare(end, std::string::npos, rest) == 0;
    return matches ? std::stoi(pointer.substr(hole, end - hole)) : -1;
}

// What a channel changes by glTF's numbers. `rule` is NULL for what is not supported.
struct channel_target {
    const target_rule *rule;
    int index;
};

channel_target pointer_find(const std::string &pointer)
{
    for (const target_rule &rule : target_rules) {
        const int index = pointer_match(pointer, rule.pointer);
        if (index >= 0) {
            return {&rule, index};
        }
    }
    return {nullptr, -1};
}

channel_target path_find(const std::string &path, int node)
{
    for (const target_rule &rule : target_rules) {
        if (rule.path && path == rule.path) {
            return {&rule, node};
        }
    }
    return {nullptr, -1};
}

// Empty where there is none.
std::string pointer_of(const tinygltf::AnimationChannel &channel)
{
    const auto extension = channel.target_extensions.find("KHR_animation_pointer");
    const bool has_pointer = extension != channel.target_extensions.end() && extension->second.Has("pointer") &&
                             extension->second.Get("pointer").IsString();
    return has_pointer ? extension->second.Get("pointer").Get<std::string>() : "";
}

void channel_skip(importer &in, const std::string &where, const std::string &why)
{
    if (in.skipped_channels++ == 0) {
        in.skipped_channel = where + ": " + why;
    }
}

uint32_t node_targets(const importer &in, const scene_node &node)
{
    const uint32_t deformation = node.mesh == SCENE_NONE ? SCENE_NONE : in.scene->meshes[node.mesh].deformation;
    return deformation == SCENE_NONE ? 0 : in.scene->deformations[deformation].target_count;
}

// Fills in target, index and width; false for what the scene does not have, which is counted.
bool node_resolve(importer &in, const channel_target &target, const std::string &where, scene_channel &out)
{
    out.index = in.node_of[index_check(target.index, in.node_of.size(), where, "node")];
    if (out.index == SCENE_NONE) {
        channel_skip(in, where, "its node is not in the scene");
        return false;
    }
    const scene_node &node = in.scene->nodes[out.index];
    const bool is_weights = target.rule->target == SCENE_WEIGHTS;
    out.width = is_weights ? node_targets(in, node) : target.rule->width;
    if (out.width == 0) {
        channel_skip(in, where, "its node has no morph targets");
    } else if (!is_weights && !node.has_trs) {
        channel_skip(in, where, "its node has a matrix, which cannot be animated");
    }
    return out.width > 0 && (is_weights || node.has_trs);
}

bool target_resolve(importer &in, const channel_target &target, const std::string &where, scene_channel &out)
{
    out.target = target.rule->target;
    out.width = target.rule->width;
    if (out.target <= SCENE_WEIGHTS) {
        return node_resolve(in, target, where, out);
    }
    if (out.target <= SCENE_LIGHT_OUTER_CONE) {
        out.index = in.light_of[index_check(target.index, in.light_of.size(), where, "light")];
        if (out.index == SCENE_NONE) {
            channel_skip(in, where, "its light is of an unknown type");
        }
        return out.index != SCENE_NONE;
    }
    out.index = index_check(target.index, in.model.materials.size(), where, "material");
    return true;
}

// ---- Samplers

scene_interpolation interpolation_of(const std::string &name, const std::string &where)
{
    static const struct {
        const char *name;
        scene_interpolation interpolation;
    } names[] = {{"STEP", SCENE_STEP}, {"LINEAR", SCENE_LINEAR}, {"CUBICSPLINE", SCENE_CUBIC}};
    for (const auto &known : names) {
        if (name == known.name) {
            return known.interpolation;
        }
    }
    fail("%s has the interpolation \"%.32s\", expected STEP, LINEAR or CUBICSPLINE", where.c_str(), name.c_str());
}

float *numbers_allocate(importer &in, uint64_t count, const std::string &where)
{
    in.animated_numbers += count;
    if (in.animated_numbers > NUMBERS_MAX) {
        fail("%s: more than %llu numbers of keys in all", where.c_str(), static_cast<unsigned long long>(NUMBERS_MAX));
    }
    return in.allocate<float>(count);
}

// False, and counted, where keys do not follow each other.
bool times_read(importer &in, int accessor, const std::string &where, scene_channel &out)
{
    static const accessor_rule rule = {"input", {TINYGLTF_TYPE_SCALAR}, false};
    const uint32_t index = accessor_use(in, accessor, rule, where);
    const accessor_reader reader(in, index);
    if (reader.accessor.count == 0) {
        fail("%s: accessor %u has no keys", where.c_str(), index);
    }
    float *const times = numbers_allocate(in, reader.accessor.count, where);
    for (uint32_t i = 0; i < reader.accessor.count; i++) {
        reader.numbers(i, &times[i]);
        if (!(times[i] >= 0 && std::isfinite(times[i]))) {
            fail("%s: key %u (accessor %u) is at %g s, expected 0 or more", where.c_str(), i, index,
                 static_cast<double>(times[i]));
        }
        if (i > 0 && times[i] <= times[i - 1]) {
            channel_skip(in, where, "key " + std::to_string(i) + " is not after the key before it");
            return false;
        }
    }
    out.times = times;
    out.key_count = static_cast<uint32_t>(reader.accessor.count);
    return true;
}

// Unit quaternions where they are interpolated as such; splines are normalised when they have been evaluated.
void rotations_normalize(float *values, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        float *const q = values + 4 * i;
        double length = 0;
        for (int k = 0; k < 4; k++) {
            length += static_cast<double>(q[k]) * static_cast<double>(q[k]);
        }
        length = std::sqrt(length);
        for (int k = 0; k < 4; k++) {
            q[k] = length > 1e-20 ? static_cast<float>(static_cast<double>(q[k]) / length) : k == 3 ? 1.0f : 0.0f;
        }
    }
}

void values_read(importer &in, int accessor, const std::string &where, int type, scene_channel &out)
{
    const accessor_rule rule = {"output", {type}, false};
    const uint32_t index = accessor_use(in, accessor, rule, where);
    const accessor_reader reader(in, index);
    const uint64_t parts = out.interpolation == SCENE_CUBIC ? 3 : 1;
    const uint64_t numbers = uint64_t(out.key_count) * parts * out.width, expected = numbers / reader.components;
    if (reader.accessor.count != expected) {
        fail("%s: accessor %u has %zu values, expected %llu for %u keys", where.c_str(), index, reader.accessor.count,
             static_cast<unsigned long long>(expected), out.key_count);
    }
    float *const values = numbers_allocate(in, numbers, where);
    for (uint64_t i = 0; i < expected; i++) {
        reader.numbers(static_cast<uint32_t>(i), values + i * reader.components);
    }
    const float *const bad = std::find_if_not(values, values + numbers, [](float v) { return std::isfinite(v); });
    if (bad != values + numbers) {
        fail("%s: value %lld (accessor %u) is not finite", where.c_str(),
             static_cast<long long>((bad - values) / reader.components), index);
    }
    if (out.target == SCENE_ROTATION && out.interpolation != SCENE_CUBIC) {
        rotations_normalize(values, out.key_count);
    }
    out.values = values;
}

// ---- Animations

bool channel_read(importer &in, const tinygltf::Animation &animation, size_t channel, const std::string &where,
                  scene_channel &out)
{
    const tinygltf::AnimationChannel &source = animation.channels[channel];
    const std::string here = where + " channel " + std::to_string(channel);
    const uint32_t sampler = index_check(source.sampler, animation.samplers.size(), here, "sampler");
    const bool by_pointer = source.target_path == "pointer";
    if (!by_pointer && source.target_node == -1) {
        channel_skip(in, here, "it has no node");
        return false;
    }
    const std::string path = by_pointer ? pointer_of(source) : source.target_path;
    const channel_target target = by_pointer ? pointer_find(path) : path_find(path, source.target_node);
    if (!target.rule) {
        channel_skip(in, here, "\"" + path.substr(0, 100) + "\" cannot be animated");
        return false;
    }
    if (!target_resolve(in, target, here, out)) {
        return false;
    }
    const tinygltf::AnimationSampler &from = animation.samplers[sampler];
    const std::string there = where + " sampler " + std::to_string(sampler);
    out.interpolation = interpolation_of(from.interpolation, there);
    if (!times_read(in, from.input, there, out)) {
        return false;
    }
    values_read(in, from.output, there, target.rule->type, out);
    return true;
}

scene_animation animation_read(importer &in, const tinygltf::Animation &source, const std::string &where)
{
    scene_animation animation = {};
    animation.name = in.keep(source.name);
    scene_channel *const channels = in.allocate<scene_channel>(source.channels.size());
    for (size_t i = 0; i < source.channels.size(); i++) {
        scene_channel channel = {};
        if (channel_read(in, source, i, where, channel)) {
            channels[animation.channel_count++] = channel;
            animation.duration = std::max(animation.duration, channel.times[channel.key_count - 1]);
        }
    }
    animation.channels = channels;
    return animation;
}

} // namespace

void animations_read(importer &in)
{
    scene_data *const scene = in.scene;
    scene->animations = in.allocate<scene_animation>(in.model.animations.size());
    for (size_t i = 0; i < in.model.animations.size(); i++) {
        const tinygltf::Animation &source = in.model.animations[i];
        scene->animations[scene->animation_count++] = animation_read(in, source, label("animation", i, source.name));
    }
    if (in.skipped_channels > 0) {
        scene_warning(scene, "%u animation channels are left out; the first is %s", in.skipped_channels,
                      in.skipped_channel.c_str());
    }
}

} // namespace gltf
