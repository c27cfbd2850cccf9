// Scene import: files that lie or lack something are refused with one line that names the file and the thing.
#include "scene_test.h"

#include <sys/stat.h>

#define REFUSED(members, thing) check_refused(__FILE__, __LINE__, load_triangle(members), "triangle.gltf", thing)
#define FILE_REFUSED(name, bytes, size, thing)                                                                         \
    (test_file(name, bytes, size), log_clear(),                                                                        \
     check_refused(__FILE__, __LINE__, scene_load(test_path(name)), name, thing))

// ---- The file

TEST(a_missing_file_is_refused)
{
    log_clear();
    check_refused(__FILE__, __LINE__, scene_load(test_path("nowhere.gltf")), "nowhere.gltf", "No such file");
}

TEST(a_directory_is_refused)
{
    log_clear();
    check_refused(__FILE__, __LINE__, scene_load(test_folder), test_folder, "not a regular file");
}

TEST(an_empty_file_is_refused)
{
    FILE_REFUSED("empty.gltf", "", 0, "empty");
    FILE_REFUSED("empty.glb", "", 0, "empty");
}

TEST(a_glb_with_the_wrong_magic_is_refused)
{
    FILE_REFUSED("magic.glb", "GLTF\2\0\0\0\x20\0\0\0", 12, "wrong magic");
}

TEST(a_glb_truncated_anywhere_is_refused)
{
    static const char json[] = "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":4}]}";
    enum { JSON_SIZE = sizeof(json) - 1, SIZE = 12 + 8 + JSON_SIZE + 8 + 4 };
    _Static_assert(JSON_SIZE % 4 == 0, "chunks are padded");
    uint8_t glb[SIZE] = {0};
    const uint32_t header[] = {0x46546C67, 2, SIZE, JSON_SIZE, 0x4E4F534A}, chunk[] = {4, 0x004E4942};
    memcpy(glb, header, sizeof(header));
    memcpy(glb + 20, json, JSON_SIZE);
    memcpy(glb + 20 + JSON_SIZE, chunk, sizeof(chunk));
    for (uint32_t size = 4; size < SIZE; size++) {
        // With the header's length as it was, and with one that admits the loss.
        memcpy(glb + 8, &(uint32_t){SIZE}, 4);
        FILE_REFUSED("short.glb", glb, size, "truncated");
        if (size >= 12 && size != 20 + JSON_SIZE) {
            memcpy(glb + 8, &size, 4);
            FILE_REFUSED("short.glb", glb, size, "truncated");
        }
    }
}

TEST(what_is_not_json_is_refused_with_its_line)
{
    static const char text[] = "{\n \"asset\": {\n  oops\n";
    FILE_REFUSED("text.gltf", text, sizeof(text) - 1, "line 3");
}

TEST(json_nested_very_deep_is_refused)
{
    static char text[200000];
    memset(text, '[', sizeof(text));
    FILE_REFUSED("deep.gltf", text, sizeof(text), "JSON");
}

TEST(another_gltf_version_is_refused)
{
    static const char text[] = "{\"asset\":{\"version\":\"1.0\"}}";
    FILE_REFUSED("old.gltf", text, sizeof(text) - 1, "version \"1.0\"");
}

TEST(an_unknown_required_extension_is_refused_by_name)
{
    REFUSED(TRIANGLE ",'extensionsRequired':['KHR_draco_mesh_compression']", "KHR_draco_mesh_compression");
}

// ---- Buffers, views, accessors

TEST(a_missing_buffer_file_is_refused_by_name)
{
    static const char text[] = "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"uri\":\"x.bin\",\"byteLength\":4}]}";
    FILE_REFUSED("external.gltf", text, sizeof(text) - 1, "buffer \"x.bin\"");
}

TEST(a_buffer_file_that_is_too_short_is_refused_by_name)
{
    test_file("y.bin", "12", 2);
    static const char text[] = "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"uri\":\"y.bin\",\"byteLength\":4}]}";
    FILE_REFUSED("external.gltf", text, sizeof(text) - 1, "buffer \"y.bin\" has 2 bytes, expected byteLength 4");
}

TEST(a_buffer_that_is_a_directory_or_a_pipe_is_refused)
{
    CHECK(mkdir(test_path("z.bin"), 0777) == 0 && mkfifo(test_path("w.bin"), 0666) == 0);
    static const char z[] = "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"uri\":\"z.bin\",\"byteLength\":4}]}";
    static const char w[] = "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"uri\":\"w.bin\",\"byteLength\":4}]}";
    FILE_REFUSED("external.gltf", z, sizeof(z) - 1, "buffer \"z.bin\"");
    FILE_REFUSED("external.gltf", w, sizeof(w) - 1, "buffer \"w.bin\"");
}

