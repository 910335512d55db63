#include "cfem_pairs.h"

#include <string.h>

#include "cfem_linear.h"

#define N CFEM_PATCHES
#define K CFEM_PATCH_ROWS
static const double OPPOSED = -0.2, TURNING = 0.2, LEAST = 1e-6, WITHIN = 2.5, FLAT = 2.0, DEEP = 0.5, DEEPEST = 1.0, STEEP = 0.7,
                    RANK = 1e-3; /* see cfem.contact.detection */
static const double S = CFEM_MEET_SPACING;
enum { NEVER, OWN, OTHER };

void cfem_row_place(const cfem_row_of *row, double (*place)[3], double *found) {
    for (int a = 0; a < 3; a++) {
        found[a] = 0.0;
        for (int k = 0; k < row->count; k++) found[a] += row->weight[k] * place[row->patch[k]][a];
    }
}

/* Outward unit normal of patch p: its area, a quadratic form of the rows. */
static const double *normal_of(cfem_around *around, int p) {
    const double *const rows = around->rows[p / N];
    const cfem_placed *const robot = &around->robots[p / N];
    double z[K + 1] = {1.0}, own[3], length = 0.0;
    if (around->known[p]) return around->normal[p];
    around->known[p] = 1;
    for (int k = 0; k < K; k++) z[k + 1] = rows[k];
    for (int a = 0; a < 3; a++) {
        const double *by = cfem_meet_area[p % N][a];
        own[a] = 0.0;
        for (int k = 0; k <= K; by += K + 1 - k, k++) own[a] += z[k] * cfem_dot(K + 1 - k, by, z + k);
        length += own[a] * own[a];
    }
    for (int a = 0; a < 3; a++) around->normal[p][a] = cfem_dot(3, robot->R[a], own) / sqrt(length);
    return around->normal[p];
}

static int may_meet(int p, int q) {
    if (cfem_patch_held[p % N] || cfem_patch_held[q % N]) return NEVER;
    return p / N == q / N ? cfem_meet_itself[p % N][q % N] : OTHER;
}

static double square(const double *x, const double *y) {
    const double d[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]};
    return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
}

/* Whether patch p may be near any of robot b. */
static int reaches(const cfem_around *around, int p, int b) {
    for (int a = 0; a < 3; a++) {
        const double x = around->place[p][a];
        if (x < around->low[b][a] - WITHIN * S || x > around->high[b][a] + WITHIN * S) return 0;
    }
    return b != p / N || around->robots[b].itself;
}

/* Those that patch p may meet, behind it in the row. 0, or 1 where they are too many. */
static int look_for(cfem_around *around, int p, cfem_row_of *row) {
    const double *const x = around->place[p];
    row->count = 1;
    for (int q = 0; q < CFEM_MEET_PATCHES; q++) {
        if (q % N == 0 && !reaches(around, p, q / N)) {
            q += N - 1;
            continue;
        }
        const double *const y = around->place[q];
        if (square(x, y) >= WITHIN * S * WITHIN * S) continue;
        const int who = may_meet(p, q);
        if (who == NEVER || !(OPPOSED - cfem_dot(3, normal_of(around, p), normal_of(around, q)) > 0.0)) continue;
        const double *const n = normal_of(around, q);
        const double above = n[0] * (x[0] - y[0]) + n[1] * (x[1] - y[1]) + n[2] * (x[2] - y[2]);
        if (who == OWN && above < -DEEP * S) continue; /* the other side of a wall */
        if (row->count == CFEM_ROW_MOST) return 1;
        row->patch[row->count++] = q;
    }
    return 0;
}

/* Rows n, t1, t2 by n: that of an obstacle that stands as the scene does. */
static void frame_of(const double *n, double (*frame)[3]) {
    static const cfem_obstacle ball = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0}, {0}, 0.0, 0};
    cfem_obstacle_frame(&ball, n, frame);
}

/* By how much the least eigenvalue of a symmetric M (3, 3) falls short of RANK of the largest, or less than 0: by the roots of its
 * cubic. None of positive ones is below 4 det / trace^2. */
