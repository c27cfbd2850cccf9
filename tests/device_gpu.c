// The device layer on a real device (lavapipe will do), with the validation layer counting what we do wrong.
#include "test.h"

#include "engine/gpu.h"
#include "engine/shader.h"
#include "test_shaders_shaders.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

static gpu *device;

// ---- Helpers

static gpu_buffer buffer_of(const void *data, VkDeviceSize size)
{
    const gpu_buffer_desc desc = {
        .name = "test", .size = size, .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, .data = data};
    return gpu_buffer_create(device, &desc);
}

static gpu_pipeline compute(const gpu_shader *shader)
{
    const gpu_compute_pipeline_desc desc = {.shader = shader};
    return gpu_compute_pipeline_create(device, &desc);
}

static void submit(gpu_commands *commands)
{
    CHECK(gpu_commands_submit_and_wait(device, commands));
}

// Collects the log in place of stderr.
static char logged[4096];

static void log_collect(log_level level, const char *line, void *user)
{
    (void)level, (void)user;
    const size_t length = strlen(logged);
    snprintf(logged + length, sizeof logged - length, "%s\n", line);
}

static void log_capture_begin(void)
{
    logged[0] = '\0';
    log_sink_set(log_collect, NULL);
}

static void log_capture_end(void)
{
    log_sink_set(NULL, NULL);
}

// ---- Device

TEST(unknown_device_name_is_refused_with_the_names_there_are)
{
    log_capture_begin();
    const gpu_desc desc = {.device = "no such device"};
    gpu *none = gpu_create(&desc);
    log_capture_end();
    CHECK(!none);
    CHECK(strstr(logged, "\"no such device\""));
    CHECK(strstr(logged, gpu_name(device)));
}

TEST(device_is_found_by_part_of_its_name_in_any_case)
{
    char part[8] = {0};
    strncpy(part, gpu_name(device), sizeof part - 1);
    for (char *c = part; *c; c++)
        if (*c >= 'a' && *c <= 'z')
            *c = (char)(*c - 'a' + 'A');
    const gpu_desc desc = {.device = part};
    gpu *found = gpu_create(&desc);
    CHECK(found && strcmp(gpu_name(found), gpu_name(device)) == 0);
    gpu_destroy(found);
}

TEST(printed_devices_name_the_one_in_use)
{
    char text[4096] = {0};
    FILE *out = fmemopen(text, sizeof text - 1, "w");
    const uint32_t usable = gpu_devices_print(out);
    fclose(out);
    CHECK(usable >= 1);
    CHECK(strstr(text, gpu_name(device)) && strstr(text, ": usable\n"));
}

TEST(write_after_write_without_a_barrier_is_reported)
{
    const gpu_desc desc = {.device = gpu_name(device), .validation = true};
    gpu *other = gpu_create(&desc);
    const gpu_buffer_desc buffer_desc = {.name = "raced", .size = 64};
    const gpu_buffer buffer = gpu_buffer_create(other, &buffer_desc);
    gpu_commands *commands = gpu_commands_begin(other);
    log_capture_begin();
    gpu_buffer_fill(commands, buffer, 0, 64, 1);
    gpu_buffer_fill(commands, buffer, 0, 64, 2);
    gpu_commands_submit_and_wait(other, commands);
    log_capture_end();
    CHECK(gpu_validation_messages(other) == 1);
    CHECK(strstr(logged, "WRITE_AFTER_WRITE") || strstr(logged, "WRITE-AFTER-WRITE"));
    gpu_destroy(other);
}

// ---- Resources

TEST(device_buffer_keeps_what_was_written)
{
    uint32_t data[1000], read[1000];
    for (uint32_t i = 0; i < countof(data); i++)
        data[i] = i * i;
    const gpu_buffer buffer = buffer_of(data, sizeof data);
    CHECK(gpu_buffer_size(device, buffer) == sizeof data);
    const uint32_t patch[] = {7, 8};
    CHECK(gpu_buffer_write(device, buffer, 40, patch, sizeof patch));
    CHECK(gpu_buffer_read(device, buffer, 0, read, sizeof read));
    data[10] = 7, data[11] = 8;
    CHECK(memcmp(data, read, sizeof data) == 0);
    gpu_buffer_destroy(device, buffer);
}

TEST(empty_buffer_has_sixteen_bytes)
{
    const gpu_buffer buffer = buffer_of(NULL, 0);
    CHECK(gpu_buffer_size(device, buffer) == 16);
    gpu_buffer_destroy(device, buffer);
}

TEST(host_buffer_shows_what_the_device_copied)
{
    const uint32_t data[] = {1, 2, 3, 4};
    const gpu_buffer source = buffer_of(data, sizeof data);
    const gpu_buffer_desc desc = {.name = "host", .size = sizeof data, .host = true};
    const gpu_buffer host = gpu_buffer_create(device, &desc);
    gpu_commands *commands = gpu_commands_begin(device);
    gpu_buffer_copy(commands, source, host, sizeof data);
    submit(commands);
    CHECK(memcmp(gpu_buffer_map(device, host), data, sizeof data) == 0);
    gpu_buffer_destroy(device, host);
    gpu_buffer_destroy(device, source);
}

