/* A box- and row-constrained least-squares program: to the coordinates of its active set, back, and checked. */
#include "cfem_qp.h"

#include "cfem_linear.h"

#define N CFEM_QP_VARIABLES
#define C CFEM_QP_CONSTRAINTS
#define ROUNDING CFEM_TOLERANCE(4e-15, 2e-6)
#define OUTSIDE CFEM_TOLERANCE(1e-12, 1e-6) /* in shares of a constraint's size: what is violated by less is not */
#define MEETS CFEM_TOLERANCE(1e-10, 1e-5)   /* bounds that exclude each other by less meet */
#define FLAT CFEM_TOLERANCE(1e-13, 1e-6)    /* of a column: what depends on those before */
#define OPEN 1e20 /* a box wider than that is meant to be none, and no measure for its variable */

/* The program in its own coordinates: half-spaces low <= normal . y <= high, |normal| = 1, about the point of least |y|. */
typedef struct {
    int n, count;
    double normal[C][N];
    double low[C], high[C];
    double size[C]; /* what one unit of y along the normal is in the scaled x; 0: the row is zero and binds nothing */
} half_spaces;

/* The constraint that is violated most, as a cfem_program has it. */
static int violated(void *with, const double *y, const unsigned char *state, double *sign) {
    const half_spaces *const h = with;
    const double length = sqrt(cfem_dot(h->n, y, y));
    double most = 0.0;
    int which = -1;
    for (int k = 0; k < h->count; k++) {
        if (h->size[k] == 0.0 || state[k]) continue;
        const double value = cfem_dot(h->n, h->normal[k], y), below = h->low[k] - value, above = value - h->high[k];
        const double by = cfem_larger(below, above), bound = below > above ? h->low[k] : h->high[k];
        if (by > most && by > ROUNDING * (length + fabs(bound)) + OUTSIDE / h->size[k]) which = k, most = by, *sign = below > above ? 1.0 : -1.0;
    }
    return which;
}

static cfem_bound bound(void *with, int k, double sign, double *normal) {
    const half_spaces *const h = with;
    for (int j = 0; j < h->n; j++) normal[j] = sign * h->normal[k][j];
    return (cfem_bound){sign > 0 ? h->low[k] : -h->high[k], 0.0, MEETS / h->size[k]};
}

/* In place, by Householder reflections: B (rows, n + 1) = Q R, of which R (n, n) and, in the last column, the first entries of
 * Q^T d remain. 0, or 1 where B has no full column rank. */
static int triangularise(int n, int rows, double B[CFEM_QP_ROWS][N + 1]) {
    if (rows < n) return 1;
    for (int j = 0; j < n; j++) {
        double square = 0.0;
        for (int i = j; i < rows; i++) square += B[i][j] * B[i][j];
        const double column_length = sqrt(square), old = B[j][j], norm = old > 0 ? -column_length : column_length;
        double above = 0.0;
        for (int i = 0; i < j; i++) above += B[i][j] * B[i][j];
        if (!(column_length > FLAT * sqrt(square + above))) return 1;
        B[j][j] = old - norm; /* the reflection's vector is column j from row j on */
        const double scale = norm * B[j][j];
        for (int c = j + 1; c <= n; c++) {
            double sum = 0.0;
            for (int i = j; i < rows; i++) sum += B[i][j] * B[i][c];
            sum /= scale;
            for (int i = j; i < rows; i++) B[i][c] += sum * B[i][j];
        }
        B[j][j] = norm;
    }
    return 0;
}

/* The program as it was given, with the sizes that make its residuals dimensionless. */
typedef struct {
    int n, rows, m;
    const double *M, *d, *A, *low, *high;
    int stride; /* of A */
    double width[N];  /* of the variables' boxes, or what brings the curvature to one where one is open or a point */
    double length[C]; /* of the constraints' rows for variables in units of their width */
    double curvature, steepest;
} program;

