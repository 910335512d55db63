/* From what the surrogate gives to W and delta_free:
 *
 *     form          W_aa           W_ea             W_ee
 *     displacement  (hess Psi)^-1  (grad e) W_aa    C + (grad e) W_aa (grad e)^T
 *     force         hess Psi*      grad e           C
 *
 * and delta_free = delta - W[:, a] lambda_a. A network of the entries gives them as they are. */
#include "cfem_linear.h"
#include "cfem_parts.h"

#define MOST CFEM_MOST_NA

#if CFEM_SPECTRAL || CFEM_MLP
static int positive_definite(double W[MOST][MOST]) {
    double copy[MOST][MOST];
    for (int i = 0; i < CFEM_NA; i++)
        for (int j = i; j < CFEM_NA; j++) copy[i][j] = W[i][j];
    return cfem_invert(CFEM_NA, MOST, &copy[0][0]) == 0;
}
#endif

#if CFEM_FULL && CFEM_SEMIDEFINITE
/* Raises the eigenvalues of the locked compliance in W_ee to CFEM_FLOOR, in units of cfem_sizes: the nearest semidefinite matrix
 * (Higham 1988). moved: W_ea W_aa^-1 W_ae, or none. */
#define CFEM_FLOOR 1e-12
static void make_semidefinite(double W_ee[CFEM_MOST_NE][CFEM_MOST_NE], double moved[CFEM_MOST_NE][CFEM_MOST_NE]) {
    const int n = CFEM_NE;
    double A[CFEM_MOST_NE][CFEM_MOST_NE], V[CFEM_MOST_NE][CFEM_MOST_NE];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) A[i][j] = (W_ee[i][j] - moved[i][j]) / (cfem_sizes[i] * cfem_sizes[j]);
    cfem_jacobi(n, CFEM_MOST_NE, A[0], V[0]);
    for (int k = 0; k < n; k++) {
        if (!(A[k][k] < CFEM_FLOOR)) continue;
        for (int i = 0; i < n; i++)
            for (int j = 0; j < n; j++)
                W_ee[i][j] += (CFEM_FLOOR - A[k][k]) * V[i][k] * V[j][k] * cfem_sizes[i] * cfem_sizes[j];
    }
}

/* The same where W_ee and W_aa are there and the part that the actuators give must be found. */
static void make_whole_semidefinite(cfem_condensed *m) {
    double K[MOST][MOST], G[CFEM_MOST_NE][MOST], moved[CFEM_MOST_NE][CFEM_MOST_NE];
    for (int i = 0; i < CFEM_NA; i++)
        for (int j = 0; j < CFEM_NA; j++) K[i][j] = m->W_aa[i][j];
    if (cfem_invert(CFEM_NA, MOST, &K[0][0])) return;
    for (int e = 0; e < CFEM_NE; e++)
        for (int j = 0; j < CFEM_NA; j++) G[e][j] = cfem_dot(CFEM_NA, m->W_ea[e], K[j]);
    for (int e = 0; e < CFEM_NE; e++)
        for (int f = 0; f < CFEM_NE; f++) moved[e][f] = cfem_dot(CFEM_NA, G[e], m->W_ea[f]);
    make_semidefinite(m->W_ee, moved);
}
#endif

#if CFEM_SPECTRAL
static unsigned of_series(const double *s, cfem_condensed *m) {
    const int n_a = CFEM_SERIES_NA, n_e = CFEM_SERIES_NE; /* CFEM_NA and CFEM_NE */
    cfem_parts part;
    unsigned status = 0;
    cfem_spectral(s, &part);
    for (int i = 0; i < n_a; i++)
        for (int j = 0; j < n_a; j++) m->W_aa[i][j] = part.hessian[i][j];
    if (CFEM_FORM_DISPLACEMENT) {
        for (int i = 0; i < n_a; i++) m->delta_a[i] = s[i], m->lambda_a[i] = part.gradient[i];
        if (cfem_invert(n_a, MOST, &m->W_aa[0][0])) status = CFEM_NO_MODEL;
        for (int e = 0; e < n_e; e++)
            for (int j = 0; j < n_a; j++) m->W_ea[e][j] = cfem_dot(n_a, part.effector_gradient[e], m->W_aa[j]);
    } else {
        for (int i = 0; i < n_a; i++) m->delta_a[i] = part.gradient[i], m->lambda_a[i] = s[i];
        if (!positive_definite(m->W_aa)) status = CFEM_NO_MODEL;
        for (int e = 0; e < n_e; e++)
            for (int j = 0; j < n_a; j++) m->W_ea[e][j] = part.effector_gradient[e][j];
    }
    for (int i = 0; i < n_a; i++) m->free_a[i] = m->delta_a[i] - cfem_dot(n_a, m->W_aa[i], m->lambda_a);
    for (int e = 0; e < n_e; e++) m->free_e[e] = part.effector[e] - cfem_dot(n_a, m->W_ea[e], m->lambda_a);
#if CFEM_FULL
    m->energy = part.energy;
#if CFEM_SEMIDEFINITE
    if (CFEM_FORM_DISPLACEMENT) {
        double none[CFEM_MOST_NE][CFEM_MOST_NE] = {{0}};
        make_semidefinite(part.compliance, none);
    }
#endif
    for (int e = 0; e < n_e; e++)
        for (int f = 0; f < n_e; f++) {
            m->W_ee[e][f] = part.compliance[e][f];
            if (CFEM_FORM_DISPLACEMENT) m->W_ee[e][f] += cfem_dot(n_a, m->W_ea[e], part.effector_gradient[f]);
        }
#if CFEM_SEMIDEFINITE
    if (!CFEM_FORM_DISPLACEMENT) make_whole_semidefinite(m);
#endif
#endif
    return status;
}
#endif

