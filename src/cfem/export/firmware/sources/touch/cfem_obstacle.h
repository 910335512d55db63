/* Rigid bodies that a robot may touch: signed distance, positive outside, frames of the surface, and their curvature. */
#ifndef CFEM_OBSTACLE_H
#define CFEM_OBSTACLE_H

#ifdef __cplusplus
extern "C" {
#endif

/* The points within `rounding` mm of a box about its own origin, of half extents `core` mm: a sphere has none, a capsule one along
 * z, a box no rounding. below: of a half space instead, all that is under its own z = 0; its core is HUGE_VAL, HUGE_VAL, 0. A
 * point is x = R s + t from its own coordinates s. */
typedef struct {
    double R[3][3], t[3]; /* t in mm */
    double core[3], rounding;
    int below;
} cfem_obstacle;

/* mm from an obstacle. */
double cfem_obstacle_distance(const cfem_obstacle *o, const double x[3]);

/* Rows n, t1, t2: the gradient of the distance, and two more that make a right-handed frame with it. */
void cfem_obstacle_frame(const cfem_obstacle *o, const double x[3], double frame[3][3]);

/* 1/mm: derivative of n by the place; 0 on flat faces and at edges. */
void cfem_obstacle_bend(const cfem_obstacle *o, const double x[3], double bend[3][3]);

#ifdef __cplusplus
}
#endif
#endif
