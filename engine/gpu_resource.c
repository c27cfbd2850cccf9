// Handle pools, memory, buffers and images, with the staging copies that fill and read them.
#include "gpu_internal.h"

#include <stdlib.h>
#include <string.h>

// ---- Handle pools

enum { SLOT_BITS = 20, SLOT_MASK = (1 << SLOT_BITS) - 1, GENERATION_MASK = (1 << (32 - SLOT_BITS)) - 1 };

void *gpu_pool_add(gpu_pool *pool, size_t object_size, uint32_t *id)
{
    uint32_t number = pool->first_free;
    if (number) {
        pool->first_free = pool->slots[number - 1].next_free;
    } else {
        memory_reserve((void **)&pool->slots, &pool->capacity, pool->count + 1, sizeof *pool->slots);
        number = ++pool->count;
        assert(number <= SLOT_MASK);
    }
    gpu_slot *slot = &pool->slots[number - 1];
    slot->object = memory_alloc(object_size);
    *id = slot->generation << SLOT_BITS | number;
    return slot->object;
}

static gpu_slot *pool_slot(const gpu_pool *pool, uint32_t id)
{
    const uint32_t number = id & SLOT_MASK;
    assert(number && number <= pool->count && "null or foreign handle");
    gpu_slot *slot = &pool->slots[number - 1];
    assert(slot->object && slot->generation == id >> SLOT_BITS && "handle of a destroyed object");
    return slot;
}

void *gpu_pool_get(const gpu_pool *pool, uint32_t id)
{
    return pool_slot(pool, id)->object;
}

void gpu_pool_remove(gpu_pool *pool, uint32_t id)
{
    gpu_slot *slot = pool_slot(pool, id);
    free(slot->object);
    slot->object = NULL;
    slot->generation = (slot->generation + 1) & GENERATION_MASK;
    slot->next_free = pool->first_free;
    pool->first_free = id & SLOT_MASK;
}

void gpu_pool_fini(gpu *gpu, gpu_pool *pool)
{
    for (uint32_t i = 0; i < pool->count; i++) {
        if (!pool->slots[i].object)
            continue;
        gpu_owned_destroy(gpu, pool->slots[i].object);
        free(pool->slots[i].object);
    }
    free(pool->slots);
    *pool = (gpu_pool){0};
}

// ---- Ownership and deferred destruction

void gpu_owned_destroy(gpu *gpu, const gpu_owned *owned)
{
    gpu->vkDestroyAccelerationStructureKHR(gpu->device, owned->acceleration, NULL);
    vkDestroyBuffer(gpu->device, owned->buffer, NULL);
    vkDestroyImageView(gpu->device, owned->view, NULL);
    vkDestroyImage(gpu->device, owned->image, NULL);
    vkDestroyPipeline(gpu->device, owned->pipeline, NULL);
    vkDestroyPipelineLayout(gpu->device, owned->layout, NULL);
    vkDestroyDescriptorSetLayout(gpu->device, owned->set_layout, NULL);
    vkFreeMemory(gpu->device, owned->memory, NULL);
    gpu->memory_used -= owned->memory_size;
}

void gpu_owned_retire(gpu *gpu, const gpu_owned *owned)
{
    memory_reserve((void **)&gpu->garbage, &gpu->garbage_capacity, gpu->garbage_count + 1, sizeof *gpu->garbage);
    gpu->garbage[gpu->garbage_count++] = *owned;
    if (!gpu->open_commands)
        gpu_garbage_flush(gpu);
}

void gpu_garbage_flush(gpu *gpu)
{
    for (size_t i = 0; i < gpu->garbage_count; i++)
        gpu_owned_destroy(gpu, &gpu->garbage[i]);
    gpu->garbage_count = 0;
}

// ---- Memory

