/* The surface of the robot: x_p = X_p + sum_k u_kp rows_k + sum_q R_p L_pq R_q^T f_q + R_p E_p[g_p, g_p] / 2, g_p = R_p^T f_p,
 * rows = s_0 + C_ss w + D_ss[w, w] / 2, w_k = sum_p u_kp . f_p; see cfem.predict.touchable. */
#include "cfem_linear.h"
#include "cfem_touch.h"

#define K CFEM_PATCH_ROWS
#define NA CFEM_NA
#define NE CFEM_NE
#define PACKED (NE * K + K * (K + 1) / 2)
#define SWEEPS 60
#define HALVINGS 4 /* of how much of the dents is taken, before none is */
static const double TRUSTED = 0.3; /* largest share of the motion by forces that is of second order */

typedef struct {
    double value[NA][CFEM_PATCH_DEGREE + 2], slope[NA][CFEM_PATCH_DEGREE + 2];
} polynomials;

/* Chebyshev polynomials and their derivatives. */
static void evaluate(const double *s, polynomials *t) {
    for (int i = 0; i < NA; i++) {
        double z = cfem_patch_offset[i];
        for (int j = 0; j < NA; j++) z += cfem_patch_to_box[i][j] * s[j];
        t->value[i][0] = 1.0, t->value[i][1] = z, t->slope[i][0] = 0.0, t->slope[i][1] = 1.0;
        for (int k = 2; k <= CFEM_PATCH_DEGREE; k++) {
            t->value[i][k] = 2.0 * z * t->value[i][k - 1] - t->value[i][k - 2];
            t->slope[i][k] = 2.0 * t->value[i][k - 1] + 2.0 * z * t->slope[i][k - 1] - t->slope[i][k - 2];
        }
    }
}

static double product(const polynomials *t, const uint8_t *degrees, int slope_of) {
    double found = 1.0;
    for (int i = 0; i < NA; i++) found *= (i == slope_of ? t->slope : t->value)[i][degrees[i]];
    return found;
}

static double in_box(double delta, int i) {
    return 2.0 * (delta - cfem_patch_box[0][i]) / (cfem_patch_box[1][i] - cfem_patch_box[0][i]) - 1.0;
}

/* Of the polynomial of degree 3 at most of what the modes leave; or its derivative by delta_a, number slope_of. */
static double local_term(const double *delta_a, int term, int slope_of) {
    double found = 1.0;
    for (int i = 0; i < NA; i++) {
        const int degree = cfem_patch_local_degrees[term][i];
        const double z = in_box(delta_a[i], i), by = 2.0 / (cfem_patch_box[1][i] - cfem_patch_box[0][i]);
        const double value[] = {1.0, z, 2.0 * z * z - 1.0, (4.0 * z * z - 3.0) * z};
        const double slope[] = {0.0, by, 4.0 * z * by, (12.0 * z * z - 3.0) * by};
        found *= (i == slope_of ? slope : value)[degree];
    }
    return found;
}

unsigned cfem_touch_hold(const double delta_a[NA], cfem_touched *now, cfem_touch_room *room) {
    polynomials t;
    cfem_condensed m;
    double packed[PACKED] = {0.0};
    if (cfem_model(delta_a, &m)) return CFEM_TOUCH_NO_MODEL;
    for (int e = 0; e < NE; e++) now->delta_e[e] = m.free_e[e] + cfem_dot(NA, m.W_ea[e], m.lambda_a);
    for (int i = 0; i < NA; i++) now->lambda_a[i] = m.lambda_a[i], room->s[i] = delta_a[i];
    evaluate(delta_a, &t);
    for (int k = 0; k < K; k++) room->rows[k] = 0.0;
    for (int l = 0; l < CFEM_PATCH_TERMS; l++) {
        const double value = product(&t, cfem_patch_degrees[l], -1);
        for (int k = 0; k < K; k++) room->rows[k] += cfem_patch_series[l][k] * value;
    }
    for (int l = 0; l < CFEM_PATCH_COMPLIANCE_TERMS; l++) {
        const double value = product(&t, cfem_patch_compliance_degrees[l], -1);
        for (int k = 0; k < PACKED; k++) packed[k] += cfem_patch_compliance[l][k] * value;
    }
    for (int e = 0; e < NE; e++)
        for (int k = 0; k < K; k++) room->C_es[e][k] = packed[e * K + k];
    for (int i = 0, at = NE * K; i < K; i++)
        for (int j = i; j < K; j++, at++) room->C_ss[i][j] = room->C_ss[j][i] = packed[at];
    for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++) room->terms[l] = local_term(delta_a, l, -1);
    for (int i = 0; i < K * (NE + K) * K; i++) {
        double sum = 0.0;
        for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++) sum += room->terms[l] * (&cfem_patch_bent[l][0][0][0])[i];
        (&room->D[0][0][0])[i] = sum;
    }
    for (int p = 0; p < CFEM_PATCHES; p++)
        for (int a = 0; a < 3; a++) room->free[p][a] = cfem_patch_rest[p][a] + cfem_dot(K, cfem_patch_modes[p][a], room->rows);
    room->count = -1;
    return 0;
}

