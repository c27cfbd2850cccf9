// Embree's scenes, its filters for alpha masks, and the loops over a batch.
#include "embree_rays.h"
#include "engine/parallel.h"
#include "texture_sample.h"

#include <embree3/rtcore.h>

#include <stdlib.h>
#include <string.h>

typedef struct masked_primitive { // what the filter of a geometry needs
    const scene_data *scene;
    const material *material;
    const mesh_primitive *primitive;
} masked_primitive;

typedef struct deformed_mesh { // of a deformation
    uint32_t version; // of the vertices that its scene was committed with
    bool at_rest; // the tree is the one over the triangles at rest
    bool moved; // by the update that runs
    float (*rest)[3]; // its positions at rest, padded for Embree; NULL until first instanced
} deformed_mesh;

typedef struct placed_mesh { // what an instance was when it was last committed
    RTCGeometry geometry;
    uint32_t mesh;
    float world[3][4];
} placed_mesh;

struct embree_rays {
    const scene_data *scene;
    const material *materials;
    const float (*positions)[3];
    const uint32_t *indices;
    RTCDevice device;
    RTCScene *meshes; // NULL until first instanced
    masked_primitive *masks; // per primitive
    uint32_t *mesh_deformations; // per mesh: index, or SCENE_NONE
    deformed_mesh *deformed; // per deformation
    RTCScene instances; // geometry i: instance i
    placed_mesh *placed;
    size_t placed_capacity;
    uint32_t placed_count;
    bool failed;
    parallel *pool;
};

// ---- Alpha masks

static float vertex_alpha(const vertex_attributes *vertex)
{
    return (float)(vertex->color_ba >> 16) / 65535;
}

// As hit_base_color in scene.glsl.h at lod 0.
static float hit_alpha(const scene_data *s, const material *m, const mesh_primitive *p, uint32_t triangle, float u,
                       float v)
{
    const float weights[3] = {1 - u - v, u, v};
    float vertex_sum = 0, uv[2] = {0};
    for (uint32_t k = 0; k < 3; k++) {
        const uint32_t index = p->first_vertex + s->indices[p->first_index + 3 * triangle + k];
        const vertex_attributes *vertex = &s->attributes[index];
        float vertex_uv[2];
        texture_vertex_uv(&m->base_texture, vertex, vertex_uv);
        vertex_sum += weights[k] * vertex_alpha(vertex);
        uv[0] += weights[k] * vertex_uv[0];
        uv[1] += weights[k] * vertex_uv[1];
    }
    const float alpha = m->base_color[3] * vertex_sum;
    return m->base_texture.texture == TEXTURE_NONE
               ? alpha
               : alpha * texture_alpha(s, &s->textures[m->base_texture.texture], uv);
}

// Embree's arrays of N hits each, one behind the other: its accessors are C++.
enum { HIT_U = 3, HIT_V = 4, HIT_PRIMITIVE = 5 };

static void mask_filter(const struct RTCFilterFunctionNArguments *args)
{
    const masked_primitive *mask = args->geometryUserPtr;
    const float *u = (const float *)args->hit + HIT_U * args->N, *v = (const float *)args->hit + HIT_V * args->N;
    const uint32_t *triangle = (const uint32_t *)args->hit + HIT_PRIMITIVE * args->N;
    for (uint32_t i = 0; i < args->N; i++)
        if (args->valid[i] && !(hit_alpha(mask->scene, mask->material, mask->primitive, triangle[i], u[i], v[i]) >=
                                mask->material->alpha_cutoff))
            args->valid[i] = 0;
}

// ---- Scenes

static void error_note(void *user, enum RTCError code, const char *text)
{
    embree_rays *rays = user;
    if (!rays->failed)
        log_error("Embree: %s (error %d)", text ? text : "unknown error", (int)code);
    rays->failed = true;
}

static RTCGeometry geometry_create(embree_rays *rays, const mesh_primitive *p)
{
    RTCGeometry geometry = rtcNewGeometry(rays->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, rays->positions,
                               p->first_vertex * sizeof *rays->positions, sizeof *rays->positions, p->vertex_count);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, rays->indices,
                               p->first_index * sizeof *rays->indices, 3 * sizeof *rays->indices, p->index_count / 3);
    if (rays->scene->materials[p->material].flags & MATERIAL_ALPHA_MASK) {
        masked_primitive *mask = &rays->masks[p - rays->scene->primitives];
        *mask = (masked_primitive){rays->scene, &rays->materials[p->material], p};
        rtcSetGeometryUserData(geometry, mask);
        rtcSetGeometryIntersectFilterFunction(geometry, mask_filter);
        rtcSetGeometryOccludedFilterFunction(geometry, mask_filter);
    }
    return geometry;
}

