/* The filter, as src/cfem/motion/estimation/marker_filter.py has it: a frame's correction by markers. */
#include <math.h>
#include <string.h>

#include "cfem_swing_room.h"
#include "cfem_inertia.h"
#include "cfem_linear.h"
#include "cfem_swing_fit.h"
#include "cfem_swing_parts.h"

#undef M /* the mass, here */
#define MARKERS CFEM_ESTIMATE_MARKERS
#define NQ CFEM_MOTION_NQ
#define NR CFEM_MOTION_NR
#define NZ CFEM_SWING_NZ
#define NX CFEM_SWING_NX
#define REST (NZ - NQ) /* momenta and memory, which markers do not tell */
#define HELD (!CFEM_SWING_FORCE)
#define SAG 0.5   /* of the square of a swing over the length of the robot: how far its arc is from a line */
#define UNSEEN 0.3

/* Place of an unknown that markers tell (N), in the covariance (NX). */
static int state_index(int i) { return i < NQ ? i : i - NQ + NZ; }

/* Whether a value is at most the width of its box away from it. */
static int in_box(int i, double value) {
    const double low = cfem_swing_box[i][0], high = cfem_swing_box[i][1];
    return value > 2.0 * low - high && value < 2.0 * high - low;
}

void cfem_swing_init(cfem_swing *filter) { memset(filter, 0, sizeof *filter), cfem_gate_restart(&filter->gate); }

/* Before the first frame: about where it is told, or where a robot at rest would be. 0, or 1 where nobody said which forces drive it. */
static int start(cfem_swing *s, const cfem_frame *frame, const double *u) {
    double delta_a[NA], (*P)[NX] = s->covariance;
    cfem_inertia inertia;
    cfem_estimate at_rest;
    if (!u && !HELD) return 1;
    if (u && HELD) memcpy(delta_a, u, sizeof delta_a);
    else cfem_estimate_frame(frame, &at_rest), memcpy(delta_a, at_rest.x, sizeof delta_a);
    cfem_swing_init(s);
    cfem_inertia_at(delta_a, 0, 1.0, &inertia);
    const double *mass = inertia.M;
    for (int i = 0; i < NQ; i++)
        for (int j = i; j < NQ; j++, mass++)
            if (i >= NA) P[NQ + i][NQ + j] = P[NQ + j][NQ + i] = CFEM_SWING_SWING * CFEM_SWING_SWING * cfem_motion_stiffness * *mass;
    for (int i = 0; i < NQ; i++) {
        const double size = i >= NA ? CFEM_SWING_SWING : u && HELD ? CFEM_SWING_OFFSET : 3.0 * cfem_swing_scale[i];
        P[i][i] = size * size;
    }
    for (int v = 0; v < NW; v++)
        for (int w = 0; w < NW; w++) P[NZ + v][NZ + w] = cfem_estimate_load_covariance[v][w];
    P[NX - 1][NX - 1] = CFEM_SWING_STIFFNESS * CFEM_SWING_STIFFNESS;
    memcpy(s->z, delta_a, sizeof delta_a), memcpy(s->u, u ? u : delta_a, sizeof delta_a);
    s->known = 1;
    return 0;
}

/* mm of a marker's coordinate: the camera's, and the sag of an arc on which the effectors swing, which the skin's model does not have. */
static double noise_of(const cfem_swing *s) {
    double square = 0.0;
    cfem_inner inner;
    cfem_inner_at(s->z, 0, &inner);
    for (int e = 0; e < NE && e < 3; e++) {
        const double *H = inner.H + e * NR, swing = cfem_dot(NR, H, s->z + NA);
        square += swing * swing;
        for (int r = 0; r < NR; r++) square += H[r] * cfem_dot(NR, s->covariance[NA + r] + NA, H);
    }
    const double sag = SAG * square / CFEM_SWING_LENGTH, camera = CFEM_SWING_NOISE;
    return sqrt(camera * camera + sag * sag);
}