/* Eigenvectors of a symmetric matrix A (n, n) in the columns of V by Jacobi's rotations; A becomes diagonal. */
static void jacobi(int n, double *A, double *V) {
    for (int i = 0; i < n * n; i++) V[i] = i % (n + 1) ? 0.0 : 1.0;
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double off = 0.0, on = 0.0;
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++) *(i == j ? &on : &off) += A[i * n + j] * A[i * n + j];
        if (!(off > 1e-32 * on)) return;
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) {
                if (A[p * n + q] == 0.0) continue;
                const double theta = (A[q * n + q] - A[p * n + p]) / (2.0 * A[p * n + q]);
                const double t = (theta < 0.0 ? -1.0 : 1.0) / (fabs(theta) + sqrt(theta * theta + 1.0));
                const double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
                for (int i = 0; i < n; i++) {
                    const double a = A[i * n + p], b = A[i * n + q];
                    A[i * n + p] = c * a - s * b, A[i * n + q] = s * a + c * b;
                }
                for (int i = 0; i < n; i++) {
                    const double a = A[p * n + i], b = A[q * n + i];
                    A[p * n + i] = c * a - s * b, A[q * n + i] = s * a + c * b;
                }
                for (int i = 0; i < n; i++) {
                    const double a = V[i * n + p], b = V[i * n + q];
                    V[i * n + p] = c * a - s * b, V[i * n + q] = s * a + c * b;
                }
            }
    }
}

/* Rotation R of a patch since rest that fits its nodes best, from M = sum (x - mean x) (X - mean X)^T: the quaternion of the largest
 * eigenvalue (Horn, Closed-form solution of absolute orientation using unit quaternions, 1987). */
static void rotation(int patch, const double *rows, double R[3][3]) {
    double M[3][3], V[16];
    for (int a = 0; a < 9; a++)
        M[a / 3][a % 3] = cfem_patch_spread[patch][a] + cfem_dot(K, cfem_patch_spread_by_row[patch][a], rows);
    double N[16] = {
        M[0][0] + M[1][1] + M[2][2], M[2][1] - M[1][2], M[0][2] - M[2][0], M[1][0] - M[0][1],
        M[2][1] - M[1][2], M[0][0] - M[1][1] - M[2][2], M[0][1] + M[1][0], M[0][2] + M[2][0],
        M[0][2] - M[2][0], M[0][1] + M[1][0], M[1][1] - M[0][0] - M[2][2], M[1][2] + M[2][1],
        M[1][0] - M[0][1], M[0][2] + M[2][0], M[1][2] + M[2][1], M[2][2] - M[0][0] - M[1][1]};
    jacobi(4, N, V);
    int best = 0;
    for (int i = 1; i < 4; i++)
        if (N[5 * i] > N[5 * best]) best = i;
    const double w = V[best], x = V[4 + best], y = V[8 + best], z = V[12 + best];
    R[0][0] = w * w + x * x - y * y - z * z, R[0][1] = 2 * (x * y - w * z), R[0][2] = 2 * (x * z + w * y);
    R[1][0] = 2 * (x * y + w * z), R[1][1] = w * w - x * x + y * y - z * z, R[1][2] = 2 * (y * z - w * x);
    R[2][0] = 2 * (x * z - w * y), R[2][1] = 2 * (y * z + w * x), R[2][2] = w * w - x * x - y * y + z * z;
}

