/* The correction of goals by samples that may be late and rare: the rule of Python's cfem.control.closed_loop.feedback.
 *
 * A sample has the number of the command that it followed, and corrects once, against the reference of that command. Its age is
 * 1 where it followed the last one. The largest age and the smallest interval of the last samples say how many of them come
 * late, and that says K_I. */
#ifndef CFEM_FEEDBACK_H
#define CFEM_FEEDBACK_H

#include <stdint.h>

#include "cfem_gate.h"
#include "cfem_room.h"

#define CFEM_FEEDBACK_WINDOW 8     /* samples whose ages and intervals count */
#define CFEM_FEEDBACK_SPREAD 0.005 /* lengths of the robot: standard deviation of what the model misses from one sample to the next */
#define CFEM_FEEDBACK_SIGMAS 5.0   /* standard deviations by which a sample may miss the last one */
#define CFEM_FEEDBACK_CONFIRMED 2  /* samples in a row that agree on a jump, from which on it counts */

typedef struct {
    double total[CFEM_MOST_NE];                        /* mm, K_I sum e */
    double moved[CFEM_MOST_NE];                        /* mm, by which the goal is moved: K_P e + K_I sum e */
    double expected[CFEM_MOST_LATE][CFEM_MOST_NE];     /* mm, absolute: effectors under the last commands; the next goes to `next` */
    double shifted[CFEM_MOST_LATE][CFEM_MOST_NE];      /* mm, `moved` at these commands */
    double missed[CFEM_MOST_NE];                       /* mm, what the model missed by at the last sample that corrected */
    cfem_gate gate;
    double integral;                                   /* K_I of the last sample */
    uint32_t given, heard;                             /* commands so far; number of the command that the last sample followed */
    uint32_t ages[CFEM_FEEDBACK_WINDOW], intervals[CFEM_FEEDBACK_WINDOW]; /* ticks, of the last samples */
    int next, samples, gaps;                           /* samples and intervals so far, up to the window and then round it */
    int late;                                          /* samples taken before the one that first shows a correction */
} cfem_feedback;

void cfem_feedback_init(cfem_feedback *f);

/* A sample x_e (CFEM_NE,) mm that followed the command of that number; 0: none. One heard before changes nothing. CFEM_OK, or
 * CFEM_REJECTED for one that is not finite, farther from rest than goals may be (cfem_far), older than CFEM_LATE commands, of a
 * command not given yet, or a jump that no second sample has confirmed. */
unsigned cfem_feedback_hear(cfem_feedback *f, uint32_t tick, const cfem_real *x_e);

/* Forgets the correction; samples keep their numbers. */
void cfem_feedback_drop(cfem_feedback *f);

/* After each command; expected (CFEM_NE,) mm, absolute: where the model has the effectors under it. */
void cfem_feedback_commanded(cfem_feedback *f, const double *expected);

#endif
