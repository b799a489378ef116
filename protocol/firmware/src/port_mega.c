/* Arduino Mega 2560. SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * Timer 1 interrupts every 25 us, reads all echo and encoder pins, and stores the changes. */
#ifdef __AVR_ATmega2560__

#include "slamd_port.h"
#include "slamd_ring.h"
#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/atomic.h>
#include <util/delay.h>

#define SAMPLE_US 25
#define BYTE_US 85 /* ten bits at 117647 baud, the nearest rate to 115200 that the crystal allows */

const char slamd_port_board[] = "mega2560";

static volatile uint32_t sampled_us;

static uint8_t last_a, last_c, last_l, last_k, last_d;

#define SLAMD_ATOMIC ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
#define SLAMD_ATOMIC_WORD SLAMD_ATOMIC
#define START_SENDING() (UCSR0B |= _BV(UDRIE0))
#include "slamd_queues.h"

static uint32_t packed(uint8_t a, uint8_t c, uint8_t l, uint8_t k) {
    return a | (uint32_t)c << 8 | (uint32_t)l << 16 | (uint32_t)k << 24;
}

/* Call with interrupts disabled. */
static uint32_t now_us(void) {
    uint32_t base = sampled_us;
    uint16_t count = TCNT1;
    if (TIFR1 & _BV(OCF1A)) {
        base += SAMPLE_US;
        count = TCNT1;
    }
    return base + (count >> 1);
}

ISR(TIMER1_COMPA_vect) {
    uint8_t a = PINA, c = PINC, l = PINL, k = PINK, d = PIND;
    sampled_us += SAMPLE_US;
    if (a != last_a || c != last_c || l != last_l || k != last_k) {
        uint8_t next = (edge_in + 1) & 63;
        /* If the queue is full, the next sample sees the change again. */
        if (next != edge_out) {
            last_a = a, last_c = c, last_l = l, last_k = k;
            edges[edge_in].t_us = sampled_us;
            edges[edge_in].levels = packed(a, c, l, k);
            edge_in = next;
        }
    }
    if ((d ^ last_d) & 0x0F) {
        counts[0] += slamd_quadrature_step(last_d, d);
        counts[1] += slamd_quadrature_step(last_d >> 2, d >> 2);
        last_d = d;
    }
}

ISR(USART0_RX_vect) {
    uint8_t byte = UDR0, next = (received_in + 1) & 127;
    if (next == received_out) return;
    received[received_in] = byte;
    received_in = next;
    if (byte == 0) {
        delimiter_us[delimiter_in & 15] = now_us();
        delimiter_in++;
    }
}

ISR(USART0_UDRE_vect) {
    if (sending_in == sending_out) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
        return;
    }
    UDR0 = sending[sending_out];
    sending_out = (sending_out + 1) & 1023;
}

/* Port H: enable of the left and the right bridge (D6, D7: PWM of timer 4) and their inputs, left D8, D9, right D16, D17.
 * Both inputs low and the bridge enabled: the motor is short-circuited. */
#define ENABLES (_BV(PH3) | _BV(PH4))
#define INPUTS (_BV(PH5) | _BV(PH6) | _BV(PH1) | _BV(PH0))

static void brake(void) {
    TCCR4A = _BV(WGM40); /* off the pins, which are high then */
    PORTH = (uint8_t)((PORTH & ~INPUTS) | ENABLES);
}

/* The control has not come for 120 ms. */
ISR(WDT_vect) {
    brake();
}

static void begin_motors(void) {
    brake();
    DDRH |= ENABLES | INPUTS;
    TCCR4B = _BV(WGM42) | _BV(CS41) | _BV(CS40); /* 8 bit, 977 Hz */
    wdt_reset();
    WDTCSR = _BV(WDCE) | _BV(WDE);
    WDTCSR = _BV(WDIE) | _BV(WDP1) | _BV(WDP0);
}

/* With interrupts disabled, because no half of a command may reach the bridges. */
void slamd_port_motors(const int16_t duty[2]) {
    static bool begun;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        uint8_t inputs = 0, pwm = _BV(WGM40);
        if (!begun) begin_motors();
        begun = true;
        wdt_reset();
        if (duty[0]) {
            inputs |= duty[0] > 0 ? _BV(PH5) : _BV(PH6);
            pwm |= _BV(COM4A1);
        }
        if (duty[1]) {
            inputs |= duty[1] > 0 ? _BV(PH1) : _BV(PH0);
            pwm |= _BV(COM4B1);
        }
        OCR4A = (uint8_t)(duty[0] > 0 ? duty[0] : -duty[0]);
        OCR4B = (uint8_t)(duty[1] > 0 ? duty[1] : -duty[1]);
        TCCR4A = pwm;
        PORTH = (uint8_t)((PORTH & ~INPUTS) | inputs);
    }
}

bool slamd_port_has_motors(void) {
    return true;
}

bool slamd_port_emergency(void) {
    return PINB & _BV(PB4);
}

void slamd_port_begin(void) {
    DDRF = 0xFF;
    DDRB |= _BV(PB7);
    PORTD |= 0x0F; /* pull-ups: many encoders have open-collector outputs */
    PORTB |= _BV(PB4); /* the emergency pin's: open is high */
    PORTF = 0;
    last_d = PIND;
    TCCR1A = 0;
    TCCR1B = _BV(WGM12) | _BV(CS11);
    OCR1A = SAMPLE_US * 2 - 1;
    TIMSK1 = _BV(OCIE1A);
    UCSR0A = _BV(U2X0);
    UBRR0 = 16;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
    set_sleep_mode(SLEEP_MODE_IDLE);
    sleep_enable();
    sei();
}

uint32_t slamd_port_now_us(void) {
    uint32_t us;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { us = now_us(); }
    return us;
}

uint32_t slamd_port_levels(void) {
    return packed(PINA, PINC, PINL, PINK);
}

void slamd_port_trigger(uint8_t lines) {
    PORTF = lines;
    PORTB ^= _BV(PB7);
    _delay_us(10);
    PORTF = 0;
}

/* The chip has no number of its own. */
void slamd_port_uid(uint8_t uid[8]) {
    (void)uid;
}

/* Each sleep ends with the next sample. */
void slamd_port_rest(void) {
    for (uint8_t i = 0; i < 8; i++) sleep_cpu();
}

uint8_t slamd_port_load(uint8_t at) {
    return eeprom_read_byte((const uint8_t *)(uintptr_t)at);
}

bool slamd_port_store(uint8_t at, uint8_t byte) {
    if (!eeprom_is_ready()) return false;
    eeprom_update_byte((uint8_t *)(uintptr_t)at, byte);
    return true;
}

#endif