TEST(two_buffers_share_one_memory)
{
    const gpu_buffer_desc plain = {.name = "placed", .size = 1000, .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT};
    const VkMemoryRequirements needs = gpu_buffer_requirements(device, &plain);
    VkMemoryRequirements both = needs;
    const VkDeviceSize second_offset = align_up(needs.size, needs.alignment);
    both.size = second_offset + needs.size;
    const VkDeviceSize before = gpu_memory_used(device);
    const gpu_memory memory = gpu_memory_create(device, &both);
    gpu_buffer_desc placed = plain;
    placed.memory = memory;
    const gpu_buffer first = gpu_buffer_create(device, &placed);
    placed.offset = second_offset;
    const gpu_buffer second = gpu_buffer_create(device, &placed);
    CHECK(gpu_memory_used(device) - before == both.size);

    gpu_commands *commands = gpu_commands_begin(device);
    gpu_buffer_fill(commands, first, 0, 1000, 11);
    gpu_buffer_fill(commands, second, 0, 1000, 22);
    submit(commands);
    uint32_t values[2];
    CHECK(gpu_buffer_read(device, first, 996, &values[0], 4) && gpu_buffer_read(device, second, 0, &values[1], 4));
    CHECK(values[0] == 11 && values[1] == 22);
    gpu_buffer_destroy(device, first);
    gpu_buffer_destroy(device, second);
    gpu_memory_destroy(device, memory);
    CHECK(gpu_memory_used(device) == before);
}

TEST(memory_is_counted_and_given_back)
{
    const VkDeviceSize before = gpu_memory_used(device);
    const gpu_buffer buffer = buffer_of(NULL, 1 << 20);
    CHECK(gpu_memory_used(device) >= before + (1 << 20));
    gpu_buffer_destroy(device, buffer);
    CHECK(gpu_memory_used(device) == before);
    CHECK(gpu_memory_peak(device) >= before + (1 << 20));
    gpu_memory_peak_reset(device);
    CHECK(gpu_memory_peak(device) == before);
}

TEST(destroyed_buffer_lives_until_its_commands_have_finished)
{
    const VkDeviceSize before = gpu_memory_used(device);
    const gpu_buffer buffer = buffer_of(NULL, 4096);
    gpu_commands *commands = gpu_commands_begin(device);
    gpu_buffer_fill(commands, buffer, 0, 4096, 3);
    gpu_buffer_destroy(device, buffer);
    CHECK(gpu_memory_used(device) > before);
    // Loading in the middle of a frame submits commands of its own, which must not release the buffer either.
    const gpu_buffer loaded = buffer_of("abc", 4);
    CHECK(gpu_memory_used(device) > before + 4096);
    submit(commands);
    gpu_buffer_destroy(device, loaded);
    CHECK(gpu_memory_used(device) == before);
}

TEST(too_large_storage_buffer_is_refused_by_name)
{
    log_capture_begin();
    const gpu_buffer_desc desc = {.name = "monster", .size = 1ull << 40, .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT};
    const gpu_buffer buffer = gpu_buffer_create(device, &desc);
    log_capture_end();
    CHECK(!buffer.id);
    CHECK(strstr(logged, "monster"));
}

