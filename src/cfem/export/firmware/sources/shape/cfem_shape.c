/* x = rest + sum_k mode_k sum_m c_mk prod_i T_{degrees_mi}(z_i), z = to_box s + offset. */
#include "cfem_shape.h"

#define NUMBERS (3 * CFEM_SKIN_NODES)

static void displacements(const double *s, cfem_real row[CFEM_SKIN_ROWS]) {
    double t[CFEM_SKIN_NZ][CFEM_SKIN_DEGREE + 2], sum[CFEM_SKIN_ROWS] = {0.0};
    for (int i = 0; i < CFEM_SKIN_NZ; i++) {
        double z = cfem_skin_offset[i];
        for (int j = 0; j < CFEM_NA; j++) z += cfem_skin_to_box[i][j] * s[j];
        t[i][0] = 1.0, t[i][1] = z;
        for (int k = 2; k <= CFEM_SKIN_DEGREE; k++) t[i][k] = 2.0 * z * t[i][k - 1] - t[i][k - 2];
    }
    for (int m = 0; m < CFEM_SKIN_TERMS; m++) {
        double value = t[0][cfem_skin_degrees[m][0]];
        for (int i = 1; i < CFEM_SKIN_NZ; i++) value *= t[i][cfem_skin_degrees[m][i]];
        for (int k = 0; k < CFEM_SKIN_ROWS; k++) sum[k] += cfem_skin_series[m][k] * value;
    }
    for (int k = 0; k < CFEM_SKIN_ROWS; k++) row[k] = (cfem_real)sum[k];
}

void cfem_shape(const double s[CFEM_NA], cfem_real xyz[CFEM_SKIN_NODES][3]) {
    cfem_real row[CFEM_SKIN_ROWS], *x = &xyz[0][0];
    int k = 0;
    displacements(s, row);
    for (int i = 0; i < NUMBERS; i++) x[i] = (cfem_real)cfem_skin_rest[i];
    /* Four modes at once: what is summed is read and written a quarter as often. */
    for (; k + 4 <= CFEM_SKIN_ROWS; k += 4) {
        const float *a = cfem_skin_modes[k], *b = a + NUMBERS, *c = b + NUMBERS, *d = c + NUMBERS;
        const cfem_real p = row[k], q = row[k + 1], r = row[k + 2], u = row[k + 3];
        for (int i = 0; i < NUMBERS; i++) x[i] += p * a[i] + q * b[i] + r * c[i] + u * d[i];
    }
    for (; k < CFEM_SKIN_ROWS; k++)
        for (int i = 0; i < NUMBERS; i++) x[i] += row[k] * cfem_skin_modes[k][i];
}
