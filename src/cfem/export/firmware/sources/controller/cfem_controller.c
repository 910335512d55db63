/* A tick of the controller (cfem_step): sample, observer, model, inverse step, and a command that is cut to its bounds. */
#include "cfem_far.h"
#include "cfem_inverse.h"
#include "cfem_linear.h"
#include "cfem_parts.h"

#define NA CFEM_NA
#define NE CFEM_NE
#define MOST_NA CFEM_MOST_NA
#define MOST_NE CFEM_MOST_NE

/* The model that the controller plans with. */
static unsigned query_model(const cfem_controller *c, const double *s, cfem_condensed *m) {
#if CFEM_CONTACT
    if (c->ask) return c->ask(c->with, s, m);
#else
    (void)c;
#endif
    return cfem_model(s, m);
}

static double clip(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

/* Amplitude limits cut down to what one tick may change: `rate` from the last command, a `share` of `step` from where the
 * actuators stand (here, mm). Where those lie outside of the amplitudes, what is left is the bound. */
static cfem_limits tick_limits(const cfem_controller *c, const double *here, double share) {
    cfem_limits l;
    for (int i = 0; i < NA; i++) {
        const double least = cfem_lambda_low[i], most = cfem_lambda_high[i];
        const double low = clip(c->delta_a[i] - cfem_delta_rate[i], cfem_delta_low[i], cfem_delta_high[i]);
        const double high = clip(c->delta_a[i] + cfem_delta_rate[i], cfem_delta_low[i], cfem_delta_high[i]);
        l.delta_low[i] = clip(here[i] - share * cfem_step_limit[i], low, high);
        l.delta_high[i] = clip(here[i] + share * cfem_step_limit[i], low, high);
        l.lambda_low[i] = clip(c->lambda_a[i] - cfem_lambda_rate[i], least, most);
        l.lambda_high[i] = clip(c->lambda_a[i] + cfem_lambda_rate[i], least, most);
    }
    return l;
}

/* Whether the actuators at a and at b (NA,) mm are the same to the tolerance of a search. */
static int same_place(const double *a, const double *b) {
    for (int i = 0; i < NA; i++)
        if (fabs(a[i] - b[i]) > cfem_tolerance[i]) return 0;
    return 1;
}

#if CFEM_MOST_HALVINGS
/* mm^2, what the inverse step minimises, at a state of the model, with an exact penalty on forces outside their bounds. */
static double merit(const cfem_condensed *m, const double *aim, double penalty) {
    double cost = 0.0, outside = 0.0;
    for (int e = 0; e < NE; e++) {
        const double missing = m->free_e[e] + cfem_dot(NA, m->W_ea[e], m->lambda_a) - aim[e];
        cost += cfem_effector_weight[e] * missing * cfem_effector_weight[e] * missing;
    }
    for (int i = 0; i < NA; i++) {
        const double lambda = m->lambda_a[i], least = cfem_lambda_low[i], most = cfem_lambda_high[i];
        cost += cfem_ridge[i] * m->delta_a[i] * cfem_ridge[i] * m->delta_a[i];
        outside += lambda < least ? least - lambda : lambda > most ? lambda - most : 0.0;
    }
    return 0.5 * cost + penalty * outside;
}

/* m becomes the model where the inverse step leads, of the longest of step, step / 2, step / 4, ... for which that is better;
 * it stays where none is, or where the step is shorter than cfem_tolerance. A shorter step, not a part of the step: what the
 * goal needs is still done, what hardly matters waits. Among obstacles, where friction makes that lead aside, it is a part of the step as
 * long as the limits leave it as long as it was. The status is of the first. */
static unsigned descend(const cfem_controller *c, cfem_condensed *m, const double *aim, int *moved) {
    double lambda_a[MOST_NA], delta_a[MOST_NA], strongest, share = 1.0;
#if CFEM_CONTACT
    double full_step[MOST_NA] = {0.0};
#endif
    unsigned first = CFEM_OK;
    *moved = 0;
    for (int halving = 0; halving < CFEM_HALVINGS; halving++, share *= 0.5) {
        const cfem_limits l = tick_limits(c, m->delta_a, share);
        const unsigned status = cfem_inverse_step(m, aim, &l, lambda_a, delta_a, &strongest);
        cfem_condensed trial;
        if (halving == 0) first = status;
        if ((status & CFEM_NO_QP) || same_place(delta_a, m->delta_a)) break;
#if CFEM_CONTACT
        for (int i = 0; i < NA && halving == 0; i++) full_step[i] = delta_a[i];
        const int unshortened = same_place(delta_a, full_step);
        for (int i = 0; i < NA && unshortened; i++) delta_a[i] = m->delta_a[i] + share * (delta_a[i] - m->delta_a[i]);
#endif
        if (query_model(c, CFEM_FORM_DISPLACEMENT ? delta_a : lambda_a, &trial)) continue;
        if (merit(&trial, aim, 2.0 * strongest) < merit(m, aim, 2.0 * strongest)) {
            *m = trial, *moved = 1;
            break;
        }
    }
    return first;
}
#endif

/* Where the robot stands, by the observer of cfem_data.h: the model there, and its input s. */
static unsigned observe(const cfem_controller *c, const cfem_input *in, double *s, cfem_condensed *m) {
    double wanted[MOST_NA];
#if CFEM_MOST_HALVINGS
    if (CFEM_HALVINGS && CFEM_OBSERVER != CFEM_OBSERVER_MEASURED && c->stands) {
        *m = c->at;
        return CFEM_OK;
    }
#endif
    for (int i = 0; i < NA; i++) {
        s[i] = CFEM_FORM_DISPLACEMENT ? c->delta_a[i] : c->lambda_a[i];
        wanted[i] = CFEM_OBSERVER == CFEM_OBSERVER_MEASURED ? (double)in->delta_a[i]
                    : CFEM_COMMAND_FORCE                    ? c->lambda_a[i]
                                                            : c->delta_a[i];
    }
    if (CFEM_OBSERVER == CFEM_OBSERVER_PREVIOUS_STEP) return query_model(c, s, m);
    if ((CFEM_OBSERVER == CFEM_OBSERVER_EQUILIBRIUM && CFEM_COMMAND_FORCE) == CFEM_FORM_DISPLACEMENT)
        return cfem_find(wanted, s, m);
    for (int i = 0; i < NA; i++) s[i] = wanted[i]; /* what is known is what the model takes */
    return query_model(c, s, m);
}

unsigned cfem_outside(const cfem_condensed *m) {
    for (int i = 0; i < NA; i++) {
        double along = 0.0;
        for (int j = 0; j < NA; j++) along += cfem_domain_axes[i][j] * m->delta_a[j];
        if (m->delta_a[i] < cfem_domain_delta_a[0][i] || m->delta_a[i] > cfem_domain_delta_a[1][i] ||
            m->lambda_a[i] < cfem_domain_lambda_a[0][i] || m->lambda_a[i] > cfem_domain_lambda_a[1][i] ||
            along < cfem_domain_along[0][i] || along > cfem_domain_along[1][i])
            return CFEM_OUTSIDE;
    }
    return CFEM_OK;
}

/* CFEM_OK, or CFEM_HELD with what is wrong with the input. */
static unsigned input_status(const cfem_input *in) {
    double goal[MOST_NE];
    int good = 1;
    for (int e = 0; e < NE; e++) goal[e] = (double)in->goal[e], good &= cfem_finite(goal[e]);
    if (CFEM_OBSERVER == CFEM_OBSERVER_MEASURED)
        for (int i = 0; i < NA; i++) good &= cfem_finite((double)in->delta_a[i]);
    return !good ? CFEM_HELD | CFEM_BAD_INPUT : cfem_is_far(goal) ? CFEM_HELD | CFEM_BAD_INPUT | CFEM_FAR : CFEM_OK;
}

static unsigned answer(const cfem_controller *c, unsigned status, cfem_output *out) {
    for (int i = 0; i < NA; i++) {
        out->delta_a[i] = (cfem_real)c->delta_a[i];
        out->lambda_a[i] = (cfem_real)c->lambda_a[i];
    }
    for (int e = 0; e < NE; e++) out->reference[e] = (cfem_real)c->reference[e];
    out->tick = c->feedback.given;
    return out->status = status;
}

/* The command is held. A correction so large that it has no command would hold it for ever, as no sample corrects before the next
 * command, so it is dropped. */
static unsigned hold(cfem_controller *c, unsigned status, cfem_output *out) {
    cfem_feedback_drop(&c->feedback);
    return answer(c, CFEM_HELD | status, out);
}

/* expected (NE,) mm, absolute: where the model then has the effectors. */
static void remember(cfem_controller *c, const cfem_condensed *m, const double *lambda_a, const double *delta_a,
                     double *expected) {
    for (int i = 0; i < NA; i++) c->lambda_a[i] = lambda_a[i], c->delta_a[i] = delta_a[i];
    for (int e = 0; e < NE; e++) {
        expected[e] = cfem_rest_e[e] + m->free_e[e] + cfem_dot(NA, m->W_ea[e], lambda_a);
        c->reference[e] = expected[e] - c->feedback.moved[e];
    }
#if CFEM_MOST_HALVINGS
    c->at = *m, c->stands = 1;
    for (int i = 0; i < NA; i++)
        if ((CFEM_COMMAND_FORCE ? lambda_a[i] != m->lambda_a[i] : delta_a[i] != m->delta_a[i])) c->stands = 0;
#endif
}

void cfem_init(cfem_controller *c) {
    cfem_condensed m;
    double expected[MOST_NE];
    cfem_feedback_init(&c->feedback);
#if CFEM_CONTACT
    c->ask = 0, c->with = 0;
#endif
    const unsigned status = cfem_model(cfem_home, &m);
    remember(c, &m, m.lambda_a, m.delta_a, expected);
#if CFEM_MOST_HALVINGS
    if (status) c->stands = 0; /* the first tick asks again, and says so */
#else
    (void)status;
#endif
}

unsigned cfem_step(cfem_controller *c, const cfem_input *in, cfem_output *out) {
    double aim[MOST_NE], expected[MOST_NE], s[MOST_NA], delta_a[MOST_NA], lambda_a[MOST_NA];
    cfem_condensed m;
    cfem_limits l;
    const unsigned wrong = input_status(in);
    if (wrong) return answer(c, wrong, out);
    unsigned qualifiers = cfem_feedback_hear(&c->feedback, in->tick, in->x_e), status = CFEM_OK;
    for (int e = 0; e < NE; e++) aim[e] = (double)in->goal[e] + c->feedback.moved[e] - cfem_rest_e[e]; /* the goal shift */

    qualifiers |= observe(c, in, s, &m);
    if (qualifiers & CFEM_NO_MODEL) return answer(c, CFEM_HELD | qualifiers, out);
    for (int iteration = 0;; iteration++) {
        qualifiers |= cfem_outside(&m);
        l = tick_limits(c, m.delta_a, 1.0);
#if CFEM_MOST_HALVINGS
        if (CFEM_HALVINGS) {
            int moved;
            status = descend(c, &m, aim, &moved);
            if (status & CFEM_NO_QP) return hold(c, status | qualifiers, out);
            if (!moved) status |= cfem_verdict(&m, aim);
            if (!moved || iteration == CFEM_ITERATIONS - 1) break;
            continue;
        }
#endif
        double strongest;
        status = cfem_inverse_step(&m, aim, &l, lambda_a, delta_a, &strongest);
        if (status & CFEM_NO_QP) return hold(c, status | qualifiers, out);
        if (same_place(delta_a, m.delta_a)) status |= cfem_verdict(&m, aim);
        if (iteration == CFEM_ITERATIONS - 1) break;
        for (int i = 0; i < NA; i++) s[i] = CFEM_FORM_DISPLACEMENT ? delta_a[i] : lambda_a[i];
        const unsigned no_model = query_model(c, s, &m);
        if (no_model) return hold(c, no_model | qualifiers, out);
    }
    for (int i = 0; i < NA; i++) { /* the command keeps its bounds, also where the program softened them */
        if (CFEM_HALVINGS) delta_a[i] = m.delta_a[i], lambda_a[i] = m.lambda_a[i];
        if (CFEM_COMMAND_FORCE)
            lambda_a[i] = clip(lambda_a[i], l.lambda_low[i], l.lambda_high[i]);
        else
            delta_a[i] = clip(delta_a[i], l.delta_low[i], l.delta_high[i]);
    }
    remember(c, &m, lambda_a, delta_a, expected);
    cfem_feedback_commanded(&c->feedback, expected);
    return answer(c, status | qualifiers, out);
}
