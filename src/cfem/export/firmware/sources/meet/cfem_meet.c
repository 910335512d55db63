/* Robots that meet, and the pairs of their soft surfaces. The same as cfem.predict.contact.step.soft_pairs. */
#include "cfem_meet.h"

#include <string.h>

#include "cfem_linear.h"
#include "cfem_soft.h"

#define N CFEM_PATCHES
#define ALL CFEM_MEET_PATCHES
#define ROBOTS CFEM_MEET_ROBOTS
#define MOST CFEM_TOUCH_MOST
#define NA CFEM_NA

static const double OVERLAP = 1e-6, INSIDE = 1e-3; /* of the length */
static const double SETTLING = 0.01, STAYING = 0.001, ENTERED = 0.1, NEAR = 0.1; /* of the distance of patches */

static int presses(const double *force) { return force[0] != 0.0 || force[1] != 0.0 || force[2] != 0.0; }

int cfem_hold_of(const cfem_met *now, int slot) {
    for (int i = 0; i < now->hold_count; i++)
        if (now->hold[i].row.slot == slot) return i;
    return -1;
}

static cfem_pair *touching(const cfem_rounds *at, int k) { return &at->soft->now->pair[at->soft->room->touching[k]]; }

static const double *begun(const cfem_rounds *at, int p) { return at->before[p / N].place[p % N]; }

/* mm: gap of a pair, were the patches where the step began, on the same plane. */
static double first_gap(const cfem_rounds *at, const cfem_pair *pair) {
    double gap = pair->gap;
    for (int k = 0; k < pair->row.count; k++) {
        const double *const x = begun(at, pair->row.patch[k]), *const y = at->soft->room->around.place[pair->row.patch[k]];
        for (int a = 0; a < 3; a++) gap += pair->frame[0][a] * pair->row.weight[k] * (x[a] - y[a]);
    }
    return gap;
}

/* Whether a pair has come in through the faces that it has. */
static int entered(const cfem_rounds *at, const cfem_pair *pair) {
    const int h = cfem_hold_of(at->soft->now, pair->row.slot);
    return !at->before || first_gap(at, pair) > -ENTERED * CFEM_MEET_SPACING || (h >= 0 && !at->soft->now->hold[h].unknown);
}

/* Where all patches are, for those who look for pairs. */
static void see(cfem_rounds *at) {
    cfem_around *const around = &at->soft->room->around;
    for (int b = 0; b < ROBOTS; b++) {
        const cfem_touch_room *const room = &at->room[b];
        memcpy(around->place[b * N], at->now[b].place, sizeof at->now[b].place);
        for (int p = 0; p < N; p++)
            for (int a = 0; a < 3; a++) {
                const double x = around->place[b * N + p][a];
                around->low[b][a] = fmin(x, p ? around->low[b][a] : x), around->high[b][a] = fmax(x, p ? around->high[b][a] : x);
            }
        for (int k = 0; k < CFEM_PATCH_ROWS; k++) around->rows[b][k] = room->rows[k] + (at->now[b].count ? room->moved[k] : 0.0);
    }
}

/* Whether patches hardly move any more. */
static int rests(const cfem_rounds *at) { return at->moved <= SETTLING * CFEM_MEET_SPACING; }

/* The pairs of before on the same planes. */
static void onwards(cfem_rounds *at) {
    double apart[3];
    see(at);
    for (int i = 0; i < at->soft->now->pair_count; i++) {
        cfem_pair *const pair = &at->soft->now->pair[i];
        cfem_row_place(&pair->row, at->soft->room->around.place, apart);
        pair->gap = cfem_dot(3, pair->frame[0], apart);
    }
}

/* The pair of patch p, where it has one now. What has touched in this step keeps its faces: always where patches hardly move any more, else
 * where it would have none. 1: a pair; 0: none; -1: too many patches. */
static int look_at(cfem_rounds *at, int p, cfem_pair *pair) {
    cfem_meet_room *const room = at->soft->room;
    const int h = cfem_hold_of(at->soft->now, p);
    const cfem_row_of *const faces = h >= 0 && room->kept[h] ? &room->faces[h] : 0;
    const int found = !faces || !rests(at) ? cfem_pair_of(&room->around, p, 0, pair) : 0;
    return !found && faces ? cfem_pair_of(&room->around, p, faces, pair) : found;
}

