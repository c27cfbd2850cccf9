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
    if (!scene || scene->subdivision_count == 0) {
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

// ---- Moving cages

// A cube over a larger one, each from the same cage; the upper one moves by its joints, or as a whole by `place`.
#define BOTH_NODES(of_the_cube)                                                                                        \
    ",'nodes':[{'mesh':0," of_the_cube "},{'name':'lower'},{'name':'upper'},"                                          \
    "{'mesh':0,'translation':[0,-3,0],'scale':[4,1,4]}],'skins':[{'joints':[1,2]}]"

static renderer *renderer_of(const scene_data *scene, uint32_t rays)
{
    render_settings settings = render_settings_default();
    settings.width = settings.height = 96;
    settings.vpls = 0;
    settings.rays = rays;
    settings.taa = settings.filter = false;
    renderer *r = renderer_create(device, scene, &settings);
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    r->camera =
        (render_camera){.eye = {2, 3, 7}, .target = {0, -1, 0}, .up = {0, 1, 0}, .yfov = 0.9f, .near_plane = 0.1f};
    world_sun_add(r, (float[3]){-0.4f, -1, -0.2f}, 3);
    return r;
}

static float *node_matrix(renderer *r, uint32_t node)
{
    return ((node_component *)ecs_get(r->world, r->gpu_world->node_entities[node], r->gpu_world->node))->matrix;
}

// The deformation of the drawn instance that has one.
static uint32_t deformation_drawn(const renderer *r)
{
    const world_gpu *w = r->gpu_world;
    uint32_t found = SCENE_NONE;
    for (uint32_t i = 0; i < w->instance_count; i++)
        if (w->mesh_deformations[w->order[i].mesh] != SCENE_NONE)
            found = w->mesh_deformations[w->order[i].mesh];
    return found;
}

static float (*positions_read(const renderer *r))[3]
{
    const VkDeviceSize size = r->scene->vertex_count * sizeof(float[3]);
    float(*positions)[3] = memory_alloc(size);
    CHECK(gpu_buffer_read(device, r->gpu_world->positions, 0, positions, size));
    return positions;
}

static void level_check(const renderer *r, uint32_t level, const float (*before)[3])
{
    const uint32_t index = deformation_drawn(r);
    const scene_deformation *d = &r->scene->deformations[index];
    const world_deformation *now = &r->gpu_world->deformations[index];
    CHECK(d->subdivision && d->level == level && now->drawn && now->changed);
    float(*positions)[3] = positions_read(r);
    float(*previous)[3] = memory_alloc(d->vertex_count * sizeof *previous);
    CHECK(gpu_buffer_read(device, r->gpu_world->previous_positions, now->first_kept * sizeof *previous, previous,
                          d->vertex_count * sizeof *previous));
    CHECK(memcmp(previous, before ? before[d->first_vertex] : positions[d->first_vertex],
                 d->vertex_count * sizeof *previous) == 0);
    for (uint32_t i = d->first_vertex; i < d->first_vertex + d->vertex_count; i++) {
        float expected[3];
        world_deformed_position(r, index, i, expected);
        for (int k = 0; k < 3; k++) {
            CHECK_NEAR(positions[i][k], expected[k], 2e-6);
            CHECK(positions[i][k] >= now->box.min[k] && positions[i][k] <= now->box.max[k]);
        }
    }
    free(previous);
    free(positions);
}

TEST(a_level_follows_the_joints_of_its_cage)
{
    scene_data *scene = cube_scene(BOTH_NODES("'skin':0"));
    CHECK(scene->mesh_count == 5 + 5 && scene->subdivision_count == 2 && scene->deformation_count == 5);
    renderer *r = renderer_of(scene, RAYS_AUTO);
    CHECK(renderer_frame(r));
    float(*before)[3] = positions_read(r);
    const uint32_t level = scene->deformations[deformation_drawn(r)].level;
    CHECK(level > 1);
    node_matrix(r, 2)[13] = 0.5f; // the upper half up
    CHECK(renderer_frame(r));
    level_check(r, level, (const float(*)[3])before);
    free(before);
    node_matrix(r, 2)[12] = 0.25f; // and aside, while another level is taken
    r->settings.subdivision_max = 1;
    CHECK(renderer_frame(r));
    level_check(r, 1, NULL);
    r->settings.subdivision_max = 5; // a level that was behind
    node_matrix(r, 2)[12] = 0.3f;
    CHECK(renderer_frame(r));
    level_check(r, level, NULL);
    renderer_destroy(r);
    scene_destroy(scene);
}

static float *radiance_read(renderer *r)
{
    float *radiance = memory_alloc(96 * 96 * 16);
    CHECK(gpu_image_read(device, frame_graph_find_image(r->graph, "radiance"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                         radiance, 96 * 96 * 16));
    return radiance;
}

// Share of the pixels that differ.
static double pixels_differ(const float *a, const float *b)
{
    uint32_t differ = 0;
    for (uint32_t i = 0; i < 96 * 96; i++)
        differ += fabsf(a[4 * i + 1] - b[4 * i + 1]) > 0.01f * (a[4 * i + 1] + b[4 * i + 1]);
    return differ / (96.0 * 96.0);
}

// Through every stage: what is drawn, the rays' structures, shadows.
TEST(a_cube_moved_by_its_joints_looks_as_one_moved_by_its_node)
{
    static const uint32_t methods[] = {RAYS_QUERY, RAYS_EMBREE};
    scene_data *still = cube_scene(BOTH_NODES("'translation':[0.75,0.25,0]"));
    scene_data *skinned = cube_scene(BOTH_NODES("'skin':0"));
    for (size_t i = 0; i < countof(methods); i++) {
        renderer *r = renderer_of(still, methods[i]);
        CHECK(renderer_frame(r));
        float *wanted = radiance_read(r);
        renderer_destroy(r);
        r = renderer_of(skinned, methods[i]);
        CHECK(renderer_frame(r));
        float *at_rest = radiance_read(r);
        for (uint32_t joint = 1; joint <= 2; joint++) {
            node_matrix(r, joint)[12] = 0.75f;
            node_matrix(r, joint)[13] = 0.25f;
        }
        CHECK(renderer_frame(r));
        float *moved = radiance_read(r);
        printf("  differ: moved %.4f, at rest %.4f of the pixels\n", pixels_differ(moved, wanted),
               pixels_differ(at_rest, wanted));
        CHECK(pixels_differ(moved, wanted) < 0.002); // a ray past an edge may fall to the other side
        CHECK(pixels_differ(at_rest, wanted) > 0.05);
        free(wanted);
        free(at_rest);
        free(moved);
        renderer_destroy(r);
    }
    scene_destroy(still);
    scene_destroy(skinned);
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
    RUN(a_level_follows_the_joints_of_its_cage);
    RUN(a_cube_moved_by_its_joints_looks_as_one_moved_by_its_node);
    CHECK(gpu_validation_messages(device) == 0);
    gpu_destroy(device);
    return scene_test_end();
}