/* Sizes of a program: 0, or CFEM_QP_FLAT where numbers are not finite. */
static int measure(program *p) {
    p->curvature = p->steepest = 0.0;
    for (int j = 0; j < p->n; j++) {
        double square = 0.0, slope = 0.0;
        for (int i = 0; i < p->rows; i++) {
            square += p->M[i * p->n + j] * p->M[i * p->n + j];
            slope += p->M[i * p->n + j] * p->d[i];
        }
        const double open = p->high[j] - p->low[j];
        const int usable = open < OPEN && open > 1e-6 * cfem_larger(fabs(p->low[j]), fabs(p->high[j]));
        p->width[j] = p->length[j] = usable ? open : square > 0.0 ? 1.0 / sqrt(square) : 1.0;
        if (!cfem_finite(square) || !cfem_finite(slope)) return CFEM_QP_FLAT;
        p->curvature = cfem_larger(p->curvature, square * p->width[j] * p->width[j]);
        p->steepest = cfem_larger(p->steepest, fabs(slope) * p->width[j]);
    }
    for (int k = 0; k < p->m; k++) {
        double square = 0.0;
        for (int j = 0; j < p->n; j++) square += p->A[k * p->stride + j] * p->width[j] * p->A[k * p->stride + j] * p->width[j];
        if (!cfem_finite(square)) return CFEM_QP_FLAT;
        p->length[p->n + k] = sqrt(square);
    }
    return CFEM_QP_OPTIMAL;
}

/* B = [M d], its columns scaled by the widths, to triangular form; the half-spaces: a . x with x = R^-1 (c + y) is
 * (R^-T a) . (c + y), so their normals are R^-T a, brought to unit length. */
static int transform(const program *p, double B[CFEM_QP_ROWS][N + 1], half_spaces *h) {
    const int n = p->n;
    for (int i = 0; i < p->rows; i++) {
        for (int j = 0; j < n; j++) B[i][j] = p->M[i * n + j] * p->width[j];
        B[i][n] = p->d[i];
    }
    if (triangularise(n, p->rows, B)) return CFEM_QP_FLAT;
    h->n = n, h->count = n + p->m;
    for (int k = 0; k < h->count; k++) {
        double *g = h->normal[k], shift = 0.0;
        h->size[k] = 0.0;
        if (p->length[k] == 0.0) {
            if (p->low[k] > 0.0 || p->high[k] < 0.0) return CFEM_QP_INFEASIBLE;
            continue;
        }
        for (int j = 0; j < n; j++) {
            g[j] = k < n ? (j == k ? p->width[j] : 0.0) : p->A[(k - n) * p->stride + j] * p->width[j];
            for (int i = 0; i < j; i++) g[j] -= B[i][j] * g[i];
            g[j] /= B[j][j];
        }
        const double norm = sqrt(cfem_dot(n, g, g));
        if (!cfem_finite(norm)) return CFEM_QP_FLAT;
        for (int j = 0; j < n; j++) {
            g[j] /= norm;
            shift += g[j] * B[j][n];
        }
        h->size[k] = norm / p->length[k];
        h->low[k] = p->low[k] / norm - shift;
        h->high[k] = p->high[k] / norm - shift;
    }
    return CFEM_QP_OPTIMAL;
}

/* v := R^-1 v, scaled to x's units. */
static void to_x(const program *p, double B[CFEM_QP_ROWS][N + 1], double *v) {
    for (int i = p->n - 1; i >= 0; i--) {
        for (int j = i + 1; j < p->n; j++) v[i] -= B[i][j] * v[j];
        v[i] /= B[i][i];
    }
    for (int j = 0; j < p->n; j++) v[j] *= p->width[j];
}

static double value(const program *p, int k, const double *x) {
    return k < p->n ? x[k] : cfem_dot(p->n, p->A + (k - p->n) * p->stride, x);
}

/* Multipliers of the program from those of the half-spaces. */
static void name_multipliers(const program *p, const half_spaces *h, const cfem_active *set, double *multipliers) {
    for (int k = 0; k < h->count; k++) multipliers[k] = 0.0;
    for (int i = 0; i < set->count; i++) {
        const int k = set->which[i];
        multipliers[k] = -set->sign[i] * set->force[i] / (h->size[k] * p->length[k]);
    }
}

