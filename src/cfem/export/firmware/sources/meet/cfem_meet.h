/* Robots that touch each other, themselves and rigid bodies, all of the model that was exported: one quasi-static step at held
 * displacements, with friction. The same as cfem.predict.contact.step.scene. cfem_meet_data.h and cfem_meet_data.c were written by `cfem export`.
 *
 * Memory is what the caller owns: states, and a room to work in. Every loop is bounded; a step that finds no state says so. */
#ifndef CFEM_MEET_H
#define CFEM_MEET_H

#include "cfem_meet_data.h"
#include "cfem_pairs.h"
#include "cfem_touch.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CFEM_MEET_INSIDE 6 /* status beside those of cfem_touch.h: robots overlap where they begin */

/* From where the slip of a pair counts: the row of patches that it had; unknown: it does not, and the pair begins to. push: N, on the first
 * of these. */
typedef struct {
    cfem_row_of row;
    double push[3];
    int mode, unknown;
} cfem_hold;

/* One state. robot: of each one, `patch`, `force` in its own frame, `rows`, `delta_e` and `lambda_a`; `place` is in the scene. */
typedef struct {
    unsigned status;
    int iterations, systems, pair_count, hold_count;
    cfem_touched robot[CFEM_MEET_ROBOTS];
    cfem_pair pair[CFEM_MEET_PAIRS]; /* of soft surfaces, all that are near */
    cfem_hold hold[CFEM_MEET_PAIRS]; /* of those that press */
} cfem_met;

extern const cfem_placed cfem_robots[CFEM_MEET_ROBOTS]; /* of the export */

/* Answers of the last rounds, `count` of them, on the same `rows` of the law. pushes: N, of the rows in the scene, and behind them on the
 * patches that bear; step: mm, by which these move, `moved` numbers. last, last_moved: the step of the last round, whatever its rows. */
#define CFEM_MEET_ANSWERS 4
typedef struct {
    int count, rows, moved, last_moved, slot[CFEM_TOUCH_MOST], mode[CFEM_TOUCH_MOST];
    double pushes[CFEM_MEET_ANSWERS][CFEM_TOUCH_ROWS * (1 + CFEM_MEET_ROBOTS)];
    double step[CFEM_MEET_ANSWERS][CFEM_TOUCH_ROWS * CFEM_MEET_ROBOTS], last[CFEM_TOUCH_ROWS * CFEM_MEET_ROBOTS];
} cfem_answers;

/* Room to work in. */
typedef struct {
    cfem_touch_room robot[CFEM_MEET_ROBOTS];
    cfem_around around;
    cfem_answers answers;
    int chosen[CFEM_MEET_PATCHES];                        /* place of a patch among those of its robot's state, or -1 */
    int kept[CFEM_MEET_PAIRS];                            /* whether a hold has touched in this step, */
    cfem_row_of faces[CFEM_MEET_PAIRS];                   /* and what it met then */
    int touching[CFEM_TOUCH_MOST], slots[CFEM_TOUCH_MOST]; /* pairs of this round; slots of the last one */
} cfem_meet_room;

/* Quasi-static step of all robots to delta_a mm, from the state `before` (0: where they begin, pressed by nothing), among obstacles
 * (count,), with friction mu. How far a step may go: a twentieth of the reach, as who meets whom, and friction, depend on the way. A cable
 * that would have to push goes slack (not where they begin): its lambda_a is 0, and its delta_a beyond what was asked for.
 * Returns now->status; `now` may not be `before`. cfem_robots, cfem_obstacles and CFEM_TOUCH_FRICTION are those of the export. */
unsigned cfem_meet(double (*delta_a)[CFEM_NA], const cfem_placed *robots, const cfem_obstacle *obstacles, int count, double mu,
                   const cfem_met *before, cfem_met *now, cfem_meet_room *room);

/* N: the sum of the normal forces between robot `robot` and what has the number `met`: a robot, or that of all robots plus that of an
 * obstacle. */
double cfem_meet_pressed(const cfem_met *state, int robot, int met);

#ifdef __cplusplus
}
#endif
#endif
