#include "cfem_law.h"

#include "cfem_linear.h"

enum { ITERATIONS = 40, HALVINGS = 4, CORRECTIONS = 8 };
/* Of the curve along friction: steps in units of the largest force without it; see cfem.contact.law.path. */
static const double LONGEST = 1.0, FIRST = 0.1, SHORTEST = 1e-7, ACROSS = 1e-5, ONWARDS = 1e-4, FARTHEST = 1.2, CLOSE = 1e-10;
static const double EXACT = 1e-13; /* of the largest force: change of a force in the last step */

/* Whether another system may be solved, which is one of these. */
static int may_solve(int *systems) { return *systems > 0 && (*systems)-- > 0; }

static double largest_of(int n, const double *x) {
    double found = 0.0;
    for (int i = 0; i < n; i++) {
        if (!cfem_finite(x[i])) return HUGE_VAL;
        if (fabs(x[i]) > found) found = fabs(x[i]);
    }
    return found;
}

/* P(p), the projection of p by the law of one point, in its place; d: its derivative (3, 3). */
static void project(double mu, double *p, double *d) {
    for (int a = 0; a < 9; a++) d[a] = 0.0;
    if (!(p[0] > 0.0)) p[0] = 0.0;
    if (!(p[0] > 0.0 && mu > 0.0)) p[1] = p[2] = 0.0;
    if (!(p[0] > 0.0)) return;
    d[0] = 1.0;
    if (!(mu > 0.0)) return;
    const double length = sqrt(p[1] * p[1] + p[2] * p[2]), limit = mu * p[0];
    if (length <= limit) {
        d[4] = d[8] = 1.0;
        return;
    }
    const double share = limit / length, along[2] = {p[1] / length, p[2] / length};
    for (int a = 0; a < 2; a++) {
        p[1 + a] *= share;
        d[3 * (1 + a)] = mu * along[a];
        for (int b = 0; b < 2; b++) d[3 * (1 + a) + 1 + b] = share * ((a == b ? 1.0 : 0.0) - along[a] * along[b]);
    }
}

double cfem_law_violation(double mu, const double force[3], const double gap[3], double yields) {
    double lawful[3], off[3], d[9];
    for (int a = 0; a < 3; a++) lawful[a] = force[a] - gap[a] / yields;
    project(mu, lawful, d);
    for (int a = 0; a < 3; a++) off[a] = yields * (force[a] - lawful[a]);
    return sqrt(cfem_dot(3, off, off));
}

/* F = lambda - P(p), p = A lambda - constant, and the derivatives D (m, 3, 3) of P. |F|. */
static double missing(int m, const double *A, const double *constant, double mu, const double *lambda, double *F, double *D) {
    const int n = 3 * m;
    for (int i = 0; i < m; i++) {
        double p[3];
        for (int a = 0; a < 3; a++) p[a] = cfem_dot(n, A + (3 * i + a) * n, lambda) - constant[3 * i + a];
        project(mu, p, D + 9 * i);
        for (int a = 0; a < 3; a++) F[3 * i + a] = lambda[3 * i + a] - p[a];
    }
    return largest_of(n, F);
}

/* Forces of open points exactly 0, no friction beyond its limit by rounding. */
static void clean(int m, double mu, double *lambda) {
    const double least = EXACT * largest_of(3 * m, lambda);
    for (int i = 0; i < m; i++) {
        double *const f = lambda + 3 * i;
        if (!(f[0] > least)) f[0] = f[1] = f[2] = 0.0;
        const double length = sqrt(f[1] * f[1] + f[2] * f[2]);
        if (length > mu * f[0]) f[1] *= mu * f[0] / length, f[2] *= mu * f[0] / length;
    }
}

/* A and constant of p = A lambda - constant. 0, or 1 where a point does not yield. */
static int scale(int m, const double *W, const double *free, double *A, double *constant) {
    const int n = 3 * m;
    for (int i = 0; i < m; i++) {
        double yields = 0.0;
        for (int a = 3 * i; a < 3 * i + 3; a++)
            if (W[a * n + a] > yields) yields = W[a * n + a];
        if (!(yields > 0.0)) return 1;
        for (int a = 3 * i; a < 3 * i + 3; a++) {
            for (int b = 0; b < n; b++) A[a * n + b] = (a == b ? 1.0 : 0.0) - W[a * n + b] / yields;
            constant[a] = free[a] / yields;
        }
    }
    return 0;
}

/* Newton's step (1 - D A) step = -F. Rows without derivative need no system: without friction those along the surface, and all of
 * open points. J and by: room. 0, or 1 where it is singular. */
