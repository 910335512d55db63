/* Where the robot is and how it moves, from measured effectors: an extended Kalman filter, as src/cfem/control/motion/observer.py has
 * it. A late sample corrects the state of its own tick. One that does not fit is not heard (cfem_gate.h); after a run of these, and where
 * the estimate is lost, the filter begins again at the model's equilibrium. */
#include <string.h>

#include "cfem_linear.h"
#include "cfem_innovation.h"
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
#define SWING 0.1  /* of the square of what samples missed: that of a swing that they may be of */

/* (NQ,) K^-1 b of a robot at rest, or of what is not held of it. W: the compliance of the actuators. */
static void apply_compliance(double W[CFEM_MOTION_MOST_NA][CFEM_MOTION_MOST_NA], const double *b, double *out) {
    for (int a = 0; a < NA; a++) out[a] = HELD ? 0.0 : cfem_dot(NA, W[a], b);
    for (int r = NA; r < NQ; r++) out[r] = b[r] / cfem_motion_stiffness;
}

/* At rest where m->state is, as uncertain as stated. */
static void begin(cfem_mpc *m) {
    static const double share[2] = {CFEM_MPC_DOUBT_STIFFNESS, CFEM_MPC_DOUBT_VISCOSITY};
    double by[2][ACROSS];
    memset(by, 0, sizeof by), memset(m->logarithm, 0, sizeof m->logarithm), memset(m->offset, 0, sizeof m->offset);
    m->material.stiffness = m->material.viscosity = 1.0;
    cfem_gate_restart(&m->gate);
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

void cfem_observer_init(cfem_mpc *m) {
    begin(m);
    for (int e = 0; e < NE; e++) m->sample[e] = NAN;
}

/* Begins again at the model's equilibrium under the command u: searched from where the robot was taken to be, the middle of what the
 * model was trained on where there is none. */
static void restart(cfem_mpc *m, const double *u) {
    double z[CFEM_MPC_MOST_NZ] = {0};
    cfem_condensed found;
    for (int a = 0; a < NA; a++) {
        const double low = cfem_domain_delta_a[0][a], high = cfem_domain_delta_a[1][a], near = m->state.z[a];
        z[a] = HELD ? u[a] : cfem_finite(near) ? fmin(fmax(near, low), high) : (low + high) / 2;
    }
    if (!HELD && cfem_find(u, z, &found))
        for (int a = 0; a < NA; a++) z[a] = (cfem_domain_delta_a[0][a] + cfem_domain_delta_a[1][a]) / 2;
    memcpy(m->state.z, z, sizeof z), memset(m->state.v, 0, sizeof m->state.v);
    memcpy(m->state.u, u, sizeof(double) * NA);
    cfem_place_at(z, 1, &m->near);
    begin(m);
}

void cfem_observer_restart(cfem_mpc *m, const double *u) {
    restart(m, u);
    memset(m->known, 0, sizeof m->known);
}

static int lost(const cfem_mpc *m) {
    double sum = 0.0;
    for (int i = 0; i < NZ; i++) sum += m->state.z[i];
    for (int i = 0; i < NX; i++)
        for (int j = 0; j < NX; j++) sum += m->covariance[i][j];
    return !cfem_finite(sum);
}

/* Adds to the covariance an offset of mean square `square` in each coordinate, and a swing of the effectors of a share of that about the
 * equilibrium, with as much energy in each motion. */
static void widen(cfem_mpc *m, double square) {
    double e[CFEM_MOTION_MOST_NE], C[CFEM_MOTION_MOST_NE][MOST_NQ], moved = 0.0;
    const double *mass = m->near.inertia.M;
    cfem_parts parts;
    cfem_potential_parts(m->state.z, &parts);
    cfem_tips(m->state.z, &m->near.inner, &m->near.inner, e, C);
    if (HELD || !cfem_invert(NA, CFEM_MOST_SERIES_NA, parts.hessian[0]))
        for (int k = 0; k < NE; k++) {
            double by[MOST_NQ];
            apply_compliance(parts.hessian, C[k], by);
            moved += cfem_dot(NQ, C[k], by);
        }
    const double energy = moved > 0.0 ? SWING * square * NE / moved : 0.0;
    for (int a = 0; a < NA && !HELD; a++)
        for (int b = 0; b < NA; b++) m->covariance[a][b] += energy * parts.hessian[a][b];
    for (int r = NA; r < NQ; r++) m->covariance[r][r] += energy / cfem_motion_stiffness;
    for (int i = 0; i < NQ; i++)
        for (int j = i; j < NQ; j++, mass++) {
            if (i >= FIRST) m->covariance[NQ + i][NQ + j] += energy * *mass;
            if (i >= FIRST && j > i) m->covariance[NQ + j][NQ + i] += energy * *mass;
        }
    for (int k = 0; k < NE; k++) m->covariance[OFFSET + k][OFFSET + k] += square;
}

/* Adds the covariance (NZ, NZ) of forces during a tick in proportion to the stiffness, such that at rest they would move the effectors
 * by `push`. z (NA,): the actuators at the middle of the tick `stage`. 0, or 1 where there is no stiffness. */
static int add_pushes(cfem_mpc *m, const double *z, const cfem_inner *place, const cfem_stage *stage) {
    double stiff[CFEM_MOTION_MOST_NA][CFEM_MOTION_MOST_NA], e[CFEM_MOTION_MOST_NE], C[CFEM_MOTION_MOST_NE][MOST_NQ], moved = 0.0;
    double (*push)[ACROSS] = m->work.moved; /* (NZ, NQ) by momentum */
    cfem_parts parts;
    cfem_potential_parts(z, &parts);
    memcpy(stiff, parts.hessian, sizeof stiff);
    if (!HELD && cfem_invert(NA, CFEM_MOST_SERIES_NA, parts.hessian[0])) return 1;
    double still[CFEM_MPC_MOST_NZ] = {0}; /* slopes where the inner motions are none */
    memcpy(still, z, sizeof(double) * NA);
    cfem_tips(still, place, place, e, C);
    for (int k = 0; k < NE; k++) {
        double by[MOST_NQ];
        apply_compliance(parts.hessian, C[k], by);
        moved += cfem_dot(NQ, C[k], by) / m->material.stiffness / NE;
    }
    for (int c = 0; c < ACROSS; c += CFEM_MOTION_MOST_NA) { /* a push is like momentum, half of it before the tick, half after */
        double unit[CFEM_MPC_MOST_NZ * CFEM_MOTION_MOST_NA], out[CFEM_MPC_MOST_NZ * CFEM_MOTION_MOST_NA];
        if (c >= NQ) break;
        memset(unit, 0, sizeof unit);
        for (int k = 0; k < NA && c + k < NQ; k++) unit[(NQ + c + k) * NA + k] = 1.0;
        cfem_stage_of_block(stage, NA, unit, 0.0, out, 0);
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
static void propagate(const cfem_stage *stage, double by_material[CFEM_MPC_MOST_NZ][2], double in[][ACROSS], double out[][ACROSS]) {
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
    propagate(stage, by_material, m->covariance, m->work.moved);
    for (int i = 0; i < NX; i++)
        for (int j = i + 1; j < NX; j++) {
            const double upper = m->work.moved[i][j];
            m->work.moved[i][j] = m->work.moved[j][i], m->work.moved[j][i] = upper;
        }
    propagate(stage, by_material, m->work.moved, m->covariance);
    if (add_pushes(m, stage->middle, &place->inner, stage)) return 1;
    for (int k = 0; k < 2; k++) {
        const double wander = CFEM_MPC_DOUBT_WANDER * share[k];
        m->covariance[MATERIAL + k][MATERIAL + k] += DT * wander * wander;
    }
    for (int e = 0; e < NE; e++) m->covariance[OFFSET + e][OFFSET + e] += DT * CFEM_MPC_DOUBT_OFFSET * CFEM_MPC_DOUBT_OFFSET;
    return 0;
}

/* Predicts the oldest command that is still on its way; whether the estimate was lost, and began again. */
static int predict_oldest(cfem_mpc *m) {
    const int failed = predict(m, m->late[0]) || lost(m);
    if (failed) restart(m, m->late[0]);
    m->heard++;
    memmove(m->late[0], m->late[1], sizeof m->late[0] * (CFEM_MPC_LATE - 1));
    memmove(&m->place[0], &m->place[1], sizeof m->place[0] * (CFEM_MPC_LATE - 1));
    memmove(m->known, m->known + 1, sizeof m->known[0] * (CFEM_MPC_LATE - 1));
    return failed;
}

unsigned cfem_observer_hear(cfem_mpc *m, const double *x_e, long sampled) {
    double sum = 0.0, size;
    unsigned status = 0;
    int measured = 0;
    cfem_innovation innovation;
    if (sampled <= m->heard) return 0;
    while (m->heard < sampled)
        if (predict_oldest(m)) status = CFEM_RESTARTED;
    for (int e = 0; e < NE; e++)
        if (cfem_mpc_weight[e] > 0.0) sum += x_e[e], measured = 1;
    if (!measured || !cfem_finite(sum)) return status;
    const int none = cfem_innovation_of(m, x_e, &innovation);
    if (cfem_frozen(m, x_e, &innovation)) return status | CFEM_REJECTED;
    const int verdict =
        none ? CFEM_GATE_RESTART : cfem_gate_judge(&m->gate, innovation.square, innovation.n, CFEM_MPC_GATE_SIGMAS, CFEM_MPC_GATE_SAMPLES);
    if (verdict == CFEM_GATE_REJECTED) return status | CFEM_REJECTED;
    if (verdict == CFEM_GATE_RESTART) {
        size = innovation.size, status = CFEM_RESTARTED;
        restart(m, m->state.u);
        if (cfem_innovation_of(m, x_e, &innovation)) return status;
        widen(m, fmax(size, innovation.size));
        if (cfem_innovation_of(m, x_e, &innovation)) return status;
    }
    cfem_correct(m, &innovation);
    if (!lost(m)) return status;
    restart(m, m->state.u);
    return CFEM_RESTARTED;
}

int cfem_observer_now(cfem_mpc *m, cfem_moving *now) {
    for (int attempt = 0; attempt < 2; attempt++) {
        double sum = 0.0;
        int failed = 0;
        *now = m->state;
        for (long k = 0; k < m->sent - m->heard && !failed; k++)
            failed = cfem_tick(now, m->late[k], &m->material, &m->place[k], &m->known[k], &m->stage[0]);
        for (int i = 0; i < NZ; i++) sum += now->z[i];
        if (!failed && cfem_finite(sum)) return attempt;
        cfem_observer_restart(m, m->state.u);
    }
    return -1;
}

void cfem_observer_commanded(cfem_mpc *m, const double *u) {
    if (m->sent - m->heard == CFEM_MPC_LATE) predict_oldest(m); /* no sample will be of that tick any more */
    const long last = m->sent++ - m->heard;
    memcpy(m->late[last], u, sizeof(double) * NA);
    if ((m->known[last] = m->has_first)) m->place[last] = m->first;
}
