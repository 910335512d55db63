#include "cfem_meet_law.h"

#include <string.h>

#include "cfem_linear.h"

#define N CFEM_PATCHES
#define ALL CFEM_MEET_PATCHES
#define MOST CFEM_TOUCH_MOST
#define ROBOTS CFEM_MEET_ROBOTS
#define ROWS CFEM_TOUCH_ROWS

int cfem_hold_of(const cfem_met *now, int slot) {
    for (int i = 0; i < now->hold_count; i++)
        if (now->hold[i].row.slot == slot) return i;
    return -1;
}

cfem_pair *cfem_touching(const cfem_meeting *at, int i) { return &at->now->pair[at->room->touching[i]]; }

/* Chooses patch p of all. 0, or a status. */
static unsigned choose(cfem_meeting *at, int p) {
    cfem_touched *const one = &at->now->robot[p / N];
    int i = one->count;
    if (i == MOST) return CFEM_TOUCH_MANY;
    for (; i > 0 && one->patch[i - 1] > p % N; i--) {
        one->patch[i] = one->patch[i - 1];
        memcpy(one->force[i], one->force[i - 1], sizeof one->force[i]);
    }
    one->patch[i] = p % N, one->count++;
    memset(one->force[i], 0, sizeof one->force[i]);
    return 0;
}

void cfem_meet_number(cfem_meeting *at) {
    for (int p = 0; p < ALL; p++) at->room->chosen[p] = -1;
    for (int b = 0; b < ROBOTS; b++)
        for (int i = 0; i < at->now->robot[b].count; i++) at->room->chosen[b * N + at->now->robot[b].patch[i]] = i;
}

int cfem_meet_choose(cfem_meeting *at, int all) {
    int found = 0;
    cfem_meet_number(at);
    for (int i = 0; i < at->count; i++)
        for (int k = 0; k < cfem_touching(at, i)->row.count; k++) {
            const int p = cfem_touching(at, i)->row.patch[k];
            if (at->room->chosen[p] >= 0) continue;
            found++, at->room->chosen[p] = 0;
            if (all && choose(at, p)) return -1;
        }
    cfem_meet_number(at);
    return found;
}

static const double *begun(const cfem_meeting *at, int p) { return at->begin->robot[p / N].place[p % N]; }

double cfem_first_gap(const cfem_meeting *at, const cfem_pair *pair) {
    double gap = pair->gap;
    for (int k = 0; k < pair->row.count; k++) {
        const double *const x = begun(at, pair->row.patch[k]), *const y = at->room->around.place[pair->row.patch[k]];
        for (int a = 0; a < 3; a++) gap += pair->frame[0][a] * pair->row.weight[k] * (x[a] - y[a]);
    }
    return gap;
}

/* A pair that has not touched before sticks where it has touched: on the way from where the step began; a patch that touches an obstacle
 * slides from where it was then. */
static void begin_hold(cfem_meeting *at, const cfem_pair *pair, cfem_hold *hold) {
    cfem_row_of *const row = &hold->row;
    const double first = at->begin ? cfem_first_gap(at, pair) : pair->gap, last = pair->gap;
    const double share = first <= 0.0 ? 0.0 : last < 0.0 ? first / fmax(first - last, 1e-300) : 1.0;
    double sign, x[CFEM_ROW_MOST][3], on[CFEM_ROW_MOST][2], mean[2] = {0.0}, aside[2] = {0.0}, M[4] = {0.0};
    hold->unknown = 0, hold->origin[0] = hold->origin[1] = hold->origin[2] = 0.0;
    *row = pair->row;
    for (int k = 0; k < row->count; k++) {
        const double *const there = at->room->around.place[row->patch[k]], *const from = at->begin ? begun(at, row->patch[k]) : there;
        for (int a = 0; a < 3; a++) x[k][a] = from[a] + share * (there[a] - from[a]);
        for (int a = 0; a < 2; a++) {
            on[k][a] = cfem_dot(3, pair->frame[1 + a], x[k]), aside[a] += row->weight[k] * on[k][a];
            if (k) mean[a] += on[k][a] / (row->count - 1);
        }
    }
    if (row->slot >= ALL) {
        memcpy(hold->origin, at->begin ? begun(at, row->patch[0]) : x[0], sizeof hold->origin);
        return;
    }
    for (int k = 1; k < row->count; k++)
        for (int a = 0; a < 4; a++) M[a] += (on[k][a / 2] - mean[a / 2]) * (on[k][a % 2] - mean[a % 2]);
    if (cfem_eliminate(2, M, 1, aside, &sign)) return;
    for (int k = 1; k < row->count; k++) /* such shares of its faces that the point is before it there */
        for (int a = 0; a < 2; a++) row->weight[k] -= (on[k][a] - mean[a]) * aside[a];
}