/* Who is before whom. 0, or a status. */
static unsigned look(cfem_rounds *at) {
    cfem_met *const now = at->soft->now;
    see(at);
    memset(at->soft->room->around.known, 0, sizeof at->soft->room->around.known);
    now->pair_count = 0, at->soft->moved = 0.0;
    for (int p = 0; p < ALL; p++) {
        if (now->pair_count == CFEM_MEET_PAIRS) return CFEM_TOUCH_MANY;
        const int found = look_at(at, p, &now->pair[now->pair_count]);
        if (found < 0) return CFEM_TOUCH_MANY;
        now->pair_count += found;
    }
    return 0;
}

/* The same where patches have hardly moved since: pairs that are far apart keep their planes, and nothing new has come near. 0, or a
 * status. */
static unsigned look_again(cfem_rounds *at) {
    cfem_met *const now = at->soft->now;
    int kept = 0;
    onwards(at);
    memset(at->soft->room->around.known, 0, sizeof at->soft->room->around.known);
    for (int i = 0; i < now->pair_count; i++) {
        const int p = now->pair[i].row.slot, h = cfem_hold_of(now, p);
        const int far = now->pair[i].gap > NEAR * CFEM_MEET_SPACING && !(h >= 0 && at->soft->room->kept[h]);
        const int found = far ? 1 : look_at(at, p, &now->pair[i]);
        if (found < 0) return CFEM_TOUCH_MANY;
        if (found && kept < i) now->pair[kept] = now->pair[i];
        kept += found;
    }
    now->pair_count = kept;
    return 0;
}

unsigned cfem_soft_begin(cfem_rounds *at) {
    cfem_met *const now = at->soft->now;
    const cfem_met *const before = at->soft->begin;
    int inside = 0;
    at->soft->room->around.robots = at->placed, at->soft->last = 0, at->soft->moved = HUGE_VAL;
    at->soft->room->answers.count = at->soft->room->answers.last_moved = 0;
    if (before) {
        now->pair_count = before->pair_count, now->hold_count = before->hold_count;
        memcpy(now->pair, before->pair, sizeof *now->pair * (size_t)now->pair_count);
        memcpy(now->hold, before->hold, sizeof *now->hold * (size_t)now->hold_count);
        memset(at->soft->room->kept, 0, sizeof at->soft->room->kept);
        onwards(at);
        return 0;
    }
    const unsigned status = look(at);
    for (int i = 0; i < now->pair_count; i++) inside |= now->pair[i].gap < -INSIDE * CFEM_PATCH_LENGTH;
    for (int p = 0; p < ALL; p++) inside |= at->room[p / N].distance[p % N] < -INSIDE * CFEM_PATCH_LENGTH;
    return status ? status : inside ? CFEM_MEET_INSIDE : 0;
}

unsigned cfem_soft_touch(cfem_rounds *at) {
    at->pairs = 0;
    for (int i = 0; i < at->soft->now->pair_count; i++) {
        const cfem_pair *const pair = &at->soft->now->pair[i];
        const int h = cfem_hold_of(at->soft->now, pair->row.slot);
        if (!(pair->gap <= 0.0 || (h >= 0 && presses(at->soft->now->hold[h].push))) || !entered(at, pair)) continue;
        if (at->pairs == MOST) return CFEM_TOUCH_MANY;
        at->soft->room->touching[at->pairs++] = i;
    }
    return 0;
}

unsigned cfem_soft_bear(cfem_rounds *at, int *grown) {
    for (int k = 0; k < at->pairs; k++)
        for (int e = 0; e < touching(at, k)->row.count; e++) {
            const int p = touching(at, k)->row.patch[e], more = cfem_rounds_bear(at, p / N, p % N);
            if (more < 0) return CFEM_TOUCH_MANY;
            *grown |= more;
        }
    return 0;
}

/* Places of the patches among those of their robots that bear, -1 of others. */
static void number(cfem_rounds *at) {
    int *const place = at->soft->room->chosen;
    for (int p = 0; p < ALL; p++) place[p] = -1;
    for (int b = 0; b < ROBOTS; b++)
        for (int i = 0; i < at->now[b].count; i++) place[b * N + at->now[b].patch[i]] = i;
}

unsigned cfem_soft_go_on(cfem_rounds *at, int *known) {
    onwards(at);
    const unsigned status = cfem_soft_touch(at);
    if (status || at->solid + at->pairs > MOST) return CFEM_TOUCH_MANY;
    number(at);
    for (int k = 0; k < at->pairs; k++)
        for (int e = 0; e < touching(at, k)->row.count; e++) *known &= at->soft->room->chosen[touching(at, k)->row.patch[e]] >= 0;
    return 0;
}

