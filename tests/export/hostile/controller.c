/* The controller of cfem.h on a robot that is as its model: good samples are where the last command leads, with 0.05 mm of noise, and up to
 * three ticks old. Alive: it commands, and the effectors are near a goal within reach. */
#include <string.h>

#include "cfem.h"
#include "driver.h"

enum { LATE = 4 };
static const double NEAR = 2.0; /* mm */

static cfem_controller controller;
static double place[LATE][CFEM_NE], aim[CFEM_NE], u[CFEM_NA]; /* of the last commands; mm: of the goal's actuators */

/* mm, absolute: where the effectors are under the input s of the model. */
static int lead(const double *s, double *x_e) {
    cfem_condensed m;
    if (cfem_model(s, &m)) return 0;
    for (int e = 0; e < CFEM_NE; e++) {
        x_e[e] = cfem_rest_e[e] + m.free_e[e];
        for (int i = 0; i < CFEM_NA; i++) x_e[e] += m.W_ea[e][i] * m.lambda_a[i];
    }
    return 1;
}

void begin(void) {
    cfem_init(&controller);
    for (int k = 0; k < LATE; k++) lead(cfem_home, place[k]);
}

/* The goal walks between the middles of what the model knows. */
static void walk(long number) {
    for (int i = 0; i < CFEM_NA; i++) {
        const double (*const box)[CFEM_NA] = CFEM_FORM_DISPLACEMENT ? cfem_domain_delta_a : cfem_domain_lambda_a;
        u[i] = box[0][i] + (0.4 + 0.2 * sin(0.01 * (double)number + 0.2 * i)) * (box[1][i] - box[0][i]);
    }
    demand(lead(u, aim), "the model has no answer in the middle of its box");
}

static double apart(const double *x_e) {
    double square = 0.0;
    for (int e = 0; e < CFEM_NE; e++) {
        const double missed = x_e[e] - aim[e];
        square += cfem_effector_weight[e] > 0.0 ? missed * missed : 0.0;
    }
    return sqrt(square);
}

int tick(long number, int phase) {
    cfem_input input;
    cfem_output output;
    double delta_a[CFEM_NA], lambda_a[CFEM_NA], x_e[CFEM_NE];
    const uint32_t given = controller.feedback.given;
    uint32_t age = (uint32_t)(3.0 * uniform());
    memset(&input, 0, sizeof input);
    walk(number);
    if (age >= given) age = 0;
    for (int e = 0; e < CFEM_NE; e++) {
        input.goal[e] = (cfem_real)goal(aim[e], phase);
        input.x_e[e] = (cfem_real)sample(place[(given - age) % LATE][e] + noise(0.05), phase);
    }
    for (int i = 0; i < CFEM_NA; i++) input.delta_a[i] = (cfem_real)sample(controller.delta_a[i], phase);
    input.tick = given - age;
    if (phase != GOOD && uniform() < 0.1) input.tick = (uint32_t)(4294967295.0 * uniform());
    const unsigned status = cfem_step(&controller, &input, &output);
    for (int i = 0; i < CFEM_NA; i++) delta_a[i] = (double)output.delta_a[i], lambda_a[i] = (double)output.lambda_a[i];
    const double slack = sizeof(cfem_real) == 4 ? 1e-5 : 1e-12;
    if (CFEM_COMMAND_FORCE) demand_within(CFEM_NA, lambda_a, cfem_lambda_low, cfem_lambda_high, slack, "force");
    else demand_within(CFEM_NA, delta_a, cfem_delta_low, cfem_delta_high, slack, "displacement");
    for (int i = 0; i < CFEM_NA; i++) demand(isfinite(delta_a[i]) && isfinite(lambda_a[i]), "a command is not finite");
    if (status & CFEM_HELD) return LOST;
    if (!lead(CFEM_FORM_DISPLACEMENT ? controller.delta_a : controller.lambda_a, x_e)) return LOST;
    memcpy(place[controller.feedback.given % LATE], x_e, sizeof x_e);
    return apart(x_e) < NEAR ? ALIVE : LOST;
}
