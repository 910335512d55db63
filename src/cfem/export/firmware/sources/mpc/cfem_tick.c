/* A tick of the condensed robot in motion, linearised: its factors, what it does to columns of states and commands. */
#include "cfem_tick.h"

#include <string.h>

#include "cfem_block.h"
#include "cfem_linear.h"
#include "cfem_parts.h"

#define NA CFEM_MOTION_NA
#define NQ CFEM_MOTION_NQ
#define NR CFEM_MOTION_NR
#define NE CFEM_MOTION_NE
#define NZ CFEM_MPC_NZ
#define MOST_NA CFEM_MOTION_MOST_NA
#define MOST_NQ CFEM_MOTION_MOST_NQ
#define DT CFEM_MPC_DT
#define HELD (!CFEM_MPC_FORCE)
#define FIRST (HELD ? NA : 0) /* of q that the equations give */
#define ITERATIONS 4
#define SETTLED 1e-4

/* What m columns do: right (NQ, m) of the equations, which what is held (X of actuators, known) is taken off; X (NQ, m) = v. */
CFEM_INLINE void respond(const cfem_stage *s, int m, double right[MOST_NQ * MOST_NA], double X[MOST_NQ * MOST_NA], double *lambda,
                         int stride) {
    if (HELD) {
        double held[MOST_NA * MOST_NA];
        for (int i = 0; i < NA * m; i++) held[i] = -X[i];
        cfem_add_product(NR, NA, s->held[NA], MOST_NA, m, held, m, right + NA * m, m);
    }
    for (int i = FIRST * m; i < NQ * m; i++) X[i] = right[i];
    cfem_solve((const double(*)[CFEM_MOTION_MOST_NQ])s->factor, s->pivots, FIRST, NQ, m, X);
    if (!HELD || !lambda) return;
    for (int a = 0; a < NA; a++) /* what the rows of the actuators lack */
        for (int c = 0; c < m; c++) {
            double sum = -right[a * m + c];
            for (int j = 0; j < NQ; j++) sum += s->holding[a][j] * X[j * m + c];
            lambda[a * stride + c] = 2.0 / DT * sum;
        }
}

/* The state after v = X: out (NZ, m). */
CFEM_INLINE void arrive(const cfem_stage *s, int m, const double *z, int stride, const double *X, double *out) {
    double moved[MOST_NA * MOST_NA], impulse[MOST_NQ * MOST_NA];
    for (int a = 0; a < NA; a++) CFEM_UNROLL for (int c = 0; c < m; c++) moved[a * m + c] = DT / 2 * X[a * m + c];
    for (int a = 0; z && a < NA; a++) CFEM_UNROLL for (int c = 0; c < m; c++) moved[a * m + c] += z[a * stride + c];
    for (int i = 0; i < NQ * m; i++) impulse[i] = 0.0;
    cfem_add_product(NQ, NQ, s->M[0], MOST_NQ, m, X, m, impulse, m);
    cfem_add_product(NQ, NA, s->turning[0], MOST_NA, m, moved, m, impulse, m);
    for (int i = 0; i < NQ; i++) {
        const double *x = X + i * m, *p = impulse + i * m;
        double *q = out + i * stride, *after = out + (NQ + i) * stride;
        CFEM_UNROLL for (int c = 0; c < m; c++) q[c] = DT * x[c], after[c] = 2.0 * p[c];
        for (int t = 0; t < CFEM_MOTION_TERMS; t++) {
            const double by = DT / (1.0 + DT / (2.0 * cfem_motion_prony[t][1]));
            for (int c = 0; c < m; c++) out[((2 + t) * NQ + i) * stride + c] = by * x[c];
        }
    }
    if (!z) return;
    for (int i = 0; i < NQ; i++) {
        const double *q = z + i * stride, *p = z + (NQ + i) * stride;
        double *to = out + i * stride, *after = out + (NQ + i) * stride;
        CFEM_UNROLL for (int c = 0; c < m; c++) to[c] += q[c], after[c] -= p[c];
        for (int t = 0; t < CFEM_MOTION_TERMS; t++) {
            const double half = DT / (2.0 * cfem_motion_prony[t][1]), by = (1.0 - half) / (1.0 + half);
            for (int c = 0, row = ((2 + t) * NQ + i) * stride; c < m; c++) out[row + c] += by * z[row + c];
        }
    }
}

