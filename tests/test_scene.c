// Scene import: what small files mean.
#include "scene_test.h"

static void node_point(const scene_node *node, const float in[3], float out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = node->world[i] * in[0] + node->world[4 + i] * in[1] + node->world[8 + i] * in[2] + node->world[12 + i];
    }
}

TEST(a_triangle_loads_with_counts_and_bounds)
{
    scene_data *const scene = load_triangle(TRIANGLE "," TRIANGLE_NODE);
    CHECK(scene && test_log.errors == 0 && test_log.warnings == 0);
    if (scene) {
        CHECK(scene->mesh_count == 1 && scene->primitive_count == 1 && scene->index_count == 3 &&
              scene->vertex_count == 3);
        CHECK(scene->instanced_triangles == 1);
        CHECK_NEAR(scene->bounds_max[0], 1, 0);
        CHECK_NEAR(scene->bounds_max[1], 2, 0);
        CHECK_NEAR(scene->bounds_min[2], 0, 0);
    }
    scene_destroy(scene);
}

TEST(a_file_without_geometry_loads)
{
    scene_data *const scene = load_triangle("'nodes':[{}]");
    CHECK(scene && scene->index_count == 0 && scene->instanced_triangles == 0 && scene->bounds_max[0] == 0);
    scene_destroy(scene);
    scene_destroy(NULL);
}

static size_t glb_make(uint8_t *out, const char *json, const void *binary, uint32_t binary_size)
{
    const uint32_t json_size = (uint32_t)align_up(strlen(json), 4), total = 12 + 8 + json_size + 8 + binary_size;
    const uint32_t header[] = {0x46546C67, 2, total, json_size, 0x4E4F534A};
    const uint32_t chunk[] = {binary_size, 0x004E4942};
    memcpy(out, header, sizeof(header));
    memset(out + 20, ' ', json_size);
    for (size_t i = 0; json[i]; i++) {
        out[20 + i] = json[i] == '\'' ? '"' : (uint8_t)json[i];
    }
    memcpy(out + 20 + json_size, chunk, sizeof(chunk));
    memcpy(out + 28 + json_size, binary, binary_size);
    return total;
}

TEST(a_glb_loads_from_its_binary_chunk)
{
    uint8_t glb[2048];
    const size_t size =
        glb_make(glb, "{'asset':{'version':'2.0'},'buffers':[{'byteLength':42}]," TRIANGLE "," TRIANGLE_NODE "}",
                 &triangle, sizeof(triangle));
    test_file("triangle.glb", glb, size);
    scene_data *const scene = scene_load(test_path("triangle.glb"));
    CHECK(scene && scene->instanced_triangles == 1);
    scene_destroy(scene);
}

TEST(parents_come_before_children_and_world_matrices_multiply)
{
    scene_data *const scene = load_triangle(
        TRIANGLE
        ",'nodes':[{'mesh':0,'translation':[0,0,5],'name':'leaf'},{'children':[0],'scale':[2,2,2],'name':'middle'},"
        "{'children':[1],'translation':[10,0,0],'name':'root'}]");
    CHECK(scene && scene->node_count == 3);
    if (scene) {
        CHECK_STRING(scene->nodes[0].name, "root");
        CHECK_STRING(scene->nodes[2].name, "leaf");
        CHECK(scene->nodes[0].parent == SCENE_NONE && scene->nodes[1].parent == 0 && scene->nodes[2].parent == 1);
        float p[3];
        node_point(&scene->nodes[2], (float[]){1, 0, 0}, p);
        CHECK(p[0] == 12 && p[1] == 0 && p[2] == 10);
        CHECK(scene->bounds_min[2] == 10 && scene->bounds_max[0] == 12);
    }
    scene_destroy(scene);
}

TEST(translation_rotation_scale_and_the_same_matrix_agree)
{
    scene_data *const scene = load_triangle(
        TRIANGLE ",'nodes':[{'translation':[1,2,3],'rotation':[0,0,0.70710678,0.70710678],'scale':[2,3,4]},"
                 "{'matrix':[0,2,0,0,-3,0,0,0,0,0,4,0,1,2,3,1]}]");
    CHECK(scene && scene->node_count == 2);
    for (int i = 0; scene && i < 16; i++) {
        CHECK_NEAR(scene->nodes[0].matrix[i], scene->nodes[1].matrix[i], 1e-6);
    }
    CHECK(scene && scene->nodes[0].has_trs && !scene->nodes[1].has_trs);
    scene_destroy(scene);
}

TEST(mirrored_and_non_uniform_scales_stay_in_the_matrix)
{
    scene_data *const scene = load_triangle(TRIANGLE ",'nodes':[{'mesh':0,'scale':[-1,2,3]}]");
    CHECK(scene && scene->nodes[0].world[0] == -1 && scene->nodes[0].world[5] == 2 && scene->nodes[0].world[10] == 3);
    CHECK(scene && scene->bounds_min[0] == -1 && scene->bounds_max[1] == 4);
    scene_destroy(scene);
}

