/* The law of contact of a round, for cfem_rounds.c: its compliance, its forces, and these on the patches. */
#include "cfem_rounds.h"

#include <string.h>

#if CFEM_TOUCH_SOFT
#include "cfem_soft.h"
#endif

#define SOFT CFEM_SOFT
#define PUSH CFEM_PUSH
#define MOST CFEM_TOUCH_MOST
#define ROWS CFEM_TOUCH_ROWS
#define ROBOTS CFEM_TOUCH_ROBOTS

enum { TURNED, YIELDS, TOTAL }; /* compliance of a room */

/* B (3, 3) of entry k of row r: how its gap and slip, in its frame, go with the patch's place in the axes of robot b. The patch's first
 * column among those that bear of b, or -1 where it is of another robot. */
static int entry(const cfem_rounds *at, int r, int k, int b, double (*B)[3]) {
    double weight = 1.0;
    int place = at->slot[r], of = at->robot[r];
#if CFEM_TOUCH_SOFT
    if (r >= at->solid) of = cfem_soft_entry(at, r - at->solid, k, &place, &weight);
#else
    (void)k; /* which is 0 */
#endif
    if (of != b) return -1;
    for (int a = 0; a < 9; a++) {
        B[a / 3][a % 3] = SOFT(0.0, at->frame[r][a / 3][a % 3]);
        for (int d = 0; d < 3 && SOFT(1, 0); d++) B[a / 3][a % 3] += weight * at->frame[r][a / 3][d] * at->placed[b].R[d][a % 3];
    }
    return 3 * place;
}

static int entries(const cfem_rounds *at, int r) {
    (void)at, (void)r;
    return SOFT(r < at->solid ? 1 : cfem_soft_entries(at, r - at->solid), 1);
}

/* sum of B^T local, (c,) N: what forces of the rows in their frames are on the patches of robot b that bear. */
static void on_patches(const cfem_rounds *at, int b, double (*local)[3], double *sum) {
    double B[3][3];
    for (int j = 0; j < 3 * at->now[b].count; j++) sum[j] = 0.0;
    for (int r = 0; r < at->solid + at->pairs; r++)
        for (int k = 0; k < entries(at, r); k++) {
            const int j = entry(at, r, k, b, B);
            for (int a = 0; a < 9 && j >= 0; a++) sum[j + a % 3] += B[a / 3][a % 3] * local[r][a / 3];
        }
}

static const double *compliance(const cfem_touch_room *room, int which) {
    return which == TURNED ? room->turned : which == YIELDS ? room->yields : room->total;
}

/* What the patches of robot b, with compliance C (c, c), do to the rows: to W, and to gaps by the forces that are not of the rows' `known`
 * ones. */
static void yield(cfem_rounds *at, int b, const double *C, double (*known)[3], double *W, double *gap) {
    const int rows = at->solid + at->pairs, n = 3 * rows, c = 3 * at->now[b].count;
    double *const T = at->room[0].law, rest[ROWS], B[3][3]; /* T (n, c): B C */
    on_patches(at, b, known, rest);
    for (int j = 0; j < c; j++) rest[j] = at->now[b].force[j / 3][j % 3] - rest[j];
    for (int i = 0; i < n * c; i++) T[i] = 0.0;
    for (int r = 0; r < rows; r++)
        for (int k = 0; k < entries(at, r); k++) {
            const int j = entry(at, r, k, b, B);
            for (int a = 0; a < 9 && j >= 0; a++)
                for (int m = 0; m < c; m++) T[(3 * r + a / 3) * c + m] += B[a / 3][a % 3] * C[(j + a % 3) * c + m];
        }
    for (int i = 0; i < n; i++) gap[i] -= cfem_dot(c, T + i * c, rest);
    for (int r = 0; r < rows; r++)
        for (int k = 0; k < entries(at, r); k++) {
            const int j = entry(at, r, k, b, B);
            for (int a = 0; a < 9 && j >= 0; a++)
                for (int m = 0; m < n; m++) W[m * n + 3 * r + a / 3] += T[m * c + j + a % 3] * B[a / 3][a % 3];
        }
}

