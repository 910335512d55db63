/* The surface of the robot: x_p = X_p + sum_k u_kp rows_k + sum_q R_p L_pq R_q^T f_q + R_p E_p[g_p, g_p] / 2, g_p = R_p^T f_p,
 * rows = s_0 + C_ss w + Q D_ss[v, v] / 2 + ..., w_k = sum_p u_kp . f_p, v = Q^T w; see cfem.predict.contact.forces.held_robot. */
#include "cfem_chebyshev.h"
#include "cfem_linear.h"
#include "cfem_touch.h"

#define K CFEM_PATCH_ROWS
#define NA CFEM_NA
#define NE CFEM_NE
#define PACKED (NE * K + K * (K + 1) / 2)
#define M CFEM_PATCH_BENDS
#define CUBES (M * (M + 1) * (M + 2) / 6)
static const double TRUSTED = 0.8; /* to which a body that softens is followed; see cfem.predict.contact.forces.high_order */
static const double THIRD = 2.5;   /* the third order over the square of the second; see cfem.predict.contact.forces.load_kernel */

#define DEGREES (CFEM_PATCH_DEGREE + 1)
#define LOCAL 4 /* polynomials in what the modes leave, whose degree is 3 at most */

#define BOX {NA, NA, NA, CFEM_PATCH_DEGREE, NA, DEGREES, cfem_patch_to_box[0], cfem_patch_offset}
static const cfem_box local_box = {.n = NA, .rows = NA, .across = LOCAL};

/* Polynomials, and their derivatives by delta_a, in the box of the patches. */
static void local_polynomials(const double *delta_a, double t[2][NA][LOCAL]) {
    for (int i = 0; i < NA; i++) {
        const double by = 2.0 / (cfem_patch_box[1][i] - cfem_patch_box[0][i]);
        cfem_chebyshev(by * (delta_a[i] - cfem_patch_box[0][i]) - 1.0, LOCAL - 1, t[0][i], t[1][i], 0);
        for (int k = 0; k < LOCAL; k++) t[1][i][k] *= by;
    }
}

int cfem_touch_is_far(const double delta_a[NA]) {
    int far = 0;
    for (int i = 0; i < NA; i++) {
        const double low = cfem_domain_delta_a[0][i], high = cfem_domain_delta_a[1][i];
        far |= high > low && fmax(low - delta_a[i], delta_a[i] - high) > high - low;
    }
    return far;
}

unsigned cfem_touch_hold(const double delta_a[NA], cfem_touched *now, cfem_touch_room *room) {
    cfem_condensed m;
    double packed[PACKED] = {0.0}, t[NA][DEGREES], local[2][NA][LOCAL];
    now->error = room->error = 0.0, now->deep = now->unsettled = 0, now->outside = 1;
    if (cfem_touch_is_far(delta_a) || cfem_model(delta_a, &m)) return CFEM_TOUCH_NO_MODEL;
    now->outside = cfem_outside(&m) != CFEM_OK;
    for (int e = 0; e < NE; e++) now->delta_e[e] = m.free_e[e] + cfem_dot(NA, m.W_ea[e], m.lambda_a);
    for (int i = 0; i < NA; i++) now->lambda_a[i] = m.lambda_a[i], room->s[i] = now->delta_a[i] = delta_a[i];
    cfem_box box = BOX;
    cfem_polynomials(box, delta_a, 1, t[0]);
    local_polynomials(delta_a, local);
    for (int k = 0; k < K; k++) room->rows[k] = 0.0;
    cfem_add_terms(box, t[0], CFEM_PATCH_TERMS, cfem_patch_degrees[0], K, cfem_patch_series[0], room->rows, 0);
    cfem_add_terms(box, t[0], CFEM_PATCH_COMPLIANCE_TERMS, cfem_patch_compliance_degrees[0], PACKED, cfem_patch_compliance[0], packed, 0);
    for (int e = 0; e < NE; e++)
        for (int k = 0; k < K; k++) room->C_es[e][k] = packed[e * K + k];
    for (int i = 0, at = NE * K; i < K; i++)
        for (int j = i; j < K; j++, at++) room->C_ss[i][j] = room->C_ss[j][i] = packed[at];
    for (int i = 0; i < CFEM_PATCH_BENT; i++) room->D[i] = 0.0;
    for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++) {
        const double term = room->terms[l] = cfem_term(local_box, local[0][0], cfem_patch_local_degrees[l], -1, -1);
        for (int i = 0; i < CFEM_PATCH_BENT; i++) room->D[i] += term * (double)cfem_patch_bent[l][i];
    }
    for (int p = 0; p < CFEM_PATCHES; p++)
        for (int a = 0; a < 3; a++) room->free[p][a] = cfem_patch_rest[p][a] + cfem_dot(K, cfem_patch_modes[p][a], room->rows);
    room->count = -1;
    for (int p = 0; p < CFEM_PATCHES; p++) room->turns[p] = 0;
    return 0;
}

