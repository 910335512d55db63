/* Sizes of predictive control, and room for them in memory: as much as the robot needs. Code that takes its robot as data says before
 * how much room there is. */
#ifndef CFEM_MPC_ROOM_H
#define CFEM_MPC_ROOM_H

#include "cfem_motion_data.h"
#include "cfem_mpc_data.h"
#include "cfem_room.h"

#define CFEM_MPC_NR (CFEM_MOTION_NQ - CFEM_MOTION_NA)
#define CFEM_MPC_NZ ((2 + CFEM_MOTION_TERMS) * CFEM_MOTION_NQ) /* q, p and the memory of Prony terms */
#define CFEM_MPC_NX (CFEM_MPC_NZ + 2 + CFEM_MOTION_NE)         /* what the observer estimates: state, material, offset */
#define CFEM_MPC_VARIABLES (CFEM_MPC_MOVES * CFEM_MOTION_NA)

#ifndef CFEM_MPC_MOST_NQ
#define CFEM_MPC_MOST_NA CFEM_MOTION_NA
#define CFEM_MPC_MOST_NE CFEM_MOTION_NE
#define CFEM_MPC_MOST_NQ CFEM_MOTION_NQ
#define CFEM_MPC_MOST_NR CFEM_MPC_NR
#define CFEM_MPC_MOST_NZ CFEM_MPC_NZ
#define CFEM_MPC_MOST_DEGREE CFEM_MOTION_DEGREE
#define CFEM_MPC_MOST_LOSSES (CFEM_MOTION_LOSSES ? CFEM_MOTION_LOSSES : 1)
#define CFEM_MPC_MOST_TERMS (CFEM_MOTION_TERMS ? CFEM_MOTION_TERMS : 1)
#define CFEM_MPC_MOST_MOVING CFEM_MOTION_MOVING_TERMS
#define CFEM_MPC_MOST_TICKS CFEM_MPC_TICKS
#define CFEM_MPC_MOST_MOVES CFEM_MPC_MOVES
#define CFEM_MPC_MOST_PLANES CFEM_MPC_PLANES
#define CFEM_MPC_MOST_LATE CFEM_MPC_LATE
#endif

#define CFEM_MPC_TRIANGLE (CFEM_MPC_MOST_NQ * (CFEM_MPC_MOST_NQ + 1) / 2)
/* Columns of the covariance, a multiple of those that a step takes at once. */
#define CFEM_MPC_COLUMNS ((CFEM_MPC_MOST_NZ + 2 + CFEM_MPC_MOST_NE + CFEM_MPC_MOST_NA - 1) / CFEM_MPC_MOST_NA * CFEM_MPC_MOST_NA)
#define CFEM_MPC_MOST_VARIABLES (CFEM_MPC_MOST_MOVES * CFEM_MPC_MOST_NA)

#define CFEM_MOTION_MOVING_OUTPUTS (CFEM_MOTION_NQ * (CFEM_MOTION_NQ + 1) / 2 + CFEM_MOTION_NE * CFEM_MPC_NR)

#if defined(__GNUC__) && !defined(__clang__)
#define CFEM_UNROLL _Pragma("GCC unroll 8")
#else
#define CFEM_UNROLL
#endif
#if defined(__GNUC__)
#define CFEM_INLINE static inline __attribute__((always_inline))
#else
#define CFEM_INLINE static inline
#endif

#endif
