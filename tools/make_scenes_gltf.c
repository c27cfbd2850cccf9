// Writes binary glTF 2.0; see the header.
#include "tools/make_scenes_gltf.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ARRAY_BUFFER = 34962, ELEMENT_ARRAY_BUFFER = 34963, FLOAT = 5126, UNSIGNED_INT = 5125 };

struct gltf_file {
    cJSON *root;
    cJSON *scene_nodes, *nodes, *meshes, *materials, *textures, *images, *accessors, *views, *cameras, *lights;
    uint8_t *binary;
    size_t binary_size, binary_capacity;
    size_t triangle_count;
};

static cJSON *numbers(const float *values, int count)
{
    return cJSON_CreateFloatArray(values, count);
}

static cJSON *vec3_json(vec3 v)
{
    return numbers((const float[3]){v.x, v.y, v.z}, 3);
}

// Appends an empty object and returns it.
static cJSON *object_append(cJSON *array)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddItemToArray(array, object);
    return object;
}

static cJSON *reference_add(cJSON *object, const char *key, uint32_t id)
{
    cJSON *reference = cJSON_AddObjectToObject(object, key);
    cJSON_AddNumberToObject(reference, "index", id - 1);
    return reference;
}

gltf_file *gltf_create(void)
{
    gltf_file *file = memory_alloc(sizeof *file);
    file->root = cJSON_CreateObject();
    cJSON *asset = cJSON_AddObjectToObject(file->root, "asset");
    cJSON_AddStringToObject(asset, "version", "2.0");
    cJSON_AddStringToObject(asset, "generator", "lanternfield make_scenes");
    cJSON_AddItemToArray(cJSON_AddArrayToObject(file->root, "extensionsUsed"),
                         cJSON_CreateString("KHR_lights_punctual"));
    cJSON_AddNumberToObject(file->root, "scene", 0);
    file->scene_nodes = cJSON_AddArrayToObject(object_append(cJSON_AddArrayToObject(file->root, "scenes")), "nodes");
    file->nodes = cJSON_AddArrayToObject(file->root, "nodes");
    file->meshes = cJSON_AddArrayToObject(file->root, "meshes");
    file->materials = cJSON_AddArrayToObject(file->root, "materials");
    file->accessors = cJSON_AddArrayToObject(file->root, "accessors");
    file->views = cJSON_AddArrayToObject(file->root, "bufferViews");
    file->cameras = cJSON_AddArrayToObject(file->root, "cameras");
    // glTF forbids empty arrays: these two join the root once the scene has a texture.
    file->textures = cJSON_CreateArray();
    file->images = cJSON_CreateArray();
    cJSON *extensions = cJSON_AddObjectToObject(file->root, "extensions");
    file->lights = cJSON_AddArrayToObject(cJSON_AddObjectToObject(extensions, "KHR_lights_punctual"), "lights");
    return file;
}

void gltf_destroy(gltf_file *file)
{
    if (!file)
        return;
    if (cJSON_GetArraySize(file->textures) == 0) {
        cJSON_Delete(file->textures);
        cJSON_Delete(file->images);
    }
    cJSON_Delete(file->root);
    free(file->binary);
    free(file);
}

// Appends to the binary chunk, four-byte aligned, and returns the index of the new buffer view. A target of 0 is none.
static int view_add(gltf_file *file, const void *bytes, size_t size, int target)
{
    const size_t offset = file->binary_size;
    file->binary_size = align_up(offset + size, 4);
    memory_reserve((void **)&file->binary, &file->binary_capacity, file->binary_size, 1);
    memcpy(file->binary + offset, bytes, size);

    cJSON *view = object_append(file->views);
    cJSON_AddNumberToObject(view, "buffer", 0);
    cJSON_AddNumberToObject(view, "byteOffset", (double)offset);
    cJSON_AddNumberToObject(view, "byteLength", (double)size);
    if (target)
        cJSON_AddNumberToObject(view, "target", target);
    return cJSON_GetArraySize(file->views) - 1;
}

gltf_texture gltf_texture_add(gltf_file *file, const char *name, const void *png, size_t size)
{
    if (cJSON_GetArraySize(file->textures) == 0) {
        cJSON_AddItemToObject(file->root, "textures", file->textures);
        cJSON_AddItemToObject(file->root, "images", file->images);
    }
    cJSON *image = object_append(file->images);
    cJSON_AddStringToObject(image, "name", name);
    cJSON_AddStringToObject(image, "mimeType", "image/png");
    cJSON_AddNumberToObject(image, "bufferView", view_add(file, png, size, 0));
    cJSON *texture = object_append(file->textures);
    cJSON_AddNumberToObject(texture, "source", cJSON_GetArraySize(file->images) - 1);
    return (gltf_texture){(uint32_t)cJSON_GetArraySize(file->textures)};
}

