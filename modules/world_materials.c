// Materials whose colours change while running: their copy on the CPU, what of it changed, and its upload.
#include "world.h"

#include <stdlib.h>
#include <string.h>

struct world_materials {
    uint8_t *changes; // per material: MATERIAL_*_CHANGED
    uint8_t any; // of them
    bool on_host; // the buffer is one that can be written while running
};

void world_materials_init(renderer *r)
{
    world_gpu *w = r->gpu_world;
    const size_t count = max_u32(r->scene->material_count, 1), used = r->scene->material_count;
    w->material_data = memory_alloc(count * sizeof *w->material_data);
    if (used > 0)
        memcpy(w->material_data, r->scene->materials, used * sizeof *w->material_data);
    w->material_state = memory_alloc(sizeof *w->material_state);
    w->material_state->changes = memory_alloc(count);
}

void world_materials_fini(renderer *r)
{
    world_gpu *w = r->gpu_world;
    if (w->material_state)
        free(w->material_state->changes);
    free(w->material_state);
    free(w->material_data);
}

void world_material_set(renderer *r, uint32_t index, const float base_color[4], const float emissive[3])
{
    assert(index < r->scene->material_count);
    material *m = &r->gpu_world->material_data[index];
    struct world_materials *state = r->gpu_world->material_state;
    uint8_t changes = 0;
    if (memcmp(m->base_color, base_color, sizeof m->base_color) != 0)
        changes |= MATERIAL_COLOR_CHANGED;
    if (memcmp(m->emissive, emissive, sizeof m->emissive) != 0)
        changes |= MATERIAL_EMISSION_CHANGED;
    memcpy(m->base_color, base_color, sizeof m->base_color);
    memcpy(m->emissive, emissive, sizeof m->emissive);
    state->changes[index] |= changes;
    state->any |= changes;
}

uint8_t world_material_changes(const renderer *r, uint32_t index)
{
    return r->gpu_world->material_state->changes[index];
}

uint8_t world_materials_changes(const renderer *r)
{
    return r->gpu_world->material_state->any;
}

// Materials that never change stay in the device's memory; the first change moves them all to the host's.
bool world_materials_extract(renderer *r)
{
    world_gpu *w = r->gpu_world;
    if (!w->material_state->any)
        return true;
    if (!w->material_state->on_host) {
        gpu_buffer_destroy(r->gpu, w->materials);
        w->materials = (gpu_buffer){0};
        w->material_state->on_host = true;
    }
    const size_t size = r->scene->material_count * sizeof *w->material_data;
    material *mapped = world_buffer_reserve(r, &w->materials, "materials", SCENE_MATERIALS, size);
    if (mapped)
        memcpy(mapped, w->material_data, size);
    return mapped != NULL;
}

void world_materials_rest(renderer *r)
{
    struct world_materials *state = r->gpu_world->material_state;
    memset(state->changes, 0, r->scene->material_count);
    state->any = 0;
}
