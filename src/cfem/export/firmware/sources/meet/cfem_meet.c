/* Rounds: the law of contact for the pairs that touch, linear about where the patches are; where its forces bring them; who is before
 * whom there; until neither forces nor pairs change. The same as cfem.predict.contact.scene. */
#include "cfem_meet_law.h"

#include <string.h>

#include "cfem_linear.h"
#include "cfem_slack.h"

#define N CFEM_PATCHES
#define ALL CFEM_MEET_PATCHES
#define ROBOTS CFEM_MEET_ROBOTS
#define MOST CFEM_TOUCH_MOST
#define NA CFEM_NA
#define ALL_NA CFEM_SLACK_MOST

enum { ITERATIONS = 60, ON = 99 }; /* rounds, as many as in Python (predict/contact/rounds.py); ON: another is needed */
static const double TOLERANCE = 1e-8, OVERLAP = 1e-6, INSIDE = 1e-3;         /* of the length */
static const double SETTLING = 0.01, ENTERED = 0.1, NEAR = 0.1;              /* of the distance of patches */

static int presses(const cfem_hold *hold) { return hold->push[0] != 0.0 || hold->push[1] != 0.0 || hold->push[2] != 0.0; }

/* Whether a pair has come in through the faces that it has. */
static int entered(const cfem_meeting *at, const cfem_pair *pair) {
    const int h = cfem_hold_of(at->now, pair->row.slot);
    return !at->begin || pair->row.slot >= ALL || cfem_first_gap(at, pair) > -ENTERED * CFEM_MEET_SPACING ||
           (h >= 0 && !at->now->hold[h].unknown);
}

/* Where all patches are under the forces. 0, or a status. */
static unsigned place(cfem_meeting *at) {
    cfem_around *const around = &at->room->around;
    for (int b = 0; b < ROBOTS; b++) {
        cfem_touched *const one = &at->now->robot[b];
        cfem_touch_room *const room = &at->room->robot[b];
        const cfem_placed *const pose = &around->robots[b];
        if (cfem_touch_compliance(one->count, one->patch, room)) return CFEM_TOUCH_NO_MODEL;
        cfem_touch_bear(one->count, one->patch, one->force, room);
        cfem_touch_places(one->count, one->patch, one->force, room, one->place);
        for (int p = 0; p < N; p++) {
            double *const x = around->place[b * N + p];
            for (int a = 0; a < 3; a++) {
                x[a] = cfem_dot(3, pose->R[a], one->place[p]) + pose->t[a];
                around->low[b][a] = fmin(x[a], p ? around->low[b][a] : x[a]);
                around->high[b][a] = fmax(x[a], p ? around->high[b][a] : x[a]);
            }
            memcpy(one->place[p], x, sizeof one->place[p]);
        }
        for (int k = 0; k < CFEM_PATCH_ROWS; k++) around->rows[b][k] = room->rows[k] + (one->count ? room->moved[k] : 0.0);
    }
    return 0;
}

/* Adds the obstacles that patches are near to. */
static unsigned solids(cfem_meeting *at) {
    for (int p = 0; p < ALL; p++) {
        if (at->now->pair_count == CFEM_MEET_PAIRS) return CFEM_TOUCH_MANY;
        at->now->pair_count += cfem_pair_solid(&at->room->around, p, &at->now->pair[at->now->pair_count]);
    }
    return 0;
}

/* Places, and the pairs of before on the same planes. */
static unsigned onwards(cfem_meeting *at) {
    cfem_met *const now = at->now;
    double apart[3];
    const unsigned status = place(at);
    if (status) return status;
    while (now->pair_count && now->pair[now->pair_count - 1].row.slot >= ALL) now->pair_count--;
    for (int i = 0; i < now->pair_count; i++) {
        cfem_row_place(&now->pair[i].row, at->room->around.place, apart);
        now->pair[i].gap = cfem_dot(3, now->pair[i].frame[0], apart);
    }
    return solids(at);
}

/* Places, and who is before whom there. What has touched in this step keeps its faces: always where patches hardly move any more,
 * else where it would have none. */
static unsigned look(cfem_meeting *at) {
    cfem_met *const now = at->now;
    cfem_around *const around = &at->room->around;
    const unsigned status = place(at);
    if (status) return status;
    memset(around->known, 0, sizeof around->known);
    now->pair_count = 0;
    for (int p = 0; p < ALL; p++) {
        if (now->pair_count == CFEM_MEET_PAIRS) return CFEM_TOUCH_MANY;
        cfem_pair *const pair = &now->pair[now->pair_count];
        const int h = cfem_hold_of(now, p);
        const cfem_row_of *const faces = h >= 0 && at->room->kept[h] ? &at->room->faces[h] : 0;
        int found = !faces || at->moved > SETTLING * CFEM_MEET_SPACING ? cfem_pair_of(around, p, 0, pair) : 0;
        if (!found && faces) found = cfem_pair_of(around, p, faces, pair);
        if (found < 0) return CFEM_TOUCH_MANY;
        now->pair_count += found;
    }
    return solids(at);
}

