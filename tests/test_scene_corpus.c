// Scene import over the scenes beside the project, valid and invalid. Skipped where they are not there.
#include "scene_test.h"

#include <fcntl.h>
#include <ftw.h>
#include <sys/stat.h>
#include <sys/wait.h>

#define SCENES "../shared/scenes/"

static scene_data *load(const char *path)
{
    char full[512];
    snprintf(full, sizeof(full), SCENES "%s", path);
    log_clear();
    scene_data *const scene = scene_load(full);
    if (!scene) {
        test_failures++;
        printf("%s: not loaded: %s\n", path, test_log.error);
    }
    return scene;
}

// What a scene must fulfil for the renderer to run on it.
static void check_sound(const scene_data *scene)
{
    for (uint32_t i = 0; i < scene->primitive_count; i++) {
        const mesh_primitive *const p = &scene->primitives[i];
        bool ok = p->material < scene->material_count && p->index_count % 3 == 0;
        ok = ok && p->first_index + p->index_count <= scene->index_count;
        ok = ok && p->first_vertex + p->vertex_count <= scene->vertex_count;
        for (uint32_t k = 0; ok && k < p->index_count; k++) {
            ok = scene->indices[p->first_index + k] < p->vertex_count;
        }
        CHECK(ok);
    }
    bool unit = true;
    for (uint32_t i = 0; i < scene->vertex_count; i++) {
        const float *const n = scene->attributes[i].normal, *const t = scene->attributes[i].tangent;
        unit = unit && fabsf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1) < 1e-5f;
        unit = unit && (t[3] == 0 || (fabsf(t[3]) == 1 && fabsf(t[0] * t[0] + t[1] * t[1] + t[2] * t[2] - 1) < 1e-5f));
    }
    CHECK(unit);
    for (uint32_t i = 0; i < scene->node_count; i++) {
        CHECK(scene->nodes[i].parent == SCENE_NONE || scene->nodes[i].parent < i);
    }
    for (uint32_t i = 0; i < scene->texture_count; i++) {
        CHECK(scene->textures[i].image < scene->image_count && scene->images[scene->textures[i].image].texels);
    }
}

// Those loaded and those left out for want of area.
static uint64_t triangles_with_dropped(const scene_data *scene)
{
    unsigned dropped = 0;
    for (uint32_t i = 0; i < scene->warning_count; i++) {
        sscanf(scene->warnings[i], "%u triangles without area", &dropped);
    }
    return scene->index_count / 3 + dropped;
}

static void check_counts(const char *path, uint64_t triangles, uint32_t cameras)
{
    scene_data *const scene = load(path);
    if (scene) {
        check_sound(scene);
        CHECK(triangles_with_dropped(scene) == triangles && scene->camera_count == cameras);
    }
    scene_destroy(scene);
}

// ---- Scenes that are valid

TEST(sponza_has_its_triangles_cameras_materials_and_sun)
{
    scene_data *const scene = load("sponza/sponza.gltf");
    if (scene) {
        check_sound(scene);
        CHECK(triangles_with_dropped(scene) == 262267 && scene->instanced_triangles >= 262266);
        CHECK(scene->material_count == 25 + 1 && scene->camera_count == 3);
        CHECK(scene_camera_find(scene, "hall") == 0 && scene_camera_find(scene, "gallery") == 2);
        CHECK(scene->light_count == 1 && scene->lights[0].type == LIGHT_DIRECTIONAL && scene->lights[0].color[1] == 60);
        uint32_t masked = 0;
        for (uint32_t i = 0; i < scene->material_count; i++) {
            masked += scene->materials[i].flags & MATERIAL_ALPHA_MASK;
        }
        CHECK(masked == 3);
    }
    scene_destroy(scene);
}

// A mesh's triangles as the driver sees them: primitive after primitive.
static float (*mesh_corners(const scene_data *scene, const scene_mesh *mesh, uint32_t *triangles))[3]
{
    float(*const corners)[3] = memory_alloc(scene->index_count * sizeof(*corners));
    uint32_t count = 0;
    for (uint32_t i = 0; i < mesh->primitive_count; i++) {
        const mesh_primitive *const p = &scene->primitives[mesh->first_primitive + i];
        for (uint32_t k = 0; k < p->index_count; k++) {
            memcpy(corners[count++], scene->positions[p->first_vertex + scene->indices[p->first_index + k]],
                   sizeof(*corners));
        }
    }
    *triangles = count / 3;
    return corners;
}

