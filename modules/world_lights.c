// The light sources as the GPU sees them: punctual lights, emissive triangles in the world, and the distribution by
// which light paths choose among them, in proportion to power.
#include "texture_sample.h"
#include "world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CGLM_FORCE_DEPTH_ZERO_TO_ONE
#include <cglm/cglm.h>

enum { JOINED_MAX = 1 << 20 }; // lights; behind 2,500,000 VPLs their slots' numbers still have 22 bits

typedef struct punctual_list {
    punctual_light *lights;
    float *powers; // of the lights
    size_t light_capacity, power_capacity;
} punctual_list;

typedef struct emitter_list {
    emissive_triangle *triangles;
    float *powers; // of the triangles
    size_t triangle_capacity, power_capacity;
} emitter_list;

typedef struct source_list {
    world_source *sources; // ascending by kind and entity
    uint32_t count;
    size_t capacity;
} source_list;

struct world_lights {
    // Per primitive with an emissive texture that has emitted: each triangle's mean of the texture; else NULL.
    float (**texture_means)[3];
    // Each with that of the last frame. Emitters change places when they are gathered anew only.
    punctual_list punctual, last_punctual;
    emitter_list emitters, last_emitters;
    source_list sources, last_sources;
};

static float luminance(const float color[3])
{
    return 0.2126f * color[0] + 0.7152f * color[1] + 0.0722f * color[2];
}

bool world_material_emits(const renderer *r, uint32_t index)
{
    return luminance(r->gpu_world->material_data[index].emissive) > 0;
}

// ---- Mean emission of textured triangles

static float srgb_decode(float value)
{
    return value <= 0.04045f ? value / 12.92f : powf((value + 0.055f) / 1.055f, 2.4f);
}

// Mean of the texture over the triangle, by the texels at fixed points of the R2 sequence (Roberts 2018).
static void texture_mean(const scene_data *s, const scene_texture *texture, const float decode[256],
                         const float uv[3][2], float mean[3])
{
    enum { POINTS = 64 };
    memset(mean, 0, 3 * sizeof(float));
    for (int i = 0; i < POINTS; i++) {
        float b = fmodf(0.5f + 0.7548776662f * (float)i, 1), c = fmodf(0.5f + 0.5698402910f * (float)i, 1);
        if (b + c > 1) {
            b = 1 - b;
            c = 1 - c;
        }
        float point[2];
        for (int k = 0; k < 2; k++)
            point[k] = uv[0][k] + b * (uv[1][k] - uv[0][k]) + c * (uv[2][k] - uv[0][k]);
        const uint8_t *texel = texture_texel(s, texture, point);
        for (int k = 0; k < 3; k++)
            mean[k] += decode[texel[k]] / POINTS;
    }
}

static void triangle_vertices(const scene_data *s, const mesh_primitive *p, uint32_t triangle, uint32_t vertices[3])
{
    for (int k = 0; k < 3; k++)
        vertices[k] = p->first_vertex + s->indices[p->first_index + 3 * triangle + (uint32_t)k];
}

static void emissive_uvs(const scene_data *s, const material *m, const uint32_t vertices[3], float uv[3][2])
{
    for (int k = 0; k < 3; k++)
        texture_vertex_uv(&m->emissive_texture, &s->attributes[vertices[k]], uv[k]);
}

// NULL when the primitive's emission does not vary.
static float (*texture_means_make(const scene_data *s, const mesh_primitive *p))[3]
{
    const material *m = &s->materials[p->material];
    if (m->emissive_texture.texture == TEXTURE_NONE)
        return NULL;
    const scene_texture *texture = &s->textures[m->emissive_texture.texture];
    if (!s->images[texture->image].texels)
        return NULL;
    float decode[256];
    for (int i = 0; i < 256; i++)
        decode[i] = texture->srgb ? srgb_decode((float)i / 255) : (float)i / 255;
    const uint32_t count = p->index_count / 3;
    float(*means)[3] = memory_alloc(max_u32(count, 1) * sizeof *means);
    for (uint32_t t = 0; t < count; t++) {
        uint32_t vertices[3];
        float uv[3][2];
        triangle_vertices(s, p, t, vertices);
        emissive_uvs(s, m, vertices, uv);
        texture_mean(s, texture, decode, (const float(*)[2])uv, means[t]);
    }
    return means;
}

