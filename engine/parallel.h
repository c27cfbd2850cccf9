// Loops over the CPU's cores: a few threads that sleep until there is work, so that a software Vulkan device has the
// cores to itself in between.
#pragma once

#include "base.h"

typedef struct parallel parallel;

// `threads` counts the caller too; 0 means as many as there are CPUs for this process. Where fewer can be started, the
// loops run on fewer. Never NULL.
parallel *parallel_create(uint32_t threads);
void parallel_destroy(parallel *pool); // accepts NULL
uint32_t parallel_threads(const parallel *pool);

// Calls `body` on the parts of at most `chunk` > 0 items of 0..count-1, each part once, on any thread and in any order,
// and returns when all have returned; what they wrote is visible then. Not from within a body, and from one thread at a
// time.
void parallel_for(parallel *pool, uint32_t count, uint32_t chunk,
                  void (*body)(uint32_t begin, uint32_t end, void *user), void *user);
