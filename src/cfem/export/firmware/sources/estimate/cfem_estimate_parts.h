/* What the files of the estimator share. The filter of what moves takes it with its own unknowns: cfem_swing_fit.h. */
#ifndef CFEM_ESTIMATE_PARTS_H
#define CFEM_ESTIMATE_PARTS_H

#include "cfem_estimate.h"

#define NA CFEM_ESTIMATE_NA
#define NW CFEM_ESTIMATE_NW
#ifndef N
#define N CFEM_ESTIMATE_N
#define STARTS CFEM_ESTIMATE_STARTS
#endif
#define NE CFEM_ESTIMATE_NE
#define M CFEM_ESTIMATE_MARKERS
#define ROWS (3 * M)

/* y (ROWS,): where the markers are, from rest; by (ROWS, N). */
void cfem_estimate_places(const double *x, double y[ROWS], double by[ROWS][N]);

#ifndef cfem_estimate_tensions
/* y (NA,): forces of the actuators; by (NA, N). */
void cfem_estimate_tensions(const double *x, double y[NA], double by[NA][N]);
#endif
/* effector (NE,): mm from rest. */
void cfem_estimate_effectors_at(const double x[N], double effector[NE]);

#define known(value) isfinite(value)

/* What is measured, with noise mm of each coordinate, and what is known before: root (x - mean) has standard deviation 1. */
typedef struct {
    const cfem_frame *frame;
    double where[M][3], noise, mean[N], root[N][N];
    int there[M], rows, numbers, forces;
} cfem_estimate_problem;

/* normal, gradient: J^T J and J^T r of all that counts, by the unknowns over their scale. size (M,): standard deviations of a coordinate
 * by which a marker misses; r, J: of the markers. */
typedef struct {
    double x[N], normal[N][N], gradient[N], cost, size[M], r[M][3], J[M][3][N];
    double force[NA], by_x[NA][N];
} cfem_estimate_evaluated;

/* Which markers a frame has, and where they are, from rest: `there` and `where`. */
void cfem_estimate_see(const cfem_frame *frame, cfem_estimate_problem *asked);

/* Bits of the markers that are there and not kept, and the root mean square of `size` of those kept. */
uint32_t cfem_estimate_left_out(const cfem_estimate_problem *asked, const cfem_estimate_evaluated *here, const int *kept, double *noise);

/* How many of the markers (M,) are kept. */
int cfem_estimate_count(const int *kept);

/* From x: the status; kept: markers that fit. */
unsigned cfem_estimate_minimise(const cfem_estimate_problem *asked, const double *first, cfem_estimate_evaluated *here, int *kept, int *iterations);

#endif
