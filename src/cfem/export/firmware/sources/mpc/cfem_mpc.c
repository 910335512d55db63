/* A tick of predictive control: the horizon is linearised, its program is solved, the first command is sent. */
#include "cfem_mpc.h"

#include <string.h>

#include "cfem_far.h"
#include "cfem_linear.h"
#include "cfem_parts.h"

#define NA CFEM_MOTION_NA
#define NQ CFEM_MOTION_NQ
#define NE CFEM_MOTION_NE
#define NZ CFEM_MPC_NZ
#define TICKS CFEM_MPC_TICKS
#define MOVES CFEM_MPC_MOVES
#define DT CFEM_MPC_DT
#define EVERY CFEM_MPC_EVERY
#define PATIENCE 3        /* ticks in a row without a plan, after which the command retreats */
#define RETREAT 0.75      /* of the way to the command at home, in a tick */
#define AGAIN 20          /* ticks without a plan, after which the observer begins again once more */

const unsigned long cfem_mpc_bytes = sizeof(cfem_mpc);

void cfem_mpc_init(cfem_mpc *m, const double *delta_a) {
    cfem_parts parts;
    memset(m, 0, sizeof *m);
    for (int a = 0; a < NA; a++) m->state.z[a] = delta_a ? delta_a[a] : cfem_home[a];
    cfem_potential_parts(m->state.z, &parts);
    for (int a = 0; a < NA; a++) m->state.u[a] = m->rest[a] = CFEM_MPC_FORCE ? parts.gradient[a] : m->state.z[a];
    for (int k = 0; k <= TICKS; k++) {
        memcpy(m->states[k], m->state.z, sizeof m->states[k]);
        if (k < TICKS) memcpy(m->ahead[k], m->state.u, sizeof m->ahead[k]);
    }
    memcpy(m->last, m->rest, sizeof m->last);
    m->material.stiffness = m->material.viscosity = 1.0; /* without an observer too */
    if (CFEM_MPC_SENSED) cfem_observer_init(m);
}

static void guess(const cfem_mpc *m, int k, double *v) {
    for (int i = 0; i < NQ; i++) v[i] = (m->states[k + 1][i] - m->states[k][i]) / DT;
}

static void place_of(const cfem_mpc *m, int k, int slopes, cfem_place *found) {
    double middle[CFEM_MOTION_MOST_NA];
    for (int a = 0; a < NA; a++) middle[a] = (m->states[k][a] + m->states[k + 1][a]) / 2;
    cfem_place_at(middle, slopes, found);
}

/* Slopes of effectors and course by the commands of each block, in shares of their size. */
static void write_slopes(cfem_mpc *m, int k, int blocks, double C[CFEM_MOTION_MOST_NE][CFEM_MOTION_MOST_NQ],
                         double lambda[CFEM_MPC_MOST_MOVES][CFEM_MOTION_MOST_NA * CFEM_MOTION_MOST_NA]) {
    for (int b = 0; b < blocks; b++)
        for (int c = 0; c < NA; c++) {
            const double *column = m->work.horizon.columns[b] + c, size = cfem_mpc_size[c];
            for (int e = 0; e < NE; e++) {
                double sum = 0.0;
                for (int i = 0; i < NQ; i++) sum += C[e][i] * column[i * NA];
                m->plan.E[k][e][b * NA + c] = size * sum;
            }
            for (int a = 0; a < NA; a++)
                m->plan.by_course[k][a][b * NA + c] = size * (CFEM_MPC_FORCE ? column[a * NA] : lambda[b][a * NA + c]);
        }
}

