/* The controller of firmware for a page: reads the robot from a block of bytes, ticks it, sets its actuators by hand, and gives the surface
 * that its skin has there. No heap and no imports: the page lays its data behind __heap_base. */
#include "cfem_page.h"

#include "cfem_chebyshev.h"

#define SHORTEST (1.0 / 64.0) /* step of what is set by hand, as a share of the way */

#define DEFINE_TREE(name, outputs, n_z, degree) \
    const cfem_real *name; \
    const uint8_t *name##_degrees; \
    const cfem_group *name##_groups; \
    int name##_group_count;
CFEM_COUNTS(DEFINE_COUNT)
CFEM_VECTORS(DEFINE_VECTOR)
CFEM_MATRICES(DEFINE_MATRIX)
CFEM_TREES(DEFINE_TREE)

static cfem_controller controller;

cfem_page_shared cfem_io;
#define io cfem_io

double *SERVED(io)(void) { return &io.goal[0]; }

/* How many groups a series has. */
static int read_tree(reader *r, const cfem_real **coefficients, const uint8_t **degrees, const cfem_group **groups, int outputs, int n_z,
                     int degree) {
    const int32_t *sizes = take(r, 2 * sizeof *sizes);
    if (!r->good || !between(r, 0, sizes[0], 1 << 16) || !between(r, 0, sizes[1], sizes[0])) return 0;
    const int terms = sizes[0], count = sizes[1];
    *coefficients = take(r, (size_t)terms * (size_t)outputs * sizeof **coefficients);
    const uint8_t *own = *degrees = take(r, (size_t)terms);
    const cfem_group *group = *groups = take(r, (size_t)count * sizeof *group);
    for (int m = 0; r->good && m < terms; m++) between(r, 0, own[m], degree);
    for (int g = 0, end = 0; r->good && g < count; end = group[g++].end) {
        between(r, end, group[g].end, terms);
        between(r, 0, group[g].depth, n_z - 1);
        for (int d = 0; r->good && d < n_z - 1; d++) between(r, 0, group[g].degrees[d], degree);
    }
    if (r->good && count) between(r, terms, group[count - 1].end, terms);
    return count;
}

#define READ_TREE(name, outputs, n_z, degree) \
    name##_group_count = read_tree(&r, &name, &name##_degrees, &name##_groups, outputs, n_z, degree);

/* 0, or 1 where the block is not of a robot that this code has room for. It is not copied: it has to stay. */
int SERVED(load)(const unsigned char *block, int size) {
    reader r = {block, block + size, 1};
    const int32_t *head = take(&r, (CFEM_COUNTS(ONE)) * sizeof *head);
    if (!r.good) return 1;
    CFEM_COUNTS(READ_COUNT)
    if (CFEM_KIND == CFEM_KIND_SERIAL)
        between(&r, 6, CFEM_SERIES_NE, 6), between(&r, CFEM_NA, CFEM_MODULES * CFEM_SERIES_NA, CFEM_NA), between(&r, 3, CFEM_NE, 3);
    else
        between(&r, 0, CFEM_KIND, CFEM_KIND_SPECTRAL), between(&r, CFEM_NE, CFEM_SERIES_NE, CFEM_NE), between(&r, CFEM_NA, CFEM_SERIES_NA, CFEM_NA);
    if (!r.good) return 1;
    CFEM_VECTORS(READ_VECTOR)
    CFEM_MATRICES(READ_MATRIX)
    CFEM_TREES(READ_TREE)
    return !(r.good && r.at == r.end);
}

/* --- the skin ----------------------------------------------------------------------------------------------------------- */

/* Rows of the skin at s, (outputs,) mm, summed from the leaves as in cfem_spectral.c. */
static void skin_rows(const double *s, double *out) {
    double T[CFEM_MOST_NZ][CFEM_MOST_DEGREE + 1], sum[CFEM_MOST_NZ][CFEM_MOST_SKIN];
    const int N = CFEM_SKIN_NZ, outputs = CFEM_SKIN_ROWS;
    const cfem_box box = {N, CFEM_NA, CFEM_MOST_NA, CFEM_SKIN_DEGREE, CFEM_MOST_NZ, CFEM_MOST_DEGREE + 1, cfem_skin_to_box[0], cfem_skin_offset};
    cfem_polynomials(box, s, 1, T[0]);
    for (int i = 0; i < N; i++)
        for (int o = 0; o < outputs; o++) sum[i][o] = 0.0;
    for (int g = 0, m = 0; g < cfem_skin_group_count; g++) {
        const cfem_group *group = cfem_skin_groups + g;
        for (; m < group->end; m++)
            for (int o = 0; o < outputs; o++) sum[N - 1][o] += cfem_skin[m * outputs + o] * T[N - 1][cfem_skin_degrees[m]];
        for (int d = N - 2; d >= group->depth; d--)
            for (int o = 0; o < outputs; o++)
                sum[d][o] += T[d][group->degrees[d]] * sum[d + 1][o], sum[d + 1][o] = 0.0;
    }
    for (int o = 0; o < outputs; o++) out[o] = sum[0][o];
}