TEST(only_the_default_scene_is_instanced)
{
    scene_data *const scene = load_triangle(
        TRIANGLE ",'nodes':[{'mesh':0},{'mesh':0},{'mesh':0}],'scene':1,'scenes':[{'nodes':[0,1]},{'nodes':[2]}]");
    CHECK(scene && scene->node_count == 1 && scene->instanced_triangles == 1);
    scene_destroy(scene);
}

TEST(the_first_scene_is_the_default_and_without_scenes_all_roots)
{
    scene_data *const first = load_triangle(TRIANGLE ",'nodes':[{'mesh':0},{'mesh':0}],'scenes':[{'nodes':[1]}]");
    CHECK(first && first->node_count == 1);
    scene_destroy(first);
    scene_data *const all = load_triangle(TRIANGLE ",'nodes':[{'mesh':0},{'mesh':0}]");
    CHECK(all && all->node_count == 2 && all->instanced_triangles == 2);
    scene_destroy(all);
}

TEST(a_camera_has_its_own_name_or_its_nodes)
{
    scene_data *const scene =
        load_triangle("'cameras':[{'name':'own','type':'perspective','perspective':{'yfov':1,'znear':0.1}},"
                      "{'type':'perspective','perspective':{'yfov':0.5,'znear':0.2}}],"
                      "'nodes':[{'camera':0,'name':'a'},{'camera':1,'name':'b','translation':[0,0,7]}]");
    CHECK(scene && scene->camera_count == 2);
    if (scene) {
        CHECK(scene_camera_find(scene, "own") == 0 && scene_camera_find(scene, "b") == 1);
        CHECK(scene_camera_find(scene, "a") == SCENE_NONE);
        CHECK_NEAR(scene->cameras[1].yfov, 0.5, 0);
        CHECK_NEAR(scene->cameras[1].near_plane, 0.2f, 0);
        CHECK(scene->nodes[scene->cameras[1].node].world[14] == 7);
    }
    scene_destroy(scene);
}

TEST(an_orthographic_camera_is_a_perspective_one_with_a_warning)
{
    scene_data *const scene =
        load_triangle("'cameras':[{'type':'orthographic','orthographic':{'xmag':1,'ymag':1,'zfar':9,"
                      "'znear':0.1}}],'nodes':[{'camera':0}]");
    CHECK(scene && scene->camera_count == 1 && scene->cameras[0].yfov > 0 && scene->warning_count == 1);
    CHECK(strstr(test_log.warning, "orthographic"));
    scene_destroy(scene);
}

// ---- Geometry

// Four corners of a square, and indices 0 1 2 3 in all widths.
typedef struct square_bytes {
    float positions[4][3];
    uint32_t wide[4];
    uint16_t middle[4];
    uint8_t narrow[4];
} square_bytes;
static const square_bytes square = {
    {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, {0, 1, 2, 3}, {0, 1, 2, 3}, {0, 1, 2, 3}};

#define SQUARE                                                                                                         \
    "'bufferViews':[{'buffer':0,'byteLength':48},{'buffer':0,'byteOffset':48,'byteLength':28}],"                       \
    "'accessors':[{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'},"                                      \
    "{'bufferView':1,'componentType':5125,'count':3,'type':'SCALAR'},"                                                 \
    "{'bufferView':1,'byteOffset':16,'componentType':5123,'count':3,'type':'SCALAR'},"                                 \
    "{'bufferView':1,'byteOffset':24,'componentType':5121,'count':3,'type':'SCALAR'}],'nodes':[{'mesh':0}]"

static scene_data *load_square(const char *members)
{
    return load_members("square.gltf", &square, sizeof(square), members);
}

TEST(indices_of_every_width_and_none_give_the_same_triangle)
{
    static const char *const primitives[] = {
        SQUARE ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1}]}]",
        SQUARE ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':2}]}]",
        SQUARE ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':3}]}]",
        SQUARE ",'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]",
    };
    for (uint32_t i = 0; i < countof(primitives); i++) {
        scene_data *const scene = load_square(primitives[i]);
        CHECK(scene && scene->index_count == 3 && scene->vertex_count == 3);
        if (scene) {
            const test_box b = test_box_of((const float(*)[3])scene->positions, 3);
            CHECK(b.max[0] == 1 && b.max[1] == 1 && scene->attributes[0].normal[2] == 1);
        }
        scene_destroy(scene);
    }
    CHECK(test_log.warnings == 1 && strstr(test_log.warning, "multiple of three")); // the list without indices has four
}

TEST(strips_and_fans_become_triangles_that_keep_their_side)
{
    scene_data *const strip = load_square(SQUARE ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'mode':5}]}]");
    CHECK(strip && strip->index_count == 6);
    for (uint32_t i = 0; strip && i < strip->vertex_count; i++) {
        CHECK(strip->attributes[i].normal[2] == 1);
    }
    scene_destroy(strip);
    scene_data *const fan = load_square(SQUARE ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'mode':6}]}]");
    CHECK(fan && fan->index_count == 6);
    if (fan) { // 0 1 2 faces +z, 0 2 3 faces -z
        double sum = 0;
        for (uint32_t i = 0; i < fan->vertex_count; i++) {
            sum += fan->attributes[i].normal[2];
        }
        CHECK(sum == 0);
    }
    scene_destroy(fan);
}

