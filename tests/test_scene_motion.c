// Scene import: skins, morph targets, the meshes that they deform, and animations.
#include "scene_test.h"

// A square of two triangles, 0 1 2 and 2 1 3, and what can move it.
typedef struct motion_bytes {
    float positions[4][3];
    uint16_t indices[6], padding[2];
    uint8_t joints[4][4];
    float weights[4][4];
    uint16_t more_joints[4][4];
    uint8_t more_weights[4][4]; // normalised
    float inverse_bind[2][16];
    float lift[4][3]; // morph target
    uint16_t lifted[2]; // sparse indices of another
    float by[2][3]; // and its values
    float times[3];
    float places[9][3]; // three keys with tangents; without, the first three
    int16_t turns[3][4]; // normalised quaternions
    float numbers[6];
} motion_bytes;

static const motion_bytes motion = {
    .positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}},
    .indices = {0, 1, 2, 2, 1, 3},
    .joints = {{0, 1, 9, 9}, {1, 0, 9, 9}, {0, 1, 0, 0}, {1, 0, 0, 0}},
    .weights = {{0.25f, 0.75f, 0, 0}, {1, 1, 0, 0}, {1, 0, 0, 0}, {0.5f, 0.125f, 0, 0}},
    .more_joints = {{1, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}, {0, 1, 0, 0}},
    .more_weights = {{255, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}, {0, 51, 0, 0}},
    .inverse_bind = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1},
                     {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1}},
    .lift = {{0, 0, 1}, {0, 0, 2}, {0, 0, 3}, {0, 0, 4}},
    .lifted = {1, 3},
    .by = {{0, 5, 0}, {0, 6, 0}},
    .times = {0.5f, 1, 3},
    .places = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {10, 11, 12}},
    .turns = {{0, 0, 0, 32767}, {32767, 0, 0, 0}, {0, -32767, 0, 0}},
    .numbers = {1, 2, 3, 4, 5, 6},
};

enum {
    POSITIONS,
    INDICES,
    JOINTS,
    WEIGHTS,
    MORE_JOINTS,
    MORE_WEIGHTS,
    BIND,
    LIFT,
    SPARSE,
    TIMES,
    PLACES,
    SPLINE,
    TURNS
};
enum { ONE_NUMBER = TURNS + 1, TWO_NUMBERS, SIX_NUMBERS };

static const char *accessors(void)
{
    static char text[4096];
    static const struct {
        size_t offset;
        int component_type;
        const char *rest;
    } table[] = {
        [POSITIONS] = {offsetof(motion_bytes, positions), 5126, "'count':4,'type':'VEC3'"},
        [INDICES] = {offsetof(motion_bytes, indices), 5123, "'count':6,'type':'SCALAR'"},
        [JOINTS] = {offsetof(motion_bytes, joints), 5121, "'count':4,'type':'VEC4'"},
        [WEIGHTS] = {offsetof(motion_bytes, weights), 5126, "'count':4,'type':'VEC4'"},
        [MORE_JOINTS] = {offsetof(motion_bytes, more_joints), 5123, "'count':4,'type':'VEC4'"},
        [MORE_WEIGHTS] = {offsetof(motion_bytes, more_weights), 5121, "'normalized':true,'count':4,'type':'VEC4'"},
        [BIND] = {offsetof(motion_bytes, inverse_bind), 5126, "'count':2,'type':'MAT4'"},
        [LIFT] = {offsetof(motion_bytes, lift), 5126, "'count':4,'type':'VEC3'"},
        [TIMES] = {offsetof(motion_bytes, times), 5126, "'count':3,'type':'SCALAR'"},
        [PLACES] = {offsetof(motion_bytes, places), 5126, "'count':3,'type':'VEC3'"},
        [SPLINE] = {offsetof(motion_bytes, places), 5126, "'count':9,'type':'VEC3'"},
        [TURNS] = {offsetof(motion_bytes, turns), 5122, "'normalized':true,'count':3,'type':'VEC4'"},
        [ONE_NUMBER] = {offsetof(motion_bytes, numbers), 5126, "'count':3,'type':'SCALAR'"},
        [TWO_NUMBERS] = {offsetof(motion_bytes, numbers), 5126, "'count':2,'type':'SCALAR'"},
        [SIX_NUMBERS] = {offsetof(motion_bytes, numbers), 5126, "'count':6,'type':'SCALAR'"},
    };
    int length =
        snprintf(text, sizeof text, "'bufferViews':[{'buffer':0,'byteLength':%zu}],'accessors':[", sizeof motion);
    for (size_t i = 0; i < countof(table); i++) {
        length += snprintf(text + length, sizeof text - (size_t)length, i ? "," : "");
        length += i == SPARSE ? snprintf(text + length, sizeof text - (size_t)length,
                                         "{'componentType':5126,'count':4,'type':'VEC3','sparse':{'count':2,'indices':"
                                         "{'bufferView':0,'byteOffset':%zu,'componentType':5123},'values':"
                                         "{'bufferView':0,'byteOffset':%zu}}}",
                                         offsetof(motion_bytes, lifted), offsetof(motion_bytes, by))
                              : snprintf(text + length, sizeof text - (size_t)length,
                                         "{'bufferView':0,'byteOffset':%zu,'componentType':%d,%s}", table[i].offset,
                                         table[i].component_type, table[i].rest);
    }
    snprintf(text + length, sizeof text - (size_t)length, "]");
    return text;
}

