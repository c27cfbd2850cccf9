// Entities, components, iteration, deferred destruction and systems.
#include "engine/ecs.h"
#include "test.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

typedef struct number {
    int value;
} number;

static component_type number_register(ecs_world *world)
{
    return ecs_component_register(world, &(component_desc){.name = "number", .size = sizeof(number)});
}

static component_type tag_register(ecs_world *world)
{
    return ecs_component_register(world, &(component_desc){.name = "tag"});
}

static entity entity_with_number(ecs_world *world, component_type type, int value)
{
    const entity e = ecs_entity_create(world);
    ((number *)ecs_add(world, e, type))->value = value;
    return e;
}

static int number_of(const ecs_world *world, entity e, component_type type)
{
    const number *const component = ecs_get(world, e, type);
    return component ? component->value : -1;
}

// A component type that writes the values of released components to a list.
typedef struct release_list {
    int values[64];
    int count;
} release_list;

static void number_release(void *component, void *user)
{
    release_list *const released = user;
    assert(released->count < (int)countof(released->values));
    released->values[released->count++] = ((const number *)component)->value;
}

static component_type released_register(ecs_world *world, const char *name, release_list *released)
{
    return ecs_component_register(
        world, &(component_desc){.name = name, .size = sizeof(number), .fini = number_release, .user = released});
}

// Whether `break_rule` fails an assertion, tried in a child process.
static bool asserts(void (*break_rule)(void))
{
    fflush(stdout);
    const pid_t child = fork();
    if (child == 0) {
        // The assertion's message is expected and would only alarm a reader.
        close(STDERR_FILENO);
        break_rule();
        _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    return WIFSIGNALED(status) && WTERMSIG(status) == SIGABRT;
}

// ---- Entities

TEST(entity_zero_is_none)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    CHECK(!ecs_entity_alive(world, (entity){0}));
    for (int i = 0; i < 100; i++) {
        CHECK(ecs_entity_create(world).id != 0);
    }
    CHECK(!ecs_entity_alive(world, (entity){0}));
    CHECK(!ecs_get(world, (entity){0}, type));
    ecs_entity_destroy(world, (entity){0});
    ecs_remove(world, (entity){0}, type);
    ecs_world_destroy(world);
}

TEST(world_destroy_accepts_null)
{
    ecs_world_destroy(NULL);
}

TEST(entity_is_alive_from_creation_to_destruction)
{
    ecs_world *const world = ecs_world_create();
    const entity e = ecs_entity_create(world);
    CHECK(ecs_entity_alive(world, e));
    ecs_entity_destroy(world, e);
    CHECK(!ecs_entity_alive(world, e));
    ecs_world_destroy(world);
}

TEST(id_never_given_out_is_not_alive)
{
    ecs_world *const world = ecs_world_create();
    ecs_entity_create(world);
    CHECK(!ecs_entity_alive(world, (entity){2}));
    CHECK(!ecs_entity_alive(world, (entity){UINT32_MAX}));
    ecs_world_destroy(world);
}

TEST(recycled_slot_gets_a_new_generation)
{
    ecs_world *const world = ecs_world_create();
    const entity first = ecs_entity_create(world);
    ecs_entity_destroy(world, first);
    const entity second = ecs_entity_create(world);
    CHECK((first.id & 0xfffff) == (second.id & 0xfffff));
    CHECK(first.id >> 20 != second.id >> 20);
    CHECK(!ecs_entity_alive(world, first) && ecs_entity_alive(world, second));
    ecs_world_destroy(world);
}

TEST(stale_id_does_not_reach_the_component_of_its_successor)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    const entity stale = entity_with_number(world, type, 1);
    ecs_entity_destroy(world, stale);
    const entity successor = entity_with_number(world, type, 2);
    CHECK(!ecs_get(world, stale, type));
    ecs_remove(world, stale, type);
    ecs_entity_destroy(world, stale);
    CHECK(ecs_entity_alive(world, successor) && number_of(world, successor, type) == 2);
    ecs_world_destroy(world);
}

