// See subdivide.h.
#include "subdivide.h"
#include "modules.h"
#include "world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// ---- The choice of a level

uint32_t subdivide_level(float edge_pixels, uint32_t current, uint32_t max_level)
{
    if (max_level == 0)
        return 0;
    const float exact = log2f(fmaxf(edge_pixels / SUBDIVIDE_EDGE_PIXELS, 1)); // level l suits (l - 1, l]
    const float held = (float)current;
    const bool keep = current > 0 && exact > held - 1 - SUBDIVIDE_HYSTERESIS && exact <= held + SUBDIVIDE_HYSTERESIS;
    const float level = keep ? held : fminf(ceilf(exact), (float)SUBDIVISION_LEVELS_MAX);
    return min_u32(max_u32((uint32_t)level, 1), max_level);
}

typedef struct level_place { // of a mesh of the scene
    uint32_t subdivision; // SCENE_NONE: it is none's
    uint32_t level; // 0: the cage
} level_place;

typedef struct subdivide_state {
    renderer *r;
    level_place *places; // [mesh_count]
} subdivide_state;

// A sphere around the mesh, in mesh space.
static float mesh_sphere(const renderer *r, uint32_t mesh, float centre[3])
{
    const scene_mesh *m = &r->scene->meshes[mesh];
    const box *boxes = r->gpu_world->primitive_boxes + m->first_primitive;
    float square = 0;
    for (int k = 0; k < 3; k++) {
        float low = INFINITY, high = -INFINITY;
        for (uint32_t i = 0; i < m->primitive_count; i++) {
            low = fminf(low, boxes[i].min[k]);
            high = fmaxf(high, boxes[i].max[k]);
        }
        centre[k] = 0.5f * low + 0.5f * high;
        square += 0.25f * (high - low) * (high - low);
    }
    return sqrtf(square);
}

