// Rays in batches: all tracers find what the geometry says, and the same in scenes.
//
//     device_rays                      the tests
//     device_rays bench SCENE [K]      millions of the renderer's shadow rays per second, 640x360 and K a pixel: by
//                                      query and pipeline as they come and ordered, by Embree, and by Embree alone
#include "engine/gpu_internal.h"
#include "engine/parallel.h"
#include "modules/rays.h"
#include "modules/world.h"
#include "quad_scene.h"
#include "ray_batch.h"
#include "test.h"

#include <embree3/rtcore.h>
#include <unistd.h>

#define SHARED_SCENES "../shared/scenes/"
#define OWN_SCENES BUILD_DIR "/scenes/"

static gpu *device;
static const uint32_t tracers[] = {RAYS_QUERY, RAYS_PIPELINE, RAYS_EMBREE};

static renderer *renderer_of(const scene_data *scene)
{
    render_settings settings = render_settings_default();
    settings.width = settings.height = 16;
    settings.only = ONLY_INDIRECT; // and no VPLs: nobody else traces
    settings.vpls = 0;
    renderer *r = renderer_create(device, scene, &settings);
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    batch_add(r);
    return r;
}

static void matrix_at(float matrix[16], float x, float y, float z)
{
    memcpy(matrix, IDENTITY, sizeof IDENTITY);
    matrix[12] = x;
    matrix[13] = y;
    matrix[14] = z;
}

// ---- Tests

TEST(rays_find_the_nearest_quad_within_their_reach)
{
    quad_scene s;
    quad_scene_init(&s);
    float matrix[16];
    for (int i = 0; i < 3; i++) {
        matrix_at(matrix, 0, 0, -2.0f * (float)i);
        quad_add(&s, matrix);
    }
    renderer *r = renderer_of(&s.data);
    const ray rays[] = {
        {{0.5f, -0.25f, 1}, 1e30f, {0, 0, -1}, 0}, // the first quad, lower right triangle
        {{-0.5f, 0.25f, -1}, 1e30f, {0, 0, -1}, 0}, // the second, upper left triangle
        {{-0.5f, 0.25f, -3}, 1e30f, {0, 0, 1}, 0}, // the second from behind
        {{0.5f, 0.25f, 1}, 0.999f, {0, 0, -1}, 0}, // ends before the first
        {{0.5f, 0.25f, 1}, 1.001f, {0, 0, -1}, 0}, // ends behind it
        {{1.5f, 0, 1}, 1e30f, {0, 0, -1}, 0}, // beside all
        {{0.5f, 0.25f, 1}, 0, {0, 0, -1}, 0}, // no ray
        {{0.5f, 0.25f, 1}, -1, {0, 0, -1}, 0}, // no ray
    };
    static const struct {
        uint32_t node, triangle; // node RAY_MISS: nothing
        float barycentrics[2];
    } expected[] = {
        {0, 0, {0.375f, 0.375f}}, // (x + 1) / 2 - (y + 1) / 2, (y + 1) / 2
        {1, 1, {0.25f, 0.375f}}, // (x + 1) / 2, (y - x) / 2
        {1, 1, {0.25f, 0.375f}},  {RAY_MISS, 0, {0}}, {0, 0, {0.125f, 0.625f}},
        {RAY_MISS, 0, {0}},       {RAY_MISS, 0, {0}}, {RAY_MISS, 0, {0}},
    };
    for (size_t t = 0; t < countof(tracers); t++) {
        answers a = trace(r, tracers[t], rays, countof(rays));
        for (size_t i = 0; i < countof(rays); i++) {
            const ray_hit *hit = &a.hits[i];
            const bool found = hit->instance != RAY_MISS;
            CHECK(found == (expected[i].node != RAY_MISS));
            if (rays[i].reach > 0)
                CHECK(a.visible[i] == !found);
            if (!found)
                continue;
            CHECK(r->gpu_world->instance_data[hit->instance].mesh == expected[i].node);
            CHECK(hit->geometry == 0 && hit->triangle == expected[i].triangle);
            for (int k = 0; k < 2; k++)
                CHECK_NEAR(hit->barycentrics[k], expected[i].barycentrics[k], 1e-6);
        }
        answers_free(&a);
    }
    renderer_destroy(r);
}

// ---- The tracers against each other

static uint32_t random_state;

static float random_unit(void) // xorshift; in [0,1)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return (float)(random_state >> 8) / 16777216;
}

