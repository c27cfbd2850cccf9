// Pipelines and the layouts reflected from their shaders, and the scene's descriptor set with its samplers.
#include "gpu_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- The scene set

static bool scene_layout_create(gpu *gpu)
{
    VkDescriptorSetLayoutBinding bindings[GPU_SCENE_BUFFERS + 1];
    VkDescriptorBindingFlags flags[countof(bindings)];
    for (uint32_t i = 0; i < countof(bindings); i++) {
        bindings[i] = (VkDescriptorSetLayoutBinding){
            .binding = i,
            .descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
            .descriptorCount = 1,
            .stageFlags = VK_SHADER_STAGE_ALL,
        };
        flags[i] = VK_DESCRIPTOR_BINDING_PARTIALLY_BOUND_BIT;
    }
    VkDescriptorSetLayoutBinding *textures = &bindings[GPU_SCENE_BUFFERS];
    textures->binding = GPU_SCENE_TEXTURES_BINDING;
    textures->descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
    textures->descriptorCount = GPU_SCENE_TEXTURES_MAX;

    const VkDescriptorSetLayoutBindingFlagsCreateInfo flags_info = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_BINDING_FLAGS_CREATE_INFO,
        .bindingCount = countof(flags),
        .pBindingFlags = flags,
    };
    const VkDescriptorSetLayoutCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
        .pNext = &flags_info,
        .bindingCount = countof(bindings),
        .pBindings = bindings,
    };
    return VK(vkCreateDescriptorSetLayout(gpu->device, &info, NULL, &gpu->scene_layout), "scene set");
}

bool gpu_scene_init(gpu *gpu)
{
    if (!scene_layout_create(gpu))
        return false;
    const VkDescriptorPoolSize sizes[] = {
        {VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, GPU_SCENE_BUFFERS},
        {VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, GPU_SCENE_TEXTURES_MAX},
    };
    const VkDescriptorPoolCreateInfo pool = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO,
        .maxSets = 1,
        .poolSizeCount = countof(sizes),
        .pPoolSizes = sizes,
    };
    if (!VK(vkCreateDescriptorPool(gpu->device, &pool, NULL, &gpu->scene_pool), "scene set"))
        return false;
    const VkDescriptorSetAllocateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO,
        .descriptorPool = gpu->scene_pool,
        .descriptorSetCount = 1,
        .pSetLayouts = &gpu->scene_layout,
    };
    return VK(vkAllocateDescriptorSets(gpu->device, &info, &gpu->scene_set), "scene set");
}

void gpu_scene_fini(gpu *gpu)
{
    for (size_t i = 0; i < gpu->sampler_count; i++)
        vkDestroySampler(gpu->device, gpu->samplers[i].handle, NULL);
    free(gpu->samplers);
    vkDestroyDescriptorPool(gpu->device, gpu->scene_pool, NULL);
    vkDestroyDescriptorSetLayout(gpu->device, gpu->scene_layout, NULL);
}

static void scene_write(gpu *gpu, VkWriteDescriptorSet write)
{
    // The set may not change under commands that use it.
    assert(!gpu->open_commands && "the scene set is updated between submits");
    write.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET;
    write.dstSet = gpu->scene_set;
    write.descriptorCount = 1;
    vkUpdateDescriptorSets(gpu->device, 1, &write, 0, NULL);
}

void gpu_scene_bind_buffer(gpu *gpu, uint32_t binding, gpu_buffer buffer)
{
    assert(binding < GPU_SCENE_BUFFERS);
    const VkDescriptorBufferInfo info = {gpu_buffer_handle(gpu, buffer), 0, VK_WHOLE_SIZE};
    const VkWriteDescriptorSet write = {
        .dstBinding = binding,
        .descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER,
        .pBufferInfo = &info,
    };
    scene_write(gpu, write);
}

