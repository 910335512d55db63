/* Symmetric forms of the first CFEM_POSE of numbers w, packed as their entries i <= j <= ..., and their derivatives by w; a matrix is of
 * all CFEM_ROW_EACH. */
#ifndef CFEM_FORMS_H
#define CFEM_FORMS_H

#include "cfem_row.h"

/* out = M w of a matrix. */
static void cfem_by_matrix(const cfem_real *M, const double *w, double *out) {
    for (int i = 0; i < CFEM_ROW_EACH; i++) out[i] = 0.0;
    for (int i = 0; i < CFEM_ROW_EACH; i++)
        for (int j = i; j < CFEM_ROW_EACH; j++, M++) {
            out[i] += (double)*M * w[j];
            if (j != i) out[j] += (double)*M * w[i];
        }
}

/* out = M[w, w] / 2 of a tensor of three indices. */
static void cfem_by_cube(const cfem_real *M, const double *w, double *out) {
    for (int i = 0; i < CFEM_POSE; i++) out[i] = 0.0;
    for (int i = 0; i < CFEM_POSE; i++)
        for (int j = i; j < CFEM_POSE; j++)
            for (int k = j; k < CFEM_POSE; k++, M++) {
                const double c = (double)*M;
                out[i] += j == k ? c * w[j] * w[k] / 2.0 : c * w[j] * w[k];
                if (j != i) out[j] += c * w[i] * w[k];
                if (k != j) out[k] += i == j ? c * w[i] * w[j] / 2.0 : c * w[i] * w[j];
            }
}

/* w_i w_j w_k at i <= j <= k, over the factorials of how often each index occurs. */
static void cfem_triples(const double *w, double out[CFEM_POSE][CFEM_POSE][CFEM_POSE]) {
    for (int i = 0; i < CFEM_POSE; i++)
        for (int j = i; j < CFEM_POSE; j++)
            for (int k = j; k < CFEM_POSE; k++)
                out[i][j][k] = w[i] * w[j] * w[k] / (i == k ? 6.0 : i == j || j == k ? 2.0 : 1.0);
}

/* out = M[w, w, w] / 6 of a tensor of four indices. */
static void cfem_by_fourth(const cfem_real *M, double w3[CFEM_POSE][CFEM_POSE][CFEM_POSE], double *out) {
    for (int i = 0; i < CFEM_POSE; i++) out[i] = 0.0;
    for (int i = 0; i < CFEM_POSE; i++)
        for (int j = i; j < CFEM_POSE; j++)
            for (int k = j; k < CFEM_POSE; k++)
                for (int l = k; l < CFEM_POSE; l++, M++) {
                    const double c = (double)*M;
                    out[l] += c * w3[i][j][k];
                    if (k != l) out[k] += c * w3[i][j][l];
                    if (j != k) out[j] += c * w3[i][k][l];
                    if (i != j) out[i] += c * w3[j][k][l];
                }
}

/* S = M[w, w] / 2 of a tensor of four indices: each two of an entry's indices, once, by the other two. */
static void cfem_square_of_fourth(const double *M, const double *w, double S[CFEM_POSE][CFEM_POSE]) {
    for (int i = 0; i < CFEM_POSE; i++)
        for (int j = 0; j < CFEM_POSE; j++) S[i][j] = 0.0;
    int at[4];
    for (at[0] = 0; at[0] < CFEM_POSE; at[0]++)
        for (at[1] = at[0]; at[1] < CFEM_POSE; at[1]++)
            for (at[2] = at[1]; at[2] < CFEM_POSE; at[2]++)
                for (at[3] = at[2]; at[3] < CFEM_POSE; at[3]++, M++)
                    for (int p = 0; p < 3; p++) {
                        if (p && at[p] == at[p - 1]) continue;
                        for (int q = p + 1; q < 4; q++) {
                            if (q > p + 1 && at[q] == at[q - 1]) continue;
                            const int r = p ? 0 : q == 1 ? 2 : 1, s = 6 - p - q - r;
                            S[at[p]][at[q]] += *M * w[at[r]] * w[at[s]] / (at[r] == at[s] ? 2.0 : 1.0);
                        }
                    }
    for (int i = 0; i < CFEM_POSE; i++)
        for (int j = 0; j < i; j++) S[i][j] = S[j][i];
}

#endif
