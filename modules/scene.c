// A scene's way from import to use: triangles and normals are repaired, triangles ordered for the driver's BVH builder,
// and everything counted and bounded.
#include "scene.h"
#include "gltf.h"

#include <float.h>
#include <math.h>
#include <meshoptimizer.h>
#include <stdlib.h>
#include <string.h>

// ---- Vectors

static void subtract(const float a[3], const float b[3], float out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = a[i] - b[i];
    }
}

static float dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const float a[3], const float b[3], float out[3])
{
    const float result[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    memcpy(out, result, sizeof(result));
}

static void add_scaled(float out[3], const float v[3], float scale)
{
    for (int i = 0; i < 3; i++) {
        out[i] += v[i] * scale;
    }
}

bool scene_normalize(float v[3])
{
    const float largest = fmaxf(fabsf(v[0]), fmaxf(fabsf(v[1]), fabsf(v[2])));
    if (!(largest > 0 && largest < INFINITY) || !isfinite(v[0] + v[1] + v[2])) {
        return false;
    }
    const float scaled[3] = {v[0] / largest, v[1] / largest, v[2] / largest};
    const float length = sqrtf(dot(scaled, scaled));
    for (int i = 0; i < 3; i++) {
        v[i] = scaled[i] / length;
    }
    return true;
}

// Twice the area long, along the geometric normal.
static void triangle_cross(const gltf_primitive *p, const uint32_t *triangle, float out[3])
{
    float edge1[3], edge2[3];
    subtract(p->positions[triangle[1]], p->positions[triangle[0]], edge1);
    subtract(p->positions[triangle[2]], p->positions[triangle[0]], edge2);
    cross(edge1, edge2, out);
}

// ---- Repairs

// Whether whatever deforms the primitive takes both vertices the same way.
static bool vertices_move_alike(const gltf_primitive *p, uint32_t a, uint32_t b)
{
    bool alike = !p->influences || memcmp(&p->influences[a], &p->influences[b], sizeof(*p->influences)) == 0;
    for (uint32_t i = 0; i < p->target_count && alike; i++) {
        const scene_morph *const morphs = p->morphs + (size_t)i * p->vertex_count;
        alike = memcmp(morphs[a].position, morphs[b].position, sizeof(morphs[a].position)) == 0;
    }
    return alike;
}

// A triangle without area at rest may get one by deformation, unless it moves as a whole or has an edge without length.
static bool area_may_come(const gltf_primitive *p, const uint32_t *triangle)
{
    bool whole = true, edges = true;
    for (int i = 0; i < 3; i++) {
        const uint32_t from = triangle[i], to = triangle[(i + 1) % 3];
        const bool alike = vertices_move_alike(p, from, to);
        whole = whole && alike;
        edges = edges && !(alike && memcmp(p->positions[from], p->positions[to], sizeof(*p->positions)) == 0);
    }
    return !whole && edges;
}

// Returns how many there were. In single precision, as the shaders will take the cross product's length.
static uint32_t zero_area_triangles_drop(gltf_primitive *p)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < p->index_count; i += 3) {
        float normal[3];
        triangle_cross(p, p->indices + i, normal);
        if (dot(normal, normal) >= FLT_MIN || area_may_come(p, p->indices + i)) {
            memmove(p->indices + kept, p->indices + i, 3 * sizeof(uint32_t));
            kept += 3;
        }
    }
    const uint32_t dropped = (p->index_count - kept) / 3;
    p->index_count = kept;
    return dropped;
}

// The elements of `from` by index, a vertex for each; frees `from`.
static void *corners_take(void *from, const gltf_primitive *p, size_t size)
{
    char *const corners = memory_alloc(p->index_count * size);
    for (uint32_t i = 0; i < p->index_count; i++) {
        memcpy(corners + i * size, (const char *)from + p->indices[i] * size, size);
    }
    free(from);
    return corners;
}