TEST(points_and_lines_are_left_out_with_one_warning)
{
    scene_data *const scene =
        load_square(SQUARE ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'mode':0},"
                           "{'attributes':{'POSITION':0},'mode':1},{'attributes':{'POSITION':0},'indices':1}]}]");
    CHECK(scene && scene->index_count == 3 && scene->primitive_count == 1 && scene->warning_count == 1);
    CHECK(strstr(test_log.warning, "2 primitives of points or lines"));
    scene_destroy(scene);
}

TEST(primitives_that_share_accessors_take_only_their_vertices)
{
    scene_data *const scene = load_square(SQUARE ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':1},"
                                                 "{'attributes':{'POSITION':0},'indices':2}]}]");
    CHECK(scene && scene->vertex_count == 6 && scene->index_count == 6);
    if (scene) {
        CHECK(scene->primitives[1].first_vertex == 3 && scene->primitives[1].first_index == 3);
        CHECK(scene->indices[3] < 3 && scene->indices[4] < 3 && scene->indices[5] < 3); // relative to first_vertex
    }
    scene_destroy(scene);
}

TEST(zero_area_triangles_are_left_out_and_counted)
{
    static const struct {
        float positions[4][3];
        uint16_t indices[10];
    } bytes = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}}, {0, 1, 2, 0, 1, 1, 0, 1, 3}};
    scene_data *const scene = load_members(
        "flat.gltf", &bytes, sizeof(bytes),
        "'bufferViews':[{'buffer':0,'byteLength':48},{'buffer':0,'byteOffset':48,'byteLength':18}],"
        "'accessors':[{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'},"
        "{'bufferView':1,'componentType':5123,'count':9,'type':'SCALAR'}]," TRIANGLE_MESH "," TRIANGLE_NODE);
    CHECK(scene && scene->index_count == 3 && scene->vertex_count == 3 && scene->warning_count == 1);
    CHECK(strstr(test_log.warning, "2 triangles without area"));
    scene_destroy(scene);
}

#define SPARSE_TRIANGLE                                                                                                \
    "'count':3,'type':'VEC3','componentType':5126,'sparse':{'count':2,'indices':{'bufferView':1,'byteOffset':2,"       \
    "'componentType':5123},'values':{'bufferView':0,'byteOffset':12}}"

TEST(sparse_values_replace_those_of_the_view)
{
    static const struct {
        triangle_bytes triangle;
        float replacement[3];
    } bytes = {{{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}}, {0, 1, 2}, 0}, {7, 0, 0}};
    scene_data *const scene =
        load_members("sparse.gltf", &bytes, sizeof(bytes),
                     "'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':36,'byteLength':6},"
                     "{'buffer':0,'byteOffset':44,'byteLength':12}],"
                     "'accessors':[{'bufferView':0,'count':3,'type':'VEC3','componentType':5126,'sparse':{'count':1,"
                     "'indices':{'bufferView':1,'byteOffset':2,'componentType':5123},'values':{'bufferView':2}}}],"
                     "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]," TRIANGLE_NODE);
    CHECK(scene && scene->bounds_max[0] == 7 && scene->bounds_max[1] == 2);
    scene_destroy(scene);
}

TEST(sparse_accessors_without_a_view_start_from_zeros)
{
    scene_data *const scene =
        load_triangle(TRIANGLE_VIEWS ",'accessors':[{" SPARSE_TRIANGLE
                                     "}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]," TRIANGLE_NODE);
    CHECK(scene && scene->index_count == 3 && scene->bounds_max[0] == 1 && scene->bounds_max[1] == 2);
    scene_destroy(scene);
}

// Positions and, per vertex, a colour and a texture coordinate in several formats.
typedef struct colour_bytes {
    float positions[3][3];
    float rgb[3][3];
    uint16_t rgba16[3][4];
    uint8_t rgba8[3][4];
    uint16_t uv16[3][2];
    float uv[3][2];
} colour_bytes;

TEST(floats_and_normalized_integers_mean_the_same)
{
    static const colour_bytes bytes = {
        .positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},
        .rgb = {{1, 0, 0.2f}, {1, 0, 0.2f}, {1, 0, 0.2f}},
        .rgba16 = {{65535, 0, 13107, 65535}, {65535, 0, 13107, 65535}, {65535, 0, 13107, 65535}},
        .rgba8 = {{255, 0, 51, 255}, {255, 0, 51, 255}, {255, 0, 51, 255}},
        .uv16 = {{32768, 65535}, {32768, 65535}, {32768, 65535}},
    };
    static const char *const colours[] = {
        "{'bufferView':0,'byteOffset':36,'componentType':5126,'count':3,'type':'VEC3'}",
        "{'bufferView':0,'byteOffset':72,'componentType':5123,'normalized':true,'count':3,'type':'VEC4'}",
        "{'bufferView':0,'byteOffset':96,'componentType':5121,'normalized':true,'count':3,'type':'VEC4'}",
    };
    for (uint32_t i = 0; i < countof(colours); i++) {
        char members[1024];
        snprintf(
            members, sizeof(members),
            "'bufferViews':[{'buffer':0,'byteLength':%zu}],'accessors':[{'bufferView':0,'componentType':5126,'count':3,"
            "'type':'VEC3'},%s,{'bufferView':0,'byteOffset':108,'componentType':5123,'normalized':true,'count':3,"
            "'type':'VEC2'}],'meshes':[{'primitives':[{'attributes':{'POSITION':0,'COLOR_0':1,'TEXCOORD_0':2}}]}]",
            sizeof(bytes), colours[i]);
        scene_data *const scene = load_members("colours.gltf", &bytes, sizeof(bytes), members);
        CHECK(scene && scene->vertex_count == 3);
        if (scene) {
            CHECK(scene->attributes[1].color_rg == 65535 && scene->attributes[1].color_ba == (13107 | 65535u << 16));
            CHECK_NEAR(scene->attributes[1].uv0[0], 32768.0 / 65535, 1e-6);
            CHECK_NEAR(scene->attributes[1].uv0[1], 1, 0);
        }
        scene_destroy(scene);
    }
}

