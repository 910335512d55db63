/* How patches of the surface turn with the robot, and how they yield to forces on each other; see cfem.predict.contact.surface.patched_model. */
#include "cfem_linear.h"
#include "cfem_touch.h"

#define K CFEM_PATCH_ROWS

/* Without row and column i and j: the determinant of what is left of A (4, 4), with its sign. */
static double cofactor(const double *A, int i, int j) {
    const double *const x = A + 4 * (i < 1), *const y = A + 4 * (i < 2 ? 2 : 1), *const z = A + 4 * (i < 3 ? 3 : 2);
    const int a = j < 1, b = j < 2 ? 2 : 1, c = j < 3 ? 3 : 2;
    const double found = x[a] * (y[b] * z[c] - y[c] * z[b]) - x[b] * (y[a] * z[c] - y[c] * z[a]) + x[c] * (y[a] * z[b] - y[b] * z[a]);
    return (i + j) % 2 ? -found : found;
}

/* q: eigenvector of the largest eigenvalue of N (4, 4), of the matrix M (3, 3) of Horn's method. That is the largest root of a
 * quartic (Theobald, Rapid calculation of RMSDs using a quaternion-based characteristic polynomial, 2005), to which Newton's method comes
 * down from above; the cofactors of N without it are q q^T. 1 where it is near another one. */
static int largest_vector(const double M[3][3], const double *N, double *q) {
    double square = 0.0, minors = 0.0, det = 0.0, A[16], most = 0.0, length = 0.0;
    int best = 0;
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) {
            const int c = (a + 1) % 3, d = (a + 2) % 3, e = (b + 1) % 3, f = (b + 2) % 3;
            const double minor = M[c][e] * M[d][f] - M[c][f] * M[d][e];
            square += M[a][b] * M[a][b], minors += minor * minor, det += M[a][b] * minor / 3.0;
        }
    const double none = square * square - 4.0 * minors;
    double root = sqrt(3.0 * square), last = HUGE_VAL;
    while (root < last) {
        const double value = ((root * root - 2.0 * square) * root - 8.0 * det) * root + none;
        last = root, root -= value / ((4.0 * root * root - 4.0 * square) * root - 8.0 * det);
    }
    for (int i = 0; i < 16; i++) A[i] = N[i] - (i % 5 ? 0.0 : last);
    for (int i = 0; i < 4; i++) {
        q[i] = fabs(cofactor(A, i, i));
        if (q[i] > q[best]) best = i;
    }
    most = q[best];
    if (!(most > 1e-4 * last * last * last)) return 1;
    for (int i = 0; i < 4; i++) q[i] = cofactor(A, best, i), length += q[i] * q[i];
    for (int i = 0; i < 4; i++) q[i] /= sqrt(length);
    return 0;
}

/* Rotation R of a patch since rest that fits its nodes best, from M = sum (x - mean x) (X - mean X)^T: the quaternion of the largest
 * eigenvalue (Horn, Closed-form solution of absolute orientation using unit quaternions, 1987). */
const double (*cfem_touch_rotation(int patch, cfem_touch_room *room))[3] {
    double M[3][3], V[16], q[4], (*const R)[3] = room->R[patch];
    if (room->turns[patch]) return (const double(*)[3])R;
    room->turns[patch] = 1;
    for (int a = 0; a < 9; a++)
        M[a / 3][a % 3] = cfem_patch_spread[patch][a] + cfem_dot(K, cfem_patch_spread_by_row[patch][a], room->rows);
    double N[16] = {
        M[0][0] + M[1][1] + M[2][2], M[2][1] - M[1][2], M[0][2] - M[2][0], M[1][0] - M[0][1],
        M[2][1] - M[1][2], M[0][0] - M[1][1] - M[2][2], M[0][1] + M[1][0], M[0][2] + M[2][0],
        M[0][2] - M[2][0], M[0][1] + M[1][0], M[1][1] - M[0][0] - M[2][2], M[1][2] + M[2][1],
        M[1][0] - M[0][1], M[0][2] + M[2][0], M[1][2] + M[2][1], M[2][2] - M[0][0] - M[1][1]};
    if (largest_vector((const double(*)[3])M, N, q)) {
        int best = 0;
        cfem_jacobi(4, 4, N, V);
        for (int i = 1; i < 4; i++)
            if (N[5 * i] > N[5 * best]) best = i;
        for (int i = 0; i < 4; i++) q[i] = V[4 * i + best];
    }
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    R[0][0] = w * w + x * x - y * y - z * z, R[0][1] = 2 * (x * y - w * z), R[0][2] = 2 * (x * z + w * y);
    R[1][0] = 2 * (x * y + w * z), R[1][1] = w * w - x * x + y * y - z * z, R[1][2] = 2 * (y * z - w * x);
    R[2][0] = 2 * (x * z - w * y), R[2][1] = 2 * (y * z + w * x), R[2][2] = w * w - x * x - y * y + z * z;
    return (const double(*)[3])R;
}

/* A (n, n) without its negative eigenvalues; V: room for as many numbers. */
static void without_negative(int n, double *A, double *V, double *size) {
    cfem_jacobi(n, n, A, V);
    for (int i = 0; i < n; i++) size[i] = A[i * n + i] > 0.0 ? A[i * n + i] : 0.0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            A[i * n + j] = 0.0;
            for (int k = 0; k < n; k++) A[i * n + j] += V[i * n + k] * size[k] * V[j * n + k];
        }
}

