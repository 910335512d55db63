/* One model of a module under wrenches w on its pose, actuators held: with u = w . C w / 2, v = D[w, w, w] / 6 and
 * h(r) = 1 / (1 - r), a Pade approximant along w,
 *
 *     Psi_w = Psi - w . e - u h(v / u)        e_w = -d Psi_w / dw        C_w = d e_w / dw */
#include "cfem_row.h"

#if CFEM_ROW

#include "cfem_linear.h"

#define P CFEM_POSE
#define NEAR 0.5   /* share of the load that would buckle: beyond it h goes on as a parabola */
#define STIFF -2.0 /* and below it */
#define TINY 1e-30 /* N mm: what C w works less than is rounding */
#define CHANGES CFEM_ROW_CHANGES
#define PACKED (P * (P + 1) / 2)
#define MOST CFEM_MODULE_NA

/* A term of the basis, and its first and (packed) second derivatives by z. */
static void term(const cfem_held *held, int m, double *out) {
    const int n = held->model->n_a;
    const uint8_t *const degree = held->model->degrees + m * n;
    double *next = out + 1 + n;
    out[0] = 1.0;
    for (int k = 0; k < n; k++) out[0] *= held->polynomials[0][k][degree[k]];
    for (int i = 0; i < n; i++) {
        out[1 + i] = 1.0;
        for (int k = 0; k < n; k++) out[1 + i] *= held->polynomials[k == i][k][degree[k]];
        for (int j = i; j < n; j++, next++) {
            *next = 1.0;
            for (int k = 0; k < n; k++) *next *= held->polynomials[(k == i) + (k == j)][k][degree[k]];
        }
    }
}

/* The coefficients of a series for term m, whose next term is number *at; NULL where it has none. */
static const cfem_real *of_term(const cfem_terms *series, int size, int m, int *at) {
    if (*at == series->terms || series->term[*at] != m) return 0;
    return series->coefficients + size * (*at)++;
}

/* First derivatives by z to those by s, in place. */
static void first_by_s(const cfem_module *model, double *first) {
    const int n = model->n_a;
    double by_z[MOST];
    for (int i = 0; i < n; i++) by_z[i] = first[i];
    for (int i = 0; i < n; i++) {
        first[i] = 0.0;
        for (int k = 0; k < n; k++) first[i] += by_z[k] * model->to_box[k * n + i];
    }
}

/* The same of (packed) second derivatives. */
static void second_by_s(const cfem_module *model, double *second) {
    const int n = model->n_a;
    double by_z[MOST][MOST], *next = second;
    for (int i = 0; i < n; i++)
        for (int j = i; j < n; j++) by_z[i][j] = by_z[j][i] = *next++;
    next = second;
    for (int i = 0; i < n; i++)
        for (int j = i; j < n; j++, next++) {
            *next = 0.0;
            for (int k = 0; k < n; k++)
                for (int l = 0; l < n; l++) *next += model->to_box[k * n + i] * by_z[k][l] * model->to_box[l * n + j];
        }
}

