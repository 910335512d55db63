/* The filter's own names and sizes for what it shares with predictive control, cfem_tick.c: other steps, maybe other commands. For the
 * files of the filter alone. */
#ifndef CFEM_SWING_ROOM_H
#define CFEM_SWING_ROOM_H

#include "cfem_swing.h"

#define CFEM_MPC_DATA_H
#define CFEM_MPC_ROOM_H
#include "cfem_motion_room.h"

#define CFEM_MPC_NZ CFEM_SWING_NZ
#define CFEM_MPC_MOST_NZ CFEM_SWING_NZ
#define CFEM_MPC_DT CFEM_SWING_DT
#define CFEM_MPC_WARP CFEM_SWING_WARP
#define CFEM_MPC_FORCE CFEM_SWING_FORCE
#define cfem_place_at cfem_swing_place_at
#define cfem_place_between cfem_swing_place_between
#define cfem_stage_at cfem_swing_stage_at
#define cfem_stage_of_one cfem_swing_stage_of_one
#define cfem_stage_of_block cfem_swing_stage_of_block
#define cfem_stage_by_material cfem_swing_stage_by_material
#define cfem_tick cfem_swing_tick
#define cfem_acting cfem_swing_acting
#define cfem_tips cfem_swing_tips

#endif
