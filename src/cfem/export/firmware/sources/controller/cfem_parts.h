/* What a kind of surrogate gives at an input; cfem_condense.c makes the condensed model of it, cfem_serial.c that of modules in
 * a row. */
#ifndef CFEM_PARTS_H
#define CFEM_PARTS_H

#include "cfem.h"

#if CFEM_SPECTRAL
typedef struct {
    double gradient[CFEM_MOST_SERIES_NA]; /* of the potential, by the input */
    double hessian[CFEM_MOST_SERIES_NA][CFEM_MOST_SERIES_NA]; /* of the potential */
    double effector[CFEM_MOST_SERIES_NE]; /* mm from rest */
    double effector_gradient[CFEM_MOST_SERIES_NE][CFEM_MOST_SERIES_NA]; /* by the input */
#if CFEM_FULL
    double energy;
    double compliance[CFEM_MOST_SERIES_NE][CFEM_MOST_SERIES_NE];
#endif
} cfem_parts;

/* The potential's and the effectors' Chebyshev series and their derivatives at s. */
void cfem_spectral(const double s[CFEM_MOST_SERIES_NA], cfem_parts *parts);

/* The potential's alone, and the effectors' alone. */
void cfem_potential_parts(const double s[CFEM_MOST_SERIES_NA], cfem_parts *parts);
void cfem_effector_parts(const double s[CFEM_MOST_SERIES_NA], cfem_parts *parts);
#endif

#if CFEM_SERIAL
/* As cfem_model, of modules in a row. */
unsigned cfem_serial(const double s[CFEM_MOST_NA], cfem_condensed *m);
#endif

#if CFEM_ROW
/* The same of modules under loads, or of different models. */
unsigned cfem_row(const double s[CFEM_MOST_NA], cfem_condensed *m);
#endif

#if CFEM_MLP
/* Outputs (CFEM_MLP_OUTPUTS,) of the network at s: the upper triangle of W_aa; W_ea row by row; delta_free, actuators then
 * effectors; with CFEM_FULL the upper triangle of W_ee. */
void cfem_mlp(const double s[CFEM_MOST_NA], cfem_real out[CFEM_MOST_MLP_OUTPUTS]);
#endif

/* The model where what is not its input, lambda_a (displacement form) or delta_a (force form), takes the value `wanted`
 * (CFEM_NA,): Newton's method from s, which is moved there; m is the model at s. CFEM_OK, _NOT_FOUND or _NO_MODEL. */
unsigned cfem_find(const double *wanted, double *s, cfem_condensed *m);

#endif
