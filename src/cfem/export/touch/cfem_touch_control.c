#include "cfem_touch_control.h"

#include "cfem_linear.h"

#if CFEM_CONTACT
#define NA CFEM_NA
#define NE CFEM_NE

static const double STEP = 1e-4, SHARE = 0.05; /* of the reach: of differences; of a quasi-static step under friction */

static unsigned step(cfem_touch_controller *c, const double *delta_a, const cfem_touched *before, cfem_touched *now) {
    return cfem_touch(delta_a, c->obstacles, c->count, c->mu, before, now, &c->room);
}

/* `here` at delta_a from where the robot stands; with friction the way is gone in steps. `near`: where the last of them begins. */
static unsigned go(cfem_touch_controller *c, const double *delta_a) {
    double longest = 0.0, on[NA];
    c->near = c->at;
    for (int i = 0; i < NA && c->mu > 0.0; i++) {
        const double way = fabs(delta_a[i] - c->delta_a[i]) / (SHARE * cfem_patch_reach[i]);
        if (way > longest) longest = way;
    }
    const int steps = longest > 1.0 ? (int)ceil(longest < 1e3 ? longest : 1e3) : 1;
    for (int k = 1; k < steps; k++) {
        for (int i = 0; i < NA; i++) on[i] = c->delta_a[i] + (delta_a[i] - c->delta_a[i]) * k / steps;
        const unsigned status = step(c, on, &c->near, &c->here);
        if (status) return status;
        c->near = c->here;
    }
    return step(c, delta_a, &c->near, &c->here);
}

/* As cfem_model, of the robot that obstacles touch: derivatives are central differences of contact states. */
static unsigned touched_model(void *with, const double *s, cfem_condensed *m) {
    cfem_touch_controller *const c = with;
    double J[NE][NA], K[NA][NA], to[NA];
    if (cfem_model(s, m) || go(c, s)) return CFEM_NO_MODEL;
    for (int p = 0; p < CFEM_PATCHES; p++) { /* forces are like those here, friction counts from where the step began */
        c->here.holds[p] = c->near.holds[p];
        for (int a = 0; a < 3; a++) c->here.stuck[p][a] = c->near.stuck[p][a], c->here.place[p][a] = c->near.place[p][a];
    }
    for (int j = 0; j < NA; j++) {
        const double h = STEP * cfem_patch_reach[j];
        for (int i = 0; i < NA; i++) to[i] = s[i] + (i == j ? h : 0.0);
        if (step(c, to, &c->here, &c->ahead)) return CFEM_NO_MODEL;
        to[j] = s[j] - h;
        if (step(c, to, &c->here, &c->behind)) return CFEM_NO_MODEL;
        for (int e = 0; e < NE; e++) J[e][j] = (c->ahead.delta_e[e] - c->behind.delta_e[e]) / (2.0 * h);
        for (int i = 0; i < NA; i++) K[i][j] = (c->ahead.lambda_a[i] - c->behind.lambda_a[i]) / (2.0 * h);
    }
    for (int i = 0; i < NA; i++)
        for (int j = 0; j < NA; j++) m->W_aa[i][j] = (K[i][j] + K[j][i]) / 2.0;
    if (cfem_invert(NA, CFEM_MOST_NA, &m->W_aa[0][0])) return CFEM_NO_MODEL;
    for (int i = 0; i < NA; i++) m->lambda_a[i] = c->here.lambda_a[i];
    for (int i = 0; i < NA; i++) m->free_a[i] = s[i] - cfem_dot(NA, m->W_aa[i], m->lambda_a);
    for (int e = 0; e < NE; e++) {
        for (int j = 0; j < NA; j++) m->W_ea[e][j] = cfem_dot(NA, J[e], m->W_aa[j]);
        m->free_e[e] = c->here.delta_e[e] - cfem_dot(NA, m->W_ea[e], m->lambda_a);
    }
    return CFEM_OK;
}

/* The robot stands where the last command leads. */
static unsigned settle(cfem_touch_controller *c) {
    const unsigned status = go(c, c->controller.delta_a);
    if (status) return status;
    c->at = c->here;
    for (int i = 0; i < NA; i++) c->delta_a[i] = c->controller.delta_a[i];
    return status;
}

unsigned cfem_touch_control_init(cfem_touch_controller *c, const cfem_obstacle *obstacles, int count, double mu) {
    cfem_init(&c->controller);
    c->controller.ask = touched_model, c->controller.with = c;
    c->obstacles = obstacles, c->count = count, c->mu = mu;
    for (int i = 0; i < NA; i++) c->delta_a[i] = c->controller.delta_a[i];
    return step(c, c->delta_a, 0, &c->at);
}

unsigned cfem_touch_control(cfem_touch_controller *c, const cfem_input *input, cfem_output *output) {
#if CFEM_MOST_HALVINGS
    c->controller.stands = 0; /* obstacles may have moved, and friction counts from here on */
#endif
    const unsigned status = cfem_step(&c->controller, input, output);
    return output->status = status | (settle(c) ? CFEM_NO_MODEL : 0u);
}
#else
typedef int cfem_touch_control_is_not_there; /* ISO C wants a declaration */
#endif
