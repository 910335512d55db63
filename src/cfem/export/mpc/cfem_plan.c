#include "cfem_plan.h"

#include <string.h>

#include "cfem_linear.h"

#define NA CFEM_MOTION_NA
#define NE CFEM_MOTION_NE
#define TICKS CFEM_MPC_TICKS
#define MOVES CFEM_MPC_MOVES
#define PLANES CFEM_MPC_PLANES
#define V CFEM_MPC_VARIABLES
#define MOST_V CFEM_MPC_MOST_VARIABLES
#define SOFT (2 * V) /* the first constraint on what the robot does: before are the box and the rates */
#define COUNT (SOFT + TICKS * (NA + PLANES))
#define OUTSIDE 1e-11   /* in shares of a bound's size: what is violated by less is not */
#define DEPENDENT 1e-11 /* squared length of a unit normal outside of the active ones: less depends on them */
#define MEETS 1e-9      /* bounds that exclude each other by less meet */
#define REFINEMENTS 3
#define ROW(k) (p->G + (k) * ((k) + 3) / 2)

static double size_of(int i) {
    if (i < SOFT) return 1.0;
    return (i - SOFT) / TICKS < NA ? cfem_mpc_course_size[(i - SOFT) / TICKS] : CFEM_MPC_LENGTH;
}

/* Constraint i: its row is zero outside of [*begin, end), and there written to `row`, which may be NULL. Returns end; its bounds. */
static int constraint(const cfem_plan *p, int i, double *row, int *begin, double *low, double *high) {
    *low = -HUGE_VAL, *high = HUGE_VAL;
    if (i < V) {
        *low = cfem_mpc_command[i % NA][0] / cfem_mpc_size[i % NA], *high = cfem_mpc_command[i % NA][1] / cfem_mpc_size[i % NA];
        if (row) row[i] = 1.0;
        *begin = i;
        return i + 1;
    }
    if (i < SOFT) {
        const int j = i - V, a = j % NA;
        const double from = j < NA ? p->told[a] / cfem_mpc_size[a] : 0.0, rate = cfem_mpc_rate[a] / cfem_mpc_size[a];
        *low = from - rate, *high = from + rate, *begin = j < NA ? j : j - NA;
        if (row) {
            for (int c = *begin; c < j; c++) row[c] = 0.0;
            row[*begin] = -1.0, row[j] = 1.0;
        }
        return j + 1;
    }
    const int k = (i - SOFT) % TICKS, which = (i - SOFT) / TICKS, end = p->known[k];
    *begin = 0;
    if (which < NA) {
        *low = cfem_mpc_course[which][0] - p->course[k][which], *high = cfem_mpc_course[which][1] - p->course[k][which];
        if (row) memcpy(row, p->by_course[k][which], sizeof(double) * (size_t)end);
        return end;
    }
#if CFEM_MPC_MOST_PLANES
    const double *normal = cfem_mpc_normal[which - NA];
    *low = cfem_mpc_level[which - NA] - cfem_dot(NE, normal, p->e[k]);
    for (int c = 0; row && c < end; c++) {
        row[c] = 0.0;
        for (int e = 0; e < NE; e++) row[c] += normal[e] * p->E[k][e][c];
    }
#endif
    return end;
}

static double at(const cfem_plan *p, int i, const double *x) {
    if (i < V) return x[i];
    if (i < SOFT) return x[i - V] - (i - V < NA ? 0.0 : x[i - V - NA]);
    const int k = (i - SOFT) % TICKS, which = (i - SOFT) / TICKS;
    if (which < NA) return cfem_dot(p->known[k], p->by_course[k][which], x);
    double sum = 0.0;
#if CFEM_MPC_MOST_PLANES
    for (int e = 0; e < NE; e++) sum += cfem_mpc_normal[which - NA][e] * cfem_dot(p->known[k], p->E[k][e], x);
#endif
    return sum;
}

/* v := L^-1 v, whose first `begin` entries are zero; v := L^-T v. */
static void forward(const cfem_plan *p, int begin, double *v) {
    for (int i = begin; i < V; i++) v[i] = (v[i] - cfem_dot(i - begin, p->L[i] + begin, v + begin)) / p->L[i][i];
}
static void backward(const cfem_plan *p, double *v) {
    for (int i = V - 1; i >= 0; i--) {
        v[i] /= p->L[i][i];
        for (int j = 0; j < i; j++) v[j] -= p->L[i][j] * v[i];
    }
}

static double lasting(int block) { return (block + 1 < MOVES ? cfem_mpc_begins[block + 1] : TICKS) - cfem_mpc_begins[block]; }

