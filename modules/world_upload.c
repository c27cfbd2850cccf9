// What of the scene never changes, on the GPU, or is deformed there: geometry, textures and bottom-level acceleration
// structures; and materials as they are at first.
#include "world.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

// ---- Buffers

// On a CPU the geometry stays mapped, so that Embree traces the same memory; it may read 16 bytes past the positions.
static gpu_buffer geometry_create(gpu *gpu, const gpu_buffer_desc *source)
{
    enum { PADDING = 16 };
    gpu_buffer_desc desc = *source;
    desc.host = true;
    desc.size += PADDING;
    desc.data = NULL;
    const gpu_buffer buffer = gpu_buffer_create(gpu, &desc);
    if (buffer.id && source->size)
        memcpy(gpu_buffer_map(gpu, buffer), source->data, source->size);
    return buffer;
}

static bool buffers_upload(renderer *r)
{
    const scene_data *s = r->scene;
    world_gpu *w = r->gpu_world;
    const VkBufferUsageFlags storage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT;
    const VkBufferUsageFlags geometry = storage | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                                        VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR;
    const struct {
        gpu_buffer *buffer;
        const char *name;
        uint32_t binding;
        VkBufferUsageFlags usage;
        const void *data;
        VkDeviceSize size;
    } uploads[] = {
        {&w->positions, "positions", SCENE_POSITIONS, geometry, s->positions, s->vertex_count * sizeof *s->positions},
        {&w->attributes, "attributes", SCENE_ATTRIBUTES, storage, s->attributes,
         s->vertex_count * sizeof *s->attributes},
        {&w->indices, "indices", SCENE_INDICES, geometry, s->indices, s->index_count * sizeof *s->indices},
        {&w->primitives, "primitives", SCENE_PRIMITIVES, storage, s->primitives,
         s->primitive_count * sizeof *s->primitives},
        {&w->materials, "materials", SCENE_MATERIALS, storage, s->materials, s->material_count * sizeof *s->materials},
    };
    for (size_t i = 0; i < countof(uploads); i++) {
        const gpu_buffer_desc desc = {
            .name = uploads[i].name,
            .size = uploads[i].size,
            .usage = uploads[i].usage,
            .data = uploads[i].size ? uploads[i].data : NULL,
        };
        const bool mapped = uploads[i].usage == geometry && gpu_is_cpu(r->gpu);
        *uploads[i].buffer = mapped ? geometry_create(r->gpu, &desc) : gpu_buffer_create(r->gpu, &desc);
        if (!uploads[i].buffer->id)
            return false;
        gpu_scene_bind_buffer(r->gpu, uploads[i].binding, *uploads[i].buffer);
    }
    return true;
}

// ---- Textures

static VkSamplerAddressMode wrap_of(int gl)
{
    enum { GL_CLAMP_TO_EDGE = 33071, GL_MIRRORED_REPEAT = 33648 };
    if (gl == GL_CLAMP_TO_EDGE)
        return VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
    return gl == GL_MIRRORED_REPEAT ? VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT : VK_SAMPLER_ADDRESS_MODE_REPEAT;
}

static gpu_sampler_desc sampler_of(const scene_texture *texture)
{
    enum {
        GL_NEAREST = 9728,
        GL_LINEAR = 9729,
        GL_NEAREST_MIPMAP_NEAREST = 9984,
        GL_LINEAR_MIPMAP_NEAREST = 9985,
        GL_NEAREST_MIPMAP_LINEAR = 9986,
    };
    const int min = texture->min_filter;
    const bool min_nearest = min == GL_NEAREST || min == GL_NEAREST_MIPMAP_NEAREST || min == GL_NEAREST_MIPMAP_LINEAR;
    const bool mip_nearest = min == GL_NEAREST_MIPMAP_NEAREST || min == GL_LINEAR_MIPMAP_NEAREST;
    return (gpu_sampler_desc){
        .mag = texture->mag_filter == GL_NEAREST ? VK_FILTER_NEAREST : VK_FILTER_LINEAR,
        .min = min_nearest ? VK_FILTER_NEAREST : VK_FILTER_LINEAR,
        .mipmap = mip_nearest ? VK_SAMPLER_MIPMAP_MODE_NEAREST : VK_SAMPLER_MIPMAP_MODE_LINEAR,
        .wrap_u = wrap_of(texture->wrap_s),
        .wrap_v = wrap_of(texture->wrap_t),
        .no_mips = min == GL_NEAREST || min == GL_LINEAR,
    };
}

static uint32_t mip_count(uint32_t width, uint32_t height)
{
    uint32_t count = 1;
    for (uint32_t size = max_u32(width, height); size > 1; size /= 2)
        count++;
    return count;
}

