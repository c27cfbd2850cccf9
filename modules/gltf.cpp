// The entry to the glTF import: tinygltf's model to a scene_data. Here extensions, nodes, cameras and lights; the rest
// has files of its own.
#include "gltf_import.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

namespace gltf
{

void fail(const char *format, ...)
{
    char message[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof(message), format, arguments);
    va_end(arguments);
    throw std::runtime_error(message);
}

uint32_t index_check(int index, size_t count, const std::string &where, const char *what)
{
    if (index < 0 || static_cast<size_t>(index) >= count) {
        fail("%s: %s %d does not exist, there are %zu", where.c_str(), what, index, count);
    }
    return static_cast<uint32_t>(index);
}

std::string label(const char *kind, size_t index, const std::string &name)
{
    const std::string plain = std::string(kind) + " " + std::to_string(index);
    return name.empty() ? plain : plain + " \"" + name.substr(0, 100) + "\"";
}

double number_of(const tinygltf::Value &object, const char *key, double fallback)
{
    const tinygltf::Value *const value = object.Has(key) ? &object.Get(key) : nullptr;
    return value && value->IsNumber() ? value->GetNumberAsDouble() : fallback;
}

importer::~importer()
{
    for (gltf_primitive &primitive : primitives) {
        gltf_primitive_free(&primitive);
    }
}

namespace
{

// ---- Extensions

const char *const supported_extensions[] = {"KHR_lights_punctual", "KHR_materials_emissive_strength",
                                            "KHR_texture_transform", "KHR_mesh_quantization", "KHR_animation_pointer"};

bool is_supported(const std::string &name)
{
    return std::find(std::begin(supported_extensions), std::end(supported_extensions), name) !=
           std::end(supported_extensions);
}

// Known to change no more than the look of a surface: the plain material stands in, even where they are required.
bool is_ignored_material(const std::string &name)
{
    return name.rfind("KHR_materials_", 0) == 0;
}

std::string joined(const std::vector<std::string> &names)
{
    std::string text;
    for (const std::string &name : names) {
        text += (text.empty() ? "" : ", ") + name;
    }
    return text;
}

void extensions_check(importer &in)
{
    for (const std::string &name : in.model.extensionsRequired) {
        if (!is_supported(name) && !is_ignored_material(name)) {
            fail("requires the extension %s, which is not supported", name.c_str());
        }
    }
    std::vector<std::string> ignored, unknown;
    for (const std::string &name : in.model.extensionsUsed) {
        std::vector<std::string> &list = is_ignored_material(name) ? ignored : unknown;
        if (!is_supported(name) && std::find(list.begin(), list.end(), name) == list.end()) {
            list.push_back(name);
        }
    }
    if (!ignored.empty()) {
        scene_warning(in.scene, "material extensions without effect: %s", joined(ignored).c_str());
    }
    if (!unknown.empty()) {
        scene_warning(in.scene, "unknown optional extensions, ignored: %s", joined(unknown).c_str());
    }
}

// ---- Lights

uint32_t light_type(const std::string &type)
{
    return type == "point"         ? LIGHT_POINT
           : type == "spot"        ? LIGHT_SPOT
           : type == "directional" ? LIGHT_DIRECTIONAL
                                   : SCENE_NONE;
}

scene_light light_read(importer &in, const tinygltf::Light &light, const std::string &where)
{
    scene_light result = {};
    result.name = in.keep(light.name);
    result.type = light_type(light.type);
    if (!light.color.empty() && light.color.size() != 3) {
        fail("%s: color has %zu numbers, expected 3", where.c_str(), light.color.size());
    }
    for (size_t i = 0; i < 3; i++) {
        const double value = light.intensity * (light.color.empty() ? 1.0 : light.color[i]);
        if (!(value >= 0 && value < 1e30)) {
            fail("%s: color times intensity is %g, expected 0 to 1e30", where.c_str(), value);
        }
        result.color[i] = static_cast<float>(value);
        result.hue[i] = static_cast<float>(light.color.empty() ? 1.0 : light.color[i]);
    }
    result.intensity = static_cast<float>(light.intensity);
    const double inner = light.spot.innerConeAngle, outer = light.spot.outerConeAngle;
    if (result.type == LIGHT_SPOT && !(inner >= 0 && inner < outer && outer <= M_PI_2 + 1e-6)) {
        fail("%s: cone angles %g and %g, expected 0 <= inner < outer <= pi/2", where.c_str(), inner, outer);
    }
    result.inner_cone = static_cast<float>(inner);
    result.outer_cone = static_cast<float>(outer);
    return result;
}

void lights_read(importer &in)
{
    in.scene->lights = in.allocate<scene_light>(in.model.lights.size());
    for (size_t i = 0; i < in.model.lights.size(); i++) {
        const tinygltf::Light &light = in.model.lights[i];
        const std::string where = label("light", i, light.name);
        if (light_type(light.type) == SCENE_NONE) {
            scene_warning(in.scene, "%s has the unknown type \"%.50s\" and is left out", where.c_str(),
                          light.type.c_str());
            in.light_of.push_back(SCENE_NONE);
            continue;
        }
        in.light_of.push_back(in.scene->light_count);
        in.scene->lights[in.scene->light_count++] = light_read(in, light, where);
    }
}

// ---- Nodes

// By glTF's numbers: each node's parent, -1 for a root. Refuses children with two parents, and cycles.
std::vector<int> parents_find(const tinygltf::Model &model)
{
    std::vector<int> parents(model.nodes.size(), -1);
    for (size_t i = 0; i < model.nodes.size(); i++) {
        const std::string where = label("node", i, model.nodes[i].name);
        for (const int child : model.nodes[i].children) {
            int &parent = parents[index_check(child, parents.size(), where, "child node")];
            if (parent >= 0) {
                fail("node %d has two parents, nodes %d and %zu", child, parent, i);
            }
            parent = static_cast<int>(i);
        }
    }
    return parents;
}

// With one parent at most for each node, what cannot be reached from a root lies on a cycle.
void cycles_check(const tinygltf::Model &model, const std::vector<int> &parents)
{
    std::vector<char> reached(parents.size());
    std::vector<int> open;
    for (size_t i = 0; i < parents.size(); i++) {
        if (parents[i] < 0) {
            open.push_back(static_cast<int>(i));
        }
    }
    while (!open.empty()) {
        const size_t node = static_cast<size_t>(open.back());
        open.pop_back();
        reached[node] = 1;
        open.insert(open.end(), model.nodes[node].children.begin(), model.nodes[node].children.end());
    }
    const size_t first = static_cast<size_t>(std::find(reached.begin(), reached.end(), 0) - reached.begin());
    if (first < reached.size()) {
        fail("%s is part of a cycle in the node tree", label("node", first, model.nodes[first].name).c_str());
    }
}

std::vector<int> roots_find(const importer &in, const std::vector<int> &parents)
{
    const tinygltf::Model &model = in.model;
    std::vector<int> roots;
    if (model.scenes.empty() && model.defaultScene == -1) {
        for (size_t i = 0; i < parents.size(); i++) {
            if (parents[i] < 0) {
                roots.push_back(static_cast<int>(i));
            }
        }
        return roots;
    }
    const uint32_t scene =
        model.defaultScene == -1 ? 0 : index_check(model.defaultScene, model.scenes.size(), "file", "scene");
    std::vector<char> listed(parents.size());
    for (const int node : model.scenes[scene].nodes) {
        const std::string where = label("scene", scene, model.scenes[scene].name);
        const uint32_t index = index_check(node, parents.size(), where, "node");
        if (parents[index] >= 0) {
            fail("%s: node %d is not a root, its parent is node %d", where.c_str(), node, parents[index]);
        }
        if (!listed[index]) {
            roots.push_back(node);
        }
        listed[index] = 1;
    }
    return roots;
}

template <size_t N>
void numbers_copy(float (&out)[N], const std::vector<double> &in, const std::string &where, const char *what)
{
    if (in.size() != N) {
        fail("%s: %s has %zu numbers, expected %zu", where.c_str(), what, in.size(), N);
    }
    for (size_t i = 0; i < N; i++) {
        out[i] = static_cast<float>(in[i]);
        if (!std::isfinite(out[i])) {
            fail("%s: %s is not finite", where.c_str(), what);
        }
    }
}

// Unit quaternion; the identity instead of one without direction.
void rotation_repair(float (&q)[4])
{
    const double length =
        std::sqrt(double(q[0]) * q[0] + double(q[1]) * q[1] + double(q[2]) * q[2] + double(q[3]) * q[3]);
    for (float &component : q) {
        component = length > 1e-20 ? static_cast<float>(component / length) : (&component == &q[3] ? 1.0f : 0.0f);
    }
}

void transform_read(scene_node &out, const tinygltf::Node &node, const std::string &where)
{
    out.rotation[3] = out.scale[0] = out.scale[1] = out.scale[2] = 1;
    if (!node.matrix.empty()) {
        numbers_copy(out.matrix, node.matrix, where, "matrix");
        return;
    }
    out.has_trs = true;
    if (!node.translation.empty()) {
        numbers_copy(out.translation, node.translation, where, "translation");
    }
    if (!node.rotation.empty()) {
        numbers_copy(out.rotation, node.rotation, where, "rotation");
        rotation_repair(out.rotation);
    }
    if (!node.scale.empty()) {
        numbers_copy(out.scale, node.scale, where, "scale");
    }
    scene_matrix_compose(out.translation, out.rotation, out.scale, out.matrix);
}

uint32_t node_light(const importer &in, const tinygltf::Node &node, const std::string &where)
{
    const auto extension = node.extensions.find("KHR_lights_punctual");
    if (extension == node.extensions.end() || !extension->second.Has("light")) {
        return SCENE_NONE;
    }
    const double light = number_of(extension->second, "light", -1);
    return in.light_of[index_check(light >= 0 && light < 1e9 ? static_cast<int>(light) : -1, in.model.lights.size(),
                                   where, "light")];
}

// Its skin is glTF's.
scene_node node_read(importer &in, size_t index)
{
    const tinygltf::Node &node = in.model.nodes[index];
    const std::string where = label("node", index, node.name);
    scene_node result = {};
    result.name = in.keep(node.name);
    transform_read(result, node, where);
    result.mesh = node.mesh == -1 ? SCENE_NONE : index_check(node.mesh, in.model.meshes.size(), where, "mesh");
    result.camera = node.camera == -1 ? SCENE_NONE : index_check(node.camera, in.model.cameras.size(), where, "camera");
    result.light = node_light(in, node, where);
    result.skin = node.skin == -1 ? SCENE_NONE : index_check(node.skin, in.model.skins.size(), where, "skin");
    return result;
}

// All nodes are checked; those of the default scene are kept, parents first.
void nodes_read(importer &in)
{
    const tinygltf::Model &model = in.model;
    const std::vector<int> parents = parents_find(model);
    cycles_check(model, parents);
    std::vector<scene_node> nodes;
    for (size_t i = 0; i < model.nodes.size(); i++) {
        nodes.push_back(node_read(in, i));
    }

    // Depth first; pushed in reverse, so that siblings keep their order.
    std::vector<int> open = roots_find(in, parents);
    std::reverse(open.begin(), open.end());
    in.node_of.assign(nodes.size(), SCENE_NONE);
    in.scene->nodes = in.allocate<scene_node>(nodes.size());
    while (!open.empty()) {
        const size_t node = static_cast<size_t>(open.back());
        open.pop_back();
        open.insert(open.end(), model.nodes[node].children.rbegin(), model.nodes[node].children.rend());
        in.node_of[node] = in.scene->node_count;
        in.source_of.push_back(static_cast<uint32_t>(node));
        nodes[node].parent = parents[node] < 0 ? SCENE_NONE : in.node_of[static_cast<size_t>(parents[node])];
        in.scene->nodes[in.scene->node_count++] = nodes[node];
    }
}

// ---- Cameras

bool camera_read(importer &in, const tinygltf::Camera &camera, const std::string &where, scene_camera &out)
{
    const bool orthographic = camera.type == "orthographic";
    const double yfov = orthographic ? M_PI / 4 : camera.perspective.yfov;
    const double znear = orthographic ? camera.orthographic.znear : camera.perspective.znear;
    if (orthographic) {
        scene_warning(in.scene, "%s is orthographic and is read as a perspective one of 45 degrees", where.c_str());
    }
    if (!(yfov > 0 && yfov < M_PI)) {
        scene_warning(in.scene, "%s has yfov %g, expected more than 0 and less than pi; it is left out", where.c_str(),
                      yfov);
        return false;
    }
    out.yfov = static_cast<float>(yfov);
    out.near_plane = znear > 1e-6 && znear < 1e6 ? static_cast<float>(znear) : 0.01f;
    return true;
}

// One scene_camera for each node that carries one, in the nodes' order; the nodes' camera indices follow.
void cameras_read(importer &in)
{
    scene_data *const scene = in.scene;
    scene->cameras = in.allocate<scene_camera>(scene->node_count);
    for (uint32_t i = 0; i < scene->node_count; i++) {
        scene_node &node = scene->nodes[i];
        if (node.camera == SCENE_NONE) {
            continue;
        }
        const tinygltf::Camera &camera = in.model.cameras[node.camera];
        scene_camera result = {};
        result.node = i;
        result.name = camera.name.empty() ? node.name : in.keep(camera.name);
        const bool usable = camera_read(in, camera, label("camera", node.camera, camera.name), result);
        node.camera = usable ? scene->camera_count : static_cast<uint32_t>(SCENE_NONE);
        if (usable) {
            scene->cameras[scene->camera_count++] = result;
        }
    }
}

// ---- The whole

// tinygltf collects lines; the last is what made it stop.
std::string last_line(const std::string &text)
{
    const size_t end = text.find_last_not_of(" \n");
    const size_t start = end == std::string::npos ? end : text.rfind('\n', end);
    return end == std::string::npos ? "" : text.substr(start == std::string::npos ? 0 : start + 1, end - start);
}

void model_parse(importer &in)
{
    tinygltf::TinyGLTF parser;
    std::string error, warning;
    const std::string json = in.file.json;
    if (json.size() > UINT32_MAX) {
        fail("its JSON has %zu bytes, expected at most 4 GiB", json.size());
    }
    // Errors beside success are about parts that tinygltf drops, all of which this renderer can do without.
    if (!parser.LoadASCIIFromString(&in.model, &error, &warning, json.c_str(), static_cast<unsigned>(json.size()),
                                    "")) {
        fail("%s", error.empty() ? "not a valid glTF file" : last_line(error).c_str());
    }
}

void import_run(importer &in)
{
    model_parse(in);
    extensions_check(in);
    views_check(in);
    accessors_check(in);
    lights_read(in);
    nodes_read(in);
    cameras_read(in);
    materials_read(in);
    skins_read(in);
    meshes_read(in);
    deformations_read(in);
    meshes_keep(in);
    animations_read(in);
    images_load(in);
}

bool import_file(const gltf_file &file, scene_data *scene, gltf_primitive **primitives)
{
    importer in(file, scene);
    import_run(in);
    *primitives = static_cast<gltf_primitive *>(memory_alloc(in.primitives.size() * sizeof(gltf_primitive)));
    std::copy(in.primitives.begin(), in.primitives.end(), *primitives);
    in.primitives.clear();
    return true;
}

} // namespace
} // namespace gltf

extern "C" void gltf_primitive_free(gltf_primitive *primitive)
{
    free(primitive->positions);
    free(primitive->attributes);
    free(primitive->indices);
    free(primitive->influences);
    free(primitive->morphs);
    free(primitive->tags);
}

extern "C" bool gltf_import(const char *path, scene_data *scene, gltf_primitive **primitives)
{
    gltf_file file = {};
    bool ok = false;
    try {
        ok = gltf_file_open(&file, path) && gltf::import_file(file, scene, primitives);
    } catch (const std::exception &error) {
        // An empty message: the reason has been logged where it was found.
        ok = *error.what() && gltf_fail(&file, "%s", error.what());
    }
    gltf_file_close(&file);
    return ok;
}
