// The frame graph: passes declare what they create, read and modify; the graph orders them by their data, culls what
// nobody needs, places transients, and records barriers, timestamps and debug labels. Rebuilt every frame; physical
// objects are cached, so a frame that declares what the last one did allocates nothing.
//
//     frame_graph_begin(graph);
//     const frame_graph_pass_desc tonemap = {.name = "tonemap", .kind = ..., .execute = ..., .user = ...};
//     frame_graph_pass *pass = frame_graph_pass_add(graph, &tonemap);
//     frame_graph_read(pass, "radiance", ACCESS_STORAGE_READ); // binding 0
//     frame_graph_create_resource(pass, "display", &desc, ACCESS_STORAGE_WRITE); // binding 1
//     frame_graph_export(graph, "display", ACCESS_TRANSFER_READ);
//     ok = frame_graph_execute(graph);
//
// Every use whose access is a shader binding takes the next binding of set 0, in order of declaration.
#pragma once

#include "frame_graph_compile.h"
#include "gpu.h"

typedef struct frame_graph frame_graph;
typedef struct frame_graph_pass frame_graph_pass;

// What a pass's execute callback may use.
typedef struct frame_graph_context {
    gpu *gpu;
    gpu_commands *commands; // NULL in host passes
    frame_graph *graph;
    const struct frame_graph_pass *pass;
    uint32_t width, height; // graphics: size of the attachments; the viewport is set to it
} frame_graph_context;

typedef struct frame_graph_pass_desc {
    const char *name; // "module" or "module/step"; copied
    frame_graph_pass_kind kind;
    bool keep; // has an effect outside the graph: never culled
    void (*execute)(const frame_graph_context *context, void *user);
    // Passed to execute: a copy of `user_size` bytes at `user` when user_size is not 0, else the pointer itself.
    void *user;
    size_t user_size;
} frame_graph_pass_desc;

frame_graph *frame_graph_create(gpu *gpu);
void frame_graph_destroy(frame_graph *graph); // accepts NULL

// ---- Declare. Names are copied.
void frame_graph_begin(frame_graph *graph); // forgets the last frame's passes, keeps its history
void frame_graph_import_buffer(frame_graph *graph, const char *name, gpu_buffer buffer, frame_graph_access before,
                               frame_graph_access after);
void frame_graph_import_image(frame_graph *graph, const char *name, gpu_image image, frame_graph_access before,
                              frame_graph_access after);
void frame_graph_import_acceleration(frame_graph *graph, const char *name, gpu_acceleration acceleration,
                                     frame_graph_access before, frame_graph_access after);
frame_graph_pass *frame_graph_pass_add(frame_graph *graph, const frame_graph_pass_desc *desc);
void frame_graph_create_resource(frame_graph_pass *pass, const char *name, const frame_graph_resource_desc *desc,
                                 frame_graph_access access);
void frame_graph_create_cleared(frame_graph_pass *pass, const char *name, const frame_graph_resource_desc *desc,
                                frame_graph_access access, VkClearValue value);
void frame_graph_read(frame_graph_pass *pass, const char *name, frame_graph_access access);
void frame_graph_modify(frame_graph_pass *pass, const char *from, const char *to, frame_graph_access access);
// Reads what `name` held at the end of the last frame. Undefined contents on the first frame and after its desc
// changed: ask frame_graph_history_valid in execute.
void frame_graph_read_previous(frame_graph_pass *pass, const char *name, frame_graph_access access);
// Keeps `name` after the frame, in the state `after`, for frame_graph_find_*.
void frame_graph_export(frame_graph *graph, const char *name, frame_graph_access after);
void frame_graph_cull_set(frame_graph *graph, bool enabled); // default: on
void frame_graph_history_drop(frame_graph *graph); // a cut: next frame's history is invalid
// Whether the last frame left contents of `name` for frame_graph_read_previous. Between frames and while declaring.
bool frame_graph_has_history(const frame_graph *graph, const char *name);

static inline frame_graph_resource_desc frame_graph_image_of(VkFormat format, uint32_t width, uint32_t height)
{
    return (frame_graph_resource_desc){.kind = FRAME_GRAPH_IMAGE, .format = format, .width = width, .height = height};
}
static inline frame_graph_resource_desc frame_graph_buffer_of(uint64_t size)
{
    return (frame_graph_resource_desc){.kind = FRAME_GRAPH_BUFFER, .size = size};
}

// ---- Run: compile, record, submit and wait. False on a declaration error or a lost device; logged.
bool frame_graph_execute(frame_graph *graph);

// ---- Within execute callbacks. A name that the pass did not declare is asserted. Where a pass uses a name of this
// frame and reads last frame's too, this frame's is meant.

// Binds a pipeline with all of the pass's binding uses.
void frame_graph_bind(const frame_graph_context *context, gpu_pipeline pipeline);
gpu_buffer frame_graph_buffer(const frame_graph_context *context, const char *name);
gpu_image frame_graph_image(const frame_graph_context *context, const char *name);
bool frame_graph_history_valid(const frame_graph_context *context, const char *name);
bool frame_graph_present(const frame_graph_context *context, const char *name); // of optional uses

// ---- After execute.
gpu_buffer frame_graph_find_buffer(frame_graph *graph, const char *name); // exports only; {0} when there is none
gpu_image frame_graph_find_image(frame_graph *graph, const char *name);
typedef struct frame_graph_timing {
    const char *name; // the pass's
    double milliseconds;
} frame_graph_timing;
// Timings of the last frame in order of execution, valid until the next begin.
const frame_graph_timing *frame_graph_timings(const frame_graph *graph, uint32_t *count);
// The compiled plan of the last frame as text or DOT; free() it. NULL before the first execute.
char *frame_graph_dump_text(const frame_graph *graph);
char *frame_graph_dump_dot(const frame_graph *graph);