#if CFEM_MLP
static unsigned of_entries(const double *s, cfem_condensed *m) {
    cfem_real out[CFEM_MOST_MLP_OUTPUTS];
    const cfem_real *next = out;
    cfem_mlp(s, out);
    for (int i = 0; i < CFEM_NA; i++)
        for (int j = i; j < CFEM_NA; j++) m->W_aa[i][j] = m->W_aa[j][i] = (double)*next++;
    for (int e = 0; e < CFEM_NE; e++)
        for (int j = 0; j < CFEM_NA; j++) m->W_ea[e][j] = (double)*next++;
    for (int i = 0; i < CFEM_NA; i++) m->free_a[i] = (double)*next++;
    for (int e = 0; e < CFEM_NE; e++) m->free_e[e] = (double)*next++;
#if CFEM_FULL
    m->energy = 0.0;
    for (int e = 0; e < CFEM_NE; e++)
        for (int f = e; f < CFEM_NE; f++) m->W_ee[e][f] = m->W_ee[f][e] = (double)*next++;
#if CFEM_SEMIDEFINITE
    make_whole_semidefinite(m);
#endif
#endif
    if (!CFEM_FORM_DISPLACEMENT) {
        for (int i = 0; i < CFEM_NA; i++)
            m->lambda_a[i] = s[i], m->delta_a[i] = m->free_a[i] + cfem_dot(CFEM_NA, m->W_aa[i], s);
        return positive_definite(m->W_aa) ? 0u : CFEM_NO_MODEL;
    }
    double K[MOST][MOST];
    for (int i = 0; i < CFEM_NA; i++)
        for (int j = 0; j < CFEM_NA; j++) K[i][j] = m->W_aa[i][j];
    const unsigned status = cfem_invert(CFEM_NA, MOST, &K[0][0]) ? CFEM_NO_MODEL : 0u;
    for (int i = 0; i < CFEM_NA; i++) {
        m->delta_a[i] = s[i], m->lambda_a[i] = 0.0;
        for (int j = 0; j < CFEM_NA; j++) m->lambda_a[i] += K[i][j] * (s[j] - m->free_a[j]);
    }
    return status;
}
#endif

unsigned cfem_model(const double s[MOST], cfem_condensed *m) {
#if CFEM_ROW
    if (CFEM_KIND == CFEM_KIND_ROW) return cfem_row(s, m);
#endif
#if CFEM_SERIAL
    if (CFEM_KIND == CFEM_KIND_SERIAL) return cfem_serial(s, m);
#endif
#if CFEM_MLP
    if (CFEM_KIND == CFEM_KIND_MLP) return of_entries(s, m);
#endif
#if CFEM_SPECTRAL
    return of_series(s, m);
#else
    (void)s, (void)m;
    return CFEM_NO_MODEL;
#endif
}

/* W_aa is d delta_a / d lambda_a. */
unsigned cfem_find(const double *wanted, double *s, cfem_condensed *m) {
    double scale = 0.0;
    for (int i = 0; i < CFEM_NA; i++) {
        const double known = CFEM_FORM_DISPLACEMENT ? cfem_domain_lambda_a[1][i] : cfem_domain_delta_a[1][i];
        if (fabs(known) > scale) scale = fabs(known);
    }
    for (int round = 0;; round++) {
        double missing[MOST], worst = 0.0;
        const unsigned status = cfem_model(s, m);
        if (status) return status;
        for (int i = 0; i < CFEM_NA; i++) {
            missing[i] = wanted[i] - (CFEM_FORM_DISPLACEMENT ? m->lambda_a[i] : m->delta_a[i]);
            if (!(fabs(missing[i]) <= worst)) worst = fabs(missing[i]);
        }
        if (worst <= CFEM_OBSERVER_TOLERANCE * scale) return CFEM_OK;
        if (round == CFEM_OBSERVER_ITERATIONS) return CFEM_NOT_FOUND;
        double K[MOST][MOST];
        for (int i = 0; i < CFEM_NA; i++)
            for (int j = 0; j < CFEM_NA; j++) K[i][j] = m->W_aa[i][j];
        if (!CFEM_FORM_DISPLACEMENT && cfem_invert(CFEM_NA, MOST, &K[0][0])) return CFEM_NO_MODEL;
        for (int i = 0; i < CFEM_NA; i++) s[i] += cfem_dot(CFEM_NA, K[i], missing);
    }
}