static void morphs_unshare(gltf_primitive *p)
{
    scene_morph *const morphs = memory_alloc((size_t)p->target_count * p->index_count * sizeof(*morphs));
    for (size_t target = 0; target < p->target_count; target++) {
        for (uint32_t i = 0; i < p->index_count; i++) {
            morphs[target * p->index_count + i] = p->morphs[target * p->vertex_count + p->indices[i]];
        }
    }
    free(p->morphs);
    p->morphs = morphs;
}

static void vertices_unshare(gltf_primitive *p)
{
    p->positions = corners_take(p->positions, p, sizeof(*p->positions));
    p->attributes = corners_take(p->attributes, p, sizeof(*p->attributes));
    if (p->tags) {
        p->tags = corners_take(p->tags, p, sizeof(*p->tags));
    }
    if (p->influences) {
        p->influences = corners_take(p->influences, p, sizeof(*p->influences));
    }
    if (p->target_count > 0) {
        morphs_unshare(p);
    }
    for (uint32_t i = 0; i < p->index_count; i++) {
        p->indices[i] = i;
    }
    p->vertex_count = p->index_count;
}

// The normal of a triangle whose vertices are not shared, with a morph target's positions added to it where `morphs` is
// not NULL. Up where it has no area.
static void flat_normal(const gltf_primitive *p, uint32_t first, const scene_morph *morphs, float normal[3])
{
    float corners[3][3], edge1[3], edge2[3];
    for (uint32_t i = 0; i < 3; i++) {
        memcpy(corners[i], p->positions[first + i], sizeof(corners[i]));
        if (morphs) {
            add_scaled(corners[i], morphs[first + i].position, 1);
        }
    }
    subtract(corners[1], corners[0], edge1);
    subtract(corners[2], corners[0], edge2);
    cross(edge1, edge2, normal);
    if (!scene_normalize(normal)) {
        memcpy(normal, (const float[3]){0, 1, 0}, 3 * sizeof(float));
    }
}

// glTF asks for flat normals where there are none, so no two triangles may share a vertex. A morph target takes them to
// its own flat normals: exact at the weights 0 and 1. Skins turn them as they turn normals that the file has.
static void flat_normals_make(gltf_primitive *p)
{
    vertices_unshare(p);
    for (uint32_t i = 0; i < p->vertex_count; i += 3) {
        float normal[3];
        flat_normal(p, i, NULL, normal);
        for (uint32_t k = i; k < i + 3; k++) {
            memcpy(p->attributes[k].normal, normal, sizeof(normal));
        }
        for (size_t target = 0; target < p->target_count; target++) {
            scene_morph *const morphs = p->morphs + target * p->vertex_count;
            float change[3];
            flat_normal(p, i, morphs, change);
            subtract(change, normal, change);
            for (uint32_t k = i; k < i + 3; k++) {
                memcpy(morphs[k].normal, change, sizeof(change));
            }
        }
    }
}

// Normals without direction become the mean of their triangles' normals; the others become unit vectors.
static void normals_repair(gltf_primitive *p)
{
    float(*const sums)[3] = memory_alloc(p->vertex_count * sizeof(*sums));
    for (uint32_t i = 0; i < p->index_count; i++) {
        float normal[3];
        triangle_cross(p, p->indices + i / 3 * 3, normal);
        add_scaled(sums[p->indices[i]], normal, 1);
    }
    static const float up[3] = {0, 1, 0};
    for (uint32_t i = 0; i < p->vertex_count; i++) {
        float *const normal = p->attributes[i].normal;
        if (!scene_normalize(normal)) {
            memcpy(normal, scene_normalize(sums[i]) ? sums[i] : up, sizeof(up));
        }
    }
    free(sums);
}

// Given tangents: unit, and w exactly 1 or -1, or 0 where they are unusable.
static void tangents_repair(gltf_primitive *p)
{
    for (uint32_t i = 0; i < p->vertex_count; i++) {
        float *const tangent = p->attributes[i].tangent;
        tangent[3] = !scene_normalize(tangent) ? 0.0f : tangent[3] < 0 ? -1.0f : 1.0f;
    }
}