TEST(destroying_twice_frees_the_slot_once)
{
    ecs_world *const world = ecs_world_create();
    const entity e = ecs_entity_create(world);
    ecs_entity_destroy(world, e);
    ecs_entity_destroy(world, e);
    const entity a = ecs_entity_create(world), b = ecs_entity_create(world);
    CHECK(a.id != b.id && (a.id & 0xfffff) != (b.id & 0xfffff));
    ecs_world_destroy(world);
}

TEST(ids_of_one_slot_differ_until_the_generation_wraps)
{
    ecs_world *const world = ecs_world_create();
    const entity first = ecs_entity_create(world);
    entity e = first;
    for (int i = 1; i < 4096; i++) {
        ecs_entity_destroy(world, e);
        e = ecs_entity_create(world);
        CHECK(e.id != first.id && !ecs_entity_alive(world, first));
    }
    ecs_entity_destroy(world, e);
    e = ecs_entity_create(world);
    CHECK(e.id == first.id && ecs_entity_alive(world, e));
    ecs_world_destroy(world);
}

TEST(freed_id_is_dead_even_when_its_generation_comes_next)
{
    ecs_world *const world = ecs_world_create();
    const entity first = ecs_entity_create(world);
    entity e = first;
    for (int i = 0; i < 4096; i++) {
        ecs_entity_destroy(world, e);
        CHECK(!ecs_entity_alive(world, first));
        e = ecs_entity_create(world);
    }
    ecs_world_destroy(world);
}

TEST(many_entities_keep_their_own_components)
{
    enum { COUNT = 100000 };
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    entity *const entities = memory_alloc(COUNT * sizeof(*entities));
    for (int i = 0; i < COUNT; i++) {
        entities[i] = entity_with_number(world, type, i);
    }
    for (int i = 0; i < COUNT; i += 3) {
        ecs_entity_destroy(world, entities[i]);
    }
    for (int i = 1; i < COUNT; i += 3) {
        ecs_remove(world, entities[i], type);
    }
    int wrong = 0;
    for (int i = 0; i < COUNT; i++) {
        wrong += ecs_entity_alive(world, entities[i]) != (i % 3 != 0);
        wrong += number_of(world, entities[i], type) != (i % 3 == 2 ? i : -1);
    }
    CHECK(wrong == 0);
    CHECK(ecs_count(world, type) == COUNT / 3);
    free(entities);
    ecs_world_destroy(world);
}

// ---- Components

TEST(registering_a_name_twice_gives_the_same_type)
{
    ecs_world *const world = ecs_world_create();
    const component_type first = number_register(world), other = tag_register(world), again = number_register(world);
    CHECK(first.id == again.id && first.id != other.id && first.id != 0 && other.id != 0);
    ecs_world_destroy(world);
}

static void register_with_another_size(void)
{
    ecs_world *const world = ecs_world_create();
    number_register(world);
    ecs_component_register(world, &(component_desc){.name = "number", .size = sizeof(number) + 1});
}

TEST(registering_a_name_with_another_size_asserts)
{
    CHECK(asserts(register_with_another_size));
}

TEST(component_type_is_found_by_name)
{
    ecs_world *const world = ecs_world_create();
    CHECK(ecs_component_find(world, "number").id == 0);
    const component_type type = number_register(world);
    CHECK(ecs_component_find(world, "number").id == type.id);
    CHECK(ecs_component_find(world, "numb").id == 0);
    ecs_world_destroy(world);
}

TEST(component_name_is_copied)
{
    ecs_world *const world = ecs_world_create();
    char name[] = "brief";
    const component_type type = ecs_component_register(world, &(component_desc){.name = name, .size = 4});
    memset(name, 'x', sizeof(name) - 1);
    CHECK(ecs_component_find(world, "brief").id == type.id);
    ecs_world_destroy(world);
}

TEST(added_component_is_zeroed_even_in_a_reused_place)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    const entity e = entity_with_number(world, type, 77);
    ecs_remove(world, e, type);
    CHECK(!ecs_get(world, e, type));
    ecs_add(world, e, type);
    CHECK(number_of(world, e, type) == 0);
    ecs_world_destroy(world);
}

TEST(adding_again_returns_the_present_component)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    const entity e = entity_with_number(world, type, 5);
    const number *const again = ecs_add(world, e, type);
    CHECK(again->value == 5 && again == ecs_get(world, e, type) && ecs_count(world, type) == 1);
    ecs_world_destroy(world);
}

