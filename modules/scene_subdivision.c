// Control cages: from a mesh's triangles to a cage (welded vertices, quads recovered), and from its levels back to
// meshes of the scene. The rules are in scene.h.
#include "gltf.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

// Of all levels of a scene's subdivided meshes, so that a small file cannot ask for all memory.
static const uint64_t SCENE_TRIANGLES_MAX = 1u << 22;
static const float QUAD_COSINE = 0.8660254f; // 30 degrees
enum { MESSAGE_SIZE = 256 };

// ---- Numbers for keys: equal keys have the same one, in order of first appearance

enum { KEY_WORDS_MAX = 7 };
typedef struct key_table {
    uint32_t words, count;
    uint32_t *keys; // [limit][words]
    uint32_t *slots; // number plus one; 0: free
    uint32_t slot_count; // a power of two, at least twice the limit
} key_table;

static key_table key_table_make(uint32_t words, uint32_t limit)
{
    key_table table = {.words = words, .slot_count = 2};
    while (table.slot_count < 2 * limit) {
        table.slot_count *= 2;
    }
    table.keys = memory_alloc((size_t)max_u32(limit, 1) * words * sizeof(uint32_t));
    table.slots = memory_alloc(table.slot_count * sizeof(uint32_t));
    return table;
}

static void key_table_free(key_table *table)
{
    free(table->keys);
    free(table->slots);
}

// The slot that has the key, or else the free one where it belongs.
static uint32_t *key_slot(const key_table *table, const uint32_t *key)
{
    uint32_t hash = 2166136261u; // FNV-1a over words, with its high bits mixed down
    for (uint32_t i = 0; i < table->words; i++) {
        hash = (hash ^ key[i]) * 16777619u;
        hash ^= hash >> 15;
    }
    for (uint32_t i = hash;; i++) {
        uint32_t *const slot = &table->slots[i & (table->slot_count - 1)];
        if (*slot == 0 ||
            memcmp(table->keys + (size_t)(*slot - 1) * table->words, key, table->words * sizeof(*key)) == 0) {
            return slot;
        }
    }
}

static uint32_t key_number(key_table *table, const uint32_t *key)
{
    uint32_t *const slot = key_slot(table, key);
    if (*slot == 0) {
        memcpy(table->keys + (size_t)table->count * table->words, key, table->words * sizeof(*key));
        *slot = ++table->count;
    }
    return *slot - 1;
}

static uint32_t key_find(const key_table *table, const uint32_t *key)
{
    const uint32_t slot = *key_slot(table, key);
    return slot == 0 ? (uint32_t)SCENE_NONE : slot - 1;
}

// Zeros of both signs have the same key.
static void floats_key(const float *floats, uint32_t count, uint32_t *key)
{
    for (uint32_t i = 0; i < count; i++) {
        const float value = floats[i] + 0.0f;
        memcpy(&key[i], &value, sizeof(value));
    }
}

// ---- The cage of a mesh

typedef struct cage_builder {
    const scene_data *scene;
    const scene_mesh *mesh;
    gltf_primitive *primitives; // the mesh's
    key_table vertices, values, edges; // edges: directed, each of one face
    uint32_t **value_of; // [primitive][vertex]
    float (*positions)[3]; // [vertices.count]
    float (*value_floats)[SUBDIVISION_VALUES]; // [values.count]
    uint32_t *face_sizes, *corners, *corner_values;
    uint32_t *face_primitives; // within the mesh
    uint32_t face_count, corner_count;
    subdivision_crease *creases;
    uint32_t crease_count;
    char reason[MESSAGE_SIZE]; // why there is no cage
} cage_builder;

static const float *vertex_position(const cage_builder *b, uint32_t vertex)
{
    return b->positions[vertex];
}

static uint32_t mesh_vertex_count(const cage_builder *b)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < b->mesh->primitive_count; i++) {
        count += b->primitives[i].vertex_count;
    }
    return count;
}

static uint32_t mesh_index_count(const cage_builder *b)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < b->mesh->primitive_count; i++) {
        count += b->primitives[i].index_count;
    }
    return count;
}

