// The world's mirror on the GPU: instances, lights and emitters must be what the entities say, frame by frame.
#include "modules/renderer.h"
#include "modules/world.h"
#include "quad_scene.h"
#include "test.h"

static gpu *device;

static renderer *renderer_of(const quad_scene *s)
{
    render_settings settings = render_settings_default();
    settings.width = settings.height = 16;
    settings.vpls = 0;
    renderer *r = renderer_create(device, &s->data, &settings);
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    return r;
}

static void matrix_at(float matrix[16], float x, float y, float z)
{
    memcpy(matrix, IDENTITY, sizeof IDENTITY);
    matrix[12] = x;
    matrix[13] = y;
    matrix[14] = z;
}

static material *emissive_quad_add(quad_scene *s, const float matrix[16], float nits)
{
    material *m = quad_add(s, matrix);
    for (int k = 0; k < 3; k++)
        m->emissive[k] = nits;
    return m;
}

// The entity of the scene's node `index`: nodes are spawned in order.
static entity entity_of(renderer *r, uint32_t index)
{
    entity found = {0};
    uint32_t i = 0;
    for (ecs_iterator it = ecs_iterate(r->world, r->gpu_world->node); ecs_next(&it);)
        if (i++ == index)
            found = it.entity;
    return found;
}

static node_component *node_of(renderer *r, uint32_t index)
{
    return ecs_get(r->world, entity_of(r, index), r->gpu_world->node);
}

static const emissive_triangle *emitters_of(renderer *r)
{
    return gpu_buffer_map(device, r->gpu_world->emitters);
}

static const float *cdf_of(renderer *r)
{
    return gpu_buffer_map(device, r->gpu_world->light_cdf);
}

TEST(acceleration_instances_have_the_order_of_instances)
{
    quad_scene s;
    quad_scene_init(&s);
    static const float places[6] = {3, -1, 5, 0, -4, 2};
    float matrix[16];
    for (int i = 0; i < 6; i++) {
        matrix_at(matrix, places[i], 0, 0);
        quad_add(&s, matrix);
    }
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    const world_gpu *w = r->gpu_world;
    const VkAccelerationStructureInstanceKHR *tlas = gpu_buffer_map(device, w->tlas_instances);
    const mesh_instance_gpu *instances = gpu_buffer_map(device, w->instances);
    CHECK(w->instance_count == 6);
    for (uint32_t i = 0; i < w->instance_count; i++) {
        CHECK(tlas[i].instanceCustomIndex == i);
        CHECK(memcmp(tlas[i].transform.matrix, instances[i].world, sizeof instances[i].world) == 0);
        CHECK(tlas[i].accelerationStructureReference == gpu_acceleration_address(device, w->blas[instances[i].mesh]));
    }
    for (uint32_t i = 0; i < 3; i++) // halved in space
        for (uint32_t k = 3; k < 6; k++)
            CHECK(instances[i].world[0][3] < instances[k].world[0][3]);
    renderer_destroy(r);
}

TEST(children_follow_their_parents)
{
    quad_scene s;
    quad_scene_init(&s);
    float matrix[16];
    matrix_at(matrix, 1, 0, 0);
    quad_add(&s, matrix);
    quad_add(&s, matrix);
    s.nodes[1].parent = 0;
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    node_of(r, 0)->matrix[13] = 5;
    CHECK(renderer_frame(r));
    const transform_component *child = ecs_get(r->world, entity_of(r, 1), r->gpu_world->transform);
    CHECK(child->world[12] == 2 && child->world[13] == 5);
    CHECK(child->previous_world[12] == 2 && child->previous_world[13] == 0);
    renderer_destroy(r);
}

TEST(instances_come_and_go)
{
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, IDENTITY);
    renderer *r = renderer_of(&s);
    frame_graph_cull_set(r->graph, false); // builds the acceleration structure too
    CHECK(renderer_frame(r) && r->gpu_world->instance_count == 1);
    for (int i = 0; i < 100; i++) { // more than there was room for
        const entity e = ecs_entity_create(r->world);
        matrix_at(((node_component *)ecs_add(r->world, e, r->gpu_world->node))->matrix, (float)i, 0, 0);
        ecs_add(r->world, e, r->gpu_world->mesh);
    }
    CHECK(renderer_frame(r) && r->gpu_world->instance_count == 101);
    CHECK_NEAR(r->constants.scene_max[0], 100, 1e-5);
    ecs_entity_destroy(r->world, entity_of(r, 0));
    CHECK(renderer_frame(r) && r->gpu_world->instance_count == 100);
    renderer_destroy(r);
}