/* w (K,) N: the load on the modes. */
static void work(int count, const int *patch, double (*force)[3], double *w) {
    for (int k = 0; k < K; k++) w[k] = 0.0;
    for (int i = 0; i < count; i++)
        for (int a = 0; a < 3; a++)
            for (int k = 0; k < K; k++) w[k] += cfem_patch_modes[patch[i]][a][k] * force[i][a];
}

/* motion (n,) mm under a load (n,) N that moves by `first` and `second`, C w and D[w, w]; across (n,) mm: of its derivative, whose
 * part it is by `rank`. */
static cfem_beyond beyond(int n, const double *load, const double *first, const double *second, double *motion, double *across) {
    const double twice = cfem_dot(n, load, first), r = twice > 0.0 ? cfem_dot(n, load, second) / (2.0 * twice) : 0.0;
    const double within = r > TRUSTED ? TRUSTED : r, g = 1.0 / (1.0 - 0.75 * within), slope = g * g / 3.0;
    cfem_beyond found = {1.0 - within * g * within * g / 2.0, 3.0 * slope, g * g * g / 2.0};
    if (r > TRUSTED) {
        const double B = slope * TRUSTED * TRUSTED, A = 0.5 + within * g / 3.0 + slope * TRUSTED;
        found.first = 2.0 * A - 4.0 * B / r, found.second = 3.0 * B / (r * r), found.rank = -2.0 * B / (r * r * r);
    }
    found.rank = twice > 0.0 ? found.rank / twice : 0.0;
    for (int i = 0; i < n; i++) {
        motion[i] = found.first * first[i] + found.second / 2.0 * second[i];
        across[i] = 1.5 * second[i] - 2.0 * r * first[i];
    }
    return found;
}

/* What patch i of the room does beyond `left` under its force. */
static void dented(int i, const double *force, cfem_touch_room *room) {
    double first[3], second[3], across[3], change[3][3];
    for (int a = 0; a < 3; a++) {
        first[a] = room->stiff[i] * force[a];
        for (int b = 0; b < 3; b++) change[a][b] = cfem_dot(3, room->dent[i][a][b], force);
        second[a] = cfem_dot(3, change[a], force);
    }
    const cfem_beyond of = room->by_dents[i] = beyond(3, force, first, second, room->beyond_own[i], across);
    for (int a = 0; a < 3; a++) {
        room->beyond_own[i][a] -= first[a];
        for (int b = 0; b < 3; b++)
            room->own_slope[i][a][b] = of.second * change[a][b] + of.rank * across[a] * across[b];
        room->own_slope[i][a][a] += (of.first - 1.0) * room->stiff[i];
    }
}

/* D[v]. Each number of D, of i <= j <= k, is met by three pairs of the mixtures, or fewer where they are the same. */
static void bend(cfem_touch_room *room) {
    const double *at = room->D, *const v = room->v;
    double(*const to)[M] = room->change + NE;
    for (int i = 0; i < (NE + M) * M; i++) room->change[i / M][i % M] = 0.0;
    for (int i = 0; i < M; i++)
        for (int j = i; j < M; j++) {
            const double by_i = i == j ? 0.0 : v[i], by_j = v[j], *const D = at - j;
            double sum = D[j] * by_j;
            to[j][j] += by_i * D[j];
            for (int k = j + 1; k < M; k++) sum += D[k] * v[k], to[i][k] += D[k] * by_j, to[j][k] += D[k] * by_i;
            to[i][j] += sum, at += M - j;
        }
    for (int i = 0; i < M; i++)
        for (int j = 0; j < i; j++) to[i][j] = to[j][i];
    for (int e = 0; e < NE; e++)
        for (int i = 0; i < M; i++) {
            double sum = *at++ * v[i];
            for (int j = i + 1; j < M; j++, at++) sum += *at * v[j], room->change[e][j] += *at * v[i];
            room->change[e][i] += sum;
        }
}

