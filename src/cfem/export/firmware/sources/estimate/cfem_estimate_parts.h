/* What the files of the estimator share. */
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

#define known(value) isfinite(value)

/* What is measured, and what is known before: root (x - mean) has standard deviation 1. */
typedef struct {
    const cfem_frame *frame;
    double where[M][3], mean[N], root[N][N];
    int there[M], rows, numbers, forces;
} cfem_estimate_problem;

/* normal, gradient: J^T J and J^T r of all that counts, by the unknowns over their scale. size (M,): standard deviations of a coordinate
 * by which a marker misses; r, J: of the markers. */
typedef struct {
    double x[N], normal[N][N], gradient[N], cost, size[M], r[M][3], J[M][3][N];
    double force[NA], by_x[NA][N];
} cfem_estimate_evaluated;

/* How many of the markers (M,) are kept. */
int cfem_estimate_count(const int *kept);

/* From x: the status; kept: markers that fit. */
unsigned cfem_estimate_minimise(const cfem_estimate_problem *asked, const double *first, cfem_estimate_evaluated *here, int *kept, int *iterations);

#endif

