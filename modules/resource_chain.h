// Resources that several passes make in turn, such as a sum that grows from batch to batch: the first pass creates, the
// others modify. What the last of them makes has the plain name, for all who read it.
//
//     resource_chain sum = {.name = "shadow_u", .desc = image, .length = 2};
//     resource_chain_next(&sum, first_pass);  // makes "shadow_u_1"
//     resource_chain_next(&sum, second_pass); // makes "shadow_u" of it
#pragma once

#include "engine/frame_graph.h"

typedef struct resource_chain {
    const char *name;
    frame_graph_resource_desc desc;
    uint32_t length; // passes that make it
    uint32_t done; // of these, declared so far
} resource_chain;

// The pass is the next maker, by its next binding: ACCESS_STORAGE_READ_WRITE, undefined contents for the first one.
void resource_chain_next(resource_chain *chain, frame_graph_pass *pass);
// A uint that `adders` passes add to (shaders/ray_count.glsl.h), readable on the host. Adds the pass `clear`, which
// makes it zero and is the first of the chain.
resource_chain resource_chain_counter(frame_graph *graph, const char *clear, const char *name, uint32_t adders);
