/* The condensed robot in motion: one step in time, in double precision, without memory of its own. cfem_motion.c is the same for every
 * robot; cfem_motion_data.c holds its numbers. Units: mm, N, s, t (chambers: mm^3, MPa). */
#ifndef CFEM_MOTION_H
#define CFEM_MOTION_H

#include "cfem_motion_data.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CFEM_MOTION_PLACES (CFEM_MOTION_TERMS ? CFEM_MOTION_TERMS : 1)

typedef struct {
    double t;                                              /* s */
    double q[CFEM_MOTION_NQ];                              /* actuators' displacements, amplitudes of the inner motions */
    double p[CFEM_MOTION_NQ];                              /* momenta */
    double v[CFEM_MOTION_NQ];                              /* mean velocity of the last step */
    double gain[CFEM_MOTION_NQ];                           /* its change in the last step, a second */
    double memory[CFEM_MOTION_PLACES][CFEM_MOTION_NQ];     /* of the Prony terms */
    double lambda_a[CFEM_MOTION_NA];                       /* the actuators' forces in the last step */
} cfem_motion;

/* Stands still at delta_a (CFEM_MOTION_NA,). */
void cfem_motion_rest(cfem_motion *motion, const double *delta_a);

/* After dt s. command (CFEM_MOTION_NA,): force during the step, or displacement at its end where held[i] is not 0. 0, or 1 where the
 * equations are not solved to 1e-8 of the motion (1e-5 in single precision): then nothing has changed; take a shorter step. */
int cfem_motion_step(cfem_motion *motion, const double *command, const int *held, double dt);

/* Derivatives by time of q, p and memory, under forces (CFEM_MOTION_NA,) of the actuators. 0, or 1 where there are none. */
int cfem_motion_rates(const cfem_motion *motion, const double *force, cfem_motion *rates);

/* effectors (CFEM_MOTION_NE,): mm from rest. */
void cfem_motion_effectors(const cfem_motion *motion, double *effectors);

#ifdef __cplusplus
}
#endif
#endif
