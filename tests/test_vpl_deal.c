// Dealing light paths: every source has its share by power to within a factor of two, and changes touch few.
#include "modules/vpl_deal.h"
#include "engine/base.h"
#include "test.h"

enum { SOURCES_MAX = 4000 };

static vpl_deal_source sources[SOURCES_MAX];

static void sources_make(uint32_t count, float power)
{
    for (uint32_t i = 0; i < count; i++)
        sources[i] = (vpl_deal_source){.key = 10 + 2 * (uint64_t)i, .power = power};
}

// The shares of each group are 0..paths-1, once each, and the groups of the sources carry all power.
static void check_deal(const vpl_deal *deal, uint32_t count)
{
    uint32_t *seen = memory_alloc((deal->group_count + 1) * sizeof *seen), total = 0;
    bool *taken = memory_alloc(deal->path_count);
    uint32_t *first = memory_alloc((deal->group_count + 1) * sizeof *first);
    for (uint32_t g = VPL_DEAL_WEAK, sum = 0; g < deal->group_count; g++) {
        first[g] = sum;
        sum += deal->groups[g].paths;
        total = sum;
    }
    CHECK(total <= deal->path_count);
    for (uint32_t p = 0; p < deal->path_count && total <= deal->path_count; p++) {
        const vpl_share *share = &deal->shares[p];
        CHECK(share->source < deal->group_count);
        seen[share->source]++;
        if (share->source == VPL_DEAL_IDLE)
            continue;
        CHECK(share->index < deal->groups[share->source].paths && !taken[first[share->source] + share->index]);
        taken[first[share->source] + share->index] = true;
    }
    for (uint32_t g = VPL_DEAL_WEAK; g < deal->group_count; g++)
        CHECK(seen[g] == deal->groups[g].paths);
    double power = 0, grouped = 0;
    for (uint32_t i = 0; i < count; i++) {
        power += (double)sources[i].power;
        CHECK(deal->groups[deal->group_of[i]].paths > 0);
    }
    for (uint32_t g = VPL_DEAL_WEAK; g < deal->group_count; g++)
        grouped += (double)deal->groups[g].power;
    CHECK_NEAR(grouped, power, 1e-5 * power);
    free(seen);
    free(taken);
    free(first);
}

// Largest ratio between what a group has and what it asks for; groups of less than `least` paths are left out.
static double worst_ratio(const vpl_deal *deal, double least)
{
    double total = 0, worst = 1;
    for (uint32_t g = VPL_DEAL_WEAK; g < deal->group_count; g++)
        total += (double)deal->groups[g].power;
    for (uint32_t g = VPL_DEAL_WEAK; g < deal->group_count; g++) {
        const double ask = deal->path_count * (double)deal->groups[g].power / total, has = deal->groups[g].paths;
        if (ask >= least)
            worst = fmax(worst, fmax(has / ask, ask / has));
    }
    return worst;
}

static uint32_t changed_paths(const vpl_deal *deal)
{
    uint32_t paths = 0;
    for (uint32_t g = VPL_DEAL_WEAK; g < deal->group_count; g++)
        paths += deal->groups[g].changed ? deal->groups[g].paths : 0;
    return paths;
}

TEST(a_first_deal_follows_power_and_leaves_none_idle)
{
    vpl_deal deal = {0};
    sources_make(7, 1);
    sources[3].power = 5;
    vpl_deal_update(&deal, 1000, sources, 7);
    check_deal(&deal, 7);
    CHECK(worst_ratio(&deal, 1) < 1.02 && changed_paths(&deal) == 1000);
    CHECK(deal.groups[deal.group_of[3]].paths >= 454 && deal.groups[deal.group_of[3]].paths <= 455);
    vpl_deal_fini(&deal);
}

TEST(nothing_changed_touches_nothing)
{
    vpl_deal deal = {0};
    sources_make(100, 1);
    for (uint32_t i = 0; i < 50; i++)
        sources[i].power = 1e-4f; // weak
    vpl_deal_update(&deal, 1000, sources, 100);
    CHECK(deal.groups[VPL_DEAL_WEAK].paths > 0 && deal.group_of[0] == VPL_DEAL_WEAK);
    vpl_deal_update(&deal, 1000, sources, 100);
    CHECK(changed_paths(&deal) == 0 && !deal.groups[VPL_DEAL_IDLE].changed);
    check_deal(&deal, 100);
    vpl_deal_fini(&deal);
}

