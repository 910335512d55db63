/* Chebyshev series of the roots of mass and viscosity, and of the inner motions, as src/cfem/motion/model.py has them. */
#include "cfem_inertia.h"

#include <string.h>

#define NA CFEM_MOTION_NA
#define NQ CFEM_MOTION_NQ
#define NR CFEM_MPC_NR
#define NE CFEM_MOTION_NE
#define TRIANGLE (NQ * (NQ + 1) / 2)
#define INNER (CFEM_MPC_MOST_NE * CFEM_MPC_MOST_NR)

/* T_k and T_k' of each coordinate of the box. */
typedef struct {
    double value[CFEM_MPC_MOST_NA][CFEM_MPC_MOST_DEGREE + 1], slope[CFEM_MPC_MOST_NA][CFEM_MPC_MOST_DEGREE + 1];
} polynomials;

static void evaluate(const double *s, polynomials *t) {
    for (int i = 0; i < NA; i++) {
        double z = cfem_motion_moving_offset[i], *value = t->value[i], *slope = t->slope[i];
        for (int j = 0; j < NA; j++) z += cfem_motion_moving_to_box[i][j] * s[j];
        value[0] = 1.0, slope[0] = 0.0;
        if (CFEM_MOTION_DEGREE > 0) value[1] = z, slope[1] = 1.0;
        for (int k = 2; k <= CFEM_MOTION_DEGREE; k++) {
            value[k] = 2.0 * z * value[k - 1] - value[k - 2];
            slope[k] = 2.0 * value[k - 1] + 2.0 * z * slope[k - 1] - slope[k - 2];
        }
    }
}

CFEM_INLINE void add(int count, double factor, const double *restrict from, double *restrict to) {
    for (int o = 0; o < count; o++) to[o] += factor * from[o];
}

/* Terms with their weights, of the value or of one derivative. */
typedef struct {
    int count;
    double weight[CFEM_MPC_MOST_MOVING];
    uint16_t term[CFEM_MPC_MOST_MOVING];
} weights;

/* By coordinate i of the box, or of the value where i < 0. */
static void weigh(const polynomials *t, int i, weights *w) {
    w->count = 0;
    for (int m = 0; m < CFEM_MOTION_MOVING_TERMS; m++) {
        const uint8_t *degrees = cfem_motion_moving_degrees[m];
        if (i >= 0 && !degrees[i]) continue;
        double phi = 1.0;
        for (int j = 0; j < NA; j++) phi *= j == i ? t->slope[j][degrees[j]] : t->value[j][degrees[j]];
        w->weight[w->count] = phi, w->term[w->count++] = (uint16_t)m;
    }
}

/* out (count,): the weighted sum of the outputs from number `from` on, WIDE of them at a time, in registers. */
#define WIDE 8
static void sum(const weights *w, int from, int count, double *out) {
    const double *c = cfem_motion_moving[0] + from;
    for (int o = 0; o < count; o += WIDE, c += WIDE) {
        double part[WIDE] = {0};
        if (o + WIDE <= count) {
            for (int m = 0; m < w->count; m++) {
                const double *of = c + w->term[m] * CFEM_MOTION_MOVING_OUTPUTS, by = w->weight[m];
                CFEM_UNROLL for (int k = 0; k < WIDE; k++) part[k] += by * of[k];
            }
            memcpy(out + o, part, sizeof part);
        } else {
            for (int m = 0; m < w->count; m++) add(count - o, w->weight[m], c + w->term[m] * CFEM_MOTION_MOVING_OUTPUTS, part);
            memcpy(out + o, part, sizeof(double) * (size_t)(count - o));
        }
    }
}

/* From derivatives by the box's coordinates to those by delta_a, in place; rows begin `stride` numbers after each other. */
static void turn(int count, double *slopes, int stride) {
    for (int o = 0; o < count; o++) {
        double of_box[CFEM_MPC_MOST_NA];
        for (int i = 0; i < NA; i++) of_box[i] = slopes[i * stride + o];
        for (int a = 0; a < NA; a++) {
            double by_a = 0.0;
            for (int i = 0; i < NA; i++) by_a += cfem_motion_moving_to_box[i][a] * of_box[i];
            slopes[a * stride + o] = by_a;
        }
    }
}

