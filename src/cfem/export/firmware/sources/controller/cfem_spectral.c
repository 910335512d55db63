/* sum_m c_m prod_i T_{k_mi}(z_i), z = to_box s + offset, of the potential and of the effectors: value and derivatives by s from the
 * coefficients of the value alone. Terms are sorted by their degrees in the first coordinate, then the second, ...: a tree, which is
 * summed from its leaves. What terms share they are multiplied by once. */
#include "cfem_parts.h"

#include "cfem_chebyshev.h"

#if CFEM_SPECTRAL

#define NA CFEM_SERIES_NA
#define NE CFEM_SERIES_NE
#define OUTPUTS CFEM_SERIES_OUTPUTS /* the effectors; with CFEM_FULL their compliance too */
#define MOST CFEM_MOST_NZ
#define MOST_OUTPUTS CFEM_MOST_SERIES_OUTPUTS
#if defined(__GNUC__) && !defined(__clang__)
#define EACH(o) _Pragma("GCC unroll 8") for (int o = 0; o < outputs; o++)
#else
#define EACH(o) for (int o = 0; o < outputs; o++)
#endif

/* T_k, T_k', T_k'', k = 0 ... CFEM_DEGREE, of one coordinate. */
typedef struct {
    cfem_real value[CFEM_MOST_DEGREE + 1], first[CFEM_MOST_DEGREE + 1], second[CFEM_MOST_DEGREE + 1];
} polynomials;

static void evaluate(double z, polynomials *t) {
    double value[CFEM_MOST_DEGREE + 1], first[CFEM_MOST_DEGREE + 1], second[CFEM_MOST_DEGREE + 1];
    cfem_chebyshev(z, CFEM_DEGREE, value, first, second);
    for (int k = 0; k <= CFEM_DEGREE; k++)
        t->value[k] = (cfem_real)value[k], t->first[k] = (cfem_real)first[k], t->second[k] = (cfem_real)second[k];
}

/* Value, gradient and Hessian (upper triangle) of the potential: sum[0]. A sum of depth d is over the terms that share the degrees of the
 * coordinates before d, with the polynomials of the others. */
typedef struct {
    cfem_real value, gradient[MOST], hessian[MOST][MOST];
} quadratic;

/* Of the coordinates from d on. */
static inline void clear(quadratic *q, int d, const int n) {
    q->value = 0;
    for (int i = d; i < n; i++) {
        q->gradient[i] = 0;
        for (int j = i; j < n; j++) q->hessian[i][j] = 0;
    }
}

CFEM_INLINE void potential(const polynomials *t, const int n, quadratic sum[MOST]) {
    const cfem_group *group = cfem_potential_groups;
    for (int d = 0; d < n; d++) clear(&sum[d], d, n);
    for (int g = 0, m = 0; g < CFEM_POTENTIAL_GROUPS; g++, group++) {
        cfem_real leaf = 0, leaf_first = 0, leaf_second = 0;
        for (; m < group->end; m++) {
            const int k = cfem_potential_degrees[m];
            leaf += cfem_potential[m] * t[n - 1].value[k];
            leaf_first += cfem_potential[m] * t[n - 1].first[k];
            leaf_second += cfem_potential[m] * t[n - 1].second[k];
        }
        sum[n - 1].value += leaf, sum[n - 1].gradient[n - 1] += leaf_first, sum[n - 1].hessian[n - 1][n - 1] += leaf_second;
        for (int d = n - 2; d >= group->depth; d--) {
            const int k = group->degrees[d];
            const cfem_real value = t[d].value[k], first = t[d].first[k];
            const quadratic *from = &sum[d + 1];
            quadratic *to = &sum[d];
            to->value += value * from->value;
            to->gradient[d] += first * from->value;
            to->hessian[d][d] += t[d].second[k] * from->value;
            for (int i = d + 1; i < n; i++) {
                to->gradient[i] += value * from->gradient[i];
                to->hessian[d][i] += first * from->gradient[i];
                for (int j = i; j < n; j++) to->hessian[i][j] += value * from->hessian[i][j];
            }
            clear(&sum[d + 1], d + 1, n);
        }
    }
}

