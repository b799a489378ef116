/* Vectors and main of the RP2040. SPDX-License-Identifier: MIT OR Apache-2.0 */
#ifdef SLAMD_RP2040
#include "slamd_ring.h"

extern uint32_t __stack[], __bss[], __bss_end[];

void slamd_rp2040_sample(void); /* of port_rp2040.c */
void slamd_rp2040_tick(void);
void slamd_rp2040_uart(void);

/* rp2040/boot2.S has copied the image, with its variables, to the RAM. */
static void start(void) {
    for (uint32_t *word = __bss; word < __bss_end; word++) *word = 0;
    slamd_ring_begin();
    for (;;) slamd_ring_poll();
}

/* A fault. The watchdog resets the chip. */
static void stop(void) {
    for (;;) {
    }
}

#define IO_BANK0 (16 + 13)
#define UART0 (16 + 20)

__attribute__((section(".vectors"), used)) static void (*const vectors[16 + 26])(void) = {
    (void (*)(void))__stack, start,
    [2] = stop, [3] = stop, [11] = stop, [14] = stop,
    [15] = slamd_rp2040_tick,
    [IO_BANK0] = slamd_rp2040_sample,
    [UART0] = slamd_rp2040_uart,
};
#endif
