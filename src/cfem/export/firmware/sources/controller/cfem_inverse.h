/* The inverse step: the actuation of a linearised robot that brings its effectors nearest to an aim, and whether one can bring them nearer. */
#ifndef CFEM_INVERSE_H
#define CFEM_INVERSE_H

#include "cfem.h"

typedef struct {
    double lambda_low[CFEM_MOST_NA], lambda_high[CFEM_MOST_NA]; /* N */
    double delta_low[CFEM_MOST_NA], delta_high[CFEM_MOST_NA];   /* mm */
} cfem_limits;

/* lambda_a (CFEM_NA,), delta_a (CFEM_NA,) mm at the model m for an aim (CFEM_NE,) mm from rest, and the strongest multiplier of a force's
 * bound. CFEM_OK, or an OR of _LIMITED and _SOFTENED; CFEM_NO_QP. */
unsigned cfem_inverse_step(const cfem_condensed *m, const double *aim, const cfem_limits *l, double *lambda_a, double *delta_a,
                           double *strongest);

/* CFEM_OUT_OF_REACH where m is the nearest point to the aim, as in Python's cfem.control.search.optimality: the linearised robot comes
 * no nearer within the bounds of force and course, and what regularises this program hardly counts. CFEM_OK elsewhere. */
unsigned cfem_verdict(const cfem_condensed *m, const double *aim);

#endif