TEST(the_order_of_sponza_costs_little_more_than_without_regard_for_materials)
{
    scene_data *const scene = load("sponza/sponza.gltf");
    if (scene) {
        uint32_t triangles;
        float(*const corners)[3] = mesh_corners(scene, &scene->meshes[0], &triangles);
        float(*const free_corners)[3] = memory_alloc(3 * (size_t)triangles * sizeof(*free_corners));
        uint32_t *const indices = memory_alloc(3 * (size_t)triangles * sizeof(*indices));
        for (uint32_t i = 0; i < 3 * triangles; i++) {
            indices[i] = i;
        }
        scene_primitive_reorder(indices, 3 * triangles, (const float(*)[3])corners);
        for (uint32_t i = 0; i < 3 * triangles; i++) {
            memcpy(free_corners[i], corners[indices[i]], sizeof(*free_corners));
        }
        const double kept = halving_cost((const float(*)[3])corners, triangles);
        const double free_order = halving_cost((const float(*)[3])free_corners, triangles);
        printf("  halving costs %.1f, %.1f were the materials free to mix\n", kept, free_order);
        CHECK(kept < 1.1 * free_order);
        free(indices);
        free(free_corners);
        free(corners);
    }
    scene_destroy(scene);
}

TEST(the_kitchen_and_the_cornell_scenes_have_their_triangles_and_cameras)
{
    check_counts("kitchen/kitchen.gltf", 85864, 1);
    check_counts("cornell/cornell_quad.gltf", 32, 1);
    scene_data *const scene = load("cornell/cornell_point.gltf");
    CHECK(scene && scene->light_count == 1 && scene->lights[0].type == LIGHT_POINT && scene->camera_count == 1);
    scene_destroy(scene);
}

TEST(material_scenes_load_with_what_they_are_about)
{
    scene_data *scene = load("materials/SimpleSparseAccessor/SimpleSparseAccessor.gltf");
    CHECK(scene && scene->bounds_max[1] > 1.5f && scene->index_count == 36); // three vertices are lifted
    scene_destroy(scene);
    scene = load("materials/TriangleWithoutIndices/TriangleWithoutIndices.gltf");
    CHECK(scene && scene->index_count == 3);
    scene_destroy(scene);
    scene = load("materials/AlphaBlendModeTest/AlphaBlendModeTest.gltf");
    CHECK(scene && strstr(scene->warnings[0], "blend"));
    scene_destroy(scene);
    scene = load("materials/VertexColorTest/VertexColorTest.gltf");
    uint32_t colored = 0;
    for (uint32_t i = 0; scene && i < scene->vertex_count; i++) {
        colored += scene->attributes[i].color_rg != 0xffffffff;
    }
    CHECK(colored > 0);
    scene_destroy(scene);
    check_counts("materials/OrientationTest/OrientationTest.gltf", 524, 0);
}

// The test model's arrow: its "All" quad is right when the green marker's place shows the arrow's direction.
TEST(the_texture_transform_test_turns_its_arrow_to_the_marker)
{
    scene_data *const scene = load("materials/TextureTransformTest/TextureTransformTest.gltf");
    for (uint32_t i = 0; scene && i < scene->material_count; i++) {
        if (strcmp(scene->material_names[i], "Rotation") == 0) {
            // The marker is 67.5 degrees down from the upper left corner, the arrow 45 degrees in the image.
            const float *const t = scene->materials[i].base_texture.transform;
            const double angle = 67.5 * M_PI / 180, u = cos(angle), v = sin(angle);
            CHECK_NEAR(t[0] * u + t[2] * v, sqrt(0.5), 1e-4);
            CHECK_NEAR(t[1] * u + t[3] * v, sqrt(0.5), 1e-4);
        }
    }
    scene_destroy(scene);
}

#define MIRROR_TEST SCENES "materials/NormalTangentMirrorTest/"