TEST(vertices_without_colours_are_white)
{
    scene_data *const scene = load_triangle(TRIANGLE);
    CHECK(scene && scene->attributes[0].color_rg == 0xffffffff && scene->attributes[0].color_ba == 0xffffffff);
    scene_destroy(scene);
}

TEST(quantized_interleaved_positions_are_read)
{
    static const struct {
        int16_t position[3], padding;
        uint16_t uv[2];
    } bytes[3] = {{{-5, 0, 0}, 0, {1, 2}}, {{5, 0, 0}, 0, {3, 4}}, {{0, 300, 0}, 0, {5, 6}}};
    scene_data *const scene =
        load_members("quantized.gltf", bytes, sizeof(bytes),
                     "'extensionsUsed':['KHR_mesh_quantization'],'extensionsRequired':['KHR_mesh_quantization'],"
                     "'bufferViews':[{'buffer':0,'byteLength':36,'byteStride':12}],"
                     "'accessors':[{'bufferView':0,'componentType':5122,'count':3,'type':'VEC3'},"
                     "{'bufferView':0,'byteOffset':8,'componentType':5123,'count':3,'type':'VEC2'}],"
                     "'meshes':[{'primitives':[{'attributes':{'POSITION':0,'TEXCOORD_1':1}}]}]," TRIANGLE_NODE);
    CHECK(scene && scene->bounds_min[0] == -5 && scene->bounds_max[1] == 300 && scene->warning_count == 0);
    CHECK(scene && scene->attributes[2].uv1[0] >= 1 && scene->attributes[2].uv1[1] >= 2);
    scene_destroy(scene);
}

TEST(missing_normals_become_flat_and_share_no_vertices)
{
    scene_data *const scene = load_square(SQUARE ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'mode':5}]}]");
    CHECK(scene && scene->vertex_count == 6);
    scene_destroy(scene);
}

// Positions, one normal per vertex, texture coordinates that grow along x and fall along y: an upright image.
typedef struct surface_bytes {
    float positions[3][3], normals[3][3], uv[3][2];
} surface_bytes;
static const surface_bytes surface = {
    {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 0, 0}, {0, 0, 5}, {0, 0, 1}}, {{0, 1}, {1, 1}, {0, 0}}};

#define SURFACE                                                                                                        \
    "'bufferViews':[{'buffer':0,'byteLength':96}],"                                                                    \
    "'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"                                      \
    "{'bufferView':0,'byteOffset':36,'componentType':5126,'count':3,'type':'VEC3'},"                                   \
    "{'bufferView':0,'byteOffset':72,'componentType':5126,'count':3,'type':'VEC2'}],"                                  \
    "'meshes':[{'primitives':[{'attributes':{'POSITION':0,'NORMAL':1,'TEXCOORD_0':2},'material':0}]}]"

static scene_data *load_surface(const char *members)
{
    return load_members("surface.gltf", &surface, sizeof(surface), members);
}

TEST(normals_without_direction_are_repaired_and_all_are_unit)
{
    scene_data *const scene = load_surface(SURFACE ",'materials':[{}]");
    CHECK(scene && scene->vertex_count == 3);
    for (uint32_t i = 0; scene && i < 3; i++) {
        CHECK(scene->attributes[i].normal[0] == 0 && scene->attributes[i].normal[2] == 1);
        CHECK(scene->attributes[i].tangent[3] == 0); // no normal map: none needed
    }
    scene_destroy(scene);
}

// ---- Materials, textures, images

static const uint8_t png8[] = {
    // two texels: 255 0 0 and 0 128 255
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
    0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02, 0x00, 0x00, 0x00, 0x7b, 0x40, 0xe8, 0xdd, 0x00, 0x00, 0x00,
    0x0f, 0x49, 0x44, 0x41, 0x54, 0x78, 0xda, 0x63, 0xf8, 0xcf, 0xc0, 0xc0, 0xd0, 0xf0, 0x1f, 0x00, 0x08, 0x00,
    0x02, 0x7f, 0x25, 0x3e, 0xfc, 0x09, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
};
static const uint8_t png16[] = {
    // one texel: 0xabcd 0x0102 0xffff
    0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00, 0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00,
    0x00, 0x01, 0x00, 0x00, 0x00, 0x01, 0x10, 0x02, 0x00, 0x00, 0x00, 0xc0, 0xe7, 0x8f, 0x9d, 0x00, 0x00, 0x00,
    0x0f, 0x49, 0x44, 0x41, 0x54, 0x78, 0xda, 0x63, 0x58, 0x7d, 0x96, 0x91, 0xe9, 0xff, 0x7f, 0x00, 0x0b, 0x11,
    0x03, 0x7a, 0x89, 0x12, 0xb8, 0xeb, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82,
};