static int newton_step(int m, const double *A, const double *F, const double *D, double mu, double *J, double *by, double *step) {
    const int n = 3 * m, axes = mu > 0.0 ? 3 : 1;
    double sign;
    int c = 0, row = 0;
    for (int i = 0; i < m; i++) {
        const int unknown = D[9 * i] > 0.0 ? axes : 0;
        for (int a = 0; a < 3; a++) step[3 * i + a] = a < unknown ? 0.0 : -F[3 * i + a];
        c += unknown;
    }
    for (int i = 0; i < m; i++) {
        if (!(D[9 * i] > 0.0)) continue;
        for (int a = 0; a < axes; a++, row++) {
            const double *const d = D + 9 * i + 3 * a, *const from = A + 3 * i * n;
            double *at = J + row * c, known = 0.0;
            for (int j = 0; j < m; j++) {
                const double *const of = from + 3 * j;
                const int unknown = D[9 * j] > 0.0 ? axes : 0;
                for (int b = 0; b < 3; b++) {
                    if (b >= unknown && step[3 * j + b] == 0.0) continue;
                    const double by_b = axes == 1 ? of[b] : d[0] * of[b] + d[1] * of[n + b] + d[2] * of[2 * n + b];
                    if (b < unknown)
                        *at++ = -by_b;
                    else
                        known += by_b * step[3 * j + b];
                }
            }
            J[row * c + row] += 1.0, by[row] = known - F[3 * i + a];
        }
    }
    if (cfem_eliminate(c, J, 1, by, &sign)) return 1;
    for (int i = 0; i < m; i++)
        for (int a = 0; a < axes && D[9 * i] > 0.0; a++) step[3 * i + a] = *by++;
    return 0;
}

/* Newton's method from lambda, the answer in its place; see cfem.contact.law.newton. */
static int newton(int m, const double *W, const double *free, double mu, double *lambda, double *room, int *systems) {
    const int n = 3 * m;
    double *const A = room, *const J = A + n * n, *const constant = J + n * n, *const F = constant + n;
    double *const step = F + n, *const trial = step + n, *const now = trial + n, *const by = now + n, *const D = by + n;
    if (scale(m, W, free, A, constant)) return 1;
    for (int a = 0; a < n; a++) now[a] = lambda[a];
    const double forces = largest_of(n, constant);
    double size = missing(m, A, constant, mu, now, F, D);
    for (int iteration = 0; iteration < ITERATIONS && may_solve(systems); iteration++) {
        if (newton_step(m, A, F, D, mu, J, by, step)) return 1;
        double share = 1.0;
        for (int halving = 0; halving <= HALVINGS; halving++, share *= 0.5) {
            for (int a = 0; a < n; a++) trial[a] = now[a] + share * step[a];
            const double next = missing(m, A, constant, mu, trial, F, D);
            if (next < size || halving == HALVINGS) {
                size = next;
                break;
            }
        }
        for (int a = 0; a < n; a++) now[a] = trial[a];
        const double most = largest_of(n, now);
        if (!cfem_finite(most) || !cfem_finite(size)) return 1;
        if (size <= EXACT * (most > forces ? most : forces)) {
            for (int a = 0; a < n; a++) lambda[a] = now[a];
            clean(m, mu, lambda);
            return 0;
        }
    }
    return 1;
}

/* (n + 1, n + 1) into M: derivatives of F by z = (lambda, mu), and the row `last` below; F (n,) at z. */
static void border(int m, const double *A, const double *constant, const double *z, const double *last, double *F, double *D,
                   double *M) {
    const int n = 3 * m;
    const double mu = z[n] > 0.0 ? z[n] : 0.0;
    missing(m, A, constant, mu, z, F, D);
    for (int i = 0; i < m; i++) {
        double p[3];
        for (int a = 0; a < 3; a++) p[a] = cfem_dot(n, A + (3 * i + a) * n, z) - constant[3 * i + a];
        const double length = sqrt(p[1] * p[1] + p[2] * p[2]);
        for (int a = 0; a < 3; a++) {
            double *const row = M + (3 * i + a) * (n + 1);
            const double *const d = D + 9 * i + 3 * a, *const from = A + 3 * i * n;
            for (int b = 0; b < n; b++) row[b] = -(d[0] * from[b] + d[1] * from[n + b] + d[2] * from[2 * n + b]);
            row[3 * i + a] += 1.0;
            row[n] = a && p[0] > 0.0 && length > mu * p[0] ? -p[0] * p[a] / length : 0.0;
        }
    }
    for (int b = 0; b <= n; b++) M[n * (n + 1) + b] = last[b];
}

