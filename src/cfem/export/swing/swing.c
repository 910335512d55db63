/* The filter along the frames of cfem_swing_vectors.h: compares it with Python and prints what a frame costs. `make test`,
 * `make emulate`. */
#if !defined(__arm__)
#define _POSIX_C_SOURCE 200112L
#include <time.h>
#endif

#include <stdint.h>
#include <stdio.h>

#include "cfem_swing_vectors.h"

#if defined(__arm__)
/* MPS2: a timer of 25 MHz that counts down. Under qemu -icount shift=0 an instruction takes 1 ns, so a count is 40 of them. */
#define UNIT "instructions"
#define TIMER ((volatile uint32_t *)0x40000000u)
static uint64_t now(void) { return (uint64_t)(0xffffffffu - TIMER[1]) * 40; }
static void start(void) { TIMER[1] = TIMER[2] = 0xffffffffu, TIMER[0] = 1u; }
#define REPEATS 1
#else
#define UNIT "ns"
static uint64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}
static void start(void) {}
#define REPEATS 20 /* of which the fastest counts */
#endif

static cfem_swing filter;
static uint64_t cost[CFEM_SWING_FRAMES];

static double apart(double a, double b, double scale) { return fabs(a - b) / scale; }

int main(void) {
    int failed = 0;
    uint64_t plain = 0, most = 0, sum = 0, plain_frames = 0;
    double largest = 0.0;
    start();
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        cfem_swing_init(&filter);
        for (int f = 0; f < CFEM_SWING_FRAMES; f++) {
            const cfem_swing_vector *one = &cfem_swing_vectors[f];
            cfem_swing_found found;
            const uint64_t begin = now();
            const unsigned status = cfem_swing_frame(&filter, &one->frame, &found);
            const uint64_t took = now() - begin;
            cost[f] = repeat && cost[f] < took ? cost[f] : took;
            if (repeat) continue;
            double off = 0.0;
            for (int i = 0; i < CFEM_SWING_N; i++) {
                off = fmax(off, apart(found.x[i], one->x[i], cfem_swing_scale[i]));
                off = fmax(off, apart(sqrt(found.covariance[i][i]), sqrt(one->variance[i]), cfem_swing_scale[i]));
            }
            for (int e = 0; e < CFEM_ESTIMATE_NE; e++) off = fmax(off, apart(found.effector[e], one->effector[e], cfem_swing_scale[0]));
            const int same = status == one->status && found.left_out == one->left_out && found.unseen == one->unseen;
            if (!same || !(off <= CFEM_SWING_TOLERANCE)) {
                printf("frame %d: status %u (Python %u), left out %x (%x), unseen %x (%x), off by %.2g of the scale\n", f, status,
                       one->status, (unsigned)found.left_out, (unsigned)one->left_out, (unsigned)found.unseen,
                       (unsigned)one->unseen, off);
                failed++;
            } else largest = fmax(largest, off);
        }
    }
    for (int f = 0; f < CFEM_SWING_FRAMES; f++) {
        sum += cost[f];
        if (cost[f] > most) most = cost[f];
        if (!cfem_swing_vectors[f].left_out) plain += cost[f], plain_frames++;
    }
    printf("filter of what moves: %d frames, %d failed; off by at most %.2g of the scale\n", CFEM_SWING_FRAMES, failed, largest);
    printf("a frame: mean %llu, without wrong markers %llu, largest %llu " UNIT "\n", (unsigned long long)(sum / CFEM_SWING_FRAMES),
           (unsigned long long)(plain_frames ? plain / plain_frames : 0), (unsigned long long)most);
    return failed != 0;
}
