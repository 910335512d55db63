/* A frame's step forward, as src/cfem/motion/estimation/transition.py has it. */
#include <math.h>
#include <string.h>

#include "cfem_swing_room.h"
#include "cfem_tick.h"
#include "cfem_linear.h"
#include "cfem_parts.h"
#include "cfem_swing_parts.h"

#define NA CFEM_MOTION_NA
#define NQ CFEM_MOTION_NQ
#define NR CFEM_MOTION_NR
#define NE CFEM_MOTION_NE
#define NW CFEM_ESTIMATE_NW
#define NZ CFEM_SWING_NZ
#define NX CFEM_SWING_NX
#define LOADS CFEM_SWING_LOADS
#define DT CFEM_SWING_DT
#define HELD (!CFEM_SWING_FORCE)
#define FREE (HELD ? NA : 0)

/* J (NW, NQ): slopes of the rows with loads by q. */
static void slopes(const double *q, const cfem_inner *inner, double J[LOADS][NQ]) {
    cfem_parts parts;
    cfem_effector_parts(q, &parts);
    for (int w = 0; w < NW; w++) {
        const int row = cfem_swing_rows[w];
        for (int a = 0; a < NA; a++) J[w][a] = parts.effector_gradient[row][a] + cfem_dot(NR, inner->dH[a] + row * NR, q + NA);
        for (int r = 0; r < NR; r++) J[w][NA + r] = inner->H[row * NR + r];
    }
}

/* A (NZ, NZ), B (NZ, NA): the state by the one before, and by what acts in the step. */
static void transition(const cfem_stage *stage, double A[NZ][NZ], double B[NZ][NA]) {
    double units[NZ * NA];
    cfem_stage_of_block(stage, NA, NULL, 1.0, B[0], NULL);
    for (int c = 0; c < NZ; c += NA) {
        double out[NZ * NA];
        memset(units, 0, sizeof units);
        for (int k = 0; k < NA && c + k < NZ; k++) units[(c + k) * NA + k] = 1.0;
        cfem_stage_of_block(stage, NA, units, 0.0, out, NULL);
        for (int i = 0; i < NZ; i++)
            for (int k = 0; k < NA && c + k < NZ; k++) A[i][c + k] = out[i * NA + k];
    }
    for (int i = 0; i < NZ && HELD; i++) /* an actuator keeps its distance from its command */
        for (int a = 0; a < NA; a++) A[i][a] += B[i][a];
}

/* Adds what forces do that nobody knows. half (NZ, NQ): by a force. 0, or 1 where there is no stiffness. */
static int add_pushes(const cfem_stage *stage, const cfem_inner *inner, double stiffness, double half[NZ][NQ], double P[NX][NX]) {
    double moved = 0.0, compliance[CFEM_MOST_SERIES_NA][CFEM_MOST_SERIES_NA];
    cfem_parts potential, tip;
    cfem_potential_parts(stage->middle, &potential), cfem_effector_parts(stage->middle, &tip);
    memcpy(compliance, potential.hessian, sizeof compliance);
    if (!HELD && cfem_invert(NA, CFEM_MOST_SERIES_NA, compliance[0])) return 1;
    for (int e = 0; e < NE; e++) {
        for (int a = 0; a < NA && !HELD; a++) moved += tip.effector_gradient[e][a] * cfem_dot(NA, compliance[a], tip.effector_gradient[e]);
        moved += cfem_dot(NR, inner->H + e * NR, inner->H + e * NR) / cfem_motion_stiffness;
    }
    moved /= NE * stiffness;
    const double size = CFEM_SWING_PUSH * CFEM_SWING_PUSH / moved * (0.01 / DT) * stiffness;
    for (int i = 0; i < NZ; i++) {
        double by[NQ];
        for (int a = 0; a < NA; a++) by[a] = HELD ? 0.0 : cfem_dot(NA, potential.hessian[a], half[i]);
        for (int r = NA; r < NQ; r++) by[r] = cfem_motion_stiffness * half[i][r];
        for (int j = 0; j <= i; j++) P[i][j] += size * cfem_dot(NQ - FREE, by + FREE, half[j] + FREE);
    }
    return 0;
}

/* P becomes F P F^T, its lower triangle. */
static void transport(double F[NX][NX], double P[NX][NX]) {
    double FP[NX][NX];
    for (int i = 0; i < NX; i++) {
        memset(FP[i], 0, sizeof FP[i]);
        for (int k = 0; k < NX; k++)
            for (int j = 0; F[i][k] != 0.0 && j < NX; j++) FP[i][j] += F[i][k] * P[k][j];
    }
    for (int i = 0; i < NX; i++)
        for (int j = 0; j <= i; j++) P[i][j] = cfem_dot(NX, FP[i], F[j]);
}