gltf_material gltf_material_add(gltf_file *file, const gltf_material_desc *desc)
{
    cJSON *material = object_append(file->materials);
    cJSON_AddStringToObject(material, "name", desc->name);
    cJSON *surface = cJSON_AddObjectToObject(material, "pbrMetallicRoughness");
    cJSON_AddNumberToObject(surface, "metallicFactor", 0);
    if (desc->roughness > 0)
        cJSON_AddNumberToObject(surface, "roughnessFactor", desc->roughness);
    const vec3 albedo = desc->albedo;
    if (albedo.x > 0 || albedo.y > 0 || albedo.z > 0)
        cJSON_AddItemToObject(surface, "baseColorFactor",
                              numbers((const float[4]){albedo.x, albedo.y, albedo.z, 1}, 4));
    if (desc->texture.id)
        reference_add(surface, "baseColorTexture", desc->texture.id);
    if (desc->normals.id)
        reference_add(material, "normalTexture", desc->normals.id);
    if (desc->alpha_mask)
        cJSON_AddStringToObject(material, "alphaMode", "MASK");
    if (desc->double_sided)
        cJSON_AddTrueToObject(material, "doubleSided");
    return (gltf_material){(uint32_t)cJSON_GetArraySize(file->materials)};
}

static cJSON *accessor_add(gltf_file *file, int view, int component, const char *type, size_t count)
{
    cJSON *accessor = object_append(file->accessors);
    cJSON_AddNumberToObject(accessor, "bufferView", view);
    cJSON_AddNumberToObject(accessor, "componentType", component);
    cJSON_AddStringToObject(accessor, "type", type);
    cJSON_AddNumberToObject(accessor, "count", (double)count);
    return accessor;
}

// A geometry is four accessors in a row: positions, normals, texture coordinates, indices.
gltf_geometry gltf_geometry_add(gltf_file *file, const mesh *mesh)
{
    const size_t count = mesh->vertex_count;
    vec3 *positions = memory_alloc(count * sizeof *positions), *normals = memory_alloc(count * sizeof *normals);
    vec2 *uvs = memory_alloc(count * sizeof *uvs);
    vec3 low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < count; i++) {
        const vec3 p = positions[i] = mesh->vertices[i].position;
        normals[i] = mesh->vertices[i].normal;
        uvs[i] = mesh->vertices[i].uv;
        low = (vec3){fminf(low.x, p.x), fminf(low.y, p.y), fminf(low.z, p.z)};
        high = (vec3){fmaxf(high.x, p.x), fmaxf(high.y, p.y), fmaxf(high.z, p.z)};
    }
    const int first = cJSON_GetArraySize(file->accessors);
    const int position_view = view_add(file, positions, count * sizeof *positions, ARRAY_BUFFER);
    cJSON *bounded = accessor_add(file, position_view, FLOAT, "VEC3", count);
    cJSON_AddItemToObject(bounded, "min", vec3_json(low));
    cJSON_AddItemToObject(bounded, "max", vec3_json(high));
    accessor_add(file, view_add(file, normals, count * sizeof *normals, ARRAY_BUFFER), FLOAT, "VEC3", count);
    accessor_add(file, view_add(file, uvs, count * sizeof *uvs, ARRAY_BUFFER), FLOAT, "VEC2", count);
    const int index_view = view_add(file, mesh->indices, mesh->index_count * sizeof(uint32_t), ELEMENT_ARRAY_BUFFER);
    accessor_add(file, index_view, UNSIGNED_INT, "SCALAR", mesh->index_count);
    free(positions);
    free(normals);
    free(uvs);
    return (gltf_geometry){(uint32_t)first + 1};
}

gltf_mesh gltf_mesh_add(gltf_file *file, const char *name, gltf_geometry geometry, gltf_material material)
{
    assert(geometry.id && material.id);
    cJSON *mesh = object_append(file->meshes);
    cJSON_AddStringToObject(mesh, "name", name);
    cJSON *primitive = object_append(cJSON_AddArrayToObject(mesh, "primitives"));
    cJSON *attributes = cJSON_AddObjectToObject(primitive, "attributes");
    const uint32_t first = geometry.id - 1;
    cJSON_AddNumberToObject(attributes, "POSITION", first);
    cJSON_AddNumberToObject(attributes, "NORMAL", first + 1);
    cJSON_AddNumberToObject(attributes, "TEXCOORD_0", first + 2);
    cJSON_AddNumberToObject(primitive, "indices", first + 3);
    cJSON_AddNumberToObject(primitive, "material", material.id - 1);
    return (gltf_mesh){(uint32_t)cJSON_GetArraySize(file->meshes)};
}

static cJSON *node_append(gltf_file *file, vec3 position)
{
    cJSON_AddItemToArray(file->scene_nodes, cJSON_CreateNumber(cJSON_GetArraySize(file->nodes)));
    cJSON *node = object_append(file->nodes);
    cJSON_AddItemToObject(node, "translation", vec3_json(position));
    return node;
}