// Runs `use` on the handle in a child process; true when an assertion stopped it.
static bool use_is_asserted(void (*use)(gpu_buffer), gpu_buffer buffer)
{
    fflush(stdout);
    const pid_t child = fork();
    if (child == 0) {
        if (!freopen("/dev/null", "w", stderr))
            _exit(1);
        use(buffer);
        _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    return WIFSIGNALED(status) && WTERMSIG(status) == SIGABRT;
}

static void size_query(gpu_buffer buffer)
{
    gpu_buffer_size(device, buffer);
}

TEST(stale_handle_is_asserted_even_when_its_slot_is_used_again)
{
    const gpu_buffer old = buffer_of(NULL, 16);
    CHECK(!use_is_asserted(size_query, old));
    gpu_buffer_destroy(device, old);
    CHECK(use_is_asserted(size_query, old));
    const gpu_buffer new = buffer_of(NULL, 32);
    CHECK(new.id != old.id);
    CHECK(use_is_asserted(size_query, old));
    CHECK(use_is_asserted(size_query, (gpu_buffer){0}));
    gpu_buffer_destroy(device, new);
}

TEST(destroying_null_handles_does_nothing)
{
    gpu_buffer_destroy(device, (gpu_buffer){0});
    gpu_image_destroy(device, (gpu_image){0});
    gpu_memory_destroy(device, (gpu_memory){0});
    gpu_pipeline_destroy(device, (gpu_pipeline){0});
    gpu_acceleration_destroy(device, (gpu_acceleration){0});
    gpu_destroy(NULL);
}

// ---- Compute

TEST(dispatch_reads_push_constants_bindings_and_the_scene)
{
    uint32_t data[100], read[100];
    for (uint32_t i = 0; i < countof(data); i++)
        data[i] = i;
    const uint32_t scene_value = 1000;
    const gpu_buffer input = buffer_of(data, sizeof data);
    const gpu_buffer output = buffer_of(data, sizeof data);
    const gpu_buffer scene = buffer_of(&scene_value, sizeof scene_value);
    const gpu_pipeline pipeline = compute(&shader_gpu_scale_comp);
    gpu_scene_bind_buffer(device, 2, scene);

    gpu_commands *commands = gpu_commands_begin(device);
    const gpu_binding bindings[] = {[0].buffer = input, [1].buffer = scene, [3].buffer = output};
    gpu_bind(commands, pipeline, bindings, countof(bindings));
    const uint32_t push[] = {90, 3};
    gpu_push(commands, push, sizeof push);
    gpu_dispatch(commands, 2, 1, 1);
    gpu_dispatch(commands, 0, 1, 1);
    submit(commands);
    CHECK(gpu_buffer_read(device, output, 0, read, sizeof read));
    uint32_t wrong = 0;
    for (uint32_t i = 0; i < countof(read); i++)
        wrong += read[i] != (i < 90 ? i * 3 + 1000 : i);
    CHECK(wrong == 0);
    gpu_pipeline_destroy(device, pipeline);
    gpu_buffer_destroy(device, scene);
    gpu_buffer_destroy(device, output);
    gpu_buffer_destroy(device, input);
}

TEST(indirect_dispatch_runs_what_a_shader_wrote)
{
    const gpu_buffer_desc desc = {
        .name = "arguments",
        .size = 16,
        .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
    };
    const gpu_buffer arguments = gpu_buffer_create(device, &desc);
    const gpu_buffer counter = buffer_of(NULL, 4);
    const gpu_pipeline writer = compute(&shader_gpu_arguments_comp);
    const gpu_pipeline worker = compute(&shader_gpu_count_comp);
    gpu_commands *commands = gpu_commands_begin(device);
    gpu_buffer_fill(commands, counter, 0, 4, 0);
    const gpu_binding writer_bindings[] = {{.buffer = arguments}};
    gpu_bind(commands, writer, writer_bindings, 1);
    gpu_dispatch(commands, 1, 1, 1);
    gpu_memory_barrier(commands);
    const gpu_binding worker_bindings[] = {{.buffer = counter}};
    gpu_bind(commands, worker, worker_bindings, 1);
    gpu_dispatch_indirect(commands, arguments, 4);
    submit(commands);
    uint32_t count = 0;
    CHECK(gpu_buffer_read(device, counter, 0, &count, 4));
    CHECK(count == 5 * 3 * 4);
    gpu_pipeline_destroy(device, worker);
    gpu_pipeline_destroy(device, writer);
    gpu_buffer_destroy(device, counter);
    gpu_buffer_destroy(device, arguments);
}

TEST(specialization_constants_replace_the_defaults)
{
    const float real = 0.25f;
    uint32_t constants[] = {42, 0, VK_TRUE};
    memcpy(&constants[1], &real, sizeof real);
    const gpu_compute_pipeline_desc desc = {&shader_gpu_constants_comp, constants, countof(constants)};
    const gpu_pipeline pipelines[] = {gpu_compute_pipeline_create(device, &desc), compute(&shader_gpu_constants_comp)};
    const float expected[][3] = {{42, 0.25f, 1}, {1, 2, 0}};
    const gpu_buffer output = buffer_of(NULL, 12);
    for (int i = 0; i < 2; i++) {
        gpu_commands *commands = gpu_commands_begin(device);
        const gpu_binding bindings[] = {{.buffer = output}};
        gpu_bind(commands, pipelines[i], bindings, 1);
        gpu_dispatch(commands, 1, 1, 1);
        submit(commands);
        float values[3];
        CHECK(gpu_buffer_read(device, output, 0, values, sizeof values));
        CHECK(memcmp(values, expected[i], sizeof values) == 0);
        gpu_pipeline_destroy(device, pipelines[i]);
    }
    gpu_buffer_destroy(device, output);
}

TEST(atomic_minimum_works_on_64_bits)
{
    const uint64_t start = UINT64_MAX;
    const gpu_buffer buffer = buffer_of(&start, sizeof start);
    const gpu_pipeline pipeline = compute(&shader_gpu_minimum_comp);
    gpu_commands *commands = gpu_commands_begin(device);
    const gpu_binding bindings[] = {{.buffer = buffer}};
    gpu_bind(commands, pipeline, bindings, 1);
    gpu_dispatch(commands, 10, 1, 1);
    submit(commands);
    uint64_t minimum = 0;
    CHECK(gpu_buffer_read(device, buffer, 0, &minimum, sizeof minimum));
    CHECK(minimum == 0x700000000ull - 639);
    gpu_pipeline_destroy(device, pipeline);
    gpu_buffer_destroy(device, buffer);
}

TEST(timestamps_increase)
{
    const gpu_buffer buffer = buffer_of(NULL, 1 << 20);
    gpu_commands *commands = gpu_commands_begin(device);
    gpu_label_begin(commands, "timed");
    gpu_timestamp(commands, 0);
    gpu_buffer_fill(commands, buffer, 0, 1 << 20, 1);
    gpu_timestamp(commands, 1);
    gpu_label_end(commands);
    submit(commands);
    double milliseconds[2] = {0};
    CHECK(gpu_timestamps_read(device, milliseconds, 2));
    CHECK(milliseconds[1] > milliseconds[0]);
    CHECK(milliseconds[1] - milliseconds[0] < 10000);
    gpu_buffer_destroy(device, buffer);
}

// ---- Images

static void sample_points(const float (*points)[4], float (*values)[4], uint32_t count)
{
    const gpu_buffer input = buffer_of(points, count * sizeof *points);
    const gpu_buffer output = buffer_of(NULL, count * sizeof *values);
    const gpu_pipeline pipeline = compute(&shader_gpu_sample_comp);
    gpu_commands *commands = gpu_commands_begin(device);
    const gpu_binding bindings[] = {{.buffer = input}, {.buffer = output}};
    gpu_bind(commands, pipeline, bindings, 2);
    gpu_dispatch(commands, count, 1, 1);
    submit(commands);
    CHECK(gpu_buffer_read(device, output, 0, values, count * sizeof *values));
    gpu_pipeline_destroy(device, pipeline);
    gpu_buffer_destroy(device, output);
    gpu_buffer_destroy(device, input);
}

// Left half black, right half white; the colours of `format`.
static gpu_image halves_image(VkFormat format, uint32_t mips)
{
    enum { WIDTH = 8, HEIGHT = 4 };
    uint8_t texels[HEIGHT][WIDTH][4];
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++)
            memset(texels[y][x], x < WIDTH / 2 ? 0 : 255, 4);
    const gpu_image_desc desc = {
        .name = "halves",
        .format = format,
        .width = WIDTH,
        .height = HEIGHT,
        .mips = mips,
        .usage = VK_IMAGE_USAGE_SAMPLED_BIT,
        .data = texels,
    };
    return gpu_image_create(device, &desc);
}

