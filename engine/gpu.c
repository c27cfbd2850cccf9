// Instance, choice of the device, validation messages and timestamps: what there is before the first resource.
#include "gpu_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const required_extensions[] = {
    VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME,
    VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME,
    VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME,
};

// Every feature structure that is queried, and enabled when the device is made.
typedef struct device_features {
    VkPhysicalDeviceFeatures2 core;
    VkPhysicalDeviceVulkan12Features vulkan12;
    VkPhysicalDeviceVulkan13Features vulkan13;
    VkPhysicalDeviceAccelerationStructureFeaturesKHR acceleration;
    VkPhysicalDeviceRayQueryFeaturesKHR ray_query;
    VkPhysicalDeviceRayTracingPipelineFeaturesKHR ray_pipeline;
    VkPhysicalDeviceShaderAtomicFloatFeaturesEXT atomic_float;
} device_features;

typedef struct required_feature {
    const char *name;
    size_t offset; // of its VkBool32 in device_features
} required_feature;

#define FEATURE(structure, member)                                                                                     \
    {                                                                                                                  \
#member, offsetof(device_features, structure.member)                                                           \
    }
static const required_feature required_features[] = {
    FEATURE(core.features, shaderInt64),
    FEATURE(core.features, fragmentStoresAndAtomics),
    FEATURE(core.features, shaderClipDistance),
    FEATURE(core.features, depthClamp),
    FEATURE(core.features, independentBlend),
    FEATURE(core.features, drawIndirectFirstInstance),
    FEATURE(core.features, shaderSampledImageArrayDynamicIndexing),
    FEATURE(core.features, shaderStorageImageReadWithoutFormat),
    FEATURE(core.features, shaderStorageImageWriteWithoutFormat),
    FEATURE(vulkan12, bufferDeviceAddress),
    FEATURE(vulkan12, scalarBlockLayout),
    FEATURE(vulkan12, shaderBufferInt64Atomics),
    FEATURE(vulkan12, runtimeDescriptorArray),
    FEATURE(vulkan12, shaderSampledImageArrayNonUniformIndexing),
    FEATURE(vulkan12, descriptorBindingPartiallyBound),
    FEATURE(vulkan12, hostQueryReset),
    FEATURE(vulkan13, dynamicRendering),
    FEATURE(vulkan13, synchronization2),
    FEATURE(vulkan13, maintenance4),
    FEATURE(acceleration, accelerationStructure),
};

static const char *result_name(VkResult result)
{
    static const struct {
        VkResult result;
        const char *name;
    } names[] = {
        {VK_ERROR_OUT_OF_HOST_MEMORY, "out of host memory"},
        {VK_ERROR_OUT_OF_DEVICE_MEMORY, "out of device memory"},
        {VK_ERROR_INITIALIZATION_FAILED, "initialization failed"},
        {VK_ERROR_DEVICE_LOST, "device lost"},
        {VK_ERROR_LAYER_NOT_PRESENT, "layer not installed"},
        {VK_ERROR_EXTENSION_NOT_PRESENT, "extension not supported"},
        {VK_ERROR_FEATURE_NOT_PRESENT, "feature not supported"},
        {VK_ERROR_INCOMPATIBLE_DRIVER, "no Vulkan driver found"},
        {VK_ERROR_TOO_MANY_OBJECTS, "too many objects"},
        {VK_ERROR_FORMAT_NOT_SUPPORTED, "format not supported"},
        {VK_NOT_READY, "not ready"},
    };
    for (size_t i = 0; i < countof(names); i++)
        if (names[i].result == result)
            return names[i].name;
    return NULL;
}

bool gpu_check(VkResult result, const char *call, const char *name)
{
    if (result == VK_SUCCESS)
        return true;
    const char *reason = result_name(result);
    const int function_length = (int)strcspn(call, "(");
    if (reason)
        log_error("%s: %.*s: %s", name ? name : "unnamed", function_length, call, reason);
    else
        log_error("%s: %.*s: VkResult %d", name ? name : "unnamed", function_length, call, result);
    return false;
}

