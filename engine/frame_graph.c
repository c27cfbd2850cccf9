// The frame graph on the device: collects declarations, has them compiled, keeps the physical objects, and records the
// plan. See frame_graph.h.
#include "frame_graph.h"

#include <stdlib.h>
#include <string.h>

enum { NONE = FRAME_GRAPH_NONE };

struct frame_graph_pass {
    frame_graph *graph;
    frame_graph_pass_decl decl;
    frame_graph_use *uses;
    uint32_t use_capacity;
    void (*execute)(const frame_graph_context *context, void *user);
    void *user;
    const frame_graph_plan_pass *plan; // while the graph runs
};

// At most one member is set.
typedef struct object {
    gpu_buffer buffer;
    gpu_image image;
    gpu_acceleration acceleration;
} object;

// A transient's object in its slot. Transients that look alike and share a slot share the object too.
typedef struct transient {
    frame_graph_resource_desc desc;
    VkFlags usage;
    uint32_t slot;
    object object;
    bool used; // by this frame
} transient;

typedef struct slot_memory {
    frame_graph_slot slot;
    gpu_memory memory; // {0} for host slots, whose buffers have allocations of their own
} slot_memory;

typedef struct history {
    char *name;
    frame_graph_resource_desc desc;
    VkFlags usage;
    object objects[2];
    uint32_t newest; // the object that the last frame wrote
    bool written; // by the last frame, and no cut since
    frame_graph_state state;
    bool used; // by this frame
} history;

// What stands behind a resource of the plan in this frame.
typedef struct physical {
    object current, previous;
    bool previous_valid;
    frame_graph_state previous_state; // taken over by the first barrier
    bool previous_seen;
} physical;

struct frame_graph {
    gpu *gpu;
    bool culling_off;

    // ---- Of this frame: in `frame`, or cleared by begin.
    arena frame;
    frame_graph_pass **passes;
    size_t pass_count, pass_capacity;
    frame_graph_import_decl *imports;
    object *import_objects; // parallel
    size_t import_count, import_capacity, import_object_capacity;
    frame_graph_export_decl *exports;
    size_t export_count, export_capacity;
    frame_graph_input input;
    const frame_graph_plan *plan; // NULL before execute
    physical *physicals; // parallel to the plan's resources
    frame_graph_timing *timings;
    uint32_t timing_count;

    // ---- Kept over frames.
    slot_memory *slots;
    size_t slot_count, slot_capacity;
    transient *transients;
    size_t transient_count, transient_capacity;
    history *histories;
    size_t history_count, history_capacity;
};

// ---- Physical objects

static object object_create(gpu *gpu, const char *name, const frame_graph_resource_desc *desc, VkFlags usage,
                            gpu_memory memory)
{
    if (desc->kind == FRAME_GRAPH_IMAGE) {
        const gpu_image_desc image = {.name = name,
                                      .format = desc->format,
                                      .width = desc->width,
                                      .height = desc->height,
                                      .usage = usage,
                                      .memory = memory};
        return (object){.image = gpu_image_create(gpu, &image)};
    }
    assert(desc->kind == FRAME_GRAPH_BUFFER);
    const gpu_buffer_desc buffer = {
        .name = name, .size = desc->size, .usage = usage, .host = desc->host, .memory = memory};
    return (object){.buffer = gpu_buffer_create(gpu, &buffer)};
}

static void object_destroy(gpu *gpu, object object)
{
    gpu_buffer_destroy(gpu, object.buffer);
    gpu_image_destroy(gpu, object.image);
}

static bool object_exists(object object)
{
    return object.buffer.id || object.image.id || object.acceleration.id;
}

static VkMemoryRequirements measure(const frame_graph_resource_desc *desc, VkFlags usage, void *user)
{
    gpu *const gpu = user;
    if (desc->kind == FRAME_GRAPH_IMAGE) {
        const gpu_image_desc image = {
            .format = desc->format, .width = desc->width, .height = desc->height, .usage = usage};
        return gpu_image_requirements(gpu, &image);
    }
    const gpu_buffer_desc buffer = {.size = desc->size, .usage = usage, .host = desc->host};
    return gpu_buffer_requirements(gpu, &buffer);
}