// Returns the best of the allowed types: host memory must be visible and coherent, and is better cached, for reading
// back; other memory is best device-local, and better not visible to the host, as that part may be small.
static uint32_t memory_type_pick(const gpu *gpu, uint32_t allowed, bool host)
{
    const VkMemoryPropertyFlags required =
        host ? VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT : 0;
    const VkMemoryPropertyFlags wanted =
        host ? VK_MEMORY_PROPERTY_HOST_CACHED_BIT : VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
    const VkMemoryPropertyFlags unwanted =
        host ? VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT : VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT;
    const VkMemoryPropertyFlags refused = VK_MEMORY_PROPERTY_LAZILY_ALLOCATED_BIT | VK_MEMORY_PROPERTY_PROTECTED_BIT |
                                          VK_MEMORY_PROPERTY_DEVICE_COHERENT_BIT_AMD |
                                          VK_MEMORY_PROPERTY_RDMA_CAPABLE_BIT_NV;
    uint32_t best = UINT32_MAX;
    int best_score = -1;
    for (uint32_t i = 0; i < gpu->memory_types.memoryTypeCount; i++) {
        const VkMemoryPropertyFlags flags = gpu->memory_types.memoryTypes[i].propertyFlags;
        if (!(allowed >> i & 1) || (flags & required) != required || (flags & refused))
            continue;
        const int score = (flags & wanted ? 2 : 0) + (flags & unwanted ? 0 : 1);
        if (score > best_score) {
            best = i;
            best_score = score;
        }
    }
    return best;
}

// Gives `owned` memory of its own. All allocations allow device addresses where `address` is set.
static bool memory_allocate(gpu *gpu, gpu_owned *owned, const VkMemoryRequirements *needs, bool host, bool address,
                            const char *name)
{
    const uint32_t type = memory_type_pick(gpu, needs->memoryTypeBits, host);
    if (type == UINT32_MAX) {
        log_error("%s: the device has no suitable memory type", name ? name : "unnamed");
        return false;
    }
    const VkMemoryAllocateFlagsInfo flags = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO,
        .flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT,
    };
    const VkMemoryAllocateInfo info = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO,
        .pNext = address ? &flags : NULL,
        .allocationSize = needs->size,
        .memoryTypeIndex = type,
    };
    const VkResult result = vkAllocateMemory(gpu->device, &info, NULL, &owned->memory);
    if (result != VK_SUCCESS) {
        log_error("%s: cannot allocate %.1f MB of %s memory, %.1f MB being in use", name ? name : "unnamed",
                  (double)needs->size * 1e-6, host ? "host" : "device", (double)gpu->memory_used * 1e-6);
        return false;
    }
    owned->memory_size = needs->size;
    gpu->memory_used += needs->size;
    if (gpu->memory_used > gpu->memory_peak)
        gpu->memory_peak = gpu->memory_used;
    gpu_name_set(gpu, VK_OBJECT_TYPE_DEVICE_MEMORY, (uint64_t)owned->memory, name);
    return true;
}

gpu_memory gpu_memory_create(gpu *gpu, const VkMemoryRequirements *requirements)
{
    gpu_owned owned = {0};
    if (!memory_allocate(gpu, &owned, requirements, false, true, "transient memory"))
        return (gpu_memory){0};
    gpu_memory memory;
    gpu_memory_object *object = gpu_pool_add(&gpu->memories, sizeof *object, &memory.id);
    object->owned = owned;
    return memory;
}

void gpu_memory_destroy(gpu *gpu, gpu_memory memory)
{
    if (!memory.id)
        return;
    const gpu_memory_object *object = gpu_pool_get(&gpu->memories, memory.id);
    gpu_owned_retire(gpu, &object->owned);
    gpu_pool_remove(&gpu->memories, memory.id);
}

VkDeviceSize gpu_storage_buffer_max(const gpu *gpu)
{
    return gpu->properties.limits.maxStorageBufferRange;
}

VkDeviceSize gpu_memory_used(const gpu *gpu)
{
    return gpu->memory_used;
}
VkDeviceSize gpu_memory_peak(const gpu *gpu)
{
    return gpu->memory_peak;
}
void gpu_memory_peak_reset(gpu *gpu)
{
    gpu->memory_peak = gpu->memory_used;
}

