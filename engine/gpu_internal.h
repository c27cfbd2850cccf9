// What the files of the device layer share: the device's state, handle pools and the Vulkan objects behind each handle.
#pragma once

#include "gpu.h"

// ---- Handle pools. An id is a slot (low 20 bits, from 1) and the slot's generation (high 12 bits).
// Objects stay at one address for their life, so pointers survive the pool's growth.
typedef struct gpu_slot {
    void *object; // NULL: free
    uint32_t generation;
    uint32_t next_free; // as `first_free`
} gpu_slot;
typedef struct gpu_pool { // zero-initialise
    gpu_slot *slots;
    size_t capacity;
    uint32_t count;
    uint32_t first_free; // slot number from 1; 0: none
} gpu_pool;
void *gpu_pool_add(gpu_pool *pool, size_t object_size, uint32_t *id); // zeroed
void *gpu_pool_get(const gpu_pool *pool, uint32_t id); // asserts that the handle is alive
void gpu_pool_remove(gpu_pool *pool, uint32_t id); // frees the object

// ---- The Vulkan objects that one handle owns; the unused ones are null, which every vkDestroy accepts.
typedef struct gpu_owned {
    VkAccelerationStructureKHR acceleration;
    VkBuffer buffer;
    VkImageView view;
    VkImage image;
    VkPipeline pipeline;
    VkPipelineLayout layout;
    VkDescriptorSetLayout set_layout;
    VkDeviceMemory memory;
    VkDeviceSize memory_size;
} gpu_owned;
void gpu_owned_destroy(gpu *gpu, const gpu_owned *owned);
// Destroys once no command that was begun so far can use the objects.
void gpu_owned_retire(gpu *gpu, const gpu_owned *owned);
void gpu_garbage_flush(gpu *gpu);
// Destroys what is still alive in the pool, and the pool. Every pooled object starts with a gpu_owned.
void gpu_pool_fini(gpu *gpu, gpu_pool *pool);

typedef struct gpu_buffer_object {
    gpu_owned owned;
    VkDeviceSize size;
    VkBufferUsageFlags usage;
    void *mapping;
} gpu_buffer_object;

typedef struct gpu_image_object {
    gpu_owned owned;
    gpu_image_desc info;
} gpu_image_object;

typedef struct gpu_memory_object {
    gpu_owned owned;
} gpu_memory_object;

typedef struct gpu_pipeline_object {
    gpu_owned owned;
    VkPipelineBindPoint bind_point;
    char name[64];
    uint32_t binding_mask;
    VkDescriptorType binding_types[GPU_BINDINGS_MAX];
    uint32_t push_size;
    bool uses_scene;
    // Ray pipelines: the shader binding table and where its parts lie in it.
    gpu_buffer table;
    VkStridedDeviceAddressRegionKHR raygen, miss, hit;
} gpu_pipeline_object;

typedef struct gpu_acceleration_object {
    gpu_owned owned;
    gpu_buffer storage;
    gpu_buffer scratch; // of those that are built again
    uint32_t max_instances; // top level
    bool updatable; // bottom level
} gpu_acceleration_object;

struct gpu_commands {
    gpu *gpu;
    VkCommandBuffer handle;
    VkFence fence;
    gpu_pipeline pipeline; // bound last
    gpu_buffer indices; // bound last
    gpu_commands *next; // in the list of free ones
};

typedef struct gpu_sampler {
    gpu_sampler_desc desc;
    VkSampler handle;
} gpu_sampler;

// Extension functions, fetched by name.
#define GPU_FUNCTIONS(X)                                                                                               \
    X(vkCmdPushDescriptorSetKHR)                                                                                       \
    X(vkCreateAccelerationStructureKHR)                                                                                \
    X(vkDestroyAccelerationStructureKHR)                                                                               \
    X(vkGetAccelerationStructureBuildSizesKHR)                                                                         \
    X(vkGetAccelerationStructureDeviceAddressKHR)                                                                      \
    X(vkCmdBuildAccelerationStructuresKHR)                                                                             \
    X(vkCreateRayTracingPipelinesKHR)                                                                                  \
    X(vkGetRayTracingShaderGroupHandlesKHR)                                                                            \
    X(vkCmdTraceRaysKHR)
// Null when the instance has no VK_EXT_debug_utils.
#define GPU_DEBUG_FUNCTIONS(X)                                                                                         \
    X(vkCreateDebugUtilsMessengerEXT)                                                                                  \
    X(vkDestroyDebugUtilsMessengerEXT)                                                                                 \
    X(vkSetDebugUtilsObjectNameEXT)                                                                                    \
    X(vkCmdBeginDebugUtilsLabelEXT)                                                                                    \
    X(vkCmdEndDebugUtilsLabelEXT)

struct gpu {
    VkInstance instance;
    VkDebugUtilsMessengerEXT messenger;
    VkPhysicalDevice physical;
    VkDevice device;
    VkQueue queue;
    uint32_t queue_family;
    uint32_t timestamp_bits;
    VkPhysicalDeviceProperties properties;
    VkPhysicalDeviceMemoryProperties memory_types;
    VkDeviceSize scratch_alignment; // of acceleration structure builds
    uint32_t handle_size, handle_alignment, table_alignment; // bytes, of ray pipelines' shader binding tables
    bool has_float_atomics, has_ray_query, has_ray_pipelines;
    uint32_t validation_messages;
#define GPU_MEMBER(name) PFN_##name name;
    GPU_FUNCTIONS(GPU_MEMBER)
    GPU_DEBUG_FUNCTIONS(GPU_MEMBER)
#undef GPU_MEMBER

    gpu_pool buffers, images, memories, pipelines, accelerations;
    gpu_owned *garbage;
    size_t garbage_count, garbage_capacity;
    VkDeviceSize memory_used, memory_peak;

    VkCommandPool command_pool;
    gpu_commands *free_commands;
    uint32_t open_commands; // begun and not yet waited for
    VkQueryPool timestamps;

    VkDescriptorSetLayout scene_layout;
    VkDescriptorPool scene_pool;
    VkDescriptorSet scene_set;
    gpu_sampler *samplers;
    size_t sampler_count, sampler_capacity;
};

// True on VK_SUCCESS; otherwise logs "<name>: <function>: <result>".
#define VK(call, name) gpu_check((call), #call, (name))
bool gpu_check(VkResult result, const char *call, const char *name);
// Labels a Vulkan object for debuggers and validation messages; `name` may be NULL.
void gpu_name_set(gpu *gpu, VkObjectType type, uint64_t handle, const char *name);

// As gpu_buffer_create, for buffers that are used by address only and may exceed the limit on descriptors.
gpu_buffer gpu_buffer_create_unbound(gpu *gpu, const gpu_buffer_desc *desc);
gpu_buffer_object *gpu_buffer_get(const gpu *gpu, gpu_buffer buffer);
gpu_image_object *gpu_image_get(const gpu *gpu, gpu_image image);
VkSampler gpu_sampler_get(gpu *gpu, const gpu_sampler_desc *desc); // null on failure

bool gpu_scene_init(gpu *gpu);
void gpu_scene_fini(gpu *gpu);
bool gpu_commands_init(gpu *gpu);
void gpu_commands_fini(gpu *gpu);
