/* The displacements of the surface's modes, for both kinds of cfem_shape.c. */
#ifndef CFEM_SKIN_ROWS_H
#define CFEM_SKIN_ROWS_H

#include "cfem_chebyshev.h"
#include "cfem_skin.h"

/* rows (CFEM_SKIN_ROWS,) mm, at s (inputs,). */
static void cfem_skin_rows(int inputs, const double *s, double rows[CFEM_SKIN_ROWS]) {
    const cfem_box box = {CFEM_SKIN_NZ, inputs, inputs, CFEM_SKIN_DEGREE, CFEM_SKIN_NZ, CFEM_SKIN_DEGREE + 1,
                          cfem_skin_to_box[0], cfem_skin_offset};
    double t[CFEM_SKIN_NZ][CFEM_SKIN_DEGREE + 1];
    cfem_polynomials(box, s, 1, t[0]);
    for (int k = 0; k < CFEM_SKIN_ROWS; k++) rows[k] = 0.0;
    cfem_add_terms(box, t[0], CFEM_SKIN_TERMS, cfem_skin_degrees[0], CFEM_SKIN_ROWS, cfem_skin_series[0], rows, 0);
}

#endif
