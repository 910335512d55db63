/* Small strictly convex quadratic programs, exactly, always in double precision:
 *
 *     minimise |M x - d|^2 / 2    subject to    low[i] <= x[i] <= high[i],  i < n
 *                                               low[n + j] <= A[j] x <= high[n + j],  j < m
 *
 * Given as a least-squares problem, whose condition is the root of that of H = M^T M. Bounds may be +-HUGE_VAL (or 1e30); each low must
 * not exceed its high.
 *
 * Method: the active set of cfem_active.h, in the coordinates y = R x - c of the QR factorisation of M, in which the objective is
 * |y|^2 / 2 and every constraint a half-space with a unit normal. Multipliers are positive where an upper bound holds and negative where a lower one does:
 * M^T (M x - d) + A^T y + z = 0. */
#ifndef CFEM_QP_H
#define CFEM_QP_H

#include "cfem_active.h"
#include "cfem_room.h"

/* Largest sizes; a program of any smaller size may be given. */
#ifndef CFEM_QP_VARIABLES
#define CFEM_QP_VARIABLES (2 * CFEM_MOST_NA)
#define CFEM_QP_ROWS (CFEM_MOST_NE > 2 * CFEM_MOST_NA ? CFEM_MOST_NE + CFEM_MOST_NA : 3 * CFEM_MOST_NA)
#define CFEM_QP_CONSTRAINTS (2 * CFEM_MOST_NA)
#endif

#define CFEM_QP_STEPS (10 * (CFEM_QP_CONSTRAINTS + 1))

typedef struct {
    double x[CFEM_QP_VARIABLES];
    double multipliers[CFEM_QP_CONSTRAINTS]; /* of the box, then of the rows */
    double kkt;     /* largest residual of the optimality conditions: variables in units of their box, rows of unit norm,
                       the objective of unit curvature; recomputed from x and the multipliers */
    int iterations; /* constraints added or dropped */
} cfem_qp_answer;

/* M (rows, n), d (rows,), A (m, n), low and high (n + m,), row-major; A's rows begin `stride` numbers after each other.
 * The status: of cfem_active.h. */
int cfem_qp(int n, int rows, const double *M, const double *d, int m, const double *A, int stride, const double *low,
            const double *high, cfem_qp_answer *answer);

#endif
