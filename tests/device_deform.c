// Deforming meshes: vertices, motion, rays and what is traced again, against evaluations of the test's own.
//
//     device_deform                    the tests
//     device_deform bench              milliseconds of deforming, of keeping up the structures, and of rays
#include "modules/image_file.h"
#include "modules/vpl_trace.h"
#include "quad_scene.h"
#include "ray_batch.h"
#include "test.h"

#include <unistd.h>

static gpu *devices[2]; // a device holds one scene
#define device devices[0]

// ---- A scene: a floor, a grid that joints and targets move, and one that targets alone move

enum {
    JOINTS = 8,
    TARGETS = 2,
    MESHES = 3,
    FLOOR_NODE = 0,
    SKINNED_NODE = 1,
    MORPHED_NODE = 2,
    FIRST_JOINT = 3,
    LIGHT_NODE = FIRST_JOINT + JOINTS,
    NODES = LIGHT_NODE + 1
};

typedef struct grid_desc {
    uint32_t cells; // along an edge
    uint32_t influences; // joints of a vertex; 1 and 2: joints 0 and 1 by x
    bool flat;
    bool is_light; // the skinned mesh gives light
} grid_desc;

typedef struct deform_scene {
    scene_data data;
    grid_desc desc;
    uint32_t vertices; // of a grid
    scene_node nodes[NODES];
    scene_mesh meshes[MESHES];
    mesh_primitive primitives[MESHES];
    material materials[2];
    scene_light light;
    scene_influences *influences;
    scene_morph *morphs;
    float weights[TARGETS];
    scene_skin skin;
    uint32_t joints[JOINTS];
    float inverse_bind[JOINTS][16];
    scene_deformation deformations[2];
} deform_scene;

static uint32_t random_state = 1;

static float random_unit(void) // xorshift; in [0,1)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return (float)(random_state >> 8) / 16777216;
}

static float random_signed(void)
{
    return 2 * random_unit() - 1;
}

// A grid over [-1,1]^2 that faces +z, its bumps along z.
static void grid_vertices(deform_scene *s, uint32_t first)
{
    const uint32_t side = s->desc.cells + 1;
    for (uint32_t v = 0; v < s->vertices; v++) {
        const float x = 2 * (float)(v % side) / (float)s->desc.cells - 1;
        const float y = 2 * (float)(v / side) / (float)s->desc.cells - 1;
        const float slope = s->desc.flat ? 0 : 0.6f * cosf(3 * x), length = sqrtf(1 + slope * slope);
        const float z = s->desc.flat ? 0 : 0.2f * sinf(3 * x);
        memcpy(s->data.positions[first + v], (float[3]){x, y, z}, sizeof(float[3]));
        s->data.attributes[first + v] = (vertex_attributes){
            .normal = {-slope / length, 0, 1 / length},
            .tangent = {1 / length, 0, slope / length, 1},
            .uv0 = {x, y},
            .color_rg = ~0u,
            .color_ba = ~0u,
        };
    }
}

static void grid_indices(const deform_scene *s, uint32_t *indices)
{
    const uint32_t side = s->desc.cells + 1;
    for (uint32_t i = 0; i < s->desc.cells * s->desc.cells; i++) {
        const uint32_t v = i / s->desc.cells * side + i % s->desc.cells;
        const uint32_t quad[6] = {v, v + 1, v + side + 1, v, v + side + 1, v + side};
        memcpy(indices + 6 * i, quad, sizeof quad);
    }
    scene_primitive_reorder(indices, 6 * s->desc.cells * s->desc.cells, (const float(*)[3])s->data.positions + 4);
}

static scene_influences influences_of(const deform_scene *s, uint32_t vertex)
{
    scene_influences by = {0};
    const float along = 0.5f + 0.5f * s->data.positions[4 + vertex][0];
    if (s->desc.influences <= 2) {
        by.joints[1] = 1;
        by.weights[0] = s->desc.influences == 1 ? 1 : 1 - along;
        by.weights[1] = 1 - by.weights[0];
        if (by.weights[0] == 0) { // used ones first
            by = (scene_influences){.joints = {1}, .weights = {1}};
        }
        return by;
    }
    float sum = 0;
    for (uint32_t i = 0; i < s->desc.influences; i++) {
        by.joints[i] = (uint16_t)((vertex + i) % JOINTS);
        by.weights[i] = 0.05f + random_unit();
        sum += by.weights[i];
    }
    for (uint32_t i = 0; i < s->desc.influences; i++)
        by.weights[i] /= sum;
    return by;
}

static void node_init(scene_node *node, const char *name, uint32_t parent, uint32_t mesh, uint32_t light)
{
    *node = (scene_node){
        .name = name, .parent = parent, .mesh = mesh, .camera = SCENE_NONE, .light = light, .skin = SCENE_NONE};
    memcpy(node->matrix, IDENTITY, sizeof IDENTITY);
}

static void nodes_init(deform_scene *s)
{
    node_init(&s->nodes[FLOOR_NODE], "floor", SCENE_NONE, 0, SCENE_NONE);
    const float slope[16] = {6, 0, 0, 0, 0, 4, -4, 0, 0, 4, 4, 0, 0, -1.5f, -1.5f, 1}; // the scene's bounds are its own
    memcpy(s->nodes[FLOOR_NODE].matrix, slope, sizeof slope);
    node_init(&s->nodes[SKINNED_NODE], "skinned", SCENE_NONE, 1, SCENE_NONE);
    s->nodes[SKINNED_NODE].skin = 0;
    s->nodes[SKINNED_NODE].matrix[12] = 100; // which does not move it
    node_init(&s->nodes[MORPHED_NODE], "morphed", SCENE_NONE, 2, SCENE_NONE);
    s->nodes[MORPHED_NODE].matrix[12] = 2.5f;
    for (uint32_t i = 0; i < JOINTS; i++) {
        node_init(&s->nodes[FIRST_JOINT + i], "joint", i == 0 ? SCENE_NONE : FIRST_JOINT, SCENE_NONE, SCENE_NONE);
        s->joints[i] = FIRST_JOINT + i;
        memcpy(s->inverse_bind[i], IDENTITY, sizeof IDENTITY);
        if (i > 0) { // joints of their own places at rest
            s->nodes[FIRST_JOINT + i].matrix[12] = 0.25f * (float)i;
            s->inverse_bind[i][12] = -0.25f * (float)i;
        }
    }
    node_init(&s->nodes[LIGHT_NODE], "light", SCENE_NONE, SCENE_NONE, 0);
    s->nodes[LIGHT_NODE].matrix[13] = s->nodes[LIGHT_NODE].matrix[14] = 3;
}