/* The horizon from `now`, linearised: what the program asks of it. */
static int condense(cfem_mpc *m, const cfem_moving *now) {
    double at[CFEM_MPC_MOST_NZ], about[CFEM_MPC_MOST_NZ], C[CFEM_MOTION_MOST_NE][CFEM_MOTION_MOST_NQ];
    double lambda[CFEM_MPC_MOST_MOVES][CFEM_MOTION_MOST_NA * CFEM_MOTION_MOST_NA];
    cfem_plan *plan = &m->plan;
    cfem_place *const before = &m->work.horizon.before, *const after = &m->work.horizon.after;
    memcpy(at, now->z, sizeof at), memcpy(about, now->z, sizeof about);
    place_of(m, 0, 1, &m->first);
    *after = m->first, m->has_first = 1;
    for (int k = 0, block = 0, from = 0, to = 0; k < TICKS; k++) {
        const cfem_place *near = after;
        cfem_stage *stage = &m->stage[k];
        double v[CFEM_MOTION_MOST_NQ], w[CFEM_MOTION_MOST_NA], deviation[CFEM_MPC_MOST_NZ], next[CFEM_MPC_MOST_NZ], by[CFEM_MOTION_MOST_NA];
        guess(m, k, v);
        if (k > to) { /* what is learned is asked at every few ticks, and interpolated between */
            from = to, to = from + EVERY < TICKS - 1 ? from + EVERY : TICKS - 1;
            *before = *after;
            place_of(m, to, 0, after);
        }
        if (k < to) {
            cfem_place_between(before, after, (double)(k - from) / (to - from), &m->near);
            near = &m->near;
        }
        cfem_acting(k ? m->ahead[k - 1] : now->u, m->ahead[k], w);
        memcpy(m->w[k], w, sizeof w);
        if (cfem_stage_at(m->states[k], v, w, &near->inertia, &m->first.inertia, &m->material, stage)) return 1;
        /* Without commands, and under those of the last plan. */
        for (int a = 0; a < NA; a++) w[a] = (k == 0 && CFEM_MPC_FORCE ? now->u[a] / 2 : 0.0) - w[a];
        for (int i = 0; i < NZ; i++) deviation[i] = at[i] - m->states[k][i];
        cfem_stage_of_one(stage, deviation, w, next, by);
        for (int i = 0; i < NZ; i++) at[i] = stage->end[i] + next[i], deviation[i] = about[i] - m->states[k][i];
        for (int a = 0; a < NA; a++) plan->course[k][a] = CFEM_MPC_FORCE ? at[a] : stage->lambda[a] + by[a], w[a] = 0.0;
        cfem_stage_of_one(stage, deviation, w, next, 0);
        for (int i = 0; i < NZ; i++) about[i] = stage->end[i] + next[i];
        /* By the commands: of this tick, and the one before where forces act with their mean. */
        const int earlier = block;
        if (block + 1 < MOVES && cfem_mpc_begins[block + 1] == k) block++;
        for (int b = 0; b <= block; b++) {
            double out[CFEM_MPC_MOST_NZ * CFEM_MOTION_MOST_NA], share = b == block ? 1.0 : 0.0;
            if (CFEM_MPC_FORCE) share = 0.5 * ((b == block) + (k > 0 && b == earlier));
            cfem_stage_of_block(stage, NA, b == block && (k == 0 || block != earlier) ? 0 : m->work.horizon.columns[b], share, out, lambda[b]);
            memcpy(m->work.horizon.columns[b], out, sizeof out);
        }
        double e[CFEM_MOTION_MOST_NE];
        cfem_tips(about, &near->inner, &m->first.inner, e, C);
        for (int i = 0; i < NE; i++) {
            plan->e[k][i] = e[i] + m->offset[i];
            for (int j = 0; j < NQ; j++) plan->e[k][i] -= C[i][j] * (about[j] - at[j]);
        }
        write_slopes(m, k, block + 1, C, lambda);
    }
    return 0;
}

/* Takes over the plan: its commands, shifted by a tick, and where they lead. */
static void follow(cfem_mpc *m, const cfem_moving *now, double *u) {
    double state[CFEM_MPC_MOST_NZ], command[CFEM_MOTION_MOST_NA], first[CFEM_MPC_MOST_NZ];
    memcpy(state, now->z, sizeof state), memcpy(command, now->u, sizeof command);
    memcpy(u, m->plan.x, sizeof(double) * NA);
    for (int k = 0, block = 0; k < TICKS; k++) {
        double w[CFEM_MOTION_MOST_NA], deviation[CFEM_MPC_MOST_NZ], next[CFEM_MPC_MOST_NZ];
        if (block + 1 < MOVES && cfem_mpc_begins[block + 1] == k) block++;
        const double *given = m->plan.x + block * NA;
        cfem_acting(command, given, w);
        for (int a = 0; a < NA; a++) w[a] -= m->w[k][a], command[a] = given[a];
        for (int i = 0; i < NZ; i++) deviation[i] = state[i] - m->states[k][i];
        cfem_stage_of_one(&m->stage[k], deviation, w, next, 0);
        for (int i = 0; i < NZ; i++) state[i] = m->stage[k].end[i] + next[i];
        if (k) { /* the guess of tick k has been used */
            memcpy(m->states[k - 1], first, sizeof first);
            memcpy(m->ahead[k - 1], given, sizeof m->ahead[k - 1]);
        }
        memcpy(first, state, sizeof first);
    }
    memcpy(m->ahead[TICKS - 1], m->ahead[TICKS - 2], sizeof m->ahead[0]);
    memcpy(m->states[TICKS - 1], first, sizeof first);
}