static struct {
    int points, triangles;
    const double *rest, *modes; /* (points, 3) mm; (skin, points, 3) */
    const uint32_t *triangle;   /* (triangles, 3) */
} surface;

/* points (n, 3) that move with the skin, and the triangles between the first of them. */
void SERVED(surface)(int points, int triangles, const double *rest, const double *modes, const uint32_t *triangle) {
    surface.points = points, surface.triangles = triangles;
    surface.rest = rest, surface.modes = modes, surface.triangle = triangle;
}

/* Where the skin is: io.skin, and x (points, 3) mm; drawn, normals: the same for a graphics card, normals of length one (0 of lone points). */
void SERVED(shape)(double *x, float *drawn, float *normals) {
    const int count = 3 * surface.points;
    skin_rows(CFEM_FORM_DISPLACEMENT ? io.delta_a : io.lambda_a, io.skin);
    __builtin_memcpy(x, surface.rest, (size_t)count * sizeof *x);
    for (int k = 0; k < CFEM_SKIN_ROWS; k++) {
        const double *mode = surface.modes + (size_t)k * (size_t)count, s = io.skin[k];
        for (int i = 0; i < count; i++) x[i] += s * mode[i];
    }
    for (int i = 0; i < count; i++) drawn[i] = (float)x[i], normals[i] = 0.0f;
    for (int t = 0; t < surface.triangles; t++) {
        const uint32_t *corner = surface.triangle + 3 * t;
        const float *a = drawn + 3 * corner[0], *b = drawn + 3 * corner[1], *c = drawn + 3 * corner[2];
        float u[3], v[3];
        for (int i = 0; i < 3; i++) u[i] = b[i] - a[i], v[i] = c[i] - a[i];
        const float n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++) normals[3 * corner[k] + i] += n[i];
    }
    for (int p = 0; p < count; p += 3) {
        float *n = normals + p;
        const float length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        if (length > 0.0f) n[0] /= length, n[1] /= length, n[2] /= length;
    }
}

/* --- the robot, of which the page knows only this model ------------------------------------------------------------------ */

static void show(const cfem_condensed *m) {
    for (int e = 0; e < CFEM_NE; e++) io.x_e[e] = cfem_rest_e[e] + m->free_e[e] + cfem_dot(CFEM_NA, m->W_ea[e], m->lambda_a);
    for (int i = 0; i < CFEM_NA; i++) io.delta_a[i] = m->delta_a[i], io.lambda_a[i] = m->lambda_a[i];
}

/* The robot under forces: Newton's method begins where the controller stands. */
static unsigned under(const double *lambda_a, cfem_condensed *m) {
    double s[CFEM_MOST_NA];
    if (!CFEM_FORM_DISPLACEMENT) return cfem_model(lambda_a, m);
    for (int i = 0; i < CFEM_NA; i++) s[i] = controller.delta_a[i];
    return cfem_find(lambda_a, s, m);
}

/* Newton's method for `set_to` from s (n_a,), the model's inputs, which it moves to the solution. What would pull with less than its smallest force, or push a cable, has that force and
 * goes where the others lead: lambda_a at the bound where delta_a is more than asked. Newton's method for d delta_a = W_aa d lambda_a,
 * of which each actuator knows the one side or the other. */
