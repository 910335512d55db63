/* Implicit midpoint rule of T = v . M v / 2, U = Psi(delta) + kappa eta . eta / 2, M = B^T B, B a root learned as a Chebyshev series:
 * as src/cfem/motion/step.py has it. */
#include "cfem_motion.h"

#include <math.h>
#include <string.h>

#define NA CFEM_MOTION_NA
#define NR (CFEM_MOTION_NQ - CFEM_MOTION_NA)
#define NQ CFEM_MOTION_NQ
#define NE CFEM_MOTION_NE
#define TRIANGLE (NQ * (NQ + 1) / 2)
#define FORCES (NA + NA * (NA + 1) / 2)   /* pull and its slopes */
#define STATIC (FORCES + NE)              /* and the effectors */
#define MOVING (TRIANGLE + NE * NR)       /* root of M, H */
#define CURVE (CFEM_MOTION_CURVED ? NE * NR * (NR + 1) / 2 : 1)
#define DEGREES (CFEM_MOTION_DEGREE + 1)
#define ITERATIONS 30
#define EXPANSIONS 30
#define BLOCK 4
#define TOLERANCE 1e-8
#define NEAR 1e-4 /* of the half width of the learned box */

/* T_k and T_k' of each coordinate. */
typedef struct {
    double value[NA][DEGREES], slope[NA][DEGREES];
} polynomials;

static void evaluate(const double to_box[NA][NA], const double *offset, const double *s, polynomials *t) {
    for (int i = 0; i < NA; i++) {
        double z = offset[i];
        for (int j = 0; j < NA; j++) z += to_box[i][j] * s[j];
        double *value = t->value[i], *slope = t->slope[i];
        value[0] = 1.0, slope[0] = 0.0;
        if (DEGREES > 1) value[1] = z, slope[1] = 1.0;
        for (int k = 2; k < DEGREES; k++) {
            value[k] = 2.0 * z * value[k - 1] - value[k - 2];
            slope[k] = 2.0 * value[k - 1] + 2.0 * z * slope[k - 1] - slope[k - 2];
        }
    }
}

static double product(const polynomials *t, const uint8_t *degrees) {
    double phi = t->value[0][degrees[0]];
    for (int i = 1; i < NA; i++) phi *= t->value[i][degrees[i]];
    return phi;
}

/* out[o] += sum of BLOCK weights times BLOCK rows of coefficients: as many terms at once as share what is read and written of `out`. */
static void add_block(int count, const double *restrict w, const double *const *c, double *restrict out) {
    const double *restrict a = c[0], *restrict b = c[1], *restrict d = c[2], *restrict e = c[3];
    for (int o = 0; o < count; o++) out[o] += w[0] * a[o] + w[1] * b[o] + w[2] * d[o] + w[3] * e[o];
}

/* out[o] = sum over terms of series[term][from + o] phi(s), o < count. */
static void sum(int terms, int outputs, int from, int count, const double *series, const uint8_t *degrees, const polynomials *t,
                double *out) {
    for (int o = 0; o < count; o++) out[o] = 0.0;
    for (int m = 0; m < terms; m += BLOCK) {
        const double *c[BLOCK];
        double w[BLOCK];
        for (int k = 0; k < BLOCK; k++) {
            const int term = m + k < terms ? m + k : 0;
            w[k] = m + k < terms ? product(t, degrees + term * NA) : 0.0, c[k] = series + term * outputs + from;
        }
        add_block(count, w, c, out);
    }
}

/* rows[0]: the root of M; rows[1 + i]: its derivative by coordinate i of the box. */
static void roots(const polynomials *t, double rows[1 + NA][TRIANGLE]) {
    memset(rows, 0, sizeof(double) * (1 + NA) * TRIANGLE);
    for (int m = 0; m < CFEM_MOTION_MOVING_TERMS; m += BLOCK) {
        const double *c[BLOCK];
        double w[1 + NA][BLOCK] = {{0}};
        for (int k = 0; k < BLOCK; k++) {
            const int term = m + k < CFEM_MOTION_MOVING_TERMS ? m + k : 0;
            const uint8_t *degrees = cfem_motion_moving_degrees[term];
            double after[NA + 1], before = 1.0;
            c[k] = cfem_motion_moving[term];
            if (m + k >= CFEM_MOTION_MOVING_TERMS) continue;
            after[NA] = 1.0;
            for (int i = NA - 1; i >= 0; i--) after[i] = after[i + 1] * t->value[i][degrees[i]];
            w[0][k] = after[0];
            for (int i = 0; i < NA; i++) {
                w[1 + i][k] = before * t->slope[i][degrees[i]] * after[i + 1];
                before *= t->value[i][degrees[i]];
            }
        }
        for (int i = 0; i <= NA; i++) add_block(TRIANGLE, w[i], c, rows[i]);
    }
}

