/* Predictive control of a page: without sensors, and with the robot as data (cfem_motion_data.h). */
#ifndef CFEM_MPC_DATA_H
#define CFEM_MPC_DATA_H

#include "cfem_motion_data.h"

#define CFEM_MPC_PLANES 0
#define CFEM_MPC_SENSED 0
#define CFEM_MPC_LATE 1
#define CFEM_MPC_DT cfem_mpc_dt[0]
#define CFEM_MPC_WARP cfem_mpc_warp[0]
#define CFEM_MPC_LENGTH cfem_mpc_length[0]

#endif
