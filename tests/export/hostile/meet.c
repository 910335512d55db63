/* Steps of robots that meet: their actuators walk within the reach, a twentieth of it a tick at most. After a step without a state they
 * begin again where the robots begin. Alive: there is a state. */
#include <string.h>

#include "cfem_meet.h"
#include "driver.h"

static cfem_met states[2];
static cfem_meet_room room;
static const cfem_met *before;
static double at[CFEM_MEET_ROBOTS][CFEM_NA]; /* mm, of the state before */

void begin(void) { before = 0; }

int tick(long number, int phase) {
    double delta_a[CFEM_MEET_ROBOTS][CFEM_NA];
    cfem_placed robots[CFEM_MEET_ROBOTS];
    cfem_met *const now = before == &states[0] ? &states[1] : &states[0];
    memcpy(robots, cfem_robots, sizeof robots);
    for (int b = 0; b < CFEM_MEET_ROBOTS; b++) {
        for (int i = 0; i < CFEM_NA; i++) {
            const double low = cfem_delta_low[i], high = cfem_delta_high[i], most = (high - low) / 20.0;
            const double to = low + (high - low) * (0.3 + 0.3 * sin(0.02 * (double)number + i - b));
            at[b][i] += fmin(fmax(to - at[b][i], -most), most);
            delta_a[b][i] = goal(at[b][i], phase);
        }
        for (int a = 0; a < 3 && b; a++) robots[b].t[a] = sample(robots[b].t[a], phase);
    }
    const double mu = uniform() < 0.02 ? sample(CFEM_TOUCH_FRICTION, phase) : CFEM_TOUCH_FRICTION; /* no sensor says it */
    const unsigned status = cfem_meet(delta_a, robots, cfem_obstacles, CFEM_TOUCH_OBSTACLES, mu, before, now, &room);
    demand(now->systems >= 0 && now->systems <= CFEM_TOUCH_SYSTEMS, "systems");
    demand(status == now->status && now->iterations <= 60 && now->pair_count <= CFEM_MEET_PAIRS, "status, iterations or pairs");
    before = status ? 0 : now;
    if (status) memset(at, 0, sizeof at);
    else memcpy(at, delta_a, sizeof at);
    if (status) return LOST;
    for (int b = 0; b < CFEM_MEET_ROBOTS; b++)
        for (int i = 0; i < now->robot[b].count; i++)
            for (int a = 0; a < 3; a++) demand(isfinite(now->robot[b].force[i][a]), "a force is not finite");
    for (int b = 1; b < CFEM_MEET_ROBOTS; b++) demand(cfem_meet_pressed(now, 0, b) >= 0.0, "robots pull each other");
    return ALIVE;
}
