// glTF materials, textures and the images that they use.
#include "gltf_import.hpp"

#include <algorithm>
#include <cmath>

namespace gltf
{
namespace
{

// ---- Textures

uint32_t image_use(importer &in, const tinygltf::Texture &texture, const std::string &where)
{
    const uint32_t image = index_check(texture.source, in.file.image_count, where, "image");
    in.image_of.resize(in.file.image_count, SCENE_NONE);
    if (in.image_of[image] == SCENE_NONE) {
        in.image_of[image] = static_cast<uint32_t>(in.used_images.size());
        in.used_images.push_back(image);
    }
    return in.image_of[image];
}

scene_texture texture_read(importer &in, const tinygltf::Texture &texture, const std::string &where, bool srgb)
{
    scene_texture result = {};
    result.image = image_use(in, texture, where);
    result.srgb = srgb;
    if (texture.sampler != -1) {
        const tinygltf::Sampler &sampler =
            in.model.samplers[index_check(texture.sampler, in.model.samplers.size(), where, "sampler")];
        result.mag_filter = std::max(sampler.magFilter, 0);
        result.min_filter = std::max(sampler.minFilter, 0);
        result.wrap_s = std::max(sampler.wrapS, 0);
        result.wrap_t = std::max(sampler.wrapT, 0);
    }
    return result;
}

// An image is stored as sRGB or linear: used both ways, it becomes two textures.
uint32_t texture_use(importer &in, uint32_t index, bool srgb)
{
    const tinygltf::Texture &texture = in.model.textures[index];
    const std::string where = label("texture", index, texture.name);
    std::vector<uint32_t> &texture_of = in.texture_of[srgb];
    texture_of.resize(in.model.textures.size(), SCENE_NONE);
    if (texture.source == -1) {
        in.textures_without_image++;
        return TEXTURE_NONE;
    }
    if (texture_of[index] == SCENE_NONE) {
        texture_of[index] = static_cast<uint32_t>(in.textures.size());
        in.textures.push_back(texture_read(in, texture, where, srgb));
    }
    return texture_of[index];
}

double element_of(const tinygltf::Value &object, const char *key, int index, double fallback)
{
    const tinygltf::Value *const array = object.Has(key) ? &object.Get(key) : nullptr;
    const bool usable =
        array && array->IsArray() && static_cast<int>(array->ArrayLen()) > index && array->Get(index).IsNumber();
    return usable ? array->Get(index).GetNumberAsDouble() : fallback;
}

// KHR_texture_transform: translation * rotation * scale. A positive angle turns (u, v) to (cu + sv, cv - su), as
// Khronos's TextureTransformTest and its sample viewer have it; the GLSL in the extension's text has the other sign.
void transform_apply(texture_reference &reference, const tinygltf::Value &transform)
{
    const double angle = number_of(transform, "rotation", 0), c = std::cos(angle), s = std::sin(angle);
    const double scale_u = element_of(transform, "scale", 0, 1), scale_v = element_of(transform, "scale", 1, 1);
    const double columns[4] = {c * scale_u, -s * scale_u, s * scale_v, c * scale_v};
    for (int i = 0; i < 4; i++) {
        reference.transform[i] = static_cast<float>(columns[i]);
    }
    reference.offset[0] = static_cast<float>(element_of(transform, "offset", 0, 0));
    reference.offset[1] = static_cast<float>(element_of(transform, "offset", 1, 0));
}

uint32_t uv_set_check(importer &in, double uv_set, const std::string &where)
{
    if (uv_set >= 0 && uv_set <= 1) {
        return static_cast<uint32_t>(uv_set);
    }
    if (!in.uv_set_warned) {
        scene_warning(in.scene, "%s uses texture coordinates %g: sets 0 and 1 are read, 0 stands in", where.c_str(),
                      uv_set);
        in.uv_set_warned = true;
    }
    return 0;
}

texture_reference reference_none()
{
    texture_reference reference = {};
    reference.texture = TEXTURE_NONE;
    reference.transform[0] = reference.transform[3] = 1;
    return reference;
}

// For TextureInfo and NormalTextureInfo, which share no base.
template <typename T> texture_reference reference_read(importer &in, const T &info, bool srgb, const std::string &where)
{
    texture_reference reference = reference_none();
    if (info.index == -1) {
        return reference;
    }
    const uint32_t texture = index_check(info.index, in.model.textures.size(), where, "texture");
    double uv_set = info.texCoord;
    const auto extension = info.extensions.find("KHR_texture_transform");
    if (extension != info.extensions.end()) {
        transform_apply(reference, extension->second);
        uv_set = number_of(extension->second, "texCoord", uv_set);
    }
    reference.uv_set = uv_set_check(in, uv_set, where);
    reference.texture = texture_use(in, texture, srgb);
    return reference;
}

// ---- Materials

material material_default()
{
    material result = {};
    std::fill_n(result.base_color, 4, 1.0f);
    result.alpha_cutoff = 0.5f;
    result.normal_scale = 1;
    result.metallic = result.roughness = 1;
    result.base_texture = result.emissive_texture = result.normal_texture = result.metallic_roughness_texture =
        reference_none();
    return result;
}

float factor_check(double value, const std::string &where, const char *what)
{
    if (!(value >= 0 && value < 1e30)) {
        fail("%s: %s is %g, expected 0 or more", where.c_str(), what, value);
    }
    return static_cast<float>(value);
}

uint32_t alpha_flags(const tinygltf::Material &in, float &cutoff, uint32_t &blended)
{
    if (in.alphaMode == "BLEND") {
        cutoff = 0.5f;
        blended++;
    }
    return in.alphaMode == "MASK" || in.alphaMode == "BLEND" ? MATERIAL_ALPHA_MASK : 0;
}

double strength_of(const tinygltf::Material &source)
{
    const auto extension = source.extensions.find("KHR_materials_emissive_strength");
    return extension == source.extensions.end() ? 1 : number_of(extension->second, "emissiveStrength", 1);
}

// After material_read, which has checked the product.
scene_emission emission_read(const tinygltf::Material &source)
{
    scene_emission emission = {};
    emission.strength = static_cast<float>(strength_of(source));
    for (size_t i = 0; i < std::min<size_t>(3, source.emissiveFactor.size()); i++) {
        emission.factor[i] = static_cast<float>(source.emissiveFactor[i]);
    }
    return emission;
}

material material_read(importer &in, size_t index, uint32_t &blended)
{
    const tinygltf::Material &source = in.model.materials[index];
    const std::string where = label("material", index, source.name);
    const tinygltf::PbrMetallicRoughness &pbr = source.pbrMetallicRoughness;
    material result = material_default();
    for (size_t i = 0; i < std::min<size_t>(4, pbr.baseColorFactor.size()); i++) {
        result.base_color[i] = factor_check(pbr.baseColorFactor[i], where, "baseColorFactor");
    }
    const double strength = strength_of(source);
    for (size_t i = 0; i < std::min<size_t>(3, source.emissiveFactor.size()); i++) {
        result.emissive[i] = factor_check(source.emissiveFactor[i] * strength, where, "emissiveFactor times strength");
    }
    result.alpha_cutoff = factor_check(source.alphaCutoff, where, "alphaCutoff");
    result.flags = alpha_flags(source, result.alpha_cutoff, blended) | (source.doubleSided ? MATERIAL_DOUBLE_SIDED : 0);
    result.normal_scale = static_cast<float>(source.normalTexture.scale);
    result.metallic = factor_check(pbr.metallicFactor, where, "metallicFactor");
    result.roughness = factor_check(pbr.roughnessFactor, where, "roughnessFactor");
    result.base_texture = reference_read(in, pbr.baseColorTexture, true, where);
    result.emissive_texture = reference_read(in, source.emissiveTexture, true, where);
    result.normal_texture = reference_read(in, source.normalTexture, false, where);
    result.metallic_roughness_texture = reference_read(in, pbr.metallicRoughnessTexture, false, where);
    if (source.occlusionTexture.index != -1) { // not used, but checked
        index_check(source.occlusionTexture.index, in.model.textures.size(), where, "texture");
    }
    return result;
}

} // namespace

void materials_read(importer &in)
{
    scene_data *const scene = in.scene;
    const size_t count = in.model.materials.size();
    scene->materials = in.allocate<material>(count + 1);
    scene->material_names = in.allocate<const char *>(count + 1);
    scene->emissions = in.allocate<scene_emission>(count + 1);
    uint32_t blended = 0;
    for (size_t i = 0; i < count; i++) {
        scene->materials[i] = material_read(in, i, blended);
        scene->emissions[i] = emission_read(in.model.materials[i]);
        scene->material_names[i] = in.keep(in.model.materials[i].name);
    }
    scene->materials[count] = material_default();
    scene->emissions[count].strength = 1;
    scene->material_names[count] = "default";
    scene->material_count = static_cast<uint32_t>(count + 1);
    if (blended > 0) {
        scene_warning(scene, "%u materials blend; they are treated as alpha masks with cutoff 0.5", blended);
    }
    if (in.textures_without_image > 0) {
        scene_warning(scene, "%u uses of textures without a PNG or JPEG image are left out", in.textures_without_image);
    }
    scene->textures = in.allocate<scene_texture>(in.textures.size());
    std::copy(in.textures.begin(), in.textures.end(), scene->textures);
    scene->texture_count = static_cast<uint32_t>(in.textures.size());
}

void images_load(importer &in)
{
    scene_data *const scene = in.scene;
    const size_t count = in.used_images.size();
    scene->images = in.allocate<scene_image>(count);
    scene->image_count = static_cast<uint32_t>(count);
    std::vector<const gltf_image_source *> sources;
    std::vector<gltf_bytes> encoded;
    for (size_t i = 0; i < count; i++) {
        const gltf_image_source &source = in.file.images[in.used_images[i]];
        scene->images[i].name = in.keep(source.name);
        if (!source.uri && source.view == SCENE_NONE) {
            fail("%s has neither a URI nor a buffer view", source.label);
        }
        sources.push_back(&source);
        encoded.push_back(source.uri ? gltf_bytes{} : view_bytes(in, source.view));
    }
    if (!gltf_images_decode(&in.file, sources.data(), encoded.data(), scene->image_count, scene->images)) {
        throw std::runtime_error(""); // logged
    }
}

} // namespace gltf
