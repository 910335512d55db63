/* What a sample tells the observer, for cfem_observer.c. */
#ifndef CFEM_INNOVATION_H
#define CFEM_INNOVATION_H

#include "cfem_mpc.h"

/* Of a sample: rows that are measured, what each missed, the inverse of its covariance, nu^T S^-1 nu and the mean square of nu. */
typedef struct {
    double missed[CFEM_MOTION_MOST_NE], S[CFEM_MOTION_MOST_NE][CFEM_MOTION_MOST_NE], square, size;
    int row[CFEM_MOTION_MOST_NE], n;
} cfem_innovation;

/* m->moved (n, NX) becomes H P. 0, or 1 where the covariance is none: beyond what the model knows, its stiffness may be negative. */
int cfem_innovation_of(cfem_mpc *m, const double *x_e, cfem_innovation *of);

/* Whether a sample repeats the one before to the last bit although the robot should have moved. */
int cfem_frozen(cfem_mpc *m, const double *x_e, const cfem_innovation *of);

/* State, material and offsets after a sample, and their covariance; m->moved is H P. */
void cfem_correct(cfem_mpc *m, const cfem_innovation *of);

#endif