static scene_data *load_bytes(const motion_bytes *bytes, const char *members)
{
    char all[8192];
    snprintf(all, sizeof all, "%s,%s", accessors(), members);
    return load_members("motion.gltf", bytes, sizeof *bytes, all);
}

static scene_data *load_motion(const char *members)
{
    return load_bytes(&motion, members);
}

#define REFUSED(members, thing) check_refused(__FILE__, __LINE__, load_motion(members), "motion.gltf", thing)
#define BYTES_REFUSED(bytes, members, thing)                                                                           \
    check_refused(__FILE__, __LINE__, load_bytes(bytes, members), "motion.gltf", thing)

// The accessors' number of a vertex, by its place.
static uint32_t corner_of(const scene_data *scene, uint32_t vertex)
{
    const float *const p = scene->positions[vertex];
    return (p[0] > 0.5f ? 1u : 0u) + (p[1] > 0.5f ? 2u : 0u);
}

#define SKIN "'skins':[{'name':'s','joints':[1,2],'inverseBindMatrices':6}]"
#define SKINNED(attributes)                                                                                            \
    SKIN ",'nodes':[{'mesh':0,'skin':0,'name':'body'},{'name':'hip','translation':[0,0,9]},{'name':'knee'}],"          \
         "'meshes':[{'primitives':[{'attributes':{'POSITION':0" attributes "},'indices':1}]}]"
#define FOUR ",'JOINTS_0':2,'WEIGHTS_0':3"
#define EIGHT FOUR ",'JOINTS_1':4,'WEIGHTS_1':5"

// ---- Skins

TEST(a_skin_has_its_joints_and_inverse_bind_matrices)
{
    scene_data *const scene = load_motion(SKINNED(FOUR));
    CHECK(scene && test_log.warnings == 0 && scene->skin_count == 1 && scene->deformation_count == 1);
    if (scene) {
        const scene_skin *const skin = &scene->skins[0];
        CHECK_STRING(skin->name, "s");
        CHECK(skin->joint_count == 2);
        CHECK_STRING(scene->nodes[skin->joints[0]].name, "hip");
        CHECK_STRING(scene->nodes[skin->joints[1]].name, "knee");
        CHECK(memcmp(skin->inverse_bind, motion.inverse_bind, sizeof motion.inverse_bind) == 0);
        const scene_deformation *const d = &scene->deformations[0];
        CHECK(d->skin == 0 && d->target_count == 0 && d->vertex_count == scene->vertex_count && d->first_vertex == 0);
        CHECK(scene->nodes[d->node].skin == 0 && scene->nodes[d->node].mesh == d->mesh);
        CHECK(scene->nodes[1].skin == SCENE_NONE && scene->meshes[d->mesh].deformation == 0);
        // At rest: hip alone takes a vertex by 9 along z, knee alone doubles it and shifts it by 5 6 7.
        CHECK(scene->bounds_min[0] == 0 && scene->bounds_max[0] == 7 && scene->bounds_max[1] == 8);
        CHECK(scene->bounds_min[2] == 7 && scene->bounds_max[2] == 9);
    }
    scene_destroy(scene);
}

TEST(a_skin_without_inverse_bind_matrices_has_identities)
{
    scene_data *const scene = load_motion("'skins':[{'joints':[0]}],'nodes':[{}]");
    CHECK(scene && scene->skin_count == 1 && scene->skins[0].inverse_bind[0][5] == 1);
    CHECK(scene && scene->skins[0].inverse_bind[0][4] == 0);
    scene_destroy(scene);
}

// By corner: weights of hip and knee, of sum one.
static void check_influences(const scene_data *scene, const float expected[4][2], const uint32_t used[4])
{
    const scene_deformation *const d = &scene->deformations[0];
    for (uint32_t i = 0; i < d->vertex_count; i++) {
        const scene_influences *const influences = &d->influences[i];
        const uint32_t corner = corner_of(scene, d->first_vertex + i);
        float sums[2] = {0};
        for (uint32_t k = 0; k < SCENE_INFLUENCES; k++) {
            CHECK((influences->weights[k] > 0) == (k < used[corner]));
            CHECK(k == 0 || influences->weights[k] <= influences->weights[k - 1]);
            CHECK(influences->joints[k] < 2);
            sums[influences->joints[k] & 1] += influences->weights[k];
        }
        CHECK_NEAR(sums[0], expected[corner][0], 1e-6);
        CHECK_NEAR(sums[1], expected[corner][1], 1e-6);
    }
}

TEST(four_weights_are_normalised_sorted_and_follow_their_vertices)
{
    static const float expected[4][2] = {{0.25f, 0.75f}, {0.5f, 0.5f}, {1, 0}, {0.2f, 0.8f}};
    scene_data *const scene = load_motion(SKINNED(FOUR));
    CHECK(scene != NULL);
    if (scene) {
        check_influences(scene, expected, (const uint32_t[4]){2, 2, 1, 2});
    }
    scene_destroy(scene);
}