// Of a primitive that emits, made when it first does.
static float (*texture_means_of(const renderer *r, uint32_t primitive))[3]
{
    float(**means)[3] = &r->gpu_world->light_state->texture_means[primitive];
    if (!*means)
        *means = texture_means_make(r->scene, &r->scene->primitives[primitive]);
    return *means;
}

// ---- Emissive triangles

static void point_to_world(const mesh_instance_gpu *instance, const float p[3], float world[3])
{
    for (int row = 0; row < 3; row++) {
        const float *m = instance->world[row];
        world[row] = m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3];
    }
}

// Mesh space, in this frame.
static void vertex_position(const renderer *r, uint32_t mesh, uint32_t vertex, float position[3])
{
    const uint32_t deformation = r->gpu_world->mesh_deformations[mesh];
    if (deformation == SCENE_NONE)
        memcpy(position, r->scene->positions[vertex], 3 * sizeof(float));
    else
        world_deformed_position(r, deformation, vertex, position);
}

// Everything but the emission and the probability. False for a triangle without area.
static bool emitter_place(const renderer *r, const mesh_instance_gpu *instance, const mesh_primitive *p,
                          const uint32_t vertices[3], emissive_triangle *emitter)
{
    const scene_data *s = r->scene;
    float corners[3][3], cross[3];
    for (int k = 0; k < 3; k++) {
        float position[3];
        vertex_position(r, instance->mesh, vertices[k], position);
        point_to_world(instance, position, corners[k]);
    }
    memcpy(emitter->corner, corners[0], sizeof emitter->corner);
    glm_vec3_sub(corners[1], corners[0], emitter->edge1);
    glm_vec3_sub(corners[2], corners[0], emitter->edge2);
    glm_vec3_cross(emitter->edge1, emitter->edge2, cross);
    const float length = glm_vec3_norm(cross);
    if (!(length > 0))
        return false;
    emitter->area = 0.5f * length;
    glm_vec3_scale(cross, (instance->mirrored ? -1.0f : 1.0f) / length, emitter->normal);
    const material *m = &s->materials[p->material];
    float uv[3][2];
    emissive_uvs(s, m, vertices, uv);
    memcpy(emitter->uv0, uv[0], sizeof uv[0]);
    memcpy(emitter->uv1, uv[1], sizeof uv[1]);
    memcpy(emitter->uv2, uv[2], sizeof uv[2]);
    emitter->material = p->material;
    emitter->two_sided = !!(m->flags & MATERIAL_DOUBLE_SIDED);
    return true;
}

// Appends the triangles that give light of one primitive of the instance `index` at `emitters` and `powers`; returns
// how many.
static uint32_t emitters_append(const renderer *r, uint32_t index, uint32_t geometry, emissive_triangle *emitters,
                                float *powers)
{
    const scene_data *s = r->scene;
    const mesh_instance_gpu *instance = &r->gpu_world->instance_data[index];
    const uint32_t primitive = instance->first_primitive + geometry;
    const mesh_primitive *p = &s->primitives[primitive];
    const float *emissive = r->gpu_world->material_data[p->material].emissive;
    float(*means)[3] = texture_means_of(r, primitive);
    uint32_t count = 0;
    for (uint32_t t = 0; t < p->index_count / 3; t++) {
        emissive_triangle emitter = {.textured = means != NULL, .instance = index, .geometry = geometry, .triangle = t};
        uint32_t vertices[3];
        triangle_vertices(s, p, t, vertices);
        memcpy(emitter.emission, emissive, sizeof emitter.emission);
        if (means)
            glm_vec3_mul(means[t], emitter.emission, emitter.emission);
        if (!(luminance(emitter.emission) > 0) || !emitter_place(r, instance, p, vertices, &emitter))
            continue;
        powers[count] = GLM_PIf * luminance(emitter.emission) * emitter.area * (emitter.two_sided ? 2 : 1);
        emitters[count++] = emitter;
    }
    return count;
}