// Geometries count as primitives do within their mesh; those without triangles leave a gap. What deforms has a tree
// whose boxes can be fitted to other positions, which Embree makes in dynamic scenes of low quality alone.
static RTCScene mesh_create(embree_rays *rays, const scene_mesh *mesh, bool deforms)
{
    RTCScene scene = rtcNewScene(rays->device);
    if (deforms) {
        rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_LOW);
        rtcSetSceneFlags(scene, RTC_SCENE_FLAG_DYNAMIC);
    }
    for (uint32_t i = 0; i < mesh->primitive_count; i++) {
        const mesh_primitive *p = &rays->scene->primitives[mesh->first_primitive + i];
        if (p->index_count < 3)
            continue;
        RTCGeometry geometry = geometry_create(rays, p);
        rtcSetGeometryBuildQuality(geometry, deforms ? RTC_BUILD_QUALITY_REFIT : RTC_BUILD_QUALITY_MEDIUM);
        rtcCommitGeometry(geometry);
        rtcAttachGeometryByID(scene, geometry, i);
        rtcReleaseGeometry(geometry);
    }
    if (!deforms)
        rtcCommitScene(scene);
    return scene;
}

// ---- Deformations

// Commits the mesh over `positions`, those of the scene's vertex `first`. `fit`: with the tree that it has.
static void mesh_commit(embree_rays *rays, uint32_t index, const float (*positions)[3], uint32_t first, bool fit)
{
    const scene_mesh *mesh = &rays->scene->meshes[index];
    for (uint32_t i = 0; i < mesh->primitive_count; i++) {
        const mesh_primitive *p = &rays->scene->primitives[mesh->first_primitive + i];
        if (p->index_count < 3)
            continue;
        RTCGeometry geometry = rtcGetGeometry(rays->meshes[index], i);
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, positions,
                                   (p->first_vertex - first) * sizeof *positions, sizeof *positions, p->vertex_count);
        if (!fit) // other triangles, as far as Embree knows
            rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0);
        rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(geometry);
    }
    rtcCommitScene(rays->meshes[index]);
}

// As modules/acceleration.c has it: the tree depends on the pose alone.
static void mesh_follow(embree_rays *rays, uint32_t index, const world_deformation *now)
{
    const scene_deformation *d = &rays->scene->deformations[index];
    deformed_mesh *mesh = &rays->deformed[index];
    if (!now->stretched && !mesh->at_rest)
        mesh_commit(rays, d->mesh, (const float(*)[3])mesh->rest, d->first_vertex, false);
    mesh_commit(rays, d->mesh, rays->positions, 0, !now->stretched);
    mesh->at_rest = !now->stretched;
    mesh->version = now->version;
    mesh->moved = true;
}

static void deformations_follow(embree_rays *rays, const world_deformation *deformations)
{
    for (uint32_t i = 0; i < rays->scene->deformation_count; i++) {
        deformed_mesh *mesh = &rays->deformed[i];
        mesh->moved = false;
        if (mesh->rest && deformations[i].drawn && mesh->version != deformations[i].version)
            mesh_follow(rays, i, &deformations[i]);
    }
}

static void deformed_create(embree_rays *rays, uint32_t index, const world_deformation *now)
{
    enum { PADDING = 2 }; // positions: more than 16 bytes
    const scene_deformation *d = &rays->scene->deformations[index];
    deformed_mesh *mesh = &rays->deformed[index];
    mesh->rest = memory_alloc((d->vertex_count + PADDING) * sizeof *mesh->rest);
    memcpy(mesh->rest, rays->scene->positions + d->first_vertex, d->vertex_count * sizeof *mesh->rest);
    mesh_follow(rays, index, now);
}

static void mesh_require(embree_rays *rays, uint32_t index, const world_deformation *deformations)
{
    if (rays->meshes[index])
        return;
    const uint32_t deformation = rays->mesh_deformations[index];
    rays->meshes[index] = mesh_create(rays, &rays->scene->meshes[index], deformation != SCENE_NONE);
    if (deformation != SCENE_NONE)
        deformed_create(rays, deformation, &deformations[deformation]);
}

// ---- Life