/* root (N, N), whose product with an error of covariance P, of what markers tell, has unit covariance; 0 where it is no covariance. */
static int root_of(double P[NX][NX], double root[N][N]) {
    double lower[N][N], size[N];
    for (int i = 0; i < N; i++) size[i] = sqrt(fmax(P[state_index(i)][state_index(i)], 1e-18));
    for (int i = 0; i < N; i++)
        for (int j = 0; j <= i; j++) lower[i][j] = P[state_index(i)][state_index(j)] / (size[i] * size[j]) + (i == j ? 1e-12 : 0.0);
    if (cfem_cholesky(N, N, lower[0], 0.0)) return 0;
    for (int j = 0; j < N; j++) {
        double column[N] = {0.0};
        column[j] = 1.0 / size[j];
        cfem_lower(N, N, lower[0], 0, column);
        for (int i = 0; i < N; i++) root[i][j] = column[i];
    }
    return 1;
}

/* The covariance if actuators were not where their commands are: cables that are slack for a moment. */
static void slack_covariance(const cfem_swing *s, double P[NX][NX]) {
    memcpy(P, s->covariance, sizeof s->covariance);
    for (int i = 0; i < NZ; i++)
        for (int j = 0; j < NZ; j++)
            for (int a = 0; a < NA; a++) P[i][j] += cfem_swing_jump[a] * cfem_swing_jump[a] * s->by_slip[i][a] * s->by_slip[j][a];
}

/* (N, N) of the least squares; 0 where there is none. */
static int covariance_of(double normal[N][N], double P[N][N]) {
    double L[N][N];
    memcpy(L, normal, sizeof L);
    if (cfem_cholesky(N, N, L[0], 0.0)) return 0;
    for (int i = 0; i < N; i++) {
        double unit[N] = {0.0};
        unit[i] = 1.0;
        cfem_lower(N, N, L[0], 0, unit), cfem_upper(N, N, L[0], unit);
        for (int j = 0; j < N; j++) P[j][i] = unit[j] * cfem_swing_scale[i] * cfem_swing_scale[j];
    }
    return cfem_finite(P[0][0]);
}

/* x, P: what markers tell, after the frame; root: of what was known before. What they do not tell follows by its covariance with them. */
static void correct(cfem_swing *s, double root[N][N], const double *mean, const double *x, double P[N][N]) {
    double gain[REST][N], GP[REST][N], less[N][N], (*C)[NX] = s->covariance;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) less[i][j] = P[i][j] - C[state_index(i)][state_index(j)];
    for (int k = 0; k < REST; k++) {
        double half[N];
        for (int i = 0; i < N; i++) {
            half[i] = 0.0;
            for (int j = 0; j <= i; j++) half[i] += root[i][j] * C[NQ + k][state_index(j)];
        }
        for (int j = 0; j < N; j++) {
            gain[k][j] = 0.0;
            for (int i = j; i < N; i++) gain[k][j] += root[i][j] * half[i];
        }
        for (int j = 0; j < N; j++) s->z[NQ + k] += gain[k][j] * (x[j] - mean[j]);
    }
    for (int k = 0; k < REST; k++) {
        double of[N];
        for (int j = 0; j < N; j++) of[j] = cfem_dot(N, gain[k], less[j]), GP[k][j] = cfem_dot(N, gain[k], P[j]);
        for (int l = 0; l <= k; l++) C[NQ + k][NQ + l] = C[NQ + l][NQ + k] = C[NQ + k][NQ + l] + cfem_dot(N, of, gain[l]);
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) C[state_index(i)][state_index(j)] = (P[i][j] + P[j][i]) / 2;
        for (int k = 0; k < REST; k++) C[state_index(i)][NQ + k] = C[NQ + k][state_index(i)] = GP[k][i];
    }
    memcpy(s->z, x, sizeof(double) * NQ), memcpy(s->load, x + NQ, sizeof(double) * NW);
    s->stiffness = x[N - 1];
}

typedef struct {
    cfem_estimate_evaluated here;
    double root[N][N], P[N][N], square; /* of the innovation, of `numbers`, as a gate is told it */
    unsigned status;
    int kept[MARKERS], iterations, good, numbers;
} fit;

/* Whether the gate would hear a frame. */
static int passes_gate(const cfem_swing *s, const fit *of) {
    return of->numbers < 1 || cfem_gate_deviate(&s->gate, of->square, of->numbers) <= cfem_estimate_gate_sigmas;
}