/* A (n, n) without its negative eigenvalues; V: room for as many numbers. */
static void without_negative(int n, double *A, double *V, double *size) {
    jacobi(n, A, V);
    for (int i = 0; i < n; i++) size[i] = A[i * n + i] > 0.0 ? A[i * n + i] : 0.0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            A[i * n + j] = 0.0;
            for (int k = 0; k < n; k++) A[i * n + j] += V[i * n + k] * size[k] * V[j * n + k];
        }
}

/* E of a patch in the robot's axes; 10 numbers a term, of a <= b <= c. */
static void dents(int patch, double R[3][3], const double *terms, double E[3][3][3]) {
    double own[10] = {0.0}, half[3][3][3], most[3][3][3];
    static const int at[3][3][3] = {{{0, 1, 2}, {1, 3, 4}, {2, 4, 5}}, {{1, 3, 4}, {3, 6, 7}, {4, 7, 8}}, {{2, 4, 5}, {4, 7, 8}, {5, 8, 9}}};
    for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++)
        for (int i = 0; i < 10; i++) own[i] += terms[l] * (double)cfem_patch_dented[patch][l][i];
    for (int i = 0; i < 27; i++) {
        const int a = i / 9, b = i / 3 % 3, c = i % 3;
        half[a][b][c] = R[a][0] * own[at[0][b][c]] + R[a][1] * own[at[1][b][c]] + R[a][2] * own[at[2][b][c]];
    }
    for (int i = 0; i < 27; i++) {
        const int a = i / 9, b = i / 3 % 3, c = i % 3;
        most[a][b][c] = R[b][0] * half[a][0][c] + R[b][1] * half[a][1][c] + R[b][2] * half[a][2][c];
    }
    for (int i = 0; i < 27; i++) E[i / 9][i / 3 % 3][i % 3] = cfem_dot(3, R[i % 3], most[i / 9][i / 3 % 3]);
}

/* (3, 3) change of the local compliance of patch i of the room under the force on it. */
static void dented(const cfem_touch_room *room, int i, const double *force, double share, double change[3][3]) {
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) change[a][b] = share * cfem_dot(3, room->dent[i][a][b], force);
}

int cfem_touch_compliance(int count, const int *patch, cfem_touch_room *room) {
    const int n = 3 * count;
    double R[CFEM_TOUCH_MOST][3][3], size[CFEM_TOUCH_ROWS], finite = 0.0;
    int same = room->count == count;
    for (int i = 0; same && i < count; i++) same = room->of[i] == patch[i];
    if (same) return 0;
    room->count = count;
    for (int i = 0; i < count; i++) room->of[i] = patch[i], rotation(patch[i], room->rows, R[i]);
    for (int i = 0; i < count; i++) dents(patch[i], R[i], room->terms, room->dent[i]);
    for (int i = 0; i < count; i++) {
        double by[3][K]; /* U C_ss of patch i */
        for (int a = 0; a < 3; a++)
            for (int k = 0; k < K; k++) by[a][k] = cfem_dot(K, cfem_patch_modes[patch[i]][a], room->C_ss[k]);
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
    if (!cfem_definite(n, room->W)) {
        for (int i = 0; i < n * n; i++) room->left[i] -= room->total[i];
        without_negative(n, room->total, room->W, size);
        for (int i = 0; i < n * n; i++) room->left[i] += room->total[i];
    }
    return 0;
}

/* w (K,) N: the load on the modes. */
static void work(int count, const int *patch, double (*force)[3], double *w) {
    for (int k = 0; k < K; k++) w[k] = 0.0;
    for (int i = 0; i < count; i++)
        for (int a = 0; a < 3; a++)
            for (int k = 0; k < K; k++) w[k] += cfem_patch_modes[patch[i]][a][k] * force[i][a];
}

/* (NE + K, K) change of C_es and C_ss under w. */
static void second(const double *w, double share, const cfem_touch_room *room, double (*change)[K]) {
    for (int r = 0; r < NE + K; r++)
        for (int l = 0; l < K; l++) change[r][l] = 0.0;
    for (int k = 0; k < K; k++)
        for (int r = 0; r < NE + K; r++)
            for (int l = 0; l < K; l++) change[r][l] += share * w[k] * room->D[k][r][l];
}

/* `yields` under forces on patches, but for their dents. */
static void bend(int count, const int *patch, double (*force)[3], cfem_touch_room *room) {
    const int n = 3 * count;
    double w[K], change[NE + K][K], by[3][K];
    work(count, patch, force, w);
    second(w, room->share, room, change);
    for (int i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++)
            for (int k = 0; k < K; k++) by[a][k] = cfem_dot(K, change[NE + k], cfem_patch_modes[patch[i]][a]);
        for (int j = 0; j < count; j++)
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) {
                    const int at = (3 * i + a) * n + 3 * j + b;
                    room->yields[at] = room->total[at] + cfem_dot(K, by[a], cfem_patch_modes[patch[j]][b]);
                }
    }
}

