/* Least squares by Gauss and Newton with Levenberg's damping, within a box; markers that do not fit are left out: see
 * src/cfem/predict/estimation/fit.py. */
#include "cfem_estimate_parts.h"

#include <math.h>
#include <string.h>

#include "cfem_linear.h"

#define FIRST 12       /* steps with all markers, */
#define LEVELS 12      /* with weights, */
#define LAST 8         /* with those that fit */
#define TOLERANCE 1e-5 /* of each unknown's scale: the next step */
#define OUTLIER 4.0    /* standard deviations at which a marker counts a quarter */
#define FIT 2.57       /* standard deviations of a coordinate, root mean square of three */

static void add_residual(cfem_estimate_evaluated *at, double r, const double *J, double weight) {
    at->cost += weight * r * r;
    for (int i = 0; i < N; i++) {
        at->gradient[i] += weight * J[i] * r;
        for (int j = 0; j <= i; j++) at->normal[i][j] += weight * J[i] * J[j];
    }
}

/* What all markers and load cells miss at x. */
static void evaluate_markers(const cfem_estimate_problem *asked, const double *x, cfem_estimate_evaluated *at) {
    double y[ROWS], by[ROWS][N];
    memcpy(at->x, x, sizeof at->x);
    cfem_estimate_places(x, y, by);
    for (int m = 0; m < M; m++) {
        double square = 0.0;
        for (int c = 0; c < 3; c++) {
            at->r[m][c] = (y[3 * m + c] - asked->where[m][c]) / asked->noise;
            square += at->r[m][c] * at->r[m][c];
            for (int i = 0; i < N; i++) at->J[m][c][i] = by[3 * m + c][i] / asked->noise * cfem_estimate_scale[i];
        }
        at->size[m] = sqrt(square / 3.0);
    }
    if (asked->forces) cfem_estimate_tensions(x, at->force, at->by_x);
}

/* normal, gradient and cost of the markers kept, each with its weight (1 where that is NULL), and of all else. */
static void add_up(const cfem_estimate_problem *asked, const int *kept, const double *weight, cfem_estimate_evaluated *at) {
    double J[N];
    const double *x = at->x;
    const cfem_frame *frame = asked->frame;
    memset(at->normal, 0, sizeof at->normal), memset(at->gradient, 0, sizeof at->gradient), at->cost = 0.0;
    for (int m = 0; m < M; m++)
        for (int c = 0; c < 3 && kept[m]; c++) add_residual(at, at->r[m][c], at->J[m][c], weight ? weight[m] : 1.0);
    for (int k = 0; k < asked->rows; k++) {
        double r = 0.0;
        for (int i = 0; i < N; i++) r += asked->root[k][i] * (x[i] - asked->mean[i]), J[i] = asked->root[k][i] * cfem_estimate_scale[i];
        add_residual(at, r, J, 1.0);
    }
    for (int a = 0; a < NA; a++) {
        if (!known(frame->displacement[a])) continue;
        for (int i = 0; i < N; i++) J[i] = i == a ? cfem_estimate_scale[i] / cfem_estimate_sensor : 0.0;
        add_residual(at, (x[a] - frame->displacement[a]) / cfem_estimate_sensor, J, 1.0);
    }
    for (int a = 0; a < NA; a++) {
        if (!known(frame->force[a])) continue;
        for (int i = 0; i < N; i++) J[i] = at->by_x[a][i] / cfem_estimate_tension * cfem_estimate_scale[i];
        add_residual(at, (at->force[a] - frame->force[a]) / cfem_estimate_tension, J, 1.0);
    }
}

/* The step over the scale; 0 where there is none. */
static int step_of(const cfem_estimate_evaluated *at, double damping, double *step) {
    double A[N][N], most = 1.0;
    for (int i = 0; i < N; i++) most = fmax(most, at->normal[i][i]);
    memcpy(A, at->normal, sizeof A), memcpy(step, at->gradient, sizeof at->gradient);
    for (int i = 0; i < N; i++) A[i][i] += damping * at->normal[i][i] + 1e-12 * most;
    if (cfem_cholesky(N, N, A[0], 0.0)) return 0;
    cfem_lower(N, N, A[0], 0, step), cfem_upper(N, N, A[0], step);
    return 1;
}

static void clip_to_box(double *x) {
    for (int i = 0; i < N; i++) x[i] = fmin(fmax(x[i], cfem_estimate_box[i][0]), cfem_estimate_box[i][1]);
}

