/* The active set of a plan's program: cfem_plan.h says how. */
#include "cfem_plan.h"

#include <string.h>

#include "cfem_linear.h"
#include "cfem_program.h"

#define NA CFEM_MOTION_NA
#define V CFEM_MPC_VARIABLES
#define MOST_V CFEM_MPC_MOST_VARIABLES
#define OUTSIDE 1e-11   /* in shares of a bound's size: what is violated by less is not */
#define DEPENDENT 1e-11 /* squared length of a unit normal outside of the active ones: less depends on them */
#define MEETS 1e-9      /* bounds that exclude each other by less meet */
#define REFINEMENTS 3
#define ROW(k) (p->G + (k) * ((k) + 3) / 2)

static double priced(const cfem_plan *p, int i) { return p->softened && i >= CFEM_PROGRAM_SOFT ? p->price : 0.0; }

/* Solves G v = v, or G^T v = v, of the first `count` rows. */
static void down(const cfem_plan *p, int count, double *v) {
    for (int i = 0; i < count; i++) v[i] = (v[i] - cfem_dot(i, ROW(i), v)) / ROW(i)[i];
}
static void up(const cfem_plan *p, int count, double *v) {
    for (int i = count - 1; i >= 0; i--) {
        const double *row = ROW(i);
        v[i] /= row[i];
        for (int j = 0; j < i; j++) v[j] -= row[j] * v[i];
    }
}

/* Takes constraint number `slot` out of the active ones: its row of G, and by rotations what stands right of the diagonal then. */
static void drop(cfem_plan *p, int slot) {
    p->state[p->which[slot]] = 0;
    p->count--, p->changes++;
    for (int i = slot; i < p->count; i++) {
        memcpy(ROW(i), ROW(i + 1), sizeof(double) * (size_t)(i + 2));
        memcpy(p->N[i], p->N[i + 1], sizeof p->N[i]);
        p->which[i] = p->which[i + 1], p->sign[i] = p->sign[i + 1], p->force[i] = p->force[i + 1];
    }
    for (int j = slot; j < p->count; j++) {
        const double a = ROW(j)[j], b = ROW(j)[j + 1], length = sqrt(a * a + b * b), c = a / length, s = b / length;
        for (int i = j; i < p->count; i++) {
            double *row = ROW(i);
            const double one = row[j], other = row[j + 1];
            row[j] = c * one + s * other, row[j + 1] = c * other - s * one;
        }
    }
}

/* x and forces from scratch, which takes out what rounding has left. */
static void settle(cfem_plan *p) {
    double y[MOST_V] = {0};
    for (int i = 0; i < p->count; i++) {
        double low, high;
        int begin;
        cfem_program_row(p, p->which[i], 0, &begin, &low, &high);
        p->force[i] = (p->sign[i] > 0 ? low : -high) - p->sign[i] * cfem_program_at(p, p->which[i], p->best);
    }
    down(p, p->count, p->force);
    up(p, p->count, p->force);
    for (int i = 0; i < p->count; i++)
        for (int j = 0; j < V; j++) y[j] += p->force[i] * p->N[i][j];
    cfem_program_backward(p, y);
    for (int j = 0; j < V; j++) p->x[j] = p->best[j] + y[j];
}

/* Makes constraint i active, and drops those that it relieves. CFEM_PLAN_OPTIMAL, _INFEASIBLE or _STEPS. */
static int hold(cfem_plan *p, int i, double sign) {
    double normal[MOST_V], low, high, own = 0.0;
    int begin, end = cfem_program_row(p, i, normal, &begin, &low, &high);
    double by = (sign > 0 ? low : -high) - sign * cfem_program_at(p, i, p->x);
    for (int j = 0; j < V; j++) normal[j] = j >= begin && j < end ? sign * normal[j] : 0.0;
    cfem_program_forward(p, begin, normal);
    const double whole = cfem_dot(V, normal, normal) + priced(p, i);
    while (p->changes < 4 * CFEM_PROGRAM_COUNT) {
        const int count = p->count;
        double *share = ROW(count), r[CFEM_PLAN_ACTIVE], step[MOST_V], partial = HUGE_VAL;
        int slot = -1;
        for (int k = 0; k < count; k++) share[k] = cfem_dot(V, p->N[k], normal);
        down(p, count, share);
        double square = whole - cfem_dot(count, share, share);
        memcpy(r, share, sizeof(double) * (size_t)count);
        up(p, count, r);
        for (int k = 0; k < count; k++)
            if (r[k] > 1e-14 && p->force[k] < partial * r[k]) partial = p->force[k] / r[k], slot = k;
        const int apart = square > DEPENDENT * whole && count < CFEM_PLAN_ACTIVE;
        if (!apart && slot < 0) {
            p->state[i] = 2;
            return by > MEETS * cfem_program_size(i) ? CFEM_PLAN_INFEASIBLE : CFEM_PLAN_OPTIMAL;
        }
        const double full = apart ? by / square : HUGE_VAL, t = full < partial ? full : partial;
        for (int k = 0; k < count; k++) p->force[k] -= t * r[k];
        own += t;
        if (apart) {
            memcpy(step, normal, sizeof step);
            for (int k = 0; k < count; k++)
                for (int j = 0; j < V; j++) step[j] -= r[k] * p->N[k][j];
            cfem_program_backward(p, step);
            for (int j = 0; j < V; j++) p->x[j] += t * step[j];
            by -= t * square;
        }
        if (t < full) {
            drop(p, slot);
            continue;
        }
        share[count] = sqrt(square);
        memcpy(p->N[count], normal, sizeof normal);
        p->which[count] = i, p->sign[count] = sign, p->force[count] = own, p->state[i] = 1;
        p->count++, p->changes++;
        return CFEM_PLAN_OPTIMAL;
    }
    return CFEM_PLAN_STEPS;
}