void gpu_name_set(gpu *gpu, VkObjectType type, uint64_t handle, const char *name)
{
    if (!gpu->vkSetDebugUtilsObjectNameEXT || !name)
        return;
    const VkDebugUtilsObjectNameInfoEXT info = {
        .sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_OBJECT_NAME_INFO_EXT,
        .objectType = type,
        .objectHandle = handle,
        .pObjectName = name,
    };
    gpu->vkSetDebugUtilsObjectNameEXT(gpu->device, &info);
}

// ---- Instance

static VkBool32 VKAPI_PTR on_validation_message(VkDebugUtilsMessageSeverityFlagBitsEXT severity,
                                                VkDebugUtilsMessageTypeFlagsEXT types,
                                                const VkDebugUtilsMessengerCallbackDataEXT *data, void *user)
{
    (void)severity, (void)types;
    gpu *gpu = user;
    gpu->validation_messages++;
    // The log takes one line a call.
    char line[2048];
    snprintf(line, sizeof line, "%s", data->pMessage);
    for (char *newline = line; (newline = strchr(newline, '\n'));)
        *newline = ' ';
    log_error("validation: %s", line);
    return VK_FALSE;
}

static bool instance_has_layer(const char *name)
{
    uint32_t count = 0;
    vkEnumerateInstanceLayerProperties(&count, NULL);
    VkLayerProperties *layers = memory_alloc(count * sizeof *layers);
    vkEnumerateInstanceLayerProperties(&count, layers);
    bool found = false;
    for (uint32_t i = 0; i < count; i++)
        found |= strcmp(layers[i].layerName, name) == 0;
    free(layers);
    return found;
}

static bool instance_has_extension(const char *name)
{
    uint32_t count = 0;
    if (vkEnumerateInstanceExtensionProperties(NULL, &count, NULL) != VK_SUCCESS)
        return false;
    VkExtensionProperties *extensions = memory_alloc(count * sizeof *extensions);
    vkEnumerateInstanceExtensionProperties(NULL, &count, extensions);
    bool found = false;
    for (uint32_t i = 0; i < count; i++)
        found |= strcmp(extensions[i].extensionName, name) == 0;
    free(extensions);
    return found;
}

// `messages_to`: receives the validation layer's messages; NULL for no validation.
static VkInstance instance_create(gpu *messages_to)
{
    static const char *const validation_layer = "VK_LAYER_KHRONOS_validation";
    if (messages_to && !instance_has_layer(validation_layer)) {
        log_error("validation was asked for, and the layer %s is not installed", validation_layer);
        return VK_NULL_HANDLE;
    }
    const char *extensions[2];
    uint32_t extension_count = 0;
    if (messages_to || instance_has_extension(VK_EXT_DEBUG_UTILS_EXTENSION_NAME))
        extensions[extension_count++] = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;
    if (messages_to)
        extensions[extension_count++] = VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME;

    static const VkValidationFeatureEnableEXT enables[] = {
        VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT,
    };
    const VkValidationFeaturesEXT validation = {
        .sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT,
        .enabledValidationFeatureCount = countof(enables),
        .pEnabledValidationFeatures = enables,
    };
    const VkApplicationInfo application = {
        .sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
        .pApplicationName = "lanternfield",
        .apiVersion = VK_API_VERSION_1_3,
    };
    const VkInstanceCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
        .pNext = messages_to ? &validation : NULL,
        .pApplicationInfo = &application,
        .enabledLayerCount = messages_to ? 1 : 0,
        .ppEnabledLayerNames = &validation_layer,
        .enabledExtensionCount = extension_count,
        .ppEnabledExtensionNames = extensions,
    };
    VkInstance instance = VK_NULL_HANDLE;
    return VK(vkCreateInstance(&info, NULL, &instance), "Vulkan") ? instance : VK_NULL_HANDLE;
}