static bool desc_equal(const frame_graph_resource_desc *a, const frame_graph_resource_desc *b)
{
    return a->kind == b->kind && a->size == b->size && a->host == b->host && a->format == b->format &&
           a->width == b->width && a->height == b->height;
}

static bool slot_equal(const frame_graph_slot *a, const frame_graph_slot *b)
{
    return a->kind == b->kind && a->host == b->host && a->requirements.size == b->requirements.size &&
           a->requirements.alignment == b->requirements.alignment &&
           a->requirements.memoryTypeBits == b->requirements.memoryTypeBits;
}

static void slot_clear(frame_graph *graph, uint32_t slot)
{
    for (size_t t = 0; t < graph->transient_count;) {
        if (graph->transients[t].slot == slot) {
            object_destroy(graph->gpu, graph->transients[t].object);
            graph->transients[t] = graph->transients[--graph->transient_count];
        } else {
            t++;
        }
    }
    gpu_memory_destroy(graph->gpu, graph->slots[slot].memory);
    graph->slots[slot] = (slot_memory){0};
}

// Gives every slot of the plan memory of exactly its size; the rest of the memory goes.
static bool slots_acquire(frame_graph *graph)
{
    const frame_graph_plan *const plan = graph->plan;
    for (; graph->slot_count > plan->slot_count; graph->slot_count--) {
        slot_clear(graph, (uint32_t)graph->slot_count - 1);
    }
    memory_reserve((void **)&graph->slots, &graph->slot_capacity, plan->slot_count, sizeof(*graph->slots));
    for (uint32_t s = 0; s < plan->slot_count; s++) {
        if (s < graph->slot_count && slot_equal(&graph->slots[s].slot, &plan->slots[s])) {
            continue;
        }
        if (s < graph->slot_count) {
            slot_clear(graph, s);
        } else {
            graph->slots[graph->slot_count++] = (slot_memory){0};
        }
        if (!plan->slots[s].host) {
            graph->slots[s].memory = gpu_memory_create(graph->gpu, &plan->slots[s].requirements);
            if (!graph->slots[s].memory.id) {
                return false; // its slot stays all zero, which equals no slot of a plan
            }
        }
        graph->slots[s].slot = plan->slots[s];
    }
    return true;
}

static object transient_acquire(frame_graph *graph, const frame_graph_plan_resource *resource)
{
    for (size_t t = 0; t < graph->transient_count; t++) {
        transient *const transient = &graph->transients[t];
        if (transient->slot == resource->slot && transient->usage == resource->usage &&
            desc_equal(&transient->desc, &resource->desc)) {
            transient->used = true;
            return transient->object;
        }
    }
    const object created = object_create(graph->gpu, resource->name, &resource->desc, resource->usage,
                                         graph->slots[resource->slot].memory);
    if (object_exists(created)) {
        memory_reserve((void **)&graph->transients, &graph->transient_capacity, graph->transient_count + 1,
                       sizeof(*graph->transients));
        graph->transients[graph->transient_count++] = (transient){
            .desc = resource->desc, .usage = resource->usage, .slot = resource->slot, .object = created, .used = true};
    }
    return created;
}

static history *history_find(frame_graph *graph, const char *name)
{
    for (size_t h = 0; h < graph->history_count; h++) {
        if (strcmp(graph->histories[h].name, name) == 0) {
            return &graph->histories[h];
        }
    }
    memory_reserve((void **)&graph->histories, &graph->history_capacity, graph->history_count + 1,
                   sizeof(*graph->histories));
    history *const added = &graph->histories[graph->history_count++];
    *added = (history){.name = strdup(name)};
    return added;
}

static bool history_acquire(frame_graph *graph, const frame_graph_plan_resource *resource, physical *physical)
{
    // All objects can be copied, so that an export more or less costs no history; of images and buffers alike.
    const VkFlags transfers = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    history *const history = history_find(graph, resource->name);
    const bool fits = object_exists(history->objects[0]) && object_exists(history->objects[1]) &&
                      desc_equal(&history->desc, &resource->desc) && !(resource->usage & ~(history->usage | transfers));
    if (!fits) {
        history->written = false;
        history->desc = resource->desc;
        history->usage = resource->usage;
        for (uint32_t i = 0; i < countof(history->objects); i++) {
            object_destroy(graph->gpu, history->objects[i]);
            history->objects[i] =
                object_create(graph->gpu, resource->name, &resource->desc, resource->usage, (gpu_memory){0});
        }
    }
    history->used = true;
    physical->current = history->objects[1 - history->newest];
    physical->previous = history->objects[history->newest];
    physical->previous_valid = history->written;
    physical->previous_state = history->written ? history->state : (frame_graph_state){0};
    return object_exists(history->objects[0]) && object_exists(history->objects[1]);
}