/* M^T (M x - d): the objective's slope. */
static void slope_at(const cfem_plan *p, const double *x, double *slope) {
    for (int j = 0; j < V; j++) slope[j] = 0.0;
    for (int k = 0; k < TICKS; k++)
        for (int e = 0, end = p->known[k]; e < NE; e++) {
            if (!(cfem_mpc_weight[e] > 0.0)) continue;
            const double *row = p->E[k][e];
            const double off = cfem_mpc_weight[e] * cfem_mpc_weight[e] * (p->e[k][e] - p->goal[k][e] + cfem_dot(end, row, x));
            for (int j = 0; j < end; j++) slope[j] += off * row[j];
        }
    for (int j = 0; j < V; j++) {
        const int a = j % NA;
        const double size = cfem_mpc_size[a], smooth = cfem_mpc_smooth[a] * size, effort = cfem_mpc_effort[a] * size;
        const double by = smooth * smooth * (x[j] - (j < NA ? p->told[a] / size : x[j - NA]));
        slope[j] += by + lasting(j / NA) * effort * effort * (x[j] - p->rest[a] / size);
        if (j >= NA) slope[j - NA] -= by;
    }
}

/* Adds the objective's part of the goals to the lower triangle of H in L, two rows and two columns at once, and finds the largest weighted
 * slope. Ticks whose effectors do not know a variable yet come before those that do. */
static void add_goals(cfem_plan *p, double *largest) {
    for (int i = 0, from = 0; i < V; i += 2) {
        while (p->known[from] <= i) from++;
        for (int j = 0; j <= i; j += 2) {
            double aa = 0.0, ab = 0.0, ba = 0.0, bb = 0.0;
            const int more = i + 1 < V;
            for (int k = from; k < TICKS; k++)
                for (int e = 0; e < NE; e++) {
                    const double *row = p->E[k][e], w = cfem_mpc_weight[e] * cfem_mpc_weight[e];
                    const double one = w * row[i], other = more && i + 1 < p->known[k] ? w * row[i + 1] : 0.0;
                    const double next = j + 1 < p->known[k] ? row[j + 1] : 0.0;
                    aa += one * row[j], ab += one * next, ba += other * row[j], bb += other * next;
                }
            p->L[i][j] += aa;
            if (j < i) p->L[i][j + 1] += ab;
            if (more) p->L[i + 1][j] += ba, p->L[i + 1][j + 1] += bb;
        }
        for (int k = from; k < TICKS; k++)
            for (int e = 0; e < NE; e++)
                for (int c = i; c < i + 2 && c < p->known[k]; c++)
                    *largest = fmax(*largest, cfem_mpc_weight[e] * fabs(p->E[k][e][c]) / cfem_mpc_size[c % NA]);
    }
}

/* L, and in `best` the optimum without bounds; the price of missing a bound. 0, or 1 where H is not positive definite. */
static int factorise(cfem_plan *p) {
    double largest = 0.0, none[MOST_V] = {0};
    for (int k = 0, block = 0; k < TICKS; k++) {
        if (block + 1 < MOVES && cfem_mpc_begins[block + 1] == k) block++;
        p->known[k] = (block + 1) * NA;
    }
    for (int i = 0; i < V; i++)
        for (int j = 0; j <= i; j++) p->L[i][j] = 0.0;
    add_goals(p, &largest);
    for (int j = 0; j < V; j++) {
        const int a = j % NA;
        const double size = cfem_mpc_size[a], smooth = cfem_mpc_smooth[a] * size, effort = cfem_mpc_effort[a] * size;
        const double many = lasting(j / NA);
        p->L[j][j] += (j + NA < V ? 2.0 : 1.0) * smooth * smooth + many * effort * effort;
        if (j >= NA) p->L[j][j - NA] -= smooth * smooth;
        largest = fmax(largest, fmax(cfem_mpc_smooth[a], sqrt(many) * cfem_mpc_effort[a]));
    }
    for (int i = 0; i < V; i++) {
        const double whole = p->L[i][i];
        for (int j = 0; j <= i; j++) {
            const double rest = p->L[i][j] - cfem_dot(j, p->L[i], p->L[j]);
            if (j < i)
                p->L[i][j] = rest / p->L[j][j];
            else if (rest > 1e-14 * whole)
                p->L[i][i] = sqrt(rest);
            else
                return 1;
        }
    }
    slope_at(p, none, p->best);
    for (int j = 0; j < V; j++) p->best[j] = -p->best[j];
    forward(p, 0, p->best);
    backward(p, p->best);
    double steepest = 0.0, sum = 0.0;
    for (int i = SOFT; i < COUNT; i++) {
        double row[MOST_V], low, high;
        int begin, end = constraint(p, i, row, &begin, &low, &high);
        for (int j = begin; j < end && (low > -HUGE_VAL || high < HUGE_VAL); j++)
            steepest = fmax(steepest, fabs(row[j]) / cfem_mpc_size[j % NA]), sum += row[j];
    }
    for (int j = 0; j < V; j++) sum += p->best[j];
    const double price = steepest > 0.0 ? 1e3 * largest / steepest : 1.0;
    p->price = 1.0 / (price * price);
    return !cfem_finite(sum);
}

