/* ESP32 (WROOM module, Arduino core). SPDX-License-Identifier: MIT OR Apache-2.0
 *
 * UNTESTED: no board has run this, and no compiler for the ESP32 has seen it. So it has no motors.
 * An interrupt stamps every edge of the echo and encoder pins with the microsecond timer. */
#ifdef ARDUINO_ARCH_ESP32

#include "slamd_port.h"
#include "slamd_ring.h"
#include <Arduino.h>
#include <Preferences.h>
#include <esp_timer.h>
#include <soc/gpio_reg.h>
#include <soc/soc.h>
#include <string.h>

#define BAUD 115200
#define BYTE_US 87
#define SENDING 1024
#define STORE_LEN 96
#define SETTLE_US 50000UL /* after the last changed byte */

/* 34 to 39 are inputs only and have no pull-downs; the dividers on the echo lines are pull-downs enough. */
static const uint8_t echoes[SLAMD_PORT_SENSORS] = {34, 35, 36, 39, 32, 33, 25, 26};
static const uint8_t triggers[SLAMD_PORT_TRIGGER_LINES] = {16, 17, 18, 19};
static const uint8_t encoders[4] = {21, 22, 23, 27}; /* left A and B, right A and B */
#define LED 2

extern "C" {
const char slamd_port_board[] = "esp32";
}

static portMUX_TYPE mux = portMUX_INITIALIZER_UNLOCKED;
static struct slamd_edge edges[64];
static volatile uint8_t edge_in, edge_out;
static uint32_t last_levels;
static uint8_t last_encoders;
static volatile int32_t counts[2];

static Preferences preferences;
static uint8_t store[STORE_LEN];
static bool changed;
static uint32_t changed_us;

static inline bool IRAM_ATTR is_high(uint8_t pin, uint32_t low_pins, uint32_t high_pins) {
    return (pin < 32 ? low_pins >> pin : high_pins >> (pin - 32)) & 1;
}

static uint32_t IRAM_ATTR levels_of(uint32_t low_pins, uint32_t high_pins) {
    uint32_t levels = 0;
    for (uint8_t i = 0; i < SLAMD_PORT_SENSORS; i++) {
        if (is_high(echoes[i], low_pins, high_pins)) levels |= 1UL << i;
    }
    return levels;
}

static void IRAM_ATTR sample() {
    portENTER_CRITICAL_SAFE(&mux);
    uint32_t low_pins = REG_READ(GPIO_IN_REG), high_pins = REG_READ(GPIO_IN1_REG);
    uint32_t t_us = (uint32_t)esp_timer_get_time(), levels = levels_of(low_pins, high_pins);
    uint8_t now = 0, next = (edge_in + 1) & 63;
    for (uint8_t i = 0; i < 4; i++) now |= (uint8_t)(is_high(encoders[i], low_pins, high_pins) << i);
    /* If the queue is full, slamd_port_rest sees the change. */
    if (levels != last_levels && next != edge_out) {
        last_levels = levels;
        edges[edge_in].t_us = t_us;
        edges[edge_in].levels = levels;
        edge_in = next;
    }
    if (now != last_encoders) {
        counts[0] = counts[0] + slamd_quadrature_step(last_encoders, now);
        counts[1] = counts[1] + slamd_quadrature_step(last_encoders >> 2, now >> 2);
        last_encoders = now;
    }
    portEXIT_CRITICAL_SAFE(&mux);
}

extern "C" {

void slamd_port_begin(void) {
    for (uint8_t pin : triggers) {
        pinMode(pin, OUTPUT);
        digitalWrite(pin, LOW);
    }
    pinMode(LED, OUTPUT);
    for (uint8_t pin : echoes) pinMode(pin, pin < 34 ? INPUT_PULLDOWN : INPUT);
    for (uint8_t pin : encoders) pinMode(pin, INPUT_PULLUP);
    memset(store, 0xFF, sizeof store);
    preferences.begin("slamd", false);
    preferences.getBytes("store", store, sizeof store);
    Serial.setTxBufferSize(SENDING);
    Serial.begin(BAUD);
    sample();
    for (uint8_t pin : echoes) attachInterrupt(digitalPinToInterrupt(pin), sample, CHANGE);
    for (uint8_t pin : encoders) attachInterrupt(digitalPinToInterrupt(pin), sample, CHANGE);
}

uint32_t slamd_port_now_us(void) {
    return (uint32_t)esp_timer_get_time();
}

uint32_t slamd_port_levels(void) {
    return levels_of(REG_READ(GPIO_IN_REG), REG_READ(GPIO_IN1_REG));
}

bool slamd_port_next_edge(struct slamd_edge *edge) {
    uint8_t at = edge_out;
    if (at == edge_in) return false;
    *edge = edges[at];
    edge_out = (at + 1) & 63;
    return true;
}

void slamd_port_trigger(uint8_t lines) {
    static bool lit;
    lit = !lit;
    digitalWrite(LED, lit);
    for (uint8_t i = 0; i < SLAMD_PORT_TRIGGER_LINES; i++) {
        if (lines >> i & 1) digitalWrite(triggers[i], HIGH);
    }
    delayMicroseconds(10);
    for (uint8_t pin : triggers) digitalWrite(pin, LOW);
}

void slamd_port_ticks(int32_t ticks[2]) {
    portENTER_CRITICAL(&mux);
    ticks[0] = counts[0];
    ticks[1] = counts[1];
    portEXIT_CRITICAL(&mux);
}

/* The arrival is taken to be now: up to a millisecond or two late, because the driver of the core collects bytes. */
bool slamd_port_receive(uint8_t *byte, uint32_t *t_us) {
    int next = Serial.read();
    if (next < 0) return false;
    *byte = (uint8_t)next;
    *t_us = slamd_port_now_us();
    return true;
}

bool slamd_port_send(const uint8_t *bytes, uint16_t len) {
    if (Serial.availableForWrite() < len) return false;
    Serial.write(bytes, len);
    return true;
}

uint32_t slamd_port_send_delay_us(void) {
    int waiting = SENDING - Serial.availableForWrite();
    return waiting > 0 ? (uint32_t)waiting * BYTE_US : 0;
}

void slamd_port_motors(const int16_t duty[2]) {
    (void)duty;
}

bool slamd_port_emergency(void) {
    return false;
}

bool slamd_port_has_motors(void) {
    return false;
}

/* NVS keeps the last whole value over a power cut. It blocks for some milliseconds. */
void slamd_port_rest(void) {
    sample();
    if (changed && slamd_port_now_us() - changed_us >= SETTLE_US) {
        changed = false;
        preferences.putBytes("store", store, sizeof store);
    }
    delayMicroseconds(100);
}

uint8_t slamd_port_load(uint8_t at) {
    return store[at];
}

bool slamd_port_store(uint8_t at, uint8_t byte) {
    if (store[at] == byte) return true;
    store[at] = byte;
    changed = true;
    changed_us = slamd_port_now_us();
    return true;
}

void slamd_port_uid(uint8_t uid[8]) {
    uint64_t mac = ESP.getEfuseMac();
    for (uint8_t i = 0; i < 8; i++) uid[i] = (uint8_t)(mac >> 8 * i);
}

} /* extern "C" */

#endif
