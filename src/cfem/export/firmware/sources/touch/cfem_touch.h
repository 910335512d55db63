/* The robot touches rigid bodies with its surface, beside its controller: forces, shape and actuators of the quasi-static state at
 * held displacements. cfem_touch_data.h and cfem_touch_data.c hold the robot's numbers and were written by `cfem export`.
 *
 * The surface is cut into CFEM_PATCHES patches, of which CFEM_TOUCH_MOST may touch at once. Memory is what the caller owns: a state, and a room to work in. Every loop is
 * bounded; a step that finds no state says so. */
#ifndef CFEM_TOUCH_H
#define CFEM_TOUCH_H

#include "cfem_law.h"
#include "cfem_obstacle.h"
#include "cfem_touch_data.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How a step ended. */
enum {
    CFEM_TOUCH_CONVERGED = 0,
    CFEM_TOUCH_NO_STATE = 1,   /* no forces were found that obey the law */
    CFEM_TOUCH_ITERATIONS = 2, /* open, sticking and sliding patches keep changing: the rounds or systems allowed were used up */
    CFEM_TOUCH_MANY = 3,       /* more than CFEM_TOUCH_MOST patches touch */
    CFEM_TOUCH_BAD_INPUT = 4,  /* a number is not finite, friction or a size is below 0, or R is not a rotation */
    CFEM_TOUCH_NO_MODEL = 5    /* the model has no trustworthy answer here: see cfem_touch_is_far */
};
#define CFEM_TOUCH_SYSTEMS 2000 /* linear systems that a step may solve, in all its rounds */

/* Where `error` is larger, forces bend the robot further than is known; with `deep` the step was too long; `unsettled`
 * says that forces hardly settle, and that small errors of the model make large ones. Forces may be wrong, a patch may lie on another side
 * than the one on which it came in, and rounding may choose between states that all obey the law. Take shorter steps from a state before. */
#define CFEM_TOUCH_TRUSTED 0.035
#define CFEM_TOUCH_SETTLED 6

/* A robot: x = R x_own + t; itself: whether it touches itself; unilateral: actuators that go slack instead of pushing. */
typedef struct {
    double R[3][3], t[3];
    int itself;
    unsigned char unilateral[CFEM_NA];
} cfem_placed;

enum { CFEM_TOUCH_OPEN, CFEM_TOUCH_STICK, CFEM_TOUCH_SLIP };

/* One state. The members up to `rows` are of patches that touch, `count` of them; those after it of the robot. */
typedef struct {
    unsigned status;
    int count, iterations, systems;
    int patch[CFEM_TOUCH_MOST];        /* number of it */
    int obstacle[CFEM_TOUCH_MOST];     /* number of what it touches */
    int mode[CFEM_TOUCH_MOST];
    double force[CFEM_TOUCH_MOST][3];  /* N, on it */
    double normal[CFEM_TOUCH_MOST][3]; /* of what it touches */
    double gap[CFEM_TOUCH_MOST];       /* mm */
#if CFEM_TOUCH_SOFT
    double push[CFEM_TOUCH_MOST][3];   /* N, that of the obstacle, in the scene */
#endif
    double rows[CFEM_PATCH_ROWS];      /* mm: how far the modes of the surface go */
    double delta_e[CFEM_NE];           /* mm, effectors from rest */
    double delta_a[CFEM_NA];           /* mm: where the actuators are */
    double lambda_a[CFEM_NA];          /* N: what holds them there */
    double error;                      /* estimate of how far what forces do is off, a share of it, the largest of all rounds */
    int deep;                          /* a patch began so far within an obstacle that twice as far in another side of it is nearer,
                                        * in this step or in one before, since when some patch has been near an obstacle */
    int unsettled;                     /* a step on rigid obstacles took more than CFEM_TOUCH_SETTLED iterations: this one, or one
                                        * before, since when some patch has been near an obstacle; 0 among robots */
    int outside;                       /* without contact the model would have no training states here: cfem_outside */
    double place[CFEM_PATCHES][3];     /* mm, of all patches */
    double stuck[CFEM_PATCHES][3];     /* mm: where friction holds each patch; read where `holds` */
    unsigned char holds[CFEM_PATCHES];
    int near_count, near[CFEM_TOUCH_MOST]; /* patches that touch, and those that may touch next */
} cfem_touched;

#define CFEM_TOUCH_ROWS (3 * CFEM_TOUCH_MOST)

/* What is taken of the first and of the second order of a load, and of its own derivative, 1/(N mm): see cfem.predict.contact.forces.high_order. */
typedef struct {
    double first, second, rank;
} cfem_beyond;