static double falls_short(const double *M) {
    const double mean = (M[0] + M[4] + M[8]) / 3.0, a = M[0] - mean, b = M[4] - mean, c = M[8] - mean;
    const double size = sqrt((a * a + b * b + c * c + 2.0 * (M[1] * M[1] + M[2] * M[2] + M[5] * M[5])) / 6.0);
    const double det = a * (b * c - M[5] * M[5]) - M[1] * (M[1] * c - M[5] * M[2]) + M[2] * (M[1] * M[5] - b * M[2]);
    const double trace = 3.0 * mean, whole = M[0] * (M[4] * M[8] - M[5] * M[5]) - M[1] * (M[1] * M[8] - M[5] * M[2]) + M[2] * (M[1] * M[5] - M[4] * M[2]);
    if (M[0] * M[4] > M[1] * M[1] && 4.0 * whole > 2.0 * RANK * trace * trace * trace) return -1.0;
    const double bent = det / (2.0 * size * size * size), angle = acos(bent < -1.0 ? -1.0 : bent < 1.0 ? bent : 1.0) / 3.0;
    return RANK * (mean + 2.0 * size * cos(angle)) - (mean + 2.0 * size * cos(angle + 2.0943951023931953));
}

int cfem_pair_of(cfem_around *around, int p, const cfem_row_of *faces, cfem_pair *pair) {
    const double *const x = around->place[p], end = exp(-WITHIN * WITHIN);
    cfem_row_of *const row = &pair->row;
    double G[CFEM_ROW_MOST], A[CFEM_ROW_MOST][3], n[3] = {0.0}, M[9], by[3], sizes = 0.0, short_of = 0.0, sign;
    int most = 1;
    if (faces)
        *row = *faces;
    else if (look_for(around, p, row))
        return -1;
    if (row->count < 4) return 0;
    row->slot = row->patch[0] = p, row->weight[0] = 1.0;
    for (int k = 1; k < row->count; k++) {
        const double *const own = normal_of(around, row->patch[k]);
        const double near = (exp(-square(x, around->place[row->patch[k]]) / (S * S)) - end) / (1.0 - end);
        const double opposed = (OPPOSED - cfem_dot(3, normal_of(around, p), own)) / TURNING;
        G[k] = (near > LEAST ? near : LEAST) * (opposed < LEAST ? LEAST : opposed > 1.0 ? 1.0 : opposed);
        for (int a = 0; a < 3; a++) n[a] += G[k] * own[a];
    }
    for (int pass = 0; pass < 2; pass++) { /* the second time square on the plane that the first has fitted */
        const double length = sqrt(cfem_dot(3, n, n));
        double unit[3] = {n[0] / length, n[1] / length, n[2] / length}, slope[3] = {0.0}, copy[9];
        frame_of(unit, pair->frame);
        for (int a = 0; a < 9; a++) M[a] = 0.0;
        for (int k = 1; k < row->count; k++) {
            const double *const y = around->place[row->patch[k]], to[3] = {y[0] - x[0], y[1] - x[1], y[2] - x[2]};
            A[k][0] = 1.0, A[k][1] = cfem_dot(3, to, pair->frame[1]) / S, A[k][2] = cfem_dot(3, to, pair->frame[2]) / S;
            for (int a = 0; a < 9; a++) M[a] += A[k][a / 3] * G[k] * A[k][a % 3];
            for (int a = 0; a < 3; a++) slope[a] += A[k][a] * G[k] * cfem_dot(3, to, pair->frame[0]);
        }
        short_of = falls_short(M);
        for (int a = 0; a < 9 && short_of > 0.0; a += 4) M[a] += short_of;
        memcpy(copy, M, sizeof M);
        if (cfem_eliminate(3, copy, 1, slope, &sign)) return 0;
        const double inclined = sqrt(slope[1] * slope[1] + slope[2] * slope[2]) / S / STEEP;
        const double share = (inclined <= 1.0 ? 1.0 : inclined < 2.0 ? 2.0 - inclined : 0.0) / S;
        for (int a = 0; a < 3; a++)
            n[a] = pair->frame[0][a] - share * (slope[1] * pair->frame[1][a] + slope[2] * pair->frame[2][a]);
    }
    by[0] = 1.0, by[1] = by[2] = 0.0;
    if (cfem_eliminate(3, M, 1, by, &sign)) return 0;
    for (int k = 1; k < row->count; k++) {
        row->weight[k] = -G[k] * cfem_dot(3, A[k], by), sizes += fabs(row->weight[k]);
        if (row->weight[k] < row->weight[most]) most = k;
    }
    cfem_row_place(row, around->place, by);
    pair->gap = cfem_dot(3, pair->frame[0], by), pair->met = row->patch[most] / N;
    return faces || (short_of <= 0.0 && sizes <= FLAT && pair->gap >= -DEEPEST * S);
}