TEST(a_material_carries_its_factors)
{
    scene_data *const scene = load_triangle(
        TRIANGLE ",'extensionsUsed':['KHR_materials_emissive_strength'],'materials':[{'name':'lamp','doubleSided':true,"
                 "'alphaMode':'MASK','alphaCutoff':0.25,'emissiveFactor':[1,0.5,0],'extensions':{"
                 "'KHR_materials_emissive_strength':{'emissiveStrength':8}},'pbrMetallicRoughness':{'baseColorFactor':"
                 "[0.1,0.2,0.3,0.4],'metallicFactor':0.6,'roughnessFactor':0.7}}]");
    CHECK(scene && scene->material_count == 2 && scene->warning_count == 0);
    if (scene) {
        const material *const m = &scene->materials[0];
        CHECK_STRING(scene->material_names[0], "lamp");
        CHECK(m->base_color[0] == 0.1f && m->base_color[3] == 0.4f && m->metallic == 0.6f && m->roughness == 0.7f);
        CHECK(m->emissive[0] == 8 && m->emissive[1] == 4 && m->emissive[2] == 0);
        CHECK(m->flags == (MATERIAL_ALPHA_MASK | MATERIAL_DOUBLE_SIDED) && m->alpha_cutoff == 0.25f);
        CHECK(m->base_texture.texture == TEXTURE_NONE && m->normal_scale == 1);
    }
    scene_destroy(scene);
}

TEST(the_default_material_comes_last_and_serves_primitives_without_one)
{
    scene_data *const scene =
        load_triangle(TRIANGLE ",'materials':[{'pbrMetallicRoughness':{'baseColorFactor':[0,0,0,1]}}]");
    CHECK(scene && scene->material_count == 2 && scene->primitives[0].material == 1);
    CHECK(scene && scene->materials[1].base_color[0] == 1 && scene->materials[1].flags == 0);
    scene_destroy(scene);
}

TEST(blended_materials_are_masks_at_one_half_with_one_warning)
{
    scene_data *const scene =
        load_triangle(TRIANGLE ",'materials':[{'alphaMode':'BLEND','alphaCutoff':0.9},{'alphaMode':'BLEND'}]");
    CHECK(scene && scene->materials[0].flags == MATERIAL_ALPHA_MASK && scene->materials[0].alpha_cutoff == 0.5f);
    CHECK(scene && scene->warning_count == 1 && strstr(test_log.warning, "2 materials blend"));
    scene_destroy(scene);
}

static scene_data *load_textured(const char *images, const char *rest)
{
    char members[2048];
    snprintf(members, sizeof(members), "%s,'images':[%s],%s", SURFACE, images, rest);
    return load_surface(members);
}

#define PNG8_URI                                                                                                       \
    "{'uri':'data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAIAAAB7QOjdAAAAD0lEQVR42mP4z8DA0PAfAAgAAn8l"       \
    "PvwJAAAAAElFTkSuQmCC'}"

TEST(an_image_used_as_colour_and_as_data_becomes_two_textures)
{
    scene_data *const scene =
        load_textured(PNG8_URI, "'textures':[{'source':0,'sampler':0}],'samplers':[{'magFilter':9728,'wrapS':33071}],"
                                "'materials':[{'normalTexture':{'index':0,'scale':0.5},'emissiveTexture':{'index':0},"
                                "'pbrMetallicRoughness':{'baseColorTexture':{'index':0,'texCoord':1}}}]");
    CHECK(scene && scene->texture_count == 2 && scene->image_count == 1);
    if (scene) {
        const material *const m = &scene->materials[0];
        const scene_texture *const colour = &scene->textures[m->base_texture.texture];
        CHECK(colour->srgb && !scene->textures[m->normal_texture.texture].srgb && m->normal_scale == 0.5f);
        CHECK(m->emissive_texture.texture == m->base_texture.texture && m->base_texture.uv_set == 1);
        CHECK(colour->mag_filter == 9728 && colour->min_filter == 0 && colour->wrap_s == 33071 &&
              colour->wrap_t == 10497);
        const uint8_t expected[] = {255, 0, 0, 255, 0, 128, 255, 255};
        CHECK(scene->images[0].width == 2 && memcmp(scene->images[0].texels, expected, sizeof(expected)) == 0);
    }
    scene_destroy(scene);
}

