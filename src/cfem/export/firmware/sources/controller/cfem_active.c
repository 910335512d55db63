/* The dual active set of Goldfarb and Idnani, on a QR factorisation of the active normals. */
#include "cfem_active.h"

#include <string.h>

#include "cfem_linear.h"

#define DEPENDENT CFEM_TOLERANCE(1e-22, 1e-11) /* squared length of a unit normal outside of the active ones: less depends on them, */
#define PRICED_DEPENDENT CFEM_TOLERANCE(1e-11, 1e-6) /* where it is a difference of squares */
#define ENOUGH 0.01             /* share of the square of a normal that one pass may leave: less loses more than a digit */
#define RELIEVED CFEM_TOLERANCE(1e-14, 1e-6) /* share of a normal in an active one below which its multiplier does not fall */

static double *row_of(const cfem_active *set, int k) { return set->R + k * (k + 3) / 2; }

/* v := R^-1 v, and R^-T v, of the first `count` rows. */
static void solve_lower(const cfem_active *set, double *v) {
    for (int i = 0; i < set->count; i++) v[i] = (v[i] - cfem_dot(i, row_of(set, i), v)) / row_of(set, i)[i];
}
static void solve_upper(const cfem_active *set, double *v) {
    for (int i = set->count - 1; i >= 0; i--) {
        const double *const row = row_of(set, i);
        v[i] /= row[i];
        for (int j = 0; j < i; j++) v[j] -= row[j] * v[i];
    }
}

/* y (n,) += sum of parts times the rows of Q, two at once: y is read and written half as often. */
static void add_rows(int n, int count, const double *part, const double *Q, double *restrict y) {
    int i = 0;
    for (; i + 1 < count; i += 2) {
        const double *restrict const p = Q + i * n, *restrict const q = p + n, a = part[i], b = part[i + 1];
        for (int j = 0; j < n; j++) y[j] += a * p[j] + b * q[j];
    }
    for (int j = 0; j < n && i < count; j++) y[j] += part[i] * Q[i * n + j];
}

/* Splits the normal in the next row of Q into its shares in the rows before, the next row of R, and a remainder, by Gram-Schmidt, done twice
 * where little remains. The squared length of the remainder, with that in the directions of `miss`. */
static double orthogonalise(cfem_active *set, double normal_square, double price) {
    const int n = set->n, count = set->count;
    double *const rest = set->Q + count * n, *const share = row_of(set, count), *const part = set->force + set->most, left = normal_square;
    for (int i = 0; i < count; i++) share[i] = 0.0;
    for (int pass = 0; pass < 2 && !(pass && (set->priced || left > ENOUGH * normal_square)); pass++) {
        for (int i = 0; i < count; i++) part[i] = -cfem_dot(n, set->Q + i * n, rest), share[i] -= part[i];
        add_rows(n, count, part, set->Q, rest);
        left = cfem_dot(n, rest, rest);
    }
    return set->priced ? normal_square + price - cfem_dot(count, share, share) : left;
}

/* Drops active constraint number `slot`: its row of R, and by rotations what stands right of the diagonal then. */
static void drop(cfem_active *set, int slot) {
    const int n = set->n, count = --set->count;
    set->state[set->which[slot]] = CFEM_FREE, set->changes++;
    for (int i = slot; i < count; i++) {
        memcpy(row_of(set, i), row_of(set, i + 1), sizeof(double) * (size_t)(i + 2));
        set->which[i] = set->which[i + 1], set->sign[i] = set->sign[i + 1], set->force[i] = set->force[i + 1];
        set->bound[i] = set->bound[i + 1];
    }
    for (int j = slot; j < count; j++) {
        const double a = row_of(set, j)[j], b = row_of(set, j)[j + 1], length = sqrt(a * a + b * b), c = a / length, s = b / length;
        double *restrict const p = set->Q + j * n, *restrict const q = p + n;
        for (int i = j; i < count; i++) {
            double *const row = row_of(set, i), left = row[j], right = row[j + 1];
            row[j] = c * left + s * right, row[j + 1] = c * right - s * left;
        }
        for (int i = 0; i < n; i++) {
            const double left = p[i], right = q[i];
            p[i] = c * left + s * right, q[i] = c * right - s * left;
        }
    }
}