/* The load on the modes, and what it does. */
static void load(int count, const int *patch, double (*force)[3], cfem_touch_room *room) {
    double first[K], second[K], mixed[M];
    work(count, patch, force, room->w);
    for (int i = 0; i < M; i++) room->v[i] = 0.0;
    for (int k = 0; k < K; k++)
        for (int i = 0; i < M; i++) room->v[i] += cfem_patch_bends[k][i] * room->w[k];
    bend(room);
    for (int i = 0; i < M; i++) mixed[i] = cfem_dot(M, room->change[NE + i], room->v);
    for (int k = 0; k < K; k++)
        first[k] = cfem_dot(K, room->C_ss[k], room->w), second[k] = cfem_dot(M, cfem_patch_bends[k], mixed);
    room->by_modes = beyond(K, room->w, first, second, room->moved, room->across);
    const double size = cfem_dot(K, first, first), share = size > 0.0 ? sqrt(cfem_dot(K, second, second) / size) / 2.0 : 0.0;
    room->error = cfem_larger(room->error, (CFEM_PATCH_MISSING + THIRD * share) * share);
}

void cfem_touch_bear(int count, const int *patch, double (*force)[3], cfem_touch_room *room) {
    load(count, patch, force, room);
    for (int i = 0; i < count; i++) dented(i, force[i], room);
}

void cfem_touch_yield(int count, const int *patch, cfem_touch_room *room) {
    const int n = 3 * count;
    const cfem_beyond of = room->by_modes;
    double across[CFEM_TOUCH_ROWS];
    for (int i = 0; i < n; i++) across[i] = cfem_dot(K, cfem_patch_modes[patch[i / 3]][i % 3], room->across);
    for (int i = 0; i < count; i++) {
        double by[3][M] = {{0.0}};
        for (int k = 0; k < M; k++)
            for (int a = 0; a < 3; a++)
                for (int l = 0; l < M; l++) by[a][l] += cfem_patch_bending[patch[i]][a][k] * room->change[NE + k][l];
        for (int j = i; j < count; j++)
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) {
                    const int at = (3 * i + a) * n + 3 * j + b, other = (3 * j + b) * n + 3 * i + a;
                    room->yields[at] = room->yields[other] =
                        room->total[at] + (of.first - 1.0) * (room->total[at] - room->left[at]) +
                        of.second * cfem_dot(M, by[a], cfem_patch_bending[patch[j]][b]) + of.rank * across[3 * i + a] * across[3 * j + b];
                }
        for (int a = 0; a < 9; a++) room->yields[(3 * i + a / 3) * n + 3 * i + a % 3] += room->own_slope[i][a / 3][a % 3];
    }
}

void cfem_touch_places(int count, const int *patch, double (*force)[3], const cfem_touch_room *room, double (*place)[3]) {
    for (int p = 0; p < CFEM_PATCHES; p++)
        for (int a = 0; a < 3; a++)
            place[p][a] = room->free[p][a] + (count ? cfem_dot(K, cfem_patch_modes[p][a], room->moved) : 0.0);
    for (int i = 0; i < 3 * count; i++)
        place[patch[i / 3]][i % 3] +=
            cfem_dot(3 * count, room->left + i * 3 * count, &force[0][0]) + room->beyond_own[i / 3][i % 3];
}