static void random_direction(float d[3])
{
    float square;
    do {
        square = 0;
        for (int k = 0; k < 3; k++) {
            d[k] = 2 * random_unit() - 1;
            square += d[k] * d[k];
        }
    } while (square > 1 || square < 0.01f);
    for (int k = 0; k < 3; k++)
        d[k] /= sqrtf(square);
}

// From anywhere within the scene's bounds to anywhere; every other ray ends somewhere.
static ray *random_rays(const scene_data *s, uint32_t count)
{
    ray *rays = memory_alloc(count * sizeof *rays);
    random_state = 1;
    for (uint32_t i = 0; i < count; i++) {
        float diagonal = 0;
        for (int k = 0; k < 3; k++) {
            const float extent = s->bounds_max[k] - s->bounds_min[k];
            rays[i].origin[k] = s->bounds_min[k] + extent * random_unit();
            diagonal += extent * extent;
        }
        random_direction(rays[i].direction);
        rays[i].reach = i % 2 ? 1e30f : 0.5f * sqrtf(diagonal) * random_unit();
    }
    return rays;
}

static void hit_position(const renderer *r, const ray_hit *hit, double position[3])
{
    const scene_data *s = r->scene;
    const mesh_instance_gpu *instance = &r->gpu_world->instance_data[hit->instance];
    const mesh_primitive *p = &s->primitives[instance->first_primitive + hit->geometry];
    const double u = hit->barycentrics[0], v = hit->barycentrics[1], weights[3] = {1 - u - v, u, v};
    double local[3] = {0};
    for (uint32_t corner = 0; corner < 3; corner++)
        for (int k = 0; k < 3; k++)
            local[k] += weights[corner] *
                        s->positions[p->first_vertex + s->indices[p->first_index + 3 * hit->triangle + corner]][k];
    for (int row = 0; row < 3; row++) {
        const float *m = instance->world[row];
        position[row] = m[0] * local[0] + m[1] * local[1] + m[2] * local[2] + m[3];
    }
}

static double hit_distance(const renderer *r, const ray *ray, const ray_hit *hit)
{
    double position[3], distance = 0;
    hit_position(r, hit, position);
    for (int k = 0; k < 3; k++)
        distance += (position[k] - (double)ray->origin[k]) * (double)ray->direction[k];
    return distance;
}

typedef struct differences { // of the other tracers, from query
    uint32_t hits; // rays that hit something by query
    uint32_t found; // that one tracer lets hit and the other miss
    uint32_t triangles; // that both let hit, but other triangles
    uint32_t distances; // that both let hit, but not at the same distance
    uint32_t visible; // that one tracer lets through and the other does not
    uint32_t itself; // where the other's two answers do not agree with each other
    double worst; // difference of distances, over all that both let hit, as a multiple of what is allowed
} differences;

// A relative 1e-4, and what rounding to floats makes of positions and barycentrics, which counts for origins close to
// what they hit: 1e-6 of the scene's diagonal.
static double distance_tolerance(const renderer *r, double distance)
{
    return 1e-4 * fabs(distance) + 2e-6 * (double)r->constants.scene_radius;
}

static bool hits_same_triangle(const ray_hit *a, const ray_hit *b)
{
    return a->instance == b->instance && a->geometry == b->geometry && a->triangle == b->triangle;
}

static void differences_add(differences *d, const renderer *r, const ray *ray, const answers *query,
                            const answers *other, uint32_t i)
{
    const bool query_found = query->hits[i].instance != RAY_MISS, found = other->hits[i].instance != RAY_MISS;
    d->found += found != query_found;
    d->visible += ray->reach > 0 && query->visible[i] != other->visible[i];
    d->itself += ray->reach > 0 && other->visible[i] == found;
    if (!found || !query_found)
        return;
    const double expected = hit_distance(r, ray, &query->hits[i]);
    const double error = fabs(hit_distance(r, ray, &other->hits[i]) - expected) / distance_tolerance(r, expected);
    d->triangles += !hits_same_triangle(&query->hits[i], &other->hits[i]);
    d->distances += error > 1;
    d->worst = fmax(d->worst, error);
}

static differences compare(renderer *r, const ray *rays, uint32_t count)
{
    static const uint32_t others[] = {RAYS_PIPELINE, RAYS_EMBREE};
    answers query = trace(r, RAYS_QUERY, rays, count);
    differences d = {0};
    for (uint32_t i = 0; i < count; i++)
        d.hits += query.hits[i].instance != RAY_MISS;
    for (size_t t = 0; t < countof(others); t++) {
        answers other = trace(r, others[t], rays, count);
        for (uint32_t i = 0; i < count; i++)
            differences_add(&d, r, &rays[i], &query, &other, i);
        answers_free(&other);
    }
    answers_free(&query);
    return d;
}