static void materials_init(deform_scene *s)
{
    const texture_reference none = {.texture = TEXTURE_NONE, .transform = {1, 0, 0, 1}};
    for (int i = 0; i < 2; i++)
        s->materials[i] = (material){
            .base_color = {0.5f, 0.5f, 0.5f, 1},
            .flags = MATERIAL_DOUBLE_SIDED,
            .normal_scale = 1,
            .base_texture = none,
            .emissive_texture = none,
            .normal_texture = none,
            .metallic_roughness_texture = none,
        };
    for (int k = 0; k < 3 && s->desc.is_light; k++)
        s->materials[1].emissive[k] = 5;
}

static void geometry_init(deform_scene *s)
{
    const uint32_t grid_indices_count = 6 * s->desc.cells * s->desc.cells;
    static const float corners[4][3] = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
    static const uint32_t floor_indices[6] = {0, 1, 2, 0, 2, 3};
    s->data.vertex_count = 4 + 2 * s->vertices;
    s->data.index_count = 6 + grid_indices_count;
    s->data.positions = memory_alloc(s->data.vertex_count * sizeof *s->data.positions);
    s->data.attributes = memory_alloc(s->data.vertex_count * sizeof *s->data.attributes);
    s->data.indices = memory_alloc(s->data.index_count * sizeof *s->data.indices);
    memcpy(s->data.positions, corners, sizeof corners);
    memcpy(s->data.indices, floor_indices, sizeof floor_indices);
    for (int i = 0; i < 4; i++)
        s->data.attributes[i] = (vertex_attributes){.normal = {0, 0, 1}, .color_rg = ~0u, .color_ba = ~0u};
    grid_vertices(s, 4);
    grid_vertices(s, 4 + s->vertices);
    grid_indices(s, s->data.indices + 6);
    s->primitives[0] = (mesh_primitive){.index_count = 6, .vertex_count = 4};
    for (uint32_t i = 1; i < MESHES; i++)
        s->primitives[i] = (mesh_primitive){.first_index = 6,
                                            .index_count = grid_indices_count,
                                            .first_vertex = 4 + (i - 1) * s->vertices,
                                            .vertex_count = s->vertices,
                                            .material = i == 1};
    for (uint32_t i = 0; i < MESHES; i++)
        s->meshes[i] =
            (scene_mesh){.first_primitive = i, .primitive_count = 1, .deformation = i == 0 ? SCENE_NONE : i - 1};
}

static deform_scene *scene_create(grid_desc desc)
{
    deform_scene *s = memory_alloc(sizeof *s);
    s->desc = desc;
    s->vertices = (desc.cells + 1) * (desc.cells + 1);
    nodes_init(s);
    materials_init(s);
    geometry_init(s);
    s->influences = memory_alloc(s->vertices * sizeof *s->influences);
    s->morphs = memory_alloc(TARGETS * s->vertices * sizeof *s->morphs);
    random_state = 1;
    for (uint32_t v = 0; v < s->vertices; v++)
        s->influences[v] = influences_of(s, v);
    for (uint32_t i = 0; i < TARGETS * s->vertices; i++)
        for (int k = 0; k < 3; k++) {
            s->morphs[i].position[k] = desc.flat ? 0 : 0.1f * random_signed();
            s->morphs[i].normal[k] = 0.2f * random_signed();
            s->morphs[i].tangent[k] = 0.2f * random_signed();
        }
    s->skin = (scene_skin){"skin", JOINTS, s->joints, (const float(*)[16])s->inverse_bind};
    for (uint32_t i = 0; i < 2; i++)
        s->deformations[i] = (scene_deformation){
            .mesh = 1 + i,
            .node = i == 0 ? SKINNED_NODE : MORPHED_NODE,
            .first_vertex = 4 + i * s->vertices,
            .vertex_count = s->vertices,
            .skin = i == 0 ? 0 : SCENE_NONE,
            .influences = i == 0 ? s->influences : NULL,
            .target_count = TARGETS,
            .morphs = s->morphs,
            .weights = s->weights,
        };
    s->light = (scene_light){.name = "light", .type = LIGHT_POINT, .color = {100, 100, 100}};
    s->data.path = "grids";
    s->data.nodes = s->nodes;
    s->data.node_count = NODES;
    s->data.meshes = s->meshes;
    s->data.mesh_count = MESHES;
    s->data.primitives = s->primitives;
    s->data.primitive_count = MESHES;
    s->data.materials = s->materials;
    s->data.material_count = 2;
    s->data.lights = &s->light;
    s->data.light_count = 1;
    s->data.skins = &s->skin;
    s->data.skin_count = 1;
    s->data.deformations = s->deformations;
    s->data.deformation_count = 2;
    return s;
}

static void scene_free(deform_scene *s)
{
    free(s->data.positions);
    free(s->data.attributes);
    free(s->data.indices);
    free(s->influences);
    free(s->morphs);
    free(s);
}

static renderer *renderer_of(gpu *on, const scene_data *scene, render_settings settings)
{
    renderer *r = renderer_create(on, scene, &settings);
    if (!r) {
        printf("no renderer\n");
        exit(EXIT_FAILURE);
    }
    return r;
}