TEST(scene_textures_have_mips_wrap_and_filter)
{
    const gpu_sampler_desc linear_repeat = {.mag = VK_FILTER_LINEAR, .min = VK_FILTER_LINEAR};
    const gpu_sampler_desc nearest_clamp = {
        .wrap_u = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
        .wrap_v = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
        .no_mips = true,
    };
    const gpu_image image = halves_image(VK_FORMAT_R8G8B8A8_UNORM, 4);
    gpu_scene_bind_texture(device, 5, image, &linear_repeat);
    gpu_scene_bind_texture(device, 1000, image, &nearest_clamp);
    const float points[][4] = {
        {0.25f, 0.5f, 0, 5}, {0.75f, 0.5f, 0, 5}, {1.25f, 0.5f, 0, 5},    {0.5f, 0.5f, 0, 5},
        {0.3f, 0.2f, 3, 5},  {0.25f, 0.5f, 1, 5}, {1.25f, 0.5f, 0, 1000}, {0.3f, 0.2f, 3, 1000},
    };
    const float expected[] = {0, 1, 0, 0.5f, 0.5f, 0, 1, 0};
    float values[countof(points)][4];
    sample_points(points, values, countof(points));
    for (size_t i = 0; i < countof(points); i++)
        CHECK_NEAR(values[i][0], expected[i], 0.01);
    gpu_image_destroy(device, image);
}

TEST(mips_of_srgb_textures_average_light_not_codes)
{
    const gpu_sampler_desc sampler = {0};
    const gpu_image image = halves_image(VK_FORMAT_R8G8B8A8_SRGB, 4);
    gpu_scene_bind_texture(device, 0, image, &sampler);
    const float points[][4] = {{0.5f, 0.5f, 3, 0}};
    float values[1][4];
    sample_points(points, values, 1);
    CHECK_NEAR(values[0][0], 0.5, 0.01);
    gpu_image_destroy(device, image);
}

TEST(image_reads_back_in_its_own_format)
{
    const gpu_image image = halves_image(VK_FORMAT_R8G8B8A8_UNORM, 1);
    uint8_t texels[4][8][4];
    CHECK(gpu_image_read(device, image, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL, texels, sizeof texels));
    CHECK(texels[2][3][1] == 0 && texels[2][4][1] == 255);
    CHECK(gpu_image_info(device, image)->width == 8 && !gpu_image_info(device, image)->data);
    gpu_image_destroy(device, image);
}

static void image_barrier(gpu_commands *commands, gpu_image image, VkImageLayout from, VkImageLayout to)
{
    const VkImageAspectFlags aspect = gpu_image_info(device, image)->format == VK_FORMAT_D32_SFLOAT
                                          ? VK_IMAGE_ASPECT_DEPTH_BIT
                                          : VK_IMAGE_ASPECT_COLOR_BIT;
    const VkImageMemoryBarrier2 barrier = {
        .sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2,
        .srcStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
        .srcAccessMask = VK_ACCESS_2_MEMORY_WRITE_BIT,
        .dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT,
        .dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_MEMORY_WRITE_BIT,
        .oldLayout = from,
        .newLayout = to,
        .image = gpu_image_handle(device, image),
        .subresourceRange = {aspect, 0, 1, 0, 1},
    };
    const VkDependencyInfo dependency = {
        .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
        .imageMemoryBarrierCount = 1,
        .pImageMemoryBarriers = &barrier,
    };
    vkCmdPipelineBarrier2(gpu_commands_handle(commands), &dependency);
}

TEST(stored_image_is_sampled_nearest_and_clamped)
{
    const gpu_image_desc desc = {
        .name = "stored",
        .format = VK_FORMAT_R32G32B32A32_SFLOAT,
        .width = 10,
        .height = 5,
        .usage = VK_IMAGE_USAGE_STORAGE_BIT | VK_IMAGE_USAGE_SAMPLED_BIT,
    };
    const gpu_image image = gpu_image_create(device, &desc);
    const gpu_buffer output = buffer_of(NULL, 32);
    const gpu_pipeline store = compute(&shader_gpu_store_comp), fetch = compute(&shader_gpu_fetch_comp);
    const VkImageLayout general = VK_IMAGE_LAYOUT_GENERAL, sampled = VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL;
    gpu_commands *commands = gpu_commands_begin(device);
    image_barrier(commands, image, VK_IMAGE_LAYOUT_UNDEFINED, general);
    const gpu_binding store_bindings[] = {{.image = image, .layout = general}};
    gpu_bind(commands, store, store_bindings, 1);
    gpu_dispatch(commands, 2, 1, 1);
    image_barrier(commands, image, general, sampled);
    const gpu_binding fetch_bindings[] = {{.image = image, .layout = sampled}, {.buffer = output}};
    gpu_bind(commands, fetch, fetch_bindings, 2);
    gpu_dispatch(commands, 1, 1, 1);
    submit(commands);
    float values[2][4];
    const float expected[2][4] = {{2, 1, 0.5f, 1}, {9, 4, 0.5f, 1}};
    CHECK(gpu_buffer_read(device, output, 0, values, sizeof values));
    CHECK(memcmp(values, expected, sizeof values) == 0);
    gpu_pipeline_destroy(device, fetch);
    gpu_pipeline_destroy(device, store);
    gpu_buffer_destroy(device, output);
    gpu_image_destroy(device, image);
}

