/* The inverse step as a quadratic program in lambda_a, and whether a goal is out of reach. */
#include "cfem_inverse.h"

#include "cfem_linear.h"
#include "cfem_qp.h"

#define NA CFEM_NA
#define NE CFEM_NE
#define MOST_NA CFEM_MOST_NA
#define MOST_NE CFEM_MOST_NE
#define NEARER 5e-3  /* of the miss: a robot that could come nearer by less is as near as it gets */
#define ARRIVED 1e-4 /* of how far a full stroke moves the effectors: a smaller miss is none */

/* nearest (NA,): delta_a that comes nearest to the course with forces within their bounds: one program in lambda and the place
 * s in the course, minimising |W_aa lambda + free_a - s|^2. */
static int nearest_to_course(const cfem_condensed *m, const cfem_limits *l, double *nearest) {
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

unsigned cfem_inverse_step(const cfem_condensed *m, const double *aim, const cfem_limits *l, double *lambda_a, double *delta_a,
                           double *strongest) {
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
        const double slack = CFEM_TOLERANCE(1e-9, 1e-5) * widest + 1e-12;
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

unsigned cfem_verdict(const cfem_condensed *m, const double *aim) {
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
