/* The robot as data: what firmware has as constants (../c, `cfem export` with format c) is read here from a block of bytes, so that
 * one WebAssembly module, compiled once, runs every robot. cfem_page.c reads the block; page_data.py writes it. */
#ifndef CFEM_DATA_H
#define CFEM_DATA_H

#include <stdint.h>

typedef double cfem_real;

/* Room: a robot that needs more is refused. */
#define CFEM_MOST_NA 8
#define CFEM_MOST_NE 12
#define CFEM_MOST_HALVINGS 20
#define CFEM_MOST_LATE 1
#define CFEM_MOST_SERIES_NA CFEM_MOST_NA
#define CFEM_MOST_SERIES_NE CFEM_MOST_NE
#define CFEM_MOST_SERIES_OUTPUTS CFEM_MOST_NE
#define CFEM_MOST_NZ 12
#define CFEM_MOST_DEGREE 40
#define CFEM_MOST_MODULES 4
#define CFEM_MOST_SKIN 40

#define CFEM_SPECTRAL 1
#define CFEM_SERIAL 1
#define CFEM_ROW 0
#define CFEM_MLP 0
#define CFEM_FULL 0

/* Terms up to `end` that share the degrees of all coordinates but the last; from the coordinate `depth` on their sums are complete. */
typedef struct {
    uint16_t end;
    uint8_t depth, degrees[CFEM_MOST_NZ - 1];
} cfem_group;

/* Terms of a series: `outputs` coefficients each, and the degree in the last coordinate. */
typedef struct {
    int outputs, terms, groups;
    const cfem_real *coefficients;
    const uint8_t *degrees;
    const cfem_group *group;
} cfem_series;

typedef struct {
    /* In the order of the block. */
    int kind, form_displacement, n_a, n_e, series_n_a, series_n_e, n_z, degree, modules;
    int observer, observer_iterations, command_force, iterations, halvings;
    double observer_tolerance;
    double rest_e[CFEM_MOST_NE], effector_weight[CFEM_MOST_NE], far[CFEM_MOST_NE];
    double ridge[CFEM_MOST_NA], least_ridge[CFEM_MOST_NA], damping[CFEM_MOST_NA];
    double lambda_low[CFEM_MOST_NA], lambda_high[CFEM_MOST_NA], delta_low[CFEM_MOST_NA], delta_high[CFEM_MOST_NA];
    double tolerance[CFEM_MOST_NA], step_limit[CFEM_MOST_NA], delta_rate[CFEM_MOST_NA], lambda_rate[CFEM_MOST_NA], home[CFEM_MOST_NA];
    double domain_delta_a[2][CFEM_MOST_NA], domain_lambda_a[2][CFEM_MOST_NA];
    double to_box[CFEM_MOST_NZ][CFEM_MOST_NA], offset[CFEM_MOST_NZ];
    double softer[CFEM_MOST_MODULES], module_rest[3];
    cfem_series potential, effector, skin;
    /* The skin's own coordinates. */
    int skin_n_z, skin_degree;
    double skin_to_box[CFEM_MOST_NZ][CFEM_MOST_NA], skin_offset[CFEM_MOST_NZ];
} cfem_robot;

extern cfem_robot cfem_here;

#define CFEM_KIND cfem_here.kind
#define CFEM_FORM_DISPLACEMENT cfem_here.form_displacement
#define CFEM_NA cfem_here.n_a
#define CFEM_NE cfem_here.n_e
#define CFEM_SERIES_NA cfem_here.series_n_a
#define CFEM_SERIES_NE cfem_here.series_n_e
#define CFEM_SERIES_OUTPUTS cfem_here.series_n_e
#define CFEM_NZ cfem_here.n_z
#define CFEM_DEGREE cfem_here.degree
#define CFEM_MODULES cfem_here.modules
#define CFEM_OBSERVER_MEASURED 0
#define CFEM_OBSERVER_PREVIOUS_STEP 1
#define CFEM_OBSERVER_EQUILIBRIUM 2
#define CFEM_OBSERVER cfem_here.observer
#define CFEM_OBSERVER_ITERATIONS cfem_here.observer_iterations
#define CFEM_OBSERVER_TOLERANCE cfem_here.observer_tolerance
#define CFEM_COMMAND_FORCE cfem_here.command_force
#define CFEM_ITERATIONS cfem_here.iterations
#define CFEM_HALVINGS cfem_here.halvings

/* Nobody measures here: the loop is open. */
#define CFEM_K_P 0.0
#define CFEM_INTEGRAL_LIMIT 0.0
#define CFEM_LATE 1
#define cfem_integral_gain ((const double[1]){0.0})

#define cfem_rest_e cfem_here.rest_e
#define cfem_effector_weight cfem_here.effector_weight
#define cfem_far cfem_here.far
#define cfem_ridge cfem_here.ridge
#define cfem_least_ridge cfem_here.least_ridge
#define cfem_damping cfem_here.damping
#define cfem_lambda_low cfem_here.lambda_low
#define cfem_lambda_high cfem_here.lambda_high
#define cfem_delta_low cfem_here.delta_low
#define cfem_delta_high cfem_here.delta_high
#define cfem_tolerance cfem_here.tolerance
#define cfem_step_limit cfem_here.step_limit
#define cfem_delta_rate cfem_here.delta_rate
#define cfem_lambda_rate cfem_here.lambda_rate
#define cfem_home cfem_here.home
#define cfem_domain_delta_a cfem_here.domain_delta_a
#define cfem_domain_lambda_a cfem_here.domain_lambda_a
#define cfem_to_box cfem_here.to_box
#define cfem_offset cfem_here.offset
#define cfem_softer cfem_here.softer
#define cfem_module_rest cfem_here.module_rest
#define CFEM_POTENTIAL_GROUPS cfem_here.potential.groups
#define cfem_potential cfem_here.potential.coefficients
#define cfem_potential_degrees cfem_here.potential.degrees
#define cfem_potential_groups cfem_here.potential.group
#define CFEM_EFFECTOR_GROUPS cfem_here.effector.groups
#define cfem_effector cfem_here.effector.coefficients
#define cfem_effector_degrees cfem_here.effector.degrees
#define cfem_effector_groups cfem_here.effector.group

#endif