static bool resources_acquire(frame_graph *graph)
{
    const frame_graph_plan *const plan = graph->plan;
    graph->physicals = arena_alloc(&graph->frame, plan->resource_count * sizeof(*graph->physicals));
    if (!slots_acquire(graph)) {
        return false;
    }
    for (uint32_t r = 0; r < plan->resource_count; r++) {
        const frame_graph_plan_resource *const resource = &plan->resources[r];
        physical *const physical = &graph->physicals[r];
        if (resource->import != NONE) {
            physical->current = graph->import_objects[resource->import];
        } else if (!resource->history) {
            physical->current = transient_acquire(graph, resource);
        } else if (!history_acquire(graph, resource, physical)) {
            return false;
        }
        if (!object_exists(physical->current)) {
            return false;
        }
    }
    return true;
}

static void histories_finish(frame_graph *graph)
{
    for (uint32_t r = 0; r < graph->plan->resource_count; r++) {
        const frame_graph_plan_resource *const resource = &graph->plan->resources[r];
        if (resource->history) {
            history *const history = history_find(graph, resource->name);
            history->newest = 1 - history->newest;
            history->written = true;
            history->state = resource->final;
        }
    }
}

static void history_destroy(frame_graph *graph, const history *history)
{
    object_destroy(graph->gpu, history->objects[0]);
    object_destroy(graph->gpu, history->objects[1]);
    free(history->name);
}

// Frees what this frame did not use.
static void unused_evict(frame_graph *graph)
{
    for (size_t t = 0; t < graph->transient_count;) {
        transient *const transient = &graph->transients[t];
        if (transient->used) {
            transient->used = false;
            t++;
        } else {
            object_destroy(graph->gpu, transient->object);
            *transient = graph->transients[--graph->transient_count];
        }
    }
    for (size_t h = 0; h < graph->history_count;) {
        history *const history = &graph->histories[h];
        if (history->used) {
            history->used = false;
            h++;
        } else {
            history_destroy(graph, history);
            *history = graph->histories[--graph->history_count];
        }
    }
}

// ---- Life

frame_graph *frame_graph_create(gpu *gpu)
{
    frame_graph *const graph = memory_alloc(sizeof(*graph));
    graph->gpu = gpu;
    return graph;
}

void frame_graph_destroy(frame_graph *graph)
{
    if (!graph) {
        return;
    }
    for (size_t s = 0; s < graph->slot_count; s++) {
        slot_clear(graph, (uint32_t)s);
    }
    for (size_t h = 0; h < graph->history_count; h++) {
        history_destroy(graph, &graph->histories[h]);
    }
    free(graph->slots);
    free(graph->transients);
    free(graph->histories);
    free(graph->passes);
    free(graph->imports);
    free(graph->import_objects);
    free(graph->exports);
    arena_fini(&graph->frame);
    free(graph);
}

// ---- Declare

void frame_graph_begin(frame_graph *graph)
{
    arena_reset(&graph->frame);
    graph->pass_count = graph->import_count = graph->export_count = 0;
    graph->plan = NULL;
    graph->physicals = NULL;
    graph->timings = NULL;
    graph->timing_count = 0;
}

static void import_add(frame_graph *graph, const char *name, frame_graph_resource_desc desc, object object,
                       frame_graph_access before, frame_graph_access after)
{
    const size_t count = graph->import_count + 1;
    memory_reserve((void **)&graph->imports, &graph->import_capacity, count, sizeof(*graph->imports));
    memory_reserve((void **)&graph->import_objects, &graph->import_object_capacity, count,
                   sizeof(*graph->import_objects));
    graph->imports[graph->import_count] = (frame_graph_import_decl){
        .name = arena_strdup(&graph->frame, name), .desc = desc, .before = before, .after = after};
    graph->import_objects[graph->import_count++] = object;
}