TEST(broken_base64_is_refused)
{
    static const char text[] =
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"uri\":\"data:;base64,AA*A\",\"byteLength\":1}]}";
    FILE_REFUSED("base64.gltf", text, sizeof(text) - 1, "buffer 0");
}

TEST(a_view_past_its_buffer_is_refused)
{
    REFUSED("'bufferViews':[{'buffer':0,'byteLength':45}]", "buffer view 0");
    REFUSED("'bufferViews':[{'buffer':0,'byteLength':36},{'buffer':0,'byteOffset':44,'byteLength':1}]",
            "buffer view 1");
}

TEST(a_view_of_no_buffer_is_refused)
{
    REFUSED("'bufferViews':[{'buffer':7,'byteLength':1}]", "buffer 7 does not exist");
}

TEST(an_accessor_past_its_view_is_refused)
{
    REFUSED(TRIANGLE_VIEWS ",'accessors':[{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'}]",
            "accessor 0");
    REFUSED(TRIANGLE_VIEWS
            ",'accessors':[{'bufferView':0,'byteOffset':4,'componentType':5126,'count':3,'type':'VEC3'}]",
            "accessor 0");
}

TEST(an_accessor_of_no_view_is_refused)
{
    REFUSED(TRIANGLE_VIEWS ",'accessors':[{'bufferView':2,'componentType':5126,'count':1,'type':'VEC3'}]",
            "accessor 0: buffer view 2 does not exist");
}

TEST(a_negative_offset_is_refused)
{
    REFUSED(TRIANGLE_VIEWS
            ",'accessors':[{'bufferView':0,'byteOffset':-12,'componentType':5126,'count':1,'type':'VEC3'}]",
            "accessors[0].byteOffset is -12");
    REFUSED("'bufferViews':[{'buffer':0,'byteOffset':-4,'byteLength':4}]", "bufferViews[0].byteOffset is -4");
}

TEST(offsets_that_would_overflow_are_refused)
{
    REFUSED(TRIANGLE_VIEWS ",'accessors':[{'bufferView':0,'byteOffset':1099511627776,'componentType':5126,'count':1,"
                           "'type':'VEC3'}]",
            "accessor 0");
    REFUSED("'bufferViews':[{'buffer':0,'byteOffset':18446744073709551612,'byteLength':8}]",
            "bufferViews[0].byteOffset");
    REFUSED("'bufferViews':[{'buffer':0,'byteLength':1e999}]", "bufferViews[0].byteLength");
    REFUSED("'bufferViews':[{'buffer':4294967296,'byteLength':4}]", "bufferViews[0].buffer");
}

TEST(counts_that_are_no_integers_are_refused)
{
    REFUSED("'bufferViews':[{'buffer':0,'byteLength':1.5}]", "bufferViews[0].byteLength is 1.5");
    REFUSED("'bufferViews':[{'buffer':'0','byteLength':1}]", "bufferViews[0].buffer: expected a number");
}

TEST(a_thousand_million_claimed_vertices_are_refused)
{
    REFUSED(TRIANGLE_VIEWS ",'accessors':[{'bufferView':0,'componentType':5126,'count':1000000000,'type':'VEC3'}],"
                           "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]",
            "accessor 0: 1000000000 elements");
    REFUSED("'accessors':[{'componentType':5126,'count':1000000000,'type':'VEC3'}],"
            "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]",
            "accessor 0 claims 1000000000 elements");
}

TEST(the_same_bytes_named_many_times_do_not_add_up_without_limit)
{
    static char members[65536];
    int length =
        snprintf(members, sizeof(members),
                 "'accessors':[{'componentType':5126,'count':1048576,'type':'VEC3'}],'meshes':[{'primitives':[");
    for (int i = 0; i < 40; i++) {
        length += snprintf(members + length, sizeof(members) - (size_t)length,
                           "%s{'attributes':{'POSITION':0},'mode':5}", i ? "," : "");
    }
    snprintf(members + length, sizeof(members) - (size_t)length, "]}]");
    REFUSED(members, "in all");
}

TEST(an_accessor_of_unknown_type_is_refused)
{
    REFUSED(TRIANGLE_VIEWS ",'accessors':[{'bufferView':0,'componentType':5126,'count':1,'type':'VEC9'}]",
            "accessors[0]");
    REFUSED(TRIANGLE_VIEWS ",'accessors':[{'bufferView':0,'componentType':5130,'count':1,'type':'VEC3'}]",
            "accessors[0]");
    REFUSED(TRIANGLE_VIEWS ",'accessors':[{'bufferView':0,'componentType':5126,'count':1}]",
            "accessors[0] has no \"type\"");
}

