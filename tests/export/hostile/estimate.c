/* The estimator of a robot at rest, whose actuators walk about the middle of what the model knows. Alive: its estimate is near. */
#include "cfem_estimate_parts.h"
#include "driver.h"

static cfem_filter filter;

void begin(void) { cfem_filter_init(&filter); }

int tick(long number, int phase) {
    cfem_frame frame;
    cfem_estimate found;
    double x[N] = {0.0}, y[ROWS], by[ROWS][N], tension[NA], of_tension[NA][N];
    for (int a = 0; a < NA; a++) x[a] = cfem_estimate_middle[a] + 0.1 * sin(0.02 * (double)number + a) * cfem_estimate_scale[a];
    cfem_estimate_places(x, y, by), cfem_estimate_tensions(x, tension, of_tension);
    for (int i = 0; i < ROWS; i++) frame.place[i / 3][i % 3] = sample(cfem_estimate_rest[i / 3][i % 3] + y[i] + noise(cfem_estimate_noise), phase);
    for (int a = 0; a < NA; a++) {
        frame.displacement[a] = sample(x[a] + noise(cfem_estimate_sensor), phase);
        frame.force[a] = sample(tension[a] + noise(cfem_estimate_tension), phase);
        frame.command[a] = goal(x[a], phase);
    }
    const unsigned status = cfem_filter_tick(&filter, &frame, &found);
    demand(status == found.status && found.iterations <= 200, "status or iterations");
    if (status) return LOST;
    for (int i = 0; i < N; i++) {
        demand(isfinite(found.x[i]) && found.covariance[i][i] > 0.0 && isfinite(found.covariance[i][i]), "an estimate is not finite");
        demand_within(1, &found.x[i], &cfem_estimate_box[i][0], &cfem_estimate_box[i][1], 1e-12, "unknown");
        if (fabs(found.x[i] - x[i]) > 6.0 * sqrt(found.covariance[i][i])) return LOST;
    }
    return ALIVE;
}