/* The constraint that is violated most and may be added, -1: none. */
static int violated(const cfem_plan *p, double *sign) {
    double most = OUTSIDE;
    int found = -1;
    for (int i = 0; i < CFEM_PROGRAM_COUNT; i++) {
        if (p->state[i]) continue;
        double low, high;
        int begin;
        cfem_program_row(p, i, 0, &begin, &low, &high);
        if (low == -HUGE_VAL && high == HUGE_VAL) continue;
        const double value = cfem_program_at(p, i, p->x), below = low - value, above = value - high, by = fmax(below, above) / cfem_program_size(i);
        if (by > most) found = i, most = by, *sign = below > above ? 1.0 : -1.0;
    }
    return found;
}

static int search(cfem_plan *p) {
    int settled = 1;
    p->count = p->changes = 0;
    memset(p->state, 0, sizeof p->state);
    memcpy(p->x, p->best, sizeof p->x);
    while (p->changes < 4 * CFEM_PROGRAM_COUNT) {
        double sign = 1.0;
        const int i = violated(p, &sign);
        if (i >= 0) {
            settled = 0;
            const int status = hold(p, i, sign);
            if (status) return status;
            continue;
        }
        if (settled) return CFEM_PLAN_OPTIMAL;
        settle(p);
        settled = 1;
        int worst = -1;
        for (int k = 0; k < p->count; k++)
            if (p->force[k] < (worst < 0 ? 0.0 : p->force[worst])) worst = k;
        if (worst >= 0) { /* rounding had hidden that this one need not hold */
            drop(p, worst);
            settle(p);
            settled = 0;
        }
    }
    return CFEM_PLAN_STEPS;
}

/* Steps of iterative refinement on the active constraints, and what is left of the optimality conditions. */
static void refine(cfem_plan *p) {
    double unit = 0.0, left[CFEM_PLAN_ACTIVE], slope[MOST_V];
    for (int i = 0; i < V; i++) unit = fmax(unit, cfem_dot(i + 1, p->L[i], p->L[i]));
    for (int round = 0;; round++) {
        double off = 0.0;
        cfem_program_slope(p, p->x, slope);
        for (int k = 0; k < p->count; k++) {
            double row[MOST_V], low, high;
            int begin, i = p->which[k], end = cfem_program_row(p, i, row, &begin, &low, &high);
            const double bound = p->sign[k] > 0 ? low : -high;
            for (int j = begin; j < end; j++) slope[j] -= p->force[k] * p->sign[k] * row[j];
            left[k] = bound - p->sign[k] * cfem_program_at(p, i, p->x) - priced(p, i) * p->force[k];
            off = fmax(off, fabs(left[k]) / cfem_program_size(i));
        }
        for (int j = 0; j < V; j++) off = fmax(off, fabs(slope[j]) / unit), slope[j] = -slope[j];
        p->kkt = off;
        if (!(off > 1e-2 * CFEM_PLAN_TOLERANCE) || round == REFINEMENTS) return;
        cfem_program_forward(p, 0, slope);
        for (int k = 0; k < p->count; k++) left[k] -= cfem_dot(V, p->N[k], slope);
        down(p, p->count, left);
        up(p, p->count, left);
        for (int k = 0; k < p->count; k++) {
            p->force[k] = fmax(0.0, p->force[k] + left[k]);
            for (int j = 0; j < V; j++) slope[j] += left[k] * p->N[k][j];
        }
        cfem_program_backward(p, slope);
        for (int j = 0; j < V; j++) p->x[j] += slope[j];
    }
}

int cfem_plan_solve(cfem_plan *p) {
    p->count = p->changes = p->softened = 0;
    p->kkt = HUGE_VAL;
    if (cfem_program_factorise(p)) return CFEM_PLAN_FLAT;
    int status = search(p);
    if (status == CFEM_PLAN_INFEASIBLE) {
        p->softened = 1;
        status = search(p);
    }
    if (status) return status;
    refine(p);
    if (!(p->kkt <= CFEM_PLAN_TOLERANCE)) return CFEM_PLAN_INACCURATE;
    for (int j = 0; j < V; j++) { /* the box holds exactly */
        const int a = j % NA;
        p->x[j] = fmin(fmax(p->x[j] * cfem_mpc_size[a], cfem_mpc_command[a][0]), cfem_mpc_command[a][1]);
    }
    return CFEM_PLAN_OPTIMAL;
}
