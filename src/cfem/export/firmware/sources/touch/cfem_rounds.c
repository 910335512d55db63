/* Rounds: the law of contact, linear about where the patches are; where its forces bring them; until it holds there too. The same
 * as cfem.predict.contact.step.rounds. */
#include "cfem_rounds.h"

#include <string.h>

#include "cfem_slack.h"
#if CFEM_TOUCH_SOFT
#include "cfem_soft.h"
#else
static const double NEAR = 0.005; /* of the length */
#endif

#define SOFT CFEM_SOFT
#define PUSH CFEM_PUSH
#define N CFEM_PATCHES
#define NA CFEM_NA
#define MOST CFEM_TOUCH_MOST
#define ROWS CFEM_TOUCH_ROWS
#define ROBOTS CFEM_TOUCH_ROBOTS

enum { ITERATIONS = 60, PATIENCE = 8, ON = CFEM_ROUNDS_ON }; /* rounds, as many as in Python (predict/contact/step/rounds.py) */
static const double LEAST = 1.0 / 64.0; /* share of a change of forces */
static const double TOLERANCE = 1e-9, OVERLAP = 1e-6, FAR = 0.1; /* of the length */
static const double SKEW = 1e-5; /* of a rotation, at most */
static const double SIDE = 0.7; /* product of normals: less is another side of an obstacle */

static int presses(const double *force) { return force[0] != 0.0 || force[1] != 0.0 || force[2] != 0.0; }

/* Distance of patch p of robot b, and which obstacle is nearest; `within` where none is nearer. */
static void look(cfem_rounds *at, int b, int p, double within) {
    cfem_touch_room *const room = &at->room[b];
    const double *const x = at->now[b].place[p];
    room->distance[p] = cfem_patch_held[p] ? HUGE_VAL : within, room->which[p] = 0;
    for (int o = 0; o < at->obstacle_count && !cfem_patch_held[p]; o++) { /* what is held still touches nothing */
        const cfem_obstacle *const obstacle = &at->obstacles[o];
        const double apart[3] = {x[0] - obstacle->t[0], x[1] - obstacle->t[1], x[2] - obstacle->t[2]};
        /* so far from its centre it cannot be nearer than what is known */
        const double beyond = room->distance[p] + obstacle->core[0] + obstacle->core[1] + obstacle->core[2] + obstacle->rounding;
        if (beyond <= 0.0 || cfem_dot(3, apart, apart) >= beyond * beyond) continue;
        const double distance = cfem_obstacle_distance(obstacle, x);
        if (distance < room->distance[p]) room->distance[p] = distance, room->which[p] = o;
    }
}

/* Whether patch p is so far within an obstacle that twice as far in another side of it is nearer. */
static int deep(const cfem_rounds *at, int b, int p) {
    const double distance = at->room[b].distance[p], *const x = at->now[b].place[p];
    const cfem_obstacle *const obstacle = &at->obstacles[at->room[b].which[p]];
    double here[3][3], there[3][3], deeper[3];
    if (!(distance < 0.0)) return 0;
    cfem_obstacle_frame(obstacle, x, here);
    for (int a = 0; a < 3; a++) deeper[a] = x[a] + distance * here[0][a];
    cfem_obstacle_frame(obstacle, deeper, there);
    return cfem_dot(3, here[0], there[0]) < SIDE;
}

void cfem_rounds_place(cfem_rounds *at) {
    for (int b = 0; b < ROBOTS; b++) {
        cfem_touched *const one = &at->now[b];
        const cfem_placed *const pose = &at->placed[b];
        cfem_touch_bear(one->count, one->patch, one->force, &at->room[b]);
        cfem_touch_places(one->count, one->patch, one->force, &at->room[b], one->place);
        for (int p = 0; p < N && SOFT(1, 0); p++) {
            double x[3];
            cfem_turn(pose, one->place[p], x);
            for (int a = 0; a < 3; a++) one->place[p][a] = x[a] + pose->t[a];
        }
    }
}

unsigned cfem_rounds_know(cfem_rounds *at) {
    for (int b = 0; b < ROBOTS; b++)
        if (cfem_touch_compliance(at->now[b].count, at->now[b].patch, &at->room[b])) return CFEM_TOUCH_NO_MODEL;
    cfem_rounds_place(at);
    return 0;
}