static render_settings settings_small(void)
{
    render_settings settings = render_settings_default();
    settings.width = settings.height = 16;
    settings.vpls = 0;
    settings.only = ONLY_INDIRECT; // nobody traces but those who are asked to
    return settings;
}

// ---- Poses

static float *matrix_of(renderer *r, uint32_t node)
{
    return ((node_component *)ecs_get(r->world, r->gpu_world->node_entities[node], r->gpu_world->node))->matrix;
}

static float *weights_of(renderer *r, uint32_t node)
{
    return ((weights_component *)ecs_get(r->world, r->gpu_world->node_entities[node], r->gpu_world->weights))->weights;
}

// Every joint turned, moved and scaled differently, and weights on all targets. `size` 0: at rest, but for a scale.
static void pose_set(renderer *r, float time, float size)
{
    for (uint32_t i = 0; i < JOINTS; i++) {
        float *m = matrix_of(r, FIRST_JOINT + i);
        const float angle = size * sinf(time + 0.7f * (float)i), scale = 1 + 0.2f * size * sinf(2 * time + (float)i);
        const float turned[12] = {scale * cosf(angle), 0, -scale * sinf(angle), 0, 0.1f * angle, 1.1f, 0, 0,
                                  sinf(angle),         0, cosf(angle),          0};
        memcpy(m, turned, sizeof turned);
        m[13] = 0.3f * size * sinf(time * (float)(i + 1));
    }
    for (uint32_t t = 0; t < TARGETS; t++) {
        weights_of(r, SKINNED_NODE)[t] = size * sinf(time + (float)t);
        if (r->scene->deformation_count > 1)
            weights_of(r, MORPHED_NODE)[t] = size * cosf(time + (float)t);
    }
}

typedef struct vector {
    double x[3];
} vector;

static double dot(vector a, vector b)
{
    return a.x[0] * b.x[0] + a.x[1] * b.x[1] + a.x[2] * b.x[2];
}

static vector normalized(vector a)
{
    const double length = sqrt(dot(a, a));
    return (vector){{a.x[0] / length, a.x[1] / length, a.x[2] / length}};
}

static void multiply(const double a[16], const double b[16], double out[16])
{
    for (int column = 0; column < 4; column++)
        for (int row = 0; row < 4; row++) {
            out[4 * column + row] = 0;
            for (int k = 0; k < 4; k++)
                out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
        }
}

static void node_world(renderer *r, uint32_t node, double out[16])
{
    double local[16], parent[16];
    for (int k = 0; k < 16; k++)
        local[k] = (double)matrix_of(r, node)[k];
    if (r->scene->nodes[node].parent == SCENE_NONE) {
        memcpy(out, local, sizeof local);
        return;
    }
    node_world(r, r->scene->nodes[node].parent, parent);
    multiply(parent, local, out);
}

// From the mesh at rest to the world.
static void joint_matrix(renderer *r, const scene_skin *skin, uint32_t joint, double out[16])
{
    double world[16], inverse_bind[16];
    node_world(r, skin->joints[joint], world);
    for (int k = 0; k < 16; k++)
        inverse_bind[k] = (double)skin->inverse_bind[joint][k];
    multiply(world, inverse_bind, out);
}

typedef struct vertex_pose {
    vector position, normal, tangent;
} vertex_pose;

static vertex_pose morphed_vertex(renderer *r, const scene_deformation *d, uint32_t vertex)
{
    const vertex_attributes *a = &r->scene->attributes[d->first_vertex + vertex];
    vertex_pose p;
    for (int k = 0; k < 3; k++) {
        p.position.x[k] = (double)r->scene->positions[d->first_vertex + vertex][k];
        p.normal.x[k] = (double)a->normal[k];
        p.tangent.x[k] = (double)a->tangent[k];
        for (uint32_t t = 0; t < d->target_count; t++) {
            const scene_morph *offset = &d->morphs[t * d->vertex_count + vertex];
            const double weight = (double)weights_of(r, d->node)[t];
            p.position.x[k] += weight * (double)offset->position[k];
            p.normal.x[k] += weight * (double)offset->normal[k];
            p.tangent.x[k] += weight * (double)offset->tangent[k];
        }
    }
    return p;
}

// Normals by the inverse transpose. `joints`: of the skin.
static vertex_pose skinned_vertex(const scene_influences *by, const double (*joints)[16], vertex_pose p)
{
    double m[16] = {0}, inverse[3][3], determinant = 0;
    for (int i = 0; i < SCENE_INFLUENCES; i++)
        for (int k = 0; k < 16; k++)
            m[k] += (double)by->weights[i] * joints[by->joints[i]][k];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) { // inverse[k][i]: cofactor of row i, column k
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            inverse[k][i] = m[4 * k1 + i1] * m[4 * k2 + i2] - m[4 * k2 + i1] * m[4 * k1 + i2];
        }
        determinant += m[i] * inverse[0][i];
    }
    vertex_pose out;
    for (int row = 0; row < 3; row++) {
        out.position.x[row] = m[12 + row];
        out.normal.x[row] = out.tangent.x[row] = 0;
        for (int k = 0; k < 3; k++) {
            out.position.x[row] += m[4 * k + row] * p.position.x[k];
            out.normal.x[row] += inverse[k][row] / determinant * p.normal.x[k];
            out.tangent.x[row] += m[4 * k + row] * p.tangent.x[k];
        }
    }
    return out;
}

static vertex_pose vertex_expected(renderer *r, const scene_deformation *d, uint32_t vertex, const double (*joints)[16])
{
    vertex_pose p = morphed_vertex(r, d, vertex);
    if (d->skin != SCENE_NONE)
        p = skinned_vertex(&d->influences[vertex], joints, p);
    p.normal = normalized(p.normal);
    const double along = dot(p.normal, p.tangent);
    for (int k = 0; k < 3; k++)
        p.tangent.x[k] -= along * p.normal.x[k];
    const bool is_parallel = dot(p.tangent, p.tangent) < 1e-6; // as some files have it
    p.tangent = is_parallel ? (vector){{NAN, NAN, NAN}} : normalized(p.tangent);
    return p;
}