TEST(images_come_from_buffer_views_too)
{
    uint8_t bytes[96 + sizeof(png8)];
    memcpy(bytes, &surface, 96);
    memcpy(bytes + 96, png8, sizeof(png8));
    char members[2048];
    snprintf(members, sizeof(members),
             "'bufferViews':[{'buffer':0,'byteLength':96},{'buffer':0,'byteOffset':96,'byteLength':%zu}],"
             "'images':[{'bufferView':1,'mimeType':'image/png'}],'textures':[{'source':0}],"
             "'materials':[{'emissiveTexture':{'index':0}}]",
             sizeof(png8));
    scene_data *const scene = load_members("embedded.gltf", bytes, sizeof(bytes), members);
    CHECK(scene && scene->image_count == 1 && scene->images[0].texels[5] == 128);
    scene_destroy(scene);
}

TEST(image_names_may_have_spaces_and_percent_codes)
{
    test_file("a b+%.png", png8, sizeof(png8));
    static const char *const uris[] = {"{'uri':'a%20b+%25.png'}", "{'uri':'a b+%.png'}"};
    for (uint32_t i = 0; i < countof(uris); i++) {
        scene_data *const scene =
            load_textured(uris[i], "'textures':[{'source':0}],'materials':[{'emissiveTexture':{'index':0}}]");
        CHECK(scene && scene->image_count == 1);
        scene_destroy(scene);
    }
}

TEST(sixteen_bit_images_are_reduced_to_eight)
{
    test_file("16.png", png16, sizeof(png16));
    scene_data *const scene =
        load_textured("{'uri':'16.png'}", "'textures':[{'source':0}],'materials':[{'emissiveTexture':{'index':0}}]");
    CHECK(scene && scene->images[0].texels[0] == 0xab && scene->images[0].texels[1] == 1 &&
          scene->images[0].texels[2] == 255);
    scene_destroy(scene);
}

TEST(an_image_that_no_material_uses_may_be_missing)
{
    scene_data *const scene = load_textured("{'uri':'nowhere.png'}", "'textures':[{'source':0}],'materials':[{}]");
    CHECK(scene && scene->image_count == 0 && scene->texture_count == 0);
    scene_destroy(scene);
}

TEST(a_texture_transform_is_translation_times_rotation_times_scale)
{
    scene_data *const scene = load_textured(
        PNG8_URI,
        "'extensionsUsed':['KHR_texture_transform'],'textures':[{'source':0}],'materials':[{'emissiveTexture':"
        "{'index':0,'extensions':{'KHR_texture_transform':{'offset':[0.25,-0.5],'rotation':1.57079633,'scale':[2,3],"
        "'texCoord':1}}}}]");
    CHECK(scene != NULL);
    if (scene) {
        // Scaled to (2u, 3v); a quarter turn takes (x, y) to (y, -x).
        const texture_reference *const t = &scene->materials[0].emissive_texture;
        CHECK_NEAR(t->transform[0], 0, 1e-6);
        CHECK_NEAR(t->transform[1], -2, 1e-6);
        CHECK_NEAR(t->transform[2], 3, 1e-6);
        CHECK_NEAR(t->transform[3], 0, 1e-6);
        CHECK(t->offset[0] == 0.25f && t->offset[1] == -0.5f && t->uv_set == 1);
        CHECK(scene->materials[0].base_texture.transform[0] == 1 && scene->materials[0].base_texture.transform[3] == 1);
    }
    scene_destroy(scene);
}

#define NORMAL_MAP "'textures':[{'source':0}],'materials':[{'normalTexture':{'index':0%s}}]"

TEST(tangents_are_made_where_a_normal_map_needs_them)
{
    char plain[256], turned[256];
    snprintf(plain, sizeof(plain), NORMAL_MAP, "");
    snprintf(turned, sizeof(turned), NORMAL_MAP, ",'extensions':{'KHR_texture_transform':{'scale':[-1,1]}}");
    scene_data *const upright = load_textured(PNG8_URI, plain), *const mirrored = load_textured(PNG8_URI, turned);
    CHECK(upright && mirrored);
    for (uint32_t i = 0; upright && mirrored && i < 3; i++) {
        // cross(normal, tangent) * w is up in the image: z cross x = y.
        CHECK_NEAR(upright->attributes[i].tangent[0], 1, 1e-6);
        CHECK(upright->attributes[i].tangent[3] == 1);
        CHECK_NEAR(mirrored->attributes[i].tangent[0], -1, 1e-6);
        CHECK(mirrored->attributes[i].tangent[3] == -1);
    }
    scene_destroy(upright);
    scene_destroy(mirrored);
}

// ---- Lights and extensions

TEST(lights_of_all_kinds_are_read)
{
    scene_data *const scene = load_triangle(
        TRIANGLE
        ",'extensionsUsed':['KHR_lights_punctual'],'extensions':{'KHR_lights_punctual':{'lights':["
        "{'type':'point','intensity':100,'color':[1,0.5,0]},{'type':'new'},{'type':'spot','spot':{'innerConeAngle':0.1,"
        "'outerConeAngle':0.2}},{'type':'directional','name':'sun','intensity':60,'range':3}]}},"
        "'nodes':[{'extensions':{'KHR_lights_punctual':{'light':3}}},{'extensions':{'KHR_lights_punctual':{'light':1}}}"
        "]");
    CHECK(scene && scene->light_count == 3);
    if (scene) {
        CHECK(scene->lights[0].type == LIGHT_POINT && scene->lights[0].color[0] == 100 &&
              scene->lights[0].color[1] == 50);
        CHECK(scene->lights[1].type == LIGHT_SPOT && scene->lights[1].inner_cone == 0.1f &&
              scene->lights[1].outer_cone == 0.2f);
        CHECK(scene->lights[2].type == LIGHT_DIRECTIONAL && scene->lights[2].color[2] == 60);
        CHECK(scene->nodes[0].light == 2 && scene->nodes[1].light == SCENE_NONE);
        CHECK(scene->warning_count == 1 && strstr(scene->warnings[0], "unknown type \"new\""));
    }
    scene_destroy(scene);
}