TEST(removing_an_absent_component_does_nothing)
{
    ecs_world *const world = ecs_world_create();
    release_list released = {0};
    const component_type type = released_register(world, "released", &released);
    const entity e = ecs_entity_create(world), other = entity_with_number(world, type, 1);
    ecs_remove(world, e, type);
    CHECK(ecs_count(world, type) == 1 && number_of(world, other, type) == 1 && released.count == 0);
    ecs_world_destroy(world);
}

TEST(removal_leaves_other_entities_components_as_they_were)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    entity entities[5];
    for (int i = 0; i < 5; i++) {
        entities[i] = entity_with_number(world, type, i);
    }
    ecs_remove(world, entities[1], type);
    ecs_remove(world, entities[4], type);
    const int expected[] = {0, -1, 2, 3, -1};
    for (int i = 0; i < 5; i++) {
        CHECK(number_of(world, entities[i], type) == expected[i]);
    }
    CHECK(ecs_count(world, type) == 3);
    ecs_world_destroy(world);
}

TEST(types_are_independent_of_each_other)
{
    ecs_world *const world = ecs_world_create();
    const component_type a = number_register(world);
    const component_type b = ecs_component_register(world, &(component_desc){.name = "b", .size = sizeof(number)});
    const entity e = entity_with_number(world, a, 1);
    CHECK(!ecs_get(world, e, b));
    ((number *)ecs_add(world, e, b))->value = 2;
    ecs_remove(world, e, a);
    CHECK(!ecs_get(world, e, a) && number_of(world, e, b) == 2);
    ecs_world_destroy(world);
}

TEST(tag_without_data_is_present_or_absent)
{
    ecs_world *const world = ecs_world_create();
    const component_type tag = tag_register(world);
    const entity tagged = ecs_entity_create(world), plain = ecs_entity_create(world);
    CHECK(ecs_add(world, tagged, tag));
    CHECK(ecs_get(world, tagged, tag) && !ecs_get(world, plain, tag));
    CHECK(ecs_count(world, tag) == 1);
    ecs_remove(world, tagged, tag);
    CHECK(!ecs_get(world, tagged, tag) && ecs_count(world, tag) == 0);
    ecs_world_destroy(world);
}

TEST(components_of_any_size_are_16_byte_aligned)
{
    ecs_world *const world = ecs_world_create();
    const size_t sizes[] = {0, 1, 4, 12, 16, 17, 64, 100};
    for (size_t i = 0; i < countof(sizes); i++) {
        char name[16];
        snprintf(name, sizeof(name), "size %zu", sizes[i]);
        const component_type type = ecs_component_register(world, &(component_desc){.name = name, .size = sizes[i]});
        for (int j = 0; j < 50; j++) {
            ecs_add(world, ecs_entity_create(world), type);
        }
        for (ecs_iterator it = ecs_iterate(world, type); ecs_next(&it);) {
            CHECK((uintptr_t)it.component % 16 == 0);
        }
    }
    ecs_world_destroy(world);
}

TEST(adjacent_components_do_not_overlap)
{
    ecs_world *const world = ecs_world_create();
    enum { SIZE = 40, COUNT = 20 };
    const component_type type = ecs_component_register(world, &(component_desc){.name = "wide", .size = SIZE});
    entity entities[COUNT];
    for (int i = 0; i < COUNT; i++) {
        entities[i] = ecs_entity_create(world);
        memset(ecs_add(world, entities[i], type), i + 1, SIZE);
    }
    for (int i = 0; i < COUNT; i++) {
        const unsigned char *const bytes = ecs_get(world, entities[i], type);
        CHECK(bytes[0] == i + 1 && bytes[SIZE - 1] == i + 1);
    }
    ecs_world_destroy(world);
}

static void add_to_a_dead_entity(void)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    const entity e = ecs_entity_create(world);
    ecs_entity_destroy(world, e);
    ecs_add(world, e, type);
}

TEST(adding_to_a_dead_entity_asserts)
{
    CHECK(asserts(add_to_a_dead_entity));
}

// ---- Release

