/* Places that cannot be meant, since their unit is another one, as src/cfem/condensed/far.py has it. */
#ifndef CFEM_FAR_H
#define CFEM_FAR_H

#include <math.h>

#include "cfem.h"
#include "cfem_linear.h"

#define CFEM_FAR_LENGTHS 2.0  /* of the robot, that cfem_far is */
#define CFEM_AWAY_LENGTHS 0.5 /* from rest, from where on a place may be one in metres */

/* Whether a place (CFEM_NE) mm absolute would be near the robot if it were in metres. Rotations have no length. */
static inline int cfem_in_metres(const double *place) {
    int near = 1, away = 0;
    for (int e = 0; e < CFEM_NE; e++) {
        const double length = cfem_far[e] / CFEM_FAR_LENGTHS;
        if (!cfem_finite(length)) continue;
        away |= fabs(place[e] - cfem_rest_e[e]) > CFEM_AWAY_LENGTHS * length;
        near &= fabs(1e3 * place[e] - cfem_rest_e[e]) <= length;
    }
    return near && away;
}

/* Whether a goal (CFEM_NE) mm absolute is more than two lengths of the robot from rest, or in metres. */
static inline int cfem_is_far(const double *goal) {
    int far = cfem_in_metres(goal);
    for (int e = 0; e < CFEM_NE; e++) far |= fabs(goal[e] - cfem_rest_e[e]) > cfem_far[e];
    return far;
}

#endif
