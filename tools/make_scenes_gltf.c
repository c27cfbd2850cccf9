// Writes binary glTF 2.0; see the header.
#include "tools/make_scenes_gltf.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ARRAY_BUFFER = 34962, ELEMENT_ARRAY_BUFFER = 34963, FLOAT = 5126, UNSIGNED_INT = 5125, UNSIGNED_BYTE = 5121 };

struct gltf_file {
    cJSON *root;
    cJSON *scene_nodes, *nodes, *meshes, *materials, *textures, *images, *accessors, *views, *cameras, *lights, *skins,
        *animations;
    uint8_t *binary;
    size_t binary_size, binary_capacity;
    size_t triangle_count;
    uint32_t *influences; // by geometry id: the accessor of JOINTS_0, WEIGHTS_0 follows it; 0 or past the end: none
    size_t influences_count, influences_capacity;
};

static cJSON *numbers(const float *values, int count)
{
    return cJSON_CreateFloatArray(values, count);
}

static cJSON *vec3_json(vec3 v)
{
    return numbers((const float[3]){v.x, v.y, v.z}, 3);
}

static cJSON *quat_json(quat q)
{
    return numbers((const float[4]){q.x, q.y, q.z, q.w}, 4);
}

// Appends an empty object and returns it.
static cJSON *object_append(cJSON *array)
{
    cJSON *object = cJSON_CreateObject();
    cJSON_AddItemToArray(array, object);
    return object;
}

// The same to an array that joins the root as `key` with its first member.
static cJSON *optional_append(gltf_file *file, const char *key, cJSON *array)
{
    if (cJSON_GetArraySize(array) == 0)
        cJSON_AddItemToObject(file->root, key, array);
    return object_append(array);
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
    // glTF forbids empty arrays: these join the root with their first member.
    file->textures = cJSON_CreateArray();
    file->images = cJSON_CreateArray();
    file->skins = cJSON_CreateArray();
    file->animations = cJSON_CreateArray();
    cJSON *extensions = cJSON_AddObjectToObject(file->root, "extensions");
    file->lights = cJSON_AddArrayToObject(cJSON_AddObjectToObject(extensions, "KHR_lights_punctual"), "lights");
    return file;
}