// ---- Graphics

typedef struct target {
    gpu_image color, depth;
} target;
enum { TARGET_SIZE = 16 };

static target target_create(void)
{
    const gpu_image_desc color = {
        .name = "colour",
        .format = VK_FORMAT_R32G32B32A32_SFLOAT,
        .width = TARGET_SIZE,
        .height = TARGET_SIZE,
        .usage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT,
    };
    gpu_image_desc depth = color;
    depth.name = "depth";
    depth.format = VK_FORMAT_D32_SFLOAT;
    depth.usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT;
    return (target){gpu_image_create(device, &color), gpu_image_create(device, &depth)};
}

static void rendering_begin(gpu_commands *commands, target target)
{
    image_barrier(commands, target.color, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL);
    image_barrier(commands, target.depth, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_GENERAL);
    const VkRenderingAttachmentInfo color = {
        .sType = VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO,
        .imageView = gpu_image_view(device, target.color),
        .imageLayout = VK_IMAGE_LAYOUT_GENERAL,
        .loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR,
        .storeOp = VK_ATTACHMENT_STORE_OP_STORE,
    };
    VkRenderingAttachmentInfo depth = color;
    depth.imageView = gpu_image_view(device, target.depth);
    depth.clearValue.depthStencil.depth = 1;
    const VkRenderingInfo info = {
        .sType = VK_STRUCTURE_TYPE_RENDERING_INFO,
        .renderArea = {{0, 0}, {TARGET_SIZE, TARGET_SIZE}},
        .layerCount = 1,
        .colorAttachmentCount = 1,
        .pColorAttachments = &color,
        .pDepthAttachment = &depth,
    };
    vkCmdBeginRendering(gpu_commands_handle(commands), &info);
    gpu_viewport_set(commands, 0, 0, TARGET_SIZE, TARGET_SIZE);
}

static void target_destroy(target target)
{
    gpu_image_destroy(device, target.color);
    gpu_image_destroy(device, target.depth);
}

typedef struct triangle_push {
    float color[4];
    float depth;
} triangle_push;

static const gpu_graphics_pipeline_desc triangle_desc = {
    .vertex = &shader_gpu_triangle_vert,
    .fragment = &shader_gpu_triangle_frag,
    .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
    .color_formats = {VK_FORMAT_R32G32B32A32_SFLOAT},
    .color_count = 1,
    .depth_format = VK_FORMAT_D32_SFLOAT,
};

static void draw_half(gpu_commands *commands, gpu_pipeline pipeline, triangle_push push)
{
    gpu_bind(commands, pipeline, NULL, 0);
    gpu_push(commands, &push, sizeof push);
    gpu_draw(commands, 6, 1, 0);
}

TEST(additive_blending_sums_all_channels)
{
    gpu_graphics_pipeline_desc desc = triangle_desc;
    desc.blend = GPU_BLEND_ADD;
    const gpu_pipeline pipeline = gpu_graphics_pipeline_create(device, &desc);
    const target target = target_create();
    gpu_commands *commands = gpu_commands_begin(device);
    rendering_begin(commands, target);
    draw_half(commands, pipeline, (triangle_push){{1, 2, 3, 4}, 0.5f});
    draw_half(commands, pipeline, (triangle_push){{10, 20, 30, 40}, 0.9f});
    vkCmdEndRendering(gpu_commands_handle(commands));
    submit(commands);
    float texels[TARGET_SIZE][TARGET_SIZE][4];
    CHECK(gpu_image_read(device, target.color, VK_IMAGE_LAYOUT_GENERAL, texels, sizeof texels));
    const float sum[4] = {11, 22, 33, 44}, clear[4] = {0};
    CHECK(memcmp(texels[3][7], sum, sizeof sum) == 0);
    CHECK(memcmp(texels[3][8], clear, sizeof clear) == 0);
    target_destroy(target);
    gpu_pipeline_destroy(device, pipeline);
}

TEST(depth_test_keeps_the_nearer_surface)
{
    gpu_graphics_pipeline_desc desc = triangle_desc;
    desc.depth_compare = VK_COMPARE_OP_LESS;
    desc.depth_write = true;
    const gpu_pipeline pipeline = gpu_graphics_pipeline_create(device, &desc);
    const target target = target_create();
    gpu_commands *commands = gpu_commands_begin(device);
    rendering_begin(commands, target);
    draw_half(commands, pipeline, (triangle_push){{1, 0, 0, 0}, 0.25f});
    draw_half(commands, pipeline, (triangle_push){{2, 0, 0, 0}, 0.75f});
    vkCmdEndRendering(gpu_commands_handle(commands));
    submit(commands);
    float texels[TARGET_SIZE][TARGET_SIZE][4], depths[TARGET_SIZE][TARGET_SIZE];
    CHECK(gpu_image_read(device, target.color, VK_IMAGE_LAYOUT_GENERAL, texels, sizeof texels));
    CHECK(gpu_image_read(device, target.depth, VK_IMAGE_LAYOUT_GENERAL, depths, sizeof depths));
    CHECK(texels[8][0][0] == 1);
    CHECK(depths[8][0] == 0.25f && depths[8][15] == 1);
    target_destroy(target);
    gpu_pipeline_destroy(device, pipeline);
}