void gpu_scene_bind_texture(gpu *gpu, uint32_t index, gpu_image image, const gpu_sampler_desc *sampler)
{
    assert(index < GPU_SCENE_TEXTURES_MAX);
    const VkDescriptorImageInfo info = {
        .sampler = gpu_sampler_get(gpu, sampler),
        .imageView = gpu_image_view(gpu, image),
        .imageLayout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL,
    };
    const VkWriteDescriptorSet write = {
        .dstBinding = GPU_SCENE_TEXTURES_BINDING,
        .dstArrayElement = index,
        .descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER,
        .pImageInfo = &info,
    };
    if (info.sampler)
        scene_write(gpu, write);
}

// ---- Samplers

static bool sampler_equal(const gpu_sampler_desc *a, const gpu_sampler_desc *b)
{
    return a->mag == b->mag && a->min == b->min && a->mipmap == b->mipmap && a->wrap_u == b->wrap_u &&
           a->wrap_v == b->wrap_v && a->no_mips == b->no_mips;
}

VkSampler gpu_sampler_get(gpu *gpu, const gpu_sampler_desc *desc)
{
    for (size_t i = 0; i < gpu->sampler_count; i++)
        if (sampler_equal(&gpu->samplers[i].desc, desc))
            return gpu->samplers[i].handle;
    const VkSamplerCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO,
        .magFilter = desc->mag,
        .minFilter = desc->min,
        .mipmapMode = desc->no_mips ? VK_SAMPLER_MIPMAP_MODE_NEAREST : desc->mipmap,
        .addressModeU = desc->wrap_u,
        .addressModeV = desc->wrap_v,
        .addressModeW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
        // 0.25 rounds to mip 0 and still tells minification from magnification (Vulkan, note on VkSamplerCreateInfo).
        .maxLod = desc->no_mips ? 0.25f : VK_LOD_CLAMP_NONE,
    };
    gpu_sampler sampler = {.desc = *desc};
    if (!VK(vkCreateSampler(gpu->device, &info, NULL, &sampler.handle), "sampler"))
        return VK_NULL_HANDLE;
    memory_reserve((void **)&gpu->samplers, &gpu->sampler_capacity, gpu->sampler_count + 1, sizeof *gpu->samplers);
    gpu->samplers[gpu->sampler_count++] = sampler;
    return sampler.handle;
}

// ---- Layouts

// Adds a shader's interface to the pipeline's; false and logged when two stages disagree about a binding.
static bool interface_merge(gpu_pipeline_object *pipeline, const gpu_shader *shader)
{
    for (uint32_t number = 0; number < GPU_BINDINGS_MAX; number++) {
        if (!(shader->binding_mask >> number & 1))
            continue;
        const VkDescriptorType type = shader->binding_types[number];
        if ((pipeline->binding_mask >> number & 1) && pipeline->binding_types[number] != type) {
            log_error("%s: binding %u is of another type in %s", shader->name, number, pipeline->name);
            return false;
        }
        pipeline->binding_types[number] = type;
    }
    pipeline->binding_mask |= shader->binding_mask;
    pipeline->push_size = max_u32(pipeline->push_size, shader->push_size);
    pipeline->uses_scene |= shader->uses_scene;
    return true;
}

static bool set_layout_create(gpu *gpu, gpu_pipeline_object *pipeline)
{
    VkDescriptorSetLayoutBinding bindings[GPU_BINDINGS_MAX];
    uint32_t count = 0;
    for (uint32_t number = 0; number < GPU_BINDINGS_MAX; number++) {
        if (!(pipeline->binding_mask >> number & 1))
            continue;
        bindings[count++] = (VkDescriptorSetLayoutBinding){
            .binding = number,
            .descriptorType = pipeline->binding_types[number],
            .descriptorCount = 1,
            .stageFlags = VK_SHADER_STAGE_ALL,
        };
    }
    const VkDescriptorSetLayoutCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
        .flags = VK_DESCRIPTOR_SET_LAYOUT_CREATE_PUSH_DESCRIPTOR_BIT_KHR,
        .bindingCount = count,
        .pBindings = bindings,
    };
    return VK(vkCreateDescriptorSetLayout(gpu->device, &info, NULL, &pipeline->owned.set_layout), pipeline->name);
}