int cfem_rounds_bear(cfem_rounds *at, int b, int p) {
    cfem_touched *const one = &at->now[b];
    int i = one->count;
    while (i > 0 && one->patch[i - 1] > p) i--;
    if (i > 0 && one->patch[i - 1] == p) return 0;
    if (one->count == MOST) return -1;
    for (int k = one->count++; k > i; k--) {
        one->patch[k] = one->patch[k - 1];
        memcpy(one->force[k], one->force[k - 1], sizeof one->force[k]);
        memcpy(PUSH(one)[k], PUSH(one)[k - 1], sizeof one->force[k]);
    }
    one->patch[i] = p;
    memset(one->force[i], 0, sizeof one->force[i]);
    memset(PUSH(one)[i], 0, sizeof one->force[i]);
    return 1;
}

/* The robots as they were before, with what they bore. 0, or a status. */
static unsigned take_up(cfem_rounds *at, const double *delta_a) {
    for (int b = 0; b < ROBOTS; b++) {
        cfem_touched *const one = &at->now[b];
        const cfem_touched *const before = at->before ? &at->before[b] : 0;
        const unsigned status = cfem_touch_hold(delta_a + b * NA, one, &at->room[b]);
        one->count = before && SOFT(1, at->obstacle_count) ? before->near_count : 0; /* without obstacles there is nothing to hold on to */
        memset(at->stuck_before[b], 0, sizeof at->stuck_before[b]);
        if (status) return status;
        for (int i = 0, j = 0; i < one->count; i++) { /* in the same order */
            const int p = one->patch[i] = before->near[i];
            while (j < before->count && before->patch[j] < p) j++;
            const int bore = j < before->count && before->patch[j] == p, gone = bore && before->obstacle[j] >= at->obstacle_count;
            double pushed[3] = {0.0}; /* by an obstacle that is gone */
            if (gone && SOFT(1, 0)) cfem_turn_back(&at->placed[b], PUSH(before)[j], pushed);
            for (int a = 0; a < 3; a++) {
                one->force[i][a] = bore && SOFT(1, !gone) ? before->force[j][a] - pushed[a] : 0.0;
                PUSH(one)[i][a] = bore && !gone ? PUSH(before)[j][a] : 0.0;
            }
            at->stuck_before[b][p] = bore && !gone && at->mu > 0.0 && before->mode[j] == CFEM_TOUCH_STICK;
        }
    }
    return cfem_rounds_know(at);
}

/* Where the step begins. 0, or a status. */
static unsigned begin(cfem_rounds *at, const double *delta_a) {
    const unsigned status = take_up(at, delta_a);
    for (int b = 0; b < ROBOTS && !status; b++) {
        cfem_touched *const one = &at->now[b];
        const cfem_touched *const before = at->before ? &at->before[b] : 0;
        for (int p = 0; p < N; p++) { /* what did not touch slides from where it was */
            const double *const from = !before ? one->place[p] : before->holds[p] ? before->stuck[p] : before->place[p];
            for (int a = 0; a < 3; a++) one->stuck[p][a] = from[a];
            look(at, b, p, FAR * CFEM_PATCH_LENGTH), one->deep |= deep(at, b, p);
        }
        const int stays = before && before->near_count; /* on the wrong side, or branch, where it was before */
        one->deep |= stays && before->deep, one->unsettled |= stays && before->unsettled;
    }
    return status ? status : SOFT(cfem_soft_begin(at), 0);
}

/* The patches of this round: those that are within an obstacle or are pressed by one. Where only obstacles are met all that have borne stay,
 * as only of these places are quite known. grown: whether there are more than before. 0, or a status. */
static unsigned choose(cfem_rounds *at, int *grown) {
    at->solid = *grown = 0;
#if CFEM_TOUCH_SOFT
    if (cfem_soft_bear(at, grown)) return CFEM_TOUCH_MANY;
#endif
    for (int b = 0; b < ROBOTS; b++) {
        cfem_touched *const one = &at->now[b];
        for (int p = 0; p < N; p++) {
            const int more = at->room[b].distance[p] <= 0.0 ? cfem_rounds_bear(at, b, p) : 0;
            if (more < 0) return CFEM_TOUCH_MANY;
            *grown |= more;
        }
        for (int i = 0; i < one->count; i++) {
            if (at->room[b].distance[one->patch[i]] > 0.0 && SOFT(!presses(PUSH(one)[i]), 0)) continue;
            if (at->solid + at->pairs == MOST) return CFEM_TOUCH_MANY;
            at->robot[at->solid] = b, at->slot[at->solid++] = i;
        }
    }
    return 0;
}

