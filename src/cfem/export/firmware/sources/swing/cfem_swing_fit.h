/* The least-squares problem of one frame, cfem_estimate_fit.c, of the filter's unknowns. For the files of the filter alone. */
#ifndef CFEM_SWING_FIT_H
#define CFEM_SWING_FIT_H

#include "cfem_swing.h"

#define CFEM_ESTIMATE_PARTS_H
#define NA CFEM_ESTIMATE_NA
#define NW CFEM_ESTIMATE_NW
#define N CFEM_SWING_N
#define NE CFEM_ESTIMATE_NE
#define M CFEM_ESTIMATE_MARKERS
#define ROWS (3 * M)
#define known(value) isfinite(value)

#undef CFEM_ESTIMATE_STARTS
#define CFEM_ESTIMATE_STARTS 0 /* what was known before is near */
#undef cfem_estimate_noise
#define cfem_estimate_noise (asked->noise)
#define cfem_estimate_scale cfem_swing_scale
#define cfem_estimate_box cfem_swing_box
#define cfem_estimate_places cfem_swing_places
#define cfem_estimate_tensions(x, force, by_x) ((void)(force), (void)(by_x))
#define cfem_estimate_count cfem_swing_count
#define cfem_estimate_minimise cfem_swing_minimise

typedef struct {
    const cfem_frame *frame;
    double where[M][3], mean[N], root[N][N], noise;
    int there[M], rows, numbers, forces;
} cfem_estimate_problem;

typedef struct {
    double x[N], normal[N][N], gradient[N], cost, size[M], r[M][3], J[M][3][N];
    double force[NA], by_x[NA][N];
} cfem_estimate_evaluated;

/* As in cfem_estimate_parts.h. */
void cfem_estimate_places(const double *x, double y[ROWS], double by[ROWS][N]);
int cfem_estimate_count(const int *kept);
unsigned cfem_estimate_minimise(const cfem_estimate_problem *asked, const double *first, cfem_estimate_evaluated *here, int *kept, int *iterations);

#endif
