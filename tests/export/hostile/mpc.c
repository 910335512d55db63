/* The predictive controller: the robot stands beside its place of rest, and good samples say so with 0.05 mm of noise. */
#include "cfem_mpc.h"
#include "driver.h"

static cfem_mpc controller;
static cfem_mpc_input input;

void begin(void) { cfem_mpc_init(&controller, 0); }

static double stands(int e) { return cfem_rest_e[e] + (e == 1 ? -1.0 : 1.0); }

int tick(long number, int phase) {
    cfem_mpc_output output;
    input.ahead = phase == BAD_GOALS && uniform() < 0.1 ? (int)(100.0 * uniform()) - 50 : CFEM_MPC_TICKS;
    for (int i = 0; i < CFEM_MPC_TICKS; i++)
        for (int e = 0; e < CFEM_MOTION_NE; e++)
            input.goal[i][e] = goal(stands(e) + (e == 1 ? -1.0 : 1.0) * sin(0.05 * (double)(number + i)), phase);
    for (int e = 0; e < CFEM_MOTION_NE; e++) input.x_e[e] = sample(stands(e) + noise(0.05), phase);
    input.sampled = controller.sent;
    if (phase == SOME_BAD_SAMPLES && uniform() < 0.2) input.sampled -= (long)(10.0 * uniform());
    if (phase == BAD_GOALS && uniform() < 0.05) input.sampled += 5;
    if (input.sampled < 0 && phase != BAD_GOALS) input.sampled = 0;
    const unsigned status = cfem_mpc_step(&controller, &input, &output);
    for (int a = 0; a < CFEM_MOTION_NA; a++)
        demand_within(1, &output.u[a], &cfem_mpc_command[a][0], &cfem_mpc_command[a][1], 0.0, "command");
    return status & CFEM_HELD ? LOST : ALIVE;
}
