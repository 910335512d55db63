/* The robot as data: what firmware has as constants, this code reads from a block of bytes under the same names, so that one WebAssembly
 * module, compiled once, runs every robot. The lists below declare the block for both sides: cfem_page.c reads it, page/layout.py and
 * page/block.py write it. */
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

#define CFEM_AS_DATA
#define CFEM_SPECTRAL 1
#define CFEM_SERIAL 1
#define CFEM_ROW 0
#define CFEM_MLP 0
#define CFEM_FULL 0
#define CFEM_OBSERVER_MEASURED 0
#define CFEM_OBSERVER_PREVIOUS_STEP 1
#define CFEM_OBSERVER_EQUILIBRIUM 2

/* Whole numbers: name, least, most, and what there is room for. CFEM_KIND: of cfem_room.h. */
#define CFEM_COUNTS(X) \
    X(CFEM_KIND, 0, 2, "kinds") \
    X(CFEM_FORM_DISPLACEMENT, 0, 1, "forms") \
    X(CFEM_NA, 1, CFEM_MOST_NA, "actuators") \
    X(CFEM_NE, 1, CFEM_MOST_NE, "effector coordinates") \
    X(CFEM_SERIES_NA, 1, CFEM_MOST_NA, "actuators") \
    X(CFEM_SERIES_NE, 1, CFEM_MOST_NE, "effector coordinates") \
    X(CFEM_NZ, 1, CFEM_MOST_NZ, "inputs") \
    X(CFEM_DEGREE, 1, CFEM_MOST_DEGREE, "degrees") \
    X(CFEM_MODULES, 1, CFEM_MOST_MODULES, "modules") \
    X(CFEM_OBSERVER, 0, 2, "observers") \
    X(CFEM_OBSERVER_ITERATIONS, 0, 100, "iterations of its observer") \
    X(CFEM_COMMAND_FORCE, 0, 1, "commands") \
    X(CFEM_ITERATIONS, 1, 50, "iterations") \
    X(CFEM_HALVINGS, 0, CFEM_MOST_HALVINGS, "halvings") \
    X(CFEM_SKIN_ROWS, 0, CFEM_MOST_SKIN, "modes of its skin") \
    X(CFEM_SKIN_NZ, 1, CFEM_MOST_NZ, "inputs") \
    X(CFEM_SKIN_DEGREE, 1, CFEM_MOST_DEGREE, "degrees")

/* Vectors: name, room and size. */
#define CFEM_VECTORS(X) \
    X(cfem_observer_tolerance, 1, 1) \
    X(cfem_rest_e, CFEM_MOST_NE, CFEM_NE) \
    X(cfem_effector_weight, CFEM_MOST_NE, CFEM_NE) \
    X(cfem_far, CFEM_MOST_NE, CFEM_NE) \
    X(cfem_ridge, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_least_ridge, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_damping, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_lambda_low, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_lambda_high, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_delta_low, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_delta_high, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_tolerance, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_step_limit, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_delta_rate, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_lambda_rate, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_home, CFEM_MOST_NA, CFEM_NA) \
    X(cfem_offset, CFEM_MOST_NZ, CFEM_NZ) \
    X(cfem_softer, CFEM_MOST_MODULES, CFEM_MODULES) \
    X(cfem_module_rest, 3, 3) \
    X(cfem_skin_offset, CFEM_MOST_NZ, CFEM_SKIN_NZ)

/* Matrices: name, room for rows and columns, rows and columns. */
#define CFEM_MATRICES(X) \
    X(cfem_domain_delta_a, 2, CFEM_MOST_NA, 2, CFEM_NA) \
    X(cfem_domain_lambda_a, 2, CFEM_MOST_NA, 2, CFEM_NA) \
    X(cfem_domain_axes, CFEM_MOST_NA, CFEM_MOST_NA, CFEM_NA, CFEM_NA) \
    X(cfem_domain_along, 2, CFEM_MOST_NA, 2, CFEM_NA) \
    X(cfem_to_box, CFEM_MOST_NZ, CFEM_MOST_NA, CFEM_NZ, CFEM_SERIES_NA) \
    X(cfem_skin_to_box, CFEM_MOST_NZ, CFEM_MOST_NA, CFEM_SKIN_NZ, CFEM_NA)

/* Series: name, outputs, coordinates and degree. Of each, the degrees of its terms in the last coordinate, and their groups. */
#define CFEM_TREES(X) \
    X(cfem_potential, 1, CFEM_NZ, CFEM_DEGREE) \
    X(cfem_effector, CFEM_SERIES_NE, CFEM_NZ, CFEM_DEGREE) \
    X(cfem_skin, CFEM_SKIN_ROWS, CFEM_SKIN_NZ, CFEM_SKIN_DEGREE)

/* Terms up to `end` that share the degrees of all coordinates but the last; from the coordinate `depth` on their sums are complete. */
typedef struct {
    uint16_t end;
    uint8_t depth, degrees[CFEM_MOST_NZ - 1];
} cfem_group;

#define CFEM_COUNT(name, least, most, what) extern int name;
#define CFEM_VECTOR(name, room, size) extern double name[room];
#define CFEM_MATRIX(name, rows_room, columns_room, rows, columns) extern double name[rows_room][columns_room];
#define CFEM_TREE(name, outputs, n_z, degree) \
    extern const cfem_real *name; \
    extern const uint8_t *name##_degrees; \
    extern const cfem_group *name##_groups; \
    extern int name##_group_count;
CFEM_COUNTS(CFEM_COUNT)
CFEM_VECTORS(CFEM_VECTOR)
CFEM_MATRICES(CFEM_MATRIX)
CFEM_TREES(CFEM_TREE)

#define CFEM_SERIES_OUTPUTS CFEM_SERIES_NE
#define CFEM_OBSERVER_TOLERANCE cfem_observer_tolerance[0]
#define CFEM_POTENTIAL_GROUPS cfem_potential_group_count
#define CFEM_EFFECTOR_GROUPS cfem_effector_group_count

/* Nobody measures here: the loop is open. */
#define CFEM_K_P 0.0
#define CFEM_INTEGRAL_LIMIT 0.0
#define CFEM_LATE 1
#define cfem_integral_gain ((const double[1]){0.0})

#endif