static float length_of(const float v[3])
{
    return sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

// Length of the cage's edges where the instance is nearest to the eye, in pixels.
static float edge_pixels(const renderer *r, const scene_subdivision *s, const float node_world[16])
{
    static const float identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    const float *world = world_is_skinned(r, s->mesh) ? identity : node_world;
    const world_deformation *deformation = world_deformation_of(r, s->mesh);
    const float edge = s->edge_length * (deformation ? deformation->scale : 1);
    float centre[3], from_eye[3], scale = 0;
    const float radius = mesh_sphere(r, s->mesh, centre);
    for (int k = 0; k < 3; k++) {
        from_eye[k] = world[k] * centre[0] + world[4 + k] * centre[1] + world[8 + k] * centre[2] + world[12 + k] -
                      r->camera.eye[k];
        scale = fmaxf(scale, length_of(world + 4 * k));
    }
    const float distance = fmaxf(length_of(from_eye) - scale * radius, r->camera.near_plane);
    const float pixels = (float)r->settings.height / (2 * tanf(r->camera.yfov / 2)); // of a metre a metre away
    return edge * scale * pixels / distance;
}

static uint32_t level_mesh(const scene_subdivision *s, uint32_t level)
{
    return level == 0 ? s->mesh : s->levels[level - 1].mesh;
}

static void levels_choose(ecs_world *world, void *user)
{
    const subdivide_state *state = user;
    const renderer *r = state->r;
    for (ecs_iterator it = ecs_iterate(world, r->gpu_world->mesh); ecs_next(&it);) {
        mesh_component *component = it.component;
        const level_place place = state->places[component->mesh];
        const transform_component *transform = ecs_get(world, it.entity, r->gpu_world->transform);
        if (place.subdivision == SCENE_NONE || !transform)
            continue;
        const scene_subdivision *s = &r->scene->subdivisions[place.subdivision];
        const uint32_t level = subdivide_level(edge_pixels(r, s, transform->world), place.level,
                                               min_u32(s->level_count, r->settings.subdivision_max));
        component->mesh = level_mesh(s, level);
    }
}

// ---- Stencils on the GPU

static gpu_buffer storage_create(gpu *gpu, const char *name, const void *data, VkDeviceSize size)
{
    const gpu_buffer_desc desc = {
        .name = name, .size = size, .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, .data = size ? data : NULL};
    return gpu_buffer_create(gpu, &desc);
}

static uint32_t vertices_before(const scene_subdivision *source, uint32_t level)
{
    uint32_t count = 0;
    for (uint32_t i = 1; i < level; i++)
        count += source->levels[i - 1].vertex_count;
    return count;
}

bool subdivide_stencils_create(gpu *gpu, const scene_subdivision *source, subdivide_stencils *stencils)
{
    const uint32_t count = vertices_before(source, source->level_count + 1);
    subdivision_vertex *vertices = memory_alloc(max_u32(count, 1) * sizeof *vertices);
    for (uint32_t level = 1; level <= source->level_count; level++) {
        const scene_subdivision_level *from = &source->levels[level - 1];
        memcpy(vertices + vertices_before(source, level), from->vertices, from->vertex_count * sizeof *vertices);
    }
    const subdivision_stencils *s = &source->stencils;
    stencils->vertices = storage_create(gpu, "subdivision vertices", vertices, count * sizeof *vertices);
    stencils->offsets =
        storage_create(gpu, "subdivision offsets", s->offsets, ((VkDeviceSize)s->count + 1) * sizeof *s->offsets);
    stencils->entries =
        storage_create(gpu, "subdivision entries", s->entries, s->offsets[s->count] * sizeof *s->entries);
    free(vertices);
    return stencils->vertices.id && stencils->offsets.id && stencils->entries.id;
}

void subdivide_stencils_destroy(gpu *gpu, const subdivide_stencils *stencils)
{
    gpu_buffer_destroy(gpu, stencils->vertices);
    gpu_buffer_destroy(gpu, stencils->offsets);
    gpu_buffer_destroy(gpu, stencils->entries);
}

void subdivide_record(gpu_commands *commands, gpu_pipeline pipeline, const subdivide_stencils *stencils,
                      const scene_subdivision *source, uint32_t level, const subdivide_target *target)
{
    const gpu_binding bindings[] = {
        {.buffer = target->positions}, {.buffer = target->attributes}, {.buffer = stencils->vertices},
        {.buffer = stencils->offsets}, {.buffer = stencils->entries},  {.buffer = target->previous_positions},
    };
    const scene_subdivision_level *to = &source->levels[level - 1];
    const subdivision_step step = {
        .first_source = source->first_vertex,
        .first_vertex = to->first_vertex,
        .vertex_count = to->vertex_count,
        .first = vertices_before(source, level),
        .first_kept = target->first_kept,
        .is_new = target->is_new,
    };
    gpu_bind(commands, pipeline, bindings, countof(bindings));
    gpu_push(commands, &step, sizeof step);
    gpu_dispatch(commands, div_up_u32(to->vertex_count, SUBDIVIDE_GROUP), 1, 1);
}

// ---- The module

static void subdivide_setup(renderer *r, void *user)
{
    (void)r;
    (void)user;
}

static void subdivide_fini(renderer *r, void *user)
{
    (void)r;
    subdivide_state *state = user;
    free(state->places);
}

static level_place *places_make(const scene_data *scene)
{
    level_place *places = memory_alloc(max_u32(scene->mesh_count, 1) * sizeof *places);
    for (uint32_t i = 0; i < scene->mesh_count; i++)
        places[i].subdivision = SCENE_NONE;
    for (uint32_t i = 0; i < scene->subdivision_count; i++)
        for (uint32_t level = 0; level <= scene->subdivisions[i].level_count; level++)
            places[level_mesh(&scene->subdivisions[i], level)] = (level_place){i, level};
    return places;
}

bool subdivide_init(renderer *r)
{
    subdivide_state *state =
        renderer_pass_add(r, "subdivide", sizeof(subdivide_state), subdivide_setup, subdivide_fini);
    state->r = r;
    state->places = places_make(r->scene);
    const ecs_system_desc levels = {
        .name = "subdivision levels", .phase = ECS_PHASE_UPDATE, .run = levels_choose, .user = state};
    ecs_system_register(r->world, &levels);
    return true;
}
