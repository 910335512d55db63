/* A tick of the condensed robot in motion, linearised: as src/cfem/motion/linear.py and src/cfem/motion/clocked.py have it. */
#ifndef CFEM_TICK_H
#define CFEM_TICK_H

#include "cfem_inertia.h"
#include "cfem_mpc_room.h"

/* Where the robot is: q, p and the memory of Prony terms; mean velocity of the last tick; the command that has been reached. */
typedef struct {
    double z[CFEM_MPC_MOST_NZ], v[CFEM_MOTION_MOST_NQ], u[CFEM_MOTION_MOST_NA];
} cfem_moving;

/* What is learned at a place, its inertia warped so that steps of a tick have the lowest natural frequency right. */
typedef struct {
    cfem_inertia inertia;
    cfem_inner inner;
} cfem_place;

/* z' = end + A (z - guess) + B (w - guess), w what acts during the tick: A and B are not formed. Forces of held actuators: lambda_a =
 * lambda + slopes, where displacements are commanded. */
typedef struct {
    double end[CFEM_MPC_MOST_NZ], lambda[CFEM_MOTION_MOST_NA];
    double middle[CFEM_MOTION_MOST_NA]; /* of the actuators */
    double M[CFEM_MOTION_MOST_NQ][CFEM_MOTION_MOST_NQ];
    double turning[CFEM_MOTION_MOST_NQ][CFEM_MOTION_MOST_NA]; /* of M v at constant v, by delta_a */
    double stiff[CFEM_MOTION_MOST_NA][CFEM_MOTION_MOST_NA];   /* of the actuators' equations by delta_a, beside `turning` */
    double held[CFEM_MOTION_MOST_NQ][CFEM_MOTION_MOST_NA];    /* of the equations by v of the actuators, where these are held, */
    double holding[CFEM_MOTION_MOST_NA][CFEM_MOTION_MOST_NQ]; /* and of theirs by v */
    double factor[CFEM_MOTION_MOST_NQ][CFEM_MOTION_MOST_NQ];  /* of the part by v that is not held: L U, with row pivots */
    int pivots[CFEM_MOTION_MOST_NQ];
    double inner;                                       /* dt/2 stiffness of the inner motions */
    double F[CFEM_MOTION_MOST_LOSSES][CFEM_MOTION_MOST_KEPT]; /* dt/2 times the material's, where Prony terms need it */
    double of_material[CFEM_MOTION_MOST_NQ][2];            /* of the equations by the logarithms of stiffness and viscosity */
} cfem_stage;

/* Shares of the modulus and of the viscosity that the model was learned from. */
typedef struct {
    double stiffness, viscosity;
} cfem_material;

void cfem_place_at(const double *delta_a, int slopes, cfem_place *found);

/* (1 - share) a + share b, but for slopes. */
void cfem_place_between(const cfem_place *a, const cfem_place *b, double share, cfem_place *found);

/* The tick from z at mean velocity v under w (force, or displacement at its end), with the inertia given, whose slopes are those of
 * `first`. 0, or 1 where its equations are singular or not finite. */
int cfem_stage_at(const double *z, const double *v, const double *w, const cfem_inertia *inertia, const cfem_inertia *first,
                  const cfem_material *material, cfem_stage *stage);

/* out (NZ,) = A z + B w, and where displacements are commanded lambda (NA,), unless it is NULL; w may be NULL. */
void cfem_stage_of_one(const cfem_stage *stage, const double *z, const double *w, double *out, double *lambda);

/* The same of NA columns in rows that begin `stride` numbers after each other; w is `share` times the identity; z may be NULL. */
void cfem_stage_of_block(const cfem_stage *stage, int stride, const double *z, double share, double *out, double *lambda);

/* (NZ, 2): the state by the logarithms of stiffness and viscosity. */
void cfem_stage_by_material(const cfem_stage *stage, double out[CFEM_MPC_MOST_NZ][2]);

/* The state after a tick in which the command moves to u, in place, and its last linearisation. What is learned as given where *known, else that
 * where the last velocity leads to, which is known then. 0, or 1 as above. */
int cfem_tick(cfem_moving *state, const double *u, const cfem_material *material, cfem_place *place, int *known, cfem_stage *stage);

/* What acts during a tick between two commands. */
void cfem_acting(const double *before, const double *u, double *w);

/* e (NE,) mm from rest at the state z, and C (NE, NQ), its slopes by q, with the inner motions as given; those of H as of `first`, those of
 * E left out. */
void cfem_tips(const double *z, const cfem_inner *near, const cfem_inner *first, double *e, double C[CFEM_MOTION_MOST_NE][CFEM_MOTION_MOST_NQ]);

#endif