/* out (NQ,) = S x, S symmetric as its upper triangle. */
static void times(const double *S, const double *x, double *out) {
    for (int i = 0; i < NQ; i++) out[i] = 0.0;
    for (int i = 0; i < NQ; i++) {
        out[i] += *S++ * x[i];
        for (int j = i + 1; j < NQ; j++, S++) out[i] += *S * x[j], out[j] += *S * x[i];
    }
}

/* A += factor D S^2 D, S symmetric as its triangle, D = 1 / scale. */
static void add_square(const double *S, double factor, double A[NQ][NQ]) {
    double full[NQ][NQ];
    for (int i = 0; i < NQ; i++)
        for (int j = i; j < NQ; j++) full[i][j] = full[j][i] = *S++;
    for (int i = 0; i < NQ; i++)
        for (int j = i; j < NQ; j++) {
            double dot = 0.0;
            for (int k = 0; k < NQ; k++) dot += full[i][k] * full[j][k];
            dot *= factor / (cfem_motion_scale[i] * cfem_motion_scale[j]);
            A[i][j] += dot;
            if (i != j) A[j][i] += dot;
        }
}

/* The equations of a step where the learned functions are expanded about a place near its middle: as src/cfem/motion/expansion.py has
 * them. rows: of `roots`; drag: of the viscous force by v; known: forces that do not depend on v. */
typedef struct {
    double about[NA], rows[1 + NA][TRIANGLE], pull[NA], stiff[NA][NA], M[NQ][NQ], drag[NQ][NQ], known[NQ];
} expansion;

static void expand(const cfem_motion *motion, const double *command, const int *held, const double *v, double dt, expansion *near) {
    double forces[FORCES];
    polynomials t;
    memset(near, 0, sizeof *near);
    for (int a = 0; a < NA; a++) near->about[a] = motion->q[a] + dt / 2 * v[a];
    evaluate(cfem_motion_static_to_box, cfem_motion_static_offset, near->about, &t);
    sum(CFEM_MOTION_STATIC_TERMS, STATIC, 0, FORCES, cfem_motion_static[0], cfem_motion_static_degrees[0], &t, forces);
    const double *stiff = forces + NA;
    for (int a = 0; a < NA; a++) {
        near->pull[a] = forces[a], near->known[a] = held[a] ? 0.0 : command[a];
        for (int b = a; b < NA; b++, stiff++) near->stiff[a][b] = near->stiff[b][a] = *stiff;
    }
    evaluate(cfem_motion_moving_to_box, cfem_motion_moving_offset, near->about, &t);
    roots(&t, near->rows);
    add_square(near->rows[0], 1.0, near->M);
    for (int l = 0, term = 0; l < CFEM_MOTION_LOSSES; l++) {
        double S[TRIANGLE], rate = cfem_motion_relaxation[l], moved[NQ] = {0}, once[NQ], twice[NQ];
        for (int k = 0; k < cfem_motion_prony_terms[l]; k++, term++) {
            const double half = dt / (2 * cfem_motion_prony[term][1]), share = cfem_motion_prony[term][0] / (1 + half);
            rate += share * dt / 2;
            for (int i = 0; i < NQ; i++) moved[i] += share * motion->memory[term][i] / cfem_motion_scale[i];
        }
        sum(CFEM_MOTION_LOSS_TERMS, CFEM_MOTION_LOSSES * TRIANGLE, l * TRIANGLE, TRIANGLE, cfem_motion_loss[0],
            cfem_motion_loss_degrees[0], &t, S);
        times(S, moved, once);
        times(S, once, twice);
        for (int i = 0; i < NQ; i++) near->known[i] -= twice[i] / cfem_motion_scale[i];
        add_square(S, rate, near->drag);
    }
}

/* At mean velocity v. rest: dt/2 (dL/dq + Q) + p - M v; turning: dt/2 times the slope of M v by the place; Mv. */
typedef struct {
    double rest[NQ], turning[NA][NQ], Mv[NQ];
} equations;

