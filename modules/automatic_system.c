// The system behind automatic settings: see automatic_system.h.
#include "automatic_system.h"
#include "modules.h"
#include "probe.h"

typedef struct automatic_state {
    automatic controller;
    bool running;
} automatic_state;

static automatic_state *state_of(const renderer *r)
{
    return ((render_pass *)ecs_get(r->world, renderer_pass_find(r, "automatic"), r->pass))->state;
}

const automatic *automatic_get(const renderer *r)
{
    const automatic_state *state = state_of(r);
    return state->running ? &state->controller : NULL;
}

static automatic_frame frame_measure(renderer *r)
{
    automatic_frame frame = {0};
    uint32_t count;
    const frame_graph_timing *timings = frame_graph_timings(r->graph, &count);
    double rest = r->milliseconds;
    for (uint32_t i = 0; i < count; i++) {
        frame.milliseconds[automatic_group_of(timings[i].name)] += timings[i].milliseconds;
        rest -= timings[i].milliseconds;
    }
    frame.milliseconds[AUTOMATIC_FIXED] += rest;
    const probe *probes = probe_results(r, &count);
    frame.probes = probe_sums(probes, count);
    return frame;
}

static void automatic_run(ecs_world *world, void *user)
{
    (void)world;
    renderer *r = user;
    automatic_state *state = state_of(r);
    const bool wanted = (r->settings.target_ms > 0 || r->settings.target_error > 0) && !automatic_refusal(&r->settings);
    if (wanted && (!state->running || !settings_equal(&state->controller.current, &r->settings))) {
        automatic_start(&state->controller, &r->settings); // or someone else changed them
    } else if (wanted &&
               !renderer_is_settled(r)) { // a settled picture leaves passes out, which says nothing of the next
        const automatic_frame frame = frame_measure(r);
        if (automatic_step(&state->controller, &frame, &r->settings))
            log_info("%s", state->controller.reason);
    }
    state->running = wanted;
}

static void automatic_setup(renderer *r, void *state)
{
    (void)r, (void)state; // it works between frames, before passes are set up
}

bool automatic_init(renderer *r)
{
    renderer_pass_add(r, "automatic", sizeof(automatic_state), automatic_setup, NULL);
    const ecs_system_desc run = {.name = "automatic", .phase = ECS_PHASE_INPUT, .run = automatic_run, .user = r};
    ecs_system_register(r->world, &run);
    return true;
}