static bool layout_create(gpu *gpu, gpu_pipeline_object *pipeline)
{
    if (!set_layout_create(gpu, pipeline))
        return false;
    const VkDescriptorSetLayout sets[] = {pipeline->owned.set_layout, gpu->scene_layout};
    // One range for all pipelines, so that gpu_push need not know which stage reads what.
    const VkPushConstantRange push = {VK_SHADER_STAGE_ALL, 0, GPU_PUSH_MAX};
    const VkPipelineLayoutCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
        .setLayoutCount = countof(sets),
        .pSetLayouts = sets,
        .pushConstantRangeCount = 1,
        .pPushConstantRanges = &push,
    };
    return VK(vkCreatePipelineLayout(gpu->device, &info, NULL, &pipeline->owned.layout), pipeline->name);
}

// ---- Stages

enum { CONSTANTS_MAX = 16 };

typedef struct specialization {
    VkSpecializationMapEntry entries[CONSTANTS_MAX];
    VkSpecializationInfo info;
} specialization;

static void specialization_init(specialization *specialization, const uint32_t *constants, uint32_t count)
{
    assert(count <= CONSTANTS_MAX);
    for (uint32_t i = 0; i < count; i++)
        specialization->entries[i] = (VkSpecializationMapEntry){i, i * sizeof *constants, sizeof *constants};
    specialization->info = (VkSpecializationInfo){
        .mapEntryCount = count,
        .pMapEntries = specialization->entries,
        .dataSize = count * sizeof *constants,
        .pData = constants,
    };
}

// Makes the shader module that the stage refers to; destroy it once the pipeline exists.
static bool stage_init(gpu *gpu, VkPipelineShaderStageCreateInfo *stage, VkShaderStageFlagBits bit,
                       const gpu_shader *shader, const specialization *specialization)
{
    const VkShaderModuleCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO,
        .codeSize = shader->word_count * sizeof *shader->words,
        .pCode = shader->words,
    };
    *stage = (VkPipelineShaderStageCreateInfo){
        .sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
        .stage = bit,
        .pName = "main",
        .pSpecializationInfo = &specialization->info,
    };
    if (!VK(vkCreateShaderModule(gpu->device, &info, NULL, &stage->module), shader->name))
        return false;
    gpu_name_set(gpu, VK_OBJECT_TYPE_SHADER_MODULE, (uint64_t)stage->module, shader->name);
    return true;
}

static gpu_pipeline pipeline_add(gpu *gpu, const gpu_pipeline_object *made)
{
    gpu_pipeline pipeline;
    gpu_pipeline_object *object = gpu_pool_add(&gpu->pipelines, sizeof *object, &pipeline.id);
    *object = *made;
    gpu_name_set(gpu, VK_OBJECT_TYPE_PIPELINE, (uint64_t)object->owned.pipeline, object->name);
    return pipeline;
}

void gpu_pipeline_destroy(gpu *gpu, gpu_pipeline pipeline)
{
    if (!pipeline.id)
        return;
    const gpu_pipeline_object *object = gpu_pool_get(&gpu->pipelines, pipeline.id);
    gpu_buffer_destroy(gpu, object->table);
    gpu_owned_retire(gpu, &object->owned);
    gpu_pool_remove(&gpu->pipelines, pipeline.id);
}

// ---- Compute

gpu_pipeline gpu_compute_pipeline_create(gpu *gpu, const gpu_compute_pipeline_desc *desc)
{
    gpu_pipeline_object made = {.bind_point = VK_PIPELINE_BIND_POINT_COMPUTE};
    snprintf(made.name, sizeof made.name, "%s", desc->shader->name);
    specialization specialization;
    specialization_init(&specialization, desc->constants, desc->constant_count);
    VkComputePipelineCreateInfo info = {.sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO};
    bool done = interface_merge(&made, desc->shader) && layout_create(gpu, &made) &&
                stage_init(gpu, &info.stage, VK_SHADER_STAGE_COMPUTE_BIT, desc->shader, &specialization);
    info.layout = made.owned.layout;
    done = done &&
           VK(vkCreateComputePipelines(gpu->device, VK_NULL_HANDLE, 1, &info, NULL, &made.owned.pipeline), made.name);
    vkDestroyShaderModule(gpu->device, info.stage.module, NULL);
    if (done)
        return pipeline_add(gpu, &made);
    gpu_owned_destroy(gpu, &made.owned);
    return (gpu_pipeline){0};
}

