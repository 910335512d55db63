/* Which patch is before which surface, of another robot or of its own: see cfem.contact.detection and cfem.contact.pairs. */
#ifndef CFEM_PAIRS_H
#define CFEM_PAIRS_H

#include "cfem_meet_data.h"
#include "cfem_touch.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CFEM_MEET_PATCHES (CFEM_MEET_ROBOTS * CFEM_PATCHES) /* robot after robot */
#define CFEM_MEET_PAIRS 128                                 /* that may be near at once */
#define CFEM_ROW_MOST 40                                    /* patches of one pair */

/* What a pair makes of the places of patches: weight 1 at its own, which is the first, and below 0 in sum -1 at those that it meets.
 * slot: number of the first. */
typedef struct {
    int slot, count, patch[CFEM_ROW_MOST];
    double weight[CFEM_ROW_MOST];
} cfem_row_of;

/* frame: rows n, t1, t2; gap mm; met: number of the robot that is met. */
typedef struct {
    cfem_row_of row;
    int met;
    double frame[3][3], gap;
} cfem_pair;

/* Where everything is. low, high: corners of a box around each robot; normal: of patches, where known. */
typedef struct {
    const cfem_placed *robots;
    double low[CFEM_MEET_ROBOTS][3], high[CFEM_MEET_ROBOTS][3], place[CFEM_MEET_PATCHES][3], normal[CFEM_MEET_PATCHES][3], rows[CFEM_MEET_ROBOTS][CFEM_PATCH_ROWS];
    unsigned char known[CFEM_MEET_PATCHES];
} cfem_around;

/* sum of weight place (3,) mm. */
void cfem_row_place(const cfem_row_of *row, double (*place)[3], double *found);

/* What patch p has before it; faces: it keeps these, whatever has become of them, or 0. 1: a pair; 0: none; -1: too many patches. */
int cfem_pair_of(cfem_around *around, int p, const cfem_row_of *faces, cfem_pair *pair);

#ifdef __cplusplus
}
#endif
#endif