CFEM_INLINE void apply(const cfem_stage *s, int m, int stride, const double *z, const double *w, double share, double *out,
                       double *lambda) {
    double right[MOST_NQ * MOST_NA], X[MOST_NQ * MOST_NA];
    for (int i = 0; i < NQ * m; i++) right[i] = 0.0;
    if (z) {
        double back[MOST_NA * MOST_NA];
        for (int i = 0; i < NQ; i++) {
            const double *q = z + i * stride, *p = z + (NQ + i) * stride, inner = i < NA ? 0.0 : s->inner;
            double *to = right + i * m;
            CFEM_UNROLL for (int c = 0; c < m; c++) to[c] = p[c] - inner * q[c];
        }
        for (int a = 0; a < NA; a++) CFEM_UNROLL for (int c = 0; c < m; c++) back[a * m + c] = -z[a * stride + c];
        cfem_add_product(NQ, NA, s->turning[0], MOST_NA, m, back, m, right, m);
        cfem_add_product(NA, NA, s->stiff[0], MOST_NA, m, back, m, right, m);
        for (int l = 0, t = 0; l < CFEM_MOTION_LOSSES; l++)
            for (int k = 0; k < cfem_motion_prony_terms[l]; k++, t++) {
                const double by = -cfem_motion_prony[t][0] / (1.0 + DT / (2.0 * cfem_motion_prony[t][1]));
                for (int c = 0; c < m; c++) {
                    double one[MOST_NQ], sum[MOST_NQ] = {0};
                    for (int i = 0; i < NQ; i++) one[i] = z[((2 + t) * NQ + i) * stride + c];
                    cfem_add_symmetric(by, s->F[l], one, sum);
                    for (int i = 0; i < NQ; i++) right[i * m + c] += sum[i];
                }
            }
    }
    for (int a = 0; a < NA; a++)
        for (int c = 0; c < m; c++) {
            const double by_w = w ? w[a] : share * (a == c);
            if (HELD)
                X[a * m + c] = (by_w - (z ? z[a * stride + c] : 0.0)) / DT;
            else
                right[a * m + c] += DT / 2 * by_w;
        }
    respond(s, m, right, X, lambda, stride);
    arrive(s, m, z, stride, X, out);
}

void cfem_stage_of_one(const cfem_stage *stage, const double *z, const double *w, double *out, double *lambda) {
    apply(stage, 1, 1, z, w, 0.0, out, lambda);
}

void cfem_stage_of_block(const cfem_stage *stage, int stride, const double *z, double share, double *out, double *lambda) {
    apply(stage, NA, stride, z, 0, share, out, lambda);
}

void cfem_stage_by_material(const cfem_stage *stage, double out[CFEM_MPC_MOST_NZ][2]) {
    for (int c = 0; c < 2; c++) {
        double right[MOST_NQ * MOST_NA], X[MOST_NQ * MOST_NA] = {0}, one[CFEM_MPC_MOST_NZ];
        for (int i = 0; i < NQ; i++) right[i] = stage->of_material[i][c];
        respond(stage, 1, right, X, 0, 1);
        arrive(stage, 1, 0, 1, X, one);
        for (int i = 0; i < NZ; i++) out[i][c] = one[i];
    }
}

