/* One model of a module under wrenches w on its pose, actuators held: with u = w . C w / 2, v = D[w, w, w] / 6,
 * q = E[w, w, w, w] / 24 and h(r) = 1 / (1 - r), a Pade approximant along w,
 *
 *     Psi_w = Psi - w . e - u h(r)        e_w = -d Psi_w / dw        C_w = d e_w / dw
 *     r = v / u, and where E is known v / u + q / u - (v / u)^2 */
#include "cfem_row.h"

#if CFEM_ROW

#include "cfem_forms.h"

#include "cfem_chebyshev.h"
#include "cfem_linear.h"

#define P CFEM_ROW_EACH
#define POSE CFEM_POSE
#define NEAR 0.5   /* share of the load that would buckle: beyond it h goes on as a parabola */
#define STIFF -2.0 /* and below it */
#define TINY 1e-30 /* N mm: what C w works less than is rounding */
#define CHANGES CFEM_ROW_CHANGES
#define CURVATURES CFEM_ROW_CURVATURES
#define PACKED (P * (P + 1) / 2)
#define MOST CFEM_MODULE_NA

static cfem_box box_of(const cfem_module *model) {
    return (cfem_box){model->n_a, model->n_a, model->n_a, model->degree, MOST, CFEM_MODULE_DEGREE + 1, model->to_box, model->offset};
}

