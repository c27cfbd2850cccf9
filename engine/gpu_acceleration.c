// Acceleration structures for ray queries: bottom levels built once, or again where their triangles move, and top
// levels over them.
#include "gpu_internal.h"

#include <stdlib.h>

typedef struct acceleration_sizes {
    VkDeviceSize storage, scratch; // bytes
} acceleration_sizes;

static acceleration_sizes sizes_query(gpu *gpu, const VkAccelerationStructureBuildGeometryInfoKHR *build,
                                      const uint32_t *primitive_counts)
{
    VkAccelerationStructureBuildSizesInfoKHR sizes = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR,
    };
    gpu->vkGetAccelerationStructureBuildSizesKHR(gpu->device, VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, build,
                                                 primitive_counts, &sizes);
    const VkDeviceSize scratch =
        sizes.buildScratchSize > sizes.updateScratchSize ? sizes.buildScratchSize : sizes.updateScratchSize;
    return (acceleration_sizes){sizes.accelerationStructureSize, scratch};
}

// Room is added for aligning the address within the buffer.
static gpu_buffer scratch_create(gpu *gpu, VkDeviceSize size)
{
    const gpu_buffer_desc desc = {
        .name = "acceleration scratch",
        .size = size + gpu->scratch_alignment,
        .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
    };
    return gpu_buffer_create_unbound(gpu, &desc);
}

static VkDeviceAddress scratch_address(gpu *gpu, gpu_buffer scratch)
{
    return align_up(gpu_buffer_address(gpu, scratch), gpu->scratch_alignment);
}

// Makes the structure and its storage, unbuilt; {0} on failure.
static gpu_acceleration acceleration_create(gpu *gpu, VkAccelerationStructureTypeKHR type, VkDeviceSize size)
{
    const char *name = type == VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR ? "top level" : "bottom level";
    const gpu_buffer_desc desc = {
        .name = name,
        .size = size,
        .usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
    };
    const gpu_buffer storage = gpu_buffer_create(gpu, &desc);
    if (!storage.id)
        return (gpu_acceleration){0};
    const VkAccelerationStructureCreateInfoKHR info = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR,
        .buffer = gpu_buffer_handle(gpu, storage),
        .size = size,
        .type = type,
    };
    VkAccelerationStructureKHR handle;
    if (!VK(gpu->vkCreateAccelerationStructureKHR(gpu->device, &info, NULL, &handle), name)) {
        gpu_buffer_destroy(gpu, storage);
        return (gpu_acceleration){0};
    }
    gpu_name_set(gpu, VK_OBJECT_TYPE_ACCELERATION_STRUCTURE_KHR, (uint64_t)handle, name);
    gpu_acceleration acceleration;
    gpu_acceleration_object *object = gpu_pool_add(&gpu->accelerations, sizeof *object, &acceleration.id);
    object->owned.acceleration = handle;
    object->storage = storage;
    return acceleration;
}

static gpu_acceleration_object *acceleration_get(gpu *gpu, gpu_acceleration acceleration)
{
    return gpu_pool_get(&gpu->accelerations, acceleration.id);
}

void gpu_acceleration_destroy(gpu *gpu, gpu_acceleration acceleration)
{
    if (!acceleration.id)
        return;
    const gpu_acceleration_object *object = acceleration_get(gpu, acceleration);
    gpu_owned_retire(gpu, &object->owned);
    gpu_buffer_destroy(gpu, object->storage);
    gpu_buffer_destroy(gpu, object->scratch);
    gpu_pool_remove(&gpu->accelerations, acceleration.id);
}

VkDeviceAddress gpu_acceleration_address(gpu *gpu, gpu_acceleration acceleration)
{
    const VkAccelerationStructureDeviceAddressInfoKHR info = {
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR,
        .accelerationStructure = acceleration_get(gpu, acceleration)->owned.acceleration,
    };
    return gpu->vkGetAccelerationStructureDeviceAddressKHR(gpu->device, &info);
}

// ---- Bottom level

static VkAccelerationStructureGeometryKHR triangles_geometry(const gpu_triangles *triangles)
{
    return (VkAccelerationStructureGeometryKHR){
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
        .geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR,
        .geometry.triangles =
            {
                .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR,
                .vertexFormat = VK_FORMAT_R32G32B32_SFLOAT,
                .vertexData.deviceAddress = triangles->positions,
                .vertexStride = triangles->position_stride,
                .maxVertex = triangles->position_count ? triangles->position_count - 1 : 0,
                .indexType = VK_INDEX_TYPE_UINT32,
                .indexData.deviceAddress = triangles->indices,
            },
        .flags = triangles->opaque ? VK_GEOMETRY_OPAQUE_BIT_KHR : 0,
    };
}

// What a build takes, an item a geometry.
typedef struct blas_input {
    VkAccelerationStructureGeometryKHR *geometries;
    VkAccelerationStructureBuildRangeInfoKHR *ranges;
    uint32_t *primitive_counts;
    VkAccelerationStructureBuildGeometryInfoKHR build; // without its structures and scratch memory
} blas_input;

static blas_input blas_input_make(const gpu_triangles *triangles, uint32_t count, bool updatable)
{
    assert(count);
    blas_input input = {
        .geometries = memory_alloc(count * sizeof *input.geometries),
        .ranges = memory_alloc(count * sizeof *input.ranges),
        .primitive_counts = memory_alloc(count * sizeof *input.primitive_counts),
    };
    for (uint32_t i = 0; i < count; i++) {
        input.geometries[i] = triangles_geometry(&triangles[i]);
        input.ranges[i].primitiveCount = input.primitive_counts[i] = triangles[i].triangle_count;
    }
    input.build = (VkAccelerationStructureBuildGeometryInfoKHR){
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR,
        .type = VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR,
        .flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR |
                 (updatable ? VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR : 0),
        .mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
        .geometryCount = count,
        .pGeometries = input.geometries,
    };
    return input;
}

