// See lgh_buffers.h.
#include "lgh_buffers.h"

#include <stdio.h>
#include <string.h>

typedef struct item_name {
    char text[40];
} item_name;

static const char *const item_names[LGH_ITEM_COUNT] = {
    [LGH_KEYS] = "lgh_keys",
    [LGH_ORDER] = "lgh_order",
    [LGH_MASKS] = "lgh_masks",
    [LGH_MASKS_FILLED] = "lgh_masks_filled",
    [LGH_RANKS] = "lgh_ranks",
    [LGH_VERTICES] = "lgh_vertices",
    [LGH_SUMS] = "lgh_sums",
    [LGH_SAMPLES] = "lgh_samples",
    [LGH_HEADER] = "lgh_header",
    [LGH_STATE] = "lgh_state",
    [LGH_SLOT_CELLS] = "lgh_slot_cells",
    [LGH_CELL_MASKS] = "lgh_cell_masks",
    [LGH_CELL_MASKS_FILLED] = "lgh_cell_masks_filled",
    [LGH_CELL_RANKS] = "lgh_cell_ranks",
    [LGH_CELL_STARTS] = "lgh_cell_starts",
    [LGH_DIRTY_CELLS] = "lgh_dirty_cells",
    [LGH_DIRTY_CELLS_FILLED] = "lgh_dirty_cells_filled",
    [LGH_LIGHTS] = "lgh_lights",
    [LGH_PARTIALS] = "lgh_partials",
    [LGH_TABLE] = "lgh_table",
    [LGH_KEYS_SWAP] = "lgh_keys_swap",
    [LGH_ORDER_SWAP] = "lgh_order_swap",
    [LGH_NEW_KEYS] = "lgh_new_keys",
    [LGH_NEW_ORDER] = "lgh_new_order",
    [LGH_CHANGED] = "lgh_changed",
    [LGH_DIRTY_PLACES] = "lgh_dirty_places",
    [LGH_RANK_GROUPS] = "lgh_rank_groups",
    [LGH_CELL_GROUPS] = "lgh_cell_groups",
};

// Even where every frame builds all, it goes on from the grid of the last, and clears no more of a mask than is filled.
static bool item_is_held(const lgh_buffers *b, lgh_item item)
{
    switch (item) {
    case LGH_HEADER:
    case LGH_STATE:
    case LGH_MASKS:
    case LGH_MASKS_FILLED:
    case LGH_CELL_MASKS:
    case LGH_CELL_MASKS_FILLED:
        return true;
    default:
        return b->hold && item < LGH_HELD_COUNT;
    }
}

static uint32_t copy_of(const lgh_buffers *b, lgh_item item)
{
    return item < LGH_DOUBLE_COUNT ? b->current : 0;
}

// Made anew when its size changed.
static bool copy_reserve(renderer *r, lgh_buffers *b, lgh_item item, uint32_t copy, bool *same)
{
    gpu_buffer *buffer = &b->held[item][copy];
    if (buffer->id && gpu_buffer_size(r->gpu, *buffer) == b->sizes[item])
        return true;
    gpu_buffer_destroy(r->gpu, *buffer);
    *same = false;
    b->is_used[item][copy] = false;
    const gpu_buffer_desc desc = {
        .name = item_names[item],
        .size = b->sizes[item],
        .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
    };
    *buffer = gpu_buffer_create(r->gpu, &desc);
    return buffer->id != 0;
}

static void item_release(renderer *r, lgh_buffers *b, lgh_item item, uint32_t copy)
{
    gpu_buffer_destroy(r->gpu, b->held[item][copy]);
    b->held[item][copy] = (gpu_buffer){0};
}

bool lgh_buffers_begin(renderer *r, lgh_buffers *b)
{
    bool same = true;
    memset(b->versions, 0, sizeof b->versions);
    for (lgh_item item = 0; item < LGH_HELD_COUNT; item++) {
        if (item_is_held(b, item))
            r->failed |= !copy_reserve(r, b, item, copy_of(b, item), &same);
        else
            for (uint32_t copy = 0; copy < 2; copy++)
                item_release(r, b, item, copy);
    }
    return same;
}

bool lgh_buffers_flip(renderer *r, lgh_buffers *b)
{
    bool ok = true, same;
    b->current ^= 1;
    for (lgh_item item = 0; item < LGH_DOUBLE_COUNT; item++)
        ok &= copy_reserve(r, b, item, b->current, &same);
    r->failed |= !ok;
    return ok;
}

bool lgh_buffers_fresh(lgh_buffers *b, lgh_item item)
{
    if (!item_is_held(b, item))
        return true;
    bool *is_used = &b->is_used[item][copy_of(b, item)];
    const bool fresh = !*is_used;
    *is_used = true;
    return fresh;
}

void lgh_buffers_fini(renderer *r, lgh_buffers *b)
{
    for (lgh_item item = 0; item < LGH_HELD_COUNT; item++)
        for (uint32_t copy = 0; copy < 2; copy++)
            item_release(r, b, item, copy);
}

static item_name name_of(lgh_item item, uint32_t version)
{
    item_name name;
    if (version == UINT32_MAX)
        snprintf(name.text, sizeof name.text, "%s", item_names[item]);
    else
        snprintf(name.text, sizeof name.text, "%s_%u", item_names[item], version);
    return name;
}

void lgh_buffers_make(renderer *r, lgh_buffers *b, frame_graph_pass *pass, lgh_item item, const char *name)
{
    if (item_is_held(b, item)) {
        char held[40];
        snprintf(held, sizeof held, "%s_held", item_names[item]);
        frame_graph_import_buffer(r->graph, held, b->held[item][copy_of(b, item)], ACCESS_STORAGE_READ_WRITE,
                                  ACCESS_NONE);
        frame_graph_modify(pass, held, name, ACCESS_STORAGE_READ_WRITE);
    } else {
        const frame_graph_resource_desc desc = frame_graph_buffer_of(b->sizes[item]);
        frame_graph_create_resource(pass, name, &desc, ACCESS_STORAGE_READ_WRITE);
    }
}

void lgh_buffers_write(renderer *r, lgh_buffers *b, frame_graph_pass *pass, lgh_item item, bool last)
{
    const uint32_t before = b->versions[item], after = last ? UINT32_MAX : before + 1;
    if (before == 0)
        lgh_buffers_make(r, b, pass, item, name_of(item, after).text);
    else
        frame_graph_modify(pass, name_of(item, before).text, name_of(item, after).text, ACCESS_STORAGE_READ_WRITE);
    b->versions[item] = after;
}

void lgh_buffers_read(const lgh_buffers *b, frame_graph_pass *pass, lgh_item item, frame_graph_access access)
{
    frame_graph_read(pass, name_of(item, b->versions[item]).text, access);
}

void lgh_buffers_read_old(renderer *r, lgh_buffers *b, frame_graph_pass *pass, lgh_item item)
{
    char old[40];
    snprintf(old, sizeof old, "%s_old", item_names[item]);
    frame_graph_import_buffer(r->graph, old, b->held[item][b->current ^ 1], ACCESS_STORAGE_READ_WRITE, ACCESS_NONE);
    frame_graph_read(pass, old, ACCESS_STORAGE_READ);
}

void lgh_buffers_import(renderer *r, lgh_buffers *b)
{
    for (lgh_item item = 0; item < LGH_HELD_COUNT; item++)
        if (item != LGH_STATE && item != LGH_SLOT_CELLS)
            frame_graph_import_buffer(r->graph, item_names[item], b->held[item][copy_of(b, item)],
                                      ACCESS_STORAGE_READ_WRITE, ACCESS_NONE);
}
