/* The least-squares problem of one frame, cfem_estimate_fit.c, with the unknowns of the filter of what moves: its names begin with
 * cfem_swing, so that both can be linked. For the files of the filter alone. */
#ifndef CFEM_SWING_FIT_H
#define CFEM_SWING_FIT_H

#include "cfem_swing.h"

#define N CFEM_SWING_N
#define STARTS 0 /* what was known before is near */
#define cfem_estimate_scale cfem_swing_scale
#define cfem_estimate_box cfem_swing_box
#define cfem_estimate_places cfem_swing_places
#define cfem_estimate_tensions(x, force, by_x) ((void)(force), (void)(by_x))
#define cfem_estimate_see cfem_swing_see
#define cfem_estimate_left_out cfem_swing_left_out
#define cfem_estimate_count cfem_swing_count
#define cfem_estimate_minimise cfem_swing_minimise
#include "cfem_estimate_parts.h"

#endif
