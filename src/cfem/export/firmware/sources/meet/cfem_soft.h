/* Pairs of soft surfaces, for cfem_rounds.c: which touch, from where they slip, and whether they have settled. */
#ifndef CFEM_SOFT_H
#define CFEM_SOFT_H

#include "cfem_meet.h"
#include "cfem_rounds.h"

#define CFEM_SOFT_RESTS 1e-8 /* of the length: patches that move by less have settled */

/* begin: the state before, or 0. last: rows of the last round. moved: mm, since all pairs were looked for. */
struct cfem_meeting {
    const cfem_met *begin;
    cfem_met *now;
    cfem_meet_room *room;
    int last;
    double moved;
};

/* Number of row r of the law, of a patch near an obstacle or of a pair: the same in all rounds. */
static inline int cfem_soft_slot(const cfem_rounds *at, int r) {
    if (r >= at->solid) return at->soft->now->pair[at->soft->room->touching[r - at->solid]].row.slot;
    return CFEM_MEET_PATCHES + at->robot[r] * CFEM_PATCHES + at->now[at->robot[r]].patch[at->slot[r]];
}

/* Number of the hold of a slot, or -1. */
int cfem_hold_of(const cfem_met *now, int slot);

/* Those of before, or those that are near where the step begins. 0, or a status. */
unsigned cfem_soft_begin(cfem_rounds *at);

/* The pairs of this round: those that touch or are pressed. 0, or a status. */
unsigned cfem_soft_touch(cfem_rounds *at);

/* All patches of these pairs bear. 0, or a status. */
unsigned cfem_soft_bear(cfem_rounds *at, int *grown);

/* The same pairs on the same planes where patches have gone since; known: whether all patches of those that touch there bear. 0, or a
 * status. */
unsigned cfem_soft_go_on(cfem_rounds *at, int *known);

/* Every pair that touches has a hold, which keeps its faces. 0, or a status. */
unsigned cfem_soft_hold(cfem_rounds *at);

/* Of pair k of the round: frame, known force and gap; how many patches it has; number e of these, whose robot is returned: its place
 * among those that bear, and weight. */
void cfem_soft_row(cfem_rounds *at, int k, double *known, double *gap);
static inline const cfem_row_of *cfem_soft_row_of(const cfem_rounds *at, int k) { return &at->soft->now->pair[at->soft->room->touching[k]].row; }
static inline int cfem_soft_entries(const cfem_rounds *at, int k) { return cfem_soft_row_of(at, k)->count; }
static inline int cfem_soft_entry(const cfem_rounds *at, int k, int e, int *place, double *weight) {
    const cfem_row_of *const row = cfem_soft_row_of(at, k);
    *place = at->soft->room->chosen[row->patch[e]], *weight = row->weight[e];
    return row->patch[e] / CFEM_PATCHES;
}

/* In cfem_answers.c: combines the answers of the last rounds, on N on the patches of each robot and `local`, where these converge too slowly;
 * step mm: how far this one's moves patches in the scene. And whether that is where they went in the last round. */
void cfem_soft_accelerate(cfem_rounds *at, double (*on)[CFEM_TOUCH_ROWS], double (*step)[CFEM_TOUCH_ROWS]);

/* Takes the forces of the round, and finds the pairs anew; settled: whether what touches is what did, and hardly moves any more. 0, or a
 * status. */
unsigned cfem_soft_settle(cfem_rounds *at, int *settled);

/* Nothing touches. CFEM_TOUCH_CONVERGED where that is so, CFEM_ROUNDS_ON, or another status. */
unsigned cfem_soft_let_go(cfem_rounds *at);

/* From where slip counts from here on; then whether patch p of robot b is near anything. */
void cfem_soft_finish(cfem_rounds *at);
int cfem_soft_near(const cfem_rounds *at, int b, int p);

#endif