/* y and the multipliers from scratch, which takes out what rounding has left. */
static void recompute(cfem_active *set, double *y) {
    memcpy(set->force, set->bound, sizeof(double) * (size_t)set->count);
    solve_lower(set, set->force);
    for (int j = 0; j < set->n; j++) y[j] = 0.0;
    add_rows(set->n, set->count, set->force, set->Q, y);
    solve_upper(set, set->force);
}

/* Makes constraint k active, and drops those that it relieves. The status. */
static int activate(cfem_active *set, const cfem_program *program, int k, double sign, int steps, double *y) {
    const int n = set->n;
    double *const normal = set->Q + (set->most + 1) * n, *const r = set->force + set->most, multiplier = 0.0;
    const cfem_bound side = program->bound(program->with, k, sign, normal);
    const double normal_square = cfem_dot(n, normal, normal), least = (set->priced ? PRICED_DEPENDENT : DEPENDENT) * (normal_square + side.price);
    double violation = side.bound - cfem_dot(n, normal, y);
    while (set->changes < steps) {
        const int count = set->count;
        double *const rest = set->Q + count * n, partial = HUGE_VAL;
        int slot = -1;
        memcpy(rest, normal, sizeof(double) * (size_t)n);
        const double square = orthogonalise(set, normal_square, side.price);
        const int independent = square > least && count < set->most;
        memcpy(r, row_of(set, count), sizeof(double) * (size_t)count);
        solve_upper(set, r);
        for (int i = 0; i < count; i++)
            if (r[i] > RELIEVED && set->force[i] < partial * r[i]) partial = set->force[i] / r[i], slot = i;
        if (!independent && slot < 0) {
            set->state[k] = CFEM_MEETING;
            return violation > side.meets ? CFEM_QP_INFEASIBLE : CFEM_QP_OPTIMAL;
        }
        const double full = independent ? violation / square : HUGE_VAL, t = full < partial ? full : partial;
        for (int i = 0; i < count; i++) set->force[i] -= t * r[i];
        multiplier += t;
        if (independent) {
            for (int j = 0; j < n; j++) y[j] += t * rest[j];
            violation -= t * square;
        }
        if (t < full) {
            drop(set, slot);
            continue;
        }
        const double norm = row_of(set, count)[count] = sqrt(square);
        for (int j = 0; j < n; j++) rest[j] /= norm;
        set->which[count] = k, set->sign[count] = sign, set->bound[count] = side.bound, set->force[count] = multiplier;
        set->state[k] = CFEM_ACTIVE, set->count++, set->changes++;
        return CFEM_QP_OPTIMAL;
    }
    return CFEM_QP_ITERATIONS;
}

int cfem_active_solve(cfem_active *set, const cfem_program *program, int steps, double *y) {
    int settled = 1;
    set->count = set->changes = 0;
    memset(set->state, CFEM_FREE, (size_t)set->constraints);
    for (int j = 0; j < set->n; j++) y[j] = 0.0;
    while (set->changes < steps) {
        double sign = 1.0;
        const int k = program->violated(program->with, y, set->state, &sign);
        if (k >= 0) {
            settled = 0;
            const int status = activate(set, program, k, sign, steps, y);
            if (status) return status;
            continue;
        }
        if (settled) return CFEM_QP_OPTIMAL;
        recompute(set, y);
        settled = 1;
        int worst = -1;
        for (int i = 0; i < set->count; i++)
            if (set->force[i] < (worst < 0 ? 0.0 : set->force[worst])) worst = i;
        if (worst >= 0) { /* rounding had hidden that this one need not hold */
            drop(set, worst);
            recompute(set, y);
            settled = 0;
        }
    }
    return CFEM_QP_ITERATIONS;
}

void cfem_active_refine(cfem_active *set, double *left, double *step) {
    const int n = set->n;
    solve_lower(set, left);
    for (int i = 0; i < set->count; i++) left[i] -= cfem_dot(n, set->Q + i * n, step);
    add_rows(n, set->count, left, set->Q, step);
    solve_upper(set, left);
    for (int i = 0; i < set->count; i++) set->force[i] = fmax(0.0, set->force[i] + left[i]);
}