// The memory that a resource placed at `offset` of `memory` binds to, or its own, allocated here.
static VkDeviceMemory memory_place(gpu *gpu, gpu_memory memory, VkDeviceSize offset, gpu_owned *owned,
                                   const VkMemoryRequirements *needs, bool host, bool address, const char *name)
{
    if (!memory.id)
        return memory_allocate(gpu, owned, needs, host, address, name) ? owned->memory : VK_NULL_HANDLE;
    const gpu_memory_object *object = gpu_pool_get(&gpu->memories, memory.id);
    assert(!host && "host buffers have their own allocation");
    assert(offset % needs->alignment == 0 && offset + needs->size <= object->owned.memory_size);
    return object->owned.memory;
}

// ---- Buffers

static VkBufferCreateInfo buffer_info(const gpu_buffer_desc *desc)
{
    return (VkBufferCreateInfo){
        .sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
        .size = desc->size ? desc->size : 16,
        .usage = desc->usage | VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
    };
}

static bool buffer_fits_limits(const gpu *gpu, const gpu_buffer_desc *desc)
{
    const VkDeviceSize limit = gpu->properties.limits.maxStorageBufferRange;
    if (!(desc->usage & VK_BUFFER_USAGE_STORAGE_BUFFER_BIT) || desc->size <= limit)
        return true;
    log_error("%s: needs %.1f MB, and %s allows storage buffers of %.1f MB", desc->name ? desc->name : "unnamed",
              (double)desc->size * 1e-6, gpu->properties.deviceName, (double)limit * 1e-6);
    return false;
}

// Creates the Vulkan objects; on failure those made so far are left in `owned`.
static bool buffer_allocate(gpu *gpu, const gpu_buffer_desc *desc, gpu_owned *owned, void **mapping)
{
    const VkBufferCreateInfo info = buffer_info(desc);
    if (!VK(vkCreateBuffer(gpu->device, &info, NULL, &owned->buffer), desc->name))
        return false;
    gpu_name_set(gpu, VK_OBJECT_TYPE_BUFFER, (uint64_t)owned->buffer, desc->name);
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(gpu->device, owned->buffer, &needs);
    const bool address = desc->usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
    const VkDeviceMemory memory =
        memory_place(gpu, desc->memory, desc->offset, owned, &needs, desc->host, address, desc->name);
    if (!memory || !VK(vkBindBufferMemory(gpu->device, owned->buffer, memory, desc->offset), desc->name))
        return false;
    return !desc->host || VK(vkMapMemory(gpu->device, memory, 0, VK_WHOLE_SIZE, 0, mapping), desc->name);
}

gpu_buffer gpu_buffer_create(gpu *gpu, const gpu_buffer_desc *desc)
{
    return buffer_fits_limits(gpu, desc) ? gpu_buffer_create_unbound(gpu, desc) : (gpu_buffer){0};
}

gpu_buffer gpu_buffer_create_unbound(gpu *gpu, const gpu_buffer_desc *desc)
{
    assert(desc->memory.id || !desc->offset);
    gpu_owned owned = {0};
    void *mapping = NULL;
    if (!buffer_allocate(gpu, desc, &owned, &mapping)) {
        gpu_owned_destroy(gpu, &owned);
        return (gpu_buffer){0};
    }
    gpu_buffer buffer;
    gpu_buffer_object *object = gpu_pool_add(&gpu->buffers, sizeof *object, &buffer.id);
    *object = (gpu_buffer_object){owned, buffer_info(desc).size, buffer_info(desc).usage, mapping};
    if (desc->data && desc->size && !gpu_buffer_write(gpu, buffer, 0, desc->data, desc->size)) {
        gpu_buffer_destroy(gpu, buffer);
        return (gpu_buffer){0};
    }
    return buffer;
}

void gpu_buffer_destroy(gpu *gpu, gpu_buffer buffer)
{
    if (!buffer.id)
        return;
    gpu_owned_retire(gpu, &gpu_buffer_get(gpu, buffer)->owned);
    gpu_pool_remove(&gpu->buffers, buffer.id);
}

gpu_buffer_object *gpu_buffer_get(const gpu *gpu, gpu_buffer buffer)
{
    return gpu_pool_get(&gpu->buffers, buffer.id);
}
VkDeviceSize gpu_buffer_size(gpu *gpu, gpu_buffer buffer)
{
    return gpu_buffer_get(gpu, buffer)->size;
}
VkBuffer gpu_buffer_handle(gpu *gpu, gpu_buffer buffer)
{
    return gpu_buffer_get(gpu, buffer)->owned.buffer;
}