TEST(instances_scaled_to_nothing_are_left_out)
{
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, IDENTITY);
    renderer *r = renderer_of(&s);
    frame_graph_cull_set(r->graph, false);
    CHECK(renderer_frame(r) && r->gpu_world->instance_count == 1);
    node_of(r, 0)->matrix[5] = 0;
    CHECK(renderer_frame(r) && r->gpu_world->instance_count == 0);
    node_of(r, 0)->matrix[5] = 1;
    CHECK(renderer_frame(r) && r->gpu_world->instance_count == 1);
    renderer_destroy(r);
}

TEST(emitters_have_area_normal_and_share_of_power)
{
    quad_scene s;
    quad_scene_init(&s);
    float mirrored[16], far[16];
    memcpy(mirrored, IDENTITY, sizeof mirrored);
    mirrored[0] = -2; // 4 by 2 metres
    matrix_at(far, 0, 0, -5);
    emissive_quad_add(&s, mirrored, 1);
    emissive_quad_add(&s, far, 2)->flags = MATERIAL_DOUBLE_SIDED;
    quad_add(&s, far); // dark
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    CHECK(r->constants.emitter_count == 4 && r->constants.light_count == 0);
    const emissive_triangle *e = emitters_of(r);
    const float *cdf = cdf_of(r);
    float sum = 0;
    for (int i = 0; i < 4; i++) {
        const bool large = e[i].material == 0;
        CHECK_NEAR(e[i].area, large ? 4 : 2, 1e-5);
        CHECK_NEAR(e[i].normal[2], 1, 1e-6);
        CHECK(e[i].two_sided == !large);
        CHECK_NEAR(e[i].emission[1], large ? 1 : 2, 0);
        sum += large ? 4.0f / 24 : 8.0f / 24; // area * nits * sides
        CHECK_NEAR(cdf[i], sum, 1e-6);
    }
    CHECK(cdf[3] == 1);
    CHECK_NEAR(r->gpu_world->light_power, M_PI * 24, 1e-3);
    renderer_destroy(r);
}

TEST(textured_emitters_have_their_triangles_mean)
{
    quad_scene s;
    quad_scene_init(&s);
    // The quad's diagonal parts it into the lower right triangle (0) and the upper left (1).
    uint8_t texels[16] = {255, 255, 255, 255, 188, 188, 188, 255, 188, 188, 188, 255, 0, 0, 0, 255};
    texture_set(&s, texels, 2, 2, true);
    emissive_quad_add(&s, IDENTITY, 3)->emissive_texture.texture = 0;
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r));
    CHECK(r->constants.emitter_count == 2);
    const double grey = pow((188 / 255.0 + 0.055) / 1.055, 2.4); // half of each triangle lies on the two grey texels
    CHECK_NEAR(emitters_of(r)[0].emission[0], 3 * 0.5 * grey, 0.1);
    CHECK_NEAR(emitters_of(r)[1].emission[0], 3 * (0.5 + 0.5 * grey), 0.1);
    CHECK(emitters_of(r)[0].textured == 1);
    CHECK(emitters_of(r)[0].uv0[0] == 0 && emitters_of(r)[0].uv0[1] == 1);
    renderer_destroy(r);
}

TEST(emitters_follow_their_instance)
{
    quad_scene s;
    quad_scene_init(&s);
    emissive_quad_add(&s, IDENTITY, 1);
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r) && renderer_frame(r));
    CHECK(emitters_of(r)[0].corner[1] == -1);
    node_of(r, 0)->matrix[13] = 5;
    CHECK(renderer_frame(r));
    CHECK(emitters_of(r)[0].corner[1] == 4);
    ecs_entity_destroy(r->world, entity_of(r, 0));
    CHECK(renderer_frame(r));
    CHECK(r->constants.emitter_count == 0 && r->gpu_world->light_power == 0);
    renderer_destroy(r);
}