// The same model with its tangents under another name, so that they have to be made.
static scene_data *mirror_test_without_tangents(void)
{
    size_t size;
    char *const text = (char *)file_read(MIRROR_TEST "NormalTangentMirrorTest.gltf", &size);
    char *const tangent = text ? strstr(text, "\"TANGENT\"") : NULL;
    char command[512];
    snprintf(command, sizeof(command), "cp " MIRROR_TEST "* '%s'", test_folder);
    CHECK(tangent && system(command) == 0);
    if (tangent) {
        memcpy(tangent, "\"_UNUSED\"", strlen("\"_UNUSED\""));
        test_file("NormalTangentMirrorTest.gltf", text, size);
    }
    free(text);
    return scene_load(test_path("NormalTangentMirrorTest.gltf"));
}

TEST(tangents_made_agree_with_those_of_the_mirror_test)
{
    scene_data *const given = load("materials/NormalTangentMirrorTest/NormalTangentMirrorTest.gltf");
    scene_data *const made = mirror_test_without_tangents();
    CHECK(given && made && given->vertex_count == made->vertex_count); // the order depends on positions only
    uint32_t mirrored = 0, close = 0, same_side = 0;
    for (uint32_t i = 0; given && made && i < given->vertex_count; i++) {
        const float *const a = given->attributes[i].tangent, *const b = made->attributes[i].tangent;
        mirrored += a[3] < 0;
        same_side += a[3] == b[3];
        close += a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > 0.95f;
    }
    CHECK(given && mirrored > 50 && same_side > 0.99 * given->vertex_count && close > 0.95 * given->vertex_count);
    scene_destroy(given);
    scene_destroy(made);
}

TEST(light_scenes_have_a_light_of_each_kind)
{
    scene_data *const scene = load("lights/Lights.glb");
    uint32_t kinds = 0;
    for (uint32_t i = 0; scene && i < scene->light_count; i++) {
        kinds |= 1u << scene->lights[i].type;
    }
    CHECK(kinds == 7);
    scene_destroy(scene);
    check_counts("lights/geometry-camera-light.glb", 14, 2);
}

static uint32_t animated_seen;

static int animated_visit(const char *path, const struct stat *status, int type, struct FTW *walk)
{
    (void)status;
    (void)walk;
    const size_t length = strlen(path);
    if (type == FTW_F && length > 5 && strcmp(path + length - 5, ".gltf") == 0) {
        scene_data *const scene = load(path + strlen(SCENES));
        if (scene) {
            check_sound(scene);
            CHECK(scene->index_count > 0 && scene->animation_count + scene->skin_count > 0);
        }
        scene_destroy(scene);
        animated_seen++;
    }
    return 0;
}

TEST(animated_scenes_load_and_count_their_animations)
{
    CHECK(nftw(SCENES "animated", animated_visit, 16, FTW_PHYS) == 0);
    CHECK(animated_seen >= 11);
}

// ---- Files that are not

// Valid by the validator, and refused all the same.
static const struct {
    const char *file, *reason;
} exceptions[] = {
    {"accessor/unknown_type.gltf", "an accessor type that glTF 2.0 does not know"},
    {"asset/min_version_valid.gltf", "asks for glTF 2.1"},
    {"buffer/non_relative_uri.gltf", "its buffer is on the network"},
    {"root/named_objects.gltf", "draws from a buffer without bytes"},
    {"root/unused_objects.gltf", "draws from a buffer without bytes"},
};

typedef enum outcome { OUTCOME_LOADED, OUTCOME_REFUSED, OUTCOME_SILENT, OUTCOME_PRINTED, OUTCOME_CRASHED } outcome;

static bool is_glTF(const char *path)
{
    const size_t length = strlen(path);
    return length > 5 && (!strcmp(path + length - 5, ".gltf") || !strcmp(path + length - 4, ".glb"));
}

// In a child: a refusal is one logged line and nothing printed.
static outcome child_load(const char *path)
{
    const int file = open(test_path("output"), O_RDWR | O_CREAT | O_TRUNC, 0600);
    fflush(stdout);
    dup2(file, STDOUT_FILENO);
    dup2(file, STDERR_FILENO);
    log_clear();
    scene_data *const scene = scene_load(path);
    fflush(NULL);
    struct stat status;
    const bool printed = fstat(file, &status) != 0 || status.st_size > 0;
    const bool silent = !scene && (test_log.errors != 1 || !strstr(test_log.error, path));
    const outcome result = printed  ? OUTCOME_PRINTED
                           : silent ? OUTCOME_SILENT
                           : scene  ? OUTCOME_LOADED
                                    : OUTCOME_REFUSED;
    if (scene) {
        FILE *const out = fopen("/dev/null", "w");
        scene_print_info(scene, out);
        fclose(out);
    }
    scene_destroy(scene);
    return result;
}