void frame_graph_import_buffer(frame_graph *graph, const char *name, gpu_buffer buffer, frame_graph_access before,
                               frame_graph_access after)
{
    import_add(graph, name, frame_graph_buffer_of(gpu_buffer_size(graph->gpu, buffer)), (object){.buffer = buffer},
               before, after);
}

void frame_graph_import_image(frame_graph *graph, const char *name, gpu_image image, frame_graph_access before,
                              frame_graph_access after)
{
    const gpu_image_desc *const info = gpu_image_info(graph->gpu, image);
    import_add(graph, name, frame_graph_image_of(info->format, info->width, info->height), (object){.image = image},
               before, after);
}

void frame_graph_import_acceleration(frame_graph *graph, const char *name, gpu_acceleration acceleration,
                                     frame_graph_access before, frame_graph_access after)
{
    import_add(graph, name, (frame_graph_resource_desc){.kind = FRAME_GRAPH_ACCELERATION},
               (object){.acceleration = acceleration}, before, after);
}

frame_graph_pass *frame_graph_pass_add(frame_graph *graph, const frame_graph_pass_desc *desc)
{
    assert(desc->name && desc->execute);
    frame_graph_pass *const pass = arena_alloc(&graph->frame, sizeof(*pass));
    *pass = (frame_graph_pass){
        .graph = graph,
        .decl = {.name = arena_strdup(&graph->frame, desc->name), .kind = desc->kind, .keep = desc->keep},
        .execute = desc->execute,
        .user = desc->user,
    };
    if (desc->user_size) {
        pass->user = memcpy(arena_alloc(&graph->frame, desc->user_size), desc->user, desc->user_size);
    }
    memory_reserve((void **)&graph->passes, &graph->pass_capacity, graph->pass_count + 1, sizeof(*graph->passes));
    return graph->passes[graph->pass_count++] = pass;
}

static void use_add(frame_graph_pass *pass, const frame_graph_use *use)
{
    arena *const frame = &pass->graph->frame;
    assert(!pass->graph->plan && "passes are declared before execute");
    if (pass->decl.use_count == pass->use_capacity) {
        pass->use_capacity = max_u32(8, 2 * pass->use_capacity);
        frame_graph_use *const grown = arena_alloc(frame, pass->use_capacity * sizeof(*grown));
        if (pass->decl.use_count) {
            memcpy(grown, pass->uses, pass->decl.use_count * sizeof(*grown));
        }
        pass->decl.uses = pass->uses = grown;
    }
    frame_graph_use *const added = &pass->uses[pass->decl.use_count++];
    *added = *use;
    added->name = use->name ? arena_strdup(frame, use->name) : NULL;
    added->makes = use->makes ? arena_strdup(frame, use->makes) : NULL;
}

void frame_graph_create_resource(frame_graph_pass *pass, const char *name, const frame_graph_resource_desc *desc,
                                 frame_graph_access access)
{
    use_add(pass, &(frame_graph_use){.kind = FRAME_GRAPH_USE_CREATE, .access = access, .makes = name, .desc = *desc});
}

void frame_graph_create_cleared(frame_graph_pass *pass, const char *name, const frame_graph_resource_desc *desc,
                                frame_graph_access access, VkClearValue value)
{
    const frame_graph_use use = {.kind = FRAME_GRAPH_USE_CREATE,
                                 .access = access,
                                 .makes = name,
                                 .desc = *desc,
                                 .clear = true,
                                 .clear_value = value};
    use_add(pass, &use);
}

void frame_graph_read(frame_graph_pass *pass, const char *name, frame_graph_access access)
{
    use_add(pass, &(frame_graph_use){.kind = FRAME_GRAPH_USE_READ, .access = access, .name = name});
}

void frame_graph_modify(frame_graph_pass *pass, const char *from, const char *to, frame_graph_access access)
{
    use_add(pass, &(frame_graph_use){.kind = FRAME_GRAPH_USE_MODIFY, .access = access, .name = from, .makes = to});
}

