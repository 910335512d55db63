/* For a page: bytes that are read one after another, and what its files share. */
#ifndef CFEM_PAGE_H
#define CFEM_PAGE_H

#include <stddef.h>

#include "cfem_linear.h"
#include "cfem_parts.h"

#define SERVED(name) __attribute__((export_name(#name))) cfem_page_##name

/* What the page reads and writes; the order is that of `FIELDS` in robot.js. */
typedef struct {
    double goal[CFEM_MOST_NE];
    double delta_a[CFEM_MOST_NA], lambda_a[CFEM_MOST_NA]; /* of the command, or of the actuators set by hand */
    double x_e[CFEM_MOST_NE];                             /* mm, absolute: where the model has the effectors */
    double skin[CFEM_MOST_SKIN];                          /* mm */
} cfem_page_shared;

extern cfem_page_shared cfem_io;

/* --- the block: numbers of four bytes, then of eight, then the series, as the lists of cfem_data.h declare them --------- */

typedef struct {
    const unsigned char *at, *end;
    int good;
} reader;

/* `size` bytes; what follows begins at a multiple of eight. */
static inline const void *take(reader *r, size_t size) {
    static const double nothing[CFEM_MOST_NZ * CFEM_MOST_NZ];
    const size_t padded = (size + 7) / 8 * 8;
    const unsigned char *found = r->at;
    if (padded > (size_t)(r->end - r->at)) {
        r->good = 0;
        return nothing;
    }
    r->at += padded;
    return found;
}

static inline void numbers(reader *r, double *to, int count) {
    const void *from = take(r, (size_t)count * sizeof *to);
    if (r->good) __builtin_memcpy(to, from, (size_t)count * sizeof *to);
}

static inline void integers(reader *r, int *to, int count) {
    const int32_t *from = take(r, (size_t)count * sizeof *from);
    for (int i = 0; r->good && i < count; i++) to[i] = from[i];
}

static inline int between(reader *r, int least, int value, int most) {
    r->good &= least <= value && value <= most;
    return r->good;
}

/* For these lists: the variables, and how they are read by `r`. */
#define DEFINE_COUNT(name, least, most, what) int name;
#define DEFINE_INTEGERS(name, room, size) int name[room];
#define DEFINE_VECTOR(name, room, size) double name[room];
#define DEFINE_MATRIX(name, rows_room, columns_room, rows, columns) double name[rows_room][columns_room];
#define ONE(name, least, most, what) +1
#define READ_COUNT(name, least, most, what) name = *head++, between(&r, least, name, most);
#define READ_INTEGERS(name, room, size) integers(&r, name, size);
#define READ_VECTOR(name, room, size) numbers(&r, name, size);
#define READ_MATRIX(name, rows_room, columns_room, rows, columns) \
    for (int i = 0; i < rows; i++) numbers(&r, name[i], columns);

#endif