static void name_modes(cfem_rounds *at) {
    for (int b = 0; b < ROBOTS; b++) {
        memset(at->stuck_before[b], 0, sizeof at->stuck_before[b]);
        for (int i = 0; i < at->now[b].count; i++) at->now[b].mode[i] = CFEM_TOUCH_OPEN;
    }
    for (int r = 0; r < at->solid; r++) {
        cfem_touched *const one = &at->now[at->robot[r]];
        const int i = at->slot[r];
        one->mode[i] = cfem_touch_mode(at->mu, at->local[r]);
        at->stuck_before[at->robot[r]][one->patch[i]] = one->mode[i] == CFEM_TOUCH_STICK;
    }
}

/* To where the forces bring the patches; mm that the nearest is from an obstacle then. */
static double move(cfem_rounds *at) {
    double farthest = 0.0, nearest = HUGE_VAL, before[ROBOTS][N][3];
    for (int b = 0; b < ROBOTS; b++) memcpy(before[b], at->now[b].place, sizeof before[b]);
    cfem_rounds_place(at);
    for (int b = 0; b < ROBOTS; b++)
        for (int i = 0; i < 3 * N; i++) farthest = cfem_larger(farthest, fabs(at->now[b].place[i / 3][i % 3] - before[b][i / 3][i % 3]));
    for (int b = 0; b < ROBOTS; b++)
        for (int p = 0; p < N; p++) at->room[b].distance[p] -= 2.0 * farthest; /* more than the root of 3 */
    for (int r = 0; r < at->solid; r++) at->room[at->robot[r]].distance[at->now[at->robot[r]].patch[at->slot[r]]] = -HUGE_VAL;
    for (int b = 0; b < ROBOTS; b++)
        for (int p = 0; p < N; p++) { /* those that cannot have come near keep what is certain */
            if (at->room[b].distance[p] <= 0.0) look(at, b, p, HUGE_VAL);
            if (at->room[b].distance[p] < nearest) nearest = at->room[b].distance[p];
        }
    return nearest;
}

/* Row r where its patch is now: there (3,) N, its force there, which turns with the surface unless it sticks. Whether the law holds;
 * largest: of all forces. */
static int obeys(cfem_rounds *at, int r, double largest, double *there) {
    const int b = at->robot[r], i = at->slot[r], n = 3 * at->now[b].count;
    cfem_touched *const one = &at->now[b];
    const int p = one->patch[i], sticks = one->mode[i] == CFEM_TOUCH_STICK;
    double frame[3][3], local[3], slip[3], gap[3] = {at->room[b].distance[p], 0.0, 0.0}, yields = 0.0;
    cfem_obstacle_frame(&at->obstacles[at->room[b].which[p]], one->place[p], frame);
    for (int a = 0; a < 3; a++) {
        there[a] = frame[0][a] * at->local[r][0] + frame[1][a] * at->local[r][1] + frame[2][a] * at->local[r][2];
        if (sticks) there[a] = PUSH(one)[i][a];
        local[a] = sticks ? cfem_dot(3, frame[a], PUSH(one)[i]) : at->local[r][a];
        slip[a] = one->place[p][a] - one->stuck[p][a], one->normal[i][a] = frame[0][a];
        yields = cfem_larger(yields, at->room[b].total[(3 * i + a) * (n + 1)]);
    }
    for (int a = 1; a < 3 && at->mu > 0.0; a++) gap[a] = cfem_dot(3, frame[a], slip);
    const double missed = cfem_law_violation(at->mu, local, gap, yields);
    at->missed = cfem_larger(at->missed, missed);
    return missed <= TOLERANCE * CFEM_PATCH_LENGTH &&
           sqrt(local[1] * local[1] + local[2] * local[2]) - at->mu * local[0] <= TOLERANCE * largest;
}

