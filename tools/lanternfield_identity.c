// The text that names all that a picture depends on: the scene by content, the view, and the settings of the method. A
// state file is continued, and a reference is taken from a cache, only where the texts are equal.
#include "lanternfield.h"

#include <stdlib.h>
#include <string.h>

// ---- Hashes of what was loaded, which is exact whatever files it came from. FNV-1a over words of 64 bits with a shift
// mixed in, so that high bits reach the low ones; eight times as fast as by bytes.

static const uint64_t hash_start = 0xcbf29ce484222325u;

static uint64_t hash_word(uint64_t hash, uint64_t word)
{
    hash = (hash ^ word) * 0x100000001b3u;
    return hash ^ (hash >> 29);
}

static uint64_t hash_bytes(uint64_t hash, const void *bytes, size_t size)
{
    const char *const from = bytes;
    hash = hash_word(hash, size);
    for (size_t i = 0; i < size; i += sizeof(uint64_t)) {
        uint64_t word = 0;
        memcpy(&word, from + i, size - i < sizeof(word) ? size - i : sizeof(word));
        hash = hash_word(hash, word);
    }
    return hash;
}

static uint64_t geometry_hash(const scene_data *s)
{
    uint64_t hash = hash_bytes(hash_start, s->positions, s->vertex_count * sizeof(*s->positions));
    hash = hash_bytes(hash, s->attributes, s->vertex_count * sizeof(*s->attributes));
    hash = hash_bytes(hash, s->indices, s->index_count * sizeof(*s->indices));
    hash = hash_bytes(hash, s->primitives, s->primitive_count * sizeof(*s->primitives));
    for (uint32_t i = 0; i < s->mesh_count; i++) {
        hash = hash_word(hash, s->meshes[i].first_primitive);
        hash = hash_word(hash, s->meshes[i].primitive_count);
    }
    return hash;
}

static uint64_t deformations_hash(const scene_data *s)
{
    uint64_t hash = hash_start;
    for (uint32_t i = 0; i < s->deformation_count; i++) {
        const scene_deformation *const d = &s->deformations[i];
        const size_t morphs = (size_t)d->target_count * d->vertex_count;
        hash = hash_word(hash, d->mesh);
        hash = hash_word(hash, d->node);
        hash = hash_word(hash, d->skin);
        hash = hash_bytes(hash, d->influences, d->influences ? d->vertex_count * sizeof(*d->influences) : 0);
        hash = hash_bytes(hash, d->morphs, morphs * sizeof(*d->morphs));
        hash = hash_bytes(hash, d->weights, d->target_count * sizeof(*d->weights));
    }
    for (uint32_t i = 0; i < s->skin_count; i++) {
        const scene_skin *const skin = &s->skins[i];
        hash = hash_bytes(hash, skin->joints, skin->joint_count * sizeof(*skin->joints));
        hash = hash_bytes(hash, skin->inverse_bind, skin->joint_count * sizeof(*skin->inverse_bind));
    }
    return hash;
}

static uint64_t channel_hash(uint64_t hash, const scene_channel *channel)
{
    const size_t parts = channel->interpolation == SCENE_CUBIC ? 3 : 1;
    hash = hash_word(hash, channel->target);
    hash = hash_word(hash, channel->index);
    hash = hash_word(hash, channel->interpolation);
    hash = hash_bytes(hash, channel->times, channel->key_count * sizeof(*channel->times));
    return hash_bytes(hash, channel->values, channel->key_count * parts * channel->width * sizeof(*channel->values));
}

static uint64_t animations_hash(const scene_data *s)
{
    uint64_t hash = hash_start;
    for (uint32_t i = 0; i < s->animation_count; i++) {
        hash = hash_word(hash, s->animations[i].channel_count);
        for (uint32_t k = 0; k < s->animations[i].channel_count; k++) {
            hash = channel_hash(hash, &s->animations[i].channels[k]);
        }
    }
    return hash;
}

static uint64_t nodes_hash(const scene_data *s)
{
    uint64_t hash = hash_start;
    for (uint32_t i = 0; i < s->node_count; i++) {
        const scene_node *const node = &s->nodes[i];
        hash = hash_bytes(hash, node->world, sizeof(node->world));
        hash = hash_word(hash, node->mesh);
        hash = hash_word(hash, node->light);
        hash = hash_word(hash, node->parent);
        hash = hash_bytes(hash, node->matrix, sizeof(node->matrix));
    }
    for (uint32_t i = 0; i < s->camera_count; i++) {
        const scene_camera *const camera = &s->cameras[i];
        hash = hash_word(hash, camera->node);
        hash = hash_bytes(hash, &camera->yfov, sizeof(camera->yfov));
        hash = hash_bytes(hash, &camera->near_plane, sizeof(camera->near_plane));
    }
    return hash;
}

static uint64_t materials_hash(const scene_data *s)
{
    const uint64_t hash = hash_bytes(hash_start, s->materials, s->material_count * sizeof(*s->materials));
    return hash_bytes(hash, s->emissions, s->emissions ? s->material_count * sizeof(*s->emissions) : 0);
}

