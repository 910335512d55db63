/* Roots of mass and viscosity, and inner motions, as src/cfem/motion/model.py has them. */
#include "cfem_inertia.h"

#define NA CFEM_MOTION_NA
#define NQ CFEM_MOTION_NQ
#define NR CFEM_MOTION_NR
#define NE CFEM_MOTION_NE
#define MOST_NQ CFEM_MOTION_MOST_NQ
#define ACROSS CFEM_WHOLE(NQ)
#define TRIANGLE (NQ * (NQ + 1) / 2)
#define LANES (8 / CFEM_AT_ONCE)
#define BEND (NR * (NR + 1) / 2)

void cfem_unpack(const double *triangle, double full[MOST_NQ][CFEM_MOTION_ACROSS]) {
    for (int i = 0; i < NQ; i++) {
        for (int j = i; j < NQ; j++) full[i][j] = full[j][i] = *triangle++;
        for (int j = NQ; j < ACROSS; j++) full[i][j] = 0.0;
    }
}

void cfem_add_symmetric(double factor, const double *S, const double *x, double *out) {
    for (int i = 0; i < NQ; i++) {
        double sum = *S++ * x[i];
        const double own = factor * x[i];
        for (int j = i + 1; j < NQ; j++, S++) sum += *S * x[j], out[j] += own * *S;
        out[i] += factor * sum;
    }
}

/* The upper triangle of factor D (A B + B A) D / 2, A and B symmetric, D = 1 / scale. */
static void symmetric_product(double factor, double A[MOST_NQ][CFEM_MOTION_ACROSS], double B[MOST_NQ][CFEM_MOTION_ACROSS], double *out) {
    double P[MOST_NQ][CFEM_MOTION_ACROSS];
    for (int j = 0; j < ACROSS; j += 8)
        for (int i = 0; i < NQ; i++) {
            cfem_lanes sum[LANES];
            CFEM_UNROLL for (int l = 0; l < LANES; l++) sum[l] = (cfem_lanes){0};
            for (int k = 0; k < NQ; k++) {
                const cfem_lanes *of = (const cfem_lanes *)(B[k] + j);
                CFEM_UNROLL for (int l = 0; l < LANES; l++) sum[l] += A[i][k] * of[l];
            }
            CFEM_UNROLL for (int l = 0; l < LANES; l++) ((cfem_lanes *)(P[i] + j))[l] = sum[l];
        }
    for (int i = 0; i < NQ; i++) {
        const double by = factor / 2 * cfem_motion_unit[i];
        for (int j = i; j < NQ; j++) *out++ = by * cfem_motion_unit[j] * (P[i][j] + P[j][i]);
    }
}

void cfem_inertia_at(const double *delta_a, int slopes, double warp, cfem_inertia *found) {
    double root[CFEM_MOTION_TRIANGLE], S[MOST_NQ][CFEM_MOTION_ACROSS], dS[MOST_NQ][CFEM_MOTION_ACROSS];
    cfem_products products;
    cfem_products_at(delta_a, &products);
    cfem_series_at(cfem_motion_root, &products, TRIANGLE, root, slopes ? found->dM[0] : 0, CFEM_MOTION_TRIANGLE);
    cfem_unpack(root, S);
    symmetric_product(warp * warp, S, S, found->M);
    for (int a = 0; slopes && a < NA; a++) { /* D (dS S + S dS) D */
        cfem_unpack(found->dM[a], dS);
        symmetric_product(2.0 * warp * warp, dS, S, found->dM[a]);
    }
    for (int l = 0; l < CFEM_MOTION_LOSSES; l++) {
        cfem_series_at(cfem_motion_loss + l, &products, TRIANGLE, root, 0, 0);
        cfem_unpack(root, S);
        symmetric_product(warp, S, S, found->F[l]);
    }
}

void cfem_inner_at(const double *delta_a, int slopes, cfem_inner *found) {
    cfem_products products;
    cfem_products_at(delta_a, &products);
    cfem_series_at(cfem_motion_inner, &products, NE * NR, found->H, slopes ? found->dH[0] : 0, CFEM_MOTION_INNER);
    if (CFEM_MOTION_CURVED) cfem_series_at(cfem_motion_curve, &products, NE * BEND, found->E, 0, 0);
}

static void between(int count, double share, const double *a, const double *b, double *out) {
    for (int i = 0; i < count; i++) out[i] = (1.0 - share) * a[i] + share * b[i];
}

void cfem_inertia_between(const cfem_inertia *a, const cfem_inertia *b, double share, cfem_inertia *found) {
    between(TRIANGLE, share, a->M, b->M, found->M);
    for (int l = 0; l < CFEM_MOTION_LOSSES; l++) between(TRIANGLE, share, a->F[l], b->F[l], found->F[l]);
}

void cfem_inner_between(const cfem_inner *a, const cfem_inner *b, double share, cfem_inner *found) {
    between(NE * NR, share, a->H, b->H, found->H);
    if (CFEM_MOTION_CURVED) between(NE * BEND, share, a->E, b->E, found->E);
}

void cfem_curve_of(const cfem_inner *near, const double *eta, double curve[CFEM_MOTION_MOST_NE][CFEM_MOTION_MOST_NR]) {
    const double *E = near->E;
    for (int e = 0; e < NE; e++) {
        for (int r = 0; r < NR; r++) curve[e][r] = 0.0;
        for (int r = 0; CFEM_MOTION_CURVED && r < NR; r++) {
            curve[e][r] += *E++ * eta[r];
            for (int s = r + 1; s < NR; s++, E++) curve[e][r] += *E * eta[s], curve[e][s] += *E * eta[r];
        }
    }
}