#define SPARSE(sparse)                                                                                                 \
    TRIANGLE_VIEWS ",'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3','sparse':{" sparse      \
                   "}}],'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]"

TEST(lying_sparse_accessors_are_refused)
{
    REFUSED(SPARSE("'count':4,'indices':{'bufferView':1,'componentType':5123},'values':{'bufferView':0}"),
            "accessor 0");
    REFUSED(
        SPARSE("'count':3,'indices':{'bufferView':1,'byteOffset':2,'componentType':5123},'values':{'bufferView':0}"),
        "accessor 0.sparse.indices");
    REFUSED(
        SPARSE("'count':2,'indices':{'bufferView':1,'componentType':5123},'values':{'bufferView':0,'byteOffset':16}"),
        "accessor 0.sparse.values");
    REFUSED(
        SPARSE("'count':1,'indices':{'bufferView':0,'byteOffset':12,'componentType':5125},'values':{'bufferView':0}"),
        "accessor 0: sparse index 0");
    REFUSED(SPARSE("'count':1,'indices':{'bufferView':9,'componentType':5123},'values':{'bufferView':0}"),
            "buffer view 9");
    REFUSED(SPARSE("'count':1,'indices':{'bufferView':1,'byteOffset':4294967296,'componentType':5123},"
                   "'values':{'bufferView':0}"),
            "accessors[0].sparse.indices.byteOffset");
}

// ---- Meshes

TEST(an_index_past_the_vertices_is_refused)
{
    static const triangle_bytes bytes = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0, 1, 3}, 0};
    log_clear();
    check_refused(__FILE__, __LINE__, load_members("index.gltf", &bytes, sizeof(bytes), TRIANGLE), "index.gltf",
                  "mesh 0 primitive 0: index 2 (accessor 1) is 3");
}

TEST(positions_that_are_not_finite_are_refused)
{
    const float bad[] = {NAN, INFINITY, -INFINITY};
    for (uint32_t i = 0; i < countof(bad); i++) {
        triangle_bytes bytes = triangle;
        bytes.positions[1][i] = bad[i];
        check_refused(__FILE__, __LINE__, load_members("nan.gltf", &bytes, sizeof(bytes), TRIANGLE), "nan.gltf",
                      "mesh 0 primitive 0: the position of vertex 1 (accessor 0) is not finite");
    }
}

TEST(attributes_of_different_lengths_are_refused)
{
    REFUSED(TRIANGLE_VIEWS ",'accessors':[{'bufferView':0,'componentType':5126,'count':3,'type':'VEC3'},"
                           "{'bufferView':0,'componentType':5126,'count':2,'type':'VEC3'}],"
                           "'meshes':[{'name':'m','primitives':[{'attributes':{'POSITION':0,'NORMAL':1}}]}]",
            "mesh 0 \"m\" primitive 0: accessor 1 (NORMAL) has 2 elements");
}

TEST(attributes_of_the_wrong_type_are_refused)
{
    REFUSED(TRIANGLE_VIEWS "," TRIANGLE_ACCESSORS ",'meshes':[{'primitives':[{'attributes':{'POSITION':1}}]}]",
            "accessor 1 has the wrong type for POSITION");
    REFUSED(TRIANGLE_VIEWS "," TRIANGLE_ACCESSORS
                           ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':0}]}]",
            "accessor 0 has the wrong type for indices");
}

TEST(primitives_that_point_nowhere_are_refused)
{
    REFUSED(TRIANGLE_VIEWS "," TRIANGLE_ACCESSORS ",'meshes':[{'primitives':[{'attributes':{'POSITION':5}}]}]",
            "mesh 0 primitive 0: accessor 5 does not exist");
    REFUSED(TRIANGLE_VIEWS "," TRIANGLE_ACCESSORS
                           ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':6}]}]",
            "mesh 0 primitive 0: accessor 6 does not exist");
    REFUSED(TRIANGLE_VIEWS "," TRIANGLE_ACCESSORS
                           ",'meshes':[{'primitives':[{'attributes':{'POSITION':0},'material':0}]}]",
            "mesh 0 primitive 0: material 0 does not exist");
}

// ---- Nodes

TEST(a_cycle_in_the_node_tree_is_refused)
{
    REFUSED("'nodes':[{},{'children':[2]},{'name':'loop','children':[1]}]", "cycle");
    REFUSED("'nodes':[{'children':[0]}]", "node 0 is part of a cycle");
}

