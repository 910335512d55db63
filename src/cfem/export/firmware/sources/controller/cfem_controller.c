#include "cfem.h"
#include "cfem_linear.h"
#include "cfem_parts.h"
#include "cfem_qp.h"

#define NA CFEM_NA
#define NE CFEM_NE
#define MOST_NA CFEM_MOST_NA
#define MOST_NE CFEM_MOST_NE

typedef struct {
    double lambda_low[MOST_NA], lambda_high[MOST_NA]; /* N */
    double delta_low[MOST_NA], delta_high[MOST_NA];   /* mm */
} limits;

/* The model that the controller plans with. */
static unsigned ask(const cfem_controller *c, const double *s, cfem_condensed *m) {
#if CFEM_CONTACT
    if (c->ask) return c->ask(c->with, s, m);
#else
    (void)c;
#endif
    return cfem_model(s, m);
}

#define NEARER 5e-3  /* of the miss: a robot that could come nearer by less is as near as it gets */
#define ARRIVED 1e-4 /* of how far a full stroke moves the effectors: a smaller miss is none */

static double clip(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

/* Amplitude limits cut down to what one tick may change: `rate` from the last command, a `share` of `step` from where the
 * actuators stand (here, mm). Where those lie outside of the amplitudes, what is left is the bound. */
static limits of_this_tick(const cfem_controller *c, const double *here, double share) {
    limits l;
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

/* nearest (NA,): delta_a that comes nearest to the course with forces within their bounds: one program in lambda and the place
 * s in the course, minimising |W_aa lambda + free_a - s|^2. */
static int nearest_to_course(const cfem_condensed *m, const limits *l, double *nearest) {
    double M[3 * MOST_NA * 2 * MOST_NA], d[3 * MOST_NA], low[2 * MOST_NA], high[2 * MOST_NA];
    cfem_qp_answer answer;
    for (int i = 0; i < 3 * NA; i++) {
        d[i] = i < NA ? -m->free_a[i] : 0.0;
        for (int j = 0; j < 2 * NA; j++) M[i * 2 * NA + j] = 0.0;
    }
    for (int i = 0; i < NA; i++) {
        double square = 0.0, *const row = M + i * 2 * NA;
        for (int j = 0; j < NA; j++) row[j] = m->W_aa[i][j], square += m->W_aa[j][i] * m->W_aa[j][i];
        row[NA + i] = -1.0;
        /* Any s with its lambda is as good: a trace of curvature picks one. */
        M[(NA + i) * 2 * NA + i] = 1e-5 * sqrt(square);
        M[(2 * NA + i) * 2 * NA + NA + i] = 1e-5;
        low[i] = l->lambda_low[i], high[i] = l->lambda_high[i];
        low[NA + i] = l->delta_low[i], high[NA + i] = l->delta_high[i];
    }
    const int status = cfem_qp(2 * NA, 3 * NA, M, d, 0, 0, 0, low, high, &answer);
    for (int i = 0; i < NA; i++) nearest[i] = m->free_a[i] + cfem_dot(NA, m->W_aa[i], answer.x);
    return status;
}

/* The inverse step at the model m: lambda_a (NA,), delta_a (NA,) mm, and the strongest multiplier of a force's bound.
 * aim (NE,) mm from rest. */
static unsigned inverse_step(const cfem_condensed *m, const double *aim, const limits *l, double *lambda_a,
                             double *delta_a, double *strongest) {
    double M[(MOST_NE + MOST_NA) * MOST_NA], d[MOST_NE + MOST_NA], low[2 * MOST_NA], high[2 * MOST_NA];
    cfem_qp_answer answer;
    unsigned status = CFEM_OK;
    for (int e = 0; e < NE; e++) {
        for (int j = 0; j < NA; j++) M[e * NA + j] = cfem_effector_weight[e] * m->W_ea[e][j];
        d[e] = cfem_effector_weight[e] * (aim[e] - m->free_e[e]);
    }
    for (int i = 0; i < NA; i++) {
        /* |r delta_a|^2 + |d (delta_a - here)|^2 is |h delta_a - d^2 here / h|^2, h^2 = r^2 + d^2, and a constant. */
        const double r = cfem_ridge[i], held = cfem_damping[i], h = sqrt(r * r + held * held);
        for (int j = 0; j < NA; j++) M[(NE + i) * NA + j] = h * m->W_aa[i][j];
        d[NE + i] = held * held / h * m->delta_a[i] - h * m->free_a[i];
        low[i] = l->lambda_low[i], high[i] = l->lambda_high[i];
        low[NA + i] = l->delta_low[i] - m->free_a[i], high[NA + i] = l->delta_high[i] - m->free_a[i];
    }
    int solved = cfem_qp(NA, NE + NA, M, d, NA, &m->W_aa[0][0], MOST_NA, low, high, &answer);
    if (solved == CFEM_QP_INFEASIBLE) {
        double nearest[MOST_NA], widest = 0.0;
        if (nearest_to_course(m, l, nearest) != CFEM_QP_OPTIMAL) return CFEM_NO_QP;
        status |= CFEM_SOFTENED;
        for (int i = 0; i < NA; i++)
            if (high[NA + i] - low[NA + i] > widest) widest = high[NA + i] - low[NA + i];
        const double slack = 1e-9 * widest + 1e-12;
        for (int i = 0; i < NA; i++) {
            const double at = nearest[i] - m->free_a[i];
            if (low[NA + i] > at - slack) low[NA + i] = at - slack;
            if (high[NA + i] < at + slack) high[NA + i] = at + slack;
        }
        solved = cfem_qp(NA, NE + NA, M, d, NA, &m->W_aa[0][0], MOST_NA, low, high, &answer);
    }
    if (solved != CFEM_QP_OPTIMAL) return CFEM_NO_QP;
    *strongest = 0.0;
    for (int k = 0; k < 2 * NA; k++) {
        if (answer.multipliers[k] != 0.0) status |= CFEM_LIMITED;
        if (k < NA && fabs(answer.multipliers[k]) > *strongest) *strongest = fabs(answer.multipliers[k]);
    }
    for (int i = 0; i < NA; i++) {
        lambda_a[i] = answer.x[i];
        delta_a[i] = m->free_a[i] + cfem_dot(NA, m->W_aa[i], answer.x);
    }
    return status;
}

/* Whether a and b (NA,) mm are as good as the same. */
static int together(const double *a, const double *b) {
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
    double whole[MOST_NA] = {0.0};
#endif
    unsigned first = CFEM_OK;
    *moved = 0;
    for (int halving = 0; halving < CFEM_HALVINGS; halving++, share *= 0.5) {
        const limits l = of_this_tick(c, m->delta_a, share);
        const unsigned status = inverse_step(m, aim, &l, lambda_a, delta_a, &strongest);
        cfem_condensed trial;
        if (halving == 0) first = status;
        if ((status & CFEM_NO_QP) || together(delta_a, m->delta_a)) break;
#if CFEM_CONTACT
        for (int i = 0; i < NA && halving == 0; i++) whole[i] = delta_a[i];
        const int as_long = together(delta_a, whole);
        for (int i = 0; i < NA && as_long; i++) delta_a[i] = m->delta_a[i] + share * (delta_a[i] - m->delta_a[i]);
#endif
        if (ask(c, CFEM_FORM_DISPLACEMENT ? delta_a : lambda_a, &trial)) continue;
        if (merit(&trial, aim, 2.0 * strongest) < merit(m, aim, 2.0 * strongest)) {
            *m = trial, *moved = 1;
            break;
        }
    }
    return first;
}
#endif

/* mm, weighted, between the effectors of the linearised robot m under lambda_a (NA,) and the aim. */
static double missed(const cfem_condensed *m, const double *aim, const double *lambda_a) {
    double square = 0.0;
    for (int e = 0; e < NE; e++) {
        const double missing = cfem_effector_weight[e] * (m->free_e[e] + cfem_dot(NA, m->W_ea[e], lambda_a) - aim[e]);
        square += missing * missing;
    }
    return sqrt(square);
}

/* mm, weighted, that the full stroke of an actuator moves the effectors here: the largest. W_ea = J W_aa. */
static double effect(const cfem_condensed *m) {
    double inverse[MOST_NA][MOST_NA], most = 0.0;
    for (int i = 0; i < NA; i++)
        for (int j = 0; j < NA; j++) inverse[i][j] = m->W_aa[i][j];
    if (cfem_invert(NA, MOST_NA, &inverse[0][0])) return 0.0;
    for (int i = 0; i < NA; i++) {
        double square = 0.0;
        for (int e = 0; e < NE; e++) {
            const double slope = cfem_effector_weight[e] * cfem_dot(NA, m->W_ea[e], inverse[i]); /* it is symmetric */
            square += slope * slope;
        }
        most = fmax(most, sqrt(square) * (cfem_delta_high[i] - cfem_delta_low[i]));
    }
    return most;
}

/* CFEM_OUT_OF_REACH where m is the nearest point to the aim, as in Python's cfem.control.search.optimality: the linearised robot comes
 * no nearer within the bounds of force and course, and what regularises this program hardly counts. */
static unsigned verdict(const cfem_condensed *m, const double *aim) {
    double M[(MOST_NE + MOST_NA) * MOST_NA], d[MOST_NE + MOST_NA], low[2 * MOST_NA], high[2 * MOST_NA];
    cfem_qp_answer answer;
    const double here = missed(m, aim, m->lambda_a);
    if (here <= ARRIVED * effect(m)) return CFEM_OK;
    for (int e = 0; e < NE; e++) {
        for (int j = 0; j < NA; j++) M[e * NA + j] = cfem_effector_weight[e] * m->W_ea[e][j];
        d[e] = cfem_effector_weight[e] * (aim[e] - m->free_e[e]);
    }
    for (int i = 0; i < NA; i++) {
        for (int j = 0; j < NA; j++) M[(NE + i) * NA + j] = cfem_least_ridge[i] * m->W_aa[i][j];
        d[NE + i] = -cfem_least_ridge[i] * m->free_a[i];
        low[i] = cfem_lambda_low[i], high[i] = cfem_lambda_high[i];
        low[NA + i] = cfem_delta_low[i] - m->free_a[i], high[NA + i] = cfem_delta_high[i] - m->free_a[i];
    }
    if (cfem_qp(NA, NE + NA, M, d, NA, &m->W_aa[0][0], MOST_NA, low, high, &answer) != CFEM_QP_OPTIMAL) return CFEM_OK;
    return here - missed(m, aim, answer.x) <= NEARER * here ? CFEM_OUT_OF_REACH : CFEM_OK;
}

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
    if (CFEM_OBSERVER == CFEM_OBSERVER_PREVIOUS_STEP) return ask(c, s, m);
    if ((CFEM_OBSERVER == CFEM_OBSERVER_EQUILIBRIUM && CFEM_COMMAND_FORCE) == CFEM_FORM_DISPLACEMENT)
        return cfem_find(wanted, s, m);
    for (int i = 0; i < NA; i++) s[i] = wanted[i]; /* what is known is what the model takes */
    return ask(c, s, m);
}

static unsigned outside(const cfem_condensed *m) {
    for (int i = 0; i < NA; i++)
        if (m->delta_a[i] < cfem_domain_delta_a[0][i] || m->delta_a[i] > cfem_domain_delta_a[1][i] ||
            m->lambda_a[i] < cfem_domain_lambda_a[0][i] || m->lambda_a[i] > cfem_domain_lambda_a[1][i])
            return CFEM_OUTSIDE;
    return CFEM_OK;
}

/* 0, or what is wrong with the input. */
static unsigned complaint(const cfem_input *in) {
    int good = 1, far = 0;
    for (int e = 0; e < NE; e++) {
        good &= cfem_finite((double)in->goal[e]);
        far |= fabs((double)in->goal[e] - cfem_rest_e[e]) > cfem_far[e];
    }
    if (CFEM_OBSERVER == CFEM_OBSERVER_MEASURED)
        for (int i = 0; i < NA; i++) good &= cfem_finite((double)in->delta_a[i]);
    return !good ? CFEM_HELD | CFEM_BAD_INPUT : far ? CFEM_HELD | CFEM_BAD_INPUT | CFEM_FAR : CFEM_OK;
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
    limits l;
    const unsigned wrong = complaint(in);
    if (wrong) return answer(c, wrong, out);
    unsigned found = cfem_feedback_hear(&c->feedback, in->tick, in->x_e), status = CFEM_OK;
    for (int e = 0; e < NE; e++) aim[e] = (double)in->goal[e] + c->feedback.moved[e] - cfem_rest_e[e]; /* the goal shift */

    found |= observe(c, in, s, &m);
    if (found & CFEM_NO_MODEL) return answer(c, CFEM_HELD | found, out);
    for (int iteration = 0;; iteration++) {
        found |= outside(&m);
        l = of_this_tick(c, m.delta_a, 1.0);
#if CFEM_MOST_HALVINGS
        if (CFEM_HALVINGS) {
            int moved;
            status = descend(c, &m, aim, &moved);
            if (status & CFEM_NO_QP) return hold(c, status | found, out);
            if (!moved) status |= verdict(&m, aim);
            if (!moved || iteration == CFEM_ITERATIONS - 1) break;
            continue;
        }
#endif
        double strongest;
        status = inverse_step(&m, aim, &l, lambda_a, delta_a, &strongest);
        if (status & CFEM_NO_QP) return hold(c, status | found, out);
        if (together(delta_a, m.delta_a)) status |= verdict(&m, aim);
        if (iteration == CFEM_ITERATIONS - 1) break;
        for (int i = 0; i < NA; i++) s[i] = CFEM_FORM_DISPLACEMENT ? delta_a[i] : lambda_a[i];
        const unsigned there = ask(c, s, &m);
        if (there) return hold(c, there | found, out);
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
    return answer(c, status | found, out);
}