/* Which pairs touch. 0, or a status. */
static unsigned touching(cfem_meeting *at) {
    at->count = 0;
    for (int i = 0; i < at->now->pair_count; i++) {
        const cfem_pair *const pair = &at->now->pair[i];
        const int h = cfem_hold_of(at->now, pair->row.slot);
        if (!(pair->gap <= 0.0 || (h >= 0 && presses(&at->now->hold[h]))) || !entered(at, pair)) continue;
        if (at->count == MOST) return CFEM_TOUCH_MANY;
        at->room->touching[at->count++] = i;
    }
    return 0;
}

/* Nothing touches. */
static unsigned let_go(cfem_meeting *at) {
    int free = 1;
    for (int b = 0; b < ROBOTS; b++)
        for (int i = 0; i < 3 * at->now->robot[b].count; i++)
            free &= at->now->robot[b].force[i / 3][i % 3] == 0.0, at->now->robot[b].force[i / 3][i % 3] = 0.0;
    for (int h = 0; h < at->now->hold_count; h++) {
        memset(at->now->hold[h].push, 0, sizeof at->now->hold[h].push);
        at->now->hold[h].mode = CFEM_TOUCH_OPEN;
    }
    const unsigned status = look(at);
    for (int i = 0; i < at->now->pair_count; i++)
        free &= at->now->pair[i].gap > 0.0 || !entered(at, &at->now->pair[i]);
    return status ? status : free ? CFEM_TOUCH_CONVERGED : ON;
}

static unsigned one_round(cfem_meeting *at) {
    cfem_met *const now = at->now;
    cfem_meet_room *const room = at->room;
    double local[MOST][3];
    int pressed = 1, settled;
    unsigned status = touching(at);
    if (status) return status;
    if (!at->count) return let_go(at);
    const int new = cfem_meet_choose(at, 1);
    if (new < 0) return CFEM_TOUCH_MANY;
    if (new) {
        status = onwards(at);
        if (!status) status = touching(at);
        if (status || cfem_meet_choose(at, 0)) return status ? status : ON;
    }
    status = cfem_meet_hold(at);
    if (status) return status;
    for (int b = 0; b < ROBOTS; b++) cfem_touch_yield(now->robot[b].count, now->robot[b].patch, &room->robot[b]);
    if (cfem_meet_law(at, 1, local)) { /* under large forces the derivative may be indefinite, which the other is not */
        pressed = 0;
        if (cfem_meet_law(at, 0, local)) return CFEM_TOUCH_NO_STATE;
    }
    cfem_meet_push(at, pressed, local);
    settled = at->count == at->last && at->moved <= TOLERANCE * CFEM_PATCH_LENGTH;
    for (int i = 0; i < at->count; i++) {
        const int slot = cfem_touching(at, i)->row.slot;
        settled &= i < at->last && room->slots[i] == slot, room->slots[i] = slot;
    }
    at->last = at->count;
    status = look(at);
    for (int i = 0, k = 0; i < now->pair_count; i++) {
        while (k < at->last && room->slots[k] < now->pair[i].row.slot) k++;
        if (k < at->last && room->slots[k] == now->pair[i].row.slot) continue;
        settled &= now->pair[i].gap >= -OVERLAP * CFEM_PATCH_LENGTH || !entered(at, &now->pair[i]);
    }
    return status ? status : settled ? CFEM_TOUCH_CONVERGED : ON;
}

/* From where slip counts from here on, and what the next step begins with. */
static void finish(cfem_meeting *at) {
    cfem_met *const now = at->now;
    int kept = 0;
    cfem_meet_number(at);
    for (int p = 0; p < ALL; p++) at->room->around.known[p] = 0; /* whether a patch is of a pair that is near, or bears */
    for (int i = 0; i < now->pair_count; i++) {
        const cfem_pair *const pair = &now->pair[i];
        for (int k = 0; k < pair->row.count && pair->gap < NEAR * CFEM_MEET_SPACING; k++)
            at->room->around.known[pair->row.patch[k]] = 1;
    }
    for (int h = 0; h < now->hold_count; h++) {
        cfem_hold *const hold = &now->hold[h];
        int i = 0;
        while (i < now->pair_count && now->pair[i].row.slot != hold->row.slot) i++;
        if (i == now->pair_count || hold->mode == CFEM_TOUCH_OPEN) continue;
        if (hold->mode == CFEM_TOUCH_SLIP) {
            hold->row = now->pair[i].row;
            for (int a = 0; a < 3; a++) hold->origin[a] = hold->row.slot < ALL ? 0.0 : at->room->around.place[hold->row.patch[0]][a];
        }
        now->hold[kept++] = *hold;
    }
    now->hold_count = kept;
    for (int b = 0; b < ROBOTS; b++) {
        cfem_touched *const one = &now->robot[b];
        one->near_count = 0;
        for (int i = 0; i < one->count; i++) {
            const double *const f = one->force[i];
            if (at->room->around.known[b * N + one->patch[i]] || f[0] != 0.0 || f[1] != 0.0 || f[2] != 0.0)
                one->near[one->near_count++] = one->patch[i];
        }
        cfem_touch_loaded(one, &at->room->robot[b]);
    }
}