// ---- Graphics

static VkPipelineColorBlendAttachmentState blend_state(gpu_blend blend)
{
    return (VkPipelineColorBlendAttachmentState){
        .blendEnable = blend == GPU_BLEND_ADD,
        .srcColorBlendFactor = VK_BLEND_FACTOR_ONE,
        .dstColorBlendFactor = VK_BLEND_FACTOR_ONE,
        .colorBlendOp = VK_BLEND_OP_ADD,
        .srcAlphaBlendFactor = VK_BLEND_FACTOR_ONE,
        .dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE,
        .alphaBlendOp = VK_BLEND_OP_ADD,
        .colorWriteMask =
            VK_COLOR_COMPONENT_R_BIT | VK_COLOR_COMPONENT_G_BIT | VK_COLOR_COMPONENT_B_BIT | VK_COLOR_COMPONENT_A_BIT,
    };
}

static bool graphics_create(gpu *gpu, const gpu_graphics_pipeline_desc *desc,
                            const VkPipelineShaderStageCreateInfo *stages, gpu_pipeline_object *made)
{
    // Nothing to fetch: vertex shaders read storage buffers.
    const VkPipelineVertexInputStateCreateInfo vertex_input = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO,
    };
    const VkPipelineInputAssemblyStateCreateInfo assembly = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO,
        .topology = desc->topology,
    };
    const VkPipelineViewportStateCreateInfo viewport = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO,
        .viewportCount = 1,
        .scissorCount = 1,
    };
    const VkPipelineRasterizationStateCreateInfo rasterization = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO,
        .depthClampEnable = desc->depth_clamp,
        .polygonMode = VK_POLYGON_MODE_FILL,
        .cullMode = desc->cull,
        .frontFace = desc->clockwise ? VK_FRONT_FACE_CLOCKWISE : VK_FRONT_FACE_COUNTER_CLOCKWISE,
        .lineWidth = 1,
    };
    const VkPipelineMultisampleStateCreateInfo multisample = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO,
        .rasterizationSamples = VK_SAMPLE_COUNT_1_BIT,
    };
    const VkPipelineDepthStencilStateCreateInfo depth = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO,
        // Depth is written only where the test is enabled.
        .depthTestEnable = desc->depth_compare != VK_COMPARE_OP_NEVER || desc->depth_write,
        .depthWriteEnable = desc->depth_write,
        .depthCompareOp = desc->depth_compare ? desc->depth_compare : VK_COMPARE_OP_ALWAYS,
    };
    const VkPipelineColorBlendAttachmentState target = blend_state(desc->blend);
    VkPipelineColorBlendAttachmentState attachments[countof(desc->color_formats)];
    assert(desc->color_count <= countof(attachments));
    for (uint32_t i = 0; i < desc->color_count; i++)
        attachments[i] = target;
    const VkPipelineColorBlendStateCreateInfo blend = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO,
        .attachmentCount = desc->color_count,
        .pAttachments = attachments,
    };
    const VkDynamicState dynamic_states[] = {
        VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR,
        VK_DYNAMIC_STATE_CULL_MODE, // last, as it may be left off
    };
    const VkPipelineDynamicStateCreateInfo dynamic = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO,
        .dynamicStateCount = countof(dynamic_states) - !desc->cull_dynamic,
        .pDynamicStates = dynamic_states,
    };
    const VkPipelineRenderingCreateInfo rendering = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO,
        .colorAttachmentCount = desc->color_count,
        .pColorAttachmentFormats = desc->color_formats,
        .depthAttachmentFormat = desc->depth_format,
    };
    const VkGraphicsPipelineCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO,
        .pNext = &rendering,
        .stageCount = desc->fragment ? 2 : 1,
        .pStages = stages,
        .pVertexInputState = &vertex_input,
        .pInputAssemblyState = &assembly,
        .pViewportState = &viewport,
        .pRasterizationState = &rasterization,
        .pMultisampleState = &multisample,
        .pDepthStencilState = &depth,
        .pColorBlendState = &blend,
        .pDynamicState = &dynamic,
        .layout = made->owned.layout,
    };
    return VK(vkCreateGraphicsPipelines(gpu->device, VK_NULL_HANDLE, 1, &info, NULL, &made->owned.pipeline),
              made->name);
}

