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
static void into(uint32_t *window, int *count, uint32_t value) {
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

unsigned cfem_feedback_hear(cfem_feedback *f, uint32_t tick, const cfem_real *x_e) {
    const uint32_t age = f->given - tick + 1, interval = tick - f->heard; /* numbers may run over */
    const int first = f->heard == 0;
    double place[CFEM_MOST_NE], error[CFEM_MOST_NE], square = 0.0;
    if ((int32_t)(tick - f->given) > 0) return CFEM_REJECTED;
    if ((int32_t)interval <= 0) return CFEM_OK;
    f->heard = tick;
    if (age > CFEM_LATE) return CFEM_REJECTED;
    const double *const reference = f->references[(f->next + CFEM_LATE - (int)age) % CFEM_LATE];
    for (int e = 0; e < CFEM_NE; e++) {
        place[e] = (double)x_e[e];
        error[e] = cfem_effector_weight[e] > 0.0 ? reference[e] - place[e] : 0.0;
        if (!cfem_finite(error[e])) return CFEM_REJECTED;
        if (cfem_effector_weight[e] > 0.0 && fabs(place[e] - cfem_rest_e[e]) > cfem_far[e]) return CFEM_REJECTED;
    }
    if (cfem_in_metres(place)) return CFEM_REJECTED;
    into(f->ages, &f->samples, age);
    if (!first) into(f->intervals, &f->gaps, interval);
    f->late = late_samples(f);
    f->integral = cfem_integral_gain[f->late];
    for (int e = 0; e < CFEM_NE; e++) {
        f->total[e] += f->integral * error[e];
        square += f->total[e] * f->total[e];
    }
    const double length = sqrt(square);
    for (int e = 0; e < CFEM_NE; e++) {
        if (length > CFEM_INTEGRAL_LIMIT) f->total[e] *= CFEM_INTEGRAL_LIMIT / length;
        f->moved[e] = CFEM_K_P * error[e] + f->total[e];
    }
    return CFEM_OK;
}

void cfem_feedback_drop(cfem_feedback *f) {
    for (int e = 0; e < CFEM_NE; e++) f->total[e] = f->moved[e] = 0.0;
}

void cfem_feedback_commanded(cfem_feedback *f, const double *expected) {
    for (int e = 0; e < CFEM_NE; e++) f->references[f->next][e] = expected[e] - f->moved[e];
    f->next = (f->next + 1) % CFEM_LATE;
    f->given++;
}
