// glTF skins, and the deformations: nodes whose meshes a skin or morph targets change.
#include "gltf_import.hpp"

#include <algorithm>
#include <cmath>

namespace gltf
{
namespace
{

const uint32_t JOINTS_MAX = UINT16_MAX + 1; // that scene_influences can name

// ---- Skins

// Whether all joints are in the scene that is loaded.
bool is_whole(const importer &in, const tinygltf::Skin &skin, const std::string &where)
{
    bool whole = true;
    for (const int joint : skin.joints) {
        whole = in.node_of[index_check(joint, in.node_of.size(), where, "joint node")] != SCENE_NONE && whole;
    }
    return whole;
}

void inverse_bind_read(const importer &in, int accessor, const std::string &where, uint32_t count, float (*out)[16])
{
    static const accessor_rule rule = {"inverseBindMatrices", {TINYGLTF_TYPE_MAT4}, false};
    const uint32_t index = accessor_use(in, accessor, rule, where);
    const accessor_reader reader(in, index);
    if (reader.accessor.count < count) {
        fail("%s: accessor %u has %zu inverse bind matrices, expected %u, one a joint", where.c_str(), index,
             reader.accessor.count, count);
    }
    for (uint32_t i = 0; i < count; i++) {
        reader.numbers(i, out[i]);
        if (!std::all_of(out[i], out[i] + 16, [](float value) { return std::isfinite(value); })) {
            fail("%s: the inverse bind matrix of joint %u (accessor %u) is not finite", where.c_str(), i, index);
        }
    }
}

scene_skin skin_read(importer &in, const tinygltf::Skin &source, const std::string &where)
{
    scene_skin skin = {};
    skin.name = in.keep(source.name);
    skin.joint_count = static_cast<uint32_t>(source.joints.size());
    uint32_t *const joints = in.allocate<uint32_t>(source.joints.size());
    for (size_t i = 0; i < source.joints.size(); i++) {
        joints[i] = in.node_of[static_cast<size_t>(source.joints[i])];
    }
    skin.joints = joints;
    auto *const matrices =
        static_cast<float(*)[16]>(arena_alloc(&in.scene->arena, source.joints.size() * sizeof(float[16])));
    for (size_t i = 0; i < source.joints.size(); i++) {
        matrices[i][0] = matrices[i][5] = matrices[i][10] = matrices[i][15] = 1;
    }
    if (source.inverseBindMatrices != -1) {
        inverse_bind_read(in, source.inverseBindMatrices, where, skin.joint_count, matrices);
    }
    skin.inverse_bind = matrices;
    return skin;
}

std::string node_label(const importer &in, uint32_t node)
{
    return label("node", in.source_of[node], in.scene->nodes[node].name);
}

// From glTF's skins to the scene's. A skin without a mesh means nothing.
void node_skins_find(importer &in, const std::vector<uint32_t> &skin_of)
{
    in.skin_of_mesh.assign(in.model.meshes.size(), SCENE_NONE);
    for (uint32_t i = 0; i < in.scene->node_count; i++) {
        scene_node &node = in.scene->nodes[i];
        if (node.skin == SCENE_NONE) {
            continue;
        }
        const uint32_t source = node.skin;
        node.skin = node.mesh == SCENE_NONE ? static_cast<uint32_t>(SCENE_NONE) : skin_of[source];
        if (node.skin != SCENE_NONE) {
            uint32_t &least = in.skin_of_mesh[node.mesh];
            const scene_skin *const skins = in.scene->skins;
            least = least == SCENE_NONE || skins[node.skin].joint_count < skins[least].joint_count ? node.skin : least;
        } else if (node.mesh != SCENE_NONE) {
            scene_warning(in.scene, "%s: a joint of skin %u is not in the scene; the skin has no effect",
                          node_label(in, i).c_str(), source);
        }
    }
}

// ---- Deformations

bool is_deformed(const importer &in, const scene_node &node)
{
    return node.mesh != SCENE_NONE && in.meshes[node.mesh].primitive_count > 0 &&
           (node.skin != SCENE_NONE || in.primitives[in.meshes[node.mesh].first_primitive].target_count > 0);
}

// Nodes whose meshes have no joints lose their skins.
void idle_skins_drop(importer &in)
{
    for (uint32_t i = 0; i < in.scene->node_count; i++) {
        scene_node &node = in.scene->nodes[i];
        const bool has_joints = is_deformed(in, node) && in.primitives[in.meshes[node.mesh].first_primitive].influences;
        if (node.skin != SCENE_NONE && !has_joints) {
            scene_warning(in.scene, "%s: its mesh has no joints; the skin has no effect", node_label(in, i).c_str());
            node.skin = SCENE_NONE;
        }
    }
}

// At rest: the node's, else its mesh's, else 0.
const float *weights_read(importer &in, uint32_t node, uint32_t mesh, uint32_t count)
{
    const std::vector<double> &own = in.model.nodes[in.source_of[node]].weights;
    const std::vector<double> &source = own.empty() ? in.model.meshes[mesh].weights : own;
    const std::string where = own.empty() ? label("mesh", mesh, in.model.meshes[mesh].name) : node_label(in, node);
    float *const weights = in.allocate<float>(count);
    if (!source.empty() && source.size() != count) {
        fail("%s has %zu weights, expected one for each of the %u morph targets", where.c_str(), source.size(), count);
    }
    for (size_t i = 0; i < source.size(); i++) {
        weights[i] = static_cast<float>(source[i]);
        if (!std::isfinite(weights[i])) {
            fail("%s: weight %zu is not finite", where.c_str(), i);
        }
    }
    return weights;
}

} // namespace

void skins_read(importer &in)
{
    std::vector<uint32_t> skin_of;
    in.scene->skins = in.allocate<scene_skin>(in.model.skins.size());
    for (size_t i = 0; i < in.model.skins.size(); i++) {
        const tinygltf::Skin &skin = in.model.skins[i];
        const std::string where = label("skin", i, skin.name);
        if (skin.joints.empty() || skin.joints.size() > JOINTS_MAX) {
            fail("%s has %zu joints, expected 1 to %u", where.c_str(), skin.joints.size(), JOINTS_MAX);
        }
        const bool usable = is_whole(in, skin, where);
        skin_of.push_back(usable ? in.scene->skin_count : static_cast<uint32_t>(SCENE_NONE));
        if (usable) {
            in.scene->skins[in.scene->skin_count++] = skin_read(in, skin, where);
        }
    }
    node_skins_find(in, skin_of);
}

void deformations_read(importer &in)
{
    scene_data *const scene = in.scene;
    idle_skins_drop(in);
    std::vector<char> taken(in.meshes.size());
    for (uint32_t i = 0; i < scene->node_count; i++) {
        const scene_node &node = scene->nodes[i];
        if (node.mesh != SCENE_NONE && !is_deformed(in, node)) {
            taken[node.mesh] = 1;
        }
    }
    scene->deformations = in.allocate<scene_deformation>(scene->node_count);
    for (uint32_t i = 0; i < scene->node_count; i++) {
        scene_node &node = scene->nodes[i];
        if (!is_deformed(in, node)) {
            continue;
        }
        const uint32_t source = node.mesh;
        scene_deformation deformation = {};
        deformation.node = i;
        deformation.skin = node.skin;
        deformation.target_count = in.primitives[in.meshes[source].first_primitive].target_count;
        deformation.weights = weights_read(in, i, source, deformation.target_count);
        // The first to come takes the mesh itself, unless it is drawn undeformed as well.
        deformation.mesh = node.mesh = taken[source] ? mesh_copy(in, source, node_label(in, i)) : source;
        taken[source] = 1;
        in.meshes[node.mesh].deformation = scene->deformation_count;
        scene->deformations[scene->deformation_count++] = deformation;
    }
}

} // namespace gltf
