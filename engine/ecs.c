// Entities, sparse sets and phases: see ecs.h.
#include "ecs.h"

#include <stdlib.h>
#include <string.h>

enum {
    INDEX_BITS = 20,
    GENERATION_BITS = 12,
    MAX_ENTITIES = 1 << INDEX_BITS,
    COMPONENT_ALIGNMENT = 16,
};
_Static_assert(_Alignof(max_align_t) >= COMPONENT_ALIGNMENT, "dense arrays come from realloc");

typedef struct entity_slot {
    uint16_t generation;
    bool alive; // told apart from the generation, which wraps
} entity_slot;

// All components of one type: `places` is sparse, `entities` and `components` are dense and parallel.
typedef struct component_set {
    component_desc desc;
    size_t stride; // bytes from one component to the next
    uint32_t locks; // loops over this set and fini callbacks under way: nothing may be added or removed
    size_t count;
    uint32_t *places; // by entity index: place in the dense arrays plus one, 0 when absent
    size_t place_capacity;
    entity *entities;
    size_t entity_capacity;
    char *components;
    size_t component_capacity;
} component_set;

struct ecs_world {
    arena arena; // the sets, and copies of names: what lives as long as the world

    entity_slot *slots; // by entity index; the first is never used, so that no entity's id is zero
    size_t slot_count, slot_capacity;
    uint32_t *free_indices; // a stack
    size_t free_count, free_capacity;

    component_set **sets; // by component type, less one
    size_t set_count, set_capacity;
    ecs_system_desc *systems;
    size_t system_count, system_capacity;

    uint32_t deferrals; // loops, systems and removals under way: while there are any, destruction waits in `doomed`
    entity *doomed;
    size_t doomed_count, doomed_capacity;
};

static uint32_t entity_index(entity e)
{
    return e.id & (MAX_ENTITIES - 1);
}

static component_set *set_of(const ecs_world *world, component_type type)
{
    assert(type.id > 0 && type.id <= world->set_count);
    return world->sets[type.id - 1];
}

static uint32_t set_place(const component_set *set, entity e)
{
    const uint32_t index = entity_index(e);
    return index < set->place_capacity ? set->places[index] : 0;
}

static void *set_component(const component_set *set, uint32_t place)
{
    return set->components + (place - 1) * set->stride;
}

static void *set_append(component_set *set, entity e)
{
    assert(set->locks == 0 && "a component is added within a loop over its own type");
    const size_t index = entity_index(e);
    memory_reserve((void **)&set->places, &set->place_capacity, index + 1, sizeof(*set->places));
    memory_reserve((void **)&set->entities, &set->entity_capacity, set->count + 1, sizeof(*set->entities));
    memory_reserve((void **)&set->components, &set->component_capacity, set->count + 1, set->stride);

    set->entities[set->count++] = e;
    set->places[index] = (uint32_t)set->count;
    return memset(set_component(set, set->places[index]), 0, set->stride);
}

// Releases the entity's component, if there is one, and moves the last one into its place. Within a deferral only, as
// the fini callback may destroy entities.
static void set_remove(component_set *set, entity e)
{
    const uint32_t place = set_place(set, e);
    if (!place) {
        return;
    }
    assert(set->locks == 0 && "a component is removed within a loop over its own type");
    if (set->desc.fini) {
        set->locks++;
        set->desc.fini(set_component(set, place), set->desc.user);
        set->locks--;
    }

    const uint32_t last = (uint32_t)set->count--;
    const entity moved = set->entities[last - 1];
    if (place != last) {
        memcpy(set_component(set, place), set_component(set, last), set->stride);
        set->entities[place - 1] = moved;
        set->places[entity_index(moved)] = place;
    }
    set->places[entity_index(e)] = 0;
}

static void set_clear(component_set *set)
{
    while (set->count > 0) {
        set_remove(set, set->entities[set->count - 1]);
    }
}

static void set_fini(component_set *set)
{
    free(set->places);
    free(set->entities);
    free(set->components);
}

// ---- Entities

static void entity_destroy_now(ecs_world *world, entity e)
{
    if (!ecs_entity_alive(world, e)) {
        return; // doomed twice
    }
    for (size_t i = world->set_count; i-- > 0;) {
        set_remove(world->sets[i], e);
    }

    const uint32_t index = entity_index(e);
    entity_slot *const slot = &world->slots[index];
    slot->alive = false;
    slot->generation = (slot->generation + 1) & ((1 << GENERATION_BITS) - 1);
    memory_reserve((void **)&world->free_indices, &world->free_capacity, world->free_count + 1,
                   sizeof(*world->free_indices));
    world->free_indices[world->free_count++] = index;
}

static void deferral_begin(ecs_world *world)
{
    world->deferrals++;
}

static void deferral_end(ecs_world *world)
{
    assert(world->deferrals > 0);
    if (world->deferrals == 1) {
        // Still within the deferral: a fini callback may doom further entities, which lengthens the list.
        for (size_t i = 0; i < world->doomed_count; i++) {
            entity_destroy_now(world, world->doomed[i]);
        }
        world->doomed_count = 0;
    }
    world->deferrals--;
}

static uint32_t unused_index(ecs_world *world)
{
    if (world->free_count > 0) {
        return world->free_indices[--world->free_count];
    }
    assert(world->slot_count < MAX_ENTITIES);
    memory_reserve((void **)&world->slots, &world->slot_capacity, world->slot_count + 1, sizeof(*world->slots));
    return (uint32_t)world->slot_count++;
}

entity ecs_entity_create(ecs_world *world)
{
    const uint32_t index = unused_index(world);
    entity_slot *const slot = &world->slots[index];
    slot->alive = true;
    return (entity){(uint32_t)slot->generation << INDEX_BITS | index};
}

