/* Implicit midpoint rule of T = v . M v / 2, U = Psi(delta) + kappa eta . eta / 2: as src/cfem/motion/step.py has it. */
#include "cfem_motion.h"

#include <math.h>
#include <string.h>

#include "cfem_block.h"
#include "cfem_inertia.h"
#include "cfem_linear.h"
#include "cfem_parts.h"

#define NA CFEM_MOTION_NA
#define NR CFEM_MOTION_NR
#define NQ CFEM_MOTION_NQ
#define NE CFEM_MOTION_NE
#define ACROSS CFEM_MOTION_ACROSS
#define ITERATIONS 30
#define EXPANSIONS 30
#define TOLERANCE CFEM_TOLERANCE(1e-8, 1e-5) /* of the motion, */
#define MOTION CFEM_TOLERANCE(1e-6, 0.1)     /* mm a step at least: shares of less are rounding of the place */
#define SLOW 0.03 /* rate of the changes from which the slopes are taken again */
#define NEAR 1e-4 /* of the half width of the learned box */

/* The equations of a step where the learned functions are expanded about a place near its middle: as src/cfem/motion/expansion.py has
 * them. drag: of the viscous force by v; known: forces that do not depend on v. */
typedef struct {
    double about[NA], pull[NA], stiff[NA][NA], M[NQ][ACROSS], dM[NA][NQ][ACROSS], drag[NQ][ACROSS], known[NQ];
} expansion;

static void expand(const cfem_motion *motion, const double *command, const int *held, const double *v, double dt, expansion *near) {
    cfem_parts parts;
    cfem_inertia inertia;
    for (int a = 0; a < NA; a++) near->about[a] = motion->q[a] + dt / 2 * v[a];
    cfem_potential_parts(near->about, &parts);
    cfem_inertia_at(near->about, 1, 1.0, &inertia);
    cfem_unpack(inertia.M, near->M);
    for (int i = 0; i < NQ; i++) near->known[i] = i < NA && !held[i] ? command[i] : 0.0;
    for (int a = 0; a < NA; a++) {
        near->pull[a] = parts.gradient[a];
        for (int b = 0; b < NA; b++) near->stiff[a][b] = parts.hessian[a][b];
        cfem_unpack(inertia.dM[a], near->dM[a]);
    }
    memset(near->drag, 0, sizeof near->drag);
    for (int l = 0, term = 0; l < CFEM_MOTION_LOSSES; l++) {
        double F[NQ][ACROSS], rate = cfem_motion_relaxation[l], moved[NQ] = {0};
        for (int k = 0; k < cfem_motion_prony_terms[l]; k++, term++) {
            const double half = dt / (2 * cfem_motion_prony[term][1]), share = cfem_motion_prony[term][0] / (1 + half);
            rate += share * dt / 2;
            for (int i = 0; i < NQ; i++) moved[i] += share * motion->memory[term][i];
        }
        if (cfem_motion_prony_terms[l]) cfem_add_symmetric(-1.0, inertia.F[l], moved, near->known);
        cfem_unpack(inertia.F[l], F);
        for (int i = 0; i < NQ; i++)
            for (int j = 0; j < ACROSS; j++) near->drag[i][j] += rate * F[i][j];
    }
}

/* out (NQ,) = S x, S symmetric: columns are added, so that sums keep their order whatever runs at once. */
static void times(double S[NQ][ACROSS], const double *x, double *out) {
    double full[ACROSS];
    for (int i = 0; i < ACROSS; i += CFEM_AT_ONCE) {
        cfem_lanes sum = {0};
        for (int j = 0; j < NQ; j++) sum += x[j] * *(const cfem_lanes *)(S[j] + i);
        *(cfem_lanes *)(full + i) = sum;
    }
    memcpy(out, full, sizeof(double) * NQ);
}

/* At mean velocity v. force: dL/dq + Q; rest: dt/2 force + p - M v; turning: dt/2 times the slope of M v by the place; Mv. */
typedef struct {
    double rest[NQ], turning[NA][NQ], Mv[NQ], force[NQ];
} equations;