void *gpu_buffer_map(gpu *gpu, gpu_buffer buffer)
{
    void *mapping = gpu_buffer_get(gpu, buffer)->mapping;
    assert(mapping && "only host buffers are mapped");
    return mapping;
}

VkDeviceAddress gpu_buffer_address(gpu *gpu, gpu_buffer buffer)
{
    const gpu_buffer_object *object = gpu_buffer_get(gpu, buffer);
    assert(object->usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT);
    const VkBufferDeviceAddressInfo info = {
        .sType = VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO,
        .buffer = object->owned.buffer,
    };
    return vkGetBufferDeviceAddress(gpu->device, &info);
}

VkMemoryRequirements gpu_buffer_requirements(gpu *gpu, const gpu_buffer_desc *desc)
{
    const VkBufferCreateInfo info = buffer_info(desc);
    const VkDeviceBufferMemoryRequirements query = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_BUFFER_MEMORY_REQUIREMENTS,
        .pCreateInfo = &info,
    };
    VkMemoryRequirements2 needs = {.sType = VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2};
    vkGetDeviceBufferMemoryRequirements(gpu->device, &query, &needs);
    return needs.memoryRequirements;
}

static gpu_buffer staging_create(gpu *gpu, VkDeviceSize size)
{
    const gpu_buffer_desc desc = {.name = "staging", .size = size, .host = true};
    return gpu_buffer_create(gpu, &desc);
}

static bool buffer_copy_and_wait(gpu *gpu, gpu_buffer from, gpu_buffer to, const VkBufferCopy *region)
{
    gpu_commands *commands = gpu_commands_begin(gpu);
    vkCmdCopyBuffer(commands->handle, gpu_buffer_handle(gpu, from), gpu_buffer_handle(gpu, to), 1, region);
    return gpu_commands_submit_and_wait(gpu, commands);
}

bool gpu_buffer_write(gpu *gpu, gpu_buffer buffer, VkDeviceSize offset, const void *data, VkDeviceSize size)
{
    const gpu_buffer_object *object = gpu_buffer_get(gpu, buffer);
    assert(offset + size <= object->size);
    if (!size)
        return true;
    if (object->mapping) {
        memcpy((char *)object->mapping + offset, data, size);
        return true;
    }
    const gpu_buffer staging = staging_create(gpu, size);
    if (!staging.id)
        return false;
    memcpy(gpu_buffer_map(gpu, staging), data, size);
    const VkBufferCopy region = {.dstOffset = offset, .size = size};
    const bool copied = buffer_copy_and_wait(gpu, staging, buffer, &region);
    gpu_buffer_destroy(gpu, staging);
    return copied;
}

bool gpu_buffer_read(gpu *gpu, gpu_buffer buffer, VkDeviceSize offset, void *data, VkDeviceSize size)
{
    const gpu_buffer_object *object = gpu_buffer_get(gpu, buffer);
    assert(offset + size <= object->size);
    if (!size)
        return true;
    if (object->mapping) {
        memcpy(data, (const char *)object->mapping + offset, size);
        return true;
    }
    const gpu_buffer staging = staging_create(gpu, size);
    if (!staging.id)
        return false;
    const VkBufferCopy region = {.srcOffset = offset, .size = size};
    const bool copied = buffer_copy_and_wait(gpu, buffer, staging, &region);
    if (copied)
        memcpy(data, gpu_buffer_map(gpu, staging), size);
    gpu_buffer_destroy(gpu, staging);
    return copied;
}

// ---- Images

typedef struct format_entry {
    VkFormat format;
    uint32_t size; // bytes per texel
} format_entry;

