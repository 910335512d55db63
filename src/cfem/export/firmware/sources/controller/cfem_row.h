/* Modules in a row under loads, or of different models: cfem_row.c. */
#ifndef CFEM_ROW_H
#define CFEM_ROW_H

#include "cfem.h"

#if CFEM_ROW

#define CFEM_ROW_EACH (CFEM_POSE + 3 * CFEM_ROW_PATCHES) /* of a module: its pose, and places of patches under forces */
#define CFEM_ROW_N (CFEM_MODULES * CFEM_ROW_EACH)        /* coordinates e of the row: those of its modules */
#define CFEM_ROW_PAIRS (CFEM_MODULE_NA * (CFEM_MODULE_NA + 1) / 2)

#define CFEM_ROW_CHANGES (CFEM_POSE * (CFEM_POSE + 1) * (CFEM_POSE + 2) / 6)
#define CFEM_ROW_CURVATURES (CFEM_POSE * (CFEM_POSE + 1) * (CFEM_POSE + 2) * (CFEM_POSE + 3) / 24)

/* One model at one s: T_k, T_k', T_k'' of its coordinates z; the pose and places, their derivatives C by a wrench, and of the pose
 * D = dC/dw and E = d2C/dw2 (packed, i <= j <= k <= l). */
typedef struct {
    const cfem_module *model;
    double polynomials[3][CFEM_MODULE_NA][CFEM_MODULE_DEGREE + 1];
    double pose[CFEM_ROW_EACH], C[CFEM_ROW_EACH][CFEM_ROW_EACH], D[CFEM_ROW_CHANGES], E[CFEM_ROW_CURVATURES];
} cfem_held;

/* The same under a wrench: pose, its derivative C by the wrench, and `ratio`, the share of the load that would buckle. */
typedef struct {
    double pose[CFEM_ROW_EACH], C[CFEM_ROW_EACH][CFEM_ROW_EACH], ratio;
} cfem_carried;

void cfem_module_at(const cfem_module *model, const double *s, cfem_held *held);
void cfem_module_under(const cfem_held *held, const double w[CFEM_ROW_EACH], cfem_carried *carried);

/* The forces (n_a,) that hold it, their derivative (packed upper triangle), and the pose's by s, under a wrench. */
void cfem_module_slopes(const cfem_held *held, const double w[CFEM_ROW_EACH], double *lambda, double *stiffness,
                        double slope[CFEM_ROW_EACH][CFEM_MODULE_NA]);

/* Where the effectors y (CFEM_NE,) mm are at poses e, and B their derivative by e; `work`: the derivative of what the wrench on them and
 * the forces on patches work, and V minus the second one. */
void cfem_row_places(double e[CFEM_MODULES][CFEM_ROW_EACH], double y[CFEM_NE], double B[CFEM_NE][CFEM_ROW_N],
                     double work[CFEM_ROW_N], double V[CFEM_ROW_N][CFEM_ROW_N]);

#endif
#endif
