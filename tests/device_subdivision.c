// Subdivided meshes on the device: the stencils there, the levels that the renderer takes, and what they look like.
#include "subdivision_scene.h"

#include "lanternfield_renderer_shaders.h"
#include "modules/renderer.h"
#include "modules/subdivide.h"
#include "modules/world.h"

static gpu *device;

static const char NORMAL_MAPPED[] =
    ",'materials':[{'normalTexture':{'index':0}}],'textures':[{'source':0}],"
    "'images':[{'uri':'data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGA"
    "WjR9awAAAABJRU5ErkJggg=='}]";

static scene_data *cube_scene(const char *rest)
{
    const cube_bytes cube = cube_bytes_make();
    scene_data *scene = cube_load(&cube, 12, "{'lanternfield_subdivision':{'scheme':'catmark','max_level':4}}", rest);
    if (!scene || scene->subdivision_count != 1) {
        printf("no subdivided cube\n");
        exit(EXIT_FAILURE);
    }
    return scene;
}

// ---- Stencils

static gpu_buffer storage_of(const void *data, VkDeviceSize size)
{
    const gpu_buffer_desc desc = {.size = size, .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, .data = data};
    return gpu_buffer_create(device, &desc);
}

static void normal_of(float v[3][3], float normal[3])
{
    float square = 0;
    for (int k = 0; k < 3; k++) {
        normal[k] = v[1][(k + 1) % 3] * v[2][(k + 2) % 3] - v[1][(k + 2) % 3] * v[2][(k + 1) % 3];
        square += normal[k] * normal[k];
    }
    for (int k = 0; k < 3; k++)
        normal[k] /= sqrtf(square);
}

// The cage as a moving one may be: nothing of it is where it was.
static void cage_bend(scene_data *scene)
{
    const scene_mesh *mesh = &scene->meshes[scene->subdivisions[0].mesh];
    const mesh_primitive *p = &scene->primitives[mesh->first_primitive];
    for (uint32_t i = p->first_vertex; i < p->first_vertex + p->vertex_count; i++)
        for (int k = 0; k < 3; k++) // by place, so that vertices at one place stay together
            scene->positions[i][k] += 0.3f * sinf(2 * scene->positions[i][(k + 1) % 3] + (float)k) + 0.1f;
}

static void level_compare(const scene_data *scene, uint32_t level, const float (*positions)[3],
                          const vertex_attributes *attributes)
{
    const scene_subdivision *s = &scene->subdivisions[0];
    const scene_subdivision_level *l = &s->levels[level - 1];
    for (uint32_t i = 0; i < l->vertex_count; i++) {
        const vertex_attributes *rest = &scene->attributes[l->first_vertex + i],
                                *now = &attributes[l->first_vertex + i];
        float v[3][3], normal[3];
        subdivision_evaluate(&s->stencils, l->vertices[i].stencil, scene->positions + s->first_vertex, v);
        normal_of(v, normal);
        for (int k = 0; k < 3; k++) {
            CHECK_NEAR(positions[l->first_vertex + i][k], v[0][k], 1e-6);
            CHECK_NEAR(now->normal[k], normal[k], 2e-6);
        }
        float square = 0, along = 0;
        for (int k = 0; k < 3; k++) {
            square += now->tangent[k] * now->tangent[k];
            along += now->tangent[k] * now->normal[k];
        }
        CHECK_NEAR(square, 1, 1e-6);
        CHECK_NEAR(along, 0, 1e-5);
        CHECK(now->tangent[3] == rest->tangent[3] && memcmp(now->uv0, rest->uv0, sizeof now->uv0) == 0);
    }
}