/* out[i], i < n: derivative of the outputs by z_i; out[n]: their values. */
CFEM_INLINE void effectors(const polynomials *t, const int n, const int outputs, cfem_real out[MOST + 1][MOST_OUTPUTS]) {
    cfem_real sum[MOST][MOST + 1][MOST_OUTPUTS];
    const cfem_group *group = cfem_effector_groups;
    for (int d = 0; d < n; d++)
        for (int i = d; i <= n; i++) EACH(o) sum[d][i][o] = 0;
    for (int g = 0, m = 0; g < CFEM_EFFECTOR_GROUPS; g++, group++) {
        cfem_real leaf[MOST_OUTPUTS], leaf_first[MOST_OUTPUTS];
        EACH(o) leaf[o] = leaf_first[o] = 0;
        for (; m < group->end; m++) {
            const cfem_real *c = cfem_effector + m * outputs;
            const cfem_real value = t[n - 1].value[cfem_effector_degrees[m]];
            const cfem_real first = t[n - 1].first[cfem_effector_degrees[m]];
            EACH(o) leaf[o] += c[o] * value, leaf_first[o] += c[o] * first;
        }
        if (n == 1) {
            EACH(o) sum[0][1][o] = leaf[o], sum[0][0][o] = leaf_first[o];
            continue;
        }
#if CFEM_MOST_NZ > 1
        const int l = group->degrees[n - 2];
        const cfem_real before = t[n - 2].value[l], before_first = t[n - 2].first[l];
        EACH(o) {
            sum[n - 2][n][o] += before * leaf[o];
            sum[n - 2][n - 1][o] += before * leaf_first[o];
            sum[n - 2][n - 2][o] += before_first * leaf[o];
        }
        for (int d = n - 3; d >= group->depth; d--) {
            const int k = group->degrees[d];
            const cfem_real value = t[d].value[k], first = t[d].first[k];
            EACH(o) sum[d][d][o] += first * sum[d + 1][n][o];
            for (int i = d + 1; i <= n; i++)
                EACH(o) sum[d][i][o] += value * sum[d + 1][i][o], sum[d + 1][i][o] = 0;
        }
#endif
    }
    for (int i = 0; i <= n; i++) EACH(o) out[i][o] = sum[0][i][o];
}

CFEM_INLINE void at_input(const int n, const double *s, polynomials t[MOST]) {
    for (int i = 0; i < n; i++) {
        double z = cfem_offset[i];
        for (int j = 0; j < NA; j++) z += cfem_to_box[i][j] * s[j];
        evaluate(z, &t[i]);
    }
}

/* From z to s: gradients by to_box^T, the Hessian on both sides. */
CFEM_INLINE void potential_parts(const int n, const polynomials *t, cfem_parts *parts) {
    quadratic sum[MOST], *const psi = sum;
    potential(t, n, sum);
    for (int i = 0; i < n; i++)
        for (int k = 0; k < i; k++) psi->hessian[i][k] = psi->hessian[k][i];
    for (int i = 0; i < NA; i++) {
        double row[MOST];
        parts->gradient[i] = 0.0;
        for (int k = 0; k < n; k++) {
            parts->gradient[i] += cfem_to_box[k][i] * (double)psi->gradient[k];
            row[k] = 0.0;
            for (int l = 0; l < n; l++) row[k] += cfem_to_box[l][i] * (double)psi->hessian[l][k];
        }
        for (int j = 0; j < NA; j++) {
            parts->hessian[i][j] = 0.0;
            for (int k = 0; k < n; k++) parts->hessian[i][j] += row[k] * cfem_to_box[k][j];
        }
    }
#if CFEM_FULL
    parts->energy = (double)psi->value;
#endif
}

CFEM_INLINE void effector_parts(const int n, const int outputs, const polynomials *t, cfem_parts *parts) {
    cfem_real e[MOST + 1][MOST_OUTPUTS];
    effectors(t, n, outputs, e);
    for (int o = 0; o < NE; o++) {
        parts->effector[o] = (double)e[n][o];
        for (int i = 0; i < NA; i++) {
            parts->effector_gradient[o][i] = 0.0;
            for (int k = 0; k < n; k++) parts->effector_gradient[o][i] += (double)e[k][o] * cfem_to_box[k][i];
        }
    }
#if CFEM_FULL
    for (int i = 0, packed = NE; i < NE; i++)
        for (int j = i; j < NE; j++, packed++) parts->compliance[i][j] = parts->compliance[j][i] = (double)e[n][packed];
#endif
}

CFEM_INLINE void of_sizes(const int n, const int outputs, const double *s, cfem_parts *parts) {
    polynomials t[MOST];
    at_input(n, s, t);
    potential_parts(n, t, parts);
    effector_parts(n, outputs, t, parts);
}

/* Loops of few and known rounds are unrolled: two actuators and one point are common. */
void cfem_spectral(const double s[CFEM_MOST_SERIES_NA], cfem_parts *parts) {
    if (CFEM_NZ == 2 && OUTPUTS == 3)
        of_sizes(2, 3, s, parts);
    else
        of_sizes(CFEM_NZ, OUTPUTS, s, parts);
}

void cfem_potential_parts(const double s[CFEM_MOST_SERIES_NA], cfem_parts *parts) {
    polynomials t[MOST];
    at_input(CFEM_NZ, s, t);
    potential_parts(CFEM_NZ, t, parts);
}

void cfem_effector_parts(const double s[CFEM_MOST_SERIES_NA], cfem_parts *parts) {
    polynomials t[MOST];
    at_input(CFEM_NZ, s, t);
    effector_parts(CFEM_NZ, OUTPUTS, t, parts);
}

#endif
