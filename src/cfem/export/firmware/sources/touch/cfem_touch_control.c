#include "cfem_touch_control.h"

#include <string.h>

#include "cfem_linear.h"
#if CFEM_CONTACT == 2
#include "cfem_soft.h"
#endif

#if CFEM_CONTACT
#define NA CFEM_NA
#define NE CFEM_NE

static const double STEP = 1e-4, SHARE = 0.05; /* of the reach: of differences; of a quasi-static step of a way */
static const double ROUNDING = 1e-9, SHORTEST = 1.0 / 64; /* of a way: a step that is cut further ends it */

#define ALL_NA CFEM_CONTACT_NA

/* Friction on obstacles counts from `near`. */
static void slip_from(cfem_touched *here, const cfem_touched *near) {
    memcpy(here->holds, near->holds, sizeof near->holds);
    memcpy(here->stuck, near->stuck, sizeof near->stuck);
    memcpy(here->place, near->place, sizeof near->place);
}

#if CFEM_CONTACT == 2
#define SOFT 1

/* The planned robot, the first one, holds its actuators: see docs/contact-in-c.md. */
static unsigned step(cfem_touch_controller *c, const double *deltas, const cfem_met *before, cfem_met *now) {
    double each[CFEM_MEET_ROBOTS][NA];
    for (int i = 0; i < ALL_NA; i++) each[i / NA][i % NA] = deltas[i];
    return cfem_meet(each, c->robots, c->obstacles, c->count, c->mu, before, now, &c->room);
}

static const cfem_touched *own(const cfem_met *state) { return &state->robot[0]; }

static int known(const cfem_met *state) {
    for (int b = 0; b < CFEM_MEET_ROBOTS; b++)
        if (state->robot[b].error > CFEM_TOUCH_TRUSTED) return 0;
    return 1;
}

static double other(const cfem_touch_controller *c, int i) { return c->others[i / NA][i % NA]; }

/* Forces are like those of `here`, friction counts from `near`, where the step to it began. */
static void again(cfem_met *here, const cfem_met *near) {
    const int count = here->hold_count;
    for (int b = 0; b < CFEM_MEET_ROBOTS; b++) slip_from(&here->robot[b], &near->robot[b]);
    for (int i = 0; i < count; i++) {
        const int h = cfem_hold_of(near, here->hold[i].row.slot);
        here->hold[i].unknown = h < 0;
        if (h < 0) continue;
        here->hold[i].row = near->hold[h].row;
    }
    for (int h = 0; h < near->hold_count && here->hold_count < CFEM_MEET_PAIRS; h++) {
        if (cfem_hold_of(here, near->hold[h].row.slot) >= 0) continue;
        cfem_hold *const more = &here->hold[here->hold_count++];
        *more = near->hold[h], more->mode = CFEM_TOUCH_OPEN;
        memset(more->push, 0, sizeof more->push);
    }
}
#else
#define SOFT 0

static unsigned step(cfem_touch_controller *c, const double *delta_a, const cfem_touched *before, cfem_touched *now) {
    return cfem_touch(delta_a, c->obstacles, c->count, c->mu, before, now, &c->room);
}

static const cfem_touched *own(const cfem_touched *state) { return state; }

static int known(const cfem_touched *state) {
    return state->error <= CFEM_TOUCH_TRUSTED && !state->deep && !state->unsettled;
}

static double other(const cfem_touch_controller *c, int i) { return c->delta_a[i]; }

/* Forces are like those of `here`, friction counts from `near`, where the step to it began. */
static void again(cfem_touched *here, const cfem_touched *near) { slip_from(here, near); }
#endif

/* deltas (ALL_NA,): delta_a, and behind it where the others are to be. */
static void with_others(const cfem_touch_controller *c, const double *delta_a, double *deltas) {
    for (int i = 0; i < ALL_NA; i++) deltas[i] = i < NA ? delta_a[i] : other(c, i);
}

/* `here` at delta_a from where all robots stand; with friction, and with soft ones, the way is gone in steps, and one that fails is halved,
 * as in cfem.equilibrium.quasi_static. `near`: where the last of them begins. What this tick has found last it
 * does not look for again. */
static unsigned go(cfem_touch_controller *c, const double *delta_a) {
    const int walks = SOFT || c->mu > 0.0;
    double longest = 1.0, share = 0.0, there, end[ALL_NA], on[ALL_NA];
    with_others(c, delta_a, end);
    if (c->arrived && !memcmp(end, c->here_delta_a, sizeof end)) return 0;
    for (int i = 0; i < ALL_NA; i += NA)
        if (cfem_touch_is_far(end + i)) return CFEM_TOUCH_NO_MODEL;
    c->near = c->at, c->arrived = 0;
    for (int i = 0; i < ALL_NA && walks; i++)
        longest = fmax(longest, fabs(end[i] - c->delta_a[i]) / (SHARE * cfem_patch_reach[i % NA]));
    const double first = 1.0 / ceil(fmin(longest, 1e3) - ROUNDING), shortest = fmin(SHORTEST, first / 8.0);
    for (double size = first; share < 1.0; share = there) {
        there = share + size > 1.0 - ROUNDING ? 1.0 : share + size;
        for (int i = 0; i < ALL_NA; i++) on[i] = there < 1.0 ? c->delta_a[i] + (end[i] - c->delta_a[i]) * there : end[i];
        const unsigned status = step(c, on, &c->near, &c->here);
        if (status && !(walks && size > shortest * (1.0 + ROUNDING))) return status;
        if (status) size = (there - share) / 2.0, there = share;
        else if (there < 1.0) size = fmin(2.0 * size, fmax(first, size)), c->near = c->here;
    }
    memcpy(c->here_delta_a, end, sizeof end), c->arrived = 1;
    return 0;
}