static void value_make(const vertex_attributes *from, float to[SUBDIVISION_VALUES])
{
    const float made[SUBDIVISION_VALUES] = {
        from->uv0[0],
        from->uv0[1],
        from->uv1[0],
        from->uv1[1],
        (float)(from->color_rg & 0xffff),
        (float)(from->color_rg >> 16),
        (float)(from->color_ba & 0xffff),
        (float)(from->color_ba >> 16),
    };
    memcpy(to, made, sizeof(made));
}

// Welds the primitive's vertices by position, and its face-varying values by vertex, coordinates and colour. The
// vertices' tags become those of the cage.
static void primitive_weld(cage_builder *b, uint32_t primitive)
{
    gltf_primitive *const p = &b->primitives[primitive];
    free(p->tags);
    p->tags = memory_alloc(p->vertex_count * sizeof(*p->tags));
    b->value_of[primitive] = memory_alloc(p->vertex_count * sizeof(uint32_t));
    for (uint32_t i = 0; i < p->vertex_count; i++) {
        uint32_t key[KEY_WORDS_MAX];
        floats_key(p->positions[i], 3, key);
        p->tags[i] = key_number(&b->vertices, key);
        memcpy(b->positions[p->tags[i]], p->positions[i], sizeof(*b->positions));

        const vertex_attributes *const attributes = &p->attributes[i];
        key[0] = p->tags[i];
        floats_key(attributes->uv0, 2, key + 1);
        floats_key(attributes->uv1, 2, key + 3);
        key[5] = attributes->color_rg;
        key[6] = attributes->color_ba;
        b->value_of[primitive][i] = key_number(&b->values, key);
        value_make(attributes, b->value_floats[b->value_of[primitive][i]]);
    }
}

static void mesh_weld(cage_builder *b)
{
    const uint32_t limit = mesh_vertex_count(b);
    b->vertices = key_table_make(3, limit);
    b->values = key_table_make(7, limit);
    b->positions = memory_alloc(max_u32(limit, 1) * sizeof(*b->positions));
    b->value_floats = memory_alloc(max_u32(limit, 1) * sizeof(*b->value_floats));
    b->value_of = memory_alloc(max_u32(b->mesh->primitive_count, 1) * sizeof(*b->value_of));
    for (uint32_t i = 0; i < b->mesh->primitive_count; i++) {
        primitive_weld(b, i);
    }
}

typedef struct cage_triangle {
    uint32_t vertices[3], values[3];
} cage_triangle;

static cage_triangle triangle_take(const cage_builder *b, uint32_t primitive, uint32_t first_index)
{
    cage_triangle t;
    for (int k = 0; k < 3; k++) {
        const uint32_t vertex = b->primitives[primitive].indices[first_index + (uint32_t)k];
        t.vertices[k] = b->primitives[primitive].tags[vertex];
        t.values[k] = b->value_of[primitive][vertex];
    }
    return t;
}

static float dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Twice the area long.
static void cross_of(const cage_builder *b, uint32_t v0, uint32_t v1, uint32_t v2, float out[3])
{
    const float *const p0 = vertex_position(b, v0), *const p1 = vertex_position(b, v1),
                       *const p2 = vertex_position(b, v2);
    const float e[3] = {p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]};
    const float f[3] = {p2[0] - p0[0], p2[1] - p0[1], p2[2] - p0[2]};
    out[0] = e[1] * f[2] - e[2] * f[1];
    out[1] = e[2] * f[0] - e[0] * f[2];
    out[2] = e[0] * f[1] - e[1] * f[0];
}

static float cosine_of(const float a[3], const float b[3])
{
    return dot(a, b) / (sqrtf(dot(a, a)) * sqrtf(dot(b, b)));
}

// Flat and convex enough, by the rule in scene.h; `quad` has the diagonal from [0] to [2].
static bool is_quad(const cage_builder *b, const uint32_t quad[4])
{
    float halves[2][3], mean[3];
    cross_of(b, quad[0], quad[1], quad[2], halves[0]);
    cross_of(b, quad[0], quad[2], quad[3], halves[1]);
    if (!(cosine_of(halves[0], halves[1]) >= QUAD_COSINE)) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        mean[k] = halves[0][k] + halves[1][k];
    }
    for (int i = 1; i < 4; i += 2) { // the halves along the other diagonal
        float other[3];
        cross_of(b, quad[i], quad[(i + 1) % 4], quad[(i + 2) % 4], other);
        if (!(dot(other, mean) > 0)) {
            return false;
        }
    }
    return true;
}