static void differences_print(const char *name, const differences *d, uint32_t count)
{
    printf(
        "  %s: of %u rays %u hit; differ: %u in hit or miss, %u in visibility, %u in triangle, %u in distance (worst "
        "%.2g of the tolerance)\n",
        name, count, d->hits, d->found, d->visible, d->triangles, d->distances, d->worst);
}

static differences scene_compare(const scene_data *scene, const char *name, uint32_t count)
{
    renderer *r = renderer_of(scene);
    ray *rays = random_rays(scene, count);
    const differences d = compare(r, rays, count);
    differences_print(name, &d, count);
    free(rays);
    renderer_destroy(r);
    return d;
}

TEST(all_find_the_same_in_scenes)
{
    static const char *const paths[] = {
        OWN_SCENES "cornell.glb",
        OWN_SCENES "two_rooms.glb",
        OWN_SCENES "atrium.glb",
        SHARED_SCENES "sponza/sponza.gltf", // with alpha masks
        SHARED_SCENES "kitchen/kitchen.gltf",
        SHARED_SCENES "materials/AlphaBlendModeTest/AlphaBlendModeTest.gltf",
        SHARED_SCENES "materials/NormalTangentMirrorTest/NormalTangentMirrorTest.gltf",
    };
    enum { RAYS = 100000 };
    for (size_t i = 0; i < countof(paths); i++) {
        if (access(paths[i], R_OK) != 0) {
            printf("  skipped: no %s\n", paths[i]);
            continue;
        }
        scene_data *scene = scene_load(paths[i]);
        CHECK(scene != NULL);
        if (!scene)
            continue;
        const differences d = scene_compare(scene, strrchr(paths[i], '/') + 1, RAYS);
        CHECK(d.hits > RAYS / 10);
        // Measured: 0 everywhere. A ray through an edge may miss, or a rounded alpha fall on the other side of the
        // cutoff.
        CHECK(d.found <= 2 && d.visible <= 2 && d.distances <= 2);
        CHECK(d.itself <= 2);
        scene_destroy(scene);
    }
}

TEST(answers_do_not_depend_on_the_order)
{
    enum { RAYS = 30000 };
    scene_data *scene = scene_load(OWN_SCENES "atrium.glb");
    ray *rays = random_rays(scene, RAYS);
    for (uint32_t i = 0; i < RAYS; i += 3)
        rays[i].reach = 0; // no ray
    renderer *r = renderer_of(scene);
    CHECK(r->settings.ray_order);
    answers ordered = trace(r, RAYS_QUERY, rays, RAYS);
    CHECK(pass_ran(r, "seen/order"));
    r->settings.ray_order = false;
    answers plain = trace(r, RAYS_QUERY, rays, RAYS);
    CHECK(!pass_ran(r, "seen/order"));
    CHECK(memcmp(ordered.hits, plain.hits, RAYS * sizeof *plain.hits) == 0);
    uint32_t visible = 0;
    for (uint32_t i = 0; i < RAYS; i++) {
        CHECK(rays[i].reach > 0 ? ordered.visible[i] == plain.visible[i] : ordered.hits[i].instance == RAY_MISS);
        visible += rays[i].reach > 0 && plain.visible[i];
    }
    CHECK(visible > RAYS / 20 && visible < RAYS / 2);
    answers_free(&ordered);
    answers_free(&plain);
    free(rays);
    renderer_destroy(r);
    scene_destroy(scene);
}

// ---- Alpha masks

typedef struct mask_case {
    const char *name;
    int filter, wrap; // glTF's; 0: the default
    uint32_t uv_set;
    float transform[4], offset[2];
} mask_case;

