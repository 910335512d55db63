/* x = rest + sum_k mode_k sum_m c_mk prod_i T_{degrees_mi}(z_i), z = to_box s + offset. */
#include "cfem_shape.h"

#include "cfem_skin_rows.h"

#define NUMBERS (3 * CFEM_SKIN_NODES)

void cfem_shape(const double s[CFEM_NA], cfem_real xyz[CFEM_SKIN_NODES][3]) {
    cfem_real row[CFEM_SKIN_ROWS], *x = &xyz[0][0];
    double wide[CFEM_SKIN_ROWS];
    int k = 0;
    cfem_skin_rows(CFEM_NA, s, wide);
    for (int i = 0; i < CFEM_SKIN_ROWS; i++) row[i] = (cfem_real)wide[i];
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
