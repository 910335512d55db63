/* The quadratic program of a horizon as its solver sees it (cfem_plan.h): rows of constraints, slopes, and the factor of its Hessian. */
#ifndef CFEM_PROGRAM_H
#define CFEM_PROGRAM_H

#include "cfem_plan.h"

#define CFEM_PROGRAM_SOFT (2 * CFEM_MPC_VARIABLES) /* the first constraint on what the robot does: before are the box and the rates */
#define CFEM_PROGRAM_COUNT (CFEM_PROGRAM_SOFT + CFEM_MPC_TICKS * (CFEM_MOTION_NA + CFEM_MPC_PLANES))

/* The unit of constraint i. */
double cfem_program_size(int i);

/* Constraint i: its row is zero outside of [*begin, end), and there written to `row`, which may be NULL. Returns end; its bounds. */
int cfem_program_row(const cfem_plan *plan, int i, double *row, int *begin, double *low, double *high);

/* Its row times x. */
double cfem_program_at(const cfem_plan *plan, int i, const double *x);

/* v := L^-1 v, whose first `begin` entries are zero; v := L^-T v. */
void cfem_program_forward(const cfem_plan *plan, int begin, double *v);
void cfem_program_backward(const cfem_plan *plan, double *v);

/* The objective's slope at x. */
void cfem_program_slope(const cfem_plan *plan, const double *x, double *slope);

/* L, and in `best` the optimum without bounds; the price of missing a bound. 0, or 1 where H is not positive definite. */
int cfem_program_factorise(cfem_plan *plan);

#endif
