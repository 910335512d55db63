/* Rounds: the law of contact, linear about where the patches are; where its forces bring them; until it holds there too. The same
 * as cfem.predict.contact.scene. */
#include "cfem_touch_round.h"

#include "cfem_linear.h"
#include "cfem_slack.h"

#define N CFEM_PATCHES
#define MOST CFEM_TOUCH_MOST

enum { ITERATIONS = 60 };
static const double TOLERANCE = 1e-9, OVERLAP = 1e-6, NEAR = 0.005, FAR = 0.1; /* of the length */
static const double SIDE = 0.7; /* product of normals: less is another side of an obstacle */

/* Distance of patch p, and which obstacle is nearest; `within` where none is nearer. */
static void look(cfem_touch_round *at, int p, double within) {
    cfem_touch_room *const room = at->room;
    const double *const x = at->now->place[p];
    room->distance[p] = cfem_patch_held[p] ? HUGE_VAL : within, room->which[p] = 0;
    for (int o = 0; o < at->obstacle_count && !cfem_patch_held[p]; o++) { /* what is held still touches nothing */
        const cfem_obstacle *const one = &at->obstacles[o];
        const double apart[3] = {x[0] - one->t[0], x[1] - one->t[1], x[2] - one->t[2]};
        /* so far from its centre it cannot be nearer than what is known */
        const double beyond = room->distance[p] + one->core[0] + one->core[1] + one->core[2] + one->rounding;
        if (beyond <= 0.0 || cfem_dot(3, apart, apart) >= beyond * beyond) continue;
        const double distance = cfem_obstacle_distance(one, x);
        if (distance < room->distance[p]) room->distance[p] = distance, room->which[p] = o;
    }
}

/* Whether patch p is so far within an obstacle that twice as far in another side of it is nearer. */
static int deep(const cfem_touch_round *at, int p) {
    const double distance = at->room->distance[p], *const x = at->now->place[p];
    const cfem_obstacle *const one = &at->obstacles[at->room->which[p]];
    double here[3][3], there[3][3], deeper[3];
    if (!(distance < 0.0)) return 0;
    cfem_obstacle_frame(one, x, here);
    for (int a = 0; a < 3; a++) deeper[a] = x[a] + distance * here[0][a];
    cfem_obstacle_frame(one, deeper, there);
    return cfem_dot(3, here[0], there[0]) < SIDE;
}

static int touches(const cfem_touched *now, int i) {
    return now->force[i][0] != 0.0 || now->force[i][1] != 0.0 || now->force[i][2] != 0.0;
}

/* The patches of the state bear its forces. 0, or 1 where their compliance is not finite. */
static int bear(cfem_touch_round *at) {
    cfem_touched *const now = at->now;
    if (cfem_touch_compliance(now->count, now->patch, at->room)) return 1;
    cfem_touch_bear(now->count, now->patch, now->force, at->room);
    cfem_touch_places(now->count, now->patch, now->force, at->room, now->place);
    return 0;
}

/* The patches of this round: those that are within an obstacle or were chosen before, as only of the chosen places are quite known;
 * in ascending order. 0, or a status. */
static unsigned choose(cfem_touch_round *at) {
    cfem_touched *const now = at->now;
    int patch[MOST], count = 0;
    const int last = now->count;
    double force[MOST][3];
    for (int p = 0, i = 0; p < N; p++) {
        const int known = i < now->count && now->patch[i] == p;
        if (at->room->distance[p] <= 0.0 || known) {
            if (count == MOST) return CFEM_TOUCH_MANY;
            patch[count] = p;
            for (int a = 0; a < 3; a++) force[count][a] = known ? now->force[i][a] : 0.0;
            count++;
        }
        i += known;
    }
    now->count = count;
    for (int i = 0; i < count; i++) {
        now->patch[i] = patch[i], now->mode[i] = CFEM_TOUCH_OPEN;
        for (int a = 0; a < 3; a++) now->force[i][a] = force[i][a];
    }
    if (count == last) return 0;
    if (bear(at)) return CFEM_TOUCH_NO_MODEL;
    for (int i = 0; i < count; i++) look(at, patch[i], HUGE_VAL); /* moved by those beside them */
    return 0;
}