TEST(a_node_with_two_parents_is_refused)
{
    REFUSED("'nodes':[{'children':[2]},{'children':[2]},{}]", "node 2 has two parents");
    REFUSED("'nodes':[{'children':[1,1]},{}]", "node 1 has two parents");
}

TEST(nodes_that_point_nowhere_are_refused)
{
    REFUSED("'nodes':[{'children':[1]}]", "node 0: child node 1 does not exist");
    REFUSED("'nodes':[{'name':'n','mesh':0}]", "node 0 \"n\": mesh 0 does not exist");
    REFUSED("'nodes':[{'camera':0}]", "node 0: camera 0 does not exist");
    REFUSED("'nodes':[{'skin':0}]", "node 0: skin 0 does not exist");
    REFUSED("'nodes':[{'extensions':{'KHR_lights_punctual':{'light':1}}}]", "node 0: light 1 does not exist");
    REFUSED("'nodes':[{}],'scenes':[{'nodes':[1]}]", "scene 0: node 1 does not exist");
    REFUSED("'nodes':[{}],'scene':1,'scenes':[{'nodes':[0]}]", "scene 1 does not exist");
    REFUSED("'nodes':[{'children':[1]},{}],'scenes':[{'nodes':[1]}]", "node 1 is not a root");
}

TEST(transforms_of_the_wrong_size_or_not_finite_are_refused)
{
    REFUSED("'nodes':[{'translation':[1,2]}]", "node 0: translation has 2 numbers");
    REFUSED("'nodes':[{'matrix':[1,0,0,0]}]", "node 0: matrix has 4 numbers");
    REFUSED("'nodes':[{'scale':[1e39,1,1]}]", "node 0: scale is not finite");
    REFUSED("'nodes':[{'scale':[1e30,1,1],'children':[1]},{'name':'far','scale':[1e30,1,1]}]", "\"far\"");
}

TEST(a_chain_of_many_nodes_loads)
{
    enum { NODES = 3000 };
    static char members[40 * NODES];
    int length = snprintf(members, sizeof(members), "'nodes':[");
    for (int i = 0; i < NODES; i++) {
        length += i + 1 < NODES
                      ? snprintf(members + length, sizeof(members) - (size_t)length, "{'children':[%d]},", i + 1)
                      : snprintf(members + length, sizeof(members) - (size_t)length, "{}]");
    }
    scene_data *const scene = load_triangle(members);
    CHECK(scene && scene->node_count == NODES);
    scene_destroy(scene);
}

// ---- Materials, images, lights, cameras

TEST(a_material_with_a_texture_that_does_not_exist_is_refused)
{
    REFUSED("'materials':[{'name':'m','emissiveTexture':{'index':3}}]", "material 0 \"m\": texture 3 does not exist");
}

TEST(a_texture_with_an_image_or_sampler_that_does_not_exist_is_refused)
{
    REFUSED("'materials':[{'emissiveTexture':{'index':0}}],'textures':[{'source':2}]",
            "texture 0: image 2 does not exist");
    REFUSED("'materials':[{'emissiveTexture':{'index':0}}],'textures':[{'source':0,'sampler':4}],'images':[{'uri':'i."
            "png'}]",
            "texture 0: sampler 4 does not exist");
}

TEST(a_missing_image_file_is_refused_by_name)
{
    REFUSED(
        "'materials':[{'emissiveTexture':{'index':0}}],'textures':[{'source':0}],'images':[{'uri':'no%20where.png'}]",
        "image \"no%20where.png\"");
}

TEST(an_image_that_cannot_be_decoded_is_refused_by_name)
{
    test_file("text.png", "not a picture", 13);
    test_file("cut.png", "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\1\0\0\0\1\x8\2\0\0\0\x90wS\xde", 33);
    test_file("huge.png", "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\x0\xff\xff\xff\x0\xff\xff\xff\x8\2\0\0\0\x90wS\xde", 33);
    static const char *const names[] = {"text.png", "cut.png", "huge.png"};
    for (uint32_t i = 0; i < countof(names); i++) {
        char members[256], thing[64];
        snprintf(members, sizeof(members),
                 "'materials':[{'emissiveTexture':{'index':0}}],'textures':[{'source':0}],'images':[{'uri':'%s'}]",
                 names[i]);
        snprintf(thing, sizeof(thing), "image \"%s\" cannot be decoded", names[i]);
        REFUSED(members, thing);
    }
}

