/* What is learned of mass, viscosity and inner motions, at a place. */
#ifndef CFEM_INERTIA_H
#define CFEM_INERTIA_H

#include "cfem_mpc_room.h"

/* Symmetric matrices (NQ, NQ) as their upper triangles, row by row. */
typedef struct {
    double M[CFEM_MPC_TRIANGLE], dM[CFEM_MPC_MOST_NA][CFEM_MPC_TRIANGLE]; /* mass, and its derivatives by delta_a */
    double F[CFEM_MPC_MOST_LOSSES][CFEM_MPC_TRIANGLE];                    /* of each viscous material */
    double H[CFEM_MPC_MOST_NE * CFEM_MPC_MOST_NR];                        /* (NE, NR) effectors by the inner motions */
    double dH[CFEM_MPC_MOST_NA][CFEM_MPC_MOST_NE * CFEM_MPC_MOST_NR];     /* by delta_a */
} cfem_inertia;

/* Mass and viscosity scaled so that steps of a tick have the lowest natural frequency right; dM and dH where `slopes` are asked. */
void cfem_inertia_at(const double *delta_a, int slopes, cfem_inertia *found);

/* (1 - share) a + share b, but for dM and dH. */
void cfem_inertia_between(const cfem_inertia *a, const cfem_inertia *b, double share, cfem_inertia *found);

#endif