TEST(eight_weights_are_one_sum)
{
    // The second set: knee 1 at corner 0; knee 0.2 at corner 3, beside knee 0.5 and hip 0.125.
    static const float expected[4][2] = {{0.125f, 0.875f}, {0.5f, 0.5f}, {1, 0}, {0.125f / 0.825f, 0.7f / 0.825f}};
    scene_data *const scene = load_motion(SKINNED(EIGHT));
    CHECK(scene != NULL);
    if (scene) {
        check_influences(scene, expected, (const uint32_t[4]){3, 2, 1, 3});
    }
    scene_destroy(scene);
}

TEST(vertices_without_weight_follow_the_first_joint_with_a_warning)
{
    motion_bytes bytes = motion;
    memset(bytes.weights[2], 0, sizeof bytes.weights[2]);
    scene_data *const scene = load_bytes(&bytes, SKINNED(FOUR));
    CHECK(scene && strstr(test_log.warning, "1 vertices of skins have no weight"));
    for (uint32_t i = 0; scene && i < scene->vertex_count; i++) {
        if (corner_of(scene, i) == 2) {
            const scene_influences *const influences = &scene->deformations[0].influences[i];
            CHECK(influences->weights[0] == 1 && influences->joints[0] == 0 && influences->weights[1] == 0);
        }
    }
    scene_destroy(scene);
}

TEST(each_deformed_node_has_a_mesh_of_its_own)
{
    scene_data *const scene =
        load_motion(SKIN ",'nodes':[{'mesh':0,'skin':0},{},{},{'mesh':0},{'mesh':0,'skin':0},{'mesh':0}],"
                         "'meshes':[{'name':'m','primitives':[{'attributes':{'POSITION':0" FOUR "},'indices':1}]}]");
    CHECK(scene && scene->mesh_count == 3 && scene->primitive_count == 3 && scene->deformation_count == 2);
    if (scene) {
        const scene_node *const nodes = scene->nodes;
        CHECK(nodes[3].mesh == nodes[5].mesh && scene->meshes[nodes[3].mesh].deformation == SCENE_NONE);
        CHECK(nodes[0].mesh != nodes[4].mesh && nodes[0].mesh != nodes[3].mesh && nodes[4].mesh != nodes[3].mesh);
        CHECK(nodes[3].skin == SCENE_NONE && nodes[4].skin == 0);
        for (uint32_t i = 0; i < 2; i++) {
            const scene_deformation *const d = &scene->deformations[i];
            CHECK(scene->meshes[d->mesh].deformation == i && nodes[d->node].mesh == d->mesh);
            CHECK(d->first_vertex == scene->primitives[scene->meshes[d->mesh].first_primitive].first_vertex);
            CHECK_STRING(scene->meshes[d->mesh].name, "m");
        }
        CHECK(scene->vertex_count == 3 * scene->deformations[0].vertex_count);
        CHECK(scene->instanced_triangles == 8);
    }
    scene_destroy(scene);
}

TEST(skins_that_can_have_no_effect_are_warned_about)
{
    scene_data *const plain = load_motion(SKINNED(""));
    CHECK(plain && plain->deformation_count == 0 && plain->nodes[0].skin == SCENE_NONE);
    CHECK(strstr(test_log.warning, "node 0 \"body\": its mesh has no joints"));
    scene_destroy(plain);
    scene_data *const elsewhere = load_motion(SKINNED(FOUR) ",'scenes':[{'nodes':[0,1]}]");
    CHECK(elsewhere && elsewhere->deformation_count == 0 && elsewhere->skin_count == 0);
    CHECK(strstr(test_log.warning, "node 0 \"body\": a joint of skin 0 is not in the scene"));
    scene_destroy(elsewhere);
}

TEST(lying_skins_are_refused)
{
    REFUSED("'skins':[{'joints':[]}]", "skin 0 has 0 joints");
    REFUSED("'skins':[{'joints':[3]}],'nodes':[{}]", "skin 0: joint node 3 does not exist");
    REFUSED("'skins':[{'joints':[0,1,2],'inverseBindMatrices':6}],'nodes':[{},{},{}]",
            "skin 0: accessor 6 has 2 inverse bind matrices, expected 3");
    REFUSED("'skins':[{'joints':[0],'inverseBindMatrices':0}],'nodes':[{}]", "wrong type for inverseBindMatrices");
    REFUSED("'skins':[{'joints':[0],'inverseBindMatrices':99}],'nodes':[{}]", "accessor 99 does not exist");
    REFUSED(SKINNED(",'JOINTS_0':2"), "mesh 0 primitive 0 has JOINTS_0 without WEIGHTS_0");
    REFUSED(SKINNED(",'JOINTS_0':3,'WEIGHTS_0':3"), "accessor 3 has the wrong type for JOINTS_0");
    REFUSED(SKINNED(",'JOINTS_0':2,'WEIGHTS_0':2"), "accessor 2 has the wrong type for WEIGHTS_0");
    REFUSED(SKINNED(",'JOINTS_0':99,'WEIGHTS_0':3"), "accessor 99 does not exist");
    REFUSED("'skins':[{'joints':[1],'name':'s'}],'nodes':[{'mesh':0,'skin':0},{}],'meshes':[{'primitives':"
            "[{'attributes':{'POSITION':0" FOUR "}}]}]",
            "joint 1 of vertex 0 (accessor 2) is 1, skin \"s\" has 1 joints");
    REFUSED(SKIN
            ",'nodes':[{'mesh':0,'skin':0},{},{}],'meshes':[{'name':'m','primitives':[{'attributes':{'POSITION':0" FOUR
            "}},{'attributes':{'POSITION':0}}]}]",
            "mesh 0 \"m\" has a skin; one of its primitives has JOINTS_0");
}