static void assemble(const cfem_motion *motion, const expansion *near, const double *v, double dt, equations *at) {
    double Dv[NQ], Sv[NQ], by_z[NA][NQ], force[NQ], ahead[NA];
    for (int i = 0; i < NQ; i++) Dv[i] = v[i] / cfem_motion_scale[i];
    times(near->rows[0], Dv, Sv);
    for (int k = 0; k < NA; k++) { /* D (dS S + S dS) D v */
        double dSv[NQ], one[NQ], other[NQ];
        times(near->rows[1 + k], Dv, dSv);
        times(near->rows[1 + k], Sv, one);
        times(near->rows[0], dSv, other);
        for (int i = 0; i < NQ; i++) by_z[k][i] = (one[i] + other[i]) / cfem_motion_scale[i];
    }
    for (int i = 0; i < NQ; i++) {
        at->Mv[i] = 0.0, force[i] = near->known[i];
        for (int j = 0; j < NQ; j++) at->Mv[i] += near->M[i][j] * v[j], force[i] -= near->drag[i][j] * v[j];
    }
    for (int a = 0; a < NA; a++) {
        ahead[a] = motion->q[a] + dt / 2 * v[a] - near->about[a];
        for (int i = 0; i < NQ; i++) {
            double by_turn = 0.0;
            for (int k = 0; k < NA; k++) by_turn += cfem_motion_moving_to_box[k][a] * by_z[k][i];
            at->Mv[i] += ahead[a] * by_turn, force[a] += by_turn * v[i] / 2;
            at->turning[a][i] = dt / 2 * by_turn;
        }
        force[a] -= near->pull[a];
    }
    for (int a = 0; a < NA; a++)
        for (int b = 0; b < NA; b++) force[a] -= near->stiff[a][b] * ahead[b];
    for (int r = NA; r < NQ; r++) force[r] -= cfem_motion_stiffness * (motion->q[r] + dt / 2 * v[r]);
    for (int i = 0; i < NQ; i++) at->rest[i] = dt / 2 * force[i] + motion->p[i] - at->Mv[i];
}

/* Minus the derivative of rest by v, but for how M differs from that at `about`. */
static void slopes(const expansion *near, const equations *at, double dt, double slope[NQ][NQ]) {
    for (int i = 0; i < NQ; i++)
        for (int j = 0; j < NQ; j++) slope[i][j] = near->M[i][j] + dt / 2 * near->drag[i][j];
    for (int a = 0; a < NA; a++) {
        for (int b = 0; b < NA; b++) slope[a][b] += dt * dt / 4 * near->stiff[a][b];
        for (int i = 0; i < NQ; i++) slope[i][a] += at->turning[a][i], slope[a][i] -= at->turning[a][i];
    }
    for (int r = NA; r < NQ; r++) slope[r][r] += dt * dt / 4 * cfem_motion_stiffness;
}

/* x of A x = b, n unknowns, by elimination with row pivots; 1 where A is singular. */
static int solve(int n, double A[NQ][NQ], double *b) {
    for (int k = 0; k < n; k++) {
        int pivot = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(A[i][k]) > fabs(A[pivot][k])) pivot = i;
        if (!(fabs(A[pivot][k]) > 0.0)) return 1;
        if (pivot != k) {
            double row[NQ];
            memcpy(row, A[k], sizeof row), memcpy(A[k], A[pivot], sizeof row), memcpy(A[pivot], row, sizeof row);
            const double value = b[k];
            b[k] = b[pivot], b[pivot] = value;
        }
        for (int i = k + 1; i < n; i++) {
            const double factor = A[i][k] / A[k][k];
            for (int j = k + 1; j < n; j++) A[i][j] -= factor * A[k][j];
            b[i] -= factor * b[k];
        }
    }
    for (int k = n - 1; k >= 0; k--) {
        for (int j = k + 1; j < n; j++) b[k] -= A[k][j] * b[j];
        b[k] /= A[k][k];
    }
    return 0;
}

void cfem_motion_rest(cfem_motion *motion, const double *delta_a) {
    double forces[FORCES];
    polynomials t;
    memset(motion, 0, sizeof *motion);
    for (int a = 0; a < NA; a++) motion->q[a] = delta_a[a];
    evaluate(cfem_motion_static_to_box, cfem_motion_static_offset, delta_a, &t);
    sum(CFEM_MOTION_STATIC_TERMS, STATIC, 0, FORCES, cfem_motion_static[0], cfem_motion_static_degrees[0], &t, forces);
    for (int a = 0; a < NA; a++) motion->lambda_a[a] = forces[a];
}

/* Newton's method from v, whose n entries `free` are changed; v, what is left, and the impulse M v, these two to first order in the last
 * change. 1 where it does not end. */