static bool quad_find(const cage_builder *b, const cage_triangle *s, const cage_triangle *t, uint32_t quad[4],
                      uint32_t values[4])
{
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            const int i1 = (i + 1) % 3, k1 = (k + 1) % 3;
            if (s->values[i] != t->values[k1] || s->values[i1] != t->values[k]) {
                continue; // equal values belong to equal vertices
            }
            const int corners[4] = {i1, (i + 2) % 3, i, (k + 2) % 3};
            for (int c = 0; c < 4; c++) {
                const cage_triangle *const from = c < 3 ? s : t;
                quad[c] = from->vertices[corners[c]];
                values[c] = from->values[corners[c]];
            }
            return is_quad(b, quad);
        }
    }
    return false;
}

static void face_add(cage_builder *b, uint32_t primitive, const uint32_t *vertices, const uint32_t *values,
                     uint32_t size)
{
    memcpy(b->corners + b->corner_count, vertices, size * sizeof(*vertices));
    memcpy(b->corner_values + b->corner_count, values, size * sizeof(*values));
    b->corner_count += size;
    b->face_sizes[b->face_count] = size;
    b->face_primitives[b->face_count++] = primitive;
}

static bool triangle_has_area(const cage_builder *b, const cage_triangle *t)
{
    float normal[3];
    cross_of(b, t->vertices[0], t->vertices[1], t->vertices[2], normal);
    return dot(normal, normal) >= FLT_MIN;
}

static bool primitive_faces(cage_builder *b, uint32_t primitive)
{
    const bool quads = b->mesh->subdivision_rules->scheme == SUBDIVISION_CATMARK;
    const uint32_t count = b->primitives[primitive].index_count;
    for (uint32_t i = 0; i < count; i += 3) {
        const cage_triangle t = triangle_take(b, primitive, i);
        if (!triangle_has_area(b, &t)) {
            snprintf(b->reason, MESSAGE_SIZE, "triangle %u of its primitive %u has no area", i / 3, primitive);
            return false;
        }
        uint32_t quad[4], values[4];
        if (quads && i + 3 < count) {
            const cage_triangle next = triangle_take(b, primitive, i + 3);
            if (quad_find(b, &t, &next, quad, values)) {
                face_add(b, primitive, quad, values, 4);
                i += 3;
                continue;
            }
        }
        face_add(b, primitive, t.vertices, t.values, 3);
    }
    return true;
}

static bool mesh_faces(cage_builder *b)
{
    const uint32_t limit = mesh_index_count(b);
    b->corners = memory_alloc(max_u32(limit, 1) * sizeof(*b->corners));
    b->corner_values = memory_alloc(max_u32(limit, 1) * sizeof(*b->corner_values));
    b->face_sizes = memory_alloc(max_u32(limit, 1) * sizeof(*b->face_sizes));
    b->face_primitives = memory_alloc(max_u32(limit, 1) * sizeof(*b->face_primitives));
    for (uint32_t i = 0; i < b->mesh->primitive_count; i++) {
        if (!primitive_faces(b, i)) {
            return false;
        }
    }
    if (b->face_count == 0) {
        snprintf(b->reason, MESSAGE_SIZE, "it has no triangles");
    }
    return b->face_count > 0;
}

// Where two faces share an edge they run along it in opposite directions; so no directed edge comes twice.
static bool mesh_edges(cage_builder *b)
{
    b->edges = key_table_make(2, b->corner_count);
    uint32_t first = 0;
    for (uint32_t f = 0; f < b->face_count; first += b->face_sizes[f++]) {
        for (uint32_t k = 0; k < b->face_sizes[f]; k++) {
            const uint32_t ends[2] = {b->corners[first + k], b->corners[first + (k + 1) % b->face_sizes[f]]};
            if (key_number(&b->edges, ends) != first + k) { // a new edge's number
                const float *const p = vertex_position(b, ends[0]), *const q = vertex_position(b, ends[1]);
                snprintf(b->reason, MESSAGE_SIZE,
                         "the edge from (%g, %g, %g) to (%g, %g, %g) has more than two faces, or two that do not face "
                         "the same way",
                         p[0], p[1], p[2], q[0], q[1], q[2]);
                return false;
            }
        }
    }
    return true;
}