// A quad with a mask of 8x8 random alphas between corners of different alpha: the share of rays it stops.
static double mask_compare(const mask_case *c)
{
    enum { SIZE = 8, RAYS = 20000 };
    quad_scene s;
    quad_scene_init(&s);
    uint8_t texels[4 * SIZE * SIZE];
    random_state = 7;
    for (size_t i = 0; i < countof(texels); i++)
        texels[i] = (uint8_t)(256 * random_unit());
    texture_set(&s, texels, SIZE, SIZE, true);
    s.texture.mag_filter = c->filter;
    s.texture.wrap_s = s.texture.wrap_t = c->wrap;
    material *m = quad_add(&s, IDENTITY);
    m->flags = MATERIAL_ALPHA_MASK;
    m->base_color[3] = 0.9f;
    m->alpha_cutoff = 0.3f;
    m->base_texture = (texture_reference){.texture = 0, .uv_set = c->uv_set};
    memcpy(m->base_texture.transform, c->transform, sizeof c->transform);
    memcpy(m->base_texture.offset, c->offset, sizeof c->offset);
    for (int i = 0; i < 4; i++) {
        s.attributes[i].color_ba = 0xffffu | (uint32_t)(40000 + 8000 * i) << 16;
        s.attributes[i].uv1[0] = 0.4f * s.attributes[i].uv0[1];
        s.attributes[i].uv1[1] = 1.7f * s.attributes[i].uv0[0];
    }
    ray *rays = memory_alloc(RAYS * sizeof *rays);
    for (int i = 0; i < RAYS; i++)
        rays[i] = (ray){{2 * random_unit() - 1, 2 * random_unit() - 1, 1}, 2, {0, 0, -1}, 0};
    renderer *r = renderer_of(&s.data);
    const differences d = compare(r, rays, RAYS);
    differences_print(c->name, &d, RAYS);
    // Measured: 0 in each case. A rounded alpha may fall on the other side of the cutoff.
    CHECK(d.found <= 2 && d.visible <= 2);
    CHECK(d.itself == 0 && d.distances == 0);
    free(rays);
    renderer_destroy(r);
    return (double)d.hits / RAYS;
}

TEST(alpha_masks_let_the_same_rays_through)
{
    enum { NEAREST = 9728, CLAMP = 33071, MIRROR = 33648 };
    static const mask_case cases[] = {
        {"nearest", NEAREST, 0, 0, {1, 0, 0, 1}, {0, 0}},
        {"nearest, repeated, turned", NEAREST, 0, 0, {2, 1, -1, 2}, {0.3f, -0.7f}},
        {"nearest, mirrored", NEAREST, MIRROR, 0, {3, 0, 0, 3}, {-1.5f, 0.25f}},
        {"nearest, clamped", NEAREST, CLAMP, 0, {2, 0, 0, 2}, {-0.5f, -0.5f}},
        {"nearest, second uv set", NEAREST, 0, 1, {1, 0, 0, 1}, {0, 0}},
        {"linear", 0, 0, 0, {1, 0, 0, 1}, {0, 0}},
        {"linear, mirrored", 0, MIRROR, 0, {3, 0, 0, 3}, {-1.5f, 0.25f}},
        {"linear, clamped", 0, CLAMP, 0, {2, 0, 0, 2}, {-0.5f, -0.5f}},
    };
    for (size_t i = 0; i < countof(cases); i++) {
        const double share = mask_compare(&cases[i]);
        CHECK(share > 0.2 && share < 0.9);
    }
}

// ---- Instances

// Rotated, stretched and half of them mirrored.
static void random_matrix(float m[16])
{
    float axes[3][3];
    random_direction(axes[0]);
    random_direction(axes[2]);
    for (int k = 0; k < 3; k++)
        axes[1][k] = axes[2][(k + 1) % 3] * axes[0][(k + 2) % 3] - axes[2][(k + 2) % 3] * axes[0][(k + 1) % 3];
    for (int column = 0; column < 3; column++) {
        const float scale = (0.2f + 2 * random_unit()) * (random_unit() < 0.5f ? -1 : 1);
        for (int k = 0; k < 3; k++)
            m[4 * column + k] = scale * axes[column][k];
        m[4 * column + 3] = 0;
        m[12 + column] = 4 * random_unit() - 2;
    }
    m[15] = 1;
}

static node_component *node_of(renderer *r, uint32_t index)
{
    uint32_t i = 0;
    node_component *found = NULL;
    for (ecs_iterator it = ecs_iterate(r->world, r->gpu_world->node); ecs_next(&it);)
        found = i++ == index ? it.component : found;
    return found;
}

static void instances_compare(renderer *r, const char *name, uint32_t instances)
{
    enum { RAYS = 20000 };
    static const scene_data around = {.bounds_min = {-4, -4, -4}, .bounds_max = {4, 4, 4}};
    ray *rays = random_rays(&around, RAYS);
    const differences d = compare(r, rays, RAYS);
    differences_print(name, &d, RAYS);
    CHECK(r->gpu_world->instance_count == instances);
    CHECK(d.hits >= 100 * instances);
    CHECK(d.found == 0 && d.visible == 0 && d.distances == 0 && d.itself == 0); // measured
    free(rays);
}

