/* From what the surrogate gives to W and delta_free:
 *
 *     form          W_aa           W_ea             W_ee
 *     displacement  (hess Psi)^-1  (grad e) W_aa    C + (grad e) W_aa (grad e)^T
 *     force         hess Psi*      grad e           C
 *
 * and delta_free = delta - W[:, a] lambda_a. A network of the entries gives them as they are. */
#include "cfem_linear.h"
#include "cfem_parts.h"

#if !CFEM_FORM_DISPLACEMENT
static int positive_definite(double W[CFEM_NA][CFEM_NA]) {
    double copy[CFEM_NA][CFEM_NA];
    for (int i = 0; i < CFEM_NA; i++)
        for (int j = 0; j < CFEM_NA; j++) copy[i][j] = W[i][j];
    return cfem_invert(CFEM_NA, &copy[0][0]) == 0;
}
#endif

#if CFEM_SPECTRAL && !CFEM_SERIAL

unsigned cfem_model(const double s[CFEM_NA], cfem_condensed *m) {
    cfem_parts part;
    unsigned status = 0;
    cfem_spectral(s, &part);
    for (int i = 0; i < CFEM_NA; i++)
        for (int j = 0; j < CFEM_NA; j++) m->W_aa[i][j] = part.hessian[i][j];
#if CFEM_FORM_DISPLACEMENT
    for (int i = 0; i < CFEM_NA; i++) m->delta_a[i] = s[i], m->lambda_a[i] = part.gradient[i];
    if (cfem_invert(CFEM_NA, &m->W_aa[0][0])) status = CFEM_NO_MODEL;
    for (int e = 0; e < CFEM_NE; e++)
        for (int j = 0; j < CFEM_NA; j++) m->W_ea[e][j] = cfem_dot(CFEM_NA, part.effector_gradient[e], m->W_aa[j]);
#else
    for (int i = 0; i < CFEM_NA; i++) m->delta_a[i] = part.gradient[i], m->lambda_a[i] = s[i];
    if (!positive_definite(m->W_aa)) status = CFEM_NO_MODEL;
    for (int e = 0; e < CFEM_NE; e++)
        for (int j = 0; j < CFEM_NA; j++) m->W_ea[e][j] = part.effector_gradient[e][j];
#endif
    for (int i = 0; i < CFEM_NA; i++) m->free_a[i] = m->delta_a[i] - cfem_dot(CFEM_NA, m->W_aa[i], m->lambda_a);
    for (int e = 0; e < CFEM_NE; e++) m->free_e[e] = part.effector[e] - cfem_dot(CFEM_NA, m->W_ea[e], m->lambda_a);
#if CFEM_FULL
    m->energy = part.energy;
    for (int e = 0; e < CFEM_NE; e++)
        for (int f = 0; f < CFEM_NE; f++) {
            m->W_ee[e][f] = part.compliance[e][f];
#if CFEM_FORM_DISPLACEMENT
            m->W_ee[e][f] += cfem_dot(CFEM_NA, m->W_ea[e], part.effector_gradient[f]);
#endif
        }
#endif
    return status;
}

#elif CFEM_MLP

unsigned cfem_model(const double s[CFEM_NA], cfem_condensed *m) {
    cfem_real out[CFEM_MLP_OUTPUTS];
    const cfem_real *next = out;
    double K[CFEM_NA][CFEM_NA];
    cfem_mlp(s, out);
    for (int i = 0; i < CFEM_NA; i++)
        for (int j = i; j < CFEM_NA; j++) K[i][j] = K[j][i] = m->W_aa[i][j] = m->W_aa[j][i] = (double)*next++;
    for (int e = 0; e < CFEM_NE; e++)
        for (int j = 0; j < CFEM_NA; j++) m->W_ea[e][j] = (double)*next++;
    for (int i = 0; i < CFEM_NA; i++) m->free_a[i] = (double)*next++;
    for (int e = 0; e < CFEM_NE; e++) m->free_e[e] = (double)*next++;
#if CFEM_FULL
    m->energy = 0.0;
    for (int e = 0; e < CFEM_NE; e++)
        for (int f = e; f < CFEM_NE; f++) m->W_ee[e][f] = m->W_ee[f][e] = (double)*next++;
#endif
#if CFEM_FORM_DISPLACEMENT
    const unsigned status = cfem_invert(CFEM_NA, &K[0][0]) ? CFEM_NO_MODEL : 0u;
    for (int i = 0; i < CFEM_NA; i++) {
        m->delta_a[i] = s[i], m->lambda_a[i] = 0.0;
        for (int j = 0; j < CFEM_NA; j++) m->lambda_a[i] += K[i][j] * (s[j] - m->free_a[j]);
    }
    return status;
#else
    for (int i = 0; i < CFEM_NA; i++)
        m->lambda_a[i] = s[i], m->delta_a[i] = m->free_a[i] + cfem_dot(CFEM_NA, m->W_aa[i], s);
    return positive_definite(K) ? 0u : CFEM_NO_MODEL;
#endif
}

#endif