TEST(skins_with_broken_numbers_are_refused)
{
    motion_bytes bytes = motion;
    bytes.inverse_bind[1][3] = NAN;
    BYTES_REFUSED(&bytes, SKINNED(FOUR), "inverse bind matrix of joint 1 (accessor 6) is not finite");
    bytes = motion;
    bytes.inverse_bind[1][0] = 3e38f;
    BYTES_REFUSED(&bytes, SKIN ",'nodes':[{},{},{'scale':[9,1,1]}]",
                  "joint 1 of skin \"s\" moves vertices to where is not finite");
    static const float bad[] = {NAN, INFINITY, -0.5f};
    for (uint32_t i = 0; i < countof(bad); i++) {
        bytes = motion;
        bytes.weights[1][1] = bad[i];
        BYTES_REFUSED(&bytes, SKINNED(FOUR), "weight 1 of vertex 1 (accessor 3)");
    }
}

TEST(more_joints_than_vertices_can_name_are_refused)
{
    enum { JOINTS_TOO_MANY = 65537 };
    static char members[2 * JOINTS_TOO_MANY + 64];
    int length =
        snprintf(members, sizeof members, "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{}],\"skins\":[{\"joints\":[0");
    static char json[sizeof members + 256];
    memcpy(json, members, (size_t)length);
    for (uint32_t i = 1; i < JOINTS_TOO_MANY; i++) {
        json[length++] = ',';
        json[length++] = '0';
    }
    length += snprintf(json + length, sizeof json - (size_t)length, "]}]}");
    test_file("joints.gltf", json, (size_t)length);
    log_clear();
    check_refused(__FILE__, __LINE__, scene_load(test_path("joints.gltf")), "joints.gltf",
                  "skin 0 has 65537 joints, expected 1 to 65536");
}

// ---- Morph targets

#define MORPHED(rest)                                                                                                  \
    "'meshes':[{'name':'face','primitives':[{'attributes':{'POSITION':0},'indices':1,'targets':[{'POSITION':7},"       \
    "{'POSITION':8}]}]" rest "}]"

TEST(morph_targets_follow_their_vertices)
{
    scene_data *const scene = load_motion(MORPHED("") ",'nodes':[{'mesh':0}]");
    CHECK(scene && scene->deformation_count == 1 && test_log.warnings == 0);
    if (scene) {
        const scene_deformation *const d = &scene->deformations[0];
        CHECK(d->target_count == 2 && d->skin == SCENE_NONE && !d->influences && d->vertex_count == 6);
        CHECK(d->weights[0] == 0 && d->weights[1] == 0);
        for (uint32_t i = 0; i < d->vertex_count; i++) {
            const uint32_t corner = corner_of(scene, i);
            CHECK(d->morphs[i].position[2] == (float)(corner + 1) && d->morphs[i].position[1] == 0);
            const float sparse = corner == 1 ? 5 : corner == 3 ? 6 : 0;
            CHECK(d->morphs[d->vertex_count + i].position[1] == sparse);
        }
    }
    scene_destroy(scene);
}

// Vertex i of a grid of 8 by 8 is at (i % 8, i / 8), has the weight 1/2 + i/256 and is lifted by i; the last row is not
// used, but for a triangle without area. Triangles come in no order, so that loading gives them another.
typedef struct grid_bytes {
    float positions[64][3], normals[64][3], weights[64][4], lift[64][3];
    uint8_t joints[64][4];
    uint16_t indices[85][3];
} grid_bytes;

static grid_bytes grid_make(void)
{
    grid_bytes grid = {0};
    for (uint32_t i = 0; i < 64; i++) {
        grid.positions[i][0] = (float)(i % 8);
        grid.positions[i][1] = (float)(i / 8);
        grid.normals[i][2] = 1;
        grid.weights[i][0] = 0.5f + (float)i / 256;
        grid.weights[i][1] = 0.5f - (float)i / 256;
        grid.joints[i][1] = 1;
        grid.lift[i][2] = (float)i;
    }
    grid.indices[84][0] = grid.indices[84][1] = grid.indices[84][2] = 60;
    for (uint32_t i = 0; i < 84; i++) {
        const uint32_t triangle = i * 37 % 84, cell = triangle / 2;
        const uint32_t corner = cell / 7 * 8 + cell % 7, corners[4] = {corner, corner + 1, corner + 8, corner + 9};
        for (uint32_t k = 0; k < 3; k++) {
            grid.indices[i][k] = (uint16_t)corners[triangle % 2 ? 3 - k : k];
        }
    }
    return grid;
}