// What every vertex of the deformation should be; free() it.
static vertex_pose *pose_expected(renderer *r, const scene_deformation *d)
{
    vertex_pose *poses = memory_alloc(d->vertex_count * sizeof *poses);
    const scene_skin *skin = d->skin == SCENE_NONE ? NULL : &r->scene->skins[d->skin];
    double(*joints)[16] = memory_alloc((skin ? skin->joint_count : 1) * sizeof *joints);
    for (uint32_t i = 0; skin && i < skin->joint_count; i++)
        joint_matrix(r, skin, i, joints[i]);
    for (uint32_t v = 0; v < d->vertex_count; v++)
        poses[v] = vertex_expected(r, d, v, (const double(*)[16])joints);
    free(joints);
    return poses;
}

// ---- Vertices

typedef struct vertices { // on the GPU
    float (*positions)[3];
    vertex_attributes *attributes;
} vertices;

static vertices vertices_read(renderer *r)
{
    const uint32_t count = r->scene->vertex_count;
    const vertices v = {memory_alloc(count * sizeof *v.positions), memory_alloc(count * sizeof *v.attributes)};
    CHECK(gpu_buffer_read(r->gpu, r->gpu_world->positions, 0, v.positions, count * sizeof *v.positions));
    CHECK(gpu_buffer_read(r->gpu, r->gpu_world->attributes, 0, v.attributes, count * sizeof *v.attributes));
    return v;
}

static void vertices_free(const vertices *v)
{
    free(v->positions);
    free(v->attributes);
}

typedef struct vertex_errors {
    double position, normal, tangent, length, angle; // worst, metres or without unit
    uint32_t outside; // of the box that the CPU has
} vertex_errors;

static double distance(const float a[3], vector b)
{
    const vector d = {{(double)a[0] - b.x[0], (double)a[1] - b.x[1], (double)a[2] - b.x[2]}};
    return sqrt(dot(d, d));
}

static void vertex_compare(vertex_errors *e, const float position[3], const vertex_attributes *a,
                           const vertex_pose *expected, const box *bounds)
{
    const vector n = {{(double)a->normal[0], (double)a->normal[1], (double)a->normal[2]}};
    const vector t = {{(double)a->tangent[0], (double)a->tangent[1], (double)a->tangent[2]}};
    e->position = fmax(e->position, distance(position, expected->position));
    e->normal = fmax(e->normal, distance(a->normal, expected->normal));
    e->length = fmax(e->length, fabs(dot(n, n) - 1));
    for (int k = 0; k < 3; k++)
        e->outside += position[k] < bounds->min[k] || position[k] > bounds->max[k];
    if (a->tangent[3] == 0 || isnan(expected->tangent.x[0]))
        return;
    e->tangent = fmax(e->tangent, distance(a->tangent, expected->tangent));
    e->length = fmax(e->length, fabs(dot(t, t) - 1));
    e->angle = fmax(e->angle, fabs(dot(n, t)));
}

// Of the vertices of all deformations; what is none of theirs should be as it was. `size`: of the scene, metres.
static void check_vertices(renderer *r, double size)
{
    const scene_data *s = r->scene;
    vertices v = vertices_read(r);
    vertex_errors e = {0};
    for (uint32_t i = 0; i < s->deformation_count; i++) {
        const scene_deformation *d = &s->deformations[i];
        vertex_pose *expected = pose_expected(r, d);
        for (uint32_t k = 0; k < d->vertex_count; k++) {
            const uint32_t vertex = d->first_vertex + k;
            vertex_compare(&e, v.positions[vertex], &v.attributes[vertex], &expected[k],
                           &r->gpu_world->deformations[i].box);
            CHECK(memcmp(v.attributes[vertex].uv0, s->attributes[vertex].uv0, 24) == 0); // and what follows
        }
        free(expected);
    }
    CHECK(e.position < 1e-5 * size && e.normal < 1e-5 && e.tangent < 1e-5);
    CHECK(e.length < 1e-6 && e.angle < 1e-6);
    CHECK(e.outside == 0);
    vertices_free(&v);
}

TEST(vertices_are_what_joints_and_targets_make_of_them)
{
    static const uint32_t influences[] = {1, 2, 4, 8};
    for (size_t i = 0; i < countof(influences); i++) {
        deform_scene *s = scene_create((grid_desc){.cells = 12, .influences = influences[i]});
        renderer *r = renderer_of(device, &s->data, settings_small());
        for (uint32_t frame = 0; frame < 4; frame++) {
            pose_set(r, 0.9f * (float)frame, 1);
            CHECK(renderer_frame(r) && pass_ran(r, "deform"));
            check_vertices(r, 1);
        }
        renderer_destroy(r);
        scene_free(s);
    }
}

TEST(a_still_pose_is_deformed_once)
{
    deform_scene *s = scene_create((grid_desc){.cells = 4, .influences = 2});
    render_settings settings = settings_small();
    settings.only = ONLY_ALL;
    settings.rays = RAYS_QUERY;
    renderer *r = renderer_of(device, &s->data, settings);
    pose_set(r, 1, 1);
    for (uint32_t frame = 0; frame < 6; frame++) {
        if (frame == 4)
            pose_set(r, 2, 1);
        const bool changes = frame == 0 || frame == 4;
        CHECK(renderer_frame(r));
        CHECK(pass_ran(r, "deform") == changes);
        CHECK(pass_ran(r, "acceleration/update") == changes);
        CHECK(pass_ran(r, "acceleration") == changes);
    }
    renderer_destroy(r);
    scene_free(s);
}

