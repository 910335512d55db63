/* The controller of cfem.h, which plans with contact: its model is the robot that obstacles touch, as in
 * cfem.predict.contact_model. For exports of form displacement that command displacements: CFEM_CONTACT says so. */
#ifndef CFEM_TOUCH_CONTROL_H
#define CFEM_TOUCH_CONTROL_H

#include "cfem_touch.h"

#ifdef __cplusplus
extern "C" {
#endif

#if CFEM_CONTACT
/* A robot's state. The caller owns it, and does not move it: the controller in it points to it. */
typedef struct {
    cfem_controller controller;
    const cfem_obstacle *obstacles; /* may move between ticks */
    int count;
    double mu, delta_a[CFEM_NA]; /* mm: of the state `at` */
    cfem_touched at;             /* where the robot stands */
    cfem_touched here, near, ahead, behind;
    cfem_touch_room room;
} cfem_touch_controller;

/* Puts the robot where control starts, among obstacles (count,) with friction mu. 0, or a status of cfem_touch.h. */
unsigned cfem_touch_control_init(cfem_touch_controller *c, const cfem_obstacle *obstacles, int count, double mu);

/* One tick, as cfem_step. CFEM_NO_MODEL where no contact state was found: where to plan, with CFEM_HELD, or else where the command
 * leads, and `at` is then the state before. */
unsigned cfem_touch_control(cfem_touch_controller *c, const cfem_input *input, cfem_output *output);
#endif

#ifdef __cplusplus
}
#endif
#endif
