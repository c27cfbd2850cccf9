// Clips in the renderer: entities follow the clock, whatever came before, and return to rest.
#include "modules/animation_system.h"
#include "modules/world.h"
#include "quad_scene.h"
#include "test.h"

static gpu *device;

// Three quads, the second a child of the first; a lamp at the third. Three animations of two seconds.
typedef struct moving_scene {
    quad_scene quads;
    scene_light light;
    scene_emission emissions[3];
    scene_camera camera;
    scene_animation animations[3];
    scene_channel channels[6];
} moving_scene;

static const float two_times[] = {0, 2};

static scene_channel channel_of(scene_target target, uint32_t index, uint32_t width, const float *values)
{
    return (scene_channel){.target = target,
                           .index = index,
                           .interpolation = SCENE_LINEAR,
                           .width = width,
                           .key_count = 2,
                           .times = two_times,
                           .values = values};
}

static void moving_scene_init(moving_scene *s)
{
    static const float right[] = {0, 0, 0, 2, 0, 0}, up[] = {0, 0, 0, 0, 2, 0}, scales[] = {1, 1, 1, 3, 3, 3};
    static const float brighter[] = {0, 10}, colors[] = {0, 0, 0, 1, 1, 1, 1, 1}, strengths[] = {0, 8};
    memset(s, 0, sizeof *s);
    quad_scene_init(&s->quads);
    scene_data *data = &s->quads.data;
    for (uint32_t i = 0; i < 3; i++) {
        quad_add(&s->quads, IDENTITY);
        scene_node *node = &s->quads.nodes[i];
        node->has_trs = true;
        node->rotation[3] = node->scale[0] = node->scale[1] = node->scale[2] = 1;
        s->emissions[i] = (scene_emission){.factor = {1, 0.5f, 0}};
    }
    s->quads.nodes[1].parent = 0;
    s->quads.nodes[2].light = 0;
    s->quads.nodes[2].translation[2] = s->quads.nodes[2].matrix[14] = 1;
    s->light = (scene_light){.type = LIGHT_POINT, .hue = {1, 0.5f, 0}};
    s->camera = (scene_camera){.name = "c", .node = 1, .yfov = 1, .near_plane = 0.01f};
    const scene_channel channels[] = {
        channel_of(SCENE_TRANSLATION, 0, 3, right), channel_of(SCENE_SCALE, 0, 3, scales),
        channel_of(SCENE_TRANSLATION, 0, 3, up),    channel_of(SCENE_LIGHT_INTENSITY, 0, 1, brighter),
        channel_of(SCENE_BASE_COLOR, 1, 4, colors), channel_of(SCENE_EMISSIVE_STRENGTH, 1, 1, strengths),
    };
    memcpy(s->channels, channels, sizeof channels);
    s->animations[0] = (scene_animation){.name = "right", .channels = s->channels, .channel_count = 2, .duration = 2};
    s->animations[1] = (scene_animation){.name = "up", .channels = s->channels + 2, .channel_count = 1, .duration = 2};
    s->animations[2] =
        (scene_animation){.name = "light", .channels = s->channels + 3, .channel_count = 3, .duration = 2};
    data->lights = &s->light;
    data->light_count = 1;
    data->emissions = s->emissions;
    data->cameras = &s->camera;
    data->camera_count = 1;
    data->animations = s->animations;
    data->animation_count = 3;
}

static renderer *renderer_of(const moving_scene *s)
{
    render_settings settings = render_settings_default();
    settings.width = settings.height = 16;
    settings.vpls = 0;
    renderer *r = renderer_create(device, &s->quads.data, &settings);
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    return r;
}

static entity play(renderer *r, const char *name, animation_clip clip)
{
    clip.animation = animation_find(r->scene, name);
    return animation_play(r, &clip);
}

static bool frame_at(renderer *r, double time)
{
    r->time = time;
    return renderer_frame(r);
}

static const float *world_of(const renderer *r, uint32_t node)
{
    return ((transform_component *)ecs_get(r->world, r->gpu_world->node_entities[node], r->gpu_world->transform))
        ->world;
}

