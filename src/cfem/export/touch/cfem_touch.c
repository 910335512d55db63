/* Rounds: the law of contact, linear about where the patches are; where its forces bring them; until it holds there too. The same
 * as cfem.predict.touching. */
#include "cfem_touch.h"

#include "cfem_linear.h"

#define N CFEM_PATCHES
#define MOST CFEM_TOUCH_MOST

enum { ITERATIONS = 60, TRUSTING = 3 };
static const double TOLERANCE = 1e-9, OVERLAP = 1e-6; /* of the length */

typedef struct {
    const cfem_obstacle *obstacles;
    int obstacle_count;
    double mu;
    cfem_touched *now;
    cfem_touch_room *room;
    int stuck_before[N]; /* whether friction held it in the last round */
    double frame[MOST][3][3], local[MOST][3], straight[MOST][3];
} step;

/* Distance of patch p, and which obstacle is nearest. */
static void look(step *at, int p) {
    cfem_touch_room *const room = at->room;
    room->distance[p] = HUGE_VAL, room->which[p] = 0;
    for (int o = 0; o < at->obstacle_count && !cfem_patch_held[p]; o++) { /* what is held still touches nothing */
        const double distance = cfem_obstacle_distance(&at->obstacles[o], at->now->place[p]);
        if (distance < room->distance[p]) room->distance[p] = distance, room->which[p] = o;
    }
}

static int touches(const cfem_touched *now, int i) {
    return now->force[i][0] != 0.0 || now->force[i][1] != 0.0 || now->force[i][2] != 0.0;
}

/* The patches of this round: those that are within an obstacle or were chosen before, as only of the chosen places are quite known;
 * in ascending order. 0, or 1 for too many. */