static void transformed_uv(const vertex_attributes *vertex, const texture_reference *reference, float uv[2])
{
    const float *const in = reference->uv_set == 1 ? vertex->uv1 : vertex->uv0;
    for (int i = 0; i < 2; i++) {
        uv[i] = reference->transform[i] * in[0] + reference->transform[2 + i] * in[1]; // an offset moves no tangent
    }
}

// Adds the triangle's directions of growing u and of falling v, weighted by area, to its corners' sums. glTF's v points
// down the image while its normal maps' green points up.
static void tangent_accumulate(const gltf_primitive *p, const uint32_t *triangle, const texture_reference *map,
                               float (*along_u)[3], float (*against_v)[3])
{
    float edge1[3], edge2[3], uv[3][2];
    subtract(p->positions[triangle[1]], p->positions[triangle[0]], edge1);
    subtract(p->positions[triangle[2]], p->positions[triangle[0]], edge2);
    for (int i = 0; i < 3; i++) {
        transformed_uv(&p->attributes[triangle[i]], map, uv[i]);
    }
    const float du1 = uv[1][0] - uv[0][0], dv1 = uv[1][1] - uv[0][1];
    const float du2 = uv[2][0] - uv[0][0], dv2 = uv[2][1] - uv[0][1];
    const float sign = du1 * dv2 - du2 * dv1 < 0 ? -1.0f : 1.0f;
    float u[3] = {0}, v[3] = {0}, normal[3];
    add_scaled(u, edge1, sign * dv2);
    add_scaled(u, edge2, -sign * dv1);
    add_scaled(v, edge1, sign * du2);
    add_scaled(v, edge2, -sign * du1);
    if (!scene_normalize(u) || !scene_normalize(v)) {
        return;
    }
    cross(edge1, edge2, normal);
    const float weight = sqrtf(dot(normal, normal));
    for (int i = 0; i < 3; i++) {
        add_scaled(along_u[triangle[i]], u, weight);
        add_scaled(against_v[triangle[i]], v, weight);
    }
}

// Tangents from the texture coordinates of the normal map, orthogonal to the normals.
static void tangents_make(gltf_primitive *p, const texture_reference *map)
{
    float(*const along_u)[3] = memory_alloc(p->vertex_count * sizeof(*along_u));
    float(*const against_v)[3] = memory_alloc(p->vertex_count * sizeof(*against_v));
    for (uint32_t i = 0; i < p->index_count; i += 3) {
        tangent_accumulate(p, p->indices + i, map, along_u, against_v);
    }
    for (uint32_t i = 0; i < p->vertex_count; i++) {
        vertex_attributes *const vertex = &p->attributes[i];
        float tangent[3], bitangent[3];
        memcpy(tangent, along_u[i], sizeof(tangent));
        add_scaled(tangent, vertex->normal, -dot(tangent, vertex->normal));
        const bool usable = scene_normalize(tangent);
        cross(vertex->normal, tangent, bitangent);
        memcpy(vertex->tangent, tangent, sizeof(tangent));
        vertex->tangent[3] = !usable ? 0.0f : dot(bitangent, against_v[i]) < 0 ? -1.0f : 1.0f;
    }
    free(along_u);
    free(against_v);
}

// ---- Order

// Renumbers in order of first use, so that neighbours in the triangle order are neighbours in memory; vertices that no
// triangle uses go.
static void vertices_renumber(gltf_primitive *p)
{
    if (p->index_count == 0) {
        p->vertex_count = 0;
        return;
    }
    uint32_t *const remap = memory_alloc(p->vertex_count * sizeof(*remap));
    const size_t used = meshopt_optimizeVertexFetchRemap(remap, p->indices, p->index_count, p->vertex_count);
    meshopt_remapIndexBuffer(p->indices, p->indices, p->index_count, remap);
    meshopt_remapVertexBuffer(p->positions, p->positions, p->vertex_count, sizeof(*p->positions), remap);
    meshopt_remapVertexBuffer(p->attributes, p->attributes, p->vertex_count, sizeof(*p->attributes), remap);
    if (p->tags) {
        meshopt_remapVertexBuffer(p->tags, p->tags, p->vertex_count, sizeof(*p->tags), remap);
    }
    if (p->influences) {
        meshopt_remapVertexBuffer(p->influences, p->influences, p->vertex_count, sizeof(*p->influences), remap);
    }
    for (size_t target = 0; target < p->target_count; target++) {
        scene_morph *const morphs = p->morphs + target * p->vertex_count;
        meshopt_remapVertexBuffer(morphs, morphs, p->vertex_count, sizeof(*morphs), remap);
        memmove(p->morphs + target * used, morphs, used * sizeof(*morphs));
    }
    p->vertex_count = (uint32_t)used;
    free(remap);
}

