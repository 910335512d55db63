/* Cables only pull: one that would have to push goes slack, carries nothing, and is beyond its target. The same as
 * cfem.predict.contact.step.slack. */
#ifndef CFEM_SLACK_H
#define CFEM_SLACK_H

#include "cfem_touch.h"

#define CFEM_SLACK_MOST (CFEM_TOUCH_ROBOTS * CFEM_NA) /* actuators, robot after robot */

/* A step with all actuators held at delta_a mm; they pull with lambda_a N there. 0, or a status of cfem_touch.h. */
typedef unsigned (*cfem_held_step)(void *with, const double *delta_a, double *lambda_a);

/* How `step` ends where actuators that are `unilateral` may go slack. n: of actuators; at: in, where they were before, out, where
 * they are, mm; slack: in and out, whether they are slack. 0, or a status. */
unsigned cfem_slack(int n, const double *target, const unsigned char *unilateral, cfem_held_step step, void *with, double *at,
                    unsigned char *slack);

#endif
