/* Frames to bytes, and bytes to frames. */
#include "cfem_wire.h"

#include <string.h>

enum { FIRST = 0xc5, SECOND = 0x5c, HEAD = 16, LENGTHS = 6, CHECKED = 2 }; /* LENGTHS: bytes that tell a frame's length */

static const char rows[] = CFEM_EFFECTORS "\n" CFEM_ACTUATORS;

uint16_t cfem_wire_checksum(const uint8_t *bytes, int count) {
    uint16_t sum = 0xffff;
    for (int i = 0; i < count; i++) {
        sum ^= (uint16_t)(bytes[i] << 8);
        for (int bit = 0; bit < 8; bit++) sum = (uint16_t)(sum & 0x8000 ? sum << 1 ^ 0x1021 : sum << 1);
    }
    return sum;
}

uint16_t cfem_wire_robot(void) { return cfem_wire_checksum((const uint8_t *)rows, (int)sizeof rows - 1); }

static void put_bytes(uint8_t *to, uint32_t value, int bytes) {
    for (int i = 0; i < bytes; i++) to[i] = (uint8_t)(value >> 8 * i);
}

static uint32_t get_bytes(const uint8_t *from, int bytes) {
    uint32_t value = 0;
    for (int i = 0; i < bytes; i++) value |= (uint32_t)from[i] << 8 * i;
    return value;
}

int cfem_wire_pack(const cfem_wire_frame *frame, uint8_t bytes[CFEM_WIRE_BYTES]) {
    const int count = frame->count < CFEM_WIRE_MOST ? frame->count : CFEM_WIRE_MOST, end = HEAD + 4 * count;
    bytes[0] = FIRST, bytes[1] = SECOND, bytes[2] = frame->version, bytes[3] = frame->kind;
    bytes[4] = (uint8_t)count, bytes[5] = (uint8_t)(255 - count);
    put_bytes(bytes + 6, frame->sequence, 2), put_bytes(bytes + 8, frame->tick, 4), put_bytes(bytes + 12, frame->stamp, 4);
    for (int i = 0; i < count; i++) {
        uint32_t bits;
        memcpy(&bits, &frame->payload[i], sizeof bits);
        put_bytes(bytes + HEAD + 4 * i, bits, 4);
    }
    put_bytes(bytes + end, cfem_wire_checksum(bytes + CHECKED, end - CHECKED), 2);
    return end + 2;
}

void cfem_wire_init(cfem_wire_receiver *receiver) { memset(receiver, 0, sizeof *receiver); }

static void drop(cfem_wire_receiver *r, int count) {
    r->filled -= count;
    memmove(r->bytes, r->bytes + count, (size_t)r->filled);
}

void cfem_wire_put(cfem_wire_receiver *receiver, uint8_t byte) {
    if (receiver->filled == CFEM_WIRE_BYTES) drop(receiver, 1), receiver->skipped++;
    receiver->bytes[receiver->filled++] = byte;
}

/* Bytes of the frame that begins here, 0 where none does; more than `filled` where that is not known yet. */
static int frame_length(const uint8_t *bytes, int filled) {
    if (bytes[0] != FIRST || (filled > 1 && bytes[1] != SECOND)) return 0;
    if (filled < LENGTHS) return LENGTHS;
    return bytes[4] + bytes[5] == 255 && bytes[4] <= CFEM_WIRE_MOST ? HEAD + 4 * bytes[4] + 2 : 0;
}

int cfem_wire_next(cfem_wire_receiver *receiver, cfem_wire_frame *frame) {
    const uint8_t *from = receiver->bytes;
    int left = receiver->filled, found = 0;
    for (; left; from++, left--) {
        const int length = frame_length(from, left);
        if (length > left) break;
        if (!length || get_bytes(from + length - 2, 2) != cfem_wire_checksum(from + CHECKED, length - 2 - CHECKED)) continue;
        found = length;
        frame->version = from[2], frame->kind = from[3], frame->count = from[4];
        frame->sequence = (uint16_t)get_bytes(from + 6, 2), frame->tick = get_bytes(from + 8, 4), frame->stamp = get_bytes(from + 12, 4);
        for (int i = 0; i < frame->count; i++) {
            const uint32_t bits = get_bytes(from + HEAD + 4 * i, 4);
            memcpy(&frame->payload[i], &bits, sizeof bits);
        }
        break;
    }
    receiver->skipped += (uint32_t)(receiver->filled - left);
    drop(receiver, receiver->filled - left + found);
    return found > 0;
}

void cfem_wire_quiet(cfem_wire_receiver *receiver) {
    if (receiver->filled) drop(receiver, 1), receiver->skipped++;
}
