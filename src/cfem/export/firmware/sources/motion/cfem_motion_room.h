/* Sizes of a robot in motion, and room for it in memory: as much as it needs. Code that takes its robot as data says before how much
 * room there is. */
#ifndef CFEM_MOTION_ROOM_H
#define CFEM_MOTION_ROOM_H

#include "cfem_chebyshev.h"
#include "cfem_motion_data.h"

#define CFEM_MOTION_NR (CFEM_MOTION_NQ - CFEM_MOTION_NA)

#ifndef CFEM_MOTION_MOST_NQ
#define CFEM_MOTION_MOST_NA CFEM_MOTION_NA
#define CFEM_MOTION_MOST_NE CFEM_MOTION_NE
#define CFEM_MOTION_MOST_NQ CFEM_MOTION_NQ
#define CFEM_MOTION_MOST_NR CFEM_MOTION_NR
#define CFEM_MOTION_MOST_DEGREE CFEM_MOTION_DEGREE
#define CFEM_MOTION_MOST_LOSSES (CFEM_MOTION_LOSSES ? CFEM_MOTION_LOSSES : 1)
#define CFEM_MOTION_MOST_TERMS (CFEM_MOTION_TERMS ? CFEM_MOTION_TERMS : 1)
#define CFEM_MOTION_MOST_PRODUCTS CFEM_MOTION_PRODUCTS
#define CFEM_MOTION_MOST_KEPT (CFEM_MOTION_TERMS ? CFEM_MOTION_TRIANGLE : 1)
#endif

#define CFEM_MOTION_TRIANGLE (CFEM_MOTION_MOST_NQ * (CFEM_MOTION_MOST_NQ + 1) / 2)
/* Columns of a square matrix, filled up with zeros to whole registers. */
#define CFEM_WHOLE(columns) (((columns) + 7) / 8 * 8)
#define CFEM_MOTION_ACROSS CFEM_WHOLE(CFEM_MOTION_MOST_NQ)
#define CFEM_MOTION_INNER (CFEM_MOTION_MOST_NE * CFEM_MOTION_MOST_NR)
#define CFEM_MOTION_CURVE (CFEM_MOTION_INNER * (CFEM_MOTION_MOST_NR + 1) / 2)

#if defined(__GNUC__) && !defined(__clang__)
#define CFEM_UNROLL _Pragma("GCC unroll 8")
#else
#define CFEM_UNROLL
#endif

/* Numbers that the processor takes at once. */
#if defined(__AVX512F__) && defined(__GNUC__)
#define CFEM_AT_ONCE 8
#elif defined(__AVX__) && defined(__GNUC__)
#define CFEM_AT_ONCE 4
#elif defined(__SSE2__) && defined(__GNUC__)
#define CFEM_AT_ONCE 2
#else
#define CFEM_AT_ONCE 1
#endif
#if CFEM_AT_ONCE > 1
typedef double cfem_lanes __attribute__((vector_size(sizeof(double) * CFEM_AT_ONCE), aligned(sizeof(double)), may_alias));
#else
typedef double cfem_lanes;
#endif

#endif