TEST(nodes_follow_the_clock_and_their_children_follow_them)
{
    moving_scene s;
    moving_scene_init(&s);
    renderer *r = renderer_of(&s);
    CHECK(frame_at(r, 1) && world_of(r, 0)[12] == 0); // nothing plays
    play(r, "right", (animation_clip){.start = 10, .speed = 1});
    CHECK(frame_at(r, 9) && world_of(r, 0)[12] == 0);
    CHECK(frame_at(r, 11) && world_of(r, 0)[12] == 1 && world_of(r, 0)[0] == 2 && world_of(r, 1)[12] == 1);
    CHECK(r->gpu_world->changes.box_count > 0);
    CHECK(frame_at(r, 11) && r->gpu_world->changes.box_count == 0); // the same time, the same place
    CHECK(frame_at(r, 99) && world_of(r, 0)[12] == 2);
    renderer_destroy(r);
}

TEST(the_same_time_gives_the_same_pose_whatever_came_before)
{
    moving_scene s;
    moving_scene_init(&s);
    float there[3][16];
    renderer *r = renderer_of(&s);
    play(r, "right", (animation_clip){.speed = 0.3f, .loop = true});
    play(r, "light", (animation_clip){.speed = -0.7f, .loop = true});
    CHECK(frame_at(r, 12.34));
    for (uint32_t i = 0; i < 3; i++)
        memcpy(there[i], world_of(r, i), sizeof there[i]);
    const material color = r->gpu_world->material_data[1];
    const entity extra = play(r, "up", (animation_clip){.start = 20, .speed = 1});
    CHECK(frame_at(r, 3) && frame_at(r, 21) && frame_at(r, 0.1));
    CHECK(memcmp(there[0], world_of(r, 0), sizeof there[0]) != 0);
    animation_stop(r, extra);
    CHECK(frame_at(r, 12.34));
    for (uint32_t i = 0; i < 3; i++)
        CHECK(memcmp(there[i], world_of(r, i), sizeof there[i]) == 0);
    CHECK(memcmp(&color, &r->gpu_world->material_data[1], sizeof color) == 0);
    renderer_destroy(r);
}

TEST(later_clips_have_their_way_unless_layers_say_otherwise)
{
    moving_scene s;
    moving_scene_init(&s);
    renderer *r = renderer_of(&s);
    const entity up = play(r, "up", (animation_clip){.start = 1, .speed = 1});
    play(r, "right", (animation_clip){.start = 0, .speed = 1});
    CHECK(frame_at(r, 2) && world_of(r, 0)[13] == 1 && world_of(r, 0)[12] == 0); // up began later
    CHECK(world_of(r, 0)[0] == 3); // what it does not share stays
    const component_type clip = ecs_component_find(r->world, "animation");
    ((animation_clip *)ecs_get(r->world, up, clip))->layer = -1;
    CHECK(frame_at(r, 2) && world_of(r, 0)[13] == 0 && world_of(r, 0)[12] == 2);
    animation_stop(r, up);
    CHECK(frame_at(r, 1) && world_of(r, 0)[12] == 1);
    animation_stop(r, up); // gone already
    renderer_destroy(r);
}

TEST(what_stops_returns_to_rest_once)
{
    moving_scene s;
    moving_scene_init(&s);
    renderer *r = renderer_of(&s);
    const entity playing = play(r, "right", (animation_clip){.speed = 1});
    CHECK(frame_at(r, 1) && world_of(r, 0)[12] == 1);
    animation_stop(r, playing);
    CHECK(frame_at(r, 1) && world_of(r, 0)[12] == 0 && world_of(r, 0)[0] == 1);
    node_component *node = ecs_get(r->world, r->gpu_world->node_entities[0], r->gpu_world->node);
    node->matrix[12] = 7; // from now on the embedder's
    CHECK(frame_at(r, 2) && world_of(r, 0)[12] == 7);
    renderer_destroy(r);
}