static bool emitters_gather(renderer *r)
{
    const scene_data *s = r->scene;
    world_gpu *w = r->gpu_world;
    struct world_lights *state = w->light_state;
    const emitter_list last = state->last_emitters;
    state->last_emitters = state->emitters;
    state->emitters = last;
    size_t limit = 0;
    for (uint32_t i = 0; i < w->instance_count; i++)
        for (uint32_t k = 0; k < w->instance_data[i].primitive_count; k++) {
            const mesh_primitive *p = &s->primitives[w->instance_data[i].first_primitive + k];
            limit += world_material_emits(r, p->material) ? p->index_count / 3 : 0;
        }
    emitter_list *list = &state->emitters;
    memory_reserve((void **)&list->powers, &list->power_capacity, limit, sizeof *list->powers);
    memory_reserve((void **)&list->triangles, &list->triangle_capacity, limit, sizeof *list->triangles);
    emissive_triangle *mapped =
        world_buffer_reserve(r, &w->emitters, "emitters", SCENE_EMITTERS, limit * sizeof *mapped);
    if (!mapped)
        return false;
    uint32_t count = 0;
    for (uint32_t i = 0; i < w->instance_count; i++)
        for (uint32_t k = 0; k < w->instance_data[i].primitive_count; k++) {
            const uint32_t primitive = w->instance_data[i].first_primitive + k;
            if (world_material_emits(r, s->primitives[primitive].material))
                count += emitters_append(r, i, k, list->triangles + count, list->powers + count);
        }
    if (count > 0)
        memcpy(mapped, list->triangles, count * sizeof *mapped);
    r->constants.emitter_count = count;
    return true;
}

// ---- Punctual lights

static punctual_light light_make(const light_component *light, const float world[16])
{
    punctual_light made = {.type = light->type};
    memcpy(made.color, light->color, sizeof made.color);
    memcpy(made.position, world + 12, sizeof made.position);
    glm_vec3_negate_to((float *)world + 8, made.direction);
    if (!scene_normalize(made.direction) && light->type != LIGHT_POINT)
        memset(made.color, 0, sizeof made.color); // a node without extent points nowhere
    if (light->type == LIGHT_SPOT) { // KHR_lights_punctual
        const float inner = cosf(light->inner_cone), outer = cosf(light->outer_cone);
        made.spot_scale = 1 / fmaxf(0.001f, inner - outer);
        made.spot_offset = -outer * made.spot_scale;
    }
    return made;
}

// Area of the rectangle, perpendicular to the unit direction and aligned with the basis of Duff et al. 2017 (as
// basis_of in common.glsl.h), that the scene's bounds project into.
static float projected_area(const frame_constants *c, const float n[3])
{
    const float s = n[2] >= 0 ? 1.0f : -1.0f, a = -1 / (s + n[2]), b = n[0] * n[1] * a;
    const float axes[2][3] = {{1 + s * n[0] * n[0] * a, s * b, -s * n[0]}, {b, s + n[1] * n[1] * a, -n[1]}};
    float extents[2] = {0, 0};
    for (int axis = 0; axis < 2; axis++)
        for (int k = 0; k < 3; k++)
            extents[axis] += fabsf(axes[axis][k]) * (c->scene_max[k] - c->scene_min[k]);
    return extents[0] * extents[1];
}

// Luminous flux; of spots an estimate between the two cones, of suns what enters the scene's bounds.
static float light_power(const frame_constants *c, const light_component *light, const punctual_light *made)
{
    const float intensity = luminance(made->color);
    switch (light->type) {
    case LIGHT_POINT:
        return 4 * GLM_PIf * intensity;
    case LIGHT_SPOT: {
        const float mean = 0.5f * (cosf(light->inner_cone) + cosf(light->outer_cone));
        return 2 * GLM_PIf * intensity * fmaxf(1 - mean, 1e-6f);
    }
    case LIGHT_DIRECTIONAL:
        return intensity * projected_area(c, made->direction);
    }
    return 0;
}

// Settings under which point lights may join the hierarchy. Of one part of the light alone (--only) they do not, so
// that direct light stays direct, nor for the references, which need no approximation.
static bool lights_may_join(const renderer *r)
{
    return r->settings.method == METHOD_LGH && r->settings.only == ONLY_ALL && r->settings.vpls > 0;
}

static bool point_lights_join(const renderer *r)
{
    const world_gpu *w = r->gpu_world;
    uint32_t count = 0;
    for (ecs_iterator it = ecs_iterate(r->world, w->light); ecs_next(&it);)
        count += ((light_component *)it.component)->type == LIGHT_POINT && ecs_get(r->world, it.entity, w->transform);
    return lights_may_join(r) && count > r->settings.many_lights && count <= JOINED_MAX;
}