void gltf_destroy(gltf_file *file)
{
    if (!file)
        return;
    cJSON *const optional[] = {file->textures, file->images, file->skins, file->animations};
    for (size_t i = 0; i < countof(optional); i++)
        if (cJSON_GetArraySize(optional[i]) == 0)
            cJSON_Delete(optional[i]);
    cJSON_Delete(file->root);
    free(file->influences);
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
    cJSON *texture = optional_append(file, "textures", file->textures);
    cJSON *image = optional_append(file, "images", file->images);
    cJSON_AddStringToObject(image, "name", name);
    cJSON_AddStringToObject(image, "mimeType", "image/png");
    cJSON_AddNumberToObject(image, "bufferView", view_add(file, png, size, 0));
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

void gltf_geometry_influences_add(gltf_file *file, gltf_geometry geometry, const gltf_influences *influences,
                                  size_t count)
{
    uint8_t(*joints)[4] = memory_alloc(count * sizeof *joints);
    float(*weights)[4] = memory_alloc(count * sizeof *weights);
    for (size_t i = 0; i < count; i++) {
        memcpy(joints[i], influences[i].joints, sizeof *joints);
        memcpy(weights[i], influences[i].weights, sizeof *weights);
    }
    const size_t size = file->influences_count, needed = geometry.id + 1;
    if (needed > size) {
        memory_reserve((void **)&file->influences, &file->influences_capacity, needed, sizeof *file->influences);
        memset(file->influences + size, 0, (needed - size) * sizeof *file->influences);
        file->influences_count = needed;
    }
    file->influences[geometry.id] = (uint32_t)cJSON_GetArraySize(file->accessors);
    accessor_add(file, view_add(file, joints, count * sizeof *joints, ARRAY_BUFFER), UNSIGNED_BYTE, "VEC4", count);
    accessor_add(file, view_add(file, weights, count * sizeof *weights, ARRAY_BUFFER), FLOAT, "VEC4", count);
    free(joints);
    free(weights);
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
    if (geometry.id < file->influences_count && file->influences[geometry.id]) {
        cJSON_AddNumberToObject(attributes, "JOINTS_0", file->influences[geometry.id]);
        cJSON_AddNumberToObject(attributes, "WEIGHTS_0", file->influences[geometry.id] + 1);
    }
    cJSON_AddNumberToObject(primitive, "indices", first + 3);
    cJSON_AddNumberToObject(primitive, "material", material.id - 1);
    return (gltf_mesh){(uint32_t)cJSON_GetArraySize(file->meshes)};
}

void gltf_mesh_subdivide(gltf_file *file, gltf_mesh mesh, uint32_t max_level)
{
    cJSON *extras = cJSON_AddObjectToObject(cJSON_GetArrayItem(file->meshes, (int)mesh.id - 1), "extras");
    cJSON *subdivision = cJSON_AddObjectToObject(extras, "lanternfield_subdivision");
    cJSON_AddStringToObject(subdivision, "scheme", "catmark");
    cJSON_AddNumberToObject(subdivision, "max_level", max_level);
}

// ---- Nodes

static cJSON *node_append(gltf_file *file, vec3 position)
{
    cJSON_AddItemToArray(file->scene_nodes, cJSON_CreateNumber(cJSON_GetArraySize(file->nodes)));
    cJSON *node = object_append(file->nodes);
    cJSON_AddItemToObject(node, "translation", vec3_json(position));
    return node;
}

static gltf_node last_node(const gltf_file *file)
{
    return (gltf_node){(uint32_t)cJSON_GetArraySize(file->nodes)};
}

static void node_mesh_set(gltf_file *file, cJSON *node, gltf_mesh mesh)
{
    cJSON_AddNumberToObject(node, "mesh", mesh.id - 1);
    const cJSON *primitives = cJSON_GetObjectItem(cJSON_GetArrayItem(file->meshes, (int)mesh.id - 1), "primitives");
    const int indices = cJSON_GetObjectItem(cJSON_GetArrayItem(primitives, 0), "indices")->valueint;
    const cJSON *accessor = cJSON_GetArrayItem(file->accessors, indices);
    file->triangle_count += (size_t)cJSON_GetObjectItem(accessor, "count")->valueint / 3;
}

static void node_light_set(cJSON *node, gltf_light light)
{
    cJSON *extension = cJSON_AddObjectToObject(cJSON_AddObjectToObject(node, "extensions"), "KHR_lights_punctual");
    cJSON_AddNumberToObject(extension, "light", light.id - 1);
}

void gltf_node_add(gltf_file *file, gltf_mesh mesh, vec3 position, float yaw)
{
    cJSON *node = node_append(file, position);
    node_mesh_set(file, node, mesh);
    if (yaw != 0)
        cJSON_AddItemToObject(node, "rotation", quat_json((quat){0, sinf(yaw / 2), 0, cosf(yaw / 2)}));
}

// Appends an object to the node's parent or, for a root, to the scene.
static cJSON *child_append(gltf_file *file, gltf_node parent)
{
    const int index = cJSON_GetArraySize(file->nodes);
    cJSON *siblings = file->scene_nodes;
    if (parent.id) {
        cJSON *node = cJSON_GetArrayItem(file->nodes, (int)parent.id - 1);
        siblings = cJSON_GetObjectItem(node, "children");
        if (!siblings)
            siblings = cJSON_AddArrayToObject(node, "children");
    }
    cJSON_AddItemToArray(siblings, cJSON_CreateNumber(index));
    return object_append(file->nodes);
}

gltf_node gltf_node_create(gltf_file *file, const gltf_node_desc *desc)
{
    cJSON *node = child_append(file, desc->parent);
    const quat q = desc->rotation;
    if (desc->name)
        cJSON_AddStringToObject(node, "name", desc->name);
    cJSON_AddItemToObject(node, "translation", vec3_json(desc->translation));
    if (q.x != 0 || q.y != 0 || q.z != 0 || q.w != 0)
        cJSON_AddItemToObject(node, "rotation", quat_json(q));
    if (desc->scale > 0)
        cJSON_AddItemToObject(node, "scale", vec3_json((vec3){desc->scale, desc->scale, desc->scale}));
    if (desc->mesh.id)
        node_mesh_set(file, node, desc->mesh);
    if (desc->skin.id)
        cJSON_AddNumberToObject(node, "skin", desc->skin.id - 1);
    if (desc->light.id)
        node_light_set(node, desc->light);
    return last_node(file);
}

gltf_skin gltf_skin_add(gltf_file *file, const char *name, const gltf_node *joints, const float (*inverse_bind)[16],
                        size_t count)
{
    cJSON *skin = optional_append(file, "skins", file->skins);
    cJSON_AddStringToObject(skin, "name", name);
    const int view = view_add(file, inverse_bind, count * sizeof *inverse_bind, 0);
    accessor_add(file, view, FLOAT, "MAT4", count);
    cJSON_AddNumberToObject(skin, "inverseBindMatrices", cJSON_GetArraySize(file->accessors) - 1);
    cJSON *nodes = cJSON_AddArrayToObject(skin, "joints");
    for (size_t i = 0; i < count; i++)
        cJSON_AddItemToArray(nodes, cJSON_CreateNumber(joints[i].id - 1));
    return (gltf_skin){(uint32_t)cJSON_GetArraySize(file->skins)};
}

// ---- Animation

gltf_clip gltf_clip_add(gltf_file *file, const char *name)
{
    cJSON *clip = optional_append(file, "animations", file->animations);
    cJSON_AddStringToObject(clip, "name", name);
    cJSON_AddArrayToObject(clip, "channels");
    cJSON_AddArrayToObject(clip, "samplers");
    return (gltf_clip){(uint32_t)cJSON_GetArraySize(file->animations)};
}

gltf_times gltf_times_add(gltf_file *file, const float *seconds, size_t count)
{
    const int view = view_add(file, seconds, count * sizeof *seconds, 0);
    cJSON *accessor = accessor_add(file, view, FLOAT, "SCALAR", count);
    cJSON_AddItemToObject(accessor, "min", numbers(&seconds[0], 1));
    cJSON_AddItemToObject(accessor, "max", numbers(&seconds[count - 1], 1));
    return (gltf_times){(uint32_t)cJSON_GetArraySize(file->accessors)};
}

static cJSON *clip_array(const gltf_file *file, uint32_t clip, const char *key)
{
    return cJSON_GetObjectItem(cJSON_GetArrayItem(file->animations, (int)clip - 1), key);
}

gltf_sampler gltf_sampler_add(gltf_file *file, gltf_clip clip, gltf_path path, gltf_interpolation interpolation,
                              gltf_times times, const float *values)
{
    static const char *const names[] = {[GLTF_LINEAR] = "LINEAR", [GLTF_STEP] = "STEP", [GLTF_CUBIC] = "CUBICSPLINE"};
    const cJSON *input = cJSON_GetArrayItem(file->accessors, (int)times.id - 1);
    const size_t keys = (size_t)cJSON_GetObjectItem(input, "count")->valueint;
    const size_t count = keys * (interpolation == GLTF_CUBIC ? 3 : 1), width = path == GLTF_ROTATION ? 4 : 3;
    const int view = view_add(file, values, count * width * sizeof *values, 0);
    accessor_add(file, view, FLOAT, width == 4 ? "VEC4" : "VEC3", count);

    cJSON *samplers = clip_array(file, clip.id, "samplers"), *sampler = object_append(samplers);
    cJSON_AddNumberToObject(sampler, "input", times.id - 1);
    cJSON_AddNumberToObject(sampler, "output", cJSON_GetArraySize(file->accessors) - 1);
    cJSON_AddStringToObject(sampler, "interpolation", names[interpolation]);
    return (gltf_sampler){clip.id, (uint32_t)cJSON_GetArraySize(samplers)};
}

void gltf_channel_add(gltf_file *file, gltf_sampler sampler, gltf_node node, gltf_path path)
{
    static const char *const names[] = {
        [GLTF_TRANSLATION] = "translation", [GLTF_ROTATION] = "rotation", [GLTF_SCALE] = "scale"};
    cJSON *channel = object_append(clip_array(file, sampler.clip, "channels"));
    cJSON_AddNumberToObject(channel, "sampler", sampler.id - 1);
    cJSON *target = cJSON_AddObjectToObject(channel, "target");
    cJSON_AddNumberToObject(target, "node", node.id - 1);
    cJSON_AddStringToObject(target, "path", names[path]);
}

// ---- Cameras and lights

// Yaw about +Y after pitch.
quat gltf_look(vec3 forward)
{
    const float yaw = atan2f(-forward.x, -forward.z), pitch = asinf(vec3_normalize(forward).y);
    const float cy = cosf(yaw / 2), sy = sinf(yaw / 2), cp = cosf(pitch / 2), sp = sinf(pitch / 2);
    return (quat){cy * sp, sy * cp, -sy * sp, cy * cp};
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
    cJSON_AddItemToObject(node, "rotation", quat_json(gltf_look(vec3_sub(target, eye))));
}

static gltf_light light_append(gltf_file *file, const char *name, const char *type, vec3 color, float intensity)
{
    cJSON *light = object_append(file->lights);
    cJSON_AddStringToObject(light, "name", name);
    cJSON_AddStringToObject(light, "type", type);
    cJSON_AddItemToObject(light, "color", vec3_json(color));
    cJSON_AddNumberToObject(light, "intensity", intensity);
    return (gltf_light){(uint32_t)cJSON_GetArraySize(file->lights)};
}

static void light_add(gltf_file *file, cJSON *node, const char *name, const char *type, vec3 color, float intensity)
{
    cJSON_AddStringToObject(node, "name", name);
    node_light_set(node, light_append(file, name, type, color, intensity));
}

gltf_light gltf_light_add(gltf_file *file, const char *name, vec3 color, float candela)
{
    return light_append(file, name, "point", color, candela);
}

void gltf_point_light_add(gltf_file *file, const char *name, vec3 position, vec3 color, float candela)
{
    light_add(file, node_append(file, position), name, "point", color, candela);
}

gltf_node gltf_sun_add(gltf_file *file, const char *name, vec3 towards_sun, vec3 color, float lux)
{
    cJSON *node = node_append(file, (vec3){0});
    cJSON_AddItemToObject(node, "rotation", quat_json(gltf_look(vec3_scale(towards_sun, -1))));
    light_add(file, node, name, "directional", color, lux);
    return last_node(file);
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