/* One step, in which the command moves to u; share: of a slip over the frame that acts in it. 0, or 1 where the robot is lost. */
static int step(cfem_swing *s, const double *u, double share, cfem_place *place, double J[LOADS][NQ]) {
    const cfem_material material = {exp(s->stiffness), 1.0};
    double half_push[NQ] = {0.0}, A[NZ][NZ], B[NZ][NA], half[NZ][NQ], F[NX][NX], by_material[NZ][2], by_slip[NZ][NA], sum = 0.0;
    const double keeps = CFEM_SWING_KEEPS, wander = CFEM_SWING_WANDER * CFEM_SWING_STIFFNESS;
    double (*P)[NX] = s->covariance;
    int known = 1;
    cfem_moving moving;
    cfem_stage stage;
    for (int w = 0; w < NW; w++)
        for (int i = 0; i < NQ; i++) half_push[i] += DT / 2 * s->load[w] * J[w][i];
    memcpy(moving.z, s->z, sizeof s->z), memcpy(moving.v, s->v, sizeof s->v), memcpy(moving.u, s->u, sizeof s->u);
    for (int i = 0; i < NQ; i++) moving.z[NQ + i] += half_push[i];
    double goal[NA];
    for (int a = 0; a < NA; a++) goal[a] = HELD ? s->z[a] + u[a] - s->u[a] : u[a];
    if (cfem_tick(&moving, goal, &material, place, &known, &stage)) return 1;
    transition(&stage, A, B), cfem_stage_by_material(&stage, by_material);
    memset(F, 0, sizeof F);
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NQ; j++) half[i][j] = DT / 2 * (A[i][NQ + j] + (i == NQ + j)); /* half before, half after the step */
        memcpy(F[i], A[i], sizeof A[i]);
        for (int w = 0; w < NW; w++) F[i][NZ + w] = cfem_dot(NQ, half[i], J[w]);
        F[i][NX - 1] = by_material[i][0];
    }
    for (int i = NZ; i < NX; i++) F[i][i] = i == NX - 1 ? 1.0 : keeps;
    transport(F, P);
    if (add_pushes(&stage, &place->inner, material.stiffness, half, P)) return 1;
    for (int i = 0; i < NZ && HELD; i++)
        for (int j = 0; j <= i; j++) P[i][j] += CFEM_SWING_SLIP * CFEM_SWING_SLIP * DT * cfem_dot(NA, B[i], B[j]);
    for (int i = 0; i < NX && HELD; i++)
        for (int j = 0; j <= i; j++) /* momenta of what is held are the model's */
            if ((i >= NQ && i < NQ + NA) || (j >= NQ && j < NQ + NA)) P[i][j] = 0.0;
    for (int v = 0; v < NW; v++)
        for (int w = 0; w <= v; w++) P[NZ + v][NZ + w] += (1.0 - keeps * keeps) * cfem_estimate_load_covariance[v][w];
    P[NX - 1][NX - 1] += DT * wander * wander;
    for (int i = 0; i < NX; i++)
        for (int j = 0; j <= i; j++) P[j][i] = P[i][j], sum += P[i][j];
    for (int i = 0; i < NZ; i++) {
        s->z[i] = moving.z[i] + (i >= NQ && i < 2 * NQ ? half_push[i - NQ] : 0.0), sum += s->z[i];
        for (int a = 0; a < NA; a++) {
            by_slip[i][a] = B[i][a] * share;
            for (int k = 0; k < NZ; k++) by_slip[i][a] += A[i][k] * s->by_slip[k][a];
        }
    }
    memcpy(s->by_slip, by_slip, sizeof by_slip), memcpy(s->v, moving.v, sizeof s->v), memcpy(s->u, u, sizeof s->u);
    for (int w = 0; w < NW; w++) s->load[w] *= keeps;
    return !cfem_finite(sum);
}

/* To the next frame, in whose time the command moves to u. A motion that is lost is forgotten. */
void cfem_swing_advance(cfem_swing *s, const double *u) {
    double middle[NQ], J[LOADS][NQ], before[NA], now[NA];
    cfem_place place;
    for (int i = 0; i < NQ; i++) {
        const double by = HELD && i < NA ? u[i] - s->u[i] : CFEM_SWING_STEPS * DT * s->v[i];
        middle[i] = s->z[i] + by / 2;
    }
    cfem_place_at(middle, 1, &place);
    slopes(middle, &place.inner, J);
    memcpy(before, s->u, sizeof before), memset(s->by_slip, 0, sizeof s->by_slip);
    for (int k = 1; k <= CFEM_SWING_STEPS && s->known; k++) {
        const double share = (double)k / CFEM_SWING_STEPS;
        for (int a = 0; a < NA; a++) now[a] = before[a] + share * (u[a] - before[a]);
        /* a displacement grows by as much in each step, a force acts with its mean over the step */
        if (step(s, now, (HELD ? 1.0 : k - 0.5) / CFEM_SWING_STEPS, &place, J)) s->known = 0;
    }
}
