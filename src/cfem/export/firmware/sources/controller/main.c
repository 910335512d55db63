/* An example: the control loop of a robot that moves to a point and holds it. Replace what is marked by your drives, sensors and
 * timer. */
#include <stdio.h>

#include "cfem.h"

static void command_actuators(const cfem_real *delta_a) { /* yours: set points of the position drives, mm */
    for (int i = 0; i < CFEM_NA; i++) printf("%10.5f", (double)delta_a[i]);
    printf("\n");
}

/* Yours: camera or sensor, mm. Given the number of the command that the robot now follows, to be kept with an image that is taken;
 * returns the number that was kept with the image that x_e is of, 0 before the first. */
static uint32_t measure_effectors(uint32_t now, cfem_real *x_e) {
    (void)now, (void)x_e;
    return 0;
}

static void wait_for_tick(void) {} /* yours: a timer at the loop rate */

int main(void) {
    static cfem_controller controller; /* static: not on the stack of the loop */
    cfem_input input = {.tick = 0};
    cfem_output output = {.tick = 0};
    cfem_init(&controller);
    for (int e = 0; e < CFEM_NE; e++) input.goal[e] = (cfem_real)cfem_example_goal[e];
    for (int i = 0; i < CFEM_NA; i++) input.delta_a[i] = (cfem_real)controller.delta_a[i];
    for (int tick = 0; tick < 20; tick++) {
        wait_for_tick();
        input.tick = measure_effectors(output.tick, input.x_e); /* the same sample may come again: it counts once */
        if (cfem_step(&controller, &input, &output) & CFEM_HELD) printf("held, status %u\n", output.status);
        command_actuators(output.delta_a);
        for (int i = 0; i < CFEM_NA; i++) input.delta_a[i] = output.delta_a[i]; /* yours: encoders, if the observer reads them */
    }
    return 0;
}
