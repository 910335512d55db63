/* One robot among obstacles. */
#include "cfem_rounds.h"

#if !CFEM_TOUCH_SOFT
#include <string.h>

/* The step held, or with slack actuators. */
static unsigned step(unsigned (*run)(cfem_rounds *, const double *), const double *delta_a, const cfem_obstacle *obstacles, int count, double mu,
                     const cfem_touched *before, cfem_touched *now, cfem_touch_room *room) {
    cfem_placed here = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0}, 0, {0}};
    cfem_rounds at = {.placed = &here, .obstacles = obstacles, .obstacle_count = count, .mu = mu, .before = before, .now = now, .room = room,
                      .systems = CFEM_TOUCH_SYSTEMS};
    memcpy(here.unilateral, cfem_patch_unilateral, sizeof here.unilateral);
    now->status = run(&at, delta_a), now->iterations = at.iterations, now->systems = CFEM_TOUCH_SYSTEMS - at.systems;
    now->unsettled |= now->iterations > CFEM_TOUCH_SETTLED;
    return now->status;
}

unsigned cfem_touch(const double delta_a[CFEM_NA], const cfem_obstacle *obstacles, int count, double mu,
                    const cfem_touched *before, cfem_touched *now, cfem_touch_room *room) {
    return step(cfem_rounds_run, delta_a, obstacles, count, mu, before, now, room);
}

unsigned cfem_touch_slack(const double delta_a[CFEM_NA], const cfem_obstacle *obstacles, int count, double mu,
                          const cfem_touched *before, cfem_touched *now, cfem_touch_room *room) {
    return step(cfem_rounds_slack, delta_a, obstacles, count, mu, before, now, room);
}

double cfem_touch_pressed(const cfem_touched *state, int number) {
    double sum = 0.0;
    for (int i = 0; i < state->count; i++)
        if (state->obstacle[i] == number) sum += cfem_dot(3, state->force[i], state->normal[i]);
    return sum;
}
#else
typedef int cfem_touch_is_not_there; /* ISO C wants a declaration: see cfem_meet.c */
#endif