void frame_graph_read_previous(frame_graph_pass *pass, const char *name, frame_graph_access access)
{
    use_add(pass, &(frame_graph_use){.kind = FRAME_GRAPH_USE_PREVIOUS, .access = access, .name = name});
}

void frame_graph_export(frame_graph *graph, const char *name, frame_graph_access after)
{
    memory_reserve((void **)&graph->exports, &graph->export_capacity, graph->export_count + 1, sizeof(*graph->exports));
    graph->exports[graph->export_count++] =
        (frame_graph_export_decl){.name = arena_strdup(&graph->frame, name), .after = after};
}

void frame_graph_cull_set(frame_graph *graph, bool enabled)
{
    graph->culling_off = !enabled;
}

bool frame_graph_has_history(const frame_graph *graph, const char *name)
{
    for (size_t h = 0; h < graph->history_count; h++) {
        if (strcmp(graph->histories[h].name, name) == 0) {
            return graph->histories[h].written;
        }
    }
    return false;
}

void frame_graph_history_drop(frame_graph *graph)
{
    for (size_t h = 0; h < graph->history_count; h++) {
        graph->histories[h].written = false;
    }
}

// ---- Record

// The command stream of one execute. Host passes cut it.
typedef struct recording {
    frame_graph *graph;
    gpu_commands *commands; // NULL: nothing to submit
    uint32_t timestamp_count;
    uint32_t *timestamps; // of each pass of the plan: the slot at its end, or NONE; it starts at the slot before
} recording;

// From end to end, so that the passes' times add up to the frame's: lavapipe writes a timestamp at a pass's start late.
static uint32_t timestamp_write(recording *recording, gpu_commands *commands)
{
    if (recording->timestamp_count == GPU_TIMESTAMPS_MAX) {
        return NONE;
    }
    gpu_timestamp(commands, recording->timestamp_count);
    return recording->timestamp_count++;
}

static gpu_commands *commands_get(recording *recording)
{
    if (!recording->commands) {
        recording->commands = gpu_commands_begin(recording->graph->gpu);
        timestamp_write(recording, recording->commands);
    }
    return recording->commands;
}

static bool commands_submit(recording *recording)
{
    gpu_commands *const commands = recording->commands;
    recording->commands = NULL;
    return !commands || gpu_commands_submit_and_wait(recording->graph->gpu, commands);
}

static VkMemoryBarrier2 memory_barrier_of(const frame_graph_barrier *barrier)
{
    return (VkMemoryBarrier2){
        .sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
        .srcStageMask = barrier->source_stages,
        .srcAccessMask = barrier->source_mask,
        .dstStageMask = barrier->destination_stages,
        .dstAccessMask = barrier->destination_mask,
    };
}

static VkImageMemoryBarrier2 image_barrier_of(const frame_graph *graph, const frame_graph_barrier *barrier)
{
    const physical *const physical = &graph->physicals[barrier->resource];
    return (VkImageMemoryBarrier2){
        .sType = VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2,
        .srcStageMask = barrier->source_stages,
        .srcAccessMask = barrier->source_mask,
        .dstStageMask = barrier->destination_stages,
        .dstAccessMask = barrier->destination_mask,
        .oldLayout = barrier->old_layout,
        .newLayout = barrier->new_layout,
        .srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
        .dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED,
        .image = gpu_image_handle(graph->gpu, barrier->previous ? physical->previous.image : physical->current.image),
        .subresourceRange = {gpu_format_aspect(graph->plan->resources[barrier->resource].desc.format), 0,
                             VK_REMAINING_MIP_LEVELS, 0, 1},
    };
}

// The plan takes last frame's plan for its own; this puts in what really was.
static frame_graph_barrier barrier_resolve(frame_graph *graph, const frame_graph_barrier *barrier)
{
    frame_graph_barrier resolved = *barrier;
    physical *const physical = &graph->physicals[barrier->resource];
    if (barrier->previous && !physical->previous_seen) {
        physical->previous_seen = true;
        resolved.source_stages = physical->previous_state.stages;
        resolved.source_mask = physical->previous_state.mask;
        resolved.old_layout = physical->previous_state.layout;
    }
    return resolved;
}

