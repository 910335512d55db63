/* A filter along the frames of its vectors: compares it with Python and prints what a frame costs. For estimate.c and swing.c, which say
 * what FILTER, FOUND, BEGIN, FRAME and SCALE are, whether a frame with a STATUS COUNTS, and the filter's NAME. */
#include <stdio.h>

#include "cost.h"

#if defined(__arm__)
#define REPEATS 1
#else
#define REPEATS 20 /* of which the fastest counts */
#endif

static FILTER filter;
static uint64_t cost[FRAMES];

static double apart(double a, double b, double scale) { return fabs(a - b) / scale; }

int main(void) {
    int failed = 0;
    uint64_t plain = 0, most = 0, sum = 0, plain_frames = 0;
    double largest = 0.0;
    start();
    for (int repeat = 0; repeat < REPEATS; repeat++) {
        BEGIN(&filter);
        for (int f = 0; f < FRAMES; f++) {
            const vector *one = &vectors[f];
            FOUND found;
            const uint64_t begin = now();
            const unsigned status = FRAME(&filter, &one->frame, &found);
            const uint64_t took = now() - begin;
            cost[f] = repeat && cost[f] < took ? cost[f] : took;
            if (repeat) continue;
            double off = 0.0;
            for (int i = 0; i < UNKNOWNS; i++) {
                off = fmax(off, apart(found.x[i], one->x[i], SCALE[i]));
                off = fmax(off, apart(sqrt(found.covariance[i][i]), sqrt(one->variance[i]), SCALE[i]));
            }
            for (int e = 0; e < CFEM_ESTIMATE_NE; e++) off = fmax(off, apart(found.effector[e], one->effector[e], SCALE[0]));
            const int same = status == one->status && found.left_out == one->left_out && found.unseen == one->unseen;
            if (!same || (COUNTS(status) && !(off <= TOLERANCE))) {
                printf("frame %d: status %u (Python %u), left out %x (%x), unseen %x (%x), off by %.2g of the scale\n", f, status,
                       one->status, (unsigned)found.left_out, (unsigned)one->left_out, (unsigned)found.unseen,
                       (unsigned)one->unseen, off);
                failed++;
            } else if (COUNTS(status)) largest = fmax(largest, off);
        }
    }
    for (int f = 0; f < FRAMES; f++) {
        sum += cost[f];
        if (cost[f] > most) most = cost[f];
        if (!vectors[f].left_out) plain += cost[f], plain_frames++;
    }
    printf(NAME ": %d frames, %d failed; off by at most %.2g of the scale\n", FRAMES, failed, largest);
    printf("a frame: mean %llu, without wrong markers %llu, largest %llu " UNIT "\n", (unsigned long long)(sum / FRAMES),
           (unsigned long long)(plain_frames ? plain / plain_frames : 0), (unsigned long long)most);
    return failed != 0;
}