unsigned cfem_meet_hold(cfem_meeting *at) {
    cfem_met *const now = at->now;
    for (int i = 0; i < at->count; i++) {
        const cfem_pair *const pair = cfem_touching(at, i);
        int h = cfem_hold_of(now, pair->row.slot);
        if (h < 0) {
            if (now->hold_count == CFEM_MEET_PAIRS) return CFEM_TOUCH_MANY;
            h = now->hold_count++, at->room->kept[h] = 0;
            memset(&now->hold[h], 0, sizeof now->hold[h]);
            now->hold[h].unknown = 1;
        }
        if (now->hold[h].unknown) begin_hold(at, pair, &now->hold[h]);
        at->room->kept[h] = pair->row.slot < ALL, at->room->faces[h] = pair->row;
    }
    return 0;
}

/* B (3, 3) of entry k of pair i that touches: how its gap and slip, in its frame, go with the patch's place in the axes of robot b. The
 * patch's first column among those chosen of b, or -1 where it is of another robot. */
static int entry(const cfem_meeting *at, int i, int k, int b, double (*B)[3]) {
    const cfem_pair *const pair = cfem_touching(at, i);
    const cfem_placed *const pose = &at->room->around.robots[b];
    if (pair->row.patch[k] / N != b) return -1;
    for (int a = 0; a < 9; a++) {
        B[a / 3][a % 3] = 0.0;
        for (int d = 0; d < 3; d++) B[a / 3][a % 3] += pair->row.weight[k] * pair->frame[a / 3][d] * pose->R[d][a % 3];
    }
    return 3 * at->room->chosen[pair->row.patch[k]];
}

/* sum of B^T local, (c,) N: what forces of the pairs in their frames are on the chosen patches of robot b. */
static void on_patches(const cfem_meeting *at, int b, double (*local)[3], double *found) {
    double B[3][3];
    for (int j = 0; j < 3 * at->now->robot[b].count; j++) found[j] = 0.0;
    for (int i = 0; i < at->count; i++)
        for (int k = 0; k < cfem_touching(at, i)->row.count; k++) {
            const int j = entry(at, i, k, b, B);
            for (int a = 0; a < 9 && j >= 0; a++) found[j + a % 3] += B[a / 3][a % 3] * local[i][a / 3];
        }
}

/* What the chosen patches of robot b, with compliance C (c, c), do to the pairs: to W, and to gaps by the forces that are not of the
 * pairs' `known` ones. */
static void yield(cfem_meeting *at, int b, const double *C, double (*known)[3], double *W, double *gap) {
    const int n = 3 * at->count, c = 3 * at->now->robot[b].count;
    double *const T = at->room->robot[b].turned, rest[ROWS], B[3][3]; /* T (n, c): B C */
    on_patches(at, b, known, rest);
    for (int j = 0; j < c; j++) rest[j] = at->now->robot[b].force[j / 3][j % 3] - rest[j];
    for (int i = 0; i < n * c; i++) T[i] = 0.0;
    for (int i = 0; i < at->count; i++)
        for (int k = 0; k < cfem_touching(at, i)->row.count; k++) {
            const int j = entry(at, i, k, b, B);
            for (int a = 0; a < 9 && j >= 0; a++)
                for (int m = 0; m < c; m++) T[(3 * i + a / 3) * c + m] += B[a / 3][a % 3] * C[(j + a % 3) * c + m];
        }
    for (int i = 0; i < n; i++) gap[i] -= cfem_dot(c, T + i * c, rest);
    for (int i = 0; i < at->count; i++)
        for (int k = 0; k < cfem_touching(at, i)->row.count; k++) {
            const int j = entry(at, i, k, b, B);
            for (int a = 0; a < 9 && j >= 0; a++)
                for (int m = 0; m < n; m++) W[m * n + 3 * i + a / 3] += T[m * c + j + a % 3] * B[a / 3][a % 3];
        }
}