/* Into `found`: the point of the curve whose way from z has `length` along the tangent. 0, or 1 where none is near. */
static int near(int m, const double *A, const double *constant, const double *z, const double *tangent, double length,
                double *found, double *room, int *systems) {
    const int n = 3 * m;
    double *const F = room, *const D = F + n + 1, *const M = D + 9 * m;
    for (int b = 0; b <= n; b++) found[b] = z[b] + length * tangent[b];
    for (int correction = 0;; correction++) {
        double way = -length, square = 0.0, sign;
        border(m, A, constant, found, tangent, F, D, M);
        for (int b = 0; b <= n; b++) way += tangent[b] * (found[b] - z[b]);
        F[n] = way;
        if (largest_of(n, F) < CLOSE && fabs(way) < CLOSE * (length > 1.0 ? length : 1.0)) return 0;
        if (correction == CORRECTIONS || !may_solve(systems) || cfem_eliminate(n + 1, M, 1, F, &sign)) return 1;
        for (int b = 0; b <= n; b++) found[b] -= F[b], square += (found[b] - z[b]) * (found[b] - z[b]);
        if (!(sqrt(square) <= FARTHEST * length)) return 1;
    }
}

/* tangent: onwards from the direction it has, at z. 0, or 1. */
static int turn(int m, const double *A, const double *constant, const double *z, double *tangent, double *side, double *room,
                int *systems) {
    const int n = 3 * m;
    double *const F = room, *const D = F + n + 1, *const M = D + 9 * m, square = 0.0, sign;
    border(m, A, constant, z, tangent, F, D, M);
    for (int b = 0; b < n; b++) tangent[b] = 0.0;
    tangent[n] = 1.0;
    if (!may_solve(systems) || cfem_eliminate(n + 1, M, 1, tangent, &sign)) return 1;
    if (*side == 0.0) *side = sign;
    for (int b = 0; b <= n; b++) square += tangent[b] * tangent[b];
    for (int b = 0; b <= n; b++) tangent[b] *= sign * *side / sqrt(square);
    return !cfem_finite(square);
}

/* From no friction on along the curve of forces over friction, which may turn back; see cfem.contact.law.path. */
static int along_friction(int m, const double *W, const double *free, double mu, double *lambda, double *room, int *systems) {
    const int n = 3 * m;
    double *const A = room, *const constant = A + n * n, *const work = constant + n;
    double *const z = room + CFEM_LAW_ROOM(m) - 4 * (n + 1), *const tangent = z + n + 1, *const found = tangent + n + 1;
    double length = FIRST, side = 0.0;
    for (int a = 0; a < n * n; a++) A[a] = W[a];
    if (cfem_cholesky(n, n, A, 0.0)) return 1; /* there may be no state, and no end of the curve */
    if (newton(m, W, free, 0.0, lambda, room, systems)) return 1;
    const double size = largest_of(n, lambda);
    if (!(size > 0.0)) return 0;
    for (int b = 0; b < n; b++) z[b] = lambda[b] / size, tangent[b] = 0.0;
    z[n] = 0.0, tangent[n] = 1.0;
    for (int fresh = 1; *systems > 0;) {
        if (fresh) { /* Newton's method has taken the room */
            scale(m, W, free, A, constant);
            for (int b = 0; b < n; b++) constant[b] /= size;
            if (side == 0.0 && turn(m, A, constant, z, tangent, &side, work, systems)) return 1;
            fresh = 0;
        }
        int lost = near(m, A, constant, z, tangent, length, found, work, systems);
        if (lost && length > SHORTEST) {
            length /= 2.0;
            continue;
        }
        if (lost) { /* a corner, at which the curve turns by more than a right angle */
            for (int b = 0; b <= n; b++) found[b] = z[b] + ACROSS * tangent[b];
            if (turn(m, A, constant, found, tangent, &side, work, systems)) return 1;
            length = ONWARDS, lost = near(m, A, constant, z, tangent, length, found, work, systems);
            if (lost) return 1;
        }
        if (found[n] >= mu) {
            const double share = (mu - z[n]) / (found[n] - z[n]);
            for (int b = 0; b < n; b++) lambda[b] = size * (z[b] + share * (found[b] - z[b]));
            if (!newton(m, W, free, mu, lambda, room, systems)) return 0;
            if (length <= SHORTEST) return 1;
            length /= 4.0, fresh = 1;
            continue;
        }
        for (int b = 0; b <= n; b++) z[b] = found[b];
        const double longest = z[n] > 1.0 ? LONGEST * z[n] : LONGEST;
        length = 1.5 * length < longest ? 1.5 * length : longest;
        if (z[n] < 0.0 || turn(m, A, constant, z, tangent, &side, work, systems)) return 1;
    }
    return 1;
}

int cfem_law(int m, const double *W, const double *free, double mu, double *lambda, double *room, int *systems) {
    const int n = 3 * m;
    double *const found = room + CFEM_LAW_ROOM(m) - n;
    for (int a = 0; a < n * n; a++)
        if (!cfem_finite(W[a])) return 1;
    if (!newton(m, W, free, mu, lambda, room, systems)) return 0;
    for (int a = 0; a < n; a++) found[a] = 0.0;
    int status = newton(m, W, free, mu, found, room, systems);
    if (status && mu > 0.0) status = along_friction(m, W, free, mu, found, room, systems);
    for (int a = 0; a < n && !status; a++) lambda[a] = found[a];
    return status;
}