TEST(all_find_the_same_instances_wherever_they_move)
{
    quad_scene s;
    quad_scene_init(&s);
    float matrix[16];
    random_state = 3;
    for (int i = 0; i < 6; i++) {
        random_matrix(matrix);
        quad_add(&s, matrix);
    }
    s.primitives[5].index_count = 0; // a mesh without triangles
    renderer *r = renderer_of(&s.data);
    instances_compare(r, "5 quads", 5);
    random_state = 11;
    for (uint32_t i = 0; i < 3; i++)
        random_matrix(node_of(r, i)->matrix);
    instances_compare(r, "3 moved", 5);
    const entity e = ecs_entity_create(r->world);
    random_matrix(((node_component *)ecs_add(r->world, e, r->gpu_world->node))->matrix);
    ((mesh_component *)ecs_add(r->world, e, r->gpu_world->mesh))->mesh = 2;
    instances_compare(r, "1 more", 6);
    memset(node_of(r, 1)->matrix, 0, 3 * 4 * sizeof(float)); // scaled to nothing
    instances_compare(r, "1 vanished", 5);
    ecs_entity_destroy(r->world, e);
    instances_compare(r, "1 gone", 4);
    for (uint32_t i = 0; i < 6; i++)
        memset(node_of(r, i)->matrix, 0, 3 * 4 * sizeof(float));
    instances_compare(r, "nothing left", 0);
    renderer_destroy(r);
}

TEST(a_moved_quad_is_hit_where_it_went)
{
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, IDENTITY);
    renderer *r = renderer_of(&s.data);
    const ray down = {{0.25f, 0.5f, 1}, 1e30f, {0, 0, -1}, 0};
    for (int frame = 0; frame < 4; frame++) {
        node_of(r, 0)->matrix[14] = -(float)frame;
        for (size_t t = 0; t < countof(tracers); t++) {
            answers a = trace(r, tracers[t], &down, 1);
            CHECK(a.hits[0].instance == 0 && a.visible[0] == 0);
            CHECK_NEAR(hit_distance(r, &down, &a.hits[0]), 1 + frame, 1e-6);
            answers_free(&a);
        }
    }
    renderer_destroy(r);
}

TEST(primitives_without_triangles_leave_the_count_of_geometries)
{
    quad_scene s;
    quad_scene_init(&s);
    for (int i = 0; i < 3; i++)
        quad_add(&s, IDENTITY);
    s.data.mesh_count = s.data.node_count = 1;
    s.meshes[0].primitive_count = 3;
    s.primitives[0].index_count = s.primitives[1].index_count = 0;
    renderer *r = renderer_of(&s.data);
    const ray down = {{0.25f, 0.5f, 1}, 1e30f, {0, 0, -1}, 0};
    for (size_t t = 0; t < countof(tracers); t++) {
        answers a = trace(r, tracers[t], &down, 1);
        CHECK(a.hits[0].instance == 0 && a.hits[0].geometry == 2);
        answers_free(&a);
    }
    renderer_destroy(r);
}

// ---- The frame

TEST(an_empty_batch_is_traced)
{
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, IDENTITY);
    renderer *r = renderer_of(&s.data);
    for (size_t t = 0; t < countof(tracers); t++) {
        answers a = trace(r, tracers[t], NULL, 0);
        answers_free(&a);
    }
    renderer_destroy(r);
}

TEST(embree_gives_the_same_bytes_every_time)
{
    scene_data *scene = scene_load(OWN_SCENES "atrium.glb");
    enum { RAYS = 20000 };
    ray *rays = random_rays(scene, RAYS);
    answers runs[2];
    for (int run = 0; run < 2; run++) {
        renderer *r = renderer_of(scene);
        runs[run] = trace(r, RAYS_EMBREE, rays, RAYS);
        renderer_destroy(r);
    }
    CHECK(memcmp(runs[0].hits, runs[1].hits, RAYS * sizeof *runs[0].hits) == 0);
    for (int i = 0; i < RAYS; i++)
        CHECK(!(rays[i].reach > 0) || runs[0].visible[i] == runs[1].visible[i]);
    for (int run = 0; run < 2; run++)
        answers_free(&runs[run]);
    free(rays);
    scene_destroy(scene);
}

