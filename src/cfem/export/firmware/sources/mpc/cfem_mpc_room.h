/* Sizes of predictive control, and room for them in memory: as much as the robot needs. Code that takes its robot as data says before
 * how much room there is. */
#ifndef CFEM_MPC_ROOM_H
#define CFEM_MPC_ROOM_H

#include "cfem_motion_room.h"
#include "cfem_mpc_data.h"
#include "cfem_room.h"

#define CFEM_MPC_NZ ((2 + CFEM_MOTION_TERMS) * CFEM_MOTION_NQ) /* q, p and the memory of Prony terms */
#define CFEM_MPC_NX (CFEM_MPC_NZ + 2 + CFEM_MOTION_NE)         /* what the observer estimates: state, material, offset */
#define CFEM_MPC_VARIABLES (CFEM_MPC_MOVES * CFEM_MOTION_NA)

#ifndef CFEM_MPC_MOST_TICKS
#define CFEM_MPC_MOST_NZ CFEM_MPC_NZ
#define CFEM_MPC_MOST_TICKS CFEM_MPC_TICKS
#define CFEM_MPC_MOST_MOVES CFEM_MPC_MOVES
#define CFEM_MPC_MOST_PLANES CFEM_MPC_PLANES
#define CFEM_MPC_MOST_LATE CFEM_MPC_LATE
#endif

/* Columns of the covariance, a multiple of those that a step takes at once. */
#define CFEM_MPC_COLUMNS \
    ((CFEM_MPC_MOST_NZ + 2 + CFEM_MOTION_MOST_NE + CFEM_MOTION_MOST_NA - 1) / CFEM_MOTION_MOST_NA * CFEM_MOTION_MOST_NA)
#define CFEM_MPC_MOST_VARIABLES (CFEM_MPC_MOST_MOVES * CFEM_MOTION_MOST_NA)

#endif