/* A term of the basis, and its first and (packed) second derivatives by z. */
static void term(const cfem_held *held, int m, double *out) {
    const cfem_box box = box_of(held->model);
    const double *const table = held->polynomials[0][0];
    const int n = box.n;
    const uint8_t *const degrees = held->model->degrees + m * n;
    double *next = out + 1 + n;
    out[0] = cfem_term(box, table, degrees, -1, -1);
    for (int i = 0; i < n; i++) {
        out[1 + i] = cfem_term(box, table, degrees, i, -1);
        for (int j = i; j < n; j++) *next++ = cfem_term(box, table, degrees, i, j);
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
    const cfem_box box = box_of(model);
    double packed[PACKED] = {0};
    int of_e = 0, of_C = 0, of_D = 0, of_E = 0;
    held->model = model;
    cfem_polynomials(box, s, 3, held->polynomials[0][0]);
    for (int r = 0; r < P; r++) held->pose[r] = 0.0;
    for (int i = 0; i < CHANGES; i++) held->D[i] = 0.0;
    for (int i = 0; i < CURVATURES; i++) held->E[i] = 0.0;
    for (int m = 0; m < model->terms; m++) {
        const cfem_real *const e = of_term(&model->effector, P, m, &of_e), *const C = of_term(&model->compliance, PACKED, m, &of_C);
        const cfem_real *const D = of_term(&model->change, CHANGES, m, &of_D);
        const cfem_real *const E = of_term(&model->curvature, CURVATURES, m, &of_E);
        const double by = cfem_term(box, held->polynomials[0][0], model->degrees + m * box.n, -1, -1);
        for (int r = 0; e && r < P; r++) held->pose[r] += (double)e[r] * by;
        for (int i = 0; C && i < PACKED; i++) packed[i] += (double)C[i] * by;
        for (int i = 0; D && i < CHANGES; i++) held->D[i] += (double)D[i] * by;
        for (int i = 0; E && i < CURVATURES; i++) held->E[i] += (double)E[i] * by;
    }
    for (int i = 0, next = 0; i < P; i++)
        for (int j = i; j < P; j++, next++) held->C[i][j] = held->C[j][i] = packed[next];
}

/* u h(r) of t = u, v and, where there are three terms, q: derivatives f and F by these. r. */
static double continued(int terms, const double *t, double f[3], double F[3][3]) {
    const double u = t[0], ratio = t[1] / u, s = terms == 3 ? t[2] / u : ratio * ratio, r = ratio + s - ratio * ratio;
    const double near = r < STIFF ? STIFF : r > NEAR ? NEAR : r, known = 1.0 / (1.0 - near), more = r - near;
    const double h2 = 2.0 * known * known * known, h1 = known * known + more * h2;
    const double h = known + more * (known * known + more * h2 / 2.0);
    double slope[3] = {-ratio, 1.0, 0.0}, bend[3][3] = {{2.0 * ratio, -1.0, 0.0}, {-1.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    if (terms == 3) {
        slope[0] = 2.0 * ratio * ratio - ratio - s, slope[1] = 1.0 - 2.0 * ratio, slope[2] = 1.0;
        bend[0][0] = 2.0 * (ratio + s) - 6.0 * ratio * ratio, bend[0][1] = bend[1][0] = 4.0 * ratio - 1.0;
        bend[0][2] = bend[2][0] = -1.0, bend[1][1] = -2.0;
    }
    for (int i = 0; i < 3; i++) {
        f[i] = h * (i == 0) + h1 * slope[i];
        for (int j = 0; j < 3; j++)
            F[i][j] = (h1 * ((i == 0) * slope[j] + (j == 0) * slope[i] + bend[i][j]) + h2 * slope[i] * slope[j]) / u;
    }
    return r;
}

/* How many of u, v and q the model knows. */
static int known_terms(const cfem_module *model) { return model->curvature.terms ? 3 : model->change.terms ? 2 : 1; }

void cfem_module_under(const cfem_held *held, const double w[P], cfem_carried *out) {
    const int terms = known_terms(held->model);
    double ways[3][P] = {{0}}, softer[3][P][P] = {{{0}}}, f[3] = {1.0, 0.0, 0.0}, F[3][3] = {{0}}, t[3] = {0};
    double square[POSE][POSE] = {{0}};
    for (int i = 0; i < P; i++) {
        ways[0][i] = cfem_dot(P, held->C[i], w);
        for (int j = 0; j < P; j++) softer[0][i][j] = held->C[i][j];
    }
    t[0] = cfem_dot(P, ways[0], w) / 2.0;
    out->ratio = 0.0;
    if (terms > 1 && t[0] > TINY) {
        const double *d = held->D;
        for (int i = 0; i < POSE; i++)
            for (int j = i; j < POSE; j++)
                for (int k = j; k < POSE; k++, d++) {
                    softer[1][i][j] += *d * w[k];
                    if (k != j) softer[1][i][k] += *d * w[j];
                    if (j != i) softer[1][j][k] += *d * w[i];
                }
        for (int i = 0; i < POSE; i++)
            for (int j = 0; j < i; j++) softer[1][i][j] = softer[1][j][i];
        if (terms > 2) cfem_square_of_fourth(held->E, w, square);
        for (int i = 0; i < POSE; i++)
            for (int j = 0; j < POSE; j++) softer[2][i][j] = square[i][j];
        for (int k = 1; k < terms; k++) {
            for (int i = 0; i < P; i++) ways[k][i] = cfem_dot(P, softer[k][i], w) / (1.0 + k);
            t[k] = cfem_dot(P, ways[k], w) / (2.0 + k);
        }
        out->ratio = continued(terms, t, f, F);
    }
    for (int i = 0; i < P; i++) {
        out->pose[i] = held->pose[i];
        for (int k = 0; k < 3; k++) out->pose[i] += f[k] * ways[k][i];
        for (int j = 0; j < P; j++) {
            out->C[i][j] = 0.0;
            for (int k = 0; k < 3; k++) {
                out->C[i][j] += f[k] * softer[k][i][j];
                for (int l = 0; l < 3; l++) out->C[i][j] += F[k][l] * ways[k][i] * ways[l][j];
            }
        }
    }
}

void cfem_module_slopes(const cfem_held *held, const double w[P], double *lambda, double *stiffness, double slope[P][MOST]) {
    const cfem_module *const model = held->model;
    const int n = model->n_a, all = 1 + n + n * (n + 1) / 2, sizes[5] = {1, P, PACKED, CHANGES, CURVATURES};
    const cfem_terms *const parts[5] = {&model->potential, &model->effector, &model->compliance, &model->change,
                                        &model->curvature};
    int at[5] = {0};
    double work[5][1 + MOST + CFEM_ROW_PAIRS] = {{0}};     /* Psi, w . e, u, v, q: values and derivatives */
    double way[5][P] = {{0}}, turns[5][P][MOST] = {{{0}}}; /* of e, C w, D[w, w] / 2 and E[w, w, w] / 6 */
    double f[3] = {1.0, 0.0, 0.0}, F[3][3] = {{0}}, w3[POSE][POSE][POSE], t[3];
    cfem_triples(w, w3);
    for (int m = 0; m < model->terms; m++) {
        double by[1 + MOST + CFEM_ROW_PAIRS];
        term(held, m, by);
        for (int part = 0; part < 5; part++) {
            const cfem_real *const c = of_term(parts[part], sizes[part], m, &at[part]);
            double moved[P] = {0}, share;
            if (!c) continue;
            if (part == 2) cfem_by_matrix(c, w, moved);
            else if (part == 3) cfem_by_cube(c, w, moved);
            else if (part == 4) cfem_by_fourth(c, w3, moved);
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
    for (int part = 0; part < 5; part++) {
        first_by_s(model, work[part] + 1);
        second_by_s(model, work[part] + 1 + n);
        for (int r = 0; r < P; r++) first_by_s(model, turns[part][r]);
    }
    for (int k = 0; k < 3; k++) t[k] = work[2 + k][0];
    if (known_terms(model) > 1 && t[0] > TINY) continued(known_terms(model), t, f, F);
    for (int i = 0, next = 1 + n; i < n; i++) {
        lambda[i] = work[0][1 + i] - work[1][1 + i];
        for (int k = 0; k < 3; k++) lambda[i] -= f[k] * work[2 + k][1 + i];
        for (int j = i; j < n; j++, next++, stiffness++) {
            *stiffness = work[0][next] - work[1][next];
            for (int k = 0; k < 3; k++) {
                *stiffness -= f[k] * work[2 + k][next];
                for (int l = 0; l < 3; l++) *stiffness -= F[k][l] * work[2 + k][1 + i] * work[2 + l][1 + j];
            }
        }
        for (int r = 0; r < P; r++) {
            slope[r][i] = turns[1][r][i];
            for (int k = 0; k < 3; k++) {
                slope[r][i] += f[k] * turns[2 + k][r][i];
                for (int l = 0; l < 3; l++) slope[r][i] += F[k][l] * way[2 + k][r] * work[2 + l][1 + i];
            }
        }
    }
}

#endif