static void assemble(const cfem_motion *motion, expansion *near, const double *v, double dt, equations *at) {
    double force[NQ], ahead[NA], lost[NQ];
    times(near->M, v, at->Mv);
    times(near->drag, v, lost);
    for (int i = 0; i < NQ; i++) force[i] = near->known[i] - lost[i];
    for (int a = 0; a < NA; a++) {
        double by_turn[NQ], twice = 0.0;
        ahead[a] = motion->q[a] + dt / 2 * v[a] - near->about[a];
        times(near->dM[a], v, by_turn);
        for (int i = 0; i < NQ; i++) {
            at->Mv[i] += ahead[a] * by_turn[i], twice += by_turn[i] * v[i];
            at->turning[a][i] = dt / 2 * by_turn[i];
        }
        force[a] += twice / 2 - near->pull[a];
    }
    for (int a = 0; a < NA; a++)
        for (int b = 0; b < NA; b++) force[a] -= near->stiff[a][b] * ahead[b];
    for (int r = NA; r < NQ; r++) force[r] -= cfem_motion_stiffness * (motion->q[r] + dt / 2 * v[r]);
    for (int i = 0; i < NQ; i++) at->force[i] = force[i], at->rest[i] = dt / 2 * force[i] + motion->p[i] - at->Mv[i];
}

/* Minus the derivative of rest by v, but for how M differs from that at `about`. */
static void slopes(const expansion *near, const equations *at, double dt, double slope[NQ][NQ]) {
    for (int i = 0; i < NQ; i++)
        for (int j = 0; j < NQ; j++) slope[i][j] = near->M[i][j] + dt / 2 * near->drag[i][j];
    for (int a = 0; a < NA; a++) {
        for (int b = 0; b < NA; b++) slope[a][b] += dt * dt / 4 * near->stiff[a][b];
        for (int i = 0; i < NQ; i++) slope[i][a] += at->turning[a][i], slope[a][i] -= at->turning[a][i];
    }
    for (int r = NA; r < NQ; r++) slope[r][r] += dt * dt / 4 * cfem_motion_stiffness;
}

/* Newton's method from v, whose n entries `free` are changed, with the slopes there, and later ones where changes fall slowly. v, what is left,
 * and the impulse M v, these two to first order in the last change. 1 where it does not end. */
static int newton(const cfem_motion *motion, expansion *near, const int *free, int n, double dt, double *v, double *left,
                  double *impulse) {
    double before = HUGE_VAL, size = 0.0, slope[NQ][NQ], A[NQ][NQ];
    int pivots[NQ], stale = 1;
    for (int i = 0; i < NQ; i++) size = fmax(size, fmax(fabs(v[i]), MOTION / dt) * cfem_motion_unit[i]);
    for (int iteration = 0; iteration < ITERATIONS; iteration++) {
        double change[NQ], full[NQ] = {0}, moved = 0.0;
        equations at;
        assemble(motion, near, v, dt, &at);
        if (stale) {
            slopes(near, &at, dt, slope);
            for (int i = 0; i < n; i++)
                for (int j = 0; j < n; j++) A[i][j] = slope[free[i]][free[j]];
            if (cfem_factorise(0, n, A, pivots)) return 1;
        }
        for (int i = 0; i < n; i++) change[i] = at.rest[free[i]];
        cfem_solve((const double(*)[NQ])A, pivots, 0, n, 1, change);
        for (int i = 0; i < n; i++) {
            full[free[i]] = change[i], v[free[i]] += change[i];
            moved = fmax(moved, fabs(change[i]) * cfem_motion_unit[free[i]]);
        }
        if (!(moved - moved == 0.0)) return 1;
        const double rate = before == HUGE_VAL ? 1.0 : fmin(moved / before, 1.0);
        stale = before != HUGE_VAL && rate > SLOW, before = moved;
        if (moved * rate > TOLERANCE * size) continue;
        for (int i = 0; i < NQ; i++) {
            left[i] = at.rest[i], impulse[i] = at.Mv[i];
            for (int j = 0; j < NQ; j++) left[i] -= slope[i][j] * full[j], impulse[i] += near->M[i][j] * full[j];
            for (int a = 0; a < NA; a++) impulse[i] += at.turning[a][i] * full[a];
        }
        return 0;
    }
    return 1;
}

