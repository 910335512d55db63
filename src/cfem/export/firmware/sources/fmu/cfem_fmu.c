/* The functions of FMI 3.0 for co-simulation and, where there are states, model exchange, around what cfem_fmu.h declares. An error changes nothing but the log: what has raised it can be
 * set or stepped again. Whatever a step changes lies in one block, so that states are copies of it. */
#include "cfem_fmu.h"

#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cfem_fmi3.h"

#define N CFEM_FMU_VARIABLES
#define NEAR 1e-6 /* of a step: by what times may differ by rounding */

enum { INSTANTIATED, INITIALISING, STEPPING, TERMINATED };

typedef struct {
    double time, value[N];
    int mode, begun; /* begun: outputs are those of the inputs at the start, or of the states in model exchange */
    double state[];
} content;

typedef struct {
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
    content *now, *before;
    int exchanges; /* its states are integrated by others */
} unit;

static size_t bytes(void) { return sizeof(content) + cfem_fmu_bytes; }

static fmi3Status say(const unit *u, fmi3Status status, const char *format, ...) {
    char said[2 * CFEM_FMU_SAID];
    va_list words;
    va_start(words, format);
    vsnprintf(said, sizeof said, format, words);
    va_end(words);
    if (u->log) u->log(u->environment, status, status == fmi3Warning ? "logStatusWarning" : "logStatusError", said);
    return status;
}

fmi3Status cfem_fmu_refuse(fmi3Instance instance, const char *said) { return say(instance, fmi3Error, "%s", said); }

static fmi3Status result(const unit *u, int status, const char *said) {
    return status == CFEM_FMU_OK ? fmi3OK : say(u, status == CFEM_FMU_WARNING ? fmi3Warning : fmi3Error, "%s", said);
}

static void start(content *c) {
    memset(c, 0, bytes());
    for (int i = 0; i < N; i++) c->value[i] = cfem_fmu_variables[i].start;
}

/* Outputs of the inputs that are set, once per change. */
static fmi3Status settle(unit *u) {
    char said[CFEM_FMU_SAID];
    if (u->now->begun) return fmi3OK;
#if CFEM_FMU_STATES
    if (u->now->mode == STEPPING && u->exchanges) {
        const fmi3Status at = result(u, cfem_fmu_rates(u->now->state, u->now->value, said), said);
        u->now->begun = at <= fmi3Warning;
        return at;
    }
#endif
    if (u->now->mode != INITIALISING) return fmi3OK;
    memset(u->now->state, 0, cfem_fmu_bytes);
    const fmi3Status status = result(u, cfem_fmu_begin(u->now->state, u->now->value, said), said);
    u->now->begun = status <= fmi3Warning;
    return status;
}

FMI3_Export const char *FMI(GetVersion)(void) { return "3.0"; }

FMI3_Export fmi3Status FMI(SetDebugLogging)(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    (void)instance, (void)on, (void)n, (void)categories; /* errors and warnings are logged, nothing else is */
    return fmi3OK;
}

static fmi3Instance instance(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3String token, int exchanges) {
    const unit asked = {log, environment, 0, 0, exchanges};
    if (!token || strcmp(token, CFEM_FMU_TOKEN)) {
        say(&asked, fmi3Error, "the instantiation token is not that of this FMU: its modelDescription.xml is of another export");
        return 0;
    }
    unit *u = malloc(sizeof *u);
    content *now = malloc(bytes()), *before = malloc(bytes());
    if (!u || !now || !before) {
        say(&asked, fmi3Error, "there is no memory for an instance");
        free(u), free(now), free(before);
        return 0;
    }
    *u = asked, u->now = now, u->before = before;
    start(now);
    return u;
}

FMI3_Export fmi3Instance FMI(InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                                      fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                                      const fmi3ValueReference intermediate[], size_t n, fmi3InstanceEnvironment environment,
                                                      fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    (void)name, (void)resources, (void)visible, (void)logging, (void)early, (void)intermediate, (void)n, (void)update;
    if (events) {
        const unit asked = {log, environment, 0, 0, 0};
        say(&asked, fmi3Error, "this FMU has no event mode: instantiate it without eventModeUsed");
        return 0;
    }
    return instance(environment, log, token, 0);
}