/* Whether the law of obstacles holds where the patches are, `nearest` mm from them, with the frames there, in which the forces are then. */
static int lawful(cfem_rounds *at, double nearest) {
    double there[MOST][3], change[ROBOTS][ROWS] = {{0.0}}, largest = 0.0;
    int holds = nearest >= -OVERLAP * CFEM_PATCH_LENGTH, turned = 0;
    at->missed = cfem_larger(0.0, -nearest);
    for (int r = 0; r < at->solid; r++)
        for (int a = 0; a < 3; a++) largest = cfem_larger(largest, fabs(PUSH(&at->now[at->robot[r]])[at->slot[r]][a]));
    for (int r = 0; r < at->solid; r++) {
        const int b = at->robot[r], i = at->slot[r];
        double scene[3];
        holds &= obeys(at, r, largest, there[r]);
        for (int a = 0; a < 3; a++) scene[a] = there[r][a] - PUSH(&at->now[b])[i][a], turned |= scene[a] != 0.0;
        cfem_turn_back(&at->placed[b], scene, change[b] + 3 * i);
    }
    for (int b = 0; b < ROBOTS && turned; b++) {
        const int n = 3 * at->now[b].count;
        for (int j = 0; j < n && holds; j++)
            holds = fabs(cfem_dot(n, at->room[b].total + j * n, change[b])) <= TOLERANCE * CFEM_PATCH_LENGTH;
    }
    if (!holds || !turned) return holds;
    for (int b = 0; b < ROBOTS; b++)
        for (int j = 0; j < 3 * at->now[b].count && SOFT(1, 0); j++) at->now[b].force[j / 3][j % 3] += change[b][j];
    for (int r = 0; r < at->solid; r++) memcpy(PUSH(&at->now[at->robot[r]])[at->slot[r]], there[r], sizeof there[r]);
    for (int b = 0; b < ROBOTS; b++) cfem_touch_bear(at->now[b].count, at->now[b].patch, at->now[b].force, &at->room[b]);
    return 1;
}

/* Whether the law holds where the round ends, which took all of its answer. Of later rounds the next one takes half of the share of this one
 * where patches miss the law by more than in the last one, and do not go on the same way, else twice as much. */
static int ends(cfem_rounds *at, double nearest, int settled) {
    const double last = at->missed;
    int holds = settled && at->takes_all;
    if (at->solid) holds &= lawful(at, nearest);
    if (at->pairs) at->missed = cfem_larger(at->solid ? at->missed : 0.0, at->moved);
    if (at->iterations >= PATIENCE) at->share = at->missed < last || at->onwards ? fmin(2.0 * at->share, 1.0) : fmax(at->share / 2.0, LEAST);
    return holds;
}

/* Status of a round, ON where another one is needed. */
static unsigned one_round(cfem_rounds *at) {
    int grown, settled = 1;
    unsigned status = SOFT(cfem_soft_touch(at), 0);
    if (!status) status = choose(at, &grown);
    if (status) return status;
    if (!at->solid && !at->pairs) return SOFT(cfem_soft_let_go(at), CFEM_TOUCH_CONVERGED);
    if (grown) {
        status = cfem_rounds_know(at);
        if (status) return status;
        for (int r = 0; r < at->solid; r++) look(at, at->robot[r], at->now[at->robot[r]].patch[at->slot[r]], HUGE_VAL); /* moved by those beside */
    }
#if CFEM_TOUCH_SOFT
    if (grown) status = cfem_soft_go_on(at, &settled);
    if (!status && settled) status = cfem_soft_hold(at);
    if (status || !settled) return status ? status : ON;
#endif
    for (int b = 0; b < ROBOTS; b++) cfem_touch_yield(at->now[b].count, at->now[b].patch, &at->room[b]);
    if (cfem_rounds_obey(at)) return at->systems > 0 ? CFEM_TOUCH_NO_STATE : CFEM_TOUCH_ITERATIONS;
    name_modes(at);
    const double nearest = move(at);
#if CFEM_TOUCH_SOFT
    status = cfem_soft_settle(at, &settled);
    if (status) return status;
#endif
    return ends(at, nearest, settled) ? CFEM_TOUCH_CONVERGED : ON;
}

/* Friction holds patch i where it is; one that sticks where it was, on the surface. */
static void hold(cfem_touched *now, int i) {
    const double *const n = now->normal[i], *const x = now->place[now->patch[i]];
    double *const stuck = now->stuck[now->patch[i]], away = 0.0;
    for (int a = 0; a < 3; a++) away += n[a] * (x[a] - stuck[a]);
    for (int a = 0; a < 3; a++) stuck[a] = now->mode[i] == CFEM_TOUCH_STICK ? stuck[a] + away * n[a] : x[a];
}

