/* Drives the predictive controller with good, bad and mixed inputs in turns of 500 ticks, for the sanitisers:
 *     hostile_mpc TICKS
 * The robot stands beside its place of rest, and good samples say so with 0.05 mm of noise. Exit 1: a command left its bounds. Prints
 * the ticks, those whose command was held, and the largest number of held ones in a row among good ticks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cfem_mpc.h"

enum { GOOD, BAD_SAMPLES, SOME_BAD_SAMPLES, BAD_GOALS, PHASES, TURN = 500 };

static unsigned long long random_state = 88172645463325252ull;

static double uniform(void) { /* xorshift */
    random_state ^= random_state << 13, random_state ^= random_state >> 7, random_state ^= random_state << 17;
    return (double)(random_state >> 11) / 9007199254740992.0;
}

static double garbage(void) {
    static const double extremes[] = {NAN, NAN, INFINITY, -INFINITY, 1e300, -1e308};
    const double draw = uniform();
    if (draw < 0.3) return extremes[(int)(20 * draw)];
    return (uniform() - 0.5) * pow(10.0, 9.0 * uniform());
}

static void fill(cfem_mpc_input *input, const cfem_mpc *controller, long tick, int phase) {
    input->ahead = phase == BAD_GOALS && uniform() < 0.1 ? (int)(100 * uniform()) - 50 : CFEM_MPC_TICKS;
    for (int i = 0; i < CFEM_MPC_TICKS; i++)
        for (int e = 0; e < CFEM_MOTION_NE; e++) {
            input->goal[i][e] = cfem_rest_e[e] + (e == 1 ? -1.0 : 1.0) * (1.0 + sin(0.05 * (double)(tick + i)));
            if (phase == BAD_GOALS && uniform() < 0.3) input->goal[i][e] = garbage();
        }
    for (int e = 0; e < CFEM_MOTION_NE; e++) {
        input->x_e[e] = cfem_rest_e[e] + (e == 1 ? -1.0 : 1.0) + 0.1 * (uniform() - 0.5);
        if (phase == BAD_SAMPLES || (phase == SOME_BAD_SAMPLES && uniform() < 0.3)) input->x_e[e] = garbage();
    }
    input->sampled = controller->sent;
    if (phase == SOME_BAD_SAMPLES && uniform() < 0.2) input->sampled -= (long)(10.0 * uniform());
    if (phase == BAD_GOALS && uniform() < 0.05) input->sampled += 5;
    if (input->sampled < 0 && phase != BAD_GOALS) input->sampled = 0;
}

int main(int count, char **words) {
    static cfem_mpc controller;
    const long ticks = count > 1 ? atol(words[1]) : 0;
    cfem_mpc_input input;
    cfem_mpc_output output;
    long held = 0, longest = 0, run = 0;
    memset(&input, 0, sizeof input);
    cfem_mpc_init(&controller, 0);
    for (long tick = 0; tick < ticks; tick++) {
        const int phase = (int)(tick / TURN % PHASES);
        fill(&input, &controller, tick, phase);
        const unsigned status = cfem_mpc_step(&controller, &input, &output);
        for (int a = 0; a < CFEM_MOTION_NA; a++)
            if (!(output.u[a] >= cfem_mpc_command[a][0] && output.u[a] <= cfem_mpc_command[a][1])) {
                printf("out of bounds at tick %ld: %g\n", tick, output.u[a]);
                return 1;
            }
        held += (status & CFEM_HELD) != 0;
        run = phase == GOOD && (status & CFEM_HELD) ? run + 1 : 0;
        if (run > longest) longest = run;
    }
    printf("%ld %ld %ld\n", ticks, held, longest);
    return 0;
}