TEST(morph_targets_without_weight_leave_the_vertices_alone)
{
    deform_scene *s = scene_create((grid_desc){.cells = 4, .influences = 2});
    s->data.deformation_count = 1;
    s->deformations[0] = s->deformations[1]; // no skin
    renderer *r = renderer_of(device, &s->data, settings_small());
    CHECK(renderer_frame(r) && !pass_ran(r, "deform"));
    weights_of(r, MORPHED_NODE)[1] = 0.5f;
    CHECK(renderer_frame(r) && pass_ran(r, "deform"));
    weights_of(r, MORPHED_NODE)[1] = 0;
    CHECK(renderer_frame(r) && pass_ran(r, "deform"));
    vertices v = vertices_read(r);
    CHECK(memcmp(v.positions, s->data.positions, s->data.vertex_count * sizeof *v.positions) == 0);
    vertices_free(&v);
    renderer_destroy(r);
    scene_free(s);
}

// ---- Motion

enum { MOTION_SIZE = 64 };

static float half_decode(uint16_t bits)
{
    const int exponent = bits >> 10 & 31;
    const float mantissa = (float)(bits & 1023) / 1024;
    const float value = exponent ? ldexpf(1 + mantissa, exponent - 15) : ldexpf(mantissa, -14);
    return bits & 0x8000 ? -value : value;
}

typedef struct motion {
    float x, y;
    bool drawn;
} motion;

static void motion_read(renderer *r, motion *out)
{
    enum { PIXELS = MOTION_SIZE * MOTION_SIZE };
    uint16_t(*vectors)[2] = memory_alloc(PIXELS * sizeof *vectors);
    float *depth = memory_alloc(PIXELS * sizeof *depth);
    CHECK(gpu_image_read(r->gpu, frame_graph_find_image(r->graph, "motion"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                         vectors, PIXELS * sizeof *vectors));
    CHECK(gpu_image_read(r->gpu, frame_graph_find_image(r->graph, "depth"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, depth,
                         PIXELS * sizeof *depth));
    for (uint32_t i = 0; i < PIXELS; i++)
        out[i] = (motion){half_decode(vectors[i][0]), half_decode(vectors[i][1]), depth[i] > 0};
    free(vectors);
    free(depth);
}

// The flat grid, between its joint at the left, which stays, and the one at the right, which moves by `shift` to the
// right and `rise` upwards. A camera 4 m in front of it, with 1 m to a quarter of the picture's height.
static void check_motion(renderer *r, const motion *now, float stretch, float shift, float rise)
{
    const float pixels_per_metre = MOTION_SIZE / 4.0f;
    uint32_t drawn = 0, wrong = 0;
    for (uint32_t i = 0; i < MOTION_SIZE * MOTION_SIZE; i++) {
        const float x = ((float)(i % MOTION_SIZE) + 0.5f - MOTION_SIZE / 2) / pixels_per_metre;
        const float weight = (x + 1) / (2 + stretch); // of the right joint, where x is now
        if (!now[i].drawn)
            continue;
        drawn++;
        const float motion_x = -weight * shift * pixels_per_metre, motion_y = weight * rise * pixels_per_metre;
        wrong += fabsf(now[i].x - motion_x) > 0.01f || fabsf(now[i].y - motion_y) > 0.01f;
    }
    CHECK(drawn > 900 && wrong == 0);
    CHECK(r->gpu_world->instance_count == 1);
}

TEST(motion_vectors_follow_the_vertices)
{
    static motion now[MOTION_SIZE * MOTION_SIZE];
    deform_scene *s = scene_create((grid_desc){.cells = 6, .influences = 2, .flat = true});
    s->nodes[FLOOR_NODE].mesh = s->nodes[MORPHED_NODE].mesh = SCENE_NONE;
    render_settings settings = settings_small();
    settings.width = settings.height = MOTION_SIZE;
    renderer *r = renderer_of(device, &s->data, settings);
    r->exports[r->export_count++] = "motion";
    r->exports[r->export_count++] = "depth";
    r->camera = (render_camera){
        .eye = {0, 0, 4}, .target = {0, 0, 0}, .up = {0, 1, 0}, .yfov = 2 * atanf(0.5f), .near_plane = 0.01f};
    float *right = matrix_of(r, FIRST_JOINT + 1);
    CHECK(renderer_frame(r)); // nothing was before
    motion_read(r, now);
    check_motion(r, now, 0, 0, 0);
    right[12] += 0.25f;
    CHECK(renderer_frame(r));
    motion_read(r, now);
    check_motion(r, now, 0.25f, 0.25f, 0);
    right[12] += 0.125f;
    right[13] += 0.25f;
    CHECK(renderer_frame(r));
    motion_read(r, now);
    check_motion(r, now, 0.375f, 0.125f, 0.25f);
    CHECK(renderer_frame(r)); // stands still
    motion_read(r, now);
    check_motion(r, now, 0.375f, 0, 0);
    r->camera.eye[0] = r->camera.target[0] = 0.5f; // the camera moves alone: 0.5 m to the right
    CHECK(renderer_frame(r));
    motion_read(r, now);
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < MOTION_SIZE * MOTION_SIZE; i++)
        wrong += now[i].drawn && (fabsf(now[i].x - 8) > 0.01f || fabsf(now[i].y) > 0.01f);
    CHECK(wrong == 0);
    renderer_destroy(r);
    scene_free(s);
}

// ---- Rays

typedef struct nearest {
    double distance; // INFINITY: nothing
    uint32_t mesh, triangle;
} nearest;

static vector corner_of(const renderer *r, const vertices *v, uint32_t instance, uint32_t triangle, uint32_t corner)
{
    const mesh_instance_gpu *at = &r->gpu_world->instance_data[instance];
    const mesh_primitive *p = &r->scene->primitives[at->first_primitive];
    const float *from = v->positions[p->first_vertex + r->scene->indices[p->first_index + 3 * triangle + corner]];
    vector out;
    for (int row = 0; row < 3; row++) {
        out.x[row] = (double)at->world[row][3];
        for (int k = 0; k < 3; k++)
            out.x[row] += (double)at->world[row][k] * (double)from[k];
    }
    return out;
}

static vector difference(vector a, vector b)
{
    return (vector){{a.x[0] - b.x[0], a.x[1] - b.x[1], a.x[2] - b.x[2]}};
}

static vector cross(vector a, vector b)
{
    return (vector){
        {a.x[1] * b.x[2] - a.x[2] * b.x[1], a.x[2] * b.x[0] - a.x[0] * b.x[2], a.x[0] * b.x[1] - a.x[1] * b.x[0]}};
}

// Along the ray; INFINITY: not hit. `edge` becomes the least barycentric coordinate, negative outside.
static double triangle_distance(vector origin, vector direction, const vector corners[3], double *edge)
{
    const vector e1 = difference(corners[1], corners[0]), e2 = difference(corners[2], corners[0]);
    const vector p = cross(direction, e2), t = difference(origin, corners[0]), q = cross(t, e1);
    const double determinant = dot(e1, p), u = dot(t, p) / determinant, v = dot(direction, q) / determinant;
    *edge = fmin(fmin(u, v), 1 - u - v);
    const double along = dot(e2, q) / determinant;
    return *edge >= 0 && along > 0 ? along : INFINITY;
}

// By trying every triangle. `clear` becomes false where rounding may choose otherwise: the ray passes a border closely.
static nearest nearest_by_force(const renderer *r, const vertices *v, const ray *ray, bool *clear)
{
    nearest best = {.distance = INFINITY};
    const vector origin = {{(double)ray->origin[0], (double)ray->origin[1], (double)ray->origin[2]}};
    const vector direction = {{(double)ray->direction[0], (double)ray->direction[1], (double)ray->direction[2]}};
    *clear = true;
    for (uint32_t i = 0; i < r->gpu_world->instance_count; i++) {
        const uint32_t mesh = r->gpu_world->instance_data[i].mesh;
        const uint32_t count = r->scene->primitives[mesh].index_count / 3; // of its only primitive
        for (uint32_t t = 0; t < count; t++) {
            vector corners[3];
            for (uint32_t k = 0; k < 3; k++)
                corners[k] = corner_of(r, v, i, t, k);
            double edge;
            const double along = triangle_distance(origin, direction, corners, &edge);
            *clear &= fabs(edge) > 1e-4;
            if (along < best.distance)
                best = (nearest){along, mesh, t};
        }
    }
    return best;
}

static uint32_t rays_make(ray *rays, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        float square = 0;
        for (int k = 0; k < 3; k++) {
            rays[i].origin[k] = 3 * random_signed();
            rays[i].direction[k] = 0.5f * random_signed() - rays[i].origin[k]; // towards the grids
            square += rays[i].direction[k] * rays[i].direction[k];
        }
        for (int k = 0; k < 3; k++)
            rays[i].direction[k] /= sqrtf(square);
        rays[i].reach = 1e30f;
    }
    return count;
}