static void blas_input_free(const blas_input *input)
{
    free(input->primitive_counts);
    free(input->ranges);
    free(input->geometries);
}

static void blas_build_record(gpu_commands *commands, const gpu_acceleration_object *blas, blas_input *input)
{
    gpu *gpu = commands->gpu;
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = input->ranges;
    input->build.dstAccelerationStructure = blas->owned.acceleration;
    input->build.scratchData.deviceAddress = scratch_address(gpu, blas->scratch);
    gpu->vkCmdBuildAccelerationStructuresKHR(commands->handle, 1, &input->build, &ranges);
}

// Makes the structure with its scratch memory, and builds it.
static gpu_acceleration blas_create(gpu *gpu, blas_input *input)
{
    const acceleration_sizes sizes = sizes_query(gpu, &input->build, input->primitive_counts);
    const gpu_acceleration blas = acceleration_create(gpu, input->build.type, sizes.storage);
    if (!blas.id)
        return blas;
    gpu_acceleration_object *object = acceleration_get(gpu, blas);
    object->scratch = scratch_create(gpu, sizes.scratch);
    if (object->scratch.id) {
        gpu_commands *commands = gpu_commands_begin(gpu);
        blas_build_record(commands, object, input);
        if (gpu_commands_submit_and_wait(gpu, commands))
            return blas;
    }
    gpu_acceleration_destroy(gpu, blas);
    return (gpu_acceleration){0};
}

gpu_acceleration gpu_blas_create(gpu *gpu, const gpu_triangles *triangles, uint32_t count, bool updatable)
{
    blas_input input = blas_input_make(triangles, count, updatable);
    const gpu_acceleration blas = blas_create(gpu, &input);
    blas_input_free(&input);
    if (blas.id) {
        gpu_acceleration_object *object = acceleration_get(gpu, blas);
        object->updatable = updatable;
        if (!updatable) {
            gpu_buffer_destroy(gpu, object->scratch);
            object->scratch = (gpu_buffer){0};
        }
    }
    return blas;
}

void gpu_blas_build(gpu_commands *commands, gpu_acceleration blas, const gpu_triangles *triangles, uint32_t count,
                    bool update)
{
    const gpu_acceleration_object *object = acceleration_get(commands->gpu, blas);
    assert(object->updatable);
    blas_input input = blas_input_make(triangles, count, true);
    if (update) {
        input.build.mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR;
        input.build.srcAccelerationStructure = object->owned.acceleration;
    }
    blas_build_record(commands, object, &input);
    blas_input_free(&input);
}

void gpu_build_barrier(gpu_commands *commands)
{
    const VkMemoryBarrier2 barrier = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
        .srcStageMask = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
        .srcAccessMask =
            VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR | VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
        .dstStageMask = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
        .dstAccessMask =
            VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR | VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
    };
    const VkDependencyInfo dependency = {
        .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
        .memoryBarrierCount = 1,
        .pMemoryBarriers = &barrier,
    };
    vkCmdPipelineBarrier2(commands->handle, &dependency);
}

// ---- Top level

static VkAccelerationStructureGeometryKHR instances_geometry(VkDeviceAddress instances)
{
    return (VkAccelerationStructureGeometryKHR){
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR,
        .geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR,
        .geometry.instances =
            {
                .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR,
                .data.deviceAddress = instances,
            },
    };
}

static VkAccelerationStructureBuildGeometryInfoKHR tlas_build_info(const VkAccelerationStructureGeometryKHR *instances)
{
    return (VkAccelerationStructureBuildGeometryInfoKHR){
        .sType = VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR,
        .type = VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR,
        .flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR,
        .mode = VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR,
        .geometryCount = 1,
        .pGeometries = instances,
    };
}

gpu_acceleration gpu_tlas_create(gpu *gpu, uint32_t max_instances)
{
    const VkAccelerationStructureGeometryKHR geometry = instances_geometry(0);
    const VkAccelerationStructureBuildGeometryInfoKHR build = tlas_build_info(&geometry);
    const acceleration_sizes sizes = sizes_query(gpu, &build, &max_instances);
    const gpu_acceleration tlas = acceleration_create(gpu, build.type, sizes.storage);
    if (!tlas.id)
        return tlas;
    gpu_acceleration_object *object = acceleration_get(gpu, tlas);
    object->max_instances = max_instances;
    object->scratch = scratch_create(gpu, sizes.scratch);
    if (object->scratch.id)
        return tlas;
    gpu_acceleration_destroy(gpu, tlas);
    return (gpu_acceleration){0};
}

void gpu_tlas_build(gpu_commands *commands, gpu_acceleration tlas, gpu_buffer instances, uint32_t count)
{
    gpu *gpu = commands->gpu;
    const gpu_acceleration_object *object = acceleration_get(gpu, tlas);
    assert(count <= object->max_instances);
    gpu_build_barrier(commands); // a second build in one command stream waits for the first one's use of the scratch

    const VkAccelerationStructureGeometryKHR geometry = instances_geometry(gpu_buffer_address(gpu, instances));
    VkAccelerationStructureBuildGeometryInfoKHR build = tlas_build_info(&geometry);
    build.dstAccelerationStructure = object->owned.acceleration;
    build.scratchData.deviceAddress = scratch_address(gpu, object->scratch);
    const VkAccelerationStructureBuildRangeInfoKHR range = {.primitiveCount = count};
    const VkAccelerationStructureBuildRangeInfoKHR *ranges = &range;
    gpu->vkCmdBuildAccelerationStructuresKHR(commands->handle, 1, &build, &ranges);
}