/* Room to work in. */
typedef struct {
    double s[CFEM_NA], rows[CFEM_PATCH_ROWS], C_es[CFEM_NE][CFEM_PATCH_ROWS], C_ss[CFEM_PATCH_ROWS][CFEM_PATCH_ROWS];
    double D[CFEM_PATCH_BENT];                        /* mm/N^2: how C_ss (i <= j <= k) and C_es (i <= j) change with loads on mixtures */
    double terms[CFEM_PATCH_LOCAL_TERMS];             /* of the polynomial of what the modes leave of the compliance */
    double free[CFEM_PATCHES][3];                     /* mm: places without forces */
    double R[CFEM_PATCHES][3][3];                     /* rotations since rest, where known */
    unsigned char turns[CFEM_PATCHES];                /* whether they are */
    int of[CFEM_TOUCH_MOST], count;                   /* the patches that `left` and `total` are of */
    double left[CFEM_TOUCH_ROWS * CFEM_TOUCH_ROWS];   /* mm/N: what the modes leave of */
    double total[CFEM_TOUCH_ROWS * CFEM_TOUCH_ROWS];  /* mm/N: how the places of patches yield to forces on them */
    double stiff[CFEM_TOUCH_MOST];                    /* mm/N: how a patch yields to a force on it, where it is stiff */
    double dent[CFEM_TOUCH_MOST][3][3][3];            /* mm/N^2: change of a patch's own part of `left` with its force */
    cfem_beyond by_dents[CFEM_TOUCH_MOST], by_modes;  /* what is taken of the second order, of dents and of modes */
    double beyond_own[CFEM_TOUCH_MOST][3];            /* mm: by which a patch moves beyond what `left` says, */
    double own_slope[CFEM_TOUCH_MOST][3][3];          /* mm/N: and its derivative by its force */
    double error;                                     /* as in the state */
    double w[CFEM_PATCH_ROWS], moved[CFEM_PATCH_ROWS], across[CFEM_PATCH_ROWS]; /* N: load on the modes; mm: rows by it */
    double v[CFEM_PATCH_BENDS];                                                 /* N: load on the mixtures of the modes */
    double change[CFEM_NE + CFEM_PATCH_BENDS][CFEM_PATCH_BENDS];                /* mm/N: of C_es and C_ss, seen in these */
    double yields[CFEM_TOUCH_ROWS * CFEM_TOUCH_ROWS]; /* mm/N: the same under the forces that they bear */
    double turned[CFEM_TOUCH_ROWS * CFEM_TOUCH_ROWS]; /* mm/N: the same with normal forces that turn with obstacles */
    double W[CFEM_TOUCH_ROWS * CFEM_TOUCH_ROWS];      /* mm/N: in the frames of what they touch */
    double bend[CFEM_TOUCH_MOST][3][3], distance[CFEM_PATCHES];
    int which[CFEM_PATCHES];
    double law[CFEM_LAW_ROOM(CFEM_TOUCH_MOST)];
} cfem_touch_room;

#if !CFEM_TOUCH_SOFT /* else see cfem_meet.h */
/* Quasi-static step to delta_a (CFEM_NA,) mm from the state `before` (0: the free robot, from where patches slide); friction mu of
 * all obstacles (count,). Returns now->status; `now` may not be `before`. CFEM_TOUCH_OBSTACLES of them and CFEM_TOUCH_FRICTION are
 * those that the robot was exported with. */
unsigned cfem_touch(const double delta_a[CFEM_NA], const cfem_obstacle *obstacles, int count, double mu,
                    const cfem_touched *before, cfem_touched *now, cfem_touch_room *room);

/* The same where actuators that only pull (cfem_patch_unilateral) go slack instead of pushing: they carry nothing, and are beyond
 * delta_a. `before` is a state of this function, or one with no lambda_a at 0. */
unsigned cfem_touch_slack(const double delta_a[CFEM_NA], const cfem_obstacle *obstacles, int count, double mu,
                          const cfem_touched *before, cfem_touched *now, cfem_touch_room *room);

/* N: how hard obstacle `number` is pressed, the sum of the normal forces of all patches that touch it. */
double cfem_touch_pressed(const cfem_touched *state, int number);
#endif

/* cfem_touch_patches.c, for the files beside it: rotation of a patch since rest. */
const double (*cfem_touch_rotation(int patch, cfem_touch_room *room))[3];
/* Finds what the room holds of patches (count,) without forces. 0, or 1 where they are not finite. */
int cfem_touch_compliance(int count, const int *patch, cfem_touch_room *room);

/* cfem_touch_held.c: whether delta_a (CFEM_NA,) mm is beyond the displacements of the training states by more than their range, as no step can
 * be meant to be. */
int cfem_touch_is_far(const double delta_a[CFEM_NA]);
/* For cfem_rounds.c: the robot without forces at delta_a. 0, or a status. */
unsigned cfem_touch_hold(const double delta_a[CFEM_NA], cfem_touched *now, cfem_touch_room *room);
/* Puts forces on patches (count,), and takes all others off. No more of the second order is taken than can be trusted. */
void cfem_touch_bear(int count, const int *patch, double (*force)[3], cfem_touch_room *room);
/* Finds `yields` of the patches that bear. */
void cfem_touch_yield(int count, const int *patch, cfem_touch_room *room);
/* place (CFEM_PATCHES, 3) mm under forces on patches (count,) that bear them, whose compliance the room holds. */
void cfem_touch_places(int count, const int *patch, double (*force)[3], const cfem_touch_room *room, double (*place)[3]);
/* rows, delta_e and lambda_a under the state's forces. */
void cfem_touch_loaded(cfem_touched *now, cfem_touch_room *room);

#ifdef __cplusplus
}
#endif
#endif