TEST(reordered_vertices_keep_their_influences_and_morphs)
{
    const grid_bytes grid = grid_make();
    char members[2048];
    snprintf(members, sizeof members,
             "'bufferViews':[{'buffer':0,'byteLength':%zu}],'accessors':["
             "{'bufferView':0,'componentType':5126,'count':64,'type':'VEC3'},"
             "{'bufferView':0,'byteOffset':%zu,'componentType':5126,'count':64,'type':'VEC3'},"
             "{'bufferView':0,'byteOffset':%zu,'componentType':5126,'count':64,'type':'VEC4'},"
             "{'bufferView':0,'byteOffset':%zu,'componentType':5126,'count':64,'type':'VEC3'},"
             "{'bufferView':0,'byteOffset':%zu,'componentType':5121,'count':64,'type':'VEC4'},"
             "{'bufferView':0,'byteOffset':%zu,'componentType':5123,'count':255,'type':'SCALAR'}],"
             "'skins':[{'joints':[0,1]}],'nodes':[{'mesh':0,'skin':0},{}],'meshes':[{'primitives':[{'attributes':{"
             "'POSITION':0,'NORMAL':1,'WEIGHTS_0':2,'JOINTS_0':4},'indices':5,'targets':[{'POSITION':1},{'POSITION':3}]"
             "}]}]",
             sizeof grid, offsetof(grid_bytes, normals), offsetof(grid_bytes, weights), offsetof(grid_bytes, lift),
             offsetof(grid_bytes, joints), offsetof(grid_bytes, indices));
    scene_data *const scene = load_members("grid.gltf", &grid, sizeof grid, members);
    CHECK(scene && scene->vertex_count == 56 && scene->index_count == 252);
    for (uint32_t i = 0; scene && i < scene->vertex_count; i++) {
        const scene_deformation *const d = &scene->deformations[0];
        const float corner = scene->positions[i][0] + 8 * scene->positions[i][1];
        CHECK(d->influences[i].weights[0] == 0.5f + corner / 256);
        CHECK(d->morphs[i].position[2] == 1 && d->morphs[56 + i].position[2] == corner);
    }
    scene_destroy(scene);
}

TEST(triangles_with_a_vertex_twice_are_left_out_of_deformed_meshes_too)
{
    motion_bytes bytes = motion;
    bytes.indices[5] = 1;
    scene_data *const scene = load_bytes(&bytes, MORPHED("") ",'nodes':[{'mesh':0}]");
    CHECK(scene && scene->index_count == 3 && strstr(test_log.warning, "1 triangles without area"));
    scene_destroy(scene);
}

TEST(weights_at_rest_are_the_nodes_or_else_the_meshs)
{
    scene_data *const scene =
        load_motion(MORPHED(",'weights':[0.5,0]") ",'nodes':[{'mesh':0},{'mesh':0,'weights':[0,1]}]");
    CHECK(scene && scene->deformation_count == 2);
    if (scene) {
        CHECK(scene->deformations[0].weights[0] == 0.5f && scene->deformations[0].weights[1] == 0);
        CHECK(scene->deformations[1].weights[0] == 0 && scene->deformations[1].weights[1] == 1);
        CHECK(scene->bounds_max[2] == 2 && scene->bounds_max[1] == 7); // half of 4; 1 + 6
    }
    scene_destroy(scene);
}

// Of each triangle at rest and with a target in full.
TEST(normals_that_are_missing_are_flat_with_each_morph_target)
{
    scene_data *const scene = load_motion(MORPHED("") ",'nodes':[{'mesh':0}]");
    for (uint32_t first = 0; scene && first < scene->index_count; first += 3) {
        const scene_deformation *const d = &scene->deformations[0];
        float corners[3][3], normal[3];
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t vertex = scene->indices[first + k];
            for (uint32_t axis = 0; axis < 3; axis++) {
                corners[k][axis] = scene->positions[vertex][axis] + d->morphs[vertex].position[axis];
            }
        }
        for (uint32_t i = 0; i < 3; i++) {
            const uint32_t a = (i + 1) % 3, b = (i + 2) % 3;
            normal[i] = (corners[1][a] - corners[0][a]) * (corners[2][b] - corners[0][b]) -
                        (corners[1][b] - corners[0][b]) * (corners[2][a] - corners[0][a]);
        }
        const float length = sqrtf(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t vertex = scene->indices[first + k];
            for (uint32_t axis = 0; axis < 3; axis++) {
                CHECK_NEAR(scene->attributes[vertex].normal[axis] + d->morphs[vertex].normal[axis],
                           normal[axis] / length, 1e-6);
            }
        }
    }
    CHECK(scene && fabsf(scene->deformations[0].morphs[0].normal[2]) > 0.1f);
    scene_destroy(scene);
}

