/* Where a robot is that moves, how it moves and who pushes it, from markers on its skin: an iterated extended Kalman filter on the
 * condensed dynamics, src/cfem/motion/estimation/marker_filter.py in C, in double precision, without heap, in a bounded number of steps.
 * cfem_swing.c is the same for every robot; cfem_swing_data.c holds its numbers. Units: mm, N, s (chambers: mm^3, MPa). A number that is
 * not finite was not measured; load cells are not read. Frames come CFEM_SWING_RATE times a second; of one that was lost, give a frame
 * in which nothing is seen. */
#ifndef CFEM_SWING_H
#define CFEM_SWING_H

#include "cfem_estimate.h"
#include "cfem_swing_data.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Beside those of cfem_estimate.h: forces are commanded, and nobody said which. */
#define CFEM_SWING_NO_COMMAND 16u

/* Unknowns that markers tell: displacements of the actuators, inner motions, loads, the logarithm of the stiffness over the model's. */
typedef struct {
    double x[CFEM_SWING_N];
    double covariance[CFEM_SWING_N][CFEM_SWING_N];
    double effector[CFEM_ESTIMATE_NE]; /* from rest */
    double noise;                      /* of the markers that fit, relative to the stated one and the sag of arcs */
    uint32_t left_out;                 /* bit m: marker m does not fit */
    uint32_t unseen;                   /* bit i: the measurements do not tell unknown i */
    unsigned status;                   /* where it is not 0, the rest is what was expected before the frame */
    int iterations;
} cfem_swing_found;

typedef struct {
    double z[CFEM_SWING_NZ], v[CFEM_MOTION_NQ], u[CFEM_ESTIMATE_NA]; /* q, momenta, memory; velocity; command that has been reached */
    double load[CFEM_SWING_LOADS], stiffness;                        /* N; the logarithm */
    double covariance[CFEM_SWING_NX][CFEM_SWING_NX];                 /* of z, load and stiffness */
    double by_slip[CFEM_SWING_NZ][CFEM_ESTIMATE_NA]; /* what the last command would have done, had it been another */
    cfem_gate gate;
    int known;
} cfem_swing;

void cfem_swing_init(cfem_swing *filter);

/* A frame, one period behind the last. Its command, of displacements or forces as exported, is reached now, evenly from the one before;
 * where it is not finite, the one before goes on. Returns the status. After
 * CFEM_ESTIMATE_GATE_SAMPLES frames that were rejected or have no estimate everything is forgotten. */
unsigned cfem_swing_frame(cfem_swing *filter, const cfem_frame *frame, cfem_swing_found *found);

/* Modes of the surface at x: its nodes are at rest + modes . cfem_skin_modes (cfem_skin.h). */
void cfem_swing_modes(const double x[CFEM_SWING_N], double modes[CFEM_ESTIMATE_ROWS]);

#ifdef __cplusplus
}
#endif
#endif
