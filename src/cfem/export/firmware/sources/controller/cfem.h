/* Inverse controller of a soft robot on its learned condensed model, C99: no heap, no I/O, every loop bounded.
 *
 * Each tick: where the actuators stand (observer) -> W, delta_free there (model) -> the actuation that brings the effectors
 * nearest to their goal within the limits (quadratic program, exact) -> a command.
 *
 *     minimise over lambda  |w (W_ea lambda + delta_free_e - goal)|^2 + |r delta_a|^2 + |d (delta_a - delta_a now)|^2
 *     subject to            bounds of lambda,  bounds of delta_a = W_aa lambda + delta_free_a,  steps a tick
 *
 * Units: mm, N, MPa (cables: delta_a in mm, lambda_a in N; chambers: mm^3, MPa, in the place of mm and N wherever an actuator's
 * are meant). Vectors hold CFEM_NA actuators or CFEM_NE
 * effector coordinates in the order of CFEM_ACTUATORS and CFEM_EFFECTORS (cfem_data.h). All that depends on the robot is in
 * cfem_data.h and cfem_data.c, which `cfem export` wrote; the other files are the same for every robot.
 *
 * Reentrant: a robot's state is a cfem_controller that the caller owns; constants are shared and const. Do not compile with
 * -ffast-math: checks for NaN would vanish. */
#ifndef CFEM_H
#define CFEM_H

#include "cfem_feedback.h"
#include "cfem_room.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a step says: an OR of these. Without CFEM_HELD they qualify a new command; with CFEM_HELD the command is the one of
 * the tick before, and one of the three bits after it says why. The last two are of samples. */
enum {
    CFEM_OK = 0,
    CFEM_LIMITED = 1,     /* a bound of force, course or step decided: on the way as well as in the end */
    CFEM_SOFTENED = 2,    /* no force within its bounds keeps the course: it is exceeded by as little as possible */
    CFEM_OUTSIDE = 4,     /* the model was asked where it has no training states: cfem_outside */
    CFEM_NOT_FOUND = 8,   /* the observer did not converge: its best guess was used */
    CFEM_HELD = 16,       /* no new command, because: */
    CFEM_BAD_INPUT = 32,  /*   a number of the input is not finite */
    CFEM_NO_MODEL = 64,   /*   the model's stiffness is not positive definite or not finite here */
    CFEM_NO_QP = 128,     /*   the program has no trustworthy answer */
    CFEM_REJECTED = 256,  /* the sample was not used: not finite, more than two lengths of the robot from rest or in metres, older than
                             CFEM_LATE commands, of a command not given yet, unlike what the observer expects of it, or a jump that no
                             second sample has confirmed (cfem_gate.h) */
    CFEM_RESTARTED = 512, /* too many samples were unlike that, or the estimate was lost: the observer began again */
    CFEM_OUT_OF_REACH = 1024, /* the robot stands at the nearest point to its goal: by the optimality conditions no move within
                              the bounds of force and course brings the effectors nearer */
    CFEM_FAR = 2048        /*   with CFEM_BAD_INPUT: the goal is more than two lengths of the robot from where the effectors rest,
                              or would be near the robot if it were in metres: its unit is another one */
};

/* What the controller knows at a tick. */
typedef struct {
    cfem_real goal[CFEM_MOST_NE];    /* mm, absolute: where the effectors should be */
    cfem_real x_e[CFEM_MOST_NE];     /* mm, absolute: the latest sample of the effectors; read only where `tick` is new */
    cfem_real delta_a[CFEM_MOST_NA]; /* mm (mm^3): where the actuators are measured; read only by CFEM_OBSERVER_MEASURED */
    uint32_t tick;              /* number of the command that x_e followed: cfem_output.tick when the sample was taken. It moves the
                                   goal once, by K_P e + K_I sum e, however long it stays here; 0: nothing is measured yet
                                   (open loop, as long as it stays 0) */
} cfem_input;

/* What it commands: take the one that the drives take (CFEM_COMMAND_FORCE says which it was exported for). */
typedef struct {
    cfem_real delta_a[CFEM_MOST_NA];  /* mm (mm^3) */
    cfem_real lambda_a[CFEM_MOST_NA]; /* N (MPa) */
    cfem_real reference[CFEM_MOST_NE]; /* mm, absolute: where the effectors will be if the outer loop is right: the goal, or what
                                     the limits leave of it. Errors are measured from here, so that nothing is added up that no
                                     command can change (anti-windup) */
    uint32_t tick;                /* number of this command, from 1 on; with CFEM_HELD that of the one that stays */
    unsigned status;              /* CFEM_OK, or an OR of the above */
} cfem_output;

/* The condensed model at a state. */
typedef struct {
    double delta_a[CFEM_MOST_NA];         /* mm */
    double lambda_a[CFEM_MOST_NA];        /* N */
    double W_aa[CFEM_MOST_NA][CFEM_MOST_NA];   /* mm/N, symmetric positive definite */
    double W_ea[CFEM_MOST_NE][CFEM_MOST_NA];   /* mm/N */
    double free_a[CFEM_MOST_NA];          /* mm: delta_a = W_aa lambda_a + free_a */
    double free_e[CFEM_MOST_NE];          /* mm, effectors from rest: delta_e = W_ea lambda_a + free_e */
#if CFEM_FULL
    double W_ee[CFEM_MOST_NE][CFEM_MOST_NE];   /* mm/N */
    double energy;                   /* N mm: condensed energy, or its dual in the force form; 0 where none was learned */
#endif
#if CFEM_ROW
    double steps, change;            /* Newton steps of the modules' poses, and the last one, in lengths of a module and radians */
#endif
} cfem_condensed;

/* A robot's state. The caller owns it; its members are for reading. */
typedef struct {
    double delta_a[CFEM_MOST_NA];     /* mm, of the last command, as linearised where forces are commanded */
    double lambda_a[CFEM_MOST_NA];    /* N, of the last command, as linearised where displacements are commanded */
    double reference[CFEM_MOST_NE];   /* mm, absolute: see cfem_output */
    cfem_feedback feedback;
#if CFEM_MOST_HALVINGS
    cfem_condensed at;           /* the model at the last command */
    int stands;                  /* whether that is the command, not cut down since */
#endif
#if CFEM_CONTACT
    unsigned (*ask)(void *with, const double *s, cfem_condensed *condensed); /* in place of cfem_model: cfem_touch_control.h */
    void *with;
#endif
} cfem_controller;

/* Puts the robot where control starts: CFEM_HOME, no integral. */
void cfem_init(cfem_controller *controller);

/* One tick. Returns output->status. */
unsigned cfem_step(cfem_controller *controller, const cfem_input *input, cfem_output *output);

/* The model at s (CFEM_NA,): delta_a mm (CFEM_FORM_DISPLACEMENT) or lambda_a N (CFEM_FORM_FORCE). Returns 0, or
 * CFEM_NO_MODEL where it has no trustworthy answer, with what was found in `condensed`. */
unsigned cfem_model(const double s[CFEM_MOST_NA], cfem_condensed *condensed);

/* CFEM_OUTSIDE where a state is none of those that the model was trained on: beyond their boxes, or beside the sheet that
 * the displacements of redundant actuators fill. Else CFEM_OK. */
unsigned cfem_outside(const cfem_condensed *m);

#ifdef __cplusplus
}
#endif
#endif