static void name_modes(cfem_touch_round *at) {
    for (int p = 0; p < N; p++) at->stuck_before[p] = 0;
    for (int i = 0; i < at->now->count; i++) {
        const double *const f = at->local[i], friction = sqrt(f[1] * f[1] + f[2] * f[2]);
        const int slips = friction >= at->mu * f[0] * (1.0 - 1e-9);
        at->now->mode[i] = !(f[0] > 0.0) ? CFEM_TOUCH_OPEN : slips ? CFEM_TOUCH_SLIP : CFEM_TOUCH_STICK;
        at->stuck_before[at->now->patch[i]] = at->now->mode[i] == CFEM_TOUCH_STICK;
    }
}

/* To where the forces bring the patches; mm that the nearest is from an obstacle then. */
static double move(cfem_touch_round *at, double (*before)[3]) {
    cfem_touched *const now = at->now;
    cfem_touch_room *const room = at->room;
    double farthest = 0.0, nearest = HUGE_VAL;
    for (int i = 0; i < 3 * N; i++) before[i / 3][i % 3] = now->place[i / 3][i % 3];
    cfem_touch_bear(now->count, now->patch, now->force, room);
    cfem_touch_places(now->count, now->patch, now->force, room, now->place);
    for (int i = 0; i < 3 * N; i++) {
        const double moved = fabs(now->place[i / 3][i % 3] - before[i / 3][i % 3]);
        if (moved > farthest) farthest = moved;
    }
    for (int p = 0, i = 0; p < N; p++) {
        const int known = i < now->count && now->patch[i] == p;
        room->distance[p] -= 2.0 * farthest; /* more than the root of 3: those that cannot have come near keep what is certain */
        if (known || room->distance[p] <= 0.0) look(at, p, HUGE_VAL);
        if (room->distance[p] < nearest) nearest = room->distance[p];
        i += known;
    }
    return nearest;
}

/* Patch i where it is now: there (3,) N, its force there, which turns with the surface unless it sticks. Whether the law holds;
 * largest: of all forces. */
static int obeys(cfem_touch_round *at, int i, double largest, double *there) {
    cfem_touched *const now = at->now;
    const int p = now->patch[i], sticks = now->mode[i] == CFEM_TOUCH_STICK, n = 3 * now->count;
    double frame[3][3], local[3], slip[3], gap[3] = {at->room->distance[p], 0.0, 0.0}, yields = 0.0;
    cfem_obstacle_frame(&at->obstacles[at->room->which[p]], now->place[p], frame);
    for (int a = 0; a < 3; a++) {
        const double own = at->room->total[(3 * i + a) * (n + 1)];
        there[a] = frame[0][a] * at->local[i][0] + frame[1][a] * at->local[i][1] + frame[2][a] * at->local[i][2];
        if (sticks) there[a] = now->force[i][a];
        local[a] = sticks ? cfem_dot(3, frame[a], now->force[i]) : at->local[i][a];
        slip[a] = now->place[p][a] - now->stuck[p][a], now->normal[i][a] = frame[0][a];
        if (own > yields) yields = own;
    }
    for (int a = 1; a < 3 && at->mu > 0.0; a++) gap[a] = cfem_dot(3, frame[a], slip);
    return cfem_law_violation(at->mu, local, gap, yields) <= TOLERANCE * CFEM_PATCH_LENGTH &&
           sqrt(local[1] * local[1] + local[2] * local[2]) - at->mu * local[0] <= TOLERANCE * largest;
}

