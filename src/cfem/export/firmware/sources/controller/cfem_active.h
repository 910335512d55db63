/* The active set of a strictly convex quadratic program, in coordinates y (n,) in which its objective is |y|^2 / 2:
 *
 *     minimise |y|^2 / 2 + sum_k miss_k^2 / (2 price_k)    subject to    low_k <= normal_k . y + miss_k <= high_k
 *
 * without `miss` where a constraint has no price. Method: the dual active set of Goldfarb and Idnani (Mathematical Programming 27, 1983)
 * from y = 0. Of the active normals, signed so that they point inwards, the factors are kept: normal_j = sum_(i <= j) R_ji Q_i. */
#ifndef CFEM_ACTIVE_H
#define CFEM_ACTIVE_H

enum {
    CFEM_QP_OPTIMAL = 0,
    CFEM_QP_INFEASIBLE = 1, /* the bounds exclude each other */
    CFEM_QP_FLAT = 2,       /* the objective is not strictly convex to rounding, or numbers are not finite */
    CFEM_QP_INACCURATE = 3, /* the answer misses the optimality conditions by more than CFEM_QP_TOLERANCE */
    CFEM_QP_ITERATIONS = 4  /* the steps allowed were not enough */
};

#define CFEM_QP_TOLERANCE CFEM_TOLERANCE(1e-9, 1e-4) /* of the optimality conditions */
#define CFEM_QP_REFINEMENTS 3

enum { CFEM_FREE, CFEM_ACTIVE, CFEM_MEETING }; /* states of a constraint; meeting: it contradicts active ones by no more than rounding */

/* A constraint at one of its bounds: normal . y >= bound; meets: by how much it may contradict others by rounding. */
typedef struct {
    double bound, price, meets;
} cfem_bound;

/* The program. violated: the constraint of those that are free which is violated most at y, and its sign (+1: its low bound is), or -1.
 * bound: that side of constraint k, its normal (n,) times the sign. */
typedef struct {
    int (*violated)(void *with, const double *y, const unsigned char *state, double *sign);
    cfem_bound (*bound)(void *with, int k, double sign, double *normal);
    void *with;
} cfem_program;

/* Numbers of R for `most` active constraints: its rows are packed, each with room for one more. */
#define CFEM_ACTIVE_R(most) (((most) + 1) * ((most) + 4) / 2)

/* The caller gives all but `count` and `changes`. */
typedef struct {
    int n, constraints, most; /* most: constraints that may be active at once */
    int priced;               /* whether any constraint has a price */
    unsigned char *state;     /* (constraints,) */
    int *which;               /* (most,) */
    double *sign, *bound;     /* (most,) +1: at its low bound; the signed bound */
    double *force;            /* (2 most,) multipliers >= 0, and room */
    double *Q, *R;            /* (most + 2, n) and (CFEM_ACTIVE_R(most),) */
    int count, changes;       /* constraints that are active; that were added or dropped */
} cfem_active;

/* y (n,) and the active set at the optimum, in at most `steps` changes. CFEM_QP_OPTIMAL, _INFEASIBLE or _ITERATIONS. */
int cfem_active_solve(cfem_active *set, const cfem_program *program, int steps, double *y);

/* One step of iterative refinement. step (n,): in, by what y misses stationarity; out, by what y changes. left (count,): by what the active
 * constraints miss their bounds; it is overwritten. */
void cfem_active_refine(cfem_active *set, double *left, double *step);

#endif