static void unpack(const double *triangle, double full[CFEM_MPC_MOST_NQ][CFEM_MPC_MOST_NQ]) {
    for (int i = 0; i < NQ; i++)
        for (int j = i; j < NQ; j++) full[i][j] = full[j][i] = *triangle++;
}

/* The upper triangle of factor D (A B + B A) D / 2, A and B symmetric, D = 1 / scale. */
static void symmetric_product(double factor, double A[CFEM_MPC_MOST_NQ][CFEM_MPC_MOST_NQ],
                              double B[CFEM_MPC_MOST_NQ][CFEM_MPC_MOST_NQ], double *out) {
    double P[CFEM_MPC_MOST_NQ][CFEM_MPC_MOST_NQ];
    for (int i = 0; i < NQ; i++) {
        double row[CFEM_MPC_MOST_NQ] = {0};
        for (int k = 0; k < NQ; k++) add(NQ, A[i][k], B[k], row);
        memcpy(P[i], row, sizeof row);
    }
    for (int i = 0; i < NQ; i++)
        for (int j = i; j < NQ; j++)
            *out++ = factor / 2 * (P[i][j] + P[j][i]) / (cfem_motion_scale[i] * cfem_motion_scale[j]);
}

void cfem_inertia_at(const double *delta_a, int slopes, cfem_inertia *found) {
    double root[CFEM_MPC_TRIANGLE], S[CFEM_MPC_MOST_NQ][CFEM_MPC_MOST_NQ], dS[CFEM_MPC_MOST_NQ][CFEM_MPC_MOST_NQ];
    polynomials t;
    weights w;
    evaluate(delta_a, &t);
    weigh(&t, -1, &w);
    sum(&w, 0, TRIANGLE, root);
    sum(&w, TRIANGLE, NE * NR, found->H);
    unpack(root, S);
    symmetric_product(CFEM_MPC_WARP * CFEM_MPC_WARP, S, S, found->M);
    for (int i = 0; slopes && i < NA; i++) {
        weigh(&t, i, &w);
        sum(&w, 0, TRIANGLE, found->dM[i]);
        sum(&w, TRIANGLE, NE * NR, found->dH[i]);
    }
    if (slopes) turn(TRIANGLE, found->dM[0], CFEM_MPC_TRIANGLE), turn(NE * NR, found->dH[0], INNER);
    for (int a = 0; slopes && a < NA; a++) { /* D (dS S + S dS) D */
        unpack(found->dM[a], dS);
        symmetric_product(2.0 * CFEM_MPC_WARP * CFEM_MPC_WARP, dS, S, found->dM[a]);
    }
    for (int l = 0; l < CFEM_MOTION_LOSSES; l++) {
        memset(root, 0, sizeof root);
        for (int m = 0; m < CFEM_MOTION_LOSS_TERMS; m++) {
            const uint8_t *degrees = cfem_motion_loss_degrees[m];
            double phi = t.value[0][degrees[0]];
            for (int i = 1; i < NA; i++) phi *= t.value[i][degrees[i]];
            add(TRIANGLE, phi, cfem_motion_loss[0] + (m * CFEM_MOTION_LOSSES + l) * TRIANGLE, root);
        }
        unpack(root, S);
        symmetric_product(CFEM_MPC_WARP, S, S, found->F[l]);
    }
}

static void between(int count, double share, const double *a, const double *b, double *out) {
    for (int i = 0; i < count; i++) out[i] = (1.0 - share) * a[i] + share * b[i];
}

void cfem_inertia_between(const cfem_inertia *a, const cfem_inertia *b, double share, cfem_inertia *found) {
    between(TRIANGLE, share, a->M, b->M, found->M);
    between(NE * NR, share, a->H, b->H, found->H);
    for (int l = 0; l < CFEM_MOTION_LOSSES; l++) between(TRIANGLE, share, a->F[l], b->F[l], found->F[l]);
}
