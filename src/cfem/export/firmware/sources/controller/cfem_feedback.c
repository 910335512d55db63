/* The PI correction of goals, with the gate of its samples and the gain for their delay. */
#include "cfem_feedback.h"

#include "cfem_far.h"

#define WINDOW CFEM_FEEDBACK_WINDOW

void cfem_feedback_init(cfem_feedback *f) {
    cfem_feedback_drop(f);
    f->given = f->heard = 0;
    f->next = f->samples = f->gaps = f->late = 0;
    f->integral = cfem_integral_gain[0];
}

/* The next of a window, which counts on to twice its length and back. */
static void append(uint32_t *window, int *count, uint32_t value) {
    window[*count % WINDOW] = value;
    *count = *count + 1 < 2 * WINDOW ? *count + 1 : WINDOW;
}

/* Samples that come late: of the largest age and the smallest interval. */
static int late_samples(const cfem_feedback *f) {
    uint32_t age = 1, interval = 0;
    for (int k = 0; k < WINDOW && k < f->samples; k++)
        if (f->ages[k] > age) age = f->ages[k];
    for (int k = 0; k < WINDOW && k < f->gaps; k++)
        if (!interval || f->intervals[k] < interval) interval = f->intervals[k];
    return (int)((age - 1) / (interval ? interval : 1));
}

/* Square of the normalised innovation: of what the model misses by against the last time; rotations do not count. */
static double innovation_square(const cfem_feedback *f, const double *missed) {
    double square = 0.0;
    for (int e = 0; e < CFEM_NE; e++) {
        const double share = (missed[e] - f->missed[e]) / (CFEM_FEEDBACK_SPREAD * cfem_far[e] / CFEM_FAR_LENGTHS);
        square += share * share;
    }
    return square;
}

unsigned cfem_feedback_hear(cfem_feedback *f, uint32_t tick, const cfem_real *x_e) {
    const uint32_t age = f->given - tick + 1, interval = tick - f->heard; /* numbers may run over */
    const int first = f->heard == 0;
    double place[CFEM_MOST_NE], missed[CFEM_MOST_NE], square = 0.0;
    int measured = 0;
    if ((int32_t)(tick - f->given) > 0) return CFEM_REJECTED;
    if ((int32_t)interval <= 0) return CFEM_OK;
    f->heard = tick;
    if (age > CFEM_LATE) return CFEM_REJECTED;
    const int command = (f->next + CFEM_LATE - (int)age) % CFEM_LATE;
    for (int e = 0; e < CFEM_NE; e++) {
        const int counts = cfem_effector_weight[e] > 0.0;
        measured += counts;
        place[e] = (double)x_e[e];
        missed[e] = counts ? f->expected[command][e] - place[e] : 0.0;
        if (!cfem_finite(missed[e])) return CFEM_REJECTED;
        if (counts && fabs(place[e] - cfem_rest_e[e]) > cfem_far[e]) return CFEM_REJECTED;
    }
    if (cfem_in_metres(place)) return CFEM_REJECTED;
    append(f->ages, &f->samples, age);
    if (!first) append(f->intervals, &f->gaps, interval);
    f->late = late_samples(f);
    f->integral = cfem_integral_gain[f->late];
    if (cfem_gate_judge(&f->gate, innovation_square(f, missed), measured, CFEM_FEEDBACK_SIGMAS, CFEM_FEEDBACK_CONFIRMED) == CFEM_GATE_REJECTED)
        return CFEM_REJECTED;
    for (int e = 0; e < CFEM_NE; e++) {
        const double error = missed[e] - (cfem_effector_weight[e] > 0.0 ? f->shifted[command][e] : 0.0);
        f->missed[e] = missed[e];
        f->moved[e] = CFEM_K_P * error;
        f->total[e] += f->integral * error;
        square += f->total[e] * f->total[e];
    }
    const double length = sqrt(square);
    for (int e = 0; e < CFEM_NE; e++) {
        if (length > CFEM_INTEGRAL_LIMIT) f->total[e] *= CFEM_INTEGRAL_LIMIT / length;
        f->moved[e] += f->total[e];
    }
    return CFEM_OK;
}

void cfem_feedback_drop(cfem_feedback *f) {
    for (int e = 0; e < CFEM_NE; e++) f->total[e] = f->moved[e] = f->missed[e] = 0.0;
    cfem_gate_restart(&f->gate);
}

void cfem_feedback_commanded(cfem_feedback *f, const double *expected) {
    for (int e = 0; e < CFEM_NE; e++) f->expected[f->next][e] = expected[e], f->shifted[f->next][e] = f->moved[e];
    f->next = (f->next + 1) % CFEM_LATE;
    f->given++;
}