/* A pair that has not touched before sticks where it has touched: on the way from where the step began. */
static void begin_hold(cfem_rounds *at, const cfem_pair *pair, cfem_hold *hold) {
    cfem_row_of *const row = &hold->row;
    const double first = at->before ? first_gap(at, pair) : pair->gap, last = pair->gap;
    const double share = first <= 0.0 ? 0.0 : last < 0.0 ? first / fmax(first - last, 1e-300) : 1.0;
    double sign, on[CFEM_ROW_MOST][2], mean[2] = {0.0}, aside[2] = {0.0}, M[4] = {0.0};
    hold->unknown = 0;
    *row = pair->row;
    for (int k = 0; k < row->count; k++) {
        const double *const there = at->soft->room->around.place[row->patch[k]], *const from = at->before ? begun(at, row->patch[k]) : there;
        double x[3];
        for (int a = 0; a < 3; a++) x[a] = from[a] + share * (there[a] - from[a]);
        for (int a = 0; a < 2; a++) {
            on[k][a] = cfem_dot(3, pair->frame[1 + a], x), aside[a] += row->weight[k] * on[k][a];
            if (k) mean[a] += on[k][a] / (row->count - 1);
        }
    }
    for (int k = 1; k < row->count; k++)
        for (int a = 0; a < 4; a++) M[a] += (on[k][a / 2] - mean[a / 2]) * (on[k][a % 2] - mean[a % 2]);
    if (cfem_eliminate(2, M, 1, aside, &sign)) return;
    for (int k = 1; k < row->count; k++) /* such shares of its faces that the point is before it there */
        for (int a = 0; a < 2; a++) row->weight[k] -= (on[k][a] - mean[a]) * aside[a];
}

unsigned cfem_soft_hold(cfem_rounds *at) {
    cfem_met *const now = at->soft->now;
    number(at);
    for (int k = 0; k < at->pairs; k++) {
        const cfem_pair *const pair = touching(at, k);
        int h = cfem_hold_of(now, pair->row.slot);
        if (h < 0) {
            if (now->hold_count == CFEM_MEET_PAIRS) return CFEM_TOUCH_MANY;
            h = now->hold_count++;
            memset(&now->hold[h], 0, sizeof now->hold[h]);
            now->hold[h].unknown = 1;
        }
        if (now->hold[h].unknown) begin_hold(at, pair, &now->hold[h]);
        at->soft->room->kept[h] = 1, at->soft->room->faces[h] = pair->row;
    }
    return 0;
}

void cfem_soft_row(cfem_rounds *at, int k, double *known, double *gap) {
    const cfem_pair *const pair = touching(at, k);
    const cfem_hold *const hold = &at->soft->now->hold[cfem_hold_of(at->soft->now, pair->row.slot)];
    double slip[3];
    memcpy(at->frame[at->solid + k], pair->frame, sizeof pair->frame);
    cfem_row_place(&hold->row, at->soft->room->around.place, slip);
    for (int a = 0; a < 3; a++) {
        known[a] = a == 0 || at->mu > 0.0 ? cfem_dot(3, pair->frame[a], hold->push) : 0.0;
        gap[a] = a == 0 ? pair->gap : at->mu > 0.0 ? cfem_dot(3, pair->frame[a], slip) : 0.0;
    }
}

/* Nothing presses any more. */
static void release(cfem_met *now) {
    for (int h = 0; h < now->hold_count; h++) {
        memset(now->hold[h].push, 0, sizeof now->hold[h].push);
        now->hold[h].mode = CFEM_TOUCH_OPEN;
    }
}

unsigned cfem_soft_settle(cfem_rounds *at, int *settled) {
    cfem_met *const now = at->soft->now;
    const int rows = at->solid + at->pairs;
    int *const slots = at->soft->room->slots;
    release(now);
    *settled = rows == at->soft->last && at->moved <= CFEM_SOFT_RESTS * CFEM_PATCH_LENGTH;
    for (int r = 0; r < rows; r++) {
        const int slot = cfem_soft_slot(at, r);
        *settled &= r < at->soft->last && slots[r] == slot, slots[r] = slot;
        if (r < at->solid) continue;
        cfem_hold *const hold = &now->hold[cfem_hold_of(now, slot)];
        hold->mode = cfem_touch_mode(at->mu, at->local[r]);
        for (int a = 0; a < 9; a++) hold->push[a % 3] += at->local[r][a / 3] * at->frame[r][a / 3][a % 3];
    }
    at->soft->last = rows;
    at->soft->moved += at->moved;
    const unsigned status = *settled || at->soft->moved > STAYING * CFEM_MEET_SPACING ? look(at) : look_again(at);
    for (int i = 0, r = at->solid; i < now->pair_count; i++) {
        while (r < rows && slots[r] < now->pair[i].row.slot) r++;
        if (r < rows && slots[r] == now->pair[i].row.slot) continue;
        *settled &= now->pair[i].gap >= -OVERLAP * CFEM_PATCH_LENGTH || !entered(at, &now->pair[i]);
    }
    return status;
}

