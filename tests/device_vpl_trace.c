// The VPLs that stay from frame to frame: after any changes to lights and surfaces they are to the bit what tracing all
// of them makes.
#include "quad_scene.h"
#include "test.h"

#include "modules/renderer.h"
#include "modules/vpl_trace.h"
#include "modules/world.h"

#define SCENES BUILD_DIR "/scenes/"

static gpu *devices[2]; // one for each renderer: a device holds one scene

// ---- Two renderers of one scene, one incremental, that see the same changes

typedef struct pair {
    scene_data *scene;
    renderer *kept, *fresh;
    float power; // of the scene's own lights
    uint32_t random;
    entity lights[64], things[64]; // added by the test
    uint32_t light_count, thing_count;
    vpl *last; // of `kept`
} pair;

static renderer *renderer_of(gpu *device, scene_data *scene, const render_settings *settings)
{
    renderer *r = scene ? renderer_create(device, scene, settings) : NULL;
    if (!r) {
        printf("cannot set up a scene\n");
        exit(EXIT_FAILURE);
    }
    static const char *const names[] = {"vpls|-", "vpl_changed|-", "rays_vpl|-"};
    for (; r->export_count < countof(names); r->export_count++)
        r->exports[r->export_count] = names[r->export_count];
    return r;
}

static pair pair_create(const char *path, uint32_t rays, uint32_t vpls)
{
    render_settings s = render_settings_default();
    s.width = s.height = 16;
    s.vpls = vpls;
    s.rays = rays;
    pair p = {.scene = scene_load(path), .random = 1};
    s.incremental = true;
    p.kept = renderer_of(devices[0], p.scene, &s);
    s.incremental = false;
    p.fresh = renderer_of(devices[1], p.scene, &s);
    p.last = memory_alloc(vpls * sizeof(vpl));
    return p;
}

static void pair_destroy(pair *p)
{
    renderer_destroy(p->kept);
    renderer_destroy(p->fresh);
    scene_destroy(p->scene);
    free(p->last);
}

static uint32_t random_below(pair *p, uint32_t end)
{
    p->random = p->random * 1664525u + 1013904223u;
    return (p->random >> 8) % end;
}
static float random_float(pair *p) // in [0,1)
{
    return (float)random_below(p, 1 << 16) / (1 << 16);
}

static void point_inside(pair *p, float point[3])
{
    const frame_constants *c = &p->kept->constants;
    for (int k = 0; k < 3; k++)
        point[k] = c->scene_min[k] + (0.1f + 0.8f * random_float(p)) * (c->scene_max[k] - c->scene_min[k]);
}

// ---- Changes, made to both

#define BOTH(p, r) for (renderer *r = (p)->kept; r; r = r == (p)->kept ? (p)->fresh : NULL)

static entity node_add(pair *p, const float position[3])
{
    entity added = {0};
    BOTH(p, r)
    {
        added = ecs_entity_create(r->world);
        node_component *node = ecs_add(r->world, added, r->gpu_world->node);
        for (int k = 0; k < 4; k++)
            node->matrix[5 * k] = 1;
        memcpy(node->matrix + 12, position, 3 * sizeof(float));
    }
    return added; // both worlds count alike
}

// `share`: its power, of what the scene had to begin with.
static void light_set(pair *p, entity e, float share)
{
    const float candela = share * p->power / (4 * (float)M_PI);
    BOTH(p, r)
    {
        light_component *light = ecs_add(r->world, e, r->gpu_world->light);
        *light = (light_component){.type = LIGHT_POINT, .color = {candela, 0.5f * candela, 0.25f * candela}};
    }
}

static void light_change(pair *p)
{
    float position[3];
    point_inside(p, position);
    const uint32_t what = random_below(p, 4);
    if (what == 0 && p->light_count < countof(p->lights)) {
        p->lights[p->light_count] = node_add(p, position);
        light_set(p, p->lights[p->light_count++], 0.01f + 0.2f * random_float(p));
    } else if (what == 1 && p->light_count > 4) {
        const uint32_t gone = random_below(p, p->light_count);
        BOTH(p, r)
        ecs_entity_destroy(r->world, p->lights[gone]);
        p->lights[gone] = p->lights[--p->light_count];
    } else if (what == 2 && p->light_count > 0) {
        light_set(p, p->lights[random_below(p, p->light_count)], 0.01f + 0.2f * random_float(p));
    } else if (p->light_count > 0) {
        const entity e = p->lights[random_below(p, p->light_count)];
        BOTH(p, r)
        memcpy(((node_component *)ecs_get(r->world, e, r->gpu_world->node))->matrix + 12, position, sizeof position);
    }
}