/* Into W: `yields` with dents. Whether that is positive definite, which spoils W. */
static int dent(int count, const int *patch, double (*force)[3], cfem_touch_room *room) {
    const int n = 3 * count;
    for (int i = 0; i < n * n; i++) room->W[i] = room->yields[i];
    for (int i = 0; i < count; i++) {
        double own[3][3];
        dented(room, i, force[i], room->dent_share[patch[i]], own);
        for (int a = 0; a < 9; a++) room->W[(3 * i + a / 3) * n + 3 * i + a % 3] += own[a / 3][a % 3];
    }
    return cfem_definite(n, room->W);
}

/* How much of patch i's dents leaves its own compliance trustworthy. */
static double dent_share(int i, int n, const double *force, const cfem_touch_room *room) {
    double change[3][3], own[9], size = 0.0;
    dented(room, i, force, 1.0, change);
    for (int a = 0; a < 9; a++) own[a] = room->total[(3 * i + a / 3) * n + 3 * i + a % 3];
    if (cfem_solve(3, own, 3, &change[0][0])) return 0.0;
    for (int a = 0; a < 9; a++) size += change[a / 3][a % 3] * change[a / 3][a % 3];
    return sqrt(size) > 2.0 * TRUSTED ? 2.0 * TRUSTED / sqrt(size) : 1.0;
}

void cfem_touch_trust(int count, const int *patch, double (*force)[3], cfem_touch_room *room) {
    double w[K], change[NE + K][K], first = 0.0, more = 0.0, most = 0.0;
    work(count, patch, force, w);
    second(w, 1.0, room, change);
    for (int r = 0; r < K; r++) {
        const double one = cfem_dot(K, room->C_ss[r], w), two = cfem_dot(K, change[NE + r], w) / 2.0;
        first += one * one, more += two * two;
    }
    first = TRUSTED * sqrt(first), more = sqrt(more);
    room->share = more > first ? first / more : 1.0;
    for (int p = 0; p < CFEM_PATCHES; p++) room->dent_share[p] = 1.0;
    for (int i = 0; i < 3 * count; i++) most += fabs(force[i / 3][i % 3]);
    if (most == 0.0) return;
    for (int i = 0; i < count; i++) room->dent_share[patch[i]] = dent_share(i, 3 * count, force[i], room);
    bend(count, patch, force, room);
    for (int halving = 0; halving < HALVINGS; halving++) {
        if (dent(count, patch, force, room)) return;
        for (int i = 0; i < count; i++) room->dent_share[patch[i]] /= 2.0;
    }
    for (int i = 0; i < count; i++) room->dent_share[patch[i]] = 0.0;
}

void cfem_touch_bent(int count, const int *patch, double (*force)[3], cfem_touch_room *room) {
    const int n = 3 * count;
    bend(count, patch, force, room);
    const int definite = dent(count, patch, force, room);
    for (int i = 0; i < n * n && !definite; i++) room->yields[i] = room->total[i];
    for (int i = 0; i < count && definite; i++) {
        double own[3][3];
        dented(room, i, force[i], room->dent_share[patch[i]], own);
        for (int a = 0; a < 9; a++) room->yields[(3 * i + a / 3) * n + 3 * i + a % 3] += own[a / 3][a % 3];
    }
}