TEST(a_source_that_changes_is_the_only_one)
{
    vpl_deal deal = {0};
    sources_make(100, 1);
    vpl_deal_update(&deal, 10000, sources, 100);
    sources[7].changed = true;
    sources[7].power = 1.3f;
    vpl_deal_update(&deal, 10000, sources, 100);
    for (uint32_t i = 0; i < 100; i++)
        CHECK(deal.groups[deal.group_of[i]].changed == (i == 7));
    vpl_deal_fini(&deal);
}

TEST(coming_and_going_touches_a_few)
{
    vpl_deal deal = {0};
    sources_make(101, 1);
    vpl_deal_update(&deal, 10000, sources, 100);
    sources[100].changed = true;
    vpl_deal_update(&deal, 10000, sources, 101);
    check_deal(&deal, 101);
    CHECK(worst_ratio(&deal, 1) < 2);
    CHECK(changed_paths(&deal) < 500 && deal.groups[deal.group_of[100]].paths >= 90);
    sources[100].changed = false;
    vpl_deal_update(&deal, 10000, sources + 1, 100); // the first goes: its paths stay idle
    CHECK(changed_paths(&deal) == 0 && deal.groups[VPL_DEAL_IDLE].changed);
    vpl_deal_update(&deal, 10000, sources + 50, 51); // half of them: too many to stay idle
    memmove(sources, sources + 50, 51 * sizeof *sources);
    check_deal(&deal, 51);
    CHECK(worst_ratio(&deal, 1) < 2);
    vpl_deal_fini(&deal);
}

TEST(more_sources_than_paths_share_them)
{
    vpl_deal deal = {0};
    for (uint32_t paths = 1; paths < 40; paths += 3) {
        sources_make(SOURCES_MAX, 1);
        sources[17].power = 3000;
        vpl_deal_update(&deal, paths, sources, SOURCES_MAX);
        check_deal(&deal, SOURCES_MAX);
    }
    vpl_deal_fini(&deal);
}

TEST(random_histories_stay_within_a_factor_of_two)
{
    vpl_deal deal = {0};
    vpl_deal_source all[300] = {0};
    uint32_t random = 1;
    double worst = 0, idle = 0;
    for (uint32_t i = 0; i < 300; i++)
        all[i] = (vpl_deal_source){.key = i, .power = expf((float)(i * 37 % 300) / 60)};
    for (uint32_t round = 0; round < 2000; round++) {
        for (uint32_t k = 0; k < 300; k++)
            all[k].changed = false;
        random = random * 1664525u + 1013904223u;
        vpl_deal_source *some = &all[(random >> 8) % 300];
        some->power = random >> 31 ? some->power * 1.7f : some->power / 1.7f;
        some->changed = true;
        uint32_t count = 0;
        const uint32_t gone = (round / 7) % 300; // a window of ten that are gone moves on
        for (uint32_t k = 0; k < 300; k++)
            if ((k + 300 - gone) % 300 >= 10)
                sources[count++] = all[k];
        vpl_deal_update(&deal, 3333, sources, count);
        check_deal(&deal, count);
        worst = fmax(worst, worst_ratio(&deal, 4));
        uint32_t dealt = 0;
        for (uint32_t g = VPL_DEAL_WEAK; g < deal.group_count; g++)
            dealt += deal.groups[g].paths;
        idle = fmax(idle, 1 - dealt / 3333.0);
    }
    printf("  worst ratio %.2f, most idle %.3f\n", worst, idle);
    CHECK(worst < 2.26 && idle <= 0.126); // two, and what whole paths add to asks of four or more
    vpl_deal_fini(&deal);
}

int main(void)
{
    RUN(a_first_deal_follows_power_and_leaves_none_idle);
    RUN(nothing_changed_touches_nothing);
    RUN(a_source_that_changes_is_the_only_one);
    RUN(coming_and_going_touches_a_few);
    RUN(more_sources_than_paths_share_them);
    RUN(random_histories_stay_within_a_factor_of_two);
    return test_end();
}
