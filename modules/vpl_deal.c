// Sizes of the groups first, then the paths themselves: see vpl_deal.h.
#include "vpl_deal.h"
#include "engine/base.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct portion { // of a group
    double ask; // paths by power
    uint32_t had, paths; // before and now
    uint32_t group;
} portion;

typedef struct dealing {
    vpl_deal *deal;
    vpl_deal_group *last; // groups before this update
    uint32_t last_count;
    portion *portions; // per group; that of the idle asks for nothing
    uint32_t *renamed; // per group before this update: its index now; idle where it is gone
} dealing;

// ---- Groups

// Index among the groups before of the source with this key; last_count where it had none. `k` walks on.
static uint32_t last_group_find(const dealing *d, uint32_t *k, uint64_t key)
{
    while (*k < d->last_count && d->last[*k].key < key)
        (*k)++;
    return *k < d->last_count && d->last[*k].key == key ? *k : d->last_count;
}

static uint64_t hash_add(uint64_t hash, uint64_t value)
{
    return (hash ^ value) * 0x100000001b3u; // FNV-1a by words
}

// A source gets a group once it asks for two paths, and loses it when it asks for less than one.
static void groups_make(dealing *d, const vpl_deal_source *sources, uint32_t count, double total)
{
    vpl_deal *deal = d->deal;
    deal->group_count = VPL_DEAL_FIRST;
    vpl_deal_group *weak = &deal->groups[VPL_DEAL_WEAK];
    uint64_t hash = 0xcbf29ce484222325u;
    for (uint32_t i = 0, k = VPL_DEAL_FIRST; i < count; i++) {
        const vpl_deal_source *source = &sources[i];
        const double ask = deal->path_count * (double)source->power / total;
        const uint32_t last = last_group_find(d, &k, source->key);
        const bool is_weak = ask < (last < d->last_count ? 1 : 2);
        deal->group_of[i] = is_weak ? VPL_DEAL_WEAK : deal->group_count;
        if (is_weak) {
            hash = hash_add(hash, source->key);
            weak->changed |= source->changed;
            d->portions[VPL_DEAL_WEAK].ask += ask;
            weak->power += source->power;
            continue;
        }
        const uint32_t index = deal->group_count++;
        deal->groups[index] =
            (vpl_deal_group){.key = source->key, .source = i, .power = source->power, .changed = source->changed};
        d->portions[index] = (portion){.ask = ask, .had = last < d->last_count ? d->last[last].paths : 0};
        if (last < d->last_count)
            d->renamed[last] = index;
    }
    weak->changed |= hash != deal->weak_hash;
    deal->weak_hash = hash;
    for (uint32_t g = 0; g < deal->group_count; g++)
        d->portions[g].group = g;
}

// ---- Sizes

static uint32_t at_least_one(double paths)
{
    return paths < 1 ? 1 : (uint32_t)paths;
}

static int portion_compare(const void *left, const void *right)
{
    const portion *a = left, *b = right;
    const double x = a->paths / a->ask, y = b->paths / b->ask;
    return x != y ? (x > y ? -1 : 1) : (a->group > b->group) - (a->group < b->group);
}

// What follows power to within a factor of two stays as it is.
static void portions_ask(dealing *d)
{
    for (uint32_t g = VPL_DEAL_WEAK; g < d->deal->group_count; g++) {
        portion *p = &d->portions[g];
        const bool stays = p->had >= ceil(0.5 * p->ask) && p->had <= ceil(2 * p->ask);
        p->paths = !(p->ask > 0) ? 0 : stays ? p->had : at_least_one(p->ask);
    }
}

// Takes from those who have most for their power where more was asked for than there is. Enough, as the integer parts
// of what all ask for fit.
static void portions_lower(portion *sorted, uint32_t count, uint64_t excess)
{
    for (uint32_t i = 0; i < count && excess > 0; i++) {
        const uint32_t least =
            min_u32(sorted[i].paths, (uint32_t)fmax(ceil(0.5 * sorted[i].ask), floor(0.6 * sorted[i].ask)));
        const uint64_t taken = sorted[i].paths - least < excess ? sorted[i].paths - least : excess;
        sorted[i].paths -= (uint32_t)taken;
        excess -= taken;
    }
    assert(excess == 0);
}

// Gives what is left to those who have least for their power.
static void portions_raise(portion *sorted, uint32_t count, uint64_t left)
{
    for (uint32_t i = count; i-- > 0 && left > 0;) {
        const uint32_t most = max_u32(sorted[i].paths, (uint32_t)ceil(sorted[i].ask));
        const uint64_t given = most - sorted[i].paths < left ? most - sorted[i].paths : left;
        sorted[i].paths += (uint32_t)given;
        left -= given;
    }
}

