/* Frames of bytes over a serial line or UDP, with a checksum; what follows a damaged frame is found again. No heap, no I/O.
 *
 *     0  c5 5c      a frame begins
 *     2  version    CFEM_WIRE_VERSION
 *     3  kind       below
 *     4  count      of floats, and 255 - count
 *     6  sequence   uint16: of the frames that this side has sent
 *     8  tick       uint32
 *    12  stamp      uint32: microseconds of the sender's clock
 *    16  payload    count floats
 *        checksum   uint16: CRC-16/CCITT (polynomial 1021, from ffff) of all from the version on
 *
 * Numbers have their lowest byte first, floats as of IEEE 754. docs/closed-loop.md says what each kind holds. */
#ifndef CFEM_WIRE_H
#define CFEM_WIRE_H

#include <stdint.h>

#include "cfem_data.h"

#define CFEM_WIRE_VERSION 1
#ifndef CFEM_WIRE_MOST
#define CFEM_WIRE_MOST (2 * (CFEM_NE + CFEM_NA) + 2) /* floats of a frame; longer ones are passed over. More for markers */
#endif
#define CFEM_WIRE_BYTES (18 + 4 * CFEM_WIRE_MOST)

#ifdef __cplusplus
extern "C" {
#endif

enum {
    CFEM_WIRE_HELLO = 1,        /* to the device: period of a tick (s), effectors at rest (n_e) */
    CFEM_WIRE_READY = 2,        /* from it: n_e, n_a, markers, CFEM_WIRE_TAKES_...; tick: checksum of the names of its rows */
    CFEM_WIRE_DISPLACEMENT = 3, /* to it: command (n_a); tick: its number */
    CFEM_WIRE_FORCE = 4,
    CFEM_WIRE_ANSWER = 5,       /* from it: x_e, delta_a, lambda_a, NAN where nothing measures them, then markers;
                                   tick: number of the command during which they were measured */
    CFEM_WIRE_GOAL = 6,         /* to one that runs the controller: goal (n_e), x_e (n_e); tick: of the command that x_e followed */
    CFEM_WIRE_COMMAND = 7,      /* from that: delta_a, lambda_a, status; tick: of this command */
    CFEM_WIRE_STOPPED = 8,      /* from it: it heard nothing for too long, and stopped; tick: of the last command */
    CFEM_WIRE_FAULT = 9,        /* from it: it cannot go on; tick: a number that its maker knows */
    CFEM_WIRE_BYE = 10          /* to it: release the robot */
};

enum { CFEM_WIRE_TAKES_DISPLACEMENT = 1, CFEM_WIRE_TAKES_FORCE = 2, CFEM_WIRE_TAKES_GOAL = 4 };

typedef struct {
    uint8_t version, kind, count;
    uint16_t sequence;
    uint32_t tick, stamp;
    float payload[CFEM_WIRE_MOST];
} cfem_wire_frame;

typedef struct {
    uint8_t bytes[CFEM_WIRE_BYTES];
    int filled;
    uint32_t skipped; /* bytes so far that are of no frame */
} cfem_wire_receiver;

/* CRC-16/CCITT of bytes. */
uint16_t cfem_wire_checksum(const uint8_t *bytes, int count);

/* Checksum of the names of the robot's rows. */
uint16_t cfem_wire_robot(void);

/* The bytes of a frame; how many there are. */
int cfem_wire_pack(const cfem_wire_frame *frame, uint8_t bytes[CFEM_WIRE_BYTES]);

void cfem_wire_init(cfem_wire_receiver *receiver);

/* Takes a byte. Ask for frames after each. */
void cfem_wire_put(cfem_wire_receiver *receiver, uint8_t byte);

/* 1 and the next frame that is there, 0 without one. */
int cfem_wire_next(cfem_wire_receiver *receiver, cfem_wire_frame *frame);

/* Gives up a frame that has begun, as no byte has come for a while: one may lie in what was taken for it. */
void cfem_wire_quiet(cfem_wire_receiver *receiver);

#ifdef __cplusplus
}
#endif
#endif