void cfem_module_at(const cfem_module *model, const double *s, cfem_held *held) {
    const int n = model->n_a;
    double packed[PACKED] = {0};
    int of_e = 0, of_C = 0, of_D = 0;
    held->model = model;
    for (int i = 0; i < n; i++) {
        double z = model->offset[i];
        double *const t = held->polynomials[0][i], *const first = held->polynomials[1][i], *const second = held->polynomials[2][i];
        for (int j = 0; j < n; j++) z += model->to_box[i * n + j] * s[j];
        t[0] = 1.0, t[1] = z, first[0] = 0.0, first[1] = 1.0, second[0] = second[1] = 0.0;
        for (int k = 2; k <= model->degree; k++) {
            t[k] = 2.0 * z * t[k - 1] - t[k - 2];
            first[k] = 2.0 * t[k - 1] + 2.0 * z * first[k - 1] - first[k - 2];
            second[k] = 4.0 * first[k - 1] + 2.0 * z * second[k - 1] - second[k - 2];
        }
    }
    for (int r = 0; r < P; r++) held->pose[r] = 0.0;
    for (int i = 0; i < CHANGES; i++) held->D[i] = 0.0;
    for (int m = 0; m < model->terms; m++) {
        const cfem_real *const e = of_term(&model->effector, P, m, &of_e), *const C = of_term(&model->compliance, PACKED, m, &of_C);
        const cfem_real *const D = of_term(&model->change, CHANGES, m, &of_D);
        double by = 1.0;
        for (int k = 0; k < n; k++) by *= held->polynomials[0][k][model->degrees[m * n + k]];
        for (int r = 0; e && r < P; r++) held->pose[r] += (double)e[r] * by;
        for (int i = 0; C && i < PACKED; i++) packed[i] += (double)C[i] * by;
        for (int i = 0; D && i < CHANGES; i++) held->D[i] += (double)D[i] * by;
    }
    for (int i = 0, next = 0; i < P; i++)
        for (int j = i; j < P; j++, next++) held->C[i][j] = held->C[j][i] = packed[next];
}

/* f = u h(v / u): derivatives f[2] by u and v, F[3] the second: uu, uv, vv. The ratio v / u. */
static double softened(double u, double v, double f[2], double F[3]) {
    const double r = v / u, near = r < STIFF ? STIFF : r > NEAR ? NEAR : r, s = 1.0 / (1.0 - near), more = r - near;
    const double h2 = 2.0 * s * s * s, h1 = s * s + more * h2, h = s + more * (s * s + more * h2 / 2.0);
    f[0] = h - r * h1, f[1] = h1;
    F[0] = r * r * h2 / u, F[1] = -r * h2 / u, F[2] = h2 / u;
    return r;
}

void cfem_module_under(const cfem_held *held, const double w[P], cfem_carried *out) {
    double Cw[P], b[P] = {0}, Dw[P][P] = {{0}}, f[2], F[3], u, v;
    for (int i = 0; i < P; i++) Cw[i] = cfem_dot(P, held->C[i], w);
    u = cfem_dot(P, Cw, w) / 2.0;
    out->ratio = 0.0;
    if (held->model->change.terms == 0 || !(u > TINY)) {
        for (int i = 0; i < P; i++) {
            out->pose[i] = held->pose[i] + Cw[i];
            for (int j = 0; j < P; j++) out->C[i][j] = held->C[i][j];
        }
        return;
    }
    const double *d = held->D;
    for (int i = 0; i < P; i++)
        for (int j = i; j < P; j++)
            for (int k = j; k < P; k++, d++) {
                Dw[i][j] += *d * w[k];
                if (k != j) Dw[i][k] += *d * w[j];
                if (j != i) Dw[j][k] += *d * w[i];
            }
    for (int i = 0; i < P; i++)
        for (int j = 0; j < i; j++) Dw[i][j] = Dw[j][i];
    for (int i = 0; i < P; i++) b[i] = cfem_dot(P, Dw[i], w) / 2.0;
    v = cfem_dot(P, b, w) / 3.0;
    out->ratio = softened(u, v, f, F);
    for (int i = 0; i < P; i++) {
        out->pose[i] = held->pose[i] + f[0] * Cw[i] + f[1] * b[i];
        for (int j = 0; j < P; j++)
            out->C[i][j] = f[0] * held->C[i][j] + f[1] * Dw[i][j] + F[0] * Cw[i] * Cw[j] +
                           F[1] * (Cw[i] * b[j] + b[i] * Cw[j]) + F[2] * b[i] * b[j];
    }
}

/* out (P,) = M w of a packed symmetric M. */
static void by_matrix(const cfem_real *M, const double *w, double *out) {
    for (int i = 0; i < P; i++) out[i] = 0.0;
    for (int i = 0; i < P; i++)
        for (int j = i; j < P; j++, M++) {
            out[i] += (double)*M * w[j];
            if (j != i) out[j] += (double)*M * w[i];
        }
}