// ---- Loading

void scene_warning(scene_data *scene, const char *format, ...)
{
    char message[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof(message), format, arguments);
    va_end(arguments);
    log_warning("\"%s\": %s", scene->path, message);

    const uint32_t count = scene->warning_count++;
    if ((count & (count - 1)) == 0) { // the arena frees nothing, so the array doubles
        char **const warnings = arena_alloc(&scene->arena, (count > 0 ? 2 * count : 1) * sizeof(*warnings));
        for (uint32_t i = 0; i < count; i++) {
            warnings[i] = scene->warnings[i];
        }
        scene->warnings = warnings;
    }
    scene->warnings[count] = arena_strdup(&scene->arena, message);
}

static void primitive_finish(gltf_primitive *p, const material *m)
{
    if (p->has_normals) {
        normals_repair(p);
    } else {
        flat_normals_make(p);
    }
    if (p->has_tangents) {
        tangents_repair(p);
    } else if (m->normal_texture.texture != TEXTURE_NONE) {
        tangents_make(p, &m->normal_texture);
    }
}

// The material goes with its primitive.
static void mesh_reorder(const scene_mesh *mesh, mesh_primitive *primitives, gltf_primitive *sources)
{
    const uint32_t count = mesh->primitive_count;
    uint32_t *const sequence = memory_alloc(count * sizeof(*sequence));
    mesh_primitive *const primitives_before = memory_alloc(count * sizeof(*primitives_before));
    gltf_primitive *const sources_before = memory_alloc(count * sizeof(*sources_before));
    mesh_triangles_reorder(sources, count, sequence);
    memcpy(primitives_before, primitives, count * sizeof(*primitives));
    memcpy(sources_before, sources, count * sizeof(*sources));
    for (uint32_t i = 0; i < count; i++) {
        primitives[i] = primitives_before[sequence[i]];
        sources[i] = sources_before[sequence[i]];
    }
    free(sequence);
    free(primitives_before);
    free(sources_before);
}

static void primitives_finish(scene_data *scene, gltf_primitive *sources)
{
    uint32_t dropped = 0;
    for (uint32_t i = 0; i < scene->primitive_count; i++) {
        dropped += zero_area_triangles_drop(&sources[i]);
        primitive_finish(&sources[i], &scene->materials[scene->primitives[i].material]);
    }
    for (uint32_t i = 0; i < scene->mesh_count; i++) {
        const uint32_t first = scene->meshes[i].first_primitive;
        mesh_reorder(&scene->meshes[i], scene->primitives + first, sources + first);
    }
    for (uint32_t i = 0; i < scene->primitive_count; i++) {
        mesh_primitive *const primitive = &scene->primitives[i];
        vertices_renumber(&sources[i]);
        primitive->first_vertex = scene->vertex_count;
        primitive->vertex_count = sources[i].vertex_count;
        primitive->first_index = scene->index_count;
        primitive->index_count = sources[i].index_count;
        scene->vertex_count += primitive->vertex_count;
        scene->index_count += primitive->index_count;
    }
    if (dropped > 0) {
        scene_warning(scene, "%u triangles without area are left out", dropped);
    }
}

