// See light_slots.h.
#include "light_slots.h"

#include <stdlib.h>
#include <string.h>

static uint32_t slot_count_for(const light_slots *slots, uint32_t count)
{
    if (count == 0 || (count <= slots->count && 4ull * count >= slots->count))
        return count == 0 ? 0 : slots->count;
    uint32_t made = LIGHT_SLOTS_MIN;
    while (made < count)
        made *= 2;
    return made;
}

// Gives the lights that were there their slots back; the others' are empty for now.
static light_slots_owner *owners_keep(light_slots *slots, const light_slots_light *lights, uint32_t count)
{
    light_slots_owner *owners = memory_alloc(max_u32(count, 1) * sizeof *owners);
    for (uint32_t i = 0, k = 0; i < count; i++) {
        assert(i == 0 || lights[i - 1].key < lights[i].key);
        while (k < slots->owner_count && slots->owners[k].key < lights[i].key)
            k++;
        const bool is_kept = k < slots->owner_count && slots->owners[k].key == lights[i].key;
        owners[i] = (light_slots_owner){lights[i].key, is_kept ? slots->owners[k].slot : LIGHT_SLOT_EMPTY};
        if (is_kept)
            slots->lights[owners[i].slot] = lights[i].light;
    }
    return owners;
}

void light_slots_update(light_slots *slots, const light_slots_light *lights, uint32_t count)
{
    const uint32_t slot_count = slot_count_for(slots, count);
    if (slot_count != slots->count)
        slots->owner_count = 0;
    slots->count = slot_count;
    memory_reserve((void **)&slots->lights, &slots->light_capacity, max_u32(slot_count, 1), sizeof *slots->lights);
    memset(slots->lights, 0xff, slot_count * sizeof *slots->lights);
    light_slots_owner *owners = owners_keep(slots, lights, count);
    for (uint32_t i = 0, free_slot = 0; i < count; i++) {
        if (owners[i].slot != LIGHT_SLOT_EMPTY)
            continue;
        while (slots->lights[free_slot] != LIGHT_SLOT_EMPTY)
            free_slot++;
        owners[i].slot = free_slot;
        slots->lights[free_slot] = lights[i].light;
    }
    memory_reserve((void **)&slots->owners, &slots->owner_capacity, max_u32(count, 1), sizeof *slots->owners);
    memcpy(slots->owners, owners, count * sizeof *owners);
    slots->owner_count = count;
    free(owners);
}

void light_slots_fini(light_slots *slots)
{
    free(slots->lights);
    free(slots->owners);
}