FMI3_Export fmi3Instance FMI(InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                                       fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                                       fmi3LogMessageCallback log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
#if CFEM_FMU_STATES
    return instance(environment, log, token, 1);
#else
    const unit asked = {log, environment, 0, 0, 0};
    say(&asked, fmi3Error, "this FMU is for co-simulation, and not for model exchange");
    return 0;
#endif
}

FMI3_Export fmi3Instance FMI(InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                                            fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                                            fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
                                                            fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    const unit asked = {log, environment, 0, 0, 0};
    say(&asked, fmi3Error, "this FMU is for co-simulation, and not for scheduled execution");
    return 0;
}

FMI3_Export void FMI(FreeInstance)(fmi3Instance instance) {
    unit *u = instance;
    if (u) free(u->now), free(u->before), free(u);
}

FMI3_Export fmi3Status FMI(EnterInitializationMode)(fmi3Instance instance, fmi3Boolean tolerant, fmi3Float64 tolerance, fmi3Float64 time,
                                                    fmi3Boolean stops, fmi3Float64 stop) {
    unit *u = instance;
    (void)tolerant, (void)tolerance, (void)stops, (void)stop;
    if (u->now->mode != INSTANTIATED) return say(u, fmi3Error, "the FMU is initialised already: reset it first");
    if (!isfinite(time)) return say(u, fmi3Error, "the start time is not a number");
    u->now->mode = INITIALISING, u->now->time = time;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(ExitInitializationMode)(fmi3Instance instance) {
    unit *u = instance;
    if (u->now->mode != INITIALISING) return say(u, fmi3Error, "the FMU is not in initialisation mode");
    const fmi3Status status = settle(u);
    if (status <= fmi3Warning) u->now->mode = STEPPING;
    return status;
}

FMI3_Export fmi3Status FMI(Terminate)(fmi3Instance instance) {
    unit *u = instance;
    u->now->mode = TERMINATED;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(Reset)(fmi3Instance instance) {
    unit *u = instance;
    start(u->now);
    return fmi3OK;
}

/* Whether the variables (n,), n values of theirs, are of the type and, to be set, inputs. */
static fmi3Status demand(const unit *u, const fmi3ValueReference *which, size_t n, size_t n_values, int counts, int set) {
    if (n != n_values) return say(u, fmi3Error, "%lu values are given for %lu scalars", (unsigned long)n_values, (unsigned long)n);
    for (size_t i = 0; i < n; i++) {
        if (which[i] >= N) return say(u, fmi3Error, "there is no variable with value reference %lu", (unsigned long)which[i]);
        const cfem_fmu_variable *const v = cfem_fmu_variables + which[i];
        if (v->counts != counts) return say(u, fmi3Error, "%s is of type %s", v->name, v->counts ? "UInt32" : "Float64");
        if (set && !v->input) return say(u, fmi3Error, "%s is no input and cannot be set", v->name);
    }
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(GetFloat64)(fmi3Instance instance, const fmi3ValueReference which[], size_t n, fmi3Float64 values[],
                                       size_t n_values) {
    unit *u = instance;
    fmi3Status status = demand(u, which, n, n_values, 0, 0);
    if (status == fmi3OK) status = settle(u);
    for (size_t i = 0; i < n && status <= fmi3Warning; i++) values[i] = which[i] ? u->now->value[which[i]] : u->now->time;
    return status;
}

FMI3_Export fmi3Status FMI(GetUInt32)(fmi3Instance instance, const fmi3ValueReference which[], size_t n, fmi3UInt32 values[],
                                      size_t n_values) {
    unit *u = instance;
    fmi3Status status = demand(u, which, n, n_values, 1, 0);
    if (status == fmi3OK) status = settle(u);
    for (size_t i = 0; i < n && status <= fmi3Warning; i++) values[i] = (fmi3UInt32)u->now->value[which[i]];
    return status;
}

FMI3_Export fmi3Status FMI(SetFloat64)(fmi3Instance instance, const fmi3ValueReference which[], size_t n, const fmi3Float64 values[],
                                       size_t n_values) {
    unit *u = instance;
    const fmi3Status status = demand(u, which, n, n_values, 0, 1);
    if (status != fmi3OK) return status;
    for (size_t i = 0; i < n; i++) {
        const cfem_fmu_variable *const v = cfem_fmu_variables + which[i];
        if (!isfinite(values[i]) && !(v->missing && isnan(values[i])))
            return say(u, fmi3Error, "%s is %s: give a number in %s", v->name, isnan(values[i]) ? "NaN" : "infinite", v->unit);
    }
    for (size_t i = 0; i < n; i++) u->now->value[which[i]] = values[i];
    u->now->begun = 0;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(SetUInt32)(fmi3Instance instance, const fmi3ValueReference which[], size_t n, const fmi3UInt32 values[],
                                      size_t n_values) {
    unit *u = instance;
    const fmi3Status status = demand(u, which, n, n_values, 1, 1);
    if (status != fmi3OK) return status;
    for (size_t i = 0; i < n; i++) u->now->value[which[i]] = values[i];
    u->now->begun = 0;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(DoStep)(fmi3Instance instance, fmi3Float64 time, fmi3Float64 step, fmi3Boolean keeps, fmi3Boolean *event,
                                   fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    unit *u = instance;
    char said[CFEM_FMU_SAID];
    double ticks = 1.0;
    (void)keeps;
    *event = *terminate = *early = 0, *reached = u->now->time;
    if (u->exchanges) return say(u, fmi3Error, "an FMU in model exchange makes no steps: its states are integrated by others");
    if (u->now->mode != STEPPING) return say(u, fmi3Error, "a step needs an FMU that is initialised and not terminated");
    if (!(step > 0.0 && isfinite(step))) return say(u, fmi3Error, "a step of %g s is none: it must be positive", step);
    if (!(fabs(time - u->now->time) <= NEAR * step))
        return say(u, fmi3Error, "the step begins at %.9g s, and the FMU stands at %.9g s", time, u->now->time);
#ifdef CFEM_FMU_TICK
    ticks = floor(step / CFEM_FMU_TICK + 0.5);
    if (!(ticks >= 1.0 && fabs(step / CFEM_FMU_TICK - ticks) <= NEAR * ticks && ticks < INT_MAX))
        return say(u, fmi3Error, "a step of %g s is no multiple of the tick of this FMU, %g s", step, CFEM_FMU_TICK);
#endif
    memcpy(u->before, u->now, bytes());
    const fmi3Status status = result(u, cfem_fmu_step(u->now->state, u->now->value, step, (int)ticks, said), said);
    if (status > fmi3Warning) memcpy(u->now, u->before, bytes());
    else *reached = u->now->time = time + step;
    return status;
}

#if CFEM_FMU_STATES
/* Model exchange: of the inputs as they are, without events. */

static fmi3Status demand_states(const unit *u, size_t n) {
    if (u->now->mode == STEPPING && n == CFEM_FMU_STATES) return fmi3OK;
    return say(u, fmi3Error, "this FMU has %d continuous states, once it is initialised", CFEM_FMU_STATES);
}

static fmi3Status take(unit *u, int first, fmi3Float64 values[], size_t n) {
    fmi3Status status = demand_states(u, n);
    if (status == fmi3OK) status = settle(u);
    if (status <= fmi3Warning) memcpy(values, u->now->value + first, n * sizeof *values);
    return status;
}

FMI3_Export fmi3Status FMI(EnterEventMode)(fmi3Instance u) { return (void)u, fmi3OK; }

FMI3_Export fmi3Status FMI(EnterContinuousTimeMode)(fmi3Instance u) { return (void)u, fmi3OK; }

FMI3_Export fmi3Status FMI(UpdateDiscreteStates)(fmi3Instance u, fmi3Boolean *more, fmi3Boolean *end, fmi3Boolean *nominals,
                                                 fmi3Boolean *values, fmi3Boolean *next, fmi3Float64 *time) {
    (void)u, (void)time;
    *more = *end = *nominals = *values = *next = 0;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(CompletedIntegratorStep)(fmi3Instance u, fmi3Boolean keeps, fmi3Boolean *event, fmi3Boolean *end) {
    (void)u, (void)keeps;
    *event = *end = 0;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(SetTime)(fmi3Instance instance, fmi3Float64 time) {
    unit *u = instance;
    if (!isfinite(time)) return say(u, fmi3Error, "the time is not a number");
    u->now->time = time;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(SetContinuousStates)(fmi3Instance instance, const fmi3Float64 states[], size_t n) {
    unit *u = instance;
    const fmi3Status status = demand_states(u, n);
    if (status != fmi3OK) return status;
    for (size_t i = 0; i < n; i++)
        if (!isfinite(states[i])) return say(u, fmi3Discard, "state %lu is not a number", (unsigned long)i + 1);
    cfem_fmu_set_states(u->now->state, states);
    u->now->begun = 0;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(GetContinuousStates)(fmi3Instance u, fmi3Float64 states[], size_t n) { return take(u, CFEM_FMU_STATE, states, n); }

FMI3_Export fmi3Status FMI(GetContinuousStateDerivatives)(fmi3Instance u, fmi3Float64 rates[], size_t n) {
    return take(u, CFEM_FMU_RATE, rates, n);
}

FMI3_Export fmi3Status FMI(GetNominalsOfContinuousStates)(fmi3Instance u, fmi3Float64 nominals[], size_t n) {
    for (size_t i = 0; i < n; i++) nominals[i] = 1.0;
    return demand_states(u, n);
}

FMI3_Export fmi3Status FMI(GetEventIndicators)(fmi3Instance u, fmi3Float64 indicators[], size_t n) {
    (void)indicators;
    return n ? cfem_fmu_refuse(u, "this FMU has no event indicators") : fmi3OK;
}

FMI3_Export fmi3Status FMI(GetNumberOfEventIndicators)(fmi3Instance u, size_t *n) { return (void)u, *n = 0, fmi3OK; }

FMI3_Export fmi3Status FMI(GetNumberOfContinuousStates)(fmi3Instance u, size_t *n) { return (void)u, *n = CFEM_FMU_STATES, fmi3OK; }
#endif

/* States. */

static int is_state(const content *c) { return c->mode >= INSTANTIATED && c->mode <= TERMINATED; }

FMI3_Export fmi3Status FMI(GetFMUState)(fmi3Instance instance, fmi3FMUState *state) {
    const unit *u = instance;
    if (!*state) *state = malloc(bytes());
    if (!*state) return say(u, fmi3Error, "there is no memory for a state");
    memcpy(*state, u->now, bytes());
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(SetFMUState)(fmi3Instance instance, fmi3FMUState state) {
    unit *u = instance;
    if (!state) return say(u, fmi3Error, "there is no state to go back to");
    memcpy(u->now, state, bytes());
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(FreeFMUState)(fmi3Instance instance, fmi3FMUState *state) {
    (void)instance;
    if (state) free(*state), *state = 0;
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(SerializedFMUStateSize)(fmi3Instance instance, fmi3FMUState state, size_t *size) {
    (void)instance, (void)state;
    *size = sizeof CFEM_FMU_TOKEN + bytes();
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(SerializeFMUState)(fmi3Instance instance, fmi3FMUState state, fmi3Byte out[], size_t size) {
    const unit *u = instance;
    if (size != sizeof CFEM_FMU_TOKEN + bytes()) return say(u, fmi3Error, "a serialised state has another size");
    memcpy(out, CFEM_FMU_TOKEN, sizeof CFEM_FMU_TOKEN);
    memcpy(out + sizeof CFEM_FMU_TOKEN, state, bytes());
    return fmi3OK;
}

FMI3_Export fmi3Status FMI(DeserializeFMUState)(fmi3Instance instance, const fmi3Byte in[], size_t size, fmi3FMUState *state) {
    const unit *u = instance;
    if (size != sizeof CFEM_FMU_TOKEN + bytes() || memcmp(in, CFEM_FMU_TOKEN, sizeof CFEM_FMU_TOKEN))
        return say(u, fmi3Error, "the serialised state is not of this FMU");
    content *const read = malloc(bytes());
    if (!read) return say(u, fmi3Error, "there is no memory for a state");
    memcpy(read, in + sizeof CFEM_FMU_TOKEN, bytes());
    if (!is_state(read)) {
        free(read);
        return say(u, fmi3Error, "the serialised state is damaged");
    }
    free(*state), *state = read;
    return fmi3OK;
}