void ecs_entity_destroy(ecs_world *world, entity e)
{
    if (!ecs_entity_alive(world, e)) {
        return;
    }
    deferral_begin(world);
    memory_reserve((void **)&world->doomed, &world->doomed_capacity, world->doomed_count + 1, sizeof(*world->doomed));
    world->doomed[world->doomed_count++] = e;
    deferral_end(world);
}

bool ecs_entity_alive(const ecs_world *world, entity e)
{
    const uint32_t index = entity_index(e);
    return index < world->slot_count && world->slots[index].alive &&
           world->slots[index].generation == e.id >> INDEX_BITS;
}

// ---- Components

component_type ecs_component_register(ecs_world *world, const component_desc *desc)
{
    const component_type known = ecs_component_find(world, desc->name);
    if (known.id) {
        assert(set_of(world, known)->desc.size == desc->size);
        return known;
    }

    component_set *const set = arena_alloc(&world->arena, sizeof(*set));
    set->desc = *desc;
    set->desc.name = arena_strdup(&world->arena, desc->name);
    // A tag takes a stride as well, so that it has an address and ecs_get can tell it from none.
    set->stride = align_up(desc->size ? desc->size : 1, COMPONENT_ALIGNMENT);
    memory_reserve((void **)&world->sets, &world->set_capacity, world->set_count + 1, sizeof(*world->sets));
    world->sets[world->set_count++] = set;
    return (component_type){(uint32_t)world->set_count};
}

component_type ecs_component_find(const ecs_world *world, const char *name)
{
    for (size_t i = 0; i < world->set_count; i++) {
        if (strcmp(world->sets[i]->desc.name, name) == 0) {
            return (component_type){(uint32_t)i + 1};
        }
    }
    return (component_type){0};
}

void *ecs_add(ecs_world *world, entity e, component_type type)
{
    assert(ecs_entity_alive(world, e));
    component_set *const set = set_of(world, type);
    const uint32_t place = set_place(set, e);
    return place ? set_component(set, place) : set_append(set, e);
}

void *ecs_get(const ecs_world *world, entity e, component_type type)
{
    const component_set *const set = set_of(world, type);
    const uint32_t place = ecs_entity_alive(world, e) ? set_place(set, e) : 0;
    return place ? set_component(set, place) : NULL;
}

void ecs_remove(ecs_world *world, entity e, component_type type)
{
    if (!ecs_get(world, e, type)) {
        return;
    }
    deferral_begin(world);
    set_remove(set_of(world, type), e);
    deferral_end(world);
}

size_t ecs_count(const ecs_world *world, component_type type)
{
    return set_of(world, type)->count;
}

// ---- Iteration

ecs_iterator ecs_iterate(ecs_world *world, component_type type)
{
    set_of(world, type)->locks++;
    deferral_begin(world);
    return (ecs_iterator){.world = world, .type = type};
}

bool ecs_next(ecs_iterator *it)
{
    assert(it->world && "the loop has ended");
    const component_set *const set = set_of(it->world, it->type);
    if (it->next == set->count) {
        ecs_iterate_end(it);
        return false;
    }
    it->entity = set->entities[it->next++];
    it->component = set_component(set, (uint32_t)it->next);
    return true;
}

void ecs_iterate_end(ecs_iterator *it)
{
    if (!it->world) {
        return; // the loop came to its end by itself
    }
    set_of(it->world, it->type)->locks--;
    deferral_end(it->world);
    *it = (ecs_iterator){0};
}

// ---- Systems

void ecs_system_register(ecs_world *world, const ecs_system_desc *desc)
{
    assert(desc->phase < ECS_PHASE_COUNT);
    memory_reserve((void **)&world->systems, &world->system_capacity, world->system_count + 1, sizeof(*world->systems));
    ecs_system_desc *const system = &world->systems[world->system_count++];
    *system = *desc;
    system->name = arena_strdup(&world->arena, desc->name);
}

// Takes a copy: the system may register others, which moves the table.
static void system_run(ecs_world *world, ecs_system_desc system)
{
    deferral_begin(world);
    const uint32_t deferrals = world->deferrals;
    system.run(world, system.user);
    if (world->deferrals != deferrals) {
        log_error("system \"%s\" left a loop over components early without ecs_iterate_end", system.name);
    }
    assert(world->deferrals == deferrals);
    deferral_end(world);
}

void ecs_run(ecs_world *world)
{
    for (uint32_t phase = 0; phase < ECS_PHASE_COUNT; phase++) {
        for (size_t i = 0; i < world->system_count; i++) {
            if (world->systems[i].phase == phase) {
                system_run(world, world->systems[i]);
            }
        }
    }
}

// ---- World

ecs_world *ecs_world_create(void)
{
    ecs_world *const world = memory_alloc(sizeof(*world));
    memory_reserve((void **)&world->slots, &world->slot_capacity, 1, sizeof(*world->slots));
    world->slot_count = 1;
    return world;
}

void ecs_world_destroy(ecs_world *world)
{
    if (!world) {
        return;
    }
    assert(world->deferrals == 0 && "the world is destroyed within a loop or a system");
    // Never ended: the entities that fini callbacks destroy go with the world.
    deferral_begin(world);
    for (size_t i = world->set_count; i-- > 0;) {
        set_clear(world->sets[i]);
    }
    // Only now, as a fini callback may look into any set.
    for (size_t i = 0; i < world->set_count; i++) {
        set_fini(world->sets[i]);
    }
    free(world->slots);
    free(world->free_indices);
    free(world->sets);
    free(world->systems);
    free(world->doomed);
    arena_fini(&world->arena);
    free(world);
}
