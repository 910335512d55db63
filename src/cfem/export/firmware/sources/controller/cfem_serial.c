/* Modules in a row, each known by the same model of its end with its orientation. Without external load nothing passes from
 * module to module but the place where the next one begins: W_aa is of blocks, and the tip is a product of rigid motions. With
 * R_i, p_i the frame in which module i ends, g and w what its end moves and turns by (its rotation vector's rate made a spin
 * by the left Jacobian of SO(3)), the tip y moves by g + w x (y - p_i). */
#include "cfem_linear.h"
#include "cfem_parts.h"

#if CFEM_SERIAL

#define K CFEM_MODULES
#define N CFEM_SERIES_NA
#define MOST CFEM_MOST_SERIES_NA

/* out = 1 + first [v] + second [v]^2, [v] x = v x x. */
static void in_spins(const double v[3], double first, double second, double out[3][3]) {
    const double square = cfem_dot(3, v, v);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) out[i][j] = second * v[i] * v[j];
    for (int i = 0; i < 3; i++) out[i][i] += 1.0 - second * square;
    out[2][1] += first * v[0], out[1][2] -= first * v[0];
    out[0][2] += first * v[1], out[2][0] -= first * v[1];
    out[1][0] += first * v[2], out[0][1] -= first * v[2];
}

/* turn = exp [phi]; jacobian: exp [phi + d] = exp [jacobian d] exp [phi] to first order. */
static void rotate(const double phi[3], double turn[3][3], double jacobian[3][3]) {
    const double s = cfem_dot(3, phi, phi), t = sqrt(s);
    const int small = s < 1e-4;
    const double a = small ? 1.0 / 2 - s / 24 + s * s / 720 : (1.0 - cos(t)) / s;          /* (1 - cos t) / t^2 */
    const double b = small ? 1.0 / 6 - s / 120 + s * s / 5040 : (t - sin(t)) / (s * t);    /* (t - sin t) / t^3 */
    in_spins(phi, a, b, jacobian);
    in_spins(phi, 1.0 - b * s, a, turn);
}

unsigned cfem_serial(const double s[CFEM_MOST_NA], cfem_condensed *m) {
    double frame[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, end[CFEM_MOST_MODULES + 1][3] = {{0}};
    double moves[CFEM_MOST_MODULES][MOST][3], turns[CFEM_MOST_MODULES][MOST][3]; /* the end of each module by its s, in the frame of the trunk */
    unsigned status = 0;
    for (int i = 0; i < CFEM_NA; i++)
        for (int j = 0; j < CFEM_NA; j++) m->W_aa[i][j] = 0.0;
    for (int k = 0; k < K; k++) {
        cfem_parts part;
        double turn[3][3], jacobian[3][3], to_spin[3][3], next[3][3];
        const int first = k * N;
        cfem_spectral(s + first, &part);
        for (int i = 0; i < N; i++)
            m->delta_a[first + i] = s[first + i], m->lambda_a[first + i] = part.gradient[i] / cfem_softer[k];
        if (cfem_invert(N, MOST, &part.hessian[0][0])) status = CFEM_NO_MODEL;
        for (int i = 0; i < N; i++)
            for (int j = 0; j < N; j++) m->W_aa[first + i][first + j] = cfem_softer[k] * part.hessian[i][j];
        rotate(part.effector + 3, turn, jacobian);
        cfem_multiply(frame, jacobian, to_spin);
        for (int e = 0; e < 3; e++) {
            end[k + 1][e] = end[k][e];
            for (int f = 0; f < 3; f++) end[k + 1][e] += frame[e][f] * (cfem_module_rest[f] + part.effector[f]);
            for (int j = 0; j < N; j++) {
                moves[k][j][e] = turns[k][j][e] = 0.0;
                for (int f = 0; f < 3; f++) {
                    moves[k][j][e] += frame[e][f] * part.effector_gradient[f][j];
                    turns[k][j][e] += to_spin[e][f] * part.effector_gradient[3 + f][j];
                }
            }
        }
        cfem_multiply(frame, turn, next);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) frame[i][j] = next[i][j];
    }
    for (int k = 0; k < K; k++) {
        double arm[3], slope[3][MOST];
        const int first = k * N;
        for (int e = 0; e < 3; e++) arm[e] = end[K][e] - end[k + 1][e];
        for (int j = 0; j < N; j++) {
            const double *w = turns[k][j];
            for (int e = 0; e < 3; e++)
                slope[e][j] = moves[k][j][e] + w[(e + 1) % 3] * arm[(e + 2) % 3] - w[(e + 2) % 3] * arm[(e + 1) % 3];
        }
        for (int e = 0; e < 3; e++)
            for (int j = 0; j < N; j++) m->W_ea[e][first + j] = cfem_dot(N, slope[e], m->W_aa[first + j] + first);
        for (int i = first; i < first + N; i++)
            m->free_a[i] = m->delta_a[i] - cfem_dot(N, m->W_aa[i] + first, m->lambda_a + first);
    }
    for (int e = 0; e < 3; e++)
        m->free_e[e] = end[K][e] - cfem_rest_e[e] - cfem_dot(CFEM_NA, m->W_ea[e], m->lambda_a);
    return status;
}

#endif
