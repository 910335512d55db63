/* The page's own C code, compiled as the firmware's is: ns a tick of the path of measure.c, the shortest of some times.
 * Usage: page_native BLOCK COMMANDS BY_FORCE   (binary files: the robot of the page; doubles, n_a a goal) */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MOST_NE 12
#define MOST_NA 8

double *cfem_page_io(void);
int cfem_page_load(const unsigned char *block, int size);
void cfem_page_home(void);
unsigned cfem_page_tick(void);
unsigned cfem_page_set(int by_force, int keep);

static unsigned char *whole(const char *path, long *size) {
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END)) exit(3);
    *size = ftell(file), rewind(file);
    unsigned char *found = aligned_alloc(16, (size_t)(*size + 15) / 16 * 16);
    if (!found || fread(found, 1, (size_t)*size, file) != (size_t)*size) exit(3);
    return fclose(file), found;
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

int main(int argc, char **argv) {
    long size, bytes;
    if (argc != 4) return 2;
    const unsigned char *block = whole(argv[1], &size), *given = whole(argv[2], &bytes);
    if (cfem_page_load(block, (int)size)) return 3;
    double *goal = cfem_page_io(), *actuator = goal + MOST_NE, *x_e = goal + MOST_NE + 2 * MOST_NA;
    const int by_force = atoi(argv[3]), n_a = ((const int *)block)[2];
    const int goals = (int)(bytes / (long)sizeof(double)) / n_a;
    double (*path)[MOST_NE] = calloc((size_t)goals + 1, sizeof *path), best = 1e300;
    cfem_page_home();
    memcpy(path[0], x_e, sizeof path[0]);
    for (int g = 0; g < goals; g++) {
        memcpy(by_force ? actuator + MOST_NA : actuator, given + (size_t)(g * n_a) * sizeof(double), (size_t)n_a * sizeof(double));
        cfem_page_set(by_force, 0);
        memcpy(path[g + 1], x_e, sizeof path[0]);
    }
    for (int round = 0; round < 40; round++) {
        const double begin = now();
        long ticks = 0;
        while (now() < begin + 15e6) {
            cfem_page_home();
            for (int g = 0; g < goals; g++)
                for (int k = 1; k <= 20; k++, ticks++) {
                    for (int e = 0; e < MOST_NE; e++) goal[e] = path[g][e] + k / 20.0 * (path[g + 1][e] - path[g][e]);
                    cfem_page_tick();
                }
        }
        const double each = (now() - begin) / (double)ticks;
        if (each < best) best = each;
    }
    return printf("%.1f\n", best) < 0;
}