gpu_pipeline gpu_graphics_pipeline_create(gpu *gpu, const gpu_graphics_pipeline_desc *desc)
{
    gpu_pipeline_object made = {.bind_point = VK_PIPELINE_BIND_POINT_GRAPHICS};
    snprintf(made.name, sizeof made.name, "%s", desc->fragment ? desc->fragment->name : desc->vertex->name);
    specialization specialization;
    specialization_init(&specialization, desc->constants, desc->constant_count);
    VkPipelineShaderStageCreateInfo stages[2] = {0};
    bool done = interface_merge(&made, desc->vertex) &&
                stage_init(gpu, &stages[0], VK_SHADER_STAGE_VERTEX_BIT, desc->vertex, &specialization);
    if (desc->fragment)
        done = done && interface_merge(&made, desc->fragment) &&
               stage_init(gpu, &stages[1], VK_SHADER_STAGE_FRAGMENT_BIT, desc->fragment, &specialization);
    done = done && layout_create(gpu, &made) && graphics_create(gpu, desc, stages, &made);
    for (size_t i = 0; i < countof(stages); i++)
        vkDestroyShaderModule(gpu->device, stages[i].module, NULL);
    if (done)
        return pipeline_add(gpu, &made);
    gpu_owned_destroy(gpu, &made.owned);
    return (gpu_pipeline){0};
}

// ---- Ray tracing

enum { RAYGEN, MISS, CLOSEST_HIT, ANY_HIT, RAY_STAGES };
enum { RAYGEN_GROUP, MISS_GROUP, HIT_GROUP, RAY_GROUPS };

static bool ray_stages_init(gpu *gpu, const gpu_ray_pipeline_desc *desc, const specialization *specialization,
                            VkPipelineShaderStageCreateInfo *stages, gpu_pipeline_object *made)
{
    const struct {
        VkShaderStageFlagBits bit;
        const gpu_shader *shader;
    } sources[RAY_STAGES] = {
        [RAYGEN] = {VK_SHADER_STAGE_RAYGEN_BIT_KHR, desc->raygen},
        [MISS] = {VK_SHADER_STAGE_MISS_BIT_KHR, desc->miss},
        [CLOSEST_HIT] = {VK_SHADER_STAGE_CLOSEST_HIT_BIT_KHR, desc->closest_hit},
        [ANY_HIT] = {VK_SHADER_STAGE_ANY_HIT_BIT_KHR, desc->any_hit},
    };
    for (int i = 0; i < RAY_STAGES; i++)
        if (!interface_merge(made, sources[i].shader) ||
            !stage_init(gpu, &stages[i], sources[i].bit, sources[i].shader, specialization))
            return false;
    return true;
}