TEST(only_the_structure_that_is_traced_is_built)
{
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, IDENTITY);
    const ray down = {{0, 0, 1}, 1, {0, 0, -1}, 0};
    for (size_t t = 0; t < countof(tracers); t++) {
        renderer *r = renderer_of(&s.data);
        answers a = trace(r, tracers[t], &down, 1);
        CHECK(pass_ran(r, "near/trace") && pass_ran(r, "seen/trace"));
        CHECK(pass_ran(r, "acceleration") == (tracers[t] != RAYS_EMBREE));
        CHECK(pass_ran(r, "rays/scene") == (tracers[t] == RAYS_EMBREE));
        answers_free(&a);
        renderer_destroy(r);
    }
}

TEST(a_structure_is_built_again_when_something_moved)
{
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, IDENTITY);
    renderer *r = renderer_of(&s.data);
    const ray down = {{0, 0, 1}, 2, {0, 0, -1}, 0};
    // Whether the quad moves away or back before the frame; while Embree traces, nobody builds.
    static const struct {
        bool moves;
        uint32_t tracer;
        bool built;
    } frames[] = {
        {false, RAYS_QUERY, true},  {false, RAYS_QUERY, false}, {true, RAYS_PIPELINE, true}, {false, RAYS_QUERY, false},
        {true, RAYS_EMBREE, false}, {false, RAYS_QUERY, true},  {false, RAYS_QUERY, false},
    };
    bool away = false;
    for (size_t i = 0; i < countof(frames); i++) {
        for (ecs_iterator it = ecs_iterate(r->world, r->gpu_world->node); ecs_next(&it);) {
            away ^= frames[i].moves;
            ((node_component *)it.component)->matrix[12] = away ? 5 : 0;
        }
        answers a = trace(r, frames[i].tracer, &down, 1);
        CHECK(pass_ran(r, "acceleration") == frames[i].built);
        CHECK((a.hits[0].instance == RAY_MISS) == away && a.visible[0] == away);
        answers_free(&a);
    }
    renderer_destroy(r);
}

static char last_error[256];
static uint32_t errors;

static void error_keep(log_level level, const char *line, void *user)
{
    (void)user;
    if (level == LOG_ERROR) {
        errors++;
        snprintf(last_error, sizeof last_error, "%s", line);
    }
}

// Any device that is not a CPU will do, and this one can say so.
TEST(embree_is_refused_where_the_device_is_not_a_cpu)
{
    const VkPhysicalDeviceType type = device->properties.deviceType;
    device->properties.deviceType = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, IDENTITY);
    renderer *r = renderer_of(&s.data);
    const ray down = {{0, 0, 2}, 4, {0, 0, -1}, 0};
    answers a = trace(r, RAYS_QUERY, &down, 1);
    CHECK(a.hits[0].instance == 0);
    answers_free(&a);
    r->settings.rays = RAYS_EMBREE;
    errors = 0;
    log_sink_set(error_keep, NULL);
    CHECK(!renderer_frame(r));
    log_sink_set(NULL, NULL);
    CHECK(errors == 1 && strstr(last_error, "--rays embree") && strstr(last_error, gpu_name(device)));
    r->settings.rays = RAYS_AUTO;
    CHECK(renderer_frame(r) && !rays_are_host(r) && pass_ran(r, "seen/trace"));
    renderer_destroy(r);
    device->properties.deviceType = type;
}

TEST(auto_is_embree_where_the_device_is_a_cpu)
{
    quad_scene s;
    quad_scene_init(&s);
    quad_add(&s, IDENTITY);
    renderer *r = renderer_of(&s.data);
    const ray down = {{0, 0, 2}, 4, {0, 0, -1}, 0};
    answers a = trace(r, RAYS_QUERY, &down, 1);
    answers_free(&a);
    r->settings.rays = RAYS_AUTO;
    CHECK(renderer_frame(r) && rays_are_host(r) && pass_ran(r, "rays/scene"));
    renderer_destroy(r);
}

TEST(the_validation_layer_is_silent)
{
    CHECK(gpu_validation_messages(device) == 0);
}

// ---- The bench

typedef struct bare { // Embree alone, over opaque copies of the same two levels
    RTCDevice device;
    RTCScene scene;
    struct RTCRay *rays;
} bare;

static RTCScene bare_mesh(RTCDevice device, const scene_data *s, const scene_mesh *mesh)
{
    RTCScene scene = rtcNewScene(device);
    for (uint32_t i = 0; i < mesh->primitive_count; i++) {
        const mesh_primitive *p = &s->primitives[mesh->first_primitive + i];
        RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        void *positions = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                  sizeof *s->positions, p->vertex_count);
        memcpy(positions, s->positions + p->first_vertex, p->vertex_count * sizeof *s->positions);
        void *indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                3 * sizeof *s->indices, p->index_count / 3);
        memcpy(indices, s->indices + p->first_index, p->index_count * sizeof *s->indices);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene, geometry);
        rtcReleaseGeometry(geometry);
    }
    rtcCommitScene(scene);
    return scene;
}