static void light_append(renderer *r, entity e, const light_component *light)
{
    const transform_component *transform = ecs_get(r->world, e, r->gpu_world->transform);
    if (!transform)
        return;
    struct world_lights *state = r->gpu_world->light_state;
    punctual_list *list = &state->punctual;
    const uint32_t i = state->sources.count++;
    list->lights[i] = light_make(light, transform->world);
    list->powers[i] = light_power(&r->constants, light, &list->lights[i]);
    state->sources.sources[i] = (world_source){.entity = e, .first = i, .count = 1, .power = list->powers[i]};
}

// Gathers the lights, each with a source of its own at the start of this frame's sources; those that join last.
static bool lights_gather(renderer *r)
{
    world_gpu *w = r->gpu_world;
    struct world_lights *state = w->light_state;
    const punctual_list last = state->last_punctual;
    state->last_punctual = state->punctual;
    state->punctual = last;
    punctual_list *list = &state->punctual;
    const size_t limit = ecs_count(r->world, w->light);
    memory_reserve((void **)&list->lights, &list->light_capacity, limit, sizeof *list->lights);
    memory_reserve((void **)&list->powers, &list->power_capacity, limit, sizeof *list->powers);
    memory_reserve((void **)&state->sources.sources, &state->sources.capacity, limit, sizeof(world_source));
    punctual_light *mapped = world_buffer_reserve(r, &w->lights, "lights", SCENE_LIGHTS, limit * sizeof *mapped);
    if (!mapped)
        return false;
    state->sources.count = 0;
    const bool join = point_lights_join(r);
    for (int joined = 0; joined < 2; joined++) {
        for (ecs_iterator it = ecs_iterate(r->world, w->light); ecs_next(&it);) {
            const light_component *light = it.component;
            if ((join && light->type == LIGHT_POINT) == joined)
                light_append(r, it.entity, light);
        }
        w->first_joined = joined ? w->first_joined : state->sources.count;
    }
    const uint32_t count = r->constants.light_count = state->sources.count;
    if (count > 0)
        memcpy(mapped, list->lights, count * sizeof *mapped);
    return true;
}

// ---- Sources

// The triangles of an instance lie together.
static void emissive_sources_append(const renderer *r)
{
    const world_gpu *w = r->gpu_world;
    struct world_lights *state = w->light_state;
    source_list *list = &state->sources;
    const emitter_list *emitters = &state->emitters;
    const uint32_t lights = r->constants.light_count, count = r->constants.emitter_count;
    for (uint32_t begin = 0, end; begin < count; begin = end) {
        const uint32_t instance = emitters->triangles[begin].instance;
        double power = 0;
        for (end = begin; end < count && emitters->triangles[end].instance == instance; end++)
            power += (double)emitters->powers[end];
        memory_reserve((void **)&list->sources, &list->capacity, list->count + 1, sizeof(world_source));
        list->sources[list->count++] = (world_source){.entity = w->order[instance].entity,
                                                      .emissive = true,
                                                      .first = lights + begin,
                                                      .count = end - begin,
                                                      .power = (float)power};
    }
}

static int source_compare(const void *left, const void *right)
{
    const world_source *a = left, *b = right;
    return a->emissive != b->emissive ? (a->emissive ? 1 : -1)
                                      : (a->entity.id > b->entity.id) - (a->entity.id < b->entity.id);
}

static bool triangles_equal(const emissive_triangle *a, const emissive_triangle *b, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        emissive_triangle same_place = a[i];
        same_place.instance = b[i].instance; // where the instance is listed does not matter
        if (memcmp(&same_place, &b[i], sizeof same_place) != 0)
            return false;
    }
    return true;
}

// Whether the source sends what it did as `last`. `gathered`: there are last frame's emitters to compare with.
static bool source_is_same(const renderer *r, const world_source *source, const world_source *last,
                           uint32_t last_lights, bool gathered)
{
    const struct world_lights *state = r->gpu_world->light_state;
    if (source->count != last->count || source->power != last->power)
        return false;
    if (!source->emissive)
        return memcmp(&state->punctual.lights[source->first], &state->last_punctual.lights[last->first],
                      sizeof(punctual_light)) == 0;
    return !gathered || triangles_equal(&state->emitters.triangles[source->first - r->constants.light_count],
                                        &state->last_emitters.triangles[last->first - last_lights], source->count);
}

