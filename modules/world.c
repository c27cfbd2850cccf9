// The scene as entities, and what is extracted from them every frame: transforms, instances, bounds, and what of it
// changed.
#include "world.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define CGLM_FORCE_DEPTH_ZERO_TO_ONE
#include <cglm/cglm.h>

typedef struct placed_box { // what an instance covers
    world_instance instance;
    box box; // world
} placed_box;

struct world_state {
    world_instance *listed; // instance_count instances as the entities came, of the last frame
    world_instance *found; // of this frame
    size_t listed_capacity, found_capacity, order_capacity, data_capacity, boxes_capacity, changed_capacity;
    placed_box *boxes; // of the instances, parallel to world_gpu's order
    box *changed; // what world_changes lists
    bool *mesh_emits; // per mesh
};

void *world_buffer_reserve(renderer *r, gpu_buffer *buffer, const char *name, uint32_t binding, VkDeviceSize size)
{
    if (!buffer->id || gpu_buffer_size(r->gpu, *buffer) < size) {
        gpu_buffer_destroy(r->gpu, *buffer);
        const gpu_buffer_desc desc = {
            .name = name,
            .size = size,
            .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                     VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR,
            .host = true,
        };
        *buffer = gpu_buffer_create(r->gpu, &desc);
        if (!buffer->id)
            return NULL;
        if (binding != BINDING_NONE)
            gpu_scene_bind_buffer(r->gpu, binding, *buffer);
    }
    return gpu_buffer_map(r->gpu, *buffer);
}

// ---- Entities

static void weights_spawn(renderer *r, const scene_deformation *d)
{
    if (d->target_count == 0)
        return;
    const size_t size = d->target_count * sizeof(float);
    weights_component *weights = ecs_add(r->world, r->gpu_world->node_entities[d->node], r->gpu_world->weights);
    *weights = (weights_component){memory_alloc(size), d->target_count};
    memcpy(weights->weights, d->weights, size);
}

static void weights_fini(void *component, void *user)
{
    (void)user;
    free(((weights_component *)component)->weights);
}

static void scene_spawn(renderer *r)
{
    const scene_data *s = r->scene;
    world_gpu *w = r->gpu_world;
    entity *entities = w->node_entities = memory_alloc(max_u32(s->node_count, 1) * sizeof *entities);
    for (uint32_t i = 0; i < s->node_count; i++) {
        const scene_node *source = &s->nodes[i];
        entities[i] = ecs_entity_create(r->world);
        node_component *node = ecs_add(r->world, entities[i], w->node);
        node->name = source->name;
        node->parent = source->parent == SCENE_NONE ? (entity){0} : entities[source->parent];
        memcpy(node->matrix, source->matrix, sizeof node->matrix);
        if (source->mesh != SCENE_NONE)
            *(mesh_component *)ecs_add(r->world, entities[i], w->mesh) = (mesh_component){source->mesh};
        if (source->light != SCENE_NONE) {
            const scene_light *from = &s->lights[source->light];
            light_component *light = ecs_add(r->world, entities[i], w->light);
            light->type = from->type;
            memcpy(light->color, from->color, sizeof light->color);
            light->inner_cone = from->inner_cone;
            light->outer_cone = from->outer_cone;
        }
    }
    for (uint32_t i = 0; i < s->deformation_count; i++)
        weights_spawn(r, &s->deformations[i]);
}

entity world_sun_add(renderer *r, const float direction[3], float lux)
{
    const world_gpu *w = r->gpu_world;
    const entity e = ecs_entity_create(r->world);
    float x[3], y[3], z[3]; // light shines along -z
    glm_vec3_negate_to((float *)direction, z);
    scene_normalize(z);
    glm_vec3_ortho(z, x);
    glm_vec3_normalize(x);
    glm_vec3_cross(z, x, y);
    node_component *node = ecs_add(r->world, e, w->node);
    node->name = "sun";
    for (int k = 0; k < 3; k++) {
        node->matrix[k] = x[k];
        node->matrix[4 + k] = y[k];
        node->matrix[8 + k] = z[k];
    }
    node->matrix[15] = 1;
    light_component *light = ecs_add(r->world, e, w->light);
    *light = (light_component){.type = LIGHT_DIRECTIONAL, .color = {lux, lux, lux}};
    return e;
}

// ---- Transforms