TEST(fini_is_called_once_on_remove)
{
    ecs_world *const world = ecs_world_create();
    release_list released = {0};
    const component_type type = released_register(world, "released", &released);
    const entity e = entity_with_number(world, type, 7);
    ecs_remove(world, e, type);
    CHECK(released.count == 1 && released.values[0] == 7);
    ecs_remove(world, e, type);
    ecs_entity_destroy(world, e);
    ecs_world_destroy(world);
    CHECK(released.count == 1);
}

TEST(fini_is_called_once_on_entity_destroy)
{
    ecs_world *const world = ecs_world_create();
    release_list released = {0};
    const component_type type = released_register(world, "released", &released);
    const entity e = entity_with_number(world, type, 7);
    ecs_entity_destroy(world, e);
    CHECK(released.count == 1 && released.values[0] == 7);
    ecs_entity_destroy(world, e);
    ecs_world_destroy(world);
    CHECK(released.count == 1);
}

TEST(fini_is_called_once_for_each_component_on_world_destroy)
{
    ecs_world *const world = ecs_world_create();
    release_list released = {0};
    const component_type type = released_register(world, "released", &released);
    for (int i = 0; i < 10; i++) {
        entity_with_number(world, type, i);
    }
    ecs_world_destroy(world);
    CHECK(released.count == 10);
    bool seen[10] = {false};
    for (int i = 0; i < released.count; i++) {
        CHECK(!seen[released.values[i]]);
        seen[released.values[i]] = true;
    }
}

TEST(types_registered_later_are_released_first)
{
    ecs_world *const world = ecs_world_create();
    release_list released = {0};
    const component_type first = released_register(world, "first", &released);
    const component_type second = released_register(world, "second", &released);
    for (int i = 0; i < 2; i++) {
        const entity e = entity_with_number(world, first, 10 + i);
        ((number *)ecs_add(world, e, second))->value = 20 + i;
        if (i == 0) {
            ecs_entity_destroy(world, e);
        }
    }
    ecs_world_destroy(world);
    const int expected[] = {20, 10, 21, 11};
    CHECK(released.count == 4 && memcmp(released.values, expected, sizeof(expected)) == 0);
}

// A component that owns an entity and destroys it on its release, and records whether it could still read itself.
typedef struct owner {
    entity self, owned;
} owner;

typedef struct owner_log {
    ecs_world *world;
    component_type type;
    int released, alive_and_readable;
} owner_log;

static void owner_release(void *component, void *user)
{
    const owner *const released = component;
    owner_log *const log = user;
    log->released++;
    log->alive_and_readable +=
        ecs_entity_alive(log->world, released->self) && ecs_get(log->world, released->self, log->type) == component;
    ecs_entity_destroy(log->world, released->owned);
    ecs_entity_destroy(log->world, released->self);
}

// A chain of `count` entities, each owning the next; returns the first.
static entity owner_chain_create(owner_log *log, int count)
{
    const component_desc desc = {.name = "owner", .size = sizeof(owner), .fini = owner_release, .user = log};
    log->type = ecs_component_register(log->world, &desc);
    entity next = {0};
    for (int i = 0; i < count; i++) {
        const entity e = ecs_entity_create(log->world);
        *(owner *)ecs_add(log->world, e, log->type) = (owner){.self = e, .owned = next};
        next = e;
    }
    return next;
}

TEST(fini_may_destroy_entities_in_a_chain)
{
    owner_log log = {.world = ecs_world_create()};
    ecs_entity_destroy(log.world, owner_chain_create(&log, 50));
    CHECK(log.released == 50 && log.alive_and_readable == 50 && ecs_count(log.world, log.type) == 0);
    ecs_world_destroy(log.world);
    CHECK(log.released == 50);
}

TEST(fini_on_remove_may_destroy_its_own_entity)
{
    owner_log log = {.world = ecs_world_create()};
    const entity e = owner_chain_create(&log, 1);
    ecs_remove(log.world, e, log.type);
    CHECK(log.released == 1 && log.alive_and_readable == 1 && !ecs_entity_alive(log.world, e));
    ecs_world_destroy(log.world);
}

