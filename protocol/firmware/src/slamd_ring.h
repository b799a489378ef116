/* A ring of HC-SR04 and two wheel encoders. SPDX-License-Identifier: MIT OR Apache-2.0 */
#ifndef SLAMD_RING_H
#define SLAMD_RING_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SLAMD_FIRMWARE_VERSION "0.2.0"

void slamd_ring_begin(void);
void slamd_ring_poll(void); /* call as often as possible; sleeps 0.2 ms at most */

/* The step between two readings of a quadrature encoder (bit 0 A, bit 1 B): A before B counts up. Two edges at once
 * have no direction and count as 0. */
static inline int8_t slamd_quadrature_step(uint8_t before, uint8_t now) {
    static const int8_t steps[16] = {0, 1, -1, 0, -1, 0, 0, 1, 1, 0, 0, -1, 0, -1, 1, 0};
    return steps[(before & 3) << 2 | (now & 3)];
}

#ifdef __cplusplus
}
#endif
#endif