static gpu_image image_upload(gpu *gpu, const scene_image *image, bool srgb)
{
    static const uint8_t white[4] = {255, 255, 255, 255}, flat_normal[4] = {128, 128, 255, 255};
    const bool present = image->texels; // else a texel stands in for what could not be read
    const uint32_t width = present ? image->width : 1, height = present ? image->height : 1;
    const gpu_image_desc desc = {
        .name = image->name,
        .format = srgb ? VK_FORMAT_R8G8B8A8_SRGB : VK_FORMAT_R8G8B8A8_UNORM,
        .width = width,
        .height = height,
        .mips = mip_count(width, height),
        .usage = VK_IMAGE_USAGE_SAMPLED_BIT,
        .data = present ? image->texels
                : srgb  ? white
                        : flat_normal,
    };
    return gpu_image_create(gpu, &desc);
}

// Textures of the same image and colour space share the image on the GPU.
static bool textures_upload(renderer *r)
{
    const scene_data *s = r->scene;
    world_gpu *w = r->gpu_world;
    if (s->texture_count > GPU_SCENE_TEXTURES_MAX) {
        log_error("%s: %u textures; at most %u are possible", s->path, s->texture_count, GPU_SCENE_TEXTURES_MAX);
        return false;
    }
    w->textures = memory_alloc(max_u32(2 * s->image_count, 1) * sizeof *w->textures);
    w->texture_count = 2 * s->image_count;
    for (uint32_t i = 0; i < s->texture_count; i++) {
        const scene_texture *texture = &s->textures[i];
        gpu_image *image = &w->textures[2 * texture->image + texture->srgb];
        if (!image->id)
            *image = image_upload(r->gpu, &s->images[texture->image], texture->srgb);
        if (!image->id)
            return false;
        const gpu_sampler_desc sampler = sampler_of(texture);
        gpu_scene_bind_texture(r->gpu, i, *image, &sampler);
    }
    return true;
}

// ---- Meshes

static box primitive_box(const scene_data *s, const mesh_primitive *p)
{
    box b = {{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};
    for (uint32_t i = 0; i < p->index_count; i++) {
        const float *position = s->positions[p->first_vertex + s->indices[p->first_index + i]];
        for (int k = 0; k < 3; k++) {
            b.min[k] = position[k] < b.min[k] ? position[k] : b.min[k];
            b.max[k] = position[k] > b.max[k] ? position[k] : b.max[k];
        }
    }
    return b;
}

void world_mesh_triangles(const renderer *r, uint32_t index, VkDeviceAddress positions, uint32_t stride,
                          gpu_triangles *geometries)
{
    const scene_data *s = r->scene;
    const scene_mesh *mesh = &s->meshes[index];
    const VkDeviceAddress indices = gpu_buffer_address(r->gpu, r->gpu_world->indices);
    for (uint32_t i = 0; i < mesh->primitive_count; i++) {
        const mesh_primitive *p = &s->primitives[mesh->first_primitive + i];
        geometries[i] = (gpu_triangles){
            .positions = positions + (VkDeviceAddress)p->first_vertex * stride,
            .position_stride = stride,
            .position_count = p->vertex_count,
            .indices = indices + p->first_index * sizeof *s->indices,
            .triangle_count = p->index_count / 3,
            .opaque = !(s->materials[p->material].flags & MATERIAL_ALPHA_MASK),
        };
    }
}

// One geometry a primitive, so that a ray's geometry index counts primitives. {0} and true for a mesh without
// triangles.
static bool blas_build(renderer *r, uint32_t index, bool deforms, gpu_acceleration *blas)
{
    const scene_data *s = r->scene;
    const uint32_t count = s->meshes[index].primitive_count;
    gpu_triangles *geometries = memory_alloc(max_u32(count, 1) * sizeof *geometries);
    world_mesh_triangles(r, index, gpu_buffer_address(r->gpu, r->gpu_world->positions), sizeof *s->positions,
                         geometries);
    uint64_t triangles = 0;
    for (uint32_t i = 0; i < count; i++)
        triangles += geometries[i].triangle_count;
    if (triangles > 0)
        *blas = gpu_blas_create(r->gpu, geometries, count, deforms);
    free(geometries);
    return triangles == 0 || blas->id;
}

static bool meshes_upload(renderer *r)
{
    const scene_data *s = r->scene;
    world_gpu *w = r->gpu_world;
    w->primitive_boxes = memory_alloc(max_u32(s->primitive_count, 1) * sizeof *w->primitive_boxes);
    for (uint32_t i = 0; i < s->primitive_count; i++)
        w->primitive_boxes[i] = primitive_box(s, &s->primitives[i]);
    w->blas = memory_alloc(max_u32(s->mesh_count, 1) * sizeof *w->blas);
    w->blas_count = s->mesh_count;
    bool *deforms = memory_alloc(max_u32(s->mesh_count, 1) * sizeof *deforms);
    for (uint32_t i = 0; i < s->deformation_count; i++)
        deforms[s->deformations[i].mesh] = true;
    bool built = true;
    for (uint32_t i = 0; i < s->mesh_count && built; i++)
        built = blas_build(r, i, deforms[i], &w->blas[i]);
    free(deforms);
    return built;
}

bool world_upload(renderer *r)
{
    return buffers_upload(r) && textures_upload(r) && meshes_upload(r);
}
