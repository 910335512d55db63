/* The whole surface of the robot, beside its controller: positions of all surface nodes where its actuators stand. cfem_skin.h and
 * cfem_skin.c hold the robot's modes and were written by `cfem export`; what does not ask for shapes compiles without them. */
#ifndef CFEM_SHAPE_H
#define CFEM_SHAPE_H

#include "cfem_skin.h"

#ifdef __cplusplus
extern "C" {
#endif

/* xyz (CFEM_SKIN_NODES, 3): mm, at s (CFEM_NA,) as cfem_model takes it: delta_a mm (CFEM_FORM_DISPLACEMENT) or lambda_a N
 * (CFEM_FORM_FORCE). The triangles of cfem_skin_triangles, normals outward, name its rows. */
void cfem_shape(const double s[CFEM_NA], cfem_real xyz[CFEM_SKIN_NODES][3]);

#ifdef __cplusplus
}
#endif
#endif
