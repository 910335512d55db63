/* A Chebyshev series of many outputs as data: cfem_series.h says what it means. */
#ifndef CFEM_SERIES_DATA_H
#define CFEM_SERIES_DATA_H

#include <stdint.h>

#define CFEM_SERIES_WIDE 8 /* outputs whose coefficients are together, the last ones filled up with zeros */

typedef struct {
    int groups, terms;
    const uint16_t *first, *end; /* of each group: its product of the first coordinates, and where its terms end */
    const uint16_t *second;      /* of each term: its product of the others */
    const double *coefficients;  /* (outputs / WIDE, terms, WIDE) */
} cfem_motion_series;

#endif
