/* Starts a program on the Cortex-M4 and M7 boards that QEMU emulates (MPS2 AN386, AN500); output by semihosting. Only for
 * `make emulate`: your firmware has its own. */
#include <stdint.h>
#include <stdlib.h>

extern uint32_t stack_top[], bss_start[], bss_end[];
extern void initialise_monitor_handles(void);
extern int main(void);

void reset(void) {
    *(volatile uint32_t *)0xe000ed88u |= 0xfu << 20; /* the floating-point unit on */
    __asm volatile("dsb\nisb");
    for (uint32_t *p = bss_start; p < bss_end; p++) *p = 0;
    initialise_monitor_handles();
    exit(main());
}

static void fault(void) { exit(3); }

void _init(void) {}
void _fini(void) {}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    stack_top, (const void *)reset, (const void *)fault, (const void *)fault, (const void *)fault, (const void *)fault,
    (const void *)fault};