static void bare_build(bare *b, const scene_data *s)
{
    b->device = rtcNewDevice(NULL);
    b->scene = rtcNewScene(b->device);
    RTCScene *meshes = memory_alloc(s->mesh_count * sizeof *meshes);
    for (uint32_t i = 0; i < s->mesh_count; i++)
        meshes[i] = bare_mesh(b->device, s, &s->meshes[i]);
    for (uint32_t i = 0; i < s->node_count; i++) {
        if (s->nodes[i].mesh == SCENE_NONE)
            continue;
        RTCGeometry geometry = rtcNewGeometry(b->device, RTC_GEOMETRY_TYPE_INSTANCE);
        rtcSetGeometryInstancedScene(geometry, meshes[s->nodes[i].mesh]);
        rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT4X4_COLUMN_MAJOR, s->nodes[i].world);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(b->scene, geometry);
        rtcReleaseGeometry(geometry);
    }
    rtcCommitScene(b->scene);
    for (uint32_t i = 0; i < s->mesh_count; i++)
        rtcReleaseScene(meshes[i]);
    free(meshes);
}

static void bare_run(uint32_t begin, uint32_t end, void *user)
{
    const bare *b = user;
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (uint32_t i = begin; i < end; i++)
        rtcOccluded1(b->scene, &context, &b->rays[i]);
}

static double bare_milliseconds(const bare *b, parallel *pool, const ray *rays, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        const float *o = rays[i].origin, *d = rays[i].direction;
        b->rays[i] = (struct RTCRay){.org_x = o[0],
                                     .org_y = o[1],
                                     .org_z = o[2],
                                     .dir_x = d[0],
                                     .dir_y = d[1],
                                     .dir_z = d[2],
                                     .tfar = rays[i].reach,
                                     .mask = ~0u};
    }
    const double start = time_now();
    parallel_for(pool, count, 1024, bare_run, (void *)b);
    return (time_now() - start) * 1e3;
}

static double pass_milliseconds(const renderer *r, const char *name)
{
    uint32_t count;
    const frame_graph_timing *timings = frame_graph_timings(r->graph, &count);
    for (uint32_t i = 0; i < count; i++)
        if (strcmp(timings[i].name, name) == 0)
            return timings[i].milliseconds;
    return 0;
}

enum { BENCH_WIDTH = 640, BENCH_HEIGHT = 360, BENCH_REPEATS = 5 };

// Those of the scene's first camera; `count` of them, absent ones included.
static ray *shadow_rays(const scene_data *scene, uint32_t samples, uint32_t *count)
{
    render_settings settings = render_settings_default();
    settings.width = BENCH_WIDTH;
    settings.height = BENCH_HEIGHT;
    settings.shadow_samples = samples;
    renderer *r = renderer_create(device, scene, &settings);
    r->camera = renderer_camera_of_scene(r, 0);
    r->exports[r->export_count++] = "shadow_origins";
    r->exports[r->export_count++] = "shadow_directions";
    CHECK(renderer_frame(r));
    *count = samples * BENCH_WIDTH * BENCH_HEIGHT;
    float(*parts[2])[4];
    for (int i = 0; i < 2; i++) {
        parts[i] = memory_alloc(*count * sizeof *parts[i]);
        export_read(r, r->exports[i], parts[i], *count * sizeof *parts[i]);
    }
    ray *rays = memory_alloc(*count * sizeof *rays);
    for (uint32_t i = 0; i < *count; i++) {
        memcpy(rays[i].origin, parts[0][i], sizeof *parts[0]);
        memcpy(rays[i].direction, parts[1][i], sizeof *parts[1]);
    }
    free(parts[0]);
    free(parts[1]);
    renderer_destroy(r);
    return rays;
}

