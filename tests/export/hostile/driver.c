/* DRIVER TICKS [TURN]: turns of TURN ticks (500), each of one phase. Exit 1: a bound was left. Prints the ticks; those that were lost; the largest number
 * of lost ones in a row among good inputs; and the branches that the longest tick took, of good inputs and of all. */
#include "driver.h"

#include <stdio.h>
#include <stdlib.h>

static unsigned long long random_state = 88172645463325252ull, branches;
static long now;

void __sanitizer_cov_trace_pc(void) { branches++; } /* the export is compiled with -fsanitize-coverage=trace-pc */

double uniform(void) { /* xorshift */
    random_state ^= random_state << 13, random_state ^= random_state >> 7, random_state ^= random_state << 17;
    return (double)(random_state >> 11) / 9007199254740992.0;
}

double noise(double size) { return size * (2.0 * uniform() - 1.0); }

double garbage(void) {
    static const double extremes[] = {NAN, NAN, INFINITY, -INFINITY, 1e300, -1e308};
    const double draw = uniform();
    if (draw < 0.3) return extremes[(int)(20.0 * draw)];
    return (uniform() - 0.5) * pow(10.0, 9.0 * uniform());
}

double sample(double value, int phase) {
    const int bad = phase == BAD_SAMPLES || (phase == SOME_BAD_SAMPLES && uniform() < 0.3);
    return bad ? garbage() : value;
}

double goal(double value, int phase) { return phase == BAD_GOALS && uniform() < 0.3 ? garbage() : value; }

void demand(int holds, const char *what) {
    if (holds) return;
    printf("tick %ld: %s\n", now, what);
    exit(1);
}

void demand_within(int count, const double *values, const double *low, const double *high, double slack, const char *what) {
    for (int i = 0; i < count; i++) {
        if (values[i] >= low[i] - slack && values[i] <= high[i] + slack) continue;
        printf("tick %ld: %s %d is %.17g, not within %.17g and %.17g\n", now, what, i, values[i], low[i], high[i]);
        exit(1);
    }
}

int main(int count, char **words) {
    const long ticks = count > 1 ? atol(words[1]) : 0, turn = count > 2 ? atol(words[2]) : 500;
    unsigned long long most[2] = {0, 0};
    long lost = 0, longest = 0, run = 0;
    begin();
    for (now = 0; now < ticks; now++) {
        const int phase = (int)(now / turn % PHASES);
        branches = 0;
        const int alive = tick(now, phase) == ALIVE;
        for (int all = phase != GOOD; all < 2; all++) most[all] = branches > most[all] ? branches : most[all];
        lost += !alive;
        run = phase == GOOD && !alive ? run + 1 : 0;
        if (run > longest) longest = run;
    }
    printf("%ld %ld %ld %llu %llu\n", ticks, lost, longest, most[0], most[1]);
    return 0;
}
