// The lighting grid hierarchy's buffers as the frame graph sees them: transients, or held by the module from frame to
// frame so that an incremental build finds what it built before.
#pragma once

#include "renderer.h"

typedef enum lgh_item {
    // Of which an incremental build reads last frame's and writes this one's: two copies.
    LGH_KEYS, // uint[slots]: Morton codes of the VPLs' cells in S1, sorted
    LGH_ORDER, // uint[slots]: slots of the same VPLs; in a cell in ascending order
    LGH_MASKS,
    LGH_MASKS_FILLED, // uint[]: a bit for each word of the masks that is not zero
    LGH_RANKS,
    LGH_VERTICES,
    LGH_SUMS,
    LGH_SAMPLES,
    LGH_DOUBLE_COUNT,
    // One copy:
    LGH_HEADER = LGH_DOUBLE_COUNT,
    LGH_STATE,
    LGH_SLOT_CELLS, // uint[slots]: what key each slot has in the list
    LGH_CELL_MASKS,
    LGH_CELL_MASKS_FILLED,
    LGH_CELL_RANKS,
    LGH_CELL_STARTS,
    LGH_DIRTY_CELLS, // masks by Morton code of the cells whose VPLs changed
    LGH_DIRTY_CELLS_FILLED,
    LGH_LIGHTS,
    LGH_HELD_COUNT,
    // Of one frame:
    LGH_PARTIALS = LGH_HELD_COUNT,
    LGH_TABLE, // prefix sums of the sort and the merge
    LGH_KEYS_SWAP,
    LGH_ORDER_SWAP,
    LGH_NEW_KEYS, // the changed VPLs, sorted
    LGH_NEW_ORDER,
    LGH_CHANGED, // in the place of `vpl_changed`
    LGH_DIRTY_PLACES, // uint[]: vertices to build again, each level's at its first_light
    LGH_RANK_GROUPS,
    LGH_CELL_GROUPS,
    LGH_ITEM_COUNT
} lgh_item;

typedef struct lgh_buffers {
    gpu_buffer held[LGH_HELD_COUNT][2];
    bool is_used[LGH_HELD_COUNT][2]; // the buffer has been written
    uint32_t current; // the copy that this frame writes
    // Of the current frame:
    bool hold; // all of the items that can be held; else header, state and masks alone
    uint64_t sizes[LGH_ITEM_COUNT]; // bytes
    uint32_t versions[LGH_ITEM_COUNT]; // how often a pass made the item
} lgh_buffers;

// Before the frame's first pass, with `hold` and `sizes` filled in. True when everything held still has what the last
// frame left in it: nothing was made anew.
bool lgh_buffers_begin(renderer *r, lgh_buffers *b);
// From now on this frame writes the other copies. False, and logged, when there is no memory.
bool lgh_buffers_flip(renderer *r, lgh_buffers *b);
// Whether nothing in the copy that this frame writes can be relied on; from now on it can.
bool lgh_buffers_fresh(lgh_buffers *b, lgh_item item);
void lgh_buffers_fini(renderer *r, lgh_buffers *b);

// By its next binding the pass writes the item, or goes on with what the pass before made of it. The last one's has the
// plain name, "lgh_order", for all who read it.
void lgh_buffers_write(renderer *r, lgh_buffers *b, frame_graph_pass *pass, lgh_item item, bool last);
// The same for items that are made under names of the caller's choice: the first one's is `name`.
void lgh_buffers_make(renderer *r, lgh_buffers *b, frame_graph_pass *pass, lgh_item item, const char *name);
// By its next binding the pass reads what the passes declared so far made of the item.
void lgh_buffers_read(const lgh_buffers *b, frame_graph_pass *pass, lgh_item item, frame_graph_access access);
// ... and what last frame left, after a flip.
void lgh_buffers_read_old(renderer *r, lgh_buffers *b, frame_graph_pass *pass, lgh_item item);
// Nothing is built: everything held is there under its plain name.
void lgh_buffers_import(renderer *r, lgh_buffers *b);
