/* What a port to a microcontroller must provide. SPDX-License-Identifier: MIT OR Apache-2.0 */
#ifndef SLAMD_PORT_H
#define SLAMD_PORT_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Echo pins, at most 32, and trigger lines, at most 8: sensor i is on line i mod these. */
#ifdef SLAMD_RP2040
#define SLAMD_PORT_SENSORS 16
#define SLAMD_PORT_TRIGGER_LINES 4
#elif defined(ARDUINO_ARCH_ESP32)
#define SLAMD_PORT_SENSORS 8
#define SLAMD_PORT_TRIGGER_LINES 4
#else
#define SLAMD_PORT_SENSORS 32
#define SLAMD_PORT_TRIGGER_LINES 8
#endif

/* The levels of the echo pins from t_us on; bit i is sensor i. */
struct slamd_edge {
    uint32_t t_us;
    uint32_t levels;
};

void slamd_port_begin(void);
uint32_t slamd_port_now_us(void); /* wraps */

uint32_t slamd_port_levels(void);                  /* echo pins now */
bool slamd_port_next_edge(struct slamd_edge *edge); /* oldest change not yet taken */
void slamd_port_trigger(uint8_t lines);            /* 10 us high; bit l is trigger line l */
void slamd_port_ticks(int32_t ticks[2]);           /* quadrature counts, left connector first */

bool slamd_port_receive(uint8_t *byte, uint32_t *t_us); /* t_us: arrival; needed for zero bytes only */
bool slamd_port_send(const uint8_t *bytes, uint16_t len); /* all, or none if they do not fit */
uint32_t slamd_port_send_delay_us(void);            /* until a byte queued now leaves */

/* The motors' voltages, left first: -255 to 255 of the full one, 0 brakes. If it is not called for 120 ms, the port
 * brakes; before the first call, and in a reset, the motors are braked. */
void slamd_port_motors(const int16_t duty[2]);
bool slamd_port_emergency(void);                    /* the emergency pin is open */
bool slamd_port_has_motors(void);                   /* the two functions above do something */

void slamd_port_rest(void); /* sleeps at most 0.2 ms; nothing in the ring is more urgent */

uint8_t slamd_port_load(uint8_t at);             /* 96 non-volatile bytes, 0xFF when new */
/* Starts to write a changed byte; returns false while the last write is in progress. */
bool slamd_port_store(uint8_t at, uint8_t byte);

extern const char slamd_port_board[];            /* at most 16 bytes */
void slamd_port_uid(uint8_t uid[8]);             /* the chip's number; left as it is if there is none */

#ifdef __cplusplus
}
#endif
#endif