/* Where friction holds patches from here on, and which are known to the next step; what is open and not within an obstacle is left out. */
static void finish(cfem_rounds *at) {
    SOFT(cfem_soft_finish(at), (void)0);
    for (int b = 0, r = 0; b < ROBOTS; b++) {
        cfem_touched *const one = &at->now[b];
        int kept = 0;
        one->near_count = 0;
        memset(one->holds, 0, sizeof one->holds);
        for (int i = 0; i < one->count; i++) {
            const int p = one->patch[i], near = r < at->solid && at->robot[r] == b && at->slot[r] == i;
            const int pressed = near && presses(PUSH(one)[i]), touches = pressed || (near && at->room[b].distance[p] <= 0.0);
            r += near;
            one->holds[p] = near && at->mu > 0.0 && (one->mode[i] == CFEM_TOUCH_STICK || pressed);
            if (one->holds[p]) hold(one, i);
            if (SOFT(cfem_soft_near(at, b, p) || presses(one->force[i]), pressed || at->room[b].distance[p] < NEAR * CFEM_PATCH_LENGTH))
                one->near[one->near_count++] = p;
            if (SOFT(0, !touches)) continue;
            one->patch[kept] = p, one->mode[kept] = one->mode[i], one->obstacle[kept] = touches ? at->room[b].which[p] : -1;
            one->gap[kept] = at->room[b].distance[p];
            for (int a = 0; a < 3; a++) one->force[kept][a] = one->force[i][a], one->normal[kept][a] = one->normal[i][a];
            kept++;
        }
        one->count = kept;
        cfem_touch_loaded(one, &at->room[b]);
    }
}

static int is_rotation(const double (*R)[3]) {
    const double *const x = R[0], *const y = R[1];
    const double z[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
    int is = fabs(cfem_dot(3, x, x) - 1.0) <= SKEW && fabs(cfem_dot(3, y, y) - 1.0) <= SKEW && fabs(cfem_dot(3, x, y)) <= SKEW;
    for (int a = 0; a < 3; a++) is &= fabs(R[2][a] - z[a]) <= SKEW;
    return is;
}

static int sensible(const cfem_rounds *at, const double *delta_a) {
    double sum = at->mu;
    int bodies = 1;
    for (int i = 0; i < ROBOTS * NA; i++) sum += delta_a[i];
    for (int b = 0; b < ROBOTS && SOFT(1, 0); b++) {
        sum += at->placed[b].t[0] + at->placed[b].t[1] + at->placed[b].t[2];
        bodies &= is_rotation(at->placed[b].R);
    }
    for (int o = 0; o < at->obstacle_count; o++) {
        const cfem_obstacle *const obstacle = &at->obstacles[o];
        sum += obstacle->rounding;
        for (int a = 0; a < 3; a++) sum += obstacle->t[a], bodies &= obstacle->core[a] >= 0.0;
        bodies &= is_rotation(obstacle->R) && obstacle->rounding >= 0.0;
    }
    return cfem_finite(sum) && bodies && at->mu >= 0.0;
}

unsigned cfem_rounds_run(cfem_rounds *at, const double *delta_a) {
    at->iterations = at->solid = at->pairs = 0, at->onwards = 0, at->moved = at->missed = HUGE_VAL, at->share = 1.0;
    for (int b = 0; b < ROBOTS; b++) at->now[b].count = 0;
    unsigned status = sensible(at, delta_a) ? begin(at, delta_a) : CFEM_TOUCH_BAD_INPUT;
    if (status) return status;
    for (status = ON; status == ON && at->iterations < ITERATIONS; at->iterations++) status = one_round(at);
    if (status == ON) status = CFEM_TOUCH_ITERATIONS;
    if (status == CFEM_TOUCH_MANY || status == CFEM_TOUCH_NO_MODEL) {
        at->solid = at->pairs = 0;
        for (int b = 0; b < ROBOTS; b++) at->now[b].count = 0;
    }
    finish(at);
    return status;
}

static unsigned held(void *with, const double *delta_a, double *lambda_a) {
    cfem_rounds *const at = with;
    const unsigned status = cfem_rounds_run(at, delta_a);
    for (int i = 0; i < ROBOTS * NA; i++) lambda_a[i] = at->now[i / NA].lambda_a[i % NA];
    return status;
}

unsigned cfem_rounds_slack(cfem_rounds *at, const double *delta_a) {
    double place[ROBOTS * NA] = {0.0};
    unsigned char unilateral[ROBOTS * NA], slack[ROBOTS * NA] = {0};
    for (int i = 0; i < ROBOTS * NA; i++) {
        unilateral[i] = at->placed[i / NA].unilateral[i % NA];
        if (!at->before) continue;
        place[i] = at->before[i / NA].delta_a[i % NA], slack[i] = unilateral[i] && at->before[i / NA].lambda_a[i % NA] == 0.0;
    }
    const unsigned status = cfem_slack(ROBOTS * NA, delta_a, unilateral, held, at, place, slack);
    for (int i = 0; i < ROBOTS * NA; i++)
        if (slack[i]) at->now[i / NA].lambda_a[i % NA] = 0.0;
    return status;
}
