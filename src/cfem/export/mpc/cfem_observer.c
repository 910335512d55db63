/* Where the robot is and how it moves, from measured effectors: an extended Kalman filter, as src/cfem/control/moving/observer.py has
 * it. A late sample corrects the state of its own tick. */
#include <string.h>

#include "cfem_linear.h"
#include "cfem_mpc.h"
#include "cfem_parts.h"

#define NA CFEM_MOTION_NA
#define NQ CFEM_MOTION_NQ
#define NR CFEM_MOTION_NR
#define NE CFEM_MOTION_NE
#define NZ CFEM_MPC_NZ
#define NX CFEM_MPC_NX
#define MATERIAL NZ
#define OFFSET (NZ + 2)
#define ACROSS CFEM_MPC_COLUMNS
#define MOST_NQ CFEM_MOTION_MOST_NQ
#define HELD (!CFEM_MPC_FORCE)
#define FIRST (HELD ? NA : 0)
#define DT CFEM_MPC_DT

/* exp(x) for |x| <= 4 times a standard deviation, without libm: halved until small, squared back. */
static double exponential(double x) {
    double sum = 1.0, term = 1.0;
    int squared = 0;
    while (fabs(x) > 0.03125 && squared < 12) x /= 2.0, squared++;
    for (int k = 1; k < 12; k++) term *= x / k, sum += term;
    while (squared--) sum *= sum;
    return sum;
}

/* (NQ,) K^-1 b of a robot at rest, or of what is not held of it. W: the compliance of the actuators. */
static void yield_to(double W[CFEM_MOTION_MOST_NA][CFEM_MOTION_MOST_NA], const double *b, double *out) {
    for (int a = 0; a < NA; a++) out[a] = HELD ? 0.0 : cfem_dot(NA, W[a], b);
    for (int r = NA; r < NQ; r++) out[r] = b[r] / cfem_motion_stiffness;
}

void cfem_observer_init(cfem_mpc *m) {
    static const double share[2] = {CFEM_MPC_DOUBT_STIFFNESS, CFEM_MPC_DOUBT_VISCOSITY};
    double by[2][ACROSS];
    memset(by, 0, sizeof by);
    for (int k = 0; k < 2; k++) by[k][MATERIAL + k] = share[k];
    if (!HELD) { /* a stiffer robot stands elsewhere */
        cfem_parts parts;
        cfem_potential_parts(m->state.z, &parts);
        if (!cfem_invert(NA, CFEM_MOST_SERIES_NA, parts.hessian[0]))
            for (int a = 0; a < NA; a++) by[0][a] = -share[0] * cfem_dot(NA, parts.hessian[a], parts.gradient);
    }
    for (int i = 0; i < NX; i++)
        for (int j = 0; j < NX; j++) {
            m->covariance[i][j] = by[0][i] * by[0][j] + by[1][i] * by[1][j];
            if (i == j && i >= OFFSET) m->covariance[i][j] = CFEM_MPC_DOUBT_OFFSET * CFEM_MPC_DOUBT_OFFSET;
        }
}

/* Adds the covariance (NZ, NZ) of forces during a tick in proportion to the stiffness, such that at rest they would move the effectors
 * by `push`. z (NA,): the actuators at the middle of the tick `stage`. 0, or 1 where there is no stiffness. */
