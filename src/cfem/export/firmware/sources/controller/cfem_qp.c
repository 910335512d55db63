#include "cfem_qp.h"

#include "cfem_linear.h"

#define N CFEM_QP_VARIABLES
#define C CFEM_QP_CONSTRAINTS
#define OPEN 1e20 /* a box wider than that is meant to be none, and no measure for its variable */

/* The program in its own coordinates: half-spaces low <= normal . y <= high, |normal| = 1, about the point of least |y|. */
typedef struct {
    int n, count;
    double normal[C][N];
    double low[C], high[C];
    double size[C]; /* what one unit of y along the normal is in the scaled x; 0: the row is zero and binds nothing */
} half_spaces;

/* The active constraints: signed normals Q R, Q orthonormal. */
typedef struct {
    int count;
    int which[N];
    double sign[N]; /* +1: at its low bound, -1: at its high one */
    double u[N];    /* multipliers, >= 0 */
    double Q[N + 1][N];
    double R[N + 1][N]; /* R[j][i]: share of Q[i] in normal j, i <= j */
} active_set;

static double largest(double a, double b) { return a > b ? a : b; }

/* Splits a normal into its shares in Q and a remainder, by Gram-Schmidt done twice, in slot `count`. Its squared length. */
static double orthogonalise(active_set *set, int n, const double *normal, double sign) {
    const int k = set->count;
    double *rest = set->Q[k], *share = set->R[k];
    for (int i = 0; i < n; i++) rest[i] = sign * normal[i];
    for (int i = 0; i < k; i++) share[i] = 0.0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < k; i++) {
            const double part = cfem_dot(n, set->Q[i], rest);
            share[i] += part;
            for (int j = 0; j < n; j++) rest[j] -= part * set->Q[i][j];
        }
    return cfem_dot(n, rest, rest);
}

/* Makes the constraint in slot `count` active. */
static void accept(active_set *set, int n, int which, double sign, double u, double square) {
    const int k = set->count++;
    const double norm = sqrt(square);
    for (int j = 0; j < n; j++) set->Q[k][j] /= norm;
    set->R[k][k] = norm;
    set->which[k] = which, set->sign[k] = sign, set->u[k] = u;
}

static void drop(active_set *set, const half_spaces *h, int slot) {
    const int count = set->count;
    set->count = slot;
    for (int k = slot + 1; k < count; k++) {
        const int which = set->which[k];
        const double sign = set->sign[k], u = set->u[k];
        accept(set, h->n, which, sign, u, orthogonalise(set, h->n, h->normal[which], sign));
    }
}

/* Solves R^T r = share: how the active normals make up the projection of the normal in slot `count`. */
static void combine(const active_set *set, const double *share, double *r) {
    for (int i = set->count - 1; i >= 0; i--) {
        double sum = share[i];
        for (int j = i + 1; j < set->count; j++) sum -= set->R[j][i] * r[j];
        r[i] = sum / set->R[i][i];
    }
}

/* The point of least |y| on the active constraints and its multipliers, from scratch: removes what rounding has left. */
static void refresh(active_set *set, const half_spaces *h, double *y) {
    double along[N];
    for (int i = 0; i < set->count; i++) {
        const int k = set->which[i];
        double sum = set->sign[i] > 0 ? h->low[k] : -h->high[k];
        for (int j = 0; j < i; j++) sum -= set->R[i][j] * along[j];
        along[i] = sum / set->R[i][i];
    }
    for (int j = 0; j < h->n; j++) {
        y[j] = 0.0;
        for (int i = 0; i < set->count; i++) y[j] += along[i] * set->Q[i][j];
    }
    combine(set, along, set->u);
}

