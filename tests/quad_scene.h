// Scenes of a few quads as plain data, for tests that need no file.
#pragma once

#include "modules/scene.h"

#include <string.h>

enum { QUADS_MAX = 8 };

static const float IDENTITY[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

// Quads of two metres in the xy plane of their node, facing +z, u along +x and v along -y as glTF has it; quad i has
// node, mesh, primitive and material i.
typedef struct quad_scene {
    scene_data data;
    scene_node nodes[QUADS_MAX];
    scene_mesh meshes[QUADS_MAX];
    mesh_primitive primitives[QUADS_MAX];
    material materials[QUADS_MAX];
    float positions[4][3];
    vertex_attributes attributes[4];
    uint32_t indices[6];
    scene_image image;
    scene_texture texture;
} quad_scene;

static inline void quad_scene_init(quad_scene *s)
{
    static const float corners[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    *s = (quad_scene){0};
    memcpy(s->indices, indices, sizeof indices);
    for (int i = 0; i < 4; i++) {
        const float x = corners[i][0], y = corners[i][1];
        memcpy(s->positions[i], (float[3]){x, y, 0}, sizeof s->positions[i]);
        s->attributes[i] = (vertex_attributes){
            .normal = {0, 0, 1}, .uv0 = {0.5f + 0.5f * x, 0.5f - 0.5f * y}, .color_rg = ~0u, .color_ba = ~0u};
    }
    s->data = (scene_data){
        .path = "quads",
        .nodes = s->nodes,
        .meshes = s->meshes,
        .primitives = s->primitives,
        .positions = s->positions,
        .attributes = s->attributes,
        .vertex_count = 4,
        .indices = s->indices,
        .index_count = 6,
        .materials = s->materials,
        .images = &s->image,
        .textures = &s->texture,
    };
}

static inline material *quad_add(quad_scene *s, const float matrix[16])
{
    const uint32_t i = s->data.node_count;
    s->data.node_count = s->data.mesh_count = s->data.primitive_count = s->data.material_count = i + 1;
    s->nodes[i] = (scene_node){
        .name = "quad", .parent = SCENE_NONE, .mesh = i, .camera = SCENE_NONE, .light = SCENE_NONE, .skin = SCENE_NONE};
    memcpy(s->nodes[i].matrix, matrix, sizeof s->nodes[i].matrix);
    s->meshes[i] = (scene_mesh){.first_primitive = i, .primitive_count = 1, .deformation = SCENE_NONE};
    s->primitives[i] = (mesh_primitive){.index_count = 6, .vertex_count = 4, .material = i};
    const texture_reference none = {.texture = TEXTURE_NONE, .transform = {1, 0, 0, 1}};
    s->materials[i] = (material){
        .base_color = {0.5f, 0.25f, 0.75f, 1},
        .alpha_cutoff = 0.5f,
        .normal_scale = 1,
        .base_texture = none,
        .emissive_texture = none,
        .normal_texture = none,
        .metallic_roughness_texture = none,
    };
    return &s->materials[i];
}

// A texture whose texels keep hard borders.
static inline void texture_set(quad_scene *s, uint8_t *texels, uint32_t width, uint32_t height, bool srgb)
{
    s->image = (scene_image){.name = "image", .width = width, .height = height, .texels = texels};
    s->texture = (scene_texture){.srgb = srgb, .mag_filter = 9728, .min_filter = 9728};
    s->data.image_count = s->data.texture_count = 1;
}
