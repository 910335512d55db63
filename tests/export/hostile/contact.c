/* The tick that plans with contact: the goal walks, in parts of its way behind an obstacle, and good samples are where the touched model
 * stands, with 0.05 mm of noise. Bad samples are of obstacles too. Alive: there is a plan. */
#include <string.h>

#include "cfem_touch_control.h"
#include "driver.h"

static cfem_touch_controller controller;
static cfem_obstacle bodies[CFEM_TOUCH_OBSTACLES];

#if CFEM_CONTACT == 2
static const cfem_touched *robot(void) { return &controller.at.robot[0]; }
#else
static const cfem_touched *robot(void) { return &controller.at; }
#endif

void begin(void) {
    memcpy(bodies, cfem_obstacles, sizeof bodies);
    demand(!cfem_touch_control_init(&controller, bodies, CFEM_TOUCH_OBSTACLES, CFEM_TOUCH_FRICTION), "no state to begin with");
}

int tick(long number, int phase) {
    cfem_input input;
    cfem_output output;
    cfem_condensed m;
    double delta_a[CFEM_NA];
    memset(&input, 0, sizeof input);
    for (int i = 0; i < CFEM_NA; i++) {
        const double low = cfem_delta_low[i], high = cfem_delta_high[i];
        delta_a[i] = low + (high - low) * (0.4 + 0.35 * sin(0.02 * (double)number + i));
    }
    demand(!cfem_model(delta_a, &m), "no model within the reach");
    for (int e = 0; e < CFEM_NE; e++) {
        double there = cfem_rest_e[e] + m.free_e[e];
        for (int i = 0; i < CFEM_NA; i++) there += m.W_ea[e][i] * m.lambda_a[i];
        input.goal[e] = (cfem_real)goal(there, phase);
        input.x_e[e] = (cfem_real)sample(cfem_rest_e[e] + robot()->delta_e[e] + noise(0.05), phase);
    }
    input.tick = controller.controller.feedback.given;
    for (int i = 0; i < CFEM_NA; i++) input.delta_a[i] = (cfem_real)controller.controller.delta_a[i];
    for (int o = 0; o < CFEM_TOUCH_OBSTACLES; o++)
        for (int a = 0; a < 3; a++) bodies[o].t[a] = phase == SOME_BAD_SAMPLES ? sample(cfem_obstacles[o].t[a], phase) : cfem_obstacles[o].t[a];
#if CFEM_CONTACT == 2
    for (int b = 1; b < CFEM_MEET_ROBOTS; b++)
        for (int i = 0; i < CFEM_NA; i++) controller.others[b][i] = goal(0.2 * (1.0 + sin(0.01 * (double)number)) * cfem_delta_high[i], phase);
#endif
    const unsigned status = cfem_touch_control(&controller, &input, &output);
    for (int i = 0; i < CFEM_NA; i++) delta_a[i] = (double)output.delta_a[i];
    demand_within(CFEM_NA, delta_a, cfem_delta_low, cfem_delta_high, 1e-12, "displacement");
    return status & (CFEM_HELD | CFEM_NO_MODEL) ? LOST : ALIVE;
}
