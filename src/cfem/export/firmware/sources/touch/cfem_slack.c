#include "cfem_slack.h"

#include "cfem_linear.h"

#define MOST CFEM_SLACK_MOST
#define NA CFEM_NA

enum { ITERATIONS = 20 };
static const double NONE = 1e-9; /* of the reach */

/* none: N, a cable that pushes by less does not. */
typedef struct {
    int n;
    cfem_held_step step;
    void *with;
    double *at, pull[MOST], none[MOST], K[MOST][MOST];
    unsigned char *slack;
} releasing;

/* K, the stiffness of the free robots. 0, or a status. */
static unsigned stiffness(releasing *of, const double *target) {
    cfem_condensed m;
    for (int i = 0; i < of->n * of->n; i++) of->K[i / of->n][i % of->n] = 0.0;
    for (int b = 0; b < of->n; b += NA) {
        if (cfem_model(target + b, &m) || cfem_invert(NA, CFEM_MOST_NA, &m.W_aa[0][0])) return CFEM_TOUCH_NO_MODEL;
        for (int i = 0; i < NA; i++) {
            for (int j = 0; j < NA; j++) of->K[b + i][b + j] = m.W_aa[i][j];
            of->none[b + i] = NONE * m.W_aa[i][i] * cfem_patch_reach[i];
        }
    }
    return 0;
}

/* To where slack actuators carry nothing, by Broyden's method. 0, or a status. */
static unsigned let_go(releasing *of) {
    double B[MOST][MOST], lam[MOST], way[MOST], across[MOST], back[MOST];
    int which[MOST], m = 0;
    for (int i = 0; i < of->n && m < MOST; i++) /* which says to compilers that m is no more */
        if (of->slack[i]) which[m++] = i;
    for (int i = 0; i < m * m; i++) B[i / m][i % m] = of->K[which[i / m]][which[i % m]];
    if (cfem_invert(m, MOST, &B[0][0])) return CFEM_TOUCH_NO_MODEL;
    for (int k = 0; k < ITERATIONS; k++) {
        int carry = 0;
        double size = 0.0;
        for (int i = 0; i < m; i++) lam[i] = of->pull[which[i]], carry |= fabs(lam[i]) > of->none[which[i]];
        if (!carry) return 0;
        for (int i = 0; i < m; i++) way[i] = -cfem_dot(m, B[i], lam), of->at[which[i]] += way[i];
        const unsigned status = of->step(of->with, of->at, of->pull);
        if (status) return status;
        for (int i = 0; i < m; i++) lam[i] = of->pull[which[i]] - lam[i];
        for (int i = 0; i < m; i++) {
            across[i] = cfem_dot(m, B[i], lam), back[i] = 0.0;
            for (int j = 0; j < m; j++) back[i] += way[j] * B[j][i];
            size += way[i] * across[i];
        }
        if (!(fabs(size) > 0.0)) break;
        for (int i = 0; i < m * m; i++) B[i / m][i % m] += (way[i / m] - across[i / m]) * back[i % m] / size;
    }
    return CFEM_TOUCH_ITERATIONS;
}

unsigned cfem_slack(int n, const double *target, const unsigned char *unilateral, cfem_held_step step, void *with, double *at,
                    unsigned char *slack) {
    releasing of = {n, step, with, at, {0.0}, {0.0}, {{0.0}}, slack};
    int any = 0;
    for (int i = 0; i < n; i++) at[i] = slack[i] ? fmax(at[i], target[i]) : target[i];
    unsigned status = step(with, at, of.pull);
    for (int i = 0; i < n; i++) any |= slack[i] || (unilateral[i] && of.pull[i] < 0.0);
    if (status || !any) return status;
    status = stiffness(&of, target);
    for (int k = 0; k < 2 * n + 1 && !status; k++) {
        int pushes = 0, taken_up = 0;
        status = let_go(&of);
        for (int i = 0; i < n && !status; i++) {
            const int was = slack[i];
            if (was && at[i] < target[i]) slack[i] = 0, at[i] = target[i], taken_up = 1;
            if (!was && unilateral[i] && of.pull[i] < -of.none[i]) slack[i] = 1, pushes = 1;
        }
        if (!status && !pushes && !taken_up) return 0;
        if (!status && taken_up) status = step(with, at, of.pull);
    }
    return status ? status : CFEM_TOUCH_ITERATIONS;
}