TEST(faces_counter_clockwise_in_the_framebuffer_are_front)
{
    const VkCullModeFlags culls[] = {VK_CULL_MODE_BACK_BIT, VK_CULL_MODE_FRONT_BIT};
    for (int clockwise = 0; clockwise < 2; clockwise++) {
        gpu_graphics_pipeline_desc desc = triangle_desc;
        desc.cull_dynamic = true;
        desc.clockwise = clockwise;
        desc.blend = GPU_BLEND_ADD;
        const gpu_pipeline pipeline = gpu_graphics_pipeline_create(device, &desc);
        const target target = target_create();
        gpu_commands *commands = gpu_commands_begin(device);
        rendering_begin(commands, target);
        for (int i = 0; i < 2; i++) {
            gpu_cull_set(commands, culls[i]);
            draw_half(commands, pipeline, (triangle_push){{(float)(i + 1), 0, 0, 0}, 0});
        }
        vkCmdEndRendering(gpu_commands_handle(commands));
        submit(commands);
        float texels[TARGET_SIZE][TARGET_SIZE][4];
        CHECK(gpu_image_read(device, target.color, VK_IMAGE_LAYOUT_GENERAL, texels, sizeof texels));
        CHECK(texels[0][0][0] == (clockwise ? 2 : 1));
        target_destroy(target);
        gpu_pipeline_destroy(device, pipeline);
    }
}

TEST(indirect_draw_reads_its_counts_from_a_buffer)
{
    const VkDrawIndirectCommand command = {.vertexCount = 6, .instanceCount = 3};
    const gpu_buffer_desc desc = {
        .name = "draw", .size = sizeof command, .usage = VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT, .data = &command};
    const gpu_buffer arguments = gpu_buffer_create(device, &desc);
    gpu_graphics_pipeline_desc pipeline_desc = triangle_desc;
    pipeline_desc.blend = GPU_BLEND_ADD;
    const gpu_pipeline pipeline = gpu_graphics_pipeline_create(device, &pipeline_desc);
    const target target = target_create();
    gpu_commands *commands = gpu_commands_begin(device);
    rendering_begin(commands, target);
    gpu_bind(commands, pipeline, NULL, 0);
    const triangle_push push = {{1, 1, 1, 1}, 0};
    gpu_push(commands, &push, sizeof push);
    gpu_draw_indirect(commands, arguments, 0);
    vkCmdEndRendering(gpu_commands_handle(commands));
    submit(commands);
    float texels[TARGET_SIZE][TARGET_SIZE][4];
    CHECK(gpu_image_read(device, target.color, VK_IMAGE_LAYOUT_GENERAL, texels, sizeof texels));
    CHECK(texels[15][0][3] == 3);
    target_destroy(target);
    gpu_pipeline_destroy(device, pipeline);
    gpu_buffer_destroy(device, arguments);
}

// ---- Rays

typedef struct ray {
    float origin[3], direction[3];
} ray;
typedef struct hit {
    float t;
    uint32_t instance, primitive, candidates;
} hit;

static gpu_buffer input_buffer(const void *data, VkDeviceSize size)
{
    const gpu_buffer_desc desc = {
        .name = "build input",
        .size = size,
        .usage = VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |
                 VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT,
        .data = data,
    };
    return gpu_buffer_create(device, &desc);
}

// Two triangles over the same unit triangle: number 0 in the plane z = 0, number 1 at z = -1.
static gpu_acceleration layers_create(bool opaque)
{
    static const float positions[][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, -1}, {1, 0, -1}, {0, 1, -1}};
    static const uint32_t indices[] = {0, 1, 2, 3, 4, 5};
    const gpu_buffer position_buffer = input_buffer(positions, sizeof positions);
    const gpu_buffer index_buffer = input_buffer(indices, sizeof indices);
    const gpu_triangles triangles = {
        .positions = gpu_buffer_address(device, position_buffer),
        .position_stride = sizeof positions[0],
        .position_count = countof(positions),
        .indices = gpu_buffer_address(device, index_buffer),
        .triangle_count = 2,
        .opaque = opaque,
    };
    const gpu_acceleration blas = gpu_blas_create(device, &triangles, 1, false);
    gpu_buffer_destroy(device, index_buffer);
    gpu_buffer_destroy(device, position_buffer);
    return blas;
}

