/* A plan's program for its active set: cfem_plan.h says how. */
#include "cfem_plan.h"

#include <string.h>

#include "cfem_linear.h"
#include "cfem_program.h"

#define NA CFEM_MOTION_NA
#define V CFEM_MPC_VARIABLES
#define MOST_V CFEM_MPC_MOST_VARIABLES
#define OUTSIDE CFEM_TOLERANCE(1e-11, 1e-5) /* in shares of a bound's size: what is violated by less is not */
#define MEETS CFEM_TOLERANCE(1e-9, 1e-4) /* bounds that exclude each other by less meet */
#define ATTEMPTS CFEM_TOLERANCE(1, 4) /* of a program that is softened, each with less of a price: high ones are inaccurate in single precision */
#define SOFTER 4.0

static double price_of(const cfem_plan *p, int i) { return p->softened && i >= CFEM_PROGRAM_SOFT ? p->price : 0.0; }

/* Writes the commands x (V,) of the coordinates y (V,) of the active set. */
static void to_commands(cfem_plan *p, const double *y) {
    memcpy(p->x, y, sizeof(double) * (size_t)V);
    cfem_program_backward(p, p->x);
    for (int j = 0; j < V; j++) p->x[j] += p->best[j];
}

/* The constraint that is violated most, as a cfem_program has it. */
static int violated(void *with, const double *y, const unsigned char *state, double *sign) {
    cfem_plan *const p = with;
    double most = OUTSIDE;
    int which = -1;
    to_commands(p, y);
    for (int i = 0; i < CFEM_PROGRAM_COUNT; i++) {
        if (state[i]) continue;
        double low, high;
        int begin;
        cfem_program_row(p, i, 0, &begin, &low, &high);
        if (low == -HUGE_VAL && high == HUGE_VAL) continue;
        const double value = cfem_program_at(p, i, p->x), below = low - value, above = value - high;
        const double missed = below > above ? below : above;
        if (!(missed > 0.0)) continue;
        const double by = missed / cfem_program_size(i);
        if (by > most) which = i, most = by, *sign = below > above ? 1.0 : -1.0;
    }
    return which;
}

static cfem_bound bound(void *with, int i, double sign, double *normal) {
    const cfem_plan *const p = with;
    double low, high;
    int begin, end = cfem_program_row(p, i, normal, &begin, &low, &high);
    for (int j = 0; j < V; j++) normal[j] = j >= begin && j < end ? sign * normal[j] : 0.0;
    cfem_program_forward(p, begin, normal);
    const double level = (sign > 0 ? low : -high) - sign * cfem_program_at(p, i, p->best);
    return (cfem_bound){level, price_of(p, i), MEETS * cfem_program_size(i)};
}

/* Steps of iterative refinement on the active constraints, and what is left of the optimality conditions. */
static void refine(cfem_plan *p, cfem_active *set) {
    double unit = 0.0, left[CFEM_PLAN_ACTIVE], slope[MOST_V];
    for (int i = 0; i < V; i++) unit = cfem_larger(cfem_dot(i + 1, p->L[i], p->L[i]), unit);
    for (int round = 0;; round++) {
        double largest = 0.0, pull = unit; /* the largest slope that forces have to balance */
        cfem_program_slope(p, p->x, slope);
        for (int k = 0; k < set->count; k++) {
            double row[MOST_V], low, high;
            int begin, i = set->which[k], end = cfem_program_row(p, i, row, &begin, &low, &high);
            for (int j = begin; j < end; j++) {
                const double by = set->force[k] * set->sign[k] * row[j];
                slope[j] -= by;
                if (CFEM_TOLERANCE(0, 1)) pull = cfem_larger(fabs(by), pull);
            }
            left[k] = (set->sign[k] > 0 ? low : -high) - set->sign[k] * cfem_program_at(p, i, p->x) - price_of(p, i) * set->force[k];
            largest = cfem_larger(fabs(left[k]) / cfem_program_size(i), largest);
        }
        for (int j = 0; j < V; j++) largest = cfem_larger(fabs(slope[j]) / pull, largest), slope[j] = -slope[j];
        p->kkt = largest;
        if (!(largest > 1e-2 * CFEM_QP_TOLERANCE) || round == CFEM_QP_REFINEMENTS) return;
        cfem_program_forward(p, 0, slope);
        cfem_active_refine(set, left, slope);
        cfem_program_backward(p, slope);
        for (int j = 0; j < V; j++) p->x[j] += slope[j];
    }
}

/* The status. */
static int solve_refined(cfem_plan *p, cfem_active *set, const cfem_program *program, double *y) {
    const int status = cfem_active_solve(set, program, 4 * CFEM_PROGRAM_COUNT, y);
    if (status) return status;
    refine(p, set);
    return p->kkt <= CFEM_QP_TOLERANCE ? CFEM_QP_OPTIMAL : CFEM_QP_INACCURATE;
}

int cfem_plan_solve(cfem_plan *p, cfem_plan_factors *f) {
    double y[MOST_V];
    cfem_active set = {V, CFEM_PROGRAM_COUNT, CFEM_PLAN_ACTIVE, 0, p->state, p->which, p->sign, p->bound, p->force, f->Q, f->R, 0, 0};
    const cfem_program program = {violated, bound, p};
    p->count = p->softened = 0;
    p->kkt = HUGE_VAL;
    if (cfem_program_factorise(p)) return CFEM_QP_FLAT;
    int status = solve_refined(p, &set, &program, y);
    if (status == CFEM_QP_INFEASIBLE) {
        p->softened = set.priced = 1;
        for (int attempt = 0; attempt < ATTEMPTS && status; attempt++, p->price *= SOFTER) status = solve_refined(p, &set, &program, y);
    }
    p->count = set.count;
    if (status) return status;
    for (int j = 0; j < V; j++) { /* the box holds exactly, and the rate of the command that is sent */
        const int a = j % NA;
        const double rate = j < NA ? cfem_mpc_rate[a] : HUGE_VAL, low = p->previous[a] - rate, high = p->previous[a] + rate;
        p->x[j] = fmin(fmax(fmin(fmax(p->x[j] * cfem_mpc_size[a], low), high), cfem_mpc_command[a][0]), cfem_mpc_command[a][1]);
    }
    return CFEM_QP_OPTIMAL;
}
