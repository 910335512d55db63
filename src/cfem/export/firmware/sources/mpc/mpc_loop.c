/* Predictive control in a loop: the tip follows a curve, the condensed robot in motion is the plant, its samples come a tick late and with
 * noise of 0.1 mm. Prints the distance from the goal in the last lap, of the static inverse too, and what a tick costs. `make mpc`:
 *
 *     ./mpc_loop [laps a second]
 *
 * In firmware, `move` and `sample` are your drives and your sensor. */
#if !defined(__arm__)
#define _POSIX_C_SOURCE 200112L
#endif

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cfem_motion.h"
#include "cfem_mpc.h"
#include "cfem_mpc_vectors.h"
#include "cost.h"

#define SUBSTEPS 4
#define MOST 4000 /* ticks */

static cfem_mpc mpc;
static cfem_controller inverse;
static cfem_motion plant;
static uint32_t cost[MOST];
static uint32_t seed = 1;

/* Evenly within +-1. */
static double noise(void) {
    seed = seed * 1664525u + 1013904223u;
    return (double)(seed >> 8) / 8388608.0 - 1.0;
}

static void goal_at(double laps, double *goal) {
    const double place = (laps - floor(laps)) * CFEM_MPC_CURVE, share = place - floor(place);
    const int i = (int)place % CFEM_MPC_CURVE, j = (i + 1) % CFEM_MPC_CURVE;
    for (int e = 0; e < CFEM_NE; e++) goal[e] = (1.0 - share) * cfem_mpc_curve[i][e] + share * cfem_mpc_curve[j][e];
}

/* Laps done after a number of ticks: the speed grows during the first second. */
static double laps_at(double speed, int tick) {
    const double t = tick * CFEM_MPC_DT;
    return speed * (t < 1.0 ? t * t / 2.0 : t - 0.5);
}

/* The plant during a tick in which the command moves evenly. 0, or 1 where a step is not found. */
static int move(const double *from, const double *to) {
    int held[CFEM_NA];
    for (int k = 1; k <= SUBSTEPS; k++) {
        double u[CFEM_NA];
        for (int a = 0; a < CFEM_NA; a++) {
            held[a] = !CFEM_MPC_FORCE; /* forces act with their mean during a step */
            u[a] = from[a] + (k - (CFEM_MPC_FORCE ? 0.5 : 0.0)) / SUBSTEPS * (to[a] - from[a]);
        }
        if (cfem_motion_step(&plant, u, held, CFEM_MPC_DT / SUBSTEPS)) return 1;
    }
    return 0;
}

static void sample(double *x_e) {
    cfem_motion_effectors(&plant, x_e);
    for (int e = 0; e < CFEM_NE; e++) x_e[e] += cfem_rest_e[e];
}

static int by_size(const void *a, const void *b) {
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

/* One run; predictive: or by the static inverse. 1 where the plant left what its model knows. */
static int follow(double speed, int predictive) {
    cfem_mpc_input in;
    cfem_mpc_output out;
    cfem_input asked;
    cfem_output output;
    double before[CFEM_NA], u[CFEM_NA], late[CFEM_NE], mean = 0.0, largest = 0.0;
    const int lap = (int)(1.0 / (speed * CFEM_MPC_DT)), all = (int)(1.5 / CFEM_MPC_DT) + lap, ticks = all < MOST ? all : MOST;
    int held = 0, limited = 0;
    memset(&in, 0, sizeof in), memset(&asked, 0, sizeof asked), memset(late, 0, sizeof late);
    cfem_mpc_init(&mpc, cfem_mpc_start), cfem_init(&inverse), cfem_motion_rest(&plant, cfem_mpc_start);
    memcpy(before, mpc.rest, sizeof before);
    for (int a = 0; a < CFEM_NA; a++) inverse.delta_a[a] = cfem_mpc_start[a], inverse.lambda_a[a] = plant.lambda_a[a];
    for (int k = 0; k < ticks; k++) {
        in.ahead = CFEM_MPC_TICKS;
        for (int i = 0; i < CFEM_MPC_TICKS; i++) goal_at(laps_at(speed, k + 1 + i), in.goal[i]);
        if (predictive) {
            if (CFEM_MPC_SENSED && k > 1) memcpy(in.x_e, late, sizeof in.x_e), in.sampled = k - 1;
            const uint64_t begin = now();
            const unsigned status = cfem_mpc_step(&mpc, &in, &out);
            cost[k] = (uint32_t)(now() - begin);
            held += (status & CFEM_HELD) != 0, limited += (status & CFEM_LIMITED) != 0;
            memcpy(u, out.u, sizeof u);
        } else {
            for (int e = 0; e < CFEM_NE; e++) asked.goal[e] = (cfem_real)in.goal[0][e];
            for (int i = 0; i < 6; i++) {
                for (int a = 0; a < CFEM_NA; a++) asked.delta_a[a] = (cfem_real)inverse.delta_a[a];
                cfem_step(&inverse, &asked, &output);
            }
            for (int a = 0; a < CFEM_NA; a++) u[a] = CFEM_COMMAND_FORCE ? (double)output.lambda_a[a] : (double)output.delta_a[a];
        }
        double x_e[CFEM_NE], square = 0.0;
        sample(x_e);
        for (int e = 0; e < CFEM_NE; e++) late[e] = x_e[e] + 0.17 * noise(); /* heard at the next tick */
        if (move(before, u)) {
            printf("%s: the plant left what its model knows\n", predictive ? "predictive" : "static inverse");
            return 1;
        }
        memcpy(before, u, sizeof before);
        sample(x_e);
        for (int e = 0; e < CFEM_NE; e++) square += cfem_mpc_weight[e] > 0.0 ? (x_e[e] - in.goal[0][e]) * (x_e[e] - in.goal[0][e]) : 0.0;
        if (k < ticks - lap) continue;
        mean += sqrt(square) / lap;
        if (square > largest * largest) largest = sqrt(square);
    }
    printf("%-14s %.2f laps a second: mean %.3f mm, largest %.3f mm", predictive ? "predictive" : "static inverse", speed, mean, largest);
    if (!predictive) {
        printf("\n");
        return 0;
    }
    printf(", bounds held at %d %% of the ticks, %d without a command\n", 100 * limited / ticks, held);
    qsort(cost, (size_t)ticks, sizeof *cost, by_size);
    printf("tick median %u p99 %u max %u %s, %d ticks, state %lu bytes\n", (unsigned)cost[ticks / 2], (unsigned)cost[ticks * 99 / 100],
           (unsigned)cost[ticks - 1], UNIT, ticks, cfem_mpc_bytes);
    return 0;
}

int main(int words, char **word) {
#if defined(__arm__)
    const double speed = CFEM_MPC_LAPS;
    (void)words, (void)word;
#else
    const double speed = words > 1 ? atof(word[1]) : CFEM_MPC_LAPS;
    if (!(speed > 0.0)) {
        fprintf(stderr, "./mpc_loop [laps a second], more than 0\n");
        return 2;
    }
#endif
    start();
    if (CFEM_FORM_DISPLACEMENT && CFEM_COMMAND_FORCE == CFEM_MPC_FORCE) follow(speed, 0);
    return follow(speed, 1);
}