void cfem_touch_places(int count, const int *patch, double (*force)[3], const cfem_touch_room *room, double (*place)[3]) {
    double w[K], moved[K], change[NE + K][K];
    work(count, patch, force, w);
    second(w, room->share, room, change);
    for (int k = 0; k < K; k++) moved[k] = cfem_dot(K, room->C_ss[k], w) + cfem_dot(K, change[NE + k], w) / 2.0;
    for (int p = 0; p < CFEM_PATCHES; p++)
        for (int a = 0; a < 3; a++)
            place[p][a] = room->free[p][a] + (count ? cfem_dot(K, cfem_patch_modes[p][a], moved) : 0.0);
    for (int i = 0; i < 3 * count; i++)
        place[patch[i / 3]][i % 3] += cfem_dot(3 * count, room->left + i * 3 * count, &force[0][0]);
    for (int i = 0; i < count; i++) {
        double own[3][3];
        dented(room, i, force[i], room->dent_share[patch[i]], own);
        for (int a = 0; a < 3; a++) place[patch[i]][a] += cfem_dot(3, own[a], force[i]) / 2.0;
    }
}

/* delta_e under forces on patches. */
static void move_tip(cfem_touched *now, const cfem_touch_room *room, const double *w, double (*change)[K]) {
    for (int e = 0; e < NE; e++) now->delta_e[e] += cfem_dot(K, room->C_es[e], w) + cfem_dot(K, change[e], w) / 2.0;
    for (int i = 0; i < now->count; i++) {
        double R[3][3], own[3] = {0.0};
        rotation(now->patch[i], room->rows, R);
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) own[a] += R[b][a] * now->force[i][b];
        for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++)
            for (int e = 0; e < NE; e++)
                now->delta_e[e] += room->terms[l] * cfem_dot(3, cfem_patch_local_tip[now->patch[i]][l][e], own);
    }
}

void cfem_touch_loaded(cfem_touched *now, const cfem_touch_room *room) {
    double w[K], slope[NA] = {0.0}, change[NE + K][K];
    polynomials t;
    work(now->count, now->patch, now->force, w);
    second(w, room->share, room, change);
    for (int k = 0; k < K; k++)
        now->rows[k] = room->rows[k] + cfem_dot(K, room->C_ss[k], w) + cfem_dot(K, change[NE + k], w) / 2.0;
    if (!now->count) return;
    move_tip(now, room, w, change);
    /* lambda = grad (Psi - w . s_0 - w . C_ss w / 2 - D_ss[w, w, w] / 6) */
    evaluate(room->s, &t);
    for (int l = 0; l < CFEM_PATCH_TERMS; l++) {
        const double load = cfem_dot(K, cfem_patch_series[l], w);
        for (int i = 0; i < NA; i++) slope[i] += load * product(&t, cfem_patch_degrees[l], i);
    }
    for (int l = 0; l < CFEM_PATCH_COMPLIANCE_TERMS; l++) {
        const double *C = cfem_patch_compliance[l] + NE * K;
        double load = 0.0;
        for (int i = 0; i < K; i++)
            for (int j = i; j < K; j++) load += (i == j ? 0.5 : 1.0) * w[i] * w[j] * *C++;
        for (int i = 0; i < NA; i++) slope[i] += load * product(&t, cfem_patch_compliance_degrees[l], i);
    }
    for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++) {
        double third = 0.0;
        for (int k = 0; k < K; k++)
            for (int r = 0; r < K; r++) third += w[k] * w[r] * cfem_dot(K, cfem_patch_bent[l][k][NE + r], w);
        for (int j = 0; j < NA; j++) now->lambda_a[j] -= room->share * third / 6.0 * local_term(room->s, l, j);
    }
    for (int j = 0; j < NA; j++)
        for (int i = 0; i < NA; i++) now->lambda_a[j] -= cfem_patch_to_box[i][j] * slope[i];
}
