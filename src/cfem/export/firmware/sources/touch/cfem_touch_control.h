/* The controller of cfem.h, which plans with contact: its model is the robot that obstacles touch, as in
 * cfem.predict.contact.model. For exports of form displacement that command displacements: CFEM_CONTACT is 1 among rigid obstacles, 2 among
 * soft robots too. */
#ifndef CFEM_TOUCH_CONTROL_H
#define CFEM_TOUCH_CONTROL_H

#include "cfem_touch.h"
#if CFEM_CONTACT == 2
#include "cfem_meet.h"
#endif

#ifdef __cplusplus
extern "C" {
#endif

#if CFEM_CONTACT
#if CFEM_CONTACT == 2
typedef cfem_met cfem_contact_state;
typedef cfem_meet_room cfem_contact_room;
#define CFEM_CONTACT_NA (CFEM_MEET_ROBOTS * CFEM_NA)
#else
typedef cfem_touched cfem_contact_state;
typedef cfem_touch_room cfem_contact_room;
#define CFEM_CONTACT_NA CFEM_NA
#endif
#define CFEM_TOUCH_HELD 5 /* ticks in a row without a contact state, after which the actuators retreat */

/* A robot's state. The caller owns it, and does not move it: the controller in it points to it. */
typedef struct {
    cfem_controller controller;
    const cfem_obstacle *obstacles; /* may move between ticks */
    int count, failed; /* failed: ticks in a row without a contact state */
    double mu, delta_a[CFEM_CONTACT_NA]; /* mm: of the state `at` */
#if CFEM_CONTACT == 2
    cfem_placed robots[CFEM_MEET_ROBOTS];         /* the first one is controlled */
    double others[CFEM_MEET_ROBOTS][CFEM_NA];     /* mm: where the others' actuators are to be, from the second robot on */
#endif
    cfem_contact_state at; /* where the robot stands */
    cfem_contact_state near, here, begin, beside;
    double here_delta_a[CFEM_CONTACT_NA]; /* mm: of the state `here`, */
    int arrived;                          /* where this tick has found it */
    cfem_contact_room room;
} cfem_touch_controller;

/* Puts the robot where control starts, among obstacles (count,) with friction mu, and other robots whose actuators are at 0. 0, or a
 * status of cfem_touch.h or cfem_meet.h. */
unsigned cfem_touch_control_init(cfem_touch_controller *c, const cfem_obstacle *obstacles, int count, double mu);

/* One tick, as cfem_step. CFEM_OUTSIDE also where contact bends a robot further than the model knows (CFEM_TOUCH_TRUSTED), or, without
 * other robots, a patch has begun too `deep` or forces hardly settle (CFEM_TOUCH_SETTLED). CFEM_NO_MODEL where no contact state was found: where to plan, with CFEM_HELD, or else where
 * the command leads, and `at` is then the state before. Where a plan fails at one tick it mostly fails at the next, as nothing has moved:
 * after CFEM_TOUCH_HELD such ticks the actuators go towards home, a step at each tick within their bounds and rate, until there is a plan
 * again, and friction is forgotten: CFEM_NO_MODEL with CFEM_RESTARTED, without CFEM_HELD. */
unsigned cfem_touch_control(cfem_touch_controller *c, const cfem_input *input, cfem_output *output);
#endif

#ifdef __cplusplus
}
#endif
#endif