/* To where the forces bring the patches. 1 where the law holds there too, with the frames there, in which the forces are then. */
static int settled(cfem_touch_round *at, double (*before)[3]) {
    cfem_touched *const now = at->now;
    const int n = 3 * now->count;
    double there[MOST][3], change[CFEM_TOUCH_ROWS], largest = 0.0;
    int lawful, turned = 0;
    name_modes(at);
    lawful = move(at, before) >= -OVERLAP * CFEM_PATCH_LENGTH;
    for (int i = 0; i < n; i++)
        if (fabs(now->force[i / 3][i % 3]) > largest) largest = fabs(now->force[i / 3][i % 3]);
    for (int i = 0; i < now->count; i++) lawful &= obeys(at, i, largest, there[i]);
    for (int i = 0; i < n; i++) change[i] = there[i / 3][i % 3] - now->force[i / 3][i % 3];
    for (int i = 0; i < n && lawful; i++)
        lawful = fabs(cfem_dot(n, at->room->total + i * n, change)) <= TOLERANCE * CFEM_PATCH_LENGTH;
    if (!lawful) return 0;
    for (int i = 0; i < n; i++) {
        turned |= now->force[i / 3][i % 3] != there[i / 3][i % 3];
        now->force[i / 3][i % 3] = there[i / 3][i % 3];
    }
    if (turned) cfem_touch_bear(now->count, now->patch, now->force, at->room);
    return 1;
}

static unsigned rounds(cfem_touch_round *at) {
    cfem_touched *const now = at->now;
    double before[N][3];
    for (now->iterations = 1; now->iterations <= ITERATIONS; now->iterations++) {
        const unsigned status = choose(at);
        if (status) return status;
        if (!now->count) return CFEM_TOUCH_CONVERGED;
        cfem_touch_yield(now->count, now->patch, at->room);
        if (cfem_touch_obey(at)) return CFEM_TOUCH_NO_STATE;
        if (settled(at, before)) return CFEM_TOUCH_CONVERGED;
    }
    now->iterations = ITERATIONS;
    return CFEM_TOUCH_ITERATIONS;
}

/* Friction holds patch i where it is; one that sticks where it was, on the surface. */
static void hold(cfem_touched *now, int i) {
    const double *const n = now->normal[i], *const x = now->place[now->patch[i]];
    double *const stuck = now->stuck[now->patch[i]], away = 0.0;
    for (int a = 0; a < 3; a++) away += n[a] * (x[a] - stuck[a]);
    for (int a = 0; a < 3; a++) stuck[a] = now->mode[i] == CFEM_TOUCH_STICK ? stuck[a] + away * n[a] : x[a];
}

/* Where friction holds patches from here on; what is open and not within an obstacle is left out. */
static void finish(cfem_touch_round *at) {
    cfem_touched *const now = at->now;
    unsigned char holds[N] = {0};
    int kept = 0;
    now->near_count = 0;
    for (int i = 0; i < now->count; i++) {
        const int p = now->patch[i], pressed = touches(now, i);
        holds[p] = at->mu > 0.0 && (now->mode[i] == CFEM_TOUCH_STICK || pressed);
        if (holds[p]) hold(now, i);
        if (pressed || at->room->distance[p] < NEAR * CFEM_PATCH_LENGTH) now->near[now->near_count++] = p;
        if (!pressed && at->room->distance[p] > 0.0) continue;
        now->patch[kept] = p, now->mode[kept] = now->mode[i], now->obstacle[kept] = at->room->which[p];
        now->gap[kept] = at->room->distance[p];
        for (int a = 0; a < 3; a++) now->force[kept][a] = now->force[i][a], now->normal[kept][a] = now->normal[i][a];
        kept++;
    }
    now->count = kept;
    for (int p = 0; p < N; p++) now->holds[p] = holds[p];
}

static int sensible(const double *delta_a, const cfem_obstacle *obstacles, int count, double mu) {
    double sum = mu;
    for (int i = 0; i < CFEM_NA; i++) sum += delta_a[i];
    for (int o = 0; o < count; o++) {
        sum += obstacles[o].rounding;
        for (int a = 0; a < 3; a++) {
            sum += obstacles[o].t[a];
            for (int b = 0; b < 3; b++) sum += obstacles[o].R[a][b];
        }
    }
    return cfem_finite(sum) && mu >= 0.0;
}

