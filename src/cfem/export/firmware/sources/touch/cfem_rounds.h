/* The rounds of one step of contact, for cfem_touch.c and, where surfaces are soft, cfem_meet.c. */
#ifndef CFEM_ROUNDS_H
#define CFEM_ROUNDS_H

#include "cfem_linear.h"
#include "cfem_touch.h"

/* Where surfaces are soft, and where they are not; what obstacles press on the patches of a robot's state, in the axes of the scene: those of
 * the only robot, where only obstacles press. */
#if CFEM_TOUCH_SOFT
#define CFEM_SOFT(soft, rigid) (soft)
#define CFEM_PUSH(state) ((state)->push)
#else
#define CFEM_SOFT(soft, rigid) (rigid)
#define CFEM_PUSH(state) ((state)->force)
#endif

struct cfem_meeting;

/* robots: of the step, of each one its state before, or 0, and now. solid: patches near obstacles, which are the first rows of the law: of
 * each its robot, and its place among those of the robot that bear. pairs: of soft surfaces that touch, which are the next rows. local: N, in
 * the frames of the rows. moved: mm, by all of the last change of the forces. share: of that change, that the round takes; takes_all: whether it takes
 * the answer of the law as it is; onwards: whether patches go where they went in the last round. missed: mm, by which patches miss the law
 * where they have come to. systems: linear ones that the step may still solve, of all its rounds. */
typedef struct {
    const cfem_placed *placed;
    const cfem_obstacle *obstacles;
    int obstacle_count;
    double mu;
    const cfem_touched *before;
    cfem_touched *now;
    cfem_touch_room *room;
    struct cfem_meeting *soft;
    int iterations, systems, solid, pairs, takes_all, onwards, robot[CFEM_TOUCH_MOST], slot[CFEM_TOUCH_MOST];
    double frame[CFEM_TOUCH_MOST][3][3], local[CFEM_TOUCH_MOST][3], moved, share, missed;
    unsigned char stuck_before[CFEM_TOUCH_ROBOTS][CFEM_PATCHES]; /* whether friction held it on an obstacle in the last round */
} cfem_rounds;

#define CFEM_ROUNDS_ON 99 /* status of a round: another is needed */

/* The step to delta_a mm, robot after robot: its status. In the second case unilateral actuators go slack where they would push. */
unsigned cfem_rounds_run(cfem_rounds *at, const double *delta_a);
unsigned cfem_rounds_slack(cfem_rounds *at, const double *delta_a);

/* Forces of the round that obey the law, or what it takes of these, in `local` and on the patches. 0, or 1 where nothing does. */
int cfem_rounds_obey(cfem_rounds *at);

/* From a robot's axes to those of the scene, and back. */
static inline void cfem_turn(const cfem_placed *pose, const double *own, double *scene) {
    for (int a = 0; a < 3; a++) scene[a] = cfem_dot(3, pose->R[a], own);
}

static inline void cfem_turn_back(const cfem_placed *pose, const double *scene, double *own) {
    for (int a = 0; a < 3; a++) own[a] = pose->R[0][a] * scene[0] + pose->R[1][a] * scene[1] + pose->R[2][a] * scene[2];
}

/* Mode of a force in the frame of its row. */
static inline int cfem_touch_mode(double mu, const double local[3]) {
    const int slips = sqrt(local[1] * local[1] + local[2] * local[2]) >= mu * local[0] * (1.0 - 1e-9);
    return !(local[0] > 0.0) ? CFEM_TOUCH_OPEN : slips ? CFEM_TOUCH_SLIP : CFEM_TOUCH_STICK;
}

/* For cfem_meet.c: where all patches are under the forces, and in the second case as patches that bear have become more. 0, or a status. */
void cfem_rounds_place(cfem_rounds *at);
unsigned cfem_rounds_know(cfem_rounds *at);
/* Patch p of robot b bears from now on. 1: it did not before; 0: it did; -1: too many do. */
int cfem_rounds_bear(cfem_rounds *at, int b, int p);

#endif
