/* The estimator, of a robot at rest in each frame or, with CFEM_FMU_MOVES, of one that moves, as a unit of co-simulation: cfem_fmu.h. */
#include <math.h>
#include <string.h>

#include "cfem_data.h"
#include "cfem_fmu.h"

#if CFEM_FMU_MOVES
#include "cfem_swing.h"
#define FILTER cfem_swing
#define FOUND cfem_swing_found
#define BEGIN cfem_swing_init
#define FRAME cfem_swing_frame
#define LOADS CFEM_MOTION_NQ /* the first of the unknowns that is a load */
#else
#include "cfem_estimate.h"
#define FILTER cfem_filter
#define FOUND cfem_estimate
#define BEGIN cfem_filter_init
#define FRAME cfem_filter_tick
#define LOADS CFEM_ESTIMATE_NA
#endif

#define NA CFEM_ESTIMATE_NA

typedef struct {
    FILTER filter;
    FOUND found;
} estimator;

const size_t cfem_fmu_bytes = sizeof(estimator);

static void show(const FOUND *found, double *value) {
    for (int i = 0; i < NA + CFEM_ESTIMATE_NW; i++) {
        const int unknown = i < NA ? i : LOADS + i - NA;
        value[CFEM_FMU_ESTIMATE + i] = found->x[unknown];
        value[CFEM_FMU_DEVIATION + i] = sqrt(found->covariance[unknown][unknown]);
    }
    for (int e = 0; e < CFEM_ESTIMATE_NE; e++) value[CFEM_FMU_POSITION + e] = cfem_rest_e[e] + found->effector[e];
    value[CFEM_FMU_STATUS] = found->status;
}

/* Nothing is known before the first frame. */
int cfem_fmu_begin(void *state, double *value, char said[CFEM_FMU_SAID]) {
    estimator *const one = state;
    (void)said;
    BEGIN(&one->filter);
    for (int i = 0; i < NA + CFEM_ESTIMATE_NW; i++) value[CFEM_FMU_ESTIMATE + i] = value[CFEM_FMU_DEVIATION + i] = NAN;
    for (int e = 0; e < CFEM_ESTIMATE_NE; e++) value[CFEM_FMU_POSITION + e] = NAN;
    value[CFEM_FMU_STATUS] = CFEM_ESTIMATE_TOO_FEW;
    return CFEM_FMU_OK;
}

int cfem_fmu_step(void *state, double *value, double step, int ticks, char said[CFEM_FMU_SAID]) {
    estimator *const one = state;
    cfem_frame frame;
    (void)step, (void)said;
    memcpy(frame.place, value + CFEM_FMU_MARKER, sizeof frame.place);
    memcpy(frame.displacement, value + CFEM_FMU_DISPLACEMENT, sizeof frame.displacement);
    memcpy(frame.force, value + CFEM_FMU_FORCE, sizeof frame.force);
    memcpy(frame.command, value + CFEM_FMU_COMMAND, sizeof frame.command);
    for (int k = 0; k < ticks; k++) FRAME(&one->filter, &frame, &one->found);
    show(&one->found, value);
    return CFEM_FMU_OK;
}