static void primitives_concatenate(scene_data *scene, const gltf_primitive *sources)
{
    scene->positions = arena_alloc(&scene->arena, scene->vertex_count * sizeof(*scene->positions));
    scene->attributes = arena_alloc(&scene->arena, scene->vertex_count * sizeof(*scene->attributes));
    scene->indices = arena_alloc(&scene->arena, scene->index_count * sizeof(*scene->indices));
    for (uint32_t i = 0; i < scene->primitive_count; i++) {
        const mesh_primitive *const p = &scene->primitives[i];
        memcpy(scene->positions + p->first_vertex, sources[i].positions, p->vertex_count * sizeof(*scene->positions));
        memcpy(scene->attributes + p->first_vertex, sources[i].attributes,
               p->vertex_count * sizeof(*scene->attributes));
        memcpy(scene->indices + p->first_index, sources[i].indices, p->index_count * sizeof(*scene->indices));
    }
}

// Which vertices it deforms, and how.
static void deformation_finish(scene_data *scene, scene_deformation *deformation, const gltf_primitive *sources)
{
    const scene_mesh *const mesh = &scene->meshes[deformation->mesh];
    const mesh_primitive *const primitives = scene->primitives + mesh->first_primitive;
    deformation->first_vertex = primitives[0].first_vertex;
    for (uint32_t i = 0; i < mesh->primitive_count; i++) {
        deformation->vertex_count += primitives[i].vertex_count;
    }
    const size_t all = deformation->vertex_count;
    scene_influences *const influences =
        deformation->skin == SCENE_NONE ? NULL : arena_alloc(&scene->arena, all * sizeof(*influences));
    scene_morph *const morphs = arena_alloc(&scene->arena, deformation->target_count * all * sizeof(*morphs));
    for (uint32_t i = 0; i < mesh->primitive_count; i++) {
        const gltf_primitive *const source = &sources[mesh->first_primitive + i];
        const size_t first = primitives[i].first_vertex - deformation->first_vertex, count = source->vertex_count;
        if (influences) {
            memcpy(influences + first, source->influences, count * sizeof(*influences));
        }
        for (size_t target = 0; target < deformation->target_count; target++) {
            memcpy(morphs + target * all + first, source->morphs + target * count, count * sizeof(*morphs));
        }
    }
    deformation->influences = influences;
    deformation->morphs = morphs;
}

void scene_matrix_multiply(const float a[16], const float b[16], float out[16])
{
    for (int column = 0; column < 4; column++) {
        for (int row = 0; row < 4; row++) {
            float sum = 0;
            for (int k = 0; k < 4; k++) {
                sum += a[4 * k + row] * b[4 * column + k];
            }
            out[4 * column + row] = sum;
        }
    }
}

// Columns: the rotation's, scaled; then the translation.
void scene_matrix_compose(const float translation[3], const float rotation[4], const float scale[3], float out[16])
{
    const float x = rotation[0], y = rotation[1], z = rotation[2], w = rotation[3];
    const float columns[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
        {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
        {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)},
    };
    for (int column = 0; column < 3; column++) {
        for (int row = 0; row < 3; row++) {
            out[4 * column + row] = columns[column][row] * scale[column];
        }
        out[4 * column + 3] = 0;
        out[12 + column] = translation[column];
    }
    out[15] = 1;
}

static bool matrix_is_finite(const float m[16])
{
    float sum = 0;
    for (int i = 0; i < 16; i++) {
        sum += m[i] - m[i]; // 0, or not a number
    }
    return sum == 0;
}

// Parents come first, so one pass is enough.
static bool nodes_place(scene_data *scene)
{
    for (uint32_t i = 0; i < scene->node_count; i++) {
        scene_node *const node = &scene->nodes[i];
        if (node->parent == SCENE_NONE) {
            memcpy(node->world, node->matrix, sizeof(node->world));
        } else {
            scene_matrix_multiply(scene->nodes[node->parent].world, node->matrix, node->world);
        }
        if (!matrix_is_finite(node->world)) {
            log_error("\"%s\": the place of node \"%s\" in the world is not finite", scene->path, node->name);
            return false;
        }
    }
    return true;
}

// Joint matrices at rest.
static bool skins_place(const scene_data *scene)
{
    for (uint32_t i = 0; i < scene->skin_count; i++) {
        const scene_skin *const skin = &scene->skins[i];
        for (uint32_t k = 0; k < skin->joint_count; k++) {
            float matrix[16];
            scene_matrix_multiply(scene->nodes[skin->joints[k]].world, skin->inverse_bind[k], matrix);
            if (!matrix_is_finite(matrix)) {
                log_error("\"%s\": joint %u of skin \"%s\" moves vertices to where is not finite", scene->path, k,
                          skin->name);
                return false;
            }
        }
    }
    return true;
}