TEST(fini_on_world_destroy_may_destroy_entities)
{
    owner_log log = {.world = ecs_world_create()};
    owner_chain_create(&log, 50);
    ecs_world_destroy(log.world);
    CHECK(log.released == 50 && log.alive_and_readable == 50);
}

// ---- Iteration

TEST(iteration_visits_components_in_dense_order)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    entity entities[6];
    for (int i = 0; i < 6; i++) {
        entities[i] = entity_with_number(world, type, i);
        ecs_entity_create(world);
    }
    // The last component takes the place of the one removed.
    ecs_remove(world, entities[1], type);
    const int expected[] = {0, 5, 2, 3, 4};
    size_t count = 0;
    const char *previous = NULL;
    for (ecs_iterator it = ecs_iterate(world, type); ecs_next(&it);) {
        const number *const component = it.component;
        CHECK(component->value == expected[count] && it.entity.id == entities[expected[count]].id);
        CHECK(!previous || (const char *)it.component == previous + 16);
        previous = it.component;
        count++;
    }
    CHECK(count == countof(expected));
    ecs_world_destroy(world);
}

TEST(iteration_over_no_components_ends_at_once)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    for (ecs_iterator it = ecs_iterate(world, type); ecs_next(&it);) {
        CHECK(!"reached");
    }
    const entity e = ecs_entity_create(world);
    ecs_entity_destroy(world, e);
    CHECK(!ecs_entity_alive(world, e));
    ecs_world_destroy(world);
}

TEST(other_types_may_be_added_and_removed_within_a_loop)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world), tag = tag_register(world);
    for (int i = 0; i < 100; i++) {
        const entity e = entity_with_number(world, type, i);
        if (i % 2) {
            ecs_add(world, e, tag);
        }
    }
    int count = 0;
    for (ecs_iterator it = ecs_iterate(world, type); ecs_next(&it);) {
        CHECK(((const number *)it.component)->value == count);
        if (count++ % 2) {
            ecs_remove(world, it.entity, tag);
        } else {
            ecs_add(world, it.entity, tag);
        }
        ecs_add(world, ecs_entity_create(world), tag);
    }
    CHECK(count == 100 && ecs_count(world, tag) == 150);
    ecs_world_destroy(world);
}

TEST(types_may_be_registered_within_a_loop)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    for (int i = 0; i < 40; i++) {
        entity_with_number(world, type, i);
    }
    int count = 0;
    for (ecs_iterator it = ecs_iterate(world, type); ecs_next(&it);) {
        char name[16];
        snprintf(name, sizeof(name), "new %d", count);
        ecs_add(world, it.entity, ecs_component_register(world, &(component_desc){.name = name, .size = 4}));
        CHECK(((const number *)it.component)->value == count++);
    }
    CHECK(count == 40);
    ecs_world_destroy(world);
}

static void remove_own_type_in_loop(void)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    entity_with_number(world, type, 0);
    for (ecs_iterator it = ecs_iterate(world, type); ecs_next(&it);) {
        ecs_remove(world, it.entity, type);
    }
}

static void add_own_type_in_loop(void)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    entity_with_number(world, type, 0);
    ecs_iterator it = ecs_iterate(world, type);
    ecs_add(world, ecs_entity_create(world), type);
    ecs_iterate_end(&it);
}

TEST(changing_a_type_within_a_loop_over_it_asserts)
{
    CHECK(asserts(remove_own_type_in_loop));
    CHECK(asserts(add_own_type_in_loop));
}

TEST(entity_destroyed_within_a_loop_lives_until_its_end)
{
    ecs_world *const world = ecs_world_create();
    release_list released = {0};
    const component_type type = released_register(world, "released", &released);
    entity entities[10];
    for (int i = 0; i < 10; i++) {
        entities[i] = entity_with_number(world, type, i);
    }
    int visited = 0;
    for (ecs_iterator it = ecs_iterate(world, type); ecs_next(&it);) {
        ecs_entity_destroy(world, it.entity);
        ecs_entity_destroy(world, entities[9 - visited]);
        CHECK(ecs_entity_alive(world, it.entity) && number_of(world, it.entity, type) == visited);
        CHECK(released.count == 0);
        visited++;
    }
    CHECK(visited == 10 && released.count == 10 && ecs_count(world, type) == 0);
    for (int i = 0; i < 10; i++) {
        CHECK(!ecs_entity_alive(world, entities[i]));
    }
    ecs_world_destroy(world);
}

