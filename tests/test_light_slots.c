// Slots of point lights: who stays keeps its slot, whoever comes and goes.
#include "modules/light_slots.h"
#include "test.h"

enum { KEYS = 2000 };

static uint32_t slot_of(const light_slots *slots, uint32_t light)
{
    for (uint32_t i = 0; i < slots->count; i++)
        if (slots->lights[i] == light)
            return i;
    return LIGHT_SLOT_EMPTY;
}

// The keys from `first`, `count` of them, each holding itself plus 10.
static void update(light_slots *slots, uint32_t first, uint32_t count)
{
    light_slots_light lights[KEYS];
    for (uint32_t i = 0; i < count; i++)
        lights[i] = (light_slots_light){first + i, first + i + 10};
    light_slots_update(slots, lights, count);
}

TEST(lights_take_the_lowest_free_slots_and_keep_them)
{
    light_slots slots = {0};
    update(&slots, 0, 60);
    CHECK(slots.count == 64);
    for (uint32_t i = 0; i < 60; i++)
        CHECK(slots.lights[i] == i + 10);
    CHECK(slots.lights[60] == LIGHT_SLOT_EMPTY);
    update(&slots, 20, 50); // 0 to 19 went, 60 to 69 came
    for (uint32_t i = 20; i < 60; i++)
        CHECK(slots.lights[i] == i + 10);
    for (uint32_t i = 60; i < 70; i++)
        CHECK(slots.lights[i - 60] == i + 10);
    CHECK(slots.lights[10] == LIGHT_SLOT_EMPTY && slot_of(&slots, 29) == LIGHT_SLOT_EMPTY);
    light_slots_fini(&slots);
}

TEST(a_slot_follows_the_number_of_its_light)
{
    light_slots slots = {0};
    light_slots_update(&slots, (light_slots_light[]){{3, 0}, {5, 1}}, 2);
    light_slots_update(&slots, (light_slots_light[]){{3, 7}, {5, 0}}, 2);
    CHECK(slots.lights[0] == 7 && slots.lights[1] == 0);
    light_slots_fini(&slots);
}

TEST(slots_grow_at_once_and_shrink_late)
{
    light_slots slots = {0};
    update(&slots, 0, 65);
    CHECK(slots.count == 128);
    update(&slots, 0, 2000);
    CHECK(slots.count == 2048);
    update(&slots, 1500, 512);
    CHECK(slots.count == 2048 && slot_of(&slots, 1510) == 1500);
    update(&slots, 1500, 511);
    CHECK(slots.count == 512 && slot_of(&slots, 1510) == 0);
    update(&slots, 0, 0);
    CHECK(slots.count == 0);
    update(&slots, 0, 1);
    CHECK(slots.count == LIGHT_SLOTS_MIN && slots.lights[0] == 10);
    light_slots_fini(&slots);
}

int main(void)
{
    RUN(lights_take_the_lowest_free_slots_and_keep_them);
    RUN(a_slot_follows_the_number_of_its_light);
    RUN(slots_grow_at_once_and_shrink_late);
    return test_end();
}