TEST(lights_share_the_choice_in_proportion_to_power)
{
    quad_scene s;
    quad_scene_init(&s);
    emissive_quad_add(&s, IDENTITY, 1);
    renderer *r = renderer_of(&s);
    const entity point = ecs_entity_create(r->world);
    matrix_at(((node_component *)ecs_add(r->world, point, r->gpu_world->node))->matrix, 1, 2, 3);
    light_component *light = ecs_add(r->world, point, r->gpu_world->light);
    *light = (light_component){.type = LIGHT_POINT, .color = {1, 1, 1}};
    const float down[3] = {0, 0, -2};
    world_sun_add(r, down, 3);
    CHECK(renderer_frame(r));
    CHECK(r->constants.light_count == 2 && r->constants.emitter_count == 2);
    const punctual_light *lights = gpu_buffer_map(device, r->gpu_world->lights);
    CHECK(lights[0].type == LIGHT_POINT && lights[0].position[2] == 3);
    CHECK(lights[1].type == LIGHT_DIRECTIONAL);
    CHECK_NEAR(lights[1].direction[2], -1, 1e-6);
    // 4 pi cd; 3 lux on 2 m x 2 m; two triangles of pi * 1 nit * 2 m^2.
    const double powers[4] = {4 * M_PI, 12, 2 * M_PI, 2 * M_PI};
    const double total = powers[0] + powers[1] + powers[2] + powers[3];
    double sum = 0;
    for (int i = 0; i < 4; i++) {
        sum += powers[i];
        CHECK_NEAR(cdf_of(r)[i], sum / total, 1e-6);
    }
    ecs_entity_destroy(r->world, point);
    CHECK(renderer_frame(r));
    CHECK_NEAR(cdf_of(r)[0], 12 / (12 + 4 * M_PI), 1e-6);
    renderer_destroy(r);
}

// Of the changed sources, by their kind.
static void check_changed_sources(const renderer *r, uint32_t punctual, uint32_t emissive)
{
    uint32_t counts[2] = {0};
    for (uint32_t i = 0; i < r->gpu_world->source_count; i++)
        counts[r->gpu_world->sources[i].emissive] += r->gpu_world->sources[i].changed;
    CHECK(counts[0] == punctual && counts[1] == emissive);
}

TEST(changes_are_what_changed)
{
    quad_scene s;
    quad_scene_init(&s);
    float matrix[16];
    matrix_at(matrix, 100, 100, 100);
    emissive_quad_add(&s, matrix, 1);
    matrix_at(matrix, -100, -100, -100);
    quad_add(&s, matrix);
    quad_add(&s, IDENTITY);
    renderer *r = renderer_of(&s);
    const world_changes *changes = &r->gpu_world->changes;
    const float down[3] = {0, 0, -2};
    const entity sun = world_sun_add(r, down, 3);
    CHECK(renderer_frame(r) && changes->bounds && changes->sources);
    check_changed_sources(r, 1, 1);
    CHECK(renderer_frame(r) && !changes->bounds && !changes->sources && changes->box_count == 0);
    check_changed_sources(r, 0, 0);

    ((light_component *)ecs_get(r->world, sun, r->gpu_world->light))->color[0] = 4;
    CHECK(renderer_frame(r) && !changes->bounds && changes->sources && changes->box_count == 0);
    check_changed_sources(r, 1, 0);

    node_of(r, 2)->matrix[12] = 7; // inside the bounds, gives no light
    CHECK(renderer_frame(r) && !changes->bounds && !changes->sources && changes->box_count == 2);
    CHECK(changes->boxes[0].min[0] == -1 && changes->boxes[0].max[1] == 1);
    CHECK(changes->boxes[1].min[0] == 6 && changes->boxes[1].max[0] == 8);

    node_of(r, 0)->matrix[12] = 99;
    CHECK(renderer_frame(r) && changes->bounds && changes->sources && changes->box_count == 2);
    check_changed_sources(r, 1, 1); // the sun shines through other bounds, so with other power

    ecs_entity_destroy(r->world, entity_of(r, 2));
    CHECK(renderer_frame(r) && !changes->bounds && changes->box_count == 1);
    CHECK(changes->boxes[0].min[0] == 6 && changes->boxes[0].max[0] == 8);
    check_changed_sources(r, 0, 0);

    ecs_entity_destroy(r->world, sun);
    CHECK(renderer_frame(r) && changes->sources && changes->box_count == 0);
    check_changed_sources(r, 0, 0);
    renderer_destroy(r);
}

static bool same_bytes_on_gpu(const renderer *r)
{
    material read[QUADS_MAX];
    const size_t size = r->scene->material_count * sizeof *read;
    return gpu_buffer_read(device, r->gpu_world->materials, 0, read, size) &&
           memcmp(read, r->gpu_world->material_data, size) == 0;
}