/* Forces of viscosity, minus their slope by v onto `factor`. */
static void viscous(const double *z, const double *v, const cfem_inertia *inertia, double size, cfem_stage *s, double *force) {
    for (int l = 0, t = 0; l < CFEM_MOTION_LOSSES; l++) {
        double rate = cfem_motion_relaxation[l], x[MOST_NQ] = {0};
        for (int k = 0; k < cfem_motion_prony_terms[l]; k++, t++) {
            const double half = DT / (2.0 * cfem_motion_prony[t][1]), share = cfem_motion_prony[t][0] / (1.0 + half);
            rate += share * DT / 2;
            for (int i = 0; i < NQ; i++) x[i] += share * z[(2 + t) * NQ + i];
        }
        for (int i = 0; i < NQ; i++) x[i] += rate * v[i];
        cfem_add_symmetric(-size, inertia->F[l], x, force);
        const double *F = inertia->F[l];
        double *scaled = s->F[l];
        for (int i = 0; i < NQ; i++)
            for (int j = i; j < NQ; j++, F++) {
                if (CFEM_MOTION_TERMS) *scaled++ = DT / 2 * size * *F;
                const double by = DT / 2 * rate * size * *F;
                s->factor[i][j] += by;
                if (i != j) s->factor[j][i] += by;
            }
    }
}

int cfem_stage_at(const double *z, const double *v, const double *w, const cfem_inertia *inertia, const cfem_inertia *first,
                  const cfem_material *material, cfem_stage *s) {
    const double stiffness = material->stiffness, kappa = stiffness * cfem_motion_stiffness;
    double elastic[MOST_NQ], lost[MOST_NQ] = {0}, turned[MOST_NQ] = {0}, Mv[MOST_NQ] = {0};
    double right[MOST_NQ * MOST_NA], X[MOST_NQ * MOST_NA], by_turn[MOST_NA][MOST_NQ] = {{0}}, one[CFEM_MPC_MOST_NZ];
    cfem_parts parts;
    const double *M = inertia->M;
    for (int a = 0; a < NA; a++) s->middle[a] = z[a] + DT / 2 * v[a];
    cfem_potential_parts(s->middle, &parts);
    for (int i = 0; i < NQ; i++)
        for (int j = i; j < NQ; j++) s->M[i][j] = s->M[j][i] = *M++;
    memcpy(s->factor, s->M, sizeof s->factor);
    viscous(z, v, inertia, stiffness * material->viscosity, s, lost);
    s->inner = DT / 2 * kappa;
    for (int a = 0; a < NA; a++) {
        cfem_add_symmetric(1.0, first->dM[a], v, by_turn[a]);
        elastic[a] = -stiffness * parts.gradient[a];
        turned[a] = cfem_dot(NQ, by_turn[a], v) / 2;
    }
    for (int r = NA; r < NQ; r++) elastic[r] = -kappa * (z[r] + DT / 2 * v[r]), s->factor[r][r] += DT / 2 * s->inner;
    for (int i = 0; i < NQ; i++)
        for (int a = 0; a < NA; a++) {
            s->turning[i][a] = by_turn[a][i];
            s->factor[i][a] += DT / 2 * by_turn[a][i];
            if (i >= NA) continue;
            s->stiff[i][a] = DT / 2 * stiffness * parts.hessian[i][a];
            s->factor[i][a] += DT / 2 * s->stiff[i][a];
        }
    for (int a = 0; a < NA; a++)
        for (int j = 0; j < NQ; j++) s->factor[a][j] -= DT / 2 * by_turn[a][j];
    for (int i = 0; i < NQ && HELD; i++)
        for (int a = 0; a < NA; a++) s->held[i][a] = s->factor[i][a], s->holding[a][i] = s->factor[a][i];
    if (cfem_factorise(FIRST, NQ, s->factor, s->pivots)) return 1;
    cfem_add_symmetric(1.0, inertia->M, v, Mv);
    for (int i = 0; i < NQ; i++) {
        s->of_material[i][0] = DT / 2 * (elastic[i] + lost[i]), s->of_material[i][1] = DT / 2 * lost[i];
        right[i] = z[NQ + i] - Mv[i] + DT / 2 * (elastic[i] + turned[i] + lost[i] + (i < NA && !HELD ? w[i] : 0.0));
        if (i < NA) X[i] = (w[i] - z[i]) / DT - v[i];
    }
    respond(s, 1, right, X, s->lambda, 1);
    for (int i = 0; i < NQ; i++) X[i] += v[i];
    /* As `arrive` does, but the mass turns by what the step adds to v alone. */
    for (int i = 0; i < NQ; i++) one[i] = X[i];
    arrive(s, 1, z, 1, one, s->end);
    double sum = 0.0;
    for (int i = 0; i < NQ; i++) {
        for (int a = 0; a < NA; a++) s->end[NQ + i] -= 2.0 * s->turning[i][a] * (DT / 2 * v[a] + z[a]);
        sum += s->end[i] + s->end[NQ + i];
    }
    return !cfem_finite(sum);
}

