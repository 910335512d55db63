/* An example: firmware at the other end of a wire. Bytes come in; a goal makes a step of the controller, a command of cfem control is
 * kept within the robot's bounds; the answer goes out. Without either for three ticks it stops. Replace what is marked. On the PC
 * the bytes are those of standard input and output, on an emulated Cortex-M those of its UART:
 *
 *     make wire && socat PTY,raw,echo=0,link=/tmp/robot EXEC:./wire        device: {kind: serial, port: /tmp/robot} */
#if !defined(__arm__)
#define _POSIX_C_SOURCE 200112L
#include <poll.h>
#include <unistd.h>
#endif

#include <math.h>
#include <string.h>

#include "cfem_parts.h"
#include "cfem_wire.h"
#include "cost.h"

#define PATIENCE 2.5 /* ticks without a command: it stops before the third ends */

static cfem_controller controller;
static cfem_input input;
static cfem_output output;
static cfem_wire_receiver receiver;
static cfem_wire_frame in, out;
static uint32_t tick;         /* of the last command */
static uint16_t last;         /* sequence of the last frame that was heeded */
static uint8_t said[CFEM_WIRE_BYTES]; /* the last frame that was sent, */
static int length;                    /* and its bytes */
static int greeted, running;  /* hello was said; commands come */
static uint64_t heard, quiet; /* ns: when the last command came, and the last byte */
static uint64_t period;       /* ns of a tick */

/* ---- Yours: drives and sensors. Here the model stands in for the robot. ---- */

static double command[CFEM_NA]; /* mm (mm^3), or N (MPa) with CFEM_COMMAND_FORCE */

static void command_actuators(const double *u) { memcpy(command, u, sizeof command); }

static void release_actuators(void) { /* vents, or holds: what is safe */
    for (int i = 0; i < CFEM_NA; i++) command[i] = CFEM_COMMAND_FORCE ? 0.0 : cfem_home[i];
}

/* Effectors, absolute, and actuators; NAN what nothing measures. */
static void measure(float *x_e, float *delta_a, float *lambda_a) {
    static cfem_condensed m;
    static double s[CFEM_NA];
    unsigned status;
    if (CFEM_COMMAND_FORCE != CFEM_FORM_DISPLACEMENT) { /* what is commanded is what the model takes */
        memcpy(s, command, sizeof s);
        status = cfem_model(s, &m);
    } else
        status = cfem_find(command, s, &m);
    for (int e = 0; e < CFEM_NE; e++) {
        double x = cfem_rest_e[e] + m.free_e[e];
        for (int i = 0; i < CFEM_NA; i++) x += m.W_ea[e][i] * m.lambda_a[i];
        x_e[e] = status ? NAN : (float)x;
    }
    for (int i = 0; i < CFEM_NA; i++) delta_a[i] = status ? NAN : (float)m.delta_a[i], lambda_a[i] = status ? NAN : (float)m.lambda_a[i];
}

/* ---- Yours: bytes and clock. ---- */

#if defined(__arm__) /* UART and timer of the MPS2 boards that QEMU emulates; on a board, receive by interrupt */
#define UART ((volatile uint32_t *)0x40004000u)
#define SYSTEM(address) (*(volatile uint32_t *)(0xe000e000u + (address)))
static void begin(void) {
    start();
    UART[4] = 16, UART[2] = 1 | 2 | 8;         /* speed; sends, receives, and interrupts for what is received */
    SYSTEM(0x100) = 1;                         /* that interrupt is on, */
    SYSTEM(0x14) = 24999, SYSTEM(0x10) = 7;    /* and that of a millisecond; */
    __asm volatile("cpsid i");                 /* they wake, and call nothing */
}
static int read_bytes(uint8_t *bytes, int most) {
    int count = 0;
    if (!(UART[1] & 2)) __asm volatile("wfi");
    UART[3] = 2, SYSTEM(0x280) = 1, SYSTEM(0xd04) = 1u << 25; /* no longer pending */
    for (; count < most && UART[1] & 2; count++) bytes[count] = (uint8_t)UART[0];
    return count;
}
static void write_bytes(const uint8_t *bytes, int count) {
    for (int i = 0; i < count; i++) {
        while (UART[1] & 1) {}
        UART[0] = bytes[i];
    }
}
static uint64_t clock_ns(void) { /* the timer begins again after 171 s */
    static uint64_t total;
    static uint32_t before;
    const uint32_t counts = (uint32_t)(now() / PER_COUNT);
    total += counts - before, before = counts;
    return total * PER_COUNT;
}
#else
static void begin(void) { start(); }
static int read_bytes(uint8_t *bytes, int most) { /* -1: the other end is closed */
    struct pollfd wire = {0, POLLIN, 0};
    if (!poll(&wire, 1, 1)) return 0;
    const int count = (int)read(0, bytes, (size_t)most);
    return count > 0 ? count : -1;
}
static void write_bytes(const uint8_t *bytes, int count) {
    if (write(1, bytes, (size_t)count) != count) greeted = 0;
}
static uint64_t clock_ns(void) { return now(); }
#endif

/* ---- The robot's side of the wire. ---- */

