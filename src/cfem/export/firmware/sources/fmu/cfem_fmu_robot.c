/* The robot, at rest at each instant or, with CFEM_FMU_MOVES, in motion, as a unit of co-simulation: cfem_fmu.h. */
#include <math.h>
#include <stdio.h>

#include "cfem_fmu.h"
#include "cfem_parts.h"

#if CFEM_FMU_MOVES
#include "cfem_motion.h"
#endif

typedef struct {
    double s[CFEM_NA]; /* input of the model that it last stood at */
#if CFEM_FMU_MOVES
    double command[CFEM_NA]; /* at the end of the last step */
    cfem_motion motion;
#endif
} robot;

const size_t cfem_fmu_bytes = sizeof(robot);

/* Outputs; delta, lambda (CFEM_NA,): of the actuators; ends (CFEM_NE,) mm from rest. */
static void show(const double *delta, const double *lambda, const double *ends, unsigned outside, double *value) {
    for (int i = 0; i < CFEM_NA; i++) value[CFEM_FMU_DISPLACEMENT + i] = delta[i], value[CFEM_FMU_FORCE + i] = lambda[i];
    for (int e = 0; e < CFEM_NE; e++) value[CFEM_FMU_POSITION + e] = cfem_rest_e[e] + ends[e];
    value[CFEM_FMU_OUTSIDE] = outside != 0;
}

#if CFEM_FMU_MOVES
/* Forces of a robot in motion are those of inertia too, so that actuators alone are compared. */
static unsigned beyond(const double *delta) {
    unsigned outside = 0;
    for (int i = 0; i < CFEM_NA; i++) outside |= delta[i] < cfem_domain_delta_a[0][i] || delta[i] > cfem_domain_delta_a[1][i];
    return outside;
}
#endif

/* The equilibrium under the command. */
static int stand(robot *r, double *value, cfem_condensed *m, char said[CFEM_FMU_SAID]) {
    const double *const command = value + CFEM_FMU_COMMAND;
    double ends[CFEM_NE];
    unsigned status;
    if (CFEM_COMMAND_FORCE != CFEM_FORM_DISPLACEMENT) { /* what is commanded is what the model takes */
        for (int i = 0; i < CFEM_NA; i++) r->s[i] = command[i];
        status = cfem_model(r->s, m);
    } else
        status = cfem_find(command, r->s, m);
    if (status) {
        snprintf(said, CFEM_FMU_SAID, "no equilibrium under this command is known to the model, whose training ends before it: command less");
        return CFEM_FMU_ERROR;
    }
    for (int e = 0; e < CFEM_NE; e++) {
        ends[e] = m->free_e[e];
        for (int i = 0; i < CFEM_NA; i++) ends[e] += m->W_ea[e][i] * m->lambda_a[i];
    }
#if CFEM_FMU_MOVES
    show(m->delta_a, m->lambda_a, ends, beyond(m->delta_a), value);
#else
    show(m->delta_a, m->lambda_a, ends, cfem_outside(m), value);
#endif
    return CFEM_FMU_OK;
}

#if CFEM_FMU_STATES
void cfem_fmu_set_states(void *state, const double *x) {
    robot *const r = state;
    for (int i = 0; i < CFEM_MOTION_NQ; i++) {
        r->motion.q[i] = x[i], r->motion.p[i] = x[CFEM_MOTION_NQ + i];
        for (int term = 0; term < CFEM_MOTION_TERMS; term++) r->motion.memory[term][i] = x[(2 + term) * CFEM_MOTION_NQ + i];
    }
}

static void get(const cfem_motion *motion, double *x) {
    for (int i = 0; i < CFEM_MOTION_NQ; i++) {
        x[i] = motion->q[i], x[CFEM_MOTION_NQ + i] = motion->p[i];
        for (int term = 0; term < CFEM_MOTION_TERMS; term++) x[(2 + term) * CFEM_MOTION_NQ + i] = motion->memory[term][i];
    }
}

int cfem_fmu_rates(const void *state, double *value, char said[CFEM_FMU_SAID]) {
    cfem_motion rates, motion = ((const robot *)state)->motion;
    const double *const force = value + CFEM_FMU_COMMAND;
    double ends[CFEM_NE];
    if (cfem_motion_rates(&motion, force, &rates)) {
        snprintf(said, CFEM_FMU_SAID, "there are no derivatives at these states, where the robot would have no inertia");
        return CFEM_FMU_ERROR;
    }
    cfem_motion_effectors(&motion, ends);
    show(motion.q, force, ends, beyond(motion.q), value);
    get(&motion, value + CFEM_FMU_STATE), get(&rates, value + CFEM_FMU_RATE);
    return CFEM_FMU_OK;
}
#endif

int cfem_fmu_begin(void *state, double *value, char said[CFEM_FMU_SAID]) {
    robot *const r = state;
    cfem_condensed m;
    const int status = stand(r, value, &m, said);
#if CFEM_FMU_MOVES
    if (status == CFEM_FMU_OK) cfem_motion_rest(&r->motion, m.delta_a);
    for (int i = 0; i < CFEM_NA; i++) r->command[i] = value[CFEM_FMU_COMMAND + i];
#endif
#if CFEM_FMU_STATES
    if (status == CFEM_FMU_OK) return cfem_fmu_rates(r, value, said);
#endif
    return status;
}

#if CFEM_FMU_MOVES
/* Displacements are reached at the end of the step, evenly; forces act from its beginning. */
int cfem_fmu_step(void *state, double *value, double step, int ticks, char said[CFEM_FMU_SAID]) {
    robot *const r = state;
    const double parts = ceil(step / CFEM_FMU_LONGEST - 1e-6);
    const double *const command = value + CFEM_FMU_COMMAND;
    double u[CFEM_NA], ends[CFEM_NE];
    int held[CFEM_NA];
    (void)ticks;
    for (int i = 0; i < CFEM_NA; i++) held[i] = !CFEM_COMMAND_FORCE;
    for (double k = 1.0; k <= parts; k++) {
        for (int i = 0; i < CFEM_NA; i++) u[i] = CFEM_COMMAND_FORCE ? command[i] : r->command[i] + k / parts * (command[i] - r->command[i]);
        if (cfem_motion_step(&r->motion, u, held, step / parts)) {
            snprintf(said, CFEM_FMU_SAID, "the equations of motion are not solved in a step of %g s: take shorter ones, or command less at once",
                     step / parts);
            return CFEM_FMU_ERROR;
        }
    }
    for (int i = 0; i < CFEM_NA; i++) r->command[i] = command[i];
#if CFEM_FMU_STATES
    if (cfem_fmu_rates(r, value, said)) return CFEM_FMU_ERROR;
#endif
    cfem_motion_effectors(&r->motion, ends);
    show(r->motion.q, r->motion.lambda_a, ends, beyond(r->motion.q), value);
    return CFEM_FMU_OK;
}
#else
int cfem_fmu_step(void *state, double *value, double step, int ticks, char said[CFEM_FMU_SAID]) {
    cfem_condensed m;
    (void)step, (void)ticks;
    return stand(state, value, &m, said);
}
#endif
