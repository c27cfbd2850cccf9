// The pure half of the frame graph: from what passes declare to a plan of plain data (order, culled passes, lifetimes,
// memory slots, barriers). Touches no GPU object, so that tests read the plan without a device.
//
// Names are versions. A resource is created under one name; a modification consumes one name and makes a new one (in
// the same memory), so every name has exactly one maker, and the order of passes follows from the names alone, never
// from the order of registration. All readers of a name run before the pass that modifies it.
#pragma once

#include "base.h"

#include <vulkan/vulkan.h>

// How a pass touches a resource. The table in frame_graph_access.c gives each its stages, access mask, layout, usage
// flags and whether it writes; shader stages follow from the kind of the pass.
typedef enum frame_graph_access {
    ACCESS_NONE, // imports only: contents undefined (before) or of no further interest (after)
    ACCESS_COLOR_ATTACHMENT,
    ACCESS_DEPTH_ATTACHMENT,
    ACCESS_DEPTH_TEST, // depth attachment that is only tested
    ACCESS_DEPTH_TEST_SAMPLED, // tested, and sampled by the shaders of the same pass
    ACCESS_SAMPLED,
    ACCESS_STORAGE_READ,
    ACCESS_STORAGE_WRITE, // every byte that is read later is written here: earlier contents are not needed
    ACCESS_STORAGE_READ_WRITE, // also cleared by the pass itself, with gpu_buffer_fill, before its shaders count in it
    ACCESS_UNIFORM,
    ACCESS_INDIRECT,
    ACCESS_TRANSFER_READ,
    ACCESS_TRANSFER_WRITE,
    ACCESS_BUILD_INPUT, // instances for an acceleration structure build
    ACCESS_BUILD_WRITE, // the structure that is built
    ACCESS_TRACE, // the structure that is traced
    ACCESS_HOST_READ,
    ACCESS_HOST_WRITE,
    ACCESS_COUNT
} frame_graph_access;

typedef struct frame_graph_access_info {
    const char *name;
    VkPipelineStageFlags2 stages;
    bool shader; // and the shader stages of the pass's kind
    VkAccessFlags2 mask;
    VkImageLayout layout;
    VkFlags image_usage, buffer_usage;
    bool write;
    bool binding; // takes the next binding of set 0
    bool attachment;
    uint32_t resource_kinds, pass_kinds; // that may be used so, by such passes: bit per enumerator
} frame_graph_access_info;
const frame_graph_access_info *frame_graph_access_describe(frame_graph_access access);

typedef enum frame_graph_pass_kind {
    FRAME_GRAPH_GRAPHICS,
    FRAME_GRAPH_COMPUTE,
    FRAME_GRAPH_TRANSFER,
    FRAME_GRAPH_RAY_TRACING, // ray-tracing pipelines; ray queries are made by COMPUTE and GRAPHICS passes
    FRAME_GRAPH_HOST, // a CPU callback between two submits
} frame_graph_pass_kind;

typedef enum frame_graph_resource_kind {
    FRAME_GRAPH_BUFFER,
    FRAME_GRAPH_IMAGE,
    FRAME_GRAPH_ACCELERATION
} frame_graph_resource_kind;

typedef struct frame_graph_resource_desc {
    frame_graph_resource_kind kind;
    uint64_t size; // buffer: bytes
    bool host; // buffer: in host-visible memory
    VkFormat format; // image
    uint32_t width, height; // image
} frame_graph_resource_desc;

// One line of a pass's declaration. A pass may use one resource in several ways, what it makes itself included (its own
// steps, with gpu_memory_barrier between them): the graph waits for all of them before the pass and for all of them
// after. An image must be in one layout throughout a pass.
typedef enum frame_graph_use_kind {
    FRAME_GRAPH_USE_CREATE,
    FRAME_GRAPH_USE_READ,
    FRAME_GRAPH_USE_MODIFY,
    FRAME_GRAPH_USE_PREVIOUS, // the contents that this name had at the end of the last frame
} frame_graph_use_kind;
typedef struct frame_graph_use {
    frame_graph_use_kind kind;
    frame_graph_access access;
    // READ, MODIFY and PREVIOUS: the name, or alternatives separated by '|': the first that has a maker is meant
    // ("filtered|raw"). An alternative "-" at the end makes the use optional: nothing is bound when no other exists.
    const char *name;
    const char *makes; // CREATE and MODIFY: the name made
    frame_graph_resource_desc desc; // CREATE
    bool clear; // attachments made by CREATE: they start as `clear_value`; false: undefined
    VkClearValue clear_value;
} frame_graph_use;

typedef struct frame_graph_pass_decl {
    const char *name;
    frame_graph_pass_kind kind;
    bool keep; // never culled: has an effect outside the graph
    const frame_graph_use *uses;
    uint32_t use_count;
} frame_graph_pass_decl;

// A pass that modifies an imported buffer or image is never culled; one that builds an imported acceleration structure
// is culled when nobody traces it.
typedef struct frame_graph_import_decl {
    const char *name;
    frame_graph_resource_desc desc;
    frame_graph_access before; // how it was last used; the import's memory is synchronised against it
    frame_graph_access after; // the state to leave it in; ACCESS_NONE: as the last pass left it
} frame_graph_import_decl;

