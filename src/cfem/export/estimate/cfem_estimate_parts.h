/* What the two files of the estimator share. */
#ifndef CFEM_ESTIMATE_PARTS_H
#define CFEM_ESTIMATE_PARTS_H

#include "cfem_estimate.h"

#define NA CFEM_ESTIMATE_NA
#define NZ CFEM_ESTIMATE_NZ /* coordinates of the series */
#define NW CFEM_ESTIMATE_NW
#define N CFEM_ESTIMATE_N
#define NE CFEM_ESTIMATE_NE
#define M CFEM_ESTIMATE_MARKERS
#define ROWS (3 * M)

/* y (ROWS,): where the markers are, from rest; by (ROWS, N). */
void cfem_estimate_places(const double *x, double y[ROWS], double by[ROWS][N]);

/* y (NA,): forces of the actuators; by (NA, N). */
void cfem_estimate_tensions(const double *x, double y[NA], double by[NA][N]);

/* effector (NE,): mm from rest. */
void cfem_estimate_effectors_at(const double x[N], double effector[NE]);

#endif
