/* Compares the compiled controller with the Python model that it was made from, on the PC or on the target: exits 0 and prints
 * "N passed, 0 failed" where all hold. Differences are relative to the largest number of the same block in all vectors. The only file besides main.c that prints. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "cfem.h"
#include "cfem_vectors.h"

#define TICKS 300

static int passed, failed;

static void check(int good, const char *what, int vector, double off) {
    if (good) passed++;
    else failed++, printf("vector %d: %s, off by %.3g\n", vector, what, off);
}

/* A block of numbers of the condensed model, by where it is in cfem_condensed and in cfem_vector. */
typedef struct {
    const char *name;
    int size;
    size_t found, expected;
} block;

#define BLOCK(n, member) {#member, n, offsetof(cfem_condensed, member), offsetof(cfem_vector, member)}
static const block blocks[] = {BLOCK(CFEM_NA *CFEM_NA, W_aa), BLOCK(CFEM_NE *CFEM_NA, W_ea), BLOCK(CFEM_NA, lambda_a),
                               BLOCK(CFEM_NA, delta_a), BLOCK(CFEM_NA, free_a), BLOCK(CFEM_NE, free_e),
#if CFEM_FULL
                               BLOCK(CFEM_NE *CFEM_NE, W_ee),
#endif
};
#define BLOCKS ((int)(sizeof blocks / sizeof *blocks))

static const double *at(const void *record, size_t offset) { return (const double *)((const char *)record + offset); }

/* The largest number of a block in all vectors; delta_free is a part of delta, whose size it takes. */
static double size_of(const block *b) {
    double size = 0.0;
    size_t offset = b->expected;
    if (b->expected == offsetof(cfem_vector, free_a)) offset = offsetof(cfem_vector, delta_a);
    for (int v = 0; v < CFEM_VECTORS; v++)
        for (int i = 0; i < b->size; i++) size = fmax(size, fabs(at(&cfem_vectors[v], offset)[i]));
    return size > 0.0 ? size : 1.0;
}

/* From home to a goal that the model can reach: mm between the goal and where the model has the effectors in the end. */
static double follow(const double *goal, unsigned *status) {
    cfem_controller controller;
    cfem_input in;
    cfem_output out;
    cfem_condensed m;
    double s[CFEM_NA], square = 0.0;
    memset(&in, 0, sizeof in);
    cfem_init(&controller);
    for (int e = 0; e < CFEM_NE; e++) in.goal[e] = (cfem_real)goal[e];
    for (int i = 0; i < CFEM_NA; i++) in.delta_a[i] = (cfem_real)controller.delta_a[i];
    *status = CFEM_OK;
    for (int tick = 0; tick < TICKS; tick++) {
        *status = cfem_step(&controller, &in, &out);
        if (*status & CFEM_HELD) return HUGE_VAL;
        for (int i = 0; i < CFEM_NA; i++) in.delta_a[i] = out.delta_a[i];
    }
    for (int i = 0; i < CFEM_NA; i++) s[i] = CFEM_FORM_DISPLACEMENT ? controller.delta_a[i] : controller.lambda_a[i];
    cfem_model(s, &m);
    for (int e = 0; e < CFEM_NE; e++) {
        double missing = cfem_rest_e[e] + m.free_e[e] - goal[e];
        for (int i = 0; i < CFEM_NA; i++) missing += m.W_ea[e][i] * m.lambda_a[i];
        missing *= cfem_effector_weight[e] > 0.0;
        square += missing * missing;
    }
    return sqrt(square);
}

int main(void) {
    cfem_controller controller;
    cfem_input in;
    cfem_output out, before;
    double farthest = 0.0, worst = 0.0;
    int followed = 0;
    double sizes[BLOCKS];
    for (int b = 0; b < BLOCKS; b++) sizes[b] = size_of(&blocks[b]);
    for (int v = 0; v < CFEM_VECTORS; v++) {
        cfem_condensed m;
        const cfem_vector *one = &cfem_vectors[v];
        double error = cfem_model(one->s, &m) ? HUGE_VAL : 0.0;
        for (int b = 0; b < BLOCKS; b++)
            for (int i = 0; i < blocks[b].size; i++) {
                const double off = fabs(at(&m, blocks[b].found)[i] - at(one, blocks[b].expected)[i]) / sizes[b];
                if (!(off <= error)) error = off;
            }
        if (error > worst) worst = error;
        check(error <= CFEM_VECTOR_TOLERANCE, "the model differs from Python's", v, error);
        if (one->reachable) {
            unsigned status;
            const double distance = follow(one->goal, &status);
            if (!(distance <= farthest)) farthest = distance;
            followed++;
            check(distance <= CFEM_GOAL_TOLERANCE, "a goal is not reached (mm)", v, distance);
        }
    }

    /* What is not a number is refused: the command stays. */
    memset(&in, 0, sizeof in);
    cfem_init(&controller);
    for (int e = 0; e < CFEM_NE; e++) in.goal[e] = (cfem_real)cfem_rest_e[e];
    cfem_step(&controller, &in, &before);
    in.goal[0] = (cfem_real)NAN;
    check(cfem_step(&controller, &in, &out) == (CFEM_HELD | CFEM_BAD_INPUT), "NaN is not refused", -1, 0);
    check(!memcmp(out.delta_a, before.delta_a, sizeof out.delta_a), "a refused tick changed the command", -1, 0);

    printf("model: off by %.2e at most (%d vectors); goals: missed by %.2e mm at most (%d)\n", worst, CFEM_VECTORS, farthest,
           followed);
    printf("%d passed, %d failed\n", passed, failed);
    return failed != 0;
}