typedef struct frame_graph_export_decl {
    const char *name; // alternatives with '|' as in uses
    frame_graph_access after;
} frame_graph_export_decl;

typedef struct frame_graph_input {
    const frame_graph_pass_decl *passes;
    uint32_t pass_count;
    const frame_graph_import_decl *imports;
    uint32_t import_count;
    const frame_graph_export_decl *exports; // kept alive, and kept out of aliasing from their last use on
    uint32_t export_count;
    bool keep_all; // turns culling off
    // Size, alignment and compatible memory types of a transient with these usage flags; tests give a fake.
    VkMemoryRequirements (*measure)(const frame_graph_resource_desc *desc, VkFlags usage, void *user);
    void *measure_user;
} frame_graph_input;

enum { FRAME_GRAPH_NONE = UINT32_MAX };

// What must be waited for before the next access.
typedef struct frame_graph_state {
    VkPipelineStageFlags2 stages; // that wrote or read last
    VkAccessFlags2 mask; // what was written
    VkImageLayout layout;
} frame_graph_state;

// A physical resource of the plan: one memory range with one chain of versions.
typedef struct frame_graph_plan_resource {
    const char *name; // of its first version
    frame_graph_resource_desc desc;
    VkFlags usage;
    uint32_t import; // index, or FRAME_GRAPH_NONE
    bool history; // last frame's contents are read: two objects that alternate, outside the slots
    bool exported;
    uint32_t slot; // transient: index of its memory slot; FRAME_GRAPH_NONE otherwise
    // Lifetime: indices into `order`, inclusive; exports last to the end; unused: FRAME_GRAPH_NONE.
    uint32_t first, last;
    frame_graph_state final; // at the end of the frame, after the final barriers
} frame_graph_plan_resource;

typedef struct frame_graph_slot {
    VkMemoryRequirements requirements; // the largest of its users
    frame_graph_resource_kind kind; // buffers and images never share a slot
    bool host;
} frame_graph_slot;

typedef struct frame_graph_barrier {
    uint32_t resource;
    // Of the resource's other object, last frame's contents. The source of the first one is the resource's `final`
    // state, as if the last frame had had this plan; whoever executes puts in the state that it recorded, or UNDEFINED.
    bool previous;
    VkPipelineStageFlags2 source_stages, destination_stages;
    VkAccessFlags2 source_mask, destination_mask;
    VkImageLayout old_layout, new_layout; // images
} frame_graph_barrier;

// What each use of a pass came to.
typedef struct frame_graph_plan_use {
    uint32_t resource; // FRAME_GRAPH_NONE: optional and absent
    const char *name; // READ, MODIFY and PREVIOUS: the alternative that was meant; NULL: absent
    bool previous;
    VkAttachmentLoadOp load; // attachments
    VkAttachmentStoreOp store;
} frame_graph_plan_use;

typedef struct frame_graph_plan_pass {
    uint32_t pass; // index into the input
    const frame_graph_barrier *barriers; // before it, in one vkCmdPipelineBarrier2
    uint32_t barrier_count;
    const frame_graph_plan_use *uses; // parallel to the declaration's
} frame_graph_plan_pass;

typedef struct frame_graph_culled {
    uint32_t pass;
    const char *why; // a sentence
} frame_graph_culled;

typedef struct frame_graph_plan {
    frame_graph_plan_pass *order;
    uint32_t order_count;
    frame_graph_culled *culled;
    uint32_t culled_count;
    frame_graph_plan_resource *resources;
    uint32_t resource_count;
    frame_graph_slot *slots;
    uint32_t slot_count;
    const frame_graph_barrier *final_barriers; // imports and exports to their `after` states
    uint32_t final_barrier_count;
} frame_graph_plan;

// Compiles into memory of `arena`. Returns NULL on an error and writes one sentence naming passes and resources to
// `error` (two makers of a name, a cycle, a read of nothing, two modifiers of one version, history of a version that is
// later modified, a desc of size zero, ...); what the arena already holds stays valid and there is no half-built plan.
const frame_graph_plan *frame_graph_plan_compile(const frame_graph_input *input, arena *arena, char error[512]);

// Whether `name` is all of `alternatives` or one of them: "raw" is named by "filtered|raw".
bool frame_graph_names(const char *alternatives, const char *name);

// Resource that carries `name` (alternatives allowed) in the plan, or FRAME_GRAPH_NONE.
uint32_t frame_graph_plan_find(const frame_graph_plan *plan, const frame_graph_input *input, const char *name);

// The plan as text (order with barriers, culled passes with reasons, resources with lifetimes and slots), or as a
// DOT digraph.
char *frame_graph_plan_text(const frame_graph_plan *plan, const frame_graph_input *input, arena *arena);
char *frame_graph_plan_dot(const frame_graph_plan *plan, const frame_graph_input *input, arena *arena);

// Enumerators in messages and texts: "graphics", "image", "modifies".
extern const char *const FRAME_GRAPH_PASS_KINDS[], *const FRAME_GRAPH_RESOURCE_KINDS[], *const FRAME_GRAPH_USE_VERBS[];
