/* The quadratic program of a horizon: commands x (VARIABLES,), in shares of their size, of which later ones are held for several ticks:
 *
 *     minimise    sum_k |weight (e_k - goal_k)|^2 / 2 + |smooth (u_k - u_(k-1))|^2 / 2 + |effort (u_k - rest)|^2 / 2
 *     subject to  bounds of u_k, |u_k - u_(k-1)| <= rate, bounds of the course, normal . e_k >= level of each plane
 *
 * e_k = e + E x and the course are affine in x. Method: the dual active set of Goldfarb and Idnani (Mathematical Programming 27, 1983),
 * which begins at the optimum without bounds, in the coordinates y = L^T x of the Cholesky factor of H = L L^T. Of the active normals
 * N the Cholesky factor of their Gram matrix N N^T + D is kept up to date. D is 0, or what a bound on the robot's motion costs that is
 * missed: first these are kept; where they contradict each other, they are missed by the least sum of squares. */
#ifndef CFEM_PLAN_H
#define CFEM_PLAN_H

#include "cfem_mpc_room.h"

#define CFEM_PLAN_SOFT (CFEM_MPC_MOST_TICKS * (CFEM_MOTION_MOST_NA + CFEM_MPC_MOST_PLANES))
#define CFEM_PLAN_ACTIVE (CFEM_MPC_MOST_VARIABLES + CFEM_PLAN_SOFT)
#define CFEM_PLAN_TOLERANCE 1e-9 /* of the optimality conditions */

enum {
    CFEM_PLAN_OPTIMAL = 0,
    CFEM_PLAN_INFEASIBLE = 1, /* bounds of commands and rates exclude each other */
    CFEM_PLAN_FLAT = 2,       /* H is not positive definite, or numbers are not finite */
    CFEM_PLAN_INACCURATE = 3, /* the answer misses the optimality conditions */
    CFEM_PLAN_STEPS = 4       /* too many changes of the active set */
};

typedef struct {
    /* Given. */
    double told[CFEM_MOTION_MOST_NA]; /* the command before */
    double rest[CFEM_MOTION_MOST_NA]; /* what effort is counted from */
    double e[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NE], goal[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NE]; /* mm from rest */
    double course[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NA];
    double E[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NE][CFEM_MPC_MOST_VARIABLES];
    double by_course[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NA][CFEM_MPC_MOST_VARIABLES];
    /* Found. */
    double x[CFEM_MPC_MOST_VARIABLES], kkt; /* kkt: largest residual of the optimality conditions, relative */
    int changes, count, softened;           /* of the active set; constraints that hold; whether bounds are missed */
    /* Work. */
    double L[CFEM_MPC_MOST_VARIABLES][CFEM_MPC_MOST_VARIABLES], best[CFEM_MPC_MOST_VARIABLES], ahead[CFEM_MPC_MOST_VARIABLES];
    double N[CFEM_PLAN_ACTIVE][CFEM_MPC_MOST_VARIABLES];             /* active normals, L^-1 of their rows, signed */
    double G[(CFEM_PLAN_ACTIVE + 1) * (CFEM_PLAN_ACTIVE + 4) / 2];   /* rows of the factor, each with room for one more */
    double force[CFEM_PLAN_ACTIVE], sign[CFEM_PLAN_ACTIVE], price;   /* multipliers >= 0; +1: at the low bound; D of what is soft */
    int which[CFEM_PLAN_ACTIVE], known[CFEM_MPC_MOST_TICKS]; /* known: variables that the effectors and the course of a tick know */
    unsigned char state[CFEM_MPC_MOST_VARIABLES * 2 + CFEM_PLAN_SOFT]; /* of each constraint: 1: active, 2: meets another, to rounding */
} cfem_plan;

/* One of the above. */
int cfem_plan_solve(cfem_plan *plan);

#endif