void cfem_acting(const double *before, const double *u, double *w) {
    for (int a = 0; a < NA; a++) w[a] = CFEM_MPC_FORCE ? (before[a] + u[a]) / 2 : u[a];
}

int cfem_tick(cfem_moving *state, const double *u, const cfem_material *material, cfem_place *place, int *known, cfem_stage *stage) {
    double w[MOST_NA], middle[MOST_NA];
    cfem_acting(state->u, u, w);
    for (int a = 0; a < NA; a++) {
        if (HELD) state->v[a] = (w[a] - state->z[a]) / DT;
        middle[a] = state->z[a] + DT / 2 * state->v[a];
    }
    if (!*known) cfem_place_at(middle, 1, place), *known = 1;
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        double moved = 0.0, size = 1.0;
        if (cfem_stage_at(state->z, state->v, w, &place->inertia, &place->inertia, material, stage)) return 1;
        for (int i = 0; i < NQ; i++) {
            const double v = (stage->end[i] - state->z[i]) / DT;
            moved = fmax(moved, fabs(v - state->v[i]) / cfem_motion_scale[i]), size = fmax(size, fabs(v) / cfem_motion_scale[i]);
            state->v[i] = v;
        }
        if (moved <= SETTLED * size) break;
    }
    memcpy(state->z, stage->end, sizeof state->z);
    memcpy(state->u, u, sizeof(double) * NA);
    return 0;
}

void cfem_tips(const double *z, const cfem_inner *near, const cfem_inner *first, double *e, double C[CFEM_MOTION_MOST_NE][CFEM_MOTION_MOST_NQ]) {
    double curve[CFEM_MOTION_MOST_NE][CFEM_MOTION_MOST_NR];
    cfem_parts parts;
    cfem_effector_parts(z, &parts);
    cfem_curve_of(near, z + NA, curve);
    for (int k = 0; k < NE; k++) {
        const double *H = near->H + k * NR;
        e[k] = parts.effector[k];
        for (int a = 0; a < NA; a++) C[k][a] = parts.effector_gradient[k][a] + cfem_dot(NR, first->dH[a] + k * NR, z + NA);
        for (int r = 0; r < NR; r++) C[k][NA + r] = H[r] + curve[k][r], e[k] += (H[r] + curve[k][r] / 2.0) * z[NA + r];
    }
}

void cfem_place_at(const double *delta_a, int slopes, cfem_place *found) {
    cfem_inertia_at(delta_a, slopes, CFEM_MPC_WARP, &found->inertia);
    cfem_inner_at(delta_a, slopes, &found->inner);
}

void cfem_place_between(const cfem_place *a, const cfem_place *b, double share, cfem_place *found) {
    cfem_inertia_between(&a->inertia, &b->inertia, share, &found->inertia);
    cfem_inner_between(&a->inner, &b->inner, share, &found->inner);
}
