/* One part of a robot's loop, a controller, a robot or an estimator, as a unit of co-simulation: what cfem_fmu.c, which is the same for all,
 * asks of it. cfem_fmu_data.h and .c list the variables of this unit; all values are doubles, in the order of the list. */
#ifndef CFEM_FMU_H
#define CFEM_FMU_H

#include <stddef.h>

#include "cfem_fmu_data.h"

#define CFEM_FMU_SAID 240 /* characters of a message */

enum { CFEM_FMU_OK, CFEM_FMU_WARNING, CFEM_FMU_ERROR };

typedef struct {
    const char *name, *unit; /* unit: empty where it has none */
    unsigned char counts;    /* UInt32; else Float64 */
    unsigned char input;
    unsigned char missing;   /* NaN is allowed: it is not known */
    double start;
} cfem_fmu_variable;

extern const cfem_fmu_variable cfem_fmu_variables[CFEM_FMU_VARIABLES];

extern const size_t cfem_fmu_bytes; /* of the state, which holds no pointers */

/* The state at the start, with the inputs of `value` (CFEM_FMU_VARIABLES,), whose outputs become those at the start. */
int cfem_fmu_begin(void *state, double *value, char said[CFEM_FMU_SAID]);

#if CFEM_FMU_STATES
/* For model exchange: continuous states x (CFEM_FMU_STATES,), and what `value` has at them with its inputs: states, derivatives, outputs. */
void cfem_fmu_set_states(void *state, const double *x);
int cfem_fmu_rates(const void *state, double *value, char said[CFEM_FMU_SAID]);
#endif

/* After `step` s with the inputs of `value`, whose outputs become those at the end. With CFEM_FMU_TICK, step is `ticks` of them; else ticks
 * is 1. Of an error the caller takes back what has changed. */
int cfem_fmu_step(void *state, double *value, double step, int ticks, char said[CFEM_FMU_SAID]);

#endif