unsigned cfem_soft_let_go(cfem_rounds *at) {
    cfem_met *const now = at->soft->now;
    int free = 1;
    for (int b = 0; b < ROBOTS; b++)
        for (int i = 0; i < at->now[b].count; i++) {
            free &= !presses(at->now[b].force[i]);
            memset(at->now[b].force[i], 0, sizeof at->now[b].force[i]);
            memset(at->now[b].push[i], 0, sizeof at->now[b].push[i]);
        }
    release(now);
    cfem_rounds_place(at);
    const unsigned status = look(at);
    for (int i = 0; i < now->pair_count; i++) free &= now->pair[i].gap > 0.0 || !entered(at, &now->pair[i]);
    return status ? status : free ? CFEM_TOUCH_CONVERGED : CFEM_ROUNDS_ON;
}

void cfem_soft_finish(cfem_rounds *at) {
    cfem_met *const now = at->soft->now;
    unsigned char *const near = at->soft->room->around.known;
    int kept = 0;
    memset(near, 0, sizeof at->soft->room->around.known);
    for (int i = 0; i < now->pair_count; i++)
        for (int e = 0; e < now->pair[i].row.count && now->pair[i].gap < NEAR * CFEM_MEET_SPACING; e++) near[now->pair[i].row.patch[e]] = 1;
    for (int h = 0; h < now->hold_count; h++) {
        cfem_hold *const hold = &now->hold[h];
        int i = 0;
        while (i < now->pair_count && now->pair[i].row.slot != hold->row.slot) i++;
        if (i == now->pair_count || hold->mode == CFEM_TOUCH_OPEN) continue;
        if (hold->mode == CFEM_TOUCH_SLIP) hold->row = now->pair[i].row;
        now->hold[kept++] = *hold;
    }
    now->hold_count = kept;
}

int cfem_soft_near(const cfem_rounds *at, int b, int p) {
    return at->soft->room->around.known[b * N + p] || at->room[b].distance[p] < NEAR * CFEM_MEET_SPACING;
}

unsigned cfem_meet(double (*delta_a)[CFEM_NA], const cfem_placed *robots, const cfem_obstacle *obstacles, int count, double mu,
                   const cfem_met *before, cfem_met *now, cfem_meet_room *room) {
    struct cfem_meeting soft = {before, now, room, 0, 0.0};
    cfem_rounds at = {.placed = robots, .obstacles = obstacles, .obstacle_count = count, .mu = mu, .before = before ? before->robot : 0,
                      .now = now->robot, .room = room->robot, .soft = &soft, .systems = CFEM_TOUCH_SYSTEMS};
    now->pair_count = now->hold_count = 0;
    now->status = (before ? cfem_rounds_slack : cfem_rounds_run)(&at, &delta_a[0][0]), now->iterations = at.iterations, now->systems = CFEM_TOUCH_SYSTEMS - at.systems;
    if (now->status == CFEM_TOUCH_NO_MODEL || now->status == CFEM_TOUCH_MANY) now->pair_count = now->hold_count = 0;
    return now->status;
}

double cfem_meet_pressed(const cfem_met *state, int robot, int met) {
    double sum = 0.0;
    for (int i = 0; i < state->pair_count; i++) {
        const cfem_pair *const pair = &state->pair[i];
        const int h = cfem_hold_of(state, pair->row.slot), mine = pair->row.patch[0] / N;
        if (h >= 0 && ((mine == robot && pair->met == met) || (mine == met && pair->met == robot)))
            sum += cfem_dot(3, state->hold[h].push, pair->frame[0]);
    }
    for (int i = 0; i < state->robot[robot].count; i++)
        if (state->robot[robot].obstacle[i] + ROBOTS == met) sum += cfem_dot(3, state->robot[robot].push[i], state->robot[robot].normal[i]);
    return sum;
}
