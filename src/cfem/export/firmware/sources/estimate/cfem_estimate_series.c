/* Series of the estimator: where the markers are, forces of the actuators, effectors and modes, with their derivatives, as
 * src/cfem/predict/series/modes.py and force_series.py have them. */
#include "cfem_estimate_parts.h"

#include <string.h>

#include "cfem_chebyshev.h"

#define NZ CFEM_ESTIMATE_NZ /* coordinates of the series */
#define DEGREES (CFEM_ESTIMATE_DEGREE + 1)

#define BOX {NZ, NA, NA, CFEM_ESTIMATE_DEGREE, NZ, DEGREES, cfem_estimate_to_box[0], cfem_estimate_offset}

/* y (ROWS,): where the markers are, from rest; by (ROWS, N). */
void cfem_estimate_places(const double *x, double y[ROWS], double by[ROWS][N]) {
    double by_z[NZ][ROWS], t[2][NZ][DEGREES];
    cfem_box box = BOX;
    cfem_polynomials(box, x, 2, t[0][0]);
    memset(y, 0, sizeof(double) * ROWS), memset(by, 0, sizeof(double) * ROWS * N), memset(by_z, 0, sizeof by_z);
    cfem_add_terms(box, t[0][0], CFEM_ESTIMATE_TERMS, cfem_estimate_degrees[0], ROWS, cfem_estimate_markers[0], y, by_z[0]);
    for (int m = 0; NW && m < CFEM_ESTIMATE_SOFT_TERMS; m++) {
        const uint8_t *degrees = cfem_estimate_soft_degrees[m];
        const double phi = cfem_term(box, t[0][0], degrees, -1, -1);
        double moved[ROWS] = {0.0};
        for (int w = 0; w < NW; w++) {
            const double *c = cfem_estimate_soft[m][w], load = x[NA + w];
            for (int o = 0; o < ROWS; o++) by[o][NA + w] += c[o] * phi, moved[o] += c[o] * load;
        }
        for (int o = 0; o < ROWS; o++) y[o] += moved[o] * phi;
        for (int i = 0; i < NZ; i++) {
            if (!degrees[i]) continue;
            const double slope = cfem_term(box, t[0][0], degrees, i, -1);
            for (int o = 0; o < ROWS; o++) by_z[i][o] += moved[o] * slope;
        }
    }
    for (int o = 0; o < ROWS; o++)
        for (int i = 0; i < NZ; i++)
            for (int a = 0; a < NA; a++) by[o][a] += cfem_estimate_to_box[i][a] * by_z[i][o];
}

/* y (NA,): forces of the actuators; by (NA, N). Pi = Psi - w . e - w . C w / 2. */
void cfem_estimate_tensions(const double *x, double y[NA], double by[NA][N]) {
    double by_z[NZ] = {0.0}, curve[NZ][NZ] = {{0.0}}, across[NZ][NW + 1] = {{0.0}}, t[3][NZ][DEGREES];
    cfem_box box = BOX;
    cfem_polynomials(box, x, 3, t[0][0]);
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
            const double slope = cfem_term(box, t[0][0], degrees, i, -1);
            by_z[i] += pi * slope;
            for (int j = 0; j < NW; j++) across[i][j] -= row[j] * slope;
            for (int j = 0; j < NZ; j++) curve[i][j] += pi * cfem_term(box, t[0][0], degrees, i, j);
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
    double t[NZ][DEGREES];
    cfem_box box = BOX;
    cfem_polynomials(box, x, 1, t[0]);
    for (int o = 0; o < outputs; o++) out[o] = 0.0;
    for (int m = 0; m < terms; m++, degrees += NZ) {
        const double phi = cfem_term(box, t[0], degrees, -1, -1);
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
