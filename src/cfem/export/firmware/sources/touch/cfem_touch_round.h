/* One round of a step, for cfem_touch.c: the law of contact, linear about where the patches are. */
#ifndef CFEM_TOUCH_ROUND_H
#define CFEM_TOUCH_ROUND_H

#include "cfem_touch.h"

/* local: forces in the frames of what the patches meet. */
typedef struct {
    const cfem_obstacle *obstacles;
    int obstacle_count;
    double mu;
    cfem_touched *now;
    cfem_touch_room *room;
    int stuck_before[CFEM_PATCHES]; /* whether friction held it in the last round */
    double frame[CFEM_TOUCH_MOST][3][3], local[CFEM_TOUCH_MOST][3];
} cfem_touch_round;

/* The forces that obey the law: `local` in the frames, and turned with curved obstacles as the state's. 0, or 1 where nothing obeys
 * it. */
int cfem_touch_obey(cfem_touch_round *at);

#endif
