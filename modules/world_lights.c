// The light sources as the GPU sees them: punctual lights, emissive triangles in the world, and the distribution by
// which light paths choose among them, in proportion to power.
#include "texture_sample.h"
#include "world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CGLM_FORCE_DEPTH_ZERO_TO_ONE
#include <cglm/cglm.h>

struct world_lights {
    float (**triangle_emission)[3]; // per primitive with an emissive texture: each triangle's mean, nits; else NULL
    float *light_powers; // of the punctual lights
    float *last_light_powers;
    float *emitter_powers;
    size_t light_capacity, last_light_capacity, emitter_capacity;
};

static float luminance(const float color[3])
{
    return 0.2126f * color[0] + 0.7152f * color[1] + 0.0722f * color[2];
}

bool world_material_emits(const renderer *r, uint32_t index)
{
    const material *m = &r->scene->materials[index];
    return luminance(m->emissive) > 0;
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
static float (*primitive_emission(const scene_data *s, const mesh_primitive *p))[3]
{
    const material *m = &s->materials[p->material];
    if (luminance(m->emissive) <= 0 || m->emissive_texture.texture == TEXTURE_NONE)
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
        glm_vec3_mul(means[t], (float *)m->emissive, means[t]);
    }
    return means;
}

// ---- Emissive triangles

static void point_to_world(const mesh_instance_gpu *instance, const float p[3], float world[3])
{
    for (int row = 0; row < 3; row++) {
        const float *m = instance->world[row];
        world[row] = m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3];
    }
}