static bool is_edge(const cage_builder *b, const uint32_t ends[2])
{
    const uint32_t reversed[2] = {ends[1], ends[0]};
    return key_find(&b->edges, ends) != SCENE_NONE || key_find(&b->edges, reversed) != SCENE_NONE;
}

static void mesh_label(const cage_builder *b, char label[MESSAGE_SIZE])
{
    snprintf(label, MESSAGE_SIZE, "mesh %u \"%.100s\"", (uint32_t)(b->mesh - b->scene->meshes), b->mesh->name);
}

static void mesh_creases(cage_builder *b, scene_data *scene)
{
    const scene_subdivision_rules *const rules = b->mesh->subdivision_rules;
    b->creases = memory_alloc(max_u32(rules->crease_count, 1) * sizeof(*b->creases));
    uint32_t lost = 0;
    for (uint32_t i = 0; i < rules->crease_count; i++) {
        subdivision_crease crease = {.sharpness = rules->creases[i].sharpness};
        for (int k = 0; k < 2; k++) {
            uint32_t key[3];
            floats_key(rules->creases[i].ends[k], 3, key);
            crease.vertices[k] = key_find(&b->vertices, key);
        }
        if (is_edge(b, crease.vertices)) {
            b->creases[b->crease_count++] = crease;
        } else {
            lost++;
        }
    }
    if (lost > 0) {
        char label[MESSAGE_SIZE];
        mesh_label(b, label);
        scene_warning(scene, "%s: %u of its creases are left out: their ends are not those of an edge of the cage",
                      label, lost);
    }
}

static void cage_builder_free(cage_builder *b)
{
    for (uint32_t i = 0; b->value_of && i < b->mesh->primitive_count; i++) {
        free(b->value_of[i]);
    }
    free(b->value_of);
    free(b->positions);
    free(b->value_floats);
    free(b->face_sizes);
    free(b->corners);
    free(b->corner_values);
    free(b->face_primitives);
    free(b->creases);
    key_table_free(&b->vertices);
    key_table_free(&b->values);
    key_table_free(&b->edges);
}

static float edge_length(const cage_builder *b)
{
    double sum = 0;
    for (uint32_t i = 0; i < b->edges.count; i++) {
        const float *const p = vertex_position(b, b->edges.keys[2 * i]);
        const float *const q = vertex_position(b, b->edges.keys[2 * i + 1]);
        for (int k = 0; k < 3; k++) {
            sum += ((double)q[k] - p[k]) * ((double)q[k] - p[k]);
        }
    }
    return (float)sqrt(sum / b->edges.count);
}

// ---- The levels as meshes

typedef struct limit_point { // of a stencil, at rest
    float position[3], normal[3];
} limit_point;

static limit_point *limit_points(const subdivision_stencils *stencils, const float (*cage)[3])
{
    limit_point *const points = memory_alloc(stencils->count * sizeof(*points));
    for (uint32_t i = 0; i < stencils->count; i++) {
        float v[3][3];
        subdivision_evaluate(stencils, i, cage, v);
        memcpy(points[i].position, v[0], sizeof(v[0]));
        for (int k = 0; k < 3; k++) {
            points[i].normal[k] = v[1][(k + 1) % 3] * v[2][(k + 2) % 3] - v[1][(k + 2) % 3] * v[2][(k + 1) % 3];
        }
    }
    return points;
}

static uint32_t unorm16_of(float value)
{
    return (uint32_t)(fminf(fmaxf(value, 0), 65535) + 0.5f);
}

static vertex_attributes attributes_make(const float value[SUBDIVISION_VALUES], const float normal[3])
{
    return (vertex_attributes){
        .normal = {normal[0], normal[1], normal[2]},
        .uv0 = {value[0], value[1]},
        .uv1 = {value[2], value[3]},
        .color_rg = unorm16_of(value[4]) | unorm16_of(value[5]) << 16,
        .color_ba = unorm16_of(value[6]) | unorm16_of(value[7]) << 16,
    };
}

