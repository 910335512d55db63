/* Poses of modules in a row to the places of its effectors: the tip X, and the centre of mass Y where it is one, with their derivatives.
 * With A_i the frame at the base of module i, R_i its turn, and x_i, c_i the places of its end and centre of mass in it, the row
 * behind module i is, in the frame at its end,
 *
 *     X_i = x_(i+1) + R_(i+1) X_(i+1)        Y_i = S x_(i+1) + s c_(i+1) + R_(i+1) Y_(i+1)
 *
 * s: the share of module i + 1 in the mass, S: of those behind it. Forces f_j on patches z_j of module i + 1, and the sum T of those
 * behind it, work on
 *
 *     Z_i = sum f_j z_j^T + T x_(i+1)^T + Z_(i+1) R_(i+1)^T
 *
 * All the work is < A_(i+1), M_i >, M_i = w_X X_i^T + w_Y Y_i^T + Z_i. */
#include "cfem_row.h"

#if CFEM_ROW

#include "cfem_linear.h"

#define K CFEM_MODULES
#define P CFEM_ROW_EACH
#define PATCHES CFEM_ROW_PATCHES
#define HEAVY (CFEM_POSE > 6)

typedef double matrix[3][3];

/* exp [phi], its first and second derivatives by phi: Rodrigues' formula, whose functions of s = |phi|^2 are power series. */
static void turn(const double phi[3], matrix R, matrix first[3], matrix second[3][3]) {
    const double s = cfem_dot(3, phi, phi);
    double a[3] = {0}, b[3] = {0}, power = 1.0, ca[22], cb[22];
    ca[0] = 1.0, cb[0] = 0.5;
    for (int k = 1; k < 22; k++) ca[k] = -ca[k - 1] / ((2 * k) * (2 * k + 1)), cb[k] = -cb[k - 1] / ((2 * k + 1) * (2 * k + 2));
    for (int k = 0; k < 20; k++, power *= s) { /* values, first and second derivatives by s */
        a[0] += ca[k] * power, a[1] += (k + 1) * ca[k + 1] * power, a[2] += (k + 1) * (k + 2) * ca[k + 2] * power;
        b[0] += cb[k] * power, b[1] += (k + 1) * cb[k + 1] * power, b[2] += (k + 1) * (k + 2) * cb[k + 2] * power;
    }
    const matrix S = {{0, -phi[2], phi[1]}, {phi[2], 0, -phi[0]}, {-phi[1], phi[0], 0}};
    for (int p = 0; p < 3; p++)
        for (int q = 0; q < 3; q++) {
            const double SS = phi[p] * phi[q] - (p == q ? s : 0.0);
            R[p][q] = (p == q) + a[0] * S[p][q] + b[0] * SS;
            for (int i = 0; i < 3; i++) {
                const double spin = p == q ? 0.0 : (p + 1) % 3 == q ? (i == (q + 1) % 3 ? -1.0 : 0.0) : (i == (p + 1) % 3 ? 1.0 : 0.0);
                const double square = (p == i) * phi[q] + (q == i) * phi[p] - (p == q ? 2.0 * phi[i] : 0.0);
                first[i][p][q] = 2.0 * phi[i] * (a[1] * S[p][q] + b[1] * SS) + a[0] * spin + b[0] * square;
                for (int j = 0; j < 3; j++) {
                    const double spin_j = p == q ? 0.0 : (p + 1) % 3 == q ? (j == (q + 1) % 3 ? -1.0 : 0.0) : (j == (p + 1) % 3 ? 1.0 : 0.0);
                    const double square_j = (p == j) * phi[q] + (q == j) * phi[p] - (p == q ? 2.0 * phi[j] : 0.0);
                    const double both = (p == i) * (q == j) + (q == i) * (p == j) - (p == q ? 2.0 * (i == j) : 0.0);
                    second[i][j][p][q] = 4.0 * phi[i] * phi[j] * (a[2] * S[p][q] + b[2] * SS) + b[0] * both +
                                         2.0 * phi[i] * (a[1] * spin_j + b[1] * square_j) +
                                         2.0 * phi[j] * (a[1] * spin + b[1] * square) +
                                         (i == j) * 2.0 * (a[1] * S[p][q] + b[1] * SS);
                }
            }
        }
}

static double inner(matrix A, matrix B) { return cfem_dot(9, &A[0][0], &B[0][0]); }

/* A^T x */
static void back(matrix A, const double *x, double out[3]) {
    for (int i = 0; i < 3; i++) out[i] = A[0][i] * x[0] + A[1][i] * x[1] + A[2][i] * x[2];
}