static const format_entry formats[] = {
    {VK_FORMAT_R8_UNORM, 1},
    {VK_FORMAT_R8_UINT, 1},
    {VK_FORMAT_R8G8_UNORM, 2},
    {VK_FORMAT_R8G8_SNORM, 2},
    {VK_FORMAT_R16_UINT, 2},
    {VK_FORMAT_R16_UNORM, 2},
    {VK_FORMAT_R16_SFLOAT, 2},
    {VK_FORMAT_R8G8B8A8_UNORM, 4},
    {VK_FORMAT_R8G8B8A8_SRGB, 4},
    {VK_FORMAT_R8G8B8A8_UINT, 4},
    {VK_FORMAT_B8G8R8A8_UNORM, 4},
    {VK_FORMAT_B8G8R8A8_SRGB, 4},
    {VK_FORMAT_A2B10G10R10_UNORM_PACK32, 4},
    {VK_FORMAT_B10G11R11_UFLOAT_PACK32, 4},
    {VK_FORMAT_E5B9G9R9_UFLOAT_PACK32, 4},
    {VK_FORMAT_R16G16_UNORM, 4},
    {VK_FORMAT_R16G16_SNORM, 4},
    {VK_FORMAT_R16G16_UINT, 4},
    {VK_FORMAT_R16G16_SFLOAT, 4},
    {VK_FORMAT_R32_UINT, 4},
    {VK_FORMAT_R32_SINT, 4},
    {VK_FORMAT_R32_SFLOAT, 4},
    {VK_FORMAT_R16G16B16A16_UNORM, 8},
    {VK_FORMAT_R16G16B16A16_SNORM, 8},
    {VK_FORMAT_R16G16B16A16_UINT, 8},
    {VK_FORMAT_R16G16B16A16_SFLOAT, 8},
    {VK_FORMAT_R32G32_UINT, 8},
    {VK_FORMAT_R32G32_SFLOAT, 8},
    {VK_FORMAT_R64_UINT, 8},
    {VK_FORMAT_R32G32B32A32_UINT, 16},
    {VK_FORMAT_R32G32B32A32_SFLOAT, 16},
    {VK_FORMAT_D16_UNORM, 2},
    {VK_FORMAT_D32_SFLOAT, 4},
};

uint32_t gpu_format_size(VkFormat format)
{
    for (size_t i = 0; i < countof(formats); i++)
        if (formats[i].format == format)
            return formats[i].size;
    assert(!"format missing from the table above");
    return 0;
}

VkImageAspectFlags gpu_format_aspect(VkFormat format)
{
    const bool depth = format == VK_FORMAT_D16_UNORM || format == VK_FORMAT_D32_SFLOAT;
    return depth ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT;
}

static VkImageCreateInfo image_info(const gpu_image_desc *desc)
{
    return (VkImageCreateInfo){
        .sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO,
        .imageType = VK_IMAGE_TYPE_2D,
        .format = desc->format,
        .extent = {desc->width, desc->height, 1},
        .mipLevels = max_u32(desc->mips, 1),
        .arrayLayers = 1,
        .samples = VK_SAMPLE_COUNT_1_BIT,
        .tiling = VK_IMAGE_TILING_OPTIMAL,
        .usage = desc->usage | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT,
    };
}

static bool view_create(gpu *gpu, const gpu_image_desc *desc, gpu_owned *owned)
{
    const VkImageViewCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO,
        .image = owned->image,
        .viewType = VK_IMAGE_VIEW_TYPE_2D,
        .format = desc->format,
        .subresourceRange = {gpu_format_aspect(desc->format), 0, max_u32(desc->mips, 1), 0, 1},
    };
    if (!VK(vkCreateImageView(gpu->device, &info, NULL, &owned->view), desc->name))
        return false;
    gpu_name_set(gpu, VK_OBJECT_TYPE_IMAGE_VIEW, (uint64_t)owned->view, desc->name);
    return true;
}

// Creates the Vulkan objects; on failure those made so far are left in `owned`.
static bool image_allocate(gpu *gpu, const gpu_image_desc *desc, gpu_owned *owned)
{
    const VkImageCreateInfo info = image_info(desc);
    if (!VK(vkCreateImage(gpu->device, &info, NULL, &owned->image), desc->name))
        return false;
    gpu_name_set(gpu, VK_OBJECT_TYPE_IMAGE, (uint64_t)owned->image, desc->name);
    VkMemoryRequirements needs;
    vkGetImageMemoryRequirements(gpu->device, owned->image, &needs);
    const VkDeviceMemory memory =
        memory_place(gpu, desc->memory, desc->offset, owned, &needs, false, false, desc->name);
    if (!memory || !VK(vkBindImageMemory(gpu->device, owned->image, memory, desc->offset), desc->name))
        return false;
    // An image that is only copied can have no view.
    return !desc->usage || view_create(gpu, desc, owned);
}