/* Levenberg and Marquardt's steps until the next would be below the tolerance by the rate at which undamped ones fall: how many; done:
 * whether. */
static int descend(const cfem_estimate_problem *asked, cfem_estimate_evaluated *here, const int *kept, int most, int *done) {
    double damping = 1e-6, last = HUGE_VAL, step[N], x[N];
    cfem_estimate_evaluated trial;
    int steps = 0;
    for (*done = 0; steps < most;) {
        double moved = 0.0;
        steps++;
        if (!step_of(here, damping, step)) return steps;
        for (int i = 0; i < N; i++) x[i] = here->x[i] - cfem_estimate_scale[i] * step[i];
        clip_to_box(x);
        for (int i = 0; i < N; i++) moved = fmax(moved, fabs(x[i] - here->x[i]) / cfem_estimate_scale[i]);
        evaluate_markers(asked, x, &trial), add_up(asked, kept, NULL, &trial);
        if (!(trial.cost <= here->cost * (1.0 + 1e-12))) {
            damping *= 100.0, last = HUGE_VAL;
            if (damping < 1e8) continue;
            *done = 1;
            return steps;
        }
        *here = trial;
        damping = fmax(damping / 100.0, 1e-12);
        if (moved * (last < HUGE_VAL ? fmin(moved / last, 1.0) : 1.0) <= TOLERANCE) {
            *done = 1;
            return steps;
        }
        last = damping < 1e-5 ? moved : HUGE_VAL;
    }
    return steps;
}

static double median(const double *values, const int *there) {
    double sorted[M];
    int n = 0;
    for (int m = 0; m < M; m++) {
        if (!there[m]) continue;
        int place = n++;
        for (; place > 0 && sorted[place - 1] > values[m]; place--) sorted[place] = sorted[place - 1];
        sorted[place] = values[m];
    }
    return n % 2 ? sorted[n / 2] : 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]);
}

/* Replaces x by a state of the training set where half of the markers are nearer to it. */
static void choose_start(const cfem_estimate_problem *asked, double *x) {
    double y[ROWS], by[ROWS][N], apart[M], least = HUGE_VAL;
    int best = -1;
    cfem_estimate_places(x, y, by);
    for (int k = -1; k < STARTS; k++) {
        const double *at = k < 0 ? y : cfem_estimate_start_places[k];
        for (int m = 0; m < M; m++) {
            double square = 0.0;
            for (int c = 0; c < 3; c++) square += (at[3 * m + c] - asked->where[m][c]) * (at[3 * m + c] - asked->where[m][c]);
            apart[m] = sqrt(square);
        }
        const double middle = median(apart, asked->there);
        if (middle < least) least = middle, best = k;
    }
    if (best < 0) return;
    for (int i = 0; i < N; i++) x[i] = i < NA ? cfem_estimate_starts[best][i] : 0.0;
}

/* Steps with weights of Geman and McClure from x: how many. */
static int weighted(const cfem_estimate_problem *asked, double *x, cfem_estimate_evaluated *here) {
    double bound = HUGE_VAL, weight[M], step[N];
    int steps = 0;
    evaluate_markers(asked, x, here);
    while (steps < LEVELS && bound > OUTLIER) {
        bound = fmax(OUTLIER, fmin(bound / 2.0, 3.0 * median(here->size, asked->there)));
        for (int m = 0; m < M; m++) {
            const double share = 1.0 + here->size[m] * here->size[m] / (bound * bound);
            weight[m] = 1.0 / (share * share);
        }
        add_up(asked, asked->there, weight, here);
        if (!step_of(here, 1e-6, step)) return steps;
        for (int i = 0; i < N; i++) x[i] -= cfem_estimate_scale[i] * step[i];
        clip_to_box(x), steps++;
        evaluate_markers(asked, x, here);
    }
    return steps;
}

/* r . A^-1 r, A (3, 3) symmetric, by its adjugate. */
static double inverse_square(double A[3][3], const double *r) {
    double adjugate[3][3], square = 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
            adjugate[j][i] = A[a][c] * A[b][d] - A[a][d] * A[b][c];
        }
    const double det = A[0][0] * adjugate[0][0] + A[0][1] * adjugate[1][0] + A[0][2] * adjugate[2][0];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) square += r[i] * adjugate[i][j] * r[j];
    return square / det;
}

