// What each access means to Vulkan: see frame_graph_access_info in frame_graph_compile.h.
#include "frame_graph_compile.h"

enum {
    BUFFERS = 1 << FRAME_GRAPH_BUFFER,
    IMAGES = 1 << FRAME_GRAPH_IMAGE,
    ACCELERATIONS = 1 << FRAME_GRAPH_ACCELERATION,
    GRAPHICS = 1 << FRAME_GRAPH_GRAPHICS,
    SHADERS = GRAPHICS | 1 << FRAME_GRAPH_COMPUTE | 1 << FRAME_GRAPH_RAY_TRACING,
    DEVICE = SHADERS | 1 << FRAME_GRAPH_TRANSFER,
    HOST = 1 << FRAME_GRAPH_HOST,
};

#define DEPTH_STAGES (VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT)

static const frame_graph_access_info ACCESSES[ACCESS_COUNT] = {
    [ACCESS_NONE] = {.name = "none"},
    [ACCESS_COLOR_ATTACHMENT] =
        {
            .name = "color attachment",
            .stages = VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT,
            .mask = VK_ACCESS_2_COLOR_ATTACHMENT_READ_BIT | VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT,
            .layout = VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT,
            .write = true,
            .attachment = true,
            .resource_kinds = IMAGES,
            .pass_kinds = GRAPHICS,
        },
    [ACCESS_DEPTH_ATTACHMENT] =
        {
            .name = "depth attachment",
            .stages = DEPTH_STAGES,
            .mask = VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT,
            .layout = VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT,
            .write = true,
            .attachment = true,
            .resource_kinds = IMAGES,
            .pass_kinds = GRAPHICS,
        },
    [ACCESS_DEPTH_TEST] =
        {
            .name = "depth test",
            .stages = DEPTH_STAGES,
            .mask = VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT,
            .layout = VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT,
            .attachment = true,
            .resource_kinds = IMAGES,
            .pass_kinds = GRAPHICS,
        },
    [ACCESS_DEPTH_TEST_SAMPLED] =
        {
            .name = "depth test, sampled",
            .stages = DEPTH_STAGES,
            .shader = true,
            .mask = VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_2_SHADER_SAMPLED_READ_BIT,
            .layout = VK_IMAGE_LAYOUT_DEPTH_STENCIL_READ_ONLY_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_SAMPLED_BIT,
            .binding = true,
            .attachment = true,
            .resource_kinds = IMAGES,
            .pass_kinds = GRAPHICS,
        },
    [ACCESS_SAMPLED] =
        {
            .name = "sampled",
            .shader = true,
            .mask = VK_ACCESS_2_SHADER_SAMPLED_READ_BIT,
            .layout = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_SAMPLED_BIT,
            .binding = true,
            .resource_kinds = IMAGES,
            .pass_kinds = SHADERS,
        },
    [ACCESS_STORAGE_READ] =
        {
            .name = "storage read",
            .shader = true,
            .mask = VK_ACCESS_2_SHADER_STORAGE_READ_BIT,
            .layout = VK_IMAGE_LAYOUT_GENERAL,
            .image_usage = VK_IMAGE_USAGE_STORAGE_BIT,
            .buffer_usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
            .binding = true,
            .resource_kinds = BUFFERS | IMAGES,
            .pass_kinds = SHADERS,
        },
    [ACCESS_STORAGE_WRITE] =
        {
            .name = "storage write",
            .shader = true,
            .mask = VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT,
            .layout = VK_IMAGE_LAYOUT_GENERAL,
            .image_usage = VK_IMAGE_USAGE_STORAGE_BIT,
            .buffer_usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
            .write = true,
            .binding = true,
            .resource_kinds = BUFFERS | IMAGES,
            .pass_kinds = SHADERS,
        },
    [ACCESS_STORAGE_READ_WRITE] =
        {
            .name = "storage read and write",
            .stages = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT,
            .shader = true,
            .mask = VK_ACCESS_2_SHADER_STORAGE_READ_BIT | VK_ACCESS_2_SHADER_STORAGE_WRITE_BIT |
                    VK_ACCESS_2_TRANSFER_WRITE_BIT,
            .layout = VK_IMAGE_LAYOUT_GENERAL,
            .image_usage = VK_IMAGE_USAGE_STORAGE_BIT,
            .buffer_usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT,
            .write = true,
            .binding = true,
            .resource_kinds = BUFFERS | IMAGES,
            .pass_kinds = SHADERS,
        },
    [ACCESS_UNIFORM] =
        {
            .name = "uniform",
            .shader = true,
            .mask = VK_ACCESS_2_UNIFORM_READ_BIT,
            .buffer_usage = VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT,
            .binding = true,
            .resource_kinds = BUFFERS,
            .pass_kinds = SHADERS,
        },
    [ACCESS_INDIRECT] =
        {
            .name = "indirect",
            .stages = VK_PIPELINE_STAGE_2_DRAW_INDIRECT_BIT,
            .mask = VK_ACCESS_2_INDIRECT_COMMAND_READ_BIT,
            .buffer_usage = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
            .resource_kinds = BUFFERS,
            .pass_kinds = SHADERS,
        },
    [ACCESS_TRANSFER_READ] =
        {
            .name = "transfer read",
            .stages = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT,
            .mask = VK_ACCESS_2_TRANSFER_READ_BIT,
            .layout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT,
            .buffer_usage = VK_BUFFER_USAGE_TRANSFER_SRC_BIT,
            .resource_kinds = BUFFERS | IMAGES,
            .pass_kinds = DEVICE,
        },
    [ACCESS_TRANSFER_WRITE] =
        {
            .name = "transfer write",
            .stages = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT,
            .mask = VK_ACCESS_2_TRANSFER_WRITE_BIT,
            .layout = VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
            .image_usage = VK_IMAGE_USAGE_TRANSFER_DST_BIT,
            .buffer_usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT,
            .write = true,
            .resource_kinds = BUFFERS | IMAGES,
            .pass_kinds = DEVICE,
        },
    [ACCESS_BUILD_INPUT] =
        {
            .name = "build input",
            .stages = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
            // The specification has builds read their instances, and all but scratch, as shader reads.
            .mask = VK_ACCESS_2_SHADER_READ_BIT,
            .buffer_usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
                            VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
            .resource_kinds = BUFFERS,
            .pass_kinds = DEVICE,
        },
    [ACCESS_BUILD_WRITE] =
        {
            .name = "build write",
            .stages = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
            .mask = VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR | VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
            .write = true,
            .resource_kinds = ACCELERATIONS,
            .pass_kinds = DEVICE,
        },
    [ACCESS_TRACE] =
        {
            .name = "trace",
            .shader = true,
            .mask = VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR,
            .binding = true,
            .resource_kinds = ACCELERATIONS,
            .pass_kinds = SHADERS,
        },
    [ACCESS_HOST_READ] =
        {
            .name = "host read",
            .stages = VK_PIPELINE_STAGE_2_HOST_BIT,
            .mask = VK_ACCESS_2_HOST_READ_BIT,
            .resource_kinds = BUFFERS,
            .pass_kinds = HOST,
        },
    [ACCESS_HOST_WRITE] =
        {
            .name = "host write",
            .stages = VK_PIPELINE_STAGE_2_HOST_BIT,
            .mask = VK_ACCESS_2_HOST_WRITE_BIT,
            .write = true,
            .resource_kinds = BUFFERS,
            .pass_kinds = HOST,
        },
};

const frame_graph_access_info *frame_graph_access_describe(frame_graph_access access)
{
    assert((uint32_t)access < ACCESS_COUNT);
    return &ACCESSES[access];
}