static void check_rays(renderer *r, uint32_t tracer, const ray *rays, uint32_t count, uint32_t *deforming)
{
    answers a = trace(r, tracer, rays, count);
    vertices v = vertices_read(r);
    uint32_t wrong = 0, unclear = 0;
    for (uint32_t i = 0; i < count; i++) {
        bool clear;
        const nearest expected = nearest_by_force(r, &v, &rays[i], &clear);
        unclear += !clear;
        const ray_hit *hit = &a.hits[i];
        if (!clear)
            continue;
        const bool found = hit->instance != RAY_MISS;
        wrong += found != isfinite(expected.distance) || a.visible[i] == found ||
                 (found && (r->gpu_world->instance_data[hit->instance].mesh != expected.mesh ||
                            hit->triangle != expected.triangle));
        *deforming += found && expected.mesh != 0;
    }
    CHECK(wrong == 0 && unclear < count / 4);
    vertices_free(&v);
    answers_free(&a);
}

TEST(every_tracer_hits_the_deformed_triangles)
{
    enum { RAYS = 300, FRAMES = 24 };
    static const uint32_t tracers[] = {RAYS_QUERY, RAYS_PIPELINE, RAYS_EMBREE};
    deform_scene *s = scene_create((grid_desc){.cells = 10, .influences = 2});
    renderer *r = renderer_of(device, &s->data, settings_small());
    batch_add(r);
    ray *rays = memory_alloc(RAYS * sizeof *rays);
    uint32_t deforming = 0;
    for (uint32_t frame = 0; frame < FRAMES; frame++) {
        pose_set(r, 0.5f * (float)frame, 0.2f);
        const bool far = frame % 8 >= 6; // and back again
        matrix_of(r, FIRST_JOINT + 1)[12] = far ? 5 + 3 * (float)(frame % 8) : 0.25f;
        check_rays(r, tracers[frame % 3], rays, rays_make(rays, RAYS), &deforming);
        CHECK(r->gpu_world->deformations[0].stretched == far);
    }
    for (uint32_t i = 0; i < 3; i++) // standing still
        check_rays(r, tracers[i], rays, rays_make(rays, RAYS), &deforming);
    CHECK(deforming > RAYS * FRAMES / 4);
    free(rays);
    renderer_destroy(r);
    scene_free(s);
}

// ---- Light paths

