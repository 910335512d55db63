/* The surface of the robot: x_p = X_p + sum_k u_kp rows_k + sum_q R_p L_pq R_q^T f_q + R_p E_p[g_p, g_p] / 2, g_p = R_p^T f_p,
 * rows = s_0 + C_ss w + D_ss[w, w] / 2, w_k = sum_p u_kp . f_p; see cfem.predict.held. */
#include "cfem_linear.h"
#include "cfem_touch.h"

#define K CFEM_PATCH_ROWS
#define NA CFEM_NA
#define NE CFEM_NE
#define PACKED (NE * K + K * (K + 1) / 2)
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

/* What is taken of the dents of patch i of the room under its force. */
static void dented(int i, const double *force, cfem_touch_room *room) {
    double excess[3][3], by_force[3] = {0.0}, square = 0.0, share = 1.0;
    for (int a = 0; a < 9; a++) {
        const int r = a / 3, c = a % 3;
        excess[r][c] = cfem_dot(3, room->relative[i][r][c], force), square += excess[r][c] * excess[r][c];
    }
    if (sqrt(square) > 2.0 * TRUSTED) {
        share = 2.0 * TRUSTED / sqrt(square);
        for (int a = 0; a < 27; a++) /* it depends on the force too */
            by_force[a % 3] += room->relative[i][a / 9][a / 3 % 3][a % 3] * excess[a / 9][a / 3 % 3] / square;
    }
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) room->dents[i][r][c] = share * cfem_dot(3, room->dent[i][r][c], force);
        room->by_dents[i][r] = cfem_dot(3, room->dents[i][r], force) / 2.0;
        for (int c = 0; c < 3; c++) room->dent_slope[i][r][c] = room->dents[i][r][c] - room->by_dents[i][r] * by_force[c];
    }
}

/* The load on the modes, and what it does. */
static void load(int count, const int *patch, double (*force)[3], cfem_touch_room *room) {
    double first = 0.0, more = 0.0;
    double *const change = &room->change[0][0];
    work(count, patch, force, room->w);
    for (int i = 0; i < (NE + K) * K; i++) change[i] = 0.0;
    for (int k = 0; k < K; k++) {
        const double *const D = &room->D[k][0][0], w = room->w[k];
        for (int i = 0; i < (NE + K) * K; i++) change[i] += w * D[i];
    }
    for (int k = 0; k < K; k++) {
        room->first[k] = cfem_dot(K, room->C_ss[k], room->w), first += room->first[k] * room->first[k];
        room->more[k] = cfem_dot(K, room->change[NE + k], room->w), more += room->more[k] * room->more[k];
    }
    first = 2.0 * TRUSTED * sqrt(first), more = sqrt(more);
    room->share = more > first ? first / more : 1.0;
    for (int i = 0; i < (NE + K) * K && room->share != 1.0; i++) change[i] *= room->share;
}

void cfem_touch_bear(int count, const int *patch, double (*force)[3], cfem_touch_room *room) {
    load(count, patch, force, room);
    for (int i = 0; i < count; i++) dented(i, force[i], room);
}

/* (K, K) derivative of the rows by w, less C_ss. */
static void slope(const cfem_touch_room *room, double (*found)[K]) {
    const double *const first = room->first, *const more = room->more;
    const double ones = cfem_dot(K, first, first), twos = cfem_dot(K, more, more);
    double by_w[K] = {0.0};
    for (int k = 0; k < K && room->share != 1.0; k++)
        by_w[k] = cfem_dot(K, room->C_ss[k], first) / ones - 2.0 / room->share * cfem_dot(K, room->change[NE + k], more) / twos;
    for (int k = 0; k < K; k++)
        for (int l = 0; l < K; l++) found[k][l] = room->change[NE + k][l] + room->share / 2.0 * more[k] * by_w[l];
}

void cfem_touch_yield(int count, const int *patch, cfem_touch_room *room) {
    const int n = 3 * count;
    double change[K][K], by[3][K];
    slope(room, change);
    for (int i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++) {
            for (int l = 0; l < K; l++) by[a][l] = 0.0;
            for (int k = 0; k < K; k++)
                for (int l = 0; l < K; l++) by[a][l] += cfem_patch_modes[patch[i]][a][k] * change[k][l];
        }
        for (int j = room->share == 1.0 ? i : 0; j < count; j++) /* symmetric where all of the second order is taken */
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) {
                    const int at = (3 * i + a) * n + 3 * j + b, other = (3 * j + b) * n + 3 * i + a;
                    room->yields[at] = room->total[at] + cfem_dot(K, by[a], cfem_patch_modes[patch[j]][b]);
                    if (room->share == 1.0) room->yields[other] = room->yields[at];
                }
        for (int a = 0; a < 9; a++) room->yields[(3 * i + a / 3) * n + 3 * i + a % 3] += room->dent_slope[i][a / 3][a % 3];
    }
}

void cfem_touch_places(int count, const int *patch, double (*force)[3], const cfem_touch_room *room, double (*place)[3]) {
    double moved[K];
    for (int k = 0; k < K; k++) moved[k] = room->first[k] + room->share / 2.0 * room->more[k];
    for (int p = 0; p < CFEM_PATCHES; p++)
        for (int a = 0; a < 3; a++)
            place[p][a] = room->free[p][a] + (count ? cfem_dot(K, cfem_patch_modes[p][a], moved) : 0.0);
    for (int i = 0; i < 3 * count; i++)
        place[patch[i / 3]][i % 3] +=
            cfem_dot(3 * count, room->left + i * 3 * count, &force[0][0]) + room->by_dents[i / 3][i % 3];
}

/* delta_e under forces on patches. */
static void move_tip(cfem_touched *now, cfem_touch_room *room) {
    for (int e = 0; e < NE; e++)
        now->delta_e[e] += cfem_dot(K, room->C_es[e], room->w) + cfem_dot(K, room->change[e], room->w) / 2.0;
    for (int i = 0; i < now->count; i++) {
        const double(*const R)[3] = cfem_touch_rotation(now->patch[i], room);
        double own[3] = {0.0};
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) own[a] += R[b][a] * now->force[i][b];
        for (int l = 0; l < CFEM_PATCH_LOCAL_TERMS; l++)
            for (int e = 0; e < NE; e++)
                now->delta_e[e] += room->terms[l] * cfem_dot(3, cfem_patch_local_tip[now->patch[i]][l][e], own);
    }
}

void cfem_touch_loaded(cfem_touched *now, cfem_touch_room *room) {
    const double *const w = room->w;
    double slope[NA] = {0.0};
    polynomials t;
    load(now->count, now->patch, now->force, room);
    for (int k = 0; k < K; k++) now->rows[k] = room->rows[k] + room->first[k] + room->share / 2.0 * room->more[k];
    if (!now->count) return;
    move_tip(now, room);
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
