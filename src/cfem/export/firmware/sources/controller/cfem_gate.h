/* Whether a sample may correct a filter, as src/cfem/predict/estimation/gate.py has it: its innovation, normalised by what the filter states,
 * against the chi-squared distribution. */
#ifndef CFEM_GATE_H
#define CFEM_GATE_H

#include <math.h>

#define CFEM_GATE_FIRST 10.0  /* spread before the first sample */
#define CFEM_GATE_MEMORY 10.0 /* samples after which one counts for 1/e in the spread */
#define CFEM_GATE_LARGEST 2.0 /* of the spread: what a sample adds to its mean */
#define CFEM_GATE_ALIKE 4.0   /* ratio of squares of innovations below which two rejected samples agree */

/* spread: of innovations of late over what the filter states, 1 or more; last: square of the last rejected one; agreeing: rejected
 * samples in a row that agree. */
typedef struct {
    double spread, last;
    int agreeing;
} cfem_gate;

enum { CFEM_GATE_ACCEPTED, CFEM_GATE_REJECTED, CFEM_GATE_RESTART }; /* of the last: the filter begins again, with this sample */

static inline void cfem_gate_restart(cfem_gate *gate) { gate->spread = CFEM_GATE_FIRST, gate->last = 0.0, gate->agreeing = 0; }

/* Standard deviations by which a sample misses more than expected: of the square nu^T S^-1 nu, nu of so many numbers. */
static inline double cfem_gate_deviate(const cfem_gate *gate, double square, int numbers) {
    return sqrt(2.0 * square / gate->spread) - sqrt(2.0 * numbers - 1.0);
}

/* square, numbers: nu^T S^-1 nu of the sample, and how many numbers nu has, HUGE_VAL where the filter found no answer; sigmas,
 * samples: limits. One of the above. */
static inline int cfem_gate_judge(cfem_gate *gate, double square, int numbers, double sigmas, int samples) {
    if (numbers < 1) return CFEM_GATE_ACCEPTED;
    if (!(square < HUGE_VAL)) square = HUGE_VAL; /* NaN too */
    const double most = CFEM_GATE_LARGEST * gate->spread, large = fmax(square, gate->last), small = fmin(square, gate->last);
    const int accepted = cfem_gate_deviate(gate, square, numbers) <= sigmas;
    const int agrees = gate->last > 0.0 && (!(large < HUGE_VAL) || large <= CFEM_GATE_ALIKE * small);
    if (accepted || agrees)
        gate->spread = fmax(1.0, gate->spread + (fmin(square / numbers, most) - gate->spread) / CFEM_GATE_MEMORY);
    if (accepted) {
        gate->agreeing = 0, gate->last = 0.0;
        return CFEM_GATE_ACCEPTED;
    }
    gate->agreeing = agrees ? gate->agreeing + 1 : 1, gate->last = square;
    if (gate->agreeing < samples) return CFEM_GATE_REJECTED;
    cfem_gate_restart(gate);
    return CFEM_GATE_RESTART;
}

#endif
