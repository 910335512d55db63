/* What is learned of mass, viscosity and inner motions, at a place. */
#ifndef CFEM_INERTIA_H
#define CFEM_INERTIA_H

#include "cfem_series.h"

/* Symmetric matrices (NQ, NQ) as their upper triangles, row by row. */
typedef struct {
    double M[CFEM_MOTION_TRIANGLE], dM[CFEM_MOTION_MOST_NA][CFEM_MOTION_TRIANGLE]; /* mass, and its derivatives by delta_a */
    double F[CFEM_MOTION_MOST_LOSSES][CFEM_MOTION_TRIANGLE];                       /* of each viscous material */
} cfem_inertia;

/* Where the effectors are: e(delta_a) + H eta + E[eta, eta] / 2. */
typedef struct {
    double H[CFEM_MOTION_INNER];                     /* (NE, NR) effectors by the inner motions */
    double dH[CFEM_MOTION_MOST_NA][CFEM_MOTION_INNER]; /* by delta_a */
    double E[CFEM_MOTION_CURVE];                     /* (NE, NR (NR + 1) / 2): upper triangles; 0 where it is not known */
} cfem_inner;

/* Mass times warp^2, viscosity times warp; dM where `slopes` are asked. */
void cfem_inertia_at(const double *delta_a, int slopes, double warp, cfem_inertia *found);

/* dH where `slopes` are asked. */
void cfem_inner_at(const double *delta_a, int slopes, cfem_inner *found);

/* (1 - share) a + share b, but for slopes. */
void cfem_inertia_between(const cfem_inertia *a, const cfem_inertia *b, double share, cfem_inertia *found);
void cfem_inner_between(const cfem_inner *a, const cfem_inner *b, double share, cfem_inner *found);

/* full (NQ, NQ) of a triangle, and zeros beside it. */
void cfem_unpack(const double *triangle, double full[CFEM_MOTION_MOST_NQ][CFEM_MOTION_ACROSS]);

/* out (NQ,) += factor S x, S symmetric as its upper triangle. */
void cfem_add_symmetric(double factor, const double *S, const double *x, double *out);

/* The effectors' slopes by inner motions eta (NR,): curve (NE, NR) = E eta. */
void cfem_curve_of(const cfem_inner *near, const double *eta, double curve[CFEM_MOTION_MOST_NE][CFEM_MOTION_MOST_NR]);

#endif
