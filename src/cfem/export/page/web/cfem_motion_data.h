/* The robot in motion as data, as cfem_data.h has the robot at rest. cfem_page_motion.c reads it; page_motion.py writes it. */
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
#define CFEM_MPC_MOST_NZ ((2 + CFEM_MOTION_MOST_TERMS) * CFEM_MOTION_MOST_NQ)
#define CFEM_MOTION_MOST_DEGREE CFEM_MOST_DEGREE
#define CFEM_MOTION_MOST_PRODUCTS 256
#define CFEM_MPC_MOST_TICKS 20
#define CFEM_MPC_MOST_MOVES 20
#define CFEM_MPC_MOST_PLANES 0
#define CFEM_MPC_MOST_LATE 1

typedef struct {
    /* In the order of the block. */
    int n_q, losses, terms, degree, curved, first_products, second_products, ticks, moves, every, force;
    int begins[CFEM_MPC_MOST_MOVES], prony_terms[CFEM_MOTION_MOST_LOSSES];
    double dt, warp, length, stiffness;
    double relaxation[CFEM_MOTION_MOST_LOSSES], prony[CFEM_MOTION_MOST_TERMS][2];
    double scale[CFEM_MOTION_MOST_NQ], unit[CFEM_MOTION_MOST_NQ];
    double to_box[CFEM_MOST_NA][CFEM_MOST_NA], offset[CFEM_MOST_NA], start[CFEM_MOST_NA];
    double weight[CFEM_MOST_NE], smooth[CFEM_MOST_NA], effort[CFEM_MOST_NA], size[CFEM_MOST_NA], rate[CFEM_MOST_NA];
    double course_size[CFEM_MOST_NA], command[CFEM_MOST_NA][2], course[CFEM_MOST_NA][2];
    const uint8_t *first_degrees, *second_degrees;
    cfem_motion_series root[1], inner[1], curve[1], loss[CFEM_MOTION_MOST_LOSSES];
} cfem_motion_robot;

extern cfem_motion_robot cfem_moves;

#define CFEM_MOTION_NA CFEM_NA
#define CFEM_MOTION_NE CFEM_NE
#define CFEM_MOTION_NQ cfem_moves.n_q
#define CFEM_MOTION_LOSSES cfem_moves.losses
#define CFEM_MOTION_TERMS cfem_moves.terms
#define CFEM_MOTION_DEGREE cfem_moves.degree
#define CFEM_MOTION_CURVED cfem_moves.curved
#define CFEM_MOTION_FIRST_PRODUCTS cfem_moves.first_products
#define CFEM_MOTION_SECOND_PRODUCTS cfem_moves.second_products
#define cfem_motion_stiffness cfem_moves.stiffness
#define cfem_motion_relaxation cfem_moves.relaxation
#define cfem_motion_prony_terms cfem_moves.prony_terms
#define cfem_motion_prony cfem_moves.prony
#define cfem_motion_scale cfem_moves.scale
#define cfem_motion_unit cfem_moves.unit
#define cfem_motion_to_box cfem_moves.to_box
#define cfem_motion_offset cfem_moves.offset
#define cfem_motion_first_degrees cfem_moves.first_degrees
#define cfem_motion_second_degrees cfem_moves.second_degrees
#define cfem_motion_root cfem_moves.root
#define cfem_motion_inner cfem_moves.inner
#define cfem_motion_curve cfem_moves.curve
#define cfem_motion_loss cfem_moves.loss

#endif
