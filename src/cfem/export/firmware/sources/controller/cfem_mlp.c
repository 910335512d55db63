/* The network of the entries: each layer runs over its inputs and skips those that are zero (about half of them after ReLU), so
 * that each weight is read once, in order. Standardisation is folded into the first and the last layer. */
#include "cfem_parts.h"

#if CFEM_MLP

#include <math.h>

#define EXP(x) (sizeof(cfem_real) == sizeof(float) ? (cfem_real)expf((float)(x)) : (cfem_real)exp((double)(x)))
#define TANH(x) (sizeof(cfem_real) == sizeof(float) ? (cfem_real)tanhf((float)(x)) : (cfem_real)tanh((double)(x)))

static cfem_real activate(cfem_real x) {
    if (CFEM_ACTIVATION == 0) return x > 0 ? x : 0; /* relu */
    return CFEM_ACTIVATION == 1 ? TANH(x) : /* silu */ x / (1 + EXP(-x));
}

/* Weights (inputs, outputs): in full, or as 16-bit integers in steps of each input's row. */
static void layer(const cfem_layer *l, const cfem_real *in, cfem_real *out) {
    for (int j = 0; j < l->outputs; j++) out[j] = l->bias[j];
    for (int i = 0; i < l->inputs; i++) {
        const long row = (long)i * l->outputs;
        if (in[i] == 0) continue;
        if (l->narrow) {
            const cfem_real x = in[i] * l->step[i];
            for (int j = 0; j < l->outputs; j++) out[j] += x * (cfem_real)l->narrow[row + j];
        } else {
            for (int j = 0; j < l->outputs; j++) out[j] += in[i] * l->weight[row + j];
        }
    }
}

void cfem_mlp(const double s[CFEM_MOST_NA], cfem_real out[CFEM_MOST_MLP_OUTPUTS]) {
    cfem_real hidden[2][CFEM_MOST_MLP_WIDTH];
    for (int i = 0; i < CFEM_NA; i++) hidden[0][i] = (cfem_real)s[i];
    for (int l = 0; l < CFEM_MLP_LAYERS; l++) {
        const cfem_layer *one = &cfem_layers[l];
        const int last = l == CFEM_MLP_LAYERS - 1;
        cfem_real *to = last ? out : hidden[(l + 1) % 2];
        layer(one, hidden[l % 2], to);
        if (!last)
            for (int j = 0; j < one->outputs; j++) to[j] = activate(to[j]);
    }
}

#endif