TEST(destruction_in_a_nested_loop_waits_for_the_outer_one)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world), tag = tag_register(world);
    for (int i = 0; i < 5; i++) {
        ecs_add(world, entity_with_number(world, type, i), tag);
    }
    int outer = 0, inner = 0;
    for (ecs_iterator i = ecs_iterate(world, type); ecs_next(&i);) {
        for (ecs_iterator j = ecs_iterate(world, tag); ecs_next(&j);) {
            ecs_entity_destroy(world, j.entity);
            inner++;
        }
        outer++;
        CHECK(ecs_entity_alive(world, i.entity) && ecs_count(world, type) == 5 && ecs_count(world, tag) == 5);
    }
    CHECK(outer == 5 && inner == 25);
    CHECK(ecs_count(world, type) == 0 && ecs_count(world, tag) == 0);
    ecs_world_destroy(world);
}

TEST(loops_over_the_same_type_nest)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    for (int i = 0; i < 4; i++) {
        entity_with_number(world, type, i);
    }
    int pairs = 0;
    for (ecs_iterator i = ecs_iterate(world, type); ecs_next(&i);) {
        for (ecs_iterator j = ecs_iterate(world, type); ecs_next(&j);) {
            pairs++;
        }
    }
    CHECK(pairs == 16);
    entity_with_number(world, type, 4);
    CHECK(ecs_count(world, type) == 5);
    ecs_world_destroy(world);
}

TEST(iterate_end_lets_destruction_and_changes_happen_again)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    const entity first = entity_with_number(world, type, 0), second = entity_with_number(world, type, 1);
    ecs_iterator it = ecs_iterate(world, type);
    CHECK(ecs_next(&it));
    ecs_entity_destroy(world, first);
    CHECK(ecs_entity_alive(world, first));
    ecs_iterate_end(&it);
    CHECK(!ecs_entity_alive(world, first));
    ecs_remove(world, second, type);
    CHECK(ecs_count(world, type) == 0);
    ecs_world_destroy(world);
}

TEST(iterate_end_after_the_last_component_does_nothing)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    entity_with_number(world, type, 0);
    ecs_iterator outer = ecs_iterate(world, type);
    ecs_iterator it = ecs_iterate(world, type);
    while (ecs_next(&it)) {
    }
    ecs_iterate_end(&it);
    ecs_iterate_end(&it);
    const entity e = ecs_entity_create(world);
    ecs_entity_destroy(world, e);
    CHECK(ecs_entity_alive(world, e));
    ecs_iterate_end(&outer);
    CHECK(!ecs_entity_alive(world, e));
    ecs_world_destroy(world);
}

TEST(entity_created_within_a_loop_does_not_take_a_doomed_slot)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    entity_with_number(world, type, 0);
    entity created = {0};
    for (ecs_iterator it = ecs_iterate(world, type); ecs_next(&it);) {
        ecs_entity_destroy(world, it.entity);
        created = ecs_entity_create(world);
        CHECK((created.id & 0xfffff) != (it.entity.id & 0xfffff));
    }
    CHECK(ecs_entity_alive(world, created));
    ecs_world_destroy(world);
}

// ---- Systems

typedef struct run_log {
    char text[64];
} run_log;

typedef struct letter {
    run_log *log;
    const char *text;
} letter;

static void letter_system(ecs_world *world, void *user)
{
    (void)world;
    const letter *const letter = user;
    strcat(letter->log->text, letter->text);
}

TEST(phases_run_in_order_whatever_the_registration_order)
{
    ecs_world *const world = ecs_world_create();
    run_log log = {0};
    const ecs_phase phases[] = {ECS_PHASE_RENDER, ECS_PHASE_INPUT, ECS_PHASE_EXTRACT, ECS_PHASE_UPDATE};
    letter letters[] = {{&log, "R"}, {&log, "I"}, {&log, "E"}, {&log, "U"}};
    for (size_t i = 0; i < countof(letters); i++) {
        const ecs_system_desc desc = {.name = "l", .phase = phases[i], .run = letter_system, .user = &letters[i]};
        ecs_system_register(world, &desc);
    }
    ecs_run(world);
    CHECK_STRING(log.text, "IUER");
    ecs_run(world);
    CHECK_STRING(log.text, "IUERIUER");
    ecs_world_destroy(world);
}