/* The next tick of the plan before. */
static void keep_plan(cfem_mpc *m, double *u) {
    memcpy(u, m->ahead[0], sizeof(double) * NA);
    memmove(m->ahead[0], m->ahead[1], sizeof m->ahead[0] * (TICKS - 1));
    memmove(m->states[0], m->states[1], sizeof m->states[0] * TICKS);
}

/* Towards the command at home, within the rate: where a command led to is perhaps beyond what the model knows, and no plan is found
 * as long as it stays. */
static void retreat(cfem_mpc *m, double *u) {
    for (int a = 0; a < NA; a++) {
        const double step = RETREAT * (m->rest[a] - m->last[a]), rate = cfem_mpc_rate[a];
        u[a] = m->last[a] + fmin(fmax(step, -rate), rate);
        for (int k = 0; k < TICKS; k++) m->ahead[k][a] = u[a];
    }
}

/* heard: what became of the sample. */
static unsigned plan_command(cfem_mpc *m, const cfem_mpc_input *in, double *u, unsigned *heard) {
    cfem_moving now;
    double sum = 0.0;
    int far = 0;
    const int known = in->ahead < 1 ? 1 : in->ahead < TICKS ? in->ahead : TICKS;
    for (int k = 0; k < TICKS; k++) {
        const double *goal = in->goal[k < known ? k : known - 1];
        for (int e = 0; e < NE; e++) m->plan.goal[k][e] = goal[e] - cfem_rest_e[e], sum += goal[e];
        far |= cfem_is_far(goal);
    }
    if (CFEM_MPC_SENSED) {
        if (in->sampled > m->sent || in->sampled < 0) return CFEM_HELD | CFEM_BAD_INPUT;
        *heard = cfem_observer_hear(m, in->x_e, in->sampled);
        const int again = cfem_observer_now(m, &now);
        if (again) *heard = CFEM_RESTARTED;
        if (again < 0) return CFEM_HELD | CFEM_NO_MODEL;
    } else {
        now = m->state;
    }
    if (!cfem_finite(sum)) return CFEM_HELD | CFEM_BAD_INPUT;
    if (far) return CFEM_HELD | CFEM_BAD_INPUT | CFEM_FAR;
    for (int k = 0; m->lost && k <= TICKS; k++) memcpy(m->states[k], now.z, sizeof m->states[k]);
    memcpy(m->plan.previous, now.u, sizeof m->plan.previous), memcpy(m->plan.rest, m->rest, sizeof m->plan.rest);
    if (condense(m, &now)) return CFEM_HELD | CFEM_NO_MODEL;
    if (cfem_plan_solve(&m->plan, &m->work.factors)) return CFEM_HELD | CFEM_NO_QP;
    follow(m, &now, u);
    unsigned status = (m->plan.count ? CFEM_LIMITED : 0u) | (m->plan.softened ? CFEM_SOFTENED : 0u);
    for (int a = 0; a < NA; a++)
        if (now.z[a] < cfem_domain_delta_a[0][a] || now.z[a] > cfem_domain_delta_a[1][a]) status |= CFEM_OUTSIDE;
    return status;
}

unsigned cfem_mpc_step(cfem_mpc *m, const cfem_mpc_input *in, cfem_mpc_output *out) {
    unsigned heard = 0;
    m->has_first = 0;
    unsigned status = plan_command(m, in, out->u, &heard);
    m->lost = status & (CFEM_NO_MODEL | CFEM_NO_QP) ? m->lost + 1 : 0;
    status |= heard;
    if (m->lost > PATIENCE) {
        retreat(m, out->u);
        /* What samples cannot tell from the truth may still leave no plan. */
        if (CFEM_MPC_SENSED && (m->lost - PATIENCE) % AGAIN == 1) cfem_observer_restart(m, out->u), status |= CFEM_RESTARTED;
    } else if (status & CFEM_HELD)
        keep_plan(m, out->u);
    memcpy(m->last, out->u, sizeof(double) * NA);
    for (int i = 0; i < NZ; i++) m->states[TICKS][i] = 2.0 * m->states[TICKS - 1][i] - m->states[TICKS - 2][i];
    if (CFEM_MPC_SENSED) {
        cfem_observer_commanded(m, out->u);
    } else {
        if (cfem_tick(&m->state, out->u, &m->material, &m->first, &m->has_first, &m->stage[0])) status |= CFEM_NOT_FOUND;
        m->sent++;
    }
    memcpy(out->delta_a, m->states[0], sizeof(double) * NA);
    return out->status = status;
}