static int add_pushes(cfem_mpc *m, const double *z, const cfem_inner *place, const cfem_stage *stage) {
    double stiff[CFEM_MOTION_MOST_NA][CFEM_MOTION_MOST_NA], e[CFEM_MOTION_MOST_NE], C[CFEM_MOTION_MOST_NE][MOST_NQ], moved = 0.0;
    double (*push)[ACROSS] = m->moved; /* (NZ, NQ) by momentum */
    cfem_parts parts;
    cfem_potential_parts(z, &parts);
    memcpy(stiff, parts.hessian, sizeof stiff);
    if (!HELD && cfem_invert(NA, CFEM_MOST_SERIES_NA, parts.hessian[0])) return 1;
    double still[CFEM_MPC_MOST_NZ] = {0}; /* slopes where the inner motions are none */
    memcpy(still, z, sizeof(double) * NA);
    cfem_tips(still, place, place, e, C);
    for (int k = 0; k < NE; k++) {
        double by[MOST_NQ];
        yield_to(parts.hessian, C[k], by);
        moved += cfem_dot(NQ, C[k], by) / m->material.stiffness / NE;
    }
    for (int c = 0; c < ACROSS; c += CFEM_MOTION_MOST_NA) { /* a push is like momentum, half of it before the tick, half after */
        double one[CFEM_MPC_MOST_NZ * CFEM_MOTION_MOST_NA], out[CFEM_MPC_MOST_NZ * CFEM_MOTION_MOST_NA];
        if (c >= NQ) break;
        memset(one, 0, sizeof one);
        for (int k = 0; k < NA && c + k < NQ; k++) one[(NQ + c + k) * NA + k] = 1.0;
        cfem_stage_of_block(stage, NA, one, 0.0, out, 0);
        for (int i = 0; i < NZ; i++)
            for (int k = 0; k < NA && c + k < NQ; k++) push[i][c + k] = DT / 2 * (out[i * NA + k] + (i == NQ + c + k));
    }
    const double size = CFEM_MPC_DOUBT_PUSH * CFEM_MPC_DOUBT_PUSH / moved * m->material.stiffness;
    for (int i = 0; i < NZ; i++) {
        double by[MOST_NQ];
        for (int a = 0; a < NA; a++) {
            by[a] = 0.0;
            for (int b = 0; b < NA; b++) by[a] += push[i][b] * stiff[b][a];
        }
        for (int r = NA; r < NQ; r++) by[r] = cfem_motion_stiffness * push[i][r];
        for (int j = 0; j < NZ; j++) m->covariance[i][j] += size * cfem_dot(NQ - FIRST, by + FIRST, push[j] + FIRST);
    }
    return 0;
}

/* out = F in, of NX columns. */
static void transport(const cfem_stage *stage, double by_material[CFEM_MPC_MOST_NZ][2], double in[][ACROSS], double out[][ACROSS]) {
    for (int c = 0; c < NX; c += NA) cfem_stage_of_block(stage, ACROSS, in[0] + c, 0.0, out[0] + c, 0);
    for (int i = 0; i < NZ; i++)
        for (int c = 0; c < NX; c++) out[i][c] += by_material[i][0] * in[MATERIAL][c] + by_material[i][1] * in[MATERIAL + 1][c];
    for (int i = NZ; i < NX; i++) memcpy(out[i], in[i], sizeof out[i]);
}

static int predict(cfem_mpc *m, const double *u) {
    static const double share[2] = {CFEM_MPC_DOUBT_STIFFNESS, CFEM_MPC_DOUBT_VISCOSITY};
    cfem_stage *stage = &m->stage[0];
    double by_material[CFEM_MPC_MOST_NZ][2];
    cfem_place *place = &m->near;
    *place = m->place[0];
    if (cfem_tick(&m->state, u, &m->material, place, &m->known[0], stage)) return 1;
    cfem_stage_by_material(stage, by_material);
    transport(stage, by_material, m->covariance, m->moved);
    for (int i = 0; i < NX; i++)
        for (int j = i + 1; j < NX; j++) {
            const double one = m->moved[i][j];
            m->moved[i][j] = m->moved[j][i], m->moved[j][i] = one;
        }
    transport(stage, by_material, m->moved, m->covariance);
    if (add_pushes(m, stage->middle, &place->inner, stage)) return 1;
    for (int k = 0; k < 2; k++) {
        const double wander = CFEM_MPC_DOUBT_WANDER * share[k];
        m->covariance[MATERIAL + k][MATERIAL + k] += DT * wander * wander;
    }
    for (int e = 0; e < NE; e++) m->covariance[OFFSET + e][OFFSET + e] += DT * CFEM_MPC_DOUBT_OFFSET * CFEM_MPC_DOUBT_OFFSET;
    return 0;
}