TEST(the_devices_stencils_are_the_cpus)
{
    scene_data *scene = cube_scene(NORMAL_MAPPED);
    cage_bend(scene);
    const VkDeviceSize positions_size = scene->vertex_count * sizeof *scene->positions;
    const VkDeviceSize attributes_size = scene->vertex_count * sizeof *scene->attributes;
    const gpu_buffer positions = storage_of(scene->positions, positions_size);
    const gpu_buffer attributes = storage_of(scene->attributes, attributes_size);
    const gpu_buffer previous = storage_of(NULL, positions_size);
    subdivide_stencils stencils = {0};
    CHECK(subdivide_stencils_create(device, &scene->subdivisions[0], &stencils));
    const gpu_compute_pipeline_desc desc = {.shader = &shader_subdivide_comp};
    const gpu_pipeline pipeline = gpu_compute_pipeline_create(device, &desc);
    gpu_commands *commands = gpu_commands_begin(device);
    for (uint32_t level = 1; level <= 4; level++) {
        const subdivide_target target = {.positions = positions,
                                         .attributes = attributes,
                                         .previous_positions = previous,
                                         .first_kept = scene->subdivisions[0].levels[level - 1].first_vertex,
                                         .is_new = level == 2};
        subdivide_record(commands, pipeline, &stencils, &scene->subdivisions[0], level, &target);
    }
    CHECK(gpu_commands_submit_and_wait(device, commands));

    float(*moved)[3] = memory_alloc(positions_size);
    vertex_attributes *shaded = memory_alloc(attributes_size);
    CHECK(gpu_buffer_read(device, positions, 0, moved, positions_size));
    CHECK(gpu_buffer_read(device, attributes, 0, shaded, attributes_size));
    float(*before)[3] = memory_alloc(positions_size);
    CHECK(gpu_buffer_read(device, previous, 0, before, positions_size));
    for (uint32_t level = 1; level <= 4; level++) {
        level_compare(scene, level, moved, shaded);
        const scene_subdivision_level *l = &scene->subdivisions[0].levels[level - 1];
        const float(*was)[3] = level == 2 ? (const float(*)[3])moved : (const float(*)[3])scene->positions;
        CHECK(memcmp(before + l->first_vertex, was + l->first_vertex, l->vertex_count * sizeof *was) == 0);
    }
    free(before);
    free(moved);
    free(shaded);
    subdivide_stencils_destroy(device, &stencils);
    gpu_pipeline_destroy(device, pipeline);
    gpu_buffer_destroy(device, previous);
    gpu_buffer_destroy(device, positions);
    gpu_buffer_destroy(device, attributes);
    scene_destroy(scene);
}

// ---- Levels

TEST(a_level_suits_its_size_and_is_held)
{
    CHECK(subdivide_level(1000, 0, 0) == 0);
    CHECK(subdivide_level(1, 0, 5) == 1);
    CHECK(subdivide_level(2 * SUBDIVIDE_EDGE_PIXELS, 0, 5) == 1);
    CHECK(subdivide_level(2.1f * SUBDIVIDE_EDGE_PIXELS, 0, 5) == 2);
    CHECK(subdivide_level(2.1f * SUBDIVIDE_EDGE_PIXELS, 1, 5) == 1); // held
    CHECK(subdivide_level(1.9f * SUBDIVIDE_EDGE_PIXELS, 2, 5) == 2);
    CHECK(subdivide_level(2.4f * SUBDIVIDE_EDGE_PIXELS, 1, 5) == 2); // too far
    CHECK(subdivide_level(1.7f * SUBDIVIDE_EDGE_PIXELS, 2, 5) == 1);
    CHECK(subdivide_level(1e30f, 0, 5) == 5 && subdivide_level(INFINITY, 3, 4) == 4);
    CHECK(subdivide_level(1e30f, 5, 3) == 3); // the cap was lowered
}

static uint32_t drawn_triangles(renderer *r)
{
    const world_gpu *w = r->gpu_world;
    CHECK(renderer_frame(r) && w->instance_count == 1);
    const scene_mesh *mesh = &r->scene->meshes[w->order[0].mesh];
    return r->scene->primitives[mesh->first_primitive].index_count / 3;
}

TEST(the_level_follows_the_distance_up_to_the_cap)
{
    scene_data *scene = cube_scene("");
    render_settings settings = render_settings_default();
    settings.width = settings.height = 64;
    settings.vpls = 0;
    renderer *r = renderer_create(device, scene, &settings);
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    r->camera = (render_camera){.eye = {0, 0, 100}, .up = {0, 1, 0}, .yfov = 0.8f, .near_plane = 0.01f};
    CHECK(drawn_triangles(r) == 48);
    r->camera.eye[2] = 8; // edges of 24 pixels at the nearest
    CHECK(drawn_triangles(r) == 192);
    r->camera.eye[2] = 2;
    CHECK(drawn_triangles(r) == 768); // level 3
    r->settings.subdivision_max = 4;
    CHECK(drawn_triangles(r) == 3072);
    r->settings.subdivision_max = 0;
    CHECK(drawn_triangles(r) == 12);
    r->settings.subdivision_max = 5; // the mesh has four
    CHECK(drawn_triangles(r) == 3072);
    renderer_destroy(r);
    scene_destroy(scene);
}

int main(void)
{
    device = gpu_create(&(gpu_desc){.validation = true});
    if (!device) {
        printf("skipped: no usable device\n");
        return 77;
    }
    scene_test_begin();
    RUN(the_devices_stencils_are_the_cpus);
    RUN(a_level_suits_its_size_and_is_held);
    RUN(the_level_follows_the_distance_up_to_the_cap);
    CHECK(gpu_validation_messages(device) == 0);
    gpu_destroy(device);
    return scene_test_end();
}