void cfem_row_places(double e[K][P], double y[CFEM_NE], double B[CFEM_NE][CFEM_ROW_N], double work[CFEM_ROW_N],
                     double V[CFEM_ROW_N][CFEM_ROW_N]) {
    matrix A[K + 1] = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, R[K], first[K][3], second[K][3][3], M[K + 1], Z[K + 1] = {{{0}}};
    double X[K + 1][3], Y[K + 1][3], behind[K + 1], T[K + 1][3] = {{0}}; /* of the row behind a module's base; its share in the mass */
    for (int r = 0; r < CFEM_NE; r++)
        for (int n = 0; n < CFEM_ROW_N; n++) B[r][n] = 0.0;
    for (int m = 0; m < CFEM_ROW_N; m++) {
        work[m] = 0.0;
        for (int n = 0; n < CFEM_ROW_N; n++) V[m][n] = 0.0;
    }
    for (int i = 0; i < K; i++) {
        turn(e[i] + 3, R[i], first[i], second[i]);
        cfem_multiply(A[i], R[i], A[i + 1]);
    }
    behind[K] = 0.0;
    for (int f = 0; f < 3; f++) X[K][f] = Y[K][f] = 0.0;
    for (int i = K - 1; i >= 0; i--) {
        behind[i] = behind[i + 1] + cfem_module_share[i];
        for (int f = 0; f < 3; f++) {
            const double x = cfem_module_rest[i][f] + e[i][f];
            X[i][f] = x + cfem_dot(3, R[i][f], X[i + 1]);
            Y[i][f] = behind[i + 1] * x + cfem_dot(3, R[i][f], Y[i + 1]);
#if HEAVY
            Y[i][f] += cfem_module_share[i] * (cfem_module_rest[i][6 + f] + e[i][6 + f]);
#endif
            for (int p = 0; p < 3; p++) Z[i][p][f] = T[i + 1][p] * x + cfem_dot(3, Z[i + 1][p], R[i][f]);
        }
        for (int f = 0; f < 3; f++) T[i][f] = T[i + 1][f];
        for (int l = 0; l < PATCHES; l++)
            for (int p = 0; p < 3; p++) {
                const int at = CFEM_POSE + 3 * l;
                const double force = cfem_row_force[i][3 * l + p];
                T[i][p] += force;
                for (int q = 0; q < 3; q++) Z[i][p][q] += force * (cfem_module_rest[i][at + q] + e[i][at + q]);
            }
    }
    for (int i = 0; i <= K; i++)
        for (int p = 0; p < 3; p++)
            for (int q = 0; q < 3; q++)
                M[i][p][q] = cfem_wrench[p] * X[i][q] + (HEAVY ? cfem_wrench[CFEM_NE - 3 + p] * Y[i][q] : 0.0) + Z[i][p][q];
    for (int r = 0; r < 3; r++) y[r] = X[0][r], y[CFEM_NE - 3 + r] = HEAVY ? Y[0][r] : X[0][r];
    for (int i = 0; i < K; i++) {
        const int at = i * P;
        for (int p = 0; p < 3; p++)
            for (int q = 0; q < 3; q++) {
                B[p][at + q] = A[i][p][q];
#if HEAVY
                B[3 + p][at + q] = behind[i + 1] * A[i][p][q];
                B[3 + p][at + 6 + q] = cfem_module_share[i] * A[i][p][q];
#endif
            }
        back(A[i], T[i + 1], work + at);
        for (int l = 0; l < PATCHES; l++) back(A[i], cfem_row_force[i] + 3 * l, work + at + CFEM_POSE + 3 * l);
        for (int a = 0; a < 3; a++) {
            const int here = at + 3 + a;
            matrix turned; /* the frame behind module i, by its rotation */
            cfem_multiply(A[i], first[i][a], turned);
            work[here] = inner(turned, Z[i + 1]);
            for (int p = 0; p < 3; p++) {
                B[p][here] = cfem_dot(3, turned[p], X[i + 1]);
#if HEAVY
                B[3 + p][here] = cfem_dot(3, turned[p], Y[i + 1]);
#endif
            }
            for (int b = 0; b < 3; b++) {
                matrix bent;
                cfem_multiply(A[i], second[i][a][b], bent);
                V[here][at + 3 + b] = -inner(bent, M[i + 1]);
            }
            for (int j = i + 1; j < K; j++) {
                const int there = j * P;
                double force[3], pulled[3];
                matrix next;
                for (int f = 0; f < 3; f++)
                    force[f] = cfem_wrench[f] + (HEAVY ? behind[j + 1] * cfem_wrench[CFEM_NE - 3 + f] : 0.0) + T[j + 1][f];
                back(turned, force, pulled);
                for (int f = 0; f < 3; f++) V[here][there + f] = V[there + f][here] = -pulled[f];
#if HEAVY
                back(turned, cfem_wrench + 3, pulled);
                for (int f = 0; f < 3; f++) V[here][there + 6 + f] = V[there + 6 + f][here] = -cfem_module_share[j] * pulled[f];
#endif
                for (int l = 0; l < PATCHES; l++) {
                    const int place = there + CFEM_POSE + 3 * l;
                    back(turned, cfem_row_force[j] + 3 * l, pulled);
                    for (int f = 0; f < 3; f++) V[here][place + f] = V[place + f][here] = -pulled[f];
                }
                for (int b = 0; b < 3; b++) {
                    cfem_multiply(turned, first[j][b], next);
                    V[here][there + 3 + b] = V[there + 3 + b][here] = -inner(next, M[j + 1]);
                }
                cfem_multiply(turned, R[j], next);
                for (int p = 0; p < 3; p++)
                    for (int q = 0; q < 3; q++) turned[p][q] = next[p][q];
            }
        }
    }
    for (int n = 0; n < CFEM_ROW_N; n++)
        for (int r = 0; r < CFEM_NE; r++) work[n] += cfem_wrench[r] * B[r][n];
}

#endif
