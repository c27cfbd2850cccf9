// Recording, submitting and waiting: one command stream, whose submits run in order.
#include "gpu_internal.h"

#include <stdlib.h>

bool gpu_commands_init(gpu *gpu)
{
    const VkCommandPoolCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO,
        .flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT,
        .queueFamilyIndex = gpu->queue_family,
    };
    return VK(vkCreateCommandPool(gpu->device, &info, NULL, &gpu->command_pool), "commands");
}

void gpu_commands_fini(gpu *gpu)
{
    for (gpu_commands *commands = gpu->free_commands; commands;) {
        gpu_commands *next = commands->next;
        vkDestroyFence(gpu->device, commands->fence, NULL);
        free(commands);
        commands = next;
    }
    vkDestroyCommandPool(gpu->device, gpu->command_pool, NULL);
}

// Command buffers and fences are host memory, whose end is not recoverable.
static void require(bool done)
{
    if (!done)
        abort();
}

static gpu_commands *commands_create(gpu *gpu)
{
    gpu_commands *commands = memory_alloc(sizeof *commands);
    commands->gpu = gpu;
    const VkCommandBufferAllocateInfo info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO,
        .commandPool = gpu->command_pool,
        .level = VK_COMMAND_BUFFER_LEVEL_PRIMARY,
        .commandBufferCount = 1,
    };
    require(VK(vkAllocateCommandBuffers(gpu->device, &info, &commands->handle), "commands"));
    const VkFenceCreateInfo fence = {.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
    require(VK(vkCreateFence(gpu->device, &fence, NULL, &commands->fence), "commands"));
    return commands;
}

gpu_commands *gpu_commands_begin(gpu *gpu)
{
    gpu_commands *commands = gpu->free_commands;
    if (commands)
        gpu->free_commands = commands->next;
    else
        commands = commands_create(gpu);
    commands->pipeline = (gpu_pipeline){0};
    commands->indices = (gpu_buffer){0};
    const VkCommandBufferBeginInfo info = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
        .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT,
    };
    require(VK(vkBeginCommandBuffer(commands->handle, &info), "commands"));
    gpu->open_commands++;
    return commands;
}

VkCommandBuffer gpu_commands_handle(gpu_commands *commands)
{
    return commands->handle;
}

static void memory_barrier(gpu_commands *commands, const VkMemoryBarrier2 *barrier)
{
    const VkDependencyInfo dependency = {
        .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
        .memoryBarrierCount = 1,
        .pMemoryBarriers = barrier,
    };
    vkCmdPipelineBarrier2(commands->handle, &dependency);
}

static bool submit_and_wait(gpu *gpu, gpu_commands *commands)
{
    // A fence alone does not make the device's writes visible to reads of mapped memory.
    const VkMemoryBarrier2 to_host = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
        .srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
        .srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT,
        .dstStageMask = VK_PIPELINE_STAGE_2_HOST_BIT,
        .dstAccessMask = VK_ACCESS_2_HOST_READ_BIT,
    };
    memory_barrier(commands, &to_host);
    const VkCommandBufferSubmitInfo buffer = {
        .sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_SUBMIT_INFO,
        .commandBuffer = commands->handle,
    };
    const VkSubmitInfo2 info = {
        .sType = VK_STRUCTURE_TYPE_SUBMIT_INFO_2,
        .commandBufferInfoCount = 1,
        .pCommandBufferInfos = &buffer,
    };
    return VK(vkEndCommandBuffer(commands->handle), "commands") &&
           VK(vkQueueSubmit2(gpu->queue, 1, &info, commands->fence), "commands") &&
           VK(vkWaitForFences(gpu->device, 1, &commands->fence, VK_TRUE, UINT64_MAX), "commands") &&
           VK(vkResetFences(gpu->device, 1, &commands->fence), "commands");
}

bool gpu_commands_submit_and_wait(gpu *gpu, gpu_commands *commands)
{
    const bool done = submit_and_wait(gpu, commands);
    commands->next = gpu->free_commands;
    gpu->free_commands = commands;
    // Other commands may still be in recording, as when a texture is loaded in the middle of a frame.
    if (--gpu->open_commands == 0)
        gpu_garbage_flush(gpu);
    return done;
}

// ---- Bindings

// The infos that one gpu_bind's writes point to.
typedef struct binding_writes {
    VkWriteDescriptorSet writes[GPU_BINDINGS_MAX];
    VkDescriptorBufferInfo buffers[GPU_BINDINGS_MAX];
    VkDescriptorImageInfo images[GPU_BINDINGS_MAX];
    VkWriteDescriptorSetAccelerationStructureKHR accelerations[GPU_BINDINGS_MAX];
    uint32_t count;
} binding_writes;