static bool messenger_create(gpu *gpu)
{
    const VkDebugUtilsMessengerCreateInfoEXT info = {
        .sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT,
        .messageSeverity =
            VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
        // Not the type GENERAL: there the loader speaks of other drivers' files.
        .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_TYPE_PERFORMANCE_BIT_EXT,
        .pfnUserCallback = on_validation_message,
        .pUserData = gpu,
    };
    return VK(gpu->vkCreateDebugUtilsMessengerEXT(gpu->instance, &info, NULL, &gpu->messenger), "validation messages");
}

// ---- Choice of the device

static bool device_has_extension(VkPhysicalDevice device, const char *name)
{
    uint32_t count = 0;
    if (vkEnumerateDeviceExtensionProperties(device, NULL, &count, NULL) != VK_SUCCESS)
        return false;
    VkExtensionProperties *extensions = memory_alloc(count * sizeof *extensions);
    vkEnumerateDeviceExtensionProperties(device, NULL, &count, extensions);
    bool found = false;
    for (uint32_t i = 0; i < count; i++)
        found |= strcmp(extensions[i].extensionName, name) == 0;
    free(extensions);
    return found;
}

// Zeroes all and chains the structures whose extensions the device has.
static void device_features_chain(VkPhysicalDevice device, device_features *features)
{
    *features = (device_features){
        .core.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2,
        .vulkan12.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES,
        .vulkan13.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES,
        .acceleration.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR,
        .ray_query.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR,
        .ray_pipeline.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR,
        .atomic_float.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_ATOMIC_FLOAT_FEATURES_EXT,
    };
    features->core.pNext = &features->vulkan12;
    features->vulkan12.pNext = &features->vulkan13;
    void **end = &features->vulkan13.pNext;
    const struct {
        const char *extension;
        void *structure;
        void **next;
    } optional[] = {
        {VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME, &features->acceleration, &features->acceleration.pNext},
        {VK_KHR_RAY_QUERY_EXTENSION_NAME, &features->ray_query, &features->ray_query.pNext},
        {VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME, &features->ray_pipeline, &features->ray_pipeline.pNext},
        {VK_EXT_SHADER_ATOMIC_FLOAT_EXTENSION_NAME, &features->atomic_float, &features->atomic_float.pNext},
    };
    for (size_t i = 0; i < countof(optional); i++) {
        if (!device_has_extension(device, optional[i].extension))
            continue;
        *end = optional[i].structure;
        end = optional[i].next;
    }
}

static void device_features_query(VkPhysicalDevice device, device_features *features)
{
    device_features_chain(device, features);
    vkGetPhysicalDeviceFeatures2(device, &features->core);
}

static VkBool32 *feature_flag(device_features *features, const required_feature *feature)
{
    return (VkBool32 *)((char *)features + feature->offset);
}

// Returns the first queue family with graphics, compute and timestamps; UINT32_MAX when there is none.
static uint32_t device_queue_family(VkPhysicalDevice device, uint32_t *timestamp_bits)
{
    uint32_t count = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(device, &count, NULL);
    VkQueueFamilyProperties *families = memory_alloc(count * sizeof *families);
    vkGetPhysicalDeviceQueueFamilyProperties(device, &count, families);
    const VkQueueFlags needed = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
    uint32_t found = UINT32_MAX;
    for (uint32_t i = 0; i < count && found == UINT32_MAX; i++) {
        if ((families[i].queueFlags & needed) == needed && families[i].timestampValidBits) {
            found = i;
            *timestamp_bits = families[i].timestampValidBits;
        }
    }
    free(families);
    return found;
}

static char *list_append(arena *arena, const char *list, const char *item)
{
    return list ? arena_printf(arena, "%s, %s", list, item) : arena_strdup(arena, item);
}