void gltf_node_add(gltf_file *file, gltf_mesh mesh, vec3 position, float yaw)
{
    cJSON *node = node_append(file, position);
    cJSON_AddNumberToObject(node, "mesh", mesh.id - 1);
    if (yaw != 0)
        cJSON_AddItemToObject(node, "rotation", numbers((const float[4]){0, sinf(yaw / 2), 0, cosf(yaw / 2)}, 4));

    const cJSON *primitives = cJSON_GetObjectItem(cJSON_GetArrayItem(file->meshes, (int)mesh.id - 1), "primitives");
    const int indices = cJSON_GetObjectItem(cJSON_GetArrayItem(primitives, 0), "indices")->valueint;
    const cJSON *accessor = cJSON_GetArrayItem(file->accessors, indices);
    file->triangle_count += (size_t)cJSON_GetObjectItem(accessor, "count")->valueint / 3;
}

// The rotation that brings -Z, where cameras and lights look, to `forward`, without roll: yaw about +Y after pitch.
static void look_add(cJSON *node, vec3 forward)
{
    const float yaw = atan2f(-forward.x, -forward.z), pitch = asinf(vec3_normalize(forward).y);
    const float cy = cosf(yaw / 2), sy = sinf(yaw / 2), cp = cosf(pitch / 2), sp = sinf(pitch / 2);
    cJSON_AddItemToObject(node, "rotation", numbers((const float[4]){cy * sp, sy * cp, -sy * sp, cy * cp}, 4));
}

void gltf_camera_add(gltf_file *file, const char *name, vec3 eye, vec3 target, float yfov, float aspect)
{
    cJSON *camera = object_append(file->cameras);
    cJSON_AddStringToObject(camera, "name", name);
    cJSON_AddStringToObject(camera, "type", "perspective");
    cJSON *perspective = cJSON_AddObjectToObject(camera, "perspective");
    cJSON_AddNumberToObject(perspective, "yfov", yfov);
    cJSON_AddNumberToObject(perspective, "aspectRatio", aspect);
    cJSON_AddNumberToObject(perspective, "znear", 0.05);

    cJSON *node = node_append(file, eye);
    cJSON_AddStringToObject(node, "name", name);
    cJSON_AddNumberToObject(node, "camera", cJSON_GetArraySize(file->cameras) - 1);
    look_add(node, vec3_sub(target, eye));
}

static void light_add(gltf_file *file, cJSON *node, const char *name, const char *type, vec3 color, float intensity)
{
    cJSON *light = object_append(file->lights);
    cJSON_AddStringToObject(light, "name", name);
    cJSON_AddStringToObject(light, "type", type);
    cJSON_AddItemToObject(light, "color", vec3_json(color));
    cJSON_AddNumberToObject(light, "intensity", intensity);

    cJSON_AddStringToObject(node, "name", name);
    cJSON *extension = cJSON_AddObjectToObject(cJSON_AddObjectToObject(node, "extensions"), "KHR_lights_punctual");
    cJSON_AddNumberToObject(extension, "light", cJSON_GetArraySize(file->lights) - 1);
}

void gltf_point_light_add(gltf_file *file, const char *name, vec3 position, vec3 color, float candela)
{
    light_add(file, node_append(file, position), name, "point", color, candela);
}

void gltf_sun_add(gltf_file *file, const char *name, vec3 towards_sun, vec3 color, float lux)
{
    cJSON *node = node_append(file, (vec3){0});
    look_add(node, vec3_scale(towards_sun, -1));
    light_add(file, node, name, "directional", color, lux);
}

size_t gltf_triangle_count(const gltf_file *file)
{
    return file->triangle_count;
}

static uint8_t *chunk_append(uint8_t *to, uint32_t type, const void *bytes, size_t size, char padding)
{
    const uint32_t padded = (uint32_t)align_up(size, 4), header[2] = {padded, type};
    memcpy(to, header, sizeof header);
    memcpy(to + sizeof header, bytes, size);
    memset(to + sizeof header + size, padding, padded - size);
    return to + sizeof header + padded;
}

bool gltf_write(gltf_file *file, const char *path)
{
    cJSON_DeleteItemFromObject(file->root, "buffers");
    cJSON *buffer = object_append(cJSON_AddArrayToObject(file->root, "buffers"));
    cJSON_AddNumberToObject(buffer, "byteLength", (double)file->binary_size);
    char *json = cJSON_PrintUnformatted(file->root);
    const size_t json_size = strlen(json);

    const uint32_t magic = 0x46546C67, json_type = 0x4E4F534A, binary_type = 0x004E4942;
    const size_t size = 12 + 8 + align_up(json_size, 4) + 8 + file->binary_size;
    const uint32_t header[3] = {magic, 2, (uint32_t)size};
    uint8_t *glb = memory_alloc(size);
    memcpy(glb, header, sizeof header);
    uint8_t *end = chunk_append(glb + sizeof header, json_type, json, json_size, ' ');
    end = chunk_append(end, binary_type, file->binary, file->binary_size, 0);
    assert(end == glb + size);

    const bool written = file_write(path, glb, size);
    free(glb);
    free(json);
    return written;
}