// ---- Bounds

typedef struct box {
    float min[3], max[3];
} box;

static const box box_empty = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};

static void box_add_point(box *b, const float p[3])
{
    for (int i = 0; i < 3; i++) {
        b->min[i] = fminf(b->min[i], p[i]);
        b->max[i] = fmaxf(b->max[i], p[i]);
    }
}

static void box_add_transformed(box *bounds, const box *local, const float world[16])
{
    for (int corner = 0; corner < 8; corner++) {
        float point[3] = {world[12], world[13], world[14]};
        for (int axis = 0; axis < 3; axis++) {
            const float coordinate = corner >> axis & 1 ? local->max[axis] : local->min[axis];
            add_scaled(point, world + 4 * axis, coordinate);
        }
        box_add_point(bounds, point);
    }
}

static uint64_t mesh_triangle_count(const scene_data *scene, const scene_mesh *mesh)
{
    uint64_t count = 0;
    for (uint32_t i = 0; i < mesh->primitive_count; i++) {
        count += scene->primitives[mesh->first_primitive + i].index_count / 3;
    }
    return count;
}

static box mesh_box(const scene_data *scene, const scene_mesh *mesh)
{
    box result = box_empty;
    for (uint32_t i = 0; i < mesh->primitive_count; i++) {
        const mesh_primitive *const p = &scene->primitives[mesh->first_primitive + i];
        for (uint32_t k = 0; k < p->vertex_count; k++) {
            box_add_point(&result, scene->positions[p->first_vertex + k]);
        }
    }
    return result;
}

static void matrix_point(const float m[16], const float in[3], float out[3])
{
    for (int row = 0; row < 3; row++) {
        out[row] = m[row] * in[0] + m[4 + row] * in[1] + m[8 + row] * in[2] + m[12 + row];
    }
}

// At rest, in the world. A skinned vertex lies between the places that each of its joints alone would take it to.
static void box_add_deformed(box *bounds, const scene_data *scene, const scene_deformation *deformation)
{
    const scene_skin *const skin = deformation->skin == SCENE_NONE ? NULL : &scene->skins[deformation->skin];
    for (uint32_t i = 0; i < deformation->vertex_count; i++) {
        float position[3], world[3];
        memcpy(position, scene->positions[deformation->first_vertex + i], sizeof(position));
        for (size_t target = 0; target < deformation->target_count; target++) {
            add_scaled(position, deformation->morphs[target * deformation->vertex_count + i].position,
                       deformation->weights[target]);
        }
        if (!skin) {
            matrix_point(scene->nodes[deformation->node].world, position, world);
            box_add_point(bounds, world);
            continue;
        }
        const scene_influences *const influences = &deformation->influences[i];
        for (int k = 0; k < SCENE_INFLUENCES && influences->weights[k] > 0; k++) {
            const uint32_t joint = influences->joints[k];
            float bound[3];
            matrix_point(skin->inverse_bind[joint], position, bound);
            matrix_point(scene->nodes[skin->joints[joint]].world, bound, world);
            box_add_point(bounds, world);
        }
    }
}

static void instances_bound(scene_data *scene)
{
    box *const boxes = memory_alloc(scene->mesh_count * sizeof(*boxes));
    uint64_t *const counts = memory_alloc(scene->mesh_count * sizeof(*counts));
    for (uint32_t i = 0; i < scene->mesh_count; i++) {
        boxes[i] = mesh_box(scene, &scene->meshes[i]);
        counts[i] = mesh_triangle_count(scene, &scene->meshes[i]);
    }
    box bounds = box_empty;
    for (uint32_t i = 0; i < scene->node_count; i++) {
        const scene_node *const node = &scene->nodes[i];
        if (node->mesh == SCENE_NONE || counts[node->mesh] == 0) {
            continue;
        }
        const uint32_t deformation = scene->meshes[node->mesh].deformation;
        if (deformation == SCENE_NONE) {
            box_add_transformed(&bounds, &boxes[node->mesh], node->world);
        } else {
            box_add_deformed(&bounds, scene, &scene->deformations[deformation]);
        }
        scene->instanced_triangles += counts[node->mesh];
    }
    if (scene->instanced_triangles > 0) {
        memcpy(scene->bounds_min, bounds.min, sizeof(bounds.min));
        memcpy(scene->bounds_max, bounds.max, sizeof(bounds.max));
    }
    free(boxes);
    free(counts);
}

