/* One round of a meeting, for cfem_meet.c: the law of contact for the pairs that touch, linear about where the patches are. */
#ifndef CFEM_MEET_LAW_H
#define CFEM_MEET_LAW_H

#include "cfem_meet.h"

/* begin: the state before, or 0. count: of the pairs that touch, whose numbers the room holds. moved: mm in the last round. */
typedef struct {
    const cfem_met *begin;
    cfem_met *now;
    cfem_meet_room *room;
    double mu, moved;
    int count, last;
} cfem_meeting;

/* Number of the hold of a slot, or -1. */
int cfem_hold_of(const cfem_met *now, int slot);

/* Pair i of those that touch. */
cfem_pair *cfem_touching(const cfem_meeting *at, int i);

/* Places of the patches that each robot has chosen, into the room. */
void cfem_meet_number(cfem_meeting *at);

/* How many patches of the pairs that touch are not chosen yet; they are chosen where `all` is. -1: too many. */
int cfem_meet_choose(cfem_meeting *at, int all);

/* mm: gap of a pair, were the patches where the step began, on the same plane. */
double cfem_first_gap(const cfem_meeting *at, const cfem_pair *pair);

/* Every pair that touches has a hold, which keeps its faces. 0, or a status. */
unsigned cfem_meet_hold(cfem_meeting *at);

/* Forces `local` (count, 3) N of the pairs that touch, in their frames, that obey the law; pressed: with the compliance as the forces
 * have changed it. 0, or 1 where nothing obeys the law. */
int cfem_meet_law(cfem_meeting *at, int pressed, double (*local)[3]);

/* Puts these forces on pairs and on patches; how far they move these, mm, into `moved`. */
void cfem_meet_push(cfem_meeting *at, int pressed, double (*local)[3]);

#endif