static uint32_t device_max_push_descriptors(VkPhysicalDevice device)
{
    VkPhysicalDevicePushDescriptorPropertiesKHR push = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PUSH_DESCRIPTOR_PROPERTIES_KHR,
    };
    VkPhysicalDeviceProperties2 properties = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2,
        .pNext = &push,
    };
    vkGetPhysicalDeviceProperties2(device, &properties);
    return push.maxPushDescriptors;
}

static bool has_ray_query(const device_features *supported, const gpu_desc *desc)
{
    return supported->ray_query.rayQuery && !desc->without_ray_query;
}

static bool has_ray_pipelines(const device_features *supported, const gpu_desc *desc)
{
    return supported->ray_pipeline.rayTracingPipeline && !desc->without_ray_pipelines;
}

// Of what compute shaders do together with the other invocations of their subgroup.
static bool device_has_subgroups(VkPhysicalDevice device)
{
    VkPhysicalDeviceVulkan11Properties subgroups = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_PROPERTIES};
    VkPhysicalDeviceProperties2 properties = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2,
        .pNext = &subgroups,
    };
    vkGetPhysicalDeviceProperties2(device, &properties);
    const VkSubgroupFeatureFlags needed = VK_SUBGROUP_FEATURE_ARITHMETIC_BIT | VK_SUBGROUP_FEATURE_BALLOT_BIT |
                                          VK_SUBGROUP_FEATURE_SHUFFLE_BIT | VK_SUBGROUP_FEATURE_VOTE_BIT;
    return subgroups.subgroupSupportedStages & VK_SHADER_STAGE_COMPUTE_BIT &&
           (subgroups.subgroupSupportedOperations & needed) == needed;
}

// Lists what the renderer needs and the device has not; NULL when it has everything.
static const char *device_missing(VkPhysicalDevice device, const gpu_desc *desc, arena *arena)
{
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(device, &properties);
    // Older devices know none of the queries below.
    if (properties.apiVersion < VK_API_VERSION_1_3)
        return arena_printf(arena, "Vulkan 1.3 (it has %u.%u)", VK_API_VERSION_MAJOR(properties.apiVersion),
                            VK_API_VERSION_MINOR(properties.apiVersion));
    const char *missing = NULL;
    for (size_t i = 0; i < countof(required_extensions); i++)
        if (!device_has_extension(device, required_extensions[i]))
            missing = list_append(arena, missing, required_extensions[i]);
    device_features features;
    device_features_query(device, &features);
    for (size_t i = 0; i < countof(required_features); i++)
        if (!*feature_flag(&features, &required_features[i]))
            missing = list_append(arena, missing, required_features[i].name);
    if (!has_ray_query(&features, desc) && !has_ray_pipelines(&features, desc))
        missing = list_append(arena, missing,
                              VK_KHR_RAY_QUERY_EXTENSION_NAME " and " VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME
                                                              " (one of them is needed)");
    if (device_has_extension(device, VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME) &&
        device_max_push_descriptors(device) < GPU_BINDINGS_MAX)
        missing = list_append(arena, missing, arena_printf(arena, "%d push descriptors", GPU_BINDINGS_MAX));
    if (properties.limits.maxPerStageDescriptorSampledImages < GPU_SCENE_TEXTURES_MAX + GPU_BINDINGS_MAX ||
        properties.limits.maxPerStageDescriptorSamplers < GPU_SCENE_TEXTURES_MAX + GPU_BINDINGS_MAX)
        missing = list_append(arena, missing, arena_printf(arena, "%d sampled textures", GPU_SCENE_TEXTURES_MAX));
    if (!device_has_subgroups(device))
        missing = list_append(arena, missing, "subgroup arithmetic, ballot, shuffle and vote in compute shaders");
    uint32_t timestamp_bits;
    if (device_queue_family(device, &timestamp_bits) == UINT32_MAX)
        missing = list_append(arena, missing, "a queue for graphics and compute with timestamps");
    return missing;
}

