/* One estimate, and a filter of one after the other: see src/cfem/predict/estimation/estimate.py and filter.py. */
#include "cfem_estimate_parts.h"

#include <math.h>
#include <string.h>

#include "cfem_linear.h"

#define UNSEEN 0.3

static void answer(const cfem_estimate_problem *asked, const cfem_estimate_evaluated *here, const int *kept, cfem_estimate *found) {
    double A[N][N];
    int finite = 1;
    memcpy(found->x, here->x, sizeof found->x), memcpy(A, here->normal, sizeof A);
    for (int i = 0; i < N; i++) A[i][i] += 1e-9;
    const int definite = !cfem_cholesky(N, N, A[0], 0.0);
    found->unseen = 0u;
    for (int i = 0; i < N; i++) {
        double unit[N] = {0.0};
        unit[i] = 1.0;
        if (definite) cfem_lower(N, N, A[0], 0, unit), cfem_upper(N, N, A[0], unit);
        for (int j = 0; j < N; j++) {
            found->covariance[j][i] = unit[j] * cfem_estimate_scale[i] * cfem_estimate_scale[j];
            finite = finite && known(found->covariance[j][i]);
        }
        const double information = here->normal[i][i]; /* the squared norm of its column */
        if (!(sqrt(found->covariance[i][i]) <= UNSEEN * cfem_estimate_scale[i]) || information < 1.0) found->unseen |= (uint32_t)1 << i;
    }
    found->left_out = cfem_estimate_left_out(asked, here, kept, &found->noise);
    cfem_estimate_effectors_at(here->x, found->effector);
    for (int i = 0; i < N; i++) finite = finite && known(found->x[i]);
    for (int e = 0; e < NE; e++) finite = finite && known(found->effector[e]);
    if (!definite || !finite) found->status |= CFEM_ESTIMATE_NO_NUMBER;
}

/* Writes what a frame measures into the problem; its prior stays. */
static void set_measured(const cfem_frame *frame, cfem_estimate_problem *asked) {
    cfem_estimate_see(frame, asked);
    asked->noise = cfem_estimate_noise, asked->numbers = asked->rows + 3 * cfem_estimate_count(asked->there), asked->forces = 0;
    for (int a = 0; a < NA; a++) {
        asked->numbers += known(frame->displacement[a]) + known(frame->force[a]);
        asked->forces += known(frame->force[a]);
    }
}

/* square, numbers: of the innovation, as a gate is told it. */
static unsigned solve(cfem_estimate_problem *asked, const cfem_frame *frame, cfem_estimate *found, double *square, int *numbers) {
    int kept[M];
    cfem_estimate_evaluated here;
    set_measured(frame, asked);
    found->status = cfem_estimate_minimise(asked, asked->mean, &here, kept, &found->iterations);
    answer(asked, &here, kept, found);
    *square = here.cost, *numbers = asked->numbers - 3 * (cfem_estimate_count(asked->there) - cfem_estimate_count(kept)) - N;
    if (found->status) *square = HUGE_VAL, *numbers = found->status & CFEM_ESTIMATE_TOO_FEW ? 0 : 1;
    return found->status;
}

/* The prior of a robot of which nothing is known: a middle state, and loads as large as they usually are. */
static void set_prior(cfem_estimate_problem *asked) {
    memset(asked, 0, sizeof *asked);
    memcpy(asked->mean, cfem_estimate_middle, sizeof(double) * NA);
    for (int w = 0; w < NW; w++)
        for (int v = 0; v < NW; v++) asked->root[w][NA + v] = cfem_estimate_load_root[w][v];
    asked->rows = NW;
}

unsigned cfem_estimate_frame(const cfem_frame *frame, cfem_estimate *found) {
    cfem_estimate_problem asked;
    double square;
    int numbers;
    set_prior(&asked);
    return solve(&asked, frame, found, &square, &numbers);
}

void cfem_filter_init(cfem_filter *filter) { memset(filter, 0, sizeof *filter), cfem_gate_restart(&filter->gate); }

/* The last estimate after the commands, slips and loads of a frame: 0 where its covariance is no more one. */
static int predict(const cfem_filter *filter, const double *command, cfem_estimate_problem *asked) {
    const cfem_estimate *last = &filter->last;
    double lower[N][N], size[N], keeps[N];
    const double rho = cfem_estimate_keeps;
    for (int i = 0; i < N; i++) {
        keeps[i] = i < NA ? 1.0 : rho;
        asked->mean[i] = keeps[i] * last->x[i] + (i < NA && command && filter->commanded ? command[i] - filter->command[i] : 0.0);
        for (int j = 0; j <= i; j++) {
            double fresh = 0.0; /* slips of the actuators, and what changes of the loads */
            if (i < NA) fresh = i == j ? cfem_estimate_slip * cfem_estimate_slip : 0.0;
            else if (j >= NA) fresh = (1.0 - rho * rho) * cfem_estimate_load_covariance[i - NA][j - NA];
            lower[i][j] = last->covariance[i][j] * keeps[i] * keeps[j] + fresh;
        }
        size[i] = sqrt(lower[i][i]);
    }
    for (int i = 0; i < N; i++)
        for (int j = 0; j <= i; j++) lower[i][j] = lower[i][j] / (size[i] * size[j]) + (i == j ? 1e-12 : 0.0);
    if (cfem_cholesky(N, N, lower[0], 0.0)) return 0;
    asked->rows = N;
    for (int j = 0; j < N; j++) {
        double column[N] = {0.0};
        column[j] = 1.0 / size[j];
        cfem_lower(N, N, lower[0], 0, column);
        for (int i = 0; i < N; i++) asked->root[i][j] = column[i];
    }
    return 1;
}

/* The prior of the first frame, about its command where it has one. */
static void start(const double *command, cfem_estimate_problem *asked) {
    set_prior(asked);
    for (int a = 0; command && a < NA; a++) {
        asked->mean[a] = command[a];
        asked->root[NW + a][a] = 1.0 / cfem_estimate_first;
        asked->rows = N;
    }
}

unsigned cfem_filter_tick(cfem_filter *filter, const cfem_frame *frame, cfem_estimate *found) {
    cfem_estimate_problem asked;
    double square;
    int numbers;
    const double *command = frame->command;
    for (int a = 0; command && a < NA; a++)
        if (!known(frame->command[a])) command = NULL;
    set_prior(&asked);
    const int carried = filter->known && predict(filter, command, &asked);
    if (!carried) start(command, &asked);
    solve(&asked, frame, found, &square, &numbers);
    if (carried) {
        const int verdict = cfem_gate_judge(&filter->gate, square, numbers, cfem_estimate_gate_sigmas, CFEM_ESTIMATE_GATE_SAMPLES);
        if (verdict == CFEM_GATE_REJECTED) return found->status = found->status ? found->status : CFEM_ESTIMATE_REJECTED;
        if (verdict == CFEM_GATE_RESTART) {
            filter->known = 0;
            start(command, &asked);
            solve(&asked, frame, found, &square, &numbers);
        }
    }
    if (found->status == 0u) {
        filter->last = *found, filter->known = 1, filter->commanded = command != NULL;
        for (int a = 0; command && a < NA; a++) filter->command[a] = command[a];
    }
    return found->status;
}