// All four corners at one place: a point that the target opens. The same without targets is left out.
TEST(triangles_that_a_deformation_opens_stay)
{
    motion_bytes bytes = motion;
    memset(bytes.positions, 0, sizeof bytes.positions);
    bytes.lift[3][0] = 1;
    scene_data *const opened = load_bytes(&bytes, MORPHED("") ",'nodes':[{'mesh':0}]");
    CHECK(opened && opened->index_count == 6 && opened->warning_count == 0);
    scene_destroy(opened);
    memset(bytes.lift, 0, sizeof bytes.lift);
    memset(bytes.by, 0, sizeof bytes.by);
    scene_data *const closed = load_bytes(&bytes, MORPHED("") ",'nodes':[{'mesh':0}]");
    CHECK(closed && closed->index_count == 0 && strstr(test_log.warning, "2 triangles without area"));
    scene_destroy(closed);
    scene_data *const skinned = load_bytes(&bytes, SKINNED(FOUR)); // corners of different weights
    CHECK(skinned && skinned->index_count == 6);
    scene_destroy(skinned);
}

TEST(lying_morph_targets_are_refused)
{
    REFUSED("'meshes':[{'primitives':[{'attributes':{'POSITION':0},'targets':[{'POSITION':10}]}]}]",
            "mesh 0 primitive 0 target 0: accessor 10 (POSITION) has 3 elements");
    REFUSED("'meshes':[{'primitives':[{'attributes':{'POSITION':0},'targets':[{'POSITION':3}]}]}]", "wrong type");
    REFUSED("'meshes':[{'primitives':[{'attributes':{'POSITION':0},'targets':[{'POSITION':77}]}]}]",
            "mesh 0 primitive 0 target 0: accessor 77 does not exist");
    REFUSED("'meshes':[{'primitives':[{'attributes':{'POSITION':0},'targets':[{'POSITION':7}]},"
            "{'attributes':{'POSITION':0}}]}]",
            "mesh 0: a primitive has 1 morph targets, another has 0");
    REFUSED(MORPHED(",'weights':[1]") ",'nodes':[{'mesh':0}]", "mesh 0 \"face\" has 1 weights");
    REFUSED(MORPHED("") ",'nodes':[{'mesh':0,'weights':[1,2,3]}]", "node 0 has 3 weights");
    REFUSED(MORPHED("") ",'nodes':[{'mesh':0,'weights':[1,1e39]}]", "node 0: weight 1 is not finite");
    motion_bytes bytes = motion;
    bytes.by[1][0] = NAN;
    BYTES_REFUSED(&bytes, MORPHED("") ",'nodes':[{'mesh':0}]",
                  "target 1: the position of vertex 3 (accessor 8) is not finite");
}

TEST(targets_do_not_add_up_without_limit)
{
    static char members[65536];
    int length = snprintf(members, sizeof members,
                          "'accessors':[{'componentType':5126,'count':1048576,'type':'VEC3'}],'meshes':[{'primitives':["
                          "{'attributes':{'POSITION':0},'targets':[");
    for (int i = 0; i < 40; i++) {
        length += snprintf(members + length, sizeof members - (size_t)length, "%s{'POSITION':0}", i ? "," : "");
    }
    snprintf(members + length, sizeof members - (size_t)length, "]}]}]");
    check_refused(__FILE__, __LINE__, load_members("many.gltf", &motion, sizeof motion, members), "many.gltf",
                  "morph targets in all");
}

// ---- Animations

#define ANIMATED(channels, samplers)                                                                                   \
    "'nodes':[{'name':'a'},{'name':'b','mesh':0},{'name':'c','matrix':[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]}]," MORPHED(   \
        "") ",'animations':[{'name':'walk','channels':[" channels "],'samplers':[" samplers "]}]"
#define CHANNEL(sampler, node, path) "{'sampler':" #sampler ",'target':{'node':" #node ",'path':'" path "'}}"
#define SAMPLER(output, interpolation) "{'input':9,'output':" #output ",'interpolation':'" interpolation "'}"

TEST(channels_have_their_keys)
{
    scene_data *const scene =
        load_motion(ANIMATED(CHANNEL(0, 0, "translation") "," CHANNEL(1, 0, "scale") "," CHANNEL(
                                 2, 1, "rotation") "," CHANNEL(3, 1, "weights") "," CHANNEL(4, 0, "scale"),
                             SAMPLER(10, "LINEAR") "," SAMPLER(11, "CUBICSPLINE") "," SAMPLER(12, "STEP") "," SAMPLER(
                                 15, "LINEAR") ",{'input':9,'output':10}"));
    CHECK(scene && test_log.warnings == 0 && scene->animation_count == 1);
    if (scene) {
        const scene_animation *const animation = &scene->animations[0];
        CHECK_STRING(animation->name, "walk");
        CHECK(animation->channel_count == 5 && animation->duration == 3);
        const scene_channel *const c = animation->channels;
        CHECK(c[0].target == SCENE_TRANSLATION && c[0].index == 0 && c[0].width == 3 && c[0].key_count == 3);
        CHECK(c[0].interpolation == SCENE_LINEAR && memcmp(c[0].values, motion.places, 36) == 0);
        CHECK(memcmp(c[0].times, motion.times, 12) == 0);
        CHECK(c[1].target == SCENE_SCALE && c[1].interpolation == SCENE_CUBIC);
        CHECK(memcmp(c[1].values, motion.places, sizeof motion.places) == 0);
        CHECK(c[2].target == SCENE_ROTATION && c[2].interpolation == SCENE_STEP && c[2].width == 4);
        CHECK(c[2].values[3] == 1 && c[2].values[4] == 1 && c[2].values[9] == -1);
        CHECK(c[3].target == SCENE_WEIGHTS && c[3].width == 2 && c[3].index == 1 && c[3].values[5] == 6);
        CHECK(c[4].interpolation == SCENE_LINEAR); // what is not said
    }
    scene_destroy(scene);
}