TEST(systems_of_a_phase_run_in_registration_order)
{
    ecs_world *const world = ecs_world_create();
    run_log log = {0};
    letter letters[] = {{&log, "c"}, {&log, "a"}, {&log, "x"}, {&log, "b"}};
    for (size_t i = 0; i < countof(letters); i++) {
        const ecs_phase phase = i == 2 ? ECS_PHASE_INPUT : ECS_PHASE_UPDATE;
        const ecs_system_desc desc = {.name = "l", .phase = phase, .run = letter_system, .user = &letters[i]};
        ecs_system_register(world, &desc);
    }
    ecs_run(world);
    CHECK_STRING(log.text, "xcab");
    ecs_world_destroy(world);
}

TEST(world_without_systems_runs)
{
    ecs_world *const world = ecs_world_create();
    ecs_run(world);
    ecs_world_destroy(world);
}

static void destroy_system(ecs_world *world, void *user)
{
    const entity e = *(const entity *)user;
    ecs_entity_destroy(world, e);
    const component_type type = ecs_component_find(world, "number");
    for (ecs_iterator it = ecs_iterate(world, type); ecs_next(&it);) {
    }
    CHECK(ecs_entity_alive(world, e) && number_of(world, e, type) == 3);
}

static void dead_system(ecs_world *world, void *user)
{
    CHECK(!ecs_entity_alive(world, *(const entity *)user));
}

TEST(entity_destroyed_by_a_system_is_gone_for_the_next)
{
    ecs_world *const world = ecs_world_create();
    entity e = entity_with_number(world, number_register(world), 3);
    ecs_system_register(world, &(ecs_system_desc){.name = "destroy", .run = destroy_system, .user = &e});
    ecs_system_register(world, &(ecs_system_desc){.name = "dead", .run = dead_system, .user = &e});
    ecs_run(world);
    CHECK(!ecs_entity_alive(world, e));
    ecs_world_destroy(world);
}

static void remove_system(ecs_world *world, void *user)
{
    const entity e = *(const entity *)user;
    const component_type type = ecs_component_find(world, "number");
    ecs_remove(world, e, type);
    CHECK(!ecs_get(world, e, type));
    ecs_add(world, e, type);
    CHECK(number_of(world, e, type) == 0);
}

TEST(components_change_at_once_within_a_system)
{
    ecs_world *const world = ecs_world_create();
    entity e = entity_with_number(world, number_register(world), 3);
    ecs_system_register(world, &(ecs_system_desc){.name = "remove", .run = remove_system, .user = &e});
    ecs_run(world);
    ecs_world_destroy(world);
}

static void registering_system(ecs_world *world, void *user)
{
    for (int i = 0; i < 20; i++) {
        const ecs_system_desc desc = {.name = "late", .phase = ECS_PHASE_RENDER, .run = letter_system, .user = user};
        ecs_system_register(world, &desc);
    }
}

TEST(systems_may_be_registered_by_a_system)
{
    ecs_world *const world = ecs_world_create();
    run_log log = {0};
    letter late = {&log, "r"};
    ecs_system_register(world, &(ecs_system_desc){.name = "register", .run = registering_system, .user = &late});
    ecs_run(world);
    CHECK_STRING(log.text, "rrrrrrrrrrrrrrrrrrrr");
    ecs_world_destroy(world);
}

static void unended_system(ecs_world *world, void *user)
{
    (void)user;
    ecs_iterate(world, number_register(world));
}

static void run_unended_loop(void)
{
    ecs_world *const world = ecs_world_create();
    ecs_system_register(world, &(ecs_system_desc){.name = "unended", .run = unended_system});
    ecs_run(world);
}

TEST(system_that_leaves_a_loop_open_asserts)
{
    CHECK(asserts(run_unended_loop));
}

// ---- Determinism