// A smaller copy of a mesh of the scene appears, moves or goes; the scene's bounds stay.
static void thing_change(pair *p)
{
    float position[3];
    point_inside(p, position);
    const uint32_t what = random_below(p, 3);
    if (p->thing_count == 0 || (what == 0 && p->thing_count < countof(p->things))) {
        const entity e = p->things[p->thing_count++] = node_add(p, position);
        const world_instance *like = &p->kept->gpu_world->order[random_below(p, p->kept->gpu_world->instance_count)];
        const uint32_t mesh = like->mesh;
        BOTH(p, r)
        {
            ((mesh_component *)ecs_add(r->world, e, r->gpu_world->mesh))->mesh = mesh;
            node_component *node = ecs_get(r->world, e, r->gpu_world->node);
            node->matrix[0] = node->matrix[5] = node->matrix[10] = 0.03f;
        }
    } else if (what == 1) {
        const uint32_t gone = random_below(p, p->thing_count);
        BOTH(p, r)
        ecs_entity_destroy(r->world, p->things[gone]);
        p->things[gone] = p->things[--p->thing_count];
    } else {
        const entity e = p->things[random_below(p, p->thing_count)];
        BOTH(p, r)
        {
            node_component *node = ecs_get(r->world, e, r->gpu_world->node);
            memcpy(node->matrix + 12, position, sizeof position);
        }
    }
}

// A surface gets another colour, or a lamp another brightness; now and then a surface begins to glow a little, or ends.
static void material_change(pair *p)
{
    const uint32_t index = random_below(p, p->scene->material_count), what = random_below(p, 3);
    const material *at_rest = &p->scene->materials[index];
    float color[4], glow[3];
    memcpy(color, p->kept->gpu_world->material_data[index].base_color, sizeof color);
    memcpy(glow, p->kept->gpu_world->material_data[index].emissive, sizeof glow);
    for (int k = 0; k < 3 && what == 0; k++)
        color[k] = 0.1f + 0.8f * random_float(p);
    const float share = what == 0 ? 0 : what == 1 ? 0.5f + random_float(p) : (float)random_below(p, 2);
    for (int k = 0; k < 3 && what > 0; k++)
        glow[k] = at_rest->emissive[k] > 0 ? fmaxf(share, 0.5f) * at_rest->emissive[k]
                  : what == 2              ? 0.1f * share
                                           : glow[k];
    BOTH(p, r)
    world_material_set(r, index, color, glow);
}

// ---- What a frame made

static vpl *vpls_read(renderer *r)
{
    const size_t size = r->settings.vpls * sizeof(vpl);
    vpl *vpls = memory_alloc(size);
    CHECK(gpu_buffer_read(r->gpu, frame_graph_find_buffer(r->graph, "vpls|-"), 0, vpls, size));
    return vpls;
}

static uint32_t rays_of(renderer *r)
{
    const gpu_buffer buffer = frame_graph_find_buffer(r->graph, "rays_vpl|-");
    return buffer.id ? *(const uint32_t *)gpu_buffer_map(r->gpu, buffer) : 0;
}

// The slots that `changed` leaves out hold what they did. Returns how many it names.
static uint32_t check_changed(pair *p, const vpl *vpls)
{
    const uint32_t slots = p->kept->settings.vpls;
    const size_t size = div_up_u32(slots, 32) * sizeof(uint32_t);
    uint32_t *changed = memory_alloc(size), named = 0, unnamed_differ = 0, named_agree = 0;
    CHECK(gpu_buffer_read(p->kept->gpu, frame_graph_find_buffer(p->kept->graph, "vpl_changed|-"), 0, changed, size));
    for (uint32_t i = 0; i < slots; i++) {
        const bool is_named = changed[i / 32] >> (i % 32) & 1, differs = memcmp(&vpls[i], &p->last[i], sizeof(vpl));
        named += is_named;
        unnamed_differ += !is_named && differs;
        named_agree += is_named && !differs;
    }
    CHECK(unnamed_differ == 0);
    CHECK(named_agree == 0);
    free(changed);
    return named;
}