/* `local` that obeys the law with one of the compliances, from the forces `known`, at which the gaps are. 0, or 1 where nothing does. */
static int law(cfem_rounds *at, int which, double (*known)[3], const double *gap) {
    const int rows = at->solid + at->pairs, n = 3 * rows;
    double *const W = at->room[0].W, free[ROWS];
    for (int i = 0; i < n * n; i++) W[i] = 0.0;
    memcpy(free, gap, sizeof free);
    for (int b = 0; b < ROBOTS; b++) yield(at, b, compliance(&at->room[b], which), known, W, free);
    for (int i = 0; i < n; i++) free[i] -= cfem_dot(n, W + i * n, &known[0][0]);
    memcpy(at->local, known, sizeof *known * (size_t)rows);
    return cfem_law(rows, W, free, at->mu, &at->local[0][0], at->room[0].law, &at->systems);
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

/* Row r of a patch near an obstacle: its frame, gap and known force, and how the force turns. Whether it does. */
static int on_obstacle(cfem_rounds *at, int r, double *known, double *gap) {
    const int b = at->robot[r], i = at->slot[r], p = at->now[b].patch[i];
    const cfem_touched *const one = &at->now[b];
    const cfem_obstacle *const obstacle = &at->obstacles[at->room[b].which[p]];
    double (*const bend)[3] = at->room[b].bend[i], half[3][3], slip[3] = {0.0};
    int turns = 0;
    cfem_obstacle_frame(obstacle, one->place[p], at->frame[r]);
    for (int a = 0; a < 3 && at->mu > 0.0; a++) slip[a] = one->place[p][a] - one->stuck[p][a];
    for (int a = 0; a < 3; a++) {
        known[a] = cfem_dot(3, at->frame[r][a], PUSH(one)[i]);
        gap[a] = a ? cfem_dot(3, at->frame[r][a], slip) : at->room[b].distance[p];
    }
    cfem_obstacle_bend(obstacle, one->place[p], bend);
    for (int a = 0; a < 3 && SOFT(1, 0); a++) cfem_turn_back(&at->placed[b], bend[a], half[a]); /* R^T bend R, which is symmetric */
    for (int a = 0; a < 3 && SOFT(1, 0); a++) {
        const double column[3] = {half[0][a], half[1][a], half[2][a]};
        cfem_turn_back(&at->placed[b], column, bend[a]);
    }
    for (int a = 0; a < 9; a++) {
        bend[a / 3][a % 3] *= at->stuck_before[b][p] ? 0.0 : known[0];
        turns |= bend[a / 3][a % 3] != 0.0;
    }
    return turns;
}

/* on N: what `local` puts on the patches of each robot; step mm: how far that moves them, in the scene. The largest of it. */
static double step_by(cfem_rounds *at, int which, double (*on)[ROWS], double (*step)[ROWS]) {
    double largest = 0.0, change[ROWS], way[ROWS];
    for (int b = 0; b < ROBOTS; b++) {
        const cfem_touched *const one = &at->now[b];
        const double *const C = compliance(&at->room[b], which);
        const int c = 3 * one->count;
        on_patches(at, b, at->local, on[b]);
        for (int j = 0; j < c; j++) change[j] = on[b][j] - one->force[j / 3][j % 3];
        for (int j = 0; j < c && SOFT(1, 0); j++) way[j] = cfem_dot(c, C + j * c, change);
        for (int i = 0; i < one->count && SOFT(1, 0); i++) cfem_turn(&at->placed[b], way + 3 * i, step[b] + 3 * i);
        for (int j = 0; j < c && SOFT(1, 0); j++) largest = cfem_larger(largest, fabs(step[b][j]));
    }
    return largest;
}

/* What the round takes of `local`, and of what it puts `on` the patches: all of it, a share of the change of the forces, or, where faces of
 * soft surfaces still turn from round to round, the answers of the last rounds combined. */
static void take(cfem_rounds *at, double (*known)[3], double (*on)[ROWS], double (*step)[ROWS]) {
    at->takes_all = at->share >= 1.0;
    for (int i = 0; i < 3 * (at->solid + at->pairs) && !at->takes_all; i++)
        at->local[i / 3][i % 3] = known[i / 3][i % 3] + at->share * (at->local[i / 3][i % 3] - known[i / 3][i % 3]);
    for (int b = 0; b < ROBOTS && !at->takes_all; b++)
        for (int j = 0; j < 3 * at->now[b].count; j++) {
            const double force = at->now[b].force[j / 3][j % 3];
            on[b][j] = force + at->share * (on[b][j] - force);
        }
#if CFEM_TOUCH_SOFT
    cfem_soft_accelerate(at, on, step);
#else
    (void)step;
#endif
}

/* Puts `local` on the patches, where it is `on`, and turns its change from `known` with curved obstacles. */
static void press(cfem_rounds *at, int which, double (*known)[3], double (*on)[ROWS]) {
    double by_rows[MOST][3];
    for (int i = 0; i < 3 * (at->solid + at->pairs); i++) by_rows[i / 3][i % 3] = at->local[i / 3][i % 3] - known[i / 3][i % 3];
    for (int b = 0; b < ROBOTS; b++) {
        cfem_touched *const one = &at->now[b];
        cfem_touch_room *const room = &at->room[b];
        const int c = 3 * one->count;
        double change[ROWS], way[ROWS], scene[3];
        if (which == TURNED) on_patches(at, b, by_rows, change);
        for (int j = 0; j < c && which == TURNED; j++) way[j] = cfem_dot(c, compliance(room, which) + j * c, change);
        for (int i = 0; i < one->count; i++)
            for (int a = 0; a < 3; a++)
                one->force[i][a] = on[b][3 * i + a] + (which == TURNED ? cfem_dot(3, room->bend[i][a], way + 3 * i) : 0.0);
        for (int i = 0; i < one->count && SOFT(1, 0); i++) memset(PUSH(one)[i], 0, sizeof one->force[i]);
        for (int r = 0; r < at->solid && SOFT(1, 0); r++) {
            const int i = at->slot[r];
            double turned[3] = {0.0};
            if (at->robot[r] != b) continue;
            for (int a = 0; a < 3 && which == TURNED; a++) turned[a] = cfem_dot(3, room->bend[i][a], way + 3 * i);
            cfem_turn(&at->placed[b], turned, scene);
            for (int a = 0; a < 3; a++)
                PUSH(one)[i][a] = scene[a] + at->frame[r][0][a] * at->local[r][0] + at->frame[r][1][a] * at->local[r][1] + at->frame[r][2][a] * at->local[r][2];
        }
    }
}

int cfem_rounds_obey(cfem_rounds *at) {
    double known[MOST][3], gap[ROWS], on[ROBOTS][ROWS], step[ROBOTS][ROWS];
    int turns = 0, which;
    for (int b = 0; b < ROBOTS; b++)
        if (at->now[b].count) memset(at->room[b].bend, 0, sizeof at->room[b].bend[0] * (size_t)at->now[b].count);
    for (int r = 0; r < at->solid; r++) turns |= on_obstacle(at, r, known[r], gap + 3 * r);
#if CFEM_TOUCH_SOFT
    for (int k = 0; k < at->pairs; k++) cfem_soft_row(at, k, known[at->solid + k], gap + 3 * (at->solid + k));
#endif
    for (int b = 0; b < ROBOTS && turns; b++) turns = !soften(&at->room[b], at->now[b].count);
    which = turns && !law(at, TURNED, known, gap) ? TURNED : YIELDS;
    if (which == YIELDS && law(at, YIELDS, known, gap)) { /* under large forces the derivative may be indefinite, which `total` is not */
        if (law(at, TOTAL, known, gap)) return 1;
        which = TOTAL;
    }
    at->moved = step_by(at, which, on, step);
    take(at, known, on, step);
    press(at, which, known, on);
    return 0;
}