// memory_alloc'd; `*count` is 0 on failure.
static VkPhysicalDevice *devices_list(VkInstance instance, uint32_t *count)
{
    *count = 0;
    if (!VK(vkEnumeratePhysicalDevices(instance, count, NULL), "Vulkan"))
        *count = 0;
    VkPhysicalDevice *devices = memory_alloc(*count * sizeof *devices);
    if (*count && !VK(vkEnumeratePhysicalDevices(instance, count, devices), "Vulkan"))
        *count = 0;
    return devices;
}

// Returns the first usable device whose name contains what `desc` says, or null after saying why each was refused.
static VkPhysicalDevice device_pick(VkInstance instance, const gpu_desc *desc)
{
    arena arena = {0};
    uint32_t count;
    VkPhysicalDevice *devices = devices_list(instance, &count);
    VkPhysicalDevice found = VK_NULL_HANDLE;
    const char *refused = NULL, *other_names = NULL;
    for (uint32_t i = 0; i < count && !found; i++) {
        VkPhysicalDeviceProperties properties;
        vkGetPhysicalDeviceProperties(devices[i], &properties);
        if (desc->device && !strcasestr(properties.deviceName, desc->device)) {
            other_names = list_append(&arena, other_names, properties.deviceName);
            continue;
        }
        const char *missing = device_missing(devices[i], desc, &arena);
        if (missing)
            refused = list_append(&arena, refused, arena_printf(&arena, "%s lacks %s", properties.deviceName, missing));
        else
            found = devices[i];
    }
    if (!found && refused)
        log_error("no usable Vulkan device: %s", refused);
    else if (!found && other_names)
        log_error("no Vulkan device's name contains \"%s\"; there are: %s", desc->device, other_names);
    else if (!found)
        log_error("no Vulkan device found");
    free(devices);
    arena_fini(&arena);
    return found;
}

uint32_t gpu_devices_print(void *out)
{
    VkInstance instance = instance_create(NULL);
    if (!instance)
        return 0;
    arena arena = {0};
    uint32_t count, usable = 0;
    VkPhysicalDevice *devices = devices_list(instance, &count);
    for (uint32_t i = 0; i < count; i++) {
        VkPhysicalDeviceProperties properties;
        vkGetPhysicalDeviceProperties(devices[i], &properties);
        const char *missing = device_missing(devices[i], &(gpu_desc){0}, &arena);
        fprintf(out, "%s: %s%s\n", properties.deviceName, missing ? "lacks " : "usable", missing ? missing : "");
        usable += !missing;
    }
    free(devices);
    arena_fini(&arena);
    vkDestroyInstance(instance, NULL);
    return usable;
}

// ---- Device

// Enables what is needed and no more, since some features cost speed merely by being enabled.
static void device_features_select(gpu *gpu, const gpu_desc *desc, device_features *enabled)
{
    device_features supported;
    device_features_query(gpu->physical, &supported);
    device_features_chain(gpu->physical, enabled);
    for (size_t i = 0; i < countof(required_features); i++)
        *feature_flag(enabled, &required_features[i]) = VK_TRUE;
    enabled->core.features.vertexPipelineStoresAndAtomics = supported.core.features.vertexPipelineStoresAndAtomics;
    enabled->atomic_float.shaderBufferFloat32AtomicAdd = supported.atomic_float.shaderBufferFloat32AtomicAdd;
    gpu->has_ray_query = has_ray_query(&supported, desc);
    gpu->has_ray_pipelines = has_ray_pipelines(&supported, desc);
    enabled->ray_query.rayQuery = gpu->has_ray_query;
    enabled->ray_pipeline.rayTracingPipeline = gpu->has_ray_pipelines;
    gpu->has_float_atomics = supported.atomic_float.shaderBufferFloat32AtomicAdd;
}