// A few idle paths cost less than the change of those who would get them; more than one in IDLE_SHARE are handed out.
static void portions_fit(dealing *d)
{
    enum { IDLE_SHARE = 8 };
    const uint32_t groups = d->deal->group_count;
    portion *sorted = memory_alloc(groups * sizeof *sorted);
    uint32_t count = 0;
    uint64_t sum = 0;
    bool is_first = true;
    for (uint32_t g = VPL_DEAL_WEAK; g < groups; g++) {
        const portion *p = &d->portions[g];
        sum += p->paths;
        is_first = is_first && p->had == 0;
        if (p->paths > 0)
            sorted[count++] = *p;
    }
    qsort(sorted, count, sizeof *sorted, portion_compare);
    const uint32_t paths = d->deal->path_count;
    if (sum > paths)
        portions_lower(sorted, count, sum - paths);
    else if (is_first || paths - sum > paths / IDLE_SHARE)
        portions_raise(sorted, count, paths - sum);
    for (uint32_t i = 0; i < count; i++)
        d->portions[sorted[i].group].paths = sorted[i].paths;
    free(sorted);
}

// ---- Paths

// Takes the paths from groups that are gone or have fewer now. True when one had an owner and may have none now.
static bool shares_release(dealing *d)
{
    vpl_deal *deal = d->deal;
    bool released = false;
    for (uint32_t p = 0; p < deal->path_count; p++) {
        vpl_share *share = &deal->shares[p];
        const uint32_t group = d->renamed[share->source];
        const bool kept = group != VPL_DEAL_IDLE && share->index < d->portions[group].paths;
        released |= !kept && share->source != VPL_DEAL_IDLE;
        *share = kept ? (vpl_share){group, share->index} : (vpl_share){VPL_DEAL_IDLE, 0};
    }
    return released;
}

static void shares_hand_out(dealing *d)
{
    vpl_deal *deal = d->deal;
    uint32_t group = VPL_DEAL_WEAK, next = d->portions[VPL_DEAL_WEAK].had;
    for (uint32_t p = 0; p < deal->path_count; p++) {
        if (deal->shares[p].source != VPL_DEAL_IDLE)
            continue;
        while (group < deal->group_count && next >= d->portions[group].paths) {
            group++;
            next = group < deal->group_count ? d->portions[group].had : 0;
        }
        if (group == deal->group_count)
            return;
        deal->shares[p] = (vpl_share){group, next++};
    }
}

static void groups_finish(dealing *d)
{
    for (uint32_t g = VPL_DEAL_WEAK; g < d->deal->group_count; g++) {
        d->deal->groups[g].paths = d->portions[g].paths;
        d->deal->groups[g].changed |= d->portions[g].paths != d->portions[g].had;
    }
}

// ---- Update

// Makes room for the groups of `count` sources; those before move to d->last.
static void dealing_begin(dealing *d, uint32_t count)
{
    vpl_deal *deal = d->deal;
    const uint32_t most = VPL_DEAL_FIRST + count;
    d->last_count = max_u32(deal->group_count, VPL_DEAL_FIRST);
    d->last = memory_alloc(d->last_count * sizeof *d->last);
    if (deal->group_count > 0)
        memcpy(d->last, deal->groups, deal->group_count * sizeof *d->last);
    d->portions = memory_alloc(most * sizeof *d->portions);
    d->portions[VPL_DEAL_WEAK].had = d->last[VPL_DEAL_WEAK].paths;
    d->renamed = memory_alloc(d->last_count * sizeof *d->renamed);
    d->renamed[VPL_DEAL_WEAK] = VPL_DEAL_WEAK;
    memory_reserve((void **)&deal->groups, &deal->group_capacity, most, sizeof *deal->groups);
    memory_reserve((void **)&deal->group_of, &deal->group_of_capacity, max_u32(count, 1), sizeof *deal->group_of);
    memset(deal->groups, 0, VPL_DEAL_FIRST * sizeof *deal->groups);
}

static void dealing_end(dealing *d)
{
    free(d->last);
    free(d->portions);
    free(d->renamed);
}

// All paths idle, and no groups.
static void deal_clear(vpl_deal *deal, uint32_t path_count)
{
    memory_reserve((void **)&deal->shares, &deal->share_capacity, path_count, sizeof *deal->shares);
    memset(deal->shares, 0, path_count * sizeof *deal->shares);
    deal->path_count = path_count;
    deal->group_count = 0;
    deal->weak_hash = 0;
}

void vpl_deal_update(vpl_deal *deal, uint32_t path_count, const vpl_deal_source *sources, uint32_t count)
{
    assert(path_count > 0);
    if (deal->path_count != path_count)
        deal_clear(deal, path_count);
    double total = 0;
    for (uint32_t i = 0; i < count; i++)
        total += (double)sources[i].power;
    dealing d = {.deal = deal};
    dealing_begin(&d, count);
    groups_make(&d, sources, count, total);
    portions_ask(&d);
    portions_fit(&d);
    deal->groups[VPL_DEAL_IDLE].changed = shares_release(&d);
    shares_hand_out(&d);
    groups_finish(&d);
    dealing_end(&d);
}

void vpl_deal_fini(vpl_deal *deal)
{
    free(deal->shares);
    free(deal->groups);
    free(deal->group_of);
}