// Everything but the emission and the probability. False for a triangle without area.
static bool emitter_place(const scene_data *s, const mesh_instance_gpu *instance, const mesh_primitive *p,
                          const uint32_t vertices[3], emissive_triangle *emitter)
{
    float corners[3][3], cross[3];
    for (int k = 0; k < 3; k++)
        point_to_world(instance, s->positions[vertices[k]], corners[k]);
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
    float(*means)[3] = r->gpu_world->light_state->triangle_emission[primitive];
    uint32_t count = 0;
    for (uint32_t t = 0; t < p->index_count / 3; t++) {
        emissive_triangle emitter = {.textured = means != NULL, .instance = index, .geometry = geometry, .triangle = t};
        uint32_t vertices[3];
        triangle_vertices(s, p, t, vertices);
        memcpy(emitter.emission, means ? means[t] : s->materials[p->material].emissive, sizeof emitter.emission);
        if (!(luminance(emitter.emission) > 0) || !emitter_place(s, instance, p, vertices, &emitter))
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
    size_t limit = 0;
    for (uint32_t i = 0; i < w->instance_count; i++)
        for (uint32_t k = 0; k < w->instance_data[i].primitive_count; k++) {
            const mesh_primitive *p = &s->primitives[w->instance_data[i].first_primitive + k];
            limit += world_material_emits(r, p->material) ? p->index_count / 3 : 0;
        }
    struct world_lights *state = w->light_state;
    memory_reserve((void **)&state->emitter_powers, &state->emitter_capacity, limit, sizeof *state->emitter_powers);
    emissive_triangle *emitters =
        world_buffer_reserve(r, &w->emitters, "emitters", SCENE_EMITTERS, limit * sizeof *emitters);
    if (!emitters)
        return false;
    uint32_t count = 0;
    for (uint32_t i = 0; i < w->instance_count; i++)
        for (uint32_t k = 0; k < w->instance_data[i].primitive_count; k++) {
            const uint32_t primitive = w->instance_data[i].first_primitive + k;
            if (world_material_emits(r, s->primitives[primitive].material))
                count += emitters_append(r, i, k, emitters + count, state->emitter_powers + count);
        }
    r->constants.emitter_count = count;
    return true;
}

// ---- Punctual lights

static punctual_light light_make(const light_component *light, const float world[16])
{
    punctual_light made = {.type = light->type};
    memcpy(made.color, light->color, sizeof made.color);
    memcpy(made.position, world + 12, sizeof made.position);
    const float axis[3] = {-world[8], -world[9], -world[10]};
    glm_vec3_normalize_to((float *)axis, made.direction);
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
    const float intensity = luminance(light->color);
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

static bool lights_gather(renderer *r)
{
    world_gpu *w = r->gpu_world;
    struct world_lights *state = w->light_state;
    const size_t limit = ecs_count(r->world, w->light);
    memory_reserve((void **)&state->light_powers, &state->light_capacity, limit, sizeof *state->light_powers);
    punctual_light *lights = world_buffer_reserve(r, &w->lights, "lights", SCENE_LIGHTS, limit * sizeof *lights);
    if (!lights)
        return false;
    uint32_t count = 0;
    for (ecs_iterator it = ecs_iterate(r->world, w->light); ecs_next(&it);) {
        const light_component *light = it.component;
        const transform_component *transform = ecs_get(r->world, it.entity, w->transform);
        if (!transform)
            continue;
        const punctual_light made = light_make(light, transform->world);
        state->light_powers[count] = light_power(&r->constants, light, &made);
        lights[count++] = made;
    }
    r->constants.light_count = count;
    return true;
}

// ---- The choice among them

// Inclusive sums of the probabilities over the punctual lights, then the emissive triangles.
static bool distribution_write(renderer *r)
{
    world_gpu *w = r->gpu_world;
    const struct world_lights *state = w->light_state;
    const uint32_t lights = r->constants.light_count, emitters = r->constants.emitter_count;
    const VkDeviceSize size = ((VkDeviceSize)lights + emitters) * sizeof(float);
    float *cdf = world_buffer_reserve(r, &w->light_cdf, "light cdf", SCENE_LIGHT_CDF, size);
    if (!cdf)
        return false;
    double total = 0;
    for (uint32_t i = 0; i < lights; i++)
        total += state->light_powers[i];
    for (uint32_t i = 0; i < emitters; i++)
        total += state->emitter_powers[i];
    w->light_power = (float)total;
    const double scale = total > 0 ? total : 1;
    double sum = 0; // added in the same order as `total`, so that the last is 1
    for (uint32_t i = 0; i < lights; i++) {
        sum += state->light_powers[i];
        cdf[i] = (float)(sum / scale);
    }
    for (uint32_t i = 0; i < emitters; i++) {
        sum += state->emitter_powers[i];
        cdf[lights + i] = (float)(sum / scale);
    }
    return true;
}

bool world_lights_extract(renderer *r, bool moved)
{
    struct world_lights *state = r->gpu_world->light_state;
    const uint32_t last_count = r->constants.light_count;
    if ((moved && !emitters_gather(r)) || !lights_gather(r))
        return false;
    const uint32_t count = r->constants.light_count;
    const size_t size = count * sizeof *state->light_powers;
    if (!moved && count == last_count &&
        (count == 0 || memcmp(state->light_powers, state->last_light_powers, size) == 0))
        return true;
    memory_reserve((void **)&state->last_light_powers, &state->last_light_capacity, count, sizeof(float));
    if (count > 0)
        memcpy(state->last_light_powers, state->light_powers, size);
    return distribution_write(r);
}

// ---- Life

bool world_lights_init(renderer *r)
{
    const scene_data *s = r->scene;
    struct world_lights *state = r->gpu_world->light_state = memory_alloc(sizeof *state);
    state->triangle_emission = memory_alloc(max_u32(s->primitive_count, 1) * sizeof *state->triangle_emission);
    for (uint32_t i = 0; i < s->primitive_count; i++)
        state->triangle_emission[i] = primitive_emission(s, &s->primitives[i]);
    return emitters_gather(r) && lights_gather(r) && distribution_write(r); // all empty: no transforms yet
}

void world_lights_fini(renderer *r)
{
    struct world_lights *state = r->gpu_world->light_state;
    if (!state)
        return;
    for (uint32_t i = 0; i < r->scene->primitive_count; i++)
        free(state->triangle_emission[i]);
    free(state->triangle_emission);
    free(state->light_powers);
    free(state->last_light_powers);
    free(state->emitter_powers);
    free(state);
}
