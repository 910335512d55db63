/* Small dense algebra. */
#ifndef CFEM_LINEAR_H
#define CFEM_LINEAR_H

#include <math.h>

/* A tolerance, by what the numbers resolve: folders are written in double or in single precision. */
#define CFEM_TOLERANCE(in_double, in_single) (sizeof(double) == 8 ? (in_double) : (in_single))

static inline double cfem_dot(int n, const double *a, const double *b) {
    double even = 0.0, odd = 0.0; /* two sums wait less for each other than one */
    int i = 0;
    for (; i + 1 < n; i += 2) even += a[i] * b[i], odd += a[i + 1] * b[i + 1];
    return i < n ? even + a[i] * b[i] + odd : even + odd;
}

/* Without a call, as fmax is where a processor has none; b where one is no number. */
static inline double cfem_larger(double a, double b) { return a > b ? a : b; }

static inline int cfem_finite(double x) { return x - x == 0.0; }

/* A = L L^T of a symmetric matrix (n, n), whose rows begin `stride` numbers after each other; of A only the lower triangle is read, and L
 * takes its place. 0, or 1 where A is not positive definite: a pivot is not above `least` of its diagonal. */
static inline int cfem_cholesky(int n, int stride, double *A, double least) {
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) {
            const double sum = A[i * stride + j] - cfem_dot(j, A + i * stride, A + j * stride);
            if (i == j && !(sum > least * fabs(A[i * stride + i]))) return 1;
            A[i * stride + j] = i == j ? sqrt(sum) : sum / A[j * stride + j];
        }
    return 0;
}

/* b := L^-1 b, whose first `begin` entries are zero, and b := L^-T b. */
static inline void cfem_lower(int n, int stride, const double *L, int begin, double *b) {
    for (int i = begin; i < n; i++) b[i] = (b[i] - cfem_dot(i - begin, L + i * stride + begin, b + begin)) / L[i * stride + i];
}
static inline void cfem_upper(int n, int stride, const double *L, double *b) {
    for (int i = n - 1; i >= 0; i--) {
        b[i] /= L[i * stride + i];
        for (int j = 0; j < i; j++) b[j] -= L[i * stride + j] * b[i];
    }
}

/* The inverse of a symmetric matrix (n, n), whose rows begin `stride` numbers after each other, by Cholesky: A = L L^T, in place. 0,
 * or 1 where A is not positive definite to rounding. Only the upper triangle of A is read. */
static inline int cfem_invert(int n, int stride, double *A) {
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++) A[i * stride + j] = A[j * stride + i];
    if (cfem_cholesky(n, stride, A, CFEM_TOLERANCE(1e-14, 1e-6))) return 1;
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

/* Solves A X = B in place, A (n, n), B (n, k), rows after each other, by elimination with pivots. 0, or 1 where A is singular; sign: of the
 * determinant. */
static inline int cfem_eliminate(int n, double *A, int k, double *B, double *sign) {
    *sign = 1.0;
    for (int i = 0; i < n; i++) {
        int pivot = i;
        for (int r = i + 1; r < n; r++)
            if (fabs(A[r * n + i]) > fabs(A[pivot * n + i])) pivot = r;
        if (!(fabs(A[pivot * n + i]) > 0.0)) return 1;
        if ((A[pivot * n + i] < 0.0) != (pivot != i)) *sign = -*sign;
        if (pivot != i) {
            for (int c = i; c < n; c++) {
                const double kept = A[i * n + c];
                A[i * n + c] = A[pivot * n + c], A[pivot * n + c] = kept;
            }
            for (int c = 0; c < k; c++) {
                const double kept = B[i * k + c];
                B[i * k + c] = B[pivot * k + c], B[pivot * k + c] = kept;
            }
        }
        const double inverse = 1.0 / A[i * n + i], *const by = A + i * n;
        for (int r = i + 1; r < n; r++) {
            double *const row = A + r * n;
            const double share = row[i] * inverse;
            if (share == 0.0) continue;
            for (int c = i + 1; c < n; c++) row[c] -= share * by[c];
            for (int c = 0; c < k; c++) B[r * k + c] -= share * B[i * k + c];
        }
    }
    for (int i = n - 1; i >= 0; i--)
        for (int c = 0; c < k; c++) {
            double sum = B[i * k + c];
            for (int j = i + 1; j < n; j++) sum -= A[i * n + j] * B[j * k + c];
            B[i * k + c] = sum / A[i * n + i];
        }
    return 0;
}

/* Eigenvectors of a symmetric matrix A (n, n) in the columns of V by Jacobi's cyclic rotations (Golub and Van Loan, Matrix Computations,
 * 8.5); rows of both begin `stride` numbers after each other. A becomes diagonal. */
static inline void cfem_jacobi(int n, int stride, double *A, double *V) {
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) V[i * stride + j] = i == j;
    for (int sweep = 0; sweep < 60; sweep++) {
        double off = 0.0, on = 0.0;
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) *(i == j ? &on : &off) += A[i * stride + j] * A[i * stride + j];
        if (!(off > CFEM_TOLERANCE(1e-32, 1e-14) * on)) return;
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) {
                if (A[p * stride + q] == 0.0) continue;
                const double theta = (A[q * stride + q] - A[p * stride + p]) / (2.0 * A[p * stride + q]);
                const double t = (theta < 0.0 ? -1.0 : 1.0) / (fabs(theta) + sqrt(theta * theta + 1.0));
                const double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
                for (int i = 0; i < n; i++) { /* columns of A and V */
                    double *const a = A + i * stride, *const v = V + i * stride, left = a[p], right = a[q], from = v[p], to = v[q];
                    a[p] = c * left - s * right, a[q] = s * left + c * right;
                    v[p] = c * from - s * to, v[q] = s * from + c * to;
                }
                for (int i = 0; i < n; i++) {
                    const double left = A[p * stride + i], right = A[q * stride + i];
                    A[p * stride + i] = c * left - s * right, A[q * stride + i] = s * left + c * right;
                }
            }
    }
}

/* out = A B of matrices (3, 3). */
static inline void cfem_multiply(double A[3][3], double B[3][3], double out[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) out[i][j] = A[i][0] * B[0][j] + A[i][1] * B[1][j] + A[i][2] * B[2][j];
}

#endif