typedef struct image_transition {
    const gpu_image_object *image;
    uint32_t first_mip, mips;
    VkImageLayout from, to;
} image_transition;

// For loading and reading back only: waits for everything.
static void image_transition_record(gpu_commands *commands, const image_transition *transition)
{
    const VkAccessFlags2 all = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT;
    const gpu_image_object *image = transition->image;
    const VkImageMemoryBarrier2 barrier = {
        .sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2,
        .srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
        .srcAccessMask = all,
        .dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
        .dstAccessMask = all,
        .oldLayout = transition->from,
        .newLayout = transition->to,
        .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
        .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
        .image = image->owned.image,
        .subresourceRange = {gpu_format_aspect(image->info.format), transition->first_mip, transition->mips, 0, 1},
    };
    const VkDependencyInfo dependency = {
        .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
        .imageMemoryBarrierCount = 1,
        .pImageMemoryBarriers = &barrier,
    };
    vkCmdPipelineBarrier2(commands->handle, &dependency);
}

// Fills mip `mip` from the one above it; both are halves, rounded down.
static void mip_blit(gpu_commands *commands, const gpu_image_object *image, uint32_t mip)
{
    const int32_t from_width = (int32_t)max_u32(image->info.width >> (mip - 1), 1);
    const int32_t from_height = (int32_t)max_u32(image->info.height >> (mip - 1), 1);
    const int32_t width = (int32_t)max_u32(image->info.width >> mip, 1);
    const int32_t height = (int32_t)max_u32(image->info.height >> mip, 1);
    const VkImageBlit region = {
        .srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, mip - 1, 0, 1},
        .srcOffsets = {{0, 0, 0}, {from_width, from_height, 1}},
        .dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, mip, 0, 1},
        .dstOffsets = {{0, 0, 0}, {width, height, 1}},
    };
    vkCmdBlitImage(commands->handle, image->owned.image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, image->owned.image,
                   VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &region, VK_FILTER_LINEAR);
}

static void image_upload_record(gpu_commands *commands, const gpu_image_object *image, VkBuffer staging)
{
    const uint32_t mips = image->info.mips;
    const image_transition to_destination = {
        image, 0, mips, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
    };
    image_transition_record(commands, &to_destination);
    const VkBufferImageCopy region = {
        .imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1},
        .imageExtent = {image->info.width, image->info.height, 1},
    };
    vkCmdCopyBufferToImage(commands->handle, staging, image->owned.image, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1,
                           &region);
    for (uint32_t mip = 1; mip <= mips; mip++) {
        const image_transition to_source = {
            image, mip - 1, 1, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
        };
        image_transition_record(commands, &to_source);
        if (mip < mips)
            mip_blit(commands, image, mip);
    }
    const image_transition to_sampled = {
        image, 0, mips, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL,
    };
    image_transition_record(commands, &to_sampled);
}

static bool image_upload(gpu *gpu, const gpu_image_object *image, const void *data)
{
    assert(gpu_format_size(image->info.format) == 4 && "texels are given as RGBA8");
    const VkDeviceSize size = (VkDeviceSize)image->info.width * image->info.height * 4;
    const gpu_buffer staging = staging_create(gpu, size);
    if (!staging.id)
        return false;
    memcpy(gpu_buffer_map(gpu, staging), data, size);
    gpu_commands *commands = gpu_commands_begin(gpu);
    image_upload_record(commands, image, gpu_buffer_handle(gpu, staging));
    const bool uploaded = gpu_commands_submit_and_wait(gpu, commands);
    gpu_buffer_destroy(gpu, staging);
    return uploaded;
}

