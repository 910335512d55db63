/* The filter of what moves, of a robot that stands still for long: its actuators walk about their middle, a thousand frames a turn. */
#include "cfem_estimate_parts.h"
#include "cfem_swing_parts.h"
#include "driver.h"

static cfem_swing filter;

void begin(void) { cfem_swing_init(&filter); }

int tick(long number, int phase) {
    cfem_frame frame;
    cfem_swing_found found;
    double x[CFEM_SWING_N] = {0.0}, y[ROWS], by[ROWS][CFEM_SWING_N];
    for (int a = 0; a < NA; a++) x[a] = cfem_estimate_middle[a] + 0.1 * sin(0.006 * (double)number + a) * cfem_swing_scale[a];
    cfem_swing_places(x, y, by);
    for (int i = 0; i < ROWS; i++) frame.place[i / 3][i % 3] = sample(cfem_estimate_rest[i / 3][i % 3] + y[i] + noise(CFEM_SWING_NOISE), phase);
    for (int a = 0; a < NA; a++) {
        frame.displacement[a] = sample(x[a] + noise(cfem_estimate_sensor), phase);
        frame.force[a] = sample(0.0, phase);
        frame.command[a] = goal(x[a], phase);
    }
    const unsigned status = cfem_swing_frame(&filter, &frame, &found);
    demand(status == found.status && found.iterations <= 200, "status or iterations");
    for (int i = 0; i < CFEM_SWING_N; i++) {
        demand(isfinite(found.x[i]) && isfinite(found.covariance[i][i]), "an estimate is not finite");
        if (!status) demand_within(1, &found.x[i], &cfem_swing_box[i][0], &cfem_swing_box[i][1], 1e-12, "unknown");
    }
    return status || fabs(found.x[0] - x[0]) > 0.05 * cfem_swing_scale[0] ? LOST : ALIVE;
}