static void binding_check(const gpu_pipeline_object *pipeline, uint32_t number, bool given, const char *expected)
{
    if (!given)
        log_error("%s: binding %u was given no %s", pipeline->name, number, expected);
    assert(given);
}

static VkDescriptorImageInfo image_binding(gpu *gpu, const gpu_binding *binding, VkDescriptorType type)
{
    static const gpu_sampler_desc nearest_clamped = {
        .wrap_u = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
        .wrap_v = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
    };
    const bool storage = type == VK_DESCRIPTOR_TYPE_STORAGE_IMAGE;
    return (VkDescriptorImageInfo){
        .sampler = storage ? VK_NULL_HANDLE : gpu_sampler_get(gpu, &nearest_clamped),
        .imageView = gpu_image_view(gpu, binding->image),
        .imageLayout = storage ? VK_IMAGE_LAYOUT_GENERAL : binding->layout,
    };
}

static void binding_write(gpu *gpu, const gpu_pipeline_object *pipeline, uint32_t number, const gpu_binding *binding,
                          binding_writes *out)
{
    const uint32_t i = out->count++;
    const VkDescriptorType type = pipeline->binding_types[number];
    out->writes[i] = (VkWriteDescriptorSet){
        .sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET,
        .dstBinding = number,
        .descriptorCount = 1,
        .descriptorType = type,
        .pBufferInfo = &out->buffers[i],
        .pImageInfo = &out->images[i],
    };
    if (type == VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR) {
        binding_check(pipeline, number, binding->acceleration.id, "acceleration structure");
        const gpu_acceleration_object *object = gpu_pool_get(&gpu->accelerations, binding->acceleration.id);
        out->accelerations[i] = (VkWriteDescriptorSetAccelerationStructureKHR){
            .sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET_ACCELERATION_STRUCTURE_KHR,
            .accelerationStructureCount = 1,
            .pAccelerationStructures = &object->owned.acceleration,
        };
        out->writes[i].pNext = &out->accelerations[i];
    } else if (type == VK_DESCRIPTOR_TYPE_STORAGE_IMAGE || type == VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER) {
        binding_check(pipeline, number, binding->image.id, "image");
        out->images[i] = image_binding(gpu, binding, type);
    } else {
        binding_check(pipeline, number, binding->buffer.id, "buffer");
        out->buffers[i] = (VkDescriptorBufferInfo){gpu_buffer_handle(gpu, binding->buffer), 0, VK_WHOLE_SIZE};
    }
}

void gpu_bind(gpu_commands *commands, gpu_pipeline pipeline, const gpu_binding *bindings, uint32_t count)
{
    gpu *gpu = commands->gpu;
    const gpu_pipeline_object *object = gpu_pool_get(&gpu->pipelines, pipeline.id);
    commands->pipeline = pipeline;
    vkCmdBindPipeline(commands->handle, object->bind_point, object->owned.pipeline);
    if (object->uses_scene)
        vkCmdBindDescriptorSets(commands->handle, object->bind_point, object->owned.layout, 1, 1, &gpu->scene_set, 0,
                                NULL);
    binding_writes writes;
    writes.count = 0;
    for (uint32_t number = 0; number < GPU_BINDINGS_MAX; number++) {
        if (!(object->binding_mask >> number & 1))
            continue;
        binding_check(object, number, number < count, "resource");
        binding_write(gpu, object, number, &bindings[number], &writes);
    }
    if (writes.count)
        gpu->vkCmdPushDescriptorSetKHR(commands->handle, object->bind_point, object->owned.layout, 0, writes.count,
                                       writes.writes);
}

void gpu_push(gpu_commands *commands, const void *data, uint32_t size)
{
    const gpu_pipeline_object *pipeline = gpu_pool_get(&commands->gpu->pipelines, commands->pipeline.id);
    assert(size >= pipeline->push_size && size <= GPU_PUSH_MAX && "the shader's block is another size");
    vkCmdPushConstants(commands->handle, pipeline->owned.layout, VK_SHADER_STAGE_ALL, 0, size, data);
}

// ---- Work

void gpu_dispatch(gpu_commands *commands, uint32_t x, uint32_t y, uint32_t z)
{
    if (x && y && z)
        vkCmdDispatch(commands->handle, x, y, z);
}