unsigned cfem_touch(const double delta_a[CFEM_NA], const cfem_obstacle *obstacles, int count, double mu,
                    const cfem_touched *before, cfem_touched *now, cfem_touch_room *room) {
    cfem_touch_round at = {obstacles, count, mu, now, room, {0}, {{{0.0}}}, {{0.0}}};
    now->count = now->iterations = 0;
    if (!sensible(delta_a, obstacles, count, mu)) return now->status = CFEM_TOUCH_BAD_INPUT;
    now->status = cfem_touch_hold(delta_a, now, room);
    if (now->status) return now->status;
    for (int p = 0; p < N; p++) { /* what did not touch slides from where it was */
        const double *const from = !before ? room->free[p] : before->holds[p] ? before->stuck[p] : before->place[p];
        for (int a = 0; a < 3; a++) now->stuck[p][a] = from[a];
    }
    now->count = before && count ? before->near_count : 0; /* without obstacles there is nothing to hold on to */
    for (int i = 0, j = 0; i < now->count; i++) { /* all that bears is near, in the same order */
        const int p = now->patch[i] = before->near[i], bears = j < before->count && before->patch[j] == p;
        for (int a = 0; a < 3; a++) now->force[i][a] = bears ? before->force[j][a] : 0.0;
        at.stuck_before[p] = bears && mu > 0.0 && before->mode[j] == CFEM_TOUCH_STICK;
        j += bears;
    }
    if (bear(&at)) return now->status = CFEM_TOUCH_NO_MODEL;
    for (int p = 0; p < N; p++) look(&at, p, FAR * CFEM_PATCH_LENGTH), now->deep |= deep(&at, p);
    now->deep |= before && before->near_count && before->deep; /* it may still be on the wrong side */
    now->status = rounds(&at);
    if (now->status == CFEM_TOUCH_MANY || now->status == CFEM_TOUCH_NO_MODEL) now->count = 0;
    finish(&at);
    cfem_touch_loaded(now, room);
    return now->status;
}

typedef struct {
    const cfem_obstacle *obstacles;
    int count;
    double mu;
    const cfem_touched *before;
    cfem_touched *now;
    cfem_touch_room *room;
} held_touch;

static unsigned held(void *with, const double *delta_a, double *lambda_a) {
    const held_touch *const of = with;
    const unsigned status = cfem_touch(delta_a, of->obstacles, of->count, of->mu, of->before, of->now, of->room);
    for (int i = 0; i < CFEM_NA; i++) lambda_a[i] = of->now->lambda_a[i];
    return status;
}

unsigned cfem_touch_slack(const double delta_a[CFEM_NA], const cfem_obstacle *obstacles, int count, double mu,
                          const cfem_touched *before, cfem_touched *now, cfem_touch_room *room) {
    held_touch with = {obstacles, count, mu, before, now, room};
    double at[CFEM_NA] = {0.0};
    unsigned char slack[CFEM_NA] = {0};
    for (int i = 0; i < CFEM_NA && before; i++)
        slack[i] = cfem_patch_unilateral[i] && before->lambda_a[i] == 0.0, at[i] = before->delta_a[i];
    now->status = cfem_slack(CFEM_NA, delta_a, cfem_patch_unilateral, held, &with, at, slack);
    for (int i = 0; i < CFEM_NA; i++)
        if (slack[i]) now->lambda_a[i] = 0.0;
    return now->status;
}

double cfem_touch_pressed(const cfem_touched *state, int number) {
    double sum = 0.0;
    for (int i = 0; i < state->count; i++)
        if (state->obstacle[i] == number) sum += cfem_dot(3, state->force[i], state->normal[i]);
    return sum;
}