static double priced(const cfem_plan *p, int i) { return p->softened && i >= SOFT ? p->price : 0.0; }

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
        constraint(p, p->which[i], 0, &begin, &low, &high);
        p->force[i] = (p->sign[i] > 0 ? low : -high) - p->sign[i] * at(p, p->which[i], p->best);
    }
    down(p, p->count, p->force);
    up(p, p->count, p->force);
    for (int i = 0; i < p->count; i++)
        for (int j = 0; j < V; j++) y[j] += p->force[i] * p->N[i][j];
    backward(p, y);
    for (int j = 0; j < V; j++) p->x[j] = p->best[j] + y[j];
}

/* Makes constraint i active, and drops those that it relieves. CFEM_PLAN_OPTIMAL, _INFEASIBLE or _STEPS. */
static int hold(cfem_plan *p, int i, double sign) {
    double normal[MOST_V], low, high, own = 0.0;
    int begin, end = constraint(p, i, normal, &begin, &low, &high);
    double by = (sign > 0 ? low : -high) - sign * at(p, i, p->x);
    for (int j = 0; j < V; j++) normal[j] = j >= begin && j < end ? sign * normal[j] : 0.0;
    forward(p, begin, normal);
    const double whole = cfem_dot(V, normal, normal) + priced(p, i);
    while (p->changes < 4 * COUNT) {
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
            return by > MEETS * size_of(i) ? CFEM_PLAN_INFEASIBLE : CFEM_PLAN_OPTIMAL;
        }
        const double full = apart ? by / square : HUGE_VAL, t = full < partial ? full : partial;
        for (int k = 0; k < count; k++) p->force[k] -= t * r[k];
        own += t;
        if (apart) {
            memcpy(step, normal, sizeof step);
            for (int k = 0; k < count; k++)
                for (int j = 0; j < V; j++) step[j] -= r[k] * p->N[k][j];
            backward(p, step);
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
    for (int i = 0; i < COUNT; i++) {
        if (p->state[i]) continue;
        double low, high;
        int begin;
        constraint(p, i, 0, &begin, &low, &high);
        if (low == -HUGE_VAL && high == HUGE_VAL) continue;
        const double value = at(p, i, p->x), below = low - value, above = value - high, by = fmax(below, above) / size_of(i);
        if (by > most) found = i, most = by, *sign = below > above ? 1.0 : -1.0;
    }
    return found;
}

static int search(cfem_plan *p) {
    int settled = 1;
    p->count = p->changes = 0;
    memset(p->state, 0, sizeof p->state);
    memcpy(p->x, p->best, sizeof p->x);
    while (p->changes < 4 * COUNT) {
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
        slope_at(p, p->x, slope);
        for (int k = 0; k < p->count; k++) {
            double row[MOST_V], low, high;
            int begin, i = p->which[k], end = constraint(p, i, row, &begin, &low, &high);
            const double bound = p->sign[k] > 0 ? low : -high;
            for (int j = begin; j < end; j++) slope[j] -= p->force[k] * p->sign[k] * row[j];
            left[k] = bound - p->sign[k] * at(p, i, p->x) - priced(p, i) * p->force[k];
            off = fmax(off, fabs(left[k]) / size_of(i));
        }
        for (int j = 0; j < V; j++) off = fmax(off, fabs(slope[j]) / unit), slope[j] = -slope[j];
        p->kkt = off;
        if (!(off > 1e-2 * CFEM_PLAN_TOLERANCE) || round == REFINEMENTS) return;
        forward(p, 0, slope);
        for (int k = 0; k < p->count; k++) left[k] -= cfem_dot(V, p->N[k], slope);
        down(p, p->count, left);
        up(p, p->count, left);
        for (int k = 0; k < p->count; k++) {
            p->force[k] = fmax(0.0, p->force[k] + left[k]);
            for (int j = 0; j < V; j++) slope[j] += left[k] * p->N[k][j];
        }
        backward(p, slope);
        for (int j = 0; j < V; j++) p->x[j] += slope[j];
    }
}

int cfem_plan_solve(cfem_plan *p) {
    p->count = p->changes = p->softened = 0;
    p->kkt = HUGE_VAL;
    if (factorise(p)) return CFEM_PLAN_FLAT;
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