/* `dent` of patch i of the room; 10 numbers a term are stored, of a <= b <= c. */
static void dent(int i, const double (*R)[3], cfem_touch_room *room) {
    static const int at[3][3][3] = {
        {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}}, {{1, 3, 4}, {3, 6, 7}, {4, 7, 8}}, {{2, 4, 5}, {4, 7, 8}, {5, 8, 9}}};
    double stored[10] = {0.0}, half[3][3][3], most[3][3][3], (*const E)[3][3] = room->dent[i];
    for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++)
        for (int k = 0; k < 10; k++) stored[k] += room->terms[l] * (double)cfem_patch_dented[room->of[i]][l][k];
    for (int k = 0; k < 27; k++) {
        const int a = k / 9, b = k / 3 % 3, c = k % 3;
        half[a][b][c] = R[a][0] * stored[at[0][b][c]] + R[a][1] * stored[at[1][b][c]] + R[a][2] * stored[at[2][b][c]];
    }
    for (int k = 0; k < 27; k++) {
        const int a = k / 9, b = k / 3 % 3, c = k % 3;
        most[a][b][c] = R[b][0] * half[a][0][c] + R[b][1] * half[a][1][c] + R[b][2] * half[a][2][c];
    }
    for (int k = 0; k < 27; k++) E[k / 9][k / 3 % 3][k % 3] = cfem_dot(3, R[k % 3], most[k / 9][k / 3 % 3]);
}

/* Harmonic mean of the eigenvalues of a symmetric matrix A (3, 3), whose rows begin n numbers after each other. */
static double stiff(const double *A, int n) {
    const double *const B = A + n, *const C = B + n;
    const double x = B[1] * C[2] - B[2] * C[1], y = B[2] * C[0] - B[0] * C[2], z = B[0] * C[1] - B[1] * C[0];
    return 3.0 * (A[0] * x + A[1] * y + A[2] * z) / (x + A[0] * C[2] - A[2] * C[0] + A[0] * B[1] - A[1] * B[0]);
}

/* by (3, K): the modes of a patch times S. */
static void through(int patch, double (*S)[K], double (*by)[K]) {
    double x[K] = {0.0}, y[K] = {0.0}, z[K] = {0.0}; /* of their own, so that no compiler fears that they are parts of S */
    for (int k = 0; k < K; k++) {
        const double u = cfem_patch_modes[patch][0][k], v = cfem_patch_modes[patch][1][k], w = cfem_patch_modes[patch][2][k];
        for (int l = 0; l < K; l++) x[l] += u * S[k][l], y[l] += v * S[k][l], z[l] += w * S[k][l];
    }
    for (int l = 0; l < K; l++) by[0][l] = x[l], by[1][l] = y[l], by[2][l] = z[l];
}

int cfem_touch_compliance(int count, const int *patch, cfem_touch_room *room) {
    const int n = 3 * count;
    double size[CFEM_TOUCH_ROWS], finite = 0.0;
    const double(*R[CFEM_TOUCH_MOST])[3];
    int same = room->count == count;
    for (int i = 0; same && i < count; i++) same = room->of[i] == patch[i];
    if (same) return 0;
    room->count = count;
    for (int i = 0; i < count; i++) room->of[i] = patch[i], R[i] = cfem_touch_rotation(patch[i], room);
    for (int i = 0; i < count; i++) {
        double by[3][K];
        through(patch[i], room->C_ss, by);
        for (int j = i; j < count; j++) { /* patches in ascending order: the pair is stored as it is asked */
            const int p = patch[i], q = patch[j];
            const float(*const of)[9] = cfem_patch_local[p * CFEM_PATCHES - p * (p - 1) / 2 + q - p];
            double L[9] = {0.0}, half[9], turned[9];
            for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++)
                for (int a = 0; a < 9; a++) L[a] += room->terms[l] * (double)of[l][a];
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++)
                    half[3 * a + b] = R[i][a][0] * L[b] + R[i][a][1] * L[3 + b] + R[i][a][2] * L[6 + b];
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) turned[3 * a + b] = cfem_dot(3, half + 3 * a, R[j][b]);
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) {
                    const int one = (3 * i + a) * n + 3 * j + b, other = (3 * j + b) * n + 3 * i + a;
                    const double left = i == j ? (turned[3 * a + b] + turned[3 * b + a]) / 2.0 : turned[3 * a + b];
                    const double smooth = cfem_dot(K, by[a], cfem_patch_modes[q][b]);
                    room->left[one] = room->left[other] = left;
                    room->total[one] = room->total[other] = smooth + left;
                    finite += smooth + left;
                }
        }
    }
    if (!cfem_finite(finite)) return 1;
    for (int i = 0; i < n * n; i++) room->W[i] = room->total[i];
    if (cfem_cholesky(n, n, room->W, 0.0)) {
        for (int i = 0; i < n * n; i++) room->left[i] -= room->total[i];
        without_negative(n, room->total, room->W, size);
        for (int i = 0; i < n * n; i++) room->left[i] += room->total[i];
    }
    for (int i = 0; i < count; i++)
        room->stiff[i] = stiff(room->total + 3 * i * (n + 1), n);
    for (int i = 0; i < count; i++) dent(i, R[i], room);
    return 0;
}
