/* Model predictive control of a robot that moves, C99: no heap, no I/O, every loop bounded. At each tick the steps of the horizon are
 * linearised about the last plan, shifted by a tick, and one quadratic program gives the commands, of which the first is sent (real-time
 * iteration). An observer, an extended Kalman filter, follows state, stiffness, viscosity and an offset of the effectors from samples of
 * these, and rejects those that do not fit. As src/cfem/control/moving has it; conventions are those of cfem.h.
 *
 * Units: mm, N, s (chambers: mm^3, MPa). A robot's state is a cfem_mpc that the caller owns: 20 to 200 kB by horizon and
 * precision, static rather than on a stack. */
#ifndef CFEM_MPC_H
#define CFEM_MPC_H

#include "cfem.h"
#include "cfem_gate.h"
#include "cfem_plan.h"
#include "cfem_tick.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    double goal[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NE]; /* mm, absolute: at the ends of the next `ahead` ticks */
    int ahead;                                          /* how many are known, at least 1; the last holds on */
    double x_e[CFEM_MOTION_MOST_NE];                       /* mm, absolute: the latest sample of the effectors */
    long sampled;                                       /* the number of the tick, from 1 on, at whose end it was taken; 0: none yet;
                                                           a sample that was heard before changes nothing */
} cfem_mpc_input;

typedef struct {
    double u[CFEM_MOTION_MOST_NA];       /* the command of this tick: N (MPa), or mm (mm^3) */
    double delta_a[CFEM_MOTION_MOST_NA]; /* mm (mm^3): where the plan has the actuators at its end */
    unsigned status;                  /* as of cfem_step. CFEM_HELD: what was planned before goes on; CFEM_SOFTENED: bounds on the
                                         course or planes contradict each other, and are missed by the least sum of squares */
} cfem_mpc_output;

/* State by the commands of each block, and what is learned at the places between which it is interpolated. */
typedef struct {
    double columns[CFEM_MPC_MOST_MOVES][CFEM_MPC_MOST_NZ * CFEM_MOTION_MOST_NA];
    cfem_place before, after;
} cfem_horizon;

typedef struct {
    long sent, heard;                                         /* commands given; the tick of the last sample */
    cfem_moving state;                                        /* at that tick; without an observer: now */
    cfem_material material;                                   /* as estimated */
    double logarithm[2], offset[CFEM_MOTION_MOST_NE];            /* of stiffness and viscosity; mm of the effectors */
    double covariance[CFEM_MPC_COLUMNS][CFEM_MPC_COLUMNS];    /* (NX, NX) */
    double late[CFEM_MPC_MOST_LATE][CFEM_MOTION_MOST_NA];        /* commands given since, */
    cfem_place place[CFEM_MPC_MOST_LATE];                     /* and what is learned at their ticks */
    int known[CFEM_MPC_MOST_LATE];
    cfem_gate gate;
    double sample[CFEM_MOTION_MOST_NE], expected[CFEM_MOTION_MOST_NE]; /* the last one, and what was expected while it was that */
    int lost;                                                 /* ticks in a row without a plan */
    double last[CFEM_MOTION_MOST_NA];                         /* N or mm: the command of the tick before */
    double rest[CFEM_MOTION_MOST_NA];                            /* the first command */
    double ahead[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NA];      /* the plan, */
    double states[CFEM_MPC_MOST_TICKS + 1][CFEM_MPC_MOST_NZ]; /* and where it leads */
    /* Work. */
    cfem_plan plan;
    cfem_stage stage[CFEM_MPC_MOST_TICKS];
    double w[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NA];
    cfem_place near, first; /* first: of the last horizon's first tick */
    union {                 /* one after the other: */
        double moved[CFEM_MPC_COLUMNS][CFEM_MPC_COLUMNS]; /* the observer hears, */
        cfem_horizon horizon;                             /* the horizon is linearised, */
        cfem_plan_factors factors;                        /* its program is solved */
    } work;
    int has_first;
} cfem_mpc;

extern const unsigned long cfem_mpc_bytes; /* of a cfem_mpc */

/* The robot stands still with its actuators at delta_a (NA,), or at the start of the export where that is NULL. */
void cfem_mpc_init(cfem_mpc *mpc, const double *delta_a);

/* One tick. Returns output->status. */
unsigned cfem_mpc_step(cfem_mpc *mpc, const cfem_mpc_input *input, cfem_mpc_output *output);

/* The observer, which cfem_mpc_step calls. What it takes to be uncertain at the start; hear a sample, CFEM_OK, CFEM_REJECTED or
 * CFEM_RESTARTED; where the commands given since the last sample have led, 0, 1 where it began again for that, or -1 where there is no
 * answer. */
void cfem_observer_init(cfem_mpc *mpc);
unsigned cfem_observer_hear(cfem_mpc *mpc, const double *x_e, long sampled);
int cfem_observer_now(cfem_mpc *mpc, cfem_moving *now);
void cfem_observer_commanded(cfem_mpc *mpc, const double *u);
void cfem_observer_restart(cfem_mpc *mpc, const double *u); /* at the model's equilibrium under the command u */

#ifdef __cplusplus
}
#endif
#endif
