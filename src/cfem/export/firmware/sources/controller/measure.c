/* What a tick costs: runs the controller along its test goals, on the PC or on an emulated Cortex-M, and prints the cost of a
 * tick and the commands. `make measure`, `make emulate`. `./measured paced`, `make paced`: on the PC, a tick every millisecond,
 * timed from when it was due. */
#if !defined(__arm__)
#define _POSIX_C_SOURCE 200112L
#endif

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cfem.h"
#include "cfem_vectors.h"
#include "cost.h"

#define TICKS_A_GOAL 20
#define TICKS (CFEM_VECTORS * TICKS_A_GOAL)

#if defined(__arm__)
static uint64_t wait(void) { return now(); }

/* The stack below this program, painted; how much of it was written to since. */
#define PAINTED 16384
static volatile uint32_t *from, *to;
static void paint(void) {
    to = (volatile uint32_t *)((uintptr_t)__builtin_frame_address(0) - 256);
    from = to - PAINTED / 4;
    for (volatile uint32_t *p = from; p < to; p++) *p = 0xc0ffee00u;
}
static int written(void) {
    volatile uint32_t *p = from;
    while (p < to && *p == 0xc0ffee00u) p++;
    return (int)(4 * (to - p)) + 256;
}
#else
static uint64_t period, due; /* ns; 0: as fast as it goes */
static uint64_t wait(void) {
    if (!period) return now();
    due = due ? due + period : now() + period;
    const struct timespec t = {(time_t)(due / 1000000000u), (long)(due % 1000000000u)};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL)) {}
    return due;
}
static void paint(void) {}
static int written(void) { return 0; }
#endif

static uint32_t cost[TICKS];
static cfem_controller controller;

static int by_size(const void *a, const void *b) {
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

/* From each reachable goal to the next at constant speed; 1: prints the command at each. Ticks done. */
static int follow(int print) {
    cfem_input in;
    cfem_output out;
    double from[CFEM_NE];
    int ticks = 0;
    memset(&in, 0, sizeof in);
    cfem_init(&controller);
    for (int i = 0; i < CFEM_NA; i++) in.delta_a[i] = (cfem_real)controller.delta_a[i];
    for (int e = 0; e < CFEM_NE; e++) from[e] = controller.reference[e];
    for (int v = 0; v < CFEM_VECTORS; v++) {
        if (!cfem_vectors[v].reachable) continue;
        for (int tick = 0; tick < TICKS_A_GOAL; tick++) {
            const double share = (tick + 1.0) / TICKS_A_GOAL;
            for (int e = 0; e < CFEM_NE; e++)
                in.goal[e] = (cfem_real)(from[e] + share * (cfem_vectors[v].goal[e] - from[e]));
            const uint64_t begin = wait();
            cfem_step(&controller, &in, &out);
            cost[ticks++] = (uint32_t)(now() - begin);
            for (int i = 0; i < CFEM_NA; i++) in.delta_a[i] = out.delta_a[i];
        }
        for (int e = 0; e < CFEM_NE; e++) from[e] = cfem_vectors[v].goal[e];
        if (!print) continue;
        printf("command %u", out.status);
        for (int i = 0; i < CFEM_NA; i++) printf(" %.17g", (double)out.delta_a[i]);
        for (int i = 0; i < CFEM_NA; i++) printf(" %.17g", (double)out.lambda_a[i]);
        printf("\n");
    }
    return ticks;
}

#if !defined(__arm__)
/* Of `rounds` times the goals; a tick is missed that ends after the next is due. */
static int paced(int rounds) {
    static uint32_t all[100 * TICKS];
    int count = 0, missed = 0;
    period = 1000000u;
    for (int round = 0; round < rounds; round++) {
        due = 0;
        const int ticks = follow(0);
        for (int i = 0; i < ticks; i++) missed += cost[i] > period;
        memcpy(all + count, cost, (size_t)ticks * sizeof *cost);
        count += ticks;
    }
    if (!count) return 1;
    qsort(all, (size_t)count, sizeof *all, by_size);
    printf("paced at 1 kHz, from when due to done: median %u p99 %u p99.9 %u max %u ns, %d of %d ticks missed\n",
           (unsigned)all[count / 2], (unsigned)all[(int)(count * 0.99)], (unsigned)all[(int)(count * 0.999)],
           (unsigned)all[count - 1], missed, count);
    return 0;
}
#endif

int main(int words, char **word) {
#if !defined(__arm__)
    if (words > 1 && !strcmp(word[1], "paced")) return paced(words > 2 ? atoi(word[2]) % 101 : 10);
#else
    (void)words, (void)word;
#endif
    start();
    follow(1);
    paint();
    const int ticks = follow(0), stack = written();
    if (!ticks) return 1;
    qsort(cost, (size_t)ticks, sizeof *cost, by_size);
    printf("tick median %u p99 %u max %u %s, %d ticks\n", (unsigned)cost[ticks / 2], (unsigned)cost[ticks * 99 / 100],
           (unsigned)cost[ticks - 1], UNIT, ticks);
    printf("state %u bytes, stack %d bytes\n", (unsigned)sizeof controller, stack);
#if defined(__linux__)
    char line[128];
    int peak;
    FILE *status = fopen("/proc/self/status", "r");
    while (status && fgets(line, sizeof line, status))
        if (sscanf(line, "VmHWM: %d", &peak) == 1) printf("peak memory %d KiB\n", peak);
    if (status) fclose(status);
#endif
    return 0;
}