#define POINTER(sampler, pointer)                                                                                      \
    "{'sampler':" #sampler ",'target':{'path':'pointer','extensions':{'KHR_animation_pointer':{'pointer':'" pointer    \
    "'}}}}"
#define LAMP "/extensions/KHR_lights_punctual/lights/1/"

TEST(pointers_find_lights_materials_and_nodes)
{
    static const char head[] =
        "'extensionsUsed':['KHR_animation_pointer','KHR_lights_punctual'],'extensionsRequired':"
        "['KHR_animation_pointer'],'extensions':{'KHR_lights_punctual':{'lights':[{'type':'new'},{'type':'spot',"
        "'intensity':4,'color':[1,0.5,0],'spot':{}}]}},'materials':[{'emissiveFactor':[1,0.5,0],'extensions':{"
        "'KHR_materials_emissive_strength':{'emissiveStrength':0}}}],'nodes':[{'mesh':0},{'name':'b'}]";
    static const char *const channels[] = {
        POINTER(0, LAMP "color"),
        POINTER(1, LAMP "intensity"),
        POINTER(1, LAMP "spot/innerConeAngle"),
        POINTER(1, LAMP "spot/outerConeAngle"),
        POINTER(2, "/materials/0/pbrMetallicRoughness/baseColorFactor"),
        POINTER(0, "/materials/0/emissiveFactor"),
        POINTER(1, "/materials/0/extensions/KHR_materials_emissive_strength/emissiveStrength"),
        POINTER(0, "/nodes/1/translation"),
        POINTER(3, "/nodes/0/weights"),
    };
    char members[4096];
    int length = snprintf(members, sizeof members, "%s,%s,'animations':[{'channels':[", head, MORPHED(""));
    for (uint32_t i = 0; i < countof(channels); i++) {
        length += snprintf(members + length, sizeof members - (size_t)length, "%s%s", i ? "," : "", channels[i]);
    }
    snprintf(members + length, sizeof members - (size_t)length, "],'samplers':[%s,%s,%s,%s]}]", SAMPLER(10, "LINEAR"),
             SAMPLER(13, "LINEAR"), SAMPLER(12, "LINEAR"), SAMPLER(15, "LINEAR"));
    scene_data *const scene = load_motion(members);
    CHECK(scene && scene->animation_count == 1 && scene->warning_count == 1); // of the light's type
    if (scene) {
        static const scene_target expected[] = {SCENE_LIGHT_COLOR,       SCENE_LIGHT_INTENSITY, SCENE_LIGHT_INNER_CONE,
                                                SCENE_LIGHT_OUTER_CONE,  SCENE_BASE_COLOR,      SCENE_EMISSIVE_FACTOR,
                                                SCENE_EMISSIVE_STRENGTH, SCENE_TRANSLATION,     SCENE_WEIGHTS};
        CHECK(scene->animations[0].channel_count == countof(expected));
        for (uint32_t i = 0; i < countof(expected); i++) {
            const scene_channel *const channel = &scene->animations[0].channels[i];
            CHECK(channel->target == expected[i] && channel->index == (channel->target == SCENE_TRANSLATION));
        }
        // Factors of products are kept, as one of them may be 0 at rest.
        CHECK(scene->lights[0].hue[1] == 0.5f && scene->lights[0].intensity == 4 && scene->lights[0].color[1] == 2);
        CHECK(scene->emissions[0].factor[1] == 0.5f && scene->emissions[0].strength == 0);
        CHECK(scene->materials[0].emissive[1] == 0);
    }
    scene_destroy(scene);
}

TEST(channels_that_change_nothing_here_are_left_out_with_one_warning)
{
    static const struct {
        const char *channel, *warning;
    } cases[] = {
        {CHANNEL(0, 2, "translation"), "animation 0 \"walk\" channel 0: its node has a matrix"},
        {CHANNEL(0, 0, "weights"), "channel 0: its node has no morph targets"},
        {CHANNEL(0, 0, "colour"), "channel 0: \"colour\" cannot be animated"},
        {"{'sampler':0,'target':{'path':'scale'}}", "channel 0: it has no node"},
        {POINTER(0, "/cameras/0/perspective/yfov"), "\"/cameras/0/perspective/yfov\" cannot be animated"},
        {POINTER(0, "/nodes//translation"), "cannot be animated"},
        {POINTER(0, "/nodes/1/translation/0"), "cannot be animated"},
        {POINTER(0, "/nodes/1"), "cannot be animated"},
        {"{'sampler':0,'target':{'path':'pointer'}}", "\"\" cannot be animated"},
    };
    for (uint32_t i = 0; i < countof(cases); i++) {
        char members[2048];
        snprintf(members, sizeof members, ANIMATED("%s", SAMPLER(10, "LINEAR")), cases[i].channel);
        scene_data *const scene = load_motion(members);
        CHECK(scene && scene->animations[0].channel_count == 0 && test_log.warnings == 1);
        CHECK(strstr(test_log.warning, "1 animation channels are left out") &&
              strstr(test_log.warning, cases[i].warning));
        scene_destroy(scene);
    }
    motion_bytes bytes = motion;
    bytes.times[2] = bytes.times[1];
    scene_data *const scene = load_bytes(&bytes, ANIMATED(CHANNEL(0, 0, "scale"), SAMPLER(10, "LINEAR")));
    CHECK(scene && strstr(test_log.warning, "sampler 0: key 2 is not after the key before it"));
    scene_destroy(scene);
}

