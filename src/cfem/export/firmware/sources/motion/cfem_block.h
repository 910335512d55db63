/* Dense algebra on a few columns at once, which stay in registers. */
#ifndef CFEM_BLOCK_H
#define CFEM_BLOCK_H

#include <math.h>

#include "cfem_motion_room.h"

/* out (rows, m) += A (rows, inner) z (inner, m): two rows at once, whose columns are summed in registers. */
CFEM_INLINE void cfem_add_product(int rows, int inner, const double *A, int across, int m, const double *z, int stride, double *out,
                             int wide) {
    int i = 0;
    for (; i + 1 < rows; i += 2, A += 2 * across, out += 2 * wide) {
        double one[CFEM_MOTION_MOST_NA], other[CFEM_MOTION_MOST_NA];
        CFEM_UNROLL for (int c = 0; c < m; c++) one[c] = out[c], other[c] = out[wide + c];
        const double *from = z;
        for (int j = 0; j < inner; j++, from += stride) {
            const double a = A[j], b = A[across + j];
            CFEM_UNROLL for (int c = 0; c < m; c++) one[c] += a * from[c], other[c] += b * from[c];
        }
        CFEM_UNROLL for (int c = 0; c < m; c++) out[c] = one[c], out[wide + c] = other[c];
    }
    if (i == rows) return;
    double one[CFEM_MOTION_MOST_NA];
    CFEM_UNROLL for (int c = 0; c < m; c++) one[c] = out[c];
    for (int j = 0; j < inner; j++, z += stride) CFEM_UNROLL for (int c = 0; c < m; c++) one[c] += A[j] * z[c];
    CFEM_UNROLL for (int c = 0; c < m; c++) out[c] = one[c];
}

/* A's rows and columns from `first` up to n become L U with row pivots, the diagonal of U its inverse; 1 where A is singular. */
static inline int cfem_factorise(int first, int n, double A[CFEM_MOTION_MOST_NQ][CFEM_MOTION_MOST_NQ], int *pivots) {
    for (int k = first; k < n; k++) {
        int pivot = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(A[i][k]) > fabs(A[pivot][k])) pivot = i;
        if (!(fabs(A[pivot][k]) > 0.0)) return 1;
        pivots[k] = pivot;
        for (int j = first; j < n && pivot != k; j++) {
            const double one = A[k][j];
            A[k][j] = A[pivot][j], A[pivot][j] = one;
        }
        const double by = A[k][k] = 1.0 / A[k][k], *restrict row = A[k];
        for (int i = k + 1; i < n; i++) {
            double *restrict to = A[i];
            const double factor = to[k] *= by;
            for (int j = k + 1; j < n; j++) to[j] -= factor * row[j];
        }
    }
    return 0;
}

/* X (n, m) := A^-1 X from row `first` on, L and U as of cfem_factorise. */
CFEM_INLINE void cfem_solve(const double LU[CFEM_MOTION_MOST_NQ][CFEM_MOTION_MOST_NQ], const int *pivots, int first, int n, int m, double *X) {
    for (int k = first; k < n; k++)
        for (int c = 0; c < m && pivots[k] != k; c++) {
            const double one = X[k * m + c];
            X[k * m + c] = X[pivots[k] * m + c], X[pivots[k] * m + c] = one;
        }
    for (int i = first; i < n; i += 2) { /* two rows at once, of which the second needs the first */
        const double *A = LU[i], *B = LU[i + 1 < n ? i + 1 : i], *from = X + first * m;
        double one[CFEM_MOTION_MOST_NA], other[CFEM_MOTION_MOST_NA], *to = X + i * m;
        CFEM_UNROLL for (int c = 0; c < m; c++) one[c] = to[c], other[c] = i + 1 < n ? to[m + c] : 0.0;
        for (int j = first; j < i; j++, from += m) {
            const double a = A[j], b = B[j];
            CFEM_UNROLL for (int c = 0; c < m; c++) one[c] -= a * from[c], other[c] -= b * from[c];
        }
        CFEM_UNROLL for (int c = 0; c < m; c++) to[c] = one[c];
        for (int c = 0; c < m && i + 1 < n; c++) to[m + c] = other[c] - B[i] * one[c];
    }
    for (int i = n - 1; i >= first; i -= 2) {
        const double *A = LU[i], *B = LU[i > first ? i - 1 : i], *from = X + (i + 1) * m;
        double one[CFEM_MOTION_MOST_NA], other[CFEM_MOTION_MOST_NA], *to = X + i * m;
        CFEM_UNROLL for (int c = 0; c < m; c++) one[c] = to[c], other[c] = i > first ? to[c - m] : 0.0;
        for (int j = i + 1; j < n; j++, from += m) {
            const double a = A[j], b = B[j];
            CFEM_UNROLL for (int c = 0; c < m; c++) one[c] -= a * from[c], other[c] -= b * from[c];
        }
        CFEM_UNROLL for (int c = 0; c < m; c++) to[c] = one[c] *= A[i];
        for (int c = 0; c < m && i > first; c++) to[c - m] = (other[c] - B[i] * one[c]) * B[i - 1];
    }
}

#endif
