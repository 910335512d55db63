/* The robot goes to a point that it can reach and back, on and on, a command every 10 ms. Replace what is marked by your drives and
 * your sensor. */
#include <cfem_robot.h>

static cfem_controller controller; /* one per robot */
static cfem_input input;
static cfem_output output;
static double from[CFEM_NE]; /* mm, absolute */
static unsigned long due;    /* us */
static uint32_t tick;

static const unsigned long PERIOD = 10000; /* us */
static const uint32_t LAP = 400;           /* ticks there and back */

/* Yours: set points of the drives; where these take forces, output.lambda_a, N (MPa). */
static void commandActuators() {
    for (int i = 0; i < CFEM_NA; i++) {
        Serial.print((double)(CFEM_COMMAND_FORCE ? output.lambda_a[i] : output.delta_a[i]), 5);
        Serial.print(i + 1 < CFEM_NA ? ' ' : '\n');
    }
}

/* Yours: where a sensor saw the effectors, mm, into input.x_e. Returns the number of the command that they followed, `now` if the
 * sample was taken now; 0: nothing is measured. */
static uint32_t measureEffectors(uint32_t now) {
    (void)now;
    return 0;
}

void setup() {
    Serial.begin(115200);
    cfem_init(&controller);
    for (int e = 0; e < CFEM_NE; e++) from[e] = controller.reference[e];
    for (int i = 0; i < CFEM_NA; i++) input.delta_a[i] = controller.delta_a[i];
    due = micros();
}

void loop() {
    if ((long)(micros() - due) < 0) return;
    due += PERIOD;
    const double share = 0.5 - 0.5 * cos(6.283185307179586 * (tick++ % LAP) / LAP);
    for (int e = 0; e < CFEM_NE; e++) input.goal[e] = (cfem_real)(from[e] + share * (cfem_example_goal[e] - from[e]));
    input.tick = measureEffectors(output.tick);
    if (cfem_step(&controller, &input, &output) & CFEM_HELD) Serial.println("held");
    commandActuators();
    for (int i = 0; i < CFEM_NA; i++) input.delta_a[i] = output.delta_a[i]; /* yours: encoders, if the observer reads them */
}