scene_data *scene_load(const char *path)
{
    scene_data *const scene = memory_alloc(sizeof(*scene));
    scene->path = arena_strdup(&scene->arena, path);
    gltf_primitive *primitives = NULL;
    if (!gltf_import(path, scene, &primitives)) {
        goto fail;
    }
    scene_subdivide(scene, &primitives);
    primitives_finish(scene, primitives);
    primitives_concatenate(scene, primitives);
    for (uint32_t i = 0; i < scene->deformation_count; i++) {
        deformation_finish(scene, &scene->deformations[i], primitives);
    }
    scene_subdivisions_finish(scene, primitives);
    for (uint32_t i = 0; i < scene->primitive_count; i++) {
        gltf_primitive_free(&primitives[i]);
    }
    free(primitives);
    if (!nodes_place(scene) || !skins_place(scene)) {
        goto fail;
    }
    instances_bound(scene);
    return scene;

fail:
    scene_destroy(scene);
    return NULL;
}

void scene_destroy(scene_data *scene)
{
    if (!scene) {
        return;
    }
    for (uint32_t i = 0; i < scene->image_count; i++) {
        free(scene->images[i].texels);
    }
    arena_fini(&scene->arena);
    free(scene);
}

uint32_t scene_camera_find(const scene_data *scene, const char *name)
{
    for (uint32_t i = 0; i < scene->camera_count; i++) {
        if (strcmp(scene->cameras[i].name, name) == 0) {
            return i;
        }
    }
    return SCENE_NONE;
}

// ---- Information

static void print_lights(const scene_data *scene, FILE *out)
{
    static const char *const kinds[] = {
        [LIGHT_POINT] = "point", [LIGHT_SPOT] = "spot", [LIGHT_DIRECTIONAL] = "directional"};
    uint32_t counts[countof(kinds)] = {0};
    for (uint32_t i = 0; i < scene->light_count; i++) {
        counts[scene->lights[i].type]++;
    }
    fprintf(out, "lights: %u point, %u spot, %u directional\n", counts[0], counts[1], counts[2]);
    for (uint32_t i = 0; i < scene->light_count; i++) {
        const scene_light *const light = &scene->lights[i];
        fprintf(out, "  %s \"%s\": %g %g %g %s", kinds[light->type], light->name, light->color[0], light->color[1],
                light->color[2], light->type == LIGHT_DIRECTIONAL ? "lx" : "cd");
        if (light->type == LIGHT_SPOT) {
            const double degrees = 180 / M_PI;
            fprintf(out, ", cone %g to %g degrees", light->inner_cone * degrees, light->outer_cone * degrees);
        }
        fprintf(out, "\n");
    }
}

static bool is_emissive(const material *m)
{
    return m->emissive[0] > 0 || m->emissive[1] > 0 || m->emissive[2] > 0;
}

static void print_emissive_materials(const scene_data *scene, FILE *out)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < scene->material_count; i++) {
        count += is_emissive(&scene->materials[i]);
    }
    fprintf(out, "emissive materials: %u\n", count);
    for (uint32_t i = 0; i < scene->material_count; i++) {
        const material *const m = &scene->materials[i];
        if (is_emissive(m)) {
            fprintf(out, "  \"%s\": %g %g %g nt%s\n", scene->material_names[i], m->emissive[0], m->emissive[1],
                    m->emissive[2], m->emissive_texture.texture == TEXTURE_NONE ? "" : ", textured");
        }
    }
}

