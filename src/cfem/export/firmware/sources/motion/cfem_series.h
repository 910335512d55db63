/* Chebyshev series of many outputs, by the actuators' displacements in the learned box: sum_m c_m prod_i T_(k_mi)(z_i), and its slopes.
 * Each term is a product of its polynomials in the first half of the coordinates and in the second. Terms that share the first are a
 * group: within it the second are summed with their slopes, so that the coefficients are read once. */
#ifndef CFEM_SERIES_H
#define CFEM_SERIES_H

#include "cfem_series_data.h"
#include "cfem_motion_room.h"

#ifndef CFEM_AS_DATA /* not constants */
extern const cfem_motion_series cfem_motion_root[], cfem_motion_inner[], cfem_motion_loss[], cfem_motion_curve[];
#endif

/* The box in which mass, viscosity and inner motions are learned; a table of polynomials has room for `across` of them. */
#define CFEM_MOTION_BOX(degree, across) \
    {CFEM_MOTION_NA, CFEM_MOTION_NA, CFEM_MOTION_MOST_NA, degree, CFEM_MOTION_MOST_NA, across, cfem_motion_to_box[0], cfem_motion_offset}

#define CFEM_SERIES_FIRST ((CFEM_MOTION_NA + 1) / 2) /* coordinates of the first half */
#define CFEM_SERIES_SECOND (CFEM_MOTION_NA / 2)
#define CFEM_SERIES_MOST ((CFEM_MOTION_MOST_NA + 1) / 2 + 1)

/* Products of the polynomials of each half, and their slopes by its coordinates. */
typedef struct {
    double first[CFEM_MOTION_MOST_PRODUCTS][CFEM_SERIES_MOST], second[CFEM_MOTION_MOST_PRODUCTS][CFEM_SERIES_MOST];
} cfem_products;

void cfem_products_at(const double *delta_a, cfem_products *products);

/* values (count,), and slopes (NA, count) by delta_a in rows that begin `stride` numbers after each other, unless they are NULL. */
void cfem_series_at(const cfem_motion_series *series, const cfem_products *products, int count, double *values, double *slopes, int stride);

#endif