// The level's triangles that come from primitive `which` of the cage's mesh.
static gltf_primitive level_primitive(const cage_builder *b, const subdivision *s, const subdivision_level *level,
                                      const limit_point *points, uint32_t which)
{
    uint32_t triangles = 0;
    for (uint32_t i = 0; i < level->triangle_count; i++) {
        triangles += b->face_primitives[level->faces[i]] == which;
    }
    const uint32_t vertices = min_u32(level->vertex_count, 3 * triangles);
    gltf_primitive out = {
        .positions = memory_alloc(vertices * sizeof(*out.positions)),
        .attributes = memory_alloc(vertices * sizeof(*out.attributes)),
        .indices = memory_alloc(3 * (size_t)triangles * sizeof(*out.indices)),
        .tags = memory_alloc(vertices * sizeof(*out.tags)),
        .has_normals = true,
    };
    uint32_t *const number_of = memory_alloc(level->vertex_count * sizeof(*number_of)); // plus one
    for (uint32_t i = 0; i < 3 * level->triangle_count; i++) {
        if (b->face_primitives[level->faces[i / 3]] != which) {
            continue;
        }
        uint32_t *const number = &number_of[level->indices[i]];
        if (*number == 0) {
            const subdivision_corner *const corner = &level->vertices[level->indices[i]];
            const uint32_t to = out.vertex_count++;
            memcpy(out.positions[to], points[corner->stencil].position, sizeof(*out.positions));
            out.attributes[to] = attributes_make(s->values[corner->value], points[corner->stencil].normal);
            out.tags[to] = corner->stencil;
            *number = out.vertex_count;
        }
        out.indices[out.index_count++] = *number - 1;
    }
    free(number_of);
    return out;
}

// What grows while meshes are added.
typedef struct scene_growth {
    scene_data *scene;
    gltf_primitive *primitives;
    size_t primitive_capacity, out_capacity;
    mesh_primitive *out; // becomes the scene's
    uint64_t triangles_left;
} scene_growth;

static uint32_t level_mesh_add(scene_growth *g, const cage_builder *b, const subdivision *s, uint32_t level,
                               const limit_point *points)
{
    scene_data *const scene = g->scene;
    const scene_mesh cage = *b->mesh;
    const uint32_t first = scene->primitive_count, mesh = scene->mesh_count++;
    memory_reserve((void **)&g->primitives, &g->primitive_capacity, first + cage.primitive_count,
                   sizeof(*g->primitives));
    memory_reserve((void **)&g->out, &g->out_capacity, first + cage.primitive_count, sizeof(*g->out));
    for (uint32_t i = 0; i < cage.primitive_count; i++) {
        g->primitives[first + i] = level_primitive(b, s, &s->levels[level - 1], points, i);
        g->out[first + i] = (mesh_primitive){.material = g->out[cage.first_primitive + i].material};
    }
    scene->primitive_count += cage.primitive_count;
    scene->meshes[mesh] = (scene_mesh){
        .name = arena_printf(&scene->arena, "%s, level %u", cage.name, level),
        .first_primitive = first,
        .primitive_count = cage.primitive_count,
        .deformation = SCENE_NONE,
    };
    return mesh;
}

static void levels_add(scene_growth *g, const cage_builder *b, const subdivision *s, uint32_t level_count)
{
    scene_data *const scene = g->scene;
    limit_point *const points = limit_points(&s->stencils, b->positions);
    scene_subdivision *const out = &scene->subdivisions[scene->subdivision_count++];
    *out = (scene_subdivision){
        .mesh = (uint32_t)(b->mesh - scene->meshes),
        .stencils = s->stencils,
        .level_count = level_count,
        .edge_length = edge_length(b),
    };
    for (uint32_t level = 1; level <= level_count; level++) {
        out->levels[level - 1].mesh = level_mesh_add(g, b, s, level, points);
    }
    free(points);
}

// The finest level that the limits allow; `cage->max_level` follows. 0: none.
static uint32_t cage_level_fit(subdivision_cage *cage, uint64_t triangles_left)
{
    uint64_t limit = SUBDIVISION_TRIANGLES_MAX;
    limit = limit < triangles_left ? limit : triangles_left;
    while (cage->max_level > 0 && subdivision_triangles(cage, cage->max_level) > limit) {
        cage->max_level--;
    }
    return cage->max_level;
}

