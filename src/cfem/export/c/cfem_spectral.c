/* sum_m c_m prod_i T_{k_mi}(z_i), z = to_box s + offset: value, gradient and Hessian by s from the coefficients of the value
 * alone. Terms that differ in the degree of the last coordinate only form a group: they are summed first, with the
 * derivatives by that coordinate, and what belongs to the other coordinates is done once a group. */
#include "cfem_parts.h"

#if CFEM_SPECTRAL

#define N CFEM_NZ
#define NE CFEM_NE

/* T_k, T_k', T_k'', k = 0 ... CFEM_DEGREE, of one coordinate. */
typedef struct {
    cfem_real value[CFEM_DEGREE + 1], first[CFEM_DEGREE + 1], second[CFEM_DEGREE + 1];
} polynomials;

/* By T_{k+1} = 2 z T_k - T_{k-1} and its derivatives, in double: their rounding grows with the degree. */
static void evaluate(double z, polynomials *t) {
    double value[2] = {1.0, z}, first[2] = {0.0, 1.0}, second[2] = {0.0, 0.0};
    for (int k = 0; k <= CFEM_DEGREE; k++) {
        t->value[k] = (cfem_real)value[0], t->first[k] = (cfem_real)first[0], t->second[k] = (cfem_real)second[0];
        const double next_second = 4.0 * first[1] + 2.0 * z * second[1] - second[0];
        const double next_first = 2.0 * value[1] + 2.0 * z * first[1] - first[0];
        const double next = 2.0 * z * value[1] - value[0];
        value[0] = value[1], first[0] = first[1], second[0] = second[1];
        value[1] = next, first[1] = next_first, second[1] = next_second;
    }
}

void cfem_spectral(const double s[CFEM_NA], cfem_parts *parts) {
    polynomials t[N];
    const polynomials *const last = &t[N - 1];
    cfem_real gradient[N] = {0}, hessian[N][N] = {{0}}, effector[NE] = {0}, effector_gradient[NE][N] = {{0}};
#if CFEM_FULL
    cfem_real energy = 0, compliance[NE * (NE + 1) / 2] = {0};
#endif
    for (int i = 0; i < N; i++) {
        double z = cfem_offset[i];
        for (int j = 0; j < CFEM_NA; j++) z += cfem_to_box[i][j] * s[j];
        evaluate(z, &t[i]);
    }
    for (int g = 0, m = 0; g < CFEM_GROUPS; g++) {
        /* Sums over the group: of the potential with its derivatives by the last coordinate, of the effectors with the first. */
        cfem_real sum = 0, sum_first = 0, sum_second = 0, of_e[NE] = {0}, of_e_first[NE] = {0};
#if CFEM_FULL
        cfem_real of_c[NE * (NE + 1) / 2] = {0};
        for (int k = m; k < cfem_groups[g].end; k++)
            for (int c = 0; c < NE * (NE + 1) / 2; c++)
                of_c[c] += cfem_compliance_series[k][c] * last->value[cfem_degrees[k]];
#endif
        for (; m < cfem_groups[g].end; m++) {
            const int k = cfem_degrees[m];
            const cfem_real *c = cfem_series[m], value = last->value[k], first = last->first[k];
            sum += c[0] * value, sum_first += c[0] * first, sum_second += c[0] * last->second[k];
            for (int e = 0; e < NE; e++) of_e[e] += c[1 + e] * value, of_e_first[e] += c[1 + e] * first;
        }

        /* The other coordinates: those of degree zero are constants. */
        const uint8_t *degree = cfem_groups[g].degrees;
        int on[N] = {0}, count = 0;
        cfem_real value = 1, slope[N];
        for (int i = 0; i < N - 1; i++)
            if (degree[i]) on[count++] = i, value *= t[i].value[degree[i]];
        for (int a = 0; a < count; a++) { /* the product of the other values stands beside each derivative */
            const int i = on[a];
            cfem_real others = 1;
            for (int b = 0; b < count; b++)
                if (b != a) others *= t[on[b]].value[degree[on[b]]];
            slope[a] = t[i].first[degree[i]] * others;
            gradient[i] += sum * slope[a];
            hessian[i][i] += sum * t[i].second[degree[i]] * others;
            hessian[i][N - 1] += sum_first * slope[a];
            for (int b = a + 1; b < count; b++) {
                cfem_real rest = sum * t[i].first[degree[i]] * t[on[b]].first[degree[on[b]]];
                for (int k = 0; k < count; k++)
                    if (k != a && k != b) rest *= t[on[k]].value[degree[on[k]]];
                hessian[i][on[b]] += rest;
            }
        }
        gradient[N - 1] += sum_first * value;
        hessian[N - 1][N - 1] += sum_second * value;
        for (int e = 0; e < NE; e++) {
            effector[e] += of_e[e] * value;
            effector_gradient[e][N - 1] += of_e_first[e] * value;
            for (int a = 0; a < count; a++) effector_gradient[e][on[a]] += of_e[e] * slope[a];
        }
#if CFEM_FULL
        energy += sum * value;
        for (int c = 0; c < NE * (NE + 1) / 2; c++) compliance[c] += of_c[c] * value;
#endif
    }
    /* From z to s: gradients by to_box^T, the Hessian on both sides. */
    for (int i = 0; i < N; i++)
        for (int k = 0; k < i; k++) hessian[i][k] = hessian[k][i];
    for (int i = 0; i < CFEM_NA; i++) {
        double row[N];
        parts->gradient[i] = 0.0;
        for (int k = 0; k < N; k++) {
            parts->gradient[i] += cfem_to_box[k][i] * (double)gradient[k];
            row[k] = 0.0;
            for (int l = 0; l < N; l++) row[k] += cfem_to_box[l][i] * (double)hessian[l][k];
        }
        for (int j = 0; j < CFEM_NA; j++) {
            parts->hessian[i][j] = 0.0;
            for (int k = 0; k < N; k++) parts->hessian[i][j] += row[k] * cfem_to_box[k][j];
        }
    }
    for (int e = 0; e < CFEM_NE; e++) {
        parts->effector[e] = (double)effector[e];
        for (int i = 0; i < CFEM_NA; i++) {
            parts->effector_gradient[e][i] = 0.0;
            for (int k = 0; k < N; k++)
                parts->effector_gradient[e][i] += (double)effector_gradient[e][k] * cfem_to_box[k][i];
        }
    }
#if CFEM_FULL
    parts->energy = (double)energy;
    for (int i = 0, packed = 0; i < CFEM_NE; i++)
        for (int j = i; j < CFEM_NE; j++, packed++)
            parts->compliance[i][j] = parts->compliance[j][i] = (double)compliance[packed];
#endif
}

#endif