static int correct(cfem_mpc *m, const double *x_e) {
    static const double share[2] = {CFEM_MPC_DOUBT_STIFFNESS, CFEM_MPC_DOUBT_VISCOSITY};
    double e[CFEM_MOTION_MOST_NE], C[CFEM_MOTION_MOST_NE][MOST_NQ], S[CFEM_MOTION_MOST_NE][CFEM_MOTION_MOST_NE], missed[CFEM_MOTION_MOST_NE];
    double (*HP)[ACROSS] = m->moved, (*gain)[ACROSS] = m->moved + NE; /* (n, NX), gain transposed */
    int row[CFEM_MOTION_MOST_NE], n = 0;
    cfem_tips(m->state.z, &m->near.inner, &m->near.inner, e, C);
    for (int k = 0; k < NE; k++)
        if (cfem_mpc_weight[k] > 0.0) row[n++] = k;
    for (int k = 0; k < n; k++) {
        missed[k] = x_e[row[k]] - cfem_rest_e[row[k]] - e[row[k]] - m->offset[row[k]];
        for (int j = 0; j < NX; j++) {
            HP[k][j] = m->covariance[OFFSET + row[k]][j];
            for (int i = 0; i < NQ; i++) HP[k][j] += C[row[k]][i] * m->covariance[i][j];
        }
    }
    for (int k = 0; k < n; k++)
        for (int l = 0; l < n; l++)
            S[k][l] = cfem_dot(NQ, C[row[l]], HP[k]) + HP[k][OFFSET + row[l]] + (k == l ? CFEM_MPC_DOUBT_NOISE * CFEM_MPC_DOUBT_NOISE : 0.0);
    if (cfem_invert(n, CFEM_MOTION_MOST_NE, S[0])) return 1;
    double change[ACROSS];
    for (int i = 0; i < NX; i++) {
        change[i] = 0.0;
        for (int k = 0; k < n; k++) {
            gain[k][i] = 0.0;
            for (int l = 0; l < n; l++) gain[k][i] += S[k][l] * HP[l][i];
            change[i] += gain[k][i] * missed[k];
        }
    }
    for (int i = 0; i < NX; i++) /* what is known now: symmetric, gain S gain^T less */
        for (int j = i; j < NX; j++) {
            double less = 0.0;
            for (int k = 0; k < n; k++) less += gain[k][i] * HP[k][j] + gain[k][j] * HP[k][i];
            m->covariance[i][j] = m->covariance[j][i] = (m->covariance[i][j] + m->covariance[j][i] - less) / 2;
        }
    for (int i = 0; i < NZ; i++) m->state.z[i] += change[i];
    for (int k = 0; k < 2; k++) {
        const double largest = 4.0 * share[k];
        m->logarithm[k] = fmin(fmax(m->logarithm[k] + change[MATERIAL + k], -largest), largest);
    }
    m->material.stiffness = exponential(m->logarithm[0]), m->material.viscosity = exponential(m->logarithm[1]);
    for (int k = 0; k < NE; k++) m->offset[k] += change[OFFSET + k];
    double sum = 0.0;
    for (int i = 0; i < NX; i++) sum += change[i] + m->covariance[i][i];
    return !cfem_finite(sum);
}

/* Predicts the oldest command that is still on its way. */
static int next(cfem_mpc *m) {
    const int failed = predict(m, m->late[0]);
    m->heard++;
    memmove(m->late[0], m->late[1], sizeof m->late[0] * (CFEM_MPC_LATE - 1));
    memmove(&m->place[0], &m->place[1], sizeof m->place[0] * (CFEM_MPC_LATE - 1));
    memmove(m->known, m->known + 1, sizeof m->known[0] * (CFEM_MPC_LATE - 1));
    return failed;
}

int cfem_observer_hear(cfem_mpc *m, const double *x_e, long sampled) {
    double sum = 0.0;
    if (sampled <= m->heard) return 0;
    while (m->heard < sampled)
        if (next(m)) return 1;
    for (int e = 0; e < NE; e++) sum += cfem_mpc_weight[e] > 0.0 ? x_e[e] : 0.0;
    return cfem_finite(sum) ? correct(m, x_e) : 0;
}

int cfem_observer_now(cfem_mpc *m, cfem_moving *now) {
    *now = m->state;
    for (long k = 0; k < m->sent - m->heard; k++)
        if (cfem_tick(now, m->late[k], &m->material, &m->place[k], &m->known[k], &m->stage[0])) return 1;
    return 0;
}

int cfem_observer_told(cfem_mpc *m, const double *u) {
    int failed = 0;
    if (m->sent - m->heard == CFEM_MPC_LATE) failed = next(m); /* no sample will be of that tick any more */
    const long last = m->sent++ - m->heard;
    memcpy(m->late[last], u, sizeof(double) * NA);
    if ((m->known[last] = m->has_first)) m->place[last] = m->first;
    return failed;
}
