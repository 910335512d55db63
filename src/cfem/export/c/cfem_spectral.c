/* sum_m c_m prod_i T_{k_mi}(z_i), z = to_box s + offset: value, gradient and Hessian by s from the coefficients of the value
 * alone. A term costs as much as it has coordinates of degree above zero. */
#include "cfem_parts.h"

#if CFEM_SPECTRAL

#define N CFEM_NZ

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
    cfem_real gradient[N] = {0}, hessian[N][N] = {{0}}, effector[CFEM_NE] = {0}, effector_gradient[CFEM_NE][N] = {{0}};
#if CFEM_FULL
    cfem_real energy = 0, compliance[CFEM_NE * (CFEM_NE + 1) / 2] = {0};
#endif
    for (int i = 0; i < N; i++) {
        double z = cfem_offset[i];
        for (int j = 0; j < CFEM_NA; j++) z += cfem_to_box[i][j] * s[j];
        evaluate(z, &t[i]);
    }
    for (int m = 0; m < CFEM_TERMS; m++) {
        const cfem_real *c = cfem_series[m];
        int on[N] = {0}, count = 0;
        cfem_real value = 1, slope[N];
        for (int i = 0; i < N; i++)
            if (cfem_degrees[m][i]) on[count++] = i;
        for (int a = 0; a < count; a++) value *= t[on[a]].value[cfem_degrees[m][on[a]]];
        for (int a = 0; a < count; a++) { /* the product of the other coordinates' values stands beside each derivative */
            const int i = on[a];
            cfem_real others = 1;
            for (int b = 0; b < count; b++)
                if (b != a) others *= t[on[b]].value[cfem_degrees[m][on[b]]];
            slope[a] = t[i].first[cfem_degrees[m][i]] * others;
            gradient[i] += c[0] * slope[a];
            hessian[i][i] += c[0] * t[i].second[cfem_degrees[m][i]] * others;
            for (int b = a + 1; b < count; b++) {
                const int j = on[b];
                cfem_real rest = c[0] * t[i].first[cfem_degrees[m][i]] * t[j].first[cfem_degrees[m][j]];
                for (int k = 0; k < count; k++)
                    if (k != a && k != b) rest *= t[on[k]].value[cfem_degrees[m][on[k]]];
                hessian[i][j] += rest;
            }
        }
#if CFEM_FULL
        energy += c[0] * value;
        for (int e = 0; e < CFEM_NE * (CFEM_NE + 1) / 2; e++) compliance[e] += cfem_compliance_series[m][e] * value;
#endif
        if (m >= CFEM_EFFECTOR_TERMS) continue;
        for (int e = 0; e < CFEM_NE; e++) {
            effector[e] += c[1 + e] * value;
            for (int a = 0; a < count; a++) effector_gradient[e][on[a]] += c[1 + e] * slope[a];
        }
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
