/* The robot in motion as data, as cfem_data.h has the robot at rest; with predictive control. cfem_page_motion.c reads the block,
 * page/motion.py writes it. */
#ifndef CFEM_MOTION_DATA_H
#define CFEM_MOTION_DATA_H

#include "cfem_data.h"
#include "cfem_series_data.h"

#define CFEM_MOTION_MOST_NA CFEM_MOST_NA
#define CFEM_MOTION_MOST_NE CFEM_MOST_NE
#define CFEM_MOTION_MOST_NQ 20
#define CFEM_MOTION_MOST_NR 20
#define CFEM_MOTION_MOST_LOSSES 4
#define CFEM_MOTION_MOST_TERMS 4
#define CFEM_MOTION_MOST_KEPT CFEM_MOTION_TRIANGLE
#define CFEM_MPC_MOST_NZ ((2 + CFEM_MOTION_MOST_TERMS) * CFEM_MOTION_MOST_NQ)
#define CFEM_MOTION_MOST_DEGREE CFEM_MOST_DEGREE
#define CFEM_MOTION_MOST_PRODUCTS 256
#define CFEM_MPC_MOST_TICKS 20
#define CFEM_MPC_MOST_MOVES 20
#define CFEM_MPC_MOST_PLANES 0
#define CFEM_MPC_MOST_LATE 1

#define CFEM_MOTION_COUNTS(X) \
    X(CFEM_MOTION_NQ, 1, CFEM_MOTION_MOST_NQ, "motions") \
    X(CFEM_MOTION_LOSSES, 0, CFEM_MOTION_MOST_LOSSES, "viscous materials") \
    X(CFEM_MOTION_TERMS, 0, CFEM_MOTION_MOST_TERMS, "Prony terms") \
    X(CFEM_MOTION_DEGREE, 1, CFEM_MOTION_MOST_DEGREE, "degrees") \
    X(CFEM_MOTION_CURVED, 0, 1, "curves") \
    X(CFEM_MOTION_FIRST_PRODUCTS, 1, CFEM_MOTION_MOST_PRODUCTS, "products in a half of its mass") \
    X(CFEM_MOTION_SECOND_PRODUCTS, 1, CFEM_MOTION_MOST_PRODUCTS, "products in a half of its mass") \
    X(CFEM_MPC_TICKS, 2, CFEM_MPC_MOST_TICKS, "ticks in the horizon") \
    X(CFEM_MPC_MOVES, 1, CFEM_MPC_MOST_MOVES, "moves in the horizon") \
    X(CFEM_MPC_EVERY, 1, CFEM_MPC_MOST_TICKS, "ticks between two places") \
    X(CFEM_MPC_FORCE, 0, 1, "commands")

/* Vectors of whole numbers. */
#define CFEM_MOTION_INTEGERS(X) \
    X(cfem_mpc_begins, CFEM_MPC_MOST_MOVES, CFEM_MPC_MOVES) \
    X(cfem_motion_prony_terms, CFEM_MOTION_MOST_LOSSES, CFEM_MOTION_LOSSES)

#define CFEM_MOTION_VECTORS(X) \
    X(cfem_mpc_dt, 1, 1) \
    X(cfem_mpc_warp, 1, 1) \
    X(cfem_mpc_length, 1, 1) \
    X(cfem_mpc_start, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_motion_kappa, 1, 1) \
    X(cfem_motion_relaxation, CFEM_MOTION_MOST_LOSSES, CFEM_MOTION_LOSSES) \
    X(cfem_motion_scale, CFEM_MOTION_MOST_NQ, CFEM_MOTION_NQ) \
    X(cfem_motion_unit, CFEM_MOTION_MOST_NQ, CFEM_MOTION_NQ) \
    X(cfem_motion_offset, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_mpc_weight, CFEM_MOST_NE, CFEM_NE) \
    X(cfem_mpc_smooth, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_mpc_effort, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_mpc_size, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_mpc_rate, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_mpc_course_size, CFEM_MOST_NA, CFEM_NA)

#define CFEM_MOTION_MATRICES(X) \
    X(cfem_motion_prony, CFEM_MOTION_MOST_TERMS, 2, CFEM_MOTION_TERMS, 2) \
    X(cfem_motion_to_box, CFEM_MOST_NA, CFEM_MOST_NA, CFEM_NA, CFEM_NA) \
    X(cfem_mpc_command, CFEM_MOST_NA, 2, CFEM_NA, 2) \
    X(cfem_mpc_course, CFEM_MOST_NA, 2, CFEM_NA, 2)

#define CFEM_INTEGER(name, room, size) extern int name[room];
CFEM_MOTION_COUNTS(CFEM_COUNT)
CFEM_MOTION_INTEGERS(CFEM_INTEGER)
CFEM_MOTION_VECTORS(CFEM_VECTOR)
CFEM_MOTION_MATRICES(CFEM_MATRIX)
extern const uint8_t *cfem_motion_first_degrees, *cfem_motion_second_degrees;
extern cfem_motion_series cfem_motion_root[1], cfem_motion_inner[1], cfem_motion_curve[1], cfem_motion_loss[CFEM_MOTION_MOST_LOSSES];

#define CFEM_MOTION_NA CFEM_NA
#define CFEM_MOTION_NE CFEM_NE
#define cfem_motion_stiffness cfem_motion_kappa[0]

#endif
