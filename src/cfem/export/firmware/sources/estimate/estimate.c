/* The estimator along the frames of cfem_estimate_vectors.h: `make test`, `make emulate`. */
#if !defined(__arm__)
#define _POSIX_C_SOURCE 200112L
#endif

#include "cfem_estimate_vectors.h"

#define NAME "estimator"
#define FILTER cfem_filter
#define FOUND cfem_estimate
#define BEGIN cfem_filter_init
#define FRAME cfem_filter_tick
#define SCALE cfem_estimate_scale
#define COUNTS(status) ((status) == 0u)

#include "frames.h"
