// A loop is a number that counts up: whoever is awake takes the next part, the caller included.
#include "parallel.h"

#include <pthread.h>
#include <sched.h>
#include <stdlib.h>

typedef struct loop {
    void (*body)(uint32_t begin, uint32_t end, void *user);
    void *user;
    uint32_t count, chunk;
    uint32_t next; // first item that nobody has taken
} loop;

struct parallel {
    pthread_mutex_t mutex; // guards all below
    pthread_cond_t started, finished;
    loop loop;
    uint32_t running; // parts that are being worked on
    bool closing;
    pthread_t *workers;
    uint32_t worker_count;
};

// Works on the loop until nothing is left to take. Called with the mutex held.
static void loop_run(parallel *pool)
{
    while (pool->loop.next < pool->loop.count) {
        const loop loop = pool->loop;
        const uint32_t end = loop.count - loop.next > loop.chunk ? loop.next + loop.chunk : loop.count;
        pool->loop.next = end;
        pool->running++;
        pthread_mutex_unlock(&pool->mutex);
        loop.body(loop.next, end, loop.user);
        pthread_mutex_lock(&pool->mutex);
        pool->running--;
    }
}

static void *worker_run(void *user)
{
    parallel *pool = user;
    pthread_mutex_lock(&pool->mutex);
    while (!pool->closing) {
        loop_run(pool);
        if (pool->running == 0)
            pthread_cond_signal(&pool->finished);
        pthread_cond_wait(&pool->started, &pool->mutex);
    }
    pthread_mutex_unlock(&pool->mutex);
    return NULL;
}

static uint32_t cpu_count(void)
{
    cpu_set_t cpus;
    return sched_getaffinity(0, sizeof cpus, &cpus) == 0 ? (uint32_t)CPU_COUNT(&cpus) : 1;
}

parallel *parallel_create(uint32_t threads)
{
    parallel *pool = memory_alloc(sizeof *pool);
    pthread_mutex_init(&pool->mutex, NULL);
    pthread_cond_init(&pool->started, NULL);
    pthread_cond_init(&pool->finished, NULL);
    const uint32_t workers = max_u32(threads ? threads : cpu_count(), 1) - 1;
    pool->workers = memory_alloc(max_u32(workers, 1) * sizeof *pool->workers);
    while (pool->worker_count < workers &&
           pthread_create(&pool->workers[pool->worker_count], NULL, worker_run, pool) == 0)
        pool->worker_count++;
    return pool;
}

void parallel_destroy(parallel *pool)
{
    if (!pool)
        return;
    pthread_mutex_lock(&pool->mutex);
    pool->closing = true;
    pthread_cond_broadcast(&pool->started);
    pthread_mutex_unlock(&pool->mutex);
    for (uint32_t i = 0; i < pool->worker_count; i++)
        pthread_join(pool->workers[i], NULL);
    pthread_cond_destroy(&pool->finished);
    pthread_cond_destroy(&pool->started);
    pthread_mutex_destroy(&pool->mutex);
    free(pool->workers);
    free(pool);
}

uint32_t parallel_threads(const parallel *pool)
{
    return pool->worker_count + 1;
}

void parallel_for(parallel *pool, uint32_t count, uint32_t chunk,
                  void (*body)(uint32_t begin, uint32_t end, void *user), void *user)
{
    assert(chunk > 0);
    pthread_mutex_lock(&pool->mutex);
    pool->loop = (loop){.body = body, .user = user, .count = count, .chunk = chunk};
    if (count > chunk)
        pthread_cond_broadcast(&pool->started);
    loop_run(pool);
    while (pool->running > 0)
        pthread_cond_wait(&pool->finished, &pool->mutex);
    pthread_mutex_unlock(&pool->mutex);
}