static bool device_create(gpu *gpu, const gpu_desc *desc)
{
    device_features features;
    device_features_select(gpu, desc, &features);
    static const char *const optional_extensions[] = {
        VK_EXT_SHADER_ATOMIC_FLOAT_EXTENSION_NAME,
        VK_KHR_RAY_QUERY_EXTENSION_NAME,
        VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME,
    };
    const char *extensions[countof(required_extensions) + countof(optional_extensions)];
    uint32_t extension_count = countof(required_extensions);
    memcpy(extensions, required_extensions, sizeof required_extensions);
    for (size_t i = 0; i < countof(optional_extensions); i++)
        if (device_has_extension(gpu->physical, optional_extensions[i]))
            extensions[extension_count++] = optional_extensions[i];

    gpu->queue_family = device_queue_family(gpu->physical, &gpu->timestamp_bits);
    const float priority = 1;
    const VkDeviceQueueCreateInfo queue = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
        .queueFamilyIndex = gpu->queue_family,
        .queueCount = 1,
        .pQueuePriorities = &priority,
    };
    const VkDeviceCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
        .pNext = &features.core,
        .queueCreateInfoCount = 1,
        .pQueueCreateInfos = &queue,
        .enabledExtensionCount = extension_count,
        .ppEnabledExtensionNames = extensions,
    };
    if (!VK(vkCreateDevice(gpu->physical, &info, NULL, &gpu->device), gpu->properties.deviceName))
        return false;
    vkGetDeviceQueue(gpu->device, gpu->queue_family, 0, &gpu->queue);
    return true;
}

static void properties_query(gpu *gpu)
{
    VkPhysicalDeviceAccelerationStructurePropertiesKHR acceleration = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR,
    };
    const bool has_pipelines = device_has_extension(gpu->physical, VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME);
    VkPhysicalDeviceRayTracingPipelinePropertiesKHR ray_pipeline = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_PROPERTIES_KHR,
        .pNext = &acceleration,
    };
    VkPhysicalDeviceProperties2 properties = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2,
        .pNext = has_pipelines ? (void *)&ray_pipeline : (void *)&acceleration,
    };
    vkGetPhysicalDeviceProperties2(gpu->physical, &properties);
    gpu->properties = properties.properties;
    gpu->scratch_alignment = acceleration.minAccelerationStructureScratchOffsetAlignment;
    gpu->handle_size = ray_pipeline.shaderGroupHandleSize;
    gpu->handle_alignment = ray_pipeline.shaderGroupHandleAlignment;
    gpu->table_alignment = ray_pipeline.shaderGroupBaseAlignment;
    vkGetPhysicalDeviceMemoryProperties(gpu->physical, &gpu->memory_types);
}

static void functions_load(gpu *gpu)
{
#define LOAD(name) gpu->name = (PFN_##name)vkGetInstanceProcAddr(gpu->instance, #name);
    GPU_FUNCTIONS(LOAD)
    // The loader answers for these whether or not the extension is enabled.
    if (instance_has_extension(VK_EXT_DEBUG_UTILS_EXTENSION_NAME)) {
        GPU_DEBUG_FUNCTIONS(LOAD)
    }
#undef LOAD
}

static bool timestamps_create(gpu *gpu)
{
    const VkQueryPoolCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO,
        .queryType = VK_QUERY_TYPE_TIMESTAMP,
        .queryCount = GPU_TIMESTAMPS_MAX,
    };
    if (!VK(vkCreateQueryPool(gpu->device, &info, NULL, &gpu->timestamps), "timestamps"))
        return false;
    vkResetQueryPool(gpu->device, gpu->timestamps, 0, GPU_TIMESTAMPS_MAX);
    return true;
}

gpu *gpu_create(const gpu_desc *desc)
{
    gpu *gpu = memory_alloc(sizeof *gpu);
    gpu->instance = instance_create(desc->validation ? gpu : NULL);
    if (!gpu->instance)
        goto fail;
    functions_load(gpu);
    if (desc->validation && !messenger_create(gpu))
        goto fail;
    gpu->physical = device_pick(gpu->instance, desc);
    if (!gpu->physical)
        goto fail;
    properties_query(gpu);
    if (!device_create(gpu, desc) || !timestamps_create(gpu) || !gpu_commands_init(gpu) || !gpu_scene_init(gpu))
        goto fail;
    return gpu;
fail:
    gpu_destroy(gpu);
    return NULL;
}

