/* Chebyshev series in a learned box, sum_m c_m prod_i T_(k_mi)(z_i), z = to_box s + offset: polynomials, one term, a sum of terms.
 * Every series of the sources is made of these; cfem_spectral.c and cfem_series.c share products between terms. */
#ifndef CFEM_CHEBYSHEV_H
#define CFEM_CHEBYSHEV_H

#include <stdint.h>

/* Sizes are arguments, so that loops unroll where these are constants. */
#if defined(__GNUC__)
#define CFEM_INLINE static inline __attribute__((always_inline))
#else
#define CFEM_INLINE static inline
#endif

/* The coordinates z (n,) of inputs s (inputs,); to_box (n, inputs), its rows `stride` numbers after each other. A table of polynomials
 * (orders, rows, across), rows >= n, across > degree, holds T_k, then T_k', then T_k''. */
typedef struct {
    int n, inputs, stride, degree, rows, across;
    const double *to_box, *offset;
} cfem_box;

/* T_k(z), k = 0 ... degree, and unless NULL T_k' and T_k''. Always in double precision: their rounding grows with the degree. */
CFEM_INLINE void cfem_chebyshev(double z, int degree, double *value, double *slope, double *curve) {
    value[0] = 1.0;
    if (slope) slope[0] = 0.0;
    if (curve) curve[0] = 0.0;
    if (degree < 1) return;
    value[1] = z;
    if (slope) slope[1] = 1.0;
    if (curve) curve[1] = 0.0;
    for (int k = 2; k <= degree; k++) {
        value[k] = 2.0 * z * value[k - 1] - value[k - 2];
        if (slope) slope[k] = 2.0 * value[k - 1] + 2.0 * z * slope[k - 1] - slope[k - 2];
        if (curve) curve[k] = 4.0 * slope[k - 1] + 2.0 * z * curve[k - 1] - curve[k - 2];
    }
}

/* Fills the first `orders` of a table, at s. */
CFEM_INLINE void cfem_polynomials(const cfem_box box, const double *s, int orders, double *table) {
    const int size = box.rows * box.across;
    for (int i = 0; i < box.n; i++) {
        double z = box.offset[i], *value = table + i * box.across;
        for (int j = 0; j < box.inputs; j++) z += box.to_box[i * box.stride + j] * s[j];
        cfem_chebyshev(z, box.degree, value, orders > 1 ? value + size : 0, orders > 2 ? value + 2 * size : 0);
    }
}

/* The term of these degrees (n,), derived by z_i and by z_j; -1: by none. */
CFEM_INLINE double cfem_term(const cfem_box box, const double *table, const uint8_t *degrees, int i, int j) {
    double term = 1.0;
    for (int k = 0; k < box.n; k++) term *= table[(((k == i) + (k == j)) * box.rows + k) * box.across + degrees[k]];
    return term;
}

/* values (outputs,) += the sum of terms, of coefficients c (terms, outputs) and degrees (terms, n); slopes (n, outputs), unless NULL, += its
 * derivatives by z. */
CFEM_INLINE void cfem_add_terms(const cfem_box box, const double *table, int terms, const uint8_t *degrees, int outputs, const double *c,
                                double *values, double *slopes) {
    for (int m = 0; m < terms; m++, degrees += box.n, c += outputs) {
        const double term = cfem_term(box, table, degrees, -1, -1);
        for (int o = 0; o < outputs; o++) values[o] += c[o] * term;
        for (int i = 0; slopes && i < box.n; i++) {
            if (!degrees[i]) continue;
            const double slope = cfem_term(box, table, degrees, i, -1);
            for (int o = 0; o < outputs; o++) slopes[i * outputs + o] += c[o] * slope;
        }
    }
}

#endif
