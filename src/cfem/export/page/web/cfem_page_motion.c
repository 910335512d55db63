/* The robot in motion, for a page: two of them run after goals that move, one under the static inverse, one under predictive control. */
#include <string.h>

#include "cfem_mpc.h"
#include "cfem_page.h"

#define NA CFEM_NA
#define NE CFEM_NE
#define SUBSTEPS 4

CFEM_MOTION_COUNTS(DEFINE_COUNT)
CFEM_MOTION_INTEGERS(DEFINE_INTEGERS)
CFEM_MOTION_VECTORS(DEFINE_VECTOR)
CFEM_MOTION_MATRICES(DEFINE_MATRIX)
const uint8_t *cfem_motion_first_degrees, *cfem_motion_second_degrees;
cfem_motion_series cfem_motion_root[1], cfem_motion_inner[1], cfem_motion_curve[1], cfem_motion_loss[CFEM_MOTION_MOST_LOSSES];

enum { STATIC, PREDICTIVE, BOTH };

static cfem_mpc predictive;
static cfem_controller inverse;
static cfem_moving robot[BOTH];
static int lost[BOTH]; /* has left what its model knows, and moves no more */

/* What the page reads and writes; the order is that of motion.js. */
static struct {
    double ahead[CFEM_MPC_MOST_TICKS][CFEM_MOST_NE]; /* mm, absolute: goals at the ends of the next ticks */
    double x_e[BOTH][CFEM_MOST_NE];                  /* mm, absolute: where the robots are */
    double u[BOTH][CFEM_MOST_NA];                    /* their commands */
} shared;

double *SERVED(motion_io)(void) { return shared.ahead[0]; }

/* Of `outputs`, with products that there are. */
static void read_series(reader *r, cfem_motion_series *to, int outputs) {
    const int32_t *head = take(r, 2 * sizeof *head);
    if (!r->good) return;
    to->groups = head[0], to->terms = head[1];
    between(r, 1, to->terms, 65535), between(r, 1, to->groups, to->terms);
    if (!r->good) return;
    to->first = take(r, (size_t)to->groups * sizeof *to->first), to->end = take(r, (size_t)to->groups * sizeof *to->end);
    to->second = take(r, (size_t)to->terms * sizeof *to->second);
    const int blocks = (outputs + CFEM_SERIES_WIDE - 1) / CFEM_SERIES_WIDE;
    to->coefficients = take(r, (size_t)(blocks * to->terms * CFEM_SERIES_WIDE) * sizeof(double));
    for (int g = 0, last = 0; r->good && g < to->groups; last = to->end[g++])
        between(r, 0, to->first[g], CFEM_MOTION_FIRST_PRODUCTS - 1), between(r, last, to->end[g], to->terms);
    for (int m = 0; r->good && m < to->terms; m++) between(r, 0, to->second[m], CFEM_MOTION_SECOND_PRODUCTS - 1);
}

/* (count, across) degrees. */
static const uint8_t *degrees(reader *r, int count, int across) {
    const uint8_t *found = take(r, (size_t)(count * across));
    for (int i = 0; r->good && i < count * across; i++) between(r, 0, found[i], CFEM_MOTION_DEGREE);
    return found;
}

/* 0, or 1 where the block is not of a robot that this code has room for. It is not copied: it has to stay. */
int SERVED(motion_load)(const unsigned char *block, int size) {
    reader r = {block, block + size, 1};
    const int32_t *head = take(&r, (CFEM_MOTION_COUNTS(ONE)) * sizeof *head);
    if (!r.good) return 1;
    CFEM_MOTION_COUNTS(READ_COUNT)
    between(&r, NA, CFEM_MOTION_NQ, CFEM_MOTION_MOST_NQ), between(&r, 1, CFEM_MPC_EVERY, CFEM_MPC_TICKS);
    if (!r.good) return 1;
    CFEM_MOTION_INTEGERS(READ_INTEGERS)
    for (int i = 0, sum = 0; r.good && i < CFEM_MOTION_LOSSES; i++) sum += cfem_motion_prony_terms[i], between(&r, 0, sum, CFEM_MOTION_TERMS);
    CFEM_MOTION_VECTORS(READ_VECTOR)
    CFEM_MOTION_MATRICES(READ_MATRIX)
    cfem_motion_first_degrees = degrees(&r, CFEM_MOTION_FIRST_PRODUCTS, CFEM_SERIES_FIRST);
    cfem_motion_second_degrees = degrees(&r, CFEM_MOTION_SECOND_PRODUCTS, CFEM_SERIES_SECOND);
    const int triangle = CFEM_MOTION_NQ * (CFEM_MOTION_NQ + 1) / 2, inner = CFEM_MOTION_NQ - NA;
    read_series(&r, cfem_motion_root, triangle), read_series(&r, cfem_motion_inner, NE * inner);
    for (int i = 0; i < CFEM_MOTION_LOSSES; i++) read_series(&r, &cfem_motion_loss[i], triangle);
    if (CFEM_MOTION_CURVED) read_series(&r, cfem_motion_curve, NE * inner * (inner + 1) / 2);
    return !(r.good && r.at == r.end);
}