/* out (P,) = M[w, w] / 2 of a packed symmetric tensor M. */
static void by_tensor(const cfem_real *M, const double *w, double *out) {
    for (int i = 0; i < P; i++) out[i] = 0.0;
    for (int i = 0; i < P; i++)
        for (int j = i; j < P; j++)
            for (int k = j; k < P; k++, M++) {
                const double c = (double)*M;
                out[i] += j == k ? c * w[j] * w[k] / 2.0 : c * w[j] * w[k];
                if (j != i) out[j] += c * w[i] * w[k];
                if (k != j) out[k] += i == j ? c * w[i] * w[j] / 2.0 : c * w[i] * w[j];
            }
}

void cfem_module_slopes(const cfem_held *held, const double w[P], double *lambda, double *stiffness, double slope[P][MOST]) {
    const cfem_module *const model = held->model;
    const int n = model->n_a, all = 1 + n + n * (n + 1) / 2, sizes[4] = {1, P, PACKED, CHANGES};
    const cfem_terms *const parts[4] = {&model->potential, &model->effector, &model->compliance, &model->change};
    int at[4] = {0};
    double work[4][1 + MOST + CFEM_ROW_PAIRS] = {{0}}; /* Psi, w . e, u, v: values and derivatives */
    double way[4][P] = {{0}}, turns[4][P][MOST] = {{{0}}}; /* of e, C w and D[w, w] / 2 */
    double f[2] = {1.0, 0.0}, F[3] = {0.0, 0.0, 0.0};
    for (int m = 0; m < model->terms; m++) {
        double by[1 + MOST + CFEM_ROW_PAIRS];
        term(held, m, by);
        for (int part = 0; part < 4; part++) {
            const cfem_real *const c = of_term(parts[part], sizes[part], m, &at[part]);
            double moved[P], share;
            if (!c) continue;
            if (part == 2) by_matrix(c, w, moved);
            else if (part == 3) by_tensor(c, w, moved);
            else
                for (int r = 0; r < P; r++) moved[r] = part ? (double)c[r] : 0.0;
            share = part ? cfem_dot(P, moved, w) / part : (double)*c;
            for (int i = 0; i < all; i++) work[part][i] += share * by[i];
            for (int r = 0; part && r < P; r++) {
                way[part][r] += moved[r] * by[0];
                for (int i = 0; i < n; i++) turns[part][r][i] += moved[r] * by[1 + i];
            }
        }
    }
    for (int part = 0; part < 4; part++) {
        first_by_s(model, work[part] + 1);
        second_by_s(model, work[part] + 1 + n);
        for (int r = 0; r < P; r++) first_by_s(model, turns[part][r]);
    }
    const double *const psi = work[0], *const we = work[1], *const u = work[2], *const v = work[3];
    if (model->change.terms && u[0] > TINY) softened(u[0], v[0], f, F);
    for (int i = 0, next = 1 + n; i < n; i++) {
        lambda[i] = psi[1 + i] - we[1 + i] - f[0] * u[1 + i] - f[1] * v[1 + i];
        for (int j = i; j < n; j++, next++)
            *stiffness++ = psi[next] - we[next] - f[0] * u[next] - f[1] * v[next] - F[0] * u[1 + i] * u[1 + j] -
                           F[1] * (u[1 + i] * v[1 + j] + v[1 + i] * u[1 + j]) - F[2] * v[1 + i] * v[1 + j];
        for (int r = 0; r < P; r++)
            slope[r][i] = turns[1][r][i] + f[0] * turns[2][r][i] + f[1] * turns[3][r][i] +
                          way[2][r] * (F[0] * u[1 + i] + F[1] * v[1 + i]) + way[3][r] * (F[1] * u[1 + i] + F[2] * v[1 + i]);
    }
}

#endif