static int choose(step *at) {
    cfem_touched *const now = at->now;
    int patch[MOST], count = 0;
    double force[MOST][3];
    for (int p = 0, i = 0; p < N; p++) {
        const int known = i < now->count && now->patch[i] == p;
        if (at->room->distance[p] <= 0.0 || known) {
            if (count == MOST) return 1;
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
    return 0;
}

static double in_frame(double frame[3][3], int row, const double *x) { return cfem_dot(3, frame[row], x); }

/* Compliance C (n, n) in the frames, symmetric, into W; gap (n,) in, without forces out; then the law from `local`. */
static int law(step *at, const double *C, const double *gap) {
    const int m = at->now->count, n = 3 * m;
    double *const W = at->room->W, free[CFEM_TOUCH_ROWS] = {0.0}, found[CFEM_TOUCH_ROWS];
    for (int i = 0; i < m; i++)
        for (int j = i; j < m; j++) {
            double half[3][3], block[3][3], other[3][3];
            for (int turn = 0; turn < 2; turn++) { /* N_i C_ij N_j^T, and N_j C_ji N_i^T, where they differ by rounding */
                const int p = turn ? j : i, q = turn ? i : j;
                for (int a = 0; a < 3; a++)
                    for (int b = 0; b < 3; b++) {
                        half[a][b] = 0.0;
                        for (int c = 0; c < 3; c++) half[a][b] += at->frame[p][a][c] * C[(3 * p + c) * n + 3 * q + b];
                    }
                for (int a = 0; a < 3; a++)
                    for (int b = 0; b < 3; b++) (turn ? other : block)[a][b] = in_frame(at->frame[q], b, half[a]);
            }
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++)
                    W[(3 * i + a) * n + 3 * j + b] = W[(3 * j + b) * n + 3 * i + a] = (block[a][b] + other[b][a]) / 2.0;
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
    double *const A = room->W;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < m; j++)
            for (int b = 0; b < 3; b++) {
                double sum = i == 3 * j + b ? 1.0 : 0.0;
                for (int c = 0; c < 3; c++) sum -= room->yields[i * n + 3 * j + c] * room->bend[j][c][b];
                A[i * n + 3 * j + b] = sum;
            }
    for (int i = 0; i < n * n; i++) room->turned[i] = room->yields[i];
    if (cfem_solve(n, A, n, room->turned)) return 1;
    for (int i = 0; i < n; i++)
        for (int j = 0; j <= i; j++) A[i * n + j] = (room->turned[i * n + j] + room->turned[j * n + i]) / 2.0;
    return !cfem_definite(n, A);
}

/* The forces that obey the law, linear about the places of the patches: `local` in the frames there, `straight` on, and turned with
 * curved obstacles as the state's. 0, or 1. */
static int obey(step *at) {
    cfem_touched *const now = at->now;
    cfem_touch_room *const room = at->room;
    const int m = now->count, n = 3 * m;
    double gap[CFEM_TOUCH_ROWS], known[MOST][3], change[CFEM_TOUCH_ROWS], moved[CFEM_TOUCH_ROWS];
    int turns = 0;
    for (int i = 0; i < m; i++) {
        const int p = now->patch[i];
        const cfem_obstacle *const o = &at->obstacles[room->which[p]];
        double slip[3] = {0.0};
        cfem_obstacle_frame(o, now->place[p], at->frame[i]);
        if (at->mu > 0.0 && now->holds[p])
            for (int a = 0; a < 3; a++) slip[a] = now->place[p][a] - now->stuck[p][a];
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
        if (law(at, room->yields, gap)) return 1;
    }
    for (int i = 0; i < m; i++)
        for (int a = 0; a < 3; a++) {
            at->straight[i][a] = 0.0;
            for (int b = 0; b < 3; b++) at->straight[i][a] += at->local[i][b] * at->frame[i][b][a];
            change[3 * i + a] = at->straight[i][a] - now->force[i][a];
        }
    for (int i = 0; i < n; i++) moved[i] = turns ? cfem_dot(n, room->turned + i * n, change) : 0.0;
    for (int i = 0; i < m; i++)
        for (int a = 0; a < 3; a++)
            now->force[i][a] = at->straight[i][a] + (turns ? cfem_dot(3, room->bend[i][a], moved + 3 * i) : 0.0);
    return 0;
}

static void name_modes(step *at) {
    for (int p = 0; p < N; p++) at->stuck_before[p] = 0;
    for (int i = 0; i < at->now->count; i++) {
        const double *const f = at->local[i], friction = sqrt(f[1] * f[1] + f[2] * f[2]);
        const int slips = friction >= at->mu * f[0] * (1.0 - 1e-9);
        at->now->mode[i] = !(f[0] > 0.0) ? CFEM_TOUCH_OPEN : slips ? CFEM_TOUCH_SLIP : CFEM_TOUCH_STICK;
        at->stuck_before[at->now->patch[i]] = at->now->mode[i] == CFEM_TOUCH_STICK;
    }
}

/* To where the forces bring the patches. 1 where the law holds there too, with the frames there, in which the forces are then. */
static int settled(step *at, double (*before)[3]) {
    cfem_touched *const now = at->now;
    cfem_touch_room *const room = at->room;
    const int m = now->count, n = 3 * m;
    double farthest = 0.0, there[MOST][3], change[CFEM_TOUCH_ROWS], nearest = HUGE_VAL, beyond = -HUGE_VAL, largest = 0.0;
    name_modes(at);
    for (int i = 0; i < 3 * N; i++) before[i / 3][i % 3] = now->place[i / 3][i % 3];
    if (now->iterations <= TRUSTING) cfem_touch_trust(m, now->patch, now->force, room);
    cfem_touch_places(m, now->patch, now->force, room, now->place);
    for (int i = 0; i < 3 * N; i++) {
        const double moved = fabs(now->place[i / 3][i % 3] - before[i / 3][i % 3]);
        if (moved > farthest) farthest = moved;
    }
    for (int i = 0; i < m && at->mu > 0.0; i++) { /* a patch that touches for the first time sticks where it came */
        const int p = now->patch[i];
        if (now->holds[p]) continue;
        now->holds[p] = 1;
        for (int a = 0; a < 3; a++) now->stuck[p][a] = now->place[p][a];
    }
    for (int p = 0, i = 0; p < N; p++) {
        const int known = i < m && now->patch[i] == p;
        room->distance[p] -= 2.0 * farthest; /* more than the root of 3: those that cannot have come near keep what is certain */
        if (known || room->distance[p] <= 0.0) look(at, p);
        if (room->distance[p] < nearest) nearest = room->distance[p];
        i += known;
    }
    for (int i = 0; i < m; i++) {
        const int p = now->patch[i], sticks = now->mode[i] == CFEM_TOUCH_STICK;
        double frame[3][3];
        cfem_obstacle_frame(&at->obstacles[room->which[p]], now->place[p], frame);
        for (int a = 0; a < 3; a++) {
            there[i][a] = 0.0;
            for (int b = 0; b < 3; b++) there[i][a] += at->local[i][b] * frame[b][a];
            if (sticks) there[i][a] = now->force[i][a];
            change[3 * i + a] = there[i][a] - (at->mu > 0.0 ? at->straight : now->force)[i][a];
            if (fabs(now->force[i][a]) > largest) largest = fabs(now->force[i][a]);
        }
        if (sticks) {
            double f[3];
            for (int a = 0; a < 3; a++) f[a] = in_frame(frame, a, now->force[i]);
            const double over = sqrt(f[1] * f[1] + f[2] * f[2]) - at->mu * f[0];
            if (over > beyond) beyond = over;
        }
        for (int a = 0; a < 3; a++) now->normal[i][a] = frame[0][a];
    }
    if (!(nearest >= -OVERLAP * CFEM_PATCH_LENGTH) || beyond > TOLERANCE * largest) return 0;
    for (int i = 0; i < n; i++) {
        const double gap = i % 3 == 0 && at->local[i / 3][0] > 0.0 ? fabs(room->distance[now->patch[i / 3]]) : 0.0;
        if (!(fabs(cfem_dot(n, room->total + i * n, change)) <= TOLERANCE * CFEM_PATCH_LENGTH) ||
            !(gap <= TOLERANCE * CFEM_PATCH_LENGTH))
            return 0;
    }
    for (int i = 0; i < n; i++) now->force[i / 3][i % 3] = there[i / 3][i % 3];
    return 1;
}

static unsigned rounds(step *at) {
    cfem_touched *const now = at->now;
    double before[N][3];
    for (now->iterations = 1; now->iterations <= ITERATIONS; now->iterations++) {
        if (choose(at)) return CFEM_TOUCH_MANY;
        if (!now->count) return CFEM_TOUCH_CONVERGED;
        if (cfem_touch_compliance(now->count, now->patch, at->room)) return CFEM_TOUCH_NO_MODEL;
        cfem_touch_bent(now->count, now->patch, now->force, at->room);
        if (obey(at)) return CFEM_TOUCH_NO_STATE;
        if (settled(at, before)) return CFEM_TOUCH_CONVERGED;
    }
    now->iterations = ITERATIONS;
    return CFEM_TOUCH_ITERATIONS;
}

/* Where friction holds patches from here on; what is open and not within an obstacle is left out. */
static void finish(step *at) {
    cfem_touched *const now = at->now;
    unsigned char holds[N] = {0};
    int kept = 0;
    for (int i = 0; i < now->count; i++) {
        const int p = now->patch[i], pressed = touches(now, i), sticks = now->mode[i] == CFEM_TOUCH_STICK;
        holds[p] = at->mu > 0.0 && (sticks || pressed);
        for (int a = 0; a < 3 && holds[p] && !sticks; a++) now->stuck[p][a] = now->place[p][a];
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
    step at = {obstacles, count, mu, now, room, {0}, {{{0.0}}}, {{0.0}}, {{0.0}}};
    now->count = now->iterations = 0;
    if (!sensible(delta_a, obstacles, count, mu)) return now->status = CFEM_TOUCH_BAD_INPUT;
    now->status = cfem_touch_hold(delta_a, now, room);
    if (now->status) return now->status;
    for (int p = 0; p < N; p++) {
        now->holds[p] = before && mu > 0.0; /* what did not touch slides from where it was */
        for (int a = 0; a < 3 && before; a++) now->stuck[p][a] = (before->holds[p] ? before->stuck : before->place)[p][a];
    }
    now->count = before && count ? before->count : 0; /* without obstacles there is nothing to hold on to */
    for (int i = 0; i < now->count; i++) {
        now->patch[i] = before->patch[i];
        for (int a = 0; a < 3; a++) now->force[i][a] = before->force[i][a];
        at.stuck_before[before->patch[i]] = mu > 0.0 && before->mode[i] == CFEM_TOUCH_STICK;
    }
    if (now->count && cfem_touch_compliance(now->count, now->patch, room)) return now->status = CFEM_TOUCH_NO_MODEL;
    cfem_touch_trust(now->count, now->patch, now->force, room);
    cfem_touch_places(now->count, now->patch, now->force, room, now->place);
    for (int p = 0; p < N; p++) look(&at, p);
    now->status = rounds(&at);
    if (now->status == CFEM_TOUCH_MANY || now->status == CFEM_TOUCH_NO_MODEL) now->count = 0;
    finish(&at);
    cfem_touch_loaded(now, room);
    return now->status;
}

double cfem_touch_pressed(const cfem_touched *state, int number) {
    double sum = 0.0;
    for (int i = 0; i < state->count; i++)
        if (state->obstacle[i] == number) sum += cfem_dot(3, state->force[i], state->normal[i]);
    return sum;
}