static void barriers_record(recording *recording, const frame_graph_barrier *barriers, uint32_t count)
{
    frame_graph *const graph = recording->graph;
    VkMemoryBarrier2 *const memories = arena_alloc(&graph->frame, count * sizeof(*memories));
    VkImageMemoryBarrier2 *const images = arena_alloc(&graph->frame, count * sizeof(*images));
    uint32_t memory_count = 0, image_count = 0;
    for (uint32_t b = 0; b < count; b++) {
        const frame_graph_barrier barrier = barrier_resolve(graph, &barriers[b]);
        const bool image = graph->plan->resources[barrier.resource].desc.kind == FRAME_GRAPH_IMAGE;
        if (image) {
            images[image_count++] = image_barrier_of(graph, &barrier);
        }
        // What the slot's last user wrote, it wrote through another image: only a barrier on all memory covers that.
        // Buffers have no layout, so that one on all memory serves them as well as one of their own.
        if (!image || (barrier.old_layout == VK_IMAGE_LAYOUT_UNDEFINED && barrier.source_mask)) {
            memories[memory_count++] = memory_barrier_of(&barrier);
        }
    }
    const VkDependencyInfo dependency = {
        .sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
        .memoryBarrierCount = memory_count,
        .pMemoryBarriers = memories,
        .imageMemoryBarrierCount = image_count,
        .pImageMemoryBarriers = images,
    };
    if (count) {
        vkCmdPipelineBarrier2(gpu_commands_handle(commands_get(recording)), &dependency);
    }
}

static VkRenderingAttachmentInfo attachment_of(const frame_graph *graph, const frame_graph_use *use,
                                               const frame_graph_plan_use *plan_use)
{
    return (VkRenderingAttachmentInfo){
        .sType = VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO,
        .imageView = gpu_image_view(graph->gpu, graph->physicals[plan_use->resource].current.image),
        .imageLayout = frame_graph_access_describe(use->access)->layout,
        .loadOp = plan_use->load,
        .storeOp = plan_use->store,
        .clearValue = use->clear_value,
    };
}

static bool access_is_depth(frame_graph_access access)
{
    return access == ACCESS_DEPTH_ATTACHMENT || access == ACCESS_DEPTH_TEST || access == ACCESS_DEPTH_TEST_SAMPLED;
}

// Begins rendering to the pass's attachments, in order of declaration, and tells their size.
static void rendering_begin(const frame_graph *graph, gpu_commands *commands, const frame_graph_pass *pass,
                            frame_graph_context *context)
{
    VkRenderingAttachmentInfo colors[8], depth;
    VkRenderingInfo rendering = {
        .sType = VK_STRUCTURE_TYPE_RENDERING_INFO, .layerCount = 1, .pColorAttachments = colors};
    for (uint32_t u = 0; u < pass->decl.use_count; u++) {
        const frame_graph_use *const use = &pass->decl.uses[u];
        const frame_graph_plan_use *const plan_use = &pass->plan->uses[u];
        const bool color = use->access == ACCESS_COLOR_ATTACHMENT;
        if (plan_use->resource == NONE || (!color && !access_is_depth(use->access))) {
            continue;
        }
        if (color) {
            colors[rendering.colorAttachmentCount++] = attachment_of(graph, use, plan_use);
        } else {
            depth = attachment_of(graph, use, plan_use);
            rendering.pDepthAttachment = &depth;
        }
        context->width = graph->plan->resources[plan_use->resource].desc.width;
        context->height = graph->plan->resources[plan_use->resource].desc.height;
    }
    rendering.renderArea.extent = (VkExtent2D){context->width, context->height};
    vkCmdBeginRendering(gpu_commands_handle(commands), &rendering);
    gpu_viewport_set(commands, 0, 0, (float)context->width, (float)context->height);
}

static void device_pass_record(recording *recording, uint32_t position, frame_graph_context *context)
{
    const frame_graph_pass *const pass = context->pass;
    gpu_commands *const commands = context->commands = commands_get(recording);
    const bool graphics = pass->decl.kind == FRAME_GRAPH_GRAPHICS;
    if (graphics) {
        rendering_begin(recording->graph, commands, pass, context);
    }
    pass->execute(context, pass->user);
    if (graphics) {
        vkCmdEndRendering(gpu_commands_handle(commands));
    }
    recording->timestamps[position] = timestamp_write(recording, commands);
}

