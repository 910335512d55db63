#include "cfem_obstacle.h"

#include <math.h>

/* Distance, and the normal in own coordinates, at x. */
static double local(const cfem_obstacle *o, const double x[3], double normal[3]) {
    double excess[3], out[3], square = 0.0, sign[3];
    int largest = 0;
    for (int i = 0; i < 3; i++) {
        double s = 0.0;
        for (int j = 0; j < 3; j++) s += (x[j] - o->t[j]) * o->R[j][i];
        sign[i] = !o->below && s < 0.0 ? -1.0 : 1.0;
        excess[i] = sign[i] * s - o->core[i];
        out[i] = excess[i] > 0.0 ? excess[i] : 0.0;
        square += out[i] * out[i];
        if (excess[i] > excess[largest]) largest = i;
    }
    const double away = sqrt(square);
    for (int i = 0; i < 3; i++) normal[i] = sign[i] * (away > 0.0 ? out[i] / away : i == largest ? 1.0 : 0.0);
    return (away > 0.0 ? away : excess[largest]) - o->rounding;
}

double cfem_obstacle_distance(const cfem_obstacle *o, const double x[3]) {
    double normal[3];
    return local(o, x, normal);
}

void cfem_obstacle_frame(const cfem_obstacle *o, const double x[3], double frame[3][3]) {
    double n[3], own[3][3];
    local(o, x, n);
    /* x, y, z turned by the shortest way that brings z to n: see cfem.contact.obstacle. */
    const double sign = n[2] < -0.99 ? -1.0 : 1.0, a = -1.0 / (sign + n[2]), b = n[0] * n[1] * a;
    for (int i = 0; i < 3; i++) own[0][i] = n[i];
    own[1][0] = 1.0 + sign * n[0] * n[0] * a, own[1][1] = sign * b, own[1][2] = -sign * n[0];
    own[2][0] = b, own[2][1] = sign + n[1] * n[1] * a, own[2][2] = -n[1];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            frame[i][j] = 0.0;
            for (int k = 0; k < 3; k++) frame[i][j] += own[i][k] * o->R[j][k];
        }
}

void cfem_obstacle_bend(const cfem_obstacle *o, const double x[3], double bend[3][3]) {
    double n[3], own[3][3];
    const double away = local(o, x, n) + o->rounding;
    const int curved = o->rounding > 0.0 && away > 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int round_there = i == j && (n[i] != 0.0 || o->core[i] == 0.0); /* there is no face across this axis */
            own[i][j] = curved ? ((round_there ? 1.0 : 0.0) - n[i] * n[j]) / away : 0.0;
        }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            bend[i][j] = 0.0;
            for (int k = 0; k < 3; k++)
                for (int l = 0; l < 3; l++) bend[i][j] += o->R[i][k] * own[k][l] * o->R[j][l];
        }
}