/* delta_e under forces on patches, which are those of the room in the same order, or some of them. */
static void move_tip(cfem_touched *now, cfem_touch_room *room) {
    const cfem_beyond modes = room->by_modes;
    for (int e = 0; e < NE; e++)
        now->delta_e[e] +=
            modes.first * cfem_dot(K, room->C_es[e], room->w) + modes.second / 2.0 * cfem_dot(M, room->change[e], room->v);
    for (int i = 0, at = 0; i < now->count; i++, at++) {
        while (room->of[at] != now->patch[i]) at++;
        const double(*const turn)[3] = cfem_touch_rotation(now->patch[i], room);
        double own[3] = {0.0};
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) own[a] += turn[b][a] * now->force[i][b];
        const double pairs[6] = {own[0] * own[0], 2.0 * own[0] * own[1], 2.0 * own[0] * own[2],
                                 own[1] * own[1], 2.0 * own[1] * own[2], own[2] * own[2]};
        for (int e = 0; e < NE; e++) {
            double first = 0.0, second = 0.0;
            for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++) {
                first += room->terms[l] * cfem_dot(3, cfem_patch_local_tip[now->patch[i]][l][e], own);
                for (int k = 0; k < 6; k++)
                    second += room->terms[l] * (double)cfem_patch_dented_tip[now->patch[i]][l][e][k] * pairs[k];
            }
            now->delta_e[e] += first + room->by_dents[at].second / 2.0 * second;
        }
    }
}

static double weighted(int n, const float *a, const double *b) {
    double sum[4] = {0.0}; /* which wait less for each other than one */
    int i = 0;
    for (; i + 3 < n; i += 4) {
        sum[0] += (double)a[i] * b[i], sum[1] += (double)a[i + 1] * b[i + 1];
        sum[2] += (double)a[i + 2] * b[i + 2], sum[3] += (double)a[i + 3] * b[i + 3];
    }
    for (; i < n; i++) sum[0] += (double)a[i] * b[i];
    return sum[0] + sum[1] + sum[2] + sum[3];
}

void cfem_touch_loaded(cfem_touched *now, cfem_touch_room *room) {
    const double *const w = room->w, *const v = room->v;
    double slope[NA] = {0.0}, cubes[CUBES], *at = cubes, t[2][NA][DEGREES], local[2][NA][LOCAL];
    now->error = room->error;
    for (int k = 0; k < K; k++) now->rows[k] = room->rows[k] + (now->count ? room->moved[k] : 0.0);
    if (!now->count) return;
    move_tip(now, room);
    /* lambda = grad (Psi - w . s_0 - Phi), see cfem.predict.contact.forces.high_order */
    cfem_box box = BOX;
    cfem_polynomials(box, room->s, 2, t[0][0]);
    local_polynomials(room->s, local);
    for (int l = 0; l < CFEM_PATCH_TERMS; l++) {
        const double load = cfem_dot(K, cfem_patch_series[l], w);
        for (int i = 0; i < NA; i++) slope[i] += load * cfem_term(box, t[0][0], cfem_patch_degrees[l], i, -1);
    }
    for (int l = 0; l < CFEM_PATCH_COMPLIANCE_TERMS; l++) {
        const double *C = cfem_patch_compliance[l] + NE * K;
        double load = 0.0;
        for (int i = 0; i < K; i++)
            for (int j = i; j < K; j++) load += (i == j ? 0.5 : 1.0) * w[i] * w[j] * *C++;
        load *= room->by_modes.first;
        for (int i = 0; i < NA; i++) slope[i] += load * cfem_term(box, t[0][0], cfem_patch_compliance_degrees[l], i, -1);
    }
    for (int i = 0; i < M; i++)
        for (int j = i; j < M; j++) {
            const double pair = v[i] * v[j], others = (i == j ? 3.0 : 6.0) * pair;
            *at++ = (i == j ? 1.0 : 3.0) * pair * v[j];
            for (int k = j + 1; k < M; k++) *at++ = others * v[k];
        }
    for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++) {
        const double third = weighted(CUBES, cfem_patch_bent[l], cubes);
        for (int j = 0; j < NA; j++)
            now->lambda_a[j] -= room->by_modes.second * third / 6.0 * cfem_term(local_box, local[0][0], cfem_patch_local_degrees[l], j, -1);
    }
    for (int j = 0; j < NA; j++)
        for (int i = 0; i < NA; i++) now->lambda_a[j] -= cfem_patch_to_box[i][j] * slope[i];
}