static void check_paths(uint32_t rays, bool is_light)
{
    deform_scene *s = scene_create((grid_desc){.cells = 8, .influences = 4, .is_light = is_light});
    render_settings settings = render_settings_default();
    settings.width = settings.height = 16;
    settings.vpls = 3000;
    settings.rays = rays;
    renderer *both[2];
    for (int i = 0; i < 2; i++) {
        settings.incremental = i == 0;
        both[i] = renderer_of(devices[i], &s->data, settings);
        both[i]->exports[both[i]->export_count++] = "vpls";
    }
    const size_t size = settings.vpls * sizeof(vpl);
    vpl *made[2] = {memory_alloc(size), memory_alloc(size)};
    uint32_t some = 0, none = 0, differ = 0;
    vpl *last = memory_alloc(size);
    for (uint32_t frame = 0; frame < 12; frame++) {
        for (int i = 0; i < 2; i++) {
            if (frame % 4 != 3) // only a part of the scene moves: its bounds are the floor's
                for (uint32_t t = 0; t < TARGETS; t++)
                    weights_of(both[i], SKINNED_NODE)[t] = sinf((float)(frame + t));
            CHECK(renderer_frame(both[i]));
            CHECK(gpu_buffer_read(devices[i], frame_graph_find_buffer(both[i]->graph, "vpls"), 0, made[i], size));
        }
        CHECK(memcmp(made[0], made[1], size) == 0);
        some += vpl_trace_change(both[0]) == VPLS_SOME;
        none += vpl_trace_change(both[0]) == VPLS_NONE;
        differ += frame > 0 && memcmp(made[0], last, size) != 0;
        memcpy(last, made[0], size);
    }
    CHECK(none == 3 && differ == 8);
    CHECK(is_light || some == 8);
    for (int i = 0; i < 2; i++) {
        renderer_destroy(both[i]);
        free(made[i]);
    }
    free(last);
    scene_free(s);
}

TEST(light_paths_that_a_deforming_mesh_meets_are_traced_again)
{
    check_paths(RAYS_QUERY, false);
    check_paths(RAYS_AUTO, false);
    check_paths(RAYS_AUTO, true);
}

TEST(emissive_triangles_lie_on_the_deformed_ones)
{
    deform_scene *s = scene_create((grid_desc){.cells = 6, .influences = 8, .is_light = true});
    renderer *r = renderer_of(device, &s->data, settings_small());
    for (uint32_t frame = 0; frame < 3; frame++) {
        pose_set(r, (float)frame, 1);
        CHECK(renderer_frame(r));
        CHECK(r->constants.emitter_count == s->primitives[1].index_count / 3);
        const emissive_triangle *emitters = gpu_buffer_map(device, r->gpu_world->emitters);
        double worst = 0;
        vertex_pose *expected = pose_expected(r, &s->deformations[0]);
        for (uint32_t i = 0; i < r->constants.emitter_count; i++)
            for (uint32_t k = 0; k < 3; k++) {
                const float *edges[3] = {(float[3]){0}, emitters[i].edge1, emitters[i].edge2};
                float corner[3];
                for (int axis = 0; axis < 3; axis++)
                    corner[axis] = emitters[i].corner[axis] + edges[k][axis];
                const uint32_t vertex = s->data.indices[6 + 3 * emitters[i].triangle + k];
                worst = fmax(worst, distance(corner, expected[vertex].position));
            }
        CHECK(worst < 1e-5);
        free(expected);
    }
    renderer_destroy(r);
    scene_free(s);
}

// ---- Models

// Of each channel the last key up to `time`, in seconds.
static void clip_pose(renderer *r, const scene_animation *clip, float time)
{
    const scene_data *s = r->scene;
    scene_node *nodes = memory_alloc(s->node_count * sizeof *nodes);
    memcpy(nodes, s->nodes, s->node_count * sizeof *nodes);
    for (uint32_t i = 0; i < clip->channel_count; i++) {
        const scene_channel *c = &clip->channels[i];
        uint32_t key = 0;
        while (key + 1 < c->key_count && c->times[key + 1] <= time)
            key++;
        const float *value = c->values + (c->interpolation == SCENE_CUBIC ? 3 * key + 1 : key) * c->width;
        if (c->target > SCENE_WEIGHTS)
            continue;
        scene_node *node = &nodes[c->index];
        float *const to[] = {[SCENE_TRANSLATION] = node->translation,
                             [SCENE_ROTATION] = node->rotation,
                             [SCENE_SCALE] = node->scale,
                             [SCENE_WEIGHTS] = c->target == SCENE_WEIGHTS ? weights_of(r, c->index) : NULL};
        memcpy(to[c->target], value, c->width * sizeof(float));
        if (c->target != SCENE_WEIGHTS)
            scene_matrix_compose(node->translation, node->rotation, node->scale, matrix_of(r, c->index));
    }
    free(nodes);
}

static void picture_write(renderer *r, const char *model, uint32_t number)
{
    const uint32_t width = r->settings.width, height = r->settings.height;
    uint8_t *texels = memory_alloc(4 * width * height);
    CHECK(gpu_image_read(r->gpu, frame_graph_find_image(r->graph, "display"), VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
                         texels, 4 * width * height));
    char path[256];
    snprintf(path, sizeof path, BUILD_DIR "/deform_%s_%u.png", model, number);
    CHECK(image_write_png(path, texels, width, height, 4));
    free(texels);
}

static void check_model(const char *model)
{
    char path[256];
    snprintf(path, sizeof path, "../shared/scenes/animated/%s/%s.gltf", model, model);
    if (access(path, R_OK) != 0) {
        printf("  skipped: no %s\n", path);
        return;
    }
    scene_data *scene = scene_load(path);
    CHECK(scene && scene->deformation_count > 0);
    render_settings settings = render_settings_default();
    settings.width = settings.height = 240;
    settings.vpls = 3000;
    renderer *r = renderer_of(device, scene, settings);
    world_sun_add(r, (float[3]){-0.5f, -1, -0.6f}, 10);
    const float diagonal[3] = {scene->bounds_max[0] - scene->bounds_min[0], scene->bounds_max[1] - scene->bounds_min[1],
                               scene->bounds_max[2] - scene->bounds_min[2]};
    static const float times[] = {0, 0.3f, 1}; // of the clip's duration
    uint32_t changes = 0;
    for (uint32_t i = 0; i < countof(times); i++) {
        clip_pose(r, &scene->animations[0], times[i] * scene->animations[0].duration);
        CHECK(renderer_frame(r));
        changes += i > 0 && pass_ran(r, "deform");
        check_vertices(r, fmax(1, (double)(diagonal[0] + diagonal[1] + diagonal[2])));
        CHECK(!r->gpu_world->deformations[0].stretched);
        picture_write(r, model, i);
    }
    CHECK(changes > 0);
    renderer_destroy(r);
    scene_destroy(scene);
}