static uint64_t textures_hash(const scene_data *s)
{
    uint64_t hash = hash_start;
    for (uint32_t i = 0; i < s->image_count; i++) {
        const scene_image *const image = &s->images[i];
        hash = hash_word(hash, image->width);
        hash = hash_word(hash, image->height);
        hash = hash_bytes(hash, image->texels, image->texels ? 4 * (size_t)image->width * image->height : 0);
    }
    for (uint32_t i = 0; i < s->texture_count; i++) {
        const scene_texture *const texture = &s->textures[i];
        const int values[] = {(int)texture->image, texture->srgb,   texture->mag_filter,
                              texture->min_filter, texture->wrap_s, texture->wrap_t};
        hash = hash_bytes(hash, values, sizeof(values));
    }
    return hash;
}

static uint64_t lights_hash(const scene_data *s)
{
    uint64_t hash = hash_start;
    for (uint32_t i = 0; i < s->light_count; i++) {
        const scene_light *const light = &s->lights[i];
        const float values[] = {light->color[0], light->color[1],  light->color[2],   light->hue[0],    light->hue[1],
                                light->hue[2],   light->intensity, light->inner_cone, light->outer_cone};
        hash = hash_word(hash, light->type);
        hash = hash_bytes(hash, values, sizeof(values));
    }
    return hash;
}

void scene_identity_print(FILE *out, const scene_data *scene)
{
    static const struct {
        const char *name;
        uint64_t (*hash)(const scene_data *scene);
    } parts[] = {
        {"geometry", geometry_hash}, {"nodes", nodes_hash},   {"materials", materials_hash},
        {"textures", textures_hash}, {"lights", lights_hash}, {"animations", animations_hash},
    };
    for (size_t i = 0; i < countof(parts); i++) {
        fprintf(out, "%s %016llx\n", parts[i].name, (unsigned long long)parts[i].hash(scene));
    }
    if (scene->deformation_count > 0) {
        fprintf(out, "deformations %016llx\n", (unsigned long long)deformations_hash(scene));
    }
}

static void motion_print(FILE *out, const render_request *request)
{
    if (request->animation) {
        fprintf(out, "animation %s\ntime %.9g\n", request->animation, (double)request->time);
    }
}

// ---- The view

static void numbers_print(FILE *out, const char *key, const float *values, uint32_t count)
{
    fputs(key, out);
    for (uint32_t i = 0; i < count; i++) {
        fprintf(out, "%c%.9g", i ? ',' : ' ', (double)values[i]); // nine digits tell all floats apart
    }
    fputc('\n', out);
}

static void view_print(FILE *out, const render_camera *camera, const render_request *request)
{
    numbers_print(out, "eye", camera->eye, 3);
    numbers_print(out, "target", camera->target, 3);
    numbers_print(out, "up", camera->up, 3);
    numbers_print(out, "fov", &camera->yfov, 1);
    numbers_print(out, "near", &camera->near_plane, 1);
    if (request->has_sun) {
        numbers_print(out, "sun", request->sun, 4);
    } else {
        fputs("sun none\n", out);
    }
}

// ---- Settings

static bool name_is_in(const char *const *names, const char *name)
{
    for (; *names; names++) {
        if (strcmp(*names, name) == 0) {
            return true;
        }
    }
    return false;
}

static bool setting_matters(uint32_t method, const char *name)
{
    // What LGH does not read, or what only changes how the PNG shows it. Who traces rays changes rounding alone.
    static const char *const not_lgh[] = {"rays", "spp", "until", "ir-vpls", "exposure", NULL};
    // How long a progressive picture is continued is no part of what it is.
    static const char *const path[] = {"size", "method", "bounces", "subdivision-max", "only", "seed", NULL};
    static const char *const vpl[] = {"size", "method", "vpls", "bounces", "singularity", "subdivision-max",
                                      "only", "seed",   NULL};
    static const char *const ir[] = {"size", "method", "ir-vpls", "bounces", "singularity", "subdivision-max",
                                     "only", "seed",   NULL};
    switch ((render_method)method) {
    case METHOD_LGH:
        return !name_is_in(not_lgh, name);
    case METHOD_PATH:
        return name_is_in(path, name);
    case METHOD_VPL:
        return name_is_in(vpl, name);
    case METHOD_IR:
        return name_is_in(ir, name);
    }
    return true;
}

static void settings_print(FILE *out, const render_settings *settings)
{
    if (settings->method == METHOD_VPL || settings->method == METHOD_IR) {
        fprintf(out, "shadows %s\n", settings->shadow_samples > 0 ? "true" : "false"); // to every VPL, or to none
    }
    uint32_t count;
    const setting_info *const table = settings_table(&count);
    for (uint32_t i = 0; i < count; i++) {
        if (setting_matters(settings->method, table[i].name)) {
            char text[32];
            settings_get(settings, &table[i], text);
            fprintf(out, "%s %s\n", table[i].name, text);
        }
    }
}

char *render_identity(const render_session *session, const render_request *request)
{
    char *text = NULL;
    size_t size = 0;
    FILE *const out = open_memstream(&text, &size);
    assert(out);
    fputs("program lanternfield " LANTERNFIELD_VERSION "\n", out);
    scene_identity_print(out, session->scene);
    motion_print(out, request);
    view_print(out, &session->renderer->camera, request);
    settings_print(out, &session->renderer->settings);
    fclose(out);
    return text;
}
