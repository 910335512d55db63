/* Sums of Chebyshev series and of their slopes. */
#include "cfem_series.h"

#include <string.h>

#define NA CFEM_MOTION_NA
#define FIRST CFEM_SERIES_FIRST
#define SECOND CFEM_SERIES_SECOND
#define WIDE CFEM_SERIES_WIDE
/* Outputs whose sums, with those of their slopes, stay in registers. */
#define LANES (WIDE / CFEM_AT_ONCE < 2 ? 1 : 2)
#define PASS (LANES * CFEM_AT_ONCE)
/* T_k and T_k' of each coordinate. */
typedef double polynomials[2][CFEM_MOTION_MOST_NA][CFEM_MOTION_MOST_DEGREE + 1];

/* Of n coordinates from number `from` on. */
CFEM_INLINE void multiply(polynomials t, int from, int n, int count, const uint8_t *degrees, double out[][CFEM_SERIES_MOST]) {
    for (int m = 0; m < count; m++, degrees += n) {
        double *row = out[m], before = 1.0, after[CFEM_SERIES_MOST];
        after[n] = 1.0;
        for (int i = n - 1; i >= 0; i--) after[i] = after[i + 1] * t[0][from + i][degrees[i]];
        row[0] = after[0];
        for (int i = 0; i < n; i++) {
            row[1 + i] = before * t[1][from + i][degrees[i]] * after[i + 1];
            before *= t[0][from + i][degrees[i]];
        }
    }
}

void cfem_products_at(const double *delta_a, cfem_products *products) {
    cfem_box box = CFEM_MOTION_BOX(CFEM_MOTION_DEGREE, CFEM_MOTION_MOST_DEGREE + 1);
    polynomials t;
    cfem_polynomials(box, delta_a, 2, t[0][0]);
    multiply(t, 0, FIRST, CFEM_MOTION_FIRST_PRODUCTS, cfem_motion_first_degrees, products->first);
    multiply(t, FIRST, SECOND, CFEM_MOTION_SECOND_PRODUCTS, cfem_motion_second_degrees, products->second);
}

/* out (1 + NA, WIDE) += the values of PASS outputs, and their slopes by the box's coordinates: n of the second half. */
CFEM_INLINE void add(const cfem_motion_series *s, const cfem_products *p, const double *c, const int n, double *out) {
    const uint16_t *second = s->second;
    for (int g = 0, m = 0; g < s->groups; g++) {
        cfem_lanes sum[CFEM_SERIES_MOST][LANES];
        CFEM_UNROLL for (int l = 0; l <= n; l++) CFEM_UNROLL for (int k = 0; k < LANES; k++) sum[l][k] = (cfem_lanes){0};
        for (; m < s->end[g]; m++, c += WIDE) {
            const double *by = p->second[*second++];
            const cfem_lanes *of = (const cfem_lanes *)c;
            CFEM_UNROLL for (int l = 0; l <= n; l++) CFEM_UNROLL for (int k = 0; k < LANES; k++) sum[l][k] += by[l] * of[k];
        }
        const double *by = p->first[s->first[g]];
        for (int i = 0; i <= FIRST; i++)
            CFEM_UNROLL for (int k = 0; k < LANES; k++) ((cfem_lanes *)(out + i * WIDE))[k] += by[i] * sum[0][k];
        CFEM_UNROLL for (int l = 1; l <= n; l++)
            CFEM_UNROLL for (int k = 0; k < LANES; k++) ((cfem_lanes *)(out + (FIRST + l) * WIDE))[k] += by[0] * sum[l][k];
    }
}

/* out (WIDE,) += the values alone. */
static void add_values(const cfem_motion_series *s, const cfem_products *p, const double *c, double *out) {
    const uint16_t *second = s->second;
    for (int g = 0, m = 0; g < s->groups; g++) {
        cfem_lanes sum[WIDE / CFEM_AT_ONCE];
        CFEM_UNROLL for (int k = 0; k < WIDE / CFEM_AT_ONCE; k++) sum[k] = (cfem_lanes){0};
        for (; m < s->end[g]; m++, c += WIDE) {
            const double by = p->second[*second++][0];
            CFEM_UNROLL for (int k = 0; k < WIDE / CFEM_AT_ONCE; k++) sum[k] += by * *(const cfem_lanes *)(c + k * CFEM_AT_ONCE);
        }
        const double by = p->first[s->first[g]][0];
        CFEM_UNROLL for (int k = 0; k < WIDE / CFEM_AT_ONCE; k++) *(cfem_lanes *)(out + k * CFEM_AT_ONCE) += by * sum[k];
    }
}

void cfem_series_at(const cfem_motion_series *s, const cfem_products *p, int count, double *values, double *slopes, int stride) {
    for (int o = 0; o < count; o += WIDE) {
        const double *c = s->coefficients + (long)o * s->terms;
        const size_t all = sizeof(double) * (size_t)(count - o < WIDE ? count - o : WIDE);
        double out[CFEM_MOTION_MOST_NA + 1][WIDE];
        memset(out, 0, sizeof out);
        if (!slopes) add_values(s, p, c, out[0]);
        for (int part = 0; slopes && part < WIDE; part += PASS) add(s, p, c + part, SECOND, out[0] + part);
        memcpy(values + o, out[0], all);
        for (int a = 0; slopes && a < NA; a++) { /* from the box to delta_a */
            double by_a[WIDE] = {0};
            for (int i = 0; i < NA; i++)
                for (int k = 0; k < WIDE; k++) by_a[k] += cfem_motion_to_box[i][a] * out[1 + i][k];
            memcpy(slopes + a * stride + o, by_a, all);
        }
    }
}