// A fixed mixture of creation, destruction, addition and removal; returns a hash of the ids and values left, in order.
static uint32_t mixture_hash(void)
{
    ecs_world *const world = ecs_world_create();
    const component_type type = number_register(world);
    entity entities[200] = {0};
    uint32_t random = 1;
    for (int step = 0; step < 20000; step++) {
        random = random * 1664525 + 1013904223;
        entity *const e = &entities[(random >> 8) % countof(entities)];
        if (!ecs_entity_alive(world, *e)) {
            *e = entity_with_number(world, type, step);
        } else if (random >> 31) {
            ecs_entity_destroy(world, *e);
        } else if (random >> 30) {
            ecs_remove(world, *e, type);
        } else {
            ((number *)ecs_add(world, *e, type))->value ^= step;
        }
    }
    uint32_t hash = 2166136261;
    for (ecs_iterator it = ecs_iterate(world, type); ecs_next(&it);) {
        hash = (hash ^ it.entity.id) * 16777619;
        hash = (hash ^ (uint32_t)((const number *)it.component)->value) * 16777619;
    }
    ecs_world_destroy(world);
    return hash;
}

TEST(same_operations_give_the_same_order_and_ids)
{
    CHECK(mixture_hash() == mixture_hash());
}

int main(void)
{
    RUN(entity_zero_is_none);
    RUN(world_destroy_accepts_null);
    RUN(entity_is_alive_from_creation_to_destruction);
    RUN(id_never_given_out_is_not_alive);
    RUN(recycled_slot_gets_a_new_generation);
    RUN(stale_id_does_not_reach_the_component_of_its_successor);
    RUN(destroying_twice_frees_the_slot_once);
    RUN(ids_of_one_slot_differ_until_the_generation_wraps);
    RUN(freed_id_is_dead_even_when_its_generation_comes_next);
    RUN(many_entities_keep_their_own_components);
    RUN(registering_a_name_twice_gives_the_same_type);
    RUN(registering_a_name_with_another_size_asserts);
    RUN(component_type_is_found_by_name);
    RUN(component_name_is_copied);
    RUN(added_component_is_zeroed_even_in_a_reused_place);
    RUN(adding_again_returns_the_present_component);
    RUN(removing_an_absent_component_does_nothing);
    RUN(removal_leaves_other_entities_components_as_they_were);
    RUN(types_are_independent_of_each_other);
    RUN(tag_without_data_is_present_or_absent);
    RUN(components_of_any_size_are_16_byte_aligned);
    RUN(adjacent_components_do_not_overlap);
    RUN(adding_to_a_dead_entity_asserts);
    RUN(fini_is_called_once_on_remove);
    RUN(fini_is_called_once_on_entity_destroy);
    RUN(fini_is_called_once_for_each_component_on_world_destroy);
    RUN(types_registered_later_are_released_first);
    RUN(fini_may_destroy_entities_in_a_chain);
    RUN(fini_on_remove_may_destroy_its_own_entity);
    RUN(fini_on_world_destroy_may_destroy_entities);
    RUN(iteration_visits_components_in_dense_order);
    RUN(iteration_over_no_components_ends_at_once);
    RUN(other_types_may_be_added_and_removed_within_a_loop);
    RUN(types_may_be_registered_within_a_loop);
    RUN(changing_a_type_within_a_loop_over_it_asserts);
    RUN(entity_destroyed_within_a_loop_lives_until_its_end);
    RUN(destruction_in_a_nested_loop_waits_for_the_outer_one);
    RUN(loops_over_the_same_type_nest);
    RUN(iterate_end_lets_destruction_and_changes_happen_again);
    RUN(iterate_end_after_the_last_component_does_nothing);
    RUN(entity_created_within_a_loop_does_not_take_a_doomed_slot);
    RUN(phases_run_in_order_whatever_the_registration_order);
    RUN(systems_of_a_phase_run_in_registration_order);
    RUN(world_without_systems_runs);
    RUN(entity_destroyed_by_a_system_is_gone_for_the_next);
    RUN(components_change_at_once_within_a_system);
    RUN(systems_may_be_registered_by_a_system);
    RUN(system_that_leaves_a_loop_open_asserts);
    RUN(same_operations_give_the_same_order_and_ids);
    return test_end();
}