/* Both stand still at the start of the curve. */
void SERVED(motion_start)(void) {
    cfem_mpc_init(&predictive, cfem_mpc_start);
    cfem_init(&inverse);
    for (int i = 0; i < NA; i++) inverse.delta_a[i] = cfem_mpc_start[i];
    cfem_parts parts;
    cfem_spectral(cfem_mpc_start, &parts);
    for (int i = 0; i < NA; i++) inverse.lambda_a[i] = parts.gradient[i];
    for (int e = 0; e < NE; e++) inverse.reference[e] = cfem_rest_e[e] + parts.effector[e];
    inverse.stands = 0;
    for (int k = 0; k < BOTH; k++) {
        robot[k] = predictive.state, lost[k] = 0;
        memcpy(shared.u[k], robot[k].u, sizeof shared.u[k]);
        memcpy(shared.x_e[k], inverse.reference, sizeof shared.x_e[k]);
    }
}

/* Where the tips of a robot are, and its skin as that of the robot at rest whose tips are nearest to there. */
static void look(int which, int shown) {
    static cfem_inner near;
    double e[CFEM_MOST_NE], C[CFEM_MOST_NE][CFEM_MOTION_MOST_NQ], A[CFEM_MOST_NA][CFEM_MOST_NA], b[CFEM_MOST_NA], trace = 0.0;
    cfem_inner_at(robot[which].z, 1, &near);
    cfem_tips(robot[which].z, &near, &near, e, C);
    for (int k = 0; k < NE; k++) shared.x_e[which][k] = cfem_rest_e[k] + e[k];
    if (!shown) return;
    cfem_parts parts;
    cfem_effector_parts(robot[which].z, &parts);
    for (int i = 0; i < NA; i++) {
        b[i] = 0.0;
        for (int j = 0; j < NA; j++) {
            A[i][j] = 0.0;
            for (int k = 0; k < NE; k++) A[i][j] += parts.effector_gradient[k][i] * parts.effector_gradient[k][j];
        }
        for (int k = 0; k < NE; k++) b[i] += parts.effector_gradient[k][i] * (e[k] - parts.effector[k]);
        trace += A[i][i];
    }
    for (int i = 0; i < NA; i++) A[i][i] += 1e-2 * trace / NA;
    const int flat = cfem_invert(NA, CFEM_MOST_NA, A[0]);
    for (int i = 0; i < NA; i++) {
        cfem_io.delta_a[i] = robot[which].z[i] + (flat ? 0.0 : cfem_dot(NA, A[i], b));
        cfem_io.lambda_a[i] = CFEM_COMMAND_FORCE ? robot[which].u[i] : cfem_io.lambda_a[i];
    }
    for (int k = 0; k < NE; k++) cfem_io.x_e[k] = shared.x_e[which][k];
}

/* A robot during a tick in which its command moves evenly to u: steps of a share of the tick. */
static int move(int which, const double *u) {
    static cfem_place place;
    static cfem_stage stage;
    const cfem_material as_learned = {1.0, 1.0};
    const double dt = CFEM_MPC_DT, warp = CFEM_MPC_WARP;
    double from[CFEM_MOST_NA], to[CFEM_MOST_NA];
    int failed = 0;
    memcpy(from, robot[which].u, sizeof from);
    CFEM_MPC_DT = dt / SUBSTEPS, CFEM_MPC_WARP = 1.0;
    for (int k = 1; k <= SUBSTEPS && !failed; k++) {
        int known = 0;
        for (int i = 0; i < NA; i++) to[i] = from[i] + (double)k / SUBSTEPS * (u[i] - from[i]);
        failed = cfem_tick(&robot[which], to, &as_learned, &place, &known, &stage);
    }
    CFEM_MPC_DT = dt, CFEM_MPC_WARP = warp;
    for (int i = 0; i < NA; i++) { /* farther beyond the training states than half of their width */
        const double low = cfem_domain_delta_a[0][i], high = cfem_domain_delta_a[1][i], beyond = (high - low) / 2;
        failed |= !(robot[which].z[i] >= low - beyond && robot[which].z[i] <= high + beyond);
    }
    return failed;
}

/* One tick of both after shared.ahead; shown: the one that is drawn. Which of them are lost: 1, 2 or 3. */
unsigned SERVED(motion_tick)(int shown) {
    static cfem_mpc_input in;
    cfem_mpc_output told;
    cfem_input asked;
    cfem_output out;
    in.ahead = CFEM_MPC_TICKS;
    for (int k = 0; k < in.ahead; k++)
        for (int e = 0; e < NE; e++) in.goal[k][e] = shared.ahead[k][e];
    cfem_mpc_step(&predictive, &in, &told);
    memset(&asked, 0, sizeof asked);
    for (int e = 0; e < NE; e++) asked.goal[e] = shared.ahead[0][e];
    for (int k = 0; k < 6; k++) {
        for (int i = 0; i < NA; i++) asked.delta_a[i] = inverse.delta_a[i];
        cfem_step(&inverse, &asked, &out);
    }
    const double *static_u = CFEM_COMMAND_FORCE ? out.lambda_a : out.delta_a;
    for (int i = 0; i < NA; i++) shared.u[STATIC][i] = static_u[i], shared.u[PREDICTIVE][i] = told.u[i];
    for (int k = 0; k < BOTH; k++) {
        if (lost[k]) continue;
        lost[k] = move(k, shared.u[k]);
        if (!lost[k]) look(k, k == shown);
    }
    return (unsigned)(lost[STATIC] + 2 * lost[PREDICTIVE]);
}