TEST(unknown_optional_extensions_are_one_warning_that_names_them)
{
    scene_data *const scene = load_triangle(TRIANGLE ",'extensionsUsed':['EXT_one','EXT_two','KHR_lights_punctual']");
    CHECK(scene && scene->warning_count == 1 && strstr(test_log.warning, "EXT_one, EXT_two"));
    CHECK(strstr(test_log.warning, "triangle.gltf") && !strstr(test_log.warning, "KHR_lights_punctual"));
    scene_destroy(scene);
}

TEST(material_extensions_are_one_warning_even_when_required)
{
    scene_data *const scene =
        load_triangle(TRIANGLE ",'extensionsUsed':['KHR_materials_unlit','KHR_materials_clearcoat'],"
                               "'extensionsRequired':['KHR_materials_unlit']");
    CHECK(scene && scene->warning_count == 1 &&
          strstr(test_log.warning, "KHR_materials_unlit, KHR_materials_clearcoat"));
    scene_destroy(scene);
}

TEST(info_prints_what_the_scene_holds)
{
    scene_data *const scene = load_triangle(
        TRIANGLE
        ",'cameras':[{'name':'eye','type':'perspective','perspective':{'yfov':1,'znear':0.1}}],'nodes':[{'mesh':0},"
        "{'mesh':0,'translation':[5,0,0]},{'camera':0}],'materials':[{'name':'lamp','emissiveFactor':[1,1,0]}],"
        "'extensionsUsed':['EXT_one']");
    char text[4096] = {0};
    FILE *const out = fmemopen(text, sizeof(text), "w");
    CHECK(scene && out);
    if (scene && out) {
        scene_print_info(scene, out);
        fclose(out);
        static const char *const expected[] = {
            "triangles: 1 (2 with instances)", "materials: 1", "\"lamp\": 1 1 0", "\"eye\"",
            "bounds: 0 0 0 to 6 2 0",          "warnings: 1",  "EXT_one"};
        for (uint32_t i = 0; i < countof(expected); i++) {
            CHECK(strstr(text, expected[i]));
        }
    }
    scene_destroy(scene);
}

// ---- Triangle order

enum { GRID = 48, GRID_TRIANGLES = 2 * GRID * GRID };

static uint32_t random_next(uint32_t *state)
{
    *state = *state * 747796405u + 2891336453u;
    return (*state >> ((*state >> 28) + 4) ^ *state) * 277803737u >> 8;
}

// A bumpy grid's triangles in random order.
static void grid_make(float (*positions)[3], uint32_t *indices)
{
    for (uint32_t y = 0; y <= GRID; y++) {
        for (uint32_t x = 0; x <= GRID; x++) {
            const float p[3] = {(float)x, sinf((float)x * 0.3f) * cosf((float)y * 0.2f), (float)y};
            memcpy(positions[y * (GRID + 1) + x], p, sizeof(p));
        }
    }
    for (uint32_t i = 0; i < GRID_TRIANGLES; i++) {
        const uint32_t x = i / 2 % GRID, y = i / 2 / GRID, a = y * (GRID + 1) + x, b = a + GRID + 1;
        const uint32_t corners[2][3] = {{a, b, a + 1}, {b, b + 1, a + 1}};
        memcpy(indices + 3 * i, corners[i % 2], sizeof(corners[0]));
    }
    for (uint32_t i = GRID_TRIANGLES - 1, state = 1; i > 0; i--) {
        const uint32_t k = random_next(&state) % (i + 1);
        for (uint32_t c = 0; c < 3; c++) {
            const uint32_t swap = indices[3 * i + c];
            indices[3 * i + c] = indices[3 * k + c];
            indices[3 * k + c] = swap;
        }
    }
}

static int compare_triangles(const void *a, const void *b)
{
    return memcmp(a, b, 3 * sizeof(uint32_t));
}

typedef struct grid {
    float positions[(GRID + 1) * (GRID + 1)][3];
    uint32_t before[3 * GRID_TRIANGLES], after[3 * GRID_TRIANGLES];
    float corners_before[3 * GRID_TRIANGLES][3], corners_after[3 * GRID_TRIANGLES][3];
} grid;

static const grid *reordered_grid(void)
{
    static grid g;
    grid_make(g.positions, g.before);
    memcpy(g.after, g.before, sizeof(g.after));
    scene_primitive_reorder(g.after, countof(g.after), (const float(*)[3])g.positions);
    for (uint32_t i = 0; i < countof(g.after); i++) {
        memcpy(g.corners_before[i], g.positions[g.before[i]], sizeof(g.corners_before[i]));
        memcpy(g.corners_after[i], g.positions[g.after[i]], sizeof(g.corners_after[i]));
    }
    return &g;
}