void world_matrix_multiply(const float a[16], const float b[16], float product[16])
{
    mat4 left, right; // over-aligned, so copies
    memcpy(left, a, sizeof left);
    memcpy(right, b, sizeof right);
    glm_mat4_mul(left, right, left);
    memcpy(product, left, sizeof left);
}

// Parents first, each once a frame. A parent that is gone counts as the world.
static void transform_update(renderer *r, entity e)
{
    const world_gpu *w = r->gpu_world;
    const uint32_t stamp = r->frame + 1;
    transform_component *transform = ecs_add(r->world, e, w->transform);
    if (transform->stamp == stamp)
        return;
    const bool is_new = transform->stamp == 0;
    transform->stamp = stamp;
    const node_component *node = ecs_get(r->world, e, w->node);
    const transform_component *parent = NULL;
    if (ecs_get(r->world, node->parent, w->node)) {
        transform_update(r, node->parent);
        parent = ecs_get(r->world, node->parent, w->transform);
        transform = ecs_get(r->world, e, w->transform); // may have moved
    }
    memcpy(transform->previous_world, transform->world, sizeof transform->world);
    if (parent)
        world_matrix_multiply(parent->world, node->matrix, transform->world);
    else
        memcpy(transform->world, node->matrix, sizeof transform->world);
    if (is_new)
        memcpy(transform->previous_world, transform->world, sizeof transform->world);
}

static void transforms_update(ecs_world *world, void *user)
{
    renderer *r = user;
    for (ecs_iterator it = ecs_iterate(world, r->gpu_world->node); ecs_next(&it);)
        transform_update(r, it.entity);
    world_deform_update(r);
}

// ---- The order of instances

typedef struct placed_instance {
    world_instance instance;
    float centre[3]; // world
} placed_instance;

static int placed_compare(const void *left, const void *right, void *axis)
{
    const placed_instance *a = left, *b = right;
    const float x = a->centre[*(int *)axis], y = b->centre[*(int *)axis];
    if (x != y)
        return x < y ? -1 : 1;
    return (a->instance.entity.id > b->instance.entity.id) - (a->instance.entity.id < b->instance.entity.id);
}

// Halves of n/2 along the longest axis, as the builders of top-level structures halve their list.
static void median_split(placed_instance *items, uint32_t count)
{
    if (count <= 2)
        return;
    float extent[3];
    for (int k = 0; k < 3; k++) {
        float low = FLT_MAX, high = -FLT_MAX;
        for (uint32_t i = 0; i < count; i++) {
            low = fminf(low, items[i].centre[k]);
            high = fmaxf(high, items[i].centre[k]);
        }
        extent[k] = high - low;
    }
    int axis = extent[1] > extent[0] ? 1 : 0;
    axis = extent[2] > extent[axis] ? 2 : axis;
    qsort_r(items, count, sizeof *items, placed_compare, &axis);
    median_split(items, count / 2);
    median_split(items + count / 2, count - count / 2);
}

static void box_add_point(box *b, const float p[3])
{
    for (int k = 0; k < 3; k++) {
        b->min[k] = fminf(b->min[k], p[k]);
        b->max[k] = fmaxf(b->max[k], p[k]);
    }
}

// Adds the corners of `from`, transformed by the column-major `matrix`.
static void box_add_transformed(box *b, const box *from, const float matrix[16])
{
    if (from->min[0] > from->max[0])
        return;
    for (int corner = 0; corner < 8; corner++) {
        float p[3] = {matrix[12], matrix[13], matrix[14]};
        for (int k = 0; k < 3; k++) {
            const float x = corner >> k & 1 ? from->max[k] : from->min[k];
            for (int row = 0; row < 3; row++)
                p[row] += matrix[4 * k + row] * x;
        }
        box_add_point(b, p);
    }
}

