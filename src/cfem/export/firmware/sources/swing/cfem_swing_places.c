/* Where markers, modes and effectors of a robot that moves are, as src/cfem/motion/estimation/moving_markers.py has them: what the static
 * model says, and inner motions but for those that forces hold. */
#include <math.h>
#include <string.h>

#include "cfem_swing_room.h"
#include "cfem_inertia.h"
#include "cfem_swing_parts.h"

#define NA CFEM_MOTION_NA
#define NQ CFEM_MOTION_NQ
#define NR CFEM_MOTION_NR
#define NE CFEM_MOTION_NE
#define NW CFEM_ESTIMATE_NW
#define N CFEM_SWING_N
#define STATIC CFEM_ESTIMATE_N
#define ROWS (3 * CFEM_ESTIMATE_MARKERS)
#define MODES CFEM_ESTIMATE_ROWS
#define DEGREES (CFEM_SWING_DEGREE + 1)

void cfem_estimate_places(const double *x, double y[ROWS], double by[ROWS][STATIC]);
void cfem_estimate_effectors_at(const double x[STATIC], double effector[NE]);

#define BOX CFEM_MOTION_BOX(CFEM_SWING_DEGREE, DEGREES)

/* The swings that forces do not hold: eta - H_w^T w / kappa; x, static: unknowns of the filter, and of the robot at rest. */
static void split_swings(const double *x, const cfem_inner *inner, double *at_rest, double swing[NR]) {
    const double soft = exp(-x[N - 1]);
    memcpy(at_rest, x, sizeof(double) * NA);
    memcpy(swing, x + NA, sizeof(double) * NR);
    for (int w = 0; w < NW; w++) {
        const double load = at_rest[NA + w] = soft * x[NQ + w];
        for (int r = 0; r < NR; r++) swing[r] -= inner->H[cfem_swing_rows[w] * NR + r] * load / cfem_motion_stiffness;
    }
}

void cfem_swing_places(const double *x, double y[ROWS], double by[ROWS][N]) {
    double at_rest[STATIC], swing[NR], R[ROWS][NR], slope_z[NA][ROWS], held[NA][NR], t[2][NA][DEGREES];
    double by_rest[ROWS][STATIC];
    const double soft = exp(-x[N - 1]);
    cfem_inner inner;
    cfem_inner_at(x, 1, &inner);
    split_swings(x, &inner, at_rest, swing);
    cfem_estimate_places(at_rest, y, by_rest);
    cfem_box box = BOX;
    cfem_polynomials(box, x, 2, t[0][0]);
    memset(R, 0, sizeof R), memset(slope_z, 0, sizeof slope_z), memset(held, 0, sizeof held);
    for (int m = 0; m < CFEM_SWING_TERMS; m++) {
        const uint8_t *degrees = cfem_swing_degrees[m];
        const double *c = cfem_swing_markers[m], phi = cfem_term(box, t[0][0], degrees, -1, -1);
        double moved[ROWS];
        for (int o = 0; o < ROWS; o++) {
            moved[o] = 0.0;
            for (int r = 0; r < NR; r++) R[o][r] += phi * c[o * NR + r], moved[o] += c[o * NR + r] * swing[r];
        }
        for (int i = 0; i < NA; i++) {
            const double slope = cfem_term(box, t[0][0], degrees, i, -1);
            for (int o = 0; o < ROWS; o++) slope_z[i][o] += slope * moved[o];
        }
    }
    for (int a = 0; a < NA; a++) /* of what forces hold */
        for (int w = 0; w < NW; w++)
            for (int r = 0; r < NR; r++) held[a][r] += inner.dH[a][cfem_swing_rows[w] * NR + r] * at_rest[NA + w] / cfem_motion_stiffness;
    for (int o = 0; o < ROWS; o++) {
        by[o][N - 1] = 0.0;
        for (int a = 0; a < NA; a++) {
            by[o][a] = by_rest[o][a];
            for (int i = 0; i < NA; i++) by[o][a] += cfem_motion_to_box[i][a] * slope_z[i][o];
            for (int r = 0; r < NR; r++) by[o][a] -= R[o][r] * held[a][r];
        }
        for (int r = 0; r < NR; r++) by[o][NA + r] = R[o][r], y[o] += R[o][r] * swing[r];
        for (int w = 0; w < NW; w++) {
            double one = by_rest[o][NA + w];
            for (int r = 0; r < NR; r++) one -= R[o][r] * inner.H[cfem_swing_rows[w] * NR + r] / cfem_motion_stiffness;
            by[o][NQ + w] = soft * one, by[o][N - 1] -= one * at_rest[NA + w];
        }
    }
}

void cfem_swing_effectors(const double x[N], double effector[NE]) {
    double at_rest[STATIC], swing[NR], curve[CFEM_MOTION_MOST_NE][CFEM_MOTION_MOST_NR];
    cfem_inner inner;
    cfem_inner_at(x, 0, &inner);
    split_swings(x, &inner, at_rest, swing);
    cfem_estimate_effectors_at(at_rest, effector);
    cfem_curve_of(&inner, x + NA, curve);
    for (int e = 0; e < NE; e++)
        for (int r = 0; r < NR; r++) effector[e] += inner.H[e * NR + r] * swing[r] + curve[e][r] * x[NA + r] / 2.0;
}

void cfem_swing_modes(const double x[N], double modes[MODES]) {
    double at_rest[STATIC], swing[NR], t[NA][DEGREES];
    cfem_inner inner;
    cfem_inner_at(x, 0, &inner);
    split_swings(x, &inner, at_rest, swing);
    cfem_estimate_modes(at_rest, modes);
    cfem_box box = BOX;
    cfem_polynomials(box, x, 1, t[0]);
    for (int m = 0; m < CFEM_SWING_TERMS; m++) {
        const double phi = cfem_term(box, t[0], cfem_swing_degrees[m], -1, -1);
        for (int k = 0; k < MODES; k++)
            for (int r = 0; r < NR; r++) modes[k] += phi * cfem_swing_modes_series[m][k * NR + r] * swing[r];
    }
}