static bool cage_refine(cage_builder *b, scene_growth *g, const char *label)
{
    const scene_subdivision_rules *const rules = b->mesh->subdivision_rules;
    subdivision_cage cage = {
        .scheme = rules->scheme,
        .boundary = rules->boundary,
        .max_level = rules->max_level,
        .vertex_count = b->vertices.count,
        .face_count = b->face_count,
        .face_sizes = b->face_sizes,
        .corners = b->corners,
        .corner_values = b->corner_values,
        .values = b->value_floats,
        .value_count = b->values.count,
        .creases = b->creases,
        .crease_count = b->crease_count,
    };
    const uint32_t level = cage_level_fit(&cage, g->triangles_left);
    if (level == 0) {
        snprintf(b->reason, MESSAGE_SIZE, "already its first level has too many triangles");
        return false;
    }
    if (level < rules->max_level) {
        scene_warning(g->scene, "%s is subdivided to level %u instead of %u: it would have too many triangles", label,
                      level, rules->max_level);
    }
    subdivision refined;
    if (!subdivision_refine(&cage, &g->scene->arena, &refined, b->reason)) {
        return false;
    }
    g->triangles_left -= subdivision_triangles(&cage, level);
    levels_add(g, b, &refined, level);
    return true;
}

static void mesh_subdivide(scene_growth *g, uint32_t mesh)
{
    scene_data *const scene = g->scene;
    cage_builder b = {.scene = scene,
                      .mesh = &scene->meshes[mesh],
                      .primitives = g->primitives + scene->meshes[mesh].first_primitive};
    char label[MESSAGE_SIZE];
    mesh_label(&b, label);
    mesh_weld(&b);
    bool ok = mesh_faces(&b) && mesh_edges(&b);
    if (ok) {
        mesh_creases(&b, scene);
        ok = cage_refine(&b, g, label);
    }
    if (!ok) {
        scene_warning(scene, "%s cannot be subdivided and is drawn as it is: %s", label, b.reason);
    }
    cage_builder_free(&b);
}

void scene_subdivide(scene_data *scene, gltf_primitive **primitives)
{
    uint32_t cages = 0;
    for (uint32_t i = 0; i < scene->mesh_count; i++) {
        cages += scene->meshes[i].subdivision_rules != NULL;
    }
    if (cages == 0) {
        return;
    }
    const uint32_t mesh_count = scene->mesh_count;
    scene_mesh *const meshes =
        arena_alloc(&scene->arena, (mesh_count + cages * SUBDIVISION_LEVELS_MAX) * sizeof(*meshes));
    memcpy(meshes, scene->meshes, mesh_count * sizeof(*meshes));
    scene->meshes = meshes;
    scene->subdivisions = arena_alloc(&scene->arena, cages * sizeof(*scene->subdivisions));

    scene_growth g = {.scene = scene, .primitives = *primitives, .triangles_left = SCENE_TRIANGLES_MAX};
    g.primitive_capacity = scene->primitive_count;
    memory_reserve((void **)&g.out, &g.out_capacity, scene->primitive_count, sizeof(*g.out));
    memcpy(g.out, scene->primitives, scene->primitive_count * sizeof(*g.out));
    for (uint32_t i = 0; i < mesh_count; i++) {
        if (meshes[i].subdivision_rules) {
            mesh_subdivide(&g, i);
        }
    }
    scene->primitives = arena_alloc(&scene->arena, scene->primitive_count * sizeof(*scene->primitives));
    memcpy(scene->primitives, g.out, scene->primitive_count * sizeof(*scene->primitives));
    free(g.out);
    *primitives = g.primitives;
}

// ---- After the scene is laid out

static void mesh_range(const scene_data *scene, uint32_t mesh, uint32_t *first_vertex, uint32_t *vertex_count)
{
    const scene_mesh *const m = &scene->meshes[mesh];
    *first_vertex = scene->primitives[m->first_primitive].first_vertex;
    *vertex_count = 0;
    for (uint32_t i = 0; i < m->primitive_count; i++) {
        *vertex_count += scene->primitives[m->first_primitive + i].vertex_count;
    }
}