static const box box_empty = {{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};

// From the instance's mesh to the world.
typedef struct placement {
    const float *world, *previous_world;
} placement;

bool world_is_skinned(const renderer *r, uint32_t mesh)
{
    const uint32_t index = r->gpu_world->mesh_deformations[mesh];
    return index != SCENE_NONE && r->scene->deformations[index].skin != SCENE_NONE;
}

static placement placement_of(const renderer *r, const world_instance *instance)
{
    static const float identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    if (world_is_skinned(r, instance->mesh))
        return (placement){identity, identity};
    const transform_component *transform = ecs_get(r->world, instance->entity, r->gpu_world->transform);
    return (placement){transform->world, transform->previous_world};
}

static void box_add_instance(const renderer *r, box *b, const world_instance *instance)
{
    const float *world = placement_of(r, instance).world;
    const scene_mesh *mesh = &r->scene->meshes[instance->mesh];
    for (uint32_t i = 0; i < mesh->primitive_count; i++)
        box_add_transformed(b, &r->gpu_world->primitive_boxes[mesh->first_primitive + i], world);
}

static void instances_order(renderer *r)
{
    world_gpu *w = r->gpu_world;
    placed_instance *items = memory_alloc(max_u32(w->instance_count, 1) * sizeof *items);
    for (uint32_t i = 0; i < w->instance_count; i++) {
        box b = box_empty;
        box_add_instance(r, &b, &w->state->listed[i]);
        items[i].instance = w->state->listed[i];
        for (int k = 0; k < 3; k++)
            items[i].centre[k] = 0.5f * b.min[k] + 0.5f * b.max[k];
    }
    median_split(items, w->instance_count);
    memory_reserve((void **)&w->order, &w->state->order_capacity, w->instance_count, sizeof *w->order);
    for (uint32_t i = 0; i < w->instance_count; i++)
        w->order[i] = items[i].instance;
    free(items);
}

// A mesh scaled to nothing is nowhere to be seen, and Vulkan wants the matrices of instances invertible.
static bool matrix_is_invertible(const float m[16])
{
    float cross[3];
    glm_vec3_cross((float *)m, (float *)m + 4, cross);
    return fabsf(glm_vec3_dot(cross, (float *)m + 8)) >= FLT_MIN;
}

// Lists the drawable instances; true when they are others than in the last frame.
static bool instances_find(renderer *r)
{
    world_gpu *w = r->gpu_world;
    struct world_state *state = w->state;
    const size_t limit = ecs_count(r->world, w->mesh);
    memory_reserve((void **)&state->found, &state->found_capacity, limit, sizeof *state->found);
    uint32_t count = 0;
    for (ecs_iterator it = ecs_iterate(r->world, w->mesh); ecs_next(&it);) {
        const uint32_t mesh = ((mesh_component *)it.component)->mesh;
        assert(mesh < w->blas_count);
        const transform_component *transform = ecs_get(r->world, it.entity, w->transform);
        if (w->blas[mesh].id && transform && (world_is_skinned(r, mesh) || matrix_is_invertible(transform->world)))
            state->found[count++] = (world_instance){it.entity, mesh};
    }
    const size_t size = count * sizeof *state->found;
    if (count == w->instance_count && (count == 0 || memcmp(state->found, state->listed, size) == 0))
        return false;
    memory_reserve((void **)&state->listed, &state->listed_capacity, count, sizeof *state->listed);
    memcpy(state->listed, state->found, size);
    w->instance_count = count;
    return true;
}

// ---- Instances on the GPU

static void rows_of(const float matrix[16], float rows[3][4])
{
    for (int row = 0; row < 3; row++)
        for (int k = 0; k < 4; k++)
            rows[row][k] = matrix[4 * k + row];
}

// The inverse transpose up to a positive factor, by cofactors. Returns whether the determinant is negative.
static bool normal_matrix_of(const float world[3][4], float normal[3][4])
{
    float largest = 0;
    for (int row = 0; row < 3; row++) {
        glm_vec3_cross((float *)world[(row + 1) % 3], (float *)world[(row + 2) % 3], normal[row]);
        normal[row][3] = 0;
        largest = fmaxf(largest,
                        glm_vec3_max((float[3]){fabsf(normal[row][0]), fabsf(normal[row][1]), fabsf(normal[row][2])}));
    }
    const bool mirrored = glm_vec3_dot((float *)world[0], normal[0]) < 0;
    const float scale = (mirrored ? -1.0f : 1.0f) / (largest > 0 ? largest : 1.0f);
    for (int row = 0; row < 3; row++)
        glm_vec3_scale(normal[row], scale, normal[row]);
    return mirrored;
}

// What its winding makes of the front becomes its back.
static void instance_turn(mesh_instance_gpu *instance)
{
    instance->mirrored = !instance->mirrored;
    for (int row = 0; row < 3; row++)
        glm_vec3_negate(instance->normal_matrix[row]);
}

static mesh_instance_gpu instance_make(const renderer *r, const world_instance *from)
{
    const placement placed = placement_of(r, from);
    const scene_mesh *mesh = &r->scene->meshes[from->mesh];
    mesh_instance_gpu instance = {
        .first_primitive = mesh->first_primitive,
        .primitive_count = mesh->primitive_count,
        .mesh = from->mesh,
        .previous_vertex = PREVIOUS_SAME,
    };
    rows_of(placed.world, instance.world);
    rows_of(placed.previous_world, instance.previous_world);
    instance.mirrored = normal_matrix_of(instance.world, instance.normal_matrix);
    const world_deformation *deformation = world_deformation_of(r, from->mesh);
    if (deformation && deformation->changed)
        instance.previous_vertex = deformation->first_kept;
    if (deformation && deformation->mirrored)
        instance_turn(&instance);
    return instance;
}

static void tlas_instances_write(renderer *r, VkAccelerationStructureInstanceKHR *to)
{
    const world_gpu *w = r->gpu_world;
    for (uint32_t i = 0; i < w->instance_count; i++) {
        VkAccelerationStructureInstanceKHR instance = {
            .instanceCustomIndex = i,
            .mask = 0xff,
            .flags = VK_GEOMETRY_INSTANCE_TRIANGLE_FACING_CULL_DISABLE_BIT_KHR,
            .accelerationStructureReference = gpu_acceleration_address(r->gpu, w->blas[w->order[i].mesh]),
        };
        memcpy(instance.transform.matrix, w->instance_data[i].world, sizeof instance.transform.matrix);
        to[i] = instance;
    }
}

bool world_has_changed(const world_gpu *w)
{
    return w->changes.bounds || w->changes.sources || w->changes.box_count > 0;
}

bool world_instance_moved(const mesh_instance_gpu *instance)
{
    return memcmp(instance->world, instance->previous_world, sizeof instance->world) != 0 ||
           instance->previous_vertex != PREVIOUS_SAME;
}

// Fills this frame's instances in, and notes whether any moved; `emitter_moved` is set when one with an emissive
// material did. False: no memory.
static bool instances_write(renderer *r, bool *emitter_moved)
{
    world_gpu *w = r->gpu_world;
    if (w->instance_count > w->instance_max)
        w->instance_max = max_u32(w->instance_count, 2 * w->instance_max);
    const VkDeviceSize max = w->instance_max;
    mesh_instance_gpu *instances =
        world_buffer_reserve(r, &w->instances, "instances", SCENE_INSTANCES, max * sizeof *instances);
    VkAccelerationStructureInstanceKHR *tlas_instances =
        world_buffer_reserve(r, &w->tlas_instances, "tlas instances", BINDING_NONE, max * sizeof *tlas_instances);
    if (!instances || !tlas_instances)
        return false;
    memory_reserve((void **)&w->instance_data, &w->state->data_capacity, w->instance_count, sizeof *w->instance_data);
    for (uint32_t i = 0; i < w->instance_count; i++) {
        w->instance_data[i] = instance_make(r, &w->order[i]);
        const bool moved = world_instance_moved(&w->instance_data[i]);
        w->changes.instances |= moved;
        *emitter_moved |= moved && w->state->mesh_emits[w->order[i].mesh];
    }
    memcpy(instances, w->instance_data, w->instance_count * sizeof *instances);
    tlas_instances_write(r, tlas_instances);
    return true;
}

// ---- Changes

static void changed_add(world_gpu *w, const box *b)
{
    memory_reserve((void **)&w->state->changed, &w->state->changed_capacity, w->changes.box_count + 1, sizeof *b);
    w->state->changed[w->changes.box_count++] = *b;
    w->changes.boxes = w->state->changed;
}

static int placed_box_compare(const void *left, const void *right)
{
    const world_instance *a = &((const placed_box *)left)->instance, *b = &((const placed_box *)right)->instance;
    return a->entity.id != b->entity.id ? (a->entity.id < b->entity.id ? -1 : 1)
                                        : (a->mesh > b->mesh) - (a->mesh < b->mesh);
}

// Lists what only one of the two lists has. Sorts both.
static void boxes_compare(world_gpu *w, placed_box *last, uint32_t last_count, placed_box *now, uint32_t now_count)
{
    qsort(last, last_count, sizeof *last, placed_box_compare);
    qsort(now, now_count, sizeof *now, placed_box_compare);
    for (uint32_t i = 0, k = 0; i < last_count || k < now_count;) {
        const int order = i == last_count ? 1 : k == now_count ? -1 : placed_box_compare(&last[i], &now[k]);
        if (order < 0)
            changed_add(w, &last[i].box);
        if (order > 0)
            changed_add(w, &now[k].box);
        i += order <= 0;
        k += order >= 0;
    }
}

static box instance_box(const renderer *r, const world_instance *instance)
{
    box b = box_empty;
    box_add_instance(r, &b, instance);
    return b;
}

// The boxes of this frame's instances where others than in the last frame are listed.
static void boxes_make(renderer *r, uint32_t last_count)
{
    world_gpu *w = r->gpu_world;
    struct world_state *state = w->state;
    placed_box *last = memory_alloc(max_u32(last_count, 1) * sizeof *last);
    placed_box *now = memory_alloc(max_u32(w->instance_count, 1) * sizeof *now);
    if (last_count > 0)
        memcpy(last, state->boxes, last_count * sizeof *last);
    memory_reserve((void **)&state->boxes, &state->boxes_capacity, w->instance_count, sizeof *state->boxes);
    for (uint32_t i = 0; i < w->instance_count; i++)
        state->boxes[i] = now[i] = (placed_box){w->order[i], instance_box(r, &w->order[i])};
    boxes_compare(w, last, last_count, now, w->instance_count);
    free(last);
    free(now);
}

// Before and after, of the instances that moved.
static void boxes_move(renderer *r)
{
    world_gpu *w = r->gpu_world;
    for (uint32_t i = 0; i < w->instance_count; i++) {
        if (!world_instance_moved(&w->instance_data[i]))
            continue;
        const float *previous_world = placement_of(r, &w->order[i]).previous_world;
        const world_deformation *deformation = world_deformation_of(r, w->order[i].mesh);
        const scene_mesh *mesh = &r->scene->meshes[w->order[i].mesh];
        box before = box_empty;
        for (uint32_t k = 0; k < mesh->primitive_count; k++)
            box_add_transformed(
                &before, deformation ? &deformation->previous_box : &w->primitive_boxes[mesh->first_primitive + k],
                previous_world);
        changed_add(w, &before);
        w->state->boxes[i].box = instance_box(r, &w->order[i]);
        changed_add(w, &w->state->boxes[i].box);
    }
}

// Of the primitives whose base colour, and with it what they reflect and let pass, changed.
static void boxes_recolor(renderer *r)
{
    world_gpu *w = r->gpu_world;
    for (uint32_t i = 0; i < w->instance_count; i++) {
        const mesh_instance_gpu *instance = &w->instance_data[i];
        float matrix[16] = {0};
        for (int row = 0; row < 3; row++)
            for (int k = 0; k < 4; k++)
                matrix[4 * k + row] = instance->world[row][k];
        for (uint32_t k = 0; k < instance->primitive_count; k++) {
            const uint32_t primitive = instance->first_primitive + k;
            if (!(world_material_changes(r, r->scene->primitives[primitive].material) & MATERIAL_COLOR_CHANGED))
                continue;
            box b = box_empty;
            box_add_transformed(&b, &w->primitive_boxes[primitive], matrix);
            changed_add(w, &b);
        }
    }
}

// `listed`: others than the `last_count` instances of the last frame are listed.
static void boxes_extract(renderer *r, bool listed, uint32_t last_count)
{
    r->gpu_world->changes.box_count = 0;
    if (listed)
        boxes_make(r, last_count);
    boxes_move(r);
    if (world_materials_changes(r) & MATERIAL_COLOR_CHANGED)
        boxes_recolor(r);
}

static void bounds_extract(renderer *r)
{
    world_gpu *w = r->gpu_world;
    box b = box_empty;
    for (uint32_t i = 0; i < w->instance_count; i++) {
        box_add_point(&b, w->state->boxes[i].box.min);
        box_add_point(&b, w->state->boxes[i].box.max);
    }
    if (b.min[0] > b.max[0])
        b = (box){0};
    frame_constants *c = &r->constants;
    w->changes.bounds = r->frame == 0 || memcmp(c->scene_min, b.min, sizeof b.min) != 0 ||
                        memcmp(c->scene_max, b.max, sizeof b.max) != 0;
    memcpy(c->scene_min, b.min, sizeof b.min);
    memcpy(c->scene_max, b.max, sizeof b.max);
    c->scene_radius = fmaxf(0.5f * glm_vec3_distance(b.min, b.max), FLT_MIN);
}

static void meshes_find_emitters(renderer *r)
{
    const scene_data *s = r->scene;
    bool *emits = r->gpu_world->state->mesh_emits;
    for (uint32_t i = 0; i < s->mesh_count; i++) {
        emits[i] = false;
        for (uint32_t k = 0; k < s->meshes[i].primitive_count; k++)
            emits[i] |= world_material_emits(r, s->primitives[s->meshes[i].first_primitive + k].material);
    }
}

static void world_extract(ecs_world *world, void *user)
{
    (void)world;
    renderer *r = user;
    const uint32_t last_count = r->gpu_world->instance_count;
    const bool listed = instances_find(r);
    if (listed)
        instances_order(r);
    world_deform_mark(r);
    const bool emission_changed = world_materials_changes(r) & MATERIAL_EMISSION_CHANGED;
    if (emission_changed)
        meshes_find_emitters(r);
    bool emitter_moved = listed || emission_changed;
    r->gpu_world->changes.instances = listed;
    r->failed |= !world_materials_extract(r) || !instances_write(r, &emitter_moved);
    if (r->failed)
        return;
    boxes_extract(r, listed, last_count);
    bounds_extract(r);
    r->failed |= !world_lights_extract(r, emitter_moved);
    world_materials_rest(r);
}

// ---- Life

static void components_register(renderer *r)
{
    world_gpu *w = r->gpu_world;
    const struct {
        component_type *type;
        component_desc desc;
    } types[] = {
        {&w->node, {.name = "node", .size = sizeof(node_component)}},
        {&w->transform, {.name = "transform", .size = sizeof(transform_component)}},
        {&w->mesh, {.name = "mesh", .size = sizeof(mesh_component)}},
        {&w->light, {.name = "light", .size = sizeof(light_component)}},
        {&w->weights, {.name = "weights", .size = sizeof(weights_component), .fini = weights_fini}},
    };
    for (size_t i = 0; i < countof(types); i++)
        *types[i].type = ecs_component_register(r->world, &types[i].desc);
}

bool world_init(renderer *r)
{
    world_gpu *w = r->gpu_world = memory_alloc(sizeof *w);
    w->state = memory_alloc(sizeof *w->state);
    components_register(r);
    world_materials_init(r);
    w->state->mesh_emits = memory_alloc(max_u32(r->scene->mesh_count, 1) * sizeof(bool));
    meshes_find_emitters(r);
    scene_spawn(r);
    const ecs_system_desc transforms = {
        .name = "transforms", .phase = ECS_PHASE_UPDATE, .run = transforms_update, .user = r};
    ecs_system_register(r->world, &transforms);
    const ecs_system_desc extract = {.name = "extract", .phase = ECS_PHASE_EXTRACT, .run = world_extract, .user = r};
    ecs_system_register(r->world, &extract);
    return world_upload(r) && world_deform_init(r) && world_lights_init(r) &&
           world_buffer_reserve(r, &w->frame, "frame constants", SCENE_FRAME, sizeof(frame_constants));
}

void world_fini(renderer *r)
{
    world_gpu *w = r->gpu_world;
    if (!w)
        return;
    world_lights_fini(r);
    world_deform_fini(r);
    world_materials_fini(r);
    const gpu_buffer buffers[] = {w->frame,      w->positions, w->attributes,    w->indices,
                                  w->primitives, w->instances, w->materials,     w->lights,
                                  w->emitters,   w->light_cdf, w->tlas_instances};
    for (size_t i = 0; i < countof(buffers); i++)
        gpu_buffer_destroy(r->gpu, buffers[i]);
    for (uint32_t i = 0; i < w->blas_count; i++)
        gpu_acceleration_destroy(r->gpu, w->blas[i]);
    for (uint32_t i = 0; i < w->texture_count; i++)
        gpu_image_destroy(r->gpu, w->textures[i]);
    free(w->blas);
    free(w->textures);
    free(w->primitive_boxes);
    free(w->node_entities);
    free(w->order);
    free(w->instance_data);
    free(w->state->listed);
    free(w->state->found);
    free(w->state->boxes);
    free(w->state->changed);
    free(w->state->mesh_emits);
    free(w->state);
    free(w);
}
