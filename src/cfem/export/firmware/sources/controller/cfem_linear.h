/* Small dense algebra in double precision. */
#ifndef CFEM_LINEAR_H
#define CFEM_LINEAR_H

#include <math.h>

static inline double cfem_dot(int n, const double *a, const double *b) {
    double even = 0.0, odd = 0.0; /* two sums wait less for each other than one */
    int i = 0;
    for (; i + 1 < n; i += 2) even += a[i] * b[i], odd += a[i + 1] * b[i + 1];
    return i < n ? even + a[i] * b[i] + odd : even + odd;
}

static inline int cfem_finite(double x) { return x - x == 0.0; }

/* The inverse of a symmetric matrix (n, n), whose rows begin `stride` numbers after each other, by Cholesky: A = L L^T, in place. 0,
 * or 1 where A is not positive definite to rounding. Only the upper triangle of A is read. */
static inline int cfem_invert(int n, int stride, double *A) {
    for (int j = 0; j < n; j++) { /* A's lower triangle becomes L, its diagonal the diagonal of L */
        double pivot = A[j * stride + j];
        for (int k = 0; k < j; k++) pivot -= A[j * stride + k] * A[j * stride + k];
        if (!(pivot > 1e-14 * fabs(A[j * stride + j]))) return 1;
        A[j * stride + j] = sqrt(pivot);
        for (int i = j + 1; i < n; i++) {
            double sum = A[j * stride + i];
            for (int k = 0; k < j; k++) sum -= A[i * stride + k] * A[j * stride + k];
            A[i * stride + j] = sum / A[j * stride + j];
        }
    }
    for (int j = 0; j < n; j++) { /* L -> L^-1 */
        A[j * stride + j] = 1.0 / A[j * stride + j];
        for (int i = j + 1; i < n; i++) {
            double sum = 0.0;
            for (int k = j; k < i; k++) sum -= A[i * stride + k] * A[k * stride + j];
            A[i * stride + j] = sum / A[i * stride + i];
        }
    }
    for (int i = 0; i < n; i++) /* A^-1 = L^-T L^-1, row by row from the top: what is overwritten is not read again */
        for (int j = i; j < n; j++) {
            double sum = 0.0;
            for (int k = j; k < n; k++) sum += A[k * stride + i] * A[k * stride + j];
            A[i * stride + j] = sum;
        }
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++) A[i * stride + j] = A[j * stride + i];
    return 0;
}

#endif