// The host may touch what earlier passes made only once these have run.
static bool host_pass_run(recording *recording, uint32_t position, const frame_graph_context *context)
{
    if (!commands_submit(recording)) {
        return false;
    }
    const double start = time_now();
    context->pass->execute(context, context->pass->user);
    recording->graph->timings[position].milliseconds = (time_now() - start) * 1e3;
    return true;
}

static bool pass_run(recording *recording, uint32_t position)
{
    frame_graph *const graph = recording->graph;
    const frame_graph_plan_pass *const plan = &graph->plan->order[position];
    frame_graph_pass *const pass = graph->passes[plan->pass];
    pass->plan = plan;
    graph->timings[position].name = pass->decl.name;
    recording->timestamps[position] = NONE;
    frame_graph_context context = {.gpu = graph->gpu, .graph = graph, .pass = pass};
    if (pass->decl.kind == FRAME_GRAPH_HOST) {
        barriers_record(recording, plan->barriers, plan->barrier_count);
        return host_pass_run(recording, position, &context);
    }
    gpu_label_begin(commands_get(recording), pass->decl.name);
    barriers_record(recording, plan->barriers, plan->barrier_count);
    device_pass_record(recording, position, &context);
    gpu_label_end(commands_get(recording));
    return true;
}

static void timings_read(recording *recording)
{
    frame_graph *const graph = recording->graph;
    double *const times = arena_alloc(&graph->frame, recording->timestamp_count * sizeof(*times));
    if (!recording->timestamp_count || !gpu_timestamps_read(graph->gpu, times, recording->timestamp_count)) {
        return;
    }
    for (uint32_t i = 0; i < graph->timing_count; i++) {
        const uint32_t slot = recording->timestamps[i];
        if (slot != NONE) {
            graph->timings[i].milliseconds = times[slot] - times[slot - 1];
        }
    }
}

static bool plan_run(frame_graph *graph)
{
    const uint32_t count = graph->plan->order_count;
    recording recording = {.graph = graph,
                           .timestamps = arena_alloc(&graph->frame, count * sizeof(*recording.timestamps))};
    graph->timings = arena_alloc(&graph->frame, count * sizeof(*graph->timings));
    graph->timing_count = count;
    for (uint32_t i = 0; i < count; i++) {
        if (!pass_run(&recording, i)) {
            return false;
        }
    }
    barriers_record(&recording, graph->plan->final_barriers, graph->plan->final_barrier_count);
    if (!commands_submit(&recording)) {
        return false;
    }
    timings_read(&recording);
    return true;
}

static void input_fill(frame_graph *graph)
{
    frame_graph_pass_decl *const passes = arena_alloc(&graph->frame, graph->pass_count * sizeof(*passes));
    for (size_t p = 0; p < graph->pass_count; p++) {
        passes[p] = graph->passes[p]->decl;
    }
    graph->input = (frame_graph_input){
        .passes = passes,
        .pass_count = (uint32_t)graph->pass_count,
        .imports = graph->imports,
        .import_count = (uint32_t)graph->import_count,
        .exports = graph->exports,
        .export_count = (uint32_t)graph->export_count,
        .keep_all = graph->culling_off,
        .measure = measure,
        .measure_user = graph->gpu,
    };
}

bool frame_graph_execute(frame_graph *graph)
{
    assert(!graph->plan && "one execute a begin");
    char error[512];
    input_fill(graph);
    graph->plan = frame_graph_plan_compile(&graph->input, &graph->frame, error);
    if (!graph->plan) {
        log_error("frame graph: %s", error);
        return false;
    }
    if (!resources_acquire(graph) || !plan_run(graph)) {
        graph->physicals = NULL; // there is nothing to find
        return false;
    }
    histories_finish(graph);
    unused_evict(graph);
    return true;
}

// ---- Within execute callbacks

enum { USES_NOW = 1, USES_PREVIOUS = 2 };

