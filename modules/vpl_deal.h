// Deals light paths to light sources by power, and keeps what is dealt: a source that changes leaves the paths of the
// others alone. A source has n paths of 1/n of its flux each, so every n is unbiased; n follows power to within a
// factor of two, and the fewest sources get another n when one comes, goes or changes its power. Pure: no GPU.
#pragma once

#include "shaders/shared.h"

#include <stdbool.h>
#include <stddef.h>

typedef struct vpl_deal_source {
    uint64_t key; // names it from call to call
    float power; // > 0
    bool changed; // its paths are to be traced anew
} vpl_deal_source;

// Group 0 holds the paths that nobody has, group 1 the sources that are too weak for paths of their own; then one
// source a group.
enum { VPL_DEAL_IDLE, VPL_DEAL_WEAK, VPL_DEAL_FIRST };
typedef struct vpl_deal_group {
    uint64_t key; // of its source
    uint32_t source; // index of its source
    uint32_t paths;
    float power;
    bool changed; // any of its paths has to be traced anew: its sources, its number of paths or their owners changed
} vpl_deal_group;

// Zero-initialise to use.
typedef struct vpl_deal {
    uint32_t path_count;
    vpl_share *shares; // path_count; `source` is a group
    vpl_deal_group *groups;
    uint32_t group_count;
    uint32_t *group_of; // per source of the last update
    uint64_t weak_hash; // of the keys in the group of the weak
    size_t share_capacity, group_capacity, group_of_capacity;
} vpl_deal;

// Deals `path_count` paths to the sources, which are sorted by ascending key. Another path_count than before deals all
// anew. Depends on nothing but the calls since the deal was zero.
void vpl_deal_update(vpl_deal *deal, uint32_t path_count, const vpl_deal_source *sources, uint32_t count);
void vpl_deal_fini(vpl_deal *deal);