/* Largest residual; forces (n,): M^T (M x - d) + A^T y + z. */
static double residual(const program *p, const cfem_qp_answer *a, double *forces) {
    const int n = p->n;
    double kkt = 0.0;
    for (int j = 0; j < n; j++) forces[j] = a->multipliers[j];
    for (int i = 0; i < p->rows; i++) {
        const double missing = cfem_dot(n, p->M + i * n, a->x) - p->d[i];
        for (int j = 0; j < n; j++) forces[j] += p->M[i * n + j] * missing;
    }
    for (int k = 0; k < n + p->m; k++) {
        const double z = a->multipliers[k], length = p->length[k], row_value = value(p, k, a->x);
        if (length == 0.0) continue;
        if (k >= n)
            for (int j = 0; j < n; j++) forces[j] += p->A[(k - n) * p->stride + j] * z;
        kkt = cfem_larger(kkt, cfem_larger(p->low[k] - row_value, row_value - p->high[k]) / length);
        if (z != 0.0) {
            const double scaled = fabs(z) * length / p->curvature;
            kkt = cfem_larger(kkt, scaled / cfem_larger(1.0, scaled) * fabs(row_value - (z > 0 ? p->high[k] : p->low[k])) / length);
        }
    }
    const double reference = cfem_larger(p->curvature, p->steepest);
    for (int j = 0; j < n; j++) {
        const double part = fabs(forces[j]) * p->width[j] / reference;
        if (!(part <= kkt)) kkt = part; /* also where it is not a number */
    }
    return kkt;
}

/* One step of iterative refinement on the active constraints, which takes out the rounding of an optimum that is small
 * beside the unconstrained one. */
static void refine(const program *p, double B[CFEM_QP_ROWS][N + 1], const half_spaces *h, cfem_active *set,
                   const double *forces, cfem_qp_answer *a) {
    const int n = p->n;
    double step[N], left[N];
    for (int j = 0; j < n; j++) { /* R^-T of what is missing in stationarity */
        step[j] = -forces[j] * p->width[j];
        for (int i = 0; i < j; i++) step[j] -= B[i][j] * step[i];
        step[j] /= B[j][j];
    }
    for (int i = 0; i < set->count; i++) {
        const int k = set->which[i];
        const double missing = (set->sign[i] > 0 ? p->low[k] : p->high[k]) - value(p, k, a->x);
        left[i] = set->sign[i] * missing / (h->size[k] * p->length[k]);
    }
    cfem_active_refine(set, left, step);
    to_x(p, B, step);
    for (int j = 0; j < n; j++) a->x[j] += step[j];
}

int cfem_qp(int n, int rows, const double *M, const double *d, int m, const double *A, int stride, const double *low,
            const double *high, cfem_qp_answer *answer) {
    program p = {n, rows, m, M, d, A, low, high, stride, {0}, {0}, 0, 0};
    double B[CFEM_QP_ROWS][N + 1], y[N], forces[N], sign[N], bounds[N], force[2 * N], Q[(N + 2) * N], R[CFEM_ACTIVE_R(N)];
    unsigned char state[C];
    int which[N];
    half_spaces h;
    answer->iterations = 0, answer->kkt = HUGE_VAL;
    for (int k = 0; k < n + m; k++)
        if (!(low[k] <= high[k])) return CFEM_QP_INFEASIBLE;
    int status = measure(&p);
    if (status == CFEM_QP_OPTIMAL) status = transform(&p, B, &h);
    cfem_active set = {n, n + m, n, 0, state, which, sign, bounds, force, Q, R, 0, 0};
    const cfem_program half = {violated, bound, &h};
    if (status == CFEM_QP_OPTIMAL) status = cfem_active_solve(&set, &half, CFEM_QP_STEPS, y);
    answer->iterations = set.changes;
    if (status != CFEM_QP_OPTIMAL) return status;

    for (int j = 0; j < n; j++) answer->x[j] = B[j][n] + y[j];
    to_x(&p, B, answer->x);
    for (int round = 0;; round++) {
        for (int i = 0; i < set.count; i++) { /* a bound holds exactly */
            const int k = set.which[i];
            if (k < n) answer->x[k] = set.sign[i] > 0 ? low[k] : high[k];
        }
        name_multipliers(&p, &h, &set, answer->multipliers);
        answer->kkt = residual(&p, answer, forces);
        if (answer->kkt <= 0.01 * CFEM_QP_TOLERANCE || round == CFEM_QP_REFINEMENTS) break;
        refine(&p, B, &h, &set, forces, answer);
    }
    return answer->kkt <= CFEM_QP_TOLERANCE ? CFEM_QP_OPTIMAL : CFEM_QP_INACCURATE;
}