static outcome forked_load(const char *path)
{
    fflush(NULL);
    const pid_t child = fork();
    if (child == 0) {
        alarm(20);
        _exit((int)child_load(path));
    }
    int status = 0;
    waitpid(child, &status, 0);
    if (!WIFEXITED(status) || WEXITSTATUS(status) >= OUTCOME_CRASHED) {
        printf("%s: %s %d\n", path, WIFSIGNALED(status) ? "ended by signal" : "exit code",
               WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
        return OUTCOME_CRASHED;
    }
    return (outcome)WEXITSTATUS(status);
}

// The validator's verdict; true as well for files without a report.
static bool has_errors(const char *path)
{
    char report[1024];
    snprintf(report, sizeof(report), "%s.report.json", path);
    size_t size;
    uint8_t *const text = access(report, R_OK) == 0 ? file_read(report, &size) : NULL;
    const char *const count = text ? strstr((const char *)text, "\"numErrors\":") : NULL;
    const bool result = !count || atoi(count + strlen("\"numErrors\":")) > 0;
    free(text);
    return result;
}

static bool is_exception(const char *path)
{
    for (uint32_t i = 0; i < countof(exceptions); i++) {
        if (strstr(path, exceptions[i].file)) {
            return true;
        }
    }
    return false;
}

static uint32_t outcomes[OUTCOME_CRASHED + 1], invalid_refused, valid_refused;

static int invalid_visit(const char *path, const struct stat *status, int type, struct FTW *walk)
{
    (void)status;
    (void)walk;
    if (type != FTW_F || !is_glTF(path)) {
        return 0;
    }
    static const char *const names[] = {"loaded", "refused", "refused without one line that names it", "printed",
                                        "crashed"};
    const outcome result = forked_load(path);
    outcomes[result]++;
    if (result > OUTCOME_REFUSED) {
        test_failures++;
        printf("%s: %s\n", path, names[result]);
    }
    const bool refused = result != OUTCOME_LOADED, broken = has_errors(path);
    invalid_refused += refused && broken;
    valid_refused += refused && !broken;
    if (!broken && refused != is_exception(path)) {
        test_failures++;
        printf("%s: valid, but %s\n", path, names[result]);
    }
    return 0;
}

TEST(every_file_under_invalid_loads_or_is_refused_with_one_line)
{
    CHECK(nftw(SCENES "invalid", invalid_visit, 16, FTW_PHYS) == 0);
    printf("  %u loaded, %u refused\n", outcomes[OUTCOME_LOADED], outcomes[OUTCOME_REFUSED]);
    CHECK(outcomes[OUTCOME_LOADED] > 100 && invalid_refused > 80);
}

TEST(valid_files_of_the_validator_load_but_for_known_exceptions)
{
    for (uint32_t i = 0; i < countof(exceptions); i++) {
        printf("  %s: %s\n", exceptions[i].file, exceptions[i].reason);
    }
    CHECK(valid_refused == countof(exceptions)); // counted by the test above
}

int main(void)
{
    if (access(SCENES, R_OK) != 0) {
        printf("skipped: no " SCENES "\n");
        return 77;
    }
    scene_test_begin();
    RUN(sponza_has_its_triangles_cameras_materials_and_sun);
    RUN(the_order_of_sponza_costs_little_more_than_without_regard_for_materials);
    RUN(the_kitchen_and_the_cornell_scenes_have_their_triangles_and_cameras);
    RUN(material_scenes_load_with_what_they_are_about);
    RUN(the_texture_transform_test_turns_its_arrow_to_the_marker);
    RUN(tangents_made_agree_with_those_of_the_mirror_test);
    RUN(light_scenes_have_a_light_of_each_kind);
    RUN(animated_scenes_load_and_count_their_animations);
    RUN(every_file_under_invalid_loads_or_is_refused_with_one_line);
    RUN(valid_files_of_the_validator_load_but_for_known_exceptions);
    return scene_test_end();
}