// 2^27 texels by the header, nine times.
TEST(images_that_are_large_in_all_are_refused_before_they_are_decoded)
{
    test_file("large.png", "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x40\0\0\0\x20\0\x8\2\0\0\0\x90wS\xde", 33);
    char materials[1024] = "", textures[512] = "", images[512] = "", members[4096];
    for (int i = 0; i < 9; i++) {
        const char *const comma = i > 0 ? "," : "";
        snprintf(materials + strlen(materials), 64, "%s{'emissiveTexture':{'index':%d}}", comma, i);
        snprintf(textures + strlen(textures), 32, "%s{'source':%d}", comma, i);
        snprintf(images + strlen(images), 32, "%s{'uri':'large.png'}", comma);
    }
    snprintf(members, sizeof members, "'materials':[%s],'textures':[%s],'images':[%s]", materials, textures, images);
    REFUSED(members, "at most 2^30 texels in all");
}

TEST(a_view_past_its_buffer_is_refused_for_images_too)
{
    REFUSED("'materials':[{'emissiveTexture':{'index':0}}],'textures':[{'source':0}],'images':[{'bufferView':1}]",
            "buffer view 1 does not exist");
}

TEST(impossible_lights_and_cameras_are_refused)
{
#define LIGHTS(light) "'extensions':{'KHR_lights_punctual':{'lights':[" light "]}}"
    REFUSED(LIGHTS("{'type':'point','intensity':-1}"), "light 0");
    REFUSED(LIGHTS("{}"), "lights[0] has no \"type\"");
    REFUSED(LIGHTS("{'type':'spot'}"), "lights[0]");
    REFUSED(LIGHTS("{'type':'spot','spot':{'innerConeAngle':0.5,'outerConeAngle':0.4}}"), "light 0");
    REFUSED("'cameras':[{'type':'perspective'}]", "cameras[0]");
    REFUSED("'cameras':[{'type':'perspective','perspective':{'yfov':1}}]", "cameras[0].perspective has no \"znear\"");
}

int main(void)
{
    scene_test_begin();
    RUN(a_missing_file_is_refused);
    RUN(a_directory_is_refused);
    RUN(an_empty_file_is_refused);
    RUN(a_glb_with_the_wrong_magic_is_refused);
    RUN(a_glb_truncated_anywhere_is_refused);
    RUN(what_is_not_json_is_refused_with_its_line);
    RUN(json_nested_very_deep_is_refused);
    RUN(another_gltf_version_is_refused);
    RUN(an_unknown_required_extension_is_refused_by_name);
    RUN(a_missing_buffer_file_is_refused_by_name);
    RUN(a_buffer_file_that_is_too_short_is_refused_by_name);
    RUN(a_buffer_that_is_a_directory_or_a_pipe_is_refused);
    RUN(broken_base64_is_refused);
    RUN(images_that_are_large_in_all_are_refused_before_they_are_decoded);
    RUN(a_view_past_its_buffer_is_refused);
    RUN(a_view_of_no_buffer_is_refused);
    RUN(an_accessor_past_its_view_is_refused);
    RUN(an_accessor_of_no_view_is_refused);
    RUN(a_negative_offset_is_refused);
    RUN(offsets_that_would_overflow_are_refused);
    RUN(counts_that_are_no_integers_are_refused);
    RUN(a_thousand_million_claimed_vertices_are_refused);
    RUN(the_same_bytes_named_many_times_do_not_add_up_without_limit);
    RUN(an_accessor_of_unknown_type_is_refused);
    RUN(lying_sparse_accessors_are_refused);
    RUN(an_index_past_the_vertices_is_refused);
    RUN(positions_that_are_not_finite_are_refused);
    RUN(attributes_of_different_lengths_are_refused);
    RUN(attributes_of_the_wrong_type_are_refused);
    RUN(primitives_that_point_nowhere_are_refused);
    RUN(a_cycle_in_the_node_tree_is_refused);
    RUN(a_node_with_two_parents_is_refused);
    RUN(nodes_that_point_nowhere_are_refused);
    RUN(transforms_of_the_wrong_size_or_not_finite_are_refused);
    RUN(a_chain_of_many_nodes_loads);
    RUN(a_material_with_a_texture_that_does_not_exist_is_refused);
    RUN(a_texture_with_an_image_or_sampler_that_does_not_exist_is_refused);
    RUN(a_missing_image_file_is_refused_by_name);
    RUN(an_image_that_cannot_be_decoded_is_refused_by_name);
    RUN(a_view_past_its_buffer_is_refused_for_images_too);
    RUN(impossible_lights_and_cameras_are_refused);
    return scene_test_end();
}