static void trace(gpu_commands *commands, gpu_acceleration tlas, gpu_buffer rays, gpu_buffer hits)
{
    const VkMemoryBarrier2 barrier = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
        .srcStageMask = VK_PIPELINE_STAGE_2_ACCELERATION_STRUCTURE_BUILD_BIT_KHR,
        .srcAccessMask = VK_ACCESS_2_ACCELERATION_STRUCTURE_WRITE_BIT_KHR,
        .dstStageMask = VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
        .dstAccessMask = VK_ACCESS_2_ACCELERATION_STRUCTURE_READ_BIT_KHR,
    };
    const VkDependencyInfo dependency = {
        .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
        .memoryBarrierCount = 1,
        .pMemoryBarriers = &barrier,
    };
    vkCmdPipelineBarrier2(gpu_commands_handle(commands), &dependency);
    const gpu_pipeline pipeline = compute(&shader_gpu_ray_comp);
    const gpu_binding bindings[] = {{.acceleration = tlas}, {.buffer = rays}, {.buffer = hits}};
    gpu_bind(commands, pipeline, bindings, 3);
    gpu_dispatch(commands, (uint32_t)(gpu_buffer_size(device, rays) / sizeof(ray)), 1, 1);
    gpu_pipeline_destroy(device, pipeline);
}

// Traces `count` rays through two instances of the layers: number 10 in place, 20 moved by x = 5 and scaled by 2.
static void trace_layers(bool opaque, const ray *rays, hit *hits, uint32_t count)
{
    const gpu_acceleration blas = layers_create(opaque);
    const gpu_acceleration tlas = gpu_tlas_create(device, 4);
    const VkDeviceAddress address = gpu_acceleration_address(device, blas);
    const VkAccelerationStructureInstanceKHR instances[] = {
        {
            .transform = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}},
            .instanceCustomIndex = 10,
            .mask = 0xff,
            .accelerationStructureReference = address,
        },
        {
            .transform = {{{2, 0, 0, 5}, {0, 2, 0, 0}, {0, 0, 2, 0}}},
            .instanceCustomIndex = 20,
            .mask = 0xff,
            .accelerationStructureReference = address,
        },
    };
    const gpu_buffer instance_buffer = input_buffer(instances, sizeof instances);
    const gpu_buffer ray_buffer = buffer_of(rays, count * sizeof *rays);
    const gpu_buffer hit_buffer = buffer_of(NULL, count * sizeof *hits);
    gpu_commands *commands = gpu_commands_begin(device);
    // The second build must wait for the first one.
    gpu_tlas_build(commands, tlas, instance_buffer, 1);
    gpu_tlas_build(commands, tlas, instance_buffer, 2);
    trace(commands, tlas, ray_buffer, hit_buffer);
    submit(commands);
    CHECK(gpu_buffer_read(device, hit_buffer, 0, hits, count * sizeof *hits));
    gpu_buffer_destroy(device, hit_buffer);
    gpu_buffer_destroy(device, ray_buffer);
    gpu_buffer_destroy(device, instance_buffer);
    gpu_acceleration_destroy(device, tlas);
    gpu_acceleration_destroy(device, blas);
}

static const ray test_rays[] = {
    {{0.25f, 0.25f, 3}, {0, 0, -1}}, // meets both layers of the first instance
    {{5.5f, 0.5f, 3}, {0, 0, -1}}, // and of the second
    {{0.9f, 0.9f, 3}, {0, 0, -1}}, // beside them
    {{0.25f, 0.25f, -4}, {0, 0, 1}}, // from behind
};

TEST(rays_meet_the_nearest_opaque_triangle_of_each_instance)
{
    hit hits[countof(test_rays)];
    trace_layers(true, test_rays, hits, countof(test_rays));
    CHECK_NEAR(hits[0].t, 3, 1e-5);
    CHECK(hits[0].instance == 10 && hits[0].primitive == 0);
    CHECK_NEAR(hits[1].t, 3, 1e-5);
    CHECK(hits[1].instance == 20 && hits[1].primitive == 0);
    CHECK(hits[2].t == -1);
    CHECK_NEAR(hits[3].t, 3, 1e-5);
    CHECK(hits[3].primitive == 1);
    for (size_t i = 0; i < countof(hits); i++)
        CHECK(hits[i].candidates == 0);
}

TEST(rays_pass_candidates_that_the_shader_does_not_confirm)
{
    hit hits[countof(test_rays)];
    trace_layers(false, test_rays, hits, countof(test_rays));
    CHECK_NEAR(hits[0].t, 4, 1e-5);
    CHECK(hits[0].instance == 10 && hits[0].primitive == 1 && hits[0].candidates >= 1);
    CHECK_NEAR(hits[1].t, 5, 1e-5);
    CHECK(hits[1].instance == 20 && hits[1].primitive == 1 && hits[1].candidates >= 1);
    CHECK(hits[2].t == -1);
}

// ---- Shaders at run time

// Writes `source` to a new folder, compiles it and returns whether that worked; the log is in `logged`.
static bool compile_text(const char *name, const char *source, gpu_shader *shader)
{
    char folder[] = "/tmp/lanternfield_test_XXXXXX", path[128];
    if (!mkdtemp(folder))
        return false;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    CHECK(file_write(path, source, strlen(source)));
    log_capture_begin();
    const bool done = shader_compile(path, shader);
    log_capture_end();
    unlink(path);
    rmdir(folder);
    return done;
}

TEST(compiled_shader_has_its_interface)
{
    CHECK_STRING(shader_gpu_scale_comp.name, "gpu_scale.comp");
    CHECK(shader_gpu_scale_comp.binding_mask == (1u << 0 | 1u << 3));
    CHECK(shader_gpu_scale_comp.binding_types[3] == VK_DESCRIPTOR_TYPE_STORAGE_BUFFER);
    CHECK(shader_gpu_scale_comp.push_size == 8);
    CHECK(shader_gpu_scale_comp.uses_scene);
    CHECK(shader_gpu_ray_comp.binding_types[0] == VK_DESCRIPTOR_TYPE_ACCELERATION_STRUCTURE_KHR);
    CHECK(shader_gpu_fetch_comp.binding_types[0] == VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER);
    CHECK(shader_gpu_store_comp.binding_types[0] == VK_DESCRIPTOR_TYPE_STORAGE_IMAGE);
    CHECK(!shader_gpu_store_comp.uses_scene);
}

