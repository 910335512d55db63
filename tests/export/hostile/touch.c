/* Steps of contact: the actuators walk within the reach before the obstacles of the export, with the cable going slack at every other step.
 * After a step without a state the next one begins with the free robot. Alive: there is a state. */
#include "cfem_touch.h"
#include "driver.h"

static cfem_touched states[2];
static cfem_touch_room room;
static const cfem_touched *before;
static cfem_obstacle bodies[CFEM_TOUCH_OBSTACLES];

void begin(void) { before = 0; }

int tick(long number, int phase) {
    double delta_a[CFEM_NA];
    cfem_touched *const now = before == &states[0] ? &states[1] : &states[0];
    for (int i = 0; i < CFEM_NA; i++) {
        const double low = cfem_delta_low[i], high = cfem_delta_high[i];
        delta_a[i] = goal(low + (high - low) * (0.5 + 0.4 * sin(0.02 * (double)number + i)), phase);
    }
    for (int o = 0; o < CFEM_TOUCH_OBSTACLES; o++) {
        bodies[o] = cfem_obstacles[o];
        for (int a = 0; a < 3; a++) bodies[o].t[a] = sample(bodies[o].t[a], phase);
        for (int k = 0; k < 9 && phase != GOOD && uniform() < 0.1; k++) bodies[o].R[k / 3][k % 3] = sample(bodies[o].R[k / 3][k % 3], phase);
    }
    const double mu = uniform() < 0.02 ? sample(CFEM_TOUCH_FRICTION, phase) : CFEM_TOUCH_FRICTION; /* no sensor says it */
    const unsigned status = (number % 2 ? cfem_touch_slack : cfem_touch)(delta_a, bodies, CFEM_TOUCH_OBSTACLES, mu, before, now, &room);
    demand(now->systems >= 0 && now->systems <= CFEM_TOUCH_SYSTEMS, "systems");
    demand(status == now->status && now->iterations <= 60 && now->count >= 0 && now->count <= CFEM_TOUCH_MOST, "status, iterations or count");
    before = status ? 0 : now;
    if (status) return LOST;
    for (int i = 0; i < now->count; i++) {
        double pushes = 0.0, square = 0.0;
        for (int a = 0; a < 3; a++) pushes += now->force[i][a] * now->normal[i][a], square += now->force[i][a] * now->force[i][a];
        demand(isfinite(square) && pushes >= -1e-9 * (1.0 + pushes), "a contact pulls");
        if (phase == GOOD) demand(square <= (1.0 + mu * mu) * pushes * pushes * (1.0 + 1e-6) + 1e-15, "friction is beyond its limit");
        if (phase == GOOD) demand(now->gap[i] >= -1e-5 * CFEM_PATCH_LENGTH, "a patch is within an obstacle");
    }
    return ALIVE;
}
