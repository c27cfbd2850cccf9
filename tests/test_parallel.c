// Loops over threads: every item once, and all of them done on return.
#include "engine/parallel.h"
#include "test.h"

enum { ITEMS = 10007 };

static void visit(uint32_t begin, uint32_t end, void *user)
{
    for (uint32_t i = begin; i < end; i++)
        ((uint8_t *)user)[i]++;
}

TEST(every_item_is_visited_once)
{
    static const uint32_t threads[] = {0, 1, 2, 7}, counts[] = {0, 1, 2, 100, ITEMS},
                          chunks[] = {1, 3, 100, UINT32_MAX};
    for (size_t t = 0; t < countof(threads); t++) {
        parallel *pool = parallel_create(threads[t]);
        CHECK(parallel_threads(pool) >= 1 && (threads[t] == 0 || parallel_threads(pool) == threads[t]));
        for (size_t n = 0; n < countof(counts); n++)
            for (size_t c = 0; c < countof(chunks); c++) {
                static uint8_t visits[ITEMS + 1];
                memset(visits, 0, sizeof visits);
                parallel_for(pool, counts[n], chunks[c], visit, visits);
                for (uint32_t i = 0; i <= ITEMS; i++)
                    if (visits[i] != (i < counts[n]))
                        CHECK(!"an item was left out or visited twice");
            }
        parallel_destroy(pool);
    }
}

typedef struct parts {
    uint32_t count, chunk;
    bool fits;
} parts;

static void measure(uint32_t begin, uint32_t end, void *user)
{
    parts *p = user;
    if (begin % p->chunk != 0 || begin >= end || end - begin > p->chunk || end > p->count)
        p->fits = false;
}

TEST(parts_have_the_size_asked_for)
{
    parallel *pool = parallel_create(1);
    parts p = {1000, 64, true};
    parallel_for(pool, p.count, p.chunk, measure, &p);
    CHECK(p.fits);
    parallel_destroy(pool);
}

TEST(loops_follow_one_another)
{
    parallel *pool = parallel_create(4);
    static uint8_t visits[256];
    for (uint32_t round = 1; round <= 200; round++) {
        parallel_for(pool, countof(visits), 1, visit, visits);
        for (size_t i = 0; i < countof(visits); i++)
            if (visits[i] != (uint8_t)round)
                CHECK(!"a loop returned before its end");
    }
    parallel_destroy(pool);
}

TEST(destroying_nothing_is_allowed)
{
    parallel_destroy(NULL);
}

int main(void)
{
    RUN(every_item_is_visited_once);
    RUN(parts_have_the_size_asked_for);
    RUN(loops_follow_one_another);
    RUN(destroying_nothing_is_allowed);
    return test_end();
}