// The use that `name` stands for; what the pass makes or reads now comes before what it reads of the last frame.
static const frame_graph_plan_use *use_find(const frame_graph_context *context, const char *name, uint32_t which)
{
    const frame_graph_pass_decl *const decl = &context->pass->decl;
    const frame_graph_plan_use *of_last_frame = NULL;
    for (uint32_t u = 0; u < decl->use_count; u++) {
        const frame_graph_use *const use = &decl->uses[u];
        const bool named =
            (use->makes && strcmp(use->makes, name) == 0) || (use->name && frame_graph_names(use->name, name));
        if (named && use->kind != FRAME_GRAPH_USE_PREVIOUS && (which & USES_NOW)) {
            return &context->pass->plan->uses[u];
        }
        if (named && use->kind == FRAME_GRAPH_USE_PREVIOUS && (which & USES_PREVIOUS) && !of_last_frame) {
            of_last_frame = &context->pass->plan->uses[u];
        }
    }
    if (!of_last_frame) {
        log_error("frame graph: pass \"%s\" does not declare \"%s\"", decl->name, name);
    }
    assert(of_last_frame && "a pass gets only what it declares");
    return of_last_frame;
}

static object use_object(const frame_graph *graph, const frame_graph_plan_use *use)
{
    if (use->resource == NONE) {
        return (object){0};
    }
    const physical *const physical = &graph->physicals[use->resource];
    return use->previous ? physical->previous : physical->current;
}

void frame_graph_bind(const frame_graph_context *context, gpu_pipeline pipeline)
{
    const frame_graph_pass *const pass = context->pass;
    gpu_binding bindings[GPU_BINDINGS_MAX] = {0};
    uint32_t count = 0;
    for (uint32_t u = 0; u < pass->decl.use_count; u++) {
        const frame_graph_access_info *const info = frame_graph_access_describe(pass->decl.uses[u].access);
        if (!info->binding) {
            continue;
        }
        assert(count < GPU_BINDINGS_MAX);
        const object object = use_object(context->graph, &pass->plan->uses[u]);
        bindings[count++] = (gpu_binding){.buffer = object.buffer,
                                          .image = object.image,
                                          .layout = info->layout,
                                          .acceleration = object.acceleration};
    }
    gpu_bind(context->commands, pipeline, bindings, count);
}

gpu_buffer frame_graph_buffer(const frame_graph_context *context, const char *name)
{
    return use_object(context->graph, use_find(context, name, USES_NOW | USES_PREVIOUS)).buffer;
}

gpu_image frame_graph_image(const frame_graph_context *context, const char *name)
{
    return use_object(context->graph, use_find(context, name, USES_NOW | USES_PREVIOUS)).image;
}

bool frame_graph_history_valid(const frame_graph_context *context, const char *name)
{
    const frame_graph_plan_use *const use = use_find(context, name, USES_PREVIOUS);
    return use->resource != NONE && context->graph->physicals[use->resource].previous_valid;
}

bool frame_graph_present(const frame_graph_context *context, const char *name)
{
    return use_find(context, name, USES_NOW | USES_PREVIOUS)->resource != NONE;
}

// ---- After execute

static object export_find(const frame_graph *graph, const char *name)
{
    const uint32_t resource =
        graph->physicals ? frame_graph_plan_find(graph->plan, &graph->input, name) : FRAME_GRAPH_NONE;
    return resource != NONE && graph->plan->resources[resource].exported ? graph->physicals[resource].current
                                                                         : (object){0};
}

gpu_buffer frame_graph_find_buffer(frame_graph *graph, const char *name)
{
    return export_find(graph, name).buffer;
}

gpu_image frame_graph_find_image(frame_graph *graph, const char *name)
{
    return export_find(graph, name).image;
}

const frame_graph_timing *frame_graph_timings(const frame_graph *graph, uint32_t *count)
{
    *count = graph->timing_count;
    return graph->timings;
}

static char *dump(const frame_graph *graph,
                  char *(*print)(const frame_graph_plan *, const frame_graph_input *, arena *))
{
    if (!graph->plan) {
        return NULL;
    }
    arena scratch = {0};
    char *const text = strdup(print(graph->plan, &graph->input, &scratch));
    arena_fini(&scratch);
    return text;
}

char *frame_graph_dump_text(const frame_graph *graph)
{
    return dump(graph, frame_graph_plan_text);
}

char *frame_graph_dump_dot(const frame_graph *graph)
{
    return dump(graph, frame_graph_plan_dot);
}
