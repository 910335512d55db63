/* The controller, cfem.h, as a unit of co-simulation: cfem_fmu.h. */
#include <stdio.h>

#include "cfem.h"
#include "cfem_fmu.h"

const size_t cfem_fmu_bytes = sizeof(cfem_controller);

static void show(const cfem_controller *c, unsigned status, double *value) {
    for (int i = 0; i < CFEM_NA; i++) value[CFEM_FMU_COMMAND + i] = CFEM_COMMAND_FORCE ? c->lambda_a[i] : c->delta_a[i];
    for (int e = 0; e < CFEM_NE; e++) value[CFEM_FMU_REFERENCE + e] = c->reference[e];
    value[CFEM_FMU_STATUS] = status;
}

int cfem_fmu_begin(void *state, double *value, char said[CFEM_FMU_SAID]) {
    (void)said;
    cfem_init(state);
    show(state, CFEM_OK, value);
    return CFEM_FMU_OK;
}

int cfem_fmu_step(void *state, double *value, double step, int ticks, char said[CFEM_FMU_SAID]) {
    cfem_controller *const c = state;
    const uint32_t age = (uint32_t)value[CFEM_FMU_SAMPLE_AGE];
    cfem_input in;
    cfem_output out;
    unsigned status = CFEM_OK;
    (void)step;
    for (int e = 0; e < CFEM_NE; e++) {
        in.goal[e] = (cfem_real)value[CFEM_FMU_GOAL + e];
        in.x_e[e] = (cfem_real)value[CFEM_FMU_MEASURED + e];
    }
#ifdef CFEM_FMU_DISPLACEMENT
    for (int i = 0; i < CFEM_NA; i++) in.delta_a[i] = (cfem_real)value[CFEM_FMU_DISPLACEMENT + i];
#endif
    in.tick = age && age <= c->feedback.given ? c->feedback.given - age + 1 : 0;
    for (int k = 0; k < ticks; k++) status = cfem_step(c, &in, &out);
    show(c, status, value);
    if (status & CFEM_FAR) {
        snprintf(said, CFEM_FMU_SAID, "the goal is more than two lengths of the robot from where its effectors rest, or is in metres: goals are in mm");
        return CFEM_FMU_ERROR;
    }
    if (status & CFEM_HELD) {
        snprintf(said, CFEM_FMU_SAID, "no new command, the last one stays: status %u", status);
        return CFEM_FMU_WARNING;
    }
    return CFEM_FMU_OK;
}