/* The marker of those kept without which the sum of squares falls most. */
static int least_fitting(const cfem_estimate_evaluated *here, const int *kept) {
    double A[N][N], most = -HUGE_VAL;
    int found = -1;
    memcpy(A, here->normal, sizeof A);
    for (int i = 0; i < N; i++) A[i][i] += 1e-9 * fmax(here->normal[i][i], 1.0);
    const int definite = !cfem_cholesky(N, N, A[0], 0.0);
    for (int m = 0; m < M; m++) {
        double left[3][3], half[3][N], falls = 3.0 * here->size[m] * here->size[m];
        if (!kept[m]) continue;
        if (definite) {
            for (int c = 0; c < 3; c++) memcpy(half[c], here->J[m][c], sizeof half[c]), cfem_lower(N, N, A[0], 0, half[c]);
            for (int c = 0; c < 3; c++)
                for (int d = 0; d < 3; d++) {
                    left[c][d] = c == d ? 1.0 + 1e-9 : 0.0;
                    for (int i = 0; i < N; i++) left[c][d] -= half[c][i] * half[d][i];
                }
            falls = inverse_square(left, here->r[m]);
        }
        if (falls > most) most = falls, found = m;
    }
    return found;
}

static int fits(const cfem_estimate_evaluated *here, const int *kept) {
    for (int m = 0; m < M; m++)
        if (kept[m] && !(here->size[m] < FIT)) return 0;
    return 1;
}

void cfem_estimate_see(const cfem_frame *frame, cfem_estimate_problem *asked) {
    asked->frame = frame;
    for (int m = 0; m < M; m++) {
        asked->there[m] = 1;
        for (int c = 0; c < 3; c++) asked->there[m] = asked->there[m] && known(frame->place[m][c]);
        for (int c = 0; c < 3; c++) asked->where[m][c] = (asked->there[m] ? frame->place[m][c] : 0.0) - cfem_estimate_rest[m][c];
    }
}

uint32_t cfem_estimate_left_out(const cfem_estimate_problem *asked, const cfem_estimate_evaluated *here, const int *kept, double *noise) {
    uint32_t bits = 0u;
    double square = 0.0;
    for (int m = 0; m < M; m++) {
        if (asked->there[m] && !kept[m]) bits |= (uint32_t)1 << m;
        if (kept[m]) square += here->size[m] * here->size[m];
    }
    *noise = cfem_estimate_count(kept) ? sqrt(square / cfem_estimate_count(kept)) : 0.0;
    return bits;
}

int cfem_estimate_count(const int *kept) {
    int n = 0;
    for (int m = 0; m < M; m++) n += kept[m] != 0;
    return n;
}

/* From x: the status; kept: markers that fit. */
unsigned cfem_estimate_minimise(const cfem_estimate_problem *asked, const double *first, cfem_estimate_evaluated *here, int *kept, int *iterations) {
    double x[N];
    int done;
    memcpy(kept, asked->there, sizeof asked->there), memcpy(x, first, sizeof x), clip_to_box(x);
    evaluate_markers(asked, x, here), add_up(asked, kept, NULL, here);
    *iterations = 0;
    if (asked->numbers < N) return CFEM_ESTIMATE_TOO_FEW;
    *iterations = descend(asked, here, kept, FIRST, &done);
    const int all = cfem_estimate_count(kept);
    if ((done || !all) && fits(here, kept)) return done ? 0u : CFEM_ESTIMATE_ITERATIONS;
    memcpy(x, first, sizeof x), choose_start(asked, x), clip_to_box(x);
    *iterations += weighted(asked, x, here);
    for (int m = 0; m < M; m++) kept[m] = asked->there[m] && here->size[m] < 2.0 * OUTLIER;
    while (cfem_estimate_count(kept) >= all / 2 + 1) {
        add_up(asked, kept, NULL, here);
        *iterations += descend(asked, here, kept, LAST, &done);
        memcpy(x, here->x, sizeof x);
        if (fits(here, kept)) return done ? 0u : CFEM_ESTIMATE_ITERATIONS;
        kept[least_fitting(here, kept)] = 0;
    }
    memcpy(kept, asked->there, sizeof asked->there);
    evaluate_markers(asked, x, here), add_up(asked, kept, NULL, here);
    return CFEM_ESTIMATE_OUTLIERS;
}