typedef struct tally {
    uint32_t frames[3]; // by vpl_change
    uint64_t rays, all_rays; // of the frames with VPLS_SOME: traced, and what tracing all of them takes
    uint64_t named;
} tally;

static void frame_check(pair *p, tally *t)
{
    CHECK(renderer_frame(p->kept) && renderer_frame(p->fresh));
    const vpl_change change = vpl_trace_change(p->kept);
    CHECK(vpl_trace_change(p->fresh) == VPLS_ALL);
    const size_t size = p->kept->settings.vpls * sizeof(vpl);
    vpl *kept = vpls_read(p->kept), *fresh = vpls_read(p->fresh);
    CHECK(memcmp(kept, fresh, size) == 0);
    CHECK((change != VPLS_NONE || rays_of(p->kept) == 0) && rays_of(p->fresh) > 0);
    t->frames[change]++;
    if (change == VPLS_SOME) {
        t->named += check_changed(p, kept);
        t->rays += rays_of(p->kept);
        t->all_rays += rays_of(p->fresh);
    }
    memcpy(p->last, kept, size);
    free(kept);
    free(fresh);
}

// ---- Tests

static void check_random_changes(const char *scene, uint32_t rays, uint32_t vpls, uint32_t frames)
{
    pair p = pair_create(scene, rays, vpls);
    tally t = {0};
    frame_check(&p, &t);
    p.power = p.kept->gpu_world->light_power;
    for (uint32_t i = 0; i < 8; i++) { // some of everything to begin with
        light_change(&p);
        thing_change(&p);
    }
    for (uint32_t frame = 0; frame < frames; frame++) {
        frame_check(&p, &t);
        if (frame % 5 != 1)
            light_change(&p);
        if (frame % 5 != 1 && frame % 3 != 0)
            thing_change(&p);
    }
    printf("  %s: %u frames all, %u some, %u none; %.3f of the rays, %.0f slots changed a frame\n", scene,
           t.frames[VPLS_ALL], t.frames[VPLS_SOME], t.frames[VPLS_NONE], (double)t.rays / (double)t.all_rays,
           (double)t.named / t.frames[VPLS_SOME]);
    CHECK(t.frames[VPLS_SOME] > frames / 2 && t.frames[VPLS_NONE] >= frames / 5 - 1);
    CHECK(t.rays < t.all_rays / 2 && t.named > 0);
    pair_destroy(&p);
}

TEST(changes_make_what_tracing_everything_makes)
{
    check_random_changes(SCENES "atrium.glb", RAYS_QUERY, 3001, 30);
    check_random_changes(SCENES "atrium.glb", RAYS_AUTO, 20000, 40);
    check_random_changes(SCENES "two_rooms.glb", RAYS_AUTO, 5000, 30);
    check_random_changes(SCENES "cornell.glb", RAYS_QUERY, 3000, 30);
}

static void check_random_colors(const char *scene, uint32_t rays, uint32_t vpls)
{
    enum { FRAMES = 30 };
    pair p = pair_create(scene, rays, vpls);
    tally t = {0};
    frame_check(&p, &t);
    p.power = p.kept->gpu_world->light_power;
    for (uint32_t frame = 0; frame < FRAMES; frame++) {
        frame_check(&p, &t);
        if (frame % 5 != 1)
            material_change(&p);
        if (frame % 7 == 3)
            thing_change(&p);
    }
    printf("  %s: %u frames all, %u some, %u none\n", scene, t.frames[VPLS_ALL], t.frames[VPLS_SOME],
           t.frames[VPLS_NONE]);
    CHECK(t.frames[VPLS_SOME] > FRAMES / 4 && t.frames[VPLS_NONE] > 0);
    pair_destroy(&p);
}

TEST(colors_and_emission_that_change_make_what_tracing_everything_makes)
{
    check_random_colors(SCENES "cornell.glb", RAYS_QUERY, 3000);
    check_random_colors(SCENES "two_rooms.glb", RAYS_AUTO, 5000);
    check_random_colors(SCENES "atrium.glb", RAYS_AUTO, 5000);
}