TEST(materials_that_change_are_uploaded_and_told)
{
    quad_scene s;
    quad_scene_init(&s);
    float matrix[16];
    matrix_at(matrix, 100, 100, 100);
    emissive_quad_add(&s, matrix, 1);
    matrix_at(matrix, -100, -100, -100);
    quad_add(&s, matrix);
    matrix_at(matrix, 5, 0, 0);
    quad_add(&s, matrix);
    renderer *r = renderer_of(&s);
    const world_changes *changes = &r->gpu_world->changes;
    CHECK(renderer_frame(r) && renderer_frame(r) && same_bytes_on_gpu(r));
    const float power = r->gpu_world->light_power;

    static const float green[4] = {0, 1, 0, 1}, dark[3] = {0}, bright[3] = {2, 2, 2};
    world_material_set(r, 2, green, dark);
    CHECK(renderer_frame(r) && changes->box_count == 1 && !changes->sources && !changes->bounds);
    CHECK(changes->boxes[0].min[0] == 4 && changes->boxes[0].max[0] == 6 && same_bytes_on_gpu(r));
    CHECK(r->gpu_world->material_data[2].base_color[1] == 1 && r->scene->materials[2].base_color[1] == 0.25f);
    world_material_set(r, 2, green, dark); // the same
    CHECK(renderer_frame(r) && changes->box_count == 0 && !changes->sources);

    world_material_set(r, 0, s.materials[0].base_color, bright); // twice as bright
    CHECK(renderer_frame(r) && changes->sources && changes->box_count == 0 && same_bytes_on_gpu(r));
    check_changed_sources(r, 0, 1);
    CHECK_NEAR(r->gpu_world->light_power, 2 * power, 1e-4 * power);

    world_material_set(r, 2, green, bright); // begins to emit
    CHECK(renderer_frame(r) && changes->sources && r->constants.emitter_count == 4);
    check_changed_sources(r, 0, 1);
    node_of(r, 2)->matrix[12] = 6; // and is followed
    CHECK(renderer_frame(r) && changes->sources && emitters_of(r)[0].emission[0] == 2);
    check_changed_sources(r, 0, 1);
    world_material_set(r, 2, green, dark); // and ends
    CHECK(renderer_frame(r) && changes->sources && r->constants.emitter_count == 2);
    CHECK(renderer_frame(r) && !changes->sources && changes->box_count == 0);
    renderer_destroy(r);
}

// Emission times the texture's mean, also of what is dark at first.
TEST(textured_surfaces_may_begin_to_emit)
{
    quad_scene s;
    quad_scene_init(&s);
    uint8_t texels[4] = {255, 255, 255, 255};
    texture_set(&s, texels, 1, 1, true);
    quad_add(&s, IDENTITY)->emissive_texture.texture = 0;
    renderer *r = renderer_of(&s);
    CHECK(renderer_frame(r) && r->constants.emitter_count == 0);
    static const float red[3] = {3, 0, 0};
    world_material_set(r, 0, s.materials[0].base_color, red);
    CHECK(renderer_frame(r) && r->constants.emitter_count == 2);
    CHECK_NEAR(emitters_of(r)[0].emission[0], 3, 1e-5);
    CHECK(emitters_of(r)[0].textured == 1 && emitters_of(r)[0].emission[1] == 0);
    renderer_destroy(r);
}

TEST(spots_fall_off_between_their_cones)
{
    quad_scene s;
    quad_scene_init(&s);
    renderer *r = renderer_of(&s);
    const entity spot = ecs_entity_create(r->world);
    matrix_at(((node_component *)ecs_add(r->world, spot, r->gpu_world->node))->matrix, 0, 0, 0);
    light_component *light = ecs_add(r->world, spot, r->gpu_world->light);
    *light = (light_component){.type = LIGHT_SPOT, .color = {1, 1, 1}, .inner_cone = 0.2f, .outer_cone = 0.6f};
    CHECK(renderer_frame(r));
    const punctual_light *made = gpu_buffer_map(device, r->gpu_world->lights);
    CHECK_NEAR(cos(0.2) * made->spot_scale + made->spot_offset, 1, 1e-4);
    CHECK_NEAR(cos(0.6) * made->spot_scale + made->spot_offset, 0, 1e-4);
    CHECK_NEAR(made->direction[2], -1, 1e-6);
    renderer_destroy(r);
}

TEST(the_validation_layer_is_silent)
{
    CHECK(gpu_validation_messages(device) == 0);
}

int main(void)
{
    device = gpu_create(&(gpu_desc){.validation = true});
    if (!device) {
        printf("skipped: no device with the validation layer\n");
        return 77;
    }
    RUN(acceleration_instances_have_the_order_of_instances);
    RUN(children_follow_their_parents);
    RUN(instances_come_and_go);
    RUN(instances_scaled_to_nothing_are_left_out);
    RUN(emitters_have_area_normal_and_share_of_power);
    RUN(textured_emitters_have_their_triangles_mean);
    RUN(emitters_follow_their_instance);
    RUN(lights_share_the_choice_in_proportion_to_power);
    RUN(changes_are_what_changed);
    RUN(materials_that_change_are_uploaded_and_told);
    RUN(textured_surfaces_may_begin_to_emit);
    RUN(spots_fall_off_between_their_cones);
    RUN(the_validation_layer_is_silent);
    gpu_destroy(device);
    return test_end();
}
