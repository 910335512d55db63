/* Robots that meet along the way of cfem_meet_vectors.h: compares it with Python and prints what a step costs. `make test`,
 * `make emulate`. */
#if !defined(__arm__)
#define _POSIX_C_SOURCE 200112L
#endif

#include <math.h>
#include <stdio.h>

#include "cfem_meet_vectors.h"
#include "cfem_touch_control.h"
#include "cost.h"

static cfem_met states[2];
static cfem_meet_room room;

static double apart(int n, const double *a, const double *b) {
    double most = 0.0;
    for (int i = 0; i < n; i++) most = fmax(most, fabs(a[i] - b[i]));
    return most;
}

#if CFEM_CONTACT == 2 && !defined(__arm__) /* whose memory is too small */
#define TICKS 3
#define NEAR 0.01 /* mm */

static cfem_touch_controller robot;

/* The tick that plans follows the tip of the first robot along the same way, the others go as they went. */
static void follow(void) {
    uint64_t sum = 0, most = 0;
    double farthest = 0.0;
    int reached = 0;
    cfem_input input = {0};
    cfem_output output;
    unsigned status = cfem_touch_control_init(&robot, cfem_obstacles, CFEM_TOUCH_OBSTACLES, CFEM_TOUCH_FRICTION);
    for (int v = 0; v < CFEM_MEET_VECTORS; v++) {
        const cfem_meet_vector *const one = &vectors[v];
        for (int i = CFEM_NA; i < CFEM_CONTACT_NA; i++) robot.others[i / CFEM_NA][i % CFEM_NA] = one->delta_a[i];
        for (int e = 0; e < CFEM_NE; e++) input.goal[e] = (cfem_real)(cfem_rest_e[e] + one->delta_e[e]);
        for (int k = 0; k < TICKS; k++) {
            const uint64_t begin = now();
            status |= cfem_touch_control(&robot, &input, &output) & (CFEM_NO_MODEL | CFEM_NO_QP);
            const uint64_t took = now() - begin;
            sum += took, most = took > most ? took : most;
        }
        const double missed = apart(CFEM_NE, robot.at.robot[0].delta_e, one->delta_e);
        reached += missed < NEAR, farthest = fmax(farthest, missed);
    }
    printf("planned: status %u; %d of %d states reached within %g mm, the farthest missed by %.2g mm; %.2g MB of state\n", status, reached,
           CFEM_MEET_VECTORS, NEAR, farthest, 1e-6 * sizeof robot);
    printf("a tick: mean %llu, largest %llu " UNIT "\n", (unsigned long long)(sum / TICKS / CFEM_MEET_VECTORS),
           (unsigned long long)most);
}
#else
static void follow(void) {}
#endif

int main(void) {
    int failed = 0;
    uint64_t sum = 0, most = 0;
    double largest = 0.0, pressed = 0.0;
    start();
    for (int v = 0; v < CFEM_MEET_VECTORS; v++) {
        const cfem_meet_vector *const one = &vectors[v];
        cfem_met *const here = &states[v % 2];
        double delta_a[CFEM_MEET_ROBOTS][CFEM_NA], force = 0.0;
        for (int i = 0; i < CFEM_MEET_ROBOTS * CFEM_NA; i++) delta_a[i / CFEM_NA][i % CFEM_NA] = one->delta_a[i];
        const uint64_t begin = now();
        cfem_meet(delta_a, cfem_robots, cfem_obstacles, CFEM_TOUCH_OBSTACLES, CFEM_TOUCH_FRICTION, v ? &states[(v + 1) % 2] : 0, here,
                  &room);
        const uint64_t took = now() - begin;
        for (int b = 0; b < CFEM_MEET_ROBOTS; b++) {
            largest = fmax(largest, apart(CFEM_NE, here->robot[b].delta_e, one->delta_e + b * CFEM_NE) / CFEM_MEET_DELTA_E);
            largest = fmax(largest, apart(CFEM_NA, here->robot[b].lambda_a, one->lambda_a + b * CFEM_NA) / CFEM_MEET_LAMBDA_A);
            for (int m = b; m < CFEM_MEET_ROBOTS + CFEM_TOUCH_OBSTACLES; m++) force += cfem_meet_pressed(here, b, m);
        }
        failed += here->status != 0u || !(largest <= CFEM_MEET_TOLERANCE);
        pressed = fmax(pressed, force), sum += took, most = took > most ? took : most;
    }
    printf("meeting: %d steps, %d failed; off by at most %.2g; pressed with %.3g N at most\n", CFEM_MEET_VECTORS, failed, largest,
           pressed);
    printf("a step: mean %llu, largest %llu " UNIT "\n", (unsigned long long)(sum / CFEM_MEET_VECTORS), (unsigned long long)most);
    follow();
    return failed != 0;
}