embree_rays *embree_rays_create(const scene_data *scene, const material *materials, const float (*positions)[3],
                                const uint32_t *indices)
{
    // Building on one thread makes the same tree every time; it takes 140 ms for Sponza's 262K triangles, once.
    RTCDevice device = rtcNewDevice("threads=1");
    if (!device)
        return NULL;
    embree_rays *rays = memory_alloc(sizeof *rays);
    *rays = (embree_rays){
        .scene = scene, .materials = materials, .positions = positions, .indices = indices, .device = device};
    rtcSetDeviceErrorFunction(device, error_note, rays);
    rays->meshes = memory_alloc(max_u32(scene->mesh_count, 1) * sizeof *rays->meshes);
    rays->masks = memory_alloc(max_u32(scene->primitive_count, 1) * sizeof *rays->masks);
    rays->mesh_deformations = memory_alloc(max_u32(scene->mesh_count, 1) * sizeof *rays->mesh_deformations);
    memset(rays->mesh_deformations, 0xff, scene->mesh_count * sizeof *rays->mesh_deformations);
    for (uint32_t i = 0; i < scene->deformation_count; i++)
        rays->mesh_deformations[scene->deformations[i].mesh] = i;
    rays->deformed = memory_alloc(max_u32(scene->deformation_count, 1) * sizeof *rays->deformed);
    rays->instances = rtcNewScene(device);
    rtcCommitScene(rays->instances);
    rays->pool = parallel_create(0);
    return rays;
}

void embree_rays_destroy(embree_rays *rays)
{
    if (!rays)
        return;
    parallel_destroy(rays->pool);
    for (uint32_t i = 0; i < rays->placed_count; i++)
        rtcReleaseGeometry(rays->placed[i].geometry);
    rtcReleaseScene(rays->instances);
    for (uint32_t i = 0; i < rays->scene->mesh_count; i++)
        if (rays->meshes[i])
            rtcReleaseScene(rays->meshes[i]);
    rtcReleaseDevice(rays->device);
    for (uint32_t i = 0; i < rays->scene->deformation_count; i++)
        free(rays->deformed[i].rest);
    free(rays->deformed);
    free(rays->mesh_deformations);
    free(rays->placed);
    free(rays->masks);
    free(rays->meshes);
    free(rays);
}

// ---- Instances

static void placed_resize(embree_rays *rays, uint32_t count)
{
    memory_reserve((void **)&rays->placed, &rays->placed_capacity, count, sizeof *rays->placed);
    for (; rays->placed_count < count; rays->placed_count++) {
        RTCGeometry geometry = rtcNewGeometry(rays->device, RTC_GEOMETRY_TYPE_INSTANCE);
        rtcAttachGeometryByID(rays->instances, geometry, rays->placed_count);
        rays->placed[rays->placed_count] = (placed_mesh){.geometry = geometry, .mesh = SCENE_NONE};
    }
    for (; rays->placed_count > count; rays->placed_count--) {
        rtcDetachGeometry(rays->instances, rays->placed_count - 1);
        rtcReleaseGeometry(rays->placed[rays->placed_count - 1].geometry);
    }
}

static bool mesh_moved(const embree_rays *rays, uint32_t mesh)
{
    const uint32_t deformation = rays->mesh_deformations[mesh];
    return deformation != SCENE_NONE && rays->deformed[deformation].moved;
}

// Whether anything changed. The mesh exists.
static bool placed_follow(embree_rays *rays, placed_mesh *placed, const mesh_instance_gpu *instance)
{
    if (placed->mesh == instance->mesh && memcmp(placed->world, instance->world, sizeof placed->world) == 0 &&
        !mesh_moved(rays, instance->mesh))
        return false;
    rtcSetGeometryInstancedScene(placed->geometry, rays->meshes[instance->mesh]);
    rtcSetGeometryTransform(placed->geometry, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, instance->world);
    rtcCommitGeometry(placed->geometry);
    placed->mesh = instance->mesh;
    memcpy(placed->world, instance->world, sizeof placed->world);
    return true;
}

bool embree_rays_update(embree_rays *rays, const mesh_instance_gpu *instances, uint32_t count,
                        const world_deformation *deformations)
{
    bool changed = rays->placed_count != count;
    deformations_follow(rays, deformations);
    placed_resize(rays, count);
    for (uint32_t i = 0; i < count; i++) {
        mesh_require(rays, instances[i].mesh, deformations);
        changed |= placed_follow(rays, &rays->placed[i], &instances[i]);
    }
    if (changed)
        rtcCommitScene(rays->instances);
    return !rays->failed;
}

