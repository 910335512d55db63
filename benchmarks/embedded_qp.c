/* The same inverse steps on an emulated Cortex-M7 by OSQP's generated code (-DOSQP) and by the active set of the C export:
 * instructions, and the answers. See embedded.py. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "problems.h"
#ifdef OSQP
#include "osqp.h"
#include "workspace.h"
#else
#include "cfem_qp.h"
#endif

#define TIMER ((volatile uint32_t *)0x40000000u) /* counts down once in 40 instructions under -icount shift=0 */

static uint32_t cost[PROBLEMS];

static int by_size(const void *a, const void *b) {
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

int main(void) {
    TIMER[1] = TIMER[2] = 0xffffffffu, TIMER[0] = 1u;
    for (int i = 0; i < PROBLEMS; i++) {
#ifdef OSQP
        double u[4]; /* open bounds as OSQP wants them: it never stops on infinite ones */
        for (int k = 0; k < 4; k++) u[k] = fmin(problems[i].u[k], 1e30);
        const uint32_t begin = TIMER[1];
        osqp_update_data_mat(&solver, (double *)problems[i].P, 0, 3, (double *)problems[i].G, 0, 8);
        osqp_update_data_vec(&solver, (double *)problems[i].q, (double *)problems[i].l, u);
        osqp_solve(&solver);
        const double *x = solver.solution->x;
        const int iterations = (int)solver.info->iter;
#else
        cfem_qp_answer answer;
        const uint32_t begin = TIMER[1];
        cfem_qp(2, 2, problems[i].M, problems[i].d, 2, problems[i].A, 2, problems[i].l, problems[i].u, &answer);
        const double *x = answer.x;
        const int iterations = answer.iterations;
#endif
        cost[i] = (begin - TIMER[1]) * 40;
        printf("x %.17g %.17g %d\n", x[0], x[1], iterations);
    }
    qsort(cost, PROBLEMS, sizeof *cost, by_size);
    printf("cost %u %u\n", (unsigned)cost[PROBLEMS / 2], (unsigned)cost[PROBLEMS - 1]);
    return 0;
}