// Entries name vertices of the cage; from here on, those of its mesh at the same places.
static void stencils_follow(const scene_data *scene, const gltf_primitive *primitives, scene_subdivision *s)
{
    const scene_mesh *const mesh = &scene->meshes[s->mesh];
    uint32_t vertex_count;
    mesh_range(scene, s->mesh, &s->first_vertex, &vertex_count);
    uint32_t *const source_of = memory_alloc(max_u32(vertex_count, 1) * sizeof(*source_of)); // by cage vertex
    for (uint32_t i = mesh->first_primitive; i < mesh->first_primitive + mesh->primitive_count; i++) {
        for (uint32_t k = 0; k < primitives[i].vertex_count; k++) {
            source_of[primitives[i].tags[k]] = scene->primitives[i].first_vertex + k - s->first_vertex;
        }
    }
    for (uint32_t i = 0; i < s->stencils.offsets[s->stencils.count]; i++) {
        s->stencils.entries[i].vertex = source_of[s->stencils.entries[i].vertex];
    }
    free(source_of);
}

// The tangent in the basis of the stencil's two tangents at rest: with these it follows the cage.
static void tangent_solve(const float tangents[2][3], const float tangent[4], float out[2])
{
    const float a = dot(tangents[0], tangents[0]), b = dot(tangents[0], tangents[1]), c = dot(tangents[1], tangents[1]);
    const float x = dot(tangents[0], tangent), y = dot(tangents[1], tangent);
    const float determinant = a * c - b * b;
    const bool usable = tangent[3] != 0 && determinant > 1e-6f * a * c;
    out[0] = usable ? (c * x - b * y) / determinant : 0;
    out[1] = usable ? (a * y - b * x) / determinant : 0;
}

static void level_finish(scene_data *scene, const gltf_primitive *primitives, const scene_subdivision *s,
                         scene_subdivision_level *level)
{
    const scene_mesh *const mesh = &scene->meshes[level->mesh];
    mesh_range(scene, level->mesh, &level->first_vertex, &level->vertex_count);
    subdivision_vertex *const vertices = arena_alloc(&scene->arena, level->vertex_count * sizeof(*vertices));
    level->vertices = vertices;
    for (uint32_t i = mesh->first_primitive, to = 0; i < mesh->first_primitive + mesh->primitive_count; i++) {
        for (uint32_t k = 0; k < primitives[i].vertex_count; k++, to++) {
            float v[3][3];
            vertices[to].stencil = primitives[i].tags[k];
            subdivision_evaluate(&s->stencils, vertices[to].stencil, scene->positions + s->first_vertex, v);
            tangent_solve(v + 1, scene->attributes[level->first_vertex + to].tangent, vertices[to].tangent);
        }
    }
}

// Where the cage deforms, its levels do.
static void levels_deform(scene_data *scene, const scene_subdivision *s)
{
    const uint32_t cage = scene->meshes[s->mesh].deformation;
    for (uint32_t level = 1; cage != SCENE_NONE && level <= s->level_count; level++) {
        const scene_subdivision_level *const to = &s->levels[level - 1];
        scene->meshes[to->mesh].deformation = scene->deformation_count;
        scene->deformations[scene->deformation_count++] = (scene_deformation){
            .mesh = to->mesh,
            .node = scene->deformations[cage].node,
            .first_vertex = to->first_vertex,
            .vertex_count = to->vertex_count,
            .skin = scene->deformations[cage].skin,
            .subdivision = s,
            .level = level,
            .cage = cage,
        };
    }
}

void scene_subdivisions_finish(scene_data *scene, const gltf_primitive *primitives)
{
    const uint32_t limit = scene->deformation_count + scene->subdivision_count * SUBDIVISION_LEVELS_MAX;
    scene_deformation *const deformations = arena_alloc(&scene->arena, limit * sizeof(*deformations));
    for (uint32_t i = 0; i < scene->deformation_count; i++) {
        deformations[i] = scene->deformations[i];
    }
    scene->deformations = deformations;
    for (uint32_t i = 0; i < scene->subdivision_count; i++) {
        scene_subdivision *const s = &scene->subdivisions[i];
        stencils_follow(scene, primitives, s);
        for (uint32_t level = 0; level < s->level_count; level++) {
            level_finish(scene, primitives, s, &s->levels[level]);
        }
        levels_deform(scene, s);
    }
}