void cfem_motion_rest(cfem_motion *motion, const double *delta_a) {
    cfem_parts parts;
    memset(motion, 0, sizeof *motion);
    for (int a = 0; a < NA; a++) motion->q[a] = delta_a[a];
    cfem_potential_parts(delta_a, &parts);
    for (int a = 0; a < NA; a++) motion->lambda_a[a] = parts.gradient[a];
}

/* The state after mean velocity v. */
static void arrive(cfem_motion *motion, const double *command, const int *held, double dt, const double *v, const double *left,
                   const double *impulse) {
    for (int i = 0; i < NQ; i++) {
        if (i < NA) motion->lambda_a[i] = held[i] ? -2 / dt * left[i] : command[i];
        motion->p[i] = 2 * impulse[i] - motion->p[i];
        motion->q[i] += dt * v[i];
        motion->gain[i] = (v[i] - motion->v[i]) / dt;
        motion->v[i] = v[i];
    }
    for (int term = 0; term < CFEM_MOTION_TERMS; term++) {
        const double half = dt / (2 * cfem_motion_prony[term][1]);
        for (int i = 0; i < NQ; i++) motion->memory[term][i] = ((1 - half) * motion->memory[term][i] + dt * v[i]) / (1 + half);
    }
    motion->t += dt;
}

int cfem_motion_step(cfem_motion *motion, const double *command, const int *held, double dt) {
    double v[NQ], left[NQ], impulse[NQ];
    int free[NQ], n = 0;
    expansion near;
    for (int i = 0; i < NQ; i++) {
        if (i >= NA || !held[i]) free[n++] = i, v[i] = motion->v[i] + dt * motion->gain[i];
        else v[i] = (command[i] - motion->q[i]) / dt;
        if (!(v[i] - v[i] == 0.0)) return 1;
    }
    for (int count = 0; count < EXPANSIONS; count++) {
        double apart = 0.0;
        expand(motion, command, held, v, dt, &near);
        if (newton(motion, &near, free, n, dt, v, left, impulse)) return 1;
        for (int k = 0; k < NA; k++) {
            double z = 0.0;
            for (int a = 0; a < NA; a++) z += cfem_motion_to_box[k][a] * (motion->q[a] + dt / 2 * v[a] - near.about[a]);
            apart = fmax(apart, fabs(z));
        }
        if (apart > NEAR) continue;
        arrive(motion, command, held, dt, v, left, impulse);
        return 0;
    }
    return 1;
}

int cfem_motion_rates(const cfem_motion *motion, const double *force, cfem_motion *rates) {
    double A[NQ][NQ], v[NQ] = {0};
    int pivots[NQ], held[NA] = {0};
    expansion here;
    equations at;
    expand(motion, force, held, v, 0.0, &here);
    for (int i = 0; i < NQ; i++) {
        v[i] = motion->p[i];
        for (int j = 0; j < NQ; j++) A[i][j] = here.M[i][j];
    }
    if (cfem_factorise(0, NQ, A, pivots)) return 1;
    cfem_solve((const double(*)[NQ])A, pivots, 0, NQ, 1, v);
    assemble(motion, &here, v, 0.0, &at);
    memset(rates, 0, sizeof *rates);
    for (int i = 0; i < NQ; i++) {
        rates->q[i] = v[i], rates->p[i] = at.force[i];
        for (int term = 0; term < CFEM_MOTION_TERMS; term++)
            rates->memory[term][i] = v[i] - motion->memory[term][i] / cfem_motion_prony[term][1];
    }
    return 0;
}

void cfem_motion_effectors(const cfem_motion *motion, double *effectors) {
    const double *eta = motion->q + NA;
    double curve[NE][NR];
    cfem_parts parts;
    cfem_inner inner;
    cfem_effector_parts(motion->q, &parts);
    cfem_inner_at(motion->q, 0, &inner);
    cfem_curve_of(&inner, eta, curve);
    for (int e = 0; e < NE; e++) {
        effectors[e] = parts.effector[e];
        for (int r = 0; r < NR; r++) effectors[e] += (inner.H[e * NR + r] + curve[e][r] / 2) * eta[r];
    }
}