void gpu_dispatch_indirect(gpu_commands *commands, gpu_buffer buffer, VkDeviceSize offset)
{
    vkCmdDispatchIndirect(commands->handle, gpu_buffer_handle(commands->gpu, buffer), offset);
}

void gpu_trace_rays(gpu_commands *commands, uint32_t count)
{
    const gpu *gpu = commands->gpu;
    const gpu_pipeline_object *pipeline = gpu_pool_get(&gpu->pipelines, commands->pipeline.id);
    static const VkStridedDeviceAddressRegionKHR no_callables;
    assert(pipeline->bind_point == VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR);
    if (count)
        gpu->vkCmdTraceRaysKHR(commands->handle, &pipeline->raygen, &pipeline->miss, &pipeline->hit, &no_callables,
                               count, 1, 1);
}

void gpu_draw(gpu_commands *commands, uint32_t vertices, uint32_t instances, uint32_t first_instance)
{
    vkCmdDraw(commands->handle, vertices, instances, 0, first_instance);
}

void gpu_draw_indexed(gpu_commands *commands, gpu_buffer indices, uint32_t first_index, uint32_t count)
{
    if (commands->indices.id != indices.id) {
        vkCmdBindIndexBuffer(commands->handle, gpu_buffer_handle(commands->gpu, indices), 0, VK_INDEX_TYPE_UINT32);
        commands->indices = indices;
    }
    vkCmdDrawIndexed(commands->handle, count, 1, first_index, 0, 0);
}

void gpu_draw_indirect(gpu_commands *commands, gpu_buffer buffer, VkDeviceSize offset)
{
    vkCmdDrawIndirect(commands->handle, gpu_buffer_handle(commands->gpu, buffer), offset, 1,
                      sizeof(VkDrawIndirectCommand));
}

void gpu_viewport_set(gpu_commands *commands, float x, float y, float width, float height)
{
    const VkViewport viewport = {x, y, width, height, 0, 1};
    const VkRect2D scissor = {{(int32_t)x, (int32_t)y}, {(uint32_t)width, (uint32_t)height}};
    vkCmdSetViewport(commands->handle, 0, 1, &viewport);
    vkCmdSetScissor(commands->handle, 0, 1, &scissor);
}

void gpu_cull_set(gpu_commands *commands, VkCullModeFlags cull)
{
    vkCmdSetCullMode(commands->handle, cull);
}

void gpu_buffer_fill(gpu_commands *commands, gpu_buffer buffer, VkDeviceSize offset, VkDeviceSize size, uint32_t value)
{
    vkCmdFillBuffer(commands->handle, gpu_buffer_handle(commands->gpu, buffer), offset, size, value);
}

void gpu_buffer_copy(gpu_commands *commands, gpu_buffer from, gpu_buffer to, VkDeviceSize size)
{
    const VkBufferCopy region = {.size = size};
    vkCmdCopyBuffer(commands->handle, gpu_buffer_handle(commands->gpu, from), gpu_buffer_handle(commands->gpu, to), 1,
                    &region);
}

void gpu_memory_barrier(gpu_commands *commands)
{
    const VkPipelineStageFlags2 stages = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT |
                                         VK_PIPELINE_STAGE_2_VERTEX_SHADER_BIT |
                                         VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT | VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
    const VkAccessFlags2 writes = VK_ACCESS_2_SHADER_WRITE_BIT | VK_ACCESS_2_TRANSFER_WRITE_BIT;
    const VkAccessFlags2 reads =
        VK_ACCESS_2_SHADER_READ_BIT | VK_ACCESS_2_TRANSFER_READ_BIT | VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT;
    const VkMemoryBarrier2 barrier = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
        .srcStageMask = stages,
        .srcAccessMask = writes,
        .dstStageMask = stages | VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT,
        .dstAccessMask = reads | writes,
    };
    memory_barrier(commands, &barrier);
}

void gpu_label_begin(gpu_commands *commands, const char *name)
{
    if (!commands->gpu->vkCmdBeginDebugUtilsLabelEXT)
        return;
    const VkDebugUtilsLabelEXT label = {.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_LABEL_EXT, .pLabelName = name};
    commands->gpu->vkCmdBeginDebugUtilsLabelEXT(commands->handle, &label);
}

void gpu_label_end(gpu_commands *commands)
{
    if (commands->gpu->vkCmdEndDebugUtilsLabelEXT)
        commands->gpu->vkCmdEndDebugUtilsLabelEXT(commands->handle);
}
