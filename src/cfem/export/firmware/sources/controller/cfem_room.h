/* Room in memory: as much as the robot needs, whose sizes are constants of cfem_data.h. Code that takes its robot as data has room
 * for the largest, and says so in its own cfem_data.h. */
#ifndef CFEM_ROOM_H
#define CFEM_ROOM_H

#include "cfem_data.h"

enum { CFEM_KIND_SPECTRAL, CFEM_KIND_MLP, CFEM_KIND_SERIAL, CFEM_KIND_ROW };

#ifndef CFEM_MOST_NA
#define CFEM_MOST_NA CFEM_NA
#define CFEM_MOST_NE CFEM_NE
#define CFEM_MOST_HALVINGS CFEM_HALVINGS
#define CFEM_MOST_LATE CFEM_LATE
#define CFEM_MOST_SERIES_NA CFEM_SERIES_NA
#define CFEM_MOST_SERIES_NE CFEM_SERIES_NE
#define CFEM_MOST_SERIES_OUTPUTS CFEM_SERIES_OUTPUTS
#define CFEM_MOST_NZ CFEM_NZ
#define CFEM_MOST_DEGREE CFEM_DEGREE
#define CFEM_MOST_MODULES CFEM_MODULES
#define CFEM_MOST_MLP_WIDTH CFEM_MLP_WIDTH
#define CFEM_MOST_MLP_OUTPUTS CFEM_MLP_OUTPUTS
#define CFEM_KIND (CFEM_ROW ? CFEM_KIND_ROW : CFEM_SERIAL ? CFEM_KIND_SERIAL : CFEM_MLP ? CFEM_KIND_MLP : CFEM_KIND_SPECTRAL)
#endif

#endif