static void say(uint8_t kind, uint32_t number, int count) {
    out.version = CFEM_WIRE_VERSION, out.kind = kind, out.count = (uint8_t)count, out.tick = number;
    out.stamp = (uint32_t)(clock_ns() / 1000);
    length = cfem_wire_pack(&out, said);
    write_bytes(said, length);
    out.sequence++;
}

static void stop(void) {
    release_actuators();
    running = 0;
    cfem_init(&controller);
    memset(&input, 0, sizeof input), memset(&output, 0, sizeof output);
    for (int i = 0; i < CFEM_NA; i++) input.delta_a[i] = (cfem_real)controller.delta_a[i];
}

static double within(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

/* A command of the PC, within the bounds and the rate that the controller was exported with. 0 where it is no number. */
static int follow(const float *u) {
    const double *low = CFEM_COMMAND_FORCE ? cfem_lambda_low : cfem_delta_low;
    const double *high = CFEM_COMMAND_FORCE ? cfem_lambda_high : cfem_delta_high;
    const double *rate = CFEM_COMMAND_FORCE ? cfem_lambda_rate : cfem_delta_rate;
    double next[CFEM_NA];
    for (int i = 0; i < CFEM_NA; i++) {
        if (!isfinite(u[i])) return 0;
        next[i] = within(within(u[i], command[i] - rate[i], command[i] + rate[i]), low[i], high[i]);
    }
    command_actuators(next);
    return 1;
}

/* A step of the controller towards a goal; the answer. */
static void step(void) {
    double next[CFEM_NA];
    int seen = 1;
    for (int e = 0; e < CFEM_NE; e++) {
        input.goal[e] = in.payload[e];
        input.x_e[e] = in.payload[CFEM_NE + e];
        seen &= isfinite(in.payload[CFEM_NE + e]) != 0;
    }
    input.tick = seen ? in.tick : 0;
    const unsigned status = cfem_step(&controller, &input, &output);
    for (int i = 0; i < CFEM_NA; i++) {
        next[i] = CFEM_COMMAND_FORCE ? output.lambda_a[i] : output.delta_a[i];
        out.payload[i] = (float)output.delta_a[i], out.payload[CFEM_NA + i] = (float)output.lambda_a[i];
        input.delta_a[i] = output.delta_a[i]; /* yours: encoders, if the observer reads them */
    }
    command_actuators(next);
    out.payload[2 * CFEM_NA] = (float)status;
    tick = output.tick;
    say(CFEM_WIRE_COMMAND, tick, 2 * CFEM_NA + 1);
}

static void heed(void) {
    const int direct = CFEM_COMMAND_FORCE ? CFEM_WIRE_FORCE : CFEM_WIRE_DISPLACEMENT;
    if (in.kind == CFEM_WIRE_HELLO && in.count == 1 + CFEM_NE && in.payload[0] > 0 && in.payload[0] < 60) {
        stop();
        greeted = 1, last = in.sequence, tick = 0;
        period = (uint64_t)(1e9 * in.payload[0]);
        out.payload[0] = CFEM_NE, out.payload[1] = CFEM_NA, out.payload[2] = 0;
        out.payload[3] = CFEM_WIRE_TAKES_GOAL + (CFEM_COMMAND_FORCE ? CFEM_WIRE_TAKES_FORCE : CFEM_WIRE_TAKES_DISPLACEMENT);
        say(CFEM_WIRE_READY, cfem_wire_robot(), 4);
        return;
    }
    const int goal = in.kind == CFEM_WIRE_GOAL && in.count == 2 * CFEM_NE;
    const int order = in.kind == direct && in.count == CFEM_NA, bye = in.kind == CFEM_WIRE_BYE && !in.count;
    if (in.version != CFEM_WIRE_VERSION || !greeted || !(goal || order || bye)) return;
    if (running && in.sequence == last) { /* it came before, and the answer was lost */
        write_bytes(said, length);
        return;
    }
    if (running && (int16_t)(in.sequence - last) < 0) return; /* it comes too late */
    if (bye) {
        stop();
        greeted = 0;
        return;
    }
    if (order && !follow(in.payload)) return;
    last = in.sequence, running = 1, heard = clock_ns();
    if (goal) {
        step();
        return;
    }
    tick = in.tick;
    measure(out.payload, out.payload + CFEM_NE, out.payload + CFEM_NE + CFEM_NA);
    say(CFEM_WIRE_ANSWER, tick, CFEM_NE + 2 * CFEM_NA);
}

int main(void) {
    uint8_t bytes[64];
    int count;
    begin();
    stop();
    cfem_wire_init(&receiver);
    while ((count = read_bytes(bytes, (int)sizeof bytes)) >= 0) {
        const uint64_t t = clock_ns();
        for (int i = 0; i < count; i++) {
            cfem_wire_put(&receiver, bytes[i]);
            while (cfem_wire_next(&receiver, &in)) heed();
        }
        if (count) quiet = t;
        if (greeted && t - quiet > period) { /* what has begun does not end */
            cfem_wire_quiet(&receiver);
            while (cfem_wire_next(&receiver, &in)) heed();
        }
        if (running && (double)(clock_ns() - heard) > PATIENCE * (double)period) {
            stop();
            say(CFEM_WIRE_STOPPED, tick, 0);
        }
    }
    release_actuators();
    return 0;
}