TEST(lights_and_materials_follow)
{
    moving_scene s;
    moving_scene_init(&s);
    renderer *r = renderer_of(&s);
    CHECK(frame_at(r, 0) && r->gpu_world->light_power == 0);
    const entity playing = play(r, "light", (animation_clip){.speed = 1});
    CHECK(frame_at(r, 1) && r->gpu_world->changes.sources);
    const punctual_light *light = gpu_buffer_map(device, r->gpu_world->lights);
    CHECK(light->color[0] == 5 && light->color[1] == 2.5f && light->color[2] == 0 && light->position[2] == 1);
    const material *m = &r->gpu_world->material_data[1];
    CHECK(m->base_color[0] == 0.5f && m->base_color[3] == 1 && m->emissive[0] == 4 && m->emissive[1] == 2);
    CHECK(r->constants.emitter_count == 2);
    animation_stop(r, playing);
    CHECK(frame_at(r, 1) && r->gpu_world->light_power == 0 && r->constants.emitter_count == 0);
    CHECK(memcmp(m, &s.quads.materials[1], sizeof *m) == 0);
    renderer_destroy(r);
}

TEST(entities_that_are_gone_are_passed_over)
{
    moving_scene s;
    moving_scene_init(&s);
    renderer *r = renderer_of(&s);
    play(r, "right", (animation_clip){.speed = 1});
    play(r, "light", (animation_clip){.speed = 1});
    CHECK(frame_at(r, 0.5));
    ecs_entity_destroy(r->world, r->gpu_world->node_entities[0]);
    ecs_remove(r->world, r->gpu_world->node_entities[2], r->gpu_world->light);
    CHECK(frame_at(r, 1) && r->gpu_world->instance_count == 2 && r->constants.light_count == 0);
    renderer_destroy(r);
}

TEST(cameras_stand_where_their_nodes_are)
{
    moving_scene s;
    moving_scene_init(&s);
    renderer *r = renderer_of(&s);
    CHECK(renderer_camera_of_scene(r, 0).eye[0] == 0);
    play(r, "right", (animation_clip){.speed = 1});
    r->time = 1;
    animation_update(r); // before any frame
    CHECK(renderer_camera_of_scene(r, 0).eye[0] == 1);
    CHECK(frame_at(r, 2) && renderer_camera_of_scene(r, 0).eye[0] == 2);
    renderer_destroy(r);
}

// Of a model that is beside the project.
TEST(morph_weights_follow)
{
    scene_data *scene = scene_load("../shared/scenes/animated/AnimatedMorphCube/AnimatedMorphCube.gltf");
    if (!scene) {
        printf("  skipped: no AnimatedMorphCube\n");
        return;
    }
    render_settings settings = render_settings_default();
    settings.width = settings.height = 16;
    settings.vpls = 0;
    renderer *r = renderer_create(device, scene, &settings);
    const uint32_t node = scene->deformations[0].node;
    const weights_component *weights = ecs_get(r->world, r->gpu_world->node_entities[node], r->gpu_world->weights);
    CHECK(weights && weights->count == 2 && weights->weights[0] == 0);
    const entity playing = play(r, "Square", (animation_clip){.speed = 1});
    float expected[2];
    animation_channel_value(&scene->animations[0].channels[0], 1.5, expected);
    CHECK(frame_at(r, 1.5) && memcmp(weights->weights, expected, sizeof expected) == 0);
    CHECK(expected[0] + expected[1] > 0.1f);
    animation_stop(r, playing);
    CHECK(frame_at(r, 1.5) && weights->weights[0] == 0 && weights->weights[1] == 0);
    renderer_destroy(r);
    scene_destroy(scene);
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
    RUN(nodes_follow_the_clock_and_their_children_follow_them);
    RUN(the_same_time_gives_the_same_pose_whatever_came_before);
    RUN(later_clips_have_their_way_unless_layers_say_otherwise);
    RUN(what_stops_returns_to_rest_once);
    RUN(lights_and_materials_follow);
    RUN(entities_that_are_gone_are_passed_over);
    RUN(cameras_stand_where_their_nodes_are);
    RUN(morph_weights_follow);
    RUN(the_validation_layer_is_silent);
    gpu_destroy(device);
    return test_end();
}