/* The most violated constraint that is not active and not in `skip`: its index, or -1; how far, and on which side. */
static int most_violated(const half_spaces *h, const active_set *set, const char *skip, const double *y, double *by,
                         double *sign) {
    int found = -1;
    const double length = sqrt(cfem_dot(h->n, y, y));
    *by = 0.0;
    for (int k = 0; k < h->count; k++) {
        if (h->size[k] == 0.0 || skip[k]) continue;
        int held = 0;
        for (int i = 0; i < set->count; i++) held |= set->which[i] == k;
        if (held) continue;
        const double at = cfem_dot(h->n, h->normal[k], y), below = h->low[k] - at, above = at - h->high[k];
        const double violation = largest(below, above);
        const double bound = below > above ? h->low[k] : h->high[k];
        if (violation > *by && violation > 4e-15 * (length + fabs(bound)) + 1e-12 / h->size[k]) {
            found = k, *by = violation, *sign = below > above ? 1.0 : -1.0;
        }
    }
    return found;
}

/* y and the active set at the optimum; CFEM_QP_OPTIMAL, _INFEASIBLE or _ITERATIONS. */
static int solve(const half_spaces *h, active_set *set, double *y, int *iterations) {
    char skip[C] = {0};
    int fresh = 1;
    set->count = 0;
    for (int j = 0; j < h->n; j++) y[j] = 0.0;
    *iterations = 0;
    while (*iterations < CFEM_QP_STEPS) {
        double by, sign = 1.0, u = 0.0;
        const int k = most_violated(h, set, skip, y, &by, &sign);
        if (k < 0) {
            if (fresh) return CFEM_QP_OPTIMAL;
            refresh(set, h, y);
            fresh = 1;
            int worst = -1;
            for (int i = 0; i < set->count; i++)
                if (set->u[i] < (worst < 0 ? 0.0 : set->u[worst])) worst = i;
            if (worst >= 0) { /* rounding had hidden that this one need not hold */
                ++*iterations;
                drop(set, h, worst);
                refresh(set, h, y);
            }
            continue;
        }
        for (int added = 0; !added && *iterations < CFEM_QP_STEPS; ++*iterations) {
            double r[N], partial = HUGE_VAL;
            int blocking = -1;
            double square = orthogonalise(set, h->n, h->normal[k], sign);
            combine(set, set->R[set->count], r);
            for (int i = 0; i < set->count; i++)
                if (r[i] > 1e-14 && set->u[i] < partial * r[i]) partial = set->u[i] / r[i], blocking = i;
            if (set->count == h->n || square <= 1e-22) square = 0.0; /* depends on the active ones */
            const double full = square > 0.0 ? by / square : HUGE_VAL;
            if (square == 0.0 && blocking < 0) {
                if (by * h->size[k] > 1e-10) return CFEM_QP_INFEASIBLE;
                skip[k] = 1; /* two bounds that meet, to rounding */
                break;
            }
            const double t = full < partial ? full : partial;
            for (int i = 0; i < set->count; i++) set->u[i] -= t * r[i];
            u += t;
            if (square > 0.0) {
                for (int j = 0; j < h->n; j++) y[j] += t * set->Q[set->count][j];
                by -= t * square;
            }
            fresh = 0;
            added = t == full;
            if (added)
                accept(set, h->n, k, sign, u, square);
            else
                drop(set, h, blocking);
        }
    }
    return CFEM_QP_ITERATIONS;
}

/* In place, by Householder reflections: B (rows, n + 1) = Q R, of which R (n, n) and, in the last column, the first entries of
 * Q^T d remain. 0, or 1 where B has no full column rank. */
