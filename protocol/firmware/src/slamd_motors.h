/* Two motors with encoders that stand still unless they are told otherwise. SPDX-License-Identifier: MIT OR Apache-2.0 */
#ifndef SLAMD_MOTORS_H
#define SLAMD_MOTORS_H

#include <stdbool.h>
#include <stdint.h>

#define SLAMD_SILENCE_US 250000UL /* without a frame of the host, the motors stop */

/* What a sensor last told about the space before it. */
struct slamd_view {
    bool tells;        /* false: stuck, mute, or not yet fired */
    uint16_t range_mm; /* from the sensor; UINT16_MAX: nothing in range */
};

int32_t slamd_setting(uint8_t key); /* of slamd_ring.c */

void slamd_motors_stop(void);             /* STOP, START, boot: idle, braked */
void slamd_motors_heard(uint32_t now_us); /* a valid frame of the host arrived */
void slamd_motors_drive(const int16_t mm_s[2], uint16_t valid_ms, uint32_t now_us);
void slamd_motors_see(uint8_t sensor, struct slamd_view view);
/* Controls the motors once per 10 ms. Returns true if the state has changed. */
bool slamd_motors_poll(uint32_t now_us, const int32_t ticks[2]);

bool slamd_motors_are_known(void); /* a DRIVE came since the start: MOTION is wanted */
uint8_t slamd_motors_state(void);  /* enum slamd_motion */
void slamd_motors_speeds(int16_t commanded_mm_s[2], int16_t measured_mm_s[2]);

#endif