TEST(settings_trace_everything_anew)
{
    pair p = pair_create(SCENES "cornell.glb", RAYS_AUTO, 2000);
    tally t = {0};
    for (uint32_t i = 0; i < 3; i++)
        frame_check(&p, &t);
    CHECK(t.frames[VPLS_ALL] == 1 && t.frames[VPLS_NONE] == 2);
    p.power = p.kept->gpu_world->light_power;
    BOTH(&p, r)
    r->settings.seed++;
    frame_check(&p, &t);
    BOTH(&p, r)
    r->settings.bounces = 2;
    frame_check(&p, &t);
    BOTH(&p, r)
    r->settings.only = ONLY_DIRECT; // nothing is traced in between
    CHECK(renderer_frame(p.kept) && renderer_frame(p.fresh));
    float position[3];
    point_inside(&p, position);
    light_set(&p, node_add(&p, position), 1);
    CHECK(renderer_frame(p.kept) && renderer_frame(p.fresh));
    BOTH(&p, r)
    r->settings.only = ONLY_ALL;
    frame_check(&p, &t);
    CHECK(t.frames[VPLS_ALL] == 4);
    pair_destroy(&p);
}

// Of the light that moves, the paths; of the others, none.
TEST(a_light_that_moves_takes_its_own_paths_only)
{
    pair p = pair_create(SCENES "cornell.glb", RAYS_AUTO, 9000);
    tally t = {0};
    frame_check(&p, &t);
    p.power = p.kept->gpu_world->light_power;
    float position[3] = {0};
    for (uint32_t i = 0; i < 10; i++) {
        point_inside(&p, position);
        p.lights[i] = node_add(&p, position);
        light_set(&p, p.lights[i], 0.1f);
    }
    frame_check(&p, &t);
    t = (tally){0};
    BOTH(&p, r)
    ((node_component *)ecs_get(r->world, p.lights[3], r->gpu_world->node))->matrix[12] += 0.01f;
    frame_check(&p, &t);
    printf("  one light of 10 and the scene's: %.3f of the rays\n", (double)t.rays / (double)t.all_rays);
    CHECK(t.frames[VPLS_SOME] == 1 && t.rays * 8 < t.all_rays && t.rays * 40 > t.all_rays);
    pair_destroy(&p);
}

static node_component *sun_find(renderer *r)
{
    for (ecs_iterator it = ecs_iterate(r->world, r->gpu_world->light); ecs_next(&it);)
        if (((light_component *)it.component)->type == LIGHT_DIRECTIONAL) {
            const entity e = it.entity;
            ecs_iterate_end(&it);
            return ecs_get(r->world, e, r->gpu_world->node);
        }
    return NULL;
}

static void turn_about_x(float m[16], float angle)
{
    for (int column = 0; column < 3; column++) {
        const float y = m[4 * column + 1], z = m[4 * column + 2];
        m[4 * column + 1] = cosf(angle) * y - sinf(angle) * z;
        m[4 * column + 2] = sinf(angle) * y + cosf(angle) * z;
    }
}

// Light paths that reach the ground reach it where they did: all moving alike would flicker.
TEST(a_sun_that_turns_leaves_the_lights_on_the_ground_where_they_are)
{
    const uint32_t count = 9000;
    pair p = pair_create(SCENES "atrium.glb", RAYS_AUTO, count);
    tally t = {0};
    frame_check(&p, &t);
    vpl *before = vpls_read(p.kept);
    BOTH(&p, r)
    {
        node_component *sun = sun_find(r);
        CHECK(sun != NULL);
        turn_about_x(sun->matrix, 0.007f);
    }
    frame_check(&p, &t);
    vpl *after = vpls_read(p.kept);
    uint32_t on_ground = 0, stayed = 0;
    const float ground = p.kept->constants.scene_min[1] + 0.5f;
    for (uint32_t i = 0; i < count; i++) {
        const vpl *a = &before[i], *b = &after[i];
        if (a->bounce != 0 || b->bounce != 0 || a->intensity <= 0 || b->intensity <= 0 || a->normal[1] < 0.9f ||
            a->position[1] > ground || b->position[1] > ground)
            continue;
        on_ground++;
        stayed += hypotf(a->position[0] - b->position[0], a->position[2] - b->position[2]) < 0.01f;
    }
    printf("  %u of %u lights on the ground stay within a centimetre\n", stayed, on_ground);
    CHECK(on_ground > 50 && stayed > 0.9 * on_ground);
    free(before);
    free(after);
    pair_destroy(&p);
}