/* As cfem_model, of the robot that obstacles touch: derivatives are central differences of contact states, of one side where the other has
 * none. */
static unsigned touched_model(void *with, const double *s, cfem_condensed *m) {
    cfem_touch_controller *const c = with;
    const cfem_touched *const here = own(&c->here), *const beside = own(&c->beside);
    double J[NE][NA] = {{0.0}}, K[NA][NA] = {{0.0}}, to[ALL_NA];
    if (cfem_model(s, m) || go(c, s)) return CFEM_NO_MODEL;
    c->begin = c->here;
    again(&c->begin, &c->near);
    for (int j = 0; j < NA; j++) {
        const double h = STEP * cfem_patch_reach[j];
        double width = 0.0;
        for (int side = -1; side <= 1; side += 2) {
            with_others(c, s, to);
            to[j] = s[j] + side * h;
            if (step(c, to, &c->begin, &c->beside)) continue;
            for (int e = 0; e < NE; e++) J[e][j] += side * (beside->delta_e[e] - here->delta_e[e]);
            for (int i = 0; i < NA; i++) K[i][j] += side * (beside->lambda_a[i] - here->lambda_a[i]);
            width += h;
        }
        if (width == 0.0) return CFEM_NO_MODEL;
        for (int e = 0; e < NE; e++) J[e][j] /= width;
        for (int i = 0; i < NA; i++) K[i][j] /= width;
    }
    for (int i = 0; i < NA; i++)
        for (int j = 0; j < NA; j++) m->W_aa[i][j] = (K[i][j] + K[j][i]) / 2.0;
    if (cfem_invert(NA, CFEM_MOST_NA, &m->W_aa[0][0])) return CFEM_NO_MODEL;
    for (int i = 0; i < NA; i++) m->lambda_a[i] = here->lambda_a[i];
    for (int i = 0; i < NA; i++) m->free_a[i] = s[i] - cfem_dot(NA, m->W_aa[i], m->lambda_a);
    for (int e = 0; e < NE; e++) {
        for (int j = 0; j < NA; j++) m->W_ea[e][j] = cfem_dot(NA, J[e], m->W_aa[j]);
        m->free_e[e] = here->delta_e[e] - cfem_dot(NA, m->W_ea[e], m->lambda_a);
    }
    return CFEM_OK;
}

/* The robot stands where the last command leads. */
static unsigned settle(cfem_touch_controller *c) {
    const unsigned status = go(c, c->controller.delta_a);
    if (status) return status;
    c->at = c->here;
    memcpy(c->delta_a, c->here_delta_a, sizeof c->here_delta_a);
    return status;
}

/* Away from where no plan is found: the actuators go a step of a way towards home, as far as one tick may, and friction is forgotten. */
static void retreat(cfem_touch_controller *c, cfem_output *output) {
    double to[ALL_NA];
    for (int i = 0; i < NA; i++) {
        const double most = fmin(SHARE * cfem_patch_reach[i], cfem_delta_rate[i]), way = cfem_home[i] - c->controller.delta_a[i];
        c->controller.delta_a[i] += fmin(fmax(way, -most), most);
        c->controller.delta_a[i] = fmin(fmax(c->controller.delta_a[i], cfem_delta_low[i]), cfem_delta_high[i]);
        output->delta_a[i] = (cfem_real)c->controller.delta_a[i];
    }
    with_others(c, c->controller.delta_a, to);
    if (step(c, to, 0, &c->here)) return;
    c->at = c->here;
    memcpy(c->delta_a, to, sizeof to);
}

unsigned cfem_touch_control_init(cfem_touch_controller *c, const cfem_obstacle *obstacles, int count, double mu) {
    cfem_init(&c->controller);
    c->controller.ask = touched_model, c->controller.with = c;
    c->obstacles = obstacles, c->count = count, c->mu = mu, c->failed = 0;
#if CFEM_CONTACT == 2
    memcpy(c->robots, cfem_robots, sizeof c->robots);
    memset(c->robots[0].unilateral, 0, sizeof c->robots[0].unilateral);
    memset(c->others, 0, sizeof c->others);
#endif
    with_others(c, c->controller.delta_a, c->delta_a);
    return step(c, c->delta_a, 0, &c->at);
}

unsigned cfem_touch_control(cfem_touch_controller *c, const cfem_input *input, cfem_output *output) {
#if CFEM_MOST_HALVINGS
    c->controller.stands = 0; /* obstacles may have moved, and friction counts from here on */
#endif
    c->arrived = 0; /* obstacles may have moved */
    unsigned status = cfem_step(&c->controller, input, output);
    if (settle(c)) status |= CFEM_NO_MODEL;
    c->failed = status & CFEM_NO_MODEL ? c->failed + 1 : 0;
    if (c->failed >= CFEM_TOUCH_HELD) {
        retreat(c, output);
        status = CFEM_NO_MODEL | CFEM_RESTARTED;
    }
    return output->status = status | (known(&c->at) ? 0u : CFEM_OUTSIDE);
}
#else
typedef int cfem_touch_control_is_not_there; /* ISO C wants a declaration */
#endif
