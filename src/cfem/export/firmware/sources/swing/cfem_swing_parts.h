/* A step forward, and where markers and effectors of a robot that moves are. For the files of the filter alone. */
#ifndef CFEM_SWING_PARTS_H
#define CFEM_SWING_PARTS_H

#include "cfem_swing.h"

/* y (rows,): where the markers are, from rest, at the unknowns x; by: its slopes by them. */
void cfem_swing_places(const double *x, double y[3 * CFEM_ESTIMATE_MARKERS], double by[3 * CFEM_ESTIMATE_MARKERS][CFEM_SWING_N]);

/* To the next frame, in whose time the command moves to u (NA,). A motion that is lost is forgotten. */
void cfem_swing_advance(cfem_swing *filter, const double *u);

/* effector (NE,): mm from rest. */
void cfem_swing_effectors(const double x[CFEM_SWING_N], double effector[CFEM_ESTIMATE_NE]);

#endif