static int newton(const cfem_motion *motion, const expansion *near, const int *free, int n, double dt, double *v, double *left,
                  double *impulse) {
    double before = HUGE_VAL, size = 0.0;
    for (int i = 0; i < NQ; i++) size = fmax(size, fmax(fabs(v[i]), 1e-6 / dt) / cfem_motion_scale[i]);
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        double slope[NQ][NQ], A[NQ][NQ], change[NQ], full[NQ] = {0}, moved = 0.0;
        equations at;
        assemble(motion, near, v, dt, &at);
        slopes(near, &at, dt, slope);
        for (int i = 0; i < n; i++) {
            for (int j = 0; j < n; j++) A[i][j] = slope[free[i]][free[j]];
            change[i] = at.rest[free[i]];
        }
        if (solve(n, A, change)) return 1;
        for (int i = 0; i < n; i++) {
            full[free[i]] = change[i], v[free[i]] += change[i];
            moved = fmax(moved, fabs(change[i]) / cfem_motion_scale[free[i]]);
        }
        if (!(moved - moved == 0.0)) return 1;
        const double rate = before == HUGE_VAL ? 1.0 : fmin(moved / before, 1.0);
        before = moved;
        if (moved * rate > TOLERANCE * size) continue;
        for (int i = 0; i < NQ; i++) {
            left[i] = at.rest[i], impulse[i] = at.Mv[i];
            for (int j = 0; j < NQ; j++) left[i] -= slope[i][j] * full[j], impulse[i] += near->M[i][j] * full[j];
            for (int a = 0; a < NA; a++) impulse[i] += at.turning[a][i] * full[a];
        }
        return 0;
    }
    return 1;
}

int cfem_motion_step(cfem_motion *motion, const double *command, const int *held, double dt) {
    double v[NQ], left[NQ], impulse[NQ];
    int free[NQ], n = 0;
    expansion near;
    for (int i = 0; i < NQ; i++) {
        if (i >= NA || !held[i]) free[n++] = i, v[i] = motion->v[i] + dt * motion->gain[i];
        else v[i] = (command[i] - motion->q[i]) / dt;
        if (!(v[i] - v[i] == 0.0)) return 1;
    }
    for (int count = 0; count < EXPANSIONS; count++) {
        double apart = 0.0;
        expand(motion, command, held, v, dt, &near);
        if (newton(motion, &near, free, n, dt, v, left, impulse)) return 1;
        for (int k = 0; k < NA; k++) {
            double z = 0.0;
            for (int a = 0; a < NA; a++) z += cfem_motion_moving_to_box[k][a] * (motion->q[a] + dt / 2 * v[a] - near.about[a]);
            apart = fmax(apart, fabs(z));
        }
        if (apart > NEAR) continue;
        for (int i = 0; i < NQ; i++) {
            if (i < NA) motion->lambda_a[i] = held[i] ? -2 / dt * left[i] : command[i];
            motion->p[i] = 2 * impulse[i] - motion->p[i];
            motion->q[i] += dt * v[i];
            motion->gain[i] = (v[i] - motion->v[i]) / dt;
            motion->v[i] = v[i];
        }
        for (int term = 0; term < CFEM_MOTION_TERMS; term++) {
            const double half = dt / (2 * cfem_motion_prony[term][1]);
            for (int i = 0; i < NQ; i++) motion->memory[term][i] = ((1 - half) * motion->memory[term][i] + dt * v[i]) / (1 + half);
        }
        motion->t += dt;
        return 0;
    }
    return 1;
}

void cfem_motion_effectors(const cfem_motion *motion, double *effectors) {
    double H[NE * NR];
    polynomials t;
    evaluate(cfem_motion_static_to_box, cfem_motion_static_offset, motion->q, &t);
    sum(CFEM_MOTION_STATIC_TERMS, STATIC, FORCES, NE, cfem_motion_static[0], cfem_motion_static_degrees[0], &t, effectors);
    evaluate(cfem_motion_moving_to_box, cfem_motion_moving_offset, motion->q, &t);
    sum(CFEM_MOTION_MOVING_TERMS, MOVING, TRIANGLE, NE * NR, cfem_motion_moving[0], cfem_motion_moving_degrees[0], &t, H);
    for (int e = 0; e < NE; e++)
        for (int r = 0; r < NR; r++) effectors[e] += H[e * NR + r] * motion->q[NA + r];
    if (!CFEM_MOTION_CURVED) return;
    double curve[CURVE];
    const double *E = curve;
    sum(CFEM_MOTION_CURVE_TERMS, CURVE, 0, CURVE, cfem_motion_curve[0], cfem_motion_curve_degrees[0], &t, curve);
    for (int e = 0; e < NE; e++)
        for (int r = NA; r < NQ; r++)
            for (int s = r; s < NQ; s++) effectors[e] += *E++ * motion->q[r] * motion->q[s] * (s == r ? 0.5 : 1.0);
}
