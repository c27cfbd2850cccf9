// Slots for the point lights that join the lighting grid hierarchy, behind the VPLs' slots: a light keeps its slot for
// as long as it is there, so that what the others hold stays the same to the bit. Pure: no GPU.
#pragma once

#include "engine/base.h"

enum { LIGHT_SLOTS_MIN = 64 };
#define LIGHT_SLOT_EMPTY UINT32_MAX

typedef struct light_slots_light {
    uint32_t key; // names it from call to call
    uint32_t light; // what its slot shall hold
} light_slots_light;

typedef struct light_slots_owner {
    uint32_t key, slot;
} light_slots_owner;

// Zero-initialise to use.
typedef struct light_slots {
    uint32_t count; // of slots: 0, or a power of two from LIGHT_SLOTS_MIN; more than four to a light are given back
    uint32_t *lights; // [count]; LIGHT_SLOT_EMPTY where nobody is
    light_slots_owner *owners; // ascending by key
    uint32_t owner_count;
    size_t light_capacity, owner_capacity;
} light_slots;

// Who came takes the lowest free slot, in the order of the keys. Another number of slots than before assigns all anew.
// `lights` ascend by key. Depends on nothing but the calls since the slots were zero.
void light_slots_update(light_slots *slots, const light_slots_light *lights, uint32_t count);
void light_slots_fini(light_slots *slots);