// ---- Batches

enum { CHUNK = 512 }; // rays a thread takes at once: about 0.2 ms

typedef struct batch {
    RTCScene scene;
    const float (*origins)[4], (*directions)[4];
    uint32_t *visible;
    ray_hit *hits;
} batch;

// Neighbouring pixels' rays, those left out skipped. Measured against one ray at a time at 640x360, on the CPU's clock:
// 0.46 (Atrium) and 0.76 (Sponza) of the time towards a sun, 1.0 and 0.9 towards the VPLs of all pixels. Embree's flag
// for coherent rays and its streams made the latter 1.2 to 2.8 times slower.
enum { PACKET = 8 };

typedef struct packet {
    struct RTCRay8 rays;
    uint32_t index[PACKET]; // in the batch
    uint32_t count;
} packet;

static void packet_add(packet *p, const batch *b, uint32_t i)
{
    const uint32_t lane = p->count++;
    p->rays.org_x[lane] = b->origins[i][0];
    p->rays.org_y[lane] = b->origins[i][1];
    p->rays.org_z[lane] = b->origins[i][2];
    p->rays.tfar[lane] = b->origins[i][3];
    p->rays.dir_x[lane] = b->directions[i][0];
    p->rays.dir_y[lane] = b->directions[i][1];
    p->rays.dir_z[lane] = b->directions[i][2];
    p->rays.mask[lane] = ~0u;
    p->index[lane] = i;
}

// Answers the packet's rays and empties it.
static void packet_trace(packet *p, const batch *b, struct RTCIntersectContext *context)
{
    _Alignas(32) int valid[PACKET];
    for (uint32_t lane = 0; lane < PACKET; lane++)
        valid[lane] = lane < p->count ? -1 : 0;
    rtcOccluded8(valid, b->scene, context, &p->rays);
    for (uint32_t lane = 0; lane < p->count; lane++)
        b->visible[p->index[lane]] = p->rays.tfar[lane] > 0; // -inf where something was hit
    p->count = 0;
}

static void visible_run(uint32_t begin, uint32_t end, void *user)
{
    const batch *b = user;
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    packet p = {0};
    for (uint32_t i = begin; i < end; i++) {
        if (!(b->origins[i][3] > 0))
            continue;
        packet_add(&p, b, i);
        if (p.count == PACKET)
            packet_trace(&p, b, &context);
    }
    packet_trace(&p, b, &context);
}

static struct RTCRay ray_of(const batch *b, uint32_t i)
{
    return (struct RTCRay){
        .org_x = b->origins[i][0],
        .org_y = b->origins[i][1],
        .org_z = b->origins[i][2],
        .tfar = b->origins[i][3],
        .dir_x = b->directions[i][0],
        .dir_y = b->directions[i][1],
        .dir_z = b->directions[i][2],
        .mask = ~0u,
    };
}

static void nearest_run(uint32_t begin, uint32_t end, void *user)
{
    const batch *b = user;
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (uint32_t i = begin; i < end; i++) {
        struct RTCRayHit found = {.ray = ray_of(b, i), .hit.geomID = RTC_INVALID_GEOMETRY_ID};
        if (found.ray.tfar > 0)
            rtcIntersect1(b->scene, &context, &found);
        const struct RTCHit *hit = &found.hit;
        b->hits[i] = hit->geomID == RTC_INVALID_GEOMETRY_ID
                         ? (ray_hit){.instance = RAY_MISS}
                         : (ray_hit){hit->instID[0], hit->geomID, hit->primID, {hit->u, hit->v}};
    }
}

static void batch_run(embree_rays *rays, uint32_t count, void (*run)(uint32_t begin, uint32_t end, void *user), batch b)
{
    b.scene = rays->instances;
    if (!rays->failed)
        parallel_for(rays->pool, count, CHUNK, run, &b);
    else if (b.hits) // the frame goes on, and its shaders look up what was hit
        memset(b.hits, 0xff, count * sizeof *b.hits);
}

void embree_rays_visible(embree_rays *rays, const float (*origins)[4], const float (*directions)[4], uint32_t *visible,
                         uint32_t count)
{
    batch_run(rays, count, visible_run, (batch){.origins = origins, .directions = directions, .visible = visible});
}

void embree_rays_nearest(embree_rays *rays, const float (*origins)[4], const float (*directions)[4], ray_hit *hits,
                         uint32_t count)
{
    batch_run(rays, count, nearest_run, (batch){.origins = origins, .directions = directions, .hits = hits});
}
