/* What drives a compiled export with good, bad and mixed inputs in turns, for the sanitisers. A file beside this one knows one kind of export:
 * it begins, and takes a tick of a phase. */
#ifndef DRIVER_H
#define DRIVER_H

#include <math.h>

enum { GOOD, BAD_SAMPLES, SOME_BAD_SAMPLES, BAD_GOALS, PHASES };
enum { ALIVE, LOST }; /* of a tick: whether it answers as it should to good inputs */

void begin(void);
int tick(long number, int phase);

double uniform(void); /* in [0, 1) */
double noise(double size); /* evenly within +-size */
double garbage(void); /* not finite, enormous, or of any size up to 1e9 */
double sample(double value, int phase); /* the value, or garbage: always among bad samples, three times in ten among some bad ones */
double goal(double value, int phase); /* the value, or garbage: three times in ten among bad goals */
void demand(int holds, const char *what); /* ends the program where it does not hold */
void demand_within(int count, const double *values, const double *low, const double *high, double slack, const char *what);

#endif