// A floor's VPLs carry albedo / pi of what falls on it, evenly spread. Something small high above it makes the shadow
// of the scene's bounds larger than the bounds.
TEST(a_sun_lights_a_floor_evenly)
{
    static quad_scene quads;
    quad_scene_init(&quads);
    quad_add(&quads, (const float[16]){2, 0, 0, 0, 0, 0, -2, 0, 0, 1, 0, 0, 0, 0, 0, 1});
    quad_add(&quads, (const float[16]){.01f, 0, 0, 0, 0, 0, -.01f, 0, 0, 1, 0, 0, 1.5f, 3, 1.5f, 1});
    render_settings s = render_settings_default();
    s.width = s.height = 16;
    s.vpls = 20000;
    s.bounces = 1;
    renderer *r = renderer_of(devices[0], &quads.data, &s);
    static const float slopes[][2] = {{0, 0}, {0.1f, -0.2f}, {-0.6f, 0.4f}, {0.9f, 0.9f}};
    const entity e = ecs_entity_create(r->world);
    ecs_add(r->world, e, r->gpu_world->node);
    ecs_add(r->world, e, r->gpu_world->transform);
    *(light_component *)ecs_add(r->world, e, r->gpu_world->light) =
        (light_component){.type = LIGHT_DIRECTIONAL, .color = {10, 10, 10}};
    for (size_t i = 0; i < countof(slopes); i++) {
        const float x = slopes[i][0], z = slopes[i][1];
        node_component *node = ecs_get(r->world, e, r->gpu_world->node);
        *node = (node_component){.matrix = {1, 0, 0, 0, 0, 1, 0, 0, -x, 1, -z, 0, 0, 0, 0, 1}}; // shines along -z
        CHECK(renderer_frame(r));
        vpl *vpls = vpls_read(r);
        double sum = 0, half[2] = {0};
        for (uint32_t k = 0; k < s.vpls; k++)
            if (vpls[k].intensity > 0 && vpls[k].position[1] < 1) {
                sum += (double)vpls[k].color[0];
                half[0] += vpls[k].position[0] < 0 ? (double)vpls[k].color[0] : 0;
                half[1] += vpls[k].position[2] < 0 ? (double)vpls[k].color[0] : 0;
            }
        free(vpls);
        const double expected = 0.5 / M_PI * 10 * 16 / sqrt(1 + (double)(x * x + z * z));
        printf("  slopes %g, %g: %.4f of %.4f, halves %.4f and %.4f\n", (double)x, (double)z, sum, expected,
               half[0] / sum, half[1] / sum);
        CHECK_NEAR(sum / expected, 1, 0.01);
        CHECK_NEAR(half[0] / sum, 0.5, 0.01);
        CHECK_NEAR(half[1] / sum, 0.5, 0.01);
    }
    renderer_destroy(r);
}

TEST(the_validation_layer_has_nothing_to_say)
{
    CHECK(gpu_validation_messages(devices[0]) == 0 && gpu_validation_messages(devices[1]) == 0);
}

int main(void)
{
    for (size_t i = 0; i < countof(devices); i++) {
        devices[i] = gpu_create(&(gpu_desc){.validation = true});
        if (!devices[i]) {
            printf("skipped: no usable device\n");
            return 77;
        }
    }
    RUN(changes_make_what_tracing_everything_makes);
    RUN(colors_and_emission_that_change_make_what_tracing_everything_makes);
    RUN(settings_trace_everything_anew);
    RUN(a_light_that_moves_takes_its_own_paths_only);
    RUN(a_sun_that_turns_leaves_the_lights_on_the_ground_where_they_are);
    RUN(a_sun_lights_a_floor_evenly);
    RUN(the_validation_layer_has_nothing_to_say);
    for (size_t i = 0; i < countof(devices); i++)
        gpu_destroy(devices[i]);
    return test_end();
}
