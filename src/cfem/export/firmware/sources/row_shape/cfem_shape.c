/* Modules in a row, whose surfaces move with the frames at their bases: y = P + R x, x = rest + sum_k mode_k row_k of the module, rows
 * and the pose of its end by the module's series (cfem_spectral.c). */
#include "cfem_shape.h"

#include <math.h>

#include "cfem_parts.h"
#include "cfem_skin_rows.h"

#define K CFEM_MODULES
#define N CFEM_SERIES_NA

/* frame R of a module's base to that of its end: R exp [phi] = R (1 + a [phi] + b [phi]^2). */
static void turn(double R[3][3], const double phi[3]) {
    const double s = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2], t = sqrt(s);
    const double a = s < 1e-4 ? 1.0 - s / 6 + s * s / 120 : sin(t) / t;
    const double b = s < 1e-4 ? 1.0 / 2 - s / 24 + s * s / 720 : (1.0 - cos(t)) / s;
    const double spin[3][3] = {{0.0, -phi[2], phi[1]}, {phi[2], 0.0, -phi[0]}, {-phi[1], phi[0], 0.0}};
    for (int i = 0; i < 3; i++) {
        double once[3], twice[3];
        for (int j = 0; j < 3; j++) once[j] = R[i][0] * spin[0][j] + R[i][1] * spin[1][j] + R[i][2] * spin[2][j];
        for (int j = 0; j < 3; j++) twice[j] = once[0] * spin[0][j] + once[1] * spin[1][j] + once[2] * spin[2][j];
        for (int j = 0; j < 3; j++) R[i][j] += a * once[j] + b * twice[j];
    }
}

void cfem_shape(const double s[CFEM_NA], cfem_real xyz[CFEM_SKIN_NODES][3]) {
    double P[3] = {0.0}, R[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int module = 0, node = 0; module < K; module++) {
        cfem_parts end;
        double row[CFEM_SKIN_ROWS];
        const double *const own_s = s + module * N;
        cfem_skin_rows(N, own_s, row);
        for (; node < CFEM_SKIN_NODES && cfem_skin_owner[node] == module; node++) {
            const int own = 3 * (int)cfem_skin_own[node];
            double x[3];
            for (int i = 0; i < 3; i++) {
                x[i] = cfem_skin_rest[own + i];
                for (int k = 0; k < CFEM_SKIN_ROWS; k++) x[i] += row[k] * (double)cfem_skin_modes[k][own + i];
            }
            for (int i = 0; i < 3; i++)
                xyz[node][i] = (cfem_real)(P[i] + R[i][0] * x[0] + R[i][1] * x[1] + R[i][2] * x[2]);
        }
        cfem_spectral(own_s, &end);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) P[i] += R[i][j] * (cfem_module_rest[j] + end.effector[j]);
        turn(R, end.effector + 3);
    }
}
