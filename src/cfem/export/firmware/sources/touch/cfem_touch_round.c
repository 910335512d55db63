#include "cfem_touch_round.h"

#include "cfem_linear.h"

static double in_frame(double frame[3][3], int row, const double *x) { return cfem_dot(3, frame[row], x); }

/* Compliance C (n, n) in the frames into W; gap (n,) in, without forces out; then the law from `local`. */
static int law(cfem_touch_round *at, const double *C, const double *gap) {
    const int m = at->now->count, n = 3 * m;
    double *const W = at->room->W, free[CFEM_TOUCH_ROWS] = {0.0}, found[CFEM_TOUCH_ROWS];
    for (int i = 0; i < m; i++)
        for (int j = 0; j < m; j++) {
            double half[3][3];
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) {
                    half[a][b] = 0.0;
                    for (int c = 0; c < 3; c++) half[a][b] += at->frame[i][a][c] * C[(3 * i + c) * n + 3 * j + b];
                }
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++) W[(3 * i + a) * n + 3 * j + b] = in_frame(at->frame[j], b, half[a]);
        }
    for (int i = 0; i < n; i++) {
        free[i] = gap[i] - cfem_dot(n, W + i * n, &at->local[0][0]);
        found[i] = at->local[i / 3][i % 3];
    }
    if (cfem_law(m, W, free, at->mu, found, at->room->law)) return 1;
    for (int i = 0; i < n; i++) at->local[i / 3][i % 3] = found[i];
    return 0;
}

/* (C^-1 - B)^-1 into `turned`, B of the patches' bends (blocks); by it forces turn. 1 where that is not positive definite. */
static int soften(cfem_touch_room *room, int m) {
    const int n = 3 * m;
    double *const A = room->W, sign;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < m; j++)
            for (int b = 0; b < 3; b++) {
                double sum = i == 3 * j + b ? 1.0 : 0.0;
                for (int c = 0; c < 3; c++) sum -= room->yields[i * n + 3 * j + c] * room->bend[j][c][b];
                A[i * n + 3 * j + b] = sum;
            }
    for (int i = 0; i < n * n; i++) room->turned[i] = room->yields[i];
    if (cfem_eliminate(n, A, n, room->turned, &sign)) return 1;
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) A[i * n + j] = (room->turned[i * n + j] + room->turned[j * n + i]) / 2.0;
    return cfem_cholesky(n, n, A, 0.0);
}

int cfem_touch_obey(cfem_touch_round *at) {
    cfem_touched *const now = at->now;
    cfem_touch_room *const room = at->room;
    const int m = now->count, n = 3 * m;
    double gap[CFEM_TOUCH_ROWS] = {0.0}, known[CFEM_TOUCH_MOST][3], change[CFEM_TOUCH_ROWS], moved[CFEM_TOUCH_ROWS];
    int turns = 0;
    for (int i = 0; i < m; i++) {
        const int p = now->patch[i];
        const cfem_obstacle *const o = &at->obstacles[room->which[p]];
        double slip[3] = {0.0};
        cfem_obstacle_frame(o, now->place[p], at->frame[i]);
        for (int a = 0; a < 3 && at->mu > 0.0; a++) slip[a] = now->place[p][a] - now->stuck[p][a];
        for (int a = 0; a < 3; a++) {
            known[i][a] = in_frame(at->frame[i], a, now->force[i]);
            gap[3 * i + a] = a ? in_frame(at->frame[i], a, slip) : room->distance[p];
        }
        cfem_obstacle_bend(o, now->place[p], room->bend[i]);
        for (int a = 0; a < 9; a++) {
            double *const bend = &room->bend[i][a / 3][a % 3];
            *bend *= at->stuck_before[p] ? 0.0 : known[i][0];
            turns |= *bend != 0.0;
        }
    }
    for (int i = 0; i < n; i++) at->local[i / 3][i % 3] = known[i / 3][i % 3];
    if (turns && (soften(room, m) || law(at, room->turned, gap))) turns = 0;
    if (!turns) {
        for (int i = 0; i < n; i++) at->local[i / 3][i % 3] = known[i / 3][i % 3];
        /* under large forces the derivative may be indefinite, which `total` is not */
        if (law(at, room->yields, gap) && law(at, room->total, gap)) return 1;
    }
    for (int i = 0; i < m; i++)
        for (int a = 0; a < 3; a++) {
            double *const straight = &now->force[i][a], last = *straight;
            *straight = 0.0;
            for (int b = 0; b < 3; b++) *straight += at->local[i][b] * at->frame[i][b][a];
            change[3 * i + a] = *straight - last;
        }
    for (int i = 0; i < n && turns; i++) moved[i] = cfem_dot(n, room->turned + i * n, change);
    for (int i = 0; i < m && turns; i++)
        for (int a = 0; a < 3; a++) now->force[i][a] += cfem_dot(3, room->bend[i][a], moved + 3 * i);
    return 0;
}