// Marks the sources that changed; true when one did, came, went or was numbered anew. Both lists are sorted.
static bool sources_compare(const renderer *r, uint32_t last_lights, bool gathered)
{
    const struct world_lights *state = r->gpu_world->light_state;
    const source_list *now = &state->sources, *last = &state->last_sources;
    bool changed = now->count != last->count;
    uint32_t k = 0;
    for (uint32_t i = 0; i < now->count; i++) {
        world_source *source = &now->sources[i];
        while (k < last->count && source_compare(&last->sources[k], source) < 0)
            k++;
        const bool is_new = k == last->count || source_compare(&last->sources[k], source) != 0;
        source->changed = is_new || !source_is_same(r, source, &last->sources[k], last_lights, gathered);
        changed |= source->changed || source->first != last->sources[k].first;
    }
    return changed;
}

float world_element_power(const renderer *r, uint32_t element)
{
    const struct world_lights *state = r->gpu_world->light_state;
    const uint32_t lights = r->constants.light_count;
    return element < lights ? state->punctual.powers[element] : state->emitters.powers[element - lights];
}

// ---- The choice among them

// Inclusive sums of the probabilities over the punctual lights, then the emissive triangles.
static bool distribution_write(renderer *r)
{
    world_gpu *w = r->gpu_world;
    const uint32_t elements = r->constants.light_count + r->constants.emitter_count;
    float *cdf = world_buffer_reserve(r, &w->light_cdf, "light cdf", SCENE_LIGHT_CDF, elements * sizeof(float));
    if (!cdf)
        return false;
    double total = 0;
    for (uint32_t i = 0; i < elements; i++)
        total += (double)world_element_power(r, i);
    w->light_power = (float)total;
    const double scale = total > 0 ? total : 1;
    double sum = 0; // added in the same order as `total`, so that the last is 1
    for (uint32_t i = 0; i < elements; i++) {
        sum += (double)world_element_power(r, i);
        cdf[i] = (float)(sum / scale);
    }
    return true;
}

// The punctual lights come first among the sorted sources.
static void slots_assign(renderer *r)
{
    world_gpu *w = r->gpu_world;
    const source_list *list = &w->light_state->sources;
    light_slots_light *joined = memory_alloc(max_u32(r->constants.light_count, 1) * sizeof *joined);
    uint32_t count = 0;
    for (uint32_t i = 0; i < r->constants.light_count; i++)
        if (list->sources[i].first >= w->first_joined)
            joined[count++] = (light_slots_light){list->sources[i].entity.id, list->sources[i].first};
    light_slots_update(&w->light_slots, joined, count);
    free(joined);
}

bool world_lights_extract(renderer *r, bool moved)
{
    world_gpu *w = r->gpu_world;
    struct world_lights *state = w->light_state;
    const uint32_t last_lights = r->constants.light_count;
    const source_list last = state->last_sources;
    state->last_sources = state->sources;
    state->sources = last;
    if ((moved && !emitters_gather(r)) || !lights_gather(r))
        return false;
    emissive_sources_append(r);
    qsort(state->sources.sources, state->sources.count, sizeof(world_source), source_compare);
    slots_assign(r);
    w->changes.sources = sources_compare(r, last_lights, moved);
    w->sources = state->sources.sources;
    w->source_count = state->sources.count;
    return !w->changes.sources || distribution_write(r);
}

// ---- Life

bool world_lights_init(renderer *r)
{
    const scene_data *s = r->scene;
    struct world_lights *state = r->gpu_world->light_state = memory_alloc(sizeof *state);
    state->texture_means = memory_alloc(max_u32(s->primitive_count, 1) * sizeof *state->texture_means);
    for (uint32_t i = 0; i < s->primitive_count; i++)
        if (world_material_emits(r, s->primitives[i].material))
            texture_means_of(r, i);
    return emitters_gather(r) && lights_gather(r) && distribution_write(r); // all empty: no transforms yet
}

void world_lights_fini(renderer *r)
{
    struct world_lights *state = r->gpu_world->light_state;
    if (!state)
        return;
    for (uint32_t i = 0; i < r->scene->primitive_count; i++)
        free(state->texture_means[i]);
    free(state->texture_means);
    const punctual_list *punctual[] = {&state->punctual, &state->last_punctual};
    const emitter_list *emitters[] = {&state->emitters, &state->last_emitters};
    for (size_t i = 0; i < 2; i++) {
        free(punctual[i]->lights);
        free(punctual[i]->powers);
        free(emitters[i]->triangles);
        free(emitters[i]->powers);
    }
    free(state->sources.sources);
    free(state->last_sources.sources);
    light_slots_fini(&r->gpu_world->light_slots);
    free(state);
}
