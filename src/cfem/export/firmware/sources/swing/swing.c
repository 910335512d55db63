/* The filter of what moves along the frames of cfem_swing_vectors.h: `make test`, `make emulate`. */
#if !defined(__arm__)
#define _POSIX_C_SOURCE 200112L
#endif

#include "cfem_swing_vectors.h"

#define NAME "filter of what moves"
#define FILTER cfem_swing
#define FOUND cfem_swing_found
#define BEGIN cfem_swing_init
#define FRAME cfem_swing_frame
#define SCALE cfem_swing_scale
#define COUNTS(status) 1

#include "frames.h"
