/* Where the robot is and who pushes it, from markers on its surface and sensors of its actuators: src/cfem/predict/estimation/estimate.py in C, in
 * double precision, without heap, in a bounded number of steps. cfem_estimate.c is the same for every robot; cfem_estimate_data.c holds
 * its numbers. Units: mm, N (chambers: mm^3, MPa). A number that is not finite was not measured. */
#ifndef CFEM_ESTIMATE_H
#define CFEM_ESTIMATE_H

#include "cfem_estimate_data.h"
#include "cfem_gate.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Status: 0, or an OR of these. x, covariance and effector are numbers in every case, and to be trusted where it is 0. */
#define CFEM_ESTIMATE_TOO_FEW 1u    /* fewer numbers are measured than are unknown */
#define CFEM_ESTIMATE_OUTLIERS 2u   /* half of the markers do not fit the others */
#define CFEM_ESTIMATE_ITERATIONS 4u /* the estimate keeps changing: the steps allowed were used up */
#define CFEM_ESTIMATE_NO_NUMBER 8u  /* a number was lost: the frame counts for nothing */
#define CFEM_ESTIMATE_REJECTED 32u  /* of a filter: the frame does not fit what was known before it, and is not carried forward */

typedef struct {
    double place[CFEM_ESTIMATE_MARKERS][3]; /* where the markers are seen, in the frame of the scene */
    double displacement[CFEM_ESTIMATE_NA];  /* of the actuators, by their sensors */
    double force[CFEM_ESTIMATE_NA];         /* of the actuators, by their load cells */
    double command[CFEM_ESTIMATE_NA];       /* displacements that were commanded; the filter alone reads them */
} cfem_frame;

typedef struct {
    double x[CFEM_ESTIMATE_N];                            /* displacements of the actuators, then loads */
    double covariance[CFEM_ESTIMATE_N][CFEM_ESTIMATE_N];
    double effector[CFEM_ESTIMATE_NE];                    /* from rest */
    double noise;                                         /* of the markers that fit, relative to the stated one */
    uint32_t left_out;                                    /* bit m: marker m does not fit */
    uint32_t unseen;                                      /* bit i: the measurements do not tell unknown i */
    unsigned status;
    int iterations;
} cfem_estimate;

typedef struct {
    cfem_estimate last;
    double command[CFEM_ESTIMATE_NA];
    int known, commanded; /* whether `last`, and `command`, are set */
    cfem_gate gate;
} cfem_filter;

/* One frame alone. Returns the status. */
unsigned cfem_estimate_frame(const cfem_frame *frame, cfem_estimate *found);

/* Frames one after the other, each with what the ones before have told. An estimate whose status is not 0 is not carried forward;
 * after CFEM_ESTIMATE_GATE_SAMPLES such frames that agree (cfem_gate.h) everything before is forgotten. */
void cfem_filter_init(cfem_filter *filter);
unsigned cfem_filter_tick(cfem_filter *filter, const cfem_frame *frame, cfem_estimate *found);

/* Modes of the surface at x: its nodes are at rest + modes . cfem_skin_modes (cfem_skin.h). */
void cfem_estimate_modes(const double x[CFEM_ESTIMATE_N], double modes[CFEM_ESTIMATE_ROWS]);

#ifdef __cplusplus
}
#endif
#endif
