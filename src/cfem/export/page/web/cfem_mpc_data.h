/* Predictive control of a page: without sensors, and with the robot as data (cfem_motion_data.h). */
#ifndef CFEM_MPC_DATA_H
#define CFEM_MPC_DATA_H

#include "cfem_motion_data.h"

#define CFEM_MPC_TICKS cfem_moves.ticks
#define CFEM_MPC_MOVES cfem_moves.moves
#define CFEM_MPC_EVERY cfem_moves.every
#define CFEM_MPC_PLANES 0
#define CFEM_MPC_FORCE cfem_moves.force
#define CFEM_MPC_SENSED 0
#define CFEM_MPC_LATE 1
#define CFEM_MPC_DT cfem_moves.dt
#define CFEM_MPC_WARP cfem_moves.warp
#define CFEM_MPC_LENGTH cfem_moves.length
#define cfem_mpc_begins cfem_moves.begins
#define cfem_mpc_weight cfem_moves.weight
#define cfem_mpc_smooth cfem_moves.smooth
#define cfem_mpc_effort cfem_moves.effort
#define cfem_mpc_size cfem_moves.size
#define cfem_mpc_command cfem_moves.command
#define cfem_mpc_rate cfem_moves.rate
#define cfem_mpc_course cfem_moves.course
#define cfem_mpc_course_size cfem_moves.course_size

#endif
