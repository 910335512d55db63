/* An example: the control loop of a robot that moves to a point and holds it. Replace what is marked by your drives, sensors and
 * timer. */
#include <stdio.h>

#include "cfem.h"

static void command_actuators(const cfem_real *delta_a) { /* yours: set points of the position drives, mm */
    for (int i = 0; i < CFEM_NA; i++) printf("%10.5f", (double)delta_a[i]);
    printf("\n");
}

static int measure_effectors(cfem_real *x_e) { /* yours: camera or sensor, mm; 0 where there is no new measurement */
    (void)x_e;
    return 0;
}

static void wait_for_tick(void) {} /* yours: a timer at the loop rate */

int main(void) {
    static cfem_controller controller; /* static: not on the stack of the loop */
    cfem_input input = {.measured = 0};
    cfem_output output;
    cfem_real x_e[CFEM_NE];
    cfem_init(&controller);
    for (int e = 0; e < CFEM_NE; e++) input.goal[e] = (cfem_real)cfem_example_goal[e];
    for (int i = 0; i < CFEM_NA; i++) input.delta_a[i] = (cfem_real)controller.delta_a[i];
    for (int tick = 0; tick < 20; tick++) {
        wait_for_tick();
        input.measured = tick > 0 && measure_effectors(x_e); /* what the last command led to */
        if (input.measured)
            for (int e = 0; e < CFEM_NE; e++) input.error[e] = output.reference[e] - x_e[e];
        if (cfem_step(&controller, &input, &output) & CFEM_HELD) printf("held, status %u\n", output.status);
        command_actuators(output.delta_a);
        for (int i = 0; i < CFEM_NA; i++) input.delta_a[i] = output.delta_a[i]; /* yours: encoders, if the observer reads them */
    }
    return 0;
}