/* The robots as they were before, with what they bore. 0, or a status. */
static unsigned take_up(cfem_meeting *at, const double *delta_a, const cfem_met *before) {
    cfem_met *const now = at->now;
    now->pair_count = now->hold_count = 0;
    for (int b = 0; b < ROBOTS; b++) {
        cfem_touched *const one = &now->robot[b];
        one->count = before ? before->robot[b].near_count : 0;
        for (int i = 0, k = 0; i < one->count; i++) {
            one->patch[i] = before->robot[b].near[i];
            while (before->robot[b].patch[k] != one->patch[i]) k++;
            memcpy(one->force[i], before->robot[b].force[k], sizeof one->force[i]);
        }
        const unsigned status = cfem_touch_hold(delta_a + b * NA, one, &at->room->robot[b]);
        if (status) return status;
    }
    if (!before) {
        const unsigned status = look(at);
        for (int i = 0; i < now->pair_count && !status; i++)
            if (now->pair[i].gap < -INSIDE * CFEM_PATCH_LENGTH) return CFEM_MEET_INSIDE;
        return status;
    }
    now->pair_count = before->pair_count, now->hold_count = before->hold_count;
    memcpy(now->pair, before->pair, sizeof now->pair);
    memcpy(now->hold, before->hold, sizeof now->hold);
    memset(at->room->kept, 0, sizeof at->room->kept);
    return onwards(at);
}

typedef struct {
    const cfem_placed *robots;
    const cfem_obstacle *obstacles;
    int count;
    double mu;
    const cfem_met *before;
    cfem_met *now;
    cfem_meet_room *room;
} held_meeting;

/* The step with all actuators held. */
static unsigned held(void *with, const double *delta_a, double *lambda_a) {
    const held_meeting *const of = with;
    cfem_met *const now = of->now;
    cfem_meet_room *const room = of->room;
    cfem_meeting at = {of->before, now, room, of->mu, HUGE_VAL, 0, 0};
    double sum = of->mu;
    for (int i = 0; i < ALL_NA; i++) sum += delta_a[i];
    now->iterations = now->pair_count = now->hold_count = 0;
    if (!cfem_finite(sum) || !(of->mu >= 0.0)) return now->status = CFEM_TOUCH_BAD_INPUT;
    room->around.robots = of->robots, room->around.obstacles = of->obstacles, room->around.obstacle_count = of->count;
    now->status = take_up(&at, delta_a, of->before);
    if (now->status) return now->status;
    for (now->status = ON; now->status == ON; now->iterations++)
        now->status = now->iterations < ITERATIONS ? one_round(&at) : CFEM_TOUCH_ITERATIONS;
    if (now->status == CFEM_TOUCH_ITERATIONS) now->iterations--;
    if (now->status == CFEM_TOUCH_NO_MODEL || now->status == CFEM_TOUCH_MANY)
        now->pair_count = now->hold_count = 0;
    else
        finish(&at);
    for (int i = 0; i < ALL_NA; i++) lambda_a[i] = now->robot[i / NA].lambda_a[i % NA];
    return now->status;
}

unsigned cfem_meet(double (*delta_a)[CFEM_NA], const cfem_placed *robots, const cfem_obstacle *obstacles, int count, double mu,
                   const cfem_met *before, cfem_met *now, cfem_meet_room *room) {
    held_meeting with = {robots, obstacles, count, mu, before, now, room};
    double at[ALL_NA] = {0.0};
    unsigned char unilateral[ALL_NA] = {0}, slack[ALL_NA] = {0};
    for (int i = 0; i < ALL_NA && before; i++) {
        unilateral[i] = robots[i / NA].unilateral[i % NA], at[i] = before->robot[i / NA].delta_a[i % NA];
        slack[i] = unilateral[i] && before->robot[i / NA].lambda_a[i % NA] == 0.0;
    }
    now->status = cfem_slack(ALL_NA, &delta_a[0][0], unilateral, held, &with, at, slack);
    for (int i = 0; i < ALL_NA; i++)
        if (slack[i]) now->robot[i / NA].lambda_a[i % NA] = 0.0;
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
    return sum;
}