TEST(models_take_the_poses_of_their_clips)
{
    static const char *const models[] = {"CesiumMan",      "Fox", "RiggedFigure", "RiggedSimple", "AnimatedMorphCube",
                                         "MorphStressTest"};
    for (size_t i = 0; i < countof(models); i++)
        check_model(models[i]);
}

TEST(the_validation_layer_has_nothing_to_say)
{
    for (int i = 0; i < 2; i++)
        CHECK(gpu_validation_messages(devices[i]) == 0);
}

// ---- Bench

enum { BENCH_RAYS = 200000, BENCH_FRAMES = 24 };

// From around the scene to its deformed meshes.
static void bench_rays_make(const renderer *r, ray *rays)
{
    const box *b = &r->gpu_world->deformations[0].box;
    for (uint32_t i = 0; i < BENCH_RAYS; i++) {
        float size = 0, length = 0;
        for (int k = 0; k < 3; k++)
            size += b->max[k] - b->min[k];
        for (int k = 0; k < 3; k++) {
            const float to = b->min[k] + random_unit() * (b->max[k] - b->min[k]);
            rays[i].origin[k] = 0.5f * (b->min[k] + b->max[k]) + size * random_signed();
            rays[i].direction[k] = to - rays[i].origin[k];
            length += rays[i].direction[k] * rays[i].direction[k];
        }
        for (int k = 0; k < 3; k++)
            rays[i].direction[k] /= sqrtf(length);
        rays[i].reach = 1e30f;
    }
}

static int double_compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double pass_time(const renderer *r, const char *name)
{
    uint32_t count;
    const frame_graph_timing *timings = frame_graph_timings(r->graph, &count);
    for (uint32_t i = 0; i < count; i++)
        if (strcmp(timings[i].name, name) == 0)
            return timings[i].milliseconds;
    return 0;
}

static double median(double times[BENCH_FRAMES])
{
    qsort(times, BENCH_FRAMES, sizeof *times, double_compare);
    return times[BENCH_FRAMES / 2];
}

// Medians over the frames of a clip, or of poses of the grid where there is none.
static void bench(const char *name, const scene_data *scene)
{
    static const char *const passes[] = {"deform", "acceleration/update", "acceleration", "rays/scene", "near/trace"};
    static const uint32_t tracers[] = {RAYS_QUERY, RAYS_EMBREE};
    renderer *r = renderer_of(device, scene, settings_small());
    batch_add(r);
    ray *rays = memory_alloc(BENCH_RAYS * sizeof *rays);
    for (size_t t = 0; t < countof(tracers); t++) {
        double times[countof(passes)][BENCH_FRAMES];
        uint32_t stretched = 0;
        for (uint32_t frame = 0; frame < BENCH_FRAMES; frame++) {
            if (scene->animation_count > 0)
                clip_pose(r, &scene->animations[0], (float)frame / BENCH_FRAMES * scene->animations[0].duration);
            else
                pose_set(r, 0.3f * (float)frame, 0.5f);
            random_state = 1;
            bench_rays_make(r, rays);
            answers a = trace(r, tracers[t], rays, BENCH_RAYS);
            answers_free(&a);
            for (size_t p = 0; p < countof(passes); p++)
                times[p][frame] = pass_time(r, passes[p]);
            stretched += r->gpu_world->deformations[0].stretched;
        }
        printf("%-12s %s, %2u of %u poses stretched:", name, tracers[t] == RAYS_QUERY ? "query " : "embree", stretched,
               BENCH_FRAMES);
        for (size_t p = 0; p < countof(passes); p++)
            printf(" %s %.2f", passes[p], median(times[p]));
        printf(" ms\n");
    }
    free(rays);
    renderer_destroy(r);
}

static int bench_all(void)
{
    static const char *const models[] = {"CesiumMan", "Fox"};
    devices[0] = gpu_create(&(gpu_desc){0});
    for (size_t i = 0; i < countof(models); i++) {
        char path[256];
        snprintf(path, sizeof path, "../shared/scenes/animated/%s/%s.gltf", models[i], models[i]);
        scene_data *scene = scene_load(path);
        if (scene)
            bench(models[i], scene);
        scene_destroy(scene);
    }
    deform_scene *s = scene_create((grid_desc){.cells = 224, .influences = 2});
    s->data.deformation_count = 1;
    s->nodes[MORPHED_NODE].mesh = SCENE_NONE;
    bench("100K grid", &s->data);
    scene_free(s);
    gpu_destroy(device);
    return EXIT_SUCCESS;
}

int main(int argc, char **argv)
{
    if (argc > 1 && strcmp(argv[1], "bench") == 0)
        return bench_all();
    for (int i = 0; i < 2; i++)
        devices[i] = gpu_create(&(gpu_desc){.validation = true});
    if (!devices[0] || !devices[1]) {
        printf("skipped: no usable device\n");
        return 77;
    }
    RUN(vertices_are_what_joints_and_targets_make_of_them);
    RUN(a_still_pose_is_deformed_once);
    RUN(morph_targets_without_weight_leave_the_vertices_alone);
    RUN(motion_vectors_follow_the_vertices);
    RUN(every_tracer_hits_the_deformed_triangles);
    RUN(light_paths_that_a_deforming_mesh_meets_are_traced_again);
    RUN(emissive_triangles_lie_on_the_deformed_ones);
    RUN(models_take_the_poses_of_their_clips);
    RUN(the_validation_layer_has_nothing_to_say);
    for (int i = 0; i < 2; i++)
        gpu_destroy(devices[i]);
    return test_end();
}