static bool image_fits_limits(const gpu *gpu, const gpu_image_desc *desc)
{
    const uint32_t limit = gpu->properties.limits.maxImageDimension2D;
    if (desc->width <= limit && desc->height <= limit)
        return true;
    log_error("%s: %u x %u texels, and %s allows %u", desc->name ? desc->name : "unnamed", desc->width, desc->height,
              gpu->properties.deviceName, limit);
    return false;
}

gpu_image gpu_image_create(gpu *gpu, const gpu_image_desc *desc)
{
    assert(desc->width && desc->height && (desc->memory.id || !desc->offset));
    gpu_owned owned = {0};
    if (!image_fits_limits(gpu, desc) || !image_allocate(gpu, desc, &owned)) {
        gpu_owned_destroy(gpu, &owned);
        return (gpu_image){0};
    }
    gpu_image image;
    gpu_image_object *object = gpu_pool_add(&gpu->images, sizeof *object, &image.id);
    *object = (gpu_image_object){owned, *desc};
    object->info.mips = max_u32(desc->mips, 1);
    // What the caller owns may be gone later.
    object->info.name = NULL;
    object->info.data = NULL;
    if (desc->data && !image_upload(gpu, object, desc->data)) {
        gpu_image_destroy(gpu, image);
        return (gpu_image){0};
    }
    return image;
}

void gpu_image_destroy(gpu *gpu, gpu_image image)
{
    if (!image.id)
        return;
    gpu_owned_retire(gpu, &gpu_image_get(gpu, image)->owned);
    gpu_pool_remove(&gpu->images, image.id);
}

gpu_image_object *gpu_image_get(const gpu *gpu, gpu_image image)
{
    return gpu_pool_get(&gpu->images, image.id);
}
VkImage gpu_image_handle(gpu *gpu, gpu_image image)
{
    return gpu_image_get(gpu, image)->owned.image;
}
VkImageView gpu_image_view(gpu *gpu, gpu_image image)
{
    return gpu_image_get(gpu, image)->owned.view;
}
const gpu_image_desc *gpu_image_info(gpu *gpu, gpu_image image)
{
    return &gpu_image_get(gpu, image)->info;
}

VkMemoryRequirements gpu_image_requirements(gpu *gpu, const gpu_image_desc *desc)
{
    const VkImageCreateInfo info = image_info(desc);
    const VkDeviceImageMemoryRequirements query = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_IMAGE_MEMORY_REQUIREMENTS,
        .pCreateInfo = &info,
    };
    VkMemoryRequirements2 needs = {.sType = VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2};
    vkGetDeviceImageMemoryRequirements(gpu->device, &query, &needs);
    return needs.memoryRequirements;
}

static void image_read_record(gpu_commands *commands, const gpu_image_object *image, VkImageLayout layout,
                              VkBuffer staging)
{
    const VkImageLayout source = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
    const image_transition before = {image, 0, image->info.mips, layout, source};
    const image_transition after = {image, 0, image->info.mips, source, layout};
    const VkBufferImageCopy region = {
        .imageSubresource = {gpu_format_aspect(image->info.format), 0, 0, 1},
        .imageExtent = {image->info.width, image->info.height, 1},
    };
    image_transition_record(commands, &before);
    vkCmdCopyImageToBuffer(commands->handle, image->owned.image, source, staging, 1, &region);
    image_transition_record(commands, &after);
}

bool gpu_image_read(gpu *gpu, gpu_image image, VkImageLayout layout, void *data, VkDeviceSize size)
{
    const gpu_image_object *object = gpu_image_get(gpu, image);
    assert(layout != VK_IMAGE_LAYOUT_UNDEFINED);
    assert(size == (VkDeviceSize)object->info.width * object->info.height * gpu_format_size(object->info.format));
    const gpu_buffer staging = staging_create(gpu, size);
    if (!staging.id)
        return false;
    gpu_commands *commands = gpu_commands_begin(gpu);
    image_read_record(commands, object, layout, gpu_buffer_handle(gpu, staging));
    const bool copied = gpu_commands_submit_and_wait(gpu, commands);
    if (copied)
        memcpy(data, gpu_buffer_map(gpu, staging), size);
    gpu_buffer_destroy(gpu, staging);
    return copied;
}
