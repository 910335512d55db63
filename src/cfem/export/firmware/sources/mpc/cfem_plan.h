/* The quadratic program of a horizon: commands x (VARIABLES,), in shares of their size, of which later ones are held for several ticks:
 *
 *     minimise    sum_k |weight (e_k - goal_k)|^2 / 2 + |smooth (u_k - u_(k-1))|^2 / 2 + |effort (u_k - rest)|^2 / 2
 *     subject to  bounds of u_k, |u_k - u_(k-1)| <= rate, bounds of the course, normal . e_k >= level of each plane
 *
 * e_k = e + E x and the course are affine in x. Method: the active set of cfem_active.h, in the coordinates y = L^T (x - best) of the Cholesky
 * factor of H = L L^T, best: the optimum without bounds. First all bounds are kept; where those on the robot's motion contradict each other,
 * these are missed by the least sum of squares. */
#ifndef CFEM_PLAN_H
#define CFEM_PLAN_H

#include "cfem_active.h"
#include "cfem_mpc_room.h"

#define CFEM_PLAN_SOFT (CFEM_MPC_MOST_TICKS * (CFEM_MOTION_MOST_NA + CFEM_MPC_MOST_PLANES))
#define CFEM_PLAN_ACTIVE (CFEM_MPC_MOST_VARIABLES + CFEM_PLAN_SOFT)
#define CFEM_PLAN_CONSTRAINTS (2 * CFEM_MPC_MOST_VARIABLES + CFEM_PLAN_SOFT)

typedef struct {
    /* Given. */
    double previous[CFEM_MOTION_MOST_NA]; /* the command before */
    double rest[CFEM_MOTION_MOST_NA]; /* what effort is counted from */
    double e[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NE], goal[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NE]; /* mm from rest */
    double course[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NA];
    double E[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NE][CFEM_MPC_MOST_VARIABLES];
    double by_course[CFEM_MPC_MOST_TICKS][CFEM_MOTION_MOST_NA][CFEM_MPC_MOST_VARIABLES];
    /* Found. */
    double x[CFEM_MPC_MOST_VARIABLES], kkt; /* kkt: largest residual of the optimality conditions, relative */
    int count, softened;                    /* constraints that hold; whether bounds are missed */
    /* Work. */
    double L[CFEM_MPC_MOST_VARIABLES][CFEM_MPC_MOST_VARIABLES], best[CFEM_MPC_MOST_VARIABLES];
    double price;                        /* of what is soft */
    int known[CFEM_MPC_MOST_TICKS];      /* variables that the effectors and the course of a tick know */
    unsigned char state[CFEM_PLAN_CONSTRAINTS];
    int which[CFEM_PLAN_ACTIVE];
    double sign[CFEM_PLAN_ACTIVE], bound[CFEM_PLAN_ACTIVE], force[2 * CFEM_PLAN_ACTIVE];
} cfem_plan;

/* Factors of the active constraints, needed while the program is solved. */
typedef struct {
    double Q[(CFEM_PLAN_ACTIVE + 2) * CFEM_MPC_MOST_VARIABLES], R[CFEM_ACTIVE_R(CFEM_PLAN_ACTIVE)];
} cfem_plan_factors;

/* The status: of cfem_active.h. */
int cfem_plan_solve(cfem_plan *plan, cfem_plan_factors *factors);

#endif