static unsigned set_from(double *s, const double *delta_a, cfem_condensed *m) {
    const int n = CFEM_NA;
    double scale = 0.0, course = 0.0;
    char slack[CFEM_MOST_NA];
    for (int i = 0; i < n; i++) {
        scale = fmax(scale, fabs(cfem_domain_lambda_a[1][i])), course = fmax(course, fabs(cfem_domain_delta_a[1][i]));
    }
    for (int round = 0; round < 60; round++) {
        double W[CFEM_MOST_NA][CFEM_MOST_NA], by_delta[CFEM_MOST_NA], by_lambda[CFEM_MOST_NA], left = 0.0;
        const unsigned status = cfem_model(s, m);
        if (status) return status;
        for (int i = 0; i < n; i++) {
            if (round == 0) /* what was slack before stays so, unless it is asked for more */
                slack[i] = m->delta_a[i] > delta_a[i] + 1e-9 * course && m->lambda_a[i] <= cfem_lambda_low[i] + 1e-6 * scale;
            if (m->lambda_a[i] < cfem_lambda_low[i] - 1e-9 * scale) slack[i] = 1;
            if (slack[i] && m->delta_a[i] < delta_a[i] - 1e-9 * course) slack[i] = 0;
            by_delta[i] = slack[i] ? 0.0 : delta_a[i] - m->delta_a[i];
            by_lambda[i] = slack[i] ? cfem_lambda_low[i] - m->lambda_a[i] : 0.0;
            left = fmax(left, fmax(fabs(by_delta[i]) / course, fabs(by_lambda[i]) / scale));
        }
        if (left <= 1e-11) return CFEM_OK;
        for (int i = 0; i < n; i++) { /* W of those whose delta_a is known; the others' rows and columns are of the identity */
            for (int j = 0; j < n; j++) W[i][j] = slack[i] || slack[j] ? i == j : m->W_aa[i][j];
            for (int j = 0; j < n && !slack[i]; j++) by_delta[i] -= m->W_aa[i][j] * by_lambda[j];
        }
        if (cfem_invert(n, CFEM_MOST_NA, &W[0][0])) return CFEM_NO_MODEL;
        double d_lambda[CFEM_MOST_NA];
        for (int i = 0; i < n; i++) d_lambda[i] = slack[i] ? by_lambda[i] : cfem_dot(n, W[i], by_delta);
        for (int i = 0; i < n; i++) s[i] += CFEM_FORM_DISPLACEMENT ? cfem_dot(n, m->W_aa[i], d_lambda) : d_lambda[i];
    }
    return CFEM_NOT_FOUND;
}

/* The robot whose actuators are set to delta_a. Where Newton's method does not find it from there, it goes from where the controller
 * stands, in steps that it halves. */
static unsigned set_to(const double *delta_a, cfem_condensed *m) {
    double s[CFEM_MOST_NA], last[CFEM_MOST_NA], from[CFEM_MOST_NA], to[CFEM_MOST_NA], done = 0.0, step = 0.25;
    for (int i = 0; i < CFEM_NA; i++) {
        from[i] = controller.delta_a[i], last[i] = CFEM_FORM_DISPLACEMENT ? controller.delta_a[i] : controller.lambda_a[i];
        s[i] = CFEM_FORM_DISPLACEMENT ? delta_a[i] : controller.lambda_a[i];
    }
    unsigned status = set_from(s, delta_a, m);
    while (status && done < 1.0 && step >= SHORTEST) {
        const double share = done + step < 1.0 ? done + step : 1.0;
        for (int i = 0; i < CFEM_NA; i++) to[i] = from[i] + share * (delta_a[i] - from[i]), s[i] = last[i];
        if (set_from(s, to, m)) {
            step *= 0.5;
            continue;
        }
        for (int i = 0; i < CFEM_NA; i++) last[i] = s[i];
        done = share, step *= 1.5;
        if (done >= 1.0) status = CFEM_OK;
    }
    return status;
}

/* The start; io.goal is where the effectors are. */
void SERVED(home)(void) {
    cfem_init(&controller);
    cfem_condensed m;
    cfem_model(cfem_home, &m);
    show(&m);
    for (int e = 0; e < CFEM_NE; e++) io.goal[e] = io.x_e[e];
}

/* One tick towards io.goal; the status is the controller's. */
unsigned SERVED(tick)(void) {
    cfem_input in;
    cfem_output out;
    cfem_condensed m;
    in.tick = 0;
    for (int e = 0; e < CFEM_NE; e++) in.goal[e] = io.goal[e];
    for (int i = 0; i < CFEM_NA; i++) in.delta_a[i] = io.delta_a[i];
    const unsigned status = cfem_step(&controller, &in, &out);
    if (CFEM_HALVINGS && controller.stands) {
        show(&controller.at);
        return status;
    }
    const unsigned there = CFEM_COMMAND_FORCE ? under(out.lambda_a, &m) : set_to(out.delta_a, &m);
    if (!(there & CFEM_NO_MODEL)) show(&m);
    return status | there;
}

/* The robot with io.delta_a, or io.lambda_a (by_force), and the controller there; nothing changes where the model knows no such
 * state (CFEM_NO_MODEL, CFEM_NOT_FOUND). keep: 0 to look only, the controller stays. */
unsigned SERVED(set)(int by_force, int keep) {
    cfem_condensed m;
    const unsigned status = by_force ? under(io.lambda_a, &m) : set_to(io.delta_a, &m);
    if (status) return status;
    show(&m);
    if (keep) {
        for (int i = 0; i < CFEM_NA; i++) controller.delta_a[i] = m.delta_a[i], controller.lambda_a[i] = m.lambda_a[i];
        for (int e = 0; e < CFEM_NE; e++) controller.reference[e] = io.x_e[e];
        controller.at = m, controller.stands = 1;
    }
    return cfem_outside(&m);
}