TEST(shader_compiled_at_run_time_equals_the_built_one)
{
    gpu_shader shader;
    CHECK(shader_compile("tests/shaders/gpu_scale.comp.glsl", &shader));
    CHECK_STRING(shader.name, shader_gpu_scale_comp.name);
    CHECK(shader.word_count == shader_gpu_scale_comp.word_count);
    CHECK(memcmp(shader.words, shader_gpu_scale_comp.words, shader.word_count * sizeof *shader.words) == 0);
    shader_fini(&shader);
}

TEST(broken_shader_is_reported_with_file_and_line)
{
    gpu_shader shader;
    CHECK(
        !compile_text("broken.comp.glsl", "// Comment\n#version 460\nvoid main()\n{\n    nothing = 1;\n}\n", &shader));
    CHECK(strstr(logged, "/broken.comp.glsl:5: "));
    CHECK(strstr(logged, "nothing"));
    CHECK(!shader.words);
}

TEST(missing_include_is_reported_with_file_and_line)
{
    gpu_shader shader;
    CHECK(!compile_text("lost.comp.glsl", "#version 460\n\n#include \"lost.h\"\nvoid main() {}\n", &shader));
    CHECK(strstr(logged, "/lost.comp.glsl:3: ") && strstr(logged, "/lost.h"));
}

TEST(include_in_an_untaken_branch_may_be_missing)
{
    gpu_shader shader;
    const char *source = "#version 460\n#ifndef VULKAN\n#include \"host.h\"\n#endif\nvoid main() {}\n";
    CHECK(compile_text("branch.comp.glsl", source, &shader));
    CHECK_STRING(logged, "");
    shader_fini(&shader);
}

TEST(file_that_includes_itself_is_refused)
{
    gpu_shader shader;
    CHECK(!compile_text("self.comp.glsl", "#version 460\n#include \"self.comp.glsl\"\nvoid main() {}\n", &shader));
    CHECK(strstr(logged, "includes itself"));
}

TEST(shader_of_unknown_stage_is_refused)
{
    gpu_shader shader;
    CHECK(!compile_text("stage.glsl", "#version 460\nvoid main() {}\n", &shader));
    CHECK(strstr(logged, ".comp.glsl"));
}

TEST(validation_layer_had_nothing_to_say)
{
    CHECK(gpu_validation_messages(device) == 0);
}

int main(void)
{
    if (!gpu_devices_print(stdout)) {
        printf("skipped: this machine has no Vulkan device that the renderer can use\n");
        return 77;
    }
    const gpu_desc desc = {.validation = true};
    device = gpu_create(&desc);
    if (!device)
        return EXIT_FAILURE;
    RUN(unknown_device_name_is_refused_with_the_names_there_are);
    RUN(device_is_found_by_part_of_its_name_in_any_case);
    RUN(printed_devices_name_the_one_in_use);
    RUN(write_after_write_without_a_barrier_is_reported);
    RUN(device_buffer_keeps_what_was_written);
    RUN(empty_buffer_has_sixteen_bytes);
    RUN(host_buffer_shows_what_the_device_copied);
    RUN(two_buffers_share_one_memory);
    RUN(memory_is_counted_and_given_back);
    RUN(destroyed_buffer_lives_until_its_commands_have_finished);
    RUN(too_large_storage_buffer_is_refused_by_name);
    RUN(stale_handle_is_asserted_even_when_its_slot_is_used_again);
    RUN(destroying_null_handles_does_nothing);
    RUN(dispatch_reads_push_constants_bindings_and_the_scene);
    RUN(indirect_dispatch_runs_what_a_shader_wrote);
    RUN(specialization_constants_replace_the_defaults);
    RUN(atomic_minimum_works_on_64_bits);
    RUN(timestamps_increase);
    RUN(scene_textures_have_mips_wrap_and_filter);
    RUN(mips_of_srgb_textures_average_light_not_codes);
    RUN(image_reads_back_in_its_own_format);
    RUN(stored_image_is_sampled_nearest_and_clamped);
    RUN(additive_blending_sums_all_channels);
    RUN(depth_test_keeps_the_nearer_surface);
    RUN(faces_counter_clockwise_in_the_framebuffer_are_front);
    RUN(indirect_draw_reads_its_counts_from_a_buffer);
    RUN(rays_meet_the_nearest_opaque_triangle_of_each_instance);
    RUN(rays_pass_candidates_that_the_shader_does_not_confirm);
    RUN(compiled_shader_has_its_interface);
    RUN(shader_compiled_at_run_time_equals_the_built_one);
    RUN(broken_shader_is_reported_with_file_and_line);
    RUN(missing_include_is_reported_with_file_and_line);
    RUN(include_in_an_untaken_branch_may_be_missing);
    RUN(file_that_includes_itself_is_refused);
    RUN(shader_of_unknown_stage_is_refused);
    RUN(validation_layer_had_nothing_to_say);
    gpu_destroy(device);
    return test_end();
}