static bool ray_pipeline_create(gpu *gpu, const VkPipelineShaderStageCreateInfo *stages, gpu_pipeline_object *made)
{
    const VkRayTracingShaderGroupCreateInfoKHR unused = {
        .sType = VK_STRUCTURE_TYPE_RAY_TRACING_SHADER_GROUP_CREATE_INFO_KHR,
        .type = VK_RAY_TRACING_SHADER_GROUP_TYPE_GENERAL_KHR,
        .generalShader = VK_SHADER_UNUSED_KHR,
        .closestHitShader = VK_SHADER_UNUSED_KHR,
        .anyHitShader = VK_SHADER_UNUSED_KHR,
        .intersectionShader = VK_SHADER_UNUSED_KHR,
    };
    VkRayTracingShaderGroupCreateInfoKHR groups[RAY_GROUPS] = {unused, unused, unused};
    groups[RAYGEN_GROUP].generalShader = RAYGEN;
    groups[MISS_GROUP].generalShader = MISS;
    groups[HIT_GROUP].type = VK_RAY_TRACING_SHADER_GROUP_TYPE_TRIANGLES_HIT_GROUP_KHR;
    groups[HIT_GROUP].closestHitShader = CLOSEST_HIT;
    groups[HIT_GROUP].anyHitShader = ANY_HIT;
    const VkRayTracingPipelineCreateInfoKHR info = {
        .sType = VK_STRUCTURE_TYPE_RAY_TRACING_PIPELINE_CREATE_INFO_KHR,
        .stageCount = RAY_STAGES,
        .pStages = stages,
        .groupCount = RAY_GROUPS,
        .pGroups = groups,
        .maxPipelineRayRecursionDepth = 1,
        .layout = made->owned.layout,
    };
    return VK(gpu->vkCreateRayTracingPipelinesKHR(gpu->device, VK_NULL_HANDLE, VK_NULL_HANDLE, 1, &info, NULL,
                                                  &made->owned.pipeline),
              made->name);
}

// One record a group, each at the alignment that a region's start needs.
static bool ray_table_create(gpu *gpu, gpu_pipeline_object *made)
{
    const VkDeviceSize stride = align_up(gpu->handle_size, max_u32(gpu->handle_alignment, gpu->table_alignment));
    const gpu_buffer_desc desc = {
        .name = "shader binding table",
        .size = RAY_GROUPS * stride + gpu->table_alignment, // room for aligning the address
        .usage = VK_BUFFER_USAGE_SHADER_BINDING_TABLE_BIT_KHR | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
        .host = true,
    };
    made->table = gpu_buffer_create_unbound(gpu, &desc);
    if (!made->table.id)
        return false;
    const VkDeviceAddress address = gpu_buffer_address(gpu, made->table);
    const VkDeviceAddress first = align_up(address, gpu->table_alignment);
    uint8_t *records = (uint8_t *)gpu_buffer_map(gpu, made->table) + (first - address);
    VkStridedDeviceAddressRegionKHR *const regions[RAY_GROUPS] = {&made->raygen, &made->miss, &made->hit};
    for (uint32_t group = 0; group < RAY_GROUPS; group++) {
        *regions[group] = (VkStridedDeviceAddressRegionKHR){first + group * stride, stride, stride};
        if (!VK(gpu->vkGetRayTracingShaderGroupHandlesKHR(gpu->device, made->owned.pipeline, group, 1, gpu->handle_size,
                                                          records + group * stride),
                made->name))
            return false;
    }
    return true;
}

gpu_pipeline gpu_ray_pipeline_create(gpu *gpu, const gpu_ray_pipeline_desc *desc)
{
    assert(gpu->has_ray_pipelines);
    gpu_pipeline_object made = {.bind_point = VK_PIPELINE_BIND_POINT_RAY_TRACING_KHR};
    snprintf(made.name, sizeof made.name, "%s", desc->raygen->name);
    specialization specialization;
    specialization_init(&specialization, desc->constants, desc->constant_count);
    VkPipelineShaderStageCreateInfo stages[RAY_STAGES] = {0};
    const bool done = ray_stages_init(gpu, desc, &specialization, stages, &made) && layout_create(gpu, &made) &&
                      ray_pipeline_create(gpu, stages, &made) && ray_table_create(gpu, &made);
    for (size_t i = 0; i < countof(stages); i++)
        vkDestroyShaderModule(gpu->device, stages[i].module, NULL);
    if (done)
        return pipeline_add(gpu, &made);
    gpu_buffer_destroy(gpu, made.table);
    gpu_owned_destroy(gpu, &made.owned);
    return (gpu_pipeline){0};
}
