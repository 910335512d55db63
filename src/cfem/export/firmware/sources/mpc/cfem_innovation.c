/* The observer's update: innovation of a sample, its covariance, the gain, and the corrected state. */
#include "cfem_innovation.h"

#include "cfem_linear.h"

#define NQ CFEM_MOTION_NQ
#define NE CFEM_MOTION_NE
#define NZ CFEM_MPC_NZ
#define NX CFEM_MPC_NX
#define MATERIAL NZ
#define OFFSET (NZ + 2)
#define ACROSS CFEM_MPC_COLUMNS
#define MOST_NQ CFEM_MOTION_MOST_NQ
#define FROZEN 3.0 /* of the noise: motion during which a sensor does not repeat itself */

/* exp(x) for |x| <= 4 times a standard deviation, without libm: halved until small, squared back. */
static double exponential(double x) {
    double sum = 1.0, term = 1.0;
    int squared = 0;
    while (fabs(x) > 0.03125 && squared < 12) x /= 2.0, squared++;
    for (int k = 1; k < 12; k++) term *= x / k, sum += term;
    while (squared--) sum *= sum;
    return sum;
}

int cfem_innovation_of(cfem_mpc *m, const double *x_e, cfem_innovation *of) {
    double e[CFEM_MOTION_MOST_NE], C[CFEM_MOTION_MOST_NE][MOST_NQ], (*HP)[ACROSS] = m->work.moved;
    cfem_tips(m->state.z, &m->near.inner, &m->near.inner, e, C);
    of->n = 0, of->square = of->size = 0.0;
    for (int k = 0; k < NE; k++)
        if (cfem_mpc_weight[k] > 0.0) of->row[of->n++] = k;
    for (int k = 0; k < of->n; k++) {
        const int row = of->row[k];
        of->missed[k] = x_e[row] - cfem_rest_e[row] - e[row] - m->offset[row];
        of->size += of->missed[k] * of->missed[k];
        for (int j = 0; j < NX; j++) {
            HP[k][j] = m->covariance[OFFSET + row][j];
            for (int i = 0; i < NQ; i++) HP[k][j] += C[row][i] * m->covariance[i][j];
        }
    }
    for (int k = 0; k < of->n; k++)
        for (int l = 0; l < of->n; l++)
            of->S[k][l] = cfem_dot(NQ, C[of->row[l]], HP[k]) + HP[k][OFFSET + of->row[l]] + (k == l ? CFEM_MPC_DOUBT_NOISE * CFEM_MPC_DOUBT_NOISE : 0.0);
    of->size /= of->n;
    if (cfem_invert(of->n, CFEM_MOTION_MOST_NE, of->S[0])) return 1;
    for (int k = 0; k < of->n; k++) of->square += of->missed[k] * cfem_dot(of->n, of->S[k], of->missed);
    return !(of->square >= 0.0);
}

int cfem_frozen(cfem_mpc *m, const double *x_e, const cfem_innovation *of) {
    double square = 0.0;
    int repeated = 1;
    for (int k = 0; k < of->n; k++) repeated = repeated && x_e[of->row[k]] == m->sample[of->row[k]];
    for (int k = 0; k < of->n; k++) {
        const int row = of->row[k];
        const double expected = x_e[row] - of->missed[k];
        if (!repeated) m->sample[row] = x_e[row], m->expected[row] = expected;
        const double moved = expected - m->expected[row];
        m->expected[row] += moved / CFEM_GATE_MEMORY;
        square += moved * moved / of->n;
    }
    return sqrt(square) > FROZEN * CFEM_MPC_DOUBT_NOISE;
}

void cfem_correct(cfem_mpc *m, const cfem_innovation *of) {
    static const double share[2] = {CFEM_MPC_DOUBT_STIFFNESS, CFEM_MPC_DOUBT_VISCOSITY};
    double (*HP)[ACROSS] = m->work.moved, (*gain)[ACROSS] = m->work.moved + NE, change[ACROSS]; /* (n, NX), gain transposed */
    const int n = of->n;
    for (int i = 0; i < NX; i++) {
        change[i] = 0.0;
        for (int k = 0; k < n; k++) {
            gain[k][i] = 0.0;
            for (int l = 0; l < n; l++) gain[k][i] += of->S[k][l] * HP[l][i];
            change[i] += gain[k][i] * of->missed[k];
        }
    }
    for (int i = 0; i < NX; i++) /* what is known now: symmetric, gain S gain^T less */
        for (int j = i; j < NX; j++) {
            double less = 0.0;
            for (int k = 0; k < n; k++) less += gain[k][i] * HP[k][j] + gain[k][j] * HP[k][i];
            m->covariance[i][j] = m->covariance[j][i] = (m->covariance[i][j] + m->covariance[j][i] - less) / 2;
        }
    for (int i = 0; i < NZ; i++) m->state.z[i] += change[i];
    for (int k = 0; k < 2; k++) {
        const double largest = 4.0 * share[k];
        m->logarithm[k] = fmin(fmax(m->logarithm[k] + change[MATERIAL + k], -largest), largest);
    }
    m->material.stiffness = exponential(m->logarithm[0]), m->material.viscosity = exponential(m->logarithm[1]);
    for (int k = 0; k < NE; k++) m->offset[k] += change[OFFSET + k];
}
