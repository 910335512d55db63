/* Modules in a row under the loads of cfem_data.h, each known by an unloaded model of its own. A wrench w on the effectors y, and forces on
 * patches, have the potential V = -w . y(e) of the modules' poses and patches e, so that module i bears w_i = -dV/de_i, and
 *
 *     e = E(s, -dV/de)        by Newton's method, with the Jacobian 1 + C V_ee
 *
 * With S = (1 + C V_ee)^-1, G = dE/ds, K of the modules and B = dy/de: d lambda / ds = K + G^T V_ee S G, dy/ds = B S G. */
#include "cfem_row.h"

#if CFEM_ROW

#include "cfem_linear.h"
#include "cfem_parts.h"

#define K CFEM_MODULES
#define P CFEM_ROW_EACH
#define N CFEM_ROW_N
#define NA CFEM_NA
#define ITERATIONS 50
#define TOLERANCE CFEM_TOLERANCE(1e-11, 1e-5) /* of a module's length and of a radian: the largest Newton step of a row that is solved */
#define FARTHEST 6.0    /* lengths of a module and radians: no pose is farther away */
#define NEAR 0.5        /* share of the load that would buckle a module, by its model: up to here it is believed */

/* The wrench on module i of that number, as a module of softness 1 would bear it. */
static void wrench_on(int i, const double work[N], double w[P]) {
    for (int r = 0; r < P; r++) w[r] = cfem_softer[i] * work[i * P + r];
}

/* The row's poses e, with B, `work` and V there, and A = 1 + C V. CFEM_OK or CFEM_NO_MODEL; m has the steps. */
static unsigned settle(const cfem_held held[K], double e[K][P], double y[CFEM_NE], double B[CFEM_NE][N], double work[N],
                       double V[N][N], double A[N][N], cfem_condensed *m) {
    for (int i = 0; i < K; i++)
        for (int r = 0; r < P; r++) e[i][r] = held[i].pose[r];
    for (int step = 1; step <= ITERATIONS; step++) {
        double missing[N], change = 0.0, farthest = 0.0, ratio = 0.0, solved[N][N], sign;
        cfem_row_places(e, y, B, work, V);
        for (int i = 0; i < K; i++) {
            cfem_carried under;
            double w[P];
            wrench_on(i, work, w);
            cfem_module_under(&held[i], w, &under);
            if (under.ratio > ratio) ratio = under.ratio;
            for (int r = 0; r < P; r++) {
                missing[i * P + r] = under.pose[r] - e[i][r];
                for (int n = 0; n < N; n++) {
                    double sum = i * P + r == n;
                    for (int q = 0; q < P; q++) sum += cfem_softer[i] * under.C[r][q] * V[i * P + q][n];
                    A[i * P + r][n] = solved[i * P + r][n] = sum;
                }
            }
        }
        if (cfem_eliminate(N, solved[0], 1, missing, &sign)) return CFEM_NO_MODEL;
        for (int i = 0; i < K; i++)
            for (int r = 0; r < P; r++) {
                const double unit = r >= 3 && r < 6 ? 1.0 : CFEM_MODULE_LENGTH;
                const double moved = fabs(missing[i * P + r]) / unit, place = fabs(e[i][r] + missing[i * P + r]) / unit;
                if (!(moved <= change)) change = moved;
                if (!(place <= farthest)) farthest = place;
            }
        m->steps = step, m->change = change;
        if (change <= TOLERANCE) return ratio <= NEAR ? CFEM_OK : CFEM_NO_MODEL;
        if (!(farthest < FARTHEST)) return CFEM_NO_MODEL;
        for (int i = 0; i < K; i++)
            for (int r = 0; r < P; r++) e[i][r] += missing[i * P + r];
    }
    return CFEM_NO_MODEL;
}

unsigned cfem_row(const double s[NA], cfem_condensed *m) {
    cfem_held held[K];
    double e[K][P], y[CFEM_NE], B[CFEM_NE][N], work[N], V[N][N], A[N][N], X[N][NA], G[N][NA], slope[CFEM_NE][NA], sign;
    int first[K + 1];
    first[0] = 0;
    for (int i = 0; i < K; i++) {
        const cfem_module *const model = &cfem_modules[cfem_module_model[i]];
        cfem_module_at(model, s + first[i], &held[i]);
        first[i + 1] = first[i] + model->n_a;
    }
    unsigned status = settle(held, e, y, B, work, V, A, m);
    for (int n = 0; n < N; n++)
        for (int j = 0; j < NA; j++) G[n][j] = X[n][j] = 0.0;
    for (int i = 0; i < NA; i++)
        for (int j = 0; j < NA; j++) m->W_aa[i][j] = 0.0;
    for (int i = 0; i < K; i++) {
        const int n_a = held[i].model->n_a;
        double w[P], lambda[CFEM_MODULE_NA], stiffness[CFEM_ROW_PAIRS], own[P][CFEM_MODULE_NA];
        wrench_on(i, work, w);
        cfem_module_slopes(&held[i], w, lambda, stiffness, own);
        for (int j = 0, next = 0; j < n_a; j++) {
            m->delta_a[first[i] + j] = s[first[i] + j], m->lambda_a[first[i] + j] = lambda[j] / cfem_softer[i];
            for (int k = j; k < n_a; k++, next++) m->W_aa[first[i] + j][first[i] + k] = stiffness[next] / cfem_softer[i];
            for (int r = 0; r < P; r++) G[i * P + r][first[i] + j] = X[i * P + r][first[i] + j] = own[r][j];
        }
    }
    if (cfem_eliminate(N, A[0], NA, X[0], &sign)) status = CFEM_NO_MODEL;
    for (int i = 0; i < NA; i++) /* V is symmetric, and V S with it */
        for (int n = 0; n < N; n++) {
            if (G[n][i] == 0.0) continue;
            for (int j = i; j < NA; j++)
                for (int k = 0; k < N; k++) m->W_aa[i][j] += G[n][i] * V[n][k] * X[k][j];
        }
    if (cfem_invert(NA, CFEM_MOST_NA, &m->W_aa[0][0])) status = CFEM_NO_MODEL;
    for (int r = 0; r < CFEM_NE; r++) {
        for (int j = 0; j < NA; j++) {
            slope[r][j] = 0.0;
            for (int n = 0; n < N; n++) slope[r][j] += B[r][n] * X[n][j];
        }
        for (int j = 0; j < NA; j++) m->W_ea[r][j] = cfem_dot(NA, slope[r], m->W_aa[j]);
        m->free_e[r] = y[r] - cfem_rest_e[r] - cfem_dot(NA, m->W_ea[r], m->lambda_a);
    }
    for (int i = 0; i < NA; i++) m->free_a[i] = m->delta_a[i] - cfem_dot(NA, m->W_aa[i], m->lambda_a);
    return status;
}

#endif
