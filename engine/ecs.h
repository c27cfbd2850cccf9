// A minimal entity-component system. Entities are generational ids, components live in sparse sets (dense arrays), and
// systems are callbacks that run in a phase, in the order in which they were registered. It orders the CPU's work;
// the frame graph orders the GPU's.
#pragma once

#include "base.h"

// Zero is no entity. A destroyed entity's id never becomes valid again (until its 12-bit generation wraps).
typedef struct entity {
    uint32_t id; // low 20 bits: index, high 12 bits: generation
} entity;

typedef struct component_type {
    uint32_t id; // zero is none
} component_type;

typedef struct ecs_world ecs_world;

typedef struct component_desc {
    const char *name; // unique; for messages and for looking up by name; copied
    size_t size; // bytes; 0 makes a tag without data
    // Called just before a component is removed, its entity destroyed or the world destroyed; types registered later go
    // first. It may read other components and destroy entities, but add nothing. NULL: nothing to release.
    void (*fini)(void *component, void *user);
    void *user;
} component_desc;

// The phases of a frame, in order.
typedef enum ecs_phase {
    ECS_PHASE_INPUT, // scripts, user input, animation
    ECS_PHASE_UPDATE, // transforms and whatever follows from them
    ECS_PHASE_EXTRACT, // copy what the GPU needs into buffers
    ECS_PHASE_RENDER, // declare the frame graph and execute it
    ECS_PHASE_COUNT
} ecs_phase;

typedef struct ecs_system_desc {
    const char *name; // for messages; copied
    ecs_phase phase;
    void (*run)(ecs_world *world, void *user);
    void *user;
} ecs_system_desc;

ecs_world *ecs_world_create(void);
void ecs_world_destroy(ecs_world *world); // accepts NULL

entity ecs_entity_create(ecs_world *world);
// Destroys the entity with all its components. While an iteration (ecs_iterate) or a system runs the destruction is
// deferred to its end; the entity stays alive, and its components readable, until then. A dead entity is ignored.
void ecs_entity_destroy(ecs_world *world, entity e);
bool ecs_entity_alive(const ecs_world *world, entity e);

// Registers a component type. A name registered before gives the same type back; its size must agree (asserted).
component_type ecs_component_register(ecs_world *world, const component_desc *desc);
component_type ecs_component_find(const ecs_world *world, const char *name); // {0} when unknown

// Adds a zeroed component, or returns the present one. The pointer is valid until the next add or remove of this type.
// Adding to a dead entity is a programmer's error (asserted).
void *ecs_add(ecs_world *world, entity e, component_type type);
void *ecs_get(const ecs_world *world, entity e, component_type type); // NULL when absent or the entity is dead
void ecs_remove(ecs_world *world, entity e, component_type type); // absent: nothing happens
size_t ecs_count(const ecs_world *world, component_type type);

// Iterates over all components of one type in dense order:
//     for (ecs_iterator it = ecs_iterate(world, light); ecs_next(&it);) use(it.entity, it.component);
// Within the loop components of *other* types may be added and removed, entities created, and entities destroyed
// (deferred). A loop left early must call ecs_iterate_end.
typedef struct ecs_iterator {
    entity entity;
    void *component;
    ecs_world *world;
    component_type type;
    size_t next;
} ecs_iterator;
ecs_iterator ecs_iterate(ecs_world *world, component_type type);
bool ecs_next(ecs_iterator *it);
void ecs_iterate_end(ecs_iterator *it);

void ecs_system_register(ecs_world *world, const ecs_system_desc *desc);
// Runs every system, phase by phase, in registration order within a phase.
void ecs_run(ecs_world *world);
