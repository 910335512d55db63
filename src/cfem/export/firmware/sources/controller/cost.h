/* What a call costs: nanoseconds on the PC, instructions on an emulated Cortex-M. */
#ifndef CFEM_COST_H
#define CFEM_COST_H

#include <stdint.h>

#if defined(__arm__)
/* MPS2: a timer of 25 MHz that counts down. Under qemu -icount shift=0 an instruction takes 1 ns, so a count is 40 of them. */
#define UNIT "instructions"
#define PER_COUNT 40
#define TIMER ((volatile uint32_t *)0x40000000u)
static uint64_t now(void) { return (uint64_t)(0xffffffffu - TIMER[1]) * PER_COUNT; }
static void start(void) { TIMER[1] = TIMER[2] = 0xffffffffu, TIMER[0] = 1u; }
#else
#include <time.h>
#define UNIT "ns"
static uint64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}
static void start(void) {}
#endif

#endif