static void print_cameras(const scene_data *scene, FILE *out)
{
    fprintf(out, "cameras: %u\n", scene->camera_count);
    for (uint32_t i = 0; i < scene->camera_count; i++) {
        const scene_camera *const camera = &scene->cameras[i];
        const float *const eye = scene->nodes[camera->node].world + 12;
        fprintf(out, "  \"%s\": at %g %g %g, vertical field of view %g degrees\n", camera->name, eye[0], eye[1], eye[2],
                camera->yfov * 180 / M_PI);
    }
}

static void print_subdivisions(const scene_data *scene, FILE *out)
{
    for (uint32_t i = 0; i < scene->subdivision_count; i++) {
        const scene_subdivision *const s = &scene->subdivisions[i];
        const scene_mesh *const coarse = &scene->meshes[s->levels[0].mesh],
                                *const fine = &scene->meshes[s->levels[s->level_count - 1].mesh];
        fprintf(out, "subdivided: \"%s\", levels 1 to %u, %llu to %llu triangles\n", scene->meshes[s->mesh].name,
                s->level_count, (unsigned long long)mesh_triangle_count(scene, coarse),
                (unsigned long long)mesh_triangle_count(scene, fine));
    }
}

static void print_motion(const scene_data *scene, FILE *out)
{
    fprintf(out, "animations: %u\n", scene->animation_count);
    for (uint32_t i = 0; i < scene->animation_count; i++) {
        const scene_animation *const animation = &scene->animations[i];
        fprintf(out, "  \"%s\": %g s, %u channels\n", animation->name, animation->duration, animation->channel_count);
    }
    fprintf(out, "skins: %u\n", scene->skin_count);
    for (uint32_t i = 0; i < scene->skin_count; i++) {
        fprintf(out, "  \"%s\": %u joints\n", scene->skins[i].name, scene->skins[i].joint_count);
    }
    uint32_t levels = 0;
    for (uint32_t i = 0; i < scene->deformation_count; i++) {
        levels += scene->deformations[i].subdivision != NULL;
    }
    fprintf(out, "deformed meshes: %u\n", scene->deformation_count - levels);
    for (uint32_t i = 0; i < scene->deformation_count; i++) {
        const scene_deformation *const deformation = &scene->deformations[i];
        if (deformation->subdivision) {
            continue;
        }
        fprintf(out, "  \"%s\" of node \"%s\": %u vertices, %s, %u morph targets\n",
                scene->meshes[deformation->mesh].name, scene->nodes[deformation->node].name, deformation->vertex_count,
                deformation->skin == SCENE_NONE ? "no skin" : "a skin", deformation->target_count);
    }
}

void scene_print_info(const scene_data *scene, FILE *out)
{
    uint32_t instances = 0;
    for (uint32_t i = 0; i < scene->node_count; i++) {
        instances += scene->nodes[i].mesh != SCENE_NONE;
    }
    fprintf(out, "scene: %s\n", scene->path);
    fprintf(out, "triangles: %u (%llu with instances)\n", scene->index_count / 3,
            (unsigned long long)scene->instanced_triangles);
    print_subdivisions(scene, out);
    fprintf(out, "vertices: %u\n", scene->vertex_count);
    fprintf(out, "meshes: %u (%u primitives, %u instances)\n", scene->mesh_count, scene->primitive_count, instances);
    fprintf(out, "materials: %u\n", scene->material_count - 1); // without the default one
    fprintf(out, "textures: %u (%u images)\n", scene->texture_count, scene->image_count);
    print_lights(scene, out);
    print_emissive_materials(scene, out);
    print_motion(scene, out);
    print_cameras(scene, out);
    fprintf(out, "bounds: %g %g %g to %g %g %g m\n", scene->bounds_min[0], scene->bounds_min[1], scene->bounds_min[2],
            scene->bounds_max[0], scene->bounds_max[1], scene->bounds_max[2]);
    fprintf(out, "warnings: %u\n", scene->warning_count);
    for (uint32_t i = 0; i < scene->warning_count; i++) {
        fprintf(out, "  %s\n", scene->warnings[i]);
    }
}