static int compare_doubles(const void *left, const void *right)
{
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

static double median(double *values, size_t count)
{
    qsort(values, count, sizeof *values, compare_doubles);
    return values[count / 2];
}

typedef enum contender { QUERY, ORDERED, PIPELINE, PIPELINE_ORDERED, EMBREE, ALONE, CONTENDERS } contender;

static double contender_milliseconds(renderer *r, contender c, const ray *rays, uint32_t count)
{
    static const uint32_t contender_tracers[] = {RAYS_QUERY, RAYS_QUERY, RAYS_PIPELINE, RAYS_PIPELINE, RAYS_EMBREE};
    r->settings.ray_order = c == ORDERED || c == PIPELINE_ORDERED;
    answers a = trace(r, contender_tracers[c], rays, count);
    answers_free(&a);
    return pass_milliseconds(r, "seen/order") + pass_milliseconds(r, "seen/trace");
}

static void print_rates(const renderer *r, double milliseconds[CONTENDERS][BENCH_REPEATS], uint32_t present)
{
    double rates[CONTENDERS];
    for (int c = 0; c < CONTENDERS; c++)
        rates[c] = 1e-3 * present / median(milliseconds[c], BENCH_REPEATS);
    printf("pipeline %.3f, ordered %.3f, %.2f times\n", rates[PIPELINE], rates[PIPELINE_ORDERED],
           rates[PIPELINE_ORDERED] / rates[PIPELINE]);
    printf("query %.3f, ordered (order included) %.3f, %.2f times; embree %.2f, %.1f times query; embree alone, opaque "
           "%.2f (in the renderer %.2f of it)\n",
           rates[QUERY], rates[ORDERED], rates[ORDERED] / rates[QUERY], rates[EMBREE], rates[EMBREE] / rates[QUERY],
           rates[ALONE], rates[EMBREE] / rates[ALONE]);
    printf("order alone %.2f ms\n", pass_milliseconds(r, "seen/order"));
}

static int print_bench(const char *path, uint32_t samples)
{
    scene_data *scene = scene_load(path);
    if (!scene)
        return EXIT_FAILURE;
    uint32_t count, present = 0;
    ray *rays = shadow_rays(scene, samples, &count);
    for (uint32_t i = 0; i < count; i++)
        present += rays[i].reach > 0;
    renderer *r = renderer_of(scene);
    parallel *pool = parallel_create(0);
    bare b = {.rays = aligned_alloc(16, count * sizeof *b.rays)};
    bare_build(&b, scene);
    double milliseconds[CONTENDERS][BENCH_REPEATS];
    for (int i = 0; i < BENCH_REPEATS; i++) { // in turns, so that what else runs hits all alike
        milliseconds[ALONE][i] = bare_milliseconds(&b, pool, rays, count);
        for (contender c = EMBREE + 1; c-- > 0;)
            milliseconds[c][i] = contender_milliseconds(r, c, rays, count);
    }
    printf("%s, %u shadow rays a pixel, %u in all; %u threads; Mray/s, median of %d\n", path, samples, present,
           parallel_threads(pool), BENCH_REPEATS);
    print_rates(r, milliseconds, present);
    free(rays);
    free(b.rays);
    rtcReleaseScene(b.scene);
    rtcReleaseDevice(b.device);
    parallel_destroy(pool);
    renderer_destroy(r);
    scene_destroy(scene);
    return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
    const bool bench = argc >= 3 && strcmp(argv[1], "bench") == 0;
    device = gpu_create(&(gpu_desc){.validation = !bench});
    if (!device) {
        printf("skipped: no device with the validation layer\n");
        return 77;
    }
    if (!gpu_has_ray_query(device) || !gpu_has_ray_pipelines(device)) {
        printf("skipped: %s has not both ray queries and ray-tracing pipelines\n", gpu_name(device));
        gpu_destroy(device);
        return 77;
    }
    if (!gpu_is_cpu(device)) {
        printf("skipped: %s is not a CPU, so that there is no Embree to compare with\n", gpu_name(device));
        gpu_destroy(device);
        return 77;
    }
    if (bench)
        return print_bench(argv[2], argc > 3 ? (uint32_t)strtoul(argv[3], NULL, 10) : 1);
    RUN(rays_find_the_nearest_quad_within_their_reach);
    RUN(all_find_the_same_in_scenes);
    RUN(answers_do_not_depend_on_the_order);
    RUN(alpha_masks_let_the_same_rays_through);
    RUN(all_find_the_same_instances_wherever_they_move);
    RUN(a_moved_quad_is_hit_where_it_went);
    RUN(primitives_without_triangles_leave_the_count_of_geometries);
    RUN(an_empty_batch_is_traced);
    RUN(embree_gives_the_same_bytes_every_time);
    RUN(only_the_structure_that_is_traced_is_built);
    RUN(a_structure_is_built_again_when_something_moved);
    RUN(embree_is_refused_where_the_device_is_not_a_cpu);
    RUN(auto_is_embree_where_the_device_is_a_cpu);
    RUN(the_validation_layer_is_silent);
    gpu_destroy(device);
    return test_end();
}
