/* Series of the estimator: where the markers are, forces of the actuators, effectors and modes, with their derivatives, as
 * src/cfem/predict/mode_series.py and force_series.py have them. */
#include "cfem_estimate_parts.h"

#include <string.h>

#define DEGREES (CFEM_ESTIMATE_DEGREE + 1)

/* T_k, T_k' and T_k'' of each coordinate of the box. */
typedef struct {
    double value[NZ][DEGREES], slope[NZ][DEGREES], curve[NZ][DEGREES];
} polynomials; /* of order 0, 1, 2 */

static void evaluate(const double *s, polynomials *t) {
    for (int i = 0; i < NZ; i++) {
        double z = cfem_estimate_offset[i];
        for (int j = 0; j < NA; j++) z += cfem_estimate_to_box[i][j] * s[j];
        double *value = t->value[i], *slope = t->slope[i], *curve = t->curve[i];
        value[0] = 1.0, slope[0] = curve[0] = 0.0;
        if (DEGREES > 1) value[1] = z, slope[1] = 1.0, curve[1] = 0.0;
        for (int k = 2; k < DEGREES; k++) {
            value[k] = 2.0 * z * value[k - 1] - value[k - 2];
            slope[k] = 2.0 * value[k - 1] + 2.0 * z * slope[k - 1] - slope[k - 2];
            curve[k] = 4.0 * slope[k - 1] + 2.0 * z * curve[k - 1] - curve[k - 2];
        }
    }
}

/* The product of the polynomials of these degrees, those of coordinates i and j (or none, -1) derived. */
static double product(const polynomials *t, const uint8_t *degrees, int i, int j) {
    double phi = 1.0;
    for (int k = 0; k < NZ; k++) {
        const int times = (k == i) + (k == j);
        phi *= (times == 0 ? t->value : times == 1 ? t->slope : t->curve)[k][degrees[k]];
    }
    return phi;
}

/* y (ROWS,): where the markers are, from rest; by (ROWS, N). */
void cfem_estimate_places(const double *x, double y[ROWS], double by[ROWS][N]) {
    double by_z[NZ][ROWS];
    polynomials t;
    evaluate(x, &t);
    memset(y, 0, sizeof(double) * ROWS), memset(by, 0, sizeof(double) * ROWS * N), memset(by_z, 0, sizeof by_z);
    for (int m = 0; m < CFEM_ESTIMATE_TERMS; m++) {
        const uint8_t *degrees = cfem_estimate_degrees[m];
        const double *c = cfem_estimate_markers[m], phi = product(&t, degrees, -1, -1);
        for (int o = 0; o < ROWS; o++) y[o] += c[o] * phi;
        for (int i = 0; i < NZ; i++) {
            if (!degrees[i]) continue;
            const double slope = product(&t, degrees, i, -1);
            for (int o = 0; o < ROWS; o++) by_z[i][o] += c[o] * slope;
        }
    }
    for (int m = 0; NW && m < CFEM_ESTIMATE_SOFT_TERMS; m++) {
        const uint8_t *degrees = cfem_estimate_soft_degrees[m];
        const double phi = product(&t, degrees, -1, -1);
        double moved[ROWS] = {0.0};
        for (int w = 0; w < NW; w++) {
            const double *c = cfem_estimate_soft[m][w], load = x[NA + w];
            for (int o = 0; o < ROWS; o++) by[o][NA + w] += c[o] * phi, moved[o] += c[o] * load;
        }
        for (int o = 0; o < ROWS; o++) y[o] += moved[o] * phi;
        for (int i = 0; i < NZ; i++) {
            if (!degrees[i]) continue;
            const double slope = product(&t, degrees, i, -1);
            for (int o = 0; o < ROWS; o++) by_z[i][o] += moved[o] * slope;
        }
    }
    for (int o = 0; o < ROWS; o++)
        for (int i = 0; i < NZ; i++)
            for (int a = 0; a < NA; a++) by[o][a] += cfem_estimate_to_box[i][a] * by_z[i][o];
}

/* y (NA,): forces of the actuators; by (NA, N). Pi = Psi - w . e - w . C w / 2. */
void cfem_estimate_tensions(const double *x, double y[NA], double by[NA][N]) {
    double by_z[NZ] = {0.0}, curve[NZ][NZ] = {{0.0}}, across[NZ][NW + 1] = {{0.0}};
    polynomials t;
    evaluate(x, &t);
    for (int m = 0; m < CFEM_ESTIMATE_FORCE_TERMS; m++) {
        const uint8_t *degrees = cfem_estimate_force_degrees[m];
        const double *c = cfem_estimate_force[m], *pair = c + 1 + NW, *w = x + NA;
        double pi = c[0], row[NW + 1];
        for (int j = 0; j < NW; j++) row[j] = c[1 + j], pi -= w[j] * c[1 + j];
        for (int j = 0; j < NW; j++)
            for (int k = j; k < NW; k++, pair++) {
                pi -= (j == k ? 0.5 : 1.0) * w[j] * w[k] * *pair;
                row[j] += *pair * w[k];
                if (k != j) row[k] += *pair * w[j];
            }
        for (int i = 0; i < NZ; i++) {
            const double slope = product(&t, degrees, i, -1);
            by_z[i] += pi * slope;
            for (int j = 0; j < NW; j++) across[i][j] -= row[j] * slope;
            for (int j = 0; j < NZ; j++) curve[i][j] += pi * product(&t, degrees, i, j);
        }
    }
    for (int a = 0; a < NA; a++) {
        y[a] = 0.0;
        for (int n = 0; n < N; n++) by[a][n] = 0.0;
        for (int i = 0; i < NZ; i++) {
            const double turn = cfem_estimate_to_box[i][a];
            y[a] += turn * by_z[i];
            for (int j = 0; j < NW; j++) by[a][NA + j] += turn * across[i][j];
            for (int j = 0; j < NZ; j++)
                for (int b = 0; b < NA; b++) by[a][b] += turn * curve[i][j] * cfem_estimate_to_box[j][b];
        }
    }
}

/* out (outputs,) = sum over terms of series (outputs, 1 + NW): the first column, and the others times the loads. */
static void sum(const double *x, int terms, int outputs, const double *series, const uint8_t *degrees, double *out) {
    polynomials t;
    evaluate(x, &t);
    for (int o = 0; o < outputs; o++) out[o] = 0.0;
    for (int m = 0; m < terms; m++, degrees += NZ) {
        const double phi = product(&t, degrees, -1, -1);
        for (int o = 0; o < outputs; o++) {
            double value = *series++;
            for (int w = 0; w < NW; w++) value += *series++ * x[NA + w];
            out[o] += phi * value;
        }
    }
}

void cfem_estimate_effectors_at(const double x[N], double effector[NE]) {
    sum(x, CFEM_ESTIMATE_EFFECTOR_TERMS, NE, cfem_estimate_effectors[0], cfem_estimate_effector_degrees[0], effector);
}

void cfem_estimate_modes(const double x[N], double modes[CFEM_ESTIMATE_ROWS]) {
    sum(x, CFEM_ESTIMATE_MODE_TERMS, CFEM_ESTIMATE_ROWS, cfem_estimate_modes_series[0], cfem_estimate_mode_degrees[0], modes);
}