static void solve(cfem_estimate_problem *asked, double covariance[NX][NX], fit *found) {
    found->good = 0, found->status = CFEM_ESTIMATE_NO_NUMBER, found->iterations = 0;
    found->square = HUGE_VAL, found->numbers = 1;
    memcpy(found->kept, asked->there, sizeof found->kept), memset(&found->here, 0, sizeof found->here);
    if (!root_of(covariance, found->root)) return;
    memcpy(asked->root, found->root, sizeof asked->root);
    found->status = cfem_estimate_minimise(asked, asked->mean, &found->here, found->kept, &found->iterations);
    found->good = found->status == 0u && covariance_of(found->here.normal, found->P);
    if (!found->good && found->status == 0u) found->status = CFEM_ESTIMATE_NO_NUMBER;
    if (found->status & CFEM_ESTIMATE_TOO_FEW) found->numbers = 0;
    if (!found->good) return;
    found->square = found->here.cost, found->numbers = 3 * cfem_estimate_count(found->kept);
    for (int a = 0; a < NA; a++) found->numbers += cfem_finite(asked->frame->displacement[a]) != 0;
}

static void set_problem(const cfem_swing *s, const cfem_frame *frame, cfem_estimate_problem *asked) {
    memset(asked, 0, sizeof *asked);
    cfem_estimate_see(frame, asked);
    asked->rows = N, asked->numbers = N, asked->noise = noise_of(s);
    memcpy(asked->mean, s->z, sizeof(double) * NQ), memcpy(asked->mean + NQ, s->load, sizeof(double) * NW);
    asked->mean[N - 1] = s->stiffness;
}

static void answer(const cfem_swing *s, const fit *best, const cfem_estimate_problem *asked, cfem_swing_found *found) {
    memcpy(found->x, s->z, sizeof(double) * NQ), memcpy(found->x + NQ, s->load, sizeof(double) * NW);
    found->x[N - 1] = s->stiffness, found->unseen = 0u;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) found->covariance[i][j] = s->covariance[state_index(i)][state_index(j)];
        if (!(sqrt(found->covariance[i][i]) <= UNSEEN * cfem_swing_scale[i])) found->unseen |= (uint32_t)1 << i;
    }
    found->left_out = cfem_estimate_left_out(asked, &best->here, best->kept, &found->noise);
    found->status = best->status, found->iterations = best->iterations;
    cfem_swing_effectors(found->x, found->effector);
}

unsigned cfem_swing_frame(cfem_swing *s, const cfem_frame *frame, cfem_swing_found *found) {
    double wider[NX][NX];
    cfem_estimate_problem asked;
    cfem_frame seen = *frame;
    fit one, other, *best = &one;
    const double *u = frame->command;
    for (int a = 0; a < NA; a++) {
        const int stated = cfem_finite(frame->command[a]) && (!HELD || in_box(a, frame->command[a]));
        seen.force[a] = NAN, u = u && stated ? u : NULL;
    }
    if (s->known) cfem_swing_advance(s, u ? u : s->u);
    for (int i = 0; i < NQ; i++) s->known = s->known && in_box(i, s->z[i]);
    for (int again = 0; again < 2; again++) {
        const int begins = !s->known;
        int wide = 0;
        best = &one;
        if (begins && start(s, &seen, u)) {
            memset(found, 0, sizeof *found);
            return found->status = CFEM_SWING_NO_COMMAND;
        }
        set_problem(s, &seen, &asked);
        solve(&asked, s->covariance, &one);
        if (!one.good || cfem_estimate_count(one.kept) < cfem_estimate_count(asked.there) || !passes_gate(s, &one)) {
            slack_covariance(s, wider);
            solve(&asked, wider, &other);
            const int better = cfem_estimate_count(other.kept) > cfem_estimate_count(one.kept) || (passes_gate(s, &other) && !passes_gate(s, &one));
            wide = other.good && (!one.good || better);
            if (wide) best = &other;
        }
        const int verdict = begins ? CFEM_GATE_ACCEPTED
                                   : cfem_gate_judge(&s->gate, best->square, best->numbers, cfem_estimate_gate_sigmas, CFEM_ESTIMATE_GATE_SAMPLES);
        if (verdict == CFEM_GATE_RESTART) {
            s->known = 0;
            continue;
        }
        if (best->good && verdict == CFEM_GATE_REJECTED) best->good = 0, best->status = CFEM_ESTIMATE_REJECTED;
        if (best->good && wide) memcpy(s->covariance, wider, sizeof wider);
        break;
    }
    if (best->good) correct(s, best->root, asked.mean, best->here.x, best->P);
    answer(s, best, &asked, found);
    return found->status;
}