TEST(reordering_permutes_whole_triangles)
{
    static grid g;
    g = *reordered_grid();
    CHECK(memcmp(g.before, g.after, sizeof(g.before)) != 0);
    qsort(g.before, GRID_TRIANGLES, 3 * sizeof(uint32_t), compare_triangles);
    qsort(g.after, GRID_TRIANGLES, 3 * sizeof(uint32_t), compare_triangles);
    CHECK(memcmp(g.before, g.after, sizeof(g.before)) == 0);
}

TEST(reordering_is_deterministic)
{
    static grid first;
    first = *reordered_grid();
    CHECK(memcmp(first.after, reordered_grid()->after, sizeof(first.after)) == 0);
}

static double halves_overlap(const float (*corners)[3], uint32_t triangles)
{
    const uint32_t half = triangles / 2;
    const test_box a = test_box_of(corners, 3 * half), b = test_box_of(corners + 3 * half, 3 * (triangles - half));
    double overlap = 1;
    for (int axis = 0; axis < 3; axis += 2) { // seen from above: the grid is flat
        overlap *= fmax(0, fmin(a.max[axis], b.max[axis]) - fmax(a.min[axis], b.min[axis])) / GRID;
    }
    return overlap;
}

TEST(the_halves_of_a_reordered_list_barely_overlap)
{
    const grid *const g = reordered_grid();
    CHECK(halves_overlap(g->corners_before, GRID_TRIANGLES) > 0.9);
    CHECK(halves_overlap(g->corners_after, GRID_TRIANGLES) < 0.05);
}

TEST(halving_a_reordered_list_costs_a_small_part_of_a_random_one)
{
    const grid *const g = reordered_grid();
    const double before = halving_cost(g->corners_before, GRID_TRIANGLES),
                 after = halving_cost(g->corners_after, GRID_TRIANGLES);
    CHECK(after < 0.05 * before);
}

TEST(reordering_none_or_one_triangle_does_nothing)
{
    uint32_t indices[3] = {2, 0, 1};
    const float positions[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    scene_primitive_reorder(indices, 0, positions);
    scene_primitive_reorder(indices, 3, positions);
    CHECK(indices[0] == 2 && indices[1] == 0 && indices[2] == 1);
}

int main(void)
{
    scene_test_begin();
    RUN(a_triangle_loads_with_counts_and_bounds);
    RUN(a_file_without_geometry_loads);
    RUN(a_glb_loads_from_its_binary_chunk);
    RUN(parents_come_before_children_and_world_matrices_multiply);
    RUN(translation_rotation_scale_and_the_same_matrix_agree);
    RUN(mirrored_and_non_uniform_scales_stay_in_the_matrix);
    RUN(only_the_default_scene_is_instanced);
    RUN(the_first_scene_is_the_default_and_without_scenes_all_roots);
    RUN(a_camera_has_its_own_name_or_its_nodes);
    RUN(an_orthographic_camera_is_a_perspective_one_with_a_warning);
    RUN(indices_of_every_width_and_none_give_the_same_triangle);
    RUN(strips_and_fans_become_triangles_that_keep_their_side);
    RUN(points_and_lines_are_left_out_with_one_warning);
    RUN(primitives_that_share_accessors_take_only_their_vertices);
    RUN(zero_area_triangles_are_left_out_and_counted);
    RUN(sparse_values_replace_those_of_the_view);
    RUN(sparse_accessors_without_a_view_start_from_zeros);
    RUN(floats_and_normalized_integers_mean_the_same);
    RUN(vertices_without_colours_are_white);
    RUN(quantized_interleaved_positions_are_read);
    RUN(missing_normals_become_flat_and_share_no_vertices);
    RUN(normals_without_direction_are_repaired_and_all_are_unit);
    RUN(a_material_carries_its_factors);
    RUN(the_default_material_comes_last_and_serves_primitives_without_one);
    RUN(blended_materials_are_masks_at_one_half_with_one_warning);
    RUN(an_image_used_as_colour_and_as_data_becomes_two_textures);
    RUN(images_come_from_buffer_views_too);
    RUN(image_names_may_have_spaces_and_percent_codes);
    RUN(sixteen_bit_images_are_reduced_to_eight);
    RUN(an_image_that_no_material_uses_may_be_missing);
    RUN(a_texture_transform_is_translation_times_rotation_times_scale);
    RUN(tangents_are_made_where_a_normal_map_needs_them);
    RUN(lights_of_all_kinds_are_read);
    RUN(unknown_optional_extensions_are_one_warning_that_names_them);
    RUN(material_extensions_are_one_warning_even_when_required);
    RUN(info_prints_what_the_scene_holds);
    RUN(reordering_permutes_whole_triangles);
    RUN(reordering_is_deterministic);
    RUN(the_halves_of_a_reordered_list_barely_overlap);
    RUN(halving_a_reordered_list_costs_a_small_part_of_a_random_one);
    RUN(reordering_none_or_one_triangle_does_nothing);
    return scene_test_end();
}