int cfem_meet_law(cfem_meeting *at, int pressed, double (*local)[3]) {
    cfem_meet_room *const room = at->room;
    const int n = 3 * at->count;
    double *const W = room->robot[0].W, gap[ROWS], slip[3], known[MOST][3];
    for (int i = 0; i < n * n; i++) W[i] = 0.0;
    for (int i = 0; i < n; i++) {
        const cfem_pair *const pair = cfem_touching(at, i / 3);
        const cfem_hold *const hold = &at->now->hold[cfem_hold_of(at->now, pair->row.slot)];
        if (i % 3 == 0) cfem_row_place(&hold->row, room->around.place, slip);
        for (int a = 0; a < 3 && i % 3 == 0; a++) slip[a] -= hold->origin[a];
        const int known_here = i % 3 == 0 || at->mu > 0.0;
        known[i / 3][i % 3] = known_here ? cfem_dot(3, pair->frame[i % 3], hold->push) : 0.0;
        gap[i] = i % 3 == 0 ? pair->gap : at->mu > 0.0 ? cfem_dot(3, pair->frame[i % 3], slip) : 0.0;
    }
    for (int b = 0; b < ROBOTS; b++)
        yield(at, b, pressed ? room->robot[b].yields : room->robot[b].total, known, W, gap);
    for (int i = 0; i < n; i++) {
        gap[i] -= cfem_dot(n, W + i * n, &known[0][0]);
        local[i / 3][i % 3] = known[i / 3][i % 3];
    }
    return cfem_law(at->count, W, gap, at->mu, &local[0][0], room->robot[0].law);
}

void cfem_meet_push(cfem_meeting *at, int pressed, double (*local)[3]) {
    double on[ROWS], step[ROWS];
    for (int h = 0; h < at->now->hold_count; h++) {
        memset(at->now->hold[h].push, 0, sizeof at->now->hold[h].push);
        at->now->hold[h].mode = CFEM_TOUCH_OPEN;
    }
    for (int i = 0; i < at->count; i++) {
        cfem_hold *const hold = &at->now->hold[cfem_hold_of(at->now, cfem_touching(at, i)->row.slot)];
        const double *const f = local[i], friction = sqrt(f[1] * f[1] + f[2] * f[2]);
        hold->mode = !(f[0] > 0.0) ? CFEM_TOUCH_OPEN : friction >= at->mu * f[0] * (1.0 - 1e-9) ? CFEM_TOUCH_SLIP : CFEM_TOUCH_STICK;
        for (int a = 0; a < 9; a++) hold->push[a % 3] += f[a / 3] * cfem_touching(at, i)->frame[a / 3][a % 3];
    }
    at->moved = 0.0;
    for (int b = 0; b < ROBOTS; b++) {
        cfem_touched *const one = &at->now->robot[b];
        const int c = 3 * one->count;
        on_patches(at, b, local, on);
        for (int j = 0; j < c; j++) step[j] = on[j] - one->force[j / 3][j % 3], one->force[j / 3][j % 3] = on[j];
        for (int j = 0; j < c; j++)
            on[j] = cfem_dot(c, (pressed ? at->room->robot[b].yields : at->room->robot[b].total) + j * c, step);
        for (int j = 0; j < c; j++)
            at->moved = fmax(at->moved, fabs(cfem_dot(3, at->room->around.robots[b].R[j % 3], on + j / 3 * 3)));
    }
}