TEST(lying_animations_are_refused)
{
    REFUSED("'animations':[{'channels':[{'sampler':0}],'samplers':[]}]", "animations[0].channels[0] has no \"target\"");
    REFUSED("'animations':[{'channels':[{'sampler':0,'target':{}}],'samplers':[]}]",
            "animations[0].channels[0].target has no \"path\"");
    REFUSED("'animations':[{'channels':{},'samplers':[]}]", "animations[0].channels: expected an array");
    REFUSED("'animations':[{'channels':[],'samplers':[{'input':0}]}]", "animations[0].samplers[0] has no \"output\"");
    REFUSED(ANIMATED(CHANNEL(3, 0, "scale"), SAMPLER(10, "LINEAR")), "animation 0 \"walk\" channel 0: sampler 3");
    REFUSED(ANIMATED(CHANNEL(0, 9, "scale"), SAMPLER(10, "LINEAR")), "channel 0: node 9 does not exist");
    REFUSED(ANIMATED(POINTER(0, "/materials/5/emissiveFactor"), SAMPLER(10, "LINEAR")), "material 5 does not exist");
    REFUSED(ANIMATED(POINTER(0, LAMP "color"), SAMPLER(10, "LINEAR")), "light 1 does not exist");
    REFUSED(ANIMATED(CHANNEL(0, 0, "scale"), SAMPLER(12, "LINEAR")), "accessor 12 has the wrong type for output");
    REFUSED(ANIMATED(CHANNEL(0, 0, "scale"), SAMPLER(10, "SMOOTH")), "interpolation \"SMOOTH\"");
    REFUSED(ANIMATED(CHANNEL(0, 0, "scale"), SAMPLER(10, "CUBICSPLINE")), "accessor 10 has 3 values, expected 9 for 3");
    REFUSED(ANIMATED(CHANNEL(0, 1, "weights"), SAMPLER(13, "LINEAR")), "accessor 13 has 3 values, expected 6");
    REFUSED(ANIMATED(CHANNEL(0, 0, "scale"), "{'input':0,'output':10}"), "accessor 0 has the wrong type for input");
    REFUSED(ANIMATED(CHANNEL(0, 0, "scale"), "{'input':9,'output':99}"), "sampler 0: accessor 99 does not exist");
    motion_bytes bytes = motion;
    bytes.times[1] = NAN;
    BYTES_REFUSED(&bytes, ANIMATED(CHANNEL(0, 0, "scale"), SAMPLER(10, "LINEAR")), "sampler 0: key 1 (accessor 9)");
    bytes = motion;
    bytes.times[0] = -1;
    BYTES_REFUSED(&bytes, ANIMATED(CHANNEL(0, 0, "scale"), SAMPLER(10, "LINEAR")), "key 0 (accessor 9) is at -1 s");
    bytes = motion;
    bytes.places[2][0] = INFINITY;
    BYTES_REFUSED(&bytes, ANIMATED(CHANNEL(0, 0, "scale"), SAMPLER(10, "LINEAR")), "value 2 (accessor 10)");
}

int main(void)
{
    scene_test_begin();
    RUN(a_skin_has_its_joints_and_inverse_bind_matrices);
    RUN(a_skin_without_inverse_bind_matrices_has_identities);
    RUN(four_weights_are_normalised_sorted_and_follow_their_vertices);
    RUN(eight_weights_are_one_sum);
    RUN(vertices_without_weight_follow_the_first_joint_with_a_warning);
    RUN(each_deformed_node_has_a_mesh_of_its_own);
    RUN(skins_that_can_have_no_effect_are_warned_about);
    RUN(lying_skins_are_refused);
    RUN(skins_with_broken_numbers_are_refused);
    RUN(more_joints_than_vertices_can_name_are_refused);
    RUN(morph_targets_follow_their_vertices);
    RUN(reordered_vertices_keep_their_influences_and_morphs);
    RUN(triangles_with_a_vertex_twice_are_left_out_of_deformed_meshes_too);
    RUN(weights_at_rest_are_the_nodes_or_else_the_meshs);
    RUN(normals_that_are_missing_are_flat_with_each_morph_target);
    RUN(triangles_that_a_deformation_opens_stay);
    RUN(lying_morph_targets_are_refused);
    RUN(targets_do_not_add_up_without_limit);
    RUN(channels_have_their_keys);
    RUN(pointers_find_lights_materials_and_nodes);
    RUN(channels_that_change_nothing_here_are_left_out_with_one_warning);
    RUN(lying_animations_are_refused);
    return scene_test_end();
}