static void device_destroy(gpu *gpu)
{
    vkDeviceWaitIdle(gpu->device);
    gpu_garbage_flush(gpu);
    // Accelerations first: they lie in buffers. Memories last: buffers and images lie in them.
    gpu_pool_fini(gpu, &gpu->accelerations);
    gpu_pool_fini(gpu, &gpu->pipelines);
    gpu_pool_fini(gpu, &gpu->images);
    gpu_pool_fini(gpu, &gpu->buffers);
    gpu_pool_fini(gpu, &gpu->memories);
    gpu_scene_fini(gpu);
    gpu_commands_fini(gpu);
    vkDestroyQueryPool(gpu->device, gpu->timestamps, NULL);
    vkDestroyDevice(gpu->device, NULL);
}

void gpu_destroy(gpu *gpu)
{
    if (!gpu)
        return;
    if (gpu->device)
        device_destroy(gpu);
    if (gpu->messenger)
        gpu->vkDestroyDebugUtilsMessengerEXT(gpu->instance, gpu->messenger, NULL);
    if (gpu->instance)
        vkDestroyInstance(gpu->instance, NULL);
    free(gpu->garbage);
    free(gpu);
}

const char *gpu_name(const gpu *gpu)
{
    return gpu->properties.deviceName;
}
bool gpu_is_cpu(const gpu *gpu)
{
    return gpu->properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
}
bool gpu_has_float_atomics(const gpu *gpu)
{
    return gpu->has_float_atomics;
}
bool gpu_has_ray_query(const gpu *gpu)
{
    return gpu->has_ray_query;
}
bool gpu_has_ray_pipelines(const gpu *gpu)
{
    return gpu->has_ray_pipelines;
}
uint32_t gpu_validation_messages(const gpu *gpu)
{
    return gpu->validation_messages;
}

// ---- Timestamps

static void full_barrier(VkCommandBuffer commands)
{
    const VkMemoryBarrier2 barrier = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
        .srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
        .dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
    };
    const VkDependencyInfo dependency = {
        .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO, .memoryBarrierCount = 1, .pMemoryBarriers = &barrier};
    vkCmdPipelineBarrier2(commands, &dependency);
}

void gpu_timestamp(gpu_commands *commands, uint32_t slot)
{
    assert(slot < GPU_TIMESTAMPS_MAX);
    const gpu *gpu = commands->gpu;
    // A reset inside the command buffer is not allowed while rendering; earlier submits have been waited for.
    vkResetQueryPool(gpu->device, gpu->timestamps, slot, 1);
    // Lavapipe defers rasterisation and compute past the timestamps behind them; a barrier makes it finish them.
    if (gpu_is_cpu(gpu))
        full_barrier(commands->handle);
    vkCmdWriteTimestamp2(commands->handle, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, gpu->timestamps, slot);
}

bool gpu_timestamps_read(gpu *gpu, double *milliseconds, uint32_t count)
{
    assert(count <= GPU_TIMESTAMPS_MAX);
    uint64_t ticks[GPU_TIMESTAMPS_MAX];
    if (!count)
        return true;
    if (!VK(vkGetQueryPoolResults(gpu->device, gpu->timestamps, 0, count, count * sizeof ticks[0], ticks,
                                  sizeof ticks[0], VK_QUERY_RESULT_64_BIT),
            "timestamps"))
        return false;
    const uint64_t mask = gpu->timestamp_bits == 64 ? UINT64_MAX : (1ull << gpu->timestamp_bits) - 1;
    for (uint32_t i = 0; i < count; i++)
        milliseconds[i] = (double)(ticks[i] & mask) * gpu->properties.limits.timestampPeriod * 1e-6;
    return true;
}