static int triangularise(int n, int rows, double B[CFEM_QP_ROWS][N + 1]) {
    if (rows < n) return 1;
    for (int j = 0; j < n; j++) {
        double square = 0.0;
        for (int i = j; i < rows; i++) square += B[i][j] * B[i][j];
        const double whole = sqrt(square), old = B[j][j], norm = old > 0 ? -whole : whole;
        double above = 0.0;
        for (int i = 0; i < j; i++) above += B[i][j] * B[i][j];
        if (!(whole > 1e-13 * sqrt(square + above))) return 1;
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
        const int usable = open < OPEN && open > 1e-6 * largest(fabs(p->low[j]), fabs(p->high[j]));
        p->width[j] = p->length[j] = usable ? open : square > 0.0 ? 1.0 / sqrt(square) : 1.0;
        if (!cfem_finite(square) || !cfem_finite(slope)) return CFEM_QP_FLAT;
        p->curvature = largest(p->curvature, square * p->width[j] * p->width[j]);
        p->steepest = largest(p->steepest, fabs(slope) * p->width[j]);
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
static void name_multipliers(const program *p, const half_spaces *h, const active_set *set, double *multipliers) {
    for (int k = 0; k < h->count; k++) multipliers[k] = 0.0;
    for (int i = 0; i < set->count; i++) {
        const int k = set->which[i];
        multipliers[k] = -set->sign[i] * set->u[i] / (h->size[k] * p->length[k]);
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
        const double z = a->multipliers[k], length = p->length[k], at = value(p, k, a->x);
        if (length == 0.0) continue;
        if (k >= n)
            for (int j = 0; j < n; j++) forces[j] += p->A[(k - n) * p->stride + j] * z;
        kkt = largest(kkt, largest(p->low[k] - at, at - p->high[k]) / length);
        if (z != 0.0) {
            const double scaled = fabs(z) * length / p->curvature;
            kkt = largest(kkt, scaled / largest(1.0, scaled) * fabs(at - (z > 0 ? p->high[k] : p->low[k])) / length);
        }
    }
    const double reference = largest(p->curvature, p->steepest);
    for (int j = 0; j < n; j++) {
        const double part = fabs(forces[j]) * p->width[j] / reference;
        if (!(part <= kkt)) kkt = part; /* also where it is not a number */
    }
    return kkt;
}

/* One step of iterative refinement on the active constraints, which takes out the rounding of an optimum that is small
 * beside the unconstrained one. */
static void refine(const program *p, double B[CFEM_QP_ROWS][N + 1], const half_spaces *h, active_set *set,
                   const double *forces, cfem_qp_answer *a) {
    const int n = p->n;
    double step[N], along[N], change[N];
    for (int j = 0; j < n; j++) { /* R^-T of what is missing in stationarity */
        step[j] = -forces[j] * p->width[j];
        for (int i = 0; i < j; i++) step[j] -= B[i][j] * step[i];
        step[j] /= B[j][j];
    }
    for (int i = 0; i < set->count; i++) { /* what its part along the active normals is, and what it must be */
        const int k = set->which[i];
        const double left = (set->sign[i] > 0 ? p->low[k] : p->high[k]) - value(p, k, a->x);
        double sum = set->sign[i] * left / (h->size[k] * p->length[k]);
        for (int j = 0; j < i; j++) sum -= set->R[i][j] * along[j];
        along[i] = sum / set->R[i][i];
    }
    for (int i = 0; i < set->count; i++) change[i] = along[i] - cfem_dot(n, set->Q[i], step);
    for (int i = 0; i < set->count; i++)
        for (int j = 0; j < n; j++) step[j] += change[i] * set->Q[i][j];
    combine(set, change, along);
    for (int i = 0; i < set->count; i++) set->u[i] = largest(0.0, set->u[i] + along[i]);
    to_x(p, B, step);
    for (int j = 0; j < n; j++) a->x[j] += step[j];
}

int cfem_qp(int n, int rows, const double *M, const double *d, int m, const double *A, int stride, const double *low,
            const double *high, cfem_qp_answer *answer) {
    program p = {n, rows, m, M, d, A, low, high, stride, {0}, {0}, 0, 0};
    double B[CFEM_QP_ROWS][N + 1], y[N], forces[N];
    half_spaces h;
    active_set set;
    answer->iterations = 0;
    answer->kkt = HUGE_VAL;
    for (int k = 0; k < n + m; k++)
        if (!(low[k] <= high[k])) return CFEM_QP_INFEASIBLE;
    int status = measure(&p);
    if (status == CFEM_QP_OPTIMAL) status = transform(&p, B, &h);
    if (status == CFEM_QP_OPTIMAL) status = solve(&h, &set, y, &answer->iterations);
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
