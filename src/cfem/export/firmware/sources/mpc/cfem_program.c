/* Rows, slopes and the Hessian's factor of the quadratic program of a horizon. */
#include "cfem_program.h"

#include <string.h>

#include "cfem_linear.h"

#define NA CFEM_MOTION_NA
#define NE CFEM_MOTION_NE
#define TICKS CFEM_MPC_TICKS
#define MOVES CFEM_MPC_MOVES
#define V CFEM_MPC_VARIABLES
#define MOST_V CFEM_MPC_MOST_VARIABLES

double cfem_program_size(int i) {
    if (i < CFEM_PROGRAM_SOFT) return 1.0;
    return (i - CFEM_PROGRAM_SOFT) / TICKS < NA ? cfem_mpc_course_size[(i - CFEM_PROGRAM_SOFT) / TICKS] : CFEM_MPC_LENGTH;
}

int cfem_program_row(const cfem_plan *p, int i, double *row, int *begin, double *low, double *high) {
    *low = -HUGE_VAL, *high = HUGE_VAL;
    if (i < V) {
        *low = cfem_mpc_command[i % NA][0] / cfem_mpc_size[i % NA], *high = cfem_mpc_command[i % NA][1] / cfem_mpc_size[i % NA];
        if (row) row[i] = 1.0;
        *begin = i;
        return i + 1;
    }
    if (i < CFEM_PROGRAM_SOFT) {
        const int j = i - V, a = j % NA;
        const double from = j < NA ? p->previous[a] / cfem_mpc_size[a] : 0.0, rate = cfem_mpc_rate[a] / cfem_mpc_size[a];
        *low = from - rate, *high = from + rate, *begin = j < NA ? j : j - NA;
        if (row) {
            for (int c = *begin; c < j; c++) row[c] = 0.0;
            row[*begin] = -1.0, row[j] = 1.0;
        }
        return j + 1;
    }
    const int k = (i - CFEM_PROGRAM_SOFT) % TICKS, which = (i - CFEM_PROGRAM_SOFT) / TICKS, end = p->known[k];
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

double cfem_program_at(const cfem_plan *p, int i, const double *x) {
    if (i < V) return x[i];
    if (i < CFEM_PROGRAM_SOFT) return x[i - V] - (i - V < NA ? 0.0 : x[i - V - NA]);
    const int k = (i - CFEM_PROGRAM_SOFT) % TICKS, which = (i - CFEM_PROGRAM_SOFT) / TICKS;
    if (which < NA) return cfem_dot(p->known[k], p->by_course[k][which], x);
    double sum = 0.0;
#if CFEM_MPC_MOST_PLANES
    for (int e = 0; e < NE; e++) sum += cfem_mpc_normal[which - NA][e] * cfem_dot(p->known[k], p->E[k][e], x);
#endif
    return sum;
}

void cfem_program_forward(const cfem_plan *p, int begin, double *v) { cfem_lower(V, MOST_V, p->L[0], begin, v); }
void cfem_program_backward(const cfem_plan *p, double *v) { cfem_upper(V, MOST_V, p->L[0], v); }

static double lasting(int block) { return (block + 1 < MOVES ? cfem_mpc_begins[block + 1] : TICKS) - cfem_mpc_begins[block]; }

void cfem_program_slope(const cfem_plan *p, const double *x, double *slope) {
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
        const double by = smooth * smooth * (x[j] - (j < NA ? p->previous[a] / size : x[j - NA]));
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
                    *largest = cfem_larger(cfem_mpc_weight[e] * fabs(p->E[k][e][c]) / cfem_mpc_size[c % NA], *largest);
    }
}

int cfem_program_factorise(cfem_plan *p) {
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
        largest = cfem_larger(cfem_larger(cfem_mpc_smooth[a], sqrt(many) * cfem_mpc_effort[a]), largest);
    }
    if (cfem_cholesky(V, MOST_V, p->L[0], CFEM_TOLERANCE(1e-14, 1e-6))) return 1;
    cfem_program_slope(p, none, p->best);
    for (int j = 0; j < V; j++) p->best[j] = -p->best[j];
    cfem_program_forward(p, 0, p->best);
    cfem_program_backward(p, p->best);
    double steepest = 0.0, sum = 0.0;
    for (int i = CFEM_PROGRAM_SOFT; i < CFEM_PROGRAM_COUNT; i++) {
        double row[MOST_V], low, high;
        int begin, end = cfem_program_row(p, i, row, &begin, &low, &high);
        for (int j = begin; j < end && (low > -HUGE_VAL || high < HUGE_VAL); j++)
            steepest = cfem_larger(fabs(row[j]) / cfem_mpc_size[j % NA], steepest), sum += row[j];
    }
    for (int j = 0; j < V; j++) sum += p->best[j];
    const double price = steepest > 0.0 ? CFEM_TOLERANCE(1e3, 1e2) * largest / steepest : 1.0;
    p->price = 1.0 / (price * price);
    return !cfem_finite(sum);
}
